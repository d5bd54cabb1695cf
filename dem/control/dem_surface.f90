!> The free surface of a bed seen from above: grains with nothing above their centre within their
!! outline in the plan.
!!
!! A free grain lies above another if its centre is higher by more than a tenth of the other's
!! vertical semi-extent (neighbours at one height overlap in the plan by their contact) and their
!! outlines overlap. A fixed or driven grain lies above if its outline holds the other's centre: a
!! wall of spheres beside the bed covers nothing. So do ghosts, except in an overlap with a solid,
!! where they continue the bed and count as free.
!!
!! A grain that was on the surface at the last update leaves it when it is covered by more than
!! that, one that was not joins it when it is free by more: the surface of a bed at rest does not
!! change.
module dem_surface
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, kind_free, kind_ghost
  use dem_plan, only: plan_type, outline_of, largest_reach, holds_centre, outlines_meet, &
    folded_in, nearest, with_images
  use dem_ellipsoid, only: rotation_of
  implicit none
  private
  public :: surface_rows

  real(wp), parameter :: higher = 0.1_wp  !! of the vertical semi-extent [-]
  real(wp), parameter :: higher_slack = 0.05_wp   !! more to leave, less to come back [-]
  real(wp), parameter :: outline_slack = 0.03_wp  !! outlines smaller to leave, larger to come [-]

  !> Grains as the plan shows them, those of the bed in square bins.
  type :: view_type
    logical, allocatable :: bed(:)          !! (n) free, or a ghost that continues the bed
    real(wp), allocatable :: outline(:, :)  !! (3, n), see outline_of [m^2]
    real(wp), allocatable :: reach(:)       !! (n) largest semi-axis of the outline [m]
    real(wp), allocatable :: half(:)        !! (n) vertical semi-extent [m]
    real(wp), allocatable :: x(:, :)        !! (2, entries) grains, then images over faces [m]
    integer(i4), allocatable :: row(:)      !! (entries) of the grain
    real(wp) :: corner(2) = 0.0_wp          !! of the first bin [m]
    real(wp) :: edge = 1.0_wp               !! of a bin [m]
    integer(i4) :: bins(2) = 1
    integer(i4), allocatable :: first(:)    !! (bins + 1) in list
    integer(i4), allocatable :: list(:)     !! entries of the bed by bin
  end type view_type

contains

  !> Rows of the free grains of the surface whose centres lie in the rectangle outside the discs,
  !! ascending; with `ghosts` of the ghosts, too.
  pure function surface_rows(g, plan, ghosts, was) result(rows)
    type(dem_grains_type), intent(in) :: g
    type(plan_type), intent(in) :: plan
    logical, intent(in) :: ghosts            !! they go on the bed
    logical, intent(in), optional :: was(:)  !! (grains) they were on the surface last time
    integer(i4), allocatable :: rows(:)
    type(view_type) :: view
    logical, allocatable :: top(:)
    real(wp) :: slack
    integer(i4) :: i

    allocate (top(g%n))
    view%bed = g%kind == kind_free .or. (ghosts .and. g%kind == kind_ghost)
    call look_down(g, plan, view)
    do i = 1, g%n
      top(i) = view%bed(i)
      if (top(i)) top(i) = inside(plan, view%x(:, i))
      slack = 0.0_wp
      if (present(was)) slack = merge(1.0_wp, -1.0_wp, was(i))
      if (top(i)) top(i) = .not. under_free(g, view, i, slack)
      if (top(i)) top(i) = .not. under_held(g, plan, view, i, slack)
    end do
    rows = pack([(i, i=1, g%n)], top)
  end function surface_rows

  pure logical function inside(plan, x)
    type(plan_type), intent(in) :: plan
    real(wp), intent(in) :: x(2)
    integer(i4) :: k
    inside = all(plan%periodic .or. (x > plan%lower .and. x < plan%upper))
    do k = 1, size(plan%disc, 2)
      inside = inside .and. sum((x - plan%disc(:2, k))**2) > plan%disc(3, k)**2
    end do
  end function inside

  !> Outlines and bins; grains beyond the rectangle come into the bins at its border.
  pure subroutine look_down(g, plan, view)
    type(dem_grains_type), intent(in) :: g
    type(plan_type), intent(in) :: plan
    type(view_type), intent(inout) :: view
    real(wp) :: turn(3, 3), place(2, g%n)
    integer(i4) :: i

    allocate (view%outline(3, g%n), view%reach(g%n), view%half(g%n))
    do i = 1, g%n
      turn = rotation_of(g%quat(:, i))
      view%outline(:, i) = outline_of(turn, g%axes(:, i))
      view%reach(i) = largest_reach(view%outline(:, i))
      view%half(i) = sqrt(sum((turn(3, :)*g%axes(:, i))**2))
      place(:, i) = folded_in(plan, g%x(:2, i))
    end do
    view%edge = max(2.0_wp*maxval(view%reach, mask=view%bed), tiny(1.0_wp))
    view%corner = plan%lower - view%edge
    view%bins = 2 + ceiling(min((plan%upper - plan%lower)/view%edge, 1.0e4_wp))
    call with_images(plan, place, [view%edge, view%edge], view%x, view%row)
    call fill_bins(view)
  end subroutine look_down

  !> Entries of the bed by bin, ascending in each.
  pure subroutine fill_bins(view)
    type(view_type), intent(inout) :: view
    integer(i4) :: i, b
    allocate (view%first(product(view%bins) + 1), source=0_i4)
    allocate (view%list(count(view%bed(view%row))))
    do i = 1, size(view%row)
      if (.not. view%bed(view%row(i))) cycle
      b = bin_of(view, view%x(:, i))
      view%first(b) = view%first(b) + 1
    end do
    do b = 2, size(view%first)
      view%first(b) = view%first(b) + view%first(b - 1)
    end do
    do i = size(view%row), 1, -1
      if (.not. view%bed(view%row(i))) cycle
      b = bin_of(view, view%x(:, i))
      view%list(view%first(b)) = i
      view%first(b) = view%first(b) - 1
    end do
    view%first = view%first + 1
  end subroutine fill_bins

  pure integer(i4) function bin_of(view, x) result(b)
    type(view_type), intent(in) :: view
    real(wp), intent(in) :: x(2)
    integer(i4) :: at(2)
    at = place_of(view, x)
    b = at(1) + view%bins(1)*(at(2) - 1)
  end function bin_of

  !> Column and row of the bin of a point.
  pure function place_of(view, x) result(at)
    type(view_type), intent(in) :: view
    real(wp), intent(in) :: x(2)
    integer(i4) :: at(2)
    at = 1 + int(min(max((x - view%corner)/view%edge, 0.0_wp), real(view%bins - 1, wp)))
  end function place_of

  !> Does a free grain lie above grain i?
  pure logical function under_free(g, view, i, slack) result(under)
    type(dem_grains_type), intent(in) :: g
    type(view_type), intent(in) :: view
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: slack  !! 1 it was on the surface, -1 it was not, 0 unknown
    integer(i4) :: at(2), row, b, k, j
    real(wp) :: r(2), above, scale

    above = g%x(3, i) + (higher + slack*higher_slack)*view%half(i)
    scale = 1.0_wp + slack*outline_slack
    at = place_of(view, view%x(:, i))
    under = .true.
    do row = max(at(2) - 1, 1), min(at(2) + 1, view%bins(2))
      b = view%bins(1)*(row - 1)
      do k = view%first(b + max(at(1) - 1, 1)), &
             view%first(b + min(at(1) + 1, view%bins(1)) + 1) - 1
        j = view%row(view%list(k))
        if (g%x(3, j) <= above) cycle
        r = scale*(view%x(:, view%list(k)) - view%x(:, i))
        if (sum(r**2) >= (view%reach(i) + view%reach(j))**2) cycle
        if (outlines_meet(view%outline(:, i), view%outline(:, j), r)) return
      end do
    end do
    under = .false.
  end function under_free

  !> Does a fixed or driven grain or a ghost lie above the centre of grain i?
  pure logical function under_held(g, plan, view, i, slack) result(under)
    type(dem_grains_type), intent(in) :: g
    type(plan_type), intent(in) :: plan
    type(view_type), intent(in) :: view
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: slack  !! as of under_free
    integer(i4) :: j
    real(wp) :: r(2)
    under = .true.
    do j = 1, g%n
      if (view%bed(j) .or. g%x(3, j) <= g%x(3, i)) cycle
      r = (1.0_wp + slack*outline_slack)*nearest(plan, g%x(:2, i) - g%x(:2, j))
      if (sum(r**2) >= view%reach(j)**2) cycle
      if (holds_centre(view%outline(:, j), r)) return
    end do
    under = .false.
  end function under_held
end module dem_surface
