!> Gaps and normals of pairs of features of rounded polyhedra: of a vertex, or a sphere, and a face,
!! and of two edges. The nearest points of both are centres of the spheres that meet.
!! eqs. D.95 and D.97
module dem_feature_pairs
  use talus_kinds, only: wp, i4
  use dem_block, only: dem_block_type
  use dem_feature_gap, only: nearest_of_polygon, nearest_of_segments
  use dem_feature_state, only: dem_features_type, feature_none, feature_edge, feature_face, &
    may_touch
  use dem_state, only: dem_pairs_type, lanes
  implicit none
  private
  public :: cannot_touch, of_features, find_feature_gap, evaluate_features, meets_planes
  public :: bounding_records

  !> Mean curvature of features of radius 1: of a sphere or a vertex, an edge, a face.
  real(wp), parameter :: bend(feature_none:feature_face) = [1.0_wp, 1.0_wp, 0.5_wp, 0.0_wp]

contains

  !> What body is a feature of; planes and pads are none.
  pure integer(i4) function kind_of(pairs, body) result(kind)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: body
    kind = feature_none
    if (pairs%grain(body) > 0) kind = pairs%features%kind(pairs%grain(body))
  end function kind_of

  !> Is this pair left to other features of its bodies?
  pure logical function cannot_touch(pairs, i, j)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: i, j
    cannot_touch = .false.
    if (.not. allocated(pairs%features)) return
    cannot_touch = .not. may_touch(kind_of(pairs, i), kind_of(pairs, j))
  end function cannot_touch

  !> Is one of the bodies an edge or a face?
  pure logical function of_features(pairs, i, j)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: i, j
    of_features = .false.
    if (.not. allocated(pairs%features)) return
    of_features = max(kind_of(pairs, i), kind_of(pairs, j)) >= feature_edge
  end function of_features

  !> Planes meet polyhedra at their vertices alone.
  pure logical function meets_planes(pairs, body)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: body
    meets_planes = .true.
    if (allocated(pairs%features)) meets_planes = kind_of(pairs, body) < feature_edge
  end function meets_planes

  !> Records of the grains as the search wants them: edges and faces as their bounding spheres.
  pure function bounding_records(pairs, radius) result(body)
    type(dem_pairs_type), intent(in) :: pairs
    real(wp), intent(in) :: radius(:)  !! (grains) [m]
    real(wp) :: body(size(pairs%body, 1), size(radius))
    integer(i4) :: i
    body = pairs%body(:, :size(radius))
    do i = 1, size(radius, kind=i4)
      if (pairs%features%kind(i) >= feature_edge) body(10:12, i) = radius(i)**2
    end do
  end function bounding_records

  !> Number of the corners of a body.
  pure integer(i4) function corners(pairs, body)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: body
    corners = 0
    associate (grain => pairs%grain(body))
      if (grain > 0) corners = pairs%features%start(grain + 1) - pairs%features%start(grain)
    end associate
  end function corners

  !> Corners of a body whose centre is at a point [m].
  pure subroutine put_corners(pairs, body, point, x)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: body
    real(wp), intent(in) :: point(3)
    real(wp), intent(out) :: x(:, :)
    integer(i4) :: k, grain
    grain = pairs%grain(body)
    do k = 1, size(x, 2, kind=i4)
      x(:, k) = pairs%body(1:3, pairs%features%corner(pairs%features%start(grain) + k - 1)) &
                - pairs%body(1:3, grain) + point
    end do
  end subroutine put_corners

  !> Nearest points of the cores of two bodies, from the centre of the first [m].
  pure subroutine nearest_points(pairs, i, j, p, q)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: i, j
    real(wp), intent(out) :: p(3), q(3)
    real(wp) :: a(3, corners(pairs, i)), b(3, corners(pairs, j))
    integer(i4) :: kinds(2)

    kinds = [kind_of(pairs, i), kind_of(pairs, j)]
    p = 0.0_wp
    q = pairs%body(1:3, j) - pairs%body(1:3, i)
    if (kinds(1) >= feature_edge) call put_corners(pairs, i, p, a)
    if (kinds(2) >= feature_edge) call put_corners(pairs, j, q, b)
    if (kinds(1) == feature_edge .and. kinds(2) == feature_edge) then
      call nearest_of_segments(a, b, p, q)
    else if (kinds(1) == feature_face) then
      p = nearest_of_polygon(q, a)
    else if (kinds(2) == feature_face) then
      q = nearest_of_polygon(p, b)
    end if
  end subroutine nearest_points

  !> Gap of a pair, and its normal unless the cores have a point in common.
  pure subroutine find_feature_gap(pairs, i, j, normal, gap)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: i, j
    real(wp), intent(inout) :: normal(3)  !! from i to j
    real(wp), intent(out) :: gap          !! [m]
    real(wp) :: p(3), q(3), distance

    call nearest_points(pairs, i, j, p, q)
    distance = norm2(q - p)
    gap = distance - sqrt(pairs%body(10, i)) - sqrt(pairs%body(10, j))
    if (distance > tiny(1.0_wp)) normal = (q - p)/distance
    if (.not. sum(normal*normal) > 0.5_wp) normal = [0.0_wp, 0.0_wp, 1.0_wp]
  end subroutine find_feature_gap

  !> Gap, normal, surface points and curvature of all lanes of block k; normals before are there.
  pure subroutine evaluate_features(pairs, k, b)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: k
    type(dem_block_type), intent(inout) :: b
    real(wp) :: p(3), q(3), n(3), radii(2), distance
    integer(i4) :: lane, i, j

    do lane = 1, lanes
      i = pairs%first(lane, k)
      j = pairs%second(lane, k)
      call nearest_points(pairs, i, j, p, q)
      distance = norm2(q - p)
      n = [b%nx(lane), b%ny(lane), b%nz(lane)]
      if (distance > tiny(1.0_wp)) n = (q - p)/distance
      radii = sqrt([b%a%s(lane, 1), b%b%s(lane, 1)])
      b%nx(lane) = n(1)
      b%ny(lane) = n(2)
      b%nz(lane) = n(3)
      b%gap(lane) = distance - radii(1) - radii(2)
      b%ha(lane) = radii(1)
      b%hb(lane) = radii(2)
      b%ax(lane) = p(1) + radii(1)*n(1)
      b%ay(lane) = p(2) + radii(1)*n(2)
      b%az(lane) = p(3) + radii(1)*n(3)
      b%bx(lane) = b%rx(lane) - q(1) + radii(2)*n(1)
      b%by(lane) = b%ry(lane) - q(2) + radii(2)*n(2)
      b%bz(lane) = b%rz(lane) - q(3) + radii(2)*n(3)
      b%residual(lane) = 0.0_wp
      b%curvature(lane) = bend(kind_of(pairs, i))/radii(1) + bend(kind_of(pairs, j))/radii(2)
    end do
  end subroutine evaluate_features
end module dem_feature_pairs
