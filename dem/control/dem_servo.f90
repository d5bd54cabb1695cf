!> Walls that follow a curve or hold a stress: their velocity is updated every few steps.
!!
!! A servo is proportional, with a slow integral: with the force F on its wall since the last
!! update, the target F_t and the sum K of the normal stiffnesses of the wall's contacts, it moves
!! at gain (F_t - F)/(K T) + v_i, T the interval between updates, but never faster than its speed; a
!! wall without contacts approaches at its speed. v_i grows by gain^2/50 (F_t - F)/(K T) per update,
!! so that the error vanishes while the specimen is sheared at a steady rate. The specimen behind
!! the wall is softer than its contacts: without v_i a gain below one cannot overshoot, and v_i is
!! damped as long as the specimen has more than a fiftieth of the contacts' stiffness. Updates are
!! made at whole multiples of steps: results depend neither on threads nor on restarts.
module dem_servo
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, read_curves, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use dem_state, only: dem_data_type, seen_size => servo_seen_size
  use dem_pore_side, only: wall_pressure, wall_stiffness
  use dem_servo_law, only: servo_law_type, servo_view_type, check_interval
  use dem_surface_servo, only: surface_servo_type
  use dem_volume, only: constant_volume_type
  implicit none
  private
  public :: dem_servo_type, measured_area

  real(wp), parameter :: parallel = 1.0e-9_wp
  character(len=14), parameter :: columns(7) = [character(len=14) :: 'time [s]', 'wall [-]', &
    'area [m2]', 'target [Pa]', 'stress [Pa]', 'velocity [m/s]', 'position [m]']

  type, extends(servo_law_type) :: servo_wall_type
    integer(i4) :: wall = 0            !! plane
    real(wp) :: stress = 0.0_wp        !! target, pressure is positive [Pa]
    real(wp) :: area = 0.0_wp          !! [m^2]; 0: measured
    logical :: total = .false.         !! of grains and liquid together
    real(wp) :: until = 0.0_wp         !! from then on the wall has its own velocity [s]
  end type servo_wall_type

  type :: dem_servo_type
    type(string_type), allocatable :: name(:)      !! of the walls
    type(curve_type), allocatable :: curve(:)
    integer(i4), allocatable :: wall_curve(:)      !! (walls) 0: constant velocity
    real(wp), allocatable :: wall_velocity(:, :)   !! (3, walls) of the deck [m/s]
    type(servo_wall_type), allocatable :: servo(:)
    type(surface_servo_type) :: surfaces
    type(constant_volume_type) :: volume
    type(history_type) :: history
  contains
    procedure :: read => read_servos
    procedure :: active
    procedure :: longest_block
    procedure :: due
    procedure :: start
    procedure :: update
    procedure :: satisfied
    procedure :: judge
    procedure :: open => open_history
    procedure :: write => write_rows
    procedure :: flush => flush_histories
    procedure :: close => close_histories
    procedure, private :: set_servo
    procedure, private :: error_of
  end type dem_servo_type

contains

  !> Groups curve and servo, and the curves of walls; a partner sets its own pace (D247).
  subroutine read_servos(self, deck, d, names, served, errors)
    class(dem_servo_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(string_type), intent(in) :: names(:)  !! of the walls
    logical, intent(in) :: served
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, n

    self%name = names
    call read_curves(deck, 'D250', self%curve, errors)
    allocate (self%wall_curve(size(names)), source=0)
    n = count([(.not. deck%given('servo', k, 'surface'), k=1, deck%count('servo'))])
    allocate (self%servo(n))
    call self%surfaces%read(deck, d, self%curve, errors)
    if (d%planes%n /= size(names)) return  ! walls had faults
    self%wall_velocity = d%planes%velocity
    do k = 1, size(names)
      call curve_index(deck, 'D250', self%curve, 'wall', k, self%wall_curve(k), errors)
    end do
    call self%volume%read(deck, d, names, errors)
    if (served .and. self%active()) &
      call deck%fault(errors, 'D247', 'walls with curves, servos or a constant volume do not '// &
                      'work under a partner', merge('servo', 'wall ', deck%count('servo') > 0), &
                      1, '', 'give the walls constant velocities')
    n = 0
    do k = 1, deck%count('servo')
      if (deck%given('servo', k, 'surface')) cycle
      n = n + 1
      call read_servo(self, deck, d, k, self%servo(n), errors)
    end do
  end subroutine read_servos

  !> One group servo of a wall (D251).
  subroutine read_servo(self, deck, d, k, servo, errors)
    type(dem_servo_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k
    type(servo_wall_type), intent(inout) :: servo
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: j

    call deck%get('servo', k, 'wall', name)
    call deck%get('servo', k, 'stress', servo%stress)
    call deck%get('servo', k, 'area', servo%area)
    call deck%get('servo', k, 'speed', servo%speed)
    call deck%get('servo', k, 'gain', servo%gain)
    call deck%get('servo', k, 'tolerance', servo%tolerance)
    call deck%get('servo', k, 'total', servo%total)
    servo%until = huge(1.0_wp)
    if (deck%given('servo', k, 'until')) call deck%get('servo', k, 'until', servo%until)
    call curve_index(deck, 'D250', self%curve, 'servo', k, servo%curve, errors)
    j = findloc([(self%name(j)%s == name, j=1, size(self%name))], .true., 1)
    if (j == 0) then
      call deck%fault(errors, 'D251', "there is no wall '"//name//"'", 'servo', k, 'wall', &
                      'walls of this deck:'//listed(self%name))
      return
    end if
    if (any(self%servo%wall == j)) &
      call deck%fault(errors, 'D251', "wall '"//name//"' has two servos", 'servo', k, 'wall', &
                      'one servo a wall')
    servo%wall = j
    if (any(abs(d%planes%velocity(:, servo%wall)) > 0.0_wp) .and. &
        .not. deck%given('servo', k, 'until')) &
      call deck%fault(errors, 'D251', "wall '"//name//"' has a velocity and a servo", 'servo', &
                      k, 'wall', 'leave the velocity out, or give the end of the servo')
    if (.not. servo%area > 0.0_wp .and. .not. measured_area(d, servo%wall) > 0.0_wp) &
      call deck%fault(errors, 'D251', "the area of wall '"//name//"' cannot be measured: it "// &
                      'needs two pairs of opposite walls, at right angles to it and to '// &
                      'each other', 'servo', k, 'area', 'give area = ... in m2')
  end subroutine read_servo

  pure function listed(names) result(text)
    type(string_type), intent(in) :: names(:)
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = ''
    if (size(names) == 0) text = ' none'
    do k = 1, size(names)
      text = text//" '"//names(k)%s//"'"
    end do
  end function listed

  !> Area between the two pairs of opposite planes at right angles to a plane and to each other
  !! [m^2]; 0 if there are no such two pairs or more than two.
  pure real(wp) function measured_area(d, wall) result(area)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: wall
    integer(i4) :: i, j, pairs
    real(wp) :: across(3)

    pairs = 0
    area = 1.0_wp
    across = 0.0_wp
    associate (p => d%planes)
      do i = 1, p%n
        if (abs(dot_product(p%normal(:, i), p%normal(:, wall))) > parallel) cycle
        do j = i + 1, p%n
          if (dot_product(p%normal(:, i), p%normal(:, j)) > parallel - 1.0_wp) cycle
          if (abs(dot_product(p%normal(:, i), across)) > parallel) pairs = 3
          across = p%normal(:, i)
          pairs = pairs + 1
          area = area*dot_product(p%point(:, j) - p%point(:, i), p%normal(:, i))
        end do
      end do
    end associate
    if (pairs /= 2) area = 0.0_wp
  end function measured_area

  pure logical function active(self)
    class(dem_servo_type), intent(in) :: self
    active = size(self%servo) > 0 .or. any(self%wall_curve > 0) .or. self%volume%active .or. &
      self%surfaces%active()
  end function active

  !> Largest number of steps without an update.
  pure integer(i4) function longest_block(self)
    class(dem_servo_type), intent(in) :: self
    longest_block = merge(check_interval, huge(check_interval), self%active())
  end function longest_block

  pure logical function due(self, steps)
    class(dem_servo_type), intent(in) :: self
    integer(i8), intent(in) :: steps  !! taken so far
    due = self%active() .and. modulo(steps, int(check_interval, i8)) == 0
  end function due

  !> First velocities of a fresh run, or of servos that the checkpoint does not contain.
  subroutine start(self, d, time, stiffness)
    class(dem_servo_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp), intent(in) :: stiffness(:)  !! of the contacts of each plane [N/m]
    logical :: fresh
    if (.not. self%active()) return
    fresh = .not. allocated(d%servo_seen)
    if (fresh) then
      allocate (d%servo_seen(seen_size, d%planes%n), source=0.0_wp)
      d%servo_seen(:3, :) = d%planes%impulse
      d%servo_seen(4, :) = time
    end if
    if (self%surfaces%active() .and. .not. allocated(d%surfaces%servo)) then
      call self%surfaces%start(d, time)
      fresh = .true.
    end if
    if (fresh) call self%update(d, time, stiffness)
  end subroutine start

  !> Velocities for the steps to come.
  subroutine update(self, d, time, stiffness)
    class(dem_servo_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp), intent(in) :: stiffness(:)  !! of the contacts of each plane [N/m]
    integer(i4) :: k
    real(wp) :: ahead

    ahead = check_interval*d%par%dt
    d%planes%velocity = self%wall_velocity
    do k = 1, size(self%wall_curve)
      if (self%wall_curve(k) == 0) cycle
      d%planes%velocity(:, k) = self%wall_velocity(:, k) &
                                *self%curve(self%wall_curve(k))%mean(time, time + ahead)
    end do
    do k = 1, size(self%servo)
      if (time < self%servo(k)%until) &
        call self%set_servo(k, d, time, ahead, stiffness)
    end do
    call self%volume%set(d, time, ahead)
    call self%surfaces%update(d, time, self%curve)
  end subroutine update

  !> Velocity of servo k.
  subroutine set_servo(self, k, d, time, ahead, stiffness)
    class(dem_servo_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time, ahead   !! now, and to the next update [s]
    real(wp), intent(in) :: stiffness(:)  !! of the contacts of each plane [N/m]
    real(wp) :: force(3), area, velocity, stiff

    associate (servo => self%servo(k), p => d%planes, seen => d%servo_seen(:, self%servo(k)%wall))
      force = p%force(:, servo%wall)
      if (time > seen(4)) force = (p%impulse(:, servo%wall) - seen(:3))/(time - seen(4))
      area = servo%area
      if (.not. area > 0.0_wp) area = measured_area(d, servo%wall)
      seen(:3) = p%impulse(:, servo%wall)
      seen(4) = time
      seen(5) = -dot_product(force, p%normal(:, servo%wall))/area
      stiff = stiffness(servo%wall)
      if (servo%total) then
        seen(5) = seen(5) + wall_pressure(d%pore, servo%wall)
        stiff = stiff + wall_stiffness(d%pore, servo%wall, area)
      end if
      seen(6) = servo%stress
      if (servo%curve > 0) seen(6) = servo%stress*self%curve(servo%curve)%at(time)
      call servo%respond(servo_view_type(seen(6) - seen(5), area, stiff, ahead, servo%speed), &
                         seen(7), velocity)
      p%velocity(:, servo%wall) = velocity*p%normal(:, servo%wall)
    end associate
  end subroutine set_servo

  !> Relative error of the stress of servo k at the last update.
  pure real(wp) function error_of(self, k, d)
    class(dem_servo_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(in) :: d
    associate (seen => d%servo_seen(:, self%servo(k)%wall))
      error_of = abs(seen(5) - seen(6))/max(abs(seen(6)), tiny(1.0_wp))
    end associate
  end function error_of

  !> Every servo holds its stress.
  pure logical function satisfied(self, d)
    class(dem_servo_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i4) :: k
    satisfied = self%surfaces%satisfied(d)
    do k = 1, size(self%servo)
      satisfied = satisfied .and. (self%error_of(k, d) <= self%servo(k)%tolerance .or. &
                                   self%servo(k)%until < huge(1.0_wp))
    end do
  end function satisfied

  !> Report servos that do not hold their stress at the end of the run, with error and cause (N204).
  subroutine judge(self, d, time, stiffness, place, errors)
    class(dem_servo_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: time          !! of the end [s]
    real(wp), intent(in) :: stiffness(:)  !! of the contacts of each plane [N/m]
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    character(len=:), allocatable :: why, hint

    do k = 1, size(self%servo)
      associate (servo => self%servo(k), seen => d%servo_seen(:, self%servo(k)%wall))
        if (self%error_of(k, d) <= servo%tolerance) cycle
        if (servo%until <= time) cycle
        call servo%reason('it moved at its speed limit', 'm/s', 'raise speed or t_end, or '// &
          'check whether the grains run away from the wall', why, hint)
        if (.not. stiffness(servo%wall) > 0.0_wp) why = why//', and it touches no grain'
        call errors%add('N204', "servo of wall '"//self%name(servo%wall)%s//"' ended at "// &
                        short_number(seen(5))//' Pa instead of '//short_number(seen(6))// &
                        ' Pa: '//why, place, hint)
      end associate
    end do
    call self%surfaces%judge(d, time, place, errors)
  end subroutine judge

  !> Begin <stem>_servos.csv, or go on in it after a restart at time >= 0.
  subroutine open_history(self, stem, time, errors)
    class(dem_servo_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    call self%surfaces%open(stem, time, errors)
    if (size(self%servo) == 0) return
    call self%history%begin(stem//'_servos.csv', columns, time, errors)
  end subroutine open_history

  !> One row per servo: values of its last update, and its present position.
  subroutine write_rows(self, time, d, errors)
    class(dem_servo_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: area
    integer(i4) :: k
    call self%surfaces%write(time, d, errors)
    if (.not. self%history%is_open()) return
    do k = 1, size(self%servo)
      associate (servo => self%servo(k), p => d%planes)
        area = servo%area
        if (.not. area > 0.0_wp) area = measured_area(d, servo%wall)
        call self%history%write([time, real(servo%wall, wp), area, d%servo_seen(6, servo%wall), &
                                 d%servo_seen(5, servo%wall), &
                                 dot_product(p%velocity(:, servo%wall), p%normal(:, servo%wall)), &
                                 dot_product(p%point(:, servo%wall), p%normal(:, servo%wall))], &
                                errors)
      end associate
    end do
  end subroutine write_rows

  subroutine flush_histories(self, errors)
    class(dem_servo_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%flush(errors)
    call self%surfaces%history%flush(errors)
  end subroutine flush_histories

  subroutine close_histories(self, errors)
    class(dem_servo_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%close(errors)
    call self%surfaces%history%close(errors)
  end subroutine close_histories
end module dem_servo
