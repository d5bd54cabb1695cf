!> Grains that move past the nodes: when one has left the elements of the free grains, or all have
!! moved far, the projection is rebuilt from where they are (theory: overlap coupling, Remap).
!!
!! Nothing jumps: nodes and grains stay where they are, displacements of the grains count from here,
!! those of the nodes are kept. Ghosts keep their positions in their elements, weights stay frozen.
!! Grains that no element holds are free like others, but no node follows them.
module cpl_overlap_remap
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use cpl_cells, only: cells_type, spot_type
  use cpl_operators, only: followers_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_mass, only: damp_fine_scale
  use cpl_overlap_parts, only: settle_parts
  use cpl_sets, only: part_free
  implicit none
  private
  public :: check_after, rebuild_map

  real(wp), parameter :: check_interval = 0.02_wp  !! of an element: motion between two checks
  real(wp), parameter :: kept_for = 0.1_wp     !! of an element: motion that a map is good for, even
                                               !! if grains at the rim leave and come meanwhile
  integer(i4), parameter :: named = 5          !! grains that a line names

contains

  !> At the end of an exchange, after measure_past; said is the text for the log, '' nothing. N423:
  !! a free grain has left and the deck wants to stop.
  subroutine check_after(o, share, leaving, time, said, errors)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: share             !! of an element, beyond which P is rebuilt; 0 never
    character(len=*), intent(in) :: leaving   !! remap, log or stop
    real(wp), intent(in) :: time              !! [s]
    character(len=:), allocatable, intent(out) :: said
    type(error_list_type), intent(inout) :: errors
    logical :: far
    real(wp) :: next

    said = ''
    far = share > 0.0_wp .and. o%map%past > share*o%sets%least_size
    next = o%map%checked + check_interval*o%sets%least_size
    if (leaving == 'remap') next = max(next, kept_for*o%sets%least_size)
    if (.not. far .and. o%map%past < next) return
    call o%map%note_check()
    call check_grains(o, leaving, far, time, said, errors)
  end subroutine check_after

  !> Find all grains; rebuild the projection if it is due.
  subroutine check_grains(o, leaving, far, time, said, errors)
    type(overlap_type), intent(inout) :: o
    character(len=*), intent(in) :: leaving
    real(wp), intent(in) :: time            !! [s]
    logical, intent(in) :: far              !! it is due
    character(len=:), allocatable, intent(inout) :: said
    type(error_list_type), intent(inout) :: errors
    type(cells_type) :: moved
    type(spot_type) :: spot(o%op%free)
    logical, dimension(o%op%free) :: gone, come, news

    call move_mesh(o, o%motion%u, moved)
    call find_all(o, moved, o%map%x_free + o%motion%q, spot)
    gone = o%map%seen .and. spot%element == 0
    come = spot%element > 0 .and. .not. o%map%seen
    news = gone .and. .not. o%map%logged
    o%map%logged = o%map%logged .or. gone
    if (any(news)) said = 'time '//short_number(time)//' s: '//whom(o, news)// &
                          ' left the elements of free grains'
    if (any(news) .and. leaving == 'stop') then
      call errors%add('N423', whom(o, news)//' left the elements of free grains', &
                      'exchange to '//str(time)//' s', "the deck says leaving = 'stop': give "// &
                      "more elements to free grains, or write leaving = 'remap' or 'log'")
      return
    end if
    if (far .or. (leaving == 'remap' .and. any(gone .or. come))) &
      call remap(o, moved, spot, [count(gone), count(come)], time, said, errors)
  end subroutine check_grains

  !> '3 free grains (ids 4, 17, 20)'
  function whom(o, news) result(text)
    type(overlap_type), intent(in) :: o
    logical, intent(in) :: news(:)
    character(len=:), allocatable :: text
    integer(i4), allocatable :: rows(:)
    integer(i4) :: k
    rows = pack(o%sets%free, news)
    text = str(int(size(rows), i4))//' free grains ('
    do k = 1, min(named, int(size(rows), i4))
      if (k > 1) text = text//', '
      text = text//str(o%pack%id(rows(k)))
    end do
    if (size(rows) > named) text = text//', ...'
    text = text//')'
  end function whom

  !> From here on displacements count from where all are now.
  subroutine remap(o, moved, spot, left_came, time, said, errors)
    type(overlap_type), intent(inout) :: o
    type(cells_type), intent(in) :: moved  !! the mesh as it is
    type(spot_type), intent(in) :: spot(:)
    real(wp), intent(in) :: time           !! [s]
    integer, intent(in) :: left_came(2)    !! grains that left, and that came
    character(len=:), allocatable, intent(inout) :: said
    type(error_list_type), intent(inout) :: errors
    real(wp) :: before

    before = o%edge_kinetic()
    call o%count_from_here()
    call map_from(o, moved, spot, errors)
    if (errors%any()) return
    call hold_again(o)
    if (o%forces%parts%active) then
      call settle_parts(o)
    else
      call o%pull()
      call o%resist()
    end if
    if (o%own%carried%active) call o%op%to_prescribed(o%motion%speed, o%motion%spin, o%motion%v, &
      o%motion%w)
    if (len(said) > 0) said = said//'; '
    if (len(said) == 0) said = 'time '//short_number(time)//' s: '
    said = said//'remap '//str(o%map%remaps)//': grains moved up to '// &
      short_number(o%map%past/o%sets%least_size)//' of an element past the nodes, '// &
      str(left_came(1))//' left, '//str(left_came(2))//' came, '//str(count(o%map%seen))// &
      ' are seen; energy changed by '//short_number(o%edge_kinetic() - before)//' J'
  end subroutine remap

  !> Loads that balance the start, which prescribed nodes transfer to other grains now.
  subroutine hold_again(o)
    type(overlap_type), intent(inout) :: o
    call o%op%from_prescribed(o%forces%f_hold, o%forces%c_hold, o%forces%force_hold, &
      o%forces%moment_hold)
    call o%forces%parts%forget_dead()
  end subroutine hold_again

  !> P and what depends on it, for free grains at x_free and nodes moved by u_map.
  subroutine rebuild_map(o, errors)
    type(overlap_type), intent(inout) :: o
    type(error_list_type), intent(inout) :: errors
    type(cells_type) :: moved
    type(spot_type) :: spot(o%op%free)

    call move_mesh(o, o%map%u_map, moved)
    call find_all(o, moved, o%map%x_free, spot)
    call map_from(o, moved, spot, errors)
  end subroutine rebuild_map

  !> The same with these grains found in the mesh.
  subroutine map_from(o, moved, spot, errors)
    type(overlap_type), intent(inout) :: o
    type(cells_type), intent(in) :: moved
    type(spot_type), intent(in) :: spot(:)
    type(error_list_type), intent(inout) :: errors
    type(followers_type) :: followers

    followers%spot = spot
    followers%x = o%map%x_free
    followers%origin = o%pack%x(:, o%sets%free)
    followers%w = o%op%w
    followers%w_phi = o%op%w_phi
    o%map%seen = followers%spot%element > 0
    o%map%logged = o%map%logged .and. .not. o%map%seen
    call o%op%project(moved, o%sets%part, followers, o%op%p%mls, errors)
    if (errors%any()) return
    associate (free => o%sets%free)
      if (o%own%carried%active) call o%own%carried%build(o%op%p, o%pack%mass(free), &
        o%own%mass(:o%op%prescribed), errors)
      if (o%own%carried_phi%active) call o%own%carried_phi%build(o%op%p_phi, o%pack%inertia(free), &
        o%own%inertia(:o%op%prescribed_phi), errors)
    end associate
    if (o%own%damping%active) call damp_fine_scale(o, moved)
  end subroutine map_from

  !> The mesh with the nodes of the overlap where they are.
  subroutine move_mesh(o, u, moved)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: u(:, :)  !! (3, nodes) [m]
    type(cells_type), intent(out) :: moved
    real(wp) :: x(3, o%cells%nodes)
    x = o%cells%x
    x(:, o%op%node) = o%map%x_node + u
    call o%cells%place(x, moved)
  end subroutine move_mesh

  !> Where the free grains are; element 0 outside of the elements of free grains.
  subroutine find_all(o, moved, x, spot)
    type(overlap_type), intent(in) :: o
    type(cells_type), intent(in) :: moved
    real(wp), intent(in) :: x(:, :)  !! (3, free) [m]
    type(spot_type), intent(out) :: spot(:)
    integer(i4) :: k
    do k = 1, size(x, 2)
      call moved%find(x(:, k), o%sets%part, spot(k))
      if (spot(k)%element == 0) cycle
      if (o%sets%part(spot(k)%element) /= part_free) spot(k) = spot_type()
    end do
  end subroutine find_all
end module cpl_overlap_remap
