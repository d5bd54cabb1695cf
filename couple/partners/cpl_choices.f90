!> What the coupled deck asks for, checked.
module cpl_choices
  use talus_kinds, only: wp, i4
  use talus_command, only: command_words
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_files, only: folder_of, stem_of
  use cpl_overlap_choices, only: overlap_choices_type, read_overlap
  use cpl_pore_choices, only: pore_choices_type, read_pore
  use cpl_solver, only: cpl_solver_type, sides, side_grains
  implicit none
  private
  public :: cpl_choices_type, read_choices, read_solvers, method_name
  public :: scheme_average, scheme_iterated, scheme_state, scheme_symmetric
  public :: interface_springs, interface_theta, interface_aitken, interface_none
  public :: rotation_fixed, rotation_curl, rotation_micro

  integer(i4), parameter :: scheme_average = 1, scheme_iterated = 2, scheme_state = 3, &
    scheme_symmetric = 4
  integer(i4), parameter :: interface_springs = 1, interface_theta = 2, interface_aitken = 3, &
    interface_none = 4
  integer(i4), parameter :: rotation_fixed = 0, rotation_curl = 1, rotation_micro = 2
  real(wp), parameter :: round_off = 1.0e-9_wp  !! of an interval

  type :: cpl_choices_type
    character(len=:), allocatable :: transport, ghosts, facets, surface
    character(len=:), allocatable :: scheme_name, interface_name
    real(wp) :: t_end = 0.0_wp         !! s
    real(wp) :: gravity(3) = 0.0_wp    !! m/s2
    logical :: gravity_given = .false.
    real(wp) :: exchange = 0.0_wp      !! s
    integer(i4) :: exchanges = 0       !! until t_end
    real(wp) :: time_limit = 0.0_wp    !! s
    logical :: trace = .false.
    integer(i4) :: scheme = scheme_average
    integer(i4) :: interface = interface_springs
    real(wp) :: tolerance = 0.0_wp
    integer(i4) :: max_iterations = 0
    real(wp) :: max_offset = -1.0_wp   !! m, below 0: not given
    real(wp) :: stiffness = 0.0_wp     !! N/m, 0: not given
    real(wp) :: theta = 0.0_wp         !! 0: not given
    real(wp) :: spread = 0.0_wp        !! width of the kernel [m], 0: none
    integer(i4) :: rotation = rotation_fixed  !! of the ghosts
    integer(i4) :: pieces = 1          !! most of an exchange
    logical :: dead_load = .true.
    logical :: relaxed = .false.       !! both sides find their balance before the run
    real(wp) :: relax_tolerance = 0.0_wp
    integer(i4) :: relax_exchanges = 0
    logical :: adaptive = .false.      !! elements of the overlap change their part
    type(overlap_choices_type) :: overlap
    type(pore_choices_type) :: pore
  end type cpl_choices_type

contains

  !> Name of the coupling method, as cpl_methods lists it.
  pure function method_name(choices) result(name)
    type(cpl_choices_type), intent(in) :: choices
    character(len=:), allocatable :: name
    name = 'facets'
    if (.not. choices%overlap%given) return
    if (allocated(choices%overlap%method)) name = choices%overlap%method
    if (allocated(choices%overlap%scheme) .and. name == 'bridging_scale') then
      if (choices%overlap%scheme == 'static') name = 'static_overlap'
    end if
    if (choices%adaptive) name = 'adaptive_scale'
  end function method_name

  subroutine read_choices(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(cpl_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: initial, rotation
    real(wp), allocatable :: gravity(:)

    call deck%get('run', 1, 't_end', choices%t_end)
    choices%gravity_given = deck%given('run', 1, 'gravity')
    call deck%get('run', 1, 'gravity', gravity)
    if (size(gravity) == 3) choices%gravity = gravity
    call deck%get('port', 1, 'transport', choices%transport)
    call deck%get('port', 1, 'time_limit', choices%time_limit)
    call deck%get('port', 1, 'trace', choices%trace)
    call deck%get('clock', 1, 'exchange', choices%exchange)
    call deck%get('clock', 1, 'scheme', choices%scheme_name)
    call deck%get('clock', 1, 'pieces', choices%pieces)
    call deck%get('clock', 1, 'tolerance', choices%tolerance)
    call deck%get('clock', 1, 'max_iterations', choices%max_iterations)
    choices%adaptive = deck%count('adapt') > 0 .and. deck%count('overlap') > 0
    call read_overlap(deck, choices%overlap, errors)
    call check_clock(deck, choices, errors)
    call read_pore(deck, choices%pore, errors)
    if (deck%count('facets') == 0) return
    call deck%get('facets', 1, 'ghosts', choices%ghosts)
    call deck%get('facets', 1, 'surface', choices%surface)
    call deck%get('facets', 1, 'facets', choices%facets)
    call deck%get('facets', 1, 'interface', choices%interface_name)
    call deck%get('facets', 1, 'initial', initial)
    choices%dead_load = initial == 'dead_load'
    choices%relaxed = initial == 'relax'
    call deck%get('facets', 1, 'relax_tolerance', choices%relax_tolerance)
    call deck%get('facets', 1, 'relax_exchanges', choices%relax_exchanges)
    call deck%get('facets', 1, 'rotation', rotation)
    if (rotation == 'curl') choices%rotation = rotation_curl
    if (rotation == 'micro') choices%rotation = rotation_micro
    if (deck%given('facets', 1, 'spread')) call deck%get('facets', 1, 'spread', choices%spread)
    if (deck%given('facets', 1, 'max_offset')) &
      call deck%get('facets', 1, 'max_offset', choices%max_offset)
    if (deck%given('facets', 1, 'stiffness')) &
      call deck%get('facets', 1, 'stiffness', choices%stiffness)
    if (deck%given('facets', 1, 'theta')) call deck%get('facets', 1, 'theta', choices%theta)
    call set_methods(choices)
    call check_surface(deck, choices, errors)
  end subroutine read_choices

  !> What goes with ghosts alone (D416).
  subroutine check_surface(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(cpl_choices_type), intent(in) :: choices
    type(error_list_type), intent(inout) :: errors
    if (len(choices%surface) == 0) return
    if (choices%rotation /= rotation_fixed) &
      call deck%fault(errors, 'D416', 'a surface turns with its triangles', 'facets', 1, &
                      'rotation', 'leave rotation out with surface')
  end subroutine check_surface

  subroutine set_methods(choices)
    type(cpl_choices_type), intent(inout) :: choices
    select case (choices%scheme_name)
    case ('iterated')
      choices%scheme = scheme_iterated
    case ('state_at_n')
      choices%scheme = scheme_state
    case ('symmetric')
      choices%scheme = scheme_symmetric
    case default
      choices%scheme = scheme_average
    end select
    select case (choices%interface_name)
    case ('theta')
      choices%interface = interface_theta
    case ('aitken')
      choices%interface = interface_aitken
    case ('none')
      choices%interface = interface_none
    case default
      choices%interface = interface_springs
    end select
  end subroutine set_methods

  !> D401 t_end is no whole number of exchanges, D418 pieces where none are made.
  subroutine check_clock(deck, choices, errors)
    type(deck_type), intent(in) :: deck
    type(cpl_choices_type), intent(inout) :: choices
    type(error_list_type), intent(inout) :: errors
    real(wp) :: count

    count = choices%t_end/choices%exchange
    if (count < 0.5_wp .or. abs(count - anint(count)) > round_off*max(1.0_wp, count) .or. &
        count > real(huge(0_i4), wp)) then
      call deck%fault(errors, 'D401', 't_end = '//str(choices%t_end)//' s is '//str(count)// &
                      ' exchanges', 'clock', 1, 'exchange', &
                      'choose t_end as a whole number of exchanges')
    else
      choices%exchanges = nint(count)
    end if
    if (choices%pieces == 1) return
    if (deck%count('facets') == 0 .or. deck%count('pore_interface') > 0 .or. &
        choices%scheme_name /= 'average') &
      call deck%fault(errors, 'D418', 'only dry facets with the mean force are exchanged in '// &
                      'pieces', 'clock', 1, 'pieces', "leave it out, or write scheme = 'average'")
  end subroutine check_clock

  !> The two solvers in the order grains, solid; faults: D404 sides, D405 launch, D406 names.
  subroutine read_solvers(deck, stem, solvers, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: stem  !! path without ending of the coupled run's files
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: side
    integer(i4) :: k, s, at(2)

    at = 0
    do k = 1, deck%count('program')
      call deck%get('program', k, 'side', side)
      s = merge(1_i4, 2_i4, side == sides(side_grains))
      if (at(s) > 0) then
        call deck%fault(errors, 'D404', "the side '"//side//"' is given twice", 'program', k, &
                        'side', 'one program for each side')
        cycle
      end if
      at(s) = k
      call read_solver(deck, k, s, stem, solvers(s), errors)
    end do
    do s = 1, 2
      if (at(s) > 0) cycle
      call deck%fault(errors, 'D404', "no program is given for the side '"//trim(sides(s))//"'", &
                      'program', 1, 'side', "add &program side = '"//trim(sides(s))// &
                        "', deck = ... /")
    end do
    if (any(at == 0)) return
    if (stem_of(solvers(1)%deck) == stem_of(solvers(2)%deck)) &
      call deck%fault(errors, 'D406', 'both solvers would write '//stem_of(solvers(1)%deck)// &
                      '.log', 'program', at(2), 'deck', 'give the decks different names')
  end subroutine read_solvers

  !> The command line of a program can be taken apart.
  subroutine check_command(deck, k, command, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    character(len=*), intent(in) :: command
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: words(:)
    logical :: closed
    if (len(command) == 0) return
    call command_words(command, words, closed)
    if (.not. closed) then
      call deck%fault(errors, 'D405', 'command has a quote that does not end', 'program', k, &
                      'command', 'blanks part words, quotes hold them together; no shell reads it')
    else if (size(words) == 0) then
      call deck%fault(errors, 'D405', 'command has no word', 'program', k, 'command', &
                      'name the launcher or the program')
    end if
  end subroutine check_command

  subroutine read_solver(deck, k, s, stem, solver, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, s  !! number of the group, of the side
    character(len=*), intent(in) :: stem
    type(cpl_solver_type), intent(inout) :: solver
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: ranks

    solver%side = trim(sides(s))
    solver%program = trim(merge('talus-dem', 'talus-fem', s == side_grains))
    solver%deck = deck%path('program', k, 'deck')
    solver%output = stem//'.'//solver%side//'.out'
    call deck%get('program', k, 'launch', solver%launch)
    call deck%get('program', k, 'command', solver%command)
    call deck%get('program', k, 'threads', solver%threads)
    call deck%get('program', k, 'ranks', ranks)
    if (ranks > 1 .and. solver%launch == 'fork') &
      call deck%fault(errors, 'D405', "launch = 'fork' starts one rank, not "//str(ranks), &
                      'program', k, 'ranks', "write launch = 'command', command = 'mpirun -np "// &
                      str(ranks)//' '//solver%program//"'")
    if (solver%launch == 'command' .and. len(solver%command) == 0) &
      call deck%fault(errors, 'D405', "launch = 'command' needs a command", 'program', k, &
        'launch', &
                      "for example command = 'mpirun -np 2 "//solver%program//"'")
    call check_command(deck, k, solver%command, errors)
    if (solver%launch /= 'command' .and. len(solver%command) > 0) &
      call deck%fault(errors, 'D405', "command means nothing with launch = '"//solver%launch//"'", &
                      'program', k, 'command', "write launch = 'command'")
    if (stem_of(solver%deck) == stem_of(stem)) &
      call deck%fault(errors, 'D406', 'this solver and the coupled run would both write '// &
                      stem_of(stem)//'.log', 'program', k, 'deck', &
                      'give the decks different names')
  end subroutine read_solver
end module cpl_choices
