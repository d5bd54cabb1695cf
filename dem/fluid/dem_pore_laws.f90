!> Laws of the drag of a liquid that flows through grains: beta, of which the mobility is n^2/beta
!! and the pressure gradient of a bed beta U/n^2 at the superficial velocity U. eq. D.41
module dem_pore_laws
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: drag_of, law_index, law_constant, law_kozeny_carman, pore_law_names

  integer(i4), parameter :: law_constant = 1, law_kozeny_carman = 2, law_ergun = 3, &
    law_beetstra = 4, law_koch_hill = 5, law_di_felice = 6
  character(len=14), parameter :: pore_law_names(6) = [character(len=14) :: 'constant', &
    'kozeny_carman', 'ergun', 'beetstra', 'koch_hill', 'di_felice']
  real(wp), parameter :: slowest = 1.0e-6_wp  !! Reynolds number below which a law does not change

contains

  pure integer(i4) function law_index(name)
    character(len=*), intent(in) :: name
    law_index = findloc(pore_law_names == name, .true., 1)
  end function law_index

  !> Drag on the grains of a unit of volume over the velocity of the liquid against them
  !! [Pa s/m^2]; not of the constant law, which has no diameter.
  pure real(wp) function drag_of(law, n, d, viscosity, reynolds) result(beta)
    integer(i4), intent(in) :: law
    real(wp), intent(in) :: n          !! porosity [-]
    real(wp), intent(in) :: d          !! diameter of Sauter [m]
    real(wp), intent(in) :: viscosity  !! [Pa s]
    real(wp), intent(in) :: reynolds   !! density U d/viscosity [-]
    real(wp) :: solid, re, stokes

    solid = 1.0_wp - n
    re = max(reynolds, slowest)
    stokes = 18.0_wp*viscosity*n*solid/d**2
    select case (law)
    case (law_kozeny_carman)
      beta = stokes*10.0_wp*solid/n**2
    case (law_ergun)
      beta = stokes*(150.0_wp*solid/n**2 + 1.75_wp*reynolds/n**2)/18.0_wp
    case (law_beetstra)
      beta = stokes*beetstra(n, solid, re)
    case (law_koch_hill)
      beta = stokes*n*koch_hill(n, solid, re)
    case (law_di_felice)
      beta = stokes*di_felice(n, re)
    case default
      error stop 'bug: no such law of drag'
    end select
  end function drag_of

  !> Beetstra, van der Hoef & Kuipers (2007), without the part of buoyancy.
  pure real(wp) function beetstra(n, solid, re) result(f)
    real(wp), intent(in) :: n, solid, re
    f = 10.0_wp*solid/n**2 + n**2*(1.0_wp + 1.5_wp*sqrt(solid)) &
        + 0.413_wp*re/(24.0_wp*n**2)*(1.0_wp/n + 3.0_wp*n*solid + 8.4_wp*re**(-0.343_wp)) &
        /(1.0_wp + 10.0_wp**(3.0_wp*solid)*re**(-0.5_wp - 2.0_wp*solid))
  end function beetstra

  !> Koch & Hill (2001); the inertial part is with the radius, hence the half.
  pure real(wp) function koch_hill(n, solid, re) result(f)
    real(wp), intent(in) :: n, solid, re
    real(wp) :: slow
    if (solid >= 0.4_wp) then
      slow = 10.0_wp*solid/n**3
    else
      slow = (1.0_wp + 3.0_wp*sqrt(0.5_wp*solid) + 135.0_wp/64.0_wp*solid*log(solid) &
              + 16.14_wp*solid)/(1.0_wp + 0.681_wp*solid - 8.48_wp*solid**2 + 8.16_wp*solid**3)
    end if
    f = slow + 0.5_wp*(0.0673_wp + 0.212_wp*solid + 0.0232_wp/n**5)*re
  end function koch_hill

  !> Di Felice (1994): the force C_D rho pi d^2/8 U^2 n^-chi on a grain is drag without that of the
  !! pressure gradient. Taken as both, gradients of dense beds would be a third of Ergun's.
  pure real(wp) function di_felice(n, re) result(f)
    real(wp), intent(in) :: n, re
    real(wp) :: coefficient, chi
    coefficient = (0.63_wp + 4.8_wp/sqrt(re))**2
    chi = 3.7_wp - 0.65_wp*exp(-0.5_wp*(1.5_wp - log10(re))**2)
    f = coefficient*re/24.0_wp*n**(-chi)
  end function di_felice
end module dem_pore_laws
