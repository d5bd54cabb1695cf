!> Regions in which grains are measured: a box, a cylinder, a sphere, the box around all free
!! grains, or a whole periodic cell.
!!
!! A branch that crosses the faces counts with the part of its length inside (exact); the volume of
!! a grain that crosses them is found on points, all others count whole or not at all.
module talus_region
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: region_type, region_all, region_box, region_cylinder, region_cell, region_sphere, &
    ball_points

  integer(i4), parameter :: region_all = 1, region_box = 2, region_cylinder = 3, &
    region_cell = 4, region_sphere = 5
  real(wp), parameter :: pi = acos(-1.0_wp)

  type :: region_type
    integer(i4) :: kind = region_all
    real(wp) :: lower(3) = 0.0_wp, upper(3) = 0.0_wp  !! of a box [m]
    real(wp) :: base(3) = 0.0_wp                      !! centre of a cylinder's lower face, or of a
                                                      !! sphere [m]
    real(wp) :: axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]    !! unit vector along the cylinder
    real(wp) :: radius = 0.0_wp, length = 0.0_wp      !! of a cylinder, radius of a sphere [m]
    real(wp) :: cell_volume = 0.0_wp                  !! of a cell, which holds everything [m^3]
  contains
    procedure :: fit
    procedure :: volume
    procedure :: centre
    procedure :: contains => contains_point
    procedure :: part_of_segment
    procedure :: part_of_grain
    procedure :: decides
  end type region_type

contains

  !> A region of all: the box around grains (3, n) with half-sizes [m] of their bounding boxes.
  pure subroutine fit(self, x, half)
    class(region_type), intent(inout) :: self
    real(wp), intent(in) :: x(:, :), half(:, :)
    integer(i4) :: k
    self%lower = 0.0_wp
    self%upper = 0.0_wp
    if (size(x, 2) == 0) return
    do k = 1, 3
      self%lower(k) = minval(x(k, :) - half(k, :))
      self%upper(k) = maxval(x(k, :) + half(k, :))
    end do
  end subroutine fit

  !> [m^3]
  pure real(wp) function volume(self)
    class(region_type), intent(in) :: self
    if (self%kind == region_cell) then
      volume = self%cell_volume
    else if (self%kind == region_cylinder) then
      volume = pi*self%radius**2*self%length
    else if (self%kind == region_sphere) then
      volume = 4.0_wp/3.0_wp*pi*self%radius**3
    else
      volume = product(self%upper - self%lower)
    end if
  end function volume

  !> Middle [m].
  pure function centre(self) result(x)
    class(region_type), intent(in) :: self
    real(wp) :: x(3)
    if (self%kind == region_cylinder) then
      x = self%base + 0.5_wp*self%length*self%axis
    else if (self%kind == region_sphere) then
      x = self%base
    else
      x = 0.5_wp*(self%lower + self%upper)
    end if
  end function centre

  !> Is a point inside? Lower faces belong to the region, upper ones do not.
  pure logical function contains_point(self, x)
    class(region_type), intent(in) :: self
    real(wp), intent(in) :: x(3)  !! [m]
    real(wp) :: d(3), along
    contains_point = .true.
    if (self%kind == region_cell) return
    d = x - self%base
    if (self%kind == region_sphere) then
      contains_point = sum(d**2) < self%radius**2
      return
    else if (self%kind /= region_cylinder) then
      contains_point = all(x >= self%lower .and. x < self%upper)
      return
    end if
    along = dot_product(d, self%axis)
    contains_point = along >= 0.0_wp .and. along < self%length .and. &
      sum((d - along*self%axis)**2) < self%radius**2
  end function contains_point

  !> Part of the way from a to b that lies inside [-].
  pure real(wp) function part_of_segment(self, a, b) result(part)
    class(region_type), intent(in) :: self
    real(wp), intent(in) :: a(3), b(3)  !! [m]
    real(wp) :: from, to, d(3), e(3), f, g, h, root
    integer(i4) :: k

    part = 1.0_wp
    if (self%kind == region_cell) return
    from = 0.0_wp
    to = 1.0_wp
    d = a - self%base
    e = b - a
    if (self%kind == region_cylinder) then
      f = dot_product(d, self%axis)
      g = dot_product(e, self%axis)
      call cut(f, g, from, to)
      call cut(self%length - f, -g, from, to)
      d = d - f*self%axis
      e = e - g*self%axis
    end if
    if (self%kind /= region_cylinder .and. self%kind /= region_sphere) then
      do k = 1, 3
        call cut(a(k) - self%lower(k), e(k), from, to)
        call cut(self%upper(k) - a(k), -e(k), from, to)
      end do
    else
      f = sum(e**2)
      g = dot_product(d, e)
      h = sum(d**2) - self%radius**2
      root = g*g - f*h
      if (f > epsilon(f)*self%radius**2 .and. root > 0.0_wp) then
        from = max(from, (-g - sqrt(root))/f)
        to = min(to, (-g + sqrt(root))/f)
      else if (h >= 0.0_wp) then
        to = from
      end if
    end if
    part = max(0.0_wp, to - from)
  end function part_of_segment

  !> Keep the part of the way on which start + slope t >= 0.
  pure subroutine cut(start, slope, from, to)
    real(wp), intent(in) :: start, slope
    real(wp), intent(inout) :: from, to
    if (slope > 0.0_wp) then
      if (start < 0.0_wp) from = max(from, -start/slope)
    else if (slope < 0.0_wp) then
      if (start + slope < 0.0_wp) to = min(to, -start/slope)
    else if (start < 0.0_wp) then
      to = from
    end if
  end subroutine cut

  !> Part of the volume of an ellipsoid that lies inside [-]: the part of the points (3, m) of the
  !! unit ball; none is evaluated where the grain is surely in or out.
  pure real(wp) function part_of_grain(self, x, half, turn, axes, points) result(part)
    class(region_type), intent(in) :: self
    real(wp), intent(in) :: x(3)          !! centre [m]
    real(wp), intent(in) :: half(3)       !! half-sizes of the bounding box [m]
    real(wp), intent(in) :: turn(3, 3)    !! rotation, body to space
    real(wp), intent(in) :: axes(3)       !! semi-axes [m]
    real(wp), intent(in) :: points(:, :)  !! of ball_points [-]
    real(wp) :: map(3, 3)
    integer(i4) :: k, inside

    part = 1.0_wp
    if (self%kind == region_cell) return
    if (surely(self, x, half, maxval(axes), .true.)) return
    part = 0.0_wp
    if (surely(self, x, half, maxval(axes), .false.)) return
    do k = 1, 3
      map(:, k) = axes(k)*turn(:, k)
    end do
    inside = 0
    do k = 1, size(points, 2)
      if (self%contains(x + matmul(map, points(:, k)))) inside = inside + 1
    end do
    part = real(inside, wp)/real(size(points, 2), wp)
  end function part_of_grain

  !> Is a grain surely within or surely out of the region, so that no face cuts it?
  pure logical function decides(self, x, half, reach)
    class(region_type), intent(in) :: self
    real(wp), intent(in) :: x(3)     !! centre [m]
    real(wp), intent(in) :: half(3)  !! half-sizes of the bounding box [m]
    real(wp), intent(in) :: reach    !! largest distance of a point from the centre [m]
    decides = self%kind == region_cell
    if (.not. decides) decides = surely(self, x, half, reach, .true.) .or. &
      surely(self, x, half, reach, .false.)
  end function decides

  !> Is a grain surely within (or surely out of) the region?
  pure logical function surely(self, x, half, reach, within)
    class(region_type), intent(in) :: self
    real(wp), intent(in) :: x(3), half(3), reach
    logical, intent(in) :: within
    real(wp) :: d(3), along, off, low, high, aside

    d = x - self%base
    if (self%kind == region_sphere) then
      off = merge(reach, -reach, within)
      surely = merge(norm2(d) + off <= self%radius, norm2(d) + off >= self%radius, within)
      return
    else if (self%kind /= region_cylinder) then
      surely = merge(all(x - half >= self%lower .and. x + half <= self%upper), &
                     any(x + half <= self%lower .or. x - half >= self%upper), within)
      return
    end if
    along = dot_product(d, self%axis)
    aside = sqrt(sum((d - along*self%axis)**2))
    off = merge(reach, -reach, within)
    low = along - off
    high = self%length - along - off
    surely = merge(low >= 0.0_wp .and. high >= 0.0_wp .and. aside + off <= self%radius, &
                   low <= 0.0_wp .or. high <= 0.0_wp .or. aside + off >= self%radius, within)
  end function surely

  !> Points of a cubic lattice, `number` to the diameter, that lie in the unit ball (3, m).
  pure function ball_points(number) result(points)
    integer(i4), intent(in) :: number
    real(wp), allocatable :: points(:, :)
    real(wp) :: p(3)
    integer(i4) :: cell, m, place(3), round

    do round = 1, 2
      m = 0
      do cell = 0, number**3 - 1
        place = [mod(cell, number), mod(cell/number, number), cell/number**2] + 1
        p = (2*place - 1)/real(number, wp) - 1.0_wp
        if (sum(p**2) > 1.0_wp) cycle
        m = m + 1
        if (round == 2) points(:, m) = p
      end do
      if (round == 1) allocate (points(3, m))
    end do
  end function ball_points
end module talus_region
