!> Domains of the ranks: boxes of equal work; the rank whose box holds a point, and those near it.
module dem_domains
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: inverse_of
  use dem_cell, only: is_periodic, reduced_basis
  use dem_halo_state, only: dem_halo_type
  use dem_state, only: dem_cell_type
  implicit none
  private
  public :: cut_domains, rank_at, ranks_near, distance_to_domain
  public :: place_of, follow_cell, turn_to_cell

  integer(i4), parameter :: bins = 2048      !! of a histogram of work along an axis

  !> Columns of places that are cut along an axis.
  type :: columns_type
    integer(i4) :: count = 1                 !! of the columns
    integer(i4) :: parts = 1                 !! of each
    real(wp) :: low = 0.0_wp, high = 1.0_wp  !! lowest and highest place of all
  end type columns_type

contains

  !> Coordinates follow the present faces of the cell.
  subroutine follow_cell(halo, cell)
    type(dem_halo_type), intent(inout) :: halo
    type(dem_cell_type), intent(in) :: cell
    real(wp) :: edges(3, 3)
    integer(i4) :: k
    if (.not. halo%folding) return
    edges = matmul(cell%vectors, real(halo%whole, wp))
    halo%inverse = inverse_of(edges)
    do k = 1, 3
      halo%per_length(k) = norm2(halo%inverse(k, :))
    end do
  end subroutine follow_cell

  !> Coordinates in the present short edges of the lattice; boxes must be chosen again if these
  !! edges have changed.
  subroutine turn_to_cell(halo, cell)
    type(dem_halo_type), intent(inout) :: halo
    type(dem_cell_type), intent(in) :: cell
    real(wp) :: edges(3, 3)
    integer(i4) :: whole(3, 3)
    halo%folding = is_periodic(cell)
    if (.not. halo%folding) return
    halo%wraps = cell%periodic
    halo%origin = cell%origin
    call reduced_basis(cell, edges, whole)
    if (any(whole /= halo%whole)) halo%cut = .false.
    halo%whole = whole
    call follow_cell(halo, cell)
  end subroutine turn_to_cell

  !> Place of a point: itself, or where its image lies between the faces of the cell.
  pure function place_of(halo, x) result(place)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(3)  !! [m]
    real(wp) :: place(3)
    place = x
    if (.not. halo%folding) return
    place = matmul(halo%inverse, x - halo%origin)
    where (halo%wraps) place = place - floor(place)
  end function place_of

  !> Choose new boxes for the grains of all ranks, so that each has the same work.
  subroutine cut_domains(halo, x, work)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(in) :: x(:, :)   !! (3, n) places of this rank's grains
    real(wp), intent(in) :: work(:)   !! (n)
    real(wp) :: low(3), high(3)
    real(wp), allocatable :: cuts(:, :)
    integer(i4), allocatable :: column(:)
    integer(i4) :: k, p(3), boxes

    do k = 1, 3
      low(k) = minval(x(k, :))
      high(k) = maxval(x(k, :))
    end do
    call halo%team%least(low)
    call halo%team%most(high)
    if (any(low > high)) then  ! no free grains at all
      low = 0.0_wp
      high = 1.0_wp
    end if
    high = max(high, low + 1.0e-3_wp*max(maxval(high - low), sqrt(tiny(1.0_wp))))
    boxes = merge(halo%domains, halo%team%ranks, halo%domains > 0)
    if (.not. halo%cut) halo%parts = best_parts(boxes, (high - low)/halo%per_length)
    halo%cut = .true.
    p = halo%parts
    if (allocated(halo%cut_x)) deallocate (halo%cut_x, halo%cut_y, halo%cut_z)
    allocate (halo%cut_x(0:p(1)), halo%cut_y(0:p(2), p(1)), halo%cut_z(0:p(3), p(1), p(2)))
    allocate (column(size(work)), source=1_i4)
    call cut_axis(halo, columns_type(1, p(1), low(1), high(1)), x(1, :), work, column, cuts)
    halo%cut_x = cuts(:, 1)
    do k = 1, size(work)
      column(k) = 1 + part_of(halo%cut_x, x(1, k))
    end do
    call cut_axis(halo, columns_type(p(1), p(2), low(2), high(2)), x(2, :), work, column, cuts)
    halo%cut_y = cuts
    do k = 1, size(work)
      column(k) = column(k) + p(1)*part_of(halo%cut_y(:, column(k)), x(2, k))
    end do
    call cut_axis(halo, columns_type(p(1)*p(2), p(3), low(3), high(3)), x(3, :), work, column, cuts)
    halo%cut_z = reshape(cuts, [p(3) + 1, p(1), p(2)])
  end subroutine cut_domains

  !> Slabs, bars and boxes whose common faces are least in all.
  pure function best_parts(ranks, edge) result(best)
    integer(i4), intent(in) :: ranks
    real(wp), intent(in) :: edge(3)  !! of the box around all grains [m]
    integer(i4) :: best(3), px, py, p(3)
    real(wp) :: area, least
    least = huge(1.0_wp)
    best = [ranks, 1_i4, 1_i4]
    do px = 1, ranks
      if (modulo(ranks, px) /= 0) cycle
      do py = 1, ranks/px
        if (modulo(ranks/px, py) /= 0) cycle
        p = [px, py, ranks/px/py]
        area = (p(1) - 1)*edge(2)*edge(3) + (p(2) - 1)*edge(1)*edge(3) + (p(3) - 1)*edge(1)*edge(2)
        if (area >= least) cycle
        least = area
        best = p
      end do
    end do
  end function best_parts

  !> Cut each column along an axis into parts of equal work: a histogram of all ranks, linear
  !! inside its bins.
  subroutine cut_axis(halo, columns, x, work, column, cuts)
    type(dem_halo_type), intent(in) :: halo
    type(columns_type), intent(in) :: columns
    real(wp), intent(in) :: x(:), work(:)             !! (n) places along the axis
    integer(i4), intent(in) :: column(:)              !! (n)
    real(wp), allocatable, intent(out) :: cuts(:, :)  !! (0:parts, columns)
    real(wp), allocatable :: load(:)
    real(wp) :: size_of_bin
    integer(i4) :: k, c, b, at

    allocate (cuts(0:columns%parts, columns%count))
    cuts(0, :) = -huge(1.0_wp)
    cuts(columns%parts, :) = huge(1.0_wp)
    if (columns%parts == 1) return
    allocate (load(bins*columns%count), source=0.0_wp)
    size_of_bin = (columns%high - columns%low)/bins
    do k = 1, size(work)
      b = min(max(int((x(k) - columns%low)/size_of_bin, i4), 0), bins - 1)
      at = 1 + b + bins*(column(k) - 1)
      load(at) = load(at) + work(k)
    end do
    call halo%team%add_up(load)
    do c = 1, columns%count
      associate (bar => load(bins*(c - 1) + 1:bins*c))
        if (.not. maxval(bar) > 0.0_wp) bar = 1.0_wp
        call cut_column(bar, columns%low, size_of_bin, cuts(1:columns%parts - 1, c))
      end associate
    end do
  end subroutine cut_axis

  !> Ends of the parts of a column that share its work evenly, but the last one's.
  pure subroutine cut_column(bar, low, size_of_bin, cut)
    real(wp), intent(in) :: bar(:)            !! work in each bin
    real(wp), intent(in) :: low, size_of_bin  !! start of the first bin, and size of all
    real(wp), intent(out) :: cut(:)
    real(wp) :: before, wanted
    integer(i4) :: k, b

    b = 1
    before = 0.0_wp
    do k = 1, size(cut)
      wanted = sum(bar)*k/(size(cut) + 1)
      do while (before + bar(b) < wanted .and. b < size(bar))
        before = before + bar(b)
        b = b + 1
      end do
      cut(k) = low + size_of_bin*(b - 1 + (wanted - before)/max(bar(b), tiny(1.0_wp)))
    end do
  end subroutine cut_column

  !> Part, from 0, that holds a place.
  pure integer(i4) function part_of(cuts, x) result(part)
    real(wp), intent(in) :: cuts(0:), x
    integer(i4) :: high, middle
    part = 0
    high = size(cuts) - 1
    do while (high - part > 1)
      middle = (part + high)/2
      if (x >= cuts(middle)) then
        part = middle
      else
        high = middle
      end if
    end do
  end function part_of

  !> Rank in whose box a place is.
  pure integer(i4) function rank_at(halo, x)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(3)
    integer(i4) :: i, j, k
    i = part_of(halo%cut_x, x(1))
    j = part_of(halo%cut_y(:, i + 1), x(2))
    k = part_of(halo%cut_z(:, i + 1, j + 1), x(3))
    rank_at = i + halo%parts(1)*(j + halo%parts(2)*k)
  end function rank_at

  !> Ranks whose boxes a cube about a place meets, over the faces of the cell too; that of the
  !! place itself is among them.
  pure subroutine ranks_near(halo, x, reach, list, count)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(3), reach     !! half the edge of the cube [m]
    integer(i4), intent(inout) :: list(0:)  !! (ranks)
    integer(i4), intent(out) :: count
    real(wp) :: low(3), high(3)
    integer(i4) :: n, m(3)

    count = 0
    low = x - reach*halo%per_length
    high = x + reach*halo%per_length
    if (.not. halo%folding) then
      call add_ranks(halo, low, high, list, count)
      return
    end if
    do n = 0, 26
      m = [mod(n + 1, 3), mod(n/3 + 1, 3), mod(n/9 + 1, 3)] - 1
      if (any(m /= 0 .and. .not. halo%wraps)) cycle
      if (any(halo%wraps .and. (high + m < 0.0_wp .or. low + m >= 1.0_wp))) cycle
      call add_ranks(halo, low + m, high + m, list, count)
    end do
  end subroutine ranks_near

  !> Ranks whose boxes meet a box of places, each once.
  pure subroutine add_ranks(halo, low, high, list, count)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: low(3), high(3)
    integer(i4), intent(inout) :: list(0:), count
    integer(i4) :: i, j, k, rank
    do i = part_of(halo%cut_x, low(1)), part_of(halo%cut_x, high(1))
      do j = part_of(halo%cut_y(:, i + 1), low(2)), part_of(halo%cut_y(:, i + 1), high(2))
        do k = part_of(halo%cut_z(:, i + 1, j + 1), low(3)), &
               part_of(halo%cut_z(:, i + 1, j + 1), high(3))
          rank = i + halo%parts(1)*(j + halo%parts(2)*k)
          if (any(list(0:count - 1) == rank)) cycle
          list(count) = rank
          count = count + 1
        end do
      end do
    end do
  end subroutine add_ranks

  !> How far a place is from the box of a rank, along the axis on which it is farthest [m].
  pure real(wp) function distance_to_domain(halo, rank, x) result(distance)
    type(dem_halo_type), intent(in) :: halo
    integer(i4), intent(in) :: rank
    real(wp), intent(in) :: x(3)
    real(wp) :: low(3), high(3), way(3)
    integer(i4) :: i, j, k
    i = modulo(rank, halo%parts(1))
    j = modulo(rank/halo%parts(1), halo%parts(2))
    k = rank/(halo%parts(1)*halo%parts(2))
    low = [halo%cut_x(i), halo%cut_y(j, i + 1), halo%cut_z(k, i + 1, j + 1)]
    high = [halo%cut_x(i + 1), halo%cut_y(j + 1, i + 1), halo%cut_z(k + 1, i + 1, j + 1)]
    way = max(low - x, x - high, 0.0_wp)
    if (halo%folding) then
      where (halo%wraps)
        low = max(low, 0.0_wp)
        high = min(high, 1.0_wp)
        way = min(way, max(low - (x + 1.0_wp), x + 1.0_wp - high, 0.0_wp), &
                  max(low - (x - 1.0_wp), x - 1.0_wp - high, 0.0_wp))
      end where
    end if
    distance = maxval(way/halo%per_length)
  end function distance_to_domain
end module dem_domains
