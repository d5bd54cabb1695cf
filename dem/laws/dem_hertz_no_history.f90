!> Base law 'hertz_no_history': Hertz normal force, tangential force of the dashpot alone.
module dem_hertz_no_history
  use talus_kinds, only: wp
  use dem_law_state, only: base_law_type
  use dem_contact, only: spring_forces
  implicit none
  private
  public :: hertz_no_history

contains

  pure function hertz_no_history() result(base)
    type(base_law_type) :: base
    base%name = 'hertz_no_history'
    base%forces => spring_forces
    base%spring = 0.0_wp
  end function hertz_no_history
end module dem_hertz_no_history
