!> The registry of laws: a new one is a file of its own, a `use` and a line here, its keys in
!! fem/deck.toml.
module fem_law_registry
  use talus_kinds, only: i4
  use fem_law, only: fem_law_type, fem_law_box_type
  use fem_law_breakage, only: fem_law_breakage_type
  use fem_law_clay, only: fem_law_clay_type
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_kirchhoff, only: fem_law_kirchhoff_type
  use fem_law_layered, only: fem_law_layered_type
  use fem_law_linear, only: fem_law_linear_type
  use fem_law_micropolar, only: fem_law_micropolar_type
  use fem_law_neo_hookean, only: fem_law_neo_hookean_type
  use fem_law_polar_drucker, only: fem_law_polar_drucker_type
  use fem_law_polar_pressure, only: fem_law_polar_pressure_type
  use fem_law_pressure, only: fem_law_pressure_type
  use fem_law_sanisand, only: fem_law_sanisand_type
  implicit none
  private
  public :: make_law, all_laws

contains

  !> Every law, defined, without constants.
  subroutine all_laws(list)
    type(fem_law_box_type), allocatable, intent(out) :: list(:)
    integer(i4) :: k
    allocate (list(0))
    call append(list, fem_law_linear_type())
    call append(list, fem_law_micropolar_type())
    call append(list, fem_law_pressure_type())
    call append(list, fem_law_drucker_type())
    call append(list, fem_law_clay_type())
    call append(list, fem_law_layered_type())
    call append(list, fem_law_neo_hookean_type())
    call append(list, fem_law_kirchhoff_type())
    call append(list, fem_law_polar_drucker_type())
    call append(list, fem_law_polar_pressure_type())
    call append(list, fem_law_sanisand_type())
    call append(list, fem_law_breakage_type())
    do k = 1, int(size(list), i4)
      call list(k)%law%define()
    end do
  end subroutine all_laws

  !> The law of a name in decks, without constants.
  subroutine make_law(name, law)
    character(len=*), intent(in) :: name
    class(fem_law_type), allocatable, intent(out) :: law
    type(fem_law_box_type), allocatable :: list(:)
    integer(i4) :: k
    call all_laws(list)
    do k = 1, int(size(list), i4)
      if (list(k)%law%name == name) call move_alloc(list(k)%law, law)
      if (allocated(law)) return
    end do
    error stop 'bug: a law of fem/deck.toml is not in fem_law_registry'
  end subroutine make_law

  subroutine append(list, law)
    type(fem_law_box_type), allocatable, intent(inout) :: list(:)
    class(fem_law_type), intent(in) :: law
    type(fem_law_box_type), allocatable :: longer(:)
    integer(i4) :: k
    allocate (longer(size(list) + 1))
    do k = 1, int(size(list), i4)
      call move_alloc(list(k)%law, longer(k)%law)
    end do
    allocate (longer(size(longer))%law, source=law)
    call move_alloc(longer, list)
  end subroutine append
end module fem_law_registry
