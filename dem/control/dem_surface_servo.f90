!> Surfaces that push the grains with a given force along a direction: groups servo that name a
!! surface. Faults D252, D292, N204.
!!
!! The law is that of dem_servo_law with the force F by which the body has pushed the grains along
!! its direction since the last update and the stiffness of its contacts along it; across it the
!! body moves as prescribed by the deck. The servo of a cylinder with grains inside moves its wall:
!! F is the sum of their normal forces, and a stress times the area grows with the radius.
module dem_surface_servo
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: short_number
  use talus_suggest, only: did_you_mean
  use dem_servo_law, only: servo_law_type, servo_view_type, check_interval
  use dem_state, only: dem_data_type
  use dem_surface_measure, only: body_of_part, surface_stiffness
  use dem_surface_state, only: servo_size, servo_velocity, is_bore
  use dem_surface_values, only: set_velocity, set_swell
  implicit none
  private
  public :: surface_servo_type, surface_stiffness_along

  real(wp), parameter :: across = 1.0e-9_wp  !! part of a velocity along the direction that is none
  character(len=14), parameter :: columns(6) = [character(len=14) :: 'time [s]', 'surface [-]', &
    'target [N]', 'force [N]', 'velocity [m/s]', 'position [m]']

  !> What a body's row of d%surfaces%servo holds.
  integer(i4), parameter :: seen_time = 4, seen_force = 5, seen_target = 6, seen_held = 7

  type, extends(servo_law_type) :: servo_body_type
    integer(i4) :: body = 0                !! surface, then penetrometers
    real(wp) :: force = 0.0_wp             !! target, on the grains along the direction [N]
    real(wp) :: direction(3) = 0.0_wp      !! [-]
    logical :: radial = .false.            !! the wall of a bore moves, direction is not used
    logical :: pressed = .false.           !! the target is a stress
    real(wp) :: until = 0.0_wp             !! from then on the body has its own velocity [s]
  end type servo_body_type

  type :: surface_servo_type
    type(string_type), allocatable :: name(:)       !! of all bodies
    type(servo_body_type), allocatable :: servo(:)
    real(wp), allocatable :: velocity(:, :)         !! (3, bodies) of the deck [m/s]
    logical, allocatable :: curved(:)               !! (bodies) the velocity follows a curve
    type(history_type) :: history
  contains
    procedure :: read => read_servos
    procedure :: active
    procedure :: start
    procedure :: update
    procedure :: satisfied
    procedure :: judge
    procedure :: open => open_history
    procedure :: write => write_rows
    procedure, private :: error_of
    procedure, private :: force_of
  end type surface_servo_type

contains

  !> Groups servo with the key surface (D252).
  subroutine read_servos(self, deck, d, curve, errors)
    class(surface_servo_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: instance(:)
    integer(i4) :: k

    instance = pack([(k, k=1, deck%count('servo'))], &
                    [(deck%given('servo', k, 'surface'), k=1, deck%count('servo'))])
    allocate (self%servo(size(instance)), self%name(d%surfaces%n))
    if (d%surfaces%n /= deck%count('surface') + deck%count('penetrometer') &
        + deck%count('cylinder') + deck%count('membrane')) return
    if (d%surfaces%n > 0) self%name = d%surfaces%name
    if (d%surfaces%n > 0) self%velocity = d%surfaces%velocity
    self%curved = [(deck%given('surface', k, 'curve'), k=1, deck%count('surface')), &
                   (deck%given('penetrometer', k, 'curve'), k=1, deck%count('penetrometer')), &
                   (deck%given('cylinder', k, 'curve'), k=1, deck%count('cylinder')), &
                   (.false., k=1, deck%count('membrane'))]
    do k = 1, size(instance)
      call read_servo(self, deck, d, instance(k), k, curve, errors)
    end do
  end subroutine read_servos

  subroutine read_servo(self, deck, d, instance, k, curve, errors)
    type(surface_servo_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: instance, k
    type(curve_type), intent(in) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: j

    associate (servo => self%servo(k))
      call deck%get('servo', instance, 'surface', name)
      call deck%get('servo', instance, 'speed', servo%speed)
      call deck%get('servo', instance, 'gain', servo%gain)
      call deck%get('servo', instance, 'tolerance', servo%tolerance)
      servo%until = huge(1.0_wp)
      if (deck%given('servo', instance, 'until')) &
        call deck%get('servo', instance, 'until', servo%until)
      call curve_index(deck, 'D250', curve, 'servo', instance, servo%curve, errors)
      do j = 1, size(self%name)
        if (self%name(j)%s == name) servo%body = j
      end do
      if (servo%body == 0) then
        call deck%fault(errors, 'D252', "there is no surface '"//name//"'", 'servo', instance, &
                        'surface', did_you_mean(name, self%name, 'surfaces of this deck:'))
        return
      end if
      if (any(self%servo(:k - 1)%body == servo%body)) &
        call deck%fault(errors, 'D252', "surface '"//name//"' has two servos", 'servo', instance, &
                        'surface', 'one servo a surface')
      call read_target(deck, instance, servo, errors)
      servo%pressed = deck%given('servo', instance, 'stress')
      servo%radial = is_bore(d%surfaces, servo%body)
      if (.not. servo%radial) then
        call read_direction(self, deck, instance, servo, errors)
      else if (deck%given('servo', instance, 'direction')) then
        call deck%fault(errors, 'D292', 'the servo of a cylinder with grains inside moves its '// &
                        'wall, outwards or inwards', 'servo', instance, 'direction', &
                        'leave the direction out')
      end if
    end associate
  end subroutine read_servo

  !> A force, or a stress and an area (D252).
  subroutine read_target(deck, instance, servo, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: instance
    type(servo_body_type), intent(inout) :: servo
    type(error_list_type), intent(inout) :: errors
    real(wp) :: stress, area

    if (deck%given('servo', instance, 'force')) then
      call deck%get('servo', instance, 'force', servo%force)
    else
      call deck%get('servo', instance, 'stress', stress)
      call deck%get('servo', instance, 'area', area)
      servo%force = stress*area
      if (.not. area > 0.0_wp) &
        call deck%fault(errors, 'D252', 'a stress on a surface needs its area', 'servo', instance, &
                        'stress', 'give area = ... in m2, or force in place of stress')
    end if
  end subroutine read_target

  !> Direction; across it the body may move by itself, along it not (D252).
  subroutine read_direction(self, deck, instance, servo, errors)
    type(surface_servo_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: instance
    type(servo_body_type), intent(inout) :: servo
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)

    if (.not. deck%given('servo', instance, 'direction')) then
      call deck%fault(errors, 'D252', 'the servo of a surface has no direction', 'servo', &
                      instance, '', 'give direction = ...: where the surface pushes the grains')
      return
    end if
    call deck%get('servo', instance, 'direction', values)
    if (.not. sum(values**2) > 0.0_wp) then
      call deck%fault(errors, 'D252', 'the direction of a servo has no length', 'servo', instance, &
                      'direction', 'give the direction in which the surface pushes the grains')
      return
    end if
    servo%direction = values/norm2(values)
    associate (v => self%velocity(:, servo%body))
      if (abs(dot_product(v, servo%direction)) > across*norm2(v) .and. &
          .not. deck%given('servo', instance, 'until')) &
        call deck%fault(errors, 'D252', "surface '"//self%name(servo%body)%s//"' has a "// &
                        'velocity along the direction of its servo', 'servo', instance, &
                        'direction', 'leave that part of the velocity out, or give the end '// &
                        'the servo works')
    end associate
  end subroutine read_direction

  pure logical function active(self)
    class(surface_servo_type), intent(in) :: self
    active = .false.
    if (allocated(self%servo)) active = size(self%servo) > 0
  end function active

  !> Stiffness of a body's contacts along a direction [N/m].
  pure real(wp) function surface_stiffness_along(d, body, direction) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: body
    real(wp), intent(in) :: direction(3)
    real(wp) :: pair(2), along
    integer(i4) :: g, k
    stiffness = 0.0_wp
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        if (body_of_part(d, d%surfaces%list%part(k, g)) /= body) cycle
        pair = surface_stiffness(d, k, g)
        along = dot_product(d%surfaces%list%normal(k, :, g), direction)**2
        stiffness = stiffness + along*pair(1) + (1.0_wp - along)*pair(2)
      end do
    end do
  end function surface_stiffness_along

  !> The same of all contacts along their normals [N/m].
  pure real(wp) function normal_stiffness(d, body) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: body
    real(wp) :: pair(2)
    integer(i4) :: g, k
    stiffness = 0.0_wp
    do g = 1, d%surfaces%list%near
      do k = 1, d%surfaces%list%contacts(g)
        if (body_of_part(d, d%surfaces%list%part(k, g)) /= body) cycle
        pair = surface_stiffness(d, k, g)
        stiffness = stiffness + pair(1)
      end do
    end do
  end function normal_stiffness

  !> Initialise; no velocity is set before the first update.
  subroutine start(self, d, time)
    class(surface_servo_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    integer(i4) :: b
    if (allocated(d%surfaces%servo)) deallocate (d%surfaces%servo)
    if (.not. self%active()) return
    allocate (d%surfaces%servo(servo_size, d%surfaces%n), source=0.0_wp)
    d%surfaces%servo(seen_time, :) = time
    do b = 1, d%surfaces%n
      if (is_bore(d%surfaces, b)) then
        d%surfaces%servo(1, b) = d%surfaces%round%press_impulse(b)
        cycle
      end if
      d%surfaces%servo(:3, b) = sum(d%surfaces%sums%impulse(:, d%surfaces%first_part(b): &
                                                       d%surfaces%first_part(b + 1) - 1), 2)
    end do
  end subroutine start

  !> Velocities for the steps to come; dem_surface_drive updates those that follow a curve.
  subroutine update(self, d, time, curve)
    class(surface_servo_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    type(curve_type), intent(in) :: curve(:)
    integer(i4) :: k, b
    real(wp) :: speed, force, old(3)

    if (.not. self%active()) return
    do k = 1, size(self%servo)
      b = self%servo(k)%body
      speed = 0.0_wp
      old = d%surfaces%servo(servo_velocity:, b)
      force = self%force_of(k, d, time)
      d%surfaces%servo(seen_force, b) = force
      d%surfaces%servo(seen_time, b) = time
      if (time < self%servo(k)%until) call answer(self, k, d, time, curve, speed)
      if (self%servo(k)%radial) then
        d%surfaces%servo(servo_velocity, b) = -speed
        call set_swell(d%surfaces, b, -speed)
        cycle
      end if
      d%surfaces%servo(servo_velocity:, b) = speed*self%servo(k)%direction
      if (self%curved(b)) then
        old = d%surfaces%velocity(:, b) - old
      else
        old = self%velocity(:, b)
      end if
      call set_velocity(d%surfaces, b, old + d%surfaces%servo(servo_velocity:, b))
    end do
  end subroutine update

  !> Speed of servo k along its direction [m/s].
  subroutine answer(self, k, d, time, curve, speed)
    type(surface_servo_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(out) :: speed
    type(servo_view_type) :: view

    associate (servo => self%servo(k), seen => d%surfaces%servo(:, self%servo(k)%body))
      seen(seen_target) = servo%force
      if (servo%curve > 0) seen(seen_target) = servo%force*curve(servo%curve)%at(time)
      if (servo%radial) then
        if (servo%pressed) seen(seen_target) = seen(seen_target) &
          *d%surfaces%round%radius(servo%body)/d%surfaces%round%start_radius(servo%body)
        view%stiffness = normal_stiffness(d, servo%body)
      else
        view%stiffness = surface_stiffness_along(d, servo%body, servo%direction)
      end if
      view%lack = seen(seen_target) - seen(seen_force)
      view%ahead = check_interval*d%par%dt
      view%approach = servo%speed
      call servo%respond(view, seen(seen_held), speed)
    end associate
  end subroutine answer

  !> Mean force on the grains along the direction since the last update, whose impulse is
  !! accumulated from zero again [N].
  real(wp) function force_of(self, k, d, time) result(force)
    class(surface_servo_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: mean(3), impulse(3)
    integer(i4) :: low, high
    associate (s => d%surfaces, seen => d%surfaces%servo(:, self%servo(k)%body))
      if (self%servo(k)%radial) then
        force = s%round%press(self%servo(k)%body)
        impulse(1) = s%round%press_impulse(self%servo(k)%body)
        if (time > seen(seen_time)) force = (impulse(1) - seen(1))/(time - seen(seen_time))
        seen(1) = impulse(1)
        return
      end if
      low = s%first_part(self%servo(k)%body)
      high = s%first_part(self%servo(k)%body + 1) - 1
      mean = sum(s%sums%force(:, low:high), 2)
      impulse = sum(s%sums%impulse(:, low:high), 2)
      if (time > seen(seen_time)) mean = (impulse - seen(:3))/(time - seen(seen_time))
      seen(:3) = impulse
      force = -dot_product(mean, self%servo(k)%direction)
    end associate
  end function force_of

  !> Relative error of the force of servo k at the last update.
  pure real(wp) function error_of(self, k, d)
    class(surface_servo_type), intent(in) :: self
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(in) :: d
    associate (seen => d%surfaces%servo(:, self%servo(k)%body))
      error_of = abs(seen(seen_force) - seen(seen_target)) &
                 /max(abs(seen(seen_target)), tiny(1.0_wp))
    end associate
  end function error_of

  !> Every servo holds its force.
  pure logical function satisfied(self, d)
    class(surface_servo_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i4) :: k
    satisfied = .true.
    if (.not. self%active()) return
    do k = 1, size(self%servo)
      satisfied = satisfied .and. (self%error_of(k, d) <= self%servo(k)%tolerance .or. &
                                   self%servo(k)%until < huge(1.0_wp))
    end do
  end function satisfied

  !> Report servos that do not hold their force at the end of the run, with error and cause (N204).
  subroutine judge(self, d, time, place, errors)
    class(surface_servo_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: time  !! of the end [s]
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    character(len=:), allocatable :: why, hint

    if (.not. self%active()) return
    do k = 1, size(self%servo)
      associate (servo => self%servo(k), seen => d%surfaces%servo(:, self%servo(k)%body))
        if (self%error_of(k, d) <= servo%tolerance .or. servo%until <= time) cycle
        call servo%reason('it moved at its speed limit', 'm/s', 'raise speed or t_end, or '// &
          'check whether the grains run away from the surface', why, hint)
        if (.not. surface_stiffness_along(d, servo%body, servo%direction) > 0.0_wp) &
          why = why//', and it touches no grain'
        call errors%add('N204', "servo of surface '"//self%name(servo%body)%s//"' ended at "// &
                        short_number(seen(seen_force))//' N instead of '// &
                        short_number(seen(seen_target))//' N: '//why, place, hint)
      end associate
    end do
  end subroutine judge

  !> Begin <stem>_surface_servos.csv, or go on in it after a restart at time >= 0.
  subroutine open_history(self, stem, time, errors)
    class(surface_servo_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active()) return
    call self%history%begin(stem//'_surface_servos.csv', columns, time, errors)
  end subroutine open_history

  !> One row per servo: values of its last update, and its position along its direction now; of a
  !! bore how fast its radius grows, and the radius.
  subroutine write_rows(self, time, d, errors)
    class(surface_servo_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: way(2)
    integer(i4) :: k
    if (.not. self%history%is_open()) return
    do k = 1, size(self%servo)
      associate (servo => self%servo(k), seen => d%surfaces%servo(:, self%servo(k)%body))
        way = [dot_product(seen(servo_velocity:), servo%direction), &
               dot_product(d%surfaces%centre(:, servo%body), servo%direction)]
        if (servo%radial) way = [seen(servo_velocity), d%surfaces%round%radius(servo%body)]
        call self%history%write([time, real(servo%body, wp), seen(seen_target), seen(seen_force), &
                                 way], errors)
      end associate
    end do
  end subroutine write_rows
end module dem_surface_servo
