!> Step limits with mass factors: bounds against the frequencies of the assembled system, and steps
!! at and above them. Starts from initial velocities.
program test_fem_critical
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_micropolar, only: lame_moduli
  use talus_ranks, only: leave_ranks
  use fem_sparse, only: multiply, multiply_mass
  use fem_start, only: start_motion
  use fem_central, only: central_step
  use fem_linear_step, only: linear_step
  use fem_topology, only: set_elements
  implicit none
  type(test_type) :: test

  interface
    subroutine dsygv(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, info)
      import :: wp
      integer, intent(in) :: itype, n, lda, ldb, lwork
      character(len=1), intent(in) :: jobz, uplo
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      real(wp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsygv
  end interface

  call explicit_factors()
  call newmark_limit()
  call hanging_springs()
  call rotor()
  call initial_rotation()
  call leave_ranks()
  call test%finish()

contains

  !> A column of n unit cubes along z, free, E = 1000, nu = 0.2, rho = 3; polar ones with j = 0.1.
  subroutine make_column(n, rule, body)
    integer(i4), intent(in) :: n
    character(len=*), intent(in) :: rule
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
    call body%elastic%use_rule(rule, k)
    body%elastic%rule_of = k
    do e = 1, n
      body%elastic%moduli(:, e) = lame_moduli(1000.0_wp, 0.2_wp)
      if (body%elastic%rule(k)%polar) &
        body%elastic%moduli(3:, e) = [80.0_wp, 5.0_wp, 10.0_wp, 40.0_wp]
    end do
    body%elastic%density = 3.0_wp
    body%elastic%inertia = 0.1_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    body%scheme%dynamic = .true.
  end subroutine make_column

  !> Largest circular frequency of the assembled stiffness with the mass of the integration.
  real(wp) function true_frequency(body) result(omega)
    type(fem_body_type), intent(in) :: body
    real(wp), dimension(3*body%dofs%blocks, 3*body%dofs%blocks) :: k, m
    real(wp), dimension(3, body%dofs%blocks) :: unit, column
    real(wp) :: values(size(k, 1)), work(34*size(k, 1))
    integer(i4) :: i, c, n
    integer :: info
    n = size(k, 1)
    m = 0.0_wp
    do i = 1, body%dofs%blocks
      do c = 1, 3
        unit = 0.0_wp
        unit(c, i) = 1.0_wp
        call multiply(body%system%pattern, body%system%k, unit, column)
        k(:, 3*i - 3 + c) = reshape(column, [n])
        if (body%scheme%explicit) then
          m(3*i - 3 + c, 3*i - 3 + c) = body%system%lumped(i)*body%port%mass_factor(i)
        else
          call multiply_mass(body%system%pattern, body%system%mass, unit, column)
          m(:, 3*i - 3 + c) = reshape(column, [n])
        end if
      end do
    end do
    call dsygv(1, 'N', 'U', n, k, n, m, n, values, work, size(work), info)
    omega = sqrt(values(n))
  end function true_frequency

  !> Explicit steps of a kicked body; the largest displacement shows whether they were stable.
  real(wp) function kicked(body, dt) result(largest)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt
    type(error_list_type) :: errors
    integer(i4) :: i, k
    body%state%u = 0.0_wp
    body%state%time = 0.0_wp
    do i = 1, body%dofs%blocks
      body%state%v(:, i) = [1.0_wp, -0.5_wp, 0.3_wp]*(-1)**i
    end do
    call start_motion(body, errors)
    do k = 1, 400
      if (body%scheme%explicit) call central_step(body, k*dt, errors)
      if (.not. body%scheme%explicit) call linear_step(body, k*dt, errors)
      if (errors%any()) exit
      call body%accept()
      if (max_abs(body%accepted%u) > 1.0e9_wp) exit
    end do
    largest = max_abs(body%accepted%u)
    if (errors%any()) largest = huge(1.0_wp)
  end function kicked

  !> Factors below one shorten the step: the bound holds, the old one does not.
  subroutine explicit_factors()
    character(len=*), parameter :: rules(2) = [character(len=9) :: 'hex8_full', 'hex8/hex8']
    type(fem_body_type) :: body
    real(wp) :: whole, factor(100)
    integer(i4) :: i, r
    factor = [(0.05_wp + 0.9_wp*modulo(0.618_wp*i, 1.0_wp), i=1, 100)]
    do r = 1, 2
      body = fem_body_type()
      body%scheme%explicit = .true.
      call make_column(4, trim(rules(r)), body)
      call body%assemble()
      whole = body%limit%step
      body%port%mass_factor = 0.49_wp
      call body%assemble()
      call test%check_close('all masses by f: the step by its root', body%limit%step, &
                            0.7_wp*whole, 1.0e-13_wp)
      body%port%mass_factor = factor(:body%dofs%blocks)
      call body%assemble()
      call test%check('shorter', body%limit%step < 0.7_wp*whole)
      call test%check('no longer than that of the assembled system', &
                      body%limit%step <= 2.0_wp/true_frequency(body))
      call test%check('not needlessly short', body%limit%step > 1.2_wp/true_frequency(body))
      call test%check('stable at the limit', kicked(body, body%limit%step) < 10.0_wp)
      call test%check('unstable at that of the whole mass', kicked(body, whole) > 1.0e6_wp)
    end do
  end subroutine explicit_factors

  !> Newmark with beta < gamma/2: of one free element the bound is the true limit.
  subroutine newmark_limit()
    type(fem_body_type) :: body
    call make_column(1, 'hex8_full', body)
    body%scheme%beta = 0.1_wp
    body%port%mass_factor(5:8) = 0.2_wp
    call body%assemble()
    call test%check_close('limit of Newmark', body%limit%step, &
      1.0_wp/(true_frequency(body)*sqrt(0.25_wp - 0.1_wp)), 1.0e-10_wp)
    call test%check('stable below', kicked(body, 0.999_wp*body%limit%step) < 10.0_wp)
    call test%check('unstable above', kicked(body, 1.01_wp*body%limit%step) > 1.0e3_wp)
    body%scheme%beta = 0.25_wp
    body%limit%step = huge(1.0_wp)
    call body%assemble()
    call test%check('average acceleration has none', body%limit%step >= huge(1.0_wp))
    call body%system%solver%mumps%free()
  end subroutine newmark_limit

  !> Springs of the port on an explicit body count as row sums over the masses.
  subroutine hanging_springs()
    type(fem_body_type) :: body
    real(wp) :: alone
    integer(i4) :: c
    body%scheme%explicit = .true.
    call make_column(2, 'hex8_full', body)
    call body%assemble()
    alone = 2.0_wp/body%limit%step
    body%port%robin%n = 1
    body%port%robin%node = reshape([9, 10, 11, 12], [4, 1])
    body%port%robin%weight = reshape([0.4_wp, 0.3_wp, 0.2_wp, 0.1_wp], [4, 1])
    allocate (body%port%robin%stiffness(3, 3, 1), source=0.0_wp)
    do c = 1, 3
      body%port%robin%stiffness(c, c, 1) = 5.0e4_wp
    end do
    call body%limit_step()
    call test%check_close('springs in the limit', (2.0_wp/body%limit%step)**2, &
      alone**2 + 0.4_wp*5.0e4_wp/body%system%lumped(9), 1.0e-12_wp*alone**2)
  end subroutine hanging_springs

  !> A free body keeps its uniform initial velocity, and its energy is in the ledger;
  !! held nodes do not start.
  subroutine rotor()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    integer(i4) :: k, way
    do way = 1, 2
      body = fem_body_type()
      body%scheme%explicit = way == 1
      call make_column(3, 'hex8_bbar', body)
      call body%assemble()
      body%state%v(2, :) = 1.5_wp
      call start_motion(body, errors)
      call test%check_close('kinetic energy', body%energy%start, 0.5_wp*9.0_wp*2.25_wp, 1.0e-12_wp)
      do k = 1, 50
        if (body%scheme%explicit) call central_step(body, k*0.01_wp, errors)
        if (.not. body%scheme%explicit) call linear_step(body, k*0.01_wp, errors)
        call body%accept()
      end do
      call test%check('no fault', .not. errors%any())
      call test%check('moved', max_abs(body%accepted%u(2, :) - 0.75_wp) < 1.0e-12_wp)
      call test%check('straight', max_abs(body%accepted%u(1:3:2, :)) < 1.0e-12_wp)
      body%supports%held(:, 1:4) = .true.
      body%state%v(2, :) = 1.5_wp
      call body%system%forget_numbers()
      call start_motion(body, errors)
      call test%check('held nodes stay', max_abs(body%accepted%v(:, 1:4)) <= 0.0_wp)
      if (.not. body%scheme%explicit) call body%system%solver%mumps%free()
    end do
  end subroutine rotor

  !> Micro-rotations alone: phi'' = -2 kappa/(rho j) phi, a sine from an initial rate.
  subroutine initial_rotation()
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    real(wp), parameter :: omega = sqrt(2.0_wp*80.0_wp/(3.0_wp*0.1_wp)), dt = 1.0e-2_wp
    real(wp) :: discrete, worst
    integer(i4) :: k
    body%scheme%explicit = .true.
    call make_column(2, 'hex8/hex8', body)
    body%supports%held(:, :body%mesh%nodes) = .true.
    call body%assemble()
    body%state%v(3, body%mesh%nodes + 1:) = 0.2_wp
    call start_motion(body, errors)
    discrete = 2.0_wp/dt*asin(0.5_wp*omega*dt)
    worst = 0.0_wp
    do k = 1, 100
      call central_step(body, k*dt, errors)
      call body%accept()
      worst = larger(worst, max_abs(body%accepted%u(3, body%mesh%nodes + 1:) &
        - 0.2_wp*dt/sin(discrete*dt)*sin(discrete*k*dt)))
    end do
    call test%check('no fault', .not. errors%any())
    call test%check('sine of the discrete frequency', worst < 1.0e-13_wp)
  end subroutine initial_rotation
end program test_fem_critical
