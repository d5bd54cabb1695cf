!> Materials and sections of the deck: law, constants and element formulation of every element.
module fem_setup_sections
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_elastic, only: micromorphic
  use fem_mesh, only: find_group, group_hint
  use fem_layered, only: fem_layered_type
  use fem_law, only: fem_law_type
  use fem_law_registry, only: make_law
  use fem_rules, only: kind_of_rule, usual_rule, polar_rule, rules_for
  use fem_kinds, only: kind_name
  use fem_types, only: group_volume, name_length
  implicit none
  private
  public :: read_sections, check_ids, read_material, fem_material_type

  !> Data of a &material; a &micromorphic has no law of fem_law.
  type :: fem_material_type
    character(len=name_length) :: id = ''
    class(fem_law_type), allocatable :: law
    logical :: polar = .false.      !! as its law has it
    logical :: stateful = .false.
    integer(i4) :: micromorphic = 0 !! number of its &micromorphic, whose chi counts as polar
    real(wp) :: moduli(6) = 0.0_wp  !! lambda, mu, kappa [Pa], alpha, beta, gamma [N]
    real(wp) :: density = 0.0_wp    !! [kg/m^3]
    real(wp) :: inertia = 0.0_wp    !! micro-inertia j [m^2]
  end type fem_material_type

contains

  !> Material m of the deck, with its law; faults D320, D321, D330, D331.
  subroutine read_material(deck, m, material, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_material_type), intent(out) :: material
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, text

    call deck%get('material', m, 'id', text)
    material%id = text
    call deck%get('material', m, 'law', name)
    call deck%get('material', m, 'density', material%density)
    call deck%get('material', m, 'micro_inertia', material%inertia)
    call make_law(name, material%law)
    material%law%id = text
    material%polar = material%law%polar
    material%stateful = material%law%stateful
    call material%law%read_constants(deck, m, errors)
    material%moduli = material%law%moduli
  end subroutine read_material

  !> Law, elastic constants and formulation of every element.
  subroutine read_sections(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    type(fem_material_type), allocatable :: material(:)
    integer(i4) :: owner(body%mesh%elements), s, m, g

    call body%elastic%start(body%mesh%elements)
    allocate (body%matter%law_of(body%mesh%elements), source=0)
    owner = 0
    call check_ids(deck, 'material', errors)
    call check_ids(deck, 'micromorphic', errors)
    allocate (material(deck%count('material') + deck%count('micromorphic')))
    do m = 1, size(material)
      if (m > deck%count('material')) then
        call read_micro_solid(deck, m - deck%count('material'), material(m))
        cycle
      end if
      call read_material(deck, m, material(m), errors)
      if (body%scheme%massive .and. material(m)%polar .and. .not. material(m)%inertia > 0.0_wp) &
        call deck%fault(errors, 'D320', 'the micropolar material has no micro_inertia', &
          'material', m, 'id', 'dynamics and modes need it: 2/5 r^2 of grains of radius r')
    end do
    do s = 1, deck%count('section')
      call find_parts(deck, body, s, material, g, m, errors)
      if (.not. (g > 0 .and. m > 0)) cycle
      call fill_section(deck, body, s, g, material(m), owner, errors)
      body%matter%law_of(body%mesh%group(g)%element) = m
      body%matter%active = body%matter%active .or. material(m)%stateful .or. &
        deck%count('stage') + deck%count('pore') > 0
    end do
    call choose_micro(deck, body, material, errors)
    if (.not. all(owner > 0) .and. .not. errors%any()) &
      call deck%fault(errors, 'D305', str(int(count(owner == 0), i4))// &
      ' elements have no section, the first is element '//str(int(findloc(owner, 0, 1), i4)), &
      'section', 1, 'group', 'volume groups: '//group_hint(body%mesh, '', [group_volume]))
    if (errors%any()) return
    call body%elastic%number_points()
    if (body%matter%micro%active) body%elastic%components = micromorphic
    if (.not. body%matter%active) return
    allocate (body%matter%law(merge(0_i4, deck%count('material'), body%matter%micro%active)))
    do m = 1, size(body%matter%law)
      call move_alloc(material(m)%law, body%matter%law(m)%law)
    end do
  end subroutine read_sections

  !> Id, density and micro-inertia of &micromorphic m.
  subroutine read_micro_solid(deck, m, material)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_material_type), intent(out) :: material
    character(len=:), allocatable :: text
    call deck%get('micromorphic', m, 'id', text)
    material%id = text
    call deck%get('micromorphic', m, 'density', material%density)
    call deck%get('micromorphic', m, 'micro_inertia', material%inertia)
    call deck%get('micromorphic', m, 'lambda', material%moduli(1))
    call deck%get('micromorphic', m, 'mu', material%moduli(2))
    material%polar = .true.
    material%stateful = .true.
    material%micromorphic = m
  end subroutine read_micro_solid

  !> Is the body micromorphic? It is so as a whole (D353), and in dynamics has a mass of chi (D320).
  subroutine choose_micro(deck, body, material, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(fem_material_type), intent(in) :: material(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: m
    logical :: is_micro(body%mesh%elements)

    is_micro = .false.
    do m = 1, size(material)
      if (material(m)%micromorphic == 0) cycle
      where (body%matter%law_of == m) is_micro = .true.
      if (body%scheme%massive .and. any(body%matter%law_of == m) .and. &
          .not. material(m)%inertia > 0.0_wp) call deck%fault(errors, 'D320', &
          'the micromorphic solid has no micro_inertia', 'micromorphic', &
          material(m)%micromorphic, 'id', 'dynamics and modes need it: r^2/5 of grains of radius r')
    end do
    if (.not. any(is_micro) .or. errors%any()) return
    if (.not. all(is_micro)) then
      call deck%fault(errors, 'D353', 'element '//str(int(findloc(is_micro, .false., 1), i4))// &
        ' is of another solid, others are micromorphic', 'section', 1, 'material', &
        'a body is micromorphic as a whole: of a classical solid it has lambda and mu alone, '// &
        'and chi held')
      return
    end if
    body%matter%micro%active = .true.
    body%matter%micro%law_of = material(body%matter%law_of)%micromorphic
  end subroutine choose_micro

  !> Group and material that section s names; 0 with a fault where there are none.
  subroutine find_parts(deck, body, s, material, g, m, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: s
    type(fem_material_type), intent(in) :: material(:)
    integer(i4), intent(out) :: g, m
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, id
    integer(i4) :: k

    call deck%get('section', s, 'group', name)
    call deck%get('section', s, 'material', id)
    g = find_group(body%mesh, name, [group_volume])
    m = 0
    do k = 1, size(material)
      if (material(k)%id == id) m = k
    end do
    if (m == 0) call deck%fault(errors, 'D302', "there is no material '"//id//"'", 'section', s, &
                                'material', 'define it with &material or &micromorphic id = ...')
    if (g == 0) call deck%fault(errors, 'D301', "the mesh has no volume group '"//name//"'", &
      'section', s, 'group', group_hint(body%mesh, name, [group_volume]))
  end subroutine find_parts

  subroutine fill_section(deck, body, s, g, material, owner, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: s, g
    type(fem_material_type), intent(in) :: material
    integer(i4), intent(inout) :: owner(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: element, name
    real(wp) :: share
    integer(i4) :: k, e, r, kind
    logical :: full

    full = .false.
    if (allocated(material%law)) full = allocated(material%law%operator)
    if (full) body%elastic%layered = [body%elastic%layered, &
      fem_layered_type(material%law%operator(:, :, 1), material%law%operator(:, :, 2))]
    call deck%get('section', s, 'element', element)
    call deck%get('section', s, 'hourglass', share)
    do k = 1, size(body%mesh%group(g)%element)
      e = body%mesh%group(g)%element(k)
      if (owner(e) > 0 .and. owner(e) /= s) then
        call deck%fault(errors, 'D305', 'element '//str(e)//' has two sections', 'section', s, &
                        'group', 'groups of sections must not share elements')
        return
      end if
      owner(e) = s
      kind = body%mesh%kind(e)
      name = element
      if (element == 'auto') name = usual_rule(kind, material%polar)
      if (len_trim(name) == 0 .or. kind_of_rule(name) /= kind &
          .or. (polar_rule(name) .neqv. material%polar)) then
        call deck%fault(errors, 'D322', "the element '"//element//"' does not fit element "// &
          str(e)//', a '//kind_name(kind)//' of a '// &
          trim(solid_name(material))//' solid', 'section', s, &
          'element', 'formulations that fit: '//rules_for(kind, material%polar))
        return
      end if
      call body%elastic%use_rule(trim(name), r)
      body%elastic%rule_of(e) = r
      body%elastic%moduli(:, e) = material%moduli
      if (full) body%elastic%layered_of(e) = int(size(body%elastic%layered), i4)
      body%elastic%density(e) = material%density
      body%elastic%inertia(e) = material%inertia
      body%elastic%hourglass(e) = share
    end do
  end subroutine fill_section

  pure function solid_name(material) result(name)
    type(fem_material_type), intent(in) :: material
    character(len=12) :: name
    name = merge('micropolar  ', 'classical   ', material%polar)
    if (material%micromorphic > 0) name = 'micromorphic'
  end function solid_name

  !> Ids of a repeated group must differ.
  subroutine check_ids(deck, group, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: a, b
    integer(i4) :: i, j
    do i = 2, deck%count(group)
      call deck%get(group, i, 'id', a)
      do j = 1, i - 1
        call deck%get(group, j, 'id', b)
        if (a == b) call deck%fault(errors, 'D309', "the id '"//a//"' stands twice", group, i, &
          'id', 'give each &'//group//' an id of its own')
      end do
    end do
  end subroutine check_ids
end module fem_setup_sections
