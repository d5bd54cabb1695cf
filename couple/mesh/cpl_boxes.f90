!> Boxes of space that list what reaches into them, so that a search looks at few things.
module cpl_boxes
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: boxes_type

  integer(i4), parameter :: most_aside = 256
  integer(i4), parameter :: most_each = 27     !! boxes a thing, for things that fill no space

  !> A grid; box b lists, ascending, listed(first(b)) .. listed(first(b+1)-1).
  type :: boxes_type
    real(wp) :: corner(3) = 0.0_wp, pitch(3) = 1.0_wp  !! [m]
    integer(i4) :: boxes(3) = 0
    integer(i4), allocatable :: first(:), listed(:)
  contains
    procedure :: make
    procedure :: holding
  end type boxes_type

contains

  !> About one box a thing, or as many as its mean size asks for.
  pure subroutine make(self, low, high)
    class(boxes_type), intent(inout) :: self
    real(wp), intent(in) :: low(:, :), high(:, :)  !! of the things, (3, n), n > 0 [m]
    real(wp) :: extent(3), size_of(3)
    integer(i4), allocatable :: filled(:)
    integer(i4) :: e, i, box, at(3), from(3), to(3), pass

    self%corner = minval(low, 2)
    extent = max(maxval(high, 2) - self%corner, tiny(1.0_wp))
    size_of = max(sum(high - low, 2)/size(low, 2), extent/most_aside)
    self%boxes = max(1, min(most_aside, ceiling(extent/size_of)))
    do while (product(real(self%boxes, wp)) > real(most_each, wp)*size(low, 2))
      self%boxes = max(1, self%boxes/2)
    end do
    self%pitch = extent/self%boxes
    if (allocated(self%first)) deallocate (self%first, self%listed)
    allocate (self%first(product(self%boxes) + 1), filled(product(self%boxes)), source=0_i4)
    do pass = 1, 2
      do e = 1, size(low, 2)
        from = box_of(self, low(:, e))
        to = box_of(self, high(:, e))
        at = from
        do while (at(3) <= to(3))
          box = number(self, at)
          if (pass == 2) self%listed(self%first(box) + filled(box)) = e
          filled(box) = filled(box) + 1
          at = next(at, from, to)
        end do
      end do
      if (pass == 2) exit
      self%first(1) = 1
      do i = 1, size(filled)
        self%first(i + 1) = self%first(i) + filled(i)
      end do
      filled = 0
      allocate (self%listed(self%first(size(self%first)) - 1))
    end do
  end subroutine make

  !> The box after this one of a block of boxes, x first; beyond the block after the last.
  pure function next(at, from, to) result(box)
    integer(i4), intent(in) :: at(3), from(3), to(3)
    integer(i4) :: box(3)
    box = at
    box(1) = at(1) + 1
    if (box(1) <= to(1)) return
    box(1) = from(1)
    box(2) = at(2) + 1
    if (box(2) <= to(2)) return
    box(2) = from(2)
    box(3) = at(3) + 1
  end function next

  !> First and last place in `listed` of what may hold a point; none: the last is before the first.
  pure function holding(self, x) result(range)
    class(boxes_type), intent(in) :: self
    real(wp), intent(in) :: x(3)  !! [m]
    integer(i4) :: range(2), box
    range = [1, 0]
    if (any(x < self%corner) .or. any(x > self%corner + self%boxes*self%pitch)) return
    box = number(self, box_of(self, x))
    range = [self%first(box), self%first(box + 1) - 1]
  end function holding

  pure function box_of(self, x) result(box)
    type(boxes_type), intent(in) :: self
    real(wp), intent(in) :: x(3)
    integer(i4) :: box(3)
    box = min(self%boxes - 1, max(0, int((x - self%corner)/self%pitch)))
  end function box_of

  pure integer(i4) function number(self, box)
    type(boxes_type), intent(in) :: self
    integer(i4), intent(in) :: box(3)
    number = 1 + box(1) + self%boxes(1)*(box(2) + self%boxes(2)*box(3))
  end function number
end module cpl_boxes
