!> Where a path that is followed by arc length stands. Plain data; fem_arc acts.
module fem_arc_type
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: fem_arc_data_type

  type :: fem_arc_data_type
    logical :: active = .false.
    logical :: settled = .false.        !! the loads at time 0 act from the start
    real(wp) :: t_end = 0.0_wp          !! whose loads and motions have the factor 1 [s]
    real(wp) :: first = 0.0_wp          !! factor of the first step [-]
    real(wp) :: growth = 1.0_wp         !! of the arc over the first one, at most [-]
    integer(i4) :: wanted = 5           !! iterations of a step
    real(wp) :: factor = 0.0_wp         !! of loads and motions, now [-]
    real(wp) :: radius = -1.0_wp        !! of the next step, < 0: not known yet [m]
    real(wp) :: first_radius = 0.0_wp   !! [m]
    integer(i4) :: iterations = 0       !! of the last step
    integer(i4) :: limits = 0           !! changes of sign of the factor's steps so far
    real(wp) :: last = 0.0_wp           !! change of the factor in the last step [-]
    real(wp), allocatable :: step(:, :) !! the last one (3, blocks) [m], [rad]
  end type fem_arc_data_type
end module fem_arc_type
