!> Surcharge: areas in the plan, the grains of a surface, forces that add up, the ledger, its state.
program test_dem_surcharge
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_archive, only: dem_archive_type
  use dem_law, only: make_linear_law
  use dem_make, only: make_grains, make_planes
  use dem_cell, only: set_cell
  use dem_plan, only: plan_type, free_area, cell_areas, disc_part, outline_of, largest_reach, &
    holds_centre, outlines_meet, folded_in
  use dem_state, only: kind_free, kind_fixed, kind_driven, kind_ghost
  use dem_surcharge, only: dem_surcharge_type
  use dem_surface, only: surface_rows
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), allocatable :: none(:)
  real(wp), parameter :: pi = acos(-1.0_wp)

  call check_discs()
  call check_cells()
  call check_periodic_cells()
  call check_outlines()
  call check_surface()
  call check_periodic_surface()
  call check_periodic_forces()
  call check_forces()
  call check_follow()
  call check_given()
  call check_ghosts()
  call check_faults()
  call test%finish()

contains

  !> Common area of squares and discs in closed form.
  subroutine check_discs()
    real(wp) :: square(2, 4), turned(2, 4)
    square = reshape([-1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp], [2, 4])
    call test%check_close('disc within', disc_part(square, [0.2_wp, -0.1_wp, 0.5_wp]), &
                          0.25_wp*pi, 1.0e-15_wp)
    call test%check_close('square within', disc_part(square, [0.0_wp, 0.3_wp, 9.0_wp]), 4.0_wp, &
                          1.0e-14_wp)
    call test%check_close('apart', disc_part(square, [3.0_wp, 0.0_wp, 1.9_wp]), 0.0_wp, 1.0e-15_wp)
    call test%check_close('half', disc_part(square, [1.0_wp, 0.0_wp, 0.5_wp]), 0.125_wp*pi, &
                          1.0e-15_wp)
    call test%check_close('a quarter about a corner', disc_part(square, [1.0_wp, 1.0_wp, 0.5_wp]), &
                          0.0625_wp*pi, 1.0e-15_wp)
    call test%check_close('four segments beyond', disc_part(square, [0.0_wp, 0.0_wp, 1.25_wp]), &
                          pi*1.5625_wp - 4.0_wp*(1.5625_wp*acos(0.8_wp) - 0.75_wp), 1.0e-14_wp)
    turned = matmul(reshape([0.6_wp, 0.8_wp, -0.8_wp, 0.6_wp], [2, 2]), square)
    call test%check_close('turned with its square', disc_part(turned, [0.6_wp, 0.8_wp, 0.7_wp]), &
                          disc_part(square, [1.0_wp, 0.0_wp, 0.7_wp]), 1.0e-15_wp)
  end subroutine check_discs

  !> A square lattice has square cells; any points share the free area.
  subroutine check_cells()
    type(plan_type) :: plan
    real(wp) :: x(2, 30), area(30), seed
    integer(i4) :: i, j
    plan%upper = [6.0_wp, 5.0_wp]
    allocate (plan%disc(3, 0))
    do j = 1, 5
      do i = 1, 6
        x(:, i + 6*(j - 1)) = [i, j] - 0.5_wp
      end do
    end do
    call cell_areas(plan, x, area)
    call test%check_all_close('square cells', area, 1.0_wp, 1.0e-14_wp)
    plan%disc = reshape([2.0_wp, 2.0_wp, 0.6_wp], [3, 1])
    call cell_areas(plan, x, area)
    call test%check_close('four cells lose a quarter each', area(8), 1.0_wp - 0.09_wp*pi, &
                          1.0e-14_wp)
    call test%check_close('others nothing', area(30), 1.0_wp, 1.0e-14_wp)
    call test%check_close('free area', free_area(plan), 30.0_wp - 0.36_wp*pi, 1.0e-14_wp)
    do i = 1, 30
      seed = modulo(i*0.6180339887_wp, 1.0_wp)
      x(:, i) = [6.0_wp*seed, 5.0_wp*modulo(i*0.7548776662_wp, 1.0_wp)]
    end do
    plan%disc = reshape([0.3_wp, 4.8_wp, 1.1_wp, 4.0_wp, 2.0_wp, 0.9_wp], [3, 2])
    call cell_areas(plan, x, area)
    call test%check_close('any points share it', sum(area), free_area(plan), 1.0e-13_wp)
    call test%check('no cell below nothing', all(area > -1.0e-14_wp))
    call cell_areas(plan, x(:, :1), area(:1))
    call test%check_close('one has it all', area(1), free_area(plan), 1.0e-14_wp)
  end subroutine check_cells

  !> In a periodic plan areas are those of the middle of 3 x 3 copies, wherever the faces lie.
  subroutine check_periodic_cells()
    type(plan_type) :: plan, whole
    real(wp) :: x(2, 12), moved(2, 12), area(12), other(12), copies(2, 108), all_areas(108)
    integer(i4) :: i, j, k
    plan%lower = [-1.0_wp, 2.0_wp]
    plan%upper = [5.0_wp, 7.0_wp]
    plan%periodic = .true.
    allocate (plan%disc(3, 0), whole%disc(3, 0))
    do i = 1, 12
      x(:, i) = plan%lower + [6.0_wp, 5.0_wp]*modulo(i*[0.6180339887_wp, 0.7548776662_wp], 1.0_wp)
    end do
    call cell_areas(plan, x, area)
    call test%check_close('they share the plan', sum(area), 30.0_wp, 1.0e-14_wp)
    k = 0
    do j = 0, 2
      do i = 0, 2
        copies(:, 12*k + 1:12*k + 12) = x + spread([6.0_wp*i, 5.0_wp*j], 2, 12)
        k = k + 1
      end do
    end do
    whole%lower = plan%lower
    whole%upper = plan%lower + 3.0_wp*[6.0_wp, 5.0_wp]
    call cell_areas(whole, copies, all_areas)
    call test%check_all_close('the middle copy', area, all_areas(49:60), 1.0e-13_wp)
    do i = 1, 12
      moved(:, i) = folded_in(plan, x(:, i) + [14.3_wp, -3.9_wp])
    end do
    call cell_areas(plan, moved, other)
    call test%check_all_close('moved over the faces', other, area, 1.0e-13_wp)
    call cell_areas(plan, x(:, :1), other(:1))
    call test%check_close('one has it all', other(1), 30.0_wp, 1.0e-14_wp)
    call cell_areas(plan, x(:, :2), other(:2))
    call test%check_close('two share it alike', other(1), 15.0_wp, 1.0e-14_wp)
  end subroutine check_periodic_cells

  !> Outlines of a turned ellipsoid, and circles that touch.
  subroutine check_outlines()
    real(wp) :: turn(3, 3), s(3), circle(3)
    turn = reshape([0.6_wp, 0.8_wp, 0.0_wp, -0.8_wp, 0.6_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], &
                   [3, 3])
    s = outline_of(turn, [3.0_wp, 1.0_wp, 2.0_wp])
    call test%check_close('reach', largest_reach(s), 3.0_wp, 1.0e-15_wp)
    call test%check('tip held', holds_centre(s, [1.79_wp, 2.39_wp]))
    call test%check('not beyond', .not. holds_centre(s, [1.81_wp, 2.41_wp]))
    call test%check('not across', .not. holds_centre(s, [1.2_wp, -0.9_wp]))
    circle = [4.0_wp, 4.0_wp, 0.0_wp]
    call test%check('circles 2 and 1 meet', &
                    outlines_meet(circle, 0.25_wp*circle, [1.8_wp, -2.3999_wp]))
    call test%check('and do not', &
                    .not. outlines_meet(circle, 0.25_wp*circle, [1.8_wp, -2.4001_wp]))
    call test%check('tip to tip', outlines_meet(s, s, [3.599_wp, 4.799_wp]))
    call test%check('not quite', .not. outlines_meet(s, s, [3.601_wp, 4.801_wp]))
    call test%check('side by side', .not. outlines_meet(s, s, [1.601_wp, -1.2008_wp]))
  end subroutine check_outlines

  !> A system of spheres of radius 1 mm.
  subroutine make_spheres(x, kind, s)
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: kind(:)
    type(dem_system_type), intent(inout) :: s
    type(error_list_type) :: errors
    real(wp) :: q(4, size(kind)), zero(3, size(kind))
    integer(i4) :: k
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_linear_law(1.0e5_wp, 1.0e5_wp, 0.3_wp, 0.1_wp, 0.1_wp)
    q = 0.0_wp
    q(1, :) = 1.0_wp
    zero = 0.0_wp
    call make_grains(s%grains, s%materials, [(int(k, i8), k=1, size(kind))], kind, &
                     [(1, k=1, size(kind))], x, q, 1.0e-3_wp + zero, zero, zero, errors)
    call test%check('grains made', .not. errors%any())
  end subroutine make_spheres

  !> Three in a pile of which the top counts; beside it one alone; a wall grain covers none beside
  !! it but one below it; outside and within a disc none counts.
  subroutine check_surface()
    type(dem_system_type) :: s
    type(plan_type) :: plan
    integer(i4), allocatable :: rows(:)
    real(wp) :: x(3, 9)
    x(:, 1) = [3.0_wp, 3.0_wp, 1.0_wp]
    x(:, 2) = [4.5_wp, 3.0_wp, 2.0_wp]    ! half above the first
    x(:, 3) = [3.0_wp, 6.0_wp, 1.0_wp]
    x(:, 4) = [4.99_wp, 6.0_wp, 1.05_wp]  ! beside the third, a little higher
    x(:, 5) = [0.5_wp, 6.0_wp, 5.0_wp]    ! fixed, beside the next
    x(:, 6) = [1.6_wp, 8.0_wp, 1.0_wp]
    x(:, 7) = [1.5_wp, 8.8_wp, 5.0_wp]    ! fixed, above it
    x(:, 8) = [8.0_wp, 8.0_wp, 1.0_wp]    ! in the disc
    x(:, 9) = [11.0_wp, 3.0_wp, 1.0_wp]   ! outside
    call make_spheres(1.0e-3_wp*x, [0, 0, 0, 0, kind_fixed, 0, kind_fixed, 0, 0], s)
    plan%upper = 10.0e-3_wp
    plan%disc = reshape([8.0e-3_wp, 7.0e-3_wp, 1.1e-3_wp], [3, 1])
    rows = surface_rows(s%grains, plan, .true.)
    call test%check('the surface', size(rows) == 3)
    if (size(rows) == 3) call test%check('which', all(rows == [2, 3, 4]))
    call check_slack(s, plan)
  end subroutine check_surface

  !> Grains over a face, free or fixed, cover as others do; centres beyond the faces count.
  subroutine check_periodic_surface()
    type(dem_system_type) :: s
    type(plan_type) :: plan
    integer(i4), allocatable :: rows(:)
    real(wp) :: x(3, 6)
    x(:, 1) = [0.4_wp, 5.0_wp, 1.0_wp]
    x(:, 2) = [9.6_wp, 5.0_wp, 2.0_wp]     ! over a face: above the first
    x(:, 3) = [5.0_wp, -0.3_wp, 1.0_wp]    ! beyond a face
    x(:, 4) = [5.0_wp, 8.9_wp, 3.0_wp]     ! above the third
    x(:, 5) = [8.0_wp, 0.2_wp, 1.0_wp]
    x(:, 6) = [-2.0_wp, 19.9_wp, 4.0_wp]   ! fixed, above the fifth
    call make_spheres(1.0e-3_wp*x, [0, 0, 0, 0, 0, kind_fixed], s)
    plan%upper = 10.0e-3_wp
    allocate (plan%disc(3, 0))
    plan%periodic = .true.
    rows = surface_rows(s%grains, plan, .true.)
    call test%check('the surface over faces', size(rows) == 2)
    if (size(rows) == 2) call test%check('which, over faces', all(rows == [2, 4]))
    plan%periodic = .false.
    rows = surface_rows(s%grains, plan, .true.)
    call test%check('with borders it is another', size(rows) == 4)
    if (size(rows) == 4) call test%check('which, with borders', all(rows == [1, 2, 4, 5]))
  end subroutine check_periodic_surface

  !> In a cell the rectangle is that of the cell; a driven grain at its face leaves its disc free.
  subroutine check_periodic_forces()
    type(dem_system_type) :: s
    type(dem_surcharge_type) :: surcharge
    type(error_list_type) :: errors
    real(wp) :: x(3, 4), edges(3, 3), free
    x = reshape([2.0_wp, 2.0_wp, 1.0_wp, 6.0_wp, 7.0_wp, 1.0_wp, 12.5_wp, 4.0_wp, 1.0_wp, &
                 -0.1_wp, 8.0_wp, 1.0_wp], [3, 4])
    call make_spheres(1.0e-3_wp*x, [0, 0, 0, kind_driven], s)
    edges = 0.0_wp
    edges(1, 1) = 10.0e-3_wp
    edges(2, 2) = 9.0e-3_wp
    edges(3, 3) = 5.0e-3_wp
    call set_cell(s%cell, [0.0_wp, 0.0_wp, 0.0_wp], edges, [.true., .true., .false.])
    surcharge%active = .true.
    surcharge%stress = 1.0e3_wp
    surcharge%clearance = 1.2_wp
    allocate (surcharge%hole(3, 0))
    call surcharge%start(s%dem_data_type, none, 0.0_wp, 0_i8, errors)
    call test%check('a cell has a surface', .not. errors%any())
    free = 90.0e-6_wp - pi*(1.2_wp*maxval(s%grains%axes(:, 4)))**2
    call test%check_close('stress x free area', sum(s%surcharge), 1.0e3_wp*free, 1.0e-12_wp)
    call test%check('all three carry', all(s%surcharge(:3) > 0.0_wp))
  end subroutine check_periodic_forces

  !> A grain leaves the surface later than it returns: by height (0.15 and 0.05 of the vertical
  !! semi-extent) and by outlines (3 % smaller and larger).
  subroutine check_slack(s, plan)
    type(dem_system_type), intent(inout) :: s
    type(plan_type), intent(in) :: plan
    real(wp), parameter :: heights(4) = [1.04_wp, 1.07_wp, 1.13_wp, 1.16_wp]
    real(wp), parameter :: places(4) = [4.93_wp, 4.96_wp, 5.04_wp, 5.07_wp]
    logical, parameter :: stays(4) = [.true., .true., .true., .false.]
    logical, parameter :: comes(4) = [.true., .false., .false., .false.]
    logical, parameter :: stays_beside(4) = [.false., .true., .true., .true.]
    logical, parameter :: comes_beside(4) = [.false., .false., .false., .true.]
    logical :: was(9)
    integer(i4) :: k
    do k = 1, 4
      s%grains%x(:, 4) = 1.0e-3_wp*[4.9_wp, 6.0_wp, heights(k)]
      was = .true.
      call test%check('stays below', any(surface_rows(s%grains, plan, .true., was) == 3) &
                      .eqv. stays(k))
      was(3) = .false.
      call test%check('comes below', any(surface_rows(s%grains, plan, .true., was) == 3) &
                      .eqv. comes(k))
      s%grains%x(:, 4) = 1.0e-3_wp*[places(k), 6.0_wp, 1.5_wp]
      was = .true.
      call test%check('stays beside', any(surface_rows(s%grains, plan, .true., was) == 3) &
                      .eqv. stays_beside(k))
      was(3) = .false.
      call test%check('comes beside', any(surface_rows(s%grains, plan, .true., was) == 3) &
                      .eqv. comes_beside(k))
    end do
  end subroutine check_slack

  !> Two spheres on a floor: shares by area, forces held, work and closure, the same bits from an
  !! archive; loads of a partner stay beside it.
  subroutine check_forces()
    type(dem_system_type) :: s, copy
    type(dem_surcharge_type) :: surcharge
    type(dem_archive_type) :: archive
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), up(3, 1), at(3, 1)
    integer(i4) :: k

    x = reshape([1.0_wp, 1.0_wp, 1.0_wp, 4.0_wp, 1.0_wp, 1.0_wp], [3, 2])
    call make_spheres(1.0e-3_wp*x, [kind_free, kind_free], s)
    up = reshape([0.0_wp, 0.0_wp, 1.0_wp], [3, 1])
    at = 0.0_wp
    call make_planes(s%planes, at, up, at, [1])
    s%par%dt = 2.0e-6_wp
    copy = s
    call s%init(errors)
    surcharge%active = .true.
    surcharge%stress = 1.0e5_wp
    surcharge%upper = [5.0e-3_wp, 2.0e-3_wp]
    surcharge%clearance = 1.2_wp
    allocate (surcharge%hole(3, 0))
    call surcharge%start(s%dem_data_type, none, 0.0_wp, 0_i8, errors)
    call test%check('shares', all(abs(s%grains%extra_force(3, :) + 0.5_wp) < 1.0e-15_wp))
    do k = 1, 30
      call s%step(100, errors)
      if (surcharge%due(s%dem_data_type, s%health%steps)) &
        call surcharge%update(s%dem_data_type, k*2.0e-4_wp, s%health%steps, errors)
      if (k == 10) surcharge%stress = 3.0e5_wp
      if (k == 20) surcharge%stress = 2.0e5_wp
    end do
    call test%check('no faults', .not. errors%any())
    call s%refresh_ledger()
    call test%check_close('the ledger closes', s%closure()/s%ledger%external, 0.0_wp, 1.0e-4_wp)
    call test%check('work was done', s%ledger%external > 0.0_wp)
    call s%set_extra([1], reshape([1.0_wp, 0.0_wp, 7.0_wp], [3, 1]), 0.0_wp*up)
    call test%check_close('a partner''s load', s%grains%extra_force(3, 1), 6.0_wp, 1.0e-14_wp)
    call surcharge%update(s%dem_data_type, 0.1_wp, 3000_i8, errors)
    call test%check_close('stays beside it', s%grains%extra_force(3, 1), 6.0_wp, 1.0e-14_wp)
    call s%clear_extra()
    call test%check_close('and goes', s%grains%extra_force(3, 1), -1.0_wp, 1.0e-14_wp)
    call s%export_state(archive)
    call copy%import_state(archive, errors)
    call test%check('state taken', .not. errors%any())
    call test%check('forces of the archive', all(abs(copy%surcharge - s%surcharge) <= 0.0_wp))
    call test%check('last update', all(abs(copy%surcharge_seen - s%surcharge_seen) <= 0.0_wp))
    call test%check('its surface', all(copy%surcharge_top .eqv. s%surcharge_top))
    surcharge%active = .false.
    call surcharge%start(copy%dem_data_type, none, 0.1_wp, 3000_i8, errors)
    call test%check('a deck without takes it off', .not. allocated(copy%surcharge) .and. &
                    all(abs(copy%grains%extra_force) <= 0.0_wp))
  end subroutine check_forces

  !> A load follows its share in so many updates, the total at once.
  subroutine check_follow()
    type(dem_system_type) :: s
    type(dem_surcharge_type) :: surcharge
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), wanted
    integer(i4) :: k
    x = reshape([1.0_wp, 1.0_wp, 1.0_wp, 4.0_wp, 1.0_wp, 1.0_wp], [3, 2])
    call make_spheres(1.0e-3_wp*x, [kind_free, kind_free], s)
    surcharge%active = .true.
    surcharge%stress = 1.0e5_wp
    surcharge%upper = [5.0e-3_wp, 2.0e-3_wp]
    surcharge%follow = 20.0_wp
    allocate (surcharge%hole(3, 0))
    call surcharge%start(s%dem_data_type, none, 0.0_wp, 0_i8, errors)
    call test%check_close('at first its share', s%surcharge(1), 0.5_wp, 1.0e-15_wp)
    s%grains%x(1, 1) = 2.0e-3_wp  ! the border moves to 3 mm
    wanted = 0.5_wp
    do k = 1, 3
      call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
      wanted = wanted + (0.6_wp - wanted)/20.0_wp
    end do
    call test%check_close('then on the way', s%surcharge(1), wanted, 1.0e-14_wp)
    call test%check_close('with what is held', s%grains%extra_force(3, 1), -wanted, 1.0e-14_wp)
    call test%check_close('all of it', sum(s%surcharge), 1.0_wp, 1.0e-14_wp)
    surcharge%stress = 2.0e5_wp
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    call test%check_close('the total at once', sum(s%surcharge), 2.0_wp, 1.0e-14_wp)
    do k = 1, 700
      call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    end do
    call test%check_close('at last its share', s%surcharge(1), 1.2_wp, 1.0e-12_wp)
    surcharge%follow = 1.0_wp
    s%grains%x(1, 1) = 1.0e-3_wp
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    call test%check_close('or without delay', s%surcharge(1), 1.0_wp, 1.0e-14_wp)
    call test%check('no fault', .not. errors%any())
  end subroutine check_follow

  !> Loads of a packing: those of now are the first, of the grains that had one the surface is.
  subroutine check_given()
    type(dem_system_type) :: s
    type(dem_surcharge_type) :: surcharge
    type(error_list_type) :: errors
    real(wp) :: x(3, 4)
    real(wp), allocatable :: given(:)
    x = reshape([1.0_wp, 1.0_wp, 1.0_wp, 4.0_wp, 1.0_wp, 1.0_wp, 3.0_wp, 5.0_wp, 1.0_wp, &
                 7.0_wp, 1.0_wp, 1.0_wp], [3, 4])
    call make_spheres(1.0e-3_wp*x, [kind_free, kind_free, kind_ghost, kind_free], s)
    surcharge%active = .true.
    surcharge%stress = 1.0e5_wp
    surcharge%upper = [5.0e-3_wp, 2.0e-3_wp]
    surcharge%follow = 20.0_wp
    allocate (surcharge%hole(3, 0))
    given = [0.8_wp, 0.2_wp, 5.0_wp, 3.0_wp]
    call surcharge%start(s%dem_data_type, given, 0.0_wp, 0_i8, errors)
    call test%check('no fault', .not. errors%any())
    call test%check_close('a twentieth towards its share', s%surcharge(1), 0.785_wp, 1.0e-14_wp)
    call test%check_close('held', s%grains%extra_force(3, 2), -0.215_wp, 1.0e-14_wp)
    call test%check_close('none on a ghost', s%surcharge(3), 0.0_wp, 0.0_wp)
    call test%check_close('none beyond the area', s%surcharge(4), 0.0_wp, 0.0_wp)
    s%grains%kind(2) = kind_ghost
    s%par%overlapped = .true.
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    call test%check_close('one that became a ghost leaves its load at once', s%surcharge(1), &
                          0.5_wp, 1.0e-14_wp)
    call test%check_close('and carries none', s%surcharge(2), 0.0_wp, 0.0_wp)
  end subroutine check_given

  !> A ghost between two free grains, where grains overlap with a solid: it keeps its share, which
  !! no grain carries; elsewhere it is a wall, and the free ones carry all.
  subroutine check_ghosts()
    type(dem_system_type) :: s
    type(dem_surcharge_type) :: surcharge
    type(error_list_type) :: errors
    real(wp) :: x(3, 3)
    x = reshape([1.0_wp, 1.0_wp, 1.0_wp, 3.0_wp, 1.0_wp, 1.0_wp, 5.0_wp, 1.0_wp, 1.0_wp], [3, 3])
    call make_spheres(1.0e-3_wp*x, [kind_free, kind_ghost, kind_free], s)
    surcharge%active = .true.
    surcharge%stress = 1.0e6_wp
    surcharge%upper = [6.0e-3_wp, 2.0e-3_wp]
    allocate (surcharge%hole(3, 0))
    allocate (s%surcharge(3), s%surcharge_seen(8), source=0.0_wp)
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    call test%check_close('beside a wall of ghosts', s%surcharge(1), 6.0_wp, 1.0e-12_wp)
    s%par%overlapped = .true.
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, errors)
    call test%check('no fault', .not. errors%any())
    call test%check_close('its own share', s%surcharge(1), 4.0_wp, 1.0e-12_wp)
    call test%check_close('nothing on the ghost', s%surcharge(2), 0.0_wp, 0.0_wp)
    call test%check_close('nor held there', s%grains%extra_force(3, 2), 0.0_wp, 0.0_wp)
    call test%check_close('the other', s%surcharge(3), 4.0_wp, 1.0e-12_wp)
    call test%check_close('area reported', s%surcharge_seen(2), 8.0e-6_wp, 1.0e-18_wp)
    call test%check_close('grains reported', s%surcharge_seen(3), 2.0_wp, 0.0_wp)
  end subroutine check_ghosts

  !> Nobody in the free area (N230); discs that overlap (N231).
  subroutine check_faults()
    type(dem_system_type) :: s
    type(dem_surcharge_type) :: surcharge
    type(error_list_type) :: none, overlap
    real(wp) :: x(3, 3)
    x = reshape([1.0_wp, 1.0_wp, 1.0_wp, 4.0_wp, 1.0_wp, 3.0_wp, 6.3_wp, 1.0_wp, 3.0_wp], [3, 3])
    call make_spheres(1.0e-3_wp*x, [kind_free, kind_driven, kind_driven], s)
    surcharge%active = .true.
    surcharge%stress = 1.0_wp
    surcharge%lower = 2.0e-3_wp
    surcharge%upper = 9.0e-3_wp
    surcharge%clearance = 1.1_wp
    allocate (surcharge%hole(3, 0))
    allocate (s%surcharge(3), s%surcharge_seen(8), source=0.0_wp)
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, none)
    call test%check('nobody', none%any())
    if (none%any()) call test%check_text('its code', none%item(1)%code, 'N230')
    surcharge%clearance = 1.2_wp
    call surcharge%update(s%dem_data_type, 0.0_wp, 0_i8, overlap)
    call test%check('overlap', overlap%any())
    if (overlap%any()) call test%check_text('its code', overlap%item(1)%code, 'N231')
  end subroutine check_faults
end program test_dem_surcharge
