!> What every material law with a state offers: stress and state from a strain increment, with the
!! consistent tangent. Small strains; tension positive; components as in fem_voigt.
module fem_law
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_polar, only: symmetric_of
  use fem_types, only: name_length
  implicit none
  private
  public :: fem_law_type, fem_law_box_type, integrate, common_names
  public :: at_flag, at_iterations, at_stored, at_dissipated, at_numerical, at_plastic, common_size
  public :: flag_elastic, flag_yielding, flag_apex, state_length

  !> Places in the state of a point that all laws share.
  integer(i4), parameter :: at_flag = 1        !! elastic, yielding or apex in the last increment
  integer(i4), parameter :: at_iterations = 2  !! local iterations in it
  integer(i4), parameter :: at_stored = 3      !! elastic work since the start [J/m^3]
  integer(i4), parameter :: at_dissipated = 4  !! plastic dissipation [J/m^3]
  integer(i4), parameter :: at_numerical = 5   !! dissipated by the integration [J/m^3]
  integer(i4), parameter :: at_plastic = 6     !! plastic strain, six components
  integer(i4), parameter :: common_size = 11
  integer(i4), parameter :: state_length = 32  !! of the name of a state variable
  real(wp), parameter :: flag_elastic = 0.0_wp, flag_yielding = 1.0_wp, flag_apex = 2.0_wp

  integer(i4), parameter :: most_parts = 128   !! of an increment, when the whole does not converge
  real(wp), parameter :: probe = 1.0e-6_wp     !! of the strain, for the tangent of a cut increment

  character(len=18), parameter :: common_names(common_size) = [character(len=18) :: 'yield', &
    'local_iterations', 'stored_energy', 'dissipation', 'numerical', 'plastic_xx', 'plastic_yy', &
    'plastic_zz', 'plastic_xy', 'plastic_yz', 'plastic_zx']

  !> Properties of a law (`define`) and of its material (`read_constants`): set-up, restart,
  !! output and the one-point driver read them here, and refer to no law by its name.
  type, abstract :: fem_law_type
    character(len=name_length) :: name = ''  !! in decks
    character(len=name_length) :: id = ''    !! of the material
    logical :: stateful = .true.       !! false: linear elasticity, of `moduli` or `operator`
    logical :: symmetric = .true.      !! its tangent is
    logical :: finite = .false.        !! finite strain: fem_law_finite
    logical :: polar = .false.         !! strain and curvature of 18 components: fem_law_polar
    logical :: eringen = .false.       !! has the constants of Eringen's solid
    logical :: accounts = .false.      !! its update counts what is stored and dissipated
    integer(i4) :: states = common_size
    character(len=state_length), allocatable :: state_names(:)  !! beyond the common, with unit
    real(wp) :: moduli(6) = 0.0_wp     !! as in fem_micropolar; at the reference of the law [Pa, N]
    real(wp), allocatable :: operator(:, :, :)  !! (9, 9, 2) linear and not isotropic: of gamma
                                                !! [Pa] and of curvature [N]
  contains
    procedure(define_face), deferred :: define
    procedure(read_face), deferred :: read_constants
    procedure :: begin
    procedure :: take_over
    procedure(update_face), deferred :: update
    procedure(modulus_face), deferred :: modulus
    procedure :: moduli_at
    procedure :: add_states
    procedure :: state_name
  end type fem_law_type

  !> A law in a list.
  type :: fem_law_box_type
    class(fem_law_type), allocatable :: law
  end type fem_law_box_type

  abstract interface
    !> Name in decks, kind, states.
    subroutine define_face(self)
      import :: fem_law_type
      class(fem_law_type), intent(inout) :: self
    end subroutine define_face
    !> Constants of material m of the deck, whose keys were checked; faults of values that cannot
    !! work together.
    subroutine read_face(self, deck, m, errors)
      import :: fem_law_type, deck_type, error_list_type, i4
      class(fem_law_type), intent(inout) :: self
      type(deck_type), intent(in) :: deck
      integer(i4), intent(in) :: m
      type(error_list_type), intent(inout) :: errors
    end subroutine read_face
    !> Stress and state after a strain increment, and the tangent d stress/d strain. A point that
    !! yielded treats a zero increment as the limit of a small one. `good` is false where the local
    !! equations do not converge; nothing is changed then.
    pure subroutine update_face(self, strain, stress, state, tangent, good)
      import :: fem_law_type, wp
      class(fem_law_type), intent(in) :: self
      real(wp), intent(in) :: strain(6)
      real(wp), intent(inout) :: stress(6)
      real(wp), intent(inout) :: state(:)
      real(wp), intent(out) :: tangent(6, 6)
      logical, intent(out) :: good
    end subroutine update_face
    !> Bulk and shear modulus at a state, for scales, hints and the largest stable step [Pa].
    pure function modulus_face(self, stress) result(moduli)
      import :: fem_law_type, wp
      class(fem_law_type), intent(in) :: self
      real(wp), intent(in) :: stress(6)
      real(wp) :: moduli(2)
    end function modulus_face
  end interface

contains

  !> State of a point that starts with a stress; `fault` is what is wrong with it, with its value,
  !! and `cure` a remedy; '' if nothing is. Here: every stress is admitted.
  subroutine begin(self, stress, state, fault, cure)
    class(fem_law_type), intent(in) :: self
    real(wp), intent(in) :: stress(6)   !! [Pa]
    real(wp), intent(out) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    state = 0.0_wp
    fault = ''
    cure = ''
  end subroutine begin

  !> State of a point that begins within a run with the stress of grains, which is brought back to
  !! what the law bears (eq. F.75, F.76, F.77). `state` holds that of the point until now. Here:
  !! every stress is admitted that the law can start with.
  subroutine take_over(self, density, stress, state, fault, cure)
    class(fem_law_type), intent(in) :: self
    real(wp), intent(in) :: density         !! of the grains, over that of the deck [-]
    real(wp), intent(inout) :: stress(6)    !! [Pa]
    real(wp), intent(inout) :: state(:)
    character(len=:), allocatable, intent(out) :: fault, cure
    call self%begin(stress, state, fault, cure)
  end subroutine take_over

  !> Moduli, as in fem_micropolar, of waves about a stress: the largest stable step is theirs.
  pure function moduli_at(self, stress) result(moduli)
    class(fem_law_type), intent(in) :: self
    real(wp), intent(in) :: stress(:)  !! six components, or those of a body with micropolar parts
    real(wp) :: moduli(6), two(2)
    if (size(stress) > 6) then
      two = self%modulus(stress(symmetric_of))
    else
      two = self%modulus(stress)
    end if
    moduli = 0.0_wp
    moduli(:2) = [two(1) - 2.0_wp/3.0_wp*two(2), two(2)]
  end function moduli_at

  !> States beyond the common ones, by name and unit: 'hardening [-]'.
  subroutine add_states(self, names)
    class(fem_law_type), intent(inout) :: self
    character(len=*), intent(in) :: names(:)
    self%state_names = names
    self%states = common_size + int(size(names), i4)
  end subroutine add_states

  !> Name and unit of state k, beyond the common ones.
  pure function state_name(self, k) result(name)
    class(fem_law_type), intent(in) :: self
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    name = trim(self%state_names(k - common_size))
  end function state_name

  !> Update with the ledger of the point: trapezoidal work is stored, dissipated (end stress times
  !! plastic strain, never negative) or by the integration. An increment that does not converge
  !! as a whole is divided into 2, 4, ... parts, with a tangent by differences.
  pure subroutine integrate(law, strain, stress, state, tangent, good)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: new(6), there(size(state))
    integer(i4) :: parts

    new = stress
    there = state
    call law%update(strain, new, there, tangent, good)
    if (good) call count_work(law%finite .or. law%accounts, strain, stress, new, state, there)
    parts = 1
    do while (.not. good .and. parts < most_parts)
      parts = 2*parts
      call in_parts(law, strain, parts, stress, state, new, there, good)
      if (good) call differences(law, strain, parts, stress, state, tangent, good)
    end do
    if (.not. good) return
    stress = new
    state = there
  end subroutine integrate

  !> The increment in equal parts.
  pure subroutine in_parts(law, strain, parts, stress, state, new, there, good)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: strain(6), stress(6), state(:)
    integer(i4), intent(in) :: parts
    real(wp), intent(out) :: new(6), there(:)
    logical, intent(out) :: good
    real(wp) :: before(6), was(size(state)), unused(6, 6), iterations
    integer(i4) :: k
    new = stress
    there = state
    iterations = 0.0_wp
    do k = 1, parts
      before = new
      was = there
      call law%update(strain/parts, new, there, unused, good)
      if (.not. good) return
      iterations = iterations + there(at_iterations)
      call count_work(law%finite .or. law%accounts, strain/parts, before, new, was, there)
    end do
    there(at_iterations) = iterations
    ! trapezoids of the parts are not that of the whole, which the ledger of the body counts
    there(at_numerical) = there(at_numerical) + 0.5_wp*sum((stress + new)*strain) &
      - sum(there(at_stored:at_numerical) - state(at_stored:at_numerical))
  end subroutine in_parts

  !> Tangent of an increment in parts, by central differences.
  pure subroutine differences(law, strain, parts, stress, state, tangent, good)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: strain(6), stress(6), state(:)
    integer(i4), intent(in) :: parts
    real(wp), intent(out) :: tangent(6, 6)
    logical, intent(out) :: good
    real(wp) :: step, moved(6), high(6), low(6), there(size(state))
    integer(i4) :: j
    step = probe*max(maxval(abs(strain)), probe)
    do j = 1, 6
      moved = strain
      moved(j) = strain(j) + step
      call in_parts(law, moved, parts, stress, state, high, there, good)
      if (.not. good) return
      moved(j) = strain(j) - step
      call in_parts(law, moved, parts, stress, state, low, there, good)
      if (.not. good) return
      tangent(:, j) = (high - low)/(2.0_wp*step)
    end do
  end subroutine differences

  !> Work of the increment from `stress` to `new` into the state `there`; laws of finite strain, and
  !! those that account for it, have the stored and the dissipated energy `known`.
  pure subroutine count_work(known, strain, stress, new, state, there)
    logical, intent(in) :: known
    real(wp), intent(in) :: strain(6), stress(6), new(6), state(:)
    real(wp), intent(inout) :: there(:)
    real(wp) :: plastic(6), lost
    if (known) then
      there(at_numerical) = state(at_numerical) + 0.5_wp*sum((stress + new)*strain) &
        - sum(there(at_stored:at_dissipated) - state(at_stored:at_dissipated))
      return
    end if
    plastic = there(at_plastic:at_plastic + 5) - state(at_plastic:at_plastic + 5)
    lost = sum(new*plastic)
    there(at_stored) = state(at_stored) + 0.5_wp*sum((stress + new)*(strain - plastic))
    there(at_dissipated) = state(at_dissipated) + lost
    there(at_numerical) = state(at_numerical) + 0.5_wp*sum((stress + new)*plastic) - lost
  end subroutine count_work
end module fem_law
