!> Contact laws as data: constants of a pair of materials, and what the file of a base law gives.
!!
!! A base law is a file of dem/laws that fills base_law_type, and a line in dem_law_registry. No
!! other code depends on a law by name. Default routines are those of springs: Hertz or linear
!! normal force, tangential spring of stiffness k_t (dem_contact).
module dem_law_state
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_block, only: dem_block_type
  use dem_additional_numbers, only: additional_law_type
  implicit none
  private
  public :: dem_material_type, law_numbers_type, dem_law_type, base_law_type
  public :: constants_routine, forces_routine, energy_routine, response_routine, impact_routine
  public :: history_size, history_side, history_root, history_point, column_count
  public :: column_damping, column_friction, column_relaxation, column_curvature, column_plastic

  integer(i4), parameter :: history_size = 11     !! reals kept for a candidate, see dem_contact
  integer(i4), parameter :: history_side = 7      !! square root of the overlap, > 0 in contact
  integer(i4), parameter :: history_root = 8      !! square root of the effective radius
  integer(i4), parameter :: history_point = 9     !! contact point from the centre of A, 9-11

  integer(i4), parameter :: column_count = 5      !! work columns of a block, all in J:
  integer(i4), parameter :: column_damping = 1    !! dissipated by dashpots
  integer(i4), parameter :: column_friction = 2   !! dissipated by sliding
  integer(i4), parameter :: column_relaxation = 3 !! lost by tangential springs without sliding
  integer(i4), parameter :: column_curvature = 4  !! fed into normal springs as R_e changes
  integer(i4), parameter :: column_plastic = 5    !! dissipated by plastic deformation of contacts

  integer(i4), parameter :: most_own = 4   !! constants of a law's own
  integer(i4), parameter :: longest_key = 24

  !> Elastic constants and density of a material.
  type :: dem_material_type
    real(wp) :: young = 0.0_wp    !! Young's modulus [Pa]
    real(wp) :: poisson = 0.0_wp  !! Poisson's ratio [-]
    real(wp) :: density = 0.0_wp  !! density [kg/m^3]
    logical :: fragments_scaled = .false.  !! masses of its grains are not those of the solid
  end type dem_material_type

  !> Numbers of a law of an ordered pair of materials, as its file sees them.
  type :: law_numbers_type
    real(wp) :: e_star = 0.0_wp            !! contact modulus E*, 0 of given stiffness [Pa]
    real(wp) :: g_star = 0.0_wp            !! shear contact modulus G* [Pa]
    real(wp) :: friction = 0.0_wp          !! Coulomb coefficient [-]
    real(wp) :: damping_ratio = 0.0_wp     !! normal damping ratio xi [-]
    real(wp) :: tangential_ratio = 0.0_wp  !! tangential damping ratio [-]
    real(wp) :: kn = 0.0_wp                !! normal stiffness if it is given [N/m]
    real(wp) :: kt = 0.0_wp                !! tangential stiffness if it is given [N/m]
    real(wp) :: own(most_own) = 0.0_wp     !! of the law's own, see its file
    real(wp) :: spring = 1.0_wp            !! 1: tangential spring kept, 0: none
    real(wp) :: share = 0.5_wp             !! compliance share of the first material [-]
    logical :: frozen = .false.            !! R_e of a contact stays that of its first touch
  end type law_numbers_type

  !> A base law; components after `forces` may be left as they are.
  type :: base_law_type
    character(len=longest_key) :: name = ''  !! in the deck
    procedure(forces_routine), pointer, nopass :: forces => null()
    procedure(constants_routine), pointer, nopass :: constants => null()  !! own, from the deck
    procedure(energy_routine), pointer, nopass :: energy => null()      !! stored, of a block
    procedure(response_routine), pointer, nopass :: response => null()  !! stiffness and force
    procedure(impact_routine), pointer, nopass :: impact => null()      !! predicted stiffness
    character(len=12) :: memory = ''         !! name in checkpoints of what its contacts keep
    integer(i4) :: reals = 0                 !! of it, 0 without contact
    logical :: hertz = .true.                !! normal force of Hertz: elliptic areas, DMT, JKR
    logical :: starts = .true.               !! accepts the tangential force of a packing
    logical :: plastic = .false.             !! books plastic work
    real(wp) :: spring = 1.0_wp              !! 1: tangential spring kept, 0: none
    real(wp) :: oscillator = sqrt(1.2_wp)    !! damping of the equivalent linear oscillator / xi [-]
  end type base_law_type

  !> Contact law of an ordered pair of materials (filled by dem_law).
  type, extends(law_numbers_type) :: dem_law_type
    integer(i4) :: kind = 0                !! place in dem_law_registry, 0: not given
    type(base_law_type) :: base
    logical :: elliptic = .false.          !! exact Hertz force of elliptic areas, see dem_ellipse
    type(additional_law_type) :: additional !! additional contact models
  end type dem_law_type

  abstract interface
    !> Constants of the law's own from contact group k of the deck; moduli, friction and damping are
    !! there. Faults go to the list.
    subroutine constants_routine(deck, k, law, errors)
      import :: deck_type, i4, law_numbers_type, error_list_type
      type(deck_type), intent(in) :: deck
      integer(i4), intent(in) :: k
      type(law_numbers_type), intent(inout) :: law
      type(error_list_type), intent(inout) :: errors
    end subroutine constants_routine

    !> Forces and moments of all lanes into the block, history and memory brought forward by h.
    pure subroutine forces_routine(b, law, round, h, m_star, weight, history, memory, columns)
      import :: dem_block_type, law_numbers_type, lanes, history_size, column_count, wp
      type(dem_block_type), intent(inout) :: b
      type(law_numbers_type), intent(in) :: law
      logical, intent(in) :: round                            !! all pairs are of spheres
      real(wp), intent(in) :: h                               !! since the last evaluation [s]
      real(wp), intent(in) :: m_star(lanes), weight(lanes)    !! reduced masses [kg], weights [-]
      real(wp), intent(inout) :: history(lanes, history_size)
      real(wp), intent(inout), contiguous :: memory(:, :)     !! (lanes, reals)
      real(wp), intent(out) :: columns(column_count)          !! [J]
    end subroutine forces_routine

    !> Stored normal and tangential energy of a block; on entry that of springs [J].
    pure subroutine energy_routine(law, weight, memory, energy)
      import :: law_numbers_type, lanes, wp
      type(law_numbers_type), intent(in) :: law
      real(wp), intent(in) :: weight(lanes), memory(:, :)  !! [-], (lanes, reals)
      real(wp), intent(inout) :: energy(2)
    end subroutine energy_routine

    !> k_n and k_t [N/m], elastic normal force [N] of a contact.
    pure function response_routine(law, memory) result(response)
      import :: law_numbers_type, wp
      type(law_numbers_type), intent(in) :: law
      real(wp), intent(in) :: memory(:)  !! (reals)
      real(wp) :: response(3)
    end function response_routine

    !> k_n + k_t at the largest overlap of an impact, 0: none predicted [N/m].
    pure function impact_routine(law, mass, radius, speed) result(stiffness)
      import :: law_numbers_type, wp
      type(law_numbers_type), intent(in) :: law
      real(wp), intent(in) :: mass, radius  !! reduced mass [kg], R_e [m]
      real(wp), intent(in) :: speed         !! of approach [m/s]
      real(wp) :: stiffness
    end function impact_routine
  end interface
end module dem_law_state
