!> Ellipticity of the micromorphic solid: it is lost where a plane wave finds a direction n in which
!!   det Q(n) <= 0,  Q(n) = [P,F n n, P,G n n; R,F n n, R,G n n],
!! the acoustic matrix (12, 12) of displacements and micro-deformations from the tangent of the
!! forces, or that of displacements alone (3, 3) where the gradient has no moduli (theory:
!! micromorphic plasticity). From there on a band may form whose width no length of the law sets.
!! eq. F.16
module fem_mm_ellipticity
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgetrf
  implicit none
  private
  public :: least_determinant, determinant_along

  integer(i4), parameter :: directions = 150   !! on half a sphere, some seven degrees apart
  integer(i4), parameter :: rounds = 12        !! of the search around the best one
  real(wp), parameter :: first_turn = 0.06_wp  !! of that search [rad]
  real(wp), parameter :: golden = 2.399963229728653_wp  !! angle of a spiral of even density [rad]

contains

  !> Least det Q(n), and its direction.
  subroutine least_determinant(tangent, gradient, least, normal)
    real(wp), intent(in) :: tangent(45, 45)
    logical, intent(in) :: gradient        !! the gradient has moduli
    real(wp), intent(out) :: least
    real(wp), intent(out) :: normal(3)
    real(wp) :: n(3), height, here, turn, side(3, 2)
    integer(i4) :: k, j

    least = huge(1.0_wp)
    normal = 0.0_wp
    do k = 1, directions
      height = (k - 0.5_wp)/directions
      n = [sqrt(1.0_wp - height**2)*[cos(golden*k), sin(golden*k)], height]
      call look(n)
    end do
    turn = first_turn
    do k = 1, rounds
      side = across(normal)
      here = least
      do j = 1, 4
        n = normal + merge(turn, -turn, mod(j, 2) == 0)*side(:, (j + 1)/2)
        call look(n/norm2(n))
      end do
      if (.not. least < here) turn = 0.5_wp*turn
    end do

  contains

    subroutine look(direction)
      real(wp), intent(in) :: direction(3)
      real(wp) :: det
      det = determinant_along(tangent, direction, gradient)
      if (det >= least) return
      least = det
      normal = direction
    end subroutine look
  end subroutine least_determinant

  !> Two directions at right angles to n and to each other.
  pure function across(n) result(side)
    real(wp), intent(in) :: n(3)
    real(wp) :: side(3, 2)
    real(wp) :: a(3)
    a = 0.0_wp
    a(minloc(abs(n), 1)) = 1.0_wp
    a = a - dot_product(a, n)*n
    side(:, 1) = a/norm2(a)
    side(:, 2) = [n(2)*side(3, 1) - n(3)*side(2, 1), n(3)*side(1, 1) - n(1)*side(3, 1), &
                  n(1)*side(2, 1) - n(2)*side(1, 1)]
  end function across

  !> det Q(n).
  real(wp) function determinant_along(tangent, n, gradient) result(det)
    real(wp), intent(in) :: tangent(45, 45), n(3)
    logical, intent(in) :: gradient
    real(wp) :: columns(45, 12), q(12, 12)
    integer(i4) :: pivot(12), info, many, k
    many = merge(12, 3, gradient)
    columns = along(tangent, n)
    q = transpose(along(transpose(columns), n))
    call dgetrf(many, many, q, 12, pivot, info)
    det = 0.0_wp
    if (info /= 0) return
    det = 1.0_wp
    do k = 1, many
      det = det*q(k, k)
      if (pivot(k) /= k) det = -det
    end do
  end function determinant_along

  !> Columns of F_iI = a_i n_I and of chi_iK,L = b_iK n_L, from those of the 45 numbers of a motion.
  pure function along(rows, n) result(columns)
    real(wp), intent(in) :: rows(:, :)  !! (any, 45)
    real(wp), intent(in) :: n(3)
    real(wp) :: columns(size(rows, 1), 12)
    integer(i4) :: i
    columns = 0.0_wp
    do i = 1, 3
      columns(:, :3) = columns(:, :3) + n(i)*rows(:, 3*i - 2:3*i)
      columns(:, 4:) = columns(:, 4:) + n(i)*rows(:, 9*i + 10:9*i + 18)
    end do
  end function along
end module fem_mm_ellipticity
