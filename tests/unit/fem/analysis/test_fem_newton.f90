!> Tangents of laws with a state by multigrid: the same equilibrium as by factors; where it does not
!! converge factors follow if the choice is open, or the step fails.
program test_fem_newton
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_ranks, only: leave_ranks
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_law, only: common_size
  use fem_law_linear, only: fem_law_linear_type
  use fem_newton, only: newton_step
  use fem_topology, only: set_elements
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 4          !! elements along an edge
  real(wp), parameter :: bulk = 900.0_wp, shear = 400.0_wp
  real(wp), parameter :: never = 0.0_wp    !! tolerance that is not reached
  real(wp), allocatable :: wanted(:, :)

  call by_factors()
  call by_multigrid(1.0e-6_wp, .false.)
  call by_multigrid(never, .true.)
  call fails()
  call leave_ranks()
  call test%finish()

contains

  !> A cube of n^3 skewed elements of a linear law with a state, on its base under its weight.
  subroutine make_cube(body)
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
    call body%elastic%use_rule('hex8_full', r)
    body%elastic%rule_of = r
    body%elastic%moduli(1, :) = bulk - 2.0_wp/3.0_wp*shear
    body%elastic%moduli(2, :) = shear
    body%elastic%density = 3.0_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    body%loads%gravity = [1.0_wp, 0.0_wp, -9.0_wp]
    call body%allocate_state()
    call body%assemble()
    body%supports%held(:, :(n + 1)**2) = .true.
    call make_matter(body)
  end subroutine make_cube

  subroutine make_matter(body)
    type(fem_body_type), intent(inout) :: body
    type(fem_law_linear_type) :: linear
    linear%bulk = bulk
    linear%shear = shear
    associate (m => body%matter)
      allocate (m%law(1))
      allocate (m%law_of(n**3), source=1_i4)
      m%law(1)%law = linear
      m%active = .true.
      m%states = common_size
      allocate (m%stress(6, body%elastic%points), source=0.0_wp)
      allocate (m%state(m%states, body%elastic%points), source=0.0_wp)
      call m%prepare(body%mesh, body%dofs, body%elastic)
    end associate
  end subroutine make_matter

  subroutine by_factors()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_cube(body)
    call newton_step(body, 1.0_wp, errors)
    call test%check('factors: no fault', .not. errors%any())
    wanted = body%state%u
    call test%check('factors: it moves', max_abs(wanted) > 0.0_wp)
    call body%system%solver%drop()
  end subroutine by_factors

  !> Factors follow if it `turns`.
  subroutine by_multigrid(tolerance, turns)
    real(wp), intent(in) :: tolerance
    logical, intent(in) :: turns
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_cube(body)
    call choose(body, tolerance, .true.)
    call newton_step(body, 1.0_wp, errors)
    call test%check('multigrid: no fault', .not. errors%any())
    call test%check('multigrid: factors follow', body%system%solver%iterative .neqv. turns)
    call test%check('multigrid: displacements', &
                    max_abs(body%state%u - wanted) < 1.0e-8_wp*max_abs(wanted))
    call body%system%solver%drop()
  end subroutine by_multigrid

  subroutine choose(body, tolerance, open)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: tolerance
    logical, intent(in) :: open
    associate (solver => body%system%solver)
      solver%iterative = .true.
      solver%by_multigrid = .true.
      solver%by_choice = open
      solver%tolerance = tolerance
    end associate
  end subroutine choose

  !> The deck wants multigrid: the step is halved, and then the message says why.
  subroutine fails()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_cube(body)
    call choose(body, never, .false.)
    body%newton%most_cuts = 0
    call newton_step(body, 1.0_wp, errors)
    call test%check_text('it fails', errors%item(1)%code, 'N311')
    call test%check('it says why', index(errors%item(1)%message, 'multigrid stopped') > 0)
    call body%system%solver%drop()
  end subroutine fails
end program test_fem_newton
