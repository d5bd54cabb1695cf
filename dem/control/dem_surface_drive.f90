!> Surfaces that follow a curve or motions: their velocity and spin are updated every few steps, as
!! those of walls are (dem_servo), and so are the loads of free bodies.
module dem_surface_drive
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use dem_ledger, only: staggering_of, follow_load
  use dem_state, only: dem_data_type
  use dem_ellipsoid, only: quaternion_from_rotation
  use dem_membrane, only: set_pressure, set_pressures
  use dem_surface_body, only: is_free, set_load, set_loads
  use dem_surface_paths, only: motion_type, read_motions, moved, mean_motion
  use dem_surface_state, only: servo_velocity, is_bore
  use dem_surface_values, only: set_velocity, stop_servos
  implicit none
  private
  public :: surface_drive_type

  integer(i4), parameter :: check_interval = 10

  type :: surface_drive_type
    type(curve_type), allocatable :: curve(:)
    integer(i4), allocatable :: number(:)             !! (bodies) curve of each, 0: constant
    real(wp), allocatable :: velocity(:, :), spin(:, :)  !! (3, bodies) of the deck [m/s], [rad/s]
    type(motion_type), allocatable :: motion(:)
    integer(i4), allocatable :: loading(:)            !! (bodies) curve of its load, 0: constant
    real(wp), allocatable :: load(:, :)               !! (6, bodies) of the deck [N], [N m]
    integer(i4), allocatable :: pressing(:)           !! (bodies) curve of its pressure, 0: constant
    real(wp), allocatable :: pressure(:)              !! (bodies) of the deck [Pa]
  contains
    procedure :: read => read_drive
    procedure :: longest_block
    procedure :: due
    procedure :: update
    procedure :: follow
    procedure, private :: read_loads
    procedure, private :: moves
    procedure, private :: own_motion
    procedure, private :: load_bodies
  end type surface_drive_type

contains

  !> Curves of groups surface, penetrometer and cylinder, in this order; a partner sets its own pace
  !! (D247).
  subroutine read_drive(self, deck, d, curve, served, errors)
    class(surface_drive_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curve(:)
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    character(len=12), parameter :: groups(3) = [character(len=12) :: 'surface', &
      'penetrometer', 'cylinder']
    integer(i4) :: g, k, n, number

    allocate (self%number(0))
    do g = 1, size(groups)
      do k = 1, deck%count(trim(groups(g)))
        call curve_index(deck, 'D250', curve, trim(groups(g)), k, number, errors)
        self%number = [self%number, number]
        if (served .and. number > 0) &
          call deck%fault(errors, 'D247', 'surfaces with curves do not work under a partner', &
                          trim(groups(g)), k, 'curve', 'give the surface a constant velocity')
      end do
    end do
    n = d%surfaces%n
    self%number = [self%number, (0_i4, k=1, deck%count('membrane'))]
    call read_motions(deck, d%surfaces, curve, self%motion, errors)
    if (n == 0 .or. n /= size(self%number)) return
    self%velocity = d%surfaces%velocity
    self%spin = d%surfaces%spin
    allocate (self%curve(size(curve)))
    do k = 1, size(curve)
      self%curve(k)%time = curve(k)%time
      self%curve(k)%value = curve(k)%value
    end do
    if (served .and. size(self%motion) > 0) &
      call deck%fault(errors, 'D247', 'surfaces with motions do not work under a partner', &
                      'motion', 1, '', 'give the surface a constant velocity')
    call self%read_loads(deck, d, curve, errors)
  end subroutine read_drive

  !> Curves of the loads of free bodies.
  subroutine read_loads(self, deck, d, curve, errors)
    class(surface_drive_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k, b, number

    if (allocated(d%surfaces%membranes)) then
      self%pressure = d%surfaces%membranes%pressure
      allocate (self%pressing(d%surfaces%n), source=0_i4)
      do k = 1, deck%count('membrane')
        b = d%surfaces%n - deck%count('membrane') + k
        call curve_index(deck, 'D250', curve, 'membrane', k, self%pressing(b), errors)
      end do
    end if
    if (.not. allocated(d%surfaces%rigid%given)) return
    self%load = d%surfaces%rigid%given
    allocate (self%loading(d%surfaces%n), source=0_i4)
    do k = 1, deck%count('body')
      call curve_index(deck, 'D250', curve, 'body', k, number, errors)
      call deck%get('body', k, 'surface', name)
      do b = 1, d%surfaces%n
        if (d%surfaces%name(b)%s == name) self%loading(b) = number
      end do
    end do
  end subroutine read_loads

  !> Largest number of steps without an update.
  pure integer(i4) function longest_block(self)
    class(surface_drive_type), intent(in) :: self
    longest_block = merge(check_interval, huge(check_interval), any(self%number > 0))
    if (allocated(self%motion)) &
      longest_block = merge(check_interval, longest_block, size(self%motion) > 0)
    if (allocated(self%loading)) &
      longest_block = merge(check_interval, longest_block, any(self%loading > 0))
    if (allocated(self%pressing)) &
      longest_block = merge(check_interval, longest_block, any(self%pressing > 0))
  end function longest_block

  pure logical function due(self, steps)
    class(surface_drive_type), intent(in) :: self
    integer(i8), intent(in) :: steps  !! taken so far
    due = self%longest_block() == check_interval .and. modulo(steps, int(check_interval, i8)) == 0
  end function due

  !> Velocities and spins for the steps to come: the mean of the curve over them.
  subroutine update(self, d, time)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: velocity(3), spin(3)
    integer(i4) :: k
    call self%load_bodies(d, time)
    if (allocated(self%pressing)) then
      do k = 1, size(self%pressing)
        if (self%pressing(k) == 0) cycle
        call set_pressure(d%surfaces, k, self%pressure(k) &
          *self%curve(self%pressing(k))%mean(time, time + check_interval*d%par%dt))
      end do
    end if
    do k = 1, size(self%number)
      if (self%number(k) == 0 .and. .not. self%moves(k)) cycle
      call self%own_motion(d, k, time, velocity, spin)
      call prescribe(d, k, velocity, spin)
      if (allocated(d%surfaces%servo) .and. .not. is_bore(d%surfaces, k)) &
        call set_velocity(d%surfaces, k, d%surfaces%velocity(:, k) + &
                          d%surfaces%servo(servo_velocity:servo_velocity + 2, k))
    end do
  end subroutine update

  !> Has body k motions?
  pure logical function moves(self, k)
    class(surface_drive_type), intent(in) :: self
    integer(i4), intent(in) :: k
    moves = .false.
    if (allocated(self%motion)) moves = any(self%motion%body == k)
  end function moves

  !> Velocity [m/s] and spin [rad/s] of body k for the steps to come, those of its own group and its
  !! motions.
  pure subroutine own_motion(self, d, k, time, velocity, spin)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: time  !! [s]
    real(wp), intent(out) :: velocity(3), spin(3)
    real(wp) :: centre(3), turn(4), lasting, factor

    lasting = check_interval*d%par%dt
    factor = 1.0_wp
    if (self%number(k) > 0) factor = self%curve(self%number(k))%mean(time, time + lasting)
    velocity = factor*self%velocity(:, k)
    spin = factor*self%spin(:, k)
    if (.not. self%moves(k)) return
    centre = d%surfaces%centre(:, k) + lasting*velocity
    turn = quaternion_from_rotation(lasting*spin)
    call moved(self%motion, self%curve, k, time, time + lasting, centre, turn)
    call mean_motion(centre - d%surfaces%centre(:, k), turn, lasting, velocity, spin)
  end subroutine own_motion

  !> Velocity and spin of body k where it is not free.
  pure subroutine prescribe(d, k, velocity, spin)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: velocity(3), spin(3)
    logical :: held(6)
    held = .true.
    if (is_free(d%surfaces, k)) held = d%surfaces%rigid%free(:, k) < 0.5_wp
    call set_velocity(d%surfaces, k, merge(velocity, d%surfaces%velocity(:, k), held(:3)), &
                      merge(spin, d%surfaces%spin(:, k), held(4:)))
  end subroutine prescribe

  !> Loads of free bodies for the steps to come; a load that jumps changes no energy.
  subroutine load_bodies(self, d, time)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: before
    integer(i4) :: k
    if (.not. allocated(self%loading)) return
    if (.not. any(self%loading > 0)) return
    before = staggering_of(d)
    do k = 1, size(self%loading)
      if (self%loading(k) == 0) cycle
      call set_load(d%surfaces, k, self%load(:, k) &
        *self%curve(self%loading(k))%mean(time, time + check_interval*d%par%dt))
    end do
    call follow_load(d, before)
  end subroutine load_bodies

  !> A deck that is not that of the checkpoint: its velocities and spins hold from now on.
  subroutine follow(self, d, time)
    class(surface_drive_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: before
    integer(i4) :: k
    if (.not. allocated(self%velocity)) return
    do k = 1, d%surfaces%n
      call prescribe(d, k, self%velocity(:, k), self%spin(:, k))
    end do
    if (allocated(self%pressure)) call set_pressures(d%surfaces, self%pressure)
    if (allocated(self%load)) then
      before = staggering_of(d)
      call set_loads(d%surfaces, self%load)
      call follow_load(d, before)
    end if
    call stop_servos(d%surfaces)
    call self%update(d, time)
  end subroutine follow
end module dem_surface_drive
