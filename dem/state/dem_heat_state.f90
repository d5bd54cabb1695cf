!> Heat in grains: temperatures, thermal constants of the materials, and what is held at a
!! temperature.
module dem_heat_state
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  implicit none
  private
  public :: dem_heat_type

  type :: dem_heat_type
    logical :: active = .false.
    real(wp), allocatable :: conductivity(:)    !! (materials) k [W/(m K)]
    real(wp), allocatable :: capacity(:)        !! (materials) c, specific [J/(kg K)]
    real(wp), allocatable :: temperature(:)     !! (grains) [K]
    integer(i4), allocatable :: held(:)         !! (grains) boundary that it belongs to, 0: none
    integer(i4) :: boundaries = 0               !! what is held at a temperature
    type(string_type), allocatable :: name(:)   !! (boundaries)
    real(wp), allocatable :: value(:)           !! (boundaries) temperature [K]
    real(wp), allocatable :: given(:)           !! (boundaries) heat given to the grains so far [J]
    integer(i4), allocatable :: plane(:)        !! (planes) boundary, 0: adiabatic
    integer(i4), allocatable :: body(:)         !! (surfaces) boundary, 0: adiabatic
    real(wp) :: start = 0.0_wp                  !! heat content of the free grains at the start [J]
    real(wp) :: ratio = 0.0_wp                  !! largest step over the limit of the steps so far
  end type dem_heat_type
end module dem_heat_state
