!> Forces in the balance form (Regueiro 2010): what does work on the micro-gyration
!! nu = chi' chi^-1 in place of chi',
!!   B_jk = J (s - sigma)_kj = Q_jK chi_kK + R_jKI chi_kK,I,  M_jkI = R_jKI chi_kK,
!! B with nu and M with nu_,I. The weak form with test functions of nu's kind is another
!! discretisation of the same balance; its tangent is not symmetric.
module fem_mm_balance
  use talus_kinds, only: wp, i4
  use fem_mm_motion, only: mm_motion_type, mm_force_type, packed_force, unpacked_force
  use fem_mm_motion, only: unpacked_motion
  use fem_mm_tensor, only: leg_two, fold
  implicit none
  private
  public :: balance_forces, balance_tangent

contains

  pure function balance_forces(motion, force) result(balance)
    type(mm_motion_type), intent(in) :: motion
    type(mm_force_type), intent(in) :: force
    type(mm_force_type) :: balance
    balance%p = force%p
    balance%q = matmul(force%q, transpose(motion%chi)) + fold(force%r, motion%g)
    balance%r = leg_two(motion%chi, force%r)
  end function balance_forces

  !> Derivatives (45, 45) of `balance_forces` from those of the forces.
  pure subroutine balance_tangent(motion, force, tangent)
    type(mm_motion_type), intent(in) :: motion
    type(mm_force_type), intent(in) :: force
    real(wp), intent(inout) :: tangent(45, 45)
    type(mm_motion_type) :: direction
    type(mm_force_type) :: change
    real(wp) :: unit(45)
    integer(i4) :: k
    do k = 1, 45
      unit = 0.0_wp
      unit(k) = 1.0_wp
      direction = unpacked_motion(unit)
      change = balance_forces(motion, unpacked_force(tangent(:, k)))
      change%q = change%q + matmul(force%q, transpose(direction%chi)) + fold(force%r, direction%g)
      change%r = change%r + leg_two(direction%chi, force%r)
      tangent(:, k) = packed_force(change)
    end do
  end subroutine balance_tangent
end module fem_mm_balance
