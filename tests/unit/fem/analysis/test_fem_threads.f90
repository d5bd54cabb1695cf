!> The same bits for any number of threads: products, sums, preconditioned iterations, explicit
!! steps.
program test_fem_threads
  use, intrinsic :: omp_lib, only: omp_set_num_threads
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_cg, only: cg_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_micropolar, only: lame_moduli
  use fem_sparse, only: multiply
  use fem_start, only: start_motion
  use fem_central, only: central_step
  use fem_topology, only: set_elements
  use fem_vectors, only: dot
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 13                    !! elements along an edge
  integer(i4), parameter :: threads(4) = [1, 2, 3, 7]

  call products()
  call iterations()
  call explicit_steps('hex8_full', .false.)
  call explicit_steps('hex8_full', .true.)
  call explicit_steps('hex8/hex8', .false.)
  call explicit_steps('hex8_one_point', .false.)
  call test%finish()

contains

  !> A cube of n^3 skewed elements, numbered along x, y, z, held at z = 0.
  subroutine make_cube(rule, body)
    character(len=*), intent(in) :: rule
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
    e = 0
    do k = 0, n - 1
      do j = 0, n - 1
        do i = 0, n - 1
          e = e + 1
          connectivity(:, e) = 1 + i + (n + 1)*(j + (n + 1)*k) + step
        end do
      end do
    end do
    call set_elements(body%mesh, hex8, connectivity)
    call body%elastic%start(n**3)
    call body%elastic%use_rule(rule, r)
    body%elastic%rule_of = r
    do e = 1, n**3
      body%elastic%moduli(:, e) = lame_moduli(1000.0_wp, 0.3_wp)
      if (body%elastic%rule(r)%polar) &
        body%elastic%moduli(3:, e) = [80.0_wp, 5.0_wp, 10.0_wp, 40.0_wp]
    end do
    body%elastic%density = 3.0_wp
    body%elastic%inertia = 0.2_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    body%supports%held(:, :(n + 1)**2) = .true.
    body%loads%gravity = [0.3_wp, -0.2_wp, -9.81_wp]
  end subroutine make_cube

  !> Pseudo-random numbers.
  pure function noise(blocks) result(u)
    integer(i4), intent(in) :: blocks
    real(wp) :: u(3, blocks)
    integer(i4) :: i
    u = reshape([(sin(7.3_wp*i)*1.0e-3_wp**modulo(i, 3), i=1, 3*blocks)], [3, blocks])
  end function noise

  logical function same(a, b)
    real(wp), intent(in) :: a(:, :), b(:, :)
    same = all(abs(a - b) <= 0.0_wp)
  end function same

  !> K u and sums.
  subroutine products()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), y(:, :), first(:, :)
    real(wp) :: total, first_total
    integer(i4) :: t, way
    do way = 1, 2
      do t = 1, size(threads)
        body = fem_body_type()
        call omp_set_num_threads(threads(t))
        call make_cube(trim(merge('hex8/hex8', 'hex8_bbar', way == 1)), body)
        call body%assemble()
        u = noise(body%dofs%blocks)
        y = u
        call multiply(body%system%pattern, body%system%k, u, y)
        total = dot(u, y)
        if (t == 1) then
          first = y
          first_total = total
          call test%check('one thread has no shares', .not. allocated(body%system%pattern%share))
        else
          call test%check('a share a thread', size(body%system%pattern%share) == threads(t))
        end if
        call test%check('product', same(y, first))
        call test%check('sum', abs(total - first_total) <= 0.0_wp)
      end do
    end do
  end subroutine products

  !> Conjugate gradients with sweeps by levels find what those of one thread find.
  subroutine iterations()
    type(fem_body_type) :: body
    type(cg_type) :: cg
    real(wp), allocatable :: x(:, :), first(:, :), y(:, :)
    logical :: found
    integer(i4) :: t, steps
    do t = 1, size(threads)
      body = fem_body_type()
      call omp_set_num_threads(threads(t))
      call make_cube('hex8_bbar', body)
      call body%assemble()
      cg = cg_type()
      cg%factors%least_rows = 1
      call cg%prepare(body%system%pattern, body%system%k, .not. body%supports%held)
      call test%check('factors', cg%factors%ready)
      x = body%system%weight_force
      call cg%solve(body%system%pattern, body%system%weight_force, 1.0e-10_wp, x, found)
      call test%check('found', found)
      if (t == 1) then
        first = x
        steps = cg%iterations
        y = x
        call multiply(body%system%pattern, body%system%k, x, y)
        call test%check('solved', max_abs(merge(0.0_wp, y - body%system%weight_force, &
                                                body%supports%held)) &
                        < 1.0e-8_wp*max_abs(body%system%weight_force))
      end if
      call test%check('iterations', cg%iterations == steps)
      call test%check('solution', same(x, first))
    end do
  end subroutine iterations

  !> Forty steps from initial velocities, with every kind of damping or none.
  subroutine explicit_steps(rule, damped)
    character(len=*), intent(in) :: rule
    logical, intent(in) :: damped
    type(fem_body_type) :: body
    type(error_list_type) :: errors
    real(wp), allocatable :: first(:, :), c(:, :, :)
    real(wp) :: energies(6), first_energies(6), limit
    integer(i4) :: t, k
    do t = 1, size(threads)
      body = fem_body_type()
      call omp_set_num_threads(threads(t))
      body%scheme%dynamic = .true.
      body%scheme%explicit = .true.
      if (damped) body%damping%mass = 0.3_wp
      if (damped) body%damping%stiffness = 1.0e-3_wp
      call make_cube(rule, body)
      if (damped) then
        c = reshape([40.0_wp, 3.0_wp, 0.0_wp, 3.0_wp, 30.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 60.0_wp], &
                    [3, 3, 1])
        call body%damping%add_face([(n + 1)**3], c)
      end if
      call body%assemble()
      body%state%v = noise(body%dofs%blocks)
      call start_motion(body, errors)
      do k = 1, 40
        call central_step(body, 0.9_wp*k*body%limit%step, errors)
        call body%accept()
      end do
      associate (e => body%accepted_energy)
        energies = [e%strain, e%kinetic, e%load, e%support, e%numerical, e%damping]
        call test%check('ledger closes', abs(e%start + e%load + e%support - e%strain - e%kinetic &
          - e%damping - e%numerical) < 1.0e-10_wp*(e%strain + e%kinetic))
      end associate
      if (t == 1) then
        first = body%accepted%u
        first_energies = energies
        limit = body%limit%step
      end if
      call test%check('step limit of '//rule, abs(body%limit%step - limit) <= 0.0_wp)
      call test%check('displacements of '//rule, same(body%accepted%u, first))
      call test%check('energies of '//rule, all(abs(energies - first_energies) <= 0.0_wp))
    end do
    call test%check('no fault', .not. errors%any())
  end subroutine explicit_steps
end program test_fem_threads
