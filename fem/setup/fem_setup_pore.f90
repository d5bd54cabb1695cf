!> The liquid in the pores from the deck: &fluid, &pore, &pore_pressure, &flux, &well, &submerged,
!! &water_table. Leaks: fem_setup_leaks.
module fem_setup_pore
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_curve, only: curve_index
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_pressures
  use fem_loads, only: pressure_force
  use fem_mesh, only: find_group, group_hint
  use fem_pore_element, only: fem_skeleton_type, constant_permeability, kozeny_carman, by_void_ratio
  use fem_pore_faces, only: fem_held_pressure_type, fem_inflow_type
  use fem_setup_leaks, only: read_leaks, under_head, wet_shares
  use fem_setup_retention, only: read_retention
  use fem_types, only: fem_load_type, group_facet, group_node, group_volume
  use fem_unsaturated, only: has_retention
  implicit none
  private
  public :: read_skeletons, number_wet, read_liquid

  character(len=*), parameter :: groups(8) = [character(len=14) :: 'pore_pressure', 'flux', &
    'well', 'leak', 'seepage', 'infiltration', 'submerged', 'water_table']

  real(wp), parameter :: atmosphere = 101325.0_wp  !! of air at constant temperature [Pa]

contains

  !> Solids with a liquid, their elements, and the density of both; faults D443 to D446 and D449.
  subroutine read_skeletons(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, m

    do k = 1, merge(size(groups, kind=i4), 0_i4, deck%count('pore') == 0)
      if (deck%count(trim(groups(k))) > 0) call deck%fault(errors, 'D449', &
        'no material has pores with a liquid', trim(groups(k)), 1, '', &
        'add &pore material = ..., fluid = ..., or leave it out')
    end do
    if (deck%count('pore') == 0 .or. errors%any()) return
    call refuse_analysis(deck, body, errors)
    if (errors%any()) return
    body%pore%active = .true.
    body%pore%step%gravity = body%loads%gravity
    allocate (body%pore%skeleton(deck%count('pore')), body%pore%held(0), body%pore%inflow(0))
    allocate (body%pore%leak(0))
    allocate (body%pore%skeleton_of(body%mesh%elements), source=0)
    call deck%get('analysis', 1, 'theta', body%pore%step%theta)
    do k = 1, size(body%pore%skeleton)
      call read_skeleton(deck, k, body%pore%skeleton(k), errors)
      call material_of(deck, k, m, errors)
      if (m == 0) cycle
      where (body%matter%law_of == m) body%pore%skeleton_of = k
    end do
    call refuse_elements(deck, body, errors)
    if (deck%count('absorbing') > 0) call refuse_absorbing(deck, body, errors)
    if (errors%any()) return
    do k = 1, body%mesh%elements
      if (body%pore%skeleton_of(k) == 0) cycle
      associate (s => body%pore%skeleton(body%pore%skeleton_of(k)))
        body%elastic%density(k) = body%elastic%density(k) + s%porosity*s%density
      end associate
    end do
    body%pore%unsaturated = any(has_retention(body%pore%skeleton))
    ! the liquid's inertia is in one row alone, and so is what suction empties
    body%matter%symmetric = .not. (body%scheme%dynamic .or. body%pore%unsaturated)
    body%pore%constant = deck%count('seepage') + deck%count('infiltration') == 0 .and. &
      .not. body%pore%unsaturated .and. &
      all(body%pore%skeleton%law == constant_permeability)
    do m = 1, size(body%matter%law)
      if (any(body%matter%law_of == m)) &
        body%pore%constant = body%pore%constant .and. .not. body%matter%law(m)%law%stateful
    end do
  end subroutine read_skeletons

  !> Fault D446 for what has no pressures yet.
  subroutine refuse_analysis(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: kinds(3) = [character(len=7) :: 'static', 'newmark', 'hht']
    character(len=:), allocatable :: kind, text
    call deck%get('analysis', 1, 'kind', kind)
    if (all(kinds /= kind)) then
      call deck%fault(errors, 'D446', "kind = '"//kind//"' has no pore pressures", 'analysis', 1, &
        'kind', "take kind = 'static', consolidation in time, or 'newmark' or 'hht'")
      return
    end if
    call deck%get('analysis', 1, 'continuation', text)
    if (text /= 'load') call deck%fault(errors, 'D446', &
      'a path by arc length has no times, consolidation needs them', 'analysis', 1, &
      'continuation', "take continuation = 'load'")
    call deck%get('analysis', 1, 'solver', text)
    if (text == 'iterative' .or. text == 'multigrid') call deck%fault(errors, 'D446', &
      "solver = '"//text//"' needs a positive matrix, that with pore pressures is not", &
      'analysis', 1, 'solver', "take solver = 'direct'")
    if (deck%count('stage') > 0) call deck%fault(errors, 'D446', &
      'stages do not know pore pressures', 'stage', 1, '', 'leave the stages or &pore out')
    if (body%matter%micro%active) call deck%fault(errors, 'D446', &
      'micromorphic solids have no pore pressures', 'micromorphic', 1, '', &
      'take a classical or micropolar material for &pore')
  end subroutine refuse_analysis

  !> Constants of &pore k and its &fluid.
  subroutine read_skeleton(deck, k, skeleton, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_skeleton_type), intent(out) :: skeleton
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: permeability(:)
    character(len=:), allocatable :: name
    real(wp) :: viscosity, bulk, air, solid
    integer(i4) :: f

    call deck%get('pore', k, 'fluid', name)
    call index_of(deck, 'fluid', name, f)
    if (f == 0) then
      call deck%fault(errors, 'D443', "there is no fluid '"//name//"'", 'pore', k, 'fluid', &
        'define it with &fluid id = ...')
      return
    end if
    call deck%get('fluid', f, 'density', skeleton%density)
    call deck%get('fluid', f, 'viscosity', viscosity)
    call deck%get('fluid', f, 'bulk_modulus', bulk)
    call deck%get('fluid', f, 'air', air)
    call deck%get('pore', k, 'porosity', skeleton%porosity)
    call deck%get('pore', k, 'biot', skeleton%biot)
    call deck%get('pore', k, 'solid_bulk', solid)
    call deck%get('pore', k, 'permeability', permeability)
    call deck%get('pore', k, 'law', name)
    skeleton%law = constant_permeability
    if (name == 'kozeny_carman') skeleton%law = kozeny_carman
    if (name == 'void_ratio') skeleton%law = by_void_ratio
    if (name == 'void_ratio') call deck%get('pore', k, 'permeability_index', skeleton%slope)
    if (size(permeability) == 2) call deck%fault(errors, 'D444', &
      'two permeabilities are neither one nor three', 'pore', k, 'permeability', &
      'give one value, or those along x, y and z')
    if (skeleton%biot < skeleton%porosity) call deck%fault(errors, 'D444', &
      "Biot's coefficient "//str(skeleton%biot)//' is below the porosity '// &
      str(skeleton%porosity), 'pore', k, merge('biot    ', 'porosity', &
      deck%given('pore', k, 'biot')), 'the content at constant strain would fall with pressure')
    if (errors%any()) return
    skeleton%mobility = permeability(1)/viscosity
    if (size(permeability) == 3) skeleton%mobility = permeability/viscosity
    call deck%get('pore', k, 'drained', name)
    if (name == 'no') skeleton%mobility = 0.0_wp
    skeleton%storage = skeleton%porosity*air/atmosphere
    if (bulk > 0.0_wp) skeleton%storage = skeleton%storage &
      + skeleton%porosity*(1.0_wp - air)/bulk
    if (solid > 0.0_wp) skeleton%grains = (skeleton%biot - skeleton%porosity)/solid
    skeleton%storage = skeleton%storage + skeleton%grains
    call read_retention(deck, k, skeleton%retention, errors)
  end subroutine read_skeleton

  !> Number of the &material of &pore k; D443 where there is none, or it has pores already.
  subroutine material_of(deck, k, m, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    integer(i4), intent(out) :: m
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, other
    integer(i4) :: j
    call deck%get('pore', k, 'material', name)
    call index_of(deck, 'material', name, m)
    if (m == 0) call deck%fault(errors, 'D443', "there is no material '"//name//"'", 'pore', k, &
      'material', 'define it with &material id = ...')
    do j = 1, k - 1
      call deck%get('pore', j, 'material', other)
      if (other == name) call deck%fault(errors, 'D443', "the material '"//name// &
        "' has two &pore", 'pore', k, 'material', 'give each material one')
    end do
  end subroutine material_of

  !> Instance of a group with an id, 0 if there is none.
  subroutine index_of(deck, group, name, index)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group, name
    integer(i4), intent(out) :: index
    character(len=:), allocatable :: id
    integer(i4) :: k
    index = 0
    do k = 1, deck%count(group)
      call deck%get(group, k, 'id', id)
      if (id == name) index = k
    end do
  end subroutine index_of

  !> Fault D445 for elements and laws that have no pressures.
  subroutine refuse_elements(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: known(9) = [character(len=12) :: 'hex8_bbar', 'hex8_full', &
      'hex20', 'hex27', 'tet10', 'tet4', 'hex20/hex8', 'hex27/hex8', 'tet10/tet4']
    integer(i4) :: e, k
    do e = 1, body%mesh%elements
      k = body%pore%skeleton_of(e)
      if (k == 0) cycle
      if (body%matter%law(body%matter%law_of(e))%law%finite) then
        call deck%fault(errors, 'D445', 'element '//str(e)//' has a law of finite strain', 'pore', &
          k, 'material', 'pore pressures belong to laws of small strains')
        return
      end if
      associate (name => body%elastic%rule(body%elastic%rule_of(e))%name)
        if (any(known == name)) cycle
        call deck%fault(errors, 'D445', "element '"//trim(name)//"' of element "//str(e)// &
          ' has no pressures', 'pore', k, 'material', &
          'take hex20, hex27 or tet10 (pressures at their corners), hex8_bbar, hex8_full or tet4')
      end associate
      return
    end do
  end subroutine refuse_elements

  !> Fault D446 for absorbing faces of a liquid without waves, and of quadratic elements: dashpots
  !! that stand at nodes bend their faces, which have little but shear against it.
  subroutine refuse_absorbing(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: e
    if (.not. minval(body%pore%skeleton%storage) > 0.0_wp) call deck%fault(errors, 'D446', &
      'waves in an incompressible liquid have no speed that faces could absorb', 'absorbing', 1, &
      '', 'give the &fluid a bulk_modulus')
    if (any(has_retention(body%pore%skeleton))) call deck%fault(errors, 'D477', &
      'absorbing faces have the speed of waves in full pores', 'absorbing', 1, '', &
      "take retention = 'none', or put the face so far away that nothing comes back in time")
    do e = 1, body%mesh%elements
      if (body%pore%skeleton_of(e) == 0) cycle
      associate (rule => body%elastic%rule(body%elastic%rule_of(e)))
        if (rule%corners == rule%nodes) cycle
        call deck%fault(errors, 'D446', 'absorbing faces do not serve saturated elements '// &
          trim(rule%name)//', as element '//str(e), 'absorbing', 1, '', &
          'take hex8_bbar or tet4 in a body with absorbing faces')
      end associate
      return
    end do
  end subroutine refuse_absorbing

  !> Number the pressures, once the other fields are.
  subroutine number_wet(body)
    type(fem_body_type), intent(inout) :: body
    integer(i4) :: corners(body%mesh%elements), e
    if (.not. body%pore%active) return
    corners = 0
    do e = 1, body%mesh%elements
      if (body%pore%skeleton_of(e) > 0) &
        corners(e) = body%elastic%rule(body%elastic%rule_of(e))%corners
    end do
    call number_pressures(body%mesh, corners, body%dofs)
  end subroutine number_wet

  !> Held pressures, inflow, and the pressure at the start; after the supports.
  subroutine read_liquid(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, c

    if (.not. body%pore%active) return
    if (allocated(body%loads%follower)) body%pore%constant = .false.
    do c = 2, 3  ! a block has three components, p is one
      call body%supports%hold(c, [(k, k=body%dofs%solid + 1, body%dofs%blocks)])
    end do
    if (deck%count('water_table') > 0) call begin_under(deck, body, errors)
    do k = 1, deck%count('pore_pressure')
      call read_held(deck, body, k, errors)
    end do
    do k = 1, deck%count('submerged')
      call read_submerged(deck, body, k, errors)
    end do
    do k = 1, deck%count('flux')
      call read_flux(deck, body, k, errors)
    end do
    do k = 1, deck%count('well')
      call read_well(deck, body, k, errors)
    end do
    call read_leaks(deck, body, errors)
  end subroutine read_liquid

  !> Nodes with a pressure of the group that an instance names; fault D447 where there are none.
  subroutine wet_nodes(deck, body, group, k, node, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    integer(i4), allocatable, intent(out) :: node(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), parameter :: any_kind(3) = [group_facet, group_node, group_volume]
    character(len=:), allocatable :: name
    integer(i4) :: g
    call deck%get(group, k, 'group', name)
    g = find_group(body%mesh, name, any_kind)
    allocate (node(0))
    if (g == 0) then
      call deck%fault(errors, 'D301', "the mesh has no group '"//name//"'", group, k, 'group', &
        group_hint(body%mesh, name, any_kind))
      return
    end if
    node = pack(body%mesh%group(g)%node, body%dofs%p(body%mesh%group(g)%node) > 0)
    if (size(node) == 0) call deck%fault(errors, 'D447', "no node of '"//name// &
      "' has a pressure", group, k, 'group', &
      'pressures are at the corner nodes of elements whose material has a &pore')
  end subroutine wet_nodes

  !> A &pore_pressure: value or head.
  subroutine read_held(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_held_pressure_type) :: held
    integer(i4), allocatable :: node(:)
    character(len=:), allocatable :: name
    real(wp) :: value

    call wet_nodes(deck, body, 'pore_pressure', k, node, errors)
    call curve_index(deck, 'D303', body%loads%curve, 'pore_pressure', k, held%curve, errors)
    if (deck%given('pore_pressure', k, 'head')) then
      call deck%get('pore_pressure', k, 'head', value)
      call under_head(deck, body, 'pore_pressure', k, value, held%value, errors)
      if (errors%any()) return
      held%value = held%value(node)
    else
      call deck%get('pore_pressure', k, 'value', value)
      allocate (held%value(size(node)), source=value)
    end if
    if (errors%any()) return
    call deck%get('pore_pressure', k, 'group', name)
    held%name = name
    held%block = body%dofs%p(node)
    call append_held(body, held)
  end subroutine read_held

  !> Held pressures of one group more.
  subroutine append_held(body, held)
    type(fem_body_type), intent(inout) :: body
    type(fem_held_pressure_type), intent(in) :: held
    type(fem_held_pressure_type), allocatable :: longer(:)
    integer(i4) :: n
    call body%supports%hold(1_i4, held%block)
    n = int(size(body%pore%held), i4)
    allocate (longer(n + 1))
    longer(:n) = body%pore%held
    longer(n + 1) = held
    call move_alloc(longer, body%pore%held)
  end subroutine append_held

  !> A &submerged face: free liquid above it up to a level presses on the face and in its pores.
  subroutine read_submerged(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_held_pressure_type) :: held
    type(fem_load_type) :: load
    integer(i4), allocatable :: node(:)
    character(len=:), allocatable :: name
    real(wp), allocatable :: p(:)
    real(wp) :: level
    integer(i4) :: g

    call deck%get('submerged', k, 'group', name)
    call deck%get('submerged', k, 'level', level)
    g = find_group(body%mesh, name, [group_facet])
    if (g == 0) then
      call deck%fault(errors, 'D301', "the mesh has no facet group '"//name//"'", 'submerged', k, &
        'group', group_hint(body%mesh, name, [group_facet]))
      return
    end if
    call wet_nodes(deck, body, 'submerged', k, node, errors)
    call under_head(deck, body, 'submerged', k, level, p, errors)
    if (errors%any()) return
    node = pack(node, p(node) >= 0.0_wp)
    held%name = name
    held%block = body%dofs%p(node)
    held%value = p(node)
    call append_held(body, held)
    allocate (load%force(3, body%dofs%blocks), source=0.0_wp)
    associate (density => body%pore%skeleton(1)%density, gravity => body%loads%gravity)
      call pressure_force(body%mesh, body%mesh%group(g), density*norm2(gravity)*level, &
        density*gravity, load%force, .true.)
    end associate
    call body%loads%append(load)
  end subroutine read_submerged

  !> Pressure at the start under &water_table, none above it.
  subroutine begin_under(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: p(:)
    real(wp) :: level
    integer(i4) :: n
    call deck%get('water_table', 1, 'level', level)
    call under_head(deck, body, 'water_table', 1_i4, level, p, errors)
    do n = 1, body%mesh%nodes
      if (body%dofs%p(n) == 0) cycle
      body%state%u(1, body%dofs%p(n)) = p(n)
      body%accepted%u(1, body%dofs%p(n)) = p(n)
    end do
  end subroutine begin_under

  !> A &flux through facets.
  subroutine read_flux(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_inflow_type) :: inflow
    character(len=:), allocatable :: name
    real(wp) :: share(body%dofs%blocks)

    call deck%get('flux', k, 'group', name)
    call deck%get('flux', k, 'value', share(1))
    call curve_index(deck, 'D303', body%loads%curve, 'flux', k, inflow%curve, errors)
    call wet_shares(deck, body, 'flux', k, share, errors)
    if (errors%any()) return
    inflow%name = name//' flux'
    call append_inflow(body, inflow, share)
  end subroutine read_flux

  !> A &well: a rate of volume shared by the nodes of a group alike.
  subroutine read_well(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_inflow_type) :: inflow
    integer(i4), allocatable :: node(:)
    character(len=:), allocatable :: name
    real(wp) :: rate, share(body%dofs%blocks)

    call deck%get('well', k, 'group', name)
    call deck%get('well', k, 'rate', rate)
    call curve_index(deck, 'D303', body%loads%curve, 'well', k, inflow%curve, errors)
    call wet_nodes(deck, body, 'well', k, node, errors)
    if (errors%any()) return
    inflow%name = name//' well'
    share = 0.0_wp
    share(body%dofs%p(node)) = rate/size(node)
    call append_inflow(body, inflow, share)
  end subroutine read_well

  !> One inflow more, with its rates at the blocks.
  subroutine append_inflow(body, inflow, share)
    type(fem_body_type), intent(inout) :: body
    type(fem_inflow_type), intent(inout) :: inflow
    real(wp), intent(in) :: share(:)
    type(fem_inflow_type), allocatable :: longer(:)
    integer(i4) :: n
    allocate (inflow%rate(size(share)))
    inflow%rate = share
    n = int(size(body%pore%inflow), i4)
    allocate (longer(n + 1))
    longer(:n) = body%pore%inflow
    longer(n + 1) = inflow
    call move_alloc(longer, body%pore%inflow)
  end subroutine append_inflow

end module fem_setup_pore
