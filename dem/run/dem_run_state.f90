!> State of a run of talus-dem, and procedures common to all its phases.
module dem_run_state
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: string_type
  use talus_options, only: options_type
  use talus_ranks, only: ranks_type
  use talus_deck, only: deck_type
  use talus_checkpoint, only: checkpoint_type
  use talus_lock, only: lock_type
  use talus_log, only: log_type
  use talus_stop, only: stop_type
  use talus_timers, only: timers_type
  use dem_system, only: dem_system_type
  use dem_packing, only: dem_packing_type
  use dem_flow, only: dem_flow_type
  use dem_probe, only: dem_probe_type
  use dem_setup, only: dem_choices_type
  use dem_clock, only: dem_clock_type
  use dem_histories, only: dem_histories_type
  use dem_liquid, only: dem_liquid_history_type
  use dem_wear_output, only: dem_wear_history_type
  use dem_heat_output, only: dem_heat_history_type
  use dem_fields, only: dem_fields_type
  use dem_grading, only: dem_grading_type
  use dem_measures, only: dem_measures_type
  use dem_equilibrium, only: dem_equilibrium_type
  use dem_bed, only: dem_bed_type
  use dem_breakage, only: dem_breakage_type
  use dem_openings, only: dem_openings_type
  use dem_servo, only: dem_servo_type
  use dem_surcharge, only: dem_surcharge_type
  use dem_pore, only: dem_pore_control_type
  use dem_pore_fields, only: dem_pore_fields_type
  use dem_surface_drive, only: surface_drive_type
  implicit none
  private
  public :: dem_run_state_type, program_name

  character(len=*), parameter :: program_name = 'talus-dem'

  !> Everything of a run.
  type :: dem_run_state_type
    type(options_type) :: options
    type(ranks_type) :: ranks
    type(deck_type) :: deck
    class(dem_system_type), allocatable :: system  !! class, as all that is large, for the sake of
                                                   !! compilation
    type(dem_packing_type) :: packing
    type(dem_choices_type) :: choices
    type(dem_clock_type) :: clock
    type(dem_equilibrium_type) :: equilibrium
    type(dem_servo_type) :: servo
    type(dem_surcharge_type) :: surcharge
    type(dem_pore_control_type) :: pore
    type(dem_pore_fields_type) :: pore_fields
    type(dem_flow_type) :: flow
    type(surface_drive_type) :: drive
    type(dem_openings_type) :: openings
    type(dem_bed_type) :: bed
    type(dem_breakage_type) :: breakage
    type(dem_grading_type) :: grading
    type(dem_liquid_history_type) :: liquid
    type(dem_wear_history_type) :: wear
    type(dem_heat_history_type) :: heat
    type(dem_probe_type) :: probe
    type(dem_histories_type) :: histories
    type(dem_fields_type) :: fields
    type(dem_measures_type) :: measures
    type(checkpoint_type) :: checkpoint
    type(stop_type) :: stop
    type(timers_type) :: timers
    type(log_type) :: log
    type(lock_type) :: lock
    character(len=:), allocatable :: stem          !! of all files of the run
    character(len=:), allocatable :: restart_path  !! checkpoint restarted from, '' for none
    type(string_type), allocatable :: warnings(:)  !! for the log, once it is open
    real(wp) :: start_time = -1.0_wp               !! of the checkpoint [s], < 0: a fresh run
    logical :: new_deck = .false.                  !! another one than wrote the checkpoint
    integer(i8) :: start_steps = 0                 !! steps taken before
    integer(i8) :: row_step = -1                   !! step of the last log row
    logical :: served = .false.                    !! a partner drives this run
    logical :: stopped = .false.                   !! left early on request
    logical :: opened = .false.                    !! log and files are open
  contains
    procedure :: needs_whole, starts_whole  !! are all grains on the leader?
    procedure :: drive_surfaces             !! (): velocities of surfaces, loads of free bodies
    procedure :: automatic_dt               !! (): present step of the automatic choice [s]
    procedure :: use_step                   !! (dt): steps of this length from now on
    procedure :: steps_seconds              !! (): wall time spent in steps [s]
  end type dem_run_state_type

contains

  !> Is anything in use that needs all grains and their contacts?
  logical function needs_whole(self)
    class(dem_run_state_type), intent(in) :: self
    needs_whole = self%servo%surfaces%active() .or. self%probe%wanted .or. self%served
  end function needs_whole

  !> Does one process make the first list and forces, whatever the ranks?
  logical function starts_whole(self)
    class(dem_run_state_type), intent(in) :: self
    starts_whole = self%needs_whole() .or. self%system%pairs%additional%bond%given &
      .or. self%system%springs%given > 0
  end function starts_whole

  !> Velocities of surfaces and loads of free bodies for the steps to come.
  subroutine drive_surfaces(self)
    class(dem_run_state_type), intent(inout) :: self
    real(wp) :: start
    start = self%system%ledger%start
    call self%drive%update(self%system%dem_data_type, self%clock%time())
    call self%system%start_moved(start)
  end subroutine drive_surfaces

  !> Present step of the automatic choice [s].
  real(wp) function automatic_dt(self) result(dt)
    class(dem_run_state_type), intent(in) :: self
    real(wp), parameter :: least_steps = 100.0_wp
    dt = self%clock%dt
    if (self%clock%automatic) dt = self%system%automatic_step(self%system%top_speed())
    if (self%choices%dt_curve > 0) &
      dt = dt*self%servo%curve(self%choices%dt_curve)%at(self%clock%time())
    if (self%clock%t_end > 0.0_wp) dt = min(dt, self%clock%t_end/least_steps)
  end function automatic_dt

  !> Steps of this length from now on; driven grains turn by spin times step.
  subroutine use_step(self, dt)
    class(dem_run_state_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! s
    self%system%par%dt = dt
    associate (driven => self%histories%index)
      if (size(driven) > 0) call self%system%set_velocity( &
        driven, self%system%grains%v(:, driven), self%system%grains%omega(:, driven))
    end associate
  end subroutine use_step

  !> Wall time spent in steps so far [s].
  real(wp) function steps_seconds(self)
    class(dem_run_state_type), intent(inout) :: self
    integer(i4) :: number
    call self%timers%index('steps', number)
    steps_seconds = self%timers%seconds(number)
  end function steps_seconds
end module dem_run_state
