!> Wear of planes and surfaces: how fast each wears, and what has slid on it so far.
module dem_wear_state
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: dem_wear_type

  !> Sums of normal force times sliding distance; a worn volume is such a sum times k/H.
  type :: dem_wear_type
    logical :: active = .false.
    real(wp), allocatable :: plane_rate(:)          !! (planes) k/H, 0: does not wear [1/Pa]
    real(wp), allocatable :: body_rate(:)           !! (surfaces) the same [1/Pa]
    real(wp), allocatable :: plane(:)               !! (planes) sum so far [J]
    real(wp), allocatable :: body(:)                !! (surfaces) sum so far [J]
    real(wp), allocatable :: triangle(:)            !! (triangles) sum so far [J]
    real(wp), allocatable :: plane_step(:, :)       !! (lanes, blocks of planes) of the step [J]
    real(wp), allocatable :: body_step(:, :)        !! (slots, near grains) of the step [J]
    integer(i4), allocatable :: triangle_step(:, :) !! (slots, near grains) triangle, 0: none
  end type dem_wear_type
end module dem_wear_state
