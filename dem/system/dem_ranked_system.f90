!> A system and the ranks that move it: access to their state, changes to be sent to them, and
!! figures from them or, without ranks, from the system itself.
module dem_ranked_system
  use talus_kinds, only: wp, i8
  use talus_ranks, only: ranks_type
  use dem_rank_team, only: dem_rank_team_type
  use dem_state, only: dem_data_type
  use dem_ledger, only: refresh_stored, follow_step, closure_of
  use dem_limits, only: gershgorin_step, rayleigh_step, foreseen_step
  use dem_measure, only: contact_count
  use dem_adaptive_damping, only: stop_slowing
  implicit none
  private
  public :: dem_ranked_system_type

  !> A system whose steps one process or many ranks take.
  type, extends(dem_data_type) :: dem_ranked_system_type
    class(dem_rank_team_type), allocatable :: rank_team      !! of a run on many ranks
    real(wp), private :: limit = 0.0_wp            !! recent_limit [s]
    integer(i8), private :: limit_at = -1          !! evaluation of forces then
  contains
    procedure :: use_ranks        !! (team): steps are those of many ranks
    procedure :: gather             !! (): grains and contacts as the ranks have them now
    procedure :: glance           !! (): ledger and stress in a cell as the ranks have them
    procedure :: slow_down        !! (): adaptive damping
    procedure :: loads_changed    !! (before): extra forces were others before
    procedure :: start_moved      !! (start): of the ledger, loads have changed
    procedure :: begin_anew       !! (): the state was replaced: to be sent to the ranks
    procedure :: shared           !! (): many ranks take the steps
    procedure :: owner_changed           !! (): ranks have advanced since the last access
    procedure :: pair_number      !! (): of candidate pairs, over a border twice
    procedure :: contact_number   !! (): of contacts, once the ledger was refreshed
    procedure :: top_speed        !! (): of the fastest grain [m/s]
    procedure :: step_limit       !! (): Gershgorin limit [s], huge without contacts
    procedure :: recent_limit     !! (): the same, as it was a few steps ago at most [s]
    procedure :: rayleigh_limit   !! (): least Rayleigh time of the free grains [s]
    procedure :: automatic_step   !! (speed): dt_factor x least of all limits [s]
    procedure :: refresh_ledger   !! (): fills the 'now' columns of ledger
    procedure :: closure          !! (): closure error of the ledger as last refreshed [J]
    procedure :: follow_laws      !! (): laws have changed: so has what is stored
  end type dem_ranked_system_type

contains

  !> Steps are taken by these ranks, of which this process leads.
  subroutine use_ranks(self, team)
    class(dem_ranked_system_type), intent(inout) :: self
    type(ranks_type), intent(in) :: team
    if (.not. team%several()) return
    allocate (self%rank_team)
    allocate (self%rank_team%part)
    self%rank_team%team = team
  end subroutine use_ranks

  !> On many ranks the leader's grains and contacts are those of its last access.
  subroutine gather(self)
    class(dem_ranked_system_type), intent(inout) :: self
    if (allocated(self%rank_team)) call self%rank_team%gather(self%dem_data_type)
  end subroutine gather

  !> Ledger, number of contacts, stress in a cell and driven grains as the ranks have them.
  subroutine glance(self)
    class(dem_ranked_system_type), intent(inout) :: self
    if (self%owner_changed()) call self%rank_team%glance(self%dem_data_type)
  end subroutine glance

  !> Adaptive damping.
  subroutine slow_down(self)
    class(dem_ranked_system_type), intent(inout) :: self
    if (self%shared()) then
      call self%rank_team%slow_down(self%dem_data_type)
    else
      call stop_slowing(self%dem_data_type)
    end if
  end subroutine slow_down

  !> Extra forces of some grains have changed: to be sent to the ranks.
  subroutine loads_changed(self, before)
    class(dem_ranked_system_type), intent(inout) :: self
    real(wp), intent(in) :: before(:, :)  !! (3, grains) [N]
    if (allocated(self%rank_team)) &
      call self%rank_team%mark_loads(any(abs(self%grains%extra_force - before) > 0.0_wp, 1))
  end subroutine loads_changed

  !> With a change of loads the ledger has got another start: so has that of the ranks.
  subroutine start_moved(self, start)
    class(dem_ranked_system_type), intent(inout) :: self
    real(wp), intent(in) :: start  !! before the change [J]
    if (.not. allocated(self%rank_team)) return
    if (self%rank_team%started) self%rank_team%shift = self%rank_team%shift + (self%ledger%start &
      - start)
  end subroutine start_moved

  !> Another state has taken the place of this one: ranks get their parts of it before they step.
  subroutine begin_anew(self)
    class(dem_ranked_system_type), intent(inout) :: self
    if (allocated(self%rank_team)) call self%rank_team%begin_anew()
  end subroutine begin_anew

  !> Do many ranks take the steps?
  pure logical function shared(self)
    class(dem_ranked_system_type), intent(in) :: self
    shared = .false.
    if (allocated(self%rank_team)) shared = .not. self%rank_team%alone
  end function shared

  !> Have the ranks advanced since the last access? The whole's grains are then old, it has no
  !! contacts, and what is written comes from the ranks in slabs.
  pure logical function owner_changed(self)
    class(dem_ranked_system_type), intent(in) :: self
    owner_changed = .false.
    if (allocated(self%rank_team)) owner_changed = self%rank_team%stale
  end function owner_changed

  !> Number of candidate pairs.
  integer(i8) function pair_number(self)
    class(dem_ranked_system_type), intent(in) :: self
    pair_number = self%pairs%count
    if (self%owner_changed()) pair_number = nint(self%rank_team%marks%pairs, i8)
  end function pair_number

  !> Number of contacts, as reported by the ranks with the ledger.
  integer(i8) function contact_number(self)
    class(dem_ranked_system_type), intent(in) :: self
    if (self%owner_changed()) then
      contact_number = nint(self%rank_team%marks%contacts(1), i8)
    else
      contact_number = contact_count(self%dem_data_type)
    end if
  end function contact_number

  !> Speed of the fastest grain [m/s].
  real(wp) function top_speed(self) result(speed)
    class(dem_ranked_system_type), intent(in) :: self
    speed = 0.0_wp
    if (self%owner_changed()) then
      speed = self%rank_team%marks%speed
    else if (self%grains%n > 0) then
      speed = sqrt(maxval(sum(self%grains%v**2, 1)))
    end if
  end function top_speed

  !> Gershgorin limit of the current contacts [s].
  real(wp) function step_limit(self)
    class(dem_ranked_system_type), intent(in) :: self
    if (self%owner_changed()) then
      step_limit = self%rank_team%marks%limit(1)
    else
      step_limit = gershgorin_step(self%dem_data_type)
    end if
  end function step_limit

  !> Gershgorin limit of the contacts not long ago [s].
  real(wp) function recent_limit(self)
    class(dem_ranked_system_type), intent(inout) :: self
    integer(i8), parameter :: long = 100  !! evaluations
    if (self%limit_at < 0 .or. self%health%evaluations - self%limit_at >= long .or. &
        self%health%evaluations < self%limit_at) then
      self%limit = self%step_limit()
      self%limit_at = self%health%evaluations
    end if
    recent_limit = self%limit
  end function recent_limit

  !> Least Rayleigh time of the free grains [s].
  real(wp) function rayleigh_limit(self)
    class(dem_ranked_system_type), intent(in) :: self
    if (self%owner_changed()) then
      rayleigh_limit = self%rank_team%marks%limit(2)
    else
      rayleigh_limit = rayleigh_step(self%dem_data_type)
    end if
  end function rayleigh_limit

  !> par%dt_factor times the least of the contact limit, the Rayleigh time and the limit of an
  !! impact at the given speed; no more than the dashpots of contacts allow [s].
  real(wp) function automatic_step(self, speed)
    class(dem_ranked_system_type), intent(in) :: self
    real(wp), intent(in) :: speed  !! approach speed, 0: none; of ranks the fastest grain's [m/s]
    real(wp) :: impact
    if (self%owner_changed()) then
      impact = self%rank_team%marks%limit(3)
    else
      impact = foreseen_step(self%dem_data_type, speed)
    end if
    automatic_step = self%par%dt_factor*min(self%step_limit(), self%rayleigh_limit(), impact)
  end function automatic_step

  !> Fill the 'now' columns of the ledger.
  subroutine refresh_ledger(self)
    class(dem_ranked_system_type), intent(inout) :: self
    if (self%owner_changed()) then
      call self%glance()
      return
    end if
    call follow_step(self%dem_data_type, self%par%dt)
    call refresh_stored(self%dem_data_type, self%par%dt, self%ledger)
  end subroutine refresh_ledger

  !> Closure error of the ledger as last refreshed [J].
  real(wp) function closure(self)
    class(dem_ranked_system_type), intent(in) :: self
    closure = closure_of(self%ledger)
  end function closure

  !> Contact laws may have changed since the checkpoint: what the new ones store was there at the
  !! start, so that the ledger closes as it did.
  subroutine follow_laws(self)
    class(dem_ranked_system_type), intent(inout) :: self
    real(wp) :: error, stored
    associate (ledger => self%ledger)
      error = self%closure()
      stored = ledger%elastic_normal + ledger%elastic_tangential + ledger%elastic_other
      call self%refresh_ledger()
      if (.not. abs(ledger%elastic_normal + ledger%elastic_tangential + ledger%elastic_other &
                    - stored) > 0.0_wp) return
      ledger%start = ledger%start + error - self%closure()
    end associate
  end subroutine follow_laws
end module dem_ranked_system
