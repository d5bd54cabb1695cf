!> Rounded polyhedra of the packing: templates, features of their members, and what they do not go
!! with. Faults D382 to D386, I285.
module dem_setup_polyhedra
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_cell, only: is_periodic
  use dem_cells, only: find_candidates
  use dem_clump_file, only: packed_clumps_type
  use dem_feature_state, only: feature_none, feature_vertex, feature_edge, feature_face
  use dem_kinds, only: moved_by_forces
  use dem_polyhedron, only: polyhedron_type, judge_polyhedron, cores_overlap
  use dem_source_place, only: shortest_image
  use dem_state, only: dem_data_type, dem_cell_type, kind_free
  implicit none
  private
  public :: read_polyhedra, make_features, refuse_polyhedra

contains

  !> Polyhedra of all templates; templates of spheres have none, nor has a vertex alone, which is a
  !! sphere. Faults I285.
  subroutine read_polyhedra(packed, shape, path, errors)
    type(packed_clumps_type), intent(in) :: packed
    type(polyhedron_type), allocatable, intent(out) :: shape(:)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    integer(i4) :: t, low

    allocate (shape(size(packed%spheres)))
    if (.not. allocated(packed%corners)) return
    low = 0
    do t = 1, size(packed%spheres, kind=i4)
      associate (corners => packed%corners(low + 1:low + packed%spheres(t)))
        what = ''
        if (any(corners > 0) .and. size(corners) > 1) &
          call read_polyhedron(packed, low, t, shape(t), what)
        if (len(what) > 0) call errors%add('I285', "'"//path//"' has a template, number "// &
          str(t)//', with '//what, path//':/templates', 'make the packing again')
      end associate
      low = low + packed%spheres(t)
    end do
  end subroutine read_polyhedra

  !> One polyhedron: its vertices come first, then edges, then faces, all of one radius.
  subroutine read_polyhedron(packed, low, template, p, what)
    type(packed_clumps_type), intent(in) :: packed
    integer(i4), intent(in) :: low       !! members of the templates before
    integer(i4), intent(in) :: template
    type(polyhedron_type), intent(out) :: p
    character(len=:), allocatable, intent(inout) :: what
    integer(i4) :: n, vertices, edges, faces, from, k

    n = packed%spheres(template)
    from = sum(packed%corners(:low))
    associate (corners => packed%corners(low + 1:low + n), radius => packed%radius(low + 1:low + n))
      vertices = count(corners == 1, kind=i4)
      edges = count(corners == 2, kind=i4)
      faces = n - vertices - edges
      what = 'members that are not vertices, edges and faces of one radius, in this order'
      if (vertices < 4 .or. faces < 4 .or. any(corners(:vertices) /= 1) .or. &
          any(corners(vertices + 1:vertices + edges) /= 2) .or. &
          any(corners(vertices + edges + 1:) < 3)) return
      if (any(radius < radius(1) .or. radius > radius(1))) return
      p%radius = radius(1)
      p%x = packed%centre(:, low + 1:low + vertices)
      p%start = [1_i4, (1_i4 + sum(corners(vertices + edges + 1:vertices + edges + k)), k=1, faces)]
      from = from + vertices + 2*edges
      p%corner = packed%corner(from + 1:from + sum(corners(vertices + edges + 1:)))
    end associate
    what = 'a corner that is no vertex'
    if (any(p%corner > vertices)) return
    call judge_polyhedron(p, what)
    if (len(what) == 0 .and. size(p%edge, 2) /= edges) what = 'edges that its faces do not have'
  end subroutine read_polyhedron

  !> Features of all members; edges and faces bound their corners, and are as light as these.
  subroutine make_features(packed, d)
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: k, m, i, low, from, count

    if (.not. allocated(packed%corners)) return
    allocate (d%pairs%features)
    associate (f => d%pairs%features)
      allocate (f%kind(d%grains%n), source=feature_none)
      allocate (f%start(d%grains%n + 1), source=0_i4)
      do k = 1, packed%n
        low = sum(packed%spheres(:packed%template(k) - 1))
        do m = 1, packed%spheres(packed%template(k))
          count = packed%corners(low + m)
          i = d%clumps%first(k) + m - 1
          f%start(i + 1) = count
          if (count == 0 .or. packed%spheres(packed%template(k)) == 1) cycle  ! a sphere
          f%kind(i) = min(feature_vertex + count - 1, feature_face)
        end do
      end do
      f%start(1) = 1
      do i = 1, d%grains%n
        f%start(i + 1) = f%start(i) + f%start(i + 1)
      end do
      allocate (f%corner(f%start(d%grains%n + 1) - 1))
      do k = 1, packed%n
        low = sum(packed%spheres(:packed%template(k) - 1))
        from = sum(packed%corners(:low))
        i = d%clumps%first(k)
        m = d%clumps%last(k)
        f%corner(f%start(i):f%start(m + 1) - 1) = i - 1 + packed%corner(from + 1: &
          from + f%start(m + 1) - f%start(i))
      end do
      call bound_features(d)
    end associate
  end subroutine make_features

  !> Bounding radii of edges and faces, and their lightness, which is convex in the place.
  subroutine bound_features(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: i, k
    associate (f => d%pairs%features, place => d%clumps%place)
      do i = 1, d%grains%n
        if (f%kind(i) < feature_edge) cycle
        do k = f%start(i), f%start(i + 1) - 1
          d%grains%radius(i) = max(d%grains%radius(i), d%grains%axes(1, i) &
                                   + norm2(place(:, f%corner(k)) - place(:, i)))
          d%clumps%lightness(i) = max(d%clumps%lightness(i), d%clumps%lightness(f%corner(k)))
        end do
      end do
    end associate
  end subroutine bound_features

  !> What polyhedra do not go with: surfaces (D382), grains that are no spheres (D383), cores that
  !! overlap (D384), forces over gaps (D385), elliptic areas (D386).
  subroutine refuse_polyhedra(deck, packed, d, errors)
    type(deck_type), intent(in) :: deck
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: word
    integer :: k
    integer(i4) :: i

    if (.not. allocated(d%pairs%features)) return
    if (d%surfaces%n > 0) call deck%fault(errors, 'D382', 'polyhedra meet grains and walls, '// &
      'not surfaces', 'particles', 1, 'file', 'make it of walls, or take clumps of spheres')
    do i = 1, d%grains%n
      if (maxval(d%grains%axes(:, i)) <= minval(d%grains%axes(:, i))) cycle
      call deck%fault(errors, 'D383', 'grain '//str(d%grains%id(i))//' is no sphere: '// &
                      'polyhedra meet spheres and polyhedra alone', 'particles', 1, 'file', &
                      'make the packing of polyhedra, clumps and spheres')
      exit
    end do
    do k = 1, deck%count('contact')
      call deck%get('contact', k, 'cohesion', word)
      if (word /= 'none') call deck%fault(errors, 'D385', 'polyhedra have no cohesion', 'contact', &
        k, 'cohesion', "leave it out: each feature would have a force of its own")
      call deck%get('contact', k, 'contact_area', word)
      if (word == 'ellipse') call deck%fault(errors, 'D386', 'contacts of polyhedra have '// &
        'circular areas', 'contact', k, 'contact_area', 'leave it out')
    end do
    call check_cores(deck, packed, d, errors)
  end subroutine refuse_polyhedra

  !> Cores of polyhedra have no point in common with each other, nor with centres of spheres (D384):
  !! their features might not meet at all.
  subroutine check_cores(deck, packed, d, errors)
    type(deck_type), intent(in) :: deck
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    type(polyhedron_type), allocatable :: shape(:)
    integer(i4), allocatable :: first(:), second(:), template(:), lead(:)
    real(wp), allocatable :: x(:, :), radius(:)
    integer(i4) :: count, k

    call read_polyhedra(packed, shape, '', errors)
    call list_bodies(packed, d, template, lead, x, radius)
    call find_near(d%cell, x, radius, first, second, count)
    do k = 1, count
      if (max(template(first(k)), template(second(k))) == 0) cycle
      if (.not. overlapping(first(k), second(k))) cycle
      call deck%fault(errors, 'D384', 'the cores of the bodies of grains '// &
                      str(d%grains%id(lead(first(k))))//' and '// &
                      str(d%grains%id(lead(second(k))))//' overlap', 'particles', 1, 'file', &
                      'they may overlap within their rounding: make the packing again')
      return
    end do

  contains

    logical function overlapping(a, b)
      integer(i4), intent(in) :: a, b
      type(polyhedron_type) :: point
      real(wp) :: shift(3)
      shift = shortest_image(d%cell, x(:, b) - x(:, a)) - (x(:, b) - x(:, a))
      associate (xa => vertices(a), xb => vertices(b))
        if (template(a) == 0) then
          overlapping = cores_overlap(point, xa, shape(template(b)), xb + spread(shift, 2, &
                                                                                 size(xb, 2)))
        else if (template(b) == 0) then
          overlapping = cores_overlap(shape(template(a)), xa, point, xb + spread(shift, 2, &
                                                                                 size(xb, 2)))
        else
          overlapping = cores_overlap(shape(template(a)), xa, shape(template(b)), &
                                      xb + spread(shift, 2, size(xb, 2)))
        end if
      end associate
    end function overlapping

    pure function vertices(body) result(places)
      integer(i4), intent(in) :: body
      real(wp), allocatable :: places(:, :)
      integer(i4) :: n
      n = 1
      if (template(body) > 0) n = size(shape(template(body))%x, 2, kind=i4)
      places = d%grains%x(:, lead(body):lead(body) + n - 1)
    end function vertices
  end subroutine check_cores

  !> Polyhedra, then spheres of free grains and of clumps: template (0: a sphere), first grain,
  !! centre, radius about the centre that holds the core.
  subroutine list_bodies(packed, d, template, lead, x, radius)
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(in) :: d
    integer(i4), allocatable, intent(out) :: template(:), lead(:)
    real(wp), allocatable, intent(out) :: x(:, :), radius(:)
    integer(i4) :: i, k

    lead = [pack(d%clumps%first, d%pairs%features%kind(d%clumps%first) == feature_vertex), &
            pack([(i, i=1, d%grains%n)], d%pairs%features%kind == feature_none)]
    allocate (template(size(lead)), source=0_i4)
    allocate (x(3, size(lead)), radius(size(lead)), source=0.0_wp)
    do i = 1, size(lead, kind=i4)
      x(:, i) = d%grains%x(:, lead(i))
      if (d%pairs%features%kind(lead(i)) == feature_none) cycle
      k = d%grains%clump(lead(i))
      template(i) = packed%template(k)
      x(:, i) = d%clumps%grains%x(:, k)
      radius(i) = maxval(norm2(d%clumps%arm(:, d%clumps%first(k):d%clumps%last(k)), 1))
    end do
  end subroutine list_bodies

  !> Pairs of bodies whose spheres overlap; in a periodic cell the nearest images.
  subroutine find_near(cell, x, radius, first, second, count)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: x(:, :), radius(:)
    integer(i4), allocatable, intent(out) :: first(:), second(:)
    integer(i4), intent(out) :: count
    real(wp), allocatable :: body(:, :), zero(:)
    integer(i4), allocatable :: kind(:)
    integer(i4) :: i, j, n, m

    n = size(radius, kind=i4)
    allocate (zero(n), source=0.0_wp)
    allocate (kind(n), source=kind_free)
    if (.not. is_periodic(cell)) then
      allocate (body(16, n), source=0.0_wp)
      body(1:3, :) = x
      body(10:12, :) = spread(radius**2, 1, 3)
      call find_candidates(body, max(radius, tiny(1.0_wp)), zero, kind, tiny(1.0_wp), .false., &
                           first, second, count)
      return
    end if
    do m = 1, 2
      count = 0
      do i = 1, n
        do j = i + 1, n
          if (norm2(shortest_image(cell, x(:, j) - x(:, i))) > radius(i) + radius(j)) cycle
          count = count + 1
          if (m == 1) cycle
          first(count) = i
          second(count) = j
        end do
      end do
      if (m == 1) allocate (first(count), second(count))
    end do
  end subroutine find_near
end module dem_setup_polyhedra
