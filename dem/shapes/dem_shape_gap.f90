!> Common normal and gap of two shapes (dem_shape): safeguarded Newton ascent of
!! g(n) = r.n - h_A(n) - h_B(-n), as dem_gap for ellipsoids. Shapes have curvatures that jump or
!! grow a thousandfold within a small angle: a step is shortened until g rises, and where g bends
!! the wrong way the step follows the gradient uphill.
module dem_shape_gap
  use talus_kinds, only: wp, i4
  use dem_ellipsoid, only: line_of_centres
  use dem_shape, only: shape_size, shape_height, shape_tangent
  implicit none
  private
  public :: solve_shapes, gap_of_shapes, find_shape_gap

  integer(i4), parameter :: most_steps = 200, most_cuts = 30
  real(wp), parameter :: longest_turn = 0.7_wp  !! of a step [rad]
  !> |d_t|^2/(h_A + h_B)^2 at which a normal is as good as rounding lets it be.
  real(wp), parameter :: exact_residual = 1.0e-25_wp

contains

  !> g(n) [m].
  pure real(wp) function gap_of_shapes(r, a, b, n) result(gap)
    real(wp), intent(in) :: r(3)                        !! x_B - x_A [m]
    real(wp), intent(in) :: a(shape_size), b(shape_size)
    real(wp), intent(in) :: n(3)                        !! unit vector
    gap = dot_product(r, n) - shape_height(a, n) - shape_height(b, -n)
  end function gap_of_shapes

  !> Gap along the given normal if that already separates the bodies, or along the line of centres
  !! if that leaves more than the skin, else along the true normal.
  pure subroutine find_shape_gap(r, a, b, skin, normal, gap)
    real(wp), intent(in) :: r(3), a(shape_size), b(shape_size), skin
    real(wp), intent(inout) :: normal(3)  !! of the last list, zero without one
    real(wp), intent(out) :: gap          !! or a lower bound of it [m]
    if (sum(normal**2) > 0.5_wp) then
      gap = gap_of_shapes(r, a, b, normal)
      if (gap > 0.0_wp) return
    else
      normal = line_of_centres(r)
      gap = gap_of_shapes(r, a, b, normal)
      if (gap > skin) return
    end if
    call solve_shapes(r, a, b, normal, gap)
  end subroutine find_shape_gap

  !> Common normal and gap of one pair, to rounding.
  pure subroutine solve_shapes(r, a, b, n, gap)
    real(wp), intent(in) :: r(3)                        !! x_B - x_A [m]
    real(wp), intent(in) :: a(shape_size), b(shape_size)
    real(wp), intent(inout) :: n(3)                     !! start (zero: line of centres), normal
    real(wp), intent(out) :: gap                        !! g at the normal [m]
    real(wp) :: t(3), trial(3), value, residual, fraction, rounding, slope
    integer(i4) :: step, cut

    rounding = 4.0_wp*epsilon(1.0_wp)*sqrt(sum(r*r))
    if (.not. sum(n*n) > 0.5_wp) n = line_of_centres(r)
    call ascent(r, a, b, n, gap, t, residual, slope)
    do step = 1, most_steps
      if (residual <= exact_residual) return
      fraction = min(1.0_wp, longest_turn/sqrt(sum(t*t)))
      do cut = 1, most_cuts
        trial = n + fraction*t
        trial = trial/sqrt(sum(trial*trial))
        value = gap_of_shapes(r, a, b, trial)
        if (value >= gap - rounding) exit
        fraction = fraction*min(max(0.5_wp*fraction*slope/(fraction*slope + gap - value), 0.1_wp), &
                                0.5_wp)
      end do
      if (cut > most_cuts) return
      n = trial
      call ascent(r, a, b, n, gap, t, residual, slope)
    end do
  end subroutine solve_shapes

  !> g(n), relative squared residual, a direction uphill and the slope of g along it.
  pure subroutine ascent(r, a, b, n, gap, t, residual, slope)
    real(wp), intent(in) :: r(3), a(shape_size), b(shape_size), n(3)
    real(wp), intent(out) :: gap, t(3), residual, slope
    real(wp) :: ha, hb, ua(3), ub(3), ka(6), kb(6), d(3), e(3, 2), k(3), w(2), p, q

    call shape_tangent(a, n, ha, ua, ka)
    call shape_tangent(b, -n, hb, ub, kb)
    gap = dot_product(r, n) - ha - hb
    d = r + ub - ua - gap*n
    residual = sum(d*d)/(ha + hb)**2
    call span_tangent(n, e)
    ka = ka + kb
    k = [shape_of_two(ka, e(:, 1), e(:, 1)) + gap, shape_of_two(ka, e(:, 2), e(:, 2)) + gap, &
         shape_of_two(ka, e(:, 1), e(:, 2))]
    w = [dot_product(d, e(:, 1)), dot_product(d, e(:, 2))]
    ! |K| of the 2 x 2 matrix K from its eigenvalues, so that the step goes uphill
    p = 0.5_wp*(k(1) + k(2))
    q = sqrt((0.5_wp*(k(1) - k(2)))**2 + k(3)**2)
    if (p - q <= 1.0e-6_wp*q) call make_positive(k, p, q)
    p = k(1)*k(2) - k(3)*k(3)
    w = [k(2)*w(1) - k(3)*w(2), k(1)*w(2) - k(3)*w(1)]/p
    t = w(1)*e(:, 1) + w(2)*e(:, 2)
    slope = dot_product(t, d)
  end subroutine ascent

  !> Replace the eigenvalues p +- q of a symmetric 2 x 2 matrix by their magnitudes.
  pure subroutine make_positive(k, p, q)
    real(wp), intent(inout) :: k(3)  !! xx yy xy
    real(wp), intent(in) :: p, q
    real(wp) :: high, low, share
    real(wp), parameter :: least = 1.0e-3_wp
    high = max(abs(p + q), least*(abs(p) + q), tiny(1.0_wp))
    low = max(abs(p - q), least*(abs(p) + q), tiny(1.0_wp))
    share = 0.5_wp*(high - low)/max(q, tiny(1.0_wp))
    k = share*(k - [p, p, 0.0_wp]) + 0.5_wp*(high + low)*[1.0_wp, 1.0_wp, 0.0_wp]
  end subroutine make_positive

  !> Two unit vectors at right angles to n and to each other, as columns.
  pure subroutine span_tangent(n, e)
    real(wp), intent(in) :: n(3)
    real(wp), intent(out) :: e(3, 2)
    real(wp) :: other(3)
    other = 0.0_wp
    other(minloc(abs(n), 1)) = 1.0_wp
    e(:, 1) = other - dot_product(other, n)*n
    e(:, 1) = e(:, 1)/sqrt(sum(e(:, 1)**2))
    e(:, 2) = [n(2)*e(3, 1) - n(3)*e(2, 1), n(3)*e(1, 1) - n(1)*e(3, 1), &
               n(1)*e(2, 1) - n(2)*e(1, 1)]
  end subroutine span_tangent

  !> a . K b
  pure real(wp) function shape_of_two(k, a, b) result(value)
    real(wp), intent(in) :: k(6), a(3), b(3)
    value = k(1)*a(1)*b(1) + k(2)*a(2)*b(2) + k(3)*a(3)*b(3) + k(4)*(a(1)*b(2) + a(2)*b(1)) &
            + k(5)*(a(2)*b(3) + a(3)*b(2)) + k(6)*(a(3)*b(1) + a(1)*b(3))
  end function shape_of_two
end module dem_shape_gap
