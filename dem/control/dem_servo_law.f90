!> Control law of all servos (walls, surfaces, cells): proportional, with a slow integral. With the
!! error F_t - F of the controlled quantity, the stiffness K against the motion and the interval T
!! between updates, a servo moves at gain (F_t - F)/(K T) + v_i, never faster than its speed; v_i
!! grows by gain^2/50 (F_t - F)/(K T) per update, so that the error vanishes at a steady rate.
!! Stability is shown in dem_servo.
!! eq. D.5
module dem_servo_law
  use talus_kinds, only: wp, i4, i8
  use talus_log, only: short_number
  implicit none
  private
  public :: servo_law_type, servo_view_type, check_interval

  integer(i4), parameter :: check_interval = 10  !! between two updates
  real(wp), parameter :: integral_share = 0.02_wp

  type :: servo_law_type
    integer(i4) :: curve = 0            !! of the target, 0: constant
    real(wp) :: speed = 0.0_wp          !! most [m/s], of a cell [1/s]
    real(wp) :: gain = 0.0_wp           !! [-]
    real(wp) :: tolerance = 0.0_wp      !! of what is held at the end [-]
    integer(i8) :: looks = 0            !! of this run
    integer(i8) :: at_speed = 0         !! of these, at the speed limit
  contains
    procedure :: respond
    procedure :: reason
  end type servo_law_type

  !> What a servo sees at an update; of a cell forces are stresses [Pa], velocities rates [1/s].
  type :: servo_view_type
    real(wp) :: lack = 0.0_wp           !! F_t - F [N], over the area [Pa] if there is one
    real(wp) :: area = 1.0_wp           !! of a wall whose stress is held [m^2], else 1
    real(wp) :: stiffness = 0.0_wp      !! K of what answers [N/m]
    real(wp) :: ahead = 0.0_wp          !! T, to the next update [s]
    real(wp) :: approach = 0.0_wp       !! velocity without contacts [m/s]
  end type servo_view_type

contains

  !> Velocity until the next update.
  pure subroutine respond(self, view, held, velocity)
    class(servo_law_type), intent(inout) :: self
    type(servo_view_type), intent(in) :: view
    real(wp), intent(inout) :: held    !! v_i [m/s], of a cell [1/s]
    real(wp), intent(out) :: velocity  !! the same
    real(wp) :: own

    velocity = view%approach
    if (view%stiffness > 0.0_wp) then
      own = self%gain*view%lack*view%area/(view%stiffness*view%ahead)
      velocity = own + held
      if (abs(velocity) < self%speed) held = held + integral_share*self%gain*own
    else
      held = 0.0_wp
    end if
    self%looks = self%looks + 1
    if (abs(velocity) >= self%speed) self%at_speed = self%at_speed + 1
    velocity = min(max(velocity, -self%speed), self%speed)
  end subroutine respond

  !> Why a servo does not hold what it should, and what helps.
  subroutine reason(self, moved, unit, faster, why, hint)
    class(servo_law_type), intent(in) :: self
    character(len=*), intent(in) :: moved, unit, faster  !! 'it moved at its speed limit', ...
    character(len=:), allocatable, intent(out) :: why, hint
    why = 'it was still on its way'
    hint = 'raise t_end and continue with --restart, raise gain, or widen tolerance'
    if (2*self%at_speed <= self%looks) return
    why = moved//' of '//short_number(self%speed)//' '//unit//' in '// &
      short_number(100.0_wp*real(self%at_speed, wp)/real(self%looks, wp))//' % of its updates'
    hint = faster
  end subroutine reason
end module dem_servo_law
