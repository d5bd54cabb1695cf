!> Faces of pores whose flow depends on the pressure from the deck: &leak, &seepage, &infiltration;
!! and what other boundaries share, areas of nodes and pressures under a level.
module fem_setup_leaks
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_curve, only: curve_index
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_loads, only: couple_force
  use fem_mesh, only: find_group, group_hint
  use fem_pore_faces, only: fem_leak_type
  use fem_types, only: group_facet
  implicit none
  private
  public :: read_leaks, under_head, wet_shares

contains

  !> All leaks.
  subroutine read_leaks(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, deck%count('leak')
      call read_leak(deck, body, k, errors)
    end do
    do k = 1, deck%count('seepage')
      call read_seepage(deck, body, k, errors)
    end do
    do k = 1, deck%count('infiltration')
      call read_infiltration(deck, body, k, errors)
    end do
  end subroutine read_leaks

  !> Pressures of all nodes under a level head [m]; fault D448 where gravity or the liquid is not
  !! one.
  subroutine under_head(deck, body, group, k, head, p, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: head
    real(wp), allocatable, intent(out) :: p(:)  !! (nodes) [Pa]
    type(error_list_type), intent(inout) :: errors
    associate (g => body%loads%gravity, s => body%pore%skeleton)
      allocate (p(body%mesh%nodes), source=0.0_wp)
      if (.not. norm2(g) > 0.0_wp) then
        call deck%fault(errors, 'D448', 'a head needs a gravity', group, k, '', &
          'add gravity to &run, or give a pressure')
      else if (maxval(s%density) - minval(s%density) > 0.0_wp) then
        call deck%fault(errors, 'D448', 'a head needs one density of the liquid', group, k, '', &
          'give a pressure where liquids differ')
      else
        p = s(1)%density*(norm2(g)*head + matmul(g, body%mesh%x))
      end if
    end associate
  end subroutine under_head

  !> Shares of a value per area of the nodes of the facets that an instance of a group names; fault
  !! D447 where a facet has no pressures.
  subroutine wet_shares(deck, body, group, k, value, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    real(wp), intent(inout) :: value(:)  !! (blocks): in the first, the value; out, the shares
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp) :: shares(3, body%dofs%blocks)
    integer(i4) :: g, missing
    call deck%get(group, k, 'group', name)
    g = find_group(body%mesh, name, [group_facet])
    if (g == 0) call deck%fault(errors, 'D301', "the mesh has no facet group '"//name//"'", &
      group, k, 'group', group_hint(body%mesh, name, [group_facet]))
    if (errors%any()) return
    shares = 0.0_wp
    call couple_force(body%mesh, body%mesh%group(g), body%dofs%p, [value(1), 0.0_wp, 0.0_wp], &
                      shares, missing)
    if (missing > 0) call deck%fault(errors, 'D447', 'node '//str(missing)//" of '"//name// &
      "' has no pressure", group, k, 'group', 'liquid passes faces of elements whose material '// &
      'has a &pore')
    value = shares(1, :)
  end subroutine wet_shares

  !> A &leak: c (p - outside) by area.
  subroutine read_leak(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_leak_type) :: leak
    character(len=:), allocatable :: name
    real(wp) :: share(body%dofs%blocks)

    call deck%get('leak', k, 'group', name)
    call deck%get('leak', k, 'coefficient', share(1))
    call deck%get('leak', k, 'pressure', leak%outside)
    call curve_index(deck, 'D303', body%loads%curve, 'leak', k, leak%curve, errors)
    call wet_shares(deck, body, 'leak', k, share, errors)
    if (errors%any()) return
    leak%name = name
    call append_leak(body, leak, share)
  end subroutine read_leak

  !> A &seepage face: nodes that keep the pressure of the atmosphere or let nothing pass; as leaks
  !! they are more pervious than the elements.
  subroutine read_seepage(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_leak_type) :: leak
    character(len=:), allocatable :: name
    real(wp) :: share(body%dofs%blocks)

    call deck%get('seepage', k, 'group', name)
    share(1) = 1.0_wp
    call wet_shares(deck, body, 'seepage', k, share, errors)
    if (errors%any()) return
    leak%name = name
    leak%one_way = .true.
    call append_leak(body, leak, openness(body, share)*share)
  end subroutine read_seepage

  !> Conductance by area of nodes that do not come to rest [m/(Pa s)], ten times that of elements;
  !! `share` has the areas of the nodes.
  pure real(wp) function openness(body, share)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: share(:)  !! (blocks) [m^2]
    real(wp), parameter :: pervious = 10.0_wp
    real(wp) :: most
    integer(i4) :: s
    most = 0.0_wp
    do s = 1, size(body%pore%skeleton)
      most = max(most, maxval(body%pore%skeleton(s)%mobility))
    end do
    openness = pervious*most/sqrt(sum(share)/count(share > 0.0_wp))
  end function openness

  !> An &infiltration: a rate until the pressure is that under a pond, which then is held.
  subroutine read_infiltration(deck, body, k, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    type(fem_leak_type) :: leak
    character(len=:), allocatable :: name
    real(wp), allocatable :: at(:)
    real(wp) :: share(body%dofs%blocks), rate, pond

    call deck%get('infiltration', k, 'group', name)
    call deck%get('infiltration', k, 'rate', rate)
    call deck%get('infiltration', k, 'pond', pond)
    call curve_index(deck, 'D303', body%loads%curve, 'infiltration', k, leak%rain, errors)
    if (pond > 0.0_wp) call under_head(deck, body, 'infiltration', k, pond, at, errors)
    share(1) = 1.0_wp
    call wet_shares(deck, body, 'infiltration', k, share, errors)
    if (errors%any()) return
    leak%name = name
    leak%outside = body%pore%skeleton(1)%density*norm2(body%loads%gravity)*pond
    leak%most = rate*pack(share, share > 0.0_wp)
    call append_leak(body, leak, openness(body, share)*share)
  end subroutine read_infiltration

  !> One leak more, with its conductances at the blocks.
  subroutine append_leak(body, leak, share)
    type(fem_body_type), intent(inout) :: body
    type(fem_leak_type), intent(inout) :: leak
    real(wp), intent(in) :: share(:)
    type(fem_leak_type), allocatable :: longer(:)
    integer(i4) :: n, b
    leak%block = pack([(b, b=1, body%dofs%blocks)], share > 0.0_wp)
    leak%conductance = pack(share, share > 0.0_wp)
    if (leak%one_way .or. allocated(leak%most)) call begin_switch(body%supports%held, leak)
    allocate (leak%open(size(leak%block)), source=.not. allocated(leak%held))
    n = int(size(body%pore%leak), i4)
    allocate (longer(n + 1))
    longer(:n) = body%pore%leak
    longer(n + 1) = leak
    call move_alloc(longer, body%pore%leak)
  end subroutine append_leak

  !> A face that switches; nodes with a pressure of the deck are none of its.
  pure subroutine begin_switch(held, leak)
    logical, intent(in) :: held(:, :)  !! (3, blocks)
    type(fem_leak_type), intent(inout) :: leak
    logical :: free(size(leak%block))
    free = .not. held(1, leak%block)
    leak%block = pack(leak%block, free)
    leak%conductance = pack(leak%conductance, free)
    if (allocated(leak%most)) leak%most = pack(leak%most, free)
    allocate (leak%held(size(leak%block)), source=.false.)
    allocate (leak%flips(size(leak%block)), source=0_i4)
  end subroutine begin_switch
end module fem_setup_leaks
