!> Domains of the ranks: boxes of equal work, whose box a point is in, whose boxes are near it.
module dem_domains
  use talus_kinds, only: wp, i4
  use dem_halo_state, only: dem_halo_type
  implicit none
  private
  public :: cut_domains, rank_at, ranks_near, distance_to_domain

  integer(i4), parameter :: bins = 2048      !! of a histogram of work along an axis

contains

  !> Choose the boxes anew for the grains of all ranks, so that each has the same work.
  subroutine cut_domains(halo, x, work)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(in) :: x(:, :)   !! (3, n) centres of this rank's grains [m]
    real(wp), intent(in) :: work(:)   !! (n)
    real(wp) :: low(3), high(3)
    real(wp), allocatable :: cuts(:, :)
    integer(i4), allocatable :: column(:)
    integer(i4) :: k, p(3)

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
    if (.not. halo%cut) halo%parts = best_parts(halo%team%ranks, high - low)
    halo%cut = .true.
    p = halo%parts
    if (allocated(halo%cut_x)) deallocate (halo%cut_x, halo%cut_y, halo%cut_z)
    allocate (halo%cut_x(0:p(1)), halo%cut_y(0:p(2), p(1)), halo%cut_z(0:p(3), p(1), p(2)))
    allocate (column(size(work)), source=1_i4)
    call cut_axis(halo, x(1, :), work, low(1), high(1), p(1), 1_i4, column, cuts)
    halo%cut_x = cuts(:, 1)
    do k = 1, size(work)
      column(k) = 1 + part_of(halo%cut_x, x(1, k))
    end do
    call cut_axis(halo, x(2, :), work, low(2), high(2), p(2), p(1), column, cuts)
    halo%cut_y = cuts
    do k = 1, size(work)
      column(k) = column(k) + p(1)*part_of(halo%cut_y(:, column(k)), x(2, k))
    end do
    call cut_axis(halo, x(3, :), work, low(3), high(3), p(3), p(1)*p(2), column, cuts)
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
  subroutine cut_axis(halo, x, work, low, high, parts, columns, column, cuts)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(:), work(:), low, high
    integer(i4), intent(in) :: parts, columns, column(:)
    real(wp), allocatable, intent(out) :: cuts(:, :)  !! (0:parts, columns)
    real(wp), allocatable :: load(:)
    real(wp) :: size_of_bin, sum, wanted
    integer(i4) :: k, c, b, at

    allocate (cuts(0:parts, columns))
    cuts(0, :) = -huge(1.0_wp)
    cuts(parts, :) = huge(1.0_wp)
    if (parts == 1) return
    allocate (load(bins*columns), source=0.0_wp)
    size_of_bin = (high - low)/bins
    do k = 1, size(work)
      b = min(max(int((x(k) - low)/size_of_bin, i4), 0), bins - 1)
      at = 1 + b + bins*(column(k) - 1)
      load(at) = load(at) + work(k)
    end do
    call halo%team%add_up(load)
    do c = 1, columns
      associate (bar => load(bins*(c - 1) + 1:bins*c))
        if (.not. maxval(bar) > 0.0_wp) bar = 1.0_wp
        b = 1
        sum = 0.0_wp
        do k = 1, parts - 1
          wanted = total(bar)*k/parts
          do while (sum + bar(b) < wanted .and. b < bins)
            sum = sum + bar(b)
            b = b + 1
          end do
          cuts(k, c) = low + size_of_bin*(b - 1 + (wanted - sum)/max(bar(b), tiny(1.0_wp)))
        end do
      end associate
    end do
  end subroutine cut_axis

  pure real(wp) function total(list)
    real(wp), intent(in) :: list(:)
    total = sum(list)
  end function total

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

  !> Rank in whose box a point is.
  pure integer(i4) function rank_at(halo, x)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(3)
    integer(i4) :: i, j, k
    i = part_of(halo%cut_x, x(1))
    j = part_of(halo%cut_y(:, i + 1), x(2))
    k = part_of(halo%cut_z(:, i + 1, j + 1), x(3))
    rank_at = i + halo%parts(1)*(j + halo%parts(2)*k)
  end function rank_at

  !> Ranks whose boxes a cube about a point meets, that of the point among them.
  pure subroutine ranks_near(halo, x, reach, list, count)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: x(3), reach     !! half the edge of the cube [m]
    integer(i4), intent(inout) :: list(0:)  !! (ranks)
    integer(i4), intent(out) :: count
    integer(i4) :: i, j, k
    count = 0
    do i = part_of(halo%cut_x, x(1) - reach), part_of(halo%cut_x, x(1) + reach)
      do j = part_of(halo%cut_y(:, i + 1), x(2) - reach), &
             part_of(halo%cut_y(:, i + 1), x(2) + reach)
        do k = part_of(halo%cut_z(:, i + 1, j + 1), x(3) - reach), &
               part_of(halo%cut_z(:, i + 1, j + 1), x(3) + reach)
          list(count) = i + halo%parts(1)*(j + halo%parts(2)*k)
          count = count + 1
        end do
      end do
    end do
  end subroutine ranks_near

  !> How far a point is from the box of a rank, along the axis on which it is farthest [m].
  pure real(wp) function distance_to_domain(halo, rank, x) result(distance)
    type(dem_halo_type), intent(in) :: halo
    integer(i4), intent(in) :: rank
    real(wp), intent(in) :: x(3)
    integer(i4) :: i, j, k
    i = modulo(rank, halo%parts(1))
    j = modulo(rank/halo%parts(1), halo%parts(2))
    k = rank/(halo%parts(1)*halo%parts(2))
    distance = max(halo%cut_x(i) - x(1), x(1) - halo%cut_x(i + 1), &
                   halo%cut_y(j, i + 1) - x(2), x(2) - halo%cut_y(j + 1, i + 1), &
                   halo%cut_z(k, i + 1, j + 1) - x(3), x(3) - halo%cut_z(k + 1, i + 1, j + 1), &
                   0.0_wp)
  end function distance_to_domain
end module dem_domains
