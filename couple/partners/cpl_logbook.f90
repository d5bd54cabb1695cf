!> What every coupled run reports to its user, whatever its method: header, solvers, overhead.
module cpl_logbook
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number, duration_text
  use talus_timers, only: timers_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: begin_log, log_solvers, log_row_titles, log_cells, work_share, overhead_text

contains

  !> Header and deck as read.
  subroutine begin_log(log, program, deck)
    type(log_type), intent(inout) :: log
    character(len=*), intent(in) :: program
    type(deck_type), intent(in) :: deck
    type(string_type), allocatable :: lines(:)
    character(len=:), allocatable :: title
    call deck%get('run', 1, 'title', title)
    call log%header(program, title, deck%source%path, deck%hash(), 1_i4, 1_i4)
    call deck%echo(lines)
    call log%deck_echo(lines)
  end subroutine begin_log

  !> Who answered HELLO.
  subroutine log_solvers(log, solvers)
    type(log_type), intent(inout) :: log
    type(cpl_solver_type), intent(in) :: solvers(2)
    integer(i4) :: k
    call log%section('Solvers')
    do k = 1, 2
      call log%item(solvers(k)%side, solvers(k)%title(), solvers(k)%program//' '// &
                    solvers(k)%version//', deck hash '//solvers(k)%deck_hash//', '// &
                    str(solvers(k)%ranks)//' rank, port '//solvers(k)%port%spec)
    end do
    call log%item('gravity', str(solvers(1)%gravity)//' m/s2')
  end subroutine log_solvers

  !> Titles of the rows of the log; `third` is the method's own.
  subroutine log_row_titles(log, third)
    type(log_type), intent(inout) :: log
    character(len=*), intent(in) :: third  !! with its unit
    type(string_type) :: titles(8)
    titles(1)%s = 'time [s]'
    titles(2)%s = 'ghosts moved [m]'
    titles(3)%s = third
    titles(4)%s = 'kinetic [J]'
    titles(5)%s = 'elastic grains [J]'
    titles(6)%s = 'elastic solid [J]'
    titles(7)%s = 'overhead [%]'
    titles(8)%s = 'time left'
    call log%row_titles(titles)
  end subroutine log_row_titles

  !> A row of the log.
  subroutine log_cells(log, values, left)
    type(log_type), intent(inout) :: log
    real(wp), intent(in) :: values(7)  !! of the titles; overhead is a share
    real(wp), intent(in) :: left       !! wall time [s], < 0 not known
    type(string_type) :: cells(8)
    integer(i4) :: k
    do k = 1, 6
      cells(k)%s = short_number(values(k))
    end do
    cells(7)%s = short_number(100.0_wp*values(7))
    cells(8)%s = '-'
    if (left >= 0.0_wp) cells(8)%s = duration_text(left)
    call log%row(cells)
  end subroutine log_cells

  !> Share of the time since `begun` [s of the timers] in which no solver was waited for: the work
  !! of the coupling, much of it done while they work.
  real(wp) function work_share(timers, begun, waited_before)
    type(timers_type), intent(inout) :: timers
    real(wp), intent(in) :: begun          !! elapsed time when the exchanges began [s]
    real(wp), intent(in) :: waited_before  !! waits until then [s]
    real(wp) :: whole
    whole = max(timers%elapsed() - begun, tiny(1.0_wp))
    work_share = max(0.0_wp, whole - (waited(timers) - waited_before))/whole
  end function work_share

  !> How long the grains waited for the coupling, and how long it worked.
  function overhead_text(overhead) result(text)
    real(wp), intent(in) :: overhead(2)  !! shares that the grains waited for, and worked
    character(len=:), allocatable :: text
    text = 'coupling overhead '//short_number(100.0_wp*overhead(1))//' % of the run time'
    if (abs(overhead(1) - overhead(2)) > 0.0_wp) text = text//', with what it does while the '// &
      'grains work '//short_number(100.0_wp*overhead(2))//' %'
  end function overhead_text

  real(wp) function waited(timers)
    type(timers_type), intent(inout) :: timers
    integer(i4) :: n
    call timers%index('waiting for grains', n)
    waited = timers%seconds(n)
    call timers%index('waiting for solid', n)
    waited = waited + timers%seconds(n)
  end function waited
end module cpl_logbook
