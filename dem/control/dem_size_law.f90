!> Sizes of entering grains by a law of the mass between two limits: normal, lognormal, or that of
!! Rosin and Rammler (1933, J. Inst. Fuel 7, 29). A size is the opening of the finest square sieve
!! that an ellipsoid passes, twice its middle semi-axis. Fault D478.
module dem_size_law
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_text, only: str
  implicit none
  private
  public :: size_law_type, read_size_law, by_law

  integer(i4), parameter :: cells = 200  !! of a law between its limits, as in `talus pack`

  !> The share of the number below each of some sizes; none: sizes follow no law.
  type :: size_law_type
    real(wp), allocatable :: edge(:)   !! (cells + 1) rising [m]
    real(wp), allocatable :: share(:)  !! (cells + 1) from 0 to 1 [-]
  end type size_law_type

contains

  !> The law of the k-th &source; 'uniform' has none (D478).
  subroutine read_size_law(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(size_law_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: limits(:)
    real(wp) :: middle, spread

    call deck%get('source', k, 'size_law', name)
    if (name == 'uniform') return
    call deck%get('source', k, 'size_middle', middle)
    call deck%get('source', k, 'size_spread', spread)
    call deck%get('source', k, 'size_limits', limits)
    if (limits(1) < limits(2)) call make_law(name, middle, spread, limits, law)
    if (allocated(law%edge)) return
    call deck%fault(errors, 'D478', "the law '"//name//"' of "//str(middle)//' m has no mass '// &
                    'between '//str(limits(1))//' and '//str(limits(2))//' m', 'source', k, &
                    'size_limits', 'two rising sizes around the middle of the law: '// &
                    'size_spread is a length in m for normal, a number for the others')
  end subroutine read_size_law

  !> Shares of the number from those of the mass: a grain of size d has a mass like d^3. Left
  !! unallocated where less than a millionth of the mass lies within the limits.
  subroutine make_law(name, middle, spread, limits, law)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: middle, spread, limits(2)
    type(size_law_type), intent(inout) :: law
    real(wp) :: edge(cells + 1), passes(cells + 1), share(cells + 1)
    integer(i4) :: c

    edge = [(limits(1)*(limits(2)/limits(1))**(real(c, wp)/cells), c=0, cells)]
    passes = passing(name, middle, spread, edge)
    if (.not. passes(cells + 1) - passes(1) > 1.0e-6_wp) return
    share(1) = 0.0_wp
    do c = 1, cells
      share(c + 1) = share(c) + (passes(c + 1) - passes(c))*(edge(c)*edge(c + 1))**(-1.5_wp)
    end do
    law%edge = edge
    law%share = share/share(cells + 1)
  end subroutine make_law

  !> Share of the mass that passes a sieve by a law without limits [-].
  elemental real(wp) function passing(name, middle, spread, d)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: middle, spread  !! [m]; [m] for normal, else [-]
    real(wp), intent(in) :: d               !! [m]

    select case (name)
    case ('normal')
      passing = 0.5_wp*erfc((middle - d)/(sqrt(2.0_wp)*spread))
    case ('lognormal')
      passing = 0.5_wp*erfc(log(middle/d)/(sqrt(2.0_wp)*spread))
    case default
      passing = 1.0_wp - exp(-(d/middle)**spread)
    end select
  end function passing

  !> The size below which a share of the grains lies, by number [m].
  pure real(wp) function by_law(law, share) result(d)
    type(size_law_type), intent(in) :: law
    real(wp), intent(in) :: share  !! 0 to 1
    integer(i4) :: low, high, middle
    real(wp) :: width

    low = 1
    high = size(law%edge)
    do while (high - low > 1)
      middle = (low + high)/2
      if (law%share(middle) <= share) then
        low = middle
      else
        high = middle
      end if
    end do
    width = law%share(high) - law%share(low)
    d = law%edge(low)
    if (width > 0.0_wp) d = d + (law%edge(high) - d)*(share - law%share(low))/width
  end function by_law
end module dem_size_law
