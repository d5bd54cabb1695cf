!> The trilinear hexahedron with eight nodes in VTK order: shape functions, 2 x 2 x 2 Gauss points,
!! stiffness, stress and mass. `bbar` has the volumetric part of the strain from the mean of the
!! gradients over the element (Hughes 1980), which removes volumetric locking.
module fem_hex8
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  implicit none
  private
  public :: hex8_points, hex8_geometry_type, hex8_geometry, hex8_stiffness, hex8_stress
  public :: hex8_forces, hex8_shape, quad4_shape, hex8_corners

  integer(i4), parameter :: hex8_points = 8  !! Gauss points
  real(wp), parameter :: g = 0.57735026918962576451_wp
  real(wp), parameter :: hex8_corners(3, 8) = reshape([ &
    -1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, &
    1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, &
    -1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, &
    1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp], [3, 8])

  !> Gradients of one element at its Gauss points.
  type :: hex8_geometry_type
    real(wp) :: gradient(3, 8, hex8_points)  !! of the shape functions [1/m]
    real(wp) :: mean(3, 8)                   !! volume mean of the gradients [1/m]
    real(wp) :: weight(hex8_points)          !! Gauss weight times Jacobian [m^3]
    real(wp) :: least                        !! least Jacobian determinant [m^3]
  end type hex8_geometry_type

contains

  !> Shape functions at natural coordinates.
  pure function hex8_shape(xi) result(n)
    real(wp), intent(in) :: xi(3)
    real(wp) :: n(8)
    integer(i4) :: a
    do a = 1, 8
      n(a) = 0.125_wp*product(1.0_wp + xi*hex8_corners(:, a))
    end do
  end function hex8_shape

  !> Shape functions of the four-node facet.
  pure function quad4_shape(xi) result(n)
    real(wp), intent(in) :: xi(2)
    real(wp) :: n(4)
    integer(i4) :: a
    do a = 1, 4
      n(a) = 0.25_wp*(1.0_wp + xi(1)*hex8_corners(1, a))*(1.0_wp + xi(2)*hex8_corners(2, a))
    end do
  end function quad4_shape

  !> Derivatives of the shape functions by the natural coordinates at Gauss point q.
  pure function natural_gradient(q) result(d)
    integer(i4), intent(in) :: q
    real(wp) :: d(3, 8), f(3)
    integer(i4) :: a
    do a = 1, 8
      f = 1.0_wp + g*hex8_corners(:, q)*hex8_corners(:, a)
      d(1, a) = 0.125_wp*hex8_corners(1, a)*f(2)*f(3)
      d(2, a) = 0.125_wp*hex8_corners(2, a)*f(1)*f(3)
      d(3, a) = 0.125_wp*hex8_corners(3, a)*f(1)*f(2)
    end do
  end function natural_gradient

  !> Gradients, weights and means of an element with nodes x [m]. Full integration: mean = gradient
  !! is used by the caller through `bbar`.
  pure subroutine hex8_geometry(x, geometry)
    real(wp), intent(in) :: x(3, 8)
    type(hex8_geometry_type), intent(out) :: geometry
    real(wp) :: d(3, 8), tangent(3, 3), inverse(3, 3), determinant
    integer(i4) :: q

    geometry%mean = 0.0_wp
    geometry%least = huge(1.0_wp)
    do q = 1, hex8_points
      d = natural_gradient(q)
      tangent = matmul(x, transpose(d))
      inverse(:, 1) = cross(tangent(:, 2), tangent(:, 3))
      inverse(:, 2) = cross(tangent(:, 3), tangent(:, 1))
      inverse(:, 3) = cross(tangent(:, 1), tangent(:, 2))
      determinant = dot_product(tangent(:, 1), inverse(:, 1))
      geometry%least = min(geometry%least, determinant)
      geometry%gradient(:, :, q) = matmul(inverse/determinant, d)
      geometry%weight(q) = determinant
      geometry%mean = geometry%mean + determinant*geometry%gradient(:, :, q)
    end do
    geometry%mean = geometry%mean/sum(geometry%weight)
  end subroutine hex8_geometry

  !> Stiffness as 3 x 3 node blocks k(:, :, a, b), a <= b, isotropic elastic:
  !! K_ab = sum w [ K_v gbar_a gbar_b' + mu (g_b g_a' + (g_a . g_b) I - 2/3 g_a g_b') ].
  pure subroutine hex8_stiffness(geometry, bulk, shear, factor, bbar, k)
    type(hex8_geometry_type), intent(in) :: geometry
    real(wp), intent(in) :: bulk, shear           !! moduli [Pa]
    real(wp), intent(in) :: factor(hex8_points)   !! weight of each Gauss point [-]
    logical, intent(in) :: bbar
    real(wp), intent(out) :: k(3, 3, 8, 8)        !! [N/m]; blocks with a > b are zero
    real(wp) :: ga(3), gb(3), va(3), vb(3), kw, mw, inner
    integer(i4) :: q, a, b, i, j

    k = 0.0_wp
    do q = 1, hex8_points
      kw = bulk*geometry%weight(q)*factor(q)
      mw = shear*geometry%weight(q)*factor(q)
      do b = 1, 8
        gb = geometry%gradient(:, b, q)
        vb = merge(geometry%mean(:, b), gb, bbar)
        do a = 1, b
          ga = geometry%gradient(:, a, q)
          va = merge(geometry%mean(:, a), ga, bbar)
          inner = mw*dot_product(ga, gb)
          do j = 1, 3
            do i = 1, 3
              k(i, j, a, b) = k(i, j, a, b) + kw*va(i)*vb(j) &
                              + mw*(gb(i)*ga(j) - 2.0_wp/3.0_wp*ga(i)*gb(j))
            end do
            k(j, j, a, b) = k(j, j, a, b) + inner
          end do
        end do
      end do
    end do
  end subroutine hex8_stiffness

  !> Stress xx yy zz xy yz zx [Pa] at every Gauss point for nodal displacements u [m].
  pure subroutine hex8_stress(geometry, u, bulk, shear, bbar, stress)
    type(hex8_geometry_type), intent(in) :: geometry
    real(wp), intent(in) :: u(3, 8), bulk, shear
    logical, intent(in) :: bbar
    real(wp), intent(out) :: stress(6, hex8_points)
    real(wp) :: h(3, 3), trace, volumetric
    integer(i4) :: q

    do q = 1, hex8_points
      h = matmul(u, transpose(geometry%gradient(:, :, q)))
      trace = h(1, 1) + h(2, 2) + h(3, 3)
      volumetric = trace
      if (bbar) volumetric = sum(geometry%mean*u)
      stress(1, q) = 2.0_wp*shear*(h(1, 1) - trace/3.0_wp) + bulk*volumetric
      stress(2, q) = 2.0_wp*shear*(h(2, 2) - trace/3.0_wp) + bulk*volumetric
      stress(3, q) = 2.0_wp*shear*(h(3, 3) - trace/3.0_wp) + bulk*volumetric
      stress(4, q) = shear*(h(1, 2) + h(2, 1))
      stress(5, q) = shear*(h(2, 3) + h(3, 2))
      stress(6, q) = shear*(h(3, 1) + h(1, 3))
    end do
  end subroutine hex8_stress

  !> Nodal forces of given stresses: f_a = sum w (dev sigma g_a + p gbar_a) [N].
  pure subroutine hex8_forces(geometry, stress, factor, bbar, force)
    type(hex8_geometry_type), intent(in) :: geometry
    real(wp), intent(in) :: stress(6, hex8_points), factor(hex8_points)
    logical, intent(in) :: bbar
    real(wp), intent(out) :: force(3, 8)
    real(wp) :: s(3, 3), p, w
    integer(i4) :: q, a

    force = 0.0_wp
    do q = 1, hex8_points
      w = geometry%weight(q)*factor(q)
      p = 0.0_wp
      if (bbar) p = sum(stress(1:3, q))/3.0_wp
      s(:, 1) = [stress(1, q) - p, stress(4, q), stress(6, q)]
      s(:, 2) = [stress(4, q), stress(2, q) - p, stress(5, q)]
      s(:, 3) = [stress(6, q), stress(5, q), stress(3, q) - p]
      do a = 1, 8
        force(:, a) = force(:, a) + w*(matmul(s, geometry%gradient(:, a, q)) &
                                       + p*geometry%mean(:, a))
      end do
    end do
  end subroutine hex8_forces
end module fem_hex8
