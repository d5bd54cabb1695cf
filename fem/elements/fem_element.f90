!> The element of any shape with displacement and, in polar solids, micro-rotation: stiffness, mass,
!! stress and forces. Blocks of an element: u of its nodes, then phi of its first nodes.
!!
!! With g = grad N of u, h = grad N of phi and isotropic moduli the stiffness needs three integrals
!! only, G_ab = int g_a g_b', C_ab = int g_a N_b, H_ab = int h_a h_b':
!!   K_uu   = lambda G + mu G' + (mu + kappa) tr G I,
!!   K_uphi = kappa e_lkm C_k,
!!   K_pp   = alpha H + beta H' + gamma tr H I + 2 kappa I int N_a N_b   (theory: micropolar).
!! eqs. F.4 and F.6
module fem_element
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_micropolar, only: micropolar_strain, micropolar_stress
  use fem_rules, only: fem_formulation_type, fem_points_type
  implicit none
  private
  public :: fem_shape_type, element_shape, element_stiffness, element_mass, element_stress
  public :: polar_strain
  public :: element_force, element_load, points_at

  !> Gradients of one element at its points.
  type :: fem_shape_type
    real(wp), allocatable :: u(:, :, :)    !! (3, nodes, n) [1/m]
    real(wp), allocatable :: phi(:, :, :)  !! (3, rotations, n) [1/m]
    real(wp), allocatable :: weight(:)     !! (n) [m^3]
    real(wp) :: least = 0.0_wp             !! least Jacobian determinant [m^3]
  end type fem_shape_type

contains

  !> Gradients and weights of the element with nodes x [m].
  pure subroutine element_shape(at, x, shape)
    type(fem_points_type), intent(in) :: at
    real(wp), intent(in) :: x(:, :)
    type(fem_shape_type), intent(inout) :: shape  !! kept between elements of one rule
    real(wp) :: tangent(3, 3), inverse(3, 3), determinant
    integer(i4) :: q, a

    if (.not. allocated(shape%weight)) then
      allocate (shape%u, source=at%u_slope)
      allocate (shape%phi, source=at%phi_slope)
      allocate (shape%weight, source=at%weight)
    end if
    shape%least = huge(1.0_wp)
    if (allocated(at%fine_slope)) then
      call mean_shape(at, x, shape)
      return
    end if
    do q = 1, at%n
      tangent = 0.0_wp
      do a = 1, size(x, 2)
        tangent(:, 1) = tangent(:, 1) + at%u_slope(1, a, q)*x(:, a)
        tangent(:, 2) = tangent(:, 2) + at%u_slope(2, a, q)*x(:, a)
        tangent(:, 3) = tangent(:, 3) + at%u_slope(3, a, q)*x(:, a)
      end do
      inverse(:, 1) = cross(tangent(:, 2), tangent(:, 3))
      inverse(:, 2) = cross(tangent(:, 3), tangent(:, 1))
      inverse(:, 3) = cross(tangent(:, 1), tangent(:, 2))
      determinant = dot_product(tangent(:, 1), inverse(:, 1))
      shape%least = min(shape%least, determinant)
      inverse = inverse/determinant
      call map_slopes(inverse, at%u_slope(:, :, q), shape%u(:, :, q))
      call map_slopes(inverse, at%phi_slope(:, :, q), shape%phi(:, :, q))
      shape%weight(q) = determinant*at%weight(q)
    end do
  end subroutine element_shape

  !> Gradients in space from those in the element's own coordinates.
  pure subroutine map_slopes(inverse, slope, gradient)
    real(wp), intent(in) :: inverse(3, 3)
    real(wp), intent(in), contiguous :: slope(:, :)
    real(wp), intent(inout), contiguous :: gradient(:, :)
    integer(i4) :: a
    do a = 1, size(slope, 2)
      gradient(:, a) = slope(1, a)*inverse(:, 1) + slope(2, a)*inverse(:, 2) &
                       + slope(3, a)*inverse(:, 3)
    end do
  end subroutine map_slopes

  !> The one point of an element by means over its volume: exact integrals of the gradients, which
  !! pass the patch test (Flanagan and Belytschko 1981).
  pure subroutine mean_shape(at, x, shape)
    type(fem_points_type), intent(in) :: at
    real(wp), intent(in) :: x(:, :)
    type(fem_shape_type), intent(inout) :: shape
    real(wp) :: tangent(3, 3), cofactor(3, 3), determinant
    integer(i4) :: q
    shape%u = 0.0_wp
    shape%weight = 0.0_wp
    do q = 1, size(at%fine_slope, 3)
      tangent = matmul(x, transpose(at%fine_slope(:, :, q)))
      cofactor(:, 1) = cross(tangent(:, 2), tangent(:, 3))
      cofactor(:, 2) = cross(tangent(:, 3), tangent(:, 1))
      cofactor(:, 3) = cross(tangent(:, 1), tangent(:, 2))
      determinant = dot_product(tangent(:, 1), cofactor(:, 1))
      shape%least = min(shape%least, determinant)
      shape%u(:, :, 1) = shape%u(:, :, 1) + matmul(cofactor, at%fine_slope(:, :, q))
      shape%weight(1) = shape%weight(1) + determinant
    end do
    shape%u = shape%u/shape%weight(1)
  end subroutine mean_shape

  !> Positions of the points (3, n) [m].
  pure function points_at(at, x) result(position)
    type(fem_points_type), intent(in) :: at
    real(wp), intent(in) :: x(:, :)
    real(wp) :: position(3, at%n)
    position = matmul(x, at%u)
  end function points_at

  !> sum over points of w a_p b_p', with columns a(:, q) and b(:, q).
  pure function integral(a, b, w) result(sums)
    real(wp), intent(in) :: a(:, :), b(:, :), w(:)
    real(wp) :: sums(size(a, 1), size(b, 1)), scaled(size(w), size(b, 1))
    integer(i4) :: q
    do q = 1, size(w)
      scaled(q, :) = w(q)*b(:, q)
    end do
    sums = matmul(a, scaled)
  end function integral

  !> Stiffness as 3 x 3 blocks k(:, :, a, b), a <= b [N/m, N, N m].
  pure subroutine element_stiffness(rule, shape, moduli, factor, k)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: moduli(6)   !! lambda, mu, kappa [Pa], alpha, beta, gamma [N]
    real(wp), intent(in) :: factor(:)   !! weight of each point [-]
    real(wp), intent(out) :: k(:, :, :, :)
    real(wp) :: w(size(factor)), c(3*rule%nodes, rule%rotations), n(rule%rotations, rule%rotations)
    real(wp) :: v(3)
    integer(i4) :: a, b, i, m

    m = rule%nodes
    w = shape%weight*factor
    call gradient_blocks(shape%u, w, [moduli(1), moduli(2), moduli(2) + moduli(3)], k(:, :, :m, :m))
    if (.not. rule%polar) return
    call gradient_blocks(shape%phi, w, [moduli(4), moduli(5), moduli(6)], k(:, :, m + 1:, m + 1:))
    n = 2.0_wp*moduli(3)*integral(rule%at%phi, rule%at%phi, w)
    c = moduli(3)*integral(reshape(shape%u, [3*m, rule%at%n]), rule%at%phi, w)
    do b = 1, rule%rotations
      do a = 1, b
        do i = 1, 3
          k(i, i, m + a, m + b) = k(i, i, m + a, m + b) + n(a, b)
        end do
      end do
      do a = 1, m
        v = c(3*a - 2:3*a, b)
        k(:, 1, a, m + b) = [0.0_wp, v(3), -v(2)]
        k(:, 2, a, m + b) = [-v(3), 0.0_wp, v(1)]
        k(:, 3, a, m + b) = [v(2), -v(1), 0.0_wp]
      end do
    end do
  end subroutine element_stiffness

  !> Blocks p G + q G' + r tr G I, G = sum w g_a g_b', for a <= b.
  pure subroutine gradient_blocks(g, w, pqr, k)
    real(wp), intent(in) :: g(:, :, :), w(:), pqr(3)
    real(wp), intent(out) :: k(:, :, :, :)
    real(wp) :: sums(3*size(g, 2), 3*size(g, 2)), block(3, 3), trace
    integer(i4) :: a, b, i
    sums = integral(reshape(g, [3*size(g, 2), size(w)]), reshape(g, [3*size(g, 2), size(w)]), w)
    do b = 1, size(g, 2)
      do a = 1, b
        block = sums(3*a - 2:3*a, 3*b - 2:3*b)
        trace = pqr(3)*(block(1, 1) + block(2, 2) + block(3, 3))
        k(:, :, a, b) = pqr(1)*block + pqr(2)*transpose(block)
        do i = 1, 3
          k(i, i, a, b) = k(i, i, a, b) + trace
        end do
      end do
    end do
  end subroutine gradient_blocks

  !> Mass of the pairs of blocks, one scalar each [kg, kg m^2]; none between the fields.
  pure subroutine element_mass(rule, shape, density, inertia, mass)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape  !! at the mass points
    real(wp), intent(in) :: density            !! [kg/m^3]
    real(wp), intent(in) :: inertia            !! micro-inertia j [m^2]
    real(wp), intent(out) :: mass(:, :)
    integer(i4) :: m
    m = rule%nodes
    mass = 0.0_wp
    mass(:m, :m) = density*integral(rule%mass_at%u, rule%mass_at%u, shape%weight)
    if (.not. rule%polar) return
    mass(m + 1:, m + 1:) = density*inertia*integral(rule%mass_at%phi, rule%mass_at%phi, &
                                                    shape%weight)
  end subroutine element_mass

  !> Blocks of forces of a constant force [N/m^3] and couple [N/m^2] per volume.
  pure subroutine element_load(rule, shape, force, couple, f)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape  !! at the mass points
    real(wp), intent(in) :: force(3), couple(3)
    real(wp), intent(out) :: f(:, :)
    integer(i4) :: a
    f = 0.0_wp  ! also of blocks that are no couples
    do a = 1, rule%nodes
      f(:, a) = sum(rule%mass_at%u(a, :)*shape%weight)*force
    end do
    do a = 1, rule%rotations
      f(:, rule%nodes + a) = sum(rule%mass_at%phi(a, :)*shape%weight)*couple
    end do
  end subroutine element_load

  !> Stress at every point: xx yy zz xy yz zx [Pa] in a classical element; in a polar one sigma_kl
  !! [Pa] and m_kl [N/m], nine each.
  pure subroutine element_stress(rule, shape, u, moduli, stress)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: u(:, :)     !! (3, blocks) [m], [rad]
    real(wp), intent(in) :: moduli(6)
    real(wp), intent(out) :: stress(:, :)
    real(wp) :: gamma(9), c(3, 3), sigma(9), couple(9)
    integer(i4) :: q
    do q = 1, rule%at%n
      call polar_strain(rule, shape, u, q, gamma, c)
      call micropolar_stress(moduli, gamma, c, sigma, couple)
      if (rule%polar) then
        stress(:9, q) = sigma
        stress(10:18, q) = couple
      else
        stress(:6, q) = sigma([1, 5, 9, 2, 6, 7])
      end if
    end do
  end subroutine element_stress

  !> Strain gamma_kl at point q and c(i, j) = phi_i,j [1/m], zero in a classical element.
  pure subroutine polar_strain(rule, shape, u, q, gamma, c)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: u(:, :)  !! (3, blocks) [m], [rad]
    integer(i4), intent(in) :: q
    real(wp), intent(out) :: gamma(9), c(3, 3)
    real(wp) :: phi(3)
    integer(i4) :: m
    m = rule%nodes
    phi = 0.0_wp
    c = 0.0_wp
    if (rule%polar) then
      phi = matmul(u(:, m + 1:), rule%at%phi(:, q))
      c = matmul(u(:, m + 1:), transpose(shape%phi(:, :, q)))
    end if
    gamma = micropolar_strain(matmul(u(:, :m), transpose(shape%u(:, :, q))), phi)
  end subroutine polar_strain

  !> Blocks of forces of given stresses (as `element_stress` has them) [N, N m].
  pure subroutine element_force(rule, shape, stress, factor, f)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: stress(:, :), factor(:)
    real(wp), intent(out) :: f(:, :)
    integer(i4), parameter :: full(9) = [1, 4, 6, 4, 2, 5, 6, 5, 3]
    real(wp) :: s(3, 3), w, turn(3)
    integer(i4) :: q, m, a
    m = rule%nodes
    f = 0.0_wp
    do q = 1, rule%at%n
      w = shape%weight(q)*factor(q)
      if (.not. rule%polar) then
        s = reshape(stress(full, q), [3, 3])  ! s(l, k) = sigma_kl
        f = f + w*matmul(s, shape%u(:, :, q))
        cycle
      end if
      s = reshape(stress(:9, q), [3, 3])
      f(:, :m) = f(:, :m) + w*matmul(s, shape%u(:, :, q))
      turn = -[s(3, 2) - s(2, 3), s(1, 3) - s(3, 1), s(2, 1) - s(1, 2)]  ! sigma_kl e_lkm
      s = reshape(stress(10:18, q), [3, 3])
      f(:, m + 1:) = f(:, m + 1:) + w*matmul(s, shape%phi(:, :, q))
      do a = 1, rule%rotations
        f(:, m + a) = f(:, m + a) + w*rule%at%phi(a, q)*turn
      end do
    end do
  end subroutine element_force
end module fem_element
