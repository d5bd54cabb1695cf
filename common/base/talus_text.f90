!> Text helpers: numbers to text, joining, lower case, strings of differing length in one array.
module talus_text
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: string_type, str, join, lower, starts_with, ends_with, append_string, is_finite

  !> One string of its own length, so that arrays of them can differ in length.
  type :: string_type
    character(len=:), allocatable :: s
  end type string_type

  !> Shortest text of a value that reads back as the same value (reals: 17 digits when needed).
  interface str
    module procedure str_i4, str_i8, str_real, str_logical, str_reals, str_integers
  end interface str

contains

  pure function str_i4(value) result(text)
    integer(i4), intent(in) :: value
    character(len=:), allocatable :: text
    text = str_i8(int(value, i8))
  end function str_i4

  pure function str_i8(value) result(text)
    integer(i8), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function str_i8

  !> Text of a real with the fewest of 6, 9, 12, 15 or 17 digits that reads back unchanged.
  pure function str_real(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    integer, parameter :: digits(5) = [6, 9, 12, 15, 17]
    real(wp), parameter :: near_overflow = 1.0e307_wp  !! its text may round to what cannot be read
    character(len=40) :: buffer, form
    real(wp) :: back
    integer :: k, stat

    k = 1
    if (is_finite(value)) k = merge(size(digits), 1, abs(value) > near_overflow)
    do k = k, size(digits)
      write (form, '(a,i0,a,i0,a)') '(es', digits(k) + 9, '.', digits(k) - 1, 'e3)'
      write (buffer, form) value
      if (k == size(digits) .or. .not. is_finite(value)) exit
      read (buffer, *, iostat=stat) back
      if (stat /= 0 .or. .not. back < value .and. .not. back > value) exit
    end do
    text = tidy(trim(adjustl(buffer)))
  end function str_real

  !> '1.250000E+003' becomes '1250', '1.000000E-006' becomes '1e-6'.
  pure function tidy(raw) result(text)
    character(len=*), intent(in) :: raw
    character(len=:), allocatable :: text, digits, sign
    integer :: e, power, stat, dot

    e = scan(raw, 'E')
    if (e == 0) then
      text = raw
      return
    end if
    read (raw(e + 1:), *, iostat=stat) power
    sign = ''
    digits = raw(:e - 1)
    if (digits(1:1) == '-') then
      sign = '-'
      digits = digits(2:)
    end if
    dot = scan(digits, '.')
    digits = digits(:dot - 1)//digits(dot + 1:)
    digits = digits(:max(1, verify(digits, '0', back=.true.)))
    if (digits == '0') then
      text = '0'
    else
      text = sign//placed(digits, power)
    end if
  end function tidy

  !> Digits d1d2d3... with the point after the first digit and a power of ten, in the shortest form.
  pure function placed(digits, power) result(text)
    character(len=*), intent(in) :: digits
    integer, intent(in) :: power
    character(len=:), allocatable :: text

    if (power >= 0 .and. power <= 5) then
      if (len(digits) <= power + 1) then
        text = digits//repeat('0', power + 1 - len(digits))
      else
        text = digits(:power + 1)//'.'//digits(power + 2:)
      end if
    else if (power < 0 .and. power >= -3) then
      text = '0.'//repeat('0', -power - 1)//digits
    else
      text = digits(1:1)
      if (len(digits) > 1) text = text//'.'//digits(2:)
      text = text//'e'//str_i4(power)
    end if
  end function placed

  pure function str_logical(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    text = trim(merge('true ', 'false', value))
  end function str_logical

  pure function str_reals(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(values)
      if (k > 1) text = text//', '
      text = text//str_real(values(k))
    end do
  end function str_reals

  pure function str_integers(values) result(text)
    integer(i4), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(values)
      if (k > 1) text = text//', '
      text = text//str_i4(values(k))
    end do
  end function str_integers

  !> Neither NaN nor infinite, by its bits: comparisons would trap in a debug build, and
  !! -fno-trapping-math lets ieee_is_finite compare.
  elemental logical function is_finite(value)
    real(wp), intent(in) :: value
    integer(i8), parameter :: exponent_bits = int(z'7FF0000000000000', i8)
    is_finite = iand(transfer(value, exponent_bits), exponent_bits) /= exponent_bits
  end function is_finite

  !> The strings of a list with a separator between them.
  pure function join(list, separator) result(text)
    type(string_type), intent(in) :: list(:)
    character(len=*), intent(in) :: separator
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(list)
      if (k > 1) text = text//separator
      text = text//list(k)%s
    end do
  end function join

  !> ASCII lower case.
  pure function lower(text) result(low)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: low
    integer :: k, c
    do k = 1, len(text)
      c = iachar(text(k:k))
      if (c >= iachar('A') .and. c <= iachar('Z')) c = c + 32
      low(k:k) = achar(c)
    end do
  end function lower

  pure logical function starts_with(text, head)
    character(len=*), intent(in) :: text, head
    starts_with = .false.
    if (len(text) >= len(head)) starts_with = text(:len(head)) == head
  end function starts_with

  pure logical function ends_with(text, tail)
    character(len=*), intent(in) :: text, tail
    ends_with = .false.
    if (len(text) >= len(tail)) ends_with = text(len(text) - len(tail) + 1:) == tail
  end function ends_with

  !> Add one string to the end of a list (allocated when it is not).
  pure subroutine append_string(list, text)
    type(string_type), allocatable, intent(inout) :: list(:)
    character(len=*), intent(in) :: text
    type(string_type), allocatable :: longer(:)
    integer :: k, n

    n = 0
    if (allocated(list)) n = size(list)
    allocate (longer(n + 1))
    do k = 1, n
      call move_alloc(list(k)%s, longer(k)%s)
    end do
    longer(n + 1)%s = text
    call move_alloc(longer, list)
  end subroutine append_string
end module talus_text
