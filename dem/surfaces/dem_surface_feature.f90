!> Features of a surface that a grain overlaps, and the contacts that follow from them.
module dem_surface_feature
  use talus_kinds, only: wp, i4
  use dem_surface_state, only: dem_surfaces_type
  use dem_figure, only: figure_type, figure_curvature
  implicit none
  private
  public :: touches_type, features_type, most_features, add_feature, add, append

  integer(i4), parameter :: most_features = 64
  real(wp), parameter :: same_foot = 1.0e-7_wp !! of the grain's radius

  !> Features that a grain overlaps.
  type :: features_type
    integer(i4) :: n = 0
    integer(i4) :: body(most_features), part(most_features)
    integer(i4) :: candidate(most_features)        !! triangle's place in the list of candidates
    integer(i4) :: touch(most_features)            !! contact that it belongs to
    real(wp) :: sign(most_features)                !! 1, of membranes see dem_membrane_find [-]
    real(wp) :: weight(most_features)              !! share in this contact [-]
    real(wp) :: gap(most_features), curvature(most_features)  !! [m], [1/m]
    real(wp) :: normal(3, most_features), foot(3, most_features)  !! [-], [m]
    real(wp) :: share(3, most_features)            !! of the triangle's corners at the foot [-]
    real(wp) :: image(3)                           !! of the candidate that is searched [m]
    real(wp) :: offset(3, most_features)           !! that of each feature [m]
  end type features_type

  !> Contacts that follow from them; behind the n of now those that have just ended.
  type :: touches_type
    integer(i4) :: n = 0
    integer(i4) :: body(most_features), part(most_features)
    real(wp) :: sign(most_features)                         !! forces are multiplied by it [-]
    real(wp) :: gap(most_features), curvature(most_features)  !! [m], [1/m]
    real(wp) :: normal(3, most_features), foot(3, most_features)  !! [-], [m]
    real(wp) :: offset(3, most_features)                    !! of the image that is touched [m]
    real(wp) :: motion(6, most_features)                    !! velocity and spin of the surface
                                                            !! there
  end type touches_type

contains

  !> A feature of a triangle.
  pure subroutine add(s, c, grain, n, gap, foot, share, features)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: c
    type(figure_type), intent(in) :: grain
    real(wp), intent(in) :: n(3), gap, foot(3), share(3)
    type(features_type), intent(inout) :: features
    integer(i4) :: k, body
    k = features%n
    body = s%mesh%owner(s%list%candidate(c))
    call add_feature(body, s%first_part(body), c, n, gap, foot, grain%radius, features)
    if (features%n == k) return
    features%share(:, features%n) = share
    features%curvature(features%n) = figure_curvature(grain, n)
  end subroutine add

  !> One more feature, unless it was found before from the other side of a shared edge.
  pure subroutine add_feature(body, part, c, n, gap, foot, radius, features)
    integer(i4), intent(in) :: body, part, c
    real(wp), intent(in) :: n(3), gap, foot(3), radius
    type(features_type), intent(inout) :: features
    integer(i4) :: k
    do k = 1, features%n
      if (features%body(k) /= body) cycle
      if (sum((features%foot(:, k) - foot)**2) < (same_foot*radius)**2 .and. &
          sum((features%normal(:, k) - n)**2) < same_foot**2) return
    end do
    call append(body, part, c, n, gap, foot, features)
  end subroutine add_feature

  !> One more feature, if there is room.
  pure subroutine append(body, part, c, n, gap, foot, features)
    integer(i4), intent(in) :: body, part, c
    real(wp), intent(in) :: n(3), gap, foot(3)
    type(features_type), intent(inout) :: features
    integer(i4) :: k
    if (features%n == most_features) return
    k = features%n + 1
    features%n = k
    features%body(k) = body
    features%part(k) = part
    features%candidate(k) = c
    features%sign(k) = 1.0_wp
    features%gap(k) = gap
    features%normal(:, k) = n
    features%foot(:, k) = foot
    features%offset(:, k) = features%image
    features%share(:, k) = 0.0_wp
  end subroutine append
end module dem_surface_feature
