!> Symmetric tensors as six components, xx yy zz xy yz zx: stresses as they are, strains with
!! engineering shears (twice the tensor's).
module fem_voigt
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: unit, twice, project, isotropic, trace, deviator, magnitude, elastic_matrix, outer

  real(wp), parameter :: unit(6) = [1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: twice(6) = [1.0_wp, 1.0_wp, 1.0_wp, 2.0_wp, 2.0_wp, 2.0_wp]
  real(wp), parameter :: half = 0.5_wp, one = 1.0_wp
  !> From a strain to the components of its deviator as those of a stress.
  real(wp), parameter :: project(6, 6) = reshape([2.0_wp/3.0_wp, -one/3.0_wp, -one/3.0_wp, 0.0_wp, &
    0.0_wp, 0.0_wp, -one/3.0_wp, 2.0_wp/3.0_wp, -one/3.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
    -one/3.0_wp, -one/3.0_wp, 2.0_wp/3.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
    half, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, half, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
    0.0_wp, 0.0_wp, half], [6, 6])
  !> unit unit'
  real(wp), parameter :: isotropic(6, 6) = reshape([unit, unit, unit, 0.0_wp*unit, 0.0_wp*unit, &
                                                    0.0_wp*unit], [6, 6])

contains

  pure real(wp) function trace(a)
    real(wp), intent(in) :: a(6)
    trace = a(1) + a(2) + a(3)
  end function trace

  !> Deviator of a stress.
  pure function deviator(stress) result(s)
    real(wp), intent(in) :: stress(6)
    real(wp) :: s(6)
    s = stress - trace(stress)/3.0_wp*unit
  end function deviator

  !> sqrt(s:s) of stress components.
  pure real(wp) function magnitude(s)
    real(wp), intent(in) :: s(6)
    magnitude = sqrt(sum(twice*s*s))
  end function magnitude

  !> Isotropic elasticity of a bulk and a shear modulus [Pa].
  pure function elastic_matrix(bulk, shear) result(c)
    real(wp), intent(in) :: bulk, shear
    real(wp) :: c(6, 6)
    c = bulk*isotropic + 2.0_wp*shear*project
  end function elastic_matrix

  !> a b'
  pure function outer(a, b) result(c)
    real(wp), intent(in) :: a(6), b(6)
    real(wp) :: c(6, 6)
    integer(i4) :: j
    do j = 1, 6
      c(:, j) = a*b(j)
    end do
  end function outer
end module fem_voigt
