!> The operator between the solid's nodes and the ghosts: motion one way, forces the other way.
!!
!! x_g = sum_a W_a x_a + arm; W_a are the facet's shape functions at the ghost, or those smeared
!! with a kernel over the facets around it (spread). A ghost that turns, by theta, moves by
!!   d = W u + theta x arm
!! and the transposed operator puts its force P and moment m on the nodes. theta is half the curl of
!! the displacement in the element behind its facet (curl),
!!   theta = 1/2 sum_a grad N_a x u_a,     f_a = W_a P + 1/2 (m + arm x P) x grad N_a,
!! or the micro-rotation of a micropolar solid (micro), with M_b the functions of that field,
!!   theta = sum_b M_b phi_b,              f_a = W_a P,   c_b = M_b (m + arm x P).
!! Sum W = 1, sum M = 1, sum grad N = 0 and sum x_a (grad N_a)' = 1 make total force and moment
!! exact, and the transpose makes the powers of both sides equal
!! (theory-coupling, Rotation and moments).
!!
!! Columns of nodal values: displacements or forces of the interface nodes, then micro-rotations or
!! couples of those that have them.
!! eqs. C.1, C.4 and C.5
module cpl_transfer
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: cross, inverse
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_hash, only: hash_text
  use cpl_choices, only: rotation_fixed, rotation_curl, rotation_micro
  use cpl_facet_map, only: facet_map_type
  use cpl_kernel, only: spread_weights
  use cpl_shapes, only: node_count, corner_count, shapes_at
  use cpl_solid_mesh, only: solid_mesh_type
  implicit none
  private
  public :: transfer_type, cross

  real(wp), parameter :: identity_limit = 1.0e-11_wp  !! of the identities, relative

  !> Rows of a ghost: displacement or force (3), with rotation also rotation or moment (3).
  type :: transfer_type
    integer(i4) :: ghosts = 0
    integer(i4) :: nodes = 0
    integer(i4) :: blocks = 0                     !! columns: nodes, and their micro-rotations
    integer(i4) :: rows = 3
    integer(i4) :: rotation = rotation_fixed
    integer(i8), allocatable :: phi_id(:)         !! ids of the nodes with micro-rotations
    integer(i4), allocatable :: first(:)          !! of each ghost's entries (ghosts + 1)
    integer(i4), allocatable :: node(:)           !! of each entry, number of the interface node
    real(wp), allocatable :: weight(:)            !! W_a of each entry
    real(wp), allocatable :: arm(:, :)            !! ghost minus sum W x (3, ghosts) [m]
    integer(i4), allocatable :: corner(:, :)      !! of the element behind (8, ghosts)
    real(wp), allocatable :: gradient(:, :, :)    !! grad N_a there (3, 8, ghosts) [1/m]
    integer(i4), allocatable :: phi(:, :)         !! columns of micro-rotations (most, ghosts), the
                                                  !! first again beyond
    real(wp), allocatable :: phi_weight(:, :)     !! M_b (most, ghosts), 0 beyond
  contains
    procedure :: build
    procedure :: to_ghosts
    procedure :: to_nodes
    procedure :: moment_of
    procedure :: identity_error
    procedure :: hash => transfer_hash
  end type transfer_type

contains

  !> Make the operator for a map, whose nodes are renumbered: those of the elements behind and
  !! of facets in reach join them. Faults: I405 a facet without an element behind it, I406 one
  !! without micro-rotations.
  subroutine build(self, map, mesh, spread, rotation, errors)
    class(transfer_type), intent(inout) :: self
    type(facet_map_type), intent(inout) :: map
    type(solid_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: spread           !! width of the kernel [m], 0: none
    integer(i4), intent(in) :: rotation      !! of the ghosts, as in cpl_choices
    type(error_list_type), intent(inout) :: errors
    logical :: needed(size(mesh%x, 2))
    integer(i4) :: g, element(map%ghosts), number(size(mesh%x, 2))

    self%ghosts = map%ghosts
    self%rotation = rotation
    self%rows = merge(3, 6, rotation == rotation_fixed)
    self%phi_id = [integer(i8) ::]
    call weigh(self, map, mesh, spread)
    needed = .false.
    needed(self%node) = .true.
    if (rotation == rotation_curl) then
      call find_elements(map, mesh%facets, mesh%hex8, element, errors)
      if (errors%any()) return
      do g = 1, map%ghosts
        needed(mesh%hex8(:, element(g))) = .true.
      end do
    end if
    call map%number_nodes(mesh%facets, needed, number)
    self%nodes = map%nodes
    self%node = number(self%node)
    if (rotation == rotation_curl) call make_gradients(self, map, mesh%facets, mesh%x, mesh%hex8, &
                                                       element, number)
    if (rotation == rotation_micro) call find_rotations(self, map, mesh, errors)
    self%blocks = self%nodes + size(self%phi_id)
  end subroutine build

  !> Nodes, by their ids, and weights of the displacement of each ghost, and its arm.
  subroutine weigh(self, map, mesh, spread)
    type(transfer_type), intent(inout) :: self
    type(facet_map_type), intent(in) :: map
    type(solid_mesh_type), intent(in) :: mesh
    real(wp), intent(in) :: spread  !! [m]
    integer(i4), allocatable :: list(:), node(:)
    real(wp), allocatable :: weight(:), share(:)
    integer(i4) :: g, n

    self%first = [(1_i4, g=0, map%ghosts)]
    allocate (node(size(mesh%facets, 1)*map%ghosts), share(size(mesh%facets, 1)*map%ghosts))
    self%arm = map%offset
    do g = 1, map%ghosts
      if (spread > 0.0_wp) then
        call spread_weights(map%point_on_facet(g, mesh%facets, mesh%x), map%facet(g), mesh, &
                            spread, map%weight(:, g), list, weight)
        self%arm(:, g) = map%offset(:, g) + map%point_on_facet(g, mesh%facets, mesh%x) &
                         - matmul(mesh%x(:, list), weight)
      else
        n = node_count(mesh%facets(:, map%facet(g)))
        list = mesh%facets(:n, map%facet(g))
        weight = map%weight(:n, g)
      end if
      n = size(list)
      self%first(g + 1) = self%first(g) + n
      n = self%first(g + 1) - 1
      if (n > size(node)) then  ! twice as long, so that many ghosts cost no more than their number
        node = [node, so_many_zeros(n)]
        share = [share, real(so_many_zeros(n), wp)]
      end if
      node(self%first(g):n) = list
      share(self%first(g):n) = weight
    end do
    self%node = node(:n)
    self%weight = share(:n)
  end subroutine weigh

  !> Zeros to be filled.
  pure function so_many_zeros(n) result(zeros)
    integer(i4), intent(in) :: n
    integer(i4) :: zeros(n)
    zeros = 0
  end function so_many_zeros

  !> Micro-rotations under each ghost, at its place: of all nodes of its facet, or of the corners
  !! alone with their own functions, as in pairs of mixed order.
  subroutine find_rotations(self, map, mesh, errors)
    type(transfer_type), intent(inout) :: self
    type(facet_map_type), intent(in) :: map
    type(solid_mesh_type), intent(in) :: mesh
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: g, n, k, column(size(mesh%x, 2))

    column = 0
    self%phi_id = pack(map%node_id, mesh%polar(map%node_id) == 1)
    column(self%phi_id) = [(self%nodes + k, k=1, int(size(self%phi_id), i4))]
    allocate (self%phi(size(mesh%facets, 1), map%ghosts))
    allocate (self%phi_weight(size(mesh%facets, 1), map%ghosts), source=0.0_wp)
    do g = 1, map%ghosts
      associate (nodes => mesh%facets(:node_count(mesh%facets(:, map%facet(g))), map%facet(g)))
        n = size(nodes)
        if (any(column(nodes) == 0)) n = corner_count(n)
        if (any(column(nodes(:n)) == 0)) then
          call errors%add('I406', 'facet '//str(map%facet(g))//' of ghost '// &
                          str(map%ghost_id(g))//' has no micro-rotation', '', &
                          "rotation = 'micro' needs facets of a micropolar section: see the "// &
                          "solid's deck, or write rotation = 'curl' or 'fixed'")
          return
        end if
        self%phi(:, g) = column(nodes(1))
        self%phi(:n, g) = column(nodes(:n))
        self%phi_weight(:n, g) = shapes_at(n, map%natural(:, g))
      end associate
    end do
  end subroutine find_rotations

  !> The element behind the facet of each ghost; between two the lower number.
  subroutine find_elements(map, facets, hex8, element, errors)
    type(facet_map_type), intent(in) :: map
    integer(i4), intent(in) :: facets(:, :), hex8(:, :)
    integer(i4), intent(out) :: element(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: behind(size(facets, 2)), next(size(facets, 2)), e, f, g, a
    integer(i4) :: first(max(maxval(facets), maxval(hex8)))  !! facet that begins at a node

    behind = -1
    behind(map%facet) = 0
    first = 0
    next = 0
    do f = 1, size(facets, 2)
      if (behind(f) /= 0) cycle
      next(f) = first(facets(1, f))
      first(facets(1, f)) = f
    end do
    do e = 1, size(hex8, 2)
      do a = 1, 8
        f = first(hex8(a, e))
        do while (f > 0)
          if (behind(f) == 0 .and. holds(hex8(:, e), facets(:, f))) behind(f) = e
          f = next(f)
        end do
      end do
    end do
    element = behind(map%facet)
    do g = 1, map%ghosts
      if (element(g) > 0) cycle
      call errors%add('I405', 'no element lies behind facet '//str(map%facet(g))//' of ghost '// &
                      str(map%ghost_id(g)), '', "rotation = 'curl' needs facets that are faces "// &
                      'of eight-node hexahedra, and no other elements in the mesh')
      return
    end do
  end subroutine find_elements

  pure logical function holds(nodes, corners)
    integer(i4), intent(in) :: nodes(8), corners(:)
    integer(i4) :: a
    holds = node_count(corners) == 4
    do a = 1, min(4, int(size(corners), i4))
      holds = holds .and. any(nodes == corners(a))
    end do
  end function holds

  !> Gradients of the element's shape functions at the ghost's position.
  subroutine make_gradients(self, map, facets, x_node, hex8, element, number)
    type(transfer_type), intent(inout) :: self
    type(facet_map_type), intent(in) :: map
    integer(i4), intent(in) :: facets(:, :), hex8(:, :), element(:), number(:)
    real(wp), intent(in) :: x_node(:, :)
    real(wp), parameter :: vertex(3, 8) = reshape([-1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, &
      -1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, -1.0_wp, -1.0_wp, -1.0_wp, 1.0_wp, &
      1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp], [3, 8])
    real(wp) :: at(3), factor(3, 8), slope(3, 8), jacobian(3, 3)
    integer(i4) :: g, a

    allocate (self%corner(8, map%ghosts), self%gradient(3, 8, map%ghosts))
    do g = 1, map%ghosts
      associate (nodes => hex8(:, element(g)))
        at = 0.0_wp
        do a = 1, 4
          at = at + map%weight(a, g)*vertex(:, findloc(nodes, facets(a, map%facet(g)), 1))
        end do
        do a = 1, 8
          factor(:, a) = 1.0_wp + at*vertex(:, a)
          slope(:, a) = 0.125_wp*vertex(:, a)*[factor(2, a)*factor(3, a), &
                        factor(1, a)*factor(3, a), factor(1, a)*factor(2, a)]
        end do
        jacobian = matmul(x_node(:, nodes), transpose(slope))
        self%gradient(:, :, g) = matmul(transpose(inverse(jacobian)), slope)
        self%corner(:, g) = number(nodes)
      end associate
    end do
  end subroutine make_gradients

  !> Motion of the ghosts (rows, ghosts) from displacements and micro-rotations of the nodes.
  pure subroutine to_ghosts(self, u, d)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)   !! (3, blocks) [m, rad]
    real(wp), intent(out) :: d(:, :)  !! (rows, ghosts) [m, rad]
    real(wp) :: at(3), theta(3)
    integer(i4) :: g, e
    do g = 1, self%ghosts
      at = 0.0_wp
      do e = self%first(g), self%first(g + 1) - 1
        at = at + self%weight(e)*u(:, self%node(e))
      end do
      d(1:3, g) = at
      if (self%rows == 3) cycle
      if (self%rotation == rotation_micro) then
        theta(:) = matmul(u(:, self%phi(:, g)), self%phi_weight(:, g))
      else
        theta(:) = half_curl(self%gradient(:, :, g), u(:, self%corner(:, g)))
      end if
      d(1:3, g) = at + cross(theta, self%arm(:, g))
      d(4:6, g) = theta
    end do
  end subroutine to_ghosts

  !> 1/2 sum grad N_a x u_a [rad].
  pure function half_curl(b, u) result(theta)
    real(wp), intent(in) :: b(3, 8), u(3, 8)
    real(wp) :: theta(3)
    integer(i4) :: a
    theta = 0.0_wp
    do a = 1, 8
      theta(1) = theta(1) + b(2, a)*u(3, a) - b(3, a)*u(2, a)
      theta(2) = theta(2) + b(3, a)*u(1, a) - b(1, a)*u(3, a)
      theta(3) = theta(3) + b(1, a)*u(2, a) - b(2, a)*u(1, a)
    end do
    theta = 0.5_wp*theta
  end function half_curl

  !> Forces and couples on the nodes from forces and moments on the ghosts, added in the order of
  !! the ghosts.
  pure subroutine to_nodes(self, p, f)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: p(:, :)   !! (rows, ghosts) [N, N m]
    real(wp), intent(out) :: f(:, :)  !! (3, blocks) [N, N m]
    real(wp) :: moment(3), half(3), b(3)
    integer(i4) :: g, e, a, n
    f = 0.0_wp
    do g = 1, self%ghosts
      do e = self%first(g), self%first(g + 1) - 1
        f(:, self%node(e)) = f(:, self%node(e)) + self%weight(e)*p(1:3, g)
      end do
      if (self%rows == 3) cycle
      moment = p(4:6, g) + cross(self%arm(:, g), p(1:3, g))
      if (self%rotation == rotation_micro) then
        do a = 1, size(self%phi, 1)
          n = self%phi(a, g)
          f(:, n) = f(:, n) + self%phi_weight(a, g)*moment
        end do
        cycle
      end if
      half = 0.5_wp*moment
      do a = 1, 8
        n = self%corner(a, g)
        b(:) = self%gradient(:, a, g)
        f(1, n) = f(1, n) + half(2)*b(3) - half(3)*b(2)
        f(2, n) = f(2, n) + half(3)*b(1) - half(1)*b(3)
        f(3, n) = f(3, n) + half(1)*b(2) - half(2)*b(1)
      end do
    end do
  end subroutine to_nodes

  !> Moment that the transfer of forces alone loses: sum of arm x P; zero with rotation [N m].
  pure function moment_of(self, p) result(lost)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: p(:, :)  !! (rows, ghosts) [N]
    real(wp) :: lost(3)
    integer(i4) :: g
    lost = 0.0_wp
    if (self%rows > 3) return
    do g = 1, self%ghosts
      lost = lost + cross(self%arm(:, g), p(1:3, g))
    end do
  end function moment_of

  !> Largest violation of rigid motion and of equal powers. A displacement of one extent, or a turn
  !! by one radian, of the nodes moves and turns the ghosts likewise; relative to the extent of the
  !! facets. N405 when it is above 1e-11.
  subroutine identity_error(self, x_node, x_ghost, worst, errors)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: x_node(:, :)   !! interface nodes (3, nodes) [m]
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, ghosts) [m]
    real(wp), intent(out) :: worst
    type(error_list_type), intent(inout) :: errors
    real(wp) :: u(3, self%blocks), d(self%rows, self%ghosts), axis(3), wanted(3), extent
    integer(i4) :: k, n, g

    extent = max(maxval(abs(x_node)), maxval(maxval(x_node, 2) - minval(x_node, 2)), &
                 tiny(1.0_wp))
    worst = 0.0_wp
    do k = 1, 6
      axis = 0.0_wp
      axis(1 + mod(k - 1, 3)) = 1.0_wp
      do n = 1, self%nodes
        if (k <= 3) u(:, n) = extent*axis
        if (k > 3) u(:, n) = cross(axis, x_node(:, n))
      end do
      do n = self%nodes + 1, self%blocks
        u(:, n) = merge(axis, 0.0_wp, k > 3)
      end do
      call self%to_ghosts(u, d)
      do g = 1, self%ghosts
        wanted = extent*axis
        if (k > 3) wanted = cross(axis, x_ghost(:, g))
        if (k > 3 .and. self%rows == 3) wanted = cross(axis, x_ghost(:, g) - self%arm(:, g))
        worst = max(worst, maxval(abs(d(1:3, g) - wanted))/extent)
        if (self%rows == 3) cycle
        if (k <= 3) axis = 0.0_wp
        worst = max(worst, maxval(abs(d(4:6, g) - axis)))
        axis(1 + mod(k - 1, 3)) = 1.0_wp
      end do
    end do
    worst = max(worst, power_error(self, extent))
    if (worst <= identity_limit) return
    call errors%add('N405', 'the operator between nodes and ghosts is off a rigid motion, or '// &
                    'the powers of both sides off each other, by '// &
                    str(worst), '', 'check the facets'' shape: a corner may be turned in')
  end subroutine identity_error

  !> Power of forces and moments of the ghosts less that of the nodal forces and couples, for
  !! motions and forces that are all over the place; over the sum of the powers' sizes.
  pure real(wp) function power_error(self, extent)
    type(transfer_type), intent(in) :: self
    real(wp), intent(in) :: extent  !! [m]
    real(wp) :: u(3, self%blocks), f(3, self%blocks), d(self%rows, self%ghosts), &
      p(self%rows, self%ghosts)
    integer(i4) :: k, c
    do k = 1, self%blocks
      u(:, k) = sin([(1.0_wp*k*c, c=1, 3)])
      if (k <= self%nodes) u(:, k) = extent*u(:, k)
    end do
    do k = 1, self%ghosts
      p(:, k) = cos([(0.7_wp*k*c, c=1, self%rows)])
      p(4:, k) = extent*p(4:, k)
    end do
    call self%to_ghosts(u, d)
    call self%to_nodes(p, f)
    power_error = abs(sum(p*d) - sum(f*u))/max(sum(abs(p*d)), sum(abs(f*u)), tiny(1.0_wp))
  end function power_error

  !> Hash of the whole operator: map, nodes and the bits of its numbers.
  pure function transfer_hash(self, map) result(hex)
    class(transfer_type), intent(in) :: self
    type(facet_map_type), intent(in) :: map
    character(len=16) :: hex
    character(len=:), allocatable :: text
    integer(i8), allocatable :: bits(:)
    integer(i4) :: k, n

    n = size(self%node)
    allocate (bits(2*n))
    bits(:n) = map%node_id(self%node)
    bits(n + 1:) = transfer(self%weight, [0_i8], n)
    if (self%rotation == rotation_curl) bits = [bits, &
      map%node_id(reshape(self%corner, [8*self%ghosts])), &
      transfer(self%gradient, [0_i8], 24*self%ghosts)]
    if (self%rotation == rotation_micro) bits = [bits, &
      self%phi_id(reshape(self%phi - self%nodes, [size(self%phi)])), &
      transfer(self%phi_weight, [0_i8], size(self%phi))]
    allocate (character(len=16*size(bits)) :: text)
    do k = 1, size(bits)
      write (text(16*k - 15:16*k), '(z16.16)') bits(k)
    end do
    hex = hash_text(map%hash()//text)
  end function transfer_hash
end module cpl_transfer
