!> Strain of classical elements at a quadrature point, as the transposed matrix B' (3 nodes, 6):
!! xx yy zz xy yz zx with engineering shears. With B-bar the volumetric part is its mean over the
!! element, or its least squares fit that is linear in space.
module fem_strain
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_element, only: fem_shape_type
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: volume_gradients, strain_matrix, add_product, strain_of, add_force

contains

  !> Gradients that make the volumetric strain of B-bar at every point (3 nodes, n) [1/m].
  pure subroutine volume_gradients(rule, x, shape, fitted)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :)          !! (3, nodes) [m]
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(out) :: fitted(:, :)
    real(wp) :: mean(3*rule%nodes), moment(3*rule%nodes, 3), off(3, rule%at%n), spread_of(3, 3)
    real(wp) :: volume
    integer(i4) :: q, j

    volume = sum(shape%weight)
    off = matmul(x, rule%at%u)
    off = off - spread(matmul(off, shape%weight)/volume, 2, rule%at%n)  ! from the centroid
    mean = 0.0_wp
    moment = 0.0_wp
    spread_of = 0.0_wp
    do q = 1, rule%at%n
      mean = mean + shape%weight(q)*reshape(shape%u(:, :, q), [3*rule%nodes])
      do j = 1, 3
        moment(:, j) = moment(:, j) &
          + shape%weight(q)*off(j, q)*reshape(shape%u(:, :, q), [3*rule%nodes])
        spread_of(:, j) = spread_of(:, j) + shape%weight(q)*off(j, q)*off(:, q)
      end do
    end do
    fitted = spread(mean/volume, 2, rule%at%n)
    if (rule%linear_volume) fitted = fitted + matmul(moment, matmul(inverse_of(spread_of), off))
  end subroutine volume_gradients

  !> Inverse of a symmetric 3 x 3 matrix.
  pure function inverse_of(a) result(b)
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: b(3, 3)
    b(:, 1) = cross(a(:, 2), a(:, 3))
    b(:, 2) = cross(a(:, 3), a(:, 1))
    b(:, 3) = cross(a(:, 1), a(:, 2))
    b = b/dot_product(a(:, 1), b(:, 1))
  end function inverse_of

  !> B' of point q; `mean`, the gradients of its volumetric strain, counts with B-bar alone.
  pure subroutine strain_matrix(rule, shape, q, mean, b)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: mean(:)
    real(wp), intent(out) :: b(:, :)  !! (3 nodes, 6) [1/m]
    real(wp) :: g1, g2, g3
    integer(i4) :: a, i
    b = 0.0_wp
    do a = 1, rule%nodes
      i = 3*a - 2
      g1 = shape%u(1, a, q)
      g2 = shape%u(2, a, q)
      g3 = shape%u(3, a, q)
      b(i, 1) = g1
      b(i + 1, 2) = g2
      b(i + 2, 3) = g3
      b(i, 4) = g2
      b(i + 1, 4) = g1
      b(i + 1, 5) = g3
      b(i + 2, 5) = g2
      b(i, 6) = g3
      b(i + 2, 6) = g1
      if (.not. rule%bbar) cycle
      b(i, 1:3) = b(i, 1:3) + (mean(i) - g1)/3.0_wp
      b(i + 1, 1:3) = b(i + 1, 1:3) + (mean(i + 1) - g2)/3.0_wp
      b(i + 2, 1:3) = b(i + 2, 1:3) + (mean(i + 2) - g3)/3.0_wp
    end do
  end subroutine strain_matrix

  !> Strain of displacements d; B-bar changes its volume.
  pure function strain_of(slope, d) result(strain)
    real(wp), intent(in), contiguous :: slope(:, :)  !! (3, nodes) gradients [1/m]
    real(wp), intent(in), contiguous :: d(:, :)      !! (3, nodes) [m]
    real(wp) :: strain(6), g(3, 3)
    integer(i4) :: a
    g = 0.0_wp
    do a = 1, size(d, 2)
      g(:, 1) = g(:, 1) + slope(1, a)*d(:, a)
      g(:, 2) = g(:, 2) + slope(2, a)*d(:, a)
      g(:, 3) = g(:, 3) + slope(3, a)*d(:, a)
    end do
    strain = [g(1, 1), g(2, 2), g(3, 3), g(1, 2) + g(2, 1), g(2, 3) + g(3, 2), g(3, 1) + g(1, 3)]
  end function strain_of

  !> Add the nodal forces of a stress times the weight of its point; of B-bar those of the deviator.
  pure subroutine add_force(slope, s, f)
    real(wp), intent(in), contiguous :: slope(:, :)  !! (3, nodes) gradients [1/m]
    real(wp), intent(in) :: s(6)                     !! [N m]
    real(wp), intent(inout), contiguous :: f(:, :)   !! (3, nodes) [N]
    integer(i4) :: a
    do a = 1, size(f, 2)
      f(1, a) = f(1, a) + s(1)*slope(1, a) + s(4)*slope(2, a) + s(6)*slope(3, a)
      f(2, a) = f(2, a) + s(4)*slope(1, a) + s(2)*slope(2, a) + s(5)*slope(3, a)
      f(3, a) = f(3, a) + s(6)*slope(1, a) + s(5)*slope(2, a) + s(3)*slope(3, a)
    end do
  end subroutine add_force

  !> Add w B' D B to a matrix.
  pure subroutine add_product(m, b, d, w, k)
    integer(i4), intent(in) :: m          !! 3 nodes
    real(wp), intent(in) :: b(m, 6), d(6, 6), w
    real(wp), intent(inout) :: k(m, m)
    real(wp) :: c(m, 6)                   !! w B' D
    integer(i4) :: i, j, r
    do r = 1, 6
      c(:, r) = w*(b(:, 1)*d(1, r) + b(:, 2)*d(2, r) + b(:, 3)*d(3, r) + b(:, 4)*d(4, r) &
                   + b(:, 5)*d(5, r) + b(:, 6)*d(6, r))
    end do
    do j = 1, m
      do i = 1, m
        k(i, j) = k(i, j) + c(i, 1)*b(j, 1) + c(i, 2)*b(j, 2) + c(i, 3)*b(j, 3) &
                  + c(i, 4)*b(j, 4) + c(i, 5)*b(j, 5) + c(i, 6)*b(j, 6)
      end do
    end do
  end subroutine add_product
end module fem_strain
