!> Liquid among the grains in a run: the groups &fluid, &pore_grid and &drain, when exchanges are
!! due, the history (theory-dem, Liquid among the grains). Faults D364 to D369, D371, D372.
module dem_pore
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_log, only: log_type, short_number
  use dem_state, only: dem_data_type
  use dem_pore_cavity, only: hydrostatic, is_cavity
  use dem_pore_deck, only: read_liquid, read_grid, read_drains, check_run, check_start
  use dem_pore_state, only: sum_swept, sum_inflow, sum_hull, sum_flow, sum_work, sum_darcy, &
    sum_drag, sum_exchange, sum_seepage, sum_tools
  use dem_pore_exchange, only: begin_exchange, end_exchange
  use dem_pore_grid, only: brick_edges
  use dem_pore_laws, only: law_constant, law_kozeny_carman
  use dem_pore_medium, only: porosity_change
  use dem_pore_mixing, only: alternating
  use dem_pore_side, only: side_mean
  use dem_pore_partner, only: node_storage
  use dem_pore_start, only: begin_pore, carry_liquid
  use dem_pore_tool_rows, only: open_tip_history, open_tool_history, read_tools, write_tip_rows, &
    write_tool_rows
  implicit none
  private
  public :: dem_pore_control_type, mass_error

  real(wp), parameter :: longest_exchange = 1.2_wp  !! over the stable step
  real(wp), parameter :: most_reynolds = 10.0_wp  !! of Darcy's law
  real(wp), parameter :: most_change = 0.2_wp     !! of a porosity
  real(wp), parameter :: loose = 1.5_wp  !! of that in a run, as the bound is on the safe side
  character(len=24), parameter :: columns(32) = [character(len=24) :: 'time [s]', &
    'least_pressure [Pa]', 'most_pressure [Pa]', 'pressure_x0 [Pa]', 'pressure_x1 [Pa]', &
    'pressure_y0 [Pa]', 'pressure_y1 [Pa]', 'pressure_z0 [Pa]', 'pressure_z1 [Pa]', &
    'content [m3]', 'inflow [m3]', 'swept [m3]', 'balance [-]', 'out_x0 [m3]', 'out_x1 [m3]', &
    'out_y0 [m3]', 'out_y1 [m3]', 'out_z0 [m3]', 'out_z1 [m3]', 'work [J]', 'wall_work [J]', &
    'drain_work [J]', 'darcy [J]', 'drag [J]', 'exchange [J]', 'stored [J]', 'implicit [m3]', &
    'porosity_change [-]', 'exchanges [-]', 'turns [-]', 'cavities [-]', &
    'alternating [Pa]']

  type :: dem_pore_control_type
    logical :: active = .false.
    logical :: carried = .true.
    real(wp) :: cavitation = 0.0_wp         !! tension at which the liquid cavitates [Pa]
    type(curve_type), allocatable :: curves(:)
    integer(i4) :: curve(2, 3) = 0          !! of each side's drain, 0: none
    real(wp) :: value(2, 3) = 0.0_wp        !! of each drain [Pa] or [m/s]
    type(history_type) :: history
    type(history_type) :: of_tools          !! what the liquid does to closed bodies
    type(history_type) :: of_tips           !! what it and contacts do to parts of penetrometers
  contains
    procedure :: read => read_pore
    procedure :: check => check_exchange
    procedure :: watch
    procedure :: fitting_block
    procedure :: due
    procedure :: exchange
    procedure :: text => pore_text
    procedure :: audit => audit_text
    procedure :: warn
    procedure :: open => open_history
    procedure :: write => write_row
    procedure :: flush => flush_histories
    procedure :: close => close_histories
  end type dem_pore_control_type

contains

  !> The groups of the liquid; the grains carry their part of it from now on.
  subroutine read_pore(self, deck, d, curves, served, ranks, errors)
    class(dem_pore_control_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(inout) :: d
    type(curve_type), intent(in) :: curves(:)
    logical, intent(in) :: served
    integer(i4), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before

    before = errors%count
    call check_run(deck, ranks, errors)
    self%active = deck%count('pore_grid') > 0
    if (.not. self%active .or. errors%count > before) return
    self%curves = curves
    call read_liquid(deck, d%pore, errors)
    call deck%get('pore_grid', 1, 'carried', self%carried)
    call deck%get('pore_grid', 1, 'cavitation', self%cavitation)
    call read_drains(deck, curves, served, d%pore, self%curve, errors)
    self%value = d%pore%drain_value
    call read_grid(deck, d, errors)
    if (errors%count > before) return
    call read_tools(deck, d, errors)
    if (errors%count > before) return
    call begin_pore(d%grains, d%pore)
    call check_start(deck, served, d, errors)
    if (errors%count > before) return
    if (self%carried) call carry_liquid(d)
    d%pore%active = .true.
  end subroutine read_pore

  !> Exchanges are no longer than the contacts allow (D369).
  subroutine check_exchange(self, deck, d, limit, errors)
    class(dem_pore_control_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: limit  !! stable step of the contacts [s]
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: allowed
    if (.not. self%active) return
    if (d%pore%every*d%par%dt <= (1.0_wp + 1.0e-6_wp)*longest_exchange*limit) return
    allowed = int(longest_exchange*limit/d%par%dt, i4)
    if (allowed == 3) allowed = 2
    call deck%fault(errors, 'D369', 'an exchange of '//str(d%pore%every)//' steps of '// &
                    short_number(d%par%dt)//' s is longer than 1.2 times the stable step of '// &
                    'the contacts, '//short_number(limit)//' s', 'pore_grid', 1, 'exchange', &
                    trim(merge('take exchange = '//str(max(allowed, 1))//', or a smaller step', &
                               'take a smaller step                ', allowed > 0)))
  end subroutine check_exchange

  !> The same in a run, in which contacts may have become stiffer (N232).
  subroutine watch(self, d, time, limit, errors)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: time   !! [s]
    real(wp), intent(in) :: limit  !! stable step of the contacts [s]
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    if (d%pore%every*d%par%dt <= loose*longest_exchange*limit) return
    call errors%add('N232', 'at '//short_number(time)//' s an exchange of '//str(d%pore%every)// &
                    ' steps of '//short_number(d%par%dt)//' s has become longer than '// &
                    short_number(loose*longest_exchange)//' times the stable step of the '// &
                    'contacts, '//short_number(limit)//' s', 'group pore_grid', &
                    'a smaller exchange, dt or dt_factor')
  end subroutine watch

  !> Steps in a block of which a whole number is an exchange, and the block that others want.
  pure integer(i4) function fitting_block(self, d, block) result(steps)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: block
    steps = block
    if (.not. self%active) return
    steps = d%pore%every
    do while (modulo(block, steps) /= 0 .or. modulo(d%pore%every, steps) /= 0)
      steps = steps - 1
    end do
  end function fitting_block

  !> Is an exchange due before the next step?
  pure logical function due(self, d, steps)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: steps  !! taken so far
    due = .false.
    if (self%active) due = modulo(steps, int(d%pore%every, i8)) == 0
  end function due

  !> End the exchange under way and begin the next.
  subroutine exchange(self, d, time, errors)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: axis, end
    real(wp) :: span
    call end_exchange(d, time)
    span = d%pore%every*d%par%dt
    do axis = 1, 3
      do end = 1, 2
        if (self%curve(end, axis) == 0) cycle
        d%pore%drain_value(end, axis) = self%value(end, axis)* &
          self%curves(self%curve(end, axis))%at(time + span)
      end do
    end do
    call begin_exchange(d, time, span, self%cavitation, errors)
  end subroutine exchange

  !> Grid and pores, for the log.
  function pore_text(self, d) result(text)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    character(len=:), allocatable :: text
    text = ''
    if (.not. self%active) return
    text = str(d%pore%grid%bricks(1))//' x '//str(d%pore%grid%bricks(2))//' x '// &
      str(d%pore%grid%bricks(3))//' bricks of '//str(brick_edges(d%pore%grid))// &
      ' m, porosity '//short_number(minval(d%pore%porosity))//' to '// &
      short_number(maxval(d%pore%porosity))//', permeability '// &
      short_number(minval(d%pore%mobility)*d%pore%liquid%viscosity)//' to '// &
      short_number(maxval(d%pore%mobility)*d%pore%liquid%viscosity)//' m2'
  end function pore_text

  !> Volumes and works of all exchanges, for the end of the log.
  function audit_text(self, d) result(text)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    character(len=:), allocatable :: text
    text = ''
    if (.not. self%active) return
    associate (s => d%pore%sums)
      text = str(d%pore%exchanges)//' exchanges, '//short_number(sum(d%pore%omega))// &
        ' m3 compressed, '//short_number(s(sum_inflow))//' m3 in through drains, '// &
        short_number(s(sum_swept))//' m3 swept by walls, balance '// &
        short_number(mass_error(d))//' of the pores; '//short_number(s(sum_darcy))// &
        ' J lost to flow'
    end associate
  end function audit_text

  !> Flow too fast for a law of slow flow (W437), pores far from those at the start (W439).
  subroutine warn(self, d, log)
    class(dem_pore_control_type), intent(in) :: self
    type(dem_data_type), intent(in) :: d
    class(log_type), intent(inout) :: log
    if (.not. self%active) return
    associate (pore => d%pore)
      if (any(pore%liquid%law == [law_constant, law_kozeny_carman]) .and. &
          pore%fastest(1) > most_reynolds) call log%warn('W437'//': the flow reached a '// &
          'Reynolds '// &
          'number of '//short_number(pore%fastest(1))//' at '//short_number(pore%fastest(2))// &
          " s, too fast for this law: take law = 'ergun'")
      if (pore%changed(1) > most_change) call log%warn('W439'//': the porosity of a brick has '// &
        'changed by '//short_number(pore%changed(1))//' at '//short_number(pore%changed(2))// &
        ' s; what grains carry is of the start: write a packing and begin again from it, or '// &
        'set carried = .false.')
    end associate
  end subroutine warn

  !> What the volume of the liquid has changed by without having come or gone, over the pores.
  real(wp) function mass_error(d)
    type(dem_data_type), intent(in) :: d
    real(wp) :: pores
    pores = sum(d%pore%porosity*d%pore%room)*product(brick_edges(d%pore%grid))
    mass_error = abs(sum(d%pore%omega) - d%pore%sums(sum_inflow) - d%pore%sums(sum_swept))/pores
  end function mass_error

  !> Begin <stem>_pore.csv, or go on in it after a restart at time >= 0.
  subroutine open_history(self, d, stem, time, errors)
    class(dem_pore_control_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    if (self%active) call self%history%begin(stem//'_pore.csv', columns, time, errors)
    if (self%active) call open_tool_history(self%of_tools, d, stem, time, errors)
    if (self%active) call open_tip_history(self%of_tips, d, stem, time, errors)
  end subroutine open_history

  !> Pressures of the exchange under way, sums of those that are over.
  subroutine write_row(self, time, d, errors)
    class(dem_pore_control_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: c(size(d%pore%p)), rest(size(d%pore%p)), side(6)
    integer(i4) :: k
    if (.not. self%history%is_open()) return
    call write_tool_rows(self%of_tools, time, d, errors)
    call write_tip_rows(self%of_tips, time, d, errors)
    associate (pore => d%pore, s => d%pore%sums)
      call node_storage(pore, c)
      side = [(side_mean(d%pore, k), k=1, 6)]
      rest = hydrostatic(pore%grid, pore%liquid%density*d%par%gravity_scale*d%par%gravity)
      call self%history%write([time, minval(pore%p), maxval(pore%p), side, sum(pore%omega), &
        s(sum_inflow), s(sum_swept), mass_error(d), s(sum_seepage + 1:sum_seepage + 6), &
        s(sum_work), s(sum_hull) + s(sum_tools), s(sum_flow), s(sum_darcy), s(sum_drag), &
        s(sum_exchange), pore%stored, sum(abs(pore%omega - c*pore%p)), porosity_change(pore), &
        real(pore%exchanges, wp), &
        real(pore%turns, wp), real(count(is_cavity(pore%p, -self%cavitation - rest)), wp), &
        alternating(pore)], errors)
    end associate
  end subroutine write_row

  subroutine flush_histories(self, errors)
    class(dem_pore_control_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%flush(errors)
    call self%of_tools%flush(errors)
    call self%of_tips%flush(errors)
  end subroutine flush_histories

  subroutine close_histories(self, errors)
    class(dem_pore_control_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%history%close(errors)
    call self%of_tools%close(errors)
    call self%of_tips%close(errors)
  end subroutine close_histories
end module dem_pore
