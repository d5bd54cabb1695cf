!> Time histories of a run: energy ledger, driven grains, walls (CSV).
!!
!! Driven grains and walls have one row a time and a grain or wall; works count from the start of
!! the run, also when a partner's exchanges reset those of the system.
module dem_histories
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  use dem_state, only: kind_driven
  use dem_surface_motion, only: reset_works
  use dem_surface_output, only: open_surface_history, write_surface_rows, open_body_history, &
    write_body_rows
  use dem_system, only: dem_system_type
  use dem_ledger, only: turnover_of
  implicit none
  private
  public :: dem_histories_type, relative_closure

  character(len=26), parameter :: energy_columns(22) = [character(len=26) :: 'time [s]', &
    'kinetic [J]', 'elastic [J]', 'elastic_normal [J]', 'elastic_tangential [J]', &
    'friction [J]', 'contact_damping [J]', 'background_damping [J]', 'curvature [J]', &
    'tangential_relaxation [J]', 'boundary [J]', 'external [J]', 'gravity [J]', &
    'staggering [J]', 'closure_error [J]', 'relative_closure [-]', 'contacts [-]', &
    'max_overlap [-]', 'dt [s]', 'elastic_other [J]', 'rolling [J]', 'breakage [J]']
  character(len=15), parameter :: liquid_columns(5) = [character(len=15) :: 'liquid [J]', &
    'darcy [J]', 'liquid_drag [J]', 'flow [J]', 'exchange [J]']
  character(len=16), parameter :: driven_columns(12) = [character(len=16) :: 'time [s]', 'id [-]', &
    'x [m]', 'y [m]', 'z [m]', 'force_x [N]', 'force_y [N]', 'force_z [N]', 'moment_x [N m]', &
    'moment_y [N m]', 'moment_z [N m]', 'work [J]']
  character(len=16), parameter :: wall_columns(12) = [character(len=16) :: 'time [s]', &
    'wall [-]', 'x [m]', 'y [m]', 'z [m]', 'force_x [N]', 'force_y [N]', 'force_z [N]', &
    'moment_x [N m]', 'moment_y [N m]', 'moment_z [N m]', 'work [J]']

  type :: dem_histories_type
    type(history_type) :: energy, driven, walls, surfaces, bodies
    logical :: free = .false.                 !! there are free bodies
    logical :: plastic = .false.              !! a law or model books plastic work
    logical :: open_system = .false.          !! grains enter and leave
    logical :: crushed = .false.              !! grains break
    logical :: growing = .false.              !! and their fragments grow
    logical :: wet = .false.                  !! there is a liquid among the grains
    integer(i4), allocatable :: index(:)      !! driven grains
    real(wp), allocatable :: driven_work(:)   !! of intervals that are over [J]
    real(wp), allocatable :: wall_work(:)     !! of intervals that are over [J]
    real(wp), allocatable :: surface_work(:)  !! of parts, of intervals that are over [J]
  contains
    procedure :: init
    procedure :: find_driven
    procedure :: open => open_histories
    procedure :: write => write_rows
    procedure :: keep_work
    procedure :: flush => flush_histories
    procedure :: close => close_histories
  end type dem_histories_type

contains

  !> Find the driven grains; works are zero.
  subroutine init(self, system)
    class(dem_histories_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: system
    integer(i4) :: k
    self%free = allocated(system%surfaces%rigid%free)
    self%open_system = system%open
    self%crushed = allocated(system%crushed)
    self%growing = allocated(system%growing)
    self%wet = system%pore%active
    self%plastic = any(system%laws%base%plastic)
    do k = 1, system%pairs%additional%models
      if (any(system%laws%additional%acts(k)) .or. system%pairs%additional%of_run(k)) &
        self%plastic = self%plastic .or. system%pairs%additional%model(k)%plastic
    end do
    call self%find_driven(system)
    if (allocated(self%driven_work)) deallocate (self%driven_work)
    if (allocated(self%wall_work)) deallocate (self%wall_work, self%surface_work)
    allocate (self%driven_work(size(self%index)), source=0.0_wp)
    allocate (self%wall_work(system%planes%n), source=0.0_wp)
    allocate (self%surface_work(system%surfaces%parts), source=0.0_wp)
  end subroutine init

  !> Numbers of the driven grains, which stay while others enter and leave.
  subroutine find_driven(self, system)
    class(dem_histories_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: system
    integer(i4) :: k
    self%index = pack([(k, k=1, system%grains%n)], system%grains%kind == kind_driven)
  end subroutine find_driven

  !> Begin the files, or go on in them after a restart at time >= 0.
  subroutine open_histories(self, stem, time, errors)
    class(dem_histories_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors

    call self%energy%begin(stem//'_energy.csv', &
      [character(len=26) :: energy_columns, pack(['plastic [J]'], self%plastic), &
       pack(['entered [J]', 'left [J]   '], self%open_system), &
       pack(['released [J]', 'fines [J]   '], self%crushed), &
       pack(['growth [J]'], self%growing), &
       pack(liquid_columns, self%wet)], time, errors)
    if (size(self%index) > 0) &
      call self%driven%begin(stem//'_driven.csv', driven_columns, time, errors)
    if (size(self%wall_work) > 0) &
      call self%walls%begin(stem//'_walls.csv', wall_columns, time, errors)
    if (size(self%surface_work) > 0) &
      call open_surface_history(self%surfaces, stem, time, errors)
    if (self%free) call open_body_history(self%bodies, stem, time, errors)
  end subroutine open_histories

  !> Rows of the present state; the ledger is refreshed.
  subroutine write_rows(self, time, system, errors)
    class(dem_histories_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! s
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, i

    if (.not. self%energy%is_open()) return
    call system%refresh_ledger()
    associate (l => system%ledger)
      call self%energy%write([time, l%kinetic, l%elastic_normal + l%elastic_tangential &
                              + l%elastic_other, &
                              l%elastic_normal, l%elastic_tangential, l%friction, &
                              l%contact_damping, l%background_damping, l%curvature, &
                              l%tangential_relaxation, l%boundary, l%external, l%gravity, &
                              l%staggering, system%closure(), relative_closure(system), &
                              real(system%contact_number(), wp), &
                              system%health%max_overlap, system%par%dt, l%elastic_other, &
                              l%rolling, l%breakage, &
                              pack([l%plastic], self%plastic), &
                              pack([l%entered, l%left], self%open_system), &
                              pack([l%released, l%fines], self%crushed), &
                              pack([l%growth], self%growing), &
                              pack([l%liquid, l%darcy, l%liquid_drag, l%liquid_flow, &
                                    l%liquid_exchange], self%wet)], errors)
    end associate
    do k = 1, size(self%index)
      i = self%index(k)
      call self%driven%write([time, real(system%grains%id(i), wp), system%grains%x(:, i), &
                              system%grains%force(:, i), system%grains%moment(:, i), &
                              self%driven_work(k) + system%grains%work(i)], errors)
    end do
    do k = 1, system%planes%n
      call self%walls%write([time, real(k, wp), system%planes%point(:, k), &
                             system%planes%force(:, k), system%planes%moment(:, k), &
                             self%wall_work(k) + system%planes%work(k)], errors)
    end do
    if (system%surfaces%n > 0) call write_surface_rows(self%surfaces, time, system%surfaces, &
                                                       self%surface_work, errors)
    if (self%free) call write_body_rows(self%bodies, time, system%surfaces, errors)
  end subroutine write_rows

  !> Take over the works of an interval, before the system's are reset.
  pure subroutine keep_work(self, system)
    class(dem_histories_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    self%driven_work = self%driven_work + system%grains%work(self%index)
    system%grains%work(self%index) = 0.0_wp
    if (system%surfaces%n > 0) then
      self%surface_work = self%surface_work + system%surfaces%sums%work
      call reset_works(system%surfaces)
    end if
    if (system%planes%n == 0) return
    self%wall_work = self%wall_work + system%planes%work
    system%planes%work = 0.0_wp
  end subroutine keep_work

  !> Closure error over the energy turned over so far; the ledger must be fresh.
  real(wp) function relative_closure(system)
    type(dem_system_type), intent(in) :: system
    real(wp) :: scale
    scale = turnover_of(system%ledger)
    relative_closure = 0.0_wp
    if (scale > 0.0_wp) relative_closure = abs(system%closure())/scale
  end function relative_closure

  subroutine flush_histories(self, errors)
    class(dem_histories_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%energy%flush(errors)
    call self%driven%flush(errors)
    call self%walls%flush(errors)
    call self%surfaces%flush(errors)
    call self%bodies%flush(errors)
  end subroutine flush_histories

  subroutine close_histories(self, errors)
    class(dem_histories_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    call self%energy%close(errors)
    call self%driven%close(errors)
    call self%walls%close(errors)
    call self%surfaces%close(errors)
    call self%bodies%close(errors)
  end subroutine close_histories
end module dem_histories
