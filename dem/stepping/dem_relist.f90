!> When and how the candidate list is rebuilt: travel since it was made, the skin, the cell.
module dem_relist
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_cell, only: least_width, is_periodic
  use dem_margin, only: set_margins
  use dem_migrate, only: share_out
  use dem_passages, only: find_passage
  use dem_pairs, only: build_pairs
  use dem_state, only: dem_data_type
  use dem_surface_motion, only: surface_travel
  use dem_surface_search, only: list_near
  implicit none
  private
  public :: rebuild_list, rebuild_if_needed, fit_skin, outlived, travel_of, larger

  integer(i8), parameter :: few_steps = 40      !! a list that lasts less gets a wider skin
  integer(i8), parameter :: few_in_parts = 120  !! the same where each list has a border chosen
  integer(i8), parameter :: many_steps = 200    !! one that lasts longer a narrower one
  integer(i8), parameter :: rest_steps = 2000   !! a wide skin is kept no longer than this

contains

  !> A list with a wide skin is given up when the grains have come to rest.
  pure logical function outlived(d, step)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: step
    outlived = step - d%pairs%built_at > rest_steps .and. d%pairs%skin > d%pairs%least_skin
  end function outlived

  !> Larger of two, not-a-number wins.
  pure real(wp) function larger(a, b)
    real(wp), intent(in) :: a, b
    larger = a
    if (.not. b <= a) larger = b
  end function larger

  !> Bound of how far the surface of grain i has come, along any normal, since the list was made:
  !! displacement, and rotation times the difference of the extreme semi-axes; in its own margin,
  !! see dem_margin.
  pure real(wp) function travel_of(d, i)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp) :: square, cosine, sine
    square = (d%grains%x(1, i) - d%pairs%reference_x(1, i))**2 &
             + (d%grains%x(2, i) - d%pairs%reference_x(2, i))**2 &
             + (d%grains%x(3, i) - d%pairs%reference_x(3, i))**2
    cosine = d%grains%quat(1, i)*d%pairs%reference_q(1, i) &
             + d%grains%quat(2, i)*d%pairs%reference_q(2, i) &
             + d%grains%quat(3, i)*d%pairs%reference_q(3, i) &
             + d%grains%quat(4, i)*d%pairs%reference_q(4, i)
    sine = sqrt(max(1.0_wp - cosine*cosine, 0.0_wp))
    ! asin(s) <= s + (pi/2 - 1) s^3
    travel_of = d%pairs%ease(i)*(sqrt(square) + 2.0_wp*d%pairs%reach(i)*sine &
                                 *(1.0_wp + 0.571_wp*sine*sine))
  end function travel_of

  !> Largest travel of any grain or plane since the list was made [m].
  real(wp) function largest_travel(d) result(travel)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: i
    travel = 0.0_wp
    do i = 1, d%grains%n
      travel = larger(travel, travel_of(d, i))
    end do
    do i = 1, d%planes%n
      travel = larger(travel, sqrt(sum((d%planes%point(:, i) &
                                        - d%pairs%reference_x(:, d%grains%n + 3 + i))**2)))
    end do
    if (d%surfaces%n > 0) travel = larger(travel, surface_travel(d%surfaces))
  end function largest_travel

  !> Rebuild the list if the current positions have used it up (bodies must be up to date).
  subroutine rebuild_if_needed(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: travel
    travel = largest_travel(d)
    if (.not. travel <= 0.5_wp*d%pairs%skin) call rebuild_list(d, travel, d%pending)
  end subroutine rebuild_if_needed

  !> The skin may be no wider than the cell allows; a cell narrower than two ranges ends the run
  !! (N220).
  subroutine fit_skin(d, errors)
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: range(1), width
    if (.not. is_periodic(d%cell)) return
    range = 2.0_wp*maxval(d%grains%radius)
    call d%halo%team%most(range)
    width = least_width(d%cell)
    d%pairs%most_skin = min(d%pairs%most_skin, 0.5_wp*width - range(1))
    d%pairs%skin = min(d%pairs%skin, d%pairs%most_skin)
    if (d%pairs%most_skin >= d%pairs%least_skin) return
    call errors%add('N220', 'the periodic cell has become '//str(width)//' m wide, less than '// &
                    'two interaction ranges of '//str(range(1) + d%pairs%least_skin)//' m', &
                    place='step '//str(d%health%steps), &
                    hint='a larger cell with more grains, or less compression')
  end subroutine fit_skin

  !> New list; late if one step went further than the whole margin, see dem_passages.
  subroutine rebuild_list(d, travel, h)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: travel  !! since the last list [m]
    real(wp), intent(in) :: h       !! since forces were worked [s]
    real(wp), allocatable :: contacts(:, :)
    d%health%rebuilds = d%health%rebuilds + 1
    if (travel > d%pairs%skin) then
      d%health%late_rebuilds = d%health%late_rebuilds + 1
      if (.not. d%par%allow_late) call find_passage(d, h)
    end if
    if (d%health%steps - d%pairs%built_at < merge(few_in_parts, few_steps, d%parts%active)) then
      d%pairs%skin = min(1.3_wp*d%pairs%skin, d%pairs%most_skin)
    else if (d%health%steps - d%pairs%built_at > many_steps) then
      d%pairs%skin = max(d%pairs%skin/1.3_wp, d%pairs%least_skin)
    end if
    call set_margins(d)
    d%pairs%built_at = d%health%steps
    if (d%halo%team%several()) call share_out(d, contacts)
    call build_pairs(d%pairs, d%grains, d%planes, d%weights, d%par%ghost_pairs, d%cell)
    if (d%surfaces%n > 0) call list_near(d)
  end subroutine rebuild_list
end module dem_relist
