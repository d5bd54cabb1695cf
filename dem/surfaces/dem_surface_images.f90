!> Images of surfaces in a periodic cell: which of them a grain may reach.
!!
!! Neither centres of grains nor bodies are folded back into the cell, so a contact is with the same
!! image as long as it lasts. An image lies at whole edges from its body; everything about it is
!! that of the body but the place. An endless round body along an edge is its own image there.
module dem_surface_images
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: inverse_of
  use dem_cell, only: is_periodic, shift_of
  use dem_state, only: dem_cell_type
  use dem_surface_state, only: dem_surfaces_type, surface_cone, is_round
  implicit none
  private
  public :: reached_images, image_count, image_at
  public :: body_width, turned_width, is_endless, endless_along, crosses_edges

  real(wp), parameter :: aligned = 1.0e-9_wp  !! sine of an angle that is none

contains

  !> Whole edges from body b to its first and last image that a point x may be near to, within a
  !! margin; zero along edges that are not periodic.
  pure subroutine reached_images(s, b, cell, x, margin, first, last)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: x(3), margin  !! [m]
    integer(i4), intent(out) :: first(3), last(3)
    real(wp) :: inverse(3, 3), middle(3), half, apart
    integer(i4) :: k

    first = 0
    last = 0
    if (.not. is_periodic(cell)) return
    inverse = inverse_of(cell%vectors)
    middle = middle_of(s, b)
    do k = 1, 3
      if (.not. cell%periodic(k) .or. endless_along(s, b, cell, k)) cycle
      half = half_width(s, b, inverse(k, :)) + margin*norm2(inverse(k, :))
      apart = dot_product(inverse(k, :), x - middle)
      first(k) = ceiling(apart - half)
      last(k) = floor(apart + half)
    end do
  end subroutine reached_images

  !> Number of images in a range of whole edges, along x first.
  pure integer(i4) function image_count(first, last)
    integer(i4), intent(in) :: first(3), last(3)
    image_count = product(max(last - first + 1, 0))
  end function image_count

  !> Vector from a body to image k of a range [m].
  pure function image_at(cell, first, last, k) result(image)
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: first(3), last(3)
    integer(i4), intent(in) :: k  !! from 1
    real(wp) :: image(3)
    integer(i4) :: n(3)
    n = last - first + 1
    image = shift_of(cell, first + [mod(k - 1, n(1)), mod((k - 1)/n(1), n(2)), (k - 1)/(n(1)*n(2))])
  end function image_at

  !> Width of body b between the faces across edge k, in units of the edge; of a mesh that turns at
  !! any time [-].
  pure real(wp) function body_width(s, b, cell, k, turns) result(width)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: k
    logical, intent(in) :: turns
    real(wp) :: inverse(3, 3), place
    real(wp) :: low, high
    integer(i4) :: v

    inverse = inverse_of(cell%vectors)
    width = 2.0_wp*half_width(s, b, inverse(k, :))
    if (turns) width = 2.0_wp*s%reach(b)*norm2(inverse(k, :))
    if (turns .or. is_round(s, b)) return
    low = huge(low)
    high = -huge(high)
    do v = s%first_vertex(b), s%first_vertex(b + 1) - 1
      place = dot_product(inverse(k, :), s%mesh%x(:, v))
      low = min(low, place)
      high = max(high, place)
    end do
    width = high - low
  end function body_width

  !> The same of a mesh that turns about an axis of fixed direction through its centre [-].
  pure real(wp) function turned_width(s, b, cell, k, axis) result(width)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: axis(3)  !! of any length
    real(wp) :: inverse(3, 3), along(3), across, away(3), middle, aside, low, high
    integer(i4) :: v

    inverse = inverse_of(cell%vectors)
    along = axis/norm2(axis)
    across = norm2(inverse(k, :) - dot_product(inverse(k, :), along)*along)
    low = huge(low)
    high = -huge(high)
    do v = s%first_vertex(b), s%first_vertex(b + 1) - 1
      away = s%mesh%x(:, v) - s%centre(:, b)
      middle = dot_product(away, along)
      aside = norm2(away - middle*along)*across
      middle = middle*dot_product(inverse(k, :), along)
      low = min(low, middle - aside)
      high = max(high, middle + aside)
    end do
    width = high - low
  end function turned_width

  !> Has the round body b no end?
  pure logical function is_endless(s, b)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    is_endless = .false.
    if (is_round(s, b)) is_endless = s%round%extent(b) > 0.1_wp*huge(1.0_wp)
  end function is_endless

  !> Is body b a round one without end along the periodic edge k?
  pure logical function endless_along(s, b, cell, k)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: k
    real(wp) :: edge(3)
    endless_along = .false.
    if (.not. (is_endless(s, b) .and. cell%periodic(k))) return
    if (s%kind(b) == surface_cone) return
    edge = cell%vectors(:, k)/norm2(cell%vectors(:, k))
    edge = edge - dot_product(edge, s%round%axis(:, b))*s%round%axis(:, b)
    endless_along = norm2(edge) <= aligned
  end function endless_along

  !> Does body b, which has no end, cut faces of the cell without being its own image behind them?
  pure logical function crosses_edges(s, b, cell)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(dem_cell_type), intent(in) :: cell
    real(wp) :: inverse(3, 3)
    integer(i4) :: k
    crosses_edges = .false.
    if (.not. is_endless(s, b)) return
    inverse = inverse_of(cell%vectors)
    do k = 1, 3
      if (.not. cell%periodic(k) .or. endless_along(s, b, cell, k)) cycle
      crosses_edges = crosses_edges .or. abs(dot_product(inverse(k, :), s%round%axis(:, b))) > &
        aligned*norm2(inverse(k, :))
    end do
  end function crosses_edges

  !> Point about which a body lies [m].
  pure function middle_of(s, b) result(middle)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp) :: middle(3)
    middle = s%centre(:, b)
    if (.not. is_round(s, b) .or. is_endless(s, b)) return
    if (s%kind(b) == surface_cone) middle = middle + 0.5_wp*cone_length(s, b)*s%round%axis(:, b)
  end function middle_of

  !> Half of what a body reaches along a row of the inverse edges [-]; of a mesh its sphere.
  pure real(wp) function half_width(s, b, row) result(half)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: row(3)  !! [1/m]
    real(wp) :: length
    half = s%reach(b)*norm2(row)
    if (.not. is_round(s, b)) return
    half = s%round%radius(b)*norm2(row)
    if (is_endless(s, b)) return
    length = 2.0_wp*s%round%extent(b)
    if (s%kind(b) == surface_cone) length = cone_length(s, b)
    half = half + 0.5_wp*length*abs(dot_product(row, s%round%axis(:, b)))
  end function half_width

  !> From the tip to the end of the shaft [m].
  pure real(wp) function cone_length(s, b) result(length)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    length = s%round%radius(b)*s%round%cosine(b)/s%round%sine(b) + s%round%extent(b)
  end function cone_length
end module dem_surface_images
