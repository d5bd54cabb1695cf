!> Random numbers as hashes of what they are for: no generator, no state, the same in any order.
module talus_random
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t, c_int64_t
  use talus_kinds, only: wp, i8
  implicit none
  private
  public :: uniform, unit_number, random_turn, turn_of

  interface
    pure real(c_double) function c_uniform(key, count) bind(c, name='talus_c_uniform')
      import :: c_double, c_int32_t, c_int64_t
      integer(c_int64_t), intent(in) :: key(*)
      integer(c_int32_t), value :: count
    end function c_uniform

    pure real(c_double) function c_unit_number(id, seed) bind(c, name='talus_c_unit_number')
      import :: c_double, c_int64_t
      integer(c_int64_t), value :: id, seed
    end function c_unit_number
  end interface

contains

  !> From 0 (included) to 1 (excluded), uniform; another number for every other key.
  pure real(wp) function uniform(key)
    integer(i8), intent(in) :: key(:)
    uniform = c_uniform(key, size(key, kind=c_int32_t))
  end function uniform

  !> Between 0 and 1 (both excluded), uniform; that of an id, whatever else there is.
  pure real(wp) function unit_number(id, seed)
    integer(i8), intent(in) :: id, seed
    unit_number = c_unit_number(id, seed)
  end function unit_number

  !> A unit quaternion w, x, y, z, uniform over all rotations (Shoemake 1992).
  pure function random_turn(key) result(quat)
    integer(i8), intent(in) :: key(:)
    real(wp) :: quat(4)
    quat = turn_of([uniform([key, 1_i8]), uniform([key, 2_i8]), uniform([key, 3_i8])])
  end function random_turn

  !> The unit quaternion w, x, y, z of three numbers from 0 to 1.
  pure function turn_of(part) result(quat)
    real(wp), intent(in) :: part(3)
    real(wp) :: quat(4)
    real(wp), parameter :: circle = 2.0_wp*acos(-1.0_wp)
    real(wp) :: first, second
    first = circle*part(2)
    second = circle*part(3)
    quat = [sqrt(part(1))*cos(second), sqrt(1.0_wp - part(1))*sin(first), &
            sqrt(1.0_wp - part(1))*cos(first), sqrt(part(1))*sin(second)]
  end function turn_of
end module talus_random
