!> Control of the cell: components of the velocity gradient that the deck gives, by a curve, and
!! servos that hold components of the stress.
!!
!! A servo is that of dem_servo with the cell in place of a wall: with the stress s of the contacts,
!! the target s_t and the stiffness C that the contacts would have if all grains followed the flow,
!! the rate is gain (s_t - s)/(C T) + r, T the interval between updates, bounded by its limit; r
!! grows by gain^2/50 (s_t - s)/(C T) per update. The pack is softer than C: it cannot overshoot.
!! Updates are made at whole multiples of steps: results depend neither on threads nor on restarts.
!! eq. D.9
module dem_flow
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: string_type, str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_homogenise, only: inverse_of
  use talus_log, only: short_number
  use dem_cell, only: cell_volume
  use dem_cell_stress, only: cell_stress
  use dem_servo_law, only: servo_law_type, servo_view_type, check_interval
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: dem_flow_type, stress_in, direction

  integer(i4), parameter :: mean_stress = 10  !! component number of the pressure
  character(len=4), parameter :: components(10) = [character(len=4) :: 'xx', 'xy', 'xz', 'yx', &
                                                   'yy', 'yz', 'zx', 'zy', 'zz', 'mean']

  !> One controlled component.
  type, extends(servo_law_type) :: control_type
    integer(i4) :: component = 0      !! of components
    real(wp) :: value = 0.0_wp        !! rate [1/s] or stress [Pa]
    real(wp) :: target = 0.0_wp       !! at the last update [Pa]
    integer(i4) :: between(2) = 0     !! components that set the target; 0: value does
    real(wp) :: share = 0.0_wp        !! b: place of the target between the two
  end type control_type

  type :: dem_flow_type
    logical :: present = .false.               !! the deck has a cell
    type(curve_type), allocatable :: curve(:)
    type(control_type), allocatable :: rate(:), stress(:)
    type(history_type) :: history
  contains
    procedure :: read => read_flow
    procedure :: active
    procedure :: longest_block
    procedure :: due
    procedure :: update
    procedure :: satisfied
    procedure :: judge
    procedure :: open => open_history
    procedure :: write => write_row
  end type dem_flow_type

contains

  !> Groups cell_rate and cell_stress (D268).
  subroutine read_flow(self, deck, d, curve, errors)
    class(dem_flow_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(curve_type), intent(in) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    self%present = d%cell%active
    self%curve = curve
    allocate (self%rate(deck%count('cell_rate')), self%stress(deck%count('cell_stress')))
    do k = 1, size(self%rate)
      call read_control(deck, 'cell_rate', k, curve, self%rate, errors)
      call deck%get('cell_rate', k, 'rate', self%rate(k)%value)
    end do
    do k = 1, size(self%stress)
      call read_control(deck, 'cell_stress', k, curve, self%stress, errors)
      call read_target(deck, k, self%stress(k), errors)
      call deck%get('cell_stress', k, 'rate', self%stress(k)%speed)
      call deck%get('cell_stress', k, 'gain', self%stress(k)%gain)
      call deck%get('cell_stress', k, 'tolerance', self%stress(k)%tolerance)
    end do
    if (self%active() .and. deck%count('cell') == 0) then
      call deck%fault(errors, 'D268', 'there is no cell to be strained', &
                      trim(merge('cell_rate  ', 'cell_stress', size(self%rate) > 0)), 1, '', &
                      'add &cell / ')
    else if (d%cell%active) then
      call check_controls(self, deck, d, errors)
    end if
  end subroutine read_flow

  !> Component and curve of one control; each component once.
  subroutine read_control(deck, group, k, curve, list, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    type(curve_type), intent(in) :: curve(:)
    type(control_type), intent(inout) :: list(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name

    call deck%get(group, k, 'component', name)
    list(k)%component = findloc(components == name, .true., 1)
    call curve_index(deck, 'D250', curve, group, k, list(k)%curve, errors)
    if (any(list(:k - 1)%component == list(k)%component)) &
      call deck%fault(errors, 'D268', "component '"//name//"' is given twice", group, k, &
                      'component', 'name each component once')
  end subroutine read_control

  !> Target of a servo: a stress, or a place between two other components (D268).
  subroutine read_target(deck, k, servo, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(control_type), intent(inout) :: servo
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    integer(i4) :: j

    if (deck%given('cell_stress', k, 'stress')) &
      call deck%get('cell_stress', k, 'stress', servo%value)
    if (.not. deck%given('cell_stress', k, 'between')) return
    call deck%get('cell_stress', k, 'b', servo%share)
    call deck%get('cell_stress', k, 'between', names)
    do j = 1, 2
      servo%between(j) = findloc(components == names(j)%s, .true., 1)
    end do
    if (any(servo%between == servo%component) .or. servo%between(1) == servo%between(2) .or. &
        .not. any(servo%component == [1, 5, 9]) .or. servo%curve > 0) &
      call deck%fault(errors, 'D268', 'a stress between two others is a normal one, they are '// &
                      'the two others, and it follows no curve', 'cell_stress', k, 'between', &
                      "component = 'yy', between = 'xx', 'zz', b = 0.5")
  end subroutine read_target

  !> A component has a rate or a stress, and strains only what is periodic (D268).
  subroutine check_controls(self, deck, d, errors)
    class(dem_flow_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: gradient(3, 3)
    integer(i4) :: k

    do k = 1, size(self%rate)
      gradient = direction(self%rate(k)%component)
      call check_still(deck, d, 'cell_rate', k, gradient, errors)
    end do
    do k = 1, size(self%stress)
      associate (own => self%stress(k)%component)
        gradient = direction(own)
        call check_still(deck, d, 'cell_stress', k, gradient, errors)
        if (any(self%rate%component == own)) &
          call deck%fault(errors, 'D268', "component '"//trim(components(own))//"' has a rate "// &
                          'and a stress', 'cell_stress', k, 'component', 'give one of the two')
        if (any(self%stress%component == mean_stress) .and. any(own == [1, 5, 9])) &
          call deck%fault(errors, 'D268', "the mean stress holds '"//trim(components(own))// &
                          "' too", 'cell_stress', k, 'component', &
                          'hold the mean, or xx, yy and zz')
      end associate
    end do
  end subroutine check_controls

  !> Edges that are not periodic keep still, unless none is.
  subroutine check_still(deck, d, group, k, gradient, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: gradient(3, 3)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: j
    if (.not. any(d%cell%periodic)) return
    do j = 1, 3
      if (d%cell%periodic(j)) cycle
      if (norm2(matmul(gradient, d%cell%vectors(:, j))) > &
          1.0e-9_wp*norm2(d%cell%vectors(:, j))) then
        call deck%fault(errors, 'D268', 'edge '//str(j)//' of the cell is not periodic and '// &
                        'cannot be strained', group, k, 'component', &
                        'move the walls at its ends instead')
        return
      end if
    end do
  end subroutine check_still

  !> Velocity gradient of unit rate of a component.
  pure function direction(component) result(gradient)
    integer(i4), intent(in) :: component
    real(wp) :: gradient(3, 3)
    gradient = 0.0_wp
    if (component == mean_stress) then
      gradient(1, 1) = 1.0_wp
      gradient(2, 2) = 1.0_wp
      gradient(3, 3) = 1.0_wp
    else if (component > 0) then
      gradient(1 + (component - 1)/3, 1 + mod(component - 1, 3)) = 1.0_wp
    end if
  end function direction

  pure logical function active(self)
    class(dem_flow_type), intent(in) :: self
    active = size(self%rate) + size(self%stress) > 0
  end function active

  !> Largest number of steps without an update.
  pure integer(i4) function longest_block(self)
    class(dem_flow_type), intent(in) :: self
    longest_block = merge(check_interval, huge(check_interval), self%active())
  end function longest_block

  pure logical function due(self, steps)
    class(dem_flow_type), intent(in) :: self
    integer(i8), intent(in) :: steps  !! taken so far
    due = self%active() .and. modulo(steps, int(check_interval, i8)) == 0
  end function due

  !> Stress of a component; pressure is positive in normal components and the mean, a shear stress
  !! where it resists a positive rate.
  pure real(wp) function stress_in(sigma, component) result(stress)
    real(wp), intent(in) :: sigma(3, 3)
    integer(i4), intent(in) :: component
    integer(i4) :: i, j
    if (component == mean_stress) then
      stress = -(sigma(1, 1) + sigma(2, 2) + sigma(3, 3))/3.0_wp
      return
    end if
    i = 1 + (component - 1)/3
    j = 1 + mod(component - 1, 3)
    stress = sigma(j, i)
    if (i == j) stress = -stress
  end function stress_in

  pure real(wp) function sign_of(component)
    integer(i4), intent(in) :: component
    sign_of = merge(-1.0_wp, 1.0_wp, any(component == [1, 5, 9, mean_stress]))
  end function sign_of

  !> Velocity gradient for the steps to come.
  subroutine update(self, d, time)
    class(dem_flow_type), intent(inout) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    real(wp) :: ahead, rate, gradient(3, 3), sigma(3, 3), stiffness(10)
    type(servo_view_type) :: view
    integer(i4) :: k

    if (.not. self%present) return
    ahead = check_interval*d%par%dt
    gradient = 0.0_wp
    do k = 1, size(self%rate)
      rate = self%rate(k)%value
      if (self%rate(k)%curve > 0) &
        rate = rate*self%curve(self%rate(k)%curve)%mean(time, time + ahead)
      gradient = gradient + rate*direction(self%rate(k)%component)
    end do
    if (size(self%stress) > 0) call cell_stress(d, sigma, stiffness)
    do k = 1, size(self%stress)
      associate (servo => self%stress(k))
        servo%target = servo%value
        if (servo%between(1) > 0) &
          servo%target = (1.0_wp - servo%share)*stress_in(sigma, servo%between(1)) &
                         + servo%share*stress_in(sigma, servo%between(2))
        if (servo%curve > 0) servo%target = servo%value*self%curve(servo%curve)%at(time)
        view = servo_view_type(servo%target - stress_in(sigma, servo%component), 1.0_wp, &
                               stiffness(servo%component), ahead, sign(servo%speed, servo%target))
        call servo%respond(view, d%cell%held(servo%component), rate)
        rate = sign_of(servo%component)*rate
        gradient = gradient + rate*direction(servo%component)
      end associate
    end do
    d%cell%rate = gradient
  end subroutine update

  !> Largest target, the scale of all errors [Pa].
  pure real(wp) function scale_of(self)
    class(dem_flow_type), intent(in) :: self
    scale_of = max(maxval(abs(self%stress%target)), tiny(1.0_wp))
  end function scale_of

  !> Every servo holds its stress.
  pure logical function satisfied(self, d)
    class(dem_flow_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    real(wp) :: sigma(3, 3), stiffness(10)
    integer(i4) :: k
    satisfied = .true.
    if (size(self%stress) == 0) return
    call cell_stress(d, sigma, stiffness)
    do k = 1, size(self%stress)
      satisfied = satisfied .and. abs(stress_in(sigma, self%stress(k)%component) &
                                      - self%stress(k)%target) &
                  <= self%stress(k)%tolerance*scale_of(self)
    end do
  end function satisfied

  !> Report servos that do not hold their stress at the end of the run, with error and cause (N221).
  subroutine judge(self, d, place, errors)
    class(dem_flow_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    real(wp) :: sigma(3, 3), stiffness(10), now
    integer(i4) :: k
    character(len=:), allocatable :: why, hint

    if (errors%any() .or. size(self%stress) == 0) return
    call cell_stress(d, sigma, stiffness)
    do k = 1, size(self%stress)
      associate (servo => self%stress(k))
        now = stress_in(sigma, servo%component)
        if (abs(now - servo%target) <= servo%tolerance*scale_of(self)) cycle
        call servo%reason('it strained at its limit', '1/s', 'raise rate of '// &
                          '&cell_stress; where &cell_rate strains the cell, lower its rate', &
                          why, hint)
        call errors%add('N221', "stress '"//trim(components(servo%component))// &
                        "' of the cell ended at "//short_number(now)//' Pa instead of '// &
                        short_number(servo%target)//' Pa: '//why, place, hint)
      end associate
    end do
  end subroutine judge

  !> Begin <stem>_cell.csv, or go on in it after a restart at time >= 0.
  subroutine open_history(self, stem, time, errors)
    class(dem_flow_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    character(len=8), parameter :: tensors(3) = [character(len=8) :: 'deform_ ', 'rate_   ', &
                                                 'stress_ ']
    character(len=6), parameter :: units(3) = [character(len=6) :: ' [-]', ' [1/s]', ' [Pa]']
    type(string_type) :: names(38)
    integer(i4) :: k, j

    if (.not. self%present) return
    names(1)%s = 'time [s]'
    names(2)%s = 'volume [m3]'
    do j = 1, 9
      names(2 + j)%s = 'edge_'//'abc'(1 + (j - 1)/3:1 + (j - 1)/3)// &
        'xyz'(1 + mod(j - 1, 3):1 + mod(j - 1, 3))//' [m]'
      do k = 1, 3
        names(2 + 9*k + j)%s = trim(tensors(k))//trim(components(j))//trim(units(k))
      end do
    end do
    call self%history%begin(stem//'_cell.csv', names, time, errors)
  end subroutine open_history

  !> One row: edges, deformation gradient since the start, velocity gradient, stress.
  subroutine write_row(self, time, d, errors)
    class(dem_flow_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: sigma(3, 3), stiffness(10), inverse(3, 3), deform(3, 3)
    if (.not. self%history%is_open()) return
    call cell_stress(d, sigma, stiffness)
    inverse = inverse_of(d%cell%start)
    deform = matmul(d%cell%vectors, inverse)
    call self%history%write([time, cell_volume(d%cell), d%cell%vectors, transpose(deform), &
                             transpose(d%cell%rate), transpose(sigma)], errors)
  end subroutine write_row
end module dem_flow
