!> Features of rounded polyhedra. Members of a polyhedron are its vertices, edges and faces, each
!! swept by a sphere of one radius. Corners of edges and faces are members, too: their vertices.
!! eq. D.92
module dem_feature_state
  use talus_kinds, only: i4
  implicit none
  private
  public :: dem_features_type, feature_none, feature_vertex, feature_edge, feature_face
  public :: shape_features, may_touch

  integer(i4), parameter :: feature_none = 0    !! a grain, or a sphere of a clump
  integer(i4), parameter :: feature_vertex = 1
  integer(i4), parameter :: feature_edge = 2
  integer(i4), parameter :: feature_face = 3

  integer(i4), parameter :: shape_features = 3  !! of a block of pairs, behind the kinds of shapes

  !> Of all grains.
  type :: dem_features_type
    integer(i4), allocatable :: kind(:)    !! (grains) feature_...
    integer(i4), allocatable :: start(:)   !! (grains+1) first corner of each
    integer(i4), allocatable :: corner(:)  !! vertices, those of faces in turn about the outward
                                           !! normal
  end type dem_features_type

contains

  !> Can two features have a contact of their own? All others of two polyhedra are at the ends of
  !! these.
  elemental logical function may_touch(a, b)
    integer(i4), intent(in) :: a, b  !! feature_...
    select case (max(a, b))
    case (feature_none)
      may_touch = .true.
    case (feature_face)
      may_touch = min(a, b) <= feature_vertex
    case (feature_edge)
      may_touch = a == b
    case default
      may_touch = .false.
    end select
  end function may_touch
end module dem_feature_state
