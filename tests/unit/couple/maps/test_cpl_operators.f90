!> Sets and operators of the overlap: rules and identities for bars, plates and blocks of distorted
!! hexahedra and tetrahedra, with all rotations, weights and both projections.
program test_cpl_operators
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use cpl_band, only: band_type, condition_of
  use cpl_cells, only: cells_type
  use cpl_choices, only: rotation_fixed, rotation_curl, rotation_micro
  use cpl_elements, only: hex8, hex20, tet4, tet10, node_count
  use cpl_hull, only: hull_type
  use cpl_operators, only: operators_type, map_choice_type, weigh_unit, weigh_volume
  use cpl_rows, only: lanes
  use cpl_sets, only: sets_type, pack_type, part_rest, part_ghost, part_free
  implicit none

  real(wp), parameter :: h = 0.04_wp  !! of an element [m]
  !> Roundings of a sum add like a random walk: sqrt of its terms, of the longest some 5000 grains.
  real(wp), parameter :: rounding = 64.0_wp
  type(test_type) :: test
  integer(i4) :: pairs = 0  !! operators whose fields were taken together
  integer(i4) :: kinds(4) = [hex8, hex20, tet4, tet10], k

  do k = 1, 4
    call identities('bar', kinds(k), [6, 1, 1])
    call identities('plate', kinds(k), [6, 3, 1])
    call identities('block', kinds(k), [6, 3, 3])
  end do
  call test%check('identical operators: there were some', pairs > 10)
  call fine_scale()
  call broken_rules()
  call bands()
  call hulls()
  call test%finish()

contains

  !> Elements in x: two slices of free grains, three of ghosts, the rest continuum.
  subroutine make(kind, n, cells, sets, pack_of, per_element)
    integer(i4), intent(in) :: kind, n(3), per_element
    type(cells_type), intent(out) :: cells
    type(sets_type), intent(out) :: sets
    type(pack_type), intent(out) :: pack_of
    integer(i4) :: e, slice, pieces

    call make_cells(kind, n, cells)
    pieces = cells%elements/product(n)
    allocate (sets%part(cells%elements))
    do e = 1, cells%elements
      slice = 1 + mod((e - 1)/pieces, n(1))
      sets%part(e) = merge(part_free, merge(part_ghost, part_rest, slice <= 5), slice <= 2)
    end do
    call make_grains(n, per_element, pack_of)
  end subroutine make

  !> Bricks, skewed but flat where regions meet; or six tetrahedra in each.
  subroutine make_cells(kind, n, cells)
    integer(i4), intent(in) :: kind, n(3)
    type(cells_type), intent(inout) :: cells
    integer(i4) :: i, j, l, a, m(3)
    integer(i4) :: edge_node(product(n + 1), product(n + 1))

    m = n + 1
    edge_node = 0
    allocate (cells%x(3, 8*product(m)), cells%kind(0), cells%node(0))
    cells%start = [1_i4]
    do l = 0, n(3)
      do j = 0, n(2)
        do i = 0, n(1)
          a = 1 + i + m(1)*(j + m(2)*l)
          cells%x(:, a) = h*[real(i, wp), j + 0.1_wp*sin(2.0_wp*i), l - 0.08_wp*i*j]
        end do
      end do
    end do
    cells%nodes = product(m)
    do l = 0, n(3) - 1
      do j = 0, n(2) - 1
        do i = 0, n(1) - 1
          call add_brick(kind, [i, j, l], m, cells, edge_node)
        end do
      end do
    end do
    cells%x = cells%x(:, :cells%nodes)
    cells%elements = size(cells%kind)
    allocate (cells%polar(cells%nodes), source=.false.)
    cells%polar(:product(m)) = .true.
    allocate (cells%mass(cells%nodes), source=1.0_wp)
    allocate (cells%inertia(cells%nodes), source=1.0_wp)
    call cells%prepare()
  end subroutine make_cells

  !> A brick of the lattice: one hexahedron, or six tetrahedra.
  subroutine add_brick(kind, place, m, cells, edge_node)
    integer(i4), intent(in) :: kind
    integer(i4), intent(in) :: place(3), m(3)  !! of the brick, nodes along the axes
    type(cells_type), intent(inout) :: cells
    integer(i4), intent(inout) :: edge_node(:, :)
    integer(i4), parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, &
      0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
    integer(i4), parameter :: kuhn(4, 6) = reshape([1, 2, 3, 7, 1, 3, 4, 7, 1, 4, 8, 7, &
      1, 8, 5, 7, 1, 5, 6, 7, 1, 6, 2, 7], [4, 6])
    integer(i4), parameter :: hex_edge(2, 12) = reshape([1, 2, 2, 3, 3, 4, 4, 1, 5, 6, 6, 7, 7, 8, &
      8, 5, 1, 5, 2, 6, 3, 7, 4, 8], [2, 12])
    integer(i4), parameter :: tet_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 1, 4, 2, 4, 3, 4], [2, 6])
    integer(i4) :: a, t, at(3), v(8)

    do a = 1, 8
      at = place + corner(:, a)
      v(a) = 1 + at(1) + m(1)*(at(2) + m(2)*at(3))
    end do
    if (kind == hex8 .or. kind == hex20) then
      call add(kind, v, hex_edge, cells, edge_node)
      return
    end if
    do t = 1, 6
      call add(kind, v(kuhn(:, t)), tet_edge, cells, edge_node)
    end do
  end subroutine add_brick

  subroutine add(kind, v, edge, cells, edge_node)
    integer(i4), intent(in) :: kind, v(:), edge(:, :)
    type(cells_type), intent(inout) :: cells
    integer(i4), intent(inout) :: edge_node(:, :)
    integer(i4), allocatable :: node(:)
    integer(i4) :: k, low, high
    node = v
    if (node_count(kind) > size(v)) then
      do k = 1, size(edge, 2)
        low = minval(v(edge(:, k)))
        high = maxval(v(edge(:, k)))
        if (edge_node(low, high) == 0) then
          cells%nodes = cells%nodes + 1
          edge_node(low, high) = cells%nodes
          cells%x(:, cells%nodes) = 0.5_wp*(cells%x(:, low) + cells%x(:, high))
        end if
        node = [node, edge_node(low, high)]
      end do
    end if
    cells%kind = [cells%kind, kind]
    cells%node = [cells%node, node]
    cells%start = [cells%start, int(size(cells%node), i4) + 1]
  end subroutine add

  !> Grains all over the first five slices, in no order.
  subroutine make_grains(n, per_element, pack_of)
    integer(i4), intent(in) :: n(3), per_element
    type(pack_type), intent(inout) :: pack_of
    real(wp) :: r(3)
    integer(i4) :: g, count_of
    count_of = 5*n(2)*n(3)*per_element
    allocate (pack_of%x(3, count_of))
    do g = 1, count_of
      r = modulo(g*[0.8191725134_wp, 0.6710436067_wp, 0.5497004779_wp], 1.0_wp)
      r = [4.999_wp, real(n(2), wp), real(n(3), wp)]*r
      pack_of%x(:, g) = skewed(r)
    end do
    pack_of%id = [(int(g, i8) + 100_i8, g=1, count_of)]
    pack_of%radius = [(0.002_wp + 0.001_wp*sin(real(g, wp)), g=1, count_of)]
    pack_of%volume = 4.0_wp*pack_of%radius**3
    pack_of%mass = 2000.0_wp*pack_of%volume
    pack_of%inertia = 0.4_wp*pack_of%mass*pack_of%radius**2
    allocate (pack_of%kind(count_of), source=0_i4)
    allocate (pack_of%round(count_of), source=.true.)
  end subroutine make_grains

  !> As the nodes are, inside of the body.
  pure function skewed(r) result(x)
    real(wp), intent(in) :: r(3)
    real(wp) :: x(3), s
    s = r(1) - int(r(1))
    x(1) = r(1)
    x(2) = r(2) + 0.1_wp*((1.0_wp - s)*sin(2.0_wp*int(r(1))) + s*sin(2.0_wp*(int(r(1)) + 1)))
    x(3) = r(3) - 0.08_wp*r(1)*r(2)
    x = h*x
  end function skewed

  subroutine identities(name, kind, n)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind, n(3)
    type(cells_type) :: cells
    type(sets_type) :: sets
    type(pack_type) :: pack_of
    type(error_list_type) :: errors
    character(len=40) :: label
    integer(i4) :: rotation, weights, mls

    call make(kind, n, cells, sets, pack_of, merge(300, 90, kind >= tet4))
    call sets%sort(cells, pack_of, errors)
    write (label, '(a,1x,i0)') name, kind
    call test%check(trim(label)//': sets keep the rules', .not. errors%any())
    if (errors%any()) return
    call test%check(trim(label)//': every grain has its place', size(sets%free) + &
                    size(sets%ghost) + size(sets%outside) == size(pack_of%id))
    call test%check(trim(label)//': few stand outside', size(sets%outside)*20 < size(pack_of%id))
    do rotation = rotation_fixed, rotation_micro
      do weights = weigh_unit, weigh_volume
        do mls = 0, 1
          call one(trim(label), cells, sets, pack_of, map_choice_type(rotation, weights, mls == 1))
        end do
      end do
    end do
    if (any(n == 1)) return
    cells%micromorphic = .true.
    call one(trim(label)//' chi', cells, sets, pack_of, map_choice_type(rotation_micro))
    call one(trim(label)//' chi', cells, sets, pack_of, map_choice_type(rotation_micro), .true.)
  end subroutine identities

  !> Identities of the operators; `positions`: of micro-deformations by positions alone.
  subroutine one(label, cells, sets, pack_of, choice, positions)
    character(len=*), intent(in) :: label
    type(cells_type), intent(in) :: cells
    type(sets_type), intent(in) :: sets
    type(pack_type), intent(in) :: pack_of
    type(map_choice_type), intent(in) :: choice
    logical, intent(in), optional :: positions
    type(operators_type) :: operators
    type(error_list_type) :: errors
    character(len=20) :: what
    real(wp) :: worst, limit

    write (what, '(2(a,i0),a,l1)') ' r', choice%rotation, ' w', choice%weights, &
      ' mls ', choice%mls
    if (present(positions)) operators%micro%positions = positions
    call operators%build(cells, sets, pack_of, choice, errors)
    call test%check(label//what//': built', .not. errors%any())
    if (errors%any()) return
    call operators%identity_error(pack_of%x(:, sets%free), cells%x(:, operators%node), &
                                  pack_of%x(:, sets%ghost), worst, errors)
    limit = rounding*epsilon(1.0_wp)*condition_of_maps(operators, cells%x(:, operators%node))
    call test%check_close(label//what//': identities', worst, 0.0_wp, limit)
    call test%check(label//what//': condition', operators%p%condition < 1.0e3_wp)
    if (.not. operators%micro%active) call some_ghosts(label//what, operators)
    if (operators%twin_ghosts .or. operators%twin_maps) call identical(label//what, operators)
  end subroutine one

  !> How much of an error in a motion of size one comes out of the maps: the condition of N'WN, or
  !! for rows that are there as such the largest sum of entries without sign; curls and slopes of
  !! the micro-deformation come on top, of motions over the extent.
  pure real(wp) function condition_of_maps(o, x) result(condition)
    type(operators_type), intent(in) :: o
    real(wp), intent(in) :: x(:, :)  !! nodes (3, :) [m]
    real(wp) :: rows, extent
    integer(i4) :: k

    rows = 1.0_wp
    if (o%p%mls) rows = largest_row(o%p%fit%first, abs(o%p%fit%weight))
    if (o%rotation == rotation_curl) then
      extent = maxval([(maxval(x(k, :)) - minval(x(k, :)), k=1, 3)])
      rows = rows*max(1.0_wp, extent*largest_row(o%ghost_curl%first, &
        sum(abs(o%ghost_curl%slope), 1)))
    end if
    if (o%micro%active) rows = max(rows, largest_row(o%micro%first, sum(abs(o%micro%slope), 1)))
    condition = max(o%p%condition, o%p_phi%condition, rows)
  end function condition_of_maps

  pure real(wp) function largest_row(first, size_of) result(largest)
    integer(i4), intent(in) :: first(:)   !! of each row's entries (rows + 1)
    real(wp), intent(in) :: size_of(:)    !! of the entries
    integer(i4) :: k
    largest = 0.0_wp
    do k = 1, size(first) - 1
      largest = max(largest, sum(size_of(first(k):first(k + 1) - 1)))
    end do
  end function largest_row

  !> Both fields taken together, and one after the other.
  subroutine identical(label, together)
    character(len=*), intent(in) :: label
    type(operators_type), intent(in) :: together
    type(operators_type) :: apart
    real(wp), dimension(3, together%nodes) :: u, u_apart
    real(wp), dimension(3, together%nodes_phi) :: phi, phi_apart
    real(wp), dimension(3, together%ghosts) :: d, d_apart, turn, turn_apart
    real(wp), dimension(3, together%free) :: q, theta, q_apart, theta_apart
    integer(i4) :: i

    pairs = pairs + 1
    apart = together
    apart%twin_ghosts = .false.
    apart%twin_maps = .false.
    do i = 1, together%free
      q(:, i) = [sin(3.0_wp*i), 0.7_wp, cos(2.0_wp*i)]
      theta(:, i) = [0.1_wp, cos(1.3_wp*i), sin(4.0_wp*i)]
    end do
    u = 0.3_wp
    phi = -0.6_wp
    u_apart = u
    phi_apart = phi
    call together%to_prescribed(q, theta, u, phi)
    call apart%to_prescribed(q, theta, u_apart, phi_apart)
    call together%to_ghosts(u, phi, d, turn)
    call apart%to_ghosts(u, phi, d_apart, turn_apart)
    call test%check_close(label//': identical rows move nodes', larger(max_abs(u - u_apart), &
                          max_abs(phi - phi_apart)), 0.0_wp, 1.0e-13_wp)
    call test%check_close(label//': identical rows move ghosts', larger(max_abs(d - d_apart), &
                          max_abs(turn - turn_apart)), 0.0_wp, 1.0e-13_wp)
    u_apart = u
    phi_apart = phi
    call together%pull(d, turn, u, phi, q, theta)
    call apart%pull(d, turn, u_apart, phi_apart, q_apart, theta_apart)
    call test%check_close(label//': identical rows pull', larger(max_abs(u - u_apart), &
      max_abs(phi - phi_apart), max_abs(q - q_apart), max_abs(theta - theta_apart)), &
      0.0_wp, 1.0e-11_wp)
  end subroutine identical

  !> Forces on some ghosts, with others that act on the free grains: the sum of both.
  subroutine some_ghosts(label, operators)
    character(len=*), intent(in) :: label
    type(operators_type), intent(in) :: operators
    real(wp), dimension(3, operators%ghosts) :: p, m
    real(wp), dimension(3, operators%nodes) :: f, f_some
    real(wp), dimension(3, operators%nodes_phi) :: c, c_some
    real(wp), dimension(3, operators%free) :: force, moment, load, turn, force_some, moment_some
    integer(i4) :: i
    integer(i4), allocatable :: some(:)

    do i = 1, operators%ghosts
      p(:, i) = merge(0.0_wp, 1.0_wp, mod(i, 3) == 0)*[sin(1.0_wp*i), cos(2.0_wp*i), 0.3_wp]
      m(:, i) = merge(0.0_wp, 1.0_wp, mod(i, 3) == 0)*[cos(1.0_wp*i), 0.1_wp, sin(3.0_wp*i)]
    end do
    do i = 1, operators%free
      load(:, i) = [cos(5.0_wp*i), 0.2_wp, sin(7.0_wp*i)]
      turn(:, i) = [0.4_wp, sin(2.0_wp*i), cos(9.0_wp*i)]
    end do
    f = 0.5_wp
    c = -0.25_wp
    f_some = f
    c_some = c
    some = pack([(i, i=1, operators%ghosts)], [(mod(i, 3) /= 0, i=1, operators%ghosts)])
    call operators%pull(p, m, f, c, force, moment)
    call operators%pull_some(some, p(:, some), m(:, some), f_some, c_some, load, turn, &
                             force_some, moment_some)
    call test%check_close(label//': forces of some ghosts', &
      larger(max_abs(f - f_some), max_abs(force + load - force_some)), 0.0_wp, 1.0e-13_wp)
    call test%check_close(label//': moments of some ghosts', &
      larger(max_abs(moment + turn - moment_some), max_abs([0.0_wp, c - c_some])), 0.0_wp, &
      1.0e-13_wp)
  end subroutine some_ghosts

  !> The fine scale that masses leave has no momentum under any node: N' M (q - N P q) = 0.
  subroutine fine_scale()
    type(cells_type) :: cells
    type(sets_type) :: sets
    type(pack_type) :: pack_of
    type(operators_type) :: operators
    type(error_list_type) :: errors
    real(wp), allocatable :: q(:, :), d(:, :), coarse(:, :), left(:, :)
    integer(i4) :: i

    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    call sets%sort(cells, pack_of, errors)
    call operators%build(cells, sets, pack_of, map_choice_type(), errors)
    allocate (q(3, operators%free), coarse(3, operators%free))
    allocate (d(3, operators%prescribed), left(3, operators%prescribed))
    do i = 1, operators%free
      q(:, i) = [sin(1.0_wp*i), cos(3.0_wp*i), sin(5.0_wp*i)]
    end do
    call operators%p%apply(q, d)
    call operators%p%n%apply(d, coarse)
    left = 0.0_wp
    do i = 1, operators%free
      q(:, i) = pack_of%mass(sets%free(i))*(q(:, i) - coarse(:, i))
    end do
    call operators%p%n%transposed(q, left)
    call test%check_all_close('fine scale: orthogonal', left, 0.0_wp, &
                          1.0e-12_wp*max_abs(q)*operators%free)
    call test%check('fine scale: there is one', max_abs(q) > 1.0e-6_wp)
  end subroutine fine_scale

  subroutine broken_rules()
    type(cells_type) :: cells
    type(sets_type) :: sets
    type(pack_type) :: pack_of

    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    where (sets%part == part_ghost) sets%part = part_rest
    call refused('I422', cells, sets, pack_of)
    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    pack_of%kind(size(pack_of%kind)/2:) = 2
    call refused('I428', cells, sets, pack_of)
    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    pack_of%radius = 0.06_wp
    call refused('I424', cells, sets, pack_of)
    call make(hex8, [6, 2, 2], cells, sets, pack_of, 4)
    call refused('I426', cells, sets, pack_of)
    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    sets%part([1, 2, 3, 5, 6]) = [part_free, part_ghost, part_free, part_free, part_free]
    sets%part(7:) = part_free
    sets%part(size(sets%part)) = part_ghost
    call refused('I423', cells, sets, pack_of)
    call make(hex8, [6, 2, 2], cells, sets, pack_of, 90)
    pack_of%x = pack_of%x + 1.0_wp
    call refused('I421', cells, sets, pack_of)
  end subroutine broken_rules

  subroutine refused(code, cells, sets, pack_of)
    character(len=*), intent(in) :: code
    type(cells_type), intent(in) :: cells
    type(sets_type), intent(inout) :: sets
    type(pack_type), intent(in) :: pack_of
    type(error_list_type) :: errors
    call sets%sort(cells, pack_of, errors)
    call test%check(code//': refused', errors%any())
    if (errors%any()) call test%check_text(code//': code', errors%item(1)%code, code)
  end subroutine refused

  !> A chain of springs: factor, solution and condition against closed forms.
  subroutine bands()
    integer(i4), parameter :: n = 20
    type(band_type) :: chain, factored
    real(wp) :: x(n, 3), y(n), v(lanes, n), exact
    real(wp), parameter :: pi = 3.141592653589793_wp
    integer(i4) :: i, bad

    call chain%shape_by([(max(1_i4, i - 1_i4), i=1, n)])
    do i = 1, n
      call chain%add(i, i, 2.0_wp)
      if (i > 1) call chain%add(i, i - 1, -1.0_wp)
    end do
    factored = chain
    call factored%factor(bad)
    call test%check('band: positive', bad == 0)
    x = 0.0_wp
    x(3, :) = 1.0_wp
    call factored%solve(x)
    call chain%multiply(x(:, 2), y)
    y(3) = y(3) - 1.0_wp
    call test%check_all_close('band: solution', y, 0.0_wp, 1.0e-13_wp)
    v = 0.0_wp
    v(:, 3) = [1.0_wp, -2.0_wp, 0.5_wp, 0.0_wp]
    call factored%solve_vectors(v)
    v = v - spread([1.0_wp, -2.0_wp, 0.5_wp, 0.0_wp], 2, n)*spread(x(:, 1), 1, lanes)
    call test%check_all_close('band: vectors', v, 0.0_wp, 1.0e-13_wp)
    exact = (sin(n*pi/(2*n + 2))/sin(pi/(2*n + 2)))**2
    call test%check_close('band: condition', condition_of(chain, factored)/exact, 1.0_wp, 0.05_wp)
    call chain%add(7, 7, -3.0_wp)
    call chain%factor(bad)
    call test%check('band: not positive', bad == 7)
  end subroutine bands

  !> Distance from a brick: off a face, an edge, a corner.
  subroutine hulls()
    type(cells_type) :: cells
    type(hull_type) :: hull
    real(wp) :: low(3), high(3)
    call make_cells(hex8, [1, 1, 1], cells)
    cells%x(2, :) = h*merge(1.0_wp, 0.0_wp, cells%x(2, :) > 0.5_wp*h)
    cells%x(3, :) = h*merge(1.0_wp, 0.0_wp, cells%x(3, :) > 0.5_wp*h)
    call hull%build(cells, [.true.])
    low = 0.0_wp
    high = h
    call test%check('hull: twelve triangles', hull%n == 12)
    call test%check_close('hull: face', hull%distance([0.3_wp*h, 0.6_wp*h, 1.7_wp*h]), 0.7_wp*h, &
                          1.0e-14_wp)
    call test%check_close('hull: edge', hull%distance([-0.3_wp*h, 0.5_wp*h, 1.4_wp*h]), 0.5_wp*h, &
                          1.0e-14_wp)
    call test%check_close('hull: corner', hull%distance(high + 0.1_wp*h), &
                          0.1_wp*h*sqrt(3.0_wp), 1.0e-14_wp)
  end subroutine hulls
end program test_cpl_operators
