!> Stages of the deck: groups of elements that are removed or placed.
module fem_setup_stages
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_mesh, only: find_group, group_hint
  use fem_stages, only: fem_stage_type
  use fem_staging, only: hide_absent
  use fem_types, only: fem_load_type, group_volume
  implicit none
  private
  public :: read_stages

contains

  !> All &stage groups, once the points have their initial state; no action without any.
  subroutine read_stages(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: s, n

    n = deck%count('stage')
    if (n == 0 .or. errors%any()) return
    if (body%scheme%dynamic .or. body%matter%micro%active .or. body%matter%finite) then
      call deck%fault(errors, 'D339', 'stages belong to statics at small strain', 'stage', 1, '', &
                      "take kind = 'static', and no law of finite strain or micromorphic solid")
      return
    end if
    allocate (body%stages%stage(n))
    do s = 1, n
      call read_stage(deck, body, s, body%stages%stage(s), errors)
    end do
    if (errors%any()) return
    call sort_stages(body%stages%stage)
    body%stages%active = .true.
    body%stages%density = body%elastic%density
    body%stages%stress = body%matter%stress
    body%stages%state = body%matter%state
    call check_order(deck, body, errors)
    if (errors%any()) return
    call clear_start(deck, body, errors)
    call add_release(body)
    call hide_absent(body)
  end subroutine read_stages

  subroutine read_stage(deck, body, s, stage, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: s
    type(fem_stage_type), intent(inout) :: stage
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, action
    integer(i4) :: g
    call deck%get('stage', s, 'group', name)
    call deck%get('stage', s, 'action', action)
    call deck%get('stage', s, 'time', stage%time)
    call deck%get('stage', s, 'duration', stage%duration)
    stage%place = action == 'place'
    g = find_group(body%mesh, name, [group_volume])
    if (g > 0) then
      stage%element = body%mesh%group(g)%element
    else
      call deck%fault(errors, 'D301', "the mesh has no volume group '"//name//"'", 'stage', s, &
                      'group', group_hint(body%mesh, name, [group_volume]))
    end if
  end subroutine read_stage

  !> By time; stages of one time keep the order of the deck.
  subroutine sort_stages(stage)
    type(fem_stage_type), intent(inout) :: stage(:)
    type(fem_stage_type) :: kept
    integer(i4) :: i, j
    do i = 2, size(stage)
      kept = stage(i)
      j = i - 1
      do while (j >= 1)
        if (stage(j)%time <= kept%time) exit
        stage(j + 1) = stage(j)
        j = j - 1
      end do
      stage(j + 1) = kept
    end do
  end subroutine sort_stages

  !> What is placed first is absent at the start. Faults D339 for elements that are removed while
  !! they are absent, placed while they are there, and for stages that leave none.
  subroutine check_order(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    logical :: there(body%mesh%elements), named(body%mesh%elements)
    integer(i4) :: k, bad

    there = .true.
    named = .false.
    do k = 1, size(body%stages%stage)
      associate (stage => body%stages%stage(k))
        where (.not. named(stage%element)) there(stage%element) = .not. stage%place
        named(stage%element) = .true.
      end associate
    end do
    body%elastic%absent = .not. there
    do k = 0, size(body%stages%stage)
      if (k > 0) then
        associate (stage => body%stages%stage(k))
          bad = int(findloc(there(stage%element), stage%place, 1), i4)
          if (bad > 0) call deck%fault(errors, 'D339', 'element '//str(stage%element(bad))// &
            ' is to be '//trim(merge('placed ', 'removed', stage%place))//' at time '// &
            str(stage%time)//' s, and is '//trim(merge('there ', 'absent', stage%place)), &
            'stage', 1, 'group', 'an element is removed and placed by turns')
          there(stage%element) = stage%place
        end associate
      end if
      if (any(there)) cycle
      call deck%fault(errors, 'D339', 'no element is left after stage '//str(k), 'stage', 1, &
                      'group', 'a model needs one element at all times')
      return
    end do
  end subroutine check_order

  !> Elements present at the start and placed again later have no stress; fault D333 for
  !! laws that cannot be so.
  subroutine clear_start(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fault, cure
    integer(i4) :: k, i, e
    do k = 1, size(body%stages%stage)
      if (.not. body%stages%stage(k)%place) cycle
      do i = 1, size(body%stages%stage(k)%element)
        e = body%stages%stage(k)%element(i)
        if (body%elastic%absent(e)) cycle
        call clear_element(body, e, fault, cure)
        if (len(fault) == 0) cycle
        call deck%fault(errors, 'D333', 'element '//str(e)//' returns without stress: '//fault, &
                        'material', body%matter%law_of(e), 'id', cure)
        return
      end do
    end do
  end subroutine clear_start

  !> No stress, and the state of that, at the points of element e when it is placed.
  subroutine clear_element(body, e, fault, cure)
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: e
    character(len=:), allocatable, intent(out) :: fault, cure
    real(wp), parameter :: none(6) = 0.0_wp
    integer(i4) :: q
    associate (law => body%matter%law(body%matter%law_of(e))%law)
      do q = body%elastic%point(e), body%elastic%point(e + 1) - 1
        body%stages%stress(:, q) = 0.0_wp
        call law%begin(none, body%stages%state(:law%states, q), fault, cure)
      end do
    end associate
  end subroutine clear_element

  !> A load for what is out of balance, with its curve, after those of the deck.
  subroutine add_release(body)
    type(fem_body_type), intent(inout) :: body
    type(fem_load_type) :: load
    type(curve_type), allocatable :: curve(:)
    integer(i4) :: k
    allocate (curve(size(body%loads%curve) + 1))
    do k = 1, size(body%loads%curve)
      curve(k) = body%loads%curve(k)
    end do
    load%curve = size(curve)
    allocate (load%force(3, body%dofs%blocks), source=0.0_wp)
    call body%loads%append(load)
    body%stages%load = size(body%loads%load)
    body%stages%curve = size(curve)
    curve(size(curve))%name = ''
    curve(size(curve))%time = [0.0_wp, 1.0_wp]
    curve(size(curve))%value = [1.0_wp, 0.0_wp]
    call move_alloc(curve, body%loads%curve)
  end subroutine add_release
end module fem_setup_stages
