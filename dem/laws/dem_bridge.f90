!> A capillary bridge between two grains: pull, energy and rupture distance over the separation of
!! the surfaces, by the closed form of Willett et al. (2000) for the radius R = 2 R_e.
!!
!!   F = 2 pi R gamma cos theta/(1 + 1.05 s + 2.5 s^2),  s = D sqrt(R/V),
!!   D_c = (1 + theta/2)(V^(1/3) + V^(2/3)/(10 R)).
!! Where the bodies overlap, D < 0, the pull is that at D = 0.
!! eq. D.33
module dem_bridge
  use talus_kinds, only: wp
  implicit none
  private
  public :: bridge_type, bridge_pull, bridge_energy, bridge_stiffness, rupture_distance
  public :: longest_bridge, most_liquid

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: most_liquid = 3.0e-3_wp  !! V/R^3 up to which bridges are apart
  real(wp), parameter :: linear = 1.05_wp, square = 2.5_wp    !! of the closed form
  real(wp), parameter :: root = sqrt(4.0_wp*square - linear**2)
  real(wp), parameter :: tenth = 0.1_wp           !! of V^(2/3)/R in the rupture distance

  !> Liquid of a bridge.
  type :: bridge_type
    real(wp) :: tension = 0.0_wp  !! gamma [N/m]
    real(wp) :: angle = 0.0_wp    !! of contact, theta
    real(wp) :: volume = 0.0_wp   !! V [m^3]
  end type bridge_type

contains

  !> Pull at D = 0 [N].
  pure real(wp) function first_pull(bridge, radius)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius  !! R [m]
    first_pull = 2.0_wp*pi*radius*bridge%tension*cos(bridge%angle)
  end function first_pull

  !> Pull at a separation [N].
  pure real(wp) function bridge_pull(bridge, radius, distance) result(pull)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius    !! R [m]
    real(wp), intent(in) :: distance  !! D [m]
    real(wp) :: s
    s = max(distance, 0.0_wp)*sqrt(radius/bridge%volume)
    pull = first_pull(bridge, radius)/(1.0_wp + linear*s + square*s**2)
  end function bridge_pull

  !> Work of the pull from touch to a separation; below 0 where the bodies overlap [J].
  pure real(wp) function bridge_energy(bridge, radius, distance) result(energy)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius    !! R [m]
    real(wp), intent(in) :: distance  !! D [m]
    real(wp) :: s
    energy = first_pull(bridge, radius)*distance
    if (distance <= 0.0_wp) return
    s = distance*sqrt(radius/bridge%volume)
    energy = first_pull(bridge, radius)*sqrt(bridge%volume/radius)*2.0_wp/root &
             *(atan((2.0_wp*square*s + linear)/root) - atan(linear/root))
  end function bridge_energy

  !> Largest slope of the pull over the separation [N/m].
  pure real(wp) function bridge_stiffness(bridge, radius) result(stiffness)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius  !! R [m]
    stiffness = linear*first_pull(bridge, radius)*sqrt(radius/bridge%volume)
  end function bridge_stiffness

  !> Separation at which a bridge breaks [m]. A radius below the width of the bridge counts as that:
  !! the form is for slender ones.
  pure real(wp) function rupture_distance(bridge, radius) result(distance)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius  !! R [m]
    real(wp) :: width
    width = bridge%volume**(1.0_wp/3.0_wp)
    distance = (1.0_wp + 0.5_wp*bridge%angle)*(width + tenth*width**2/max(radius, width))
  end function rupture_distance

  !> Bound of the rupture distance for any radius [m].
  pure real(wp) function longest_bridge(bridge) result(distance)
    type(bridge_type), intent(in) :: bridge
    distance = rupture_distance(bridge, bridge%volume**(1.0_wp/3.0_wp))
  end function longest_bridge
end module dem_bridge
