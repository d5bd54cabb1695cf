!> Volume, centre, principal moments and bounding radius of the shapes of dem_shape.
!!
!! The integral of x^(i-1) y^(j-1) z^(k-1) over an octant |x/a|^p + |y/b|^p + |z/c|^p <= 1 is
!! a^i b^j c^k Gamma(i/p) Gamma(j/p) Gamma(k/p) / (p^3 Gamma(1 + (i+j+k)/p)) (Dirichlet); eight
!! octants of six semi-axes add up to products of sums of their powers.
module dem_shape_mass
  use talus_kinds, only: wp, i4
  use dem_shape, only: shape_size, shape_of, octant_support, at_upper, at_lower, at_centre, bulge
  implicit none
  private
  public :: shape_mass_type, mass_of_shape, diagonalise, quaternion_of

  !> Of a body of density 1 in the frame of its octants.
  type :: shape_mass_type
    real(wp) :: volume = 0.0_wp                             !! [m^3]
    real(wp) :: centre(3) = 0.0_wp                          !! from the octants' origin [m]
    real(wp) :: moment(3) = 0.0_wp                          !! principal, about the centre [m^5]
    real(wp) :: turn(4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]  !! principal frame -> octants', w x y z
    real(wp) :: radius = 0.0_wp                             !! farthest point from the centre [m]
    real(wp) :: reach = 0.0_wp  !! bound of the tangential part of surface points [m]
  end type shape_mass_type

contains

  pure function mass_of_shape(upper, lower, exponent) result(mass)
    real(wp), intent(in) :: upper(3), lower(3)  !! semi-axes [m]
    real(wp), intent(in) :: exponent            !! p [-]
    type(shape_mass_type) :: mass
    real(wp) :: s1(3), d2(3), s3(3), second(6), tensor(3, 3), axes(3, 3), trace

    s1 = upper + lower
    d2 = (upper - lower)*s1
    s3 = upper**3 + lower**3
    mass%volume = product(s1)*dirichlet(exponent, 1, 1, 1)
    mass%centre = dirichlet(exponent, 2, 1, 1)*d2/(s1*dirichlet(exponent, 1, 1, 1))
    second(1:3) = dirichlet(exponent, 3, 1, 1)*s3*product(s1)/s1
    second(4) = dirichlet(exponent, 2, 2, 1)*d2(1)*d2(2)*s1(3)
    second(5) = dirichlet(exponent, 2, 2, 1)*d2(2)*d2(3)*s1(1)
    second(6) = dirichlet(exponent, 2, 2, 1)*d2(3)*d2(1)*s1(2)
    associate (c => mass%centre)
      second = second - mass%volume*[c*c, c(1)*c(2), c(2)*c(3), c(3)*c(1)]
    end associate
    trace = sum(second(1:3))
    if (any(abs(second(4:6)) > 0.0_wp)) then
      tensor = reshape([second(1), second(4), second(6), second(4), second(2), second(5), &
                        second(6), second(5), second(3)], [3, 3])
      call diagonalise(tensor, axes)
      mass%turn = quaternion_of(axes)
      second(1:3) = [tensor(1, 1), tensor(2, 2), tensor(3, 3)]
    end if
    mass%moment = trace - second(1:3)
    call find_extent(upper, lower, exponent, mass)
  end function mass_of_shape

  !> Integral of x^(i-1) y^(j-1) z^(k-1) over the octant of semi-axes 1.
  pure real(wp) function dirichlet(p, i, j, k)
    real(wp), intent(in) :: p
    integer(i4), intent(in) :: i, j, k
    dirichlet = gamma(i/p)*gamma(j/p)*gamma(k/p)/(p**3*gamma(1.0_wp + (i + j + k)/p))
  end function dirichlet

  !> Farthest surface point from the centre, and a bound of what rotations move surfaces by: the
  !! tangential part of surface points. Equal halves have both in closed form.
  pure subroutine find_extent(upper, lower, exponent, mass)
    real(wp), intent(in) :: upper(3), lower(3), exponent
    type(shape_mass_type), intent(inout) :: mass
    real(wp), parameter :: margin = 1.0e-6_wp, starts(3, 4) = reshape( &
      [1.0_wp, 1.0_wp, 1.0_wp, 2.0_wp, 0.5_wp, 0.5_wp, 0.5_wp, 2.0_wp, 0.5_wp, 0.5_wp, 0.5_wp, &
       2.0_wp], [3, 4])
    real(wp) :: shape(shape_size), start(3), a(3), k
    integer(i4) :: octant, i

    if (all(abs(upper - lower) <= 0.0_wp)) then
      mass%radius = maxval(upper)
      if (exponent > 2.0_wp) then
        k = 2.0_wp*exponent/(exponent - 2.0_wp)
        mass%radius = (1.0_wp + bulge)*mass%radius*sum((upper/mass%radius)**k)**(1.0_wp/k)
      end if
      mass%reach = maxval(upper) - minval(upper)
    else
      shape = shape_of(upper, lower, mass%centre, exponent)
      do octant = 0, 7
        a = merge(upper, lower, [btest(octant, 0), btest(octant, 1), btest(octant, 2)])
        mass%reach = max(mass%reach, maxval(a) - minval(a))
        do i = 1, size(starts, 2)
          start = merge(1.0_wp, -1.0_wp, [btest(octant, 0), btest(octant, 1), btest(octant, 2)])
          start = starts(:, i)*start
          mass%radius = max(mass%radius, farthest_from(shape, start/norm2(start)))
        end do
      end do
      mass%radius = mass%radius*(1.0_wp + margin)
      mass%reach = mass%reach + norm2(mass%centre)
    end if
    if (.not. exponent > 2.0_wp) return
    k = max((1.0_wp - bulge)*minval([upper, lower]) - norm2(mass%centre), 0.0_wp)
    mass%reach = sqrt(mass%radius**2 - k**2)
  end subroutine find_extent

  !> Local maximum of |u(n)|, which rises under n <- u/|u| as it maximises a convex function [m].
  pure real(wp) function farthest_from(shape, start) result(far)
    real(wp), intent(in) :: shape(shape_size), start(3)
    integer(i4), parameter :: most = 60
    real(wp) :: n(3), u(3), h
    integer(i4) :: k
    n = start
    far = 0.0_wp
    do k = 1, most
      call octant_support(shape, n, h, u)
      u = u - shape(at_centre:at_centre + 2)
      h = norm2(u)
      if (h <= far*(1.0_wp + 1.0e-12_wp)) exit
      far = h
      n = u/h
    end do
  end function farthest_from

  !> Eigenvectors of a symmetric matrix as columns of a rotation (Jacobi); the matrix is left with
  !! its eigenvalues. Columns keep near the frame they started from.
  pure subroutine diagonalise(a, v)
    real(wp), intent(inout) :: a(3, 3)
    real(wp), intent(out) :: v(3, 3)
    integer(i4), parameter :: first(3) = [1, 2, 1], second(3) = [2, 3, 3], sweeps = 30
    real(wp) :: theta, t, c, s, rotation(3, 3)
    integer(i4) :: sweep, k, p, q

    v = unit()
    do sweep = 1, sweeps
      if (abs(a(1, 2)) + abs(a(2, 3)) + abs(a(1, 3)) &
          <= tiny(1.0_wp) + 1.0e-3_wp*epsilon(1.0_wp)*(a(1, 1) + a(2, 2) + a(3, 3))) exit
      do k = 1, 3
        p = first(k)
        q = second(k)
        if (.not. abs(a(p, q)) > 0.0_wp) cycle
        theta = 0.5_wp*(a(q, q) - a(p, p))/a(p, q)
        t = sign(1.0_wp, theta)/(abs(theta) + sqrt(theta*theta + 1.0_wp))
        c = 1.0_wp/sqrt(t*t + 1.0_wp)
        s = t*c
        rotation = unit()
        rotation(p, p) = c
        rotation(q, q) = c
        rotation(p, q) = s
        rotation(q, p) = -s
        a = matmul(transpose(rotation), matmul(a, rotation))
        v = matmul(v, rotation)
      end do
    end do
  end subroutine diagonalise

  pure function unit() result(one)
    real(wp) :: one(3, 3)
    one = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  end function unit

  !> Unit quaternion of a rotation, by its largest component (Shepperd).
  pure function quaternion_of(r) result(q)
    real(wp), intent(in) :: r(3, 3)
    real(wp) :: q(4), square(4)
    integer(i4) :: most
    square = 1.0_wp + [r(1, 1) + r(2, 2) + r(3, 3), r(1, 1) - r(2, 2) - r(3, 3), &
                       r(2, 2) - r(3, 3) - r(1, 1), r(3, 3) - r(1, 1) - r(2, 2)]
    most = maxloc(square, 1)
    select case (most)
    case (1)
      q = [square(1), r(3, 2) - r(2, 3), r(1, 3) - r(3, 1), r(2, 1) - r(1, 2)]
    case (2)
      q = [r(3, 2) - r(2, 3), square(2), r(2, 1) + r(1, 2), r(1, 3) + r(3, 1)]
    case (3)
      q = [r(1, 3) - r(3, 1), r(2, 1) + r(1, 2), square(3), r(3, 2) + r(2, 3)]
    case default
      q = [r(2, 1) - r(1, 2), r(1, 3) + r(3, 1), r(3, 2) + r(2, 3), square(4)]
    end select
    q = q/norm2(q)
  end function quaternion_of
end module dem_shape_mass
