!> The liquid among the grains as named arrays, and back.
module dem_store_pore
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_pore_exchange, only: book_liquid
  use dem_pore_state, only: dem_pore_type, pore_sums, pore_tools_type
  use dem_pore_tool_loads, only: hold_loads
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: put_pore, get_pore

  integer(i4), parameter :: run_reals = 19 + pore_sums, tool_reals = 26

contains

  !> What an exchange leaves to the next; the fit is made anew from where it began.
  subroutine put_pore(pore, archive)
    type(dem_pore_type), intent(in) :: pore
    class(dem_archive_type), intent(inout) :: archive
    integer(i4) :: nodes, bricks
    nodes = size(pore%p)
    bricks = size(pore%porosity)
    call archive%put_reals('pore.nodes', reshape([pore%p, pore%omega, pore%hold_p], [nodes, 3]))
    call archive%put_integers('pore.hold', int(reshape(pore%hold, [1, nodes]), i8))
    call archive%put_reals('pore.bricks', reshape([pore%porosity, pore%first_porosity, &
                           pore%sauter, pore%speed, pore%mobility, pore%room], [bricks, 6]))
    call archive%put_reals('pore.start', pore%start_x)
    call archive%put_reals('pore.held', pore%held)
    call archive%put_reals('pore.drag', pore%drag)
    call archive%put_reals('pore.run', reshape([pore%since, pore%span, pore%stored, &
      pore%grid%lower, pore%grid%upper, reshape(pore%drain_value, [6]), pore%fastest, &
      pore%changed, pore%sums], [run_reals, 1]))
    if (pore%fit%tools%n > 0) call put_tools(pore%fit%tools, archive)
    call archive%put_integers('pore.counts', reshape([merge(1_i8, 0_i8, pore%open), &
                              pore%exchanges, int(pore%turns, i8)], [3, 1]))
  end subroutine put_pore

  !> Where closed bodies were when the exchange began, and what the liquid does to them.
  subroutine put_tools(tools, archive)
    type(pore_tools_type), intent(in) :: tools
    class(dem_archive_type), intent(inout) :: archive
    real(wp) :: rows(tool_reals, tools%n)
    rows(:3, :) = tools%centre
    rows(4:7, :) = tools%quat
    rows(8:13, :) = tools%load
    rows(14:19, :) = tools%drag
    rows(20:25, :) = tools%lift
    rows(26, :) = tools%work
    call archive%put_reals('pore.tools', rows)
    if (tools%tips%n > 0) &
      call archive%put_reals('pore.tips', reshape([tools%tips%load, tools%tips%drag, &
                                                   tools%tips%lift], [3*tools%tips%n, 3]))
  end subroutine put_tools

  !> The same back; the bodies feel it.
  subroutine get_tools(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    associate (tools => d%pore%fit%tools)
      call archive%get_reals('pore.tools', tool_reals, tools%n, rows, errors)
      if (errors%any()) return
      tools%centre = rows(:3, :)
      tools%quat = rows(4:7, :)
      tools%load = rows(8:13, :)
      tools%drag = rows(14:19, :)
      tools%lift = rows(20:25, :)
      tools%work = rows(26, :)
      if (tools%tips%n > 0) then
        call archive%get_reals('pore.tips', 3*tools%tips%n, 3, rows, errors)
        if (errors%any()) return
        tools%tips%load = reshape(rows(:, 1), [3, tools%tips%n])
        tools%tips%drag = reshape(rows(:, 2), [3, tools%tips%n])
        tools%tips%lift = reshape(rows(:, 3), [3, tools%tips%n])
      end if
    end associate
    call hold_loads(d)
  end subroutine get_tools

  !> The same back. A run with a liquid goes on from one with a liquid, one without from one
  !! without.
  subroutine get_pore(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: nodes(:, :), bricks(:, :), run(:, :)
    integer(i8), allocatable :: hold(:, :), counts(:, :)

    if (.not. d%pore%active) then
      if (archive%find('pore.run') > 0) &
        call archive%refuse('pore.run', 'is of a run with a liquid, this deck has none', errors)
      return
    end if
    associate (pore => d%pore)
      call archive%get_reals('pore.nodes', size(pore%p, kind=i4), 3, nodes, errors)
      call archive%get_integers('pore.hold', 1, size(pore%p, kind=i4), hold, errors, [0_i8, 7_i8])
      call archive%get_reals('pore.bricks', size(pore%porosity, kind=i4), 6, bricks, errors)
      call archive%get_reals('pore.run', run_reals, 1, run, errors)
      call archive%get_integers('pore.counts', 3, 1, counts, errors, [-1_i8, huge(1_i8)])
      if (errors%any()) return
      call archive%get_reals('pore.start', 3, d%grains%n, pore%start_x, errors)
      call archive%get_reals('pore.held', 3, d%grains%n, pore%held, errors)
      call archive%get_reals('pore.drag', 3, d%grains%n, pore%drag, errors)
      if (errors%any()) return
      pore%p = nodes(:, 1)
      pore%omega = nodes(:, 2)
      pore%hold_p = nodes(:, 3)
      pore%hold = int(hold(1, :), i4)
      pore%porosity = bricks(:, 1)
      pore%first_porosity = bricks(:, 2)
      pore%sauter = bricks(:, 3)
      pore%speed = bricks(:, 4)
      pore%mobility = bricks(:, 5)
      pore%room = bricks(:, 6)
      pore%since = run(1, 1)
      pore%span = run(2, 1)
      pore%stored = run(3, 1)
      pore%grid%lower = run(4:6, 1)
      pore%grid%upper = run(7:9, 1)
      pore%drain_value = reshape(run(10:15, 1), [2, 3])
      pore%fastest = run(16:17, 1)
      pore%changed = run(18:19, 1)
      pore%sums = run(20:, 1)
      pore%open = counts(1, 1) == 1
      pore%exchanges = counts(2, 1)
      pore%turns = int(counts(3, 1), i4)
      pore%fit%ready = .false.
    end associate
    if (d%pore%fit%tools%n > 0) call get_tools(d, archive, errors)
    if (errors%any()) return
    call book_liquid(d)
  end subroutine get_pore
end module dem_store_pore
