!> Deck of talus-fem to a body: mesh, sections, supports, motions, loads, springs.
module fem_setup
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_curve, only: read_curves, curve_index
  use fem_analysis, only: fem_analysis_type
  use fem_dofs, only: number_fields
  use fem_halo, only: fem_halo_type
  use fem_types, only: group_volume, group_facet, group_node
  use fem_mesh, only: read_mesh, find_group, group_hint
  use fem_mm_body, only: phi_columns
  use fem_setup_loads, only: read_tractions, read_couples, read_point_loads, read_springs, &
    read_body_loads
  use fem_setup_analysis, only: read_analysis, read_absorbing
  use fem_setup_matter, only: read_matter
  use fem_setup_micro, only: read_double_forces, read_ties, chi_component
  use fem_setup_pore, only: read_skeletons, number_wet, read_liquid
  use fem_setup_rigid, only: read_rigid
  use fem_setup_stages, only: read_stages
  use fem_setup_sections, only: read_sections, check_ids
  use fem_body, only: fem_body_type, fem_motion_type
  implicit none
  private
  public :: read_body

  integer(i4), parameter :: any_kind(3) = [group_facet, group_node, group_volume]

contains

  !> All input of the body from the deck; all faults in one pass. A rank that has a piece of the
  !! mesh, with the halo in `body%dofs`, reads no file.
  subroutine read_body(deck, body, analysis, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    class(fem_analysis_type), allocatable, intent(out) :: analysis
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: gravity(:)
    type(fem_halo_type) :: halo

    if (.not. body%mesh%is_piece()) call read_mesh(deck%path('mesh', 1, 'file'), body%mesh, errors)
    if (errors%any()) return
    halo = body%dofs%halo
    call deck%get('run', 1, 'gravity', gravity)
    body%loads%gravity = gravity
    call read_analysis(deck, body, analysis, errors)
    call read_sections(deck, body, errors)
    if (errors%any()) return
    call read_skeletons(deck, body, errors)
    if (errors%any()) return
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs, &
                       merge(phi_columns, 1_i4, body%matter%micro%active))
    body%dofs%halo = halo
    call number_wet(body)
    call body%allocate_state()
    call read_curves(deck, 'D304', body%loads%curve, errors)
    call read_supports(deck, body, errors)
    call read_motions(deck, body, errors)
    call read_rigid(deck, body, errors)
    call read_initial(deck, body, errors)
    call read_tractions(deck, body, errors)
    call read_liquid(deck, body, errors)
    call read_couples(deck, body, errors)
    call read_double_forces(deck, body, errors)
    call read_ties(deck, body, errors)
    call read_body_loads(deck, body, errors)
    call read_point_loads(deck, body, errors)
    call read_springs(deck, body, errors)
    call read_absorbing(deck, body, errors)
    if (.not. errors%any()) call read_matter(deck, body, errors)
    call analysis%check(deck, body, errors)
    call read_stages(deck, body, errors)
  end subroutine read_body

  subroutine group_fault(deck, body, group, instance, kinds, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: instance, kinds(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, what
    call deck%get(group, instance, 'group', name)
    what = 'group'
    if (size(kinds) == 1) then
      what = 'node group'
      if (kinds(1) == group_facet) what = 'facet group'
      if (kinds(1) == group_volume) what = 'volume group'
    end if
    call deck%fault(errors, 'D301', "the mesh has no "//what//" '"//name//"'", group, instance, &
                    'group', group_hint(body%mesh, name, kinds))
  end subroutine group_fault

  subroutine read_supports(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, text
    type(string_type), allocatable :: fix(:)
    integer(i4), allocatable :: block(:)
    integer(i4) :: s, g, k, c, last, component

    do s = 1, deck%count('support')
      call deck%get('support', s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) then
        call group_fault(deck, body, 'support', s, any_kind, errors)
        cycle
      end if
      call deck%get('support', s, 'fix', fix)
      do k = 1, size(fix)
        last = merge(8, 0, fix(k)%s == 'chi')
        do c = 0, last
          text = fix(k)%s
          if (text == 'chi') text = 'chi'//str(1 + c/3)//str(1 + mod(c, 3))
          call blocks_for(body, g, text, component, block)
          if (component == 0) call field_fault(deck, 'support', s, text, errors)
          if (component == 0) exit
          call body%supports%hold(component, block)
        end do
      end do
    end do
  end subroutine read_supports

  !> Component and blocks that 'x' to 'rz', 'chi11' to 'chi33' mean at the nodes of group g; the
  !! component is 0 where no node has such a field.
  subroutine blocks_for(body, g, text, component, block)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: g
    character(len=*), intent(in) :: text
    integer(i4), intent(out) :: component
    integer(i4), allocatable, intent(out) :: block(:)
    integer(i4) :: place(2)

    place = chi_component(text)
    component = index('xyz', text(len(text):))
    block = body%mesh%group(g)%node
    if (text(1:1) /= 'r' .and. place(1) == 0) return
    block = pack(body%dofs%phi(block), body%dofs%phi(block) > 0)
    if (place(1) > 0) then
      component = place(1)
      block = block + place(2) - 1
    end if
    if (body%matter%micro%active .neqv. place(1) > 0) block = [integer(i4) ::]
    if (size(block) == 0) component = 0
  end subroutine blocks_for

  !> Fault D323: the nodes that an instance of a group of the deck names do not have the field.
  subroutine field_fault(deck, group, instance, text, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group, text
    integer(i4), intent(in) :: instance
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: place(2)
    place = chi_component(text)
    call deck%get(group, instance, 'group', name)
    if (place(1) > 0) then
      call deck%fault(errors, 'D323', "no node of '"//name//"' has a micro-deformation", group, &
        instance, trim(merge('fix      ', 'component', group == 'support')), &
        'chi belongs to sections of a &micromorphic solid')
      return
    end if
    call deck%fault(errors, 'D323', "no node of '"//name//"' has a micro-rotation", group, &
      instance, trim(merge('fix      ', 'component', group == 'support')), &
      "rotations belong to sections of a material with law = 'micropolar'")
  end subroutine field_fault

  subroutine read_motions(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, component
    type(fem_motion_type) :: motion
    logical :: clash
    integer(i4) :: s, g

    allocate (body%supports%motion(0))
    do s = 1, deck%count('motion')
      call deck%get('motion', s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) call group_fault(deck, body, 'motion', s, any_kind, errors)
      call deck%get('motion', s, 'component', component)
      call deck%get('motion', s, 'scale', motion%scale)
      call curve_index(deck, 'D303', body%loads%curve, 'motion', s, motion%curve, errors)
      if (g == 0 .or. motion%curve == 0) cycle
      call blocks_for(body, g, component, motion%component, motion%block)
      if (motion%component == 0) call field_fault(deck, 'motion', s, component, errors)
      if (motion%component == 0) cycle
      clash = any(body%supports%held(motion%component, motion%block))
      if (clash) call deck%fault(errors, 'D306', &
        'component '//component//' of some of these nodes '// &
                                 'is held or moved already', 'motion', s, 'group', &
                                 'leave it out of &support and of the other &motion')
      call body%supports%hold(motion%component, motion%block)
      call append_motion(body%supports%motion, motion)
    end do
  end subroutine read_motions

  !> Velocities and displacements at the start of a dynamic run. `accepted` stays undisplaced:
  !! the step from there to the start strains the points of laws with a state (start_motion).
  subroutine read_initial(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: field(3, body%dofs%blocks)

    call read_field(deck, body, 'initial', field, errors)
    body%state%v = field
    body%accepted%v = field
    if (deck%count('initial_displacement') == 0) return
    call read_field(deck, body, 'initial_displacement', field, errors)
    if (deck%count('initial_stress') + deck%count('geostatic') > 0) call deck%fault(errors, &
      'D346', 'displacements count from the equilibrium under the initial stress', &
      'initial_displacement', 1, '', 'leave it out, or leave the initial stress out')
    if (errors%any()) return
    body%state%u = field
    call body%impose(0.0_wp, body%state%u)
  end subroutine read_initial

  !> A field that groups of the deck have at the start, linear in space; zero where held.
  subroutine read_field(deck, body, what, field, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: what
    real(wp), intent(out) :: field(:, :)  !! (3, blocks)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, text
    integer(i4), allocatable :: block(:)
    real(wp), allocatable :: slope(:), origin(:)
    real(wp) :: value
    integer(i4) :: s, g, component

    field = 0.0_wp
    do s = 1, deck%count(what)
      call deck%get(what, s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) call group_fault(deck, body, what, s, any_kind, errors)
      if (g == 0) cycle
      call deck%get(what, s, 'component', text)
      call deck%get(what, s, 'value', value)
      call deck%get(what, s, 'gradient', slope)
      call deck%get(what, s, 'origin', origin)
      call blocks_for(body, g, text, component, block)
      if (component == 0) call field_fault(deck, what, s, text, errors)
      if (component == 0) cycle
      if (size(block) > 0 .and. .not. body%mesh%is_piece() .and. &
          all(body%supports%held(component, block))) &
        call deck%fault(errors, 'D328', 'component '//text// &
          " is held or moved at all nodes of '"//name//"'", what, s, 'component', &
          'leave it out, or remove it from the &support')
      field(component, block) = value - dot_product(slope, origin) &
        + matmul(slope, body%mesh%x(:, body%dofs%node(block)))
    end do
    where (body%supports%held) field = 0.0_wp
  end subroutine read_field

  subroutine append_motion(list, motion)
    type(fem_motion_type), allocatable, intent(inout) :: list(:)
    type(fem_motion_type), intent(in) :: motion
    type(fem_motion_type), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = motion
    call move_alloc(longer, list)
  end subroutine append_motion
end module fem_setup
