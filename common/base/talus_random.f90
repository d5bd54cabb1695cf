!> Random numbers as hashes of what they are for: no generator, no state, the same in any order.
module talus_random
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t, c_int64_t
  use talus_kinds, only: wp, i8
  implicit none
  private
  public :: uniform, random_turn

  interface
    pure real(c_double) function c_uniform(key, count) bind(c, name='talus_c_uniform')
      import :: c_double, c_int32_t, c_int64_t
      integer(c_int64_t), intent(in) :: key(*)
      integer(c_int32_t), value :: count
    end function c_uniform
  end interface

contains

  !> From 0 (included) to 1 (excluded), uniform; another number for every other key.
  pure real(wp) function uniform(key)
    integer(i8), intent(in) :: key(:)
    uniform = c_uniform(key, size(key, kind=c_int32_t))
  end function uniform

  !> A unit quaternion w, x, y, z, uniform over all rotations (Shoemake 1992).
  pure function random_turn(key) result(quat)
    integer(i8), intent(in) :: key(:)
    real(wp) :: quat(4)
    real(wp), parameter :: circle = 2.0_wp*acos(-1.0_wp)
    real(wp) :: part, first, second
    part = uniform([key, 1_i8])
    first = circle*uniform([key, 2_i8])
    second = circle*uniform([key, 3_i8])
    quat = [sqrt(part)*cos(second), sqrt(1.0_wp - part)*sin(first), &
            sqrt(1.0_wp - part)*cos(first), sqrt(part)*sin(second)]
  end function random_turn
end module talus_random
