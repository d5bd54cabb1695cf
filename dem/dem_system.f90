!> A whole system of grains: what a program calls to set it up, move it and look at it.
!!
!! Order of use: fill grains (dem_make), planes, materials, laws (dem_law), par; init; then step, or
!! the split verbs kick, drift and forces. Prescribed grains are named by index (find gives it).
module dem_system
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_grains_type, dem_planes_type, dem_law_type, dem_material_type, &
    dem_pairs_type, dem_parameters_type, dem_ledger_type, dem_health_type, dem_weights_type
  implicit none
  private
  public :: dem_system_type, dem_contacts_type

  !> Contacts at one time, ordered by lower id, then higher id; planes have ids -1, -2, ...
  type :: dem_contacts_type
    integer(i4) :: n = 0
    integer(i8), allocatable :: ids(:, :)      !! (2, n) lower id first; (-plane, grain)
    real(wp), allocatable :: point(:, :)       !! (3, n) [m]
    real(wp), allocatable :: normal(:, :)      !! (3, n) from first to second [-]
    real(wp), allocatable :: branch(:, :)      !! (3, n) centre of second - first [m]
    real(wp), allocatable :: force(:, :)       !! (3, n) on the second [N]
    real(wp), allocatable :: stiffness(:, :)   !! (2, n) k_n, k_t [N/m]
    real(wp), allocatable :: overlap(:)        !! (n) [m]
  end type dem_contacts_type

  type :: dem_system_type
    type(dem_grains_type) :: grains
    type(dem_planes_type) :: planes
    type(dem_material_type), allocatable :: materials(:)
    type(dem_law_type), allocatable :: laws(:, :)    !! (first, second material)
    type(dem_parameters_type) :: par
    type(dem_pairs_type) :: pairs
    type(dem_weights_type) :: weights
    type(dem_ledger_type) :: ledger
    type(dem_health_type) :: health
    real(wp) :: pending = 0.0_wp                     !! drift since forces were evaluated [s]
    logical :: ready = .false.                       !! init was done
  contains
    procedure :: init             !! (errors): lists and forces at the start; no time passes
    procedure :: step             !! (n, errors): n sub-steps of par%dt
    procedure :: forces           !! (): forces at the current state; no time passes
    procedure :: kick             !! (dt): v += dt (F + X)/m, rotation alike
    procedure :: drift            !! (dt): x += dt v, rotation alike; prescribed grains too
    procedure :: step_limit       !! (): Gershgorin limit [s], huge without contacts
    procedure :: automatic_step   !! (): dt_factor x least of step limit, Rayleigh time
    procedure :: set_motion       !! (index, x1, quat1, steps): linear/slerp to the target
    procedure :: set_velocity     !! (index, v, omega): constant from now on
    procedure :: set_state        !! (index, x, quat, v, omega): placed at once
    procedure :: set_extra        !! (index, force, moment): held on free grains
    procedure :: clear_extra      !! ()
    procedure :: set_weights      !! (ids(2,:), value(:)): contact weights by pair id
    procedure :: reset_impulses   !! (): impulses and work of grains and planes to zero
    procedure :: find             !! (ids, index, errors): grain indices of ids
    procedure :: refresh_ledger   !! (): fills the 'now' columns of ledger
    procedure :: closure          !! (): ledger's closure error [J]
    procedure :: contacts         !! (list): contacts at the current state
    procedure :: save             !! (): keep the state in memory
    procedure :: restore          !! (): return to the kept state
    procedure :: export_state     !! (archive): complete state as named arrays
    procedure :: import_state     !! (archive, errors): instead of init, bit for bit
  end type dem_system_type

contains

  subroutine init(self, errors)
    class(dem_system_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
  end subroutine init

  subroutine step(self, n, errors)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    type(error_list_type), intent(inout) :: errors
  end subroutine step

  subroutine forces(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine forces

  subroutine kick(self, dt)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
  end subroutine kick

  subroutine drift(self, dt)
    class(dem_system_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
  end subroutine drift

  real(wp) function step_limit(self)
    class(dem_system_type), intent(in) :: self
    step_limit = huge(1.0_wp)
  end function step_limit

  real(wp) function automatic_step(self)
    class(dem_system_type), intent(in) :: self
    automatic_step = huge(1.0_wp)
  end function automatic_step

  subroutine set_motion(self, index, x1, quat1, steps)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x1(:, :)     !! (3, :) [m]
    real(wp), intent(in) :: quat1(:, :)  !! (4, :) [-]
    integer(i4), intent(in) :: steps     !! sub-steps to get there
  end subroutine set_motion

  subroutine set_velocity(self, index, v, omega)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: v(:, :), omega(:, :)  !! (3, :) [m/s], [rad/s]
  end subroutine set_velocity

  subroutine set_state(self, index, x, quat, v, omega)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x(:, :), quat(:, :), v(:, :), omega(:, :)
  end subroutine set_state

  subroutine set_extra(self, index, force, moment)
    class(dem_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: force(:, :), moment(:, :)  !! (3, :) [N], [N m]
  end subroutine set_extra

  subroutine clear_extra(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine clear_extra

  subroutine set_weights(self, ids, value)
    class(dem_system_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:, :)
    real(wp), intent(in) :: value(:)
  end subroutine set_weights

  subroutine reset_impulses(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine reset_impulses

  subroutine find(self, ids, index, errors)
    class(dem_system_type), intent(in) :: self
    integer(i8), intent(in) :: ids(:)
    integer(i4), allocatable, intent(out) :: index(:)
    type(error_list_type), intent(inout) :: errors
    allocate (index(size(ids)))
  end subroutine find

  subroutine refresh_ledger(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine refresh_ledger

  real(wp) function closure(self)
    class(dem_system_type), intent(in) :: self
    closure = 0.0_wp
  end function closure

  subroutine contacts(self, list)
    class(dem_system_type), intent(in) :: self
    type(dem_contacts_type), intent(inout) :: list
  end subroutine contacts

  subroutine save(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine save

  subroutine restore(self)
    class(dem_system_type), intent(inout) :: self
  end subroutine restore

  subroutine export_state(self, archive)
    class(dem_system_type), intent(in) :: self
    type(dem_archive_type), intent(inout) :: archive
  end subroutine export_state

  subroutine import_state(self, archive, errors)
    class(dem_system_type), intent(inout) :: self
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
  end subroutine import_state
end module dem_system
