!> Deck of talus-fem to a body: mesh, sections, supports, motions, loads, springs.
module fem_setup
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_types, only: fem_curve_type, name_length, group_volume, group_facet, group_node
  use fem_mesh, only: read_mesh, find_group, group_hint
  use fem_setup_loads, only: read_tractions, read_point_loads, read_springs
  use fem_body, only: fem_body_type, fem_motion_type
  implicit none
  private
  public :: read_body

  integer(i4), parameter :: any_kind(3) = [group_facet, group_node, group_volume]

contains

  !> Everything that the deck says of the body; all faults in one go.
  subroutine read_body(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind
    real(wp), allocatable :: gravity(:)

    call read_mesh(deck%path('mesh', 1, 'file'), body%mesh, errors)
    if (errors%any()) return
    call body%allocate_state()
    call deck%get('run', 1, 'gravity', gravity)
    body%gravity = gravity
    call deck%get('analysis', 1, 'kind', kind)
    body%dynamic = kind == 'newmark'
    call deck%get('analysis', 1, 'beta', body%beta)
    call deck%get('analysis', 1, 'gamma', body%gamma)
    call read_sections(deck, body, errors)
    call read_curves(deck, body%curve, errors)
    call read_supports(deck, body, errors)
    call read_motions(deck, body, errors)
    call read_tractions(deck, body, errors)
    call read_point_loads(deck, body, errors)
    call read_springs(deck, body, errors)
  end subroutine read_body

  !> Elastic constants and formulation of every element.
  subroutine read_sections(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, id, element
    integer(i4) :: owner(body%mesh%elements), s, m, g, k, e, n

    n = body%mesh%elements
    associate (el => body%elastic)
      allocate (el%young(n), el%poisson(n), el%density(n), source=0.0_wp)
      allocate (el%bbar(n), source=.true.)
      allocate (el%factor(8, n), source=1.0_wp)
      allocate (el%initial(6, 8, n), source=0.0_wp)
      owner = 0
      call check_ids(deck, 'material', errors)
      do s = 1, deck%count('section')
        call deck%get('section', s, 'group', name)
        call deck%get('section', s, 'material', id)
        call deck%get('section', s, 'element', element)
        g = find_group(body%mesh, name, [group_volume])
        m = 0
        do k = 1, deck%count('material')
          call deck%get('material', k, 'id', name)
          if (name == id) m = k
        end do
        if (m == 0) call deck%fault(errors, 'D302', "there is no material '"//id//"'", &
          'section', s, &
                                    'material', 'define it with &material id = ...')
        if (g == 0) call group_fault(deck, body, 'section', s, [group_volume], errors)
        if (g == 0 .or. m == 0) cycle
        do k = 1, size(body%mesh%group(g)%element)
          e = body%mesh%group(g)%element(k)
          if (owner(e) > 0 .and. owner(e) /= s) then
            call deck%fault(errors, 'D305', 'element '//str(e)//' has two sections', 'section', s, &
                            'group', 'groups of sections must not share elements')
            exit
          end if
          owner(e) = s
          call deck%get('material', m, 'young', el%young(e))
          call deck%get('material', m, 'poisson', el%poisson(e))
          call deck%get('material', m, 'density', el%density(e))
          el%bbar(e) = element == 'hex8_bbar'
        end do
      end do
    end associate
    if (all(owner > 0) .or. errors%any()) return
    call deck%fault(errors, 'D305', str(int(count(owner == 0), i4))// &
      ' elements have no section, the '// &
                    'first is element '//str(int(findloc(owner, 0, 1), i4)), 'section', 1, &
                      'group', &
                    'volume groups: '//group_hint(body%mesh, '', [group_volume]))
  end subroutine read_sections

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
          'id', &
                                    'give each &'//group//' an id of its own')
      end do
    end do
  end subroutine check_ids

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

  subroutine read_curves(deck, curve, errors)
    type(deck_type), intent(in) :: deck
    type(fem_curve_type), allocatable, intent(out) :: curve(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: id
    integer(i4) :: k, n

    allocate (curve(deck%count('curve')))
    call check_ids(deck, 'curve', errors)
    do k = 1, size(curve)
      call deck%get('curve', k, 'id', id)
      curve(k)%name = id
      call deck%get('curve', k, 'times', curve(k)%time)
      call deck%get('curve', k, 'values', curve(k)%value)
      n = size(curve(k)%time)
      if (n /= size(curve(k)%value)) then
        call deck%fault(errors, 'D304', 'the curve has '//str(n)//' times and '// &
                        str(int(size(curve(k)%value), i4))//' values', 'curve', k, 'values', &
                        'give one value for each time')
      else if (any(curve(k)%time(2:) <= curve(k)%time(:n - 1))) then
        call deck%fault(errors, 'D304', 'the times of the curve do not increase', 'curve', k, &
          'times', &
                        'put them in order, each once')
      end if
    end do
  end subroutine read_curves

  subroutine read_supports(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    type(string_type), allocatable :: fix(:)
    integer(i4) :: s, g, k

    do s = 1, deck%count('support')
      call deck%get('support', s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) then
        call group_fault(deck, body, 'support', s, any_kind, errors)
        cycle
      end if
      call deck%get('support', s, 'fix', fix)
      do k = 1, size(fix)
        body%held(index('xyz', fix(k)%s), body%mesh%group(g)%node) = .true.
      end do
    end do
  end subroutine read_supports

  subroutine read_motions(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, component
    type(fem_motion_type) :: motion
    logical :: clash
    integer(i4) :: s, g

    allocate (body%motion(0))
    do s = 1, deck%count('motion')
      call deck%get('motion', s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) call group_fault(deck, body, 'motion', s, any_kind, errors)
      call deck%get('motion', s, 'component', component)
      call deck%get('motion', s, 'curve', name)
      call deck%get('motion', s, 'scale', motion%scale)
      motion%component = index('xyz', component)
      motion%curve = find_curve(body%curve, name)
      if (motion%curve == 0) call deck%fault(errors, 'D303', "there is no curve '"//name//"'", &
                                             'motion', s, 'curve', 'define it with &curve id = ...')
      if (g == 0 .or. motion%curve == 0) cycle
      motion%node = body%mesh%group(g)%node
      clash = any(body%held(motion%component, motion%node))
      if (clash) call deck%fault(errors, 'D306', &
        'component '//component//' of some of these nodes '// &
                                 'is held or moved already', 'motion', s, 'group', &
                                 'leave it out of &support and of the other &motion')
      body%held(motion%component, motion%node) = .true.
      call append_motion(body%motion, motion)
    end do
  end subroutine read_motions

  subroutine append_motion(list, motion)
    type(fem_motion_type), allocatable, intent(inout) :: list(:)
    type(fem_motion_type), intent(in) :: motion
    type(fem_motion_type), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = motion
    call move_alloc(longer, list)
  end subroutine append_motion

  pure integer(i4) function find_curve(curve, name)
    type(fem_curve_type), intent(in) :: curve(:)
    character(len=*), intent(in) :: name
    integer(i4) :: k
    find_curve = 0
    do k = 1, size(curve)
      if (curve(k)%name == name) find_curve = k
    end do
  end function find_curve
end module fem_setup
