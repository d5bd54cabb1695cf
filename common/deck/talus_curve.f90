!> Functions of time from the deck: piecewise linear, constant beyond their ends.
module talus_curve
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  implicit none
  private
  public :: curve_type, read_curves, curve_index

  type :: curve_type
    character(len=:), allocatable :: name
    real(wp), allocatable :: time(:), value(:)  !! [s], [-]
  contains
    procedure :: at
    procedure :: integral
    procedure :: mean
  end type curve_type

contains

  !> All groups curve of a deck; faults have the program's code.
  subroutine read_curves(deck, code, curve, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: code
    type(curve_type), allocatable, intent(out) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, j, n

    allocate (curve(deck%count('curve')))
    do k = 1, size(curve)
      call deck%get('curve', k, 'id', curve(k)%name)
      call deck%get('curve', k, 'times', curve(k)%time)
      call deck%get('curve', k, 'values', curve(k)%value)
      do j = 1, k - 1
        if (curve(j)%name == curve(k)%name) &
          call deck%fault(errors, code, "two curves are named '"//curve(k)%name//"'", 'curve', k, &
                          'id', 'give each curve its own id')
      end do
      n = size(curve(k)%time)
      if (n /= size(curve(k)%value)) then
        call deck%fault(errors, code, 'the curve has '//str(n)//' times and '// &
                        str(int(size(curve(k)%value), i4))//' values', 'curve', k, 'values', &
                        'give one value for each time')
      else if (any(curve(k)%time(2:) <= curve(k)%time(:n - 1))) then
        call deck%fault(errors, code, 'the times of the curve do not increase', 'curve', k, &
                        'times', 'put them in order, each once')
      end if
    end do
  end subroutine read_curves

  !> Index of the curve that a key names; 0 if the key is empty. An unknown name is a fault.
  subroutine curve_index(deck, code, curve, group, instance, index, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: code, group
    type(curve_type), intent(in) :: curve(:)
    integer(i4), intent(in) :: instance
    integer(i4), intent(out) :: index
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, known
    integer(i4) :: k

    index = 0
    call deck%get(group, instance, 'curve', name)
    if (len(name) == 0) return
    known = ''
    do k = 1, size(curve)
      if (curve(k)%name == name) index = k
      known = known//" '"//curve(k)%name//"'"
    end do
    if (index > 0) return
    if (len(known) == 0) known = ' none'
    call deck%fault(errors, code, "there is no curve '"//name//"'", group, instance, 'curve', &
                    'curves of this deck:'//known//'; define it with &curve id = ...')
  end subroutine curve_index

  !> Value at time t [s].
  pure real(wp) function at(self, t)
    class(curve_type), intent(in) :: self
    real(wp), intent(in) :: t
    integer(i4) :: k, n
    n = size(self%time)
    if (t <= self%time(1)) then
      at = self%value(1)
    else if (t >= self%time(n)) then
      at = self%value(n)
    else
      k = count(self%time <= t)
      at = self%value(k) + (self%value(k + 1) - self%value(k)) &
           *(t - self%time(k))/(self%time(k + 1) - self%time(k))
    end if
  end function at

  !> Integral over the times from the first one of the curve to t, negative before it.
  pure real(wp) function integral(self, t)
    class(curve_type), intent(in) :: self
    real(wp), intent(in) :: t
    integer(i4) :: k
    real(wp) :: low, high
    integral = min(t - self%time(1), 0.0_wp)*self%value(1)
    do k = 1, size(self%time)
      low = self%time(k)
      if (low >= t) return
      high = t
      if (k < size(self%time)) high = min(t, self%time(k + 1))
      integral = integral + 0.5_wp*(high - low)*(self%at(low) + self%at(high))
    end do
  end function integral

  !> Mean over t0 .. t1, t1 > t0.
  pure real(wp) function mean(self, t0, t1)
    class(curve_type), intent(in) :: self
    real(wp), intent(in) :: t0, t1
    mean = (self%integral(t1) - self%integral(t0))/(t1 - t0)
  end function mean
end module talus_curve
