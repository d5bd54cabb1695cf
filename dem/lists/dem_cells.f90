!> Broad phase: all pairs of grains whose supports along the line of centres leave less than a
!! margin. Cells hold the common grains; the few much larger ones are tested against all.
module dem_cells
  use, intrinsic :: iso_fortran_env, only: int64
  use omp_lib, only: omp_get_thread_num, omp_get_num_threads, omp_get_max_threads
  use talus_kinds, only: wp, i4
  use dem_kinds, only: moved_by_forces
  use dem_state, only: kind_ghost
  implicit none
  private
  public :: find_candidates

  integer(i4), parameter :: most_large = 32     !! grains that may lie outside the cells
  real(wp), parameter :: large_factor = 1.5_wp  !! how much larger they must be

  !> Cell grid; grains outside its box count to the border cells.
  type :: grid_type
    real(wp) :: low(3) = 0.0_wp
    real(wp) :: size = 1.0_wp
    integer(i4) :: n(3) = 1
    integer(i4), allocatable :: cell(:)     !! cell of a grain, 0 for large ones
    integer(i4), allocatable :: start(:)    !! (cells+1)
    integer(i4), allocatable :: member(:)   !! grains by cell, ascending inside a cell
    real(wp), allocatable :: centre(:, :)   !! (4, members) centre, bounding radius with spare [m]
    integer(i4), allocatable :: large(:)    !! large grains, ascending
  end type grid_type

  !> One thread's share of the list.
  type :: share_type
    integer(i4) :: count = 0
    integer(i4), allocatable :: first(:), second(:)
  end type share_type

contains

  !> Pairs (first < second), ascending in first, then second.
  subroutine find_candidates(body, radius, spare, kind, margin, ghost_pairs, first, second, count)
    real(wp), intent(in), contiguous :: body(:, :)  !! body records, see dem_state
    real(wp), intent(in) :: radius(:)               !! bounding spheres [m]
    real(wp), intent(in) :: spare(:)                !! what a grain adds to the margin [m]
    integer(i4), intent(in) :: kind(:)
    real(wp), intent(in) :: margin                  !! list pairs with a smaller gap [m]
    logical, intent(in) :: ghost_pairs              !! ghost-ghost pairs are listed
    integer(i4), allocatable, intent(out) :: first(:), second(:)
    integer(i4), intent(out) :: count
    type(grid_type) :: grid
    type(share_type), allocatable :: share(:)
    integer(i4) :: n, threads, me, low, high, at, k
    integer(i4), allocatable :: offset(:)

    n = size(radius)
    call make_grid(body, radius, spare, margin, grid)
    allocate (share(0:omp_get_max_threads() - 1), offset(0:omp_get_max_threads()))
    offset = 0
    !$omp parallel default(shared) private(me, threads, low, high, at, k)
    me = omp_get_thread_num()
    threads = omp_get_num_threads()
    low = 1 + int(int(n, int64)*me/threads, i4)
    high = int(int(n, int64)*(me + 1)/threads, i4)
    call list_range(body, radius, spare, kind, margin, ghost_pairs, grid, low, high, share(me))
    !$omp barrier
    !$omp single
    do k = 0, threads - 1
      offset(k + 1) = offset(k) + share(k)%count
    end do
    count = offset(threads)
    allocate (first(count), second(count))
    !$omp end single
    at = offset(me)
    first(at + 1:offset(me + 1)) = share(me)%first(:share(me)%count)
    second(at + 1:offset(me + 1)) = share(me)%second(:share(me)%count)
    !$omp end parallel
  end subroutine find_candidates

  !> Radius that all but a few grains stay below.
  pure real(wp) function common_radius(radius) result(common)
    real(wp), intent(in) :: radius(:)
    real(wp) :: top(most_large + 1), r
    integer(i4) :: i, k

    top = 0.0_wp
    do i = 1, size(radius)
      r = radius(i)
      if (r <= top(most_large + 1)) cycle
      k = most_large + 1
      do while (k > 1)
        if (top(k - 1) >= r) exit
        top(k) = top(k - 1)
        k = k - 1
      end do
      top(k) = r
    end do
    common = top(1)
    if (size(radius) <= 2*most_large) return
    do k = 1, most_large
      if (top(k) > large_factor*top(k + 1)) common = top(k + 1)
    end do
  end function common_radius

  !> Choose box and cell size, sort the grains into cells.
  subroutine make_grid(body, radius, spare, margin, grid)
    real(wp), intent(in), contiguous :: body(:, :)
    real(wp), intent(in) :: radius(:), spare(:), margin
    type(grid_type), intent(out) :: grid
    real(wp), parameter :: slack = 1.2_wp  !! of common radii, for margins
    real(wp) :: common, widest, mean(3), spread(3), high(3), cells
    integer(i4) :: n, i, c, large
    integer(i4), allocatable :: fill(:)
    logical :: is_large(size(radius))

    n = size(radius)
    common = common_radius(radius)
    is_large = radius > common
    if (count(radius + spare > slack*common) <= 2*most_large) &
      is_large = is_large .or. radius + spare > slack*common
    widest = max(maxval(radius + spare, mask=.not. is_large), 0.0_wp)
    grid%size = max(2.0_wp*widest + margin, tiny(1.0_wp))
    grid%low = 0.0_wp
    high = 0.0_wp
    do i = 1, merge(3, 0, n > 0)
      mean(i) = sum(body(i, :n))/max(n, 1)
      spread(i) = sqrt(sum((body(i, :n) - mean(i))**2)/max(n, 1))
      grid%low(i) = max(minval(body(i, :n)), mean(i) - 4.0_wp*spread(i))
      high(i) = min(maxval(body(i, :n)), mean(i) + 4.0_wp*spread(i))
    end do
    cells = product(max((high - grid%low)/grid%size, 1.0_wp))
    if (cells > 8.0_wp*n + 64.0_wp) then
      grid%size = grid%size*(cells/(8.0_wp*n + 64.0_wp))**(1.0_wp/3.0_wp)
    end if
    grid%n = 1 + int(min((high - grid%low)/grid%size, 10.0_wp*n + 64.0_wp), i4)

    allocate (grid%cell(n), source=0)
    allocate (grid%start(product(grid%n) + 1), source=0)
    large = count(is_large)
    allocate (grid%large(large), grid%member(n - large), grid%centre(4, n - large))
    large = 0
    do i = 1, n
      if (is_large(i)) then
        large = large + 1
        grid%large(large) = i
        cycle
      end if
      c = cell_index(grid, cell_of(grid, body(1:3, i)))
      grid%cell(i) = c
      grid%start(c + 1) = grid%start(c + 1) + 1
    end do
    grid%start(1) = 1
    do c = 2, size(grid%start)
      grid%start(c) = grid%start(c) + grid%start(c - 1)
    end do
    allocate (fill, source=grid%start)
    do i = 1, n
      c = grid%cell(i)
      if (c == 0) cycle
      grid%member(fill(c)) = i
      grid%centre(:, fill(c)) = [body(1:3, i), radius(i) + spare(i)]
      fill(c) = fill(c) + 1
    end do
  end subroutine make_grid

  pure function cell_of(grid, x) result(c)
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(3)
    integer(i4) :: c(3)
    real(wp) :: s(3)
    s = min(max((x - grid%low)/grid%size, 0.0_wp), real(grid%n, wp))
    c = min(1 + int(s, i4), grid%n)
  end function cell_of

  pure integer(i4) function cell_index(grid, c)
    type(grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c(3)
    cell_index = c(1) + grid%n(1)*(c(2) - 1 + grid%n(2)*(c(3) - 1))
  end function cell_index

  !> Candidates whose lower grain is in low..high.
  subroutine list_range(body, radius, spare, kind, margin, ghost_pairs, grid, low, high, share)
    real(wp), intent(in), contiguous :: body(:, :)
    real(wp), intent(in) :: radius(:), spare(:), margin
    integer(i4), intent(in) :: kind(:), low, high
    logical, intent(in) :: ghost_pairs
    type(grid_type), intent(in) :: grid
    type(share_type), intent(inout) :: share
    integer(i4), allocatable :: partner(:), near(:)
    integer(i4) :: i, n

    n = size(radius)
    share%count = 0
    allocate (share%first(64 + 16*max(high - low + 1, 0)))
    allocate (share%second(size(share%first)), partner(n), near(n + 1))
    do i = low, high
      call list_grain(i)
    end do

  contains

    subroutine list_grain(i)
      integer(i4), intent(in) :: i
      integer(i4) :: found, close, c(3), cy, cz, m, at, k
      real(wp) :: x(3), reach, square
      logical :: apart
      found = 0
      if (grid%cell(i) == 0) then
        do k = i + 1, n
          call try(i, k, found)
        end do
      else
        x = body(1:3, i)
        reach = radius(i) + spare(i) + margin
        c = cell_of(grid, x)
        close = 0
        do cz = max(c(3) - 1, 1), min(c(3) + 1, grid%n(3))
          do cy = max(c(2) - 1, 1), min(c(2) + 1, grid%n(2))
            at = cell_index(grid, [1, cy, cz]) - 1
            do m = grid%start(at + max(c(1) - 1, 1)), &
                   grid%start(at + min(c(1) + 1, grid%n(1)) + 1) - 1
              square = (grid%centre(1, m) - x(1))**2 + (grid%centre(2, m) - x(2))**2 &
                       + (grid%centre(3, m) - x(3))**2
              apart = square > (grid%centre(4, m) + reach)**2
              near(close + 1) = grid%member(m)  ! kept if it counts: no branch to be guessed
              close = close + iand(merge(1, 0, grid%member(m) > i), merge(0, 1, apart))
            end do
          end do
        end do
        do k = 1, close
          call try(i, near(k), found)
        end do
        do k = 1, size(grid%large)
          if (grid%large(k) > i) call try(i, grid%large(k), found)
        end do
      end if
      call sort(partner(:found))
      if (share%count + found > size(share%first)) call lengthen(share, share%count + found)
      do k = 1, found
        share%first(share%count + k) = i
        share%second(share%count + k) = partner(k)
      end do
      share%count = share%count + found
    end subroutine list_grain

    !> Bounding spheres, then supports along the line of centres.
    subroutine try(i, j, found)
      integer(i4), intent(in) :: i, j
      integer(i4), intent(inout) :: found
      real(wp) :: r(3), square, reach, apart
      if (.not. (moved_by_forces(kind(i)) .or. moved_by_forces(kind(j)))) then
        if (.not. (ghost_pairs .and. kind(i) == kind_ghost .and. kind(j) == kind_ghost)) return
      end if
      r = body(1:3, j) - body(1:3, i)
      square = r(1)*r(1) + r(2)*r(2) + r(3)*r(3)
      apart = margin + spare(i) + spare(j)
      reach = radius(i) + radius(j) + apart
      if (square > reach*reach) return
      if (square - sqrt(shape(body(10:15, i), r)) - sqrt(shape(body(10:15, j), r)) &
          > apart*sqrt(square)) return
      found = found + 1
      partner(found) = j
    end subroutine try
  end subroutine list_range

  !> r . A r
  pure real(wp) function shape(a, r)
    real(wp), intent(in) :: a(6), r(3)
    shape = a(1)*r(1)*r(1) + a(2)*r(2)*r(2) + a(3)*r(3)*r(3) &
           + 2.0_wp*(a(4)*r(1)*r(2) + a(5)*r(2)*r(3) + a(6)*r(3)*r(1))
  end function shape

  !> Insertion sort, for the dozen partners of a grain.
  pure subroutine sort(list)
    integer(i4), intent(inout) :: list(:)
    integer(i4) :: i, k, item
    do i = 2, size(list)
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

  subroutine lengthen(share, least)
    type(share_type), intent(inout) :: share
    integer(i4), intent(in) :: least
    integer(i4), allocatable :: longer(:)
    integer(i4) :: n
    n = max(least, 2*size(share%first))
    allocate (longer(n))
    longer(:share%count) = share%first(:share%count)
    call move_alloc(longer, share%first)
    allocate (longer(n))
    longer(:share%count) = share%second(:share%count)
    call move_alloc(longer, share%second)
  end subroutine lengthen
end module dem_cells
