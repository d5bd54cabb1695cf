!> Groups of the deck that move as rigid bodies.
module fem_setup_rigid
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_mesh, only: find_group, group_hint
  use fem_rigid, only: fem_rigid_type
  use fem_types, only: group_volume, group_facet, group_node
  implicit none
  private
  public :: read_rigid

  integer(i4), parameter :: any_kind(3) = [group_facet, group_node, group_volume]
  character(len=*), parameter :: shifts(3) = [character(len=7) :: 'shift_x', 'shift_y', 'shift_z']

contains

  !> Faults D306 for nodes that are held already, D337 for motions that make no sense.
  subroutine read_rigid(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: s, g, k

    if (deck%count('rigid') == 0) return
    allocate (body%supports%rigid(deck%count('rigid')))
    do s = 1, size(body%supports%rigid)
      call deck%get('rigid', s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g == 0) then
        call deck%fault(errors, 'D301', "the mesh has no group '"//name//"'", 'rigid', s, 'group', &
                        group_hint(body%mesh, name, any_kind))
        cycle
      end if
      body%supports%rigid(s)%name = name
      body%supports%rigid(s)%node = body%mesh%group(g)%node
      call read_motion(deck, s, body, body%supports%rigid(s), errors)
      if (any(body%supports%held(:, body%supports%rigid(s)%node))) call deck%fault(errors, 'D306', &
        'some of these nodes are held or moved already', 'rigid', s, 'group', &
        'leave them out of &support, &motion and other &rigid')
      do k = 1, 3
        call body%supports%hold(k, body%supports%rigid(s)%node)
      end do
    end do
  end subroutine read_rigid

  subroutine read_motion(deck, s, body, rigid, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: s
    type(fem_body_type), intent(in) :: body
    type(fem_rigid_type), intent(inout) :: rigid
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: free(:)
    real(wp), allocatable :: values(:)
    integer(i4) :: c, k

    call deck%get('rigid', s, 'centre', values)
    rigid%centre = values
    call deck%get('rigid', s, 'axis', values)
    if (norm2(values) > 0.0_wp) then
      rigid%axis = values/norm2(values)
    else
      call deck%fault(errors, 'D337', 'the axis has no direction', 'rigid', s, 'axis', &
                      'give a vector of any length but zero')
    end if
    call named_curve(deck, s, 'turn', body%loads%curve, rigid%turn, errors)
    do c = 1, 3
      call named_curve(deck, s, shifts(c), body%loads%curve, rigid%shift(c), errors)
    end do
    call named_curve(deck, s, 'curve', body%loads%curve, rigid%curve, errors)
    call deck%get('rigid', s, 'mass', rigid%mass)
    call deck%get('rigid', s, 'force', values)
    rigid%force = values
    if (.not. deck%given('rigid', s, 'free')) return
    call deck%get('rigid', s, 'free', free)
    do k = 1, size(free)
      rigid%free(index('xyz', free(k)%s)) = .true.
    end do
    if (any(rigid%free .and. rigid%shift > 0)) call deck%fault(errors, 'D337', &
      'a component is free and has a curve', 'rigid', s, 'free', 'leave one of both out')
    if (.not. rigid%mass > 0.0_wp) call deck%fault(errors, 'D337', 'what is free has no mass', &
      'rigid', s, 'free', 'give mass: that of hub and axle')
    if (.not. body%scheme%dynamic) call deck%fault(errors, 'D337', &
      'statics does not support a free rigid group', &
      'rigid', s, 'free', "use kind = 'newmark', 'hht' or 'explicit', or move it by a curve")
  end subroutine read_motion

  !> Index of the curve that a key names, 0 if the key is left out; fault D303.
  subroutine named_curve(deck, s, key, curve, index, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: s
    character(len=*), intent(in) :: key
    type(curve_type), intent(in) :: curve(:)
    integer(i4), intent(out) :: index
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: id
    integer(i4) :: k
    index = 0
    call deck%get('rigid', s, trim(key), id)
    if (len(id) == 0) return
    do k = 1, size(curve)
      if (curve(k)%name == id) index = k
    end do
    if (index == 0) call deck%fault(errors, 'D303', "there is no curve '"//id//"'", 'rigid', s, &
                                    trim(key), 'define it with &curve id = ...')
  end subroutine named_curve
end module fem_setup_rigid
