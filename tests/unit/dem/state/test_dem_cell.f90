!> Periodic cell: short edges of a lattice, maps of a step, no pair over a face missed in a sheared
!! cell, momentum and energy in a strained cell of colliding grains, restart, threads, tiles.
program test_dem_cell
  use omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_homogenise, only: inverse_of
  use talus_sample, only: sample_type
  use talus_test, only: max_abs, test_type
  use dem_archive, only: dem_archive_type
  use dem_cell, only: set_cell, advance_cell, reduced_basis, least_width, cell_volume, folded, &
    determinant
  use dem_cell_stress, only: cell_stress
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_measure, only: momentum_of, stress_of
  use dem_sample, only: fill_sample
  use dem_state, only: dem_cell_type, kind_free
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_tiles, only: tile
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 1.0e-3_wp
  integer(i4), parameter :: n = 60
  real(wp), parameter :: slanted(3, 3) = reshape( &
    [8.0e-3_wp, 0.0_wp, 0.0_wp, 11.0e-3_wp, 9.0e-3_wp, 0.0_wp, -7.0e-3_wp, 5.0e-3_wp, &
     8.5e-3_wp], [3, 3])

  call check_basis()
  call check_advance()
  call check_pairs()
  call check_motion()
  call check_restart()
  call check_threads()
  call test%finish()

contains

  !> A cube that was sheared by 7.3 has the short edges of a cube that was sheared by 0.3.
  subroutine check_basis()
    type(dem_cell_type) :: cell
    real(wp) :: h(3, 3), edges(3, 3), x(3, 2)
    integer(i4) :: whole(3, 3)

    edges = 0.0_wp
    edges(1, 1) = 1.0_wp
    edges(2, 2) = 1.0_wp
    edges(3, 3) = 1.0_wp
    edges(1, 2) = 7.3_wp
    call set_cell(cell, [0.0_wp, 0.0_wp, 0.0_wp], edges, [.true., .true., .true.])
    call reduced_basis(cell, h, whole)
    call test%check_close('short edge', norm2(h(:, 2)), norm2([0.3_wp, 1.0_wp]), 1.0e-14_wp)
    call test%check_close('same volume', determinant(h), cell_volume(cell), 1.0e-14_wp)
    call test%check_close('width of the sheared cube', least_width(cell), &
                          1.0_wp/norm2([0.3_wp, 1.0_wp]), 1.0e-14_wp)
    cell%periodic = [.true., .false., .true.]
    call reduced_basis(cell, h, whole)
    call test%check_close('what is not periodic stays', h(1, 2), 7.3_wp, 0.0_wp)
    cell%periodic = .true.
    x(:, 1) = [7.5_wp, 1.1_wp, -0.2_wp]
    x(:, 2) = [0.1_wp, 0.01_wp, 0.5_wp]
    x = folded(cell, x)
    call test%check_all_close('folded back', x(:, 1), [0.2_wp + 1.0_wp, 0.1_wp, 0.8_wp], &
                          1.0e-14_wp)
    call test%check_close('left in place', x(2, 2), 0.01_wp, 0.0_wp)
  end subroutine check_basis

  !> Simple shear keeps the volume and is exact; a rotation keeps all lengths; compression changes
  !! with the exponential to third order in the step.
  subroutine check_advance()
    type(dem_cell_type) :: cell
    real(wp), parameter :: dt = 1.0e-3_wp
    integer(i4) :: k

    call set_cell(cell, [0.0_wp, 0.0_wp, 0.0_wp], slanted, [.true., .true., .true.])
    cell%rate(1, 3) = 2.0_wp
    do k = 1, 1000
      call advance_cell(cell, dt)
    end do
    call test%check_close('shear by 2', cell%vectors(1, 3), slanted(1, 3) + 2.0_wp*slanted(3, 3), &
                          1.0e-15_wp)
    call test%check_close('nothing else', cell%vectors(1, 2), slanted(1, 2), 0.0_wp)
    call set_cell(cell, [0.0_wp, 0.0_wp, 0.0_wp], slanted, [.true., .true., .true.])
    cell%rate(1, 3) = 2.0_wp
    cell%rate(3, 1) = -2.0_wp
    do k = 1, 1000
      call advance_cell(cell, dt)
    end do
    call test%check_close('rotation keeps lengths', norm2(cell%vectors(:, 3)), &
                          norm2(slanted(:, 3)), 1.0e-15_wp)
    call test%check_all_close('back undoes step', matmul(cell%back, cell%vectors) &
                          + dt*cell%speed, cell%vectors, 1.0e-15_wp)
    call set_cell(cell, [0.0_wp, 0.0_wp, 0.0_wp], slanted, [.true., .true., .true.])
    cell%rate(2, 2) = -1.0_wp
    do k = 1, 1000
      call advance_cell(cell, dt)
    end do
    call test%check_close('compression', cell%vectors(2, 2)/slanted(2, 2), exp(-1.0_wp), 1.0e-7_wp)
  end subroutine check_advance

  !> Grains at random places of the slanted cell, or (apart) around those of a lattice; some moved
  !! by whole edges.
  subroutine make_system(s, seed, speed, size_of, apart, errors)
    type(dem_system_type), intent(out) :: s
    real(wp), intent(in) :: speed, size_of
    integer(i4), intent(in) :: seed
    logical, intent(in) :: apart
    type(error_list_type), intent(inout) :: errors
    real(wp) :: x(3, n), q(4, n), v(3, n), axes(3, n), noise(3)
    integer(i4) :: k, word
    integer(i8) :: state

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%materials(1)%young = 1.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    state = seed
    do k = 1, n
      do word = 1, 3
        noise(word) = next(state)
      end do
      if (apart) noise = (real([mod(k, 4), mod(k/4, 4), k/16], wp) + 0.2_wp*noise)/4.0_wp
      x(:, k) = matmul(slanted, noise + real(mod(k, 3) - 1, wp)*[1.0_wp, 0.0_wp, -1.0_wp])
      do word = 1, 3
        v(word, k) = speed*(2.0_wp*next(state) - 1.0_wp)
        axes(word, k) = size_of*(0.8_wp + 0.2_wp*next(state))
      end do
      q(:, k) = [1.0_wp, next(state), next(state), next(state)]
      q(:, k) = q(:, k)/norm2(q(:, k))
    end do
    call make_grains(s%grains, s%materials, [(int(k, i8), k=1, n)], spread(kind_free, 1, n), &
                     spread(1_i4, 1, n), x, q, axes, v, 0.0_wp*v, errors)
    call set_cell(s%cell, [0.0_wp, 0.0_wp, 0.0_wp], slanted, [.true., .true., .true.])
    s%par%overlap_limit = 2.0_wp
  end subroutine make_system

  !> Numbers from 0 to 1 (a linear congruence).
  real(wp) function next(state)
    integer(i8), intent(inout) :: state
    state = modulo(1103515245_i8*state + 12345_i8, 2147483648_i8)
    next = real(state, wp)/2147483648.0_wp
  end function next

  !> Contacts of a slanted cell against those with 7 x 7 x 7 images of everything.
  subroutine check_pairs()
    type(dem_system_type) :: s
    type(dem_contacts_type) :: list
    type(error_list_type) :: errors
    integer(i4) :: many, k
    real(wp) :: sigma(3, 3), stiffness(10)

    call make_system(s, 5, 0.0_wp, 0.8_wp*radius, .false., errors)
    s%par%dt = 1.0e-7_wp
    call s%init(errors)
    call s%contacts(list)
    call brute_force(s, many)
    call test%check('there are contacts over faces', s%pairs%images > 20)
    call test%check('no contact is missed', list%n == many)
    call test%check('no faults', .not. errors%any())
    call cell_stress(s%dem_data_type, sigma, stiffness)
    call test%check_all_close('one stress', sigma, stress_of(s%dem_data_type, &
                              cell_volume(s%cell)), 1.0e-14_wp*max_abs(sigma))
    do k = 1, 3
      call test%check_close('forces cancel', sum(s%grains%force(k, :)) &
                            /max_abs(s%grains%force), 0.0_wp, 1.0e-12_wp)
    end do
    call check_regions(s, list)
  end subroutine check_pairs

  !> Contacts found by trying every image, through the search of a huge box without cell.
  subroutine brute_force(s, many)
    type(dem_system_type), intent(in) :: s
    integer(i4), intent(out) :: many
    type(dem_system_type) :: all
    type(dem_contacts_type) :: list
    type(error_list_type) :: errors
    integer(i4), parameter :: side = 7, copies = side**3
    real(wp), allocatable :: x(:, :), q(:, :), axes(:, :)
    integer(i4) :: k, c, at(3), whole(3, 3)
    real(wp) :: h(3, 3), inside(3, n)

    allocate (x(3, n*copies), q(4, n*copies), axes(3, n*copies))
    call reduced_basis(s%cell, h, whole)
    inside = folded(s%cell, s%grains%x)
    do c = 0, copies - 1
      ! copy 0 is the cell itself
      at = modulo([mod(c, side), mod(c/side, side), c/side**2] + 3, side) - 3
      do k = 1, n
        x(:, c*n + k) = inside(:, k) + matmul(h, real(at, wp))
        q(:, c*n + k) = s%grains%quat(:, k)
        axes(:, c*n + k) = s%grains%axes(:, k)
      end do
    end do
    all%materials = s%materials
    all%laws = s%laws
    all%par = s%par
    call make_grains(all%grains, all%materials, [(int(k, i8), k=1, n*copies)], &
                     spread(kind_free, 1, n*copies), spread(1_i4, 1, n*copies), x, q, axes, &
                     0.0_wp*x, 0.0_wp*x, errors)
    call all%init(errors)
    call all%contacts(list)
    many = 0
    do k = 1, list%n
      if (list%ids(1, k) > n) cycle
      if (list%ids(2, k) <= n) many = many + 2
      if (list%ids(2, k) > n) many = many + 1
    end do
    many = many/2
  end subroutine brute_force

  !> A box in the cell finds the images that reach into it: against a box around everything.
  subroutine check_regions(s, list)
    type(dem_system_type), intent(in) :: s
    type(dem_contacts_type), intent(in) :: list
    type(sample_type) :: sample, tiled
    type(error_list_type) :: errors
    real(wp) :: far(3), near(3)
    integer(i4) :: c, worst

    call fill_sample(s, list, sample, errors)
    worst = 0
    do c = 1, list%n
      far = sample%far_end(c) - sample%start(:, c)
      near = list%branch(:, c)
      if (norm2(far - near) > 1.0e-12_wp) worst = worst + 1
    end do
    call test%check('branches of the sample', worst == 0)
    call test%check_close('volume', sample%cell_volume, determinant(slanted), 1.0e-20_wp)
    call tile(sample, s%cell, [-20.0e-3_wp, -20.0e-3_wp, -20.0e-3_wp], &
              [20.0e-3_wp, 20.0e-3_wp, 20.0e-3_wp], tiled)
    ! 64 cm^3 hold so many cells, and as many grains and contacts in the mean
    call test%check_close('grains of the tiles', tiled%n*determinant(slanted)/64.0e-6_wp/60.0_wp, &
                          1.0_wp, 0.03_wp)
    worst = 0
    do c = 1, tiled%contacts
      if (norm2(tiled%far_end(c) - tiled%start(:, c)) > 2.0_wp*radius) worst = worst + 1
    end do
    call test%check('branches of the tiles', worst == 0)
  end subroutine check_regions

  !> Grains that collide while the cell is sheared and stretched: momentum is kept, and the ledger
  !! closes with the square of the step.
  subroutine check_motion()
    real(wp) :: error(2)
    error(1) = closure_after(1.0e-7_wp, 4000)
    error(2) = closure_after(0.5e-7_wp, 8000)
    call test%check('the ledger closes', error(2) < 1.0e-4_wp)
    call test%check('with the order of the step', error(2) < 0.3_wp*error(1))
  end subroutine check_motion

  real(wp) function closure_after(dt, steps) result(error)
    real(wp), intent(in) :: dt
    integer(i4), intent(in) :: steps
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: before(3), after(3), scale

    call make_system(s, 5, 2.0_wp, 0.95_wp*radius, .true., errors)
    s%par%dt = dt
    s%cell%rate(1, 3) = 2000.0_wp
    call s%init(errors)
    before = momentum_of(s%dem_data_type)
    call s%step(steps, errors)
    call test%check('no faults', .not. errors%any())
    after = momentum_of(s%dem_data_type)
    scale = sum(s%grains%mass)*2.0_wp
    call test%check_close('momentum across the shear', norm2(after(2:) - before(2:))/scale, &
                          0.0_wp, 1.0e-12_wp)
    call test%check_close('momentum along it, relative to the flow', &
                          (after(1) - before(1) + 2000.0_wp*steps*dt*before(3))/scale, 0.0_wp, &
                          1.0e-12_wp)
    call s%refresh_ledger()
    call test%check('the flow does work', s%ledger%boundary > 0.01_wp*s%ledger%start)
    error = abs(s%closure())/s%ledger%start
  end function closure_after

  !> Export and import in a strained cell: the same bits later on.
  subroutine check_restart()
    type(dem_system_type) :: whole, first, second
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors

    call make_system(whole, 9, 2.0_wp, 0.95_wp*radius, .true., errors)
    whole%par%dt = 1.0e-7_wp
    whole%cell%rate(1, 3) = 2000.0_wp
    whole%cell%rate(2, 2) = -100.0_wp
    first = whole
    second = whole
    call whole%init(errors)
    call whole%step(3000, errors)
    call first%init(errors)
    call first%step(1300, errors)
    call first%export_state(archive)
    call second%import_state(archive, errors)
    call second%step(1700, errors)
    call test%check('no faults', .not. errors%any())
    call test%check('lists were rebuilt', second%health%rebuilds > 2)
    call test%check('same places', all(abs(whole%grains%x - second%grains%x) <= 0.0_wp))
    call test%check('same velocities', all(abs(whole%grains%v - second%grains%v) <= 0.0_wp))
    call test%check('same cell', all(abs(whole%cell%vectors - second%cell%vectors) <= 0.0_wp))
    call test%check('same ledger', abs(whole%ledger%boundary - second%ledger%boundary) <= 0.0_wp)
  end subroutine check_restart

  !> One thread and three: the same bits after lists were rebuilt in a strained cell.
  subroutine check_threads()
    type(dem_system_type) :: one, three
    type(error_list_type) :: errors

    call make_system(one, 11, 2.0_wp, 0.95_wp*radius, .true., errors)
    one%par%dt = 1.0e-7_wp
    one%cell%rate(1, 3) = 300.0_wp
    one%cell%rate(2, 2) = -100.0_wp
    three = one
    call omp_set_num_threads(1)
    call one%init(errors)
    call one%step(2000, errors)
    call omp_set_num_threads(3)
    call three%init(errors)
    call three%step(2000, errors)
    call test%check('no faults', .not. errors%any())
    call test%check('lists were rebuilt', three%health%rebuilds > 2)
    call test%check('places of three threads', all(abs(one%grains%x - three%grains%x) <= 0.0_wp))
    call test%check('spins of three threads', &
                    all(abs(one%grains%omega - three%grains%omega) <= 0.0_wp))
    call test%check('work of three threads', &
                    abs(one%ledger%boundary - three%ledger%boundary) <= 0.0_wp)
  end subroutine check_threads
end program test_dem_cell
