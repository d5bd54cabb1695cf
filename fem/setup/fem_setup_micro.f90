!> Micromorphic bodies of the deck: their laws, the start of their points, what acts on chi.
module fem_setup_micro
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_curve, only: curve_index
  use fem_body, only: fem_body_type
  use fem_law, only: at_stored, at_numerical
  use fem_loads, only: couple_force
  use fem_mesh, only: find_group, group_hint
  use fem_mm_flow, only: mm_state_type
  use fem_mm_motion, only: mm_motion_type
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_mm_prestress, only: start_state
  use fem_mm_setup, only: read_micromorphic
  use fem_mm_store, only: point_states, point_stresses, store_point, stress_row
  use fem_mm_ties, only: tie_springs
  use fem_types, only: fem_load_type, group_facet
  implicit none
  private
  public :: read_micro_laws, begin_micro_points, read_double_forces, read_ties
  public :: chi_component, chi_held

  character(len=*), parameter :: stretch(4) = [character(len=5) :: 'chi', 'chi11', 'chi22', 'chi33']

contains

  !> The laws of all &micromorphic; whether tangents are symmetric.
  subroutine read_micro_laws(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: form
    integer(i4) :: m, n
    n = deck%count('micromorphic')
    associate (micro => body%matter%micro)
      allocate (micro%law(n), micro%balance(n))
      do m = 1, n
        call read_micromorphic(deck, m, micro%law(m), errors)
        call deck%get('micromorphic', m, 'form', form)
        micro%balance(m) = form == 'balance'
        body%matter%symmetric = body%matter%symmetric .and. .not. (micro%balance(m) .or. &
          micro%law(m)%plastic .or. micro%law(m)%elastic%reduced)
      end do
    end associate
    body%matter%states = point_states
    body%matter%micro%wants_stiffness = .not. body%scheme%explicit
  end subroutine read_micro_laws

  !> All points at their initial stress, given in `stress` of the matter as six components; fault
  !! D333 names the first that cannot be.
  subroutine begin_micro_points(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: initial(:, :)
    character(len=:), allocatable :: fault
    integer(i4) :: e, q

    call move_alloc(body%matter%stress, initial)
    allocate (body%matter%stress(point_stresses, body%elastic%points))
    allocate (body%matter%state(point_states, body%elastic%points), source=0.0_wp)
    do e = 1, body%mesh%elements
      do q = body%elastic%point(e), body%elastic%point(e + 1) - 1
        call begin_point(body, e, q, initial(:, q), fault)
        if (len(fault) == 0) cycle
        call deck%fault(errors, 'D333', 'element '//str(e)//', point '// &
          str(q - body%elastic%point(e) + 1)//': '//fault, 'micromorphic', &
          body%matter%micro%law_of(e), 'id', &
          'raise friction, cohesion or preconsolidation, or lower the stress')
        return
      end do
    end do
  end subroutine begin_micro_points

  subroutine begin_point(body, e, q, initial, fault)
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: e, q
    real(wp), intent(in) :: initial(6)
    character(len=:), allocatable, intent(out) :: fault
    type(mm_motion_type) :: none
    type(mm_point_type) :: point
    type(mm_state_type) :: state
    real(wp) :: before(point_states)

    associate (law => body%matter%micro%law(body%matter%micro%law_of(e)))
      if (any(abs(initial) > 0.0_wp) .or. law%plastic) then
        call start_state(law, initial, state, fault)
      else
        fault = ''
      end if
      if (len(fault) > 0) return
      call update_point(law, [none, none], state, point)
      before = 0.0_wp
      call store_point([none, none], point, point%force, before, body%matter%state(:, q))
      body%matter%state(at_stored:at_numerical, q) = 0.0_wp
      body%matter%stress(:, q) = stress_row(none, point)
    end associate
  end subroutine begin_point

  !> Does the deck hold the stretches of chi somewhere, or tie chi to F?
  logical function chi_held(deck)
    type(deck_type), intent(in) :: deck
    type(string_type), allocatable :: fix(:)
    character(len=:), allocatable :: name
    integer(i4) :: s, k
    chi_held = deck%count('micro_tie') > 0
    do s = 1, deck%count('support')
      call deck%get('support', s, 'fix', fix)
      do k = 1, size(fix)
        chi_held = chi_held .or. any(stretch == fix(k)%s)
      end do
    end do
    do s = 1, deck%count('motion')
      call deck%get('motion', s, 'component', name)
      chi_held = chi_held .or. any(stretch == name)
    end do
  end function chi_held

  !> Row and column of a component 'chi11' to 'chi33'; 0 if the text is none.
  pure function chi_component(text) result(place)
    character(len=*), intent(in) :: text
    integer(i4) :: place(2)
    place = 0
    if (len(text) /= 5) return
    if (text(:3) /= 'chi') return
    place = [index('123', text(4:4)), index('123', text(5:5))]
  end function chi_component

  !> Double forces per area on facets; fault D323 where a facet has no micro-deformation.
  subroutine read_double_forces(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:)
    type(fem_load_type) :: load
    integer(i4) :: s, g, c, missing, column(body%mesh%nodes)

    do s = 1, deck%count('double_force')
      call find_facets(deck, body, 'double_force', s, g, errors)
      call curve_index(deck, 'D303', body%loads%curve, 'double_force', s, load%curve, errors)
      if (g == 0) cycle
      call deck%get('double_force', s, 'value', value)
      load%force = 0.0_wp*body%state%u
      if (.not. body%matter%micro%active) then
        call refuse(deck, 'double_force', s, errors)
        cycle
      end if
      do c = 1, 3
        column = merge(body%dofs%phi + c - 1, 0, body%dofs%phi > 0)
        call couple_force(body%mesh, body%mesh%group(g), column, value(c::3), load%force, missing)
      end do
      call body%loads%append(load)
    end do
  end subroutine read_double_forces

  !> Facets on which chi follows F, springs per area; faults D323 and D326.
  subroutine read_ties(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: k
    integer(i4) :: s, g, lost

    do s = 1, deck%count('micro_tie')
      call find_facets(deck, body, 'micro_tie', s, g, errors)
      if (g == 0) cycle
      if (.not. body%matter%micro%active) then
        call refuse(deck, 'micro_tie', s, errors)
        cycle
      end if
      call deck%get('micro_tie', s, 'stiffness', k)
      call tie_springs(body%mesh, body%dofs, body%elastic, body%mesh%group(g), k, &
        body%supports%ground, lost)
      if (lost > 0) call deck%fault(errors, 'D326', 'the element of facet '//str(lost)// &
        ' is not in the mesh file', 'micro_tie', s, 'group', &
        "make the mesh with `talus mesh`, which writes the dataset 'cell' of facet groups")
    end do
  end subroutine read_ties

  subroutine refuse(deck, group, s, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: s
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D323', 'the body has no micro-deformation', group, s, 'group', &
                    'it belongs to sections of a &micromorphic solid')
  end subroutine refuse

  subroutine find_facets(deck, body, group, s, g, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: s
    integer(i4), intent(out) :: g
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    call deck%get(group, s, 'group', name)
    g = find_group(body%mesh, name, [group_facet])
    if (g == 0) call deck%fault(errors, 'D301', "the mesh has no facet group '"//name//"'", &
      group, s, 'group', group_hint(body%mesh, name, [group_facet]))
  end subroutine find_facets
end module fem_setup_micro
