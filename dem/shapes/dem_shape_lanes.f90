!> Gap, normal and curvature of the pairs of a block whose bodies have shapes (dem_shape): what
!! dem_gap does for ellipsoids. Powers are computed in blocks that hold superquadrics alone.
module dem_shape_lanes
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_block, only: dem_block_type
  use dem_shape, only: shape_size, at_half, at_rounding
  use dem_shape_gap, only: solve_shapes
  use dem_shape_side, only: shape_side_type, raise_sides, support_side, bend_side, curve_side, &
    turn_side
  use dem_gap, only: settled_residual
  implicit none
  private
  public :: shape_block_type, evaluate_shapes, evaluate_shape_planes, refine_shapes, &
    add_shape_curvatures
  public :: solve_shape_lane, ready_shapes, evaluate_again

  !> Curvatures change by this factor in a radian, near flat spots of superquadrics by more.
  real(wp), parameter :: most_change = 10.0_wp

  !> The shapes of a block; A is the first body, B the second.
  type :: shape_block_type
    type(shape_side_type) :: a, b
    logical :: powers = .false.      !! some exponent is above 2
    real(wp) :: followed(lanes)      !! 1: gap and points have followed the last step
    real(wp) :: kept(lanes)          !! 1 where of these the curvature is kept here
    logical :: keeps = .false.       !! some curvatures are kept
    real(wp) :: curvature(lanes)     !! [1/m]
  end type shape_block_type

contains

  !> Rotations of the gathered records.
  pure subroutine ready_shapes(f, with_first, powers)
    type(shape_block_type), intent(inout) :: f
    logical, intent(in) :: with_first  !! false: A is a plane
    logical, intent(in) :: powers
    f%powers = powers
    f%followed = 0.0_wp
    f%kept = 0.0_wp
    f%keeps = .false.
    if (with_first) call turn_side(f%a)
    call turn_side(f%b)
  end subroutine ready_shapes

  !> g(n), supports, surface points and tangential residual of all lanes.
  pure subroutine evaluate_shapes(b, f)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    integer(i4) :: k
    real(wp) :: g, px, py, pz

    if (f%powers) call raise_sides(b%nx, b%ny, b%nz, f%b, f%a)
    call support_side(f%a, 1.0_wp, f%powers, b%nx, b%ny, b%nz, b%ha, b%ax, b%ay, b%az)
    call support_side(f%b, -1.0_wp, f%powers, b%nx, b%ny, b%nz, b%hb, b%bx, b%by, b%bz)
    !$omp simd private(g, px, py, pz)
    do k = 1, lanes
      g = b%rx(k)*b%nx(k) + b%ry(k)*b%ny(k) + b%rz(k)*b%nz(k) - b%ha(k) - b%hb(k)
      b%gap(k) = g
      px = b%rx(k) - b%ax(k) - b%bx(k) - g*b%nx(k)
      py = b%ry(k) - b%ay(k) - b%by(k) - g*b%ny(k)
      pz = b%rz(k) - b%az(k) - b%bz(k) - g*b%nz(k)
      b%tx(k) = px
      b%ty(k) = py
      b%tz(k) = pz
      b%residual(k) = (px*px + py*py + pz*pz)/(b%ha(k) + b%hb(k))**2
    end do
  end subroutine evaluate_shapes

  !> The same where A is a plane through x_A: the normal is given, A has no extent.
  pure subroutine evaluate_shape_planes(b, f)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    integer(i4) :: k

    if (f%powers) call raise_sides(b%nx, b%ny, b%nz, f%b)
    call support_side(f%b, -1.0_wp, f%powers, b%nx, b%ny, b%nz, b%hb, b%bx, b%by, b%bz)
    !$omp simd
    do k = 1, lanes
      b%ha(k) = 0.0_wp
      b%gap(k) = b%rx(k)*b%nx(k) + b%ry(k)*b%ny(k) + b%rz(k)*b%nz(k) - b%hb(k)
      b%ax(k) = b%rx(k) - b%bx(k) - b%gap(k)*b%nx(k)
      b%ay(k) = b%ry(k) - b%by(k) - b%gap(k)*b%ny(k)
      b%az(k) = b%rz(k) - b%bz(k) - b%gap(k)*b%nz(k)
      b%residual(k) = 0.0_wp
    end do
  end subroutine evaluate_shape_planes

  !> Newton steps for the lanes whose bodies overlap along n and whose n is not converged. Lanes
  !! that resist go to the scalar path. What a lane comes to does not hang on the others.
  subroutine refine_shapes(b, f)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    real(wp) :: ka(lanes, 6), kb(lanes, 6), t(lanes, 3), left(lanes)
    integer(i4) :: trial, k
    integer(i4), parameter :: trials = 3

    do trial = 1, trials
      if (.not. worst_residual(b) > settled_residual) return
      call find_step(b, f, ka, kb, t)
      call find_left(b, f, t, left)
      call follow_step(b, f, ka, kb, t, left)
      call turn_normals(b, t)
      if (.not. maxval(left) > settled_residual) return
      call evaluate_again(b, f)
    end do
    if (.not. worst_residual(b) > settled_residual) return
    do k = 1, lanes
      if (b%gap(k) <= 0.0_wp .and. b%residual(k) > settled_residual) &
        call solve_shape_lane(b, f, k, .false.)
    end do
    call evaluate_again(b, f)
  end subroutine refine_shapes

  !> As evaluate_shapes, but lanes that have followed their last step stay as they are.
  subroutine evaluate_again(b, f)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    real(wp) :: seen(lanes, 7), second(lanes), first(lanes)
    integer(i4) :: k

    if (.not. maxval(f%followed) > 0.0_wp) then
      call evaluate_shapes(b, f)
      return
    end if
    call curve_side(f%b, f%powers, second)
    call curve_side(f%a, f%powers, first)
    f%keeps = .true.
    !$omp simd
    do k = 1, lanes
      f%curvature(k) = merge(f%curvature(k), second(k) + first(k), f%kept(k) > 0.5_wp)
      f%kept(k) = f%followed(k)
      seen(k, 1) = b%gap(k)
      seen(k, 2) = b%ax(k)
      seen(k, 3) = b%ay(k)
      seen(k, 4) = b%az(k)
      seen(k, 5) = b%bx(k)
      seen(k, 6) = b%by(k)
      seen(k, 7) = b%bz(k)
    end do
    call evaluate_shapes(b, f)
    !$omp simd
    do k = 1, lanes
      b%gap(k) = merge(seen(k, 1), b%gap(k), f%followed(k) > 0.5_wp)
      b%ax(k) = merge(seen(k, 2), b%ax(k), f%followed(k) > 0.5_wp)
      b%ay(k) = merge(seen(k, 3), b%ay(k), f%followed(k) > 0.5_wp)
      b%az(k) = merge(seen(k, 4), b%az(k), f%followed(k) > 0.5_wp)
      b%bx(k) = merge(seen(k, 5), b%bx(k), f%followed(k) > 0.5_wp)
      b%by(k) = merge(seen(k, 6), b%by(k), f%followed(k) > 0.5_wp)
      b%bz(k) = merge(seen(k, 7), b%bz(k), f%followed(k) > 0.5_wp)
      b%residual(k) = merge(0.0_wp, b%residual(k), f%followed(k) > 0.5_wp)
    end do
  end subroutine evaluate_again

  !> Greatest residual of the lanes whose bodies overlap.
  pure real(wp) function worst_residual(b) result(worst)
    type(dem_block_type), intent(in) :: b
    integer(i4) :: k
    worst = 0.0_wp
    !$omp simd reduction(max:worst)
    do k = 1, lanes
      worst = max(worst, merge(b%residual(k), 0.0_wp, b%gap(k) <= 0.0_wp))
    end do
  end function worst_residual

  !> Residuals that the steps t leave: in a turn |t| curvatures change by the share c |t|,
  !! and so much of K t stays, K t about |d_t| or, where K is nearly singular, |t|; all of it where
  !! there was no step to take or it leads into another octant, where curvatures jump.
  pure subroutine find_left(b, f, t, left)
    type(dem_block_type), intent(in) :: b
    type(shape_block_type), intent(in) :: f
    real(wp), intent(in) :: t(lanes, 3)
    real(wp), intent(out) :: left(lanes)  !! 0 of lanes whose bodies do not overlap
    real(wp) :: near(lanes), turn
    logical :: inside
    integer(i4) :: k
    near = 1.0_wp/most_change**2
    if (f%powers) then
      call near_flat_spots(f%a, near)
      call near_flat_spots(f%b, near)
    end if
    !$omp simd private(turn, inside)
    do k = 1, lanes
      turn = t(k, 1)**2 + t(k, 2)**2 + t(k, 3)**2
      left(k) = turn/near(k)*(b%residual(k) + turn)
      inside = turn > 0.0_wp .and. turn < min(f%a%inside(k), f%b%inside(k))
      left(k) = merge(left(k), b%residual(k), inside)
      left(k) = merge(left(k), 0.0_wp, b%gap(k) <= 0.0_wp)
    end do
  end subroutine find_left

  !> The square of the least share w of an axis, rounded, if that is less: 1/c^2 near flat spots.
  pure subroutine near_flat_spots(side, near)
    type(shape_side_type), intent(in) :: side
    real(wp), intent(inout) :: near(lanes)
    real(wp) :: least
    integer(i4) :: k
    !$omp simd private(least)
    do k = 1, lanes
      least = min(side%w(k, 1)**2, side%w(k, 2)**2, side%w(k, 3)**2) + side%record(k, at_rounding)
      near(k) = min(near(k), merge(least, 1.0_wp, side%record(k, at_half) < 1.0_wp))
    end do
  end subroutine near_flat_spots

  !> After the last step surface points move by their Hessians and gaps by half the slope, so that
  !! nothing need be evaluated again; the others' are recomputed.
  pure subroutine follow_step(b, f, ka, kb, t, left)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    real(wp), intent(in) :: ka(lanes, 6), kb(lanes, 6), t(lanes, 3)
    real(wp), intent(in) :: left(lanes)  !! residuals that the steps leave
    integer(i4) :: k

    !$omp simd
    do k = 1, lanes
      f%followed(k) = merge(1.0_wp, f%followed(k), .not. left(k) > settled_residual .and. &
                            abs(t(k, 1)) + abs(t(k, 2)) + abs(t(k, 3)) > 0.0_wp)
      b%gap(k) = b%gap(k) + 0.5_wp*(t(k, 1)*b%tx(k) + t(k, 2)*b%ty(k) + t(k, 3)*b%tz(k))
      b%ax(k) = b%ax(k) + ka(k, 1)*t(k, 1) + ka(k, 4)*t(k, 2) + ka(k, 6)*t(k, 3)
      b%ay(k) = b%ay(k) + ka(k, 4)*t(k, 1) + ka(k, 2)*t(k, 2) + ka(k, 5)*t(k, 3)
      b%az(k) = b%az(k) + ka(k, 6)*t(k, 1) + ka(k, 5)*t(k, 2) + ka(k, 3)*t(k, 3)
      b%bx(k) = b%bx(k) + kb(k, 1)*t(k, 1) + kb(k, 4)*t(k, 2) + kb(k, 6)*t(k, 3)
      b%by(k) = b%by(k) + kb(k, 4)*t(k, 1) + kb(k, 2)*t(k, 2) + kb(k, 5)*t(k, 3)
      b%bz(k) = b%bz(k) + kb(k, 6)*t(k, 1) + kb(k, 5)*t(k, 2) + kb(k, 3)*t(k, 3)
    end do
  end subroutine follow_step

  pure subroutine turn_normals(b, t)
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(in) :: t(lanes, 3)
    real(wp) :: tx, ty, tz, length, turn
    integer(i4) :: k
    !$omp simd private(tx, ty, tz, length, turn)
    do k = 1, lanes
      tx = b%nx(k) + t(k, 1)
      ty = b%ny(k) + t(k, 2)
      tz = b%nz(k) + t(k, 3)
      length = 1.0_wp/sqrt(tx*tx + ty*ty + tz*tz)
      turn = abs(t(k, 1)) + abs(t(k, 2)) + abs(t(k, 3))
      b%nx(k) = merge(tx*length, b%nx(k), turn > 0.0_wp)
      b%ny(k) = merge(ty*length, b%ny(k), turn > 0.0_wp)
      b%nz(k) = merge(tz*length, b%nz(k), turn > 0.0_wp)
    end do
  end subroutine turn_normals

  !> Newton's step of the lanes that overlap and are not converged, 0 of the others, and the
  !! Hessians of both bodies: (K_A + K_B + g + c n n) t = d_t.
  pure subroutine find_step(b, f, ka, kb, t)
    type(dem_block_type), intent(in) :: b
    type(shape_block_type), intent(in) :: f
    real(wp), intent(out) :: ka(lanes, 6), kb(lanes, 6), t(lanes, 3)
    real(wp) :: c, g, nx, ny, nz, s1, s2, s3, s4, s5, s6, m1, m2, m3, m4, m5, m6, det
    integer(i4) :: k

    call bend_side(f%a, f%powers, ka)
    call bend_side(f%b, f%powers, kb)
    !$omp simd private(c, g, nx, ny, nz, s1, s2, s3, s4, s5, s6, m1, m2, m3, m4, m5, m6, &
    !$omp   det)
    do k = 1, lanes
      nx = b%nx(k)
      ny = b%ny(k)
      nz = b%nz(k)
      g = b%gap(k)
      c = b%ha(k) + b%hb(k)
      s1 = ka(k, 1) + kb(k, 1) + g + c*nx*nx
      s2 = ka(k, 2) + kb(k, 2) + g + c*ny*ny
      s3 = ka(k, 3) + kb(k, 3) + g + c*nz*nz
      s4 = ka(k, 4) + kb(k, 4) + c*nx*ny
      s5 = ka(k, 5) + kb(k, 5) + c*ny*nz
      s6 = ka(k, 6) + kb(k, 6) + c*nz*nx
      m1 = s2*s3 - s5*s5
      m2 = s3*s1 - s6*s6
      m3 = s1*s2 - s4*s4
      m4 = s5*s6 - s4*s3
      m5 = s6*s4 - s5*s1
      m6 = s4*s5 - s6*s2
      det = s1*m1 + s4*m4 + s6*m6
      det = merge(1.0_wp/det, 0.0_wp, g <= 0.0_wp .and. b%residual(k) > settled_residual &
                  .and. det > 0.0_wp)
      t(k, 1) = (m1*b%tx(k) + m4*b%ty(k) + m6*b%tz(k))*det
      t(k, 2) = (m4*b%tx(k) + m2*b%ty(k) + m5*b%tz(k))*det
      t(k, 3) = (m6*b%tx(k) + m5*b%ty(k) + m3*b%tz(k))*det
    end do
  end subroutine find_step

  !> Solve one lane by the scalar path, from the line of centres if `cold`.
  subroutine solve_shape_lane(b, f, k, cold)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    integer(i4), intent(in) :: k
    logical, intent(in) :: cold
    real(wp) :: n(3), gap, shape_a(shape_size), shape_b(shape_size)
    n = [b%nx(k), b%ny(k), b%nz(k)]
    if (cold) n = 0.0_wp
    shape_a = f%a%record(k, :)
    shape_b = f%b%record(k, :)
    call solve_shapes([b%rx(k), b%ry(k), b%rz(k)], shape_a, shape_b, n, gap)
    b%nx(k) = n(1)
    b%ny(k) = n(2)
    b%nz(k) = n(3)
    f%followed(k) = 0.0_wp
    f%kept(k) = 0.0_wp
  end subroutine solve_shape_lane

  !> Mean curvature of the relative surface, 1/R_e.
  pure subroutine add_shape_curvatures(b, f, with_first)
    type(dem_block_type), intent(inout) :: b
    type(shape_block_type), intent(inout) :: f
    logical, intent(in) :: with_first  !! false: A is a plane
    real(wp) :: first(lanes)
    call curve_side(f%b, f%powers, b%curvature)
    if (.not. with_first) return
    call curve_side(f%a, f%powers, first)
    b%curvature = b%curvature + first
    if (f%keeps) b%curvature = merge(f%curvature, b%curvature, f%kept > 0.5_wp)
  end subroutine add_shape_curvatures
end module dem_shape_lanes
