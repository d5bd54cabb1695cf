!> Lowest free vibrations: subspace iteration on the factors of K + s M, s > 0 for bodies that can
!! move as rigid ones (Bathe 1996, chapter 11). The small problem is solved by LAPACK.
module fem_modal
  use talus_kinds, only: wp, i4, i8
  use talus_lapack, only: dsygv
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_body, only: fem_body_type
  use fem_sparse, only: multiply, multiply_mass, block_diagonal, mass_diagonal
  use fem_solver, only: fem_solver_type
  use fem_supports, only: check_supports
  implicit none
  private
  public :: fem_modes_type, find_modes

  integer(i4), parameter :: spare = 8              !! vectors beyond those requested
  real(wp), parameter :: shift_share = 1.0e-3_wp   !! of the rough lowest eigenvalue

  type :: fem_modes_type
    integer(i4) :: n = 0, iterations = 0
    real(wp), allocatable :: omega(:)        !! circular frequencies [rad/s]
    real(wp), allocatable :: shape(:, :, :)  !! (3, blocks, n), M-orthonormal
    real(wp), allocatable :: residual(:)     !! |K x - w^2 M x| / |K x| (of K + s M, rigid ones)
    real(wp), allocatable :: mass(:, :)      !! (3, n) effective masses along x, y, z [kg]
  end type fem_modes_type

contains

  !> The lowest `wanted` modes of the body; fault N305 if they do not converge.
  subroutine find_modes(body, wanted, tolerance, most, modes, errors)
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: wanted, most   !! number of modes, of iterations
    real(wp), intent(in) :: tolerance         !! of the eigenvalues, relative
    type(fem_modes_type), intent(out) :: modes
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :, :), values(:), before(:)
    real(wp) :: shift
    integer(i4) :: q, iteration

    call prepare(body, shift, errors)
    if (errors%any()) return
    modes%n = min(wanted, body%system%solver%free)
    q = min(modes%n + max(spare, modes%n/2), body%system%solver%free)
    call start_vectors(body, q, x)
    allocate (before(q), source=huge(1.0_wp))
    do iteration = 1, most
      call iterate(body, shift, x, values, errors)
      if (errors%any()) return
      if (all(abs(values(:modes%n) - before(:modes%n)) <= tolerance*abs(values(:modes%n)))) exit
      before = values
    end do
    modes%iterations = min(iteration, most)
    if (iteration > most) then
      call errors%add('N305', 'the '//str(modes%n)//' lowest modes have not converged in '// &
        str(most)//' iterations', '', 'raise max_iterations, or modes by a few')
      return
    end if
    modes%shape = x(:, :, :modes%n)
    modes%omega = sqrt(max(0.0_wp, values(:modes%n) - shift))
    call judge(body, shift, values, modes)
  end subroutine find_modes

  !> Factors of K + shift M; no shift where supports hold the body.
  subroutine prepare(body, shift, errors)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(out) :: shift
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: free
    real(wp), allocatable :: diagonal(:)
    logical :: fixed(3, body%dofs%blocks)

    fixed = body%supports%held .or. body%port%prescribed
    shift = 0.0_wp
    call check_supports(body%mesh, body%dofs, body%system%pattern, fixed, body%supports%ground, &
      free)
    if (free%any()) then
      diagonal = block_diagonal(body%system%pattern, body%system%k) &
        /mass_diagonal(body%system%pattern, body%system%mass)
      diagonal = diagonal(:body%mesh%nodes)
      ! frequencies fall with the square of the number of elements along the body
      shift = shift_share*sum(diagonal)/size(diagonal)/real(body%mesh%nodes, wp)**(2.0_wp/3.0_wp)
    end if
    call body%system%solver%number(body%dofs, body%system%pattern, fixed, errors)
    if (errors%any()) return
    call body%system%solver%factor(body%system%pattern, body%system%k, body%system%mass, shift, &
      errors)
    call body%system%forget_factors()
    if (body%system%solver%free == 0) call errors%add('N305', &
      'the body has no free degree of freedom', &
      '', 'leave out some &support')
  end subroutine prepare

  !> Start vectors with components along all modes, the same in every run.
  subroutine start_vectors(body, q, x)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: q
    real(wp), allocatable, intent(out) :: x(:, :, :)
    integer(i8), parameter :: factor = 16807_i8, modulus = 2147483647_i8  ! Park and Miller 1988
    integer(i8) :: seed
    integer(i4) :: i, c, k
    allocate (x(3, body%dofs%blocks, q))
    seed = 1_i8
    do k = 1, q
      do i = 1, body%dofs%blocks
        do c = 1, 3
          seed = modulo(factor*seed, modulus)
          x(c, i, k) = real(seed, wp)/real(modulus, wp) - 0.5_wp
          if (body%system%solver%equation(c, i) == 0) x(c, i, k) = 0.0_wp
        end do
      end do
    end do
  end subroutine start_vectors

  !> One inverse iteration of all vectors and the best combinations of them; values are those of
  !! K + shift M against M.
  subroutine iterate(body, shift, x, values, errors)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: shift
    real(wp), intent(inout) :: x(:, :, :)
    real(wp), allocatable, intent(out) :: values(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: right(:, :, :), work(:)
    real(wp) :: stiffness(size(x, 3), size(x, 3)), mass(size(x, 3), size(x, 3))
    integer(i4) :: k, j, q
    integer :: info

    q = size(x, 3)
    allocate (values(q), work(64*q))
    allocate (right, mold=x)
    do k = 1, q
      call multiply_mass(body%system%pattern, body%system%mass, x(:, :, k), right(:, :, k))
      where (body%system%solver%equation == 0) right(:, :, k) = 0.0_wp
      call body%system%solver%solve(body%system%pattern, right(:, :, k), x(:, :, k), errors)
      if (errors%any()) return
    end do
    do k = 1, q  ! (K + s M) x = right
      do j = 1, q
        stiffness(j, k) = sum(x(:, :, j)*right(:, :, k))
      end do
    end do
    do k = 1, q
      call multiply_mass(body%system%pattern, body%system%mass, x(:, :, k), right(:, :, k))
      do j = 1, q
        mass(j, k) = sum(x(:, :, j)*right(:, :, k))
      end do
    end do
    call dsygv(1, 'V', 'U', q, stiffness, q, mass, q, values, work, size(work), info)
    if (info /= 0) then
      call errors%add('N305', 'the reduced problem of the modes is singular (LAPACK '// &
        str(int(info, i4))//')', '', 'reduce modes')
      return
    end if
    x = reshape(matmul(reshape(x, [size(x, 1)*size(x, 2), q]), stiffness), shape(x))
  end subroutine iterate

  !> Residuals and effective masses.
  subroutine judge(body, shift, values, modes)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: shift, values(:)
    type(fem_modes_type), intent(inout) :: modes
    real(wp), dimension(3, body%dofs%blocks) :: kx, mx
    integer(i4) :: k
    allocate (modes%residual(modes%n), modes%mass(3, modes%n))
    do k = 1, modes%n
      call multiply(body%system%pattern, body%system%k, modes%shape(:, :, k), kx)
      call multiply_mass(body%system%pattern, body%system%mass, modes%shape(:, :, k), mx)
      where (body%system%solver%equation == 0)
        kx = 0.0_wp
        mx = 0.0_wp
      end where
      kx = kx + shift*mx
      modes%residual(k) = norm2(kx - values(k)*mx)/norm2(kx)
      modes%mass(:, k) = sum(mx(:, :body%mesh%nodes), 2)**2
    end do
  end subroutine judge
end module fem_modal
