!> A grain as a surface sees it: centre, and support against any normal, whatever its form is.
module dem_figure
  use talus_kinds, only: wp
  use dem_shape, only: shape_size, shape_support, shape_tangent, bounded_curvature
  use dem_ellipsoid, only: matrix_times
  implicit none
  private
  public :: figure_type, figure_point, figure_bend, bend_along, figure_curvature

  !> Spheres and ellipsoids by their matrix, the others by their form (dem_shape).
  type :: figure_type
    logical :: shaped = .false.
    real(wp) :: x(3) = 0.0_wp                !! centre [m]
    real(wp) :: radius = 0.0_wp              !! of the bounding sphere [m]
    real(wp) :: reach = 0.0_wp               !! gaps below count: 0, or what a neck bridges [m]
    real(wp) :: span = 0.0_wp                !! radius + reach [m]
    real(wp) :: a(6) = 0.0_wp                !! shape matrix, xx yy zz xy yz zx [m^2]
    real(wp) :: square = 0.0_wp              !! product of its squared semi-axes [m^6]
    real(wp) :: shape(shape_size) = 0.0_wp     !! if shaped
  end type figure_type

contains

  !> Surface point against n, from the centre, and the support that way.
  pure subroutine figure_point(f, n, u, h)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: n(3)
    real(wp), intent(out) :: u(3)  !! the point is -u [m]
    real(wp), intent(out) :: h     !! [m]
    if (f%shaped) then
      call shape_support(f%shape, -n, h, u)
      u = -u
      return
    end if
    u = matrix_times(f%a, n)
    h = sqrt(dot_product(n, u))
    u = u/h
  end subroutine figure_point

  !> The same and the Hessian of the support, xx yy zz xy yz zx [m].
  pure subroutine figure_bend(f, n, u, h, k)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: n(3)
    real(wp), intent(out) :: u(3), h, k(6)
    if (f%shaped) then
      call shape_tangent(f%shape, -n, h, u, k)
      u = -u
      return
    end if
    call figure_point(f, n, u, h)
    k(1:3) = (f%a(1:3) - u*u)/h
    k(4) = (f%a(4) - u(1)*u(2))/h
    k(5) = (f%a(5) - u(2)*u(3))/h
    k(6) = (f%a(6) - u(3)*u(1))/h
  end subroutine figure_bend

  !> Surface point and support as figure_point, and the radius of curvature along a direction
  !! across n [m].
  pure subroutine bend_along(f, n, across, u, h, radius)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: n(3), across(3)
    real(wp), intent(out) :: u(3), h, radius
    real(wp) :: k(6)
    if (f%shaped) then
      call figure_bend(f, n, u, h, k)
      radius = dot_product(across, matrix_times(k, across))
      return
    end if
    call figure_point(f, n, u, h)
    radius = (dot_product(across, matrix_times(f%a, across)) - dot_product(u, across)**2)/h
  end subroutine bend_along

  !> Mean curvature of the surface at the point against n, of shapes that of Hertz's law [1/m].
  pure real(wp) function figure_curvature(f, n) result(curvature)
    type(figure_type), intent(in) :: f
    real(wp), intent(in) :: n(3)
    real(wp) :: u(3), h, k(6)
    if (f%shaped) then
      call figure_bend(f, n, u, h, k)
      curvature = bounded_curvature(f%shape, k)
      return
    end if
    call figure_point(f, n, u, h)
    curvature = 0.5_wp*(f%a(1) + f%a(2) + f%a(3) - sum(u*u))*h*h*h/f%square
  end function figure_curvature
end module dem_figure
