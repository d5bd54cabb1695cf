!> Contact laws of material pairs: constants from elastic moduli, damping from restitution.
module dem_law
  use talus_kinds, only: wp, i4
  use dem_law_state, only: dem_law_type, dem_material_type
  use dem_law_registry, only: find_law, bind_law
  implicit none
  private
  public :: make_law, make_linear_law, restitution_of, uncut_restitution_of, damping_ratio_for
  public :: mirrored_law

  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Law between two materials; constants of its own are added by its file.
  pure function make_law(name, first, second, friction, damping_ratio, tangential_ratio) result(law)
    character(len=*), intent(in) :: name      !! in the registry
    type(dem_material_type), intent(in) :: first, second
    real(wp), intent(in) :: friction          !! Coulomb coefficient [-]
    real(wp), intent(in) :: damping_ratio     !! normal ratio xi [-]
    real(wp), intent(in) :: tangential_ratio  !! tangential ratio, usually xi too [-]
    type(dem_law_type) :: law
    real(wp) :: c1, c2, shear1, shear2

    law%kind = find_law(name)
    call bind_law(law)
    law%friction = friction
    law%damping_ratio = damping_ratio
    law%tangential_ratio = tangential_ratio
    c1 = (1.0_wp - first%poisson**2)/first%young
    c2 = (1.0_wp - second%poisson**2)/second%young
    shear1 = first%young/(2.0_wp*(1.0_wp + first%poisson))
    shear2 = second%young/(2.0_wp*(1.0_wp + second%poisson))
    law%e_star = 1.0_wp/(c1 + c2)
    law%g_star = 1.0_wp/((2.0_wp - first%poisson)/shear1 + (2.0_wp - second%poisson)/shear2)
    law%share = c1/(c1 + c2)
  end function make_law

  !> Spring and dashpot of given stiffness.
  pure function make_linear_law(kn, kt, friction, damping_ratio, tangential_ratio) result(law)
    real(wp), intent(in) :: kn, kt            !! stiffness [N/m]
    real(wp), intent(in) :: friction          !! Coulomb coefficient [-]
    real(wp), intent(in) :: damping_ratio     !! of critical [-]
    real(wp), intent(in) :: tangential_ratio  !! of critical [-]
    type(dem_law_type) :: law
    law%kind = find_law('linear')
    call bind_law(law)
    law%kn = kn
    law%kt = kt
    law%friction = friction
    law%damping_ratio = damping_ratio
    law%tangential_ratio = tangential_ratio
  end function make_linear_law

  !> The same law with first and second material exchanged.
  pure function mirrored_law(law) result(other)
    type(dem_law_type), intent(in) :: law
    type(dem_law_type) :: other
    other = law
    other%share = 1.0_wp - law%share
  end function mirrored_law

  !> Restitution of the law in force, where the contact ends when the force is back at zero:
  !! e = exp(-b (pi - 2 asin b)/sqrt(1 - b^2)), free of speed (the Hertz impact is a linear
  !! oscillator in delta^(5/4)).
  pure real(wp) function restitution_of(oscillator, damping_ratio) result(e)
    real(wp), intent(in) :: oscillator  !! see base_law_type [-]
    real(wp), intent(in) :: damping_ratio
    real(wp) :: b, s
    b = damping_ratio*oscillator
    if (b < 1.0_wp) then
      s = sqrt(1.0_wp - b*b)
      e = exp(-b*(pi - 2.0_wp*asin(b))/s)
    else if (b > 1.0_wp) then
      s = sqrt(b*b - 1.0_wp)
      e = exp(-b*2.0_wp*log(b + s)/s)
    else
      e = exp(-2.0_wp)
    end if
  end function restitution_of

  !> Restitution if the contact could pull until the overlap is gone: exp(-pi b/sqrt(1 - b^2)).
  pure real(wp) function uncut_restitution_of(oscillator, damping_ratio) result(e)
    real(wp), intent(in) :: oscillator  !! see base_law_type [-]
    real(wp), intent(in) :: damping_ratio
    real(wp) :: b
    b = damping_ratio*oscillator
    e = 0.0_wp
    if (b < 1.0_wp) e = exp(-pi*b/sqrt(1.0_wp - b*b))
  end function uncut_restitution_of

  !> Damping ratio that gives restitution e (0 < e <= 1) with the law in force, by bisection.
  pure real(wp) function damping_ratio_for(oscillator, e) result(ratio)
    real(wp), intent(in) :: oscillator  !! see base_law_type [-]
    real(wp), intent(in) :: e
    real(wp) :: low, high
    integer(i4) :: k
    low = 0.0_wp
    high = 1.0_wp
    do while (restitution_of(oscillator, high) > e .and. high < 1.0e6_wp)
      high = 2.0_wp*high
    end do
    do k = 1, 200
      ratio = 0.5_wp*(low + high)
      if (restitution_of(oscillator, ratio) > e) then
        low = ratio
      else
        high = ratio
      end if
    end do
  end function damping_ratio_for
end module dem_law
