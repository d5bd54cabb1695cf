!> Rounded polyhedra: mass against closed forms, what is none, cores that overlap or do not.
program test_dem_polyhedron
  use talus_kinds, only: wp, i4
  use dem_polyhedron, only: polyhedron_type, judge_polyhedron, mass_of_polyhedron, cores_overlap
  use dem_union, only: union_mass_type
  use talus_test, only: test_type
  implicit none

  real(wp), parameter :: pi = acos(-1.0_wp)
  type(test_type) :: test

  call judge_box()
  call judge_limit()
  call judge_parts()
  call judge_faults()
  call judge_cores()
  call test%finish()

contains

  !> A box of edges a about a point.
  function box(a, radius) result(p)
    real(wp), intent(in) :: a(3), radius
    type(polyhedron_type) :: p
    character(len=:), allocatable :: what
    integer(i4) :: k
    p%radius = radius
    allocate (p%x(3, 8))
    do k = 0, 7
      p%x(:, k + 1) = a*(real([mod(k, 2), mod(k/2, 2), k/4], wp) - 0.5_wp) &
                      + [3.0_wp, 1.0_wp, 2.0_wp]
    end do
    p%start = [1_i4, 5_i4, 9_i4, 13_i4, 17_i4, 21_i4, 25_i4]
    p%corner = [1_i4, 3_i4, 4_i4, 2_i4, 5_i4, 6_i4, 8_i4, 7_i4, 1_i4, 2_i4, 6_i4, 5_i4, 3_i4, &
                7_i4, 8_i4, 4_i4, 1_i4, 5_i4, 7_i4, 3_i4, 2_i4, 4_i4, 8_i4, 6_i4]
    call judge_polyhedron(p, what)
    call test%check('a box is a polyhedron', len(what) == 0)
  end function box

  !> Integrals of x^2 over a rounded box, from slices across x: the box, its slabs, quarters of
  !! cylinders and of balls in closed form.
  pure real(wp) function second_of_box(a, r) result(s)
    real(wp), intent(in) :: a(3), r
    real(wp) :: h, area
    h = 0.5_wp*a(1)
    area = a(2)*a(3) + 2.0_wp*r*(a(2) + a(3)) + pi*r*r
    s = area*2.0_wp*h**3/3.0_wp
    ! beyond the ends a slice is the plane core with the radius sqrt(r^2 - z^2)
    s = s + 2.0_wp*a(2)*a(3)*(h*h*r + h*r*r + r**3/3.0_wp)
    s = s + 4.0_wp*(a(2) + a(3))*(h*h*pi*r*r/4.0_wp + 2.0_wp*h*r**3/3.0_wp + pi*r**4/16.0_wp)
    s = s + 2.0_wp*pi*(h*h*2.0_wp*r**3/3.0_wp + 2.0_wp*h*r**4/4.0_wp + 2.0_wp*r**5/15.0_wp)
  end function second_of_box

  subroutine judge_box()
    real(wp), parameter :: a(3) = [1.0_wp, 0.6_wp, 1.7_wp], r = 0.3_wp
    type(union_mass_type) :: mass
    real(wp) :: xx, yy, zz
    mass = mass_of_polyhedron(box(a, r))
    call test%check_close('volume by Steiner', mass%volume, product(a) + 2.0_wp*r*(a(1)*a(2) &
      + a(2)*a(3) + a(3)*a(1)) + pi*r*r*sum(a) + 4.0_wp/3.0_wp*pi*r**3, 1.0e-13_wp)
    call test%check_close('centre', norm2(mass%centre - [3.0_wp, 1.0_wp, 2.0_wp]), 0.0_wp, &
                          1.0e-14_wp)
    xx = second_of_box(a, r)
    yy = second_of_box(a([2, 3, 1]), r)
    zz = second_of_box(a([3, 1, 2]), r)
    call test%check_close('moment about x', mass%inertia(1), yy + zz, 1.0e-13_wp)
    call test%check_close('moment about y', mass%inertia(2), zz + xx, 1.0e-13_wp)
    call test%check_close('moment about z', mass%inertia(3), xx + yy, 1.0e-13_wp)
    call test%check_close('products', norm2(mass%inertia(4:)), 0.0_wp, 1.0e-13_wp)
  end subroutine judge_box

  !> Of a core that is almost a point a ball is left.
  subroutine judge_limit()
    type(union_mass_type) :: mass
    real(wp), parameter :: little = 1.0e-6_wp
    mass = mass_of_polyhedron(box([little, little, little], 1.0_wp))
    call test%check_close('volume of a ball', mass%volume, 4.0_wp/3.0_wp*pi, 1.0e-5_wp)
    call test%check_close('moment of a ball', mass%inertia(2), 8.0_wp/15.0_wp*pi, 1.0e-5_wp)
  end subroutine judge_limit

  !> A tetrahedron without a symmetry, cut by a plane that holds an edge: what the halves have more
  !! than the whole is the rounded triangle between them: plates, half cylinders, a ball.
  subroutine judge_parts()
    real(wp), parameter :: x(3, 4) = reshape([0.1_wp, -0.2_wp, 0.3_wp, 2.0_wp, 0.1_wp, 0.2_wp, &
                                              0.4_wp, 1.5_wp, -0.3_wp, 0.2_wp, 0.7_wp, 1.8_wp], &
                                             [3, 4])
    real(wp), parameter :: r = 0.25_wp
    type(union_mass_type) :: whole, one, other
    real(wp) :: m(3), area, rim, corner(3, 3), sheet
    m = 0.3_wp*x(:, 1) + 0.7_wp*x(:, 2)
    whole = mass_of_polyhedron(tetrahedron(x, r))
    one = mass_of_polyhedron(tetrahedron(reshape([x(:, 1), m, x(:, 3), x(:, 4)], [3, 4]), r))
    other = mass_of_polyhedron(tetrahedron(reshape([m, x(:, 2), x(:, 3), x(:, 4)], [3, 4]), r))
    corner = reshape([m, x(:, 3), x(:, 4)], [3, 3])
    area = 0.5_wp*norm2(normal(corner(:, 2) - corner(:, 1), corner(:, 3) - corner(:, 1)))
    rim = norm2(corner(:, 2) - corner(:, 1)) + norm2(corner(:, 3) - corner(:, 2)) &
          + norm2(corner(:, 1) - corner(:, 3))
    sheet = 2.0_wp*r*area + 0.5_wp*pi*r*r*rim + 4.0_wp/3.0_wp*pi*r**3
    call test%check_close('volumes of parts', one%volume + other%volume, whole%volume + sheet, &
                          1.0e-13_wp)
    call test%check_close('first moments of parts across the cut', &
                          abs(dot_product(one%volume*one%centre + other%volume*other%centre &
                            - whole%volume*whole%centre - sheet*m, &
                            normal(corner(:, 2) - m, corner(:, 3) - m))), 0.0_wp, 1.0e-12_wp)
    m = normal(corner(:, 2) - m, corner(:, 3) - m)
    m = m/norm2(m)
    call test%check_close('second moments of parts across the cut', across(one, m) &
                          + across(other, m), across(whole, m) &
                          + sheet*dot_product(m, corner(:, 1))**2 + 2.0_wp/3.0_wp*r**3*area &
                          + pi/8.0_wp*r**4*rim + 4.0_wp/15.0_wp*pi*r**5, 1.0e-12_wp)
  end subroutine judge_parts

  !> Integral of the square of the place along a unit vector.
  pure real(wp) function across(mass, n)
    type(union_mass_type), intent(in) :: mass
    real(wp), intent(in) :: n(3)
    associate (i => mass%inertia)
      across = 0.5_wp*sum(i(:3)) - dot_product(n*n, i(:3)) - 2.0_wp*(n(1)*n(2)*i(4) &
               + n(2)*n(3)*i(5) + n(3)*n(1)*i(6)) + mass%volume*dot_product(n, mass%centre)**2
    end associate
  end function across

  pure function normal(a, b) result(n)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: n(3)
    n = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function normal

  !> Four vertices in the order of a right-handed frame.
  function tetrahedron(x, r) result(p)
    real(wp), intent(in) :: x(3, 4), r
    type(polyhedron_type) :: p
    character(len=:), allocatable :: what
    p%radius = r
    p%x = x
    p%start = [1_i4, 4_i4, 7_i4, 10_i4, 13_i4]
    p%corner = [1_i4, 3_i4, 2_i4, 1_i4, 2_i4, 4_i4, 2_i4, 3_i4, 4_i4, 1_i4, 4_i4, 3_i4]
    call judge_polyhedron(p, what)
    call test%check('a tetrahedron is a polyhedron', len(what) == 0)
  end function tetrahedron

  subroutine judge_faults()
    type(polyhedron_type) :: p
    character(len=:), allocatable :: what
    p = box([1.0_wp, 1.0_wp, 1.0_wp], 0.1_wp)
    p%x(1, 8) = p%x(1, 8) + 0.1_wp
    call judge_polyhedron(p, what)
    call test%check('a corner off its face is noticed', len(what) > 0)
    p = box([1.0_wp, 1.0_wp, 1.0_wp], 0.1_wp)
    p%corner(1:4) = p%corner(4:1:-1)
    call judge_polyhedron(p, what)
    call test%check('a face seen from inside is noticed', len(what) > 0)
    p = box([1.0_wp, 1.0_wp, 1.0_wp], 0.1_wp)
    p%start = p%start(:6)
    p%corner = p%corner(:20)
    call judge_polyhedron(p, what)
    call test%check('a missing face is noticed', len(what) > 0)
  end subroutine judge_faults

  !> Boxes that overlap or miss each other by a little: by a face, and by two edges that cross.
  subroutine judge_cores()
    type(polyhedron_type) :: p, point
    real(wp) :: turn(3, 3), across(3, 3), y(3, 8), middle(3), h
    integer(i4) :: k
    p = box([1.0_wp, 1.0_wp, 1.0_wp], 0.1_wp)
    middle = [3.0_wp, 1.0_wp, 2.0_wp]
    do k = 0, 1
      h = 0.999_wp + 0.002_wp*k
      call test%check('boxes side by side', cores_overlap(p, p%x, p, p%x + spread([h, 0.4_wp, &
                                                          0.3_wp], 2, 8)) .eqv. k == 0)
      call test%check('a point and a box', cores_overlap(point, reshape(middle + [0.5_wp*h, &
                      0.2_wp, 0.1_wp], [3, 1]), p, p%x) .eqv. k == 0)
      ! each turned by 45 degrees about an axis across the line between them: edge over edge
      turn = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, sqrt(0.5_wp), sqrt(0.5_wp), 0.0_wp, &
                      -sqrt(0.5_wp), sqrt(0.5_wp)], [3, 3])
      across = reshape([sqrt(0.5_wp), 0.0_wp, sqrt(0.5_wp), 0.0_wp, 1.0_wp, 0.0_wp, &
                        -sqrt(0.5_wp), 0.0_wp, sqrt(0.5_wp)], [3, 3])
      y = matmul(across, p%x - spread(middle, 2, 8))
      y(3, :) = y(3, :) + sqrt(2.0_wp)*h
      call test%check('edge over edge', cores_overlap(p, matmul(turn, p%x - spread(middle, 2, 8)), &
                                                      p, y) .eqv. k == 0)
    end do
  end subroutine judge_cores
end program test_dem_polyhedron
