!> Fragments that grow back to the volume of their grain (theory-dem, Breakage of grains).
!!
!! A fragment is born with the mass and the moments of inertia of its grown body and with the size
!! that fits into the grain; its lengths then grow linearly in time, in the looks. Rows of `growing`
!! stay as long as their grains are in the run: strengths follow from the grown size, whatever the
!! size is when a checkpoint is read.
!! eqs. D.70 and D.71
module dem_breakage_growth
  use talus_kinds, only: wp, i4, i8
  use dem_records, only: index_of
  use dem_state, only: dem_data_type, dem_grains_type, grown_size
  implicit none
  private
  public :: plan_growth, growth_due, growth_factor, grown_diameter, left_to_grow

  ! rows of growing: id, when growth began [s], present and last size over that at birth [-], last
  ! diameter of the sphere of the volume [m]
  integer(i4), parameter :: row_id = 1, row_start = 2, row_reached = 3, row_end = 4, row_size = 5
  real(wp), parameter :: third = 1.0_wp/3.0_wp

contains

  !> By how much the lengths of fragments grow so that they have the volume of their grain.
  pure real(wp) function growth_factor(whole, parts) result(factor)
    real(wp), intent(in) :: whole     !! volume of the grown grain, in any unit
    real(wp), intent(in) :: parts(:)  !! of its fragments at birth, in the same unit
    factor = (whole/sum(parts))**third
  end function growth_factor

  !> The fragments first to last of grain i begin to grow, with the masses of their ends.
  pure subroutine plan_growth(d, i, first, last, time, entering)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i            !! the grain that breaks
    integer(i4), intent(in) :: first, last  !! of its fragments; none: 0
    real(wp), intent(in) :: time            !! [s]
    type(dem_grains_type), intent(inout) :: entering
    real(wp), allocatable :: rows(:, :)
    real(wp) :: factor
    integer(i4) :: k
    if (first < 1) return
    factor = growth_factor(product(d%grains%axes(:, i))*left_to_grow(d, d%grains%id(i))**3, &
                           product(entering%axes(:, first:last), dim=1))
    allocate (rows(grown_size, first:last))
    do k = first, last
      rows(row_id, k) = real(entering%id(k), wp)
      rows(row_start, k) = time
      rows(row_reached, k) = 1.0_wp
      rows(row_end, k) = factor
      rows(row_size, k) = 2.0_wp*product(entering%axes(:, k))**third*factor
      entering%mass(k) = factor**3*entering%mass(k)
      entering%inertia(:, k) = factor**5*entering%inertia(:, k)
    end do
    d%growing = reshape([d%growing, rows], [grown_size, size(d%growing, 2) + last - first + 1])
  end subroutine plan_growth

  !> Factors on the lengths of all grains until now; rows of grains that have left go.
  pure subroutine growth_due(d, time, span, factor, jump)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time             !! [s]
    real(wp), intent(in) :: span(:)          !! (materials) that growth takes [s]; 0: none
    real(wp), intent(out) :: factor(:)       !! (grains) [-]
    real(wp), intent(out) :: jump            !! greatest part of its growth that a grain makes [-]
    logical :: there(size(d%growing, 2))
    real(wp) :: reached
    integer(i4) :: i, k
    factor = 1.0_wp
    jump = 0.0_wp
    do k = 1, size(d%growing, 2)
      i = index_of(d, d%growing(row_id, k))
      there(k) = i > 0
      if (i == 0) cycle
      associate (row => d%growing(:, k))
        if (.not. row(row_reached) < row(row_end)) cycle
        reached = row(row_end)
        if (time - row(row_start) < span(d%grains%material(i))) reached = 1.0_wp &
          + (row(row_end) - 1.0_wp)*(time - row(row_start))/span(d%grains%material(i))
        factor(i) = reached/row(row_reached)
        jump = max(jump, (reached - row(row_reached))/(row(row_end) - 1.0_wp))
      end associate
      d%growing(row_reached, k) = reached
    end do
    if (.not. all(there)) d%growing = d%growing(:, pack([(k, k=1, size(there))], there))
  end subroutine growth_due

  !> By how much the lengths of a grain will still grow.
  pure real(wp) function left_to_grow(d, id) result(factor)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: id
    integer(i4) :: k
    k = row_of(d, id)
    factor = 1.0_wp
    if (k > 0) factor = d%growing(row_end, k)/d%growing(row_reached, k)
  end function left_to_grow

  !> Diameter of the sphere of the volume that grain i has, or will have [m].
  pure real(wp) function grown_diameter(d, i) result(diameter)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    integer(i4) :: k
    k = row_of(d, d%grains%id(i))
    if (k > 0) then
      diameter = d%growing(row_size, k)
    else
      diameter = 2.0_wp*product(d%grains%axes(:, i))**third
    end if
  end function grown_diameter

  !> Row of a grain, 0: it has none.
  pure integer(i4) function row_of(d, id) result(row)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: id
    integer(i4) :: low, high
    integer(i8) :: here
    low = 1
    high = 0
    if (allocated(d%growing)) high = size(d%growing, 2)
    do while (low <= high)
      row = (low + high)/2
      here = nint(d%growing(row_id, row), i8)
      if (here == id) return
      if (here < id) then
        low = row + 1
      else
        high = row - 1
      end if
    end do
    row = 0
  end function row_of
end module dem_breakage_growth
