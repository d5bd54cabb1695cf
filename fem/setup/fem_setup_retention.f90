!> Retention and relative permeability of a &pore from the deck.
module fem_setup_retention
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_retention, only: fem_retention_type, begin_table, van_genuchten, brooks_corey, gardner, &
    power, table, by_mualem, by_corey, by_gardner, by_power, by_table
  implicit none
  private
  public :: read_retention

contains

  !> The laws of &pore k; faults D474 and D475.
  subroutine read_retention(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_retention_type), intent(out) :: law
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:)

    call deck%get('pore', k, 'retention', name)
    if (name == 'none') return
    call deck%get('pore', k, 'residual', law%residual)
    select case (name)
    case ('van_genuchten')
      law%law = van_genuchten
      call deck%get('pore', k, name, value)
      if (value(2) <= 1.0_wp) call deck%fault(errors, 'D474', &
        'the exponent nu of van Genuchten is not above 1', 'pore', k, name, &
        'give a [1/Pa] and nu > 1; 1.1 for clay to 3 for sand')
    case ('brooks_corey', 'power')
      law%law = merge(power, brooks_corey, name == 'power')
      call deck%get('pore', k, name, value)
    case ('gardner')
      law%law = gardner
      allocate (value(2), source=1.0_wp)
      call deck%get('pore', k, name, value(1))
    case ('table')
      law%law = table
      allocate (value(2), source=1.0_wp)
      call read_table(deck, k, law, errors)
    end select
    law%a = value(1)
    law%b = value(2)
    call deck%get('pore', k, 'bishop', name)
    law%effective = name == 'effective'
    call read_relative(deck, k, law, errors)
  end subroutine read_retention

  !> The relative permeability.
  subroutine read_relative(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_retention_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:)
    integer(i4), parameter :: own(5) = [by_mualem, by_corey, by_gardner, by_power, by_table]

    call deck%get('pore', k, 'relative', name)
    select case (name)
    case ('own')
      law%relative = own(law%law)
      law%c = law%a
      law%d = 3.0_wp + 2.0_wp/law%b
      if (law%law == power) call deck%fault(errors, 'D475', &
        'retention by a power has no relative permeability of its own', 'pore', k, 'relative', &
        "give relative = 'power', relative_power = c, d or another law")
    case ('mualem')
      law%relative = by_mualem
    case ('corey')
      law%relative = by_corey
      call deck%get('pore', k, 'corey', law%d)
    case ('gardner')
      law%relative = by_gardner
      call deck%get('pore', k, 'relative_gardner', law%c)
    case ('power')
      law%relative = by_power
      call deck%get('pore', k, 'relative_power', value)
      law%c = value(1)
      law%d = value(2)
    case ('table')
      law%relative = by_table
    end select
    if (law%relative == by_table .and. .not. deck%given('pore', k, 'relative_permeabilities')) &
      call deck%fault(errors, 'D475', 'the table has no relative permeability', 'pore', k, &
        'relative', "give relative_permeabilities, or another law, as relative = 'corey'")
  end subroutine read_relative

  !> Tables by suction.
  subroutine read_table(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_retention_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: at(:), kept(:), flows(:)
    call deck%get('pore', k, 'suctions', at)
    call deck%get('pore', k, 'saturations', kept)
    call check_table(deck, k, 'saturations', at, kept, errors)
    allocate (flows(0))
    if (deck%given('pore', k, 'relative_permeabilities')) then
      call deck%get('pore', k, 'relative_permeabilities', flows)
      call check_table(deck, k, 'relative_permeabilities', at, flows, errors)
    end if
    if (.not. errors%any()) call begin_table(law, at, kept, flows)
  end subroutine read_table

  !> Fault D474 for values that are no table of what falls from 1 with suction.
  subroutine check_table(deck, k, key, at, value, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    character(len=*), intent(in) :: key
    real(wp), intent(in) :: at(:), value(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: n
    n = int(size(at), i4)
    if (size(value) /= n .or. n < 2) then
      call deck%fault(errors, 'D474', 'suctions and '//key//' are not as many, two at least', &
        'pore', k, key, 'give a value for each suction')
    else if (at(1) > 0.0_wp .or. value(1) < 1.0_wp .or. any(at(2:) <= at(:n - 1))) then
      call deck%fault(errors, 'D474', 'the table does not begin with 1 at suction 0, and rise', &
        'pore', k, key, 'order suctions, from 0, and begin '//key//' with 1')
    else if (any(value(2:) > value(:n - 1))) then
      call deck%fault(errors, 'D474', key//' rise with suction', 'pore', k, key, &
        'order the table by suction, from 0')
    end if
  end subroutine check_table
end module fem_setup_retention
