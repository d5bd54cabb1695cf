!> Times of consolidation known before the first step: c_v of a solid with a liquid, and the
!! shortest step that quadratic displacements with linear pressures resolve at a drained face.
!! eq. F.31
module fem_consolidation
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_log, only: short_number
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: coefficient, short_step_warning, size_at_drain

contains

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
