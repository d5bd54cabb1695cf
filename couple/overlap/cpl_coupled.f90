!> The stiffness that acts in every step of the grains in an overlap, as a linear operator: contacts
!! of free grains and ghosts, elements with prescribed nodes, ghosts and prescribed nodes following,
!! forces pulled back. Contacts neither slide nor open; those between ghosts count in full. (theory:
!! overlap coupling)
module cpl_coupled
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: cross
  use cpl_micro, only: parts
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type, fill_partition, elastic_tensor
  use cpl_partition, only: partition_type, add_point
  use cpl_sets, only: part_ghost
  implicit none
  private
  public :: coupled_type, motion_type, add_contacts, add_elements

  integer(i4), parameter :: motions = 45  !! numbers of a micromorphic point

  !> Motion of all grains and of the nodes of the overlap, or forces on them.
  type :: motion_type
    real(wp), allocatable :: q(:, :), theta(:, :)  !! (3, grains of the pack)
    real(wp), allocatable :: u(:, :), phi(:, :)    !! (3, nodes), (3, nodes_phi)
  end type motion_type

  type :: coupled_type
    type(partition_type) :: partition
    integer(i4), allocatable :: point(:)      !! points of elements with prescribed nodes
    real(wp), allocatable :: factor(:)        !! their weights times volumes [m^3]
    real(wp), allocatable :: bending(:, :, :) !! (9, 9, elements) couple stress/curvature [N]
    real(wp), allocatable :: tangent(:, :, :) !! (45, 45, laws) of micromorphic ones
    integer(i4), allocatable :: law(:)        !! (elements) of the partition
    real(wp), allocatable :: light(:)         !! (grains) 1/mass, 0 of what does not move [1/kg]
    real(wp), allocatable :: inverse_inertia(:)  !! (grains) 1/least moment of inertia [1/(kg m^2)]
  contains
    procedure :: build
    procedure :: start
    procedure :: stiffness_times
    procedure :: accelerate
    procedure :: work
  end type coupled_type

contains

  !> From what the solvers describe, with weights and masses that the overlap has already. kicks:
  !! what acts once an exchange where forces come in parts, contacts between ghosts and the other
  !! elements in the layer of ghosts.
  subroutine build(self, o, contacts, points, inertia, kicks)
    class(coupled_type), intent(inout) :: self
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    real(wp), intent(in) :: inertia(:)  !! least principal moment of the grains [kg m^2]
    logical, intent(in), optional :: kicks
    integer(i4), allocatable :: row(:), at(:)
    integer(i4) :: q, k, e
    logical :: slow

    slow = .false.
    if (present(kicks)) slow = kicks
    call fill_partition(o, contacts, points, self%partition, row, at)
    if (slow) then
      self%point = pack([(q, q=1, int(size(at), i4))], .not. o%sets%fast(points%element(at)) &
                        .and. o%sets%part(points%element(at)) == part_ghost)
      call keep_ghosts(o, self%partition)
    else
      self%point = pack([(q, q=1, int(size(at), i4))], o%sets%fast(points%element(at)))
    end if
    self%factor = o%share%beta(at(self%point))*self%partition%volume(self%point)
    allocate (self%bending(9, 9, size(self%partition%region)), source=0.0_wp)
    allocate (self%law(size(self%partition%region)), source=0)
    if (allocated(points%tangent)) self%tangent = reshape(points%tangent, [motions, motions, &
                                                          size(points%tangent, 2)])
    do q = 1, size(at)
      k = self%partition%element(q)
      e = points%element(at(q))
      associate (m => points%moduli(:, e))
        if (allocated(points%law)) self%law(k) = points%law(e)
        if (self%partition%polar) self%bending(:, :, k) = elastic_tensor([m(4), m(5), m(6) - m(5)])
      end associate
    end do
    allocate (self%light(size(o%pack%id)), self%inverse_inertia(size(o%pack%id)), source=0.0_wp)
    associate (free => o%sets%free, outside => o%sets%outside)
      self%light(free) = 1.0_wp/(o%own%factor*o%pack%mass(free))
      self%inverse_inertia(free) = 1.0_wp/(o%own%factor*inertia(free))
      self%light(outside) = 1.0_wp/o%pack%mass(outside)
      self%inverse_inertia(outside) = 1.0_wp/inertia(outside)
    end associate
  end subroutine build

  !> Leave contacts between ghosts alone.
  pure subroutine keep_ghosts(o, p)
    type(overlap_type), intent(in) :: o
    type(partition_type), intent(inout) :: p
    logical :: ghost(size(o%pack%id))
    integer(i4), allocatable :: kept(:)
    integer(i4) :: c
    ghost = .false.
    ghost(o%sets%ghost) = .true.
    kept = pack([(c, c=1, int(size(p%pair, 2), i4))], ghost(p%pair(1, :)) .and. ghost(p%pair(2, :)))
    p%pair = p%pair(:, kept)
    p%arm = p%arm(:, :, kept)
    p%normal = p%normal(:, kept)
    p%stiffness = p%stiffness(:, kept)
  end subroutine keep_ghosts

  !> A motion in which all takes part, of no special form.
  subroutine start(self, o, y)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(out) :: y
    real(wp) :: largest
    integer(i4) :: n, k, c
    n = size(self%light)
    largest = max(maxval(o%pack%radius), tiny(1.0_wp))
    allocate (y%q(3, n), y%theta(3, n), y%u(3, o%op%nodes), y%phi(3, o%op%nodes_phi))
    do k = 1, n
      do c = 1, 3
        y%q(c, k) = sin(1.7_wp*k + 2.3_wp*c)
        y%theta(c, k) = cos(2.9_wp*k + 1.1_wp*c)/largest
      end do
    end do
    y%u = 0.0_wp
    y%phi = 0.0_wp
    where (spread(self%light, 1, 3) <= 0.0_wp)
      y%q = 0.0_wp
      y%theta = 0.0_wp
    end where
  end subroutine start

  !> r = K y; hats and ghosts of y are put where free grains and edge want them.
  subroutine stiffness_times(self, o, y, r)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: y
    type(motion_type), intent(inout) :: r
    real(wp), dimension(3, o%op%ghosts) :: d, turn
    real(wp), dimension(3, o%op%free) :: force, moment

    call o%op%to_prescribed(y%q(:, o%sets%free), y%theta(:, o%sets%free), y%u, y%phi)
    call o%op%to_ghosts(y%u, y%phi, d, turn)
    y%q(:, o%sets%ghost) = d
    y%theta(:, o%sets%ghost) = turn
    r = y
    r%q = 0.0_wp
    r%theta = 0.0_wp
    call add_contacts(self%partition, y, r)
    if (o%op%micro%active) then
      call add_micro_elements(self, o, y, r)
    else
      call add_elements(self, o, y, r)
    end if
    d = r%q(:, o%sets%ghost)
    turn = r%theta(:, o%sets%ghost)
    call o%op%pull(d, turn, r%u, r%phi, force, moment)
    r%q(:, o%sets%free) = r%q(:, o%sets%free) + force
    r%theta(:, o%sets%free) = r%theta(:, o%sets%free) + moment
    r%u(:, :o%op%prescribed) = 0.0_wp
    r%phi(:, :o%op%prescribed_phi) = 0.0_wp
    where (o%own%held) r%u = 0.0_wp
    where (o%own%held_phi) r%phi = 0.0_wp
    where (spread(self%light, 1, 3) <= 0.0_wp)
      r%q = 0.0_wp
      r%theta = 0.0_wp
    end where
  end subroutine stiffness_times

  !> Springs between the contact points of both grains.
  pure subroutine add_contacts(p, y, r)
    type(partition_type), intent(in) :: p
    type(motion_type), intent(in) :: y
    type(motion_type), intent(inout) :: r
    real(wp) :: jump(3), f(3)
    integer(i4) :: c, a, b
    do c = 1, size(p%pair, 2)
      a = p%pair(1, c)
      b = p%pair(2, c)
      jump = y%q(:, b) + cross(y%theta(:, b), p%arm(:, 2, c)) &
             - y%q(:, a) - cross(y%theta(:, a), p%arm(:, 1, c))
      f = p%stiffness(2, c)*jump + (p%stiffness(1, c) - p%stiffness(2, c)) &
          *dot_product(jump, p%normal(:, c))*p%normal(:, c)
      r%q(:, a) = r%q(:, a) - f
      r%q(:, b) = r%q(:, b) + f
      r%theta(:, a) = r%theta(:, a) - cross(p%arm(:, 1, c), f)
      r%theta(:, b) = r%theta(:, b) + cross(p%arm(:, 2, c), f)
    end do
  end subroutine add_contacts

  !> Inner forces of the elements with prescribed nodes; r%u and r%phi are overwritten.
  subroutine add_elements(self, o, y, r)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y
    type(motion_type), intent(inout) :: r
    real(wp) :: u(3, o%cells%nodes), phi(3, o%cells%nodes), strain(9, 2)
    real(wp), allocatable :: row(:, :, :)
    integer(i4) :: k, e

    associate (p => self%partition)
      u = 0.0_wp
      phi = 0.0_wp
      u(:, o%op%node) = y%u
      phi(:, o%op%node_phi) = y%phi
      allocate (row(3, 1, p%blocks()), source=0.0_wp)
      do k = 1, size(self%point)
        e = p%element(self%point(k))
        strain = strains(p, self%point(k), u, phi)
        call add_point(p, self%point(k), self%factor(k), &
                       reshape(matmul(p%moduli(:, :, e), strain(:, 1)), [9, 1]), row, &
                       reshape(matmul(self%bending(:, :, e), strain(:, 2)), [9, 1]))
      end do
      r%u = row(:, 1, o%op%node)
      if (p%polar) r%phi = row(:, 1, p%nodes + o%op%node_phi)
    end associate
  end subroutine add_elements

  !> The same of micromorphic elements, by the tangent of their laws at rest.
  subroutine add_micro_elements(self, o, y, r)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y
    type(motion_type), intent(inout) :: r
    real(wp), dimension(3, o%cells%nodes) :: u, f
    real(wp), dimension(3, parts, o%cells%nodes) :: phi, c
    real(wp) :: g(motions)
    integer(i4) :: k, q, b

    u = 0.0_wp
    phi = 0.0_wp
    f = 0.0_wp
    c = 0.0_wp
    u(:, o%op%node) = y%u
    do b = 1, o%op%nodes_phi
      phi(:, mod(b - 1, parts) + 1, o%op%node_phi(b)) = y%phi(:, b)
    end do
    associate (p => self%partition)
      do k = 1, size(self%point)
        q = self%point(k)
        g = motion_gradient(p, q, u, phi)
        g = self%factor(k)*matmul(self%tangent(:, :, self%law(p%element(q))), g)
        call spread_forces(p, q, g, f, c)
      end do
    end associate
    r%u = f(:, o%op%node)
    do b = 1, o%op%nodes_phi
      r%phi(:, b) = c(:, mod(b - 1, parts) + 1, o%op%node_phi(b))
    end do
  end subroutine add_micro_elements

  !> u_i,I, phi_iK, phi_iK,L of a point, the first index running fastest.
  pure function motion_gradient(p, q, u, phi) result(g)
    type(partition_type), intent(in) :: p
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: u(:, :), phi(:, :, :)
    real(wp) :: g(motions)
    integer(i4) :: a, k
    g = 0.0_wp
    do a = 1, size(p%node_u, 1)
      associate (node => p%node_u(a, p%element(q)))
        if (node == 0) cycle
        do k = 1, 3
          g(3*k - 2:3*k) = g(3*k - 2:3*k) + p%slope_u(k, a, q)*u(:, node)
        end do
      end associate
    end do
    do a = 1, size(p%node_phi, 1)
      associate (node => p%node_phi(a, p%element(q)))
        if (node == 0) cycle
        g(10:18) = g(10:18) + p%value_phi(a, q)*reshape(phi(:, :, node), [9])
        do k = 1, 3
          g(9*k + 10:9*k + 18) = g(9*k + 10:9*k + 18) &
            + p%slope_phi(k, a, q)*reshape(phi(:, :, node), [9])
        end do
      end associate
    end do
  end function motion_gradient

  !> Add what the forces g of a point put on its nodes.
  pure subroutine spread_forces(p, q, g, f, c)
    type(partition_type), intent(in) :: p
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: g(motions)
    real(wp), intent(inout) :: f(:, :), c(:, :, :)
    integer(i4) :: a, k
    do a = 1, size(p%node_u, 1)
      associate (node => p%node_u(a, p%element(q)))
        if (node == 0) cycle
        do k = 1, 3
          f(:, node) = f(:, node) + p%slope_u(k, a, q)*g(3*k - 2:3*k)
        end do
      end associate
    end do
    do a = 1, size(p%node_phi, 1)
      associate (node => p%node_phi(a, p%element(q)))
        if (node == 0) cycle
        c(:, :, node) = c(:, :, node) + p%value_phi(a, q)*reshape(g(10:18), [3, 3])
        do k = 1, 3
          c(:, :, node) = c(:, :, node) + p%slope_phi(k, a, q) &
            *reshape(g(9*k + 10:9*k + 18), [3, 3])
        end do
      end associate
    end do
  end subroutine spread_forces

  !> Strain u_l,k - e_klm phi_m and curvature phi_l,k of a point, in the order kl = 11 12 13 21 ...
  pure function strains(p, q, u, phi) result(strain)
    type(partition_type), intent(in) :: p
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: u(:, :), phi(:, :)
    real(wp) :: strain(9, 2), e(3, 3), c(3, 3), turn(3), swell
    integer(i4) :: a, k, at

    at = p%element(q)
    e = 0.0_wp
    c = 0.0_wp
    swell = 0.0_wp
    do a = 1, size(p%node_u, 1)
      associate (node => p%node_u(a, at), g => p%slope_u(:, a, q))
        if (node == 0) cycle
        do k = 1, 3
          e(:, k) = e(:, k) + g(k)*u(:, node)
        end do
        swell = swell + dot_product(p%slope_mean(:, a, q) - g, u(:, node))/3.0_wp
      end associate
    end do
    do k = 1, 3
      e(k, k) = e(k, k) + swell
    end do
    turn = 0.0_wp
    do a = 1, size(p%node_phi, 1)
      associate (node => p%node_phi(a, at))
        if (node == 0) cycle
        turn = turn + p%value_phi(a, q)*phi(:, node)
        do k = 1, 3
          c(:, k) = c(:, k) + p%slope_phi(k, a, q)*phi(:, node)
        end do
      end associate
    end do
    e(2, 1) = e(2, 1) - turn(3)
    e(1, 2) = e(1, 2) + turn(3)
    e(3, 2) = e(3, 2) - turn(1)
    e(2, 3) = e(2, 3) + turn(1)
    e(1, 3) = e(1, 3) - turn(2)
    e(3, 1) = e(3, 1) + turn(2)
    strain(:, 1) = reshape(e, [9])
    strain(:, 2) = reshape(c, [9])
  end function strains

  !> Accelerations in place of forces.
  subroutine accelerate(self, o, r)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: r
    real(wp) :: f(3, o%op%free), load(3, o%op%prescribed), load_phi(3, o%op%prescribed_phi)
    integer(i4) :: a

    if (o%own%carried%active) then
      f = r%q(:, o%sets%free)
      call o%own%carried%resist(f, load)
      call o%op%p%transposed(load, f)
      r%q(:, o%sets%free) = f
    end if
    if (o%own%carried_phi%active) then
      f = r%theta(:, o%sets%free)
      call o%own%carried_phi%resist(f, load_phi)
      call o%op%p_phi%transposed(load_phi, f)
      r%theta(:, o%sets%free) = f
    end if
    r%q = r%q*spread(self%light, 1, 3)
    r%theta = r%theta*spread(self%inverse_inertia, 1, 3)
    do a = o%op%prescribed + 1, o%op%nodes
      r%u(:, a) = r%u(:, a)/o%own%mass(a)
    end do
    do a = o%op%prescribed_phi + 1, o%op%nodes_phi
      r%phi(:, a) = r%phi(:, a)/o%own%inertia(a)
    end do
  end subroutine accelerate

  !> Work of forces on what moves by itself.
  pure real(wp) function work(self, o, y, r)
    class(coupled_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y, r
    associate (n => o%op%prescribed + 1, m => o%op%prescribed_phi + 1)
      work = sum(y%q*r%q) + sum(y%theta*r%theta) + sum(y%u(:, n:)*r%u(:, n:)) &
             + sum(y%phi(:, m:)*r%phi(:, m:))
    end associate
  end function work
end module cpl_coupled
