!> Base law 'linear': springs and dashpots of given stiffness.
module dem_linear
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_law_state, only: base_law_type, law_numbers_type
  use dem_contact, only: spring_forces
  implicit none
  private
  public :: linear

contains

  pure function linear() result(base)
    type(base_law_type) :: base
    base%name = 'linear'
    base%forces => spring_forces
    base%constants => constants
    base%impact => impact
    base%hertz = .false.
    base%oscillator = 1.0_wp
  end function linear

  !> Stiffnesses in place of those that follow from the moduli.
  subroutine constants(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(law_numbers_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    call deck%get('contact', k, 'normal_stiffness', law%kn)
    call deck%get('contact', k, 'tangential_stiffness', law%kt)
    law%e_star = 0.0_wp
    law%g_star = 0.0_wp
    law%share = 0.5_wp
  end subroutine constants

  !> The same at any speed [N/m].
  pure real(wp) function impact(law, mass, radius, speed)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: mass, radius, speed
    impact = law%kn + law%kt
  end function impact
end module dem_linear
