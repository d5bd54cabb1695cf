!> Pairs of features: which may touch, their gaps, also over a shift of an image, and their lanes.
program test_dem_feature_pairs
  use talus_kinds, only: wp, i4
  use dem_block, only: dem_block_type
  use dem_feature_pairs, only: cannot_touch, of_features, find_feature_gap, evaluate_features, &
    meets_planes, bounding_records
  use dem_feature_state, only: feature_none, feature_vertex, feature_edge, feature_face
  use dem_state, only: dem_pairs_type, lanes, body_size
  use talus_test, only: test_type
  implicit none

  !> Three vertices of a triangle, two of its edges, its face, a second edge, a sphere, two pads, an
  !! image of the sphere. The second edge has the first two vertices as corners, too.
  integer(i4), parameter :: grains = 8, pad = 9, image = 12
  real(wp), parameter :: r = 0.1_wp, ball = 0.5_wp
  type(dem_pairs_type) :: pairs
  type(test_type) :: test

  call make()
  call judge_kinds()
  call judge_gaps()
  call judge_lanes()
  call test%finish()

contains

  subroutine make()
    integer(i4) :: i
    allocate (pairs%body(body_size, image), source=0.0_wp)
    pairs%grain = [(i, i=1, grains), 0_i4, 0_i4, 0_i4, 8_i4]
    pairs%plain = image - 1
    pairs%body(1:3, 1) = [0.0_wp, 0.0_wp, 0.0_wp]
    pairs%body(1:3, 2) = [2.0_wp, 0.0_wp, 0.0_wp]
    pairs%body(1:3, 3) = [0.0_wp, 2.0_wp, 0.0_wp]
    pairs%body(1:3, 4) = [1.0_wp, 0.0_wp, 0.0_wp]
    pairs%body(1:3, 5) = [0.0_wp, 1.0_wp, 0.0_wp]
    pairs%body(1:3, 6) = [0.5_wp, 0.5_wp, 0.0_wp]
    pairs%body(1:3, 7) = [1.0_wp, 1.0_wp, 0.0_wp]
    pairs%body(1:3, 8) = [0.25_wp, 0.25_wp, 5.0_wp]
    pairs%body(1:3, pad) = [-1.0e4_wp, 0.0_wp, 0.0_wp]
    pairs%body(1:3, pad + 1) = [1.0e4_wp, 0.0_wp, 0.0_wp]
    pairs%body(1:3, image) = pairs%body(1:3, 8) - [0.0_wp, 0.0_wp, 4.5_wp]
    pairs%body(10:12, :) = r*r
    pairs%body(10:12, 8) = ball**2
    pairs%body(10:12, image) = ball**2
    allocate (pairs%features)
    pairs%features%kind = [feature_vertex, feature_vertex, feature_vertex, feature_edge, &
                           feature_edge, feature_face, feature_edge, feature_none]
    pairs%features%start = [1_i4, 2_i4, 3_i4, 4_i4, 6_i4, 8_i4, 11_i4, 13_i4, 13_i4]
    pairs%features%corner = [1_i4, 2_i4, 3_i4, 1_i4, 2_i4, 1_i4, 3_i4, 1_i4, 2_i4, 3_i4, 2_i4, 3_i4]
  end subroutine make

  subroutine judge_kinds()
    real(wp) :: body(body_size, grains)
    call test%check('a vertex and a face', .not. cannot_touch(pairs, 1, 6))
    call test%check('two edges', .not. cannot_touch(pairs, 4, 5))
    call test%check('a sphere and a face', .not. cannot_touch(pairs, 6, image))
    call test%check('two vertices', cannot_touch(pairs, 1, 2))
    call test%check('a vertex and an edge', cannot_touch(pairs, 1, 4))
    call test%check('an edge and a face', cannot_touch(pairs, 4, 6))
    call test%check('two faces', cannot_touch(pairs, 6, 6))
    call test%check('a sphere and a vertex', cannot_touch(pairs, 1, 8))
    call test%check('a sphere and an edge', cannot_touch(pairs, 4, image))
    call test%check('spheres are no features', .not. of_features(pairs, 1, 8))
    call test%check('edges are', of_features(pairs, 4, 5))
    call test%check('planes meet vertices', meets_planes(pairs, 1) .and. meets_planes(pairs, 8))
    call test%check('and not faces', .not. (meets_planes(pairs, 4) .or. meets_planes(pairs, 6)))
    body = bounding_records(pairs, [r, r, r, 2.0_wp, 2.0_wp, 3.0_wp, 2.0_wp, ball])
    call test%check_close('an edge is found as its sphere', body(11, 4), 4.0_wp, 1.0e-15_wp)
    call test%check_close('a vertex as itself', body(11, 1), r*r, 1.0e-15_wp)
  end subroutine judge_kinds

  subroutine judge_gaps()
    real(wp) :: normal(3), gap
    normal = 0.0_wp
    call find_feature_gap(pairs, 6, image, normal, gap)
    call test%check_close('gap of a face and an image', gap, 0.5_wp - r - ball, 1.0e-14_wp)
    call test%check_close('its normal', norm2(normal - [0.0_wp, 0.0_wp, 1.0_wp]), 0.0_wp, &
                          1.0e-14_wp)
    pairs%body(1:3, image) = [3.0_wp, 0.0_wp, 0.0_wp]
    call find_feature_gap(pairs, 6, image, normal, gap)
    call test%check_close('beyond a corner of the face', gap, 1.0_wp - r - ball, 1.0e-14_wp)
    pairs%body(1:3, image) = [0.25_wp, 0.25_wp, 0.5_wp]
    normal = [0.0_wp, 1.0_wp, 0.0_wp]
    call find_feature_gap(pairs, 4, 5, normal, gap)
    call test%check_close('edges with a point in common', gap, -2.0_wp*r, 1.0e-14_wp)
    call test%check_close('keep the normal before', normal(2), 1.0_wp, 1.0e-14_wp)
  end subroutine judge_gaps

  !> A block of a face and a sphere, of two edges, of pads.
  subroutine judge_lanes()
    type(dem_block_type) :: b
    real(wp) :: touch(3)
    allocate (pairs%first(lanes, 1), source=pad)
    allocate (pairs%second(lanes, 1), source=pad + 1_i4)
    pairs%first(1:2, 1) = [6_i4, 4_i4]
    pairs%second(1:2, 1) = [image, 7_i4]
    b%a%s = r*r
    b%b%s = r*r
    b%b%s(1, :) = ball**2
    b%nx = 1.0_wp
    b%ny = 0.0_wp
    b%nz = 0.0_wp
    b%rx = pairs%body(1, pairs%second(:, 1)) - pairs%body(1, pairs%first(:, 1))
    b%ry = pairs%body(2, pairs%second(:, 1)) - pairs%body(2, pairs%first(:, 1))
    b%rz = pairs%body(3, pairs%second(:, 1)) - pairs%body(3, pairs%first(:, 1))
    call evaluate_features(pairs, 1_i4, b)
    call test%check_close('gap in a lane', b%gap(1), 0.5_wp - r - ball, 1.0e-14_wp)
    touch = [b%ax(1), b%ay(1), b%az(1)] + pairs%body(1:3, 6)
    call test%check_close('surface point of the face', norm2(touch - [0.25_wp, 0.25_wp, r]), &
                          0.0_wp, 1.0e-14_wp)
    touch = pairs%body(1:3, image) - [b%bx(1), b%by(1), b%bz(1)]
    call test%check_close('of the sphere', norm2(touch - [0.25_wp, 0.25_wp, 0.0_wp]), 0.0_wp, &
                          1.0e-14_wp)
    call test%check_close('curvature of a sphere on a face', b%curvature(1), 1.0_wp/ball, &
                          1.0e-14_wp)
    call test%check_close('curvature of two edges', b%curvature(2), 1.0_wp/r, 1.0e-13_wp)
    call test%check('pads are far apart', all(b%gap(3:) > 1.0e4_wp))
  end subroutine judge_lanes
end program test_dem_feature_pairs
