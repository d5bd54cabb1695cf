!> Where a step of Newton's method has trouble, for its faults.
module fem_trouble
  use talus_kinds, only: i4
  use talus_text, only: str
  use fem_body, only: fem_body_type
  use fem_law, only: at_dissipated
  implicit none
  private
  public :: element_at, most_yielding

contains

  !> The element that dissipates most in the trial, as a text; '' where none does.
  pure function most_yielding(self) result(text)
    type(fem_body_type), intent(in) :: self
    character(len=:), allocatable :: text
    integer(i4) :: p, at(2)
    text = ''
    associate (m => self%matter)
      p = int(maxloc(m%state(at_dissipated, :) - m%accepted_state(at_dissipated, :), 1), i4)
      if (.not. m%state(at_dissipated, p) > m%accepted_state(at_dissipated, p)) return
      at = m%element_of(self%elastic, p)
      text = '; element '//str(self%elastic%number_of(at(1)))//' yields most'
    end associate
  end function most_yielding

  !> First element that has a node.
  integer(i4) function element_at(self, block)
    type(fem_body_type), intent(in) :: self
    integer(i4), intent(in) :: block
    integer(i4) :: place
    place = int(findloc(self%dofs%block, block, 1), i4)
    element_at = huge(place)
    if (place > 0) element_at = self%elastic%number_of(int(count(self%dofs%start <= place), i4))
    call self%dofs%halo%least_number(element_at)
  end function element_at
end module fem_trouble
