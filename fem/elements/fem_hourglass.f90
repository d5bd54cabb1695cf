!> Hourglass control of one-point hexahedra (Flanagan and Belytschko 1981), for `lanes` elements at
!! once. With hourglass base vectors h_m (+1, -1 at the nodes), mean gradients b_i and the moments
!! X_mi = sum_a h_ma x_ia, gamma_m = h_m - X_mi b_i is orthogonal to all linear fields: it measures
!! what one point misses. The modes q_mi = gamma_m . u_i get the forces c q_mi, with
!!   c = (share/8) (lambda + 2 mu) V sum b_ia^2,
!! a share of the largest stiffness of uniform strains. A cube by full integration has 0.06 to 0.14
!! of it, depending on the mode.
module fem_hourglass
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: lanes, usual_share, hourglass, hourglass_moments, hourglass_stiffness, one_point_data
  public :: one_point_force, one_point_size

  integer(i4), parameter :: lanes = 8            !! elements at once: a vector of 512 bits
  real(wp), parameter :: usual_share = 0.05_wp   !! of the control, unless the deck gives another
  real(wp), parameter :: hourglass(8, 4) = reshape([ &
    1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, &
    1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, &
    1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, &
    -1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp], [8, 4])
  !> What `one_point_force` needs of an element: b (24), moments (12), lambda V, mu V, c.
  integer(i4), parameter :: one_point_size = 39

contains

  !> Moments X (lanes, 3, 4) [m] of nodes x.
  pure subroutine hourglass_moments(x, moment)
    real(wp), intent(in) :: x(lanes, 3, 8)  !! [m]
    real(wp), intent(out) :: moment(lanes, 3, 4)
    integer(i4) :: a, i, m
    moment = 0.0_wp
    do m = 1, 4
      do a = 1, 8
        do i = 1, 3
          moment(:, i, m) = moment(:, i, m) + hourglass(a, m)*x(:, i, a)
        end do
      end do
    end do
  end subroutine hourglass_moments

  !> Stiffness c [N/m] of the modes.
  pure subroutine hourglass_stiffness(b, volume, moduli, share, c)
    real(wp), intent(in) :: b(lanes, 3, 8)     !! mean gradients [1/m]
    real(wp), intent(in) :: volume(lanes)      !! [m^3]
    real(wp), intent(in) :: moduli(lanes, 6)   !! lambda, mu, ... [Pa]
    real(wp), intent(in) :: share(lanes)       !! of the control [-]
    real(wp), intent(out) :: c(lanes)
    integer(i4) :: a, i
    c = 0.0_wp
    do a = 1, 8
      do i = 1, 3
        c = c + b(:, i, a)**2
      end do
    end do
    c = 0.125_wp*share*(moduli(:, 1) + 2.0_wp*moduli(:, 2))*volume*c
  end subroutine hourglass_stiffness

  !> Constants in time, from mean gradients, nodes and moduli.
  pure subroutine one_point_data(x, b, volume, moduli, factor, share, data)
    real(wp), intent(in) :: x(lanes, 3, 8), b(lanes, 3, 8), volume(lanes)
    real(wp), intent(in) :: moduli(lanes, 6), factor(lanes)  !! factor: weight of the point [-]
    real(wp), intent(in) :: share(lanes)                     !! of the hourglass control [-]
    real(wp), intent(out) :: data(lanes, one_point_size)
    real(wp) :: moment(lanes, 3, 4), c(lanes)
    call hourglass_moments(x, moment)
    call hourglass_stiffness(b, volume, moduli, share, c)
    data(:, 1:24) = reshape(b, [lanes, 24])
    data(:, 25:36) = reshape(moment, [lanes, 12])
    data(:, 37) = factor*moduli(:, 1)*volume
    data(:, 38) = factor*moduli(:, 2)*volume
    data(:, 39) = factor*c
  end subroutine one_point_data

  !> Nodal forces f [N] of displacements u [m]: f_ia = b_ja (V sigma_ij - X_mj r_mi) + h_ma r_mi
  !! with r = c q, where q_mi = h_m . u_i - X_mj u_i,j.
  pure subroutine one_point_force(data, u, f)
    real(wp), intent(in) :: data(lanes, one_point_size), u(lanes, 3, 8)
    real(wp), intent(out) :: f(lanes, 3, 8)
    real(wp) :: g(lanes, 3, 3), s(lanes, 3, 3), r(lanes, 3, 4)
    integer(i4) :: a, i, j

    g = 0.0_wp
    do a = 1, 8
      do j = 1, 3
        do i = 1, 3
          g(:, i, j) = g(:, i, j) + u(:, i, a)*data(:, 3*a - 3 + j)
        end do
      end do
    end do
    call modes(u, r)
    call stresses(data, g, r, s)
    call nodal(data, s, r, f)
  end subroutine one_point_force

  !> h_m . u_i by sums and differences.
  pure subroutine modes(u, r)
    real(wp), intent(in) :: u(lanes, 3, 8)
    real(wp), intent(out) :: r(lanes, 3, 4)
    real(wp) :: p, q, v, w
    integer(i4) :: i, l
    do i = 1, 3
      !$omp simd private(p, q, v, w)
      do l = 1, lanes
        p = u(l, i, 1) - u(l, i, 7)
        q = u(l, i, 2) - u(l, i, 8)
        v = u(l, i, 3) - u(l, i, 5)
        w = u(l, i, 4) - u(l, i, 6)
        r(l, i, 4) = q + w - p - v
        p = u(l, i, 1) + u(l, i, 7)
        q = u(l, i, 2) + u(l, i, 8)
        v = u(l, i, 3) + u(l, i, 5)
        w = u(l, i, 4) + u(l, i, 6)
        r(l, i, 1) = p + q - v - w
        r(l, i, 2) = p - q - v + w
        r(l, i, 3) = p - q + v - w
      end do
    end do
  end subroutine modes

  !> s_ij = V sigma_ij - X_mj r_mi from the gradients g; on entry r = h_m . u_i, on return c q.
  pure subroutine stresses(data, g, r, s)
    real(wp), intent(in) :: data(lanes, one_point_size), g(lanes, 3, 3)
    real(wp), intent(inout) :: r(lanes, 3, 4)
    real(wp), intent(out) :: s(lanes, 3, 3)
    real(wp) :: trace, mu, x1, x2, x3
    integer(i4) :: i, l, m
    !$omp simd private(trace, mu)
    do l = 1, lanes
      trace = data(l, 37)*(g(l, 1, 1) + g(l, 2, 2) + g(l, 3, 3))
      mu = data(l, 38)
      s(l, 1, 1) = 2.0_wp*mu*g(l, 1, 1) + trace
      s(l, 2, 2) = 2.0_wp*mu*g(l, 2, 2) + trace
      s(l, 3, 3) = 2.0_wp*mu*g(l, 3, 3) + trace
      s(l, 1, 2) = mu*(g(l, 1, 2) + g(l, 2, 1))
      s(l, 1, 3) = mu*(g(l, 1, 3) + g(l, 3, 1))
      s(l, 2, 3) = mu*(g(l, 2, 3) + g(l, 3, 2))
      s(l, 2, 1) = s(l, 1, 2)
      s(l, 3, 1) = s(l, 1, 3)
      s(l, 3, 2) = s(l, 2, 3)
    end do
    do m = 1, 4
      do i = 1, 3
        !$omp simd private(x1, x2, x3)
        do l = 1, lanes
          x1 = data(l, 22 + 3*m)
          x2 = data(l, 23 + 3*m)
          x3 = data(l, 24 + 3*m)
          r(l, i, m) = data(l, 39)*(r(l, i, m) - x1*g(l, i, 1) - x2*g(l, i, 2) - x3*g(l, i, 3))
          s(l, i, 1) = s(l, i, 1) - x1*r(l, i, m)
          s(l, i, 2) = s(l, i, 2) - x2*r(l, i, m)
          s(l, i, 3) = s(l, i, 3) - x3*r(l, i, m)
        end do
      end do
    end do
  end subroutine stresses

  !> f_ia = b_ja s_ij + h_ma r_mi.
  pure subroutine nodal(data, s, r, f)
    real(wp), intent(in) :: data(lanes, one_point_size), s(lanes, 3, 3), r(lanes, 3, 4)
    real(wp), intent(out) :: f(lanes, 3, 8)
    integer(i4) :: a, i
    do a = 1, 8
      do i = 1, 3
        f(:, i, a) = data(:, 3*a - 2)*s(:, i, 1) + data(:, 3*a - 1)*s(:, i, 2) &
          + data(:, 3*a)*s(:, i, 3) + hourglass(a, 1)*r(:, i, 1) + hourglass(a, 2)*r(:, i, 2) &
          + hourglass(a, 3)*r(:, i, 3) + hourglass(a, 4)*r(:, i, 4)
      end do
    end do
  end subroutine nodal
end module fem_hourglass
