!> Points of laws with a state in a body: the linear law gives the stiffness and forces of linear
!! assembly, tangents are those of the forces, threads change no bit, trials are put back, geometry
!! that is kept is that of the mesh.
program test_fem_matter
  use, intrinsic :: omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_law, only: common_size
  use fem_cone, only: cone_constants
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_linear, only: fem_law_linear_type
  use fem_sparse, only: multiply, multiply_general
  use fem_topology, only: set_elements
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 4          !! elements along an edge
  real(wp), parameter :: bulk = 900.0_wp, shear = 400.0_wp

  call check_linear('hex8_full')
  call check_linear('hex8_bbar')
  call check_tangent()
  call check_threads()
  call check_geometry('hex8_full')
  call check_geometry('hex8_bbar')
  call test%finish()

contains

  !> A cube of n^3 skewed elements with linear or Drucker-Prager points.
  subroutine make_cube(rule, plastic, body)
    character(len=*), intent(in) :: rule
    logical, intent(in) :: plastic
    type(fem_body_type), intent(inout) :: body
    integer(i4), parameter :: step(8) = [0, 1, n + 2, n + 1, (n + 1)**2, (n + 1)**2 + 1, &
                                         (n + 1)**2 + n + 2, (n + 1)**2 + n + 1]
    integer(i4) :: connectivity(8, n**3), i, j, k, e, r
    allocate (body%mesh%x(3, (n + 1)**3), body%mesh%group(0))
    do k = 0, n
      do j = 0, n
        do i = 0, n
          body%mesh%x(:, 1 + i + (n + 1)*(j + (n + 1)*k)) = &
            [i + 0.1_wp*j, j + 0.05_wp*k + 0.02_wp*i*k/n, real(k, wp)]
        end do
      end do
    end do
    do e = 1, n**3
      i = modulo(e - 1, n)
      j = modulo((e - 1)/n, n)
      k = (e - 1)/n**2
      connectivity(:, e) = 1 + i + (n + 1)*(j + (n + 1)*k) + step
    end do
    call set_elements(body%mesh, hex8, connectivity)
    call body%elastic%start(n**3)
    call body%elastic%use_rule(rule, r)
    body%elastic%rule_of = r
    body%elastic%moduli(1, :) = bulk - 2.0_wp/3.0_wp*shear
    body%elastic%moduli(2, :) = shear
    body%elastic%density = 3.0_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    call body%assemble()
    call make_matter(plastic, body)
  end subroutine make_cube

  subroutine make_matter(plastic, body)
    logical, intent(in) :: plastic
    type(fem_body_type), intent(inout) :: body
    type(fem_law_linear_type) :: linear
    type(fem_law_drucker_type) :: drucker
    linear%bulk = bulk
    linear%shear = shear
    drucker%bulk = bulk
    drucker%shear = shear
    drucker%cone%cohesion = 0.2_wp
    drucker%states = common_size + 1
    call cone_constants(0.5_wp, 0.1_wp, -1, drucker%cone%a, drucker%cone%b)
    call cone_constants(0.1_wp, 0.1_wp, -1, drucker%cone%a_flow, drucker%cone%b_flow)
    associate (m => body%matter)
      allocate (m%law(1))
      allocate (m%law_of(n**3), source=1_i4)
      if (plastic) m%law(1)%law = drucker
      if (.not. plastic) m%law(1)%law = linear
      m%active = .true.
      m%symmetric = .not. plastic
      m%states = common_size + 1
      allocate (m%stress(6, body%elastic%points), m%state(m%states, body%elastic%points))
      m%stress = 0.0_wp
      m%state = 0.0_wp
      call m%prepare(body%mesh, body%dofs, body%elastic)
    end associate
  end subroutine make_matter

  !> Pseudo-random numbers.
  pure function noise(blocks, size_of) result(u)
    integer(i4), intent(in) :: blocks
    real(wp), intent(in) :: size_of
    real(wp) :: u(3, blocks)
    integer(i4) :: i
    u = reshape([(size_of*sin(7.3_wp*i), i=1, 3*blocks)], [3, blocks])
  end function noise

  subroutine check_linear(rule)
    character(len=*), intent(in) :: rule
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), wanted(:, :), force(:, :), product(:, :)
    integer(i4) :: bad
    call make_cube(rule, .false., body)
    u = noise(body%dofs%blocks, 1.0e-3_wp)
    allocate (wanted, force, product, mold=u)
    call multiply(body%system%pattern, body%system%k, u, wanted)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    call test%check(rule//': all points have a state', bad == 0)
    call test%check_close(rule//': forces', max_abs(force - wanted)/max_abs(wanted), &
                          0.0_wp, 1.0e-13_wp)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    call test%check(rule//': symmetric', size(body%system%lower) == 0)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, u, product)
    call test%check_close(rule//': stiffness', max_abs(product - wanted) &
                          /max_abs(wanted), 0.0_wp, 1.0e-13_wp)
    call test%check_close(rule//': stored energy', sum(body%matter%works()) &
                          /(0.5_wp*sum(u*wanted)), 1.0_wp, 1.0e-12_wp)
    call body%matter%reject()
    call test%check(rule//': put back', max_abs(body%matter%stress) <= 0.0_wp)
  end subroutine check_linear

  !> Slopes of the forces along a direction, by central differences, are the tangent times it; it is
  !! not symmetric.
  subroutine check_tangent()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), way(:, :), high(:, :), low(:, :), product(:, :), back(:, :)
    real(wp), parameter :: step = 1.0e-7_wp
    integer(i4) :: bad, counts(2)
    call make_cube('hex8_bbar', .true., body)
    u = noise(body%dofs%blocks, 2.0e-3_wp)
    way = cshift(u, 1, 2)
    allocate (high, low, product, back, mold=u)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, product, bad)
    counts = body%matter%yielding()
    call test%check('some points yield', counts(1) > 0)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, way, product)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, u, back)
    call test%check('not symmetric', abs(sum(u*product) - sum(way*back)) > &
                    1.0e-6_wp*abs(sum(u*product)))
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u + step*way, high, bad)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u - step*way, low, bad)
    call test%check_close('tangent', max_abs((high - low)/(2.0_wp*step) - product) &
                          /max_abs(product), 0.0_wp, 1.0e-6_wp)
  end subroutine check_tangent

  subroutine check_threads()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), force(:, :), first(:, :), k(:, :, :), lower(:, :, :)
    integer(i4) :: bad, t
    call make_cube('hex8_bbar', .true., body)
    u = noise(body%dofs%blocks, 2.0e-3_wp)
    allocate (force, mold=u)
    do t = 1, 3
      call omp_set_num_threads(t)
      call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
      call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
        body%system%k, &
                                body%system%lower)
      if (t == 1) then
        first = force
        k = body%system%k
        lower = body%system%lower
        cycle
      end if
      call test%check('threads: forces', all(abs(force - first) <= 0.0_wp))
      call test%check('threads: stiffness', all(abs(body%system%k - k) <= 0.0_wp) &
                      .and. all(abs(body%system%lower - lower) <= 0.0_wp))
    end do
  end subroutine check_threads

  !> Forces and stiffness with kept geometry have the bits of those without, also after nodes
  !! have moved.
  subroutine check_geometry(rule)
    character(len=*), intent(in) :: rule
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), force(:, :), anew(:, :), old(:, :), k(:, :, :)
    integer(i4) :: bad
    call make_cube(rule, .true., body)
    u = noise(body%dofs%blocks, 2.0e-3_wp)
    allocate (force, anew, old, mold=u)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, old, bad)
    body%mesh%x = body%mesh%x + 50.0_wp*u
    call body%assemble()
    call test%check(rule//': geometry is kept', allocated(body%matter%geometry))
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    k = body%system%k
    deallocate (body%matter%geometry)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, anew, bad)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    call test%check(rule//': forces of kept geometry', max_abs(force - anew) <= 0.0_wp)
    call test%check(rule//': stiffness of kept geometry', max_abs(body%system%k(:, 1, :) &
                                                                  - k(:, 1, :)) <= 0.0_wp)
    call test%check(rule//': places count', max_abs(force - old) > 0.01_wp*max_abs(old))
    call check_held(rule, body, u)
  end subroutine check_geometry

  !> Accepted stresses give the forces of the update that was accepted, also after others were
  !! tried.
  subroutine check_held(rule, body, u)
    character(len=*), intent(in) :: rule
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: u(:, :)  !! (3, blocks) [m]
    real(wp), dimension(3, size(u, 2)) :: force, other, wanted
    real(wp), allocatable :: stress(:, :)
    integer(i4) :: bad
    logical :: found
    call body%matter%held_force(body%dofs, body%elastic, force, found)
    call test%check(rule//': no forces of stresses without geometry', .not. found)
    call body%assemble()
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, wanted, bad)
    call body%matter%accept()
    stress = body%matter%stress
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, 2.0_wp*u, other, bad)
    call body%matter%held_force(body%dofs, body%elastic, force, found)
    call test%check(rule//': forces of the accepted stresses', found &
                    .and. max_abs(force - wanted) <= 1.0e-14_wp*max_abs(wanted))
    call test%check(rule//': others count', max_abs(other - wanted) > 0.01_wp*max_abs(wanted))
    call test%check(rule//': the trial is put back', &
                    max_abs(body%matter%stress - stress) <= 0.0_wp)
  end subroutine check_held
end program test_fem_matter
