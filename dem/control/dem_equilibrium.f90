!> Is the bed at rest, and adaptive damping that brings it there (theory-dem, Equilibrium).
!!
!! Checks are made at whole multiples of steps and use sums in the order of the ids, so that results
!! depend neither on threads nor on restarts.
!! eq. D.4
module dem_equilibrium
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_deck, only: deck_type
  use dem_surface_body, only: is_free, load_left
  use dem_system, only: dem_system_type
  use dem_view, only: balance_of_forces
  implicit none
  private
  public :: dem_equilibrium_type, mean_unbalanced

  integer(i4), parameter :: longest = 100  !! steps in a block

  type :: dem_equilibrium_type
    logical :: watched = .false.             !! equilibrium is requested
    logical :: adaptive = .false.            !! grains are stopped when they slow down
    integer(i4) :: damping_every = 10        !! steps between two checks of adaptive damping
    real(wp) :: unbalanced_limit = 0.0_wp    !! [-]
    real(wp) :: energy_limit = 0.0_wp        !! [-]
    integer(i4) :: every = 1                 !! steps between two checks of the criterion
    logical :: reached = .false.
    real(wp) :: unbalanced = -1.0_wp         !! mean force left over mean contact force [-]
    real(wp) :: energy_ratio = -1.0_wp       !! kinetic over elastic energy [-]
  contains
    procedure :: read => read_equilibrium
    procedure :: longest_block
    procedure :: damp
    procedure :: due
    procedure :: check
    procedure :: judge
    procedure :: text => equilibrium_text
    procedure, private :: measures
  end type dem_equilibrium_type

contains

  !> Group equilibrium and adaptive damping; neither works when a partner sets the steps (D247).
  subroutine read_equilibrium(self, deck, adaptive, served, errors)
    class(dem_equilibrium_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: adaptive, served
    type(error_list_type), intent(inout) :: errors

    self%adaptive = adaptive
    self%watched = deck%count('equilibrium') > 0
    if (served .and. self%watched) &
      call deck%fault(errors, 'D247', 'a partner ends this run, equilibrium cannot', &
                      'equilibrium', 1, '', 'leave &equilibrium out under talus-couple')
    if (served .and. adaptive) &
      call deck%fault(errors, 'D247', 'adaptive damping stops grains at times that a partner '// &
                      'does not see', 'relaxation', 1, 'damping', &
                      "take a number in 1/s or 'full' under talus-couple")
    call deck%get('equilibrium', 1, 'unbalanced', self%unbalanced_limit)
    call deck%get('equilibrium', 1, 'energy_ratio', self%energy_limit)
    call deck%get('equilibrium', 1, 'check_every', self%every)
    if (modulo(self%every, longest) /= 0) &
      call deck%fault(errors, 'D248', 'checks are made at multiples of 100 steps', 'equilibrium', &
                      1, 'check_every', 'take 100, 200, ...')
    call deck%get('relaxation', 1, 'damping_every', self%damping_every)
    if (modulo(self%damping_every, longest) /= 0 .and. modulo(longest, self%damping_every) /= 0) &
      call deck%fault(errors, 'D248', 'checks are made at divisors or multiples of 100 steps', &
                      'relaxation', 1, 'damping_every', 'take 10, 20, 50, 100, 200, ...')
  end subroutine read_equilibrium

  !> Largest number of steps without a check.
  pure integer(i4) function longest_block(self)
    class(dem_equilibrium_type), intent(in) :: self
    longest_block = longest
    if (self%adaptive) longest_block = min(longest, self%damping_every)
  end function longest_block

  !> Adaptive damping, when it is due.
  subroutine damp(self, system, steps)
    class(dem_equilibrium_type), intent(in) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i8), intent(in) :: steps  !! taken so far
    if (.not. self%adaptive) return
    if (modulo(steps, int(self%damping_every, i8)) /= 0) return
    call system%slow_down()
  end subroutine damp

  pure logical function due(self, steps)
    class(dem_equilibrium_type), intent(in) :: self
    integer(i8), intent(in) :: steps
    due = self%watched .and. modulo(steps, int(self%every, i8)) == 0 .and. steps > 0
  end function due

  !> Compare both measures with their limits; a bed without contacts is not in equilibrium.
  subroutine check(self, system, held)
    class(dem_equilibrium_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: held  !! servos hold their stresses
    real(wp) :: elastic

    self%reached = .false.
    if (.not. self%watched) return
    call system%refresh_ledger()
    elastic = system%ledger%elastic_normal + system%ledger%elastic_tangential
    self%unbalanced = -1.0_wp
    self%energy_ratio = -1.0_wp
    if (system%contact_number() == 0 .or. .not. elastic > 0.0_wp) return
    self%unbalanced = mean_unbalanced(system)
    self%energy_ratio = system%ledger%kinetic/elastic
    self%reached = self%unbalanced <= self%unbalanced_limit .and. &
                   self%energy_ratio <= self%energy_limit .and. held
  end subroutine check

  !> Report a run that reached its end without the requested equilibrium (N203).
  subroutine judge(self, time, place, errors)
    class(dem_equilibrium_type), intent(in) :: self
    real(wp), intent(in) :: time  !! s
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    if (.not. self%watched .or. self%reached .or. errors%any()) return
    call errors%add('N203', 'not in equilibrium at '//short_number(time)//' s: '// &
                    self%measures(), place, 'raise t_end and go on with --restart, change '// &
                    'the damping, or relax the limits of &equilibrium; the state was written')
  end subroutine judge

  !> One line for the log.
  function equilibrium_text(self) result(text)
    class(dem_equilibrium_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = 'equilibrium: '//trim(merge('reached    ', 'not reached', self%reached))//', '// &
      self%measures()
  end function equilibrium_text

  function measures(self) result(text)
    class(dem_equilibrium_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = 'there are no contacts'
    if (self%unbalanced < 0.0_wp) return
    text = 'unbalanced force '//short_number(self%unbalanced)//' of the mean contact force '// &
      '(limit '//short_number(self%unbalanced_limit)//'), kinetic energy '// &
      short_number(self%energy_ratio)//' of the elastic (limit '// &
      short_number(self%energy_limit)//')'
  end function measures

  !> Mean force left on a free grain (contacts, gravity, extra forces; no background damping) over
  !! the mean force of a contact [-].
  real(wp) function mean_unbalanced(system) result(ratio)
    type(dem_system_type), intent(inout) :: system
    real(wp) :: sums(4), gravity(3), load(6)
    integer(i4) :: i

    sums = balance_of_forces(system)
    gravity = system%par%gravity_scale*system%par%gravity
    do i = 1, merge(system%surfaces%n, 0_i4, allocated(system%surfaces%rigid%free))
      if (.not. is_free(system%surfaces, i)) cycle
      load = load_left(system%surfaces, i, gravity)
      sums(1:2) = sums(1:2) + [norm2(load(1:3)), 1.0_wp]
    end do
    ratio = 0.0_wp
    if (sums(2) > 0.0_wp) ratio = sums(1)/sums(2)
    if (sums(3) > 0.0_wp) ratio = ratio*sums(4)/sums(3)
  end function mean_unbalanced
end module dem_equilibrium
