!> Health of a coupled run; what the figures and their limits mean stands in the manual (running,
!! Health). The solvers judge what is theirs alone in their own logs.
module cpl_judgement
  use talus_kinds, only: wp
  use talus_deck, only: deck_type
  use talus_health, only: health_type
  implicit none
  private
  public :: judge_coupling

  real(wp), parameter :: none = huge(1.0_wp)
  real(wp), parameter :: work_limits(2) = [0.05_wp, 0.9_wp]  !! difference over what went through
  real(wp), parameter :: overlap_limits(2) = [0.1_wp, none]  !! over the least semi-axis

contains

  !> Figures that every method has.
  subroutine judge_coupling(deck, work_error, settled, max_overlap, health)
    type(deck_type), intent(in) :: deck
    real(wp), intent(in) :: work_error   !! of the works of both sides at the interface [-]
    logical, intent(in) :: settled       !! after so many exchanges that it says something
    real(wp), intent(in) :: max_overlap  !! of the grains [-]
    type(health_type), intent(inout) :: health
    real(wp) :: limits(2)
    limits = work_limits
    if (.not. settled) limits(2) = none
    call health%judge(deck, 'interface_work_error', &
                      'the difference of the works of both sides at the interface', work_error, &
                      limits, "a shorter &clock exchange, or scheme = 'iterated'")
    call health%judge(deck, 'max_overlap', 'the largest overlap over the least semi-axis', &
                      max_overlap, overlap_limits, 'stiffer grains')
  end subroutine judge_coupling
end module cpl_judgement
