!> Gap and common normal of two convex bodies: the direction that maximises
!! g(n) = r.n - h_A(n) - h_B(-n). Batched over the lanes of a block, and a scalar, safeguarded path.
!!
!! Newton on the tangent plane: (K_A + K_B + g I) t = d_t, n <- (n + t)/|n + t|. Any n bounds the
!! distance from below, so g(n) > 0 means no contact after one evaluation
!! (theory-dem, Contact geometry).
!! eq. D.11
module dem_gap
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_block, only: dem_block_type
  use dem_ellipsoid, only: matrix_times, line_of_centres, one_centre
  implicit none
  private
  public :: branch_vectors, evaluate_pairs, evaluate_spheres, evaluate_planes, &
    refine_normals, add_curvatures, solve_gap, solve_lane
  public :: settled_residual

  !> |d_t|^2/(h_A + h_B)^2 below which a normal counts as converged: 1e-8 radian or so.
  real(wp), parameter :: settled_residual = 1.0e-16_wp
  integer(i4), parameter :: most_steps = 60

contains

  !> x_B - x_A of all lanes.
  pure subroutine branch_vectors(b)
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k
    !$omp simd
    do k = 1, lanes
      b%rx(k) = b%b%x(k, 1) - b%a%x(k, 1)
      b%ry(k) = b%b%x(k, 2) - b%a%x(k, 2)
      b%rz(k) = b%b%x(k, 3) - b%a%x(k, 3)
    end do
  end subroutine branch_vectors

  !> Normal, gap, surface points and supports of all lanes where both bodies are spheres.
  pure subroutine evaluate_spheres(b)
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k
    real(wp) :: nx, ny, nz, distance, inverse, ra, rb

    !$omp simd private(nx, ny, nz, distance, inverse, ra, rb)
    do k = 1, lanes
      ra = sqrt(b%a%s(k, 1))
      rb = sqrt(b%b%s(k, 1))
      distance = sqrt(b%rx(k)*b%rx(k) + b%ry(k)*b%ry(k) + b%rz(k)*b%rz(k))
      inverse = merge(1.0_wp/max(distance, one_centre), 0.0_wp, distance > one_centre)
      nx = b%rx(k)*inverse
      ny = b%ry(k)*inverse
      nz = merge(b%rz(k)*inverse, 1.0_wp, distance > one_centre)  ! as line_of_centres
      b%nx(k) = nx
      b%ny(k) = ny
      b%nz(k) = nz
      b%gap(k) = distance - ra - rb
      b%ax(k) = ra*nx
      b%ay(k) = ra*ny
      b%az(k) = ra*nz
      b%ha(k) = ra
      b%hb(k) = rb
    end do
  end subroutine evaluate_spheres

  !> g(n), supports, surface points and tangential residual of all lanes.
  pure subroutine evaluate_pairs(b)
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k
    real(wp) :: nx, ny, nz, px, py, pz, qx, qy, qz, h, g

    !$omp simd private(nx, ny, nz, px, py, pz, qx, qy, qz, h, g)
    do k = 1, lanes
      nx = b%nx(k)
      ny = b%ny(k)
      nz = b%nz(k)
      px = b%a%s(k, 1)*nx + b%a%s(k, 4)*ny + b%a%s(k, 6)*nz
      py = b%a%s(k, 4)*nx + b%a%s(k, 2)*ny + b%a%s(k, 5)*nz
      pz = b%a%s(k, 6)*nx + b%a%s(k, 5)*ny + b%a%s(k, 3)*nz
      qx = b%b%s(k, 1)*nx + b%b%s(k, 4)*ny + b%b%s(k, 6)*nz
      qy = b%b%s(k, 4)*nx + b%b%s(k, 2)*ny + b%b%s(k, 5)*nz
      qz = b%b%s(k, 6)*nx + b%b%s(k, 5)*ny + b%b%s(k, 3)*nz
      h = sqrt(nx*px + ny*py + nz*pz)
      b%ha(k) = h
      h = 1.0_wp/h
      px = px*h
      py = py*h
      pz = pz*h
      h = sqrt(nx*qx + ny*qy + nz*qz)
      b%hb(k) = h
      h = 1.0_wp/h
      qx = qx*h
      qy = qy*h
      qz = qz*h
      g = b%rx(k)*nx + b%ry(k)*ny + b%rz(k)*nz - b%ha(k) - b%hb(k)
      b%ax(k) = px
      b%ay(k) = py
      b%az(k) = pz
      b%bx(k) = qx
      b%by(k) = qy
      b%bz(k) = qz
      b%gap(k) = g
      px = b%rx(k) - px - qx - g*nx
      py = b%ry(k) - py - qy - g*ny
      pz = b%rz(k) - pz - qz - g*nz
      b%tx(k) = px
      b%ty(k) = py
      b%tz(k) = pz
      b%residual(k) = (px*px + py*py + pz*pz)/(b%ha(k) + b%hb(k))**2
    end do
  end subroutine evaluate_pairs

  !> As evaluate_pairs where A is a plane through x_A: the normal is given, A has no extent.
  pure subroutine evaluate_planes(b)
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k
    real(wp) :: nx, ny, nz, qx, qy, qz, h

    !$omp simd private(nx, ny, nz, qx, qy, qz, h)
    do k = 1, lanes
      nx = b%nx(k)
      ny = b%ny(k)
      nz = b%nz(k)
      qx = b%b%s(k, 1)*nx + b%b%s(k, 4)*ny + b%b%s(k, 6)*nz
      qy = b%b%s(k, 4)*nx + b%b%s(k, 2)*ny + b%b%s(k, 5)*nz
      qz = b%b%s(k, 6)*nx + b%b%s(k, 5)*ny + b%b%s(k, 3)*nz
      h = sqrt(nx*qx + ny*qy + nz*qz)
      b%ha(k) = 0.0_wp
      b%hb(k) = h
      h = 1.0_wp/h
      b%bx(k) = qx*h
      b%by(k) = qy*h
      b%bz(k) = qz*h
      b%gap(k) = b%rx(k)*nx + b%ry(k)*ny + b%rz(k)*nz - b%hb(k)
      b%ax(k) = b%rx(k) - b%bx(k) - b%gap(k)*nx
      b%ay(k) = b%ry(k) - b%by(k) - b%gap(k)*ny
      b%az(k) = b%rz(k) - b%bz(k) - b%gap(k)*nz
      b%residual(k) = 0.0_wp
    end do
  end subroutine evaluate_planes

  !> Newton steps for the lanes whose bodies overlap along n and whose n is not converged.
  !!
  !! A lane's course depends on that lane alone. Lanes that resist go to the scalar path.
  subroutine refine_normals(b)
    type(dem_block_type), intent(inout) :: b
    logical :: needs(lanes)
    integer(i4) :: trial, k
    integer(i4), parameter :: trials = 4

    do trial = 1, trials
      needs = b%gap <= 0.0_wp .and. b%residual > settled_residual
      if (.not. any(needs)) return
      call newton_step(b, needs)
      call evaluate_pairs(b)
    end do
    needs = b%gap <= 0.0_wp .and. b%residual > settled_residual
    if (.not. any(needs)) return
    do k = 1, lanes
      if (needs(k)) call solve_lane(b, k, .false.)
    end do
    call evaluate_pairs(b)
  end subroutine refine_normals

  !> One full Newton step of the marked lanes.
  pure subroutine newton_step(b, needs)
    type(dem_block_type), intent(inout) :: b
    logical, intent(in) :: needs(lanes)
    integer(i4) :: k
    real(wp) :: ia, ib, c, g, nx, ny, nz, s(6), m(6), tx, ty, tz, det, length, use

    !$omp simd private(ia, ib, c, g, nx, ny, nz, s, m, tx, ty, tz, det, length, use)
    do k = 1, lanes
      nx = b%nx(k)
      ny = b%ny(k)
      nz = b%nz(k)
      g = b%gap(k)
      ia = 1.0_wp/b%ha(k)
      ib = 1.0_wp/b%hb(k)
      c = b%ha(k) + b%hb(k)
      s(1) = (b%a%s(k, 1) - b%ax(k)*b%ax(k))*ia + (b%b%s(k, 1) - b%bx(k)*b%bx(k))*ib + g + c*nx*nx
      s(2) = (b%a%s(k, 2) - b%ay(k)*b%ay(k))*ia + (b%b%s(k, 2) - b%by(k)*b%by(k))*ib + g + c*ny*ny
      s(3) = (b%a%s(k, 3) - b%az(k)*b%az(k))*ia + (b%b%s(k, 3) - b%bz(k)*b%bz(k))*ib + g + c*nz*nz
      s(4) = (b%a%s(k, 4) - b%ax(k)*b%ay(k))*ia + (b%b%s(k, 4) - b%bx(k)*b%by(k))*ib + c*nx*ny
      s(5) = (b%a%s(k, 5) - b%ay(k)*b%az(k))*ia + (b%b%s(k, 5) - b%by(k)*b%bz(k))*ib + c*ny*nz
      s(6) = (b%a%s(k, 6) - b%az(k)*b%ax(k))*ia + (b%b%s(k, 6) - b%bz(k)*b%bx(k))*ib + c*nz*nx
      m(1) = s(2)*s(3) - s(5)*s(5)
      m(2) = s(3)*s(1) - s(6)*s(6)
      m(3) = s(1)*s(2) - s(4)*s(4)
      m(4) = s(5)*s(6) - s(4)*s(3)
      m(5) = s(6)*s(4) - s(5)*s(1)
      m(6) = s(4)*s(5) - s(6)*s(2)
      det = s(1)*m(1) + s(4)*m(4) + s(6)*m(6)
      use = merge(1.0_wp, 0.0_wp, needs(k) .and. det > 0.0_wp)
      det = use/merge(det, 1.0_wp, det > 0.0_wp)
      tx = nx + (m(1)*b%tx(k) + m(4)*b%ty(k) + m(6)*b%tz(k))*det
      ty = ny + (m(4)*b%tx(k) + m(2)*b%ty(k) + m(5)*b%tz(k))*det
      tz = nz + (m(6)*b%tx(k) + m(5)*b%ty(k) + m(3)*b%tz(k))*det
      length = 1.0_wp/sqrt(tx*tx + ty*ty + tz*tz)
      b%nx(k) = merge(tx*length, nx, use > 0.5_wp)
      b%ny(k) = merge(ty*length, ny, use > 0.5_wp)
      b%nz(k) = merge(tz*length, nz, use > 0.5_wp)
    end do
  end subroutine newton_step

  !> Solve one lane by the scalar path, from the line of centres if `cold`.
  subroutine solve_lane(b, k, cold)
    type(dem_block_type), intent(inout) :: b
    integer(i4), intent(in) :: k
    logical, intent(in) :: cold
    real(wp) :: n(3), gap, shape_a(6), shape_b(6)
    n = [b%nx(k), b%ny(k), b%nz(k)]
    if (cold) n = 0.0_wp
    shape_a = b%a%s(k, :)
    shape_b = b%b%s(k, :)
    call solve_gap([b%rx(k), b%ry(k), b%rz(k)], shape_a, shape_b, n, gap)
    b%nx(k) = n(1)
    b%ny(k) = n(2)
    b%nz(k) = n(3)
  end subroutine solve_lane

  !> Common normal and gap of one pair: safeguarded Newton ascent of g, to rounding. All gaps on the
  !! way are less than the true one: a pair that is further apart than `enough` is left there.
  pure subroutine solve_gap(r, a, b, n, gap, enough)
    real(wp), intent(in) :: r(3)           !! x_B - x_A [m]
    real(wp), intent(in) :: a(6), b(6)     !! shape matrices [m^2]
    real(wp), intent(inout) :: n(3)        !! start (zero: line of centres), then the normal
    real(wp), intent(out) :: gap           !! g at the normal [m]
    real(wp), intent(in), optional :: enough  !! [m]
    real(wp) :: t(3), trial(3), trial_gap, most, residual, fraction, rounding
    integer(i4) :: step, cut
    integer(i4), parameter :: most_cuts = 30

    rounding = 4.0_wp*epsilon(1.0_wp)*sqrt(sum(r*r))
    if (.not. sum(n*n) > 0.5_wp) n = line_of_centres(r)
    most = huge(most)
    if (present(enough)) most = enough
    call ascent(r, a, b, n, gap, t, residual)
    do step = 1, most_steps
      if (residual <= 1.0e-28_wp .or. gap > most) return
      fraction = min(1.0_wp, 0.7_wp/sqrt(sum(t*t)))
      do cut = 1, most_cuts
        trial = n + fraction*t
        trial = trial/sqrt(sum(trial*trial))
        trial_gap = dot_product(r, trial) - sqrt(dot_product(trial, matrix_times(a, trial))) &
                    - sqrt(dot_product(trial, matrix_times(b, trial)))
        if (trial_gap >= gap - rounding) exit
        fraction = 0.5_wp*fraction
      end do
      if (cut > most_cuts) return
      n = trial
      call ascent(r, a, b, n, gap, t, residual)
    end do
  end subroutine solve_gap

  !> g(n), relative squared residual and ascent direction (Newton's, else the gradient's).
  pure subroutine ascent(r, a, b, n, gap, t, residual)
    real(wp), intent(in) :: r(3), a(6), b(6), n(3)
    real(wp), intent(out) :: gap, t(3), residual
    real(wp) :: ua(3), ub(3), ha, hb, d(3), s(6), m(6), det, c

    ua = matrix_times(a, n)
    ha = sqrt(dot_product(n, ua))
    ua = ua/ha
    ub = matrix_times(b, n)
    hb = sqrt(dot_product(n, ub))
    ub = ub/hb
    gap = dot_product(r, n) - ha - hb
    d = r - ua - ub - gap*n
    c = ha + hb
    residual = sum(d*d)/(c*c)
    s(1:3) = (a(1:3) - ua*ua)/ha + (b(1:3) - ub*ub)/hb + gap + c*n*n
    s(4) = (a(4) - ua(1)*ua(2))/ha + (b(4) - ub(1)*ub(2))/hb + c*n(1)*n(2)
    s(5) = (a(5) - ua(2)*ua(3))/ha + (b(5) - ub(2)*ub(3))/hb + c*n(2)*n(3)
    s(6) = (a(6) - ua(3)*ua(1))/ha + (b(6) - ub(3)*ub(1))/hb + c*n(3)*n(1)
    m(1) = s(2)*s(3) - s(5)*s(5)
    m(2) = s(3)*s(1) - s(6)*s(6)
    m(3) = s(1)*s(2) - s(4)*s(4)
    m(4) = s(5)*s(6) - s(4)*s(3)
    m(5) = s(6)*s(4) - s(5)*s(1)
    m(6) = s(4)*s(5) - s(6)*s(2)
    det = s(1)*m(1) + s(4)*m(4) + s(6)*m(6)
    if (det > 0.0_wp .and. m(3) > 0.0_wp .and. s(1) > 0.0_wp) then
      t = matrix_times(m, d)/det
    else
      t = d/c
    end if
  end subroutine ascent

  !> Mean curvature of the relative surface, 1/R_e, from trace and determinant of K on the tangent
  !! plane: tr(K^-1) = tr K/det K = (tr A - u.u) h^3/(a b c)^2.
  pure subroutine add_curvatures(b, with_first)
    type(dem_block_type), intent(inout) :: b
    logical, intent(in) :: with_first  !! false: A is a plane
    integer(i4) :: k

    !$omp simd
    do k = 1, lanes
      b%curvature(k) = 0.5_wp*(b%b%s(k, 1) + b%b%s(k, 2) + b%b%s(k, 3) &
                              - b%bx(k)**2 - b%by(k)**2 - b%bz(k)**2) &
                       *(b%hb(k)*b%hb(k)*b%hb(k))/b%b%volume(k)
    end do
    if (.not. with_first) return
    !$omp simd
    do k = 1, lanes
      b%curvature(k) = b%curvature(k) + 0.5_wp*(b%a%s(k, 1) + b%a%s(k, 2) + b%a%s(k, 3) &
                       - b%ax(k)**2 - b%ay(k)**2 - b%az(k)**2) &
                       *(b%ha(k)*b%ha(k)*b%ha(k))/b%a%volume(k)
    end do
  end subroutine add_curvatures
end module dem_gap
