!> Convex polyhedra with rounded edges: what makes a body of vertices and faces one, and its mass.
!!
!! The body is all points no further than a radius from the convex core. It falls into the core,
!! prisms over the faces, sectors of cylinders along the edges and sectors of the ball at the
!! vertices, whose moments are closed forms.
!! eqs. D.93 and D.94
module dem_polyhedron
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_feature_gap, only: polygon_normal
  use dem_union, only: union_mass_type, mass_of_sums
  implicit none
  private
  public :: polyhedron_type, judge_polyhedron, mass_of_polyhedron, cores_overlap

  !> Core and radius of a body; normals and edges are found by judge_polyhedron.
  type :: polyhedron_type
    real(wp) :: radius = 0.0_wp              !! [m]
    real(wp), allocatable :: x(:, :)         !! (3, vertices) [m]
    integer(i4), allocatable :: start(:)     !! (faces+1) first corner of each
    integer(i4), allocatable :: corner(:)    !! vertices, in turn about the outward normal
    real(wp), allocatable :: normal(:, :)    !! (3, faces) outward
    integer(i4), allocatable :: edge(:, :)   !! (4, edges) ends; faces that run there from the
                                             !! first end to the second, and back
  end type polyhedron_type

contains

  !> Normals and edges; `what` says why these are no faces of a convex polyhedron, or is empty.
  pure subroutine judge_polyhedron(p, what)
    type(polyhedron_type), intent(inout) :: p
    character(len=:), allocatable, intent(out) :: what
    real(wp), parameter :: flat = 1.0e-6_wp  !! of the size: how far corners may be off a face
    real(wp) :: size_of, off
    integer(i4) :: f, v, faces

    what = ''
    faces = size(p%start, kind=i4) - 1
    size_of = maxval(maxval(p%x, 2) - minval(p%x, 2))
    if (allocated(p%normal)) deallocate (p%normal)
    allocate (p%normal(3, faces))
    do f = 1, faces
      associate (own => p%corner(p%start(f):p%start(f + 1) - 1))
        p%normal(:, f) = polygon_normal(p%x(:, own))
        if (norm2(p%normal(:, f)) < 0.5_wp) what = 'a face without an area'
        do v = 1, size(p%x, 2, kind=i4)
          off = dot_product(p%normal(:, f), p%x(:, v) - p%x(:, own(1)))
          if (off > flat*size_of) what = 'a vertex outside a face'
          if (any(own == v) .and. abs(off) > flat*size_of) what = 'a face that is not plane'
        end do
      end associate
    end do
    if (len(what) > 0) return
    call find_edges(p, what)
    if (len(what) == 0 .and. size(p%x, 2) - size(p%edge, 2) + faces /= 2) &
      what = 'faces that do not close'
  end subroutine judge_polyhedron

  !> Edges, each of two faces that run along it in opposite directions.
  pure subroutine find_edges(p, what)
    type(polyhedron_type), intent(inout) :: p
    character(len=:), allocatable, intent(inout) :: what
    integer(i4) :: f, k, a, b, back, n
    integer(i4), allocatable :: edge(:, :)

    allocate (edge(4, size(p%corner)))
    n = 0
    do f = 1, size(p%start, kind=i4) - 1
      do k = p%start(f), p%start(f + 1) - 1
        a = p%corner(k)
        b = p%corner(merge(p%start(f), k + 1, k + 1 == p%start(f + 1)))
        back = face_along(p, b, a)
        if (back == 0) what = 'an edge that is not between two faces'
        if (back == 0 .or. a > b) cycle
        n = n + 1
        edge(:, n) = [a, b, f, back]
      end do
    end do
    p%edge = edge(:, :n)
  end subroutine find_edges

  !> The face whose outline runs from vertex a to vertex b, 0: none or several.
  pure integer(i4) function face_along(p, a, b) result(face)
    type(polyhedron_type), intent(in) :: p
    integer(i4), intent(in) :: a, b
    integer(i4) :: f, k, found
    face = 0
    found = 0
    do f = 1, size(p%start, kind=i4) - 1
      do k = p%start(f), p%start(f + 1) - 1
        if (p%corner(k) /= a) cycle
        if (p%corner(merge(p%start(f), k + 1, k + 1 == p%start(f + 1))) /= b) cycle
        face = f
        found = found + 1
      end do
    end do
    if (found > 1) face = 0
  end function face_along

  !> Volume, centre and inertia of the rounded body.
  pure function mass_of_polyhedron(p) result(mass)
    type(polyhedron_type), intent(in) :: p
    type(union_mass_type) :: mass
    real(wp) :: sums(10), middle(3), top(3), x(3, size(p%x, 2))
    integer(i4) :: f, k

    middle = sum(p%x, 2)/size(p%x, 2)
    x = p%x - spread(middle, 2, size(p%x, 2))
    sums = 0.0_wp
    do f = 1, size(p%start, kind=i4) - 1
      top = p%radius*p%normal(:, f)
      do k = p%start(f) + 2, p%start(f + 1) - 1
        associate (a => x(:, p%corner(p%start(f))), b => x(:, p%corner(k - 1)), &
                   c => x(:, p%corner(k)))
          sums = sums + tetrahedron([0.0_wp, 0.0_wp, 0.0_wp], a, b, c)
          if (.not. p%radius > 0.0_wp) cycle
          sums = sums + tetrahedron(a, b, c, a + top) + tetrahedron(b, c, a + top, b + top) &
                 + tetrahedron(c, a + top, b + top, c + top)
        end associate
      end do
    end do
    do k = 1, merge(size(p%edge, 2, kind=i4), 0_i4, p%radius > 0.0_wp)
      sums = sums + cylinder_sector(p, x, k)
    end do
    do k = 1, merge(size(x, 2, kind=i4), 0_i4, p%radius > 0.0_wp)
      sums = sums + ball_sector(p, x, k)
    end do
    mass = mass_of_sums(sums, middle)
  end function mass_of_polyhedron

  !> Integrals of 1, x, y, z, xx, yy, zz, xy, yz, zx from a volume, and first and second moments.
  pure function sums_of(volume, first, second) result(sums)
    real(wp), intent(in) :: volume, first(3), second(3, 3)
    real(wp) :: sums(10)
    sums = [volume, first, second(1, 1), second(2, 2), second(3, 3), &
            0.5_wp*(second(1, 2) + second(2, 1)), 0.5_wp*(second(2, 3) + second(3, 2)), &
            0.5_wp*(second(3, 1) + second(1, 3))]
  end function sums_of

  !> The same about the origin of what has them about a point c.
  pure function moved(c, volume, first, second) result(sums)
    real(wp), intent(in) :: c(3), volume, first(3), second(3, 3)
    real(wp) :: sums(10)
    sums = sums_of(volume, first + volume*c, &
                   second + volume*outer(c, c) + outer(c, first) + outer(first, c))
  end function moved

  pure function outer(a, b) result(ab)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: ab(3, 3)
    ab = spread(a, 2, 3)*spread(b, 1, 3)
  end function outer

  !> Of a tetrahedron, whatever the order of its corners.
  pure function tetrahedron(a, b, c, d) result(sums)
    real(wp), intent(in) :: a(3), b(3), c(3), d(3)
    real(wp) :: sums(10), volume, total(3)
    volume = abs(dot_product(b - a, cross(c - a, d - a)))/6.0_wp
    total = a + b + c + d
    sums = sums_of(volume, 0.25_wp*volume*total, 0.05_wp*volume* &
                   (outer(a, a) + outer(b, b) + outer(c, c) + outer(d, d) + outer(total, total)))
  end function tetrahedron

  !> Of the sector of a cylinder along edge k, between the normals of its faces.
  pure function cylinder_sector(p, x, k) result(sums)
    type(polyhedron_type), intent(in) :: p
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: k
    real(wp) :: sums(10), along(3), middle(3), across(3), length, half, second(3, 3)
    associate (a => x(:, p%edge(1, k)), b => x(:, p%edge(2, k)), r => p%radius)
      length = norm2(b - a)
      along = (b - a)/length
      half = 0.5_wp*turn_at(p, k)
      middle = p%normal(:, p%edge(3, k)) + p%normal(:, p%edge(4, k))
      middle = middle/norm2(middle)
      across = cross(along, middle)
      second = length*r**4/4.0_wp*((half + 0.5_wp*sin(2.0_wp*half))*outer(middle, middle) &
                                   + (half - 0.5_wp*sin(2.0_wp*half))*outer(across, across)) &
               + length**3*r*r/12.0_wp*half*outer(along, along)
      sums = moved(0.5_wp*(a + b), length*r*r*half, &
                   length*r**3*2.0_wp/3.0_wp*sin(half)*middle, second)
    end associate
  end function cylinder_sector

  !> Angle between the normals of the faces at edge k [rad].
  pure real(wp) function turn_at(p, k) result(angle)
    type(polyhedron_type), intent(in) :: p
    integer(i4), intent(in) :: k
    associate (m => p%normal(:, p%edge(3, k)), n => p%normal(:, p%edge(4, k)))
      angle = atan2(norm2(cross(m, n)), dot_product(m, n))
    end associate
  end function turn_at

  !> Of the sector of the ball at vertex v, whose directions lie between the normals of its faces.
  !! In the second moment about v what edges give beyond the isotropic part is left out: at the
  !! other end of the edge it has the opposite sign.
  pure function ball_sector(p, x, v) result(sums)
    type(polyhedron_type), intent(in) :: p
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: v
    real(wp) :: sums(10), angle, first(3), second(3, 3), away(3)
    integer(i4) :: k, j

    angle = 2.0_wp*acos(-1.0_wp) - angles_of_faces(p, x, v)
    first = 0.0_wp
    second = 0.0_wp
    do k = 1, size(p%edge, 2, kind=i4)
      j = findloc(p%edge(:2, k), v, 1, kind=i4)
      if (j == 0) cycle
      away = x(:, p%edge(3 - j, k)) - x(:, v)
      away = away/norm2(away)
      first = first - 0.5_wp*turn_at(p, k)*away
    end do
    do k = 1, 3
      second(k, k) = angle/3.0_wp
    end do
    associate (r => p%radius)
      sums = moved(x(:, v), r**3/3.0_wp*angle, r**4/4.0_wp*first, r**5/5.0_wp*second)
    end associate
  end function ball_sector

  !> Sum of the angles of the faces at vertex v [rad].
  pure real(wp) function angles_of_faces(p, x, v) result(total)
    type(polyhedron_type), intent(in) :: p
    real(wp), intent(in) :: x(:, :)
    integer(i4), intent(in) :: v
    real(wp) :: a(3), b(3)
    integer(i4) :: f, k
    total = 0.0_wp
    do f = 1, size(p%start, kind=i4) - 1
      associate (own => p%corner(p%start(f):p%start(f + 1) - 1))
        do k = 1, size(own, kind=i4)
          if (own(k) /= v) cycle
          a = x(:, own(1 + modulo(k, size(own, kind=i4)))) - x(:, v)
          b = x(:, own(1 + modulo(k - 2, size(own, kind=i4)))) - x(:, v)
          total = total + atan2(norm2(cross(a, b)), dot_product(a, b))
        end do
      end associate
    end do
  end function angles_of_faces

  !> Do two convex cores have points in common? No, if a plane that is parallel to a face of one or
  !! to an edge of each parts them. A core may be one point, without faces and edges.
  !! eq. D.96
  pure logical function cores_overlap(p, x, q, y) result(overlap)
    type(polyhedron_type), intent(in) :: p, q
    real(wp), intent(in) :: x(:, :), y(:, :)  !! their vertices in space [m]
    integer(i4) :: k, j
    overlap = .false.
    if (parted_by_faces(p, x, y)) return
    if (parted_by_faces(q, y, x)) return
    do k = 1, edges_of(p)
      do j = 1, edges_of(q)
        if (parted(cross(x(:, p%edge(2, k)) - x(:, p%edge(1, k)), &
                         y(:, q%edge(2, j)) - y(:, q%edge(1, j))), x, y)) return
      end do
    end do
    overlap = .true.
  end function cores_overlap

  pure integer(i4) function edges_of(p)
    type(polyhedron_type), intent(in) :: p
    edges_of = 0
    if (allocated(p%edge)) edges_of = size(p%edge, 2, kind=i4)
  end function edges_of

  pure logical function parted_by_faces(p, x, y) result(apart)
    type(polyhedron_type), intent(in) :: p
    real(wp), intent(in) :: x(:, :), y(:, :)
    integer(i4) :: f
    apart = .false.
    if (.not. allocated(p%start)) return
    do f = 1, size(p%start, kind=i4) - 1
      apart = parted(polygon_normal(x(:, p%corner(p%start(f):p%start(f + 1) - 1))), x, y)
      if (apart) return
    end do
  end function parted_by_faces

  !> Do two sets of points lie on two sides of a plane across n?
  pure logical function parted(n, x, y) result(apart)
    real(wp), intent(in) :: n(3), x(:, :), y(:, :)
    real(wp) :: low(2), high(2), this
    integer(i4) :: k
    apart = .false.
    if (.not. sum(n*n) > tiny(1.0_wp)) return
    low = huge(1.0_wp)
    high = -huge(1.0_wp)
    do k = 1, size(x, 2, kind=i4)
      this = dot_product(n, x(:, k))
      low(1) = min(low(1), this)
      high(1) = max(high(1), this)
    end do
    do k = 1, size(y, 2, kind=i4)
      this = dot_product(n, y(:, k))
      low(2) = min(low(2), this)
      high(2) = max(high(2), this)
    end do
    apart = high(1) <= low(2) .or. high(2) <= low(1)
  end function parted
end module dem_polyhedron
