!> Counting intervals of time.
module talus_intervals
  use talus_kinds, only: wp, i8
  implicit none
  private
  public :: intervals_until

  real(wp), parameter :: most = 4.0e18_wp  !! a 64-bit number holds more

contains

  !> Whole intervals of a length from 0 until a time; of more than can be counted, as many as can.
  pure integer(i8) function intervals_until(time, every) result(number)
    real(wp), intent(in) :: time, every  !! every > 0 [s]
    number = floor(min(max(time/every, -most), most), i8)
  end function intervals_until
end module talus_intervals
