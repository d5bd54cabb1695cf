!> Values of a deck: text to numbers and logicals, strictly.
module talus_deck_value
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: lower
  implicit none
  private
  public :: parse_real, parse_integer, parse_logical
  public :: value_good, value_not_finite, value_too_large, value_is_real, value_bad

  integer(i4), parameter :: value_good = 0        !! read
  integer(i4), parameter :: value_not_finite = 1  !! NaN or infinity
  integer(i4), parameter :: value_too_large = 2   !! more than any quantity of physics
  integer(i4), parameter :: value_is_real = 3     !! a real where an integer is wanted
  integer(i4), parameter :: value_bad = 4         !! no number at all
  integer(i4), parameter :: most_power = 50       !! decimal, of a real: its fourth power is finite
  integer(i4), parameter :: least_power = -307    !! decimal, that 64 bits hold in full

contains

  !> A real: 1, 1.0, .5, 1e3, 1.0d3; nothing else.
  pure subroutine parse_real(text, value, status)
    character(len=*), intent(in) :: text
    real(wp), intent(out) :: value
    integer(i4), intent(out) :: status
    integer(i4) :: power
    integer :: stat

    value = 0.0_wp
    call look_at_real(lower(text), power, status)
    if (status /= value_good) return
    if (power > most_power) then
      status = value_too_large
      return
    end if
    if (power < least_power) return  ! nothing but zero can be meant
    read (text, *, iostat=stat) value
    if (stat /= 0) status = value_bad
  end subroutine parse_real

  !> Form of a real and the decimal power of its first digit that is not zero.
  pure subroutine look_at_real(text, power, status)
    character(len=*), intent(in) :: text
    integer(i4), intent(out) :: power, status
    integer(i4) :: first, mark, dot, lead, exponent

    power = 0
    status = value_bad
    first = 1
    if (len(text) == 0) return
    if (scan(text(1:1), '+-') == 1) first = 2
    select case (text(first:))
    case ('nan', 'inf', 'infinity')
      status = value_not_finite
      return
    end select
    mark = scan(text, 'ed')
    if (mark == 0) mark = len(text) + 1
    if (.not. is_mantissa(text(first:mark - 1))) return
    exponent = 0
    if (mark <= len(text)) then
      if (.not. is_exponent(text(mark + 1:))) return
      exponent = exponent_of(text(mark + 1:))
    end if
    status = value_good
    dot = index(text(first:mark - 1), '.')
    if (dot == 0) dot = mark - first + 1
    lead = scan(text(first:mark - 1), '123456789')
    if (lead == 0) return
    power = exponent + dot - lead - merge(1, 0, dot > lead)
  end subroutine look_at_real

  pure logical function is_mantissa(text)
    character(len=*), intent(in) :: text
    is_mantissa = verify(text, '0123456789.') == 0 .and. scan(text, '0123456789') > 0 &
                  .and. index(text, '.') == index(text, '.', back=.true.)
  end function is_mantissa

  pure logical function is_exponent(text)
    character(len=*), intent(in) :: text
    integer(i4) :: first
    is_exponent = .false.
    first = 1
    if (len(text) > 0) first = first + merge(1, 0, scan(text(1:1), '+-') == 1)
    if (len(text) < first) return
    is_exponent = verify(text(first:), '0123456789') == 0
  end function is_exponent

  !> Exponent of ten, clipped to +-9999.
  pure integer(i4) function exponent_of(text)
    character(len=*), intent(in) :: text
    integer(i4) :: k
    exponent_of = 0
    do k = verify(text, '+-'), len(text)
      exponent_of = min(9999, 10*exponent_of + iachar(text(k:k)) - iachar('0'))
    end do
    if (text(1:1) == '-') exponent_of = -exponent_of
  end function exponent_of

  !> A 32-bit integer: digits with or without sign.
  pure subroutine parse_integer(text, value, status)
    character(len=*), intent(in) :: text
    integer(i4), intent(out) :: value, status
    real(wp) :: real_value
    integer(i8) :: wide
    integer(i4) :: first, k

    value = 0
    first = 1
    if (len(text) > 0) first = first + merge(1, 0, scan(text(1:1), '+-') == 1)
    if (len(text) < first .or. verify(text(min(first, len(text)):), '0123456789') /= 0) then
      call parse_real(text, real_value, status)
      if (status == value_good .or. status == value_too_large) status = value_is_real
      return
    end if
    wide = 0
    do k = first, len(text)
      wide = min(10*wide + iachar(text(k:k)) - iachar('0'), int(huge(value), i8) + 1)
    end do
    status = merge(value_too_large, value_good, wide > huge(value))
    if (status == value_good) value = int(merge(-wide, wide, text(1:1) == '-'), i4)
  end subroutine parse_integer

  !> .true., .false., true, false in any case.
  pure subroutine parse_logical(text, value, status)
    character(len=*), intent(in) :: text
    logical, intent(out) :: value
    integer(i4), intent(out) :: status

    status = value_good
    value = .false.
    select case (lower(text))
    case ('.true.', 'true')
      value = .true.
    case ('.false.', 'false')
      value = .false.
    case default
      status = value_bad
    end select
  end subroutine parse_logical
end module talus_deck_value
