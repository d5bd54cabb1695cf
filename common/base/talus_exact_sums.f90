!> Sums whose bits do not depend on the order of their terms, nor on which rank adds which.
!!
!! A term is cut into five digits, multiples of fixed powers of two, eq. C.65. Digits add without
!! rounding, on a rank and over the ranks; one rounding at the end makes a number of them. Cutting:
!! J. Demmel, H. D. Nguyen, Parallel reproducible summation, IEEE Trans. Computers 64 (2015). Terms
!! are exact down to 2^-110 and up to 2^61, in SI units.
module talus_exact_sums
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: exact_sums_type, begin_sums, begin_step, touch, end_step, add_term, add_last
  public :: exact_value, digits

  integer(i4), parameter :: digits = 5  !! of a sum
  real(wp), parameter :: two = 2.0_wp
  real(wp), parameter :: unit(digits) = [two**10, two**(-20), two**(-50), two**(-80), two**(-110)]
  real(wp), parameter :: cut(digits) = 1.5_wp*two**52*unit
  real(wp), parameter :: per_unit(digits) = 1.0_wp/unit, cut_whole = 1.5_wp*two**52

  !> Sums over the terms of some steps, and those of the last step: (digits, quantities, things).
  type :: exact_sums_type
    real(wp), allocatable :: all(:, :, :)
    real(wp), allocatable :: last(:, :, :)
    integer(i4) :: touched = 0              !! things that have a term in the last step
    integer(i4), allocatable :: thing(:)    !! which
    logical, allocatable :: marked(:)       !! (things) is it one of them?
  end type exact_sums_type

contains

  !> Nothing so far.
  pure subroutine begin_sums(sums, quantities, things)
    type(exact_sums_type), intent(inout) :: sums
    integer(i4), intent(in) :: quantities, things
    if (allocated(sums%all)) deallocate (sums%all, sums%last, sums%thing, sums%marked)
    allocate (sums%all(digits, quantities, things), sums%last(digits, quantities, things), &
              source=0.0_wp)
    allocate (sums%thing(things))
    allocate (sums%marked(things), source=.false.)
    sums%touched = 0
  end subroutine begin_sums

  !> A step begins: nothing is touched.
  pure subroutine begin_step(sums)
    type(exact_sums_type), intent(inout) :: sums
    integer(i4) :: k
    do k = 1, sums%touched
      sums%last(:, :, sums%thing(k)) = 0.0_wp
      sums%marked(sums%thing(k)) = .false.
    end do
    sums%touched = 0
  end subroutine begin_step

  !> A term of one of many things, few of which have one in a step.
  pure subroutine touch(sums, thing, x)
    type(exact_sums_type), intent(inout) :: sums
    integer(i4), intent(in) :: thing
    real(wp), intent(in) :: x(:)
    if (.not. sums%marked(thing)) then
      sums%marked(thing) = .true.
      sums%touched = sums%touched + 1
      sums%thing(sums%touched) = thing
    end if
    call add_term(x, sums%last(:, :, thing))
  end subroutine touch

  !> The last step is complete: what it touched counts among all.
  pure subroutine end_step(sums)
    type(exact_sums_type), intent(inout) :: sums
    integer(i4) :: k
    do k = 1, sums%touched
      call add_last(sums, sums%thing(k))
    end do
  end subroutine end_step

  !> Add numbers to sums, one each. They come by reference, so that no product is merged into the
  !! first addition of the cut.
  pure subroutine add_term(x, sums)
    real(wp), intent(in) :: x(:)
    real(wp), intent(inout) :: sums(:, :)  !! (digits, numbers)
    real(wp) :: rest, digit
    integer(i4) :: k, j
    do j = 1, size(x)
      rest = x(j)
      do k = 1, digits
        digit = (rest + cut(k)) - cut(k)
        sums(k, j) = sums(k, j) + digit
        rest = rest - digit
      end do
    end do
  end subroutine add_term

  !> The last step of a thing is complete: it counts among all.
  pure subroutine add_last(sums, thing)
    type(exact_sums_type), intent(inout) :: sums
    integer(i4), intent(in) :: thing
    integer(i4) :: j
    do j = 1, size(sums%all, 2)
      sums%all(:, j, thing) = sums%all(:, j, thing) + sums%last(:, j, thing)
      call carry(sums%all(:, j, thing))
    end do
  end subroutine add_last

  !> Digits below the first one to 0 ... 2^30 - 1 of their units: the same for the same sum.
  pure subroutine carry(sum)
    real(wp), intent(inout) :: sum(digits)
    real(wp) :: whole
    integer(i4) :: k
    do k = digits, 2, -1
      whole = (sum(k)*per_unit(k - 1) + cut_whole) - cut_whole
      if (whole*unit(k - 1) > sum(k)) whole = whole - 1.0_wp
      sum(k) = sum(k) - whole*unit(k - 1)
      sum(k - 1) = sum(k - 1) + whole*unit(k - 1)
    end do
  end subroutine carry

  !> The number that a sum is, rounded from its smallest digit up.
  pure real(wp) function exact_value(sum) result(x)
    real(wp), intent(in) :: sum(digits)
    real(wp) :: s(digits), sign
    integer(i4) :: k
    x = 0.0_wp
    if (all(abs(sum) <= 0.0_wp)) return
    s = sum
    sign = 1.0_wp
    call carry(s)
    if (s(1) < 0.0_wp) then  ! digits of one sign do not cancel
      s = -s
      sign = -1.0_wp
      call carry(s)
    end if
    do k = digits, 1, -1
      x = x + s(k)
    end do
    x = sign*x
  end function exact_value
end module talus_exact_sums
