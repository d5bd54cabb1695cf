!> Output of a run: log, histories, fields, measures, checkpoints. Output does not change the state,
!! so that a restart repeats the same steps.
module dem_run_output
  use omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_files, only: make_folder, folder_of
  use talus_log, only: short_number
  use dem_clock, only: event_history, event_output, event_checkpoint, event_measure
  use dem_restart, only: write_checkpoint
  use dem_logbook, only: begin_log, log_model, log_row_titles, log_row
  use dem_view, only: see_grains
  use dem_run_start, only: dem_started_run_type
  use dem_run_state, only: program_name
  implicit none
  private
  public :: dem_written_run_type

  !> A run with its log, histories, fields and checkpoints.
  type, extends(dem_started_run_type) :: dem_written_run_type
  contains
    procedure :: open => open_run
    procedure :: write_due
    procedure :: write_row
    procedure :: save_checkpoint
    procedure :: close_files
  end type dem_written_run_type

contains

  !> Open log, histories, fields; write a fresh run's first state; a last field off the output times
  !! is removed.
  subroutine open_run(self, errors)
    class(dem_written_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: packing
    integer(i4) :: k

    call self%stop%read(self%deck, self%served, errors)
    if (errors%any()) return
    call make_folder(folder_of(self%stem), errors)
    call self%deck%get('output', 1, 'packing', packing)
    if (len(packing) > 0) call make_folder(folder_of(folder_of(self%stem)//'/'//packing), errors)
    if (.not. errors%any()) call self%lock%take(self%stem, program_name, errors)
    if (errors%any()) return
    call self%log%open(self%stem//'.log', errors, append=self%start_time >= 0.0_wp)
    if (errors%any()) return
    self%opened = .true.
    call begin_log(self%log, program_name, self%deck, self%ranks%ranks, &
                   int(omp_get_max_threads(), i4))
    call log_model(self%log, self%deck, self%system, self%choices, self%clock)
    call self%breakage%log_groups(self%log)
    if (self%surcharge%active) &
      call self%log%item('surcharge', self%surcharge%text(self%system%dem_data_type))
    if (self%pore%active) &
      call self%log%item('liquid', self%pore%text(self%system%dem_data_type))
    if (len(self%restart_path) > 0) call self%log%item('goes on from', self%restart_path, &
      'time '//str(self%start_time)//' s, step '//str(self%start_steps))
    call open_files(self, errors)
    if (.not. errors%any()) call self%measures%open(self%stem, self%start_time, errors)
    do k = 1, size(self%warnings)
      call self%log%warn(self%warnings(k)%s)
    end do
    call log_row_titles(self%log)
    if (self%start_time >= 0.0_wp .and. .not. errors%any()) call write_first_row(self, errors)
    if (self%start_time >= 0.0_wp .or. errors%any()) return
    call write_histories(self, 0.0_wp, errors)
    call self%fields%write(0.0_wp, self%system, errors)
    call self%pore_fields%write(0.0_wp, self%system%dem_data_type, errors)
    call self%measures%write(0.0_wp, self%system, .true., errors)
  end subroutine open_run

  !> Histories and fields that the deck requests.
  subroutine open_files(self, errors)
    class(dem_written_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: fields(:)
    character(len=:), allocatable :: note
    real(wp) :: kept
    integer(i4) :: k
    if (self%deck%count('history') > 0) then
      call self%histories%open(self%stem, self%start_time, errors)
      call self%servo%open(self%stem, self%start_time, errors)
      call self%surcharge%open(self%stem, self%start_time, errors)
      call self%pore%open(self%system%dem_data_type, self%stem, self%start_time, errors)
      call self%flow%open(self%stem, self%start_time, errors)
      call self%openings%open(self%stem, self%start_time, errors)
      call self%breakage%open(self%stem, self%start_time, errors)
      call self%grading%open(self%stem, self%start_time, errors)
      call self%liquid%open(self%system%dem_data_type, self%stem, self%start_time, errors)
      call self%heat%open(self%system%dem_data_type, self%stem, self%start_time, errors)
      call self%wear%open(self%system%dem_data_type, self%stem, self%start_time, errors)
    end if
    if (self%deck%count('output') > 0 .and. .not. errors%any()) then
      call self%deck%get('output', 1, 'fields', fields)
      do k = 1, size(fields)
        self%fields%contacts = self%fields%contacts .or. fields(k)%s == 'contacts'
      end do
      self%fields%generations = self%breakage%active()
      self%fields%heat = self%system%heat%active
      kept = self%start_time
      if (.not. self%clock%on_time(event_output)) kept = kept*(1.0_wp - epsilon(kept))
      call self%fields%open(self%stem, kept, note, errors)
      call self%pore_fields%open(self%system%dem_data_type, self%stem, kept, errors)
      if (len(self%pore_fields%note) > 0) &
        call append_string(self%warnings, self%pore_fields%note)
      if (len(note) > 0) call append_string(self%warnings, note)
    end if
  end subroutine open_files

  !> Where a run of another deck begins is a row of its histories: strains count from there.
  subroutine write_first_row(self, errors)
    class(dem_written_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    if (.not. (self%new_deck .and. self%histories%energy%fresh)) return
    if (self%needs_whole()) call self%system%gather()
    if (self%surcharge%active) call see_grains(self%system)
    call write_histories(self, self%start_time, errors)
  end subroutine write_first_row

  !> Rows of all histories at time t.
  subroutine write_histories(self, t, errors)
    class(dem_written_run_type), intent(inout) :: self
    real(wp), intent(in) :: t  !! [s]
    type(error_list_type), intent(inout) :: errors
    call self%histories%write(t, self%system, errors)
    call self%servo%write(t, self%system%dem_data_type, errors)
    call self%surcharge%write(t, self%system%dem_data_type, errors)
    call self%pore%write(t, self%system%dem_data_type, errors)
    call self%flow%write(t, self%system%dem_data_type, errors)
    call self%openings%write(t, self%system, errors)
    call self%breakage%write(t, self%system%dem_data_type, errors)
    call self%grading%write(t, self%system%dem_data_type, errors)
    call self%liquid%write(t, self%system%dem_data_type, errors)
    call self%heat%write(t, self%system%dem_data_type, errors)
    call self%wear%write(t, self%system%dem_data_type, errors)
  end subroutine write_histories

  !> Histories, fields and log rows that are due.
  subroutine write_due(self, errors)
    class(dem_written_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    real(wp) :: t

    if (errors%any()) return
    t = self%clock%time()
    call self%timers%start('output')
    if (self%clock%due(event_history)) then
      if (self%needs_whole()) call self%system%gather()
      if (self%surcharge%active) call see_grains(self%system)
      call write_histories(self, t, errors)
      call self%clock%passed(event_history)
    end if
    if (self%clock%due(event_output)) then
      call self%fields%write(t, self%system, errors)
      call self%pore_fields%write(t, self%system%dem_data_type, errors)
      call self%clock%passed(event_output)
    end if
    if (self%clock%due(event_measure)) then
      call self%measures%write(t, self%system, .false., errors)
      call self%clock%passed(event_measure)
    end if
    if (self%log%row_due()) then
      call self%histories%flush(errors)
      call self%servo%flush(errors)
      call self%surcharge%history%flush(errors)
      call self%pore%flush(errors)
      call self%flow%history%flush(errors)
      call self%openings%flush(errors)
      call self%breakage%flush(errors)
      call self%grading%history%flush(errors)
      call self%liquid%history%flush(errors)
      call self%wear%history%flush(errors)
      call self%heat%history%flush(errors)
      call self%write_row()
    end if
    call self%timers%stop('output')
    if (self%clock%t_end > 0.0_wp .and. .not. self%served) &
      call self%log%progress(t/self%clock%t_end, short_number(t)//' s')
  end subroutine write_due

  !> A row of the log, with the wall time of a step and what is left.
  subroutine write_row(self)
    class(dem_written_run_type), intent(inout) :: self
    real(wp) :: step_time, left
    integer(i8) :: steps

    steps = max(self%clock%steps - self%start_steps, 1_i8)
    step_time = self%timers%elapsed()/real(steps, wp)
    left = -1.0_wp
    if (self%clock%t_end > 0.0_wp .and. .not. self%served) &
      left = max(0.0_wp, self%clock%t_end - self%clock%time())/self%clock%dt*step_time
    step_time = self%steps_seconds()/real(steps, wp)
    call log_row(self%log, self%system, self%clock, step_time, left)
    self%row_step = self%clock%steps
  end subroutine write_row

  !> Write a checkpoint; histories reach the disk first.
  subroutine save_checkpoint(self, tag, errors)
    class(dem_written_run_type), intent(inout) :: self
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors

    call self%timers%start('checkpoint')
    if (self%system%surfaces%n > 0) call self%system%gather()
    call self%histories%flush(errors)
    call self%servo%flush(errors)
    call self%surcharge%history%flush(errors)
    call self%pore%flush(errors)
    call self%measures%flush(errors)
    call self%openings%flush(errors)
    call self%breakage%flush(errors)
    call self%grading%history%flush(errors)
    call self%liquid%history%flush(errors)
    call self%wear%history%flush(errors)
    call self%heat%history%flush(errors)
    call self%system%refresh_ledger()
    call self%clock%passed(event_checkpoint)
    if (.not. errors%any()) call write_checkpoint(self%checkpoint, self%system, self%clock, &
                                                  self%histories, tag, errors)
    call self%timers%stop('checkpoint')
  end subroutine save_checkpoint

  !> Histories and measures end.
  subroutine close_files(self, errors)
    class(dem_written_run_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%histories%close(errors)
    call self%servo%close(errors)
    call self%surcharge%history%close(errors)
    call self%pore%close(errors)
    call self%flow%history%close(errors)
    call self%openings%close(errors)
    call self%breakage%close(errors)
    call self%grading%history%close(errors)
    call self%liquid%history%close(errors)
    call self%wear%history%close(errors)
    call self%heat%history%close(errors)
    call self%measures%close(errors)
  end subroutine close_files
end module dem_run_output
