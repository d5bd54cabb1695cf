!> How far each grain may go until the list of pairs is used up: half the skin, and more where a few
!! grains are much faster than all others, such as loose ones on a bed that is worked, or were so
!! lately: these are struck again. So the list lasts longer, with a skin that the others can do
!! with.
!!
!! Travels and gaps are measured in a grain's own margin. With ease = half the skin over the margin
!! (1 for most) a grain that went t has used up t*ease of half the skin, and a pair that was g apart
!! cannot meet before this comes to half of g*skin/(margin of the first + margin of the second).
module dem_margin
  use talus_kinds, only: wp, i4, i8
  use dem_cell, only: is_periodic
  use dem_state, only: dem_data_type, dem_pairs_type, kind_free
  implicit none
  private
  public :: set_margins, spare_margins, pair_skin, chosen_spare

  integer(i8), parameter :: short_life = 200   !! steps of a list that calls for more margin
  integer(i8), parameter :: long_life = 1000   !! and of one that has no need of it any more
  real(wp), parameter :: fast_share = 0.03_wp  !! of the free grains that are fast
  real(wp), parameter :: memory = 0.85_wp      !! part of a margin that is kept without need
  real(wp), parameter :: least_spare = 1.0e-3_wp  !! of half the skin; less is nothing
  integer(i4), parameter :: most_wide = 32     !! grains that may have much more
  real(wp), parameter :: wide_spare = 1.0_wp   !! what these may have at most, in mean radii
  real(wp), parameter :: some_spare = 0.1_wp   !! and the others

contains

  !> Margins of the next list, from the speeds of now and the margins before. Grains of other ranks,
  !! images and surfaces rely on the skin alone, and a skin that the deck gives is not changed.
  subroutine set_margins(d)
    type(dem_data_type), intent(inout) :: d
    real(wp), allocatable :: speed(:)
    real(wp) :: before(d%grains%n), limit, top, radius, half, spare
    integer(i8) :: life
    integer(i4) :: i, free
    logical :: eased

    before = spare_margins(d%pairs, d%grains%n)
    eased = any(before > 0.0_wp)
    d%pairs%ease = 1.0_wp
    if (is_periodic(d%cell) .or. d%cell%active .or. d%halo%team%several() .or. &
        d%surfaces%n > 0 .or. d%par%skin > 0.0_wp .or. d%clumps%n > 0) return
    life = d%health%steps - d%pairs%built_at
    if (life > merge(long_life, short_life, eased)) return
    call find_speeds(d, speed, free, radius)
    limit = speed_of_fastest(speed, int(fast_share*free, i4))
    if (.not. limit > 0.0_wp) return
    top = speed_of_fastest(speed, most_wide)
    half = 0.5_wp*d%pairs%skin
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      spare = max(half*(speed(i)/limit - 1.0_wp), memory*before(i))
      spare = min(spare, radius*merge(wide_spare, some_spare, speed(i) > top))
      if (d%parts%active) spare = min(spare, allowed(d, i))
      if (spare > least_spare*half) d%pairs%ease(i) = half/(half + spare)
    end do
  end subroutine set_margins

  !> How fast surfaces of free grains move, 0 of the others [m/s]; mean radius of the free [m].
  pure subroutine find_speeds(d, speed, free, radius)
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable, intent(out) :: speed(:)
    integer(i4), intent(out) :: free
    real(wp), intent(out) :: radius
    integer(i4) :: i
    allocate (speed(d%grains%n), source=0.0_wp)
    free = 0
    radius = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      free = free + 1
      radius = radius + d%grains%radius(i)
      speed(i) = norm2(d%grains%v(:, i)) + d%pairs%reach(i)*norm2(d%grains%omega(:, i))
    end do
    radius = radius/max(free, 1_i4)
  end subroutine find_speeds

  !> A speed that at most `number` grains exceed, and little less would not do [m/s].
  pure real(wp) function speed_of_fastest(speed, number) result(high)
    real(wp), intent(in) :: speed(:)
    integer(i4), intent(in) :: number
    integer(i4), parameter :: halvings = 30
    real(wp) :: low, middle
    integer(i4) :: k
    low = 0.0_wp
    high = maxval(speed, mask=speed <= huge(1.0_wp))
    do k = 1, halvings
      middle = 0.5_wp*(low + high)
      if (count(speed > middle) > number) then
        low = middle
      else
        high = middle
      end if
    end do
  end function speed_of_fastest

  !> What the margin of a grain may have over half the skin so that only ghosts that are known to be
  !! near free grains come into its list [m].
  pure real(wp) function allowed(d, i)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    allowed = 0.0_wp
    if (allocated(d%parts%spare)) allowed = d%parts%spare(i)
  end function allowed

  !> What the next list may give each grain over half the skin: much to those that have something
  !! now [m].
  pure function chosen_spare(d) result(spare)
    type(dem_data_type), intent(in) :: d
    real(wp) :: spare(d%grains%n), radius
    real(wp), allocatable :: speed(:)
    integer(i4) :: free
    call find_speeds(d, speed, free, radius)
    spare = radius*merge(wide_spare, some_spare, d%pairs%ease(:d%grains%n) < 1.0_wp)
    where (d%grains%kind /= kind_free) spare = 0.0_wp
  end function chosen_spare

  !> Margins of n grains over half the skin [m].
  pure function spare_margins(pairs, n) result(spare)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: n
    real(wp) :: spare(n)
    spare = 0.5_wp*pairs%skin*(1.0_wp/pairs%ease(:n) - 1.0_wp)
  end function spare_margins

  !> Sum of the margins of two bodies: pairs with a gap below it are listed [m].
  pure real(wp) function pair_skin(pairs, i, j)
    type(dem_pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: i, j
    pair_skin = pairs%skin
    if (pairs%ease(i) < 1.0_wp .or. pairs%ease(j) < 1.0_wp) &
      pair_skin = 0.5_wp*pairs%skin*(1.0_wp/pairs%ease(i) + 1.0_wp/pairs%ease(j))
  end function pair_skin
end module dem_margin
