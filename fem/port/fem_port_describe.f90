!> What talus-fem reports at the port of its mesh, points, moduli and groups (DESCRIBE). Where ranks
!! have a part of the elements each, the leader reports those of all; all ranks call it together.
module fem_port_describe
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_connectivity, field_couple_stress, field_element, field_id, &
    field_kind, field_law, field_mass_phi, field_mass_u, field_mean, field_micro_stress, &
    field_micromorphic, field_moduli, field_names, field_node, field_plastic, field_polar, &
    field_start, field_stress, field_tangent, field_weight, field_x, what_facets, what_group, &
    what_groups, what_moduli, what_pore, what_quadrature
  use fem_types, only: fem_mesh_type, group_volume, group_facet, group_node
  use fem_body, only: fem_body_type
  use fem_elastic, only: classical
  use fem_law, only: at_plastic
  use fem_mesh, only: find_group, group_hint
  use fem_mm_motion, only: mm_motion_type, mm_force_type, elastic_tangent
  use fem_mm_report, only: uniform_limit
  use fem_port_pore, only: describe_wet
  use fem_port_stress, only: can_begin_elements
  use fem_recover, only: point_stress, point_positions, point_weights
  implicit none
  private
  public :: reply_describe

contains

  !> Lumped micro-inertia of every node, zero where there is no micro-rotation [kg m^2].
  pure function inertia_of_nodes(body) result(inertia)
    type(fem_body_type), intent(in) :: body
    real(wp) :: inertia(body%mesh%nodes)
    inertia = 0.0_wp
    inertia(body%dofs%node(body%mesh%nodes + 1:)) = body%system%lumped(body%mesh%nodes + 1:)
  end function inertia_of_nodes

  !> Mesh, facets, quadrature, groups, or the nodes of one group.
  subroutine reply_describe(body, what, group, reply, errors)
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: what, group
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: g

    select case (what)
    case ('mesh')
      call describe_nodes(body, reply)
      if (body%whole%ranks%several()) then
        call describe_elements(body%whole%mesh, reply)
      else
        call describe_elements(body%mesh, reply)
      end if
    case (what_facets)
      g = find_group(body%mesh, group, [group_facet])
      if (g == 0) then
        call no_group('facet group', group, group_hint(body%mesh, group, [group_facet]), errors)
        return
      end if
      call reply%put_int(field_connectivity, body%mesh%group(g)%facet)
      call reply%put_int(field_kind, body%mesh%group(g)%facet_kind)
    case (what_quadrature)
      call describe_points(body, reply)
    case (what_moduli)
      call describe_moduli(body, reply)
    case (what_pore)
      call describe_wet(body, reply, errors)
    case (what_groups)
      call reply%put_text(field_names, lines(body%mesh))
    case (what_group)
      g = find_group(body%mesh, group, [group_node, group_facet, group_volume])
      if (g == 0) then
        call no_group('group', group, group_hint(body%mesh, group, &
          [group_volume, group_facet, group_node]), errors)
        return
      end if
      call reply%put_int(field_id, body%mesh%group(g)%node)
      if (body%mesh%group(g)%kind /= group_volume) return
      if (body%whole%ranks%several()) then
        call put_elements(body%whole%mesh, g, reply)
      else
        call put_elements(body%mesh, g, reply)
      end if
    case default
      call errors%add('P301', "talus-fem cannot describe '"//what//"'", '', &
                      'choices: mesh, facets, quadrature, moduli, pore, groups and group')
    end select
  end subroutine reply_describe

  subroutine describe_nodes(body, reply)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    integer(i4) :: k
    call reply%put_int(field_id, [(k, k=1, body%mesh%nodes)])
    call reply%put(field_x, body%mesh%x)
    call reply%put(field_mass_u, body%system%lumped(:body%mesh%nodes))
    if (body%dofs%blocks == body%mesh%nodes) return
    call reply%put(field_mass_phi, inertia_of_nodes(body))
    call reply%put_int(second_field(body), merge(1_i4, 0_i4, body%dofs%phi > 0))
  end subroutine describe_nodes

  !> Elements of a mesh; ranks that do not lead have no whole one.
  subroutine describe_elements(mesh, reply)
    type(fem_mesh_type), intent(in) :: mesh
    type(message_type), intent(inout) :: reply
    if (.not. allocated(mesh%kind)) return
    if (allocated(mesh%hex8)) call reply%put_int(field_connectivity, mesh%hex8)
    call reply%put_int(field_kind, mesh%kind)
    call reply%put_int(field_start, mesh%start)
    call reply%put_int(field_node, mesh%node)
  end subroutine describe_elements

  !> Elements of group g.
  subroutine put_elements(mesh, g, reply)
    type(fem_mesh_type), intent(in) :: mesh
    integer(i4), intent(in) :: g
    type(message_type), intent(inout) :: reply
    if (allocated(mesh%group)) call reply%put_int(field_element, mesh%group(g)%element)
  end subroutine put_elements

  !> Moduli of all elements, and whether each has the mean of its volumetric strain.
  subroutine describe_moduli(body, reply)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: rows(:, :)  !! (6 moduli, the mark and the law, elements)
    allocate (rows(8, body%mesh%elements), source=0.0_wp)
    if (.not. body%matter%micro%active) rows(:6, :) = body%elastic%moduli
    if (body%matter%micro%active) rows(8, :) = body%matter%micro%law_of
    associate (rule => body%elastic%rule(body%elastic%rule_of))
      rows(7, :) = merge(1.0_wp, 0.0_wp, rule%bbar .and. .not. rule%linear_volume)
    end associate
    call body%whole%collect_cells(rows)
    if (body%matter%micro%active) then
      call describe_micro_laws(body, nint(rows(8, :), i4), reply)
    else
      call reply%put(field_moduli, rows(:6, :))
    end if
    call reply%put_int(field_mean, nint(rows(7, :), i4))
  end subroutine describe_moduli

  !> Name of the marks of nodes that have the second field.
  pure function second_field(body) result(name)
    type(fem_body_type), intent(in) :: body
    character(len=:), allocatable :: name
    name = field_polar
    if (body%matter%micro%active) name = field_micromorphic
  end function second_field

  !> Moduli of the micropolar solid that is as stiff in uniform strain, and the tangent (45, 45) of
  !! the law at rest, column by column.
  subroutine describe_micro_laws(body, law_of, reply)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: law_of(:)  !! (all elements), the leader's
    type(message_type), intent(inout) :: reply
    type(mm_motion_type) :: none
    type(mm_force_type) :: force
    real(wp) :: moduli(6, size(body%matter%micro%law)), tangent(45, 45)
    real(wp) :: packed(45*45, size(body%matter%micro%law))
    integer(i4) :: m
    do m = 1, size(body%matter%micro%law)
      associate (law => body%matter%micro%law(m)%elastic)
        moduli(:, m) = uniform_limit(law)
        call elastic_tangent(law, none, force, tangent)
      end associate
      packed(:, m) = reshape(tangent, [45*45])
    end do
    call reply%put(field_moduli, moduli(:, max(1, law_of)))
    call reply%put(field_tangent, packed)
    call reply%put_int(field_law, law_of)
  end subroutine describe_micro_laws

  subroutine no_group(what, name, hint, errors)
    character(len=*), intent(in) :: what, name, hint
    type(error_list_type), intent(inout) :: errors
    call errors%add('D301', 'the mesh has no '//what//" '"//name//"'", '', hint)
  end subroutine no_group

  !> Names of all groups with a line each.
  pure function lines(mesh) result(text)
    type(fem_mesh_type), intent(in) :: mesh
    character(len=:), allocatable :: text
    integer(i4) :: g
    text = ''
    do g = 1, size(mesh%group)
      if (g > 1) text = text//new_line('a')
      text = text//trim(mesh%group(g)%name)
    end do
  end function lines

  !> Places, weights and stresses of the points of all ranks' elements.
  subroutine describe_points(body, reply)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: x(:, :), weight(:, :), stress(:, :)
    integer(i4) :: n
    n = body%elastic%points
    allocate (x(3, n), weight(1, n), stress(body%elastic%components, n))
    call point_positions(body%mesh, body%dofs, body%elastic, x)
    call point_weights(body%mesh, body%dofs, body%elastic, weight(1, :))
    if (body%matter%active) then
      stress = body%matter%stress
    else
      call point_stress(body%mesh, body%dofs, body%elastic, body%state%u, stress)
    end if
    call body%whole%collect_points(x)
    call body%whole%collect_points(weight)
    call body%whole%collect_points(stress)
    if (can_begin_elements(body)) call describe_plastic(body, reply)
    call reply%put(field_x, x)
    call reply%put(field_weight, weight(1, :))
    if (body%elastic%components == classical) then
      call reply%put(field_stress, stress)
    else if (body%matter%micro%active) then
      call reply%put(field_stress, stress(:9, :))
      call reply%put(field_micro_stress, stress(10:18, :))
      call reply%put(field_couple_stress, stress(19:, :))
    else
      call reply%put(field_stress, stress(:9, :))
      call reply%put(field_couple_stress, stress(10:, :))
    end if
    if (body%whole%ranks%several()) then
      call reply%put_int(field_element, elements_of(body%whole%point))
    else
      call reply%put_int(field_element, elements_of(body%elastic%point))
    end if
  end subroutine describe_points

  !> Equivalent plastic strain of all points, of laws with a state.
  subroutine describe_plastic(body, reply)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: plastic(:, :)
    integer(i4) :: k
    allocate (plastic(1, body%elastic%points))
    do k = 1, body%elastic%points
      plastic(1, k) = equivalent(body%matter%accepted_state(at_plastic:at_plastic + 5, k))
    end do
    call body%whole%collect_points(plastic)
    call reply%put(field_plastic, plastic(1, :))
  end subroutine describe_plastic

  !> Square root of 2/3 e:e, e the deviator of a strain with engineering shears.
  pure real(wp) function equivalent(strain)
    real(wp), intent(in) :: strain(6)
    equivalent = sqrt(2.0_wp/3.0_wp*(sum((strain(:3) - sum(strain(:3))/3.0_wp)**2) &
                                     + 0.5_wp*sum(strain(4:)**2)))
  end function equivalent

  !> Element of each point.
  pure function elements_of(first) result(element)
    integer(i4), intent(in) :: first(:)  !! point of each element, and behind the last
    integer(i4) :: element(first(size(first)) - 1)
    integer(i4) :: e
    do e = 1, size(first) - 1
      element(first(e):first(e + 1) - 1) = e
    end do
  end function elements_of
end module fem_port_describe
