!> Strain of classical elements at a quadrature point, as the transposed matrix B' (3 nodes, 6):
!! xx yy zz xy yz zx with engineering shears. With B-bar the volumetric part is the mean over the
!! element.
module fem_strain
  use talus_kinds, only: wp, i4
  use fem_element, only: fem_shape_type
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: mean_gradient, strain_matrix, add_product, strain_of, add_force

contains

  !> Volume means of the gradients (3 nodes) [1/m].
  pure subroutine mean_gradient(shape, mean)
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(out) :: mean(:)
    integer(i4) :: a, q
    mean = 0.0_wp
    do q = 1, size(shape%weight)
      do a = 1, size(shape%u, 2)
        mean(3*a - 2:3*a) = mean(3*a - 2:3*a) + shape%weight(q)*shape%u(:, a, q)
      end do
    end do
    mean = mean/sum(shape%weight)
  end subroutine mean_gradient

  !> B' of point q; `mean` counts with B-bar alone.
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
