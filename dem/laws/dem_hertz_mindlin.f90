!> Base law 'hertz_mindlin': Hertz normal force, incremental Mindlin tangential force with cap of
!! Coulomb, history kept.
module dem_hertz_mindlin
  use dem_law_state, only: base_law_type
  use dem_contact, only: spring_forces
  implicit none
  private
  public :: hertz_mindlin

contains

  pure function hertz_mindlin() result(base)
    type(base_law_type) :: base
    base%name = 'hertz_mindlin'
    base%forces => spring_forces
  end function hertz_mindlin
end module dem_hertz_mindlin
