!> The overlap of a coupled run as the energy partition wants it (cpl_partition): grains and ghosts'
!! shape functions from the sets, contacts, quadrature points and moduli from what both solvers
!! describe. Only elements that share a node with an element of ghosts are taken, or, for the start,
!! all but those of free grains.
module cpl_overlap_partition
  use talus_kinds, only: wp, i4, i8
  use cpl_cells, only: cells_type
  use cpl_choices, only: rotation_curl, rotation_micro
  use cpl_elements, only: most_nodes, corner_count, corner_kind, locate
  use cpl_order, only: sort_order
  use cpl_overlap, only: overlap_type
  use cpl_partition, only: partition_type, grain_free, grain_ghost, grain_other, region_free, &
    region_ghost, region_rest, turn_none, turn_curl, turn_micro
  use cpl_sets, only: part_ghost, part_free, part_none
  implicit none
  private
  public :: contacts_type, points_type, fill_partition, elastic_tensor, rows_of_contacts, &
    rows_of_ids

  !> Contacts as talus-dem describes them.
  type :: contacts_type
    integer(i8), allocatable :: ids(:, :)        !! (2, n); below 1: no grain
    real(wp), allocatable :: point(:, :)         !! (3, n) [m]
    real(wp), allocatable :: normal(:, :)        !! (3, n)
    real(wp), allocatable :: stiffness(:, :)     !! (2, n) [N/m]
    real(wp), allocatable :: force(:, :)         !! (3, n) on the first grain [N]
  end type contacts_type

  !> Quadrature points and laws as talus-fem describes them.
  type :: points_type
    real(wp), allocatable :: x(:, :)             !! (3, n) [m]
    real(wp), allocatable :: weight(:)           !! (n) times Jacobian [m^3]
    integer(i4), allocatable :: element(:)       !! (n)
    real(wp), allocatable :: moduli(:, :)        !! (6, elements) lambda mu kappa [Pa], ...
    integer(i4), allocatable :: mean(:)          !! (elements) 1: mean volume change (B-bar)
    real(wp), allocatable :: tangent(:, :)       !! micromorphic: (45 x 45, laws) at rest
    integer(i4), allocatable :: law(:)           !! micromorphic: (elements)
  end type points_type

contains

  !> Fill a partition; row(k) is the contact behind its k-th contact, at(k) the point behind its
  !! k-th point.
  subroutine fill_partition(o, contacts, points, partition, row, at, whole)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(partition_type), intent(out) :: partition
    integer(i4), allocatable, intent(out) :: row(:), at(:)
    logical, intent(in), optional :: whole  !! all elements but those of free grains
    integer(i4), allocatable :: taken(:), number(:)
    logical :: all

    partition%nodes = o%cells%nodes
    partition%polar = any(o%cells%polar)
    partition%turning = turn_none
    if (o%op%rotation == rotation_curl) partition%turning = turn_curl
    if (o%op%rotation == rotation_micro) partition%turning = turn_micro
    all = .false.
    if (present(whole)) all = whole
    call take_elements(o, all, taken, number)
    call fill_elements(o%cells, o%sets%part, points, taken, partition)
    call fill_grains(o, number, partition)
    call fill_contacts(o, contacts, partition, row)
    call fill_points(o, points, taken, number, partition, at)
    call find_surface(o, taken, partition)
  end subroutine fill_partition

  !> Nodes on the surface: the integral of their function's slope, that of N n over the surface, is
  !! not zero there. Nodes of ghosts' elements have all their elements here; others do not count.
  subroutine find_surface(o, taken, partition)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(in) :: taken(:)
    type(partition_type), intent(inout) :: partition
    real(wp), parameter :: small = 1.0e-9_wp
    real(wp), allocatable :: slope(:, :), size_of(:)
    integer(i4) :: q, a, k
    allocate (slope(3, partition%nodes), size_of(partition%nodes), source=0.0_wp)
    do q = 1, size(partition%element)
      do a = 1, size(partition%node_u, 1)
        k = partition%node_u(a, partition%element(q))
        if (k == 0) cycle
        slope(:, k) = slope(:, k) + partition%volume(q)*partition%slope_u(:, a, q)
        size_of(k) = size_of(k) + partition%volume(q)*norm2(partition%slope_u(:, a, q))
      end do
    end do
    partition%outer = norm2(slope, 1) > small*size_of
    do k = 1, size(taken)
      if (o%sets%part(taken(k)) == part_ghost) size_of(o%cells%nodes_of(taken(k))) = -1.0_wp
    end do
    where (size_of >= 0.0_wp) partition%outer = .true.
  end subroutine find_surface

  !> Elements that share a node with those of ghosts, or all but those of free grains; number:
  !! their rows, 0 for others.
  subroutine take_elements(o, all, taken, number)
    type(overlap_type), intent(in) :: o
    logical, intent(in) :: all
    integer(i4), allocatable, intent(out) :: taken(:), number(:)
    logical, allocatable :: touched(:), near(:)
    integer(i4) :: e, k

    allocate (touched(o%cells%nodes), near(o%cells%elements), source=.false.)
    do e = 1, o%cells%elements
      if (o%sets%part(e) == part_ghost) touched(o%cells%nodes_of(e)) = .true.
    end do
    do e = 1, o%cells%elements
      near(e) = any(touched(o%cells%nodes_of(e)))
      if (all) near(e) = o%sets%part(e) /= part_free .and. o%sets%part(e) /= part_none
    end do
    taken = pack([(k, k=1, o%cells%elements)], near)
    allocate (number(o%cells%elements), source=0_i4)
    do k = 1, size(taken)
      number(taken(k)) = k
    end do
  end subroutine take_elements

  !> Nodes, regions and moduli.
  subroutine fill_elements(cells, part, points, taken, partition)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:), taken(:)
    type(points_type), intent(in) :: points
    type(partition_type), intent(inout) :: partition
    integer(i4) :: k, n, m, n_most, m_most

    n_most = maxval(cells%start(taken + 1) - cells%start(taken))
    m_most = merge(n_most, 0_i4, partition%polar)
    allocate (partition%node_u(n_most, size(taken)), partition%node_phi(m_most, size(taken)), &
              source=0_i4)
    allocate (partition%region(size(taken)), source=region_rest)
    allocate (partition%moduli(9, 9, size(taken)))
    do k = 1, size(taken)
      associate (e => taken(k), node => cells%node(cells%start(taken(k)):cells%start(taken(k) &
                                                                                   + 1) - 1))
        n = size(node)
        partition%node_u(:n, k) = node
        m = turning_nodes(cells, e)
        partition%node_phi(:min(m, m_most), k) = node(:min(m, m_most))
        if (part(e) == part_free) partition%region(k) = region_free
        if (part(e) == part_ghost) partition%region(k) = region_ghost
        partition%moduli(:, :, k) = elastic_tensor(points%moduli(:3, e))
      end associate
    end do
  end subroutine fill_elements

  !> Nodes of an element, the first ones, that carry its micro-rotation.
  pure integer(i4) function turning_nodes(cells, e)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: e
    turning_nodes = 0
    associate (polar => cells%polar(cells%node(cells%start(e):cells%start(e + 1) - 1)))
      if (all(polar)) then
        turning_nodes = size(polar)
      else if (all(polar(:corner_count(cells%kind(e))))) then
        turning_nodes = corner_count(cells%kind(e))
      end if
    end associate
  end function turning_nodes

  !> C_ijkl = lambda d_ij d_kl + (mu + kappa) d_ik d_jl + mu d_il d_jk, rows and columns 11 12 13
  !! 21 22 23 31 32 33 [Pa].
  pure function elastic_tensor(moduli) result(c)
    real(wp), intent(in) :: moduli(3)  !! lambda, mu, kappa [Pa]
    real(wp) :: c(9, 9)
    integer(i4) :: i, j
    c = 0.0_wp
    do i = 1, 3
      do j = 1, 3
        c(4*i - 3, 4*j - 3) = c(4*i - 3, 4*j - 3) + moduli(1)
        c(3*i + j - 3, 3*i + j - 3) = c(3*i + j - 3, 3*i + j - 3) + moduli(2) + moduli(3)
        c(3*i + j - 3, 3*j + i - 3) = c(3*i + j - 3, 3*j + i - 3) + moduli(2)
      end do
    end do
  end function elastic_tensor

  !> Kinds, elements, depths and shape functions of the grains, in the rows of the pack.
  subroutine fill_grains(o, number, partition)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(in) :: number(:)
    type(partition_type), intent(inout) :: partition
    integer(i4) :: n, g, k, u, phi

    n = size(o%pack%id)
    u = size(partition%node_u, 1)
    phi = size(partition%node_phi, 1)
    allocate (partition%kind(n), source=grain_other)
    allocate (partition%cell(n), source=0_i4)
    allocate (partition%depth(n), partition%shape_u(u, n), partition%shape_phi(phi, n), &
              partition%shape_slope(3, u, n), source=0.0_wp)
    partition%kind(o%sets%free) = grain_free
    partition%kind(o%sets%outside) = grain_free
    do k = 1, size(o%sets%ghost)
      g = o%sets%ghost(k)
      associate (spot => o%sets%ghost_spot(k))
        partition%kind(g) = grain_ghost
        partition%cell(g) = number(spot%element)
        partition%depth(g) = o%sets%hull%distance(o%map%x_ghost(:, k))
        partition%shape_u(:, g) = spot%weight(:u)
        partition%shape_phi(:min(phi, spot%n_phi), g) = spot%weight_phi(:min(phi, spot%n_phi))
        partition%shape_slope(:, :, g) = spot%gradient(:, :u)
        partition%shape_u(spot%n + 1:, g) = 0.0_wp
      end associate
    end do
  end subroutine fill_grains

  !> Contacts between two grains of the pack.
  subroutine fill_contacts(o, contacts, partition, row)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(partition_type), intent(inout) :: partition
    integer(i4), allocatable, intent(out) :: row(:)
    integer(i4), allocatable :: pair(:, :)
    integer(i4) :: c, k

    call rows_of_contacts(o, contacts, pair)
    row = pack([(c, c=1, size(pair, 2))], all(pair > 0, 1))
    partition%pair = pair(:, row)
    partition%normal = contacts%normal(:, row)
    partition%stiffness = contacts%stiffness(:, row)
    allocate (partition%arm(3, 2, size(row)))
    do c = 1, size(row)
      do k = 1, 2
        partition%arm(:, k, c) = contacts%point(:, row(c)) - o%pack%x(:, partition%pair(k, c))
      end do
    end do
  end subroutine fill_contacts

  !> Rows in the pack of both grains of each contact, 0 for what is no grain.
  subroutine rows_of_contacts(o, contacts, pair)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    integer(i4), allocatable, intent(out) :: pair(:, :)
    call rows_of_ids(o%pack%id, contacts%ids, pair)
  end subroutine rows_of_contacts

  !> Rows in a list of both ids of each pair, 0 for what it does not have.
  subroutine rows_of_ids(id, ids, pair)
    integer(i8), intent(in) :: id(:), ids(:, :)         !! (grains), (2, pairs)
    integer(i4), allocatable, intent(out) :: pair(:, :)  !! (2, pairs)
    integer(i4), allocatable :: order(:)
    integer(i4) :: c, k
    allocate (order(size(id)), pair(2, size(ids, 2)))
    call sort_order(real(id, wp), order)
    do c = 1, size(pair, 2)
      do k = 1, 2
        pair(k, c) = row_of(id, order, ids(k, c))
      end do
    end do
  end subroutine rows_of_ids

  !> Row of an id, 0 if there is none.
  pure integer(i4) function row_of(id, order, wanted)
    integer(i8), intent(in) :: id(:), wanted
    integer(i4), intent(in) :: order(:)
    integer(i4) :: low, high, middle
    low = 1
    high = size(id)
    row_of = 0
    do while (low <= high)
      middle = (low + high)/2
      if (id(order(middle)) == wanted) then
        row_of = order(middle)
        return
      else if (id(order(middle)) < wanted) then
        low = middle + 1
      else
        high = middle - 1
      end if
    end do
  end function row_of

  !> Points of the elements taken, with shape functions and slopes.
  subroutine fill_points(o, points, taken, number, partition, at)
    type(overlap_type), intent(in) :: o
    type(points_type), intent(in) :: points
    integer(i4), intent(in) :: taken(:), number(:)
    type(partition_type), intent(inout) :: partition
    integer(i4), allocatable, intent(out) :: at(:)
    real(wp) :: xi(3), n(most_nodes), slope(3, most_nodes), whole(size(taken))
    real(wp), allocatable :: mean(:, :, :)
    integer(i4) :: q, k, e, u, m
    logical :: found

    at = pack([(q, q=1, size(points%element))], number(points%element) > 0)
    u = size(partition%node_u, 1)
    partition%element = number(points%element(at))
    partition%volume = points%weight(at)
    allocate (partition%point_depth(size(at)), source=0.0_wp)
    allocate (partition%slope_u(3, u, size(at)), mean(3, u, size(taken)), source=0.0_wp)
    m = size(partition%node_phi, 1)
    allocate (partition%value_phi(m, size(at)), partition%slope_phi(3, m, size(at)), &
              source=0.0_wp)
    whole = 0.0_wp
    do q = 1, size(at)
      k = partition%element(q)
      e = taken(k)
      associate (x => points%x(:, at(q)), node => o%cells%nodes_of(e))
        if (partition%region(k) == region_ghost) &
          partition%point_depth(q) = o%sets%hull%distance(x)
        call locate(o%cells%kind(e), o%cells%x(:, node), x, xi, n, slope, found)
        partition%slope_u(:, :size(node), q) = slope(:, :size(node))
        mean(:, :, k) = mean(:, :, k) + partition%volume(q)*partition%slope_u(:, :, q)
        whole(k) = whole(k) + partition%volume(q)
        m = min(size(partition%node_phi, 1), turning_nodes(o%cells, e))
        if (m == 0) cycle
        if (m < size(node)) call locate(corner_kind(o%cells%kind(e)), o%cells%x(:, node(:m)), x, &
                                        xi, n, slope, found)
        partition%value_phi(:m, q) = n(:m)
        partition%slope_phi(:, :m, q) = slope(:, :m)
      end associate
    end do
    partition%slope_mean = partition%slope_u
    do q = 1, size(at)
      k = partition%element(q)
      if (points%mean(taken(k)) == 1) partition%slope_mean(:, :, q) = mean(:, :, k)/whole(k)
    end do
  end subroutine fill_points
end module cpl_overlap_partition
