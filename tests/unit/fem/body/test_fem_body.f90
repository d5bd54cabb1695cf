!> A body of a few bricks: factors with METIS' order, springs of both kinds, supports, Newmark,
!! reject, against closed forms.
program test_fem_body
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_value
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: larger, test_type
  use fem_body, only: fem_body_type, fem_motion_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_micropolar, only: lame_moduli
  use talus_ranks, only: leave_ranks
  use fem_start, only: start_motion
  use fem_linear_step, only: linear_step
  use fem_topology, only: set_elements
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test

  call static_bar()
  call robin_springs()
  call not_held()
  call newmark_frequency()
  call pushed_bar()
  call not_finite()
  call leave_ranks()
  call test%finish()

contains

  !> A column of n unit cubes along z, E = 1000, nu = 0, rho = 3; sides held, base held.
  subroutine make_column(n, body)
    integer(i4), intent(in) :: n
    type(fem_body_type), intent(inout) :: body
    integer(i4) :: k, e
    allocate (body%mesh%x(3, 4*(n + 1)), body%mesh%group(0))
    do k = 0, n
      body%mesh%x(:, 4*k + 1) = [0.0_wp, 0.0_wp, real(k, wp)]
      body%mesh%x(:, 4*k + 2) = [1.0_wp, 0.0_wp, real(k, wp)]
      body%mesh%x(:, 4*k + 3) = [1.0_wp, 1.0_wp, real(k, wp)]
      body%mesh%x(:, 4*k + 4) = [0.0_wp, 1.0_wp, real(k, wp)]
    end do
    call set_elements(body%mesh, hex8, reshape([((4*(e - 1) + k, k=1, 8), e=1, n)], [8, n]))
    call body%elastic%start(n)
    call body%elastic%use_rule('hex8_bbar', body%elastic%rule_of(1))
    body%elastic%rule_of = 1
    do e = 1, n
      body%elastic%moduli(:, e) = lame_moduli(1000.0_wp, 0.0_wp)
    end do
    body%elastic%density = 3.0_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    body%supports%held(1:2, :) = .true.
    body%supports%held(3, 1:4) = .true.
  end subroutine make_column

  !> A displacement that is no number is found, with its node.
  subroutine not_finite()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_column(2, body)
    call body%check_finite(errors)
    call test%check('zeros are finite', .not. errors%any())
    body%state%u(2, 7) = ieee_value(1.0_wp, ieee_positive_inf)
    call body%check_finite(errors)
    call test%check('infinity is found', errors%count == 1)
    call test%check_text('its code', errors%item(1)%code, 'N304')
    call test%check('its node', index(errors%item(1)%message, 'node 7 ') > 0)
  end subroutine not_finite

  subroutine static_bar()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_column(5, body)
    call body%assemble()
    body%port%port_load(3, 21:24) = -2.5_wp
    call linear_step(body, 1.0_wp, errors)
    call test%check('no fault', .not. errors%any())
    call test%check_close('shortening F L/(E A)', body%state%u(3, 24), -0.05_wp, 1.0e-15_wp)
    call test%check_close('reaction', sum(body%state%reaction(3, :)), 10.0_wp, 1.0e-12_wp)
    call test%check_close('half the work of the load is strain energy', &
                          body%energy%strain, 0.5_wp*10.0_wp*0.05_wp, 1.0e-13_wp)
    call test%check_close('mass', sum(body%system%lumped), 15.0_wp, 1.0e-12_wp)
    call body%reject()
    call test%check('rejected', all(abs(body%state%u) <= 0.0_wp))
    call body%system%solver%mumps%free()
  end subroutine static_bar

  !> Robin springs of stiffness s slow the approach to the fixed point by s/(k + s) a step.
  subroutine robin_springs()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    real(wp), parameter :: s = 600.0_wp, k = 200.0_wp, still = -10.0_wp/k
    real(wp) :: expected
    integer(i4) :: n, c
    call make_column(5, body)
    call body%assemble()
    body%port%robin%n = 1
    body%port%robin%node = reshape([21, 22, 23, 24], [4, 1])
    body%port%robin%weight = reshape([0.25_wp, 0.25_wp, 0.25_wp, 0.25_wp], [4, 1])
    allocate (body%port%robin%stiffness(3, 3, 1), source=0.0_wp)
    do c = 1, 3
      body%port%robin%stiffness(c, c, 1) = s
    end do
    body%port%port_load(3, 21:24) = -2.5_wp
    expected = 0.0_wp
    do n = 1, 6
      call linear_step(body, real(n, wp), errors)
      call body%accept()
      expected = still + s/(k + s)*(expected - still)
      call test%check_close('Robin step', body%state%u(3, 22), expected, 1.0e-14_wp)
    end do
    call test%check('no fault', .not. errors%any())
    call test%check('one factorisation', body%system%solver%factorisations == 1)
    call body%system%solver%mumps%free()
  end subroutine robin_springs

  !> Without the base the column can fall: the fault names the translation along z.
  subroutine not_held()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    call make_column(2, body)
    body%supports%held(3, :) = .false.
    call body%assemble()
    call body%factor(1.0_wp, errors)
    call test%check('one fault', errors%count == 1)
    call test%check_text('code', errors%item(1)%code, 'I307')
    call test%check('names the motion', index(errors%item(1)%message, 'translation along z') > 0)
  end subroutine not_held

  !> One brick on its base: u = u_s (1 - cos(w_d t)), w_d = (2/dt) atan(w dt/2), w^2 = 3 E/(rho
  !! L^2).
  subroutine newmark_frequency()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    real(wp), parameter :: dt = 0.03_wp, omega = sqrt(3.0_wp*1000.0_wp/3.0_wp)
    real(wp) :: discrete, worst
    integer(i4) :: n
    call make_column(1, body)
    body%scheme%dynamic = .true.
    body%port%port_load(3, 5:8) = -2.5_wp
    call body%assemble()
    call body%factor(dt, errors)
    call start_motion(body, errors)
    discrete = 2.0_wp/dt*atan(0.5_wp*omega*dt)
    worst = 0.0_wp
    do n = 1, 200
      call linear_step(body, n*dt, errors)
      call body%accept()
      worst = larger(worst, abs(body%state%u(3, 5) + 0.01_wp*(1.0_wp - cos(discrete*n*dt))))
    end do
    call test%check('no fault', .not. errors%any())
    call test%check('discrete frequency', worst < 1.0e-12_wp)
    call test%check_close('energy', body%energy%strain + body%energy%kinetic, body%energy%load, &
      1.0e-12_wp)
    call body%system%solver%mumps%free()
  end subroutine newmark_frequency

  !> The top moves at constant velocity from rest: the support carries rho c v A until the wave is
  !! back, nothing rings, and the ledger closes. Then the same with a motion that bends.
  subroutine pushed_bar()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    integer(i4), parameter :: cubes = 60
    real(wp), parameter :: dt = 0.02_wp, v = -0.1_wp, c = sqrt(1000.0_wp/3.0_wp)
    real(wp) :: force, worst
    integer(i4) :: n, steps
    call make_column(cubes, body)
    body%scheme%dynamic = .true.
    deallocate (body%supports%motion, body%loads%curve)
    allocate (body%supports%motion(1), body%loads%curve(1))
    body%loads%curve(1)%time = [0.0_wp, 4.0_wp, 8.0_wp]
    body%loads%curve(1)%value = [0.0_wp, 4.0_wp, 6.0_wp]
    body%supports%motion(1) = fem_motion_type(3, 1, v, [(n, n=4*cubes + 1, 4*cubes + 4)])
    body%supports%held(3, body%supports%motion(1)%block) = .true.
    call body%assemble()
    force = 0.0_wp
    worst = 0.0_wp
    steps = 150  ! 3 s; the wave needs 6.6 s to return
    do n = 1, steps
      call linear_step(body, n*dt, errors)
      call body%accept()
      associate (now => sum(body%state%reaction(3, 4*cubes + 1:)))
        if (n > steps/2) force = force + now/(steps - steps/2)
        worst = larger(worst, abs(now - 3.0_wp*c*v))
      end associate
    end do
    call test%check_close('force on the pushed end', force, 3.0_wp*c*v, 0.01_wp*3.0_wp*c*abs(v))
    call test%check('nothing rings', worst < 0.3_wp*3.0_wp*c*abs(v))
    call test%check_close('velocity of the end', body%state%v(3, 4*cubes + 1), v, 1.0e-13_wp)
    do n = steps + 1, 3*steps
      call linear_step(body, n*dt, errors)
      call body%accept()
    end do
    call test%check('no fault when pushed', .not. errors%any())
    call test%check_close('work of the support', body%energy%support, &
                          body%energy%strain + body%energy%kinetic, &
                          1.0e-11_wp*body%energy%support)
    call body%system%solver%mumps%free()
  end subroutine pushed_bar
end program test_fem_body
