!> Fragments of a grain: families of bodies that lie inside it and do not overlap (theory-dem,
!! Breakage of grains).
!!
!! In the norm |x|_p whose unit ball is the grain, balls |x - c| <= r are inside if |c| + r <= 1 and
!! apart if centres are r1 + r2 apart; the map x -> (a+- x, b+- y, c+- z) carries them to every
!! shape and keeps both. What a family leaves out is fines.
!! eq. D.28
module dem_fragments
  use talus_kinds, only: wp, i4
  use dem_ellipsoid, only: rotation_of
  implicit none
  private
  public :: fragment_type, make_fragments, family_names, family_radii, family_count, split_axis, &
    slenderness_of_halves
  public :: area_of, created_area
  public :: family_fourteen, family_halves, family_none

  integer(i4), parameter :: family_fourteen = 1, family_halves = 2, family_none = 3
  character(len=8), parameter :: family_names(3) = [character(len=8) :: 'fourteen', 'halves', &
    'none']
  integer(i4), parameter :: family_count(3) = [14, 2, 0]  !! fragments of each

  real(wp), parameter :: cut = 0.25_wp          !! of a half beyond its plane, of the semi-axis [-]
  real(wp), parameter :: close = 1.0e-9_wp      !! sizes are taken smaller by this
  real(wp), parameter :: close_flat = 2.0e-4_wp !! and by this where flat spots are rounded
  integer(i4), parameter :: points = 24         !! of a quadrature over an octant, each way

  !> A fragment in the frame of the octants of its grain.
  type :: fragment_type
    real(wp) :: origin(3) = 0.0_wp  !! of its octants from those of the grain [m]
    real(wp) :: upper(3) = 0.0_wp   !! semi-axes on the positive sides [m]
    real(wp) :: lower(3) = 0.0_wp   !! semi-axes on the negative sides [m]
  end type fragment_type

contains

  !> All fragments of a grain; of spheres and ellipsoids `fourteen` is turned in the unit ball.
  pure subroutine make_fragments(family, upper, lower, exponent, turn, axis, fragment)
    integer(i4), intent(in) :: family           !! family_...
    real(wp), intent(in) :: upper(3), lower(3)  !! semi-axes of the grain [m]
    real(wp), intent(in) :: exponent            !! p [-]
    real(wp), intent(in) :: turn(4)             !! of an ellipsoid, else [1, 0, 0, 0]
    integer(i4), intent(in) :: axis             !! that is cut in halves
    type(fragment_type), allocatable, intent(out) :: fragment(:)
    real(wp) :: smaller
    integer(i4) :: k

    allocate (fragment(family_count(family)))
    select case (family)
    case (family_fourteen)
      call put_fourteen(upper, lower, exponent, turn, fragment)
    case (family_halves)
      call put_halves(upper, lower, exponent, axis, fragment)
    end select
    smaller = 1.0_wp - merge(close_flat, close, exponent > 2.0_wp)
    do k = 1, size(fragment)
      fragment(k)%upper = smaller*fragment(k)%upper
      fragment(k)%lower = smaller*fragment(k)%lower
    end do
  end subroutine make_fragments

  !> Six along the axes, eight in the octants.
  pure subroutine put_fourteen(upper, lower, exponent, turn, fragment)
    real(wp), intent(in) :: upper(3), lower(3), exponent, turn(4)
    type(fragment_type), intent(inout) :: fragment(:)
    real(wp) :: size(2), place, c(3), r(3, 3), side(3)
    integer(i4) :: k, axis

    call family_radii(exponent, size, place)
    r = rotation_of(turn)
    do k = 1, 6
      axis = (k + 1)/2
      c = 0.0_wp
      c(axis) = (1.0_wp - size(1))*(1 - 2*modulo(k - 1, 2))
      call put_ball(matmul(r, c), size(1), upper, lower, fragment(k))
      side = merge(upper, lower, c > 0.0_wp)
      fragment(k)%upper(axis) = size(1)*side(axis)
      fragment(k)%lower(axis) = size(1)*side(axis)
    end do
    do k = 0, 7
      c = place*merge(-1.0_wp, 1.0_wp, [btest(k, 2), btest(k, 1), btest(k, 0)])
      call put_ball(matmul(r, c), size(2), upper, lower, fragment(k + 7))
      side = merge(upper, lower, c > 0.0_wp)
      fragment(k + 7)%upper = size(2)*side
      fragment(k + 7)%lower = size(2)*side
    end do
  end subroutine put_fourteen

  !> A ball of the unit ball, in a grain whose sides are both as this one.
  pure subroutine put_ball(centre, radius, upper, lower, fragment)
    real(wp), intent(in) :: centre(3), radius, upper(3), lower(3)
    type(fragment_type), intent(inout) :: fragment
    fragment%origin = centre*merge(upper, lower, centre > 0.0_wp)
    fragment%upper = radius*upper
    fragment%lower = radius*lower
  end subroutine put_ball

  !> Two whose octants meet a quarter of a semi-axis beyond the plane that cuts the grain.
  pure subroutine put_halves(upper, lower, exponent, axis, fragment)
    real(wp), intent(in) :: upper(3), lower(3), exponent
    integer(i4), intent(in) :: axis
    type(fragment_type), intent(inout) :: fragment(:)
    integer(i4) :: k
    do k = 1, 2
      fragment(k)%upper = upper*(1.0_wp - cut)**(1.0_wp/exponent)
      fragment(k)%lower = lower*(1.0_wp - cut)**(1.0_wp/exponent)
    end do
    fragment(1)%origin(axis) = cut*upper(axis)
    fragment(1)%upper(axis) = (1.0_wp - cut)*upper(axis)
    fragment(1)%lower(axis) = cut*upper(axis)
    fragment(2)%origin(axis) = -cut*lower(axis)
    fragment(2)%upper(axis) = cut*lower(axis)
    fragment(2)%lower(axis) = (1.0_wp - cut)*lower(axis)
  end subroutine put_halves

  !> Radii of `fourteen` in the unit ball of an exponent, and how far the eight are along each axis:
  !! where each touches three of the six and the surface.
  pure subroutine family_radii(exponent, size, place)
    real(wp), intent(in) :: exponent       !! p [-]
    real(wp), intent(out) :: size(2)       !! of the six, of the eight [-]
    real(wp), intent(out) :: place         !! [-]
    real(wp), parameter :: from = 0.3_wp   !! the two overlap for all p there
    real(wp) :: low, high, root2, root3
    integer(i4) :: k

    root2 = 2.0_wp**(1.0_wp/exponent)
    root3 = 3.0_wp**(1.0_wp/exponent)
    size(1) = root2/(2.0_wp + root2)
    low = from
    high = 1.0_wp - size(1)
    do k = 1, digits(low) + 4
      place = 0.5_wp*(low + high)
      size(2) = 1.0_wp - root3*place
      if (((1.0_wp - size(1) - place)**exponent + 2.0_wp*place**exponent)**(1.0_wp/exponent) &
          > size(1) + size(2)) then
        high = place
      else
        low = place
      end if
    end do
    place = high
    size(2) = 1.0_wp - root3*place
  end subroutine family_radii

  !> Axis whose principal plane holds a load best: the longest across it of those whose halves are
  !! not too slender; the longest of all where none is.
  !! eq. D.74
  pure integer(i4) function split_axis(upper, lower, load, exponent, most_slender)
    real(wp), intent(in) :: upper(3), lower(3)  !! [m]
    real(wp), intent(in) :: load(3)             !! unit vector in the frame of the octants
    real(wp), intent(in) :: exponent            !! p [-]
    real(wp), intent(in) :: most_slender        !! greatest over least semi-axis of a half [-]
    logical :: fits(3)
    integer(i4) :: k
    fits = [(slenderness_of_halves(upper, lower, exponent, k) <= most_slender, k=1, 3)]
    split_axis = maxloc((upper + lower)*sqrt(max(1.0_wp - load**2, 0.0_wp)), 1, mask=fits)
    if (split_axis == 0) split_axis = maxloc(upper + lower, 1)
  end function split_axis

  !> Greatest over least semi-axis of the halves of a grain that is cut across an axis, the more
  !! slender one's.
  pure real(wp) function slenderness_of_halves(upper, lower, exponent, axis) result(ratio)
    real(wp), intent(in) :: upper(3), lower(3)  !! [m]
    real(wp), intent(in) :: exponent            !! p [-]
    integer(i4), intent(in) :: axis             !! that is cut
    type(fragment_type) :: half(2)
    integer(i4) :: k
    call put_halves(upper, lower, exponent, axis, half)
    ratio = maxval([(max(maxval(half(k)%upper), maxval(half(k)%lower)) &
                     /min(minval(half(k)%upper), minval(half(k)%lower)), k=1, 2)])
  end function slenderness_of_halves

  !> Surface that appears when a grain of this surface breaks [m^2].
  pure real(wp) function created_area(family, upper, lower, exponent, axis) result(created)
    integer(i4), intent(in) :: family, axis
    real(wp), intent(in) :: upper(3), lower(3), exponent
    type(fragment_type), allocatable :: fragment(:)
    real(wp) :: whole, size(2), place
    integer(i4) :: k

    whole = area_of(upper, lower, exponent)
    select case (family)
    case (family_fourteen)  ! octants of fragments are octants of the grain, made smaller
      call family_radii(exponent, size, place)
      size = size*(1.0_wp - merge(close_flat, close, exponent > 2.0_wp))
      created = (6.0_wp*size(1)**2 + 8.0_wp*size(2)**2 - 1.0_wp)*whole
    case (family_halves)
      call make_fragments(family, upper, lower, exponent, [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], axis, &
                          fragment)
      created = -whole
      do k = 1, family_count(family)
        created = created + area_of(fragment(k)%upper, fragment(k)%lower, exponent)
      end do
    case default
      created = -whole
    end select
  end function created_area

  !> Surface of a form [m^2].
  pure real(wp) function area_of(upper, lower, exponent) result(area)
    real(wp), intent(in) :: upper(3), lower(3)  !! semi-axes [m]
    real(wp), intent(in) :: exponent            !! p [-]
    real(wp) :: a(3)
    real(wp), parameter :: pi = acos(-1.0_wp)
    integer(i4) :: octant
    logical :: even

    even = all(abs(upper - lower) <= 0.0_wp)
    if (even .and. .not. exponent > 2.0_wp .and. maxval(upper) <= minval(upper)) then
      area = 4.0_wp*pi*upper(1)**2
      return
    end if
    area = 0.0_wp
    do octant = 0, merge(0, 7, even)
      a = merge(upper, lower, [btest(octant, 0), btest(octant, 1), btest(octant, 2)])
      area = area + octant_area(a, exponent)
    end do
    if (even) area = 8.0_wp*area
  end function area_of

  !> Of an octant, by Gauss' rule over the direction n: with y = n/|n|_p on the unit ball and its
  !! gradient g, dA = abc |g/a| |y|^2 dn/(n.g) [m^2].
  pure real(wp) function octant_area(a, exponent) result(area)
    real(wp), intent(in) :: a(3), exponent
    real(wp) :: node(points), weight(points), n(3), g(3), r, angle
    real(wp), parameter :: quarter = 0.5_wp*acos(-1.0_wp)
    integer(i4) :: i, k

    call gauss_rule(node, weight)
    area = 0.0_wp
    do i = 1, points
      do k = 1, points
        angle = quarter*node(k)
        n = [sqrt(1.0_wp - node(i)**2)*cos(angle), sqrt(1.0_wp - node(i)**2)*sin(angle), node(i)]
        g = n**(exponent - 1.0_wp)
        r = 1.0_wp/sum(n*g)**(1.0_wp/exponent)
        area = area + quarter*weight(i)*weight(k)*norm2(g/a)*r**2/sum(n*g)
      end do
    end do
    area = product(a)*area
  end function octant_area

  !> Nodes and weights of Gauss and Legendre from 0 to 1.
  pure subroutine gauss_rule(node, weight)
    real(wp), intent(out) :: node(points), weight(points)
    real(wp), parameter :: pi = acos(-1.0_wp)
    real(wp) :: x, p(3), slope
    integer(i4) :: i, k, turn

    do i = 1, points
      x = cos(pi*(i - 0.25_wp)/(points + 0.5_wp))
      do turn = 1, 8
        p(1:2) = [1.0_wp, x]
        do k = 2, points
          p(3) = ((2*k - 1)*x*p(2) - (k - 1)*p(1))/k
          p(1:2) = p(2:3)
        end do
        slope = points*(x*p(2) - p(1))/(x*x - 1.0_wp)
        x = x - p(2)/slope
      end do
      node(i) = 0.5_wp*(1.0_wp - x)
      weight(i) = 1.0_wp/((1.0_wp - x*x)*slope**2)
    end do
  end subroutine gauss_rule
end module dem_fragments
