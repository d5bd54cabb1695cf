!> The domain of a rank and the grains that it shares with its neighbours. Plain data.
!!
!! Space is cut into slabs along x, each of these into bars along y, each of these into boxes along
!! z, one a rank: rank = ix + px (iy + py iz), all from 0. Outer boxes have no outer end. In a
!! periodic cell x, y and z are places between its faces, in short edges of its lattice.
module dem_halo_state
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: ranks_type
  implicit none
  private
  public :: dem_halo_type, cell_reals

  integer(i4), parameter :: cell_reals = 19  !! of the stress in a cell, see dem_cell_stress

  type :: dem_halo_type
    type(ranks_type) :: team
    integer(i4) :: domains = 0                 !! boxes to cut into; 0: one a rank
    integer(i4) :: parts(3) = 1                !! slabs, bars in each, boxes in each
    real(wp), allocatable :: cut_x(:)          !! (0:px) ends of the slabs [m]
    real(wp), allocatable :: cut_y(:, :)       !! (0:py, px) of the bars [m]
    real(wp), allocatable :: cut_z(:, :, :)    !! (0:pz, px, py) of the boxes [m]
    logical :: cut = .false.                   !! boxes have been chosen
    logical :: folding = .false.               !! in a periodic cell
    logical :: wraps(3) = .false.              !! along the axes that are periodic
    integer(i4) :: whole(3, 3) = 0             !! short edges in edges, when boxes were chosen
    real(wp) :: origin(3) = 0.0_wp             !! of the cell [m]
    real(wp) :: inverse(3, 3) = 0.0_wp         !! places of points from the origin [1/m]
    real(wp) :: per_length(3) = 1.0_wp         !! how far places lie apart, [-] or [1/m]
    real(wp) :: range = 0.0_wp                 !! depth of the halo [m]
    integer(i4) :: width = 9                   !! reals of a body record that change in a step
    logical :: shaped = .false.                !! some grain of the run is no ellipsoid
    integer(i4) :: partners = 0                !! ranks with which bodies are exchanged
    integer(i4), allocatable :: partner(:)     !! (partners) ascending
    integer(i4), allocatable :: first_out(:)   !! (partners+1) of the bodies sent to each
    integer(i4), allocatable :: first_in(:)    !! (partners+1) of those that come from each
    integer(i4), allocatable :: out(:)         !! bodies sent
    integer(i4), allocatable :: in(:)          !! bodies that come
    logical :: all_near = .false.              !! each rank exchanges bodies with each other
    real(wp), allocatable :: sent(:, :)        !! (width, sent + partners), see dem_swap
    real(wp), allocatable :: came(:, :)        !! (width, come + partners)
    integer, allocatable :: request(:)         !! (2 partners + 1) of the exchange under way
    real(wp) :: travel = 0.0_wp                !! of this rank's grains and its partners' [m]
    real(wp) :: before = 0.0_wp                !! of this rank's grains, an exchange ago [m]
    real(wp) :: most = 0.0_wp                  !! of all ranks' grains, on request [m]
    real(wp) :: foreseen = 0.0_wp  !! of all ranks' grains, predicted for the next step [m]
    real(wp) :: asked(1) = 0.0_wp              !! the same, in the pending reduction
    integer(i8) :: stray = 0                   !! a grain that left the halo within a step; 0: none
    logical :: strayed = .false.               !! some rank has one
    real(wp) :: stray_way = 0.0_wp             !! how far it has come from its domain [m]
    real(wp) :: imbalance = 1.0_wp             !! largest work of a rank over the mean [-]
    integer(i4) :: own = 0                     !! free grains of this rank
    integer(i4) :: mirrors = 0                 !! mirrors of free grains of others
    integer(i8) :: swaps = 0                   !! exchanges so far
    real(wp) :: seconds = 0.0_wp               !! in exchanges so far [s]
    logical :: cell_seen = .false.             !! the whole's contacts are with the ranks, but
    real(wp) :: cell_sums(cell_reals) = 0.0_wp !! these are their sums, see dem_cell_stress [J]
  end type dem_halo_type
end module dem_halo_state
