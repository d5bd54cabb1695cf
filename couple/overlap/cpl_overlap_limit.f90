!> Is the step of the grains stable in the overlap? Power iteration on the coupled operator, with
!! rotations of grains and micro-rotations of nodes (theory: overlap coupling, Time).
module cpl_overlap_limit
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_timers, only: timers_type
  use cpl_coupled, only: coupled_type, motion_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_overlap_weights, only: read_contacts, read_points
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: check_step, highest_frequency, mode_type, kick_watch_type, kick_warning

  integer(i4), parameter :: most_rounds = 300, quiet_rounds = 5
  integer(i4), parameter :: first_check = 16   !! remaps before the limit of kicks is found again
  real(wp), parameter :: settled = 1.0e-4_wp  !! change of the frequency in a round, relative

  !> The fastest motion: angular frequency, and who moves most in it.
  type :: mode_type
    real(wp) :: omega = 0.0_wp    !! [1/s]
    integer(i4) :: grain = 0      !! row in the pack, 0: a node
    integer(i4) :: node = 0       !! id
    logical :: turns = .false.    !! by its rotation
    integer(i4) :: rounds = 0     !! of the iteration
  end type mode_type

  !> The limit of kicks once more after remaps: the map is new, contacts between ghosts and elements
  !! are those of the start.
  type :: kick_watch_type
    logical :: active = .false.
    type(coupled_type), private :: kicks
  contains
    procedure :: begin => begin_watch
    procedure :: renew => renew_limit
  end type kick_watch_type

contains

  !> D425: the step of the grains is above the stable step 2/omega of the overlap.
  subroutine check_step(o, solvers, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(contacts_type) :: contacts
    type(points_type) :: points
    type(coupled_type) :: coupled
    type(mode_type) :: mode

    call read_contacts(solvers(side_grains), contacts, timers, errors)
    if (.not. errors%any()) call read_points(solvers(side_solid), points, timers, errors)
    if (errors%any()) return
    call timers%start('stable step')
    call coupled%build(o, contacts, points, o%pack%slimmest)
    mode = highest_frequency(o, coupled)
    if (o%rules%in_parts) call check_kicks(o, contacts, points)
    call timers%stop('stable step')
    if (.not. mode%omega > 0.0_wp) return
    o%limit%step_limit = 2.0_wp/mode%omega
    associate (grains => solvers(side_grains))
      if (grains%dt <= o%limit%step_limit) return
      call errors%add('D425', 'the step of the grains, '//str(grains%dt)//' s, is above the '// &
        'stable step of the overlap, '//short_number(o%limit%step_limit)//' s: '// &
        critical_part(o, mode)//' fastest', grains%deck, 'shorten dt in its deck; if '// &
        'the grains alone allow the step, '// &
        'moduli of the solid that are too stiff for the pack, light nodes or mass factors '// &
        '(least '//short_number(minval(o%own%factor))//') are the cause')
    end associate
  end subroutine check_step

  !> What acts in kicks alone has a limit of its own, 2/omega of an exchange, as if no contact slid.
  subroutine check_kicks(o, contacts, points)
    type(overlap_type), intent(inout) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(coupled_type) :: kicks
    type(mode_type) :: mode
    call kicks%build(o, contacts, points, o%pack%slimmest, .true.)
    mode = highest_frequency(o, kicks)
    if (.not. mode%omega > 0.0_wp) return
    o%limit%kick_limit = 2.0_wp/mode%omega
    o%limit%kick_critical = critical_part(o, mode)
  end subroutine check_kicks

  !> Keep what a later check needs; before the first exchange of a fresh run.
  subroutine begin_watch(self, o, solvers, timers, errors)
    class(kick_watch_type), intent(inout) :: self
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(contacts_type) :: contacts
    type(points_type) :: points
    if (.not. o%limit%kick_limit < huge(1.0_wp)) return
    call read_contacts(solvers(side_grains), contacts, timers, errors)
    if (.not. errors%any()) call read_points(solvers(side_solid), points, timers, errors)
    if (errors%any()) return
    call self%kicks%build(o, contacts, points, o%pack%slimmest, .true.)
    self%active = .true.
  end subroutine begin_watch

  !> After remaps 16, 32, 64 and so on: it costs as much as 30 exchanges. The least limit stays;
  !! said is the text for the log.
  subroutine renew_limit(self, o, exchange, timers, said)
    class(kick_watch_type), intent(in) :: self
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: exchange  !! [s]
    type(timers_type), intent(inout) :: timers
    character(len=:), allocatable, intent(out) :: said
    type(mode_type) :: mode
    real(wp) :: before

    said = ''
    if (.not. self%active .or. o%map%remaps < first_check .or. popcnt(o%map%remaps) /= 1) return
    call timers%start('stable step')
    mode = highest_frequency(o, self%kicks)
    call timers%stop('stable step')
    if (.not. mode%omega > 0.0_wp) return
    said = 'stable exchange '//short_number(2.0_wp/mode%omega)//' s after remap '// &
      str(o%map%remaps)//'; '//critical_part(o, mode)//' fastest'
    before = o%limit%kick_limit
    if (2.0_wp/mode%omega >= before) return
    o%limit%kick_limit = 2.0_wp/mode%omega
    o%limit%kick_critical = critical_part(o, mode)
    if (exchange > o%limit%kick_limit .and. exchange <= before) &
      said = 'warning: '//kick_warning(o, exchange)
  end subroutine renew_limit

  !> The exchange is above what kicks allow.
  pure function kick_warning(o, exchange) result(text)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: exchange  !! [s]
    character(len=:), allocatable :: text
    text = 'the exchange, '//short_number(exchange)// &
      ' s, is above what kicks of the forces between ghosts allow, '// &
      short_number(o%limit%kick_limit)//' s: '//o%limit%kick_critical// &
      ' fastest. Sliding contacts and '// &
      "damping may hold it; if not, shorten &clock exchange, or take projection = 'mls'"
  end function kick_warning

  !> 'grain 12 turns'
  pure function critical_part(o, mode) result(who)
    type(overlap_type), intent(in) :: o
    type(mode_type), intent(in) :: mode
    character(len=:), allocatable :: who
    who = 'node '//str(mode%node)//' of the edge'
    if (mode%grain > 0) who = 'grain '//str(o%pack%id(mode%grain))
    who = who//trim(merge(' turns', ' moves', mode%turns))
  end function critical_part

  !> Largest eigenvalue of M^-1 K by its quotient r'a / y'r, r = K y, a = M^-1 r: from below, within
  !! some tenths of a percent.
  function highest_frequency(o, coupled) result(mode)
    type(overlap_type), intent(in) :: o
    class(coupled_type), intent(in) :: coupled
    type(mode_type) :: mode
    type(motion_type) :: y, r, a
    real(wp) :: square, before, power, largest
    integer(i4) :: quiet

    call coupled%start(o, y)
    square = 0.0_wp
    quiet = 0
    do while (mode%rounds < most_rounds .and. quiet < quiet_rounds)
      mode%rounds = mode%rounds + 1
      call coupled%stiffness_times(o, y, r)
      a = r
      call coupled%accelerate(o, a)
      power = coupled%work(o, y, r)
      if (.not. power > 0.0_wp) return
      before = square
      square = coupled%work(o, a, r)/power
      quiet = merge(quiet + 1, 0_i4, abs(square - before) <= 2.0_wp*settled*square)
      largest = max(maxval(abs(a%q)), maxval(abs(a%u)), tiny(1.0_wp))
      y%q = a%q/largest
      y%theta = a%theta/largest
      y%u = a%u/largest
      y%phi = a%phi/largest
    end do
    mode%omega = sqrt(square)
    call name_mover(o, a, r, mode)
  end function highest_frequency

  !> Who has the largest share of the power.
  pure subroutine name_mover(o, a, r, mode)
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: a, r
    type(mode_type), intent(inout) :: mode
    real(wp) :: best(4)
    integer(i4) :: k
    best = 0.0_wp
    best(1:2) = [maxval(sum(a%q*r%q, 1)), maxval(sum(a%theta*r%theta, 1))]
    if (size(a%u) > 0) best(3) = maxval(sum(a%u*r%u, 1))
    if (size(a%phi) > 0) best(4) = maxval(sum(a%phi*r%phi, 1))
    k = maxloc(best, 1)
    mode%turns = k == 2 .or. k == 4
    if (k == 1) mode%grain = maxloc(sum(a%q*r%q, 1), 1)
    if (k == 2) mode%grain = maxloc(sum(a%theta*r%theta, 1), 1)
    if (k == 3) mode%node = o%op%node(maxloc(sum(a%u*r%u, 1), 1))
    if (k == 4) mode%node = o%op%node_phi(maxloc(sum(a%phi*r%phi, 1), 1))
  end subroutine name_mover
end module cpl_overlap_limit
