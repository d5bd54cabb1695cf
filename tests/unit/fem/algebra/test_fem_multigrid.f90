!> Multigrid against factors: symmetric, general and indefinite matrices of skewed elements with and
!! without micro-rotations; a hierarchy serves several right-hand sides; new values.
program test_fem_multigrid
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_ranks, only: leave_ranks
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_kinds, only: hex8
  use fem_micropolar, only: lame_moduli
  use fem_solver, only: fem_solver_type
  use fem_topology, only: set_elements
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 6              !! elements along an edge
  real(wp), parameter :: young = 1000.0_wp
  real(wp), parameter :: near = 1.0e-8_wp      !! residual of 1e-12 times the condition, about 1e4
  real(wp), allocatable :: k(:, :, :), lower(:, :, :)

  call compare('hex8_full', .false., 'symmetric')
  call compare('hex8_full', .true., 'general')
  call compare('hex8/hex8', .false., 'micropolar')
  call indefinite()
  call no_number()
  call leave_ranks()
  call test%finish()

contains

  !> A cube of n^3 skewed elements, held at z = 0 and along x at some nodes above.
  subroutine make_cube(rule, body, fixed)
    character(len=*), intent(in) :: rule
    type(fem_body_type), intent(inout) :: body
    logical, allocatable, intent(out) :: fixed(:, :)
    integer(i4), parameter :: step(8) = [0, 1, n + 2, n + 1, (n + 1)**2, (n + 1)**2 + 1, &
                                         (n + 1)**2 + n + 2, (n + 1)**2 + n + 1]
    integer(i4) :: connectivity(8, n**3), i, j, l, e, r
    allocate (body%mesh%x(3, (n + 1)**3), body%mesh%group(0))
    do l = 0, n
      do j = 0, n
        do i = 0, n
          body%mesh%x(:, 1 + i + (n + 1)*(j + (n + 1)*l)) = &
            [i + 0.1_wp*j, j + 0.05_wp*l + 0.1_wp*sin(2.1_wp*i*l), real(l, wp)]
        end do
      end do
    end do
    do e = 1, n**3
      i = modulo(e - 1, n)
      j = modulo((e - 1)/n, n)
      l = (e - 1)/n**2
      connectivity(:, e) = 1 + i + (n + 1)*(j + (n + 1)*l) + step
    end do
    call set_elements(body%mesh, hex8, connectivity)
    call body%elastic%start(n**3)
    call body%elastic%use_rule(rule, r)
    body%elastic%rule_of = r
    body%elastic%moduli(:2, :) = spread(lame_moduli(young, 0.3_wp), 2, n**3)
    if (index(rule, '/') > 0) then
      body%elastic%moduli(3, :) = 0.5_wp*young
      body%elastic%moduli(4:, :) = 0.2_wp*young
    end if
    body%elastic%density = 3.0_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    call body%assemble()
    allocate (fixed(3, body%dofs%blocks), source=.false.)
    fixed(:, :(n + 1)**2) = .true.
    fixed(1, (n + 1)**2 + 3:body%mesh%nodes:37) = .true.
    if (body%dofs%blocks > body%mesh%nodes) &
      fixed(:, body%mesh%nodes + 1:body%mesh%nodes + (n + 1)**2) = .true.
  end subroutine make_cube

  !> The matrix of a cube, with a part that is not symmetric if `general`.
  subroutine take_matrix(body, general)
    type(fem_body_type), intent(in) :: body
    logical, intent(in) :: general
    real(wp) :: skew(3, 3)
    integer(i4) :: i, p
    k = body%system%k
    allocate (lower(3, 3, merge(size(k, 3), 0, general)), source=0.0_wp)
    if (.not. general) return
    do i = 1, body%dofs%blocks
      do p = body%system%pattern%start(i), body%system%pattern%start(i + 1) - 1
        lower(:, :, p) = transpose(k(:, :, p))
        if (body%system%pattern%column(p) == i) cycle
        skew = 0.05_wp*young*reshape([(cos(real(p, wp)/(1 + modulo(p, 9))), p=1, 9)], [3, 3])
        k(:, :, p) = k(:, :, p) + skew
        lower(:, :, p) = lower(:, :, p) - transpose(skew)
      end do
    end do
  end subroutine take_matrix

  !> Two right-hand sides and two sets of values on one numbering.
  subroutine compare(rule, general, name)
    character(len=*), intent(in) :: rule, name
    logical, intent(in) :: general
    type(fem_body_type) :: body
    type(fem_solver_type) :: direct, grid
    type(error_list_type) :: errors
    logical, allocatable :: fixed(:, :)
    integer(i4) :: pass, side
    call make_cube(rule, body, fixed)
    call take_matrix(body, general)
    direct%mumps%general = general
    call start(grid)
    call direct%number(body%dofs, body%system%pattern, fixed, errors)
    call grid%number(body%dofs, body%system%pattern, fixed, errors)
    do pass = 1, 2
      k = pass*k
      lower = pass*lower
      call direct%factor(body%system%pattern, k, body%system%mass, 0.0_wp, errors, lower)
      call grid%factor(body%system%pattern, k, body%system%mass, 0.0_wp, errors, lower)
      do side = 1, 2
        call check_solution(name, side, body, direct, grid, fixed)
      end do
    end do
    call test%check(name//': no fault', .not. errors%any())
    call direct%drop()
    call grid%drop()
    deallocate (k, lower)
  end subroutine compare

  subroutine start(grid)
    type(fem_solver_type), intent(inout) :: grid
    grid%iterative = .true.
    grid%by_multigrid = .true.
    grid%tolerance = 1.0e-12_wp
  end subroutine start

  subroutine check_solution(name, side, body, direct, grid, fixed)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: side
    type(fem_body_type), intent(in) :: body
    type(fem_solver_type), intent(inout) :: direct, grid
    logical, intent(in) :: fixed(:, :)
    type(error_list_type) :: errors
    real(wp), dimension(3, body%dofs%blocks) :: right, wanted, found
    integer(i4) :: i
    right = reshape([(sin(real(side*i, wp)), i=1, size(right))], shape(right))
    call direct%solve(body%system%pattern, right, wanted, errors)
    call grid%solve(body%system%pattern, right, found, errors)
    call test%check(name//': no fault in solving', .not. errors%any())
    call test%check(name//': the solution', max_abs(found - wanted) < near*max_abs(wanted))
    call test%check(name//': nothing where prescribed', &
                    .not. max_abs(merge(found, 0.0_wp, fixed)) > 0.0_wp)
    call test%check(name//': iterations', grid%iterations > 0 .and. grid%iterations < 60)
    call grid%solve(body%system%pattern, 0.0_wp*right, found, errors)
    call test%check(name//': nothing for nothing', .not. max_abs(found) > 0.0_wp)
  end subroutine check_solution

  !> A shift below a few eigenvalues: the tangent of a law may be indefinite.
  subroutine indefinite()
    type(fem_body_type) :: body
    type(fem_solver_type) :: direct, grid
    type(error_list_type) :: errors
    logical, allocatable :: fixed(:, :)
    integer(i4) :: i, c
    call make_cube('hex8_full', body, fixed)
    call take_matrix(body, .false.)
    do i = 1, body%dofs%blocks
      do c = 1, 3
        associate (kii => k(c, c, body%system%pattern%start(i)))
          kii = kii - 0.02_wp*young
        end associate
      end do
    end do
    direct%mumps%general = .true.
    lower = reshape([(transpose(k(:, :, i)), i=1, size(k, 3))], shape(k))
    call start(grid)
    grid%mumps%indefinite = .true.
    call direct%number(body%dofs, body%system%pattern, fixed, errors)
    call grid%number(body%dofs, body%system%pattern, fixed, errors)
    call direct%factor(body%system%pattern, k, body%system%mass, 0.0_wp, errors, lower)
    call grid%factor(body%system%pattern, k, body%system%mass, 0.0_wp, errors)
    call check_solution('indefinite', 1, body, direct, grid, fixed)
    call direct%drop()
    call grid%drop()
    deallocate (k, lower)
  end subroutine indefinite

  !> An entry that is no number is a fault, not an endless loop.
  subroutine no_number()
    type(fem_body_type) :: body
    type(fem_solver_type) :: grid
    type(error_list_type) :: errors
    logical, allocatable :: fixed(:, :)
    call make_cube('hex8_full', body, fixed)
    call take_matrix(body, .false.)
    k(1, 1, size(k, 3)) = ieee_value(1.0_wp, ieee_quiet_nan)
    call start(grid)
    call grid%number(body%dofs, body%system%pattern, fixed, errors)
    call grid%factor(body%system%pattern, k, body%system%mass, 0.0_wp, errors)
    call test%check_text('no number', errors%item(1)%code, 'S306')
    call grid%drop()
    deallocate (k, lower)
  end subroutine no_number
end program test_fem_multigrid
