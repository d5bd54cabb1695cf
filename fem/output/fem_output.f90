!> Results of a body: energy ledger and reactions as CSV, fields in HDF5 with XDMF.
module fem_output
  use talus_intervals, only: intervals_until
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use talus_series, only: series_type
  use talus_xdmf, only: xdmf_type, xdmf_node, xdmf_cell
  use fem_types, only: group_facet, group_node, group_volume
  use fem_mesh, only: find_group
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_cells, only: put_cells, describe_cells
  use fem_elastic, only: classical
  use fem_mm_output, only: describe_micro, put_micro, chi_names, chi_values
  use fem_output_pore, only: describe_pore, put_pore, pore_ledger, pore_titles, write_pore
  use fem_output_state, only: put_states, describe_states, newton_titles, write_newton
  use fem_rigid, only: moment_of
  use fem_recover, only: point_stress, mean_stress, nodal_stress, point_positions, nodal_rotation
  implicit none
  private
  public :: fem_output_type, energy_error

  character(len=*), parameter :: format_name = 'talus-solid'
  real(wp), parameter :: near = 1.0e-6_wp  !! of an interval that counts as on time

  !> What is written, and when the next of each is due.
  type :: fem_output_type
    real(wp) :: every_history = 0.0_wp, every_output = 0.0_wp  !! [s], 0 never
    integer(i8) :: next_history = 0, next_output = 0
    real(wp) :: last_field = -1.0_wp                           !! time of the last field step [s]
    logical :: points = .false.                                  !! stress at points is written
    integer(i4), allocatable :: support(:)                     !! groups whose reactions are written
    type(history_type) :: energy, reactions, newton, rigid, table, pore
    type(series_type) :: series
    type(xdmf_type) :: xdmf
  contains
    procedure :: open => open_output
    procedure :: write_due
    procedure :: write_fields
    procedure :: write_last
    procedure :: write_history
    procedure :: write_iterations
    procedure :: flush => flush_output
    procedure :: close => close_output
  end type fem_output_type

  !> A field step that is being written.
  type :: field_step_type
    logical :: leads = .true.  !! this rank writes
    type(h5_file_type) :: file
    character(len=:), allocatable :: group
  contains
    procedure :: put => put_field
    procedure :: put_stress
  end type field_step_type

contains

  !> Open all files; start_time < 0 is a fresh run, else rows and steps later than it are cut.
  subroutine open_output(self, deck, stem, body, analysis, start_time, errors)
    class(fem_output_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: stem
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    real(wp), intent(in) :: start_time
    type(error_list_type), intent(inout) :: errors

    call deck%get('history', 1, 'every_time', self%every_history)
    call deck%get('output', 1, 'every_time', self%every_output)
    self%points = deck%given('output', 1, 'fields')  ! there is one choice
    if (deck%count('history') == 0) self%every_history = 0.0_wp
    if (deck%count('output') == 0) self%every_output = 0.0_wp
    if (start_time >= 0.0_wp) then
      if (self%every_history > 0.0_wp) self%next_history = after(start_time, self%every_history)
      if (self%every_output > 0.0_wp) self%next_output = after(start_time, self%every_output)
    end if
    if (self%every_history > 0.0_wp) call list_supports(self, deck, body)
    if (.not. body%whole%ranks%leads()) return
    if (self%every_history > 0.0_wp) call open_histories(self, stem, body, start_time, errors)
    if (self%every_history > 0.0_wp .or. analysis%listed) &
      call open_table(self, stem, body, analysis, start_time, errors)
    if (self%every_output > 0.0_wp) call open_fields(self, stem, body, start_time, errors)
  end subroutine open_output

  pure integer(i8) function after(time, every)
    real(wp), intent(in) :: time, every
    after = intervals_until(time + near*every, every) + 1
  end function after

  !> Groups whose reactions are written: those of supports and motions, each once.
  subroutine list_supports(self, deck, body)
    class(fem_output_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=:), allocatable :: name
    integer(i4) :: s, g
    allocate (self%support(0))
    do s = 1, deck%count('support') + deck%count('motion')
      if (s <= deck%count('support')) then
        call deck%get('support', s, 'group', name)
      else
        call deck%get('motion', s - deck%count('support'), 'group', name)
      end if
      g = find_group(body%mesh, name, [group_facet, group_node, group_volume])
      if (g > 0 .and. .not. any(self%support == g)) self%support = [self%support, g]
    end do
  end subroutine list_supports

  subroutine open_histories(self, stem, body, start_time, errors)
    class(fem_output_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: start_time
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    character(len=:), allocatable :: name
    character(len=1), parameter :: letters(3) = ['x', 'y', 'z']
    character(len=*), parameter :: ledger(9) = [character(len=18) :: 'time [s]', 'strain [J]', &
      'kinetic [J]', 'load [J]', 'gravity [J]', 'support [J]', 'spring [J]', 'damping [J]', &
      'numerical [J]']
    integer(i4) :: k, c

    do k = 1, size(ledger)
      call append_string(columns, trim(ledger(k)))
    end do
    if (body%matter%active) call append_string(columns, 'plastic [J]')
    if (body%pore%active) call pore_ledger(columns)
    call append_string(columns, 'closure [J]')
    call self%energy%begin(stem//'_energy.csv', columns, start_time, errors)
    deallocate (columns)
    call append_string(columns, 'time [s]')
    do k = 1, size(self%support)
      name = trim(body%mesh%group(self%support(k))%name)
      do c = 1, 3
        call append_string(columns, name//' '//letters(c)//' [N]')
      end do
      if (.not. any(body%dofs%phi(body%mesh%group(self%support(k))%node) > 0)) cycle
      if (body%matter%micro%active) then
        call chi_names(name, columns)
        cycle
      end if
      do c = 1, 3
        call append_string(columns, name//' r'//letters(c)//' [N m]')
      end do
    end do
    call self%reactions%begin(stem//'_reactions.csv', columns, start_time, errors)
    if (body%pore%active) &
      call self%pore%begin(stem//'_pore.csv', pore_titles(body), start_time, errors)
    if (allocated(body%supports%rigid)) call self%rigid%begin(stem//'_rigid.csv', &
      rigid_columns(body), start_time, errors)
    if (.not. body%matter%active .or. body%scheme%explicit) return
    call newton_titles(columns)
    call self%newton%begin(stem//'_newton.csv', columns, start_time, errors)
  end subroutine open_histories

  !> The table of an analysis that has one.
  subroutine open_table(self, stem, body, analysis, start_time, errors)
    class(fem_output_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    real(wp), intent(in) :: start_time
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    if (len(analysis%table) == 0) return
    call analysis%columns(body, columns)
    call self%table%begin(stem//'_'//analysis%table//'.csv', columns, start_time, errors)
  end subroutine open_table

  !> Columns of the rigid groups.
  function rigid_columns(body) result(columns)
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable :: columns(:)
    character(len=*), parameter :: names(10) = [character(len=15) :: 'x [m]', 'y [m]', 'z [m]', &
      'turn [rad]', 'force x [N]', 'force y [N]', 'force z [N]', 'moment x [N m]', &
      'moment y [N m]', 'moment z [N m]']
    integer(i4) :: k, c
    call append_string(columns, 'time [s]')
    do k = 1, size(body%supports%rigid)
      do c = 1, size(names)
        call append_string(columns, trim(body%supports%rigid(k)%name)//' '//trim(names(c)))
      end do
    end do
  end function rigid_columns

  subroutine open_fields(self, stem, body, start_time, errors)
    class(fem_output_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: start_time
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    logical :: found

    found = .false.
    if (start_time >= 0.0_wp) call self%series%resume(stem//'.h5', format_name, start_time, &
      found, errors)
    if (found .and. self%series%count > 0) &
      self%last_field = self%series%step(self%series%count)%time
    if (.not. found) then
      call self%series%start(stem//'.h5', format_name, file, errors)
      call put_mesh(body, file, errors)
      call file%commit(errors)
    end if
    call describe_mesh(body, stem//'.xdmf', self%xdmf)
    if (body%matter%micro%active) then
      call describe_micro(self%xdmf)
      return
    end if
    if (body%matter%active) call describe_states(body, self%xdmf)
    if (body%pore%active) call describe_pore(body, self%xdmf)
    call self%xdmf%attribute('u', 'u', xdmf_node, 3)
    call self%xdmf%attribute('v', 'v', xdmf_node, 3)
    call self%xdmf%attribute('reaction', 'reaction', xdmf_node, 3)
    if (body%elastic%components == classical) then
      call self%xdmf%attribute('stress', 'stress', xdmf_cell, 6)
      call self%xdmf%attribute('stress_nodal', 'stress_nodal', xdmf_node, 6)
      return
    end if
    call self%xdmf%attribute('stress', 'stress', xdmf_cell, 9)
    call self%xdmf%attribute('couple_stress', 'couple_stress', xdmf_cell, 9)
    call self%xdmf%attribute('stress_nodal', 'stress_nodal', xdmf_node, 9)
    call self%xdmf%attribute('couple_stress_nodal', 'couple_stress_nodal', xdmf_node, 9)
    call self%xdmf%attribute('phi', 'phi', xdmf_node, 3)
    call self%xdmf%attribute('phi_rate', 'phi_rate', xdmf_node, 3)
    call self%xdmf%attribute('reaction_couple', 'reaction_couple', xdmf_node, 3)
  end subroutine open_fields

  !> The cells of all ranks.
  subroutine put_mesh(body, file, errors)
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (body%whole%ranks%several()) then
      call put_cells(body%whole%mesh, file, errors)
    else
      call put_cells(body%mesh, file, errors)
    end if
  end subroutine put_mesh

  subroutine describe_mesh(body, path, xdmf)
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: path
    type(xdmf_type), intent(inout) :: xdmf
    if (body%whole%ranks%several()) then
      call describe_cells(body%whole%mesh, path, xdmf)
    else
      call describe_cells(body%mesh, path, xdmf)
    end if
  end subroutine describe_mesh

  !> The iterations of a step, if histories are written and some law has a state.
  subroutine write_iterations(self, body, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    if (self%newton%is_open()) call write_newton(body, self%newton, errors)
  end subroutine write_iterations

  !> Write what is due at the accepted state: of a list all, else by time; `last` writes all that is
  !! open once more if it lags.
  subroutine write_due(self, body, analysis, last, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    logical, intent(in) :: last
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t
    logical :: due

    t = body%accepted%time
    if (analysis%listed) then
      call write_row(self, body, analysis, errors)
      if (self%every_output > 0.0_wp) call self%write_fields(body, errors)
      return
    end if
    if (self%every_history > 0.0_wp) then
      if (t >= (self%next_history - near)*self%every_history) then
        call self%write_history(body, errors)
        call write_row(self, body, analysis, errors)
        self%next_history = after(t, self%every_history)
      end if
    end if
    if (self%every_output > 0.0_wp) then
      due = t >= (self%next_output - near)*self%every_output
      if (due .or. (last .and. self%last_field < t)) then
        self%series%extra = .not. due
        call self%write_fields(body, errors)
        self%next_output = after(t, self%every_output)
      end if
    end if
  end subroutine write_due

  !> The row of the analysis.
  subroutine write_row(self, body, analysis, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)
    if (.not. self%table%is_open()) return
    call analysis%row(body, values)
    if (size(values) > 0) call self%table%write(values, errors)
  end subroutine write_row

  !> Rows of the ledger and of the reactions; where nodes are dealt out all ranks call it together.
  subroutine write_history(self, body, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:)
    real(wp) :: works(9)
    integer(i4), allocatable :: block(:)
    integer(i4) :: s
    if (.not. (body%whole%ranks%leads() .or. body%whole%dealt)) return
    associate (e => body%accepted_energy, t => body%accepted%time)
      row = [t]
      do s = 1, size(self%support)
        block = body%mesh%group(self%support(s))%node
        row = [row, reaction_of(body, block)]
        block = pack(body%dofs%phi(block), body%dofs%phi(block) > 0)
        if (body%matter%micro%active) then
          if (size(block) > 0) row = [row, chi_values(body, block)]
          cycle
        end if
        if (size(block) > 0) row = [row, reaction_of(body, block)]
      end do
      if (.not. body%whole%ranks%leads()) return
      works = [t, e%strain, e%kinetic, e%load, e%gravity, e%support, e%spring, e%damping, &
               e%numerical]
      if (body%pore%active) then
        call self%energy%write([works, e%plastic, e%liquid, e%darcy, e%flow, closure(body)], errors)
        call write_pore(body, self%pore, errors)
      else if (body%matter%active) then
        call self%energy%write([works, e%plastic, closure(body)], errors)
      else
        call self%energy%write([works, closure(body)], errors)
      end if
      call self%reactions%write(row, errors)
      if (.not. allocated(body%supports%rigid)) return
      row = [t]
      do s = 1, size(body%supports%rigid)
        row = [row, moment_of(body%supports%rigid(s), body%loads%curve, body%mesh%x, &
          body%accepted%u, &
                              body%accepted%reaction, t)]
      end do
      call self%rigid%write(row, errors)
    end associate
  end subroutine write_history

  !> Sum of the reactions at some blocks, those of all ranks.
  function reaction_of(body, block) result(force)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: block(:)
    real(wp) :: force(3)
    force = sum(body%accepted%reaction(:, pack(block, body%dofs%halo%counts(block))), 2)
    call body%dofs%halo%total(force)
  end function reaction_of

  !> Work supplied minus energy stored and dissipated [J].
  pure real(wp) function closure(body)
    type(fem_body_type), intent(in) :: body
    associate (e => body%accepted_energy)
      closure = e%start + e%load + e%support + e%spring + e%flow - e%strain - e%kinetic &
                - e%damping - e%numerical - e%plastic - e%liquid - e%darcy
    end associate
  end function closure

  !> |closure| over the largest of the ledger's columns in the run so far.
  pure real(wp) function energy_error(body)
    type(fem_body_type), intent(in) :: body
    energy_error = 0.0_wp
    if (body%accepted_energy%largest > 0.0_wp) &
      energy_error = abs(closure(body))/body%accepted_energy%largest
  end function energy_error

  !> Fields of the accepted state; all ranks call it together, the leader writes.
  subroutine write_fields(self, body, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    type(field_step_type) :: step
    real(wp), allocatable :: stress(:, :), mean(:, :), nodal(:, :)
    integer(i4) :: n, c

    self%last_field = body%accepted%time
    step%leads = body%whole%ranks%leads()
    step%group = ''
    if (body%matter%micro%active) then
      if (step%leads) &
        call self%series%begin_step(body%accepted%time, step%file, step%group, errors)
      call put_micro(body, self%points, step%file, step%group, errors)
      if (step%leads) call self%series%end_step(int(body%mesh%nodes, i8), step%file, errors)
      if (step%leads) call self%xdmf%write(self%series, errors)
      return
    end if
    n = body%mesh%nodes
    c = body%elastic%components
    allocate (stress(c, body%elastic%points), mean(c, body%mesh%elements), nodal(c, n))
    if (body%matter%active) then
      stress = body%matter%accepted_stress
      call body%elastic%clear_absent(stress)
    else
      call point_stress(body%mesh, body%dofs, body%elastic, body%accepted%u, stress)
    end if
    call mean_stress(body%mesh, body%dofs, body%elastic, stress, mean)
    call nodal_stress(body%mesh, body%dofs, body%elastic, stress, nodal)
    call body%whole%collect_cells(mean)
    if (step%leads) call self%series%begin_step(body%accepted%time, step%file, step%group, errors)
    call put_nodes(body, 'u', whole_motion(body, n), step, errors)
    call put_nodes(body, 'v', shown_speed(body, n), step, errors)
    call put_nodes(body, 'reaction', body%accepted%reaction(:, :n), step, errors)
    call step%put_stress('stress', mean, errors)
    call put_nodes(body, 'stress_nodal', nodal, step, errors)
    if (c > classical) call write_rotations(body, nodal, step, errors)
    if (self%points) call write_points(body, stress, step, errors)
    if (body%matter%active) call put_states(body, self%points, step%file, step%group, errors)
    if (body%pore%active) call put_pore(body, mean, step%file, step%group, errors)
    if (step%leads) call self%series%end_step(int(body%mesh%total_nodes(), i8), step%file, errors)
    if (step%leads) call self%xdmf%write(self%series, errors)
  end subroutine write_fields

  !> Write values at the nodes of all ranks.
  subroutine put_nodes(body, name, values, step, errors)
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :)
    type(field_step_type), intent(inout) :: step
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: all(:, :)
    call body%collect_blocks(values, all)
    if (size(values, 1) > classical) then
      call step%put_stress(name, all, errors)
    else
      call step%put(name, all, errors)
    end if
  end subroutine put_nodes

  !> Displacements from the mesh of the deck, also of nodes that a partner has put elsewhere.
  pure function whole_motion(body, n) result(u)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: n
    real(wp) :: u(3, n)
    u = body%accepted%u(:, :n)
    if (allocated(body%port%moved)) u = u + body%port%moved(:, :n)
  end function whole_motion

  !> Velocities of the first n blocks, of prescribed ones as the partner gave them.
  pure function shown_speed(body, n) result(v)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: n
    real(wp) :: v(3, n)
    associate (given => body%port%given_v(:, :n))
      v = merge(given, body%accepted%v(:, :n), body%port%prescribed(:, :n) .and. &
                abs(given) > 0.0_wp)
    end associate
  end function shown_speed

  !> Micro-rotations, their rates and reactions; `nodal` is workspace.
  subroutine write_rotations(body, nodal, step, errors)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(inout) :: nodal(:, :)
    type(field_step_type), intent(inout) :: step
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: n
    n = body%mesh%nodes
    call nodal_rotation(body%dofs, body%elastic, body%accepted%u, nodal)
    call step%put('phi', nodal(:3, :), errors)
    call nodal_rotation(body%dofs, body%elastic, shown_speed(body, body%dofs%blocks), nodal)
    call step%put('phi_rate', nodal(:3, :), errors)
    nodal(:3, :) = 0.0_wp
    associate (last => body%dofs%solid)
      nodal(:3, body%dofs%node(n + 1:last)) = body%accepted%reaction(:, n + 1:last)
    end associate
    call step%put('reaction_couple', nodal(:3, :), errors)
  end subroutine write_rotations

  !> Positions and stresses of the quadrature points of all ranks.
  subroutine write_points(body, stress, step, errors)
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(inout) :: stress(:, :)
    type(field_step_type), intent(inout) :: step
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: position(:, :)
    allocate (position(3, body%elastic%points))
    call point_positions(body%mesh, body%dofs, body%elastic, position)
    call body%whole%collect_points(position)
    call step%put('points_x', position, errors)
    call body%whole%collect_points(stress)
    call step%put_stress('stress_points', stress, errors)
  end subroutine write_points

  !> Write a dataset, by the leader.
  subroutine put_field(self, name, values, errors)
    class(field_step_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    if (self%leads) call self%file%put(self%group//'/'//name, values, errors)
  end subroutine put_field

  !> Write stresses, of bodies with micropolar parts stress and couple stress apart.
  subroutine put_stress(self, name, values, errors)
    class(field_step_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    if (size(values, 1) == classical) then
      call self%put(name, values, errors)
      return
    end if
    call self%put(name, values(:9, :), errors)
    call self%put('couple_'//name, values(10:, :), errors)
  end subroutine put_stress

  !> Fields of the accepted state where a run ends by a fault, if fields are written at all.
  subroutine write_last(self, body, errors)
    class(fem_output_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    if (self%every_output > 0.0_wp .and. self%last_field < body%accepted%time) &
      call self%write_fields(body, errors)
  end subroutine write_last

  subroutine flush_output(self, errors)
    class(fem_output_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%energy%is_open()) call self%energy%flush(errors)
    if (self%reactions%is_open()) call self%reactions%flush(errors)
    if (self%newton%is_open()) call self%newton%flush(errors)
    if (self%rigid%is_open()) call self%rigid%flush(errors)
    if (self%pore%is_open()) call self%pore%flush(errors)
    if (self%table%is_open()) call self%table%flush(errors)
  end subroutine flush_output

  subroutine close_output(self, errors)
    class(fem_output_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (self%energy%is_open()) call self%energy%close(errors)
    if (self%reactions%is_open()) call self%reactions%close(errors)
    if (self%newton%is_open()) call self%newton%close(errors)
    if (self%rigid%is_open()) call self%rigid%close(errors)
    if (self%pore%is_open()) call self%pore%close(errors)
    if (self%table%is_open()) call self%table%close(errors)
  end subroutine close_output
end module fem_output
