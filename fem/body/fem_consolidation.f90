!> What is known of a solid with a liquid before the first step: its c_v and times, the shortest
!! step that quadratic displacements with linear pressures resolve at a drained face, and whether
!! the liquid's relative acceleration may be left out.
!! eq. F.31
module fem_consolidation
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_log, only: log_type, short_number
  use fem_body, only: fem_body_type
  use fem_retention, only: chord, steep
  implicit none
  private
  public :: coefficient, short_step_warning, size_at_drain, describe_pores, fast_warning

  real(wp), parameter :: steps_a_cycle = 20.0_wp  !! that resolve a motion
  real(wp), parameter :: most_lag = 0.1_wp        !! omega kappa rho_f/n, above which the form errs

contains

  !> Lines of the log: c_v of each solid, and the times of its smallest and largest element.
  subroutine describe_pores(body, log)
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    real(wp) :: c(2), h(2), here
    integer(i4) :: k, e
    if (.not. body%pore%active) return
    do k = 1, size(body%pore%skeleton)
      c = [huge(1.0_wp), 0.0_wp]
      h = c
      do e = 1, body%mesh%elements
        if (body%pore%skeleton_of(e) /= k) cycle
        here = coefficient(body, e)
        c = [min(c(1), here), max(c(2), here)]
        here = extent(body, e)
        h = [min(h(1), here), max(h(2), here)]
      end do
      if (steep(body%pore%skeleton(k)%retention)) call log%item('permeability of &pore '//str(k), &
        'a chord over S_e > '//short_number(chord)//' caps its slope')
      if (.not. c(1) > 0.0_wp .or. h(2) <= 0.0_wp) cycle
      call log%item('consolidation of &pore '//str(k), 'c_v '//short_number(c(2))//' m2/s', &
        'elements of '//short_number(h(1))//' to '//short_number(h(2))//' m: h^2/c_v '// &
        short_number(h(1)**2/c(2))//' to '//short_number(h(2)**2/c(1))//' s')
    end do
  end subroutine describe_pores

  !> Shortest edge from the first corner of element e to another [m].
  pure real(wp) function extent(body, e)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e
    integer(i4) :: a
    extent = huge(1.0_wp)
    associate (node => body%mesh%node(body%mesh%start(e):body%mesh%start(e + 1) - 1))
      do a = 2, body%elastic%rule(body%elastic%rule_of(e))%corners
        extent = min(extent, norm2(body%mesh%x(:, node(a)) - body%mesh%x(:, node(1))))
      end do
    end associate
  end function extent

  !> Warning W303 where motions that steps dt resolve are too fast for the pores; '' where none are.
  function fast_warning(body, dt) result(text)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: dt  !! [s]
    character(len=:), allocatable :: text
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: frequency, lag
    integer(i4) :: k
    text = ''
    if (.not. (body%pore%active .and. body%scheme%dynamic .and. dt > 0.0_wp)) return
    frequency = 1.0_wp/(steps_a_cycle*dt)
    lag = 0.0_wp
    do k = 1, size(body%pore%skeleton)
      associate (s => body%pore%skeleton(k))
        lag = max(lag, 2.0_wp*pi*frequency*maxval(s%mobility)*s%density/s%porosity)
      end associate
    end do
    if (lag > most_lag) text = 'W303'//': motions of '//short_number(frequency)// &
      ' Hz, which the step resolves, have omega kappa rho_f/n = '//short_number(lag)// &
      ': the acceleration of the liquid in the pores, which is left out, matters above '// &
      short_number(most_lag)
  end function fast_warning

  !> c_v of element e along the largest mobility [m^2/s].
  pure real(wp) function coefficient(body, e)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e
    coefficient = 0.0_wp
    if (body%pore%skeleton_of(e) == 0 .or. .not. body%pore%confined(e) > 0.0_wp) return
    associate (s => body%pore%skeleton(body%pore%skeleton_of(e)))
      coefficient = maxval(s%mobility)/(s%storage + s%biot**2/body%pore%confined(e))
    end associate
  end function coefficient

  !> Distance from the held pressures of element e to its other corners, the most; 0 where none or
  !! all are held.
  pure real(wp) function size_at_drain(body, e) result(h)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e
    real(wp) :: nearest
    integer(i4) :: a, b
    h = 0.0_wp
    associate (node => body%mesh%node(body%mesh%start(e):body%mesh%start(e + 1) - 1), &
               wet => body%dofs%wet(body%dofs%wet_start(e):body%dofs%wet_start(e + 1) - 1))
      if (.not. any(body%supports%held(1, wet))) return
      do a = 1, size(wet)
        nearest = huge(1.0_wp)
        do b = 1, size(wet)
          if (body%supports%held(1, wet(b))) nearest = min(nearest, &
            norm2(body%mesh%x(:, node(b)) - body%mesh%x(:, node(a))))
        end do
        h = max(h, nearest)
      end do
    end associate
  end function size_at_drain

  !> Warning W302 where steps dt are below h^2/(6 c_v) at a drained face of elements that have no
  !! remedy of their own; '' where none are.
  function short_step_warning(body, dt) result(text)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: dt  !! [s]
    character(len=:), allocatable :: text
    real(wp) :: floor_of, most, h
    integer(i4) :: e, worst
    text = ''
    if (.not. body%pore%active) return
    most = dt
    worst = 0
    do e = 1, body%mesh%elements
      if (body%pore%skeleton_of(e) == 0) cycle
      associate (rule => body%elastic%rule(body%elastic%rule_of(e)))
        if (rule%corners == rule%nodes) cycle
      end associate
      if (.not. coefficient(body, e) > 0.0_wp) cycle
      floor_of = size_at_drain(body, e)**2/(6.0_wp*coefficient(body, e))
      if (floor_of <= most) cycle
      most = floor_of
      worst = e
    end do
    if (worst == 0) return
    h = size_at_drain(body, worst)
    text = 'W302'//': the step of '//short_number(dt)//' s is below h^2/(6 c_v) = '// &
      short_number(most)//' s of element '//str(worst)//' (h = '//short_number(h)// &
      ' m) at a held pressure: pressures overshoot there in the first steps'
  end function short_step_warning
end module fem_consolidation
