!> Volume, centre and inertia of a union of spheres.
!!
!! Slices across z are unions of discs, whose moments are sums over the arcs of their outline
!! (Green's theorem), each a trigonometric polynomial that Gauss points integrate to rounding.
!! Along z Gauss points lie between the heights where a sphere or the circle of intersection of two
!! begins or ends; a cubic map takes the square roots there. Heights where three spheres meet in a
!! point are no ends: there alone an error of about 1e-6 is left.
!! eq. D.88
module dem_union
  use talus_kinds, only: wp, i4
  use dem_shape_mass, only: diagonalise, quaternion_of
  implicit none
  private
  public :: union_mass_type, mass_of_union, mass_of_sums, principal_frame

  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i4), parameter :: points = 8     !! Gauss points of an arc, or of a part of an interval
  integer(i4), parameter :: parts = 4      !! of an interval
  integer(i4), parameter :: few = 16       !! of more spheres, pairs end no interval
  integer(i4), parameter :: slices = 64    !! further ends then
  real(wp), parameter :: node(points) = [ &
    -0.96028985649753623_wp, -0.79666647741362674_wp, -0.52553240991632899_wp, &
    -0.18343464249564980_wp, 0.18343464249564980_wp, 0.52553240991632899_wp, &
    0.79666647741362674_wp, 0.96028985649753623_wp]
  real(wp), parameter :: weight(points) = [ &
    0.10122853629037626_wp, 0.22238103445337447_wp, 0.31370664587788729_wp, &
    0.36268378337836198_wp, 0.36268378337836198_wp, 0.31370664587788729_wp, &
    0.22238103445337447_wp, 0.10122853629037626_wp]

  !> Of a body of density 1.
  type :: union_mass_type
    real(wp) :: volume = 0.0_wp      !! [m^3]
    real(wp) :: centre(3) = 0.0_wp   !! [m]
    real(wp) :: inertia(6) = 0.0_wp  !! about the centre, xx yy zz xy yz zx, xy = -sum x y [m^5]
  end type union_mass_type

contains

  !> Mass properties of the union of spheres; of one sphere in closed form.
  pure function mass_of_union(centre, radius) result(mass)
    real(wp), intent(in) :: centre(:, :)  !! (3, n) [m]
    real(wp), intent(in) :: radius(:)     !! (n) [m]
    type(union_mass_type) :: mass
    real(wp) :: middle(3), x(3, size(radius))
    integer(i4) :: n

    n = size(radius, kind=i4)
    if (n == 1) then
      mass%volume = 4.0_wp/3.0_wp*pi*radius(1)*radius(1)*radius(1)
      mass%centre = centre(:, 1)
      mass%inertia(:3) = 0.4_wp*mass%volume*radius(1)**2
      return
    end if
    middle = sum(centre, 2)/n
    x = centre - spread(middle, 2, n)
    mass = mass_of_sums(moments(x, radius), middle)
  end function mass_of_union

  !> Mass properties from the integrals of 1, x, y, z, xx, yy, zz, xy, yz, zx about a point.
  pure function mass_of_sums(sums, point) result(mass)
    real(wp), intent(in) :: sums(10), point(3)
    type(union_mass_type) :: mass
    real(wp) :: c(3), second(6)
    c = sums(2:4)/sums(1)
    second = sums(5:) - sums(1)*[c*c, c(1)*c(2), c(2)*c(3), c(3)*c(1)]
    mass%volume = sums(1)
    mass%centre = point + c
    mass%inertia(:3) = sum(second(:3)) - second(:3)
    mass%inertia(4:) = -second(4:)
  end function mass_of_sums

  !> Principal moments of an inertia tensor, and the quaternion from their axes to its frame.
  pure subroutine principal_frame(inertia, moment, quat)
    real(wp), intent(in) :: inertia(6)
    real(wp), intent(out) :: moment(3), quat(4)
    real(wp) :: tensor(3, 3), axes(3, 3)
    integer(i4) :: k
    moment = inertia(:3)
    quat = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    if (.not. any(abs(inertia(4:)) > 1.0e-14_wp*sum(inertia(:3)))) return
    tensor = reshape([inertia(1), inertia(4), inertia(6), inertia(4), inertia(2), inertia(5), &
                      inertia(6), inertia(5), inertia(3)], [3, 3])
    call diagonalise(tensor, axes)
    moment = [(tensor(k, k), k=1, 3)]
    quat = quaternion_of(axes)
  end subroutine principal_frame

  !> Integrals of 1, x, y, z, xx, yy, zz, xy, yz, zx over the union.
  pure function moments(x, radius) result(sums)
    real(wp), intent(in) :: x(:, :), radius(:)
    real(wp) :: sums(10), disc(6), half, z, w, t
    real(wp), allocatable :: ends(:)
    integer(i4) :: k, j, part

    ends = ends_of(x, radius)
    sums = 0.0_wp
    do k = 1, size(ends, kind=i4) - 1
      half = 0.5_wp*(ends(k + 1) - ends(k))
      if (.not. half > 0.0_wp) cycle
      do part = 1, parts
        do j = 1, points
          t = (2.0_wp*part - 1.0_wp + node(j))/parts - 1.0_wp
          z = 0.5_wp*(ends(k) + ends(k + 1)) + 0.5_wp*half*t*(3.0_wp - t*t)
          w = weight(j)/parts*half*1.5_wp*(1.0_wp - t*t)
          disc = slice(x, radius, z)
          sums = sums + w*[disc(1), disc(2), disc(3), z*disc(1), disc(4), disc(5), z*z*disc(1), &
                           disc(6), z*disc(3), z*disc(2)]
        end do
      end do
    end do
  end function moments

  !> Heights between which slices change smoothly, ascending.
  pure function ends_of(x, radius) result(ends)
    real(wp), intent(in) :: x(:, :), radius(:)
    real(wp), allocatable :: ends(:)
    real(wp) :: low, high, r(3), d, along, across
    integer(i4) :: i, j, n

    n = size(radius, kind=i4)
    ends = [x(3, :) - radius, x(3, :) + radius]
    low = minval(ends)
    high = maxval(ends)
    if (n > few) ends = [ends, (low + (high - low)*i/slices, i=1, slices - 1)]
    do i = 1, merge(0_i4, n, n > few)
      do j = i + 1, n
        r = x(:, j) - x(:, i)
        d = norm2(r)
        if (.not. (d > abs(radius(i) - radius(j)) .and. d < radius(i) + radius(j))) cycle
        along = 0.5_wp*(d + (radius(i) - radius(j))*(radius(i) + radius(j))/d)
        across = sqrt(max(radius(i)**2 - along**2, 0.0_wp))*norm2(r(1:2))/d
        ends = [ends, x(3, i) + along*r(3)/d - across, x(3, i) + along*r(3)/d + across]
      end do
    end do
    call sort(ends)
  end function ends_of

  pure subroutine sort(list)
    real(wp), intent(inout) :: list(:)
    real(wp) :: item
    integer(i4) :: i, k
    do i = 2, size(list, kind=i4)
      item = list(i)
      k = i - 1
      do while (k >= 1)
        if (list(k) <= item) exit
        list(k + 1) = list(k)
        k = k - 1
      end do
      list(k + 1) = item
    end do
  end subroutine sort

  !> Integrals of 1, x, y, xx, yy, xy over the union of discs at a height.
  pure function slice(x, radius, z) result(disc)
    real(wp), intent(in) :: x(:, :), radius(:), z
    real(wp) :: disc(6)
    real(wp) :: rho(size(radius)), cover(2, 2*size(radius) + 1), at
    integer(i4) :: i, k, covers
    logical :: hidden

    rho = sqrt(max(radius**2 - (z - x(3, :))**2, 0.0_wp))
    disc = 0.0_wp
    do i = 1, size(radius, kind=i4)
      if (.not. rho(i) > 0.0_wp) cycle
      call find_cover(x, rho, i, cover, covers, hidden)
      if (hidden) cycle
      at = 0.0_wp
      do k = 1, covers
        if (cover(1, k) > at) call add_arc(x(:2, i), rho(i), at, cover(1, k), disc)
        at = max(at, cover(2, k))
      end do
      if (at < 2.0_wp*pi) call add_arc(x(:2, i), rho(i), at, 2.0_wp*pi, disc)
    end do
  end function slice

  !> Arcs of the outline of disc i that lie in other discs, by ascending begin, from 0 to 2 pi; of
  !! equal discs the first one shows.
  pure subroutine find_cover(x, rho, i, cover, covers, hidden)
    real(wp), intent(in) :: x(:, :), rho(:)
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: cover(:, :)
    integer(i4), intent(out) :: covers
    logical, intent(out) :: hidden
    real(wp) :: r(2), d, middle, half
    integer(i4) :: j

    covers = 0
    hidden = .false.
    do j = 1, size(rho, kind=i4)
      if (j == i .or. .not. rho(j) > 0.0_wp) cycle
      r = x(:2, j) - x(:2, i)
      d = norm2(r)
      hidden = d + rho(i) <= rho(j) .and. (rho(i) < rho(j) .or. j < i)
      if (hidden) return
      if (d >= rho(i) + rho(j) .or. d + rho(j) <= rho(i) .or. d + rho(i) <= rho(j)) cycle
      half = acos(max(-1.0_wp, min(1.0_wp, (d*d + rho(i)**2 - rho(j)**2)/(2.0_wp*d*rho(i)))))
      middle = modulo(atan2(r(2), r(1)), 2.0_wp*pi)
      if (middle - half < 0.0_wp) then
        call put(cover, covers, [middle - half + 2.0_wp*pi, 2.0_wp*pi])
        call put(cover, covers, [0.0_wp, middle + half])
      else if (middle + half > 2.0_wp*pi) then
        call put(cover, covers, [middle - half, 2.0_wp*pi])
        call put(cover, covers, [0.0_wp, middle + half - 2.0_wp*pi])
      else
        call put(cover, covers, [middle - half, middle + half])
      end if
    end do
  end subroutine find_cover

  !> One more arc, in the order of their begins.
  pure subroutine put(cover, covers, arc)
    real(wp), intent(inout) :: cover(:, :)
    integer(i4), intent(inout) :: covers
    real(wp), intent(in) :: arc(2)
    integer(i4) :: k
    k = covers
    do while (k >= 1)
      if (cover(1, k) <= arc(1)) exit
      cover(:, k + 1) = cover(:, k)
      k = k - 1
    end do
    cover(:, k + 1) = arc
    covers = covers + 1
  end subroutine put

  !> What an arc of an outline adds, its pieces no longer than a quarter of a circle.
  pure subroutine add_arc(centre, rho, from, to, disc)
    real(wp), intent(in) :: centre(2), rho, from, to
    real(wp), intent(inout) :: disc(6)
    real(wp) :: length, angle, x, y, dx, dy
    integer(i4) :: pieces, k, j

    pieces = 1 + int((to - from)/(0.5_wp*pi), i4)
    length = (to - from)/pieces
    do k = 0, pieces - 1
      do j = 1, points
        angle = from + length*(k + 0.5_wp*(1.0_wp + node(j)))
        x = centre(1) + rho*cos(angle)
        y = centre(2) + rho*sin(angle)
        dy = 0.5_wp*length*weight(j)*(x - centre(1))
        dx = -0.5_wp*length*weight(j)*(y - centre(2))
        disc = disc + [0.5_wp*(x*dy - y*dx), 0.5_wp*x*x*dy, -0.5_wp*y*y*dx, x**3*dy/3.0_wp, &
                       -y**3*dx/3.0_wp, 0.5_wp*x*x*y*dy]
      end do
    end do
  end subroutine add_arc
end module dem_union
