!> Tractions, point loads and ground springs of the deck.
module fem_setup_loads
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_curve, only: curve_index
  use fem_types, only: fem_load_type, fem_mesh_type, group_facet, group_volume
  use fem_assembly, only: body_force
  use fem_mesh, only: find_group, group_hint
  use fem_follower, only: fem_follower_type
  use fem_facets, only: facet_point, locate_on_facet
  use fem_kinds, only: most_facet_nodes
  use fem_loads, only: traction_force, pressure_force, couple_force, facet_springs
  use fem_topology, only: facet_nodes, facet_total
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: read_tractions, read_couples, read_point_loads, read_springs, read_body_loads

  real(wp), parameter :: on_facet = 1.0e-6_wp  !! distance / facet size that counts as on it

contains

  !> Tractions and pressures on facets.
  subroutine read_tractions(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:), slope(:), origin(:)
    real(wp) :: pressure, matrix(3, 3)
    type(fem_load_type) :: load
    integer(i4) :: s, g
    logical :: follows

    allocate (body%loads%load(0))
    do s = 1, deck%count('traction')
      call facet_group(deck, body, 'traction', s, 'group', g, errors)
      call curve_index(deck, 'D303', body%loads%curve, 'traction', s, load%curve, errors)
      if (g == 0) cycle
      call deck%get('traction', s, 'value', value)
      call deck%get('traction', s, 'gradient', slope)
      call deck%get('traction', s, 'origin', origin)
      matrix = transpose(reshape(slope, [3, 3]))
      load%force = 0.0_wp*body%state%u
      call traction_force(body%mesh, body%mesh%group(g), value - matmul(matrix, origin), matrix, &
        load%force)
      call body%dofs%halo%sum_up(load%force)
      call body%loads%append(load)
    end do
    do s = 1, deck%count('pressure')
      call facet_group(deck, body, 'pressure', s, 'group', g, errors)
      call curve_index(deck, 'D303', body%loads%curve, 'pressure', s, load%curve, errors)
      if (g == 0) cycle
      call deck%get('pressure', s, 'value', pressure)
      call deck%get('pressure', s, 'gradient', slope)
      call deck%get('pressure', s, 'origin', origin)
      pressure = pressure - dot_product(slope, origin)
      call deck%get('pressure', s, 'follower', follows)
      if (follows) then
        call append_follower(body, fem_follower_type(g, load%curve, pressure, slope))
        cycle
      end if
      load%force = 0.0_wp*body%state%u
      call pressure_force(body%mesh, body%mesh%group(g), pressure, slope, load%force)
      call body%dofs%halo%sum_up(load%force)
      call body%loads%append(load)
    end do
  end subroutine read_tractions

  !> Couples per area; fault D323 where a facet has no micro-rotation.
  subroutine read_couples(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:)
    type(fem_load_type) :: load
    integer(i4) :: s, g, n

    do s = 1, deck%count('couple')
      call facet_group(deck, body, 'couple', s, 'group', g, errors)
      call curve_index(deck, 'D303', body%loads%curve, 'couple', s, load%curve, errors)
      if (g == 0) cycle
      call deck%get('couple', s, 'value', value)
      load%force = 0.0_wp*body%state%u
      call couple_force(body%mesh, body%mesh%group(g), turning(body), value, load%force, n)
      if (n > 0) then
        call deck%get('couple', s, 'group', name)
        call deck%fault(errors, 'D323', "node "//str(n)//" of '"//name// &
          "' has no micro-rotation", 'couple', s, 'group', &
          "couples act on sections of a material with law = 'micropolar'")
      end if
      call body%loads%append(load)
    end do
  end subroutine read_couples

  !> Blocks of the micro-rotation at the nodes, 0 where there are none.
  pure function turning(body) result(phi)
    type(fem_body_type), intent(in) :: body
    integer(i4) :: phi(body%mesh%nodes)
    phi = merge(body%dofs%phi, 0, body%dofs%parts == 1)
  end function turning

  !> Forces and couples per volume; fault D323 for couples on classical elements.
  subroutine read_body_loads(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: force(:), couple(:)
    type(fem_load_type) :: load
    integer(i4) :: s, g

    do s = 1, deck%count('body_load')
      call deck%get('body_load', s, 'group', name)
      g = find_group(body%mesh, name, [group_volume])
      if (g == 0) call deck%fault(errors, 'D301', "the mesh has no volume group '"//name//"'", &
        'body_load', s, 'group', group_hint(body%mesh, name, [group_volume]))
      call curve_index(deck, 'D303', body%loads%curve, 'body_load', s, load%curve, errors)
      if (g == 0) cycle
      call deck%get('body_load', s, 'force', force)
      call deck%get('body_load', s, 'couple', couple)
      associate (element => body%mesh%group(g)%element)
        if (any(abs(couple) > 0.0_wp) .and. &
            .not. all(body%elastic%rule(body%elastic%rule_of(element))%polar .and. &
                      body%dofs%parts == 1)) then
          call deck%fault(errors, 'D323', "elements of '"//name//"' have no couples", 'body_load', &
            s, 'couple', "couples act on sections of a material with law = 'micropolar'")
          cycle
        end if
        load%force = 0.0_wp*body%state%u
        call body_force(body%mesh, body%dofs, body%elastic, element, force, couple, load%force)
        call body%dofs%halo%sum_up(load%force)
      end associate
      call body%loads%append(load)
    end do
  end subroutine read_body_loads

  subroutine read_point_loads(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: force(:), couple(:)
    type(fem_load_type) :: load
    integer(i4) :: s, node, before, total

    do s = 1, deck%count('point_load')
      call deck%get('point_load', s, 'node', node)
      call deck%get('point_load', s, 'force', force)
      call deck%get('point_load', s, 'couple', couple)
      call curve_index(deck, 'D303', body%loads%curve, 'point_load', s, load%curve, errors)
      load%force = 0.0_wp*body%state%u
      before = errors%count
      total = body%mesh%total_nodes()
      if (node > total) then
        call deck%fault(errors, 'D307', 'there is no node '//str(node)//', the mesh has '// &
                        str(total), 'point_load', s, 'node', 'node ids count from 1')
      else if (node > 0) then
        node = body%mesh%place_of(node)  ! 0 where other ranks have it
        if (node > 0) load%force(:, node) = force
        if (node > 0 .and. any(abs(couple) > 0.0_wp)) &
          call couple_at_node(deck, body, s, node, couple, load%force, errors)
      else
        call at_position(deck, body, s, force, load%force, errors)
      end if
      if (errors%count == before) call body%loads%append(load)
    end do
  end subroutine read_point_loads

  subroutine couple_at_node(deck, body, s, node, couple, nodal, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: s, node
    real(wp), intent(in) :: couple(3)
    real(wp), intent(inout) :: nodal(:, :)
    type(error_list_type), intent(inout) :: errors
    if (body%dofs%phi(node) == 0 .or. body%dofs%parts > 1) then
      call deck%fault(errors, 'D323', 'node '//str(node)//' has no micro-rotation', 'point_load', &
        s, 'couple', "couples act at corner nodes of a material with law = 'micropolar'")
    else
      nodal(:, body%dofs%phi(node)) = couple
    end if
  end subroutine couple_at_node

  !> Share a force at a point of a facet group to the facet's nodes by its shape functions.
  subroutine at_position(deck, body, s, force, nodal, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: s
    real(wp), intent(in) :: force(3)
    real(wp), intent(inout) :: nodal(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: position(:)
    integer(i4), allocatable :: node(:)
    real(wp) :: n(most_facet_nodes), xi(2), area(3), off, best
    integer(i4) :: g, f, a, chosen

    call facet_group(deck, body, 'point_load', s, 'facets', g, errors)
    if (g == 0) return
    call deck%get('point_load', s, 'position', position)
    best = huge(best)
    chosen = 0
    do f = 1, facet_total(body%mesh%group(g))
      associate (kind => body%mesh%group(g)%facet_kind(f))
        call locate_on_facet(kind, body%mesh%x(:, facet_nodes(body%mesh%group(g), f)), position, &
                             xi, off)
      end associate
      if (off < best) then
        best = off
        chosen = f
      end if
    end do
    if (chosen == 0 .or. best > on_facet) then
      call deck%fault(errors, 'D307', 'the position lies on no facet of the group', &
        'point_load', s, &
                      'position', 'the nearest is off by '//str(best)//' facet sizes')
      return
    end if
    node = facet_nodes(body%mesh%group(g), chosen)
    associate (kind => body%mesh%group(g)%facet_kind(chosen))
      call locate_on_facet(kind, body%mesh%x(:, node), position, xi, off)
      call facet_point(kind, body%mesh%x(:, node), xi, n(:size(node)), area)
    end associate
    do a = 1, size(node)
      nodal(:, node(a)) = nodal(:, node(a)) + n(a)*force
    end do
  end subroutine at_position

  subroutine read_springs(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: normal, tangential
    integer(i4) :: s, g

    do s = 1, deck%count('spring')
      call facet_group(deck, body, 'spring', s, 'group', g, errors)
      if (g == 0) cycle
      call deck%get('spring', s, 'normal', normal)
      call deck%get('spring', s, 'tangential', tangential)
      call facet_springs(body%mesh, body%mesh%group(g), normal, tangential, body%supports%ground)
    end do
  end subroutine read_springs

  !> Index of the facet group that a key names; 0 with a fault if there is none.
  subroutine facet_group(deck, body, group, s, key, g, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: s
    integer(i4), intent(out) :: g
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    call deck%get(group, s, key, name)
    g = find_group(body%mesh, name, [group_facet])
    if (g == 0) call deck%fault(errors, 'D301', "the mesh has no facet group '"//name//"'", &
      group, s, &
                                key, group_hint(body%mesh, name, [group_facet]))
  end subroutine facet_group

  subroutine append_follower(body, follower)
    type(fem_body_type), intent(inout) :: body
    type(fem_follower_type), intent(in) :: follower
    if (.not. allocated(body%loads%follower)) allocate (body%loads%follower(0))
    body%loads%follower = [body%loads%follower, follower]
  end subroutine append_follower
end module fem_setup_loads
