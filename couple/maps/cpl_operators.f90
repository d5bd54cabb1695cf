!> The operators of the overlap: nodes over free grains follow them, D^ = P Q, ghosts follow the
!! nodes, Q^ = G D + H Q with H = N P; forces come back by the transposes.
!!
!! Columns of nodal values: the prescribed nodes, then those of the edge; micro-rotations alike, of
!! those nodes that have one. A ghost turns with the micro-rotation (micro), with half the curl of
!! the displacement (curl), or not at all (fixed). Of a micromorphic solid the three columns of the
!! micro-deformation replace the micro-rotation (cpl_micro). (theory: overlap coupling)
!! eqs. C.7 and C.8
module cpl_operators
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_homogenise, only: cross
  use cpl_cells, only: cells_type, spot_type
  use cpl_choices, only: rotation_fixed, rotation_curl, rotation_micro
  use cpl_elements, only: most_nodes
  use cpl_micro, only: micro_type, parts, moment_of, columns_of_turn
  use cpl_projection, only: projection_type
  use cpl_rows, only: rows_type, curl_rows_type
  use cpl_sets, only: sets_type, pack_type, part_free, numbering
  use cpl_identical_rows, only: same_rows, same_maps, apply_identical, transposed_identical, &
    project_identical, hand_on_identical
  implicit none
  private
  public :: operators_type, map_choice_type, followers_type, weigh_unit, weigh_mass, weigh_volume

  integer(i4), parameter :: weigh_unit = 1, weigh_mass = 2, weigh_volume = 3

  !> How ghosts turn and free grains are projected.
  type :: map_choice_type
    integer(i4) :: rotation = rotation_fixed
    integer(i4) :: weights = weigh_mass
    logical :: mls = .false.                 !! moving least squares, else l2
  end type map_choice_type

  !> Free grains as the projection takes them; those in no element (spot%element = 0) do not count.
  type :: followers_type
    type(spot_type), allocatable :: spot(:)
    real(wp), allocatable :: x(:, :)       !! (3, free) [m]
    real(wp), allocatable :: origin(:, :)  !! the same in the reference state
    real(wp), allocatable :: w(:)          !! weights of displacements
    real(wp), allocatable :: w_phi(:)      !! weights of rotations
  end type followers_type

  type :: operators_type
    integer(i4) :: free = 0, ghosts = 0          !! grains
    integer(i4) :: prescribed = 0, nodes = 0           !! prescribed nodes; with those of the edge
    integer(i4) :: prescribed_phi = 0, nodes_phi = 0   !! of these, with micro-rotations
    integer(i4), allocatable :: node(:)          !! ids of the nodes
    integer(i4), allocatable :: node_phi(:)      !! ids of the nodes with micro-rotations; three
                                                 !! times each with micro-deformations
    integer(i4) :: stride = 1                    !! values of node_phi that a node has
    type(micro_type) :: micro
    integer(i4) :: rotation = rotation_fixed
    real(wp), allocatable :: w(:), w_phi(:)      !! weights of the free grains
    type(projection_type) :: p, p_phi
    type(rows_type) :: ghost, ghost_phi
    type(curl_rows_type) :: ghost_curl
    logical :: twin_ghosts = .false.             !! ghost and ghost_phi are the same
    logical :: twin_maps = .false.               !! p and p_phi have the same rows
    integer(i4), allocatable :: every(:)         !! rows of the ghosts
  contains
    procedure :: build
    procedure :: project
    procedure :: to_prescribed
    procedure :: to_ghosts
    procedure :: to_some_ghosts
    procedure :: pull
    procedure :: from_prescribed
    procedure :: pull_some
    procedure :: identity_error
  end type operators_type

contains

  !> Make all from the sets. I406 no micro-rotation, I425 a projection that cannot be.
  subroutine build(self, cells, sets, pack_of, choice, errors)
    class(operators_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(sets_type), intent(in) :: sets
    type(pack_type), intent(in) :: pack_of
    type(map_choice_type), intent(in) :: choice
    type(error_list_type), intent(inout) :: errors
    type(followers_type) :: followers
    integer(i4) :: number(cells%nodes), rotation, a

    self%free = size(sets%free)
    self%ghosts = size(sets%ghost)
    rotation = choice%rotation
    self%rotation = rotation
    self%node = [sets%prescribed, sets%edge]
    self%prescribed = size(sets%prescribed)
    self%nodes = size(self%node)
    self%node_phi = pack(self%node, cells%polar(self%node) .and. rotation == rotation_micro)
    self%prescribed_phi = count(cells%polar(sets%prescribed) .and. rotation == rotation_micro)
    if (cells%micromorphic .and. rotation == rotation_micro) then
      self%stride = parts
      self%node_phi = [(spread(self%node_phi(a), 1, parts), a=1, int(size(self%node_phi), i4))]
      self%prescribed_phi = parts*self%prescribed_phi
      call self%micro%begin(self%ghosts)
    end if
    self%nodes_phi = size(self%node_phi)

    number = numbering(self%node, cells%nodes)
    call interpolate(cells, sets%ghost_spot, number, self%nodes, .false., self%ghost)
    if (rotation == rotation_curl) call slopes(cells, sets%ghost_spot, number, self%ghost_curl)
    if (rotation == rotation_micro) then
      if (any(sets%ghost_spot%n_phi == 0) .or. &
          any(sets%free_spot%n_phi == 0 .and. sets%free_spot%element > 0)) then
        call errors%add('I406', 'some grains of the overlap are in elements without '// &
          'micro-rotation', '', "rotation = 'micro' needs a micropolar section under all of "// &
          "&overlap, or write rotation = 'curl'")
        return
      end if
      number = numbering(self%node_phi(::self%stride), cells%nodes)
      call interpolate(cells, sets%ghost_spot, number, self%nodes_phi/self%stride, .true., &
                       self%ghost_phi)
      self%twin_ghosts = .not. self%micro%active .and. same_rows(self%ghost, self%ghost_phi)
    end if
    self%every = [(a, a=1, self%ghosts)]
    followers%spot = sets%free_spot
    followers%x = pack_of%x(:, sets%free)
    followers%origin = followers%x
    self%w = weights_of(pack_of, sets%free, choice%weights, .false.)
    self%w_phi = weights_of(pack_of, sets%free, choice%weights, .true.)
    followers%w = self%w
    followers%w_phi = self%w_phi
    call self%project(cells, sets%part, followers, choice%mls, errors)
  end subroutine build

  !> P from where the free grains are in the elements. I425 a projection that cannot be.
  subroutine project(self, cells, part, followers, mls, errors)
    class(operators_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:)  !! of the elements
    type(followers_type), intent(in) :: followers
    logical, intent(in) :: mls
    type(error_list_type), intent(inout) :: errors
    call one(self%p, self%node(:self%prescribed), .false., followers%w)
    self%twin_maps = .false.
    if (self%prescribed_phi == 0 .or. errors%any()) return
    associate (ids => self%node_phi(:self%prescribed_phi:self%stride))
      call one(self%p_phi, ids, .true., followers%w_phi)
      if (self%micro%active .and. .not. errors%any()) call self%micro%fit(self%p_phi%n, &
        merge(followers%w, 0.0_wp, followers%spot%element > 0), followers%origin, ids, errors)
    end associate
    if (.not. errors%any()) self%twin_maps = .not. self%micro%active .and. &
      same_maps(self%p, self%p_phi)

  contains

    subroutine one(p, ids, turning, weights)
      type(projection_type), intent(inout) :: p
      integer(i4), intent(in) :: ids(:)
      logical, intent(in) :: turning
      real(wp), intent(in) :: weights(:)
      type(rows_type) :: n
      real(wp) :: w(size(weights))
      integer(i4) :: number(cells%nodes)
      number = numbering(ids, cells%nodes)
      call interpolate(cells, followers%spot, number, int(size(ids), i4), turning, n)
      w = merge(weights, 0.0_wp, followers%spot%element > 0)
      if (mls) then
        call p%build_mls(n, w, cells%x(:, ids), followers%x, reaches(cells, part, ids), ids, errors)
      else
        call p%build_l2(n, w, cells%x(:, ids), ids, errors)
      end if
    end subroutine one
  end subroutine project

  !> Weights of the free grains in the projection of displacements or of rotations.
  pure function weights_of(pack_of, free, weights, turning) result(w)
    type(pack_type), intent(in) :: pack_of
    integer(i4), intent(in) :: free(:), weights
    logical, intent(in) :: turning
    real(wp) :: w(size(free))
    select case (weights)
    case (weigh_mass)
      w = pack_of%mass(free)
      if (turning) w = pack_of%inertia(free)
    case (weigh_volume)
      w = pack_of%volume(free)
    case default
      w = 1.0_wp
    end select
  end function weights_of

  !> How far the fit around a node reaches: to the farthest node of its elements of free grains.
  pure function reaches(cells, part, ids) result(reach)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:), ids(:)
    real(wp) :: reach(size(ids)), whole(cells%nodes)
    real(wp), parameter :: more = 1.05_wp
    integer(i4) :: e, a
    whole = 0.0_wp
    do e = 1, cells%elements
      if (part(e) /= part_free) cycle
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        do a = 1, size(node)
          whole(node(a)) = max(whole(node(a)), farthest(cells%x(:, node(a)), cells%x(:, node)))
        end do
      end associate
    end do
    reach = more*whole(ids)
  end function reaches

  !> Distance of the farthest of some points from x.
  pure real(wp) function farthest(x, points)
    real(wp), intent(in) :: x(3), points(:, :)
    integer(i4) :: b
    farthest = 0.0_wp
    do b = 1, size(points, 2)
      farthest = max(farthest, norm2(x - points(:, b)))
    end do
  end function farthest

  !> Rows of the functions of u or phi at points.
  subroutine interpolate(cells, spot, number, columns, turning, rows)
    type(cells_type), intent(in) :: cells
    type(spot_type), intent(in) :: spot(:)
    integer(i4), intent(in) :: number(:)  !! columns of the nodes
    integer(i4), intent(in) :: columns
    logical, intent(in) :: turning
    type(rows_type), intent(inout) :: rows
    integer(i4) :: k, first, n
    call rows%begin(int(size(spot), i4), columns, most_nodes)
    do k = 1, size(spot)
      first = 1
      if (spot(k)%element > 0) first = cells%start(spot(k)%element)
      n = merge(spot(k)%n_phi, spot(k)%n, turning)
      if (turning) then
        call rows%add_row(number(cells%node(first:first + n - 1)), spot(k)%weight_phi(:n))
      else
        call rows%add_row(number(cells%node(first:first + n - 1)), spot(k)%weight(:n))
      end if
    end do
    call rows%finish()
  end subroutine interpolate

  !> Slopes of the functions of u at the ghosts.
  subroutine slopes(cells, spot, number, rows)
    type(cells_type), intent(in) :: cells
    type(spot_type), intent(in) :: spot(:)
    integer(i4), intent(in) :: number(:)
    type(curl_rows_type), intent(inout) :: rows
    integer(i4) :: k, at
    rows%rows = size(spot)
    if (allocated(rows%first)) deallocate (rows%first, rows%column, rows%slope)
    allocate (rows%first(size(spot) + 1), rows%column(sum(spot%n)), rows%slope(3, sum(spot%n)))
    rows%first(1) = 1
    do k = 1, size(spot)
      at = rows%first(k)
      associate (n => spot(k)%n, first => cells%start(spot(k)%element))
        rows%column(at:at + n - 1) = number(cells%node(first:first + n - 1))
        rows%slope(:, at:at + n - 1) = spot(k)%gradient(:, :n)
        rows%first(k + 1) = at + n
      end associate
    end do
  end subroutine slopes

  !> Prescribed nodes from the motion of the free grains.
  subroutine to_prescribed(self, q, theta, u, phi)
    class(operators_type), intent(in) :: self
    real(wp), intent(in) :: q(:, :), theta(:, :)      !! (3, free) [m], [rad]
    real(wp), intent(inout) :: u(:, :), phi(:, :)     !! (3, nodes), (3, nodes_phi)
    real(wp) :: turn(3, self%prescribed_phi/self%stride)
    if (self%twin_maps) then
      call project_identical(self%p, self%p_phi, q, theta, u(:, :self%prescribed), phi(:, &
        :self%prescribed_phi))
      return
    end if
    call self%p%apply(q, u(:, :self%prescribed))
    if (self%prescribed_phi == 0) return
    if (self%micro%active) then
      call self%p_phi%apply(theta, turn)
      call self%micro%prescribed(q, turn, phi(:, :self%prescribed_phi))
    else
      call self%p_phi%apply(theta, phi(:, :self%prescribed_phi))
    end if
  end subroutine to_prescribed

  !> Displacements and rotations of the ghosts, small ones if they turn with micro-deformations.
  subroutine to_ghosts(self, u, phi, d, turn)
    class(operators_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :), phi(:, :)
    real(wp), intent(out) :: d(:, :), turn(:, :)      !! (3, ghosts) [m], [rad]
    if (self%twin_ghosts) then
      call apply_identical(self%ghost, self%every, u, phi, d, turn)
      return
    end if
    call self%ghost%apply(u, d)
    select case (self%rotation)
    case (rotation_micro)
      if (self%micro%active) then
        call self%micro%turns(self%ghost_phi, phi, turn)
      else
        call self%ghost_phi%apply(phi, turn)
      end if
    case (rotation_curl)
      call self%ghost_curl%apply(u, turn)
    case default
      turn = 0.0_wp
    end select
  end subroutine to_ghosts

  !> As to_ghosts, for some of them.
  subroutine to_some_ghosts(self, some, u, phi, d, turn)
    class(operators_type), intent(in) :: self
    integer(i4), intent(in) :: some(:)                !! rows of the ghosts
    real(wp), intent(in) :: u(:, :), phi(:, :)
    real(wp), intent(out) :: d(:, :), turn(:, :)      !! (3, size(some)) [m], [rad]
    if (self%twin_ghosts) then
      call apply_identical(self%ghost, some, u, phi, d, turn)
      return
    end if
    call self%ghost%apply_some(some, u, d)
    select case (self%rotation)
    case (rotation_micro)
      call self%ghost_phi%apply_some(some, phi, turn)
    case (rotation_curl)
      call self%ghost_curl%apply_some(some, u, turn)
    case default
      turn = 0.0_wp
    end select
  end subroutine to_some_ghosts

  !> Forces on ghosts and nodes, transferred to what is free: f and c come in as forces and couples
  !! that elements put on the nodes, and leave with the ghosts' share; force and moment are what the
  !! prescribed nodes transfer to the free grains.
  subroutine pull(self, p, m, f, c, force, moment)
    class(operators_type), intent(in) :: self
    real(wp), intent(in) :: p(:, :), m(:, :)              !! (3, ghosts) [N], [N m]
    real(wp), intent(inout) :: f(:, :), c(:, :)           !! (3, nodes), (3, nodes_phi)
    real(wp), intent(out) :: force(:, :), moment(:, :)    !! (3, free) [N], [N m]
    if (self%twin_ghosts) then
      call transposed_identical(self%ghost, self%every, p, m, f, c)
      call self%from_prescribed(f, c, force, moment)
      return
    end if
    call self%ghost%transposed(p, f)
    if (self%micro%active) then
      call self%micro%pull(self%ghost_phi, m, c)
    else if (self%rotation == rotation_micro) then
      call self%ghost_phi%transposed(m, c)
    end if
    if (self%rotation == rotation_curl) call self%ghost_curl%transposed(m, f)
    call self%from_prescribed(f, c, force, moment)
  end subroutine pull

  !> What prescribed nodes transfer to the free grains.
  subroutine from_prescribed(self, f, c, force, moment)
    class(operators_type), intent(in) :: self
    real(wp), intent(in) :: f(:, :), c(:, :)
    real(wp), intent(out) :: force(:, :), moment(:, :)
    real(wp) :: turning(3, self%prescribed_phi/self%stride), nothing(3, self%free)
    if (self%twin_maps) then
      nothing = 0.0_wp
      call hand_on_identical(self%p, self%p_phi, f(:, :self%prescribed), c(:, &
        :self%prescribed_phi), nothing, &
                         nothing, force, moment)
      return
    end if
    force = 0.0_wp
    moment = 0.0_wp
    call self%p%transposed(f(:, :self%prescribed), force)
    if (self%prescribed_phi == 0) return
    if (self%micro%active) then
      call self%micro%pull_prescribed(c(:, :self%prescribed_phi), force, turning)
      call self%p_phi%transposed(turning, moment)
    else
      call self%p_phi%transposed(c(:, :self%prescribed_phi), moment)
    end if
  end subroutine from_prescribed

  !> As pull, with forces on some of the ghosts alone, for forces and moments that act on the free
  !! grains besides. Of micro-rotations, not of micro-deformations.
  subroutine pull_some(self, some, p, m, f, c, besides, besides_phi, force, moment)
    class(operators_type), intent(in) :: self
    integer(i4), intent(in) :: some(:)                    !! rows of the ghosts
    real(wp), intent(in) :: p(:, :), m(:, :)              !! (3, size(some)) [N], [N m]
    real(wp), intent(inout) :: f(:, :), c(:, :)
    real(wp), intent(in) :: besides(:, :), besides_phi(:, :)  !! (3, free) [N], [N m]
    real(wp), intent(out) :: force(:, :), moment(:, :)
    if (self%twin_ghosts) then
      call transposed_identical(self%ghost, some, p, m, f, c)
    else
      call self%ghost%transposed_some(some, p, f)
      if (self%rotation == rotation_micro) call self%ghost_phi%transposed_some(some, m, c)
      if (self%rotation == rotation_curl) call self%ghost_curl%transposed_some(some, m, f)
    end if
    if (self%twin_maps) then
      call hand_on_identical(self%p, self%p_phi, f(:, :self%prescribed), c(:, &
        :self%prescribed_phi), besides, &
                         besides_phi, force, moment)
      return
    end if
    call self%p%transposed_onto(f(:, :self%prescribed), besides, force)
    if (self%prescribed_phi > 0) then
      call self%p_phi%transposed_onto(c(:, :self%prescribed_phi), besides_phi, moment)
    else
      moment = besides_phi
    end if
  end subroutine pull_some

  !> Largest violation of: P N = 1 (l2), rigid motion of grains moves nodes and ghosts likewise,
  !! equal powers, total force and moment. Lengths over the extent. N422 above 1e-12, or above
  !! 1e-14 times the condition of the projection.
  subroutine identity_error(self, x_free, x_node, x_ghost, worst, errors)
    class(operators_type), intent(in) :: self
    real(wp), intent(in) :: x_free(:, :), x_node(:, :), x_ghost(:, :)  !! (3, :) [m]
    real(wp), intent(out) :: worst
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: limit = 1.0e-12_wp, rounding = 1.0e-14_wp
    real(wp) :: extent, middle(3), axis(3)
    real(wp), dimension(3, self%nodes) :: u
    real(wp), dimension(3, self%nodes_phi) :: phi
    integer(i4) :: k

    middle = 0.5_wp*(maxval(x_node, 2) + minval(x_node, 2))
    extent = maxval(maxval(x_node, 2) - minval(x_node, 2))
    worst = 0.0_wp
    do k = 1, 6
      axis = 0.0_wp
      axis(1 + mod(k - 1, 3)) = 1.0_wp
      call rigid(k > 3)
    end do
    if (.not. self%p%mls) worst = max(worst, inverse_error(self))
    worst = max(worst, power_error(self, x_free, x_node, x_ghost, middle, extent))
    if (worst > max(limit, rounding*max(self%p%condition, self%p_phi%condition))) &
      call errors%add('N422', 'the operators of the overlap violate their identities by '// &
        str(worst), '', 'elements of strange shape, or a projection near the limit of its '// &
        'condition: check the census in the log')

  contains

    !> A shift by the extent, or a turn by one radian.
    subroutine rigid(turning)
      logical, intent(in) :: turning
      real(wp) :: q(3, self%free), theta(3, self%free), d(3, self%ghosts), turn(3, self%ghosts)
      real(wp), dimension(3, self%nodes_phi) :: turned
      q = shifts(x_free)
      theta = spread(merge(axis, 0.0_wp, turning), 2, self%free)
      u = shifts(x_node)
      turned = spread(merge(axis, 0.0_wp, turning), 2, self%nodes_phi)
      if (self%micro%active) turned = reshape(spread(columns_of_turn(merge(axis, 0.0_wp, &
        turning)), 3, self%nodes_phi/parts), shape(turned))
      if (self%micro%positions) turned = turned/extent  ! of shifts over the extent
      phi = turned
      u(:, :self%prescribed) = 0.0_wp
      call self%to_prescribed(q, theta, u, phi)
      worst = max(worst, maxval(abs(u - shifts(x_node))))
      if (self%nodes_phi > 0 .and. turning) worst = max(worst, maxval(abs(phi - turned)))
      call self%to_ghosts(u, phi, d, turn)
      worst = max(worst, maxval(abs(d - shifts(x_ghost))))
      if (self%rotation == rotation_curl .or. self%micro%positions) turn = extent*turn
      if (self%rotation /= rotation_fixed) worst = max(worst, &
        maxval(abs(turn - spread(merge(axis, 0.0_wp, turning), 2, self%ghosts))))
    end subroutine rigid

    !> Motion of points, over the extent.
    pure function shifts(x) result(d)
      real(wp), intent(in) :: x(:, :)
      real(wp) :: d(3, size(x, 2))
      d = spread(axis, 2, size(x, 2))
      if (k > 3) d = turned_about(axis, x, middle, extent)
    end function shifts
  end subroutine identity_error

  !> Motion of points turned by one radian, over the extent.
  pure function turned_about(axis, x, middle, extent) result(d)
    real(wp), intent(in) :: axis(3), x(:, :), middle(3), extent
    real(wp) :: d(3, size(x, 2))
    integer(i4) :: i
    do i = 1, size(x, 2)
      d(:, i) = cross(axis, (x(:, i) - middle)/extent)
    end do
  end function turned_about

  !> P N = 1 on a field that is different at every node.
  real(wp) function inverse_error(self) result(worst)
    type(operators_type), intent(in) :: self
    real(wp) :: q(3, self%free), field(3, self%prescribed), back(3, self%prescribed)
    integer(i4) :: a
    do a = 1, self%prescribed
      field(:, a) = [sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
    end do
    call self%p%n%apply(field, q)
    call self%p%apply(q, back)
    worst = maxval(abs(back - field))
  end function inverse_error

  !> Powers of both sides, total force and total moment, for forces all over the place.
  real(wp) function power_error(self, x_free, x_node, x_ghost, middle, extent) result(worst)
    type(operators_type), intent(in) :: self
    real(wp), intent(in) :: x_free(:, :), x_node(:, :), x_ghost(:, :), middle(3), extent
    real(wp), dimension(3, self%ghosts) :: p, m, d, turn
    real(wp), dimension(3, self%free) :: q, theta, force, moment
    real(wp), dimension(3, self%nodes) :: u, f, f0
    real(wp), dimension(3, self%nodes_phi) :: phi, c, c0
    real(wp) :: here, there, scale, total(3, 2), arm

    call scatter(1.1_wp, p)
    call scatter(2.3_wp, m)
    call scatter(0.7_wp, f0)
    call scatter(3.1_wp, c0)
    call scatter(1.9_wp, q)
    call scatter(0.3_wp, theta)
    call scatter(2.9_wp, u)
    call scatter(0.9_wp, phi)
    m = extent*m
    c0 = extent*c0
    call self%to_prescribed(q, theta, u, phi)
    call self%to_ghosts(u, phi, d, turn)
    f = f0
    c = c0
    call self%pull(p, m, f, c, force, moment)
    here = sum(p*d) + sum(m*turn) + sum(f0*u) + sum(c0*phi)
    there = sum(force*q) + sum(moment*theta) + sum(f(:, self%prescribed + 1:)*u(:, &
      self%prescribed + 1:)) &
            + sum(c(:, self%prescribed_phi + 1:)*phi(:, self%prescribed_phi + 1:))
    scale = sum(abs(p*d)) + sum(abs(m*turn)) + sum(abs(f0*u)) + sum(abs(c0*phi)) &
            + sum(abs(force*q)) + sum(abs(moment*theta))
    worst = abs(here - there)/scale
    if (self%rotation == rotation_fixed) m = 0.0_wp
    total(:, 1) = sum(p, 2) + sum(f0, 2) - sum(force, 2) - sum(f(:, self%prescribed + 1:), 2)
    total(:, 2) = moment_about(x_ghost, p) + sum(m, 2) + moment_about(x_node, f0) &
      + turning(self, c0) - moment_about(x_free, force) - sum(moment, 2) &
      - turning(self, c(:, self%prescribed_phi + 1:)) &
      - moment_about(x_node(:, self%prescribed + 1:), f(:, self%prescribed + 1:))
    scale = sum(abs(p)) + sum(abs(f0)) + sum(abs(force))
    arm = extent*scale
    worst = max(worst, maxval(abs(total(:, 1)))/scale, maxval(abs(total(:, 2)))/arm)

  contains

    pure function moment_about(x, load) result(sum_of)
      real(wp), intent(in) :: x(:, :), load(:, :)
      real(wp) :: sum_of(3)
      integer(i4) :: k
      sum_of = 0.0_wp
      do k = 1, size(x, 2)
        sum_of = sum_of + cross(x(:, k) - middle, load(:, k))
      end do
    end function moment_about
  end function power_error

  !> Vectors that are different everywhere.
  pure subroutine scatter(seed, value)
    real(wp), intent(in) :: seed
    real(wp), intent(out) :: value(:, :)
    integer(i4) :: k
    do k = 1, size(value, 2)
      value(:, k) = [sin(seed*k), cos(1.7_wp*seed*k + 0.4_wp), sin(0.6_wp*seed*k + 2.0_wp)]
    end do
  end subroutine scatter

  !> Moment of couples on nodes.
  pure function turning(self, c) result(moment)
    type(operators_type), intent(in) :: self
    real(wp), intent(in) :: c(:, :)
    real(wp) :: moment(3)
    moment = sum(c, 2)
    if (self%micro%active) moment = moment_of(c)
  end function turning
end module cpl_operators
