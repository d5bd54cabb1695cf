!> History of the contacts of membranes that are born in pairs.
module dem_membrane_match
  use talus_kinds, only: wp, i4
  use dem_surface_feature, only: touches_type
  use dem_surface_state, only: dem_surfaces_type, surface_membrane
  implicit none
  private
  public :: bear_pairs

  real(wp), parameter :: far_apart = 0.5_wp  !! distance in radii that no pair and no heir has

contains

  !> A minimum or maximum and a saddle of a membrane that were born together have both the history
  !! of the nearest contact of the last step: their sum is nothing, and whichever is left over when
  !! two of the three go again carries the tangential force on.
  pure subroutine bear_pairs(s, g, h, radius, touches, source)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g  !! near grain
    real(wp), intent(in) :: h, radius
    type(touches_type), intent(in) :: touches
    integer(i4), intent(inout) :: source(:)  !! of each new contact's history, 0: none
    real(wp) :: nearest, apart
    integer(i4) :: k, j, other, heir

    do k = 1, touches%n
      if (source(k) > 0 .or. touches%sign(k) > 0.0_wp) cycle
      if (s%kind(touches%body(k)) /= surface_membrane) cycle
      nearest = far_apart*radius
      other = 0
      do j = 1, touches%n
        if (source(j) > 0 .or. touches%sign(j) < 0.0_wp .or. touches%part(j) /= touches%part(k)) &
          cycle
        apart = sqrt(sum((touches%foot(:, j) - touches%foot(:, k))**2))
        if (apart >= nearest) cycle
        nearest = apart
        other = j
      end do
      if (other == 0) cycle
      nearest = far_apart*radius
      heir = 0
      do j = 1, s%list%contacts(g)
        if (s%list%part(j, g) /= touches%part(k)) cycle
        apart = sqrt(sum((s%list%foot(j, :, g) + h*s%list%motion(j, 1:3, g) &
          - touches%foot(:, k))**2))
        if (apart >= nearest) cycle
        nearest = apart
        heir = j
      end do
      if (heir == 0) cycle
      source(k) = heir
      source(other) = heir
    end do
  end subroutine bear_pairs
end module dem_membrane_match
