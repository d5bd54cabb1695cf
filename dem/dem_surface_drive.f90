!> Surfaces that follow a curve: their velocity and spin are set anew every few steps, as those of
!! walls are (dem_servo).
module dem_surface_drive
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use dem_state, only: dem_data_type
  use dem_surface_state, only: servo_velocity
  implicit none
  private
  public :: surface_drive_type

  integer(i4), parameter :: look_steps = 10

  type :: surface_drive_type
    type(curve_type), allocatable :: curve(:)
    integer(i4), allocatable :: number(:)             !! (bodies) curve of each, 0: constant
    real(wp), allocatable :: velocity(:, :), spin(:, :)  !! (3, bodies) of the deck [m/s], [rad/s]
  contains
    procedure :: read => read_drive
    procedure :: longest_block
    procedure :: due
    procedure :: look
    procedure :: follow
  end type surface_drive_type

contains

  !> Curves of groups surface and penetrometer, in this order; a partner sets its own pace (D247).
  subroutine read_drive(self, deck, d, curve, served, errors)
    class(surface_drive_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curve(:)
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    character(len=12), parameter :: groups(2) = [character(len=12) :: 'surface', 'penetrometer']
    integer(i4) :: g, k, n, number

    allocate (self%number(0))
    do g = 1, 2
      do k = 1, deck%count(trim(groups(g)))
        call curve_index(deck, 'D250', curve, trim(groups(g)), k, number, errors)
        self%number = [self%number, number]
        if (served .and. number > 0) &
          call deck%fault(errors, 'D247', 'surfaces with curves do not work under a partner', &
                          trim(groups(g)), k, 'curve', 'give the surface a constant velocity')
      end do
    end do
    n = d%surfaces%n
    if (n == 0 .or. n /= size(self%number)) return
    self%velocity = d%surfaces%velocity
    self%spin = d%surfaces%spin
    allocate (self%curve(size(curve)))
    do k = 1, size(curve)
      self%curve(k)%time = curve(k)%time
      self%curve(k)%value = curve(k)%value
    end do
  end subroutine read_drive

  !> Steps that may pass without a look.
  pure integer(i4) function longest_block(self)
    class(surface_drive_type), intent(in) :: self
    longest_block = merge(look_steps, huge(look_steps), any(self%number > 0))
  end function longest_block

  pure logical function due(self, steps)
    class(surface_drive_type), intent(in) :: self
    integer(i8), intent(in) :: steps  !! taken so far
    due = any(self%number > 0) .and. modulo(steps, int(look_steps, i8)) == 0
  end function due

  !> Velocities and spins for the steps to come: the mean of the curve over them.
  subroutine look(self, d, time)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: factor
    integer(i4) :: k
    do k = 1, size(self%number)
      if (self%number(k) == 0) cycle
      factor = self%curve(self%number(k))%mean(time, time + look_steps*d%par%dt)
      d%surfaces%velocity(:, k) = factor*self%velocity(:, k)
      d%surfaces%spin(:, k) = factor*self%spin(:, k)
      if (allocated(d%surfaces%servo)) &
        d%surfaces%velocity(:, k) = d%surfaces%velocity(:, k) + &
        d%surfaces%servo(servo_velocity:servo_velocity + 2, k)
    end do
  end subroutine look

  !> A deck that is not that of the checkpoint: its velocities and spins hold from now on.
  subroutine follow(self, d, time)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    if (.not. allocated(self%velocity)) return
    d%surfaces%velocity = self%velocity
    d%surfaces%spin = self%spin
    if (allocated(d%surfaces%servo)) d%surfaces%servo(servo_velocity:servo_velocity + 2, :) = 0.0_wp
    call self%look(d, time)
  end subroutine follow
end module dem_surface_drive
