!> What the file of an additional contact model gives, and what its routines are given.
!!
!! A model is a file of dem/laws that fills additional_model_type, and a line in
!! dem_additional_registry. No other code depends on a model by name, but that bonds are made and
!! counted in files of theirs.
module dem_additional_model
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_block, only: dem_block_type
  use dem_additional_numbers, only: most_own, additional_work_count
  use dem_law_state, only: law_numbers_type, history_size, column_count
  implicit none
  private
  public :: additional_model_type, additional_given_type, additional_works_type

  !> What a model knows of a block, or of one of its contacts, beside its history.
  type :: additional_given_type
    type(law_numbers_type) :: law                 !! of the pair of materials
    real(wp) :: own(most_own)                     !! constants of the model's own
    logical :: surface = .false.                  !! contacts of a grain with surfaces
    logical :: round = .false.                    !! all pairs are of spheres
    logical :: responds = .false.                 !! response is given
    real(wp) :: h                                 !! since the last evaluation [s]
    real(wp) :: m_star(lanes), weight(lanes)      !! reduced masses [kg], weights [-]
    real(wp) :: response(3, lanes)                !! k_n, k_t [N/m], elastic normal force [N]
  end type additional_given_type

  !> Works of a block in this step; a model adds its own.
  type :: additional_works_type
    real(wp) :: columns(column_count)             !! column_... of dem_law_state [J]
    real(wp) :: models(additional_work_count)     !! work_... of dem_additional_numbers
  end type additional_works_type

  !> An additional contact model; components after `forces` may be left as they are.
  type :: additional_model_type
    character(len=12) :: name = ''           !! also of its memory in checkpoints
    procedure(forces_routine), pointer, nopass :: forces => null()       !! of pairs of grains
    procedure(forces_routine), pointer, nopass :: at_surfaces => null()  !! null: none there
    procedure(constants_routine), pointer, nopass :: constants => null() !! own, from &contact
    procedure(energy_routine), pointer, nopass :: energy => null()       !! stored, of a block
    procedure(stiffness_routine), pointer, nopass :: stiffness => null() !! limits the step
    procedure(reach_routine), pointer, nopass :: reach => null()         !! of a contact
    procedure(longest_routine), pointer, nopass :: longest => null()     !! of any contact
    procedure(fit_routine), pointer, nopass :: fit => null()             !! to the grains
    character(len=64) :: shorter = ''        !! hint: what makes its reach shorter
    integer(i4) :: reals = 0                 !! kept by a contact, 0 without it
    logical :: holds = .false.               !! over a gap, where its first real is > 0
    logical :: wants_response = .false.      !! of base laws whose normal force is not Hertz'
    logical :: plastic = .false.             !! books plastic work
    integer(i4) :: damping = 0               !! own constant: damping ratio of turns, 0: none
  end type additional_model_type

  abstract interface
    !> Constants of its own from contact group k; law: the base law. Faults go to the list.
    subroutine constants_routine(deck, k, law, own, acts, errors)
      import :: deck_type, i4, wp, law_numbers_type, most_own, error_list_type
      type(deck_type), intent(in) :: deck
      integer(i4), intent(in) :: k
      type(law_numbers_type), intent(in) :: law
      real(wp), intent(inout) :: own(most_own)
      logical, intent(out) :: acts
      type(error_list_type), intent(inout) :: errors
    end subroutine constants_routine

    !> Add forces and moments of all lanes to the block, works to the works; bring forward what is
    !! kept by h. The base law has been there: the history is that of the end of the step.
    pure subroutine forces_routine(b, given, history, kept, works)
      import :: dem_block_type, additional_given_type, additional_works_type, lanes, &
        history_size, wp
      type(dem_block_type), intent(inout) :: b
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: history(lanes, history_size)
      real(wp), intent(inout), contiguous :: kept(:, :)  !! (lanes, reals)
      type(additional_works_type), intent(inout) :: works
    end subroutine forces_routine

    !> Stored in a block [J].
    pure function energy_routine(given, kept) result(energy)
      import :: additional_given_type, wp
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: kept(:, :)  !! (lanes, reals)
      real(wp) :: energy
    end function energy_routine

    !> Of a contact beyond that of the base law: of translation [N/m] and of rotation [N m].
    pure function stiffness_routine(given, kept) result(stiffness)
      import :: additional_given_type, wp
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: kept(:)  !! (reals)
      real(wp) :: stiffness(2)
    end function stiffness_routine

    !> Gap up to which a contact may hold that keeps these [m].
    pure function reach_routine(given, kept) result(gap)
      import :: additional_given_type, wp
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: kept(:)  !! (reals)
      real(wp) :: gap
    end function reach_routine

    !> Gap up to which any contact holds of an effective radius [m].
    pure function longest_routine(given, radius) result(gap)
      import :: additional_given_type, wp
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: radius  !! R_e [m]
      real(wp) :: gap
    end function longest_routine

    !> Faults of constants that do not fit the grains.
    subroutine fit_routine(given, least, errors)
      import :: additional_given_type, wp, error_list_type
      type(additional_given_type), intent(in) :: given
      real(wp), intent(in) :: least  !! radius of the smallest grain [m]
      type(error_list_type), intent(inout) :: errors
    end subroutine fit_routine
  end interface
end module dem_additional_model
