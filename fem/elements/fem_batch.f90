!> Stiffness of several elements of one formulation at once: the innermost index runs over elements,
!! so that every operation is a vector operation whatever the element is. The integrals are those of
!! fem_element; only pairs of blocks a <= b are computed.
!!
!! With G_ab = sum w g_a g_b', blocks are p G + q G' + r tr G I + s m_a m_b'; s and the mean
!! gradients m are those of B-bar elements, where p = -2/3 mu, else p = lambda and s = 0. Elements
!! of linear volumetric strain have sum w K m_a m_b' with m those of fem_strain at each point.
module fem_batch
  use talus_kinds, only: wp, i4
  use fem_hourglass, only: lanes, usual_share, hourglass, hourglass_moments, hourglass_stiffness
  use fem_rules, only: fem_formulation_type, fem_points_type
  implicit none
  private
  public :: lanes, fem_batch_type, batch_room, batch_shape, batch_stiffness, batch_mass, pair

  real(wp), parameter :: two_thirds = 2.0_wp/3.0_wp

  !> Workspace of a batch of one formulation; the first index is the element.
  type :: fem_batch_type
    real(wp), allocatable :: x(:, :, :)       !! (lanes, 3, nodes) [m]
    real(wp), allocatable :: u(:, :, :, :)    !! (lanes, 3, n, nodes + modes) gradients of u [1/m]
    real(wp), allocatable :: phi(:, :, :, :)  !! (lanes, 3, n, rotations)
    real(wp), allocatable :: weight(:, :)     !! (lanes, n) volumes of the points [m^3]
    real(wp), allocatable :: factor(:, :)     !! (lanes, n) weights of the points [-]
    real(wp), allocatable :: moduli(:, :)     !! (lanes, 6) as in fem_micropolar
    real(wp), allocatable :: share(:)         !! (lanes) of the hourglass control [-]
    real(wp), allocatable :: k(:, :, :)       !! (lanes, 9, pairs) blocks a <= b, see `pair`
    real(wp), allocatable :: mass(:, :)       !! (lanes, pairs) mass over density [m^3]
  end type fem_batch_type

contains

  !> Place of the blocks (a, b), a <= b, among the pairs.
  pure integer(i4) function pair(a, b)
    integer(i4), intent(in) :: a, b
    pair = a + (b*(b - 1))/2
  end function pair

  !> Allocate a formulation at its stiffness or mass points.
  pure subroutine batch_room(rule, at, batch)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_points_type), intent(in) :: at
    type(fem_batch_type), intent(out) :: batch
    integer(i4) :: blocks, pairs
    blocks = rule%nodes + rule%rotations + rule%modes
    pairs = pair(blocks, blocks)
    allocate (batch%x(lanes, 3, rule%nodes), batch%u(lanes, 3, at%n, rule%nodes + rule%modes))
    allocate (batch%phi(lanes, 3, at%n, rule%rotations))
    allocate (batch%weight(lanes, at%n), batch%factor(lanes, at%n), batch%moduli(lanes, 6))
    allocate (batch%share(lanes), source=usual_share)
    allocate (batch%k(lanes, 9, pairs), batch%mass(lanes, pairs))
  end subroutine batch_room

  !> Gradients and weights from the nodes `batch%x`.
  pure subroutine batch_shape(at, batch)
    type(fem_points_type), intent(in) :: at
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: t(lanes, 9), r(lanes, 9), det(lanes)
    integer(i4) :: q, a

    if (allocated(at%fine_slope)) then
      call batch_mean_shape(at, batch)
      return
    end if
    do q = 1, at%n
      t = 0.0_wp  ! column j: dx/dxi_j
      do a = 1, size(batch%x, 3)
        call add_tangent(batch%x(:, :, a), at%u_slope(:, a, q), t)
      end do
      call invert(t, r, det)
      batch%weight(:, q) = det*at%weight(q)
      do a = 1, size(batch%x, 3)
        call to_space(r, at%u_slope(:, a, q), batch%u(:, :, q, a))
      end do
      do a = 1, size(batch%phi, 4)
        call to_space(r, at%phi_slope(:, a, q), batch%phi(:, :, q, a))
      end do
    end do
  end subroutine batch_shape

  !> The one point by means over the volume, as `mean_shape` of fem_element.
  pure subroutine batch_mean_shape(at, batch)
    type(fem_points_type), intent(in) :: at
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: t(lanes, 9), r(lanes, 9), det(lanes), g(lanes, 3)
    integer(i4) :: q, a, i
    batch%u = 0.0_wp
    batch%weight = 0.0_wp
    do q = 1, size(at%fine_slope, 3)
      t = 0.0_wp
      do a = 1, size(batch%x, 3)
        call add_tangent(batch%x(:, :, a), at%fine_slope(:, a, q), t)
      end do
      call invert(t, r, det)
      batch%weight(:, 1) = batch%weight(:, 1) + det
      do a = 1, size(batch%x, 3)
        call to_space(r, at%fine_slope(:, a, q), g)
        do i = 1, 3
          batch%u(:, i, 1, a) = batch%u(:, i, 1, a) + det*g(:, i)
        end do
      end do
    end do
    do a = 1, size(batch%x, 3)
      do i = 1, 3
        batch%u(:, i, 1, a) = batch%u(:, i, 1, a)/batch%weight(:, 1)
      end do
    end do
  end subroutine batch_mean_shape

  pure subroutine add_tangent(x, slope, t)
    real(wp), intent(in) :: x(lanes, 3), slope(3)
    real(wp), intent(inout) :: t(lanes, 9)
    integer(i4) :: l
    do l = 1, lanes
      t(l, 1) = t(l, 1) + x(l, 1)*slope(1)
      t(l, 2) = t(l, 2) + x(l, 2)*slope(1)
      t(l, 3) = t(l, 3) + x(l, 3)*slope(1)
      t(l, 4) = t(l, 4) + x(l, 1)*slope(2)
      t(l, 5) = t(l, 5) + x(l, 2)*slope(2)
      t(l, 6) = t(l, 6) + x(l, 3)*slope(2)
      t(l, 7) = t(l, 7) + x(l, 1)*slope(3)
      t(l, 8) = t(l, 8) + x(l, 2)*slope(3)
      t(l, 9) = t(l, 9) + x(l, 3)*slope(3)
    end do
  end subroutine add_tangent

  !> r: gradients of the natural coordinates, three each, zero where there is no volume; det:
  !! Jacobian.
  pure subroutine invert(t, r, det)
    real(wp), intent(in) :: t(lanes, 9)
    real(wp), intent(out) :: r(lanes, 9), det(lanes)
    real(wp) :: over
    integer(i4) :: l
    do l = 1, lanes
      r(l, 1) = t(l, 5)*t(l, 9) - t(l, 6)*t(l, 8)
      r(l, 2) = t(l, 6)*t(l, 7) - t(l, 4)*t(l, 9)
      r(l, 3) = t(l, 4)*t(l, 8) - t(l, 5)*t(l, 7)
      det(l) = t(l, 1)*r(l, 1) + t(l, 2)*r(l, 2) + t(l, 3)*r(l, 3)
      over = 0.0_wp
      if (abs(det(l)) > 0.0_wp) over = 1.0_wp/det(l)
      r(l, 1) = over*r(l, 1)
      r(l, 2) = over*r(l, 2)
      r(l, 3) = over*r(l, 3)
      r(l, 4) = over*(t(l, 8)*t(l, 3) - t(l, 9)*t(l, 2))
      r(l, 5) = over*(t(l, 9)*t(l, 1) - t(l, 7)*t(l, 3))
      r(l, 6) = over*(t(l, 7)*t(l, 2) - t(l, 8)*t(l, 1))
      r(l, 7) = over*(t(l, 2)*t(l, 6) - t(l, 3)*t(l, 5))
      r(l, 8) = over*(t(l, 3)*t(l, 4) - t(l, 1)*t(l, 6))
      r(l, 9) = over*(t(l, 1)*t(l, 5) - t(l, 2)*t(l, 4))
    end do
  end subroutine invert

  pure subroutine to_space(r, slope, g)
    real(wp), intent(in) :: r(lanes, 9), slope(3)
    real(wp), intent(out) :: g(lanes, 3)
    integer(i4) :: l
    do l = 1, lanes
      g(l, 1) = r(l, 1)*slope(1) + r(l, 4)*slope(2) + r(l, 7)*slope(3)
      g(l, 2) = r(l, 2)*slope(1) + r(l, 5)*slope(2) + r(l, 8)*slope(3)
      g(l, 3) = r(l, 3)*slope(1) + r(l, 6)*slope(2) + r(l, 9)*slope(3)
    end do
  end subroutine to_space

  !> Blocks `batch%k` [N/m, N, N m] from gradients, weights, factors and moduli.
  pure subroutine batch_stiffness(rule, batch)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: w(lanes, rule%at%n), pqr(lanes, 3)

    w = batch%weight*batch%factor
    pqr(:, 1) = batch%moduli(:, 1)
    if (rule%bbar) pqr(:, 1) = -two_thirds*batch%moduli(:, 2)
    pqr(:, 2) = batch%moduli(:, 2)
    pqr(:, 3) = batch%moduli(:, 2) + batch%moduli(:, 3)
    if (rule%modes > 0) call mode_gradients(rule, batch)
    call gradient_blocks(rule%at%n, rule%nodes + rule%modes, 0, batch%u, w, pqr, batch%k)
    if (rule%modes > 0) call condense(rule, batch)
    if (rule%bbar .and. .not. rule%linear_volume) call add_mean(rule, w, batch)
    if (rule%linear_volume) call add_linear_volume(rule, w, batch)
    if (rule%one_point) call add_hourglass(batch)
    if (rule%polar) call add_rotations(rule, w, batch)
  end subroutine batch_stiffness

  !> Blocks p G + q G' + r tr G I of blocks `shift` + 1 and on.
  pure subroutine gradient_blocks(n, nodes, shift, g, w, pqr, k)
    integer(i4), intent(in) :: n, nodes, shift
    real(wp), intent(in) :: g(lanes, 3, n, nodes), w(lanes, n), pqr(lanes, 3)
    real(wp), intent(inout) :: k(:, :, :)
    real(wp) :: wg(lanes, 3, n)
    integer(i4) :: a, b, i, q
    do b = 1, nodes
      do q = 1, n
        do i = 1, 3
          wg(:, i, q) = w(:, q)*g(:, i, q, b)
        end do
      end do
      do a = 1, b
        call one_block(n, g(:, :, :, a), wg, pqr, k(:, :, pair(shift + a, shift + b)))
      end do
    end do
  end subroutine gradient_blocks

  pure subroutine one_block(n, ga, gb, pqr, k)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: ga(lanes, 3, n), gb(lanes, 3, n), pqr(lanes, 3)
    real(wp), intent(out) :: k(lanes, 9)
    real(wp), dimension(lanes) :: s11, s21, s31, s12, s22, s32, s13, s23, s33, trace
    integer(i4) :: q
    s11 = 0.0_wp
    s21 = 0.0_wp
    s31 = 0.0_wp
    s12 = 0.0_wp
    s22 = 0.0_wp
    s32 = 0.0_wp
    s13 = 0.0_wp
    s23 = 0.0_wp
    s33 = 0.0_wp
    do q = 1, n
      s11 = s11 + ga(:, 1, q)*gb(:, 1, q)
      s21 = s21 + ga(:, 2, q)*gb(:, 1, q)
      s31 = s31 + ga(:, 3, q)*gb(:, 1, q)
      s12 = s12 + ga(:, 1, q)*gb(:, 2, q)
      s22 = s22 + ga(:, 2, q)*gb(:, 2, q)
      s32 = s32 + ga(:, 3, q)*gb(:, 2, q)
      s13 = s13 + ga(:, 1, q)*gb(:, 3, q)
      s23 = s23 + ga(:, 2, q)*gb(:, 3, q)
      s33 = s33 + ga(:, 3, q)*gb(:, 3, q)
    end do
    trace = pqr(:, 3)*(s11 + s22 + s33)
    k(:, 1) = (pqr(:, 1) + pqr(:, 2))*s11 + trace
    k(:, 2) = pqr(:, 1)*s21 + pqr(:, 2)*s12
    k(:, 3) = pqr(:, 1)*s31 + pqr(:, 2)*s13
    k(:, 4) = pqr(:, 1)*s12 + pqr(:, 2)*s21
    k(:, 5) = (pqr(:, 1) + pqr(:, 2))*s22 + trace
    k(:, 6) = pqr(:, 1)*s32 + pqr(:, 2)*s23
    k(:, 7) = pqr(:, 1)*s13 + pqr(:, 2)*s31
    k(:, 8) = pqr(:, 1)*s23 + pqr(:, 2)*s32
    k(:, 9) = (pqr(:, 1) + pqr(:, 2))*s33 + trace
  end subroutine one_block

  !> Gradients of the incompatible modes by the Jacobian of the centre, times j0/j: their volume
  !! integrals vanish, and any mesh passes the patch test (Taylor, Beresford and Wilson 1976).
  pure subroutine mode_gradients(rule, batch)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: t(lanes, 9), r(lanes, 9), det(lanes), ratio(lanes)
    integer(i4) :: a, i, q
    t = 0.0_wp
    do a = 1, rule%nodes
      call add_tangent(batch%x(:, :, a), rule%centre_slope(:, a), t)
    end do
    call invert(t, r, det)
    do q = 1, rule%at%n
      ratio = det*rule%at%weight(q)/batch%weight(:, q)
      do a = 1, rule%modes
        do i = 1, 3
          batch%u(:, i, q, rule%nodes + a) = ratio*r(:, 3*a - 3 + i)*rule%mode_slope(a, q)
        end do
      end do
    end do
  end subroutine mode_gradients

  !> Eliminate the blocks of the modes, the last first: K_ab - K_ac K_cc^-1 K_cb.
  pure subroutine condense(rule, batch)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: inverse(lanes, 9), half(lanes, 9), det(lanes)
    integer(i4) :: a, b, c, i, j, m
    do c = rule%nodes + rule%modes, rule%nodes + 1, -1
      call invert(batch%k(:, :, pair(c, c)), inverse, det)  ! symmetric: transposing changes nothing
      do b = 1, c - 1
        ! half = K_cc^-1 K_cb, with K_cb = K_bc'
        half = 0.0_wp
        do j = 1, 3
          do m = 1, 3
            do i = 1, 3
              half(:, i + 3*j - 3) = half(:, i + 3*j - 3) &
                + inverse(:, i + 3*m - 3)*batch%k(:, j + 3*m - 3, pair(b, c))
            end do
          end do
        end do
        do a = 1, b
          do j = 1, 3
            do m = 1, 3
              do i = 1, 3
                batch%k(:, i + 3*j - 3, pair(a, b)) = batch%k(:, i + 3*j - 3, pair(a, b)) &
                  - batch%k(:, i + 3*m - 3, pair(a, c))*half(:, m + 3*j - 3)
              end do
            end do
          end do
        end do
      end do
    end do
  end subroutine condense

  !> The volumetric part of B-bar elements: bulk modulus times m_a m_b' times the weighted volume.
  pure subroutine add_mean(rule, w, batch)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: w(lanes, rule%at%n)
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: mean(lanes, 3, rule%nodes), s(lanes), volume(lanes), sb(lanes)
    integer(i4) :: a, b, i, j, q
    mean = 0.0_wp
    volume = sum(batch%weight, dim=2)
    do a = 1, rule%nodes
      do q = 1, rule%at%n
        do i = 1, 3
          mean(:, i, a) = mean(:, i, a) + batch%weight(:, q)*batch%u(:, i, q, a)
        end do
      end do
      do i = 1, 3
        mean(:, i, a) = mean(:, i, a)/volume
      end do
    end do
    s = (batch%moduli(:, 1) + two_thirds*batch%moduli(:, 2))*sum(w, dim=2)
    do b = 1, rule%nodes
      do j = 1, 3
        sb = s*mean(:, j, b)
        do a = 1, b
          do i = 1, 3
            batch%k(:, i + 3*j - 3, pair(a, b)) = batch%k(:, i + 3*j - 3, pair(a, b)) &
              + mean(:, i, a)*sb
          end do
        end do
      end do
    end do
  end subroutine add_mean

  !> The volumetric part where it is linear in space: bulk modulus times sum w m_a m_b'.
  pure subroutine add_linear_volume(rule, w, batch)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: w(lanes, rule%at%n)
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: off(lanes, 3, rule%at%n), tilt(lanes, 3, rule%at%n)
    real(wp) :: fitted(lanes, rule%at%n, 3, rule%nodes), scaled(lanes, rule%at%n, 3)
    real(wp) :: bulk(lanes)
    integer(i4) :: a, b, i, q

    call linear_functions(rule, batch, off, tilt)
    do a = 1, rule%nodes
      do i = 1, 3
        call fit_linear(rule%at%n, batch%weight, off, tilt, batch%u(:, i, :, a), fitted(:, :, i, a))
      end do
    end do
    bulk = batch%moduli(:, 1) + two_thirds*batch%moduli(:, 2)
    do b = 1, rule%nodes
      do q = 1, rule%at%n
        do i = 1, 3
          scaled(:, q, i) = bulk*w(:, q)*fitted(:, q, i, b)
        end do
      end do
      do a = 1, b
        call add_outer(fitted(:, :, :, a), scaled, batch%k(:, :, pair(a, b)))
      end do
    end do
  end subroutine add_linear_volume

  !> Add the sum of a b' over the points to a block.
  pure subroutine add_outer(a, b, k)
    real(wp), intent(in) :: a(:, :, :), b(:, :, :)  !! (lanes, n, 3)
    real(wp), intent(inout) :: k(:, :)              !! (lanes, 9)
    integer(i4) :: i, j
    do j = 1, 3
      do i = 1, 3
        k(:, i + 3*j - 3) = k(:, i + 3*j - 3) + sum(a(:, :, i)*b(:, :, j), dim=2)
      end do
    end do
  end subroutine add_outer

  !> Places of the points from the centroid, `off` [m], and these times the inverse of their second
  !! moments, `tilt` [1/m^4].
  pure subroutine linear_functions(rule, batch, off, tilt)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_batch_type), intent(in) :: batch
    real(wp), intent(out) :: off(:, :, :), tilt(:, :, :)  !! (lanes, 3, n)
    real(wp) :: centre(lanes, 3), second(lanes, 9), inverse(lanes, 9), det(lanes)
    integer(i4) :: a, i, j, q
    off = 0.0_wp
    centre = 0.0_wp
    second = 0.0_wp
    do q = 1, rule%at%n
      do a = 1, rule%nodes
        off(:, :, q) = off(:, :, q) + rule%at%u(a, q)*batch%x(:, :, a)
      end do
      centre = centre + spread(batch%weight(:, q), 2, 3)*off(:, :, q)
    end do
    centre = centre/spread(sum(batch%weight, dim=2), 2, 3)
    do q = 1, rule%at%n
      off(:, :, q) = off(:, :, q) - centre
      do j = 1, 3
        do i = 1, 3
          second(:, i + 3*j - 3) = second(:, i + 3*j - 3) &
            + batch%weight(:, q)*off(:, i, q)*off(:, j, q)
        end do
      end do
    end do
    call invert(second, inverse, det)
    do q = 1, rule%at%n
      do i = 1, 3
        tilt(:, i, q) = inverse(:, i)*off(:, 1, q) + inverse(:, i + 3)*off(:, 2, q) &
          + inverse(:, i + 6)*off(:, 3, q)
      end do
    end do
  end subroutine linear_functions

  !> Least squares fit, linear in space, of values at the points, at the points.
  pure subroutine fit_linear(n, weight, off, tilt, values, fitted)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: weight(lanes, n), off(lanes, 3, n), tilt(lanes, 3, n), values(lanes, n)
    real(wp), intent(out) :: fitted(lanes, n)
    real(wp) :: mean(lanes), slope(lanes, 3)
    integer(i4) :: i, q
    mean = sum(weight*values, dim=2)/sum(weight, dim=2)
    do i = 1, 3
      slope(:, i) = sum(weight*values*tilt(:, i, :), dim=2)
    end do
    do q = 1, n
      fitted(:, q) = mean + slope(:, 1)*off(:, 1, q) + slope(:, 2)*off(:, 2, q) &
        + slope(:, 3)*off(:, 3, q)
    end do
  end subroutine fit_linear

  !> Elastic stiffness of the twelve hourglass modes (fem_one_point), weighted as the point is.
  pure subroutine add_hourglass(batch)
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: moment(lanes, 3, 4), gamma(lanes, 4, 8), c(lanes), product(lanes)
    integer(i4) :: a, b, i, m
    call hourglass_moments(batch%x, moment)
    call hourglass_stiffness(batch%u(:, :, 1, :), batch%weight(:, 1), batch%moduli, batch%share, &
                             c)
    c = c*batch%factor(:, 1)
    do a = 1, 8
      do m = 1, 4
        gamma(:, m, a) = hourglass(a, m)
        do i = 1, 3
          gamma(:, m, a) = gamma(:, m, a) - batch%u(:, i, 1, a)*moment(:, i, m)
        end do
      end do
    end do
    do b = 1, 8
      do a = 1, b
        product = c*sum(gamma(:, :, a)*gamma(:, :, b), dim=2)
        do i = 1, 9, 4
          batch%k(:, i, pair(a, b)) = batch%k(:, i, pair(a, b)) + product
        end do
      end do
    end do
  end subroutine add_hourglass

  !> Blocks of the micro-rotation with itself and with the displacement.
  pure subroutine add_rotations(rule, w, batch)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: w(lanes, rule%at%n)
    type(fem_batch_type), intent(inout) :: batch
    real(wp) :: pqr(lanes, 3), wn(lanes, rule%at%n)
    integer(i4) :: a, b, m, p, q

    m = rule%nodes
    pqr = batch%moduli(:, 4:6)
    call gradient_blocks(rule%at%n, rule%rotations, m, batch%phi, w, pqr, batch%k)
    do b = 1, rule%rotations
      do q = 1, rule%at%n
        wn(:, q) = batch%moduli(:, 3)*w(:, q)*rule%at%phi(b, q)
      end do
      do a = 1, b
        p = pair(m + a, m + b)
        call add_spin(rule%at%n, wn, rule%at%phi(a, :), batch%k(:, :, p))
      end do
      do a = 1, m
        call coupling_block(rule%at%n, wn, batch%u(:, :, :, a), batch%k(:, :, pair(a, m + b)))
      end do
    end do
  end subroutine add_rotations

  !> Add 2 sum wn N_a to the diagonal.
  pure subroutine add_spin(n, wn, phi, k)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: wn(lanes, n), phi(n)
    real(wp), intent(inout) :: k(lanes, 9)
    real(wp) :: sums(lanes)
    integer(i4) :: q
    sums = 0.0_wp
    do q = 1, n
      sums = sums + wn(:, q)*phi(q)
    end do
    k(:, 1) = k(:, 1) + 2.0_wp*sums
    k(:, 5) = k(:, 5) + 2.0_wp*sums
    k(:, 9) = k(:, 9) + 2.0_wp*sums
  end subroutine add_spin

  !> e_lkm C_k with C = sum wn g.
  pure subroutine coupling_block(n, wn, g, k)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: wn(lanes, n), g(lanes, 3, n)
    real(wp), intent(out) :: k(lanes, 9)
    real(wp), dimension(lanes) :: c1, c2, c3
    integer(i4) :: q
    c1 = 0.0_wp
    c2 = 0.0_wp
    c3 = 0.0_wp
    do q = 1, n
      c1 = c1 + wn(:, q)*g(:, 1, q)
      c2 = c2 + wn(:, q)*g(:, 2, q)
      c3 = c3 + wn(:, q)*g(:, 3, q)
    end do
    k(:, 1) = 0.0_wp
    k(:, 2) = c3
    k(:, 3) = -c2
    k(:, 4) = -c3
    k(:, 5) = 0.0_wp
    k(:, 6) = c1
    k(:, 7) = c2
    k(:, 8) = -c1
    k(:, 9) = 0.0_wp
  end subroutine coupling_block

  !> int N_a N_b of u, and of phi after it, from the weights at the mass points [m^3]; zero between
  !! the fields.
  pure subroutine batch_mass(rule, batch)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_batch_type), intent(inout) :: batch
    batch%mass = 0.0_wp
    associate (at => rule%mass_at)
      call products(at%n, rule%nodes, 0, at%u, batch%weight, batch%mass)
      if (rule%polar) call products(at%n, rule%rotations, rule%nodes, at%phi, batch%weight, &
                                    batch%mass)
    end associate
  end subroutine batch_mass

  pure subroutine products(n, nodes, shift, shape, weight, mass)
    integer(i4), intent(in) :: n, nodes, shift
    real(wp), intent(in) :: shape(nodes, n), weight(lanes, n)
    real(wp), intent(inout) :: mass(:, :)
    real(wp) :: sums(lanes)
    integer(i4) :: a, b, q
    do b = 1, nodes
      do a = 1, b
        sums = 0.0_wp
        do q = 1, n
          sums = sums + (shape(a, q)*shape(b, q))*weight(:, q)
        end do
        mass(:, pair(shift + a, shift + b)) = sums
      end do
    end do
  end subroutine products
end module fem_batch
