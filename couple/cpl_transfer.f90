!> The operator between the solid's nodes and the ghosts: motion one way, forces the other way.
!!
!! x_g = sum_a W_a x_a + arm; W_a are the facet's shape functions at the ghost, or those smeared
!! with a kernel over the facets around it (spread). With rotation the ghost turns by half the curl
!! of the displacement in the element behind its facet,
!!   theta = R u = 1/2 sum_a grad N_a x u_a,   d = W u + theta x arm,
!! and the transposed operator puts a force and a moment on the nodes,
!!   f_a = W_a P + 1/2 (m + arm x P) x grad N_a.
!! Sum W = 1, sum grad N = 0 and sum x_a (grad N_a)' = 1 make total force and moment exact, and the
!! transpose makes the powers of both sides equal (formulation, facet coupling).
module cpl_transfer
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_hash, only: hash_text
  use cpl_facet_map, only: facet_map_type
  use cpl_kernel, only: spread_weights
  implicit none
  private
  public :: transfer_type, cross

  real(wp), parameter :: identity_limit = 1.0e-11_wp  !! of the identities, relative

  !> Rows of a ghost: displacement or force (3), with rotation also rotation or moment (3).
  type :: transfer_type
    integer(i4) :: ghosts = 0
    integer(i4) :: nodes = 0
    integer(i4) :: rows = 3
    integer(i4), allocatable :: first(:)          !! of each ghost's entries (ghosts + 1)
    integer(i4), allocatable :: node(:)           !! of each entry, number of the interface node
    real(wp), allocatable :: weight(:)            !! W_a of each entry
    real(wp), allocatable :: arm(:, :)            !! ghost minus sum W x (3, ghosts) [m]
    integer(i4), allocatable :: corner(:, :)      !! of the element behind (8, ghosts)
    real(wp), allocatable :: gradient(:, :, :)    !! grad N_a there (3, 8, ghosts) [1/m]
  contains
    procedure :: build
    procedure :: to_ghosts
    procedure :: to_nodes
    procedure :: moment_of
    procedure :: identity_error
    procedure :: hash => transfer_hash
  end type transfer_type

contains

  !> Make the operator for a map, whose nodes are numbered anew: those of the elements behind and
  !! of facets in reach join them. Faults: I405 a facet without an element behind it.
  subroutine build(self, map, facets, x_node, hex8, spread, turns, errors)
    class(transfer_type), intent(inout) :: self
    type(facet_map_type), intent(inout) :: map
    integer(i4), intent(in) :: facets(:, :)  !! (4, k) node ids from 1
    real(wp), intent(in) :: x_node(:, :)     !! (3, all nodes) [m]
    integer(i4), intent(in) :: hex8(:, :)    !! (8, elements) node ids from 1
    real(wp), intent(in) :: spread           !! width of the kernel [m], 0: none
    logical, intent(in) :: turns             !! ghosts rotate with the solid
    type(error_list_type), intent(inout) :: errors
    logical :: needed(size(x_node, 2))
    integer(i4), allocatable :: list(:)
    real(wp), allocatable :: weight(:)
    integer(i4) :: g, n, element(map%ghosts), number(size(x_node, 2))

    self%ghosts = map%ghosts
    self%rows = merge(6, 3, turns)
    self%first = [(1_i4, g=0, map%ghosts)]
    self%node = [integer(i4) ::]
    self%weight = [real(wp) ::]
    self%arm = map%offset
    do g = 1, map%ghosts
      if (spread > 0.0_wp) then
        call spread_weights(map%point_on_facet(g, facets, x_node), map%facet(g), facets, x_node, &
                            spread, map%weight(:, g), list, weight)
        self%arm(:, g) = map%offset(:, g) + map%point_on_facet(g, facets, x_node) &
                         - matmul(x_node(:, list), weight)
      else
        list = facets(:, map%facet(g))
        weight = map%weight(:, g)
      end if
      n = size(list)
      self%first(g + 1) = self%first(g) + n
      self%node = [self%node, list]
      self%weight = [self%weight, weight]
    end do
    needed = .false.
    needed(self%node) = .true.
    if (turns) then
      call find_elements(map, facets, hex8, element, errors)
      if (errors%any()) return
      do g = 1, map%ghosts
        needed(hex8(:, element(g))) = .true.
      end do
    end if
    call map%number_nodes(facets, needed, number)
    self%nodes = map%nodes
    self%node = number(self%node)
    if (turns) call make_gradients(self, map, facets, x_node, hex8, element, number)
  end subroutine build

  !> The element behind the facet of each ghost; between two the lower number.
  subroutine find_elements(map, facets, hex8, element, errors)
    type(facet_map_type), intent(in) :: map
    integer(i4), intent(in) :: facets(:, :), hex8(:, :)
    integer(i4), intent(out) :: element(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: behind(size(facets, 2)), e, f, g
    logical :: used(maxval(hex8))

    used = .false.
    behind = -1
    do g = 1, map%ghosts
      behind(map%facet(g)) = 0
      used(facets(:, map%facet(g))) = .true.
    end do
    do e = 1, size(hex8, 2)
      if (count(used(hex8(:, e))) < 4) cycle
      do f = 1, size(facets, 2)
        if (behind(f) /= 0) cycle
        if (holds(hex8(:, e), facets(:, f))) behind(f) = e
      end do
    end do
    element = behind(map%facet)
    do g = 1, map%ghosts
      if (element(g) > 0) cycle
      call errors%add('I405', 'no element lies behind facet '//str(map%facet(g))//' of ghost '// &
                      str(map%ghost_id(g)), '', "rotation = 'curl' needs facets that are faces "// &
                      'of hexahedra of the mesh')
      return
    end do
  end subroutine find_elements

  pure logical function holds(nodes, corners)
    integer(i4), intent(in) :: nodes(8), corners(4)
    integer(i4) :: a
    holds = .true.
    do a = 1, 4
      holds = holds .and. any(nodes == corners(a))
    end do
  end function holds

  !> Gradients of the element's shape functions where the ghost stands.
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

  pure function inverse(m) result(inv)
    real(wp), intent(in) :: m(3, 3)
    real(wp) :: inv(3, 3)
    inv(1, :) = cross(m(:, 2), m(:, 3))
    inv(2, :) = cross(m(:, 3), m(:, 1))
    inv(3, :) = cross(m(:, 1), m(:, 2))
    inv = inv/dot_product(m(:, 1), inv(1, :))
  end function inverse

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

  !> Motion of the ghosts (rows, ghosts) from displacements of the nodes.
  pure subroutine to_ghosts(self, u, d)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)   !! (3, nodes) [m]
    real(wp), intent(out) :: d(:, :)  !! (rows, ghosts) [m, rad]
    real(wp) :: at(3), theta(3)
    integer(i4) :: g, e, a
    do g = 1, self%ghosts
      at = 0.0_wp
      do e = self%first(g), self%first(g + 1) - 1
        at = at + self%weight(e)*u(:, self%node(e))
      end do
      d(1:3, g) = at
      if (self%rows == 3) cycle
      theta = 0.0_wp
      do a = 1, 8
        theta = theta + cross(self%gradient(:, a, g), u(:, self%corner(a, g)))
      end do
      theta = 0.5_wp*theta
      d(1:3, g) = at + cross(theta, self%arm(:, g))
      d(4:6, g) = theta
    end do
  end subroutine to_ghosts

  !> Forces on the nodes from forces and moments on the ghosts, added in the order of the ghosts.
  pure subroutine to_nodes(self, p, f)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: p(:, :)   !! (rows, ghosts) [N, N m]
    real(wp), intent(out) :: f(:, :)  !! (3, nodes) [N]
    real(wp) :: half(3)
    integer(i4) :: g, e, a
    f = 0.0_wp
    do g = 1, self%ghosts
      do e = self%first(g), self%first(g + 1) - 1
        f(:, self%node(e)) = f(:, self%node(e)) + self%weight(e)*p(1:3, g)
      end do
      if (self%rows == 3) cycle
      half = 0.5_wp*(p(4:6, g) + cross(self%arm(:, g), p(1:3, g)))
      do a = 1, 8
        f(:, self%corner(a, g)) = f(:, self%corner(a, g)) + cross(half, self%gradient(:, a, g))
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

  !> Largest violation of rigid motion: a displacement of one extent, or a turn by one radian, of
  !! the nodes moves and turns the ghosts likewise; relative to the extent of the facets. N405 when
  !! it is above 1e-11.
  subroutine identity_error(self, x_node, x_ghost, worst, errors)
    class(transfer_type), intent(in) :: self
    real(wp), intent(in) :: x_node(:, :)   !! interface nodes (3, nodes) [m]
    real(wp), intent(in) :: x_ghost(:, :)  !! (3, ghosts) [m]
    real(wp), intent(out) :: worst
    type(error_list_type), intent(inout) :: errors
    real(wp) :: u(3, self%nodes), d(self%rows, self%ghosts), axis(3), wanted(3), extent
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
    if (worst <= identity_limit) return
    call errors%add('N405', 'the operator between nodes and ghosts is off a rigid motion by '// &
                    str(worst), '', 'look at the facets'' shape: a corner may be turned in')
  end subroutine identity_error

  !> Hash of the whole operator: map, nodes and the bits of its numbers.
  pure function transfer_hash(self, map) result(hex)
    class(transfer_type), intent(in) :: self
    type(facet_map_type), intent(in) :: map
    character(len=16) :: hex
    character(len=:), allocatable :: text
    integer(i8), allocatable :: bits(:)
    integer(i4) :: k, n

    n = size(self%node)
    allocate (bits(2*n + merge(32*self%ghosts, 0, self%rows > 3)))
    bits(:n) = map%node_id(self%node)
    bits(n + 1:2*n) = transfer(self%weight, bits, n)
    if (self%rows > 3) then
      bits(2*n + 1:2*n + 8*self%ghosts) = map%node_id(reshape(self%corner, [8*self%ghosts]))
      bits(2*n + 8*self%ghosts + 1:) = transfer(self%gradient, bits, 24*self%ghosts)
    end if
    allocate (character(len=16*size(bits)) :: text)
    do k = 1, size(bits)
      write (text(16*k - 15:16*k), '(z16.16)') bits(k)
    end do
    hex = hash_text(map%hash()//text)
  end function transfer_hash
end module cpl_transfer
