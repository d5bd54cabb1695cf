!> A capillary bridge between two grains: pull, energy and rupture distance over the separation D of
!! the surfaces, for the radius R = 2 R_e, in one of two forms.
!!
!! Closed, by Willett et al. (2000):
!!   F = 2 pi R gamma cos theta/(1 + 1.05 s + 2.5 s^2),  s = D sqrt(R/V),
!!   D_c = (1 + theta/2)(V^(1/3) + V^(2/3)/(10 R)).
!! Table: exact profiles (dem_bridge_table). Between nodes F is a cubic of D with the slopes of
!! parabolas, between angles and volumes a cubic of theta and log V/R^3; the energy is its integral.
!! Where the bodies overlap, D < 0, the pull is that at D = 0.
!! eq. D.33
module dem_bridge
  use talus_kinds, only: wp, i4
  use dem_bridge_table, only: angles, angle_step, volumes, first_volume, volume_step, nodes, &
    fraction, longest_at => longest, pull_at => pull
  implicit none
  private
  public :: bridge_type, bridge_pull, bridge_energy, bridge_stiffness, rupture_distance
  public :: longest_bridge, most_liquid

  real(wp), parameter :: pi = acos(-1.0_wp), degree = pi/180.0_wp
  real(wp), parameter :: most_liquid = 3.0e-3_wp  !! V/R^3 up to which bridges are apart
  real(wp), parameter :: linear = 1.05_wp, square = 2.5_wp    !! of the closed form
  real(wp), parameter :: root = sqrt(4.0_wp*square - linear**2)
  real(wp), parameter :: steepest = 1.23_wp       !! slope of the closed form over s, at s = 0.13
  real(wp), parameter :: margin = 1.05_wp         !! of slopes between nodes of the table
  real(wp), parameter :: tenth = 0.1_wp           !! of V^(2/3)/R in the rupture distance

  !> Liquid of a bridge.
  type :: bridge_type
    real(wp) :: tension = 0.0_wp  !! gamma [N/m]
    real(wp) :: angle = 0.0_wp    !! of contact, theta
    real(wp) :: volume = 0.0_wp   !! V [m^3]
    logical :: tabled = .false.   !! by the table, else by the closed form
  end type bridge_type

  !> A column of the table for one bridge.
  type :: curve_type
    real(wp) :: most = 0.0_wp       !! largest separation [m]
    real(wp) :: scale = 0.0_wp      !! 2 pi R gamma [N]
    real(wp) :: pull(0:nodes)       !! over that
  end type curve_type

contains

  !> Pull at D = 0 of the closed form [N].
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
    if (bridge%tabled) then
      pull = pull_of(curve_of(bridge, radius), distance)
    else
      s = max(distance, 0.0_wp)*sqrt(radius/bridge%volume)
      pull = first_pull(bridge, radius)/(1.0_wp + linear*s + square*s**2)
    end if
  end function bridge_pull

  !> Work of the pull from touch to a separation; below 0 where the bodies overlap [J].
  pure real(wp) function bridge_energy(bridge, radius, distance) result(energy)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius    !! R [m]
    real(wp), intent(in) :: distance  !! D [m]
    real(wp) :: s
    if (bridge%tabled) then
      energy = energy_of(curve_of(bridge, radius), distance)
      return
    end if
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
    type(curve_type) :: curve
    integer(i4) :: k
    stiffness = steepest*first_pull(bridge, radius)*sqrt(radius/bridge%volume)
    if (.not. bridge%tabled) return
    curve = curve_of(bridge, radius)
    ! between nodes a little more; at the last one the slope has no bound, and the pull is small
    stiffness = margin*maxval([(abs(slope_at(curve, k)), k=0, nodes - 1)])*curve%scale/curve%most
  end function bridge_stiffness

  !> Separation at which a bridge breaks [m]. A radius below the width of the bridge counts as that:
  !! the forms are for slender ones.
  pure real(wp) function rupture_distance(bridge, radius) result(distance)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius  !! R [m]
    type(curve_type) :: curve
    real(wp) :: width
    if (bridge%tabled) then
      curve = curve_of(bridge, radius)
      distance = curve%most
    else
      width = bridge%volume**(1.0_wp/3.0_wp)
      distance = (1.0_wp + 0.5_wp*bridge%angle)*(width + tenth*width**2/max(radius, width))
    end if
  end function rupture_distance

  !> Bound of the rupture distance for any radius [m].
  pure real(wp) function longest_bridge(bridge) result(distance)
    type(bridge_type), intent(in) :: bridge
    distance = rupture_distance(bridge, bridge%volume**(1.0_wp/3.0_wp))
  end function longest_bridge

  !> The table at an angle and a volume over R^3; beyond its ends those.
  pure function curve_of(bridge, radius) result(curve)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius
    type(curve_type) :: curve
    real(wp) :: of_angle(4), of_volume(4), weight
    integer(i4) :: a, v, i, j
    call neighbours(bridge%angle/degree/angle_step, angles, a, of_angle)
    call neighbours((log10(bridge%volume/radius**3) - first_volume)/volume_step, volumes, v, &
                    of_volume)
    curve%scale = 2.0_wp*pi*radius*bridge%tension
    curve%pull = 0.0_wp
    do j = 1, 4
      do i = 1, 4
        weight = of_angle(j)*of_volume(i)
        curve%most = curve%most + weight*longest_at(v + i, a + j)
        curve%pull = curve%pull + weight*pull_at(:, v + i, a + j)
      end do
    end do
    curve%most = curve%most*bridge%volume**(1.0_wp/3.0_wp)
  end function curve_of

  !> Weights of Lagrange's cubic of four of n nodes about x, which counts steps from the first; they
  !! are those behind `before`.
  pure subroutine neighbours(x, n, before, weight)
    real(wp), intent(in) :: x
    integer(i4), intent(in) :: n
    integer(i4), intent(out) :: before
    real(wp), intent(out) :: weight(4)
    real(wp) :: t
    t = min(max(x, 0.0_wp), real(n - 1, wp))
    before = min(max(int(t, i4) - 1, 0), n - 4)
    t = t - before
    weight = [-(t - 1.0_wp)*(t - 2.0_wp)*(t - 3.0_wp)/6.0_wp, t*(t - 2.0_wp)*(t - 3.0_wp)/2.0_wp, &
              -t*(t - 1.0_wp)*(t - 3.0_wp)/2.0_wp, t*(t - 1.0_wp)*(t - 2.0_wp)/6.0_wp]
  end subroutine neighbours

  !> Slope over the fraction at node k, of the parabola through its neighbours.
  pure real(wp) function slope_at(curve, k) result(slope)
    type(curve_type), intent(in) :: curve
    integer(i4), intent(in) :: k
    real(wp) :: left, right, before, after
    integer(i4) :: m
    m = min(max(k, 1), nodes - 1)  ! the middle of the parabola
    before = fraction(m) - fraction(m - 1)
    after = fraction(m + 1) - fraction(m)
    left = (curve%pull(m) - curve%pull(m - 1))/before
    right = (curve%pull(m + 1) - curve%pull(m))/after
    slope = (after*left + before*right)/(before + after)
    if (k < m) slope = 2.0_wp*left - slope
    if (k > m) slope = 2.0_wp*right - slope
  end function slope_at

  !> Interval of a fraction of the largest separation, 0 the first.
  pure integer(i4) function interval_of(t) result(k)
    real(wp), intent(in) :: t
    k = min(int(count(fraction(1:) <= t), i4), nodes - 1)
  end function interval_of

  pure real(wp) function pull_of(curve, distance) result(pull)
    type(curve_type), intent(in) :: curve
    real(wp), intent(in) :: distance
    real(wp) :: t, h, x
    integer(i4) :: k
    t = min(max(distance/curve%most, 0.0_wp), 1.0_wp)
    k = interval_of(t)
    h = fraction(k + 1) - fraction(k)
    x = (t - fraction(k))/h
    pull = curve%scale*(curve%pull(k)*(1.0_wp + 2.0_wp*x)*(1.0_wp - x)**2 &
      + curve%pull(k + 1)*x**2*(3.0_wp - 2.0_wp*x) &
      + h*slope_at(curve, k)*x*(1.0_wp - x)**2 - h*slope_at(curve, k + 1)*x**2*(1.0_wp - x))
  end function pull_of

  pure real(wp) function energy_of(curve, distance) result(energy)
    type(curve_type), intent(in) :: curve
    real(wp), intent(in) :: distance
    real(wp) :: t
    integer(i4) :: k, last
    energy = curve%scale*curve%pull(0)*distance
    if (distance <= 0.0_wp) return
    t = min(distance/curve%most, 1.0_wp)
    last = interval_of(t)
    energy = part_of(curve, last, (t - fraction(last))/(fraction(last + 1) - fraction(last)))
    do k = 0, last - 1
      energy = energy + part_of(curve, k, 1.0_wp)
    end do
    energy = curve%scale*curve%most*energy
  end function energy_of

  !> Integral of the cubic of interval k from its start to a share x of it.
  pure real(wp) function part_of(curve, k, x) result(part)
    type(curve_type), intent(in) :: curve
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: x
    real(wp) :: h
    h = fraction(k + 1) - fraction(k)
    part = h*(curve%pull(k)*(x - x**3 + 0.5_wp*x**4) + curve%pull(k + 1)*(x**3 - 0.5_wp*x**4) &
      + h*slope_at(curve, k)*(0.5_wp*x**2 - 2.0_wp/3.0_wp*x**3 + 0.25_wp*x**4) &
      - h*slope_at(curve, k + 1)*(x**3/3.0_wp - 0.25_wp*x**4))
  end function part_of
end module dem_bridge
