!> What free grains do to bodies that a partner moves during a block of steps. Plain data.
module dem_exact_state
  use talus_kinds, only: wp, i4
  use talus_exact_sums, only: exact_sums_type
  implicit none
  private
  public :: dem_exact_type

  !> Columns are those of grains that a partner moves, in the order of ids, or vertices.
  type :: dem_exact_type
    integer(i4), allocatable :: place(:)         !! (grains) column of each, 0: none
    type(exact_sums_type) :: grains              !! force [N] and moment [N m]
    type(exact_sums_type) :: vertices            !! force [N]; no columns without soft bodies
    real(wp), allocatable :: grain_start(:, :)   !! (13, columns) force, moment, the integrals of
                                                 !! both, work before the block [N, N m, N s,
                                                 !! N m s, J]
    real(wp), allocatable :: vertex_start(:, :)  !! (6, vertices) force and its integral then
    real(wp), allocatable :: work_start(:)       !! (parts) work then [J]
  end type dem_exact_type
end module dem_exact_state
