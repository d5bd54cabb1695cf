!> Log of a run: header, model, rows, health.
module dem_logbook
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number, duration_text
  use dem_state, only: kind_free, kind_fixed, kind_driven, kind_ghost, kind_member
  use dem_shape, only: bulge, hertz_radius
  use dem_shape_state, only: shape_octants, shape_powers
  use dem_system, only: dem_system_type
  use dem_histories, only: relative_closure
  use dem_clock, only: dem_clock_type
  use dem_surface_body, only: is_free
  use dem_surface_state, only: dem_surfaces_type, surface_cone, is_cylinder, is_bore
  use dem_setup, only: dem_choices_type
  use dem_setup_laws, only: law_lines
  implicit none
  private
  public :: begin_log, log_model, log_row_titles, log_row, log_health

contains

  !> Header and deck as understood.
  subroutine begin_log(log, program, deck, ranks, threads)
    type(log_type), intent(inout) :: log
    character(len=*), intent(in) :: program
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: ranks, threads
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: title

    call deck%get('run', 1, 'title', title)
    call log%header(program, title, deck%source%path, deck%hash(), ranks, threads)
    call deck%echo(lines)
    call log%deck_echo(lines)
  end subroutine begin_log

  !> Size of the model, laws, step and its limits.
  subroutine log_model(log, deck, system, choices, clock)
    type(log_type), intent(inout) :: log
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(dem_choices_type), intent(in) :: choices
    type(dem_clock_type), intent(in) :: clock
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: how
    real(wp) :: limit
    integer(i4) :: k

    call log%section('Model')
    call log%item('grains', str(system%grains%n), counted(system, kind_free)//' free, '// &
                  counted(system, kind_fixed)//' fixed, '//counted(system, kind_driven)// &
                  ' driven, '//counted(system, kind_ghost)//' ghosts')
    if (system%grains%shapes%in_use) call log_shapes(log, system)
    if (system%clumps%n > 0) call log%item('clumps', str(system%clumps%n), 'of '// &
      counted(system, kind_member)//' of these grains, '//str(maxval(system%clumps%template))// &
      ' templates')
    call log%item('walls', str(system%planes%n))
    do k = 1, system%surfaces%n
      call log%item(trim(merge('surfaces', '        ', k == 1)), system%surfaces%name(k)%s, &
                    surface_text(system%surfaces, k))
    end do
    call law_lines(deck, system%laws, choices%material, lines)
    do k = 1, size(lines)
      call log%item(trim(merge('contact laws', '            ', k == 1)), lines(k)%s)
    end do
    call log%item('contacts', str(system%contact_number()), &
                  str(system%pair_number())//' candidate pairs, skin '// &
                  short_number(system%pairs%skin)//' m')
    if (system%springs%given > 0) call log%item('friction', str(system%springs%used), &
      'of these contacts begin with the tangential force of the packing ('// &
      str(system%springs%given)//' in the file)')
    limit = system%step_limit()
    how = 'no contacts yet'
    if (limit < 0.1_wp*huge(limit)) how = short_number(limit)//' s'
    call log%item('stability limit', how)
    limit = system%rayleigh_limit()
    if (limit < 0.1_wp*huge(limit)) call log%item('Rayleigh time', short_number(limit)//' s')
    how = 'given'
    if (clock%automatic) how = 'automatic, '//short_number(system%par%dt_factor)// &
      ' of the limits'
    if (clock%dt > 0.0_wp) call log%item('time step', str(clock%dt)//' s', how)
    call log%memory()
  end subroutine log_model

  !> How many grains are no ellipsoids, and how far the flat spots of superquadrics are rounded.
  subroutine log_shapes(log, system)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(in) :: system
    real(wp) :: most
    associate (f => system%grains%shapes)
      call log%item('poly-ellipsoids', str(count(f%kind(:f%n) == shape_octants)))
      most = maxval(f%exponent)
      if (.not. most > 2.0_wp) return
      call log%item('superquadrics', str(count(f%kind(:f%n) == shape_powers)), &
                    'exponents to '//short_number(most)//', flat spots rounded by '// &
                    short_number(bulge)//' of the semi-axis, radii in Hertz''s law to '// &
                    short_number(hertz_radius)//' mean semi-axes')
    end associate
  end subroutine log_shapes

  !> Size of a surface, and its free edges if it has any.
  function surface_text(s, k) result(text)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text
    integer(i4) :: rim
    if (s%kind(k) == surface_cone) then
      text = 'cone and shaft'//free_text(s, k)
      return
    end if
    if (is_cylinder(s, k)) then
      text = 'cylinder of radius '//short_number(s%round%radius(k))//' m, grains '// &
        trim(merge('inside ', 'outside', is_bore(s, k)))//free_text(s, k)
      return
    end if
    associate (low => s%first_triangle(k), high => s%first_triangle(k + 1) - 1)
      rim = count(s%mesh%mate(:, low:high) == 0)
      text = str(high - low + 1)//' triangles, '//str(s%first_vertex(k + 1) - s%first_vertex(k))// &
        ' corners'
    end associate
    if (rim == 0) text = text//', closed'
    if (rim > 0) text = text//', open: '//str(rim)//' free edges'
    text = text//free_text(s, k)
  end function surface_text

  !> In which directions a body moves and turns freely.
  function free_text(s, k) result(text)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: text
    character(len=3), parameter :: direction(6) = [' x ', ' y ', ' z ', ' rx', ' ry', ' rz']
    integer(i4) :: j
    text = ''
    if (.not. is_free(s, k)) return
    text = ', free:'
    do j = 1, 6
      if (s%rigid%free(j, k) > 0.5_wp) text = text//trim(direction(j))
    end do
  end function free_text

  function counted(system, kind) result(text)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: kind
    character(len=:), allocatable :: text
    text = str(count(system%grains%kind == kind))
  end function counted

  subroutine log_row_titles(log)
    type(log_type), intent(inout) :: log
    type(string_type) :: titles(8)
    titles(1)%s = 'time [s]'
    titles(2)%s = 'steps'
    titles(3)%s = 'contacts'
    titles(4)%s = 'kinetic [J]'
    titles(5)%s = 'energy error'
    titles(6)%s = 'max overlap'
    titles(7)%s = 'ms/step'
    titles(8)%s = 'time left'
    call log%row_titles(titles)
  end subroutine log_row_titles

  !> One row; step_time and left are wall times [s], left < 0 is not known.
  subroutine log_row(log, system, clock, step_time, left)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    real(wp), intent(in) :: step_time, left
    type(string_type) :: cells(8)

    call system%refresh_ledger()
    cells(1)%s = short_number(clock%time())
    cells(2)%s = str(clock%steps)
    cells(3)%s = str(system%contact_number())
    cells(4)%s = short_number(system%ledger%kinetic)
    cells(5)%s = short_number(relative_closure(system))
    cells(6)%s = short_number(system%health%max_overlap)
    cells(7)%s = short_number(1.0e3_wp*step_time)
    cells(8)%s = '-'
    if (left >= 0.0_wp) cells(8)%s = duration_text(left)
    call log%row(cells)
  end subroutine log_row

  !> The line on the health of the run.
  subroutine log_health(log, system, clock)
    type(log_type), intent(inout) :: log
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    character(len=:), allocatable :: text

    call system%refresh_ledger()
    text = 'energy error '//short_number(relative_closure(system))//', largest overlap '// &
      short_number(100.0_wp*system%health%max_overlap)//' % of the least semi-axis, '// &
      str(system%health%rebuilds)//' list rebuilds, '//str(system%health%late_rebuilds)//' late'
    if (system%pairs%additional%bond%given) text = text//', '//str(system%pairs%additional%made)// &
      ' bonds, of which '//str(system%pairs%additional%torn)//' torn and '// &
      str(system%pairs%additional%sheared)//' sheared'
    if (clock%unstable > 0) text = text//', step above the stability limit at '// &
      str(clock%unstable)//' checks'
    call log%health(text)
  end subroutine log_health
end module dem_logbook
