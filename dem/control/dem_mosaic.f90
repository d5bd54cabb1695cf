!> Which grains of several packs stay where they meet: the least volume lost and, at a price,
!! overlapped, by a minimum cut (theory-dem, Conversion). eq. D.98
!!
!! Exact for two packs; of more each is cut against what has stayed of those before it.
module dem_mosaic
  use talus_kinds, only: wp, i4, i8
  use talus_homogenise, only: inverse_of
  use dem_ellipsoid, only: rotation_of
  use dem_network, only: network_type, source, sink
  implicit none
  private
  public :: lying_type, choose_mosaic, depth_of, square_of

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: most_depth = 0.3_wp  !! pairs that are deeper exclude each other
  integer(i4), parameter :: trials = 30       !! of the price
  integer(i4), parameter :: turns = 60        !! of the golden section
  real(wp), parameter :: golden = 0.5_wp*(sqrt(5.0_wp) - 1.0_wp)
  real(wp), parameter :: whole = 2.0_wp**40   !! the largest volume, as a whole number

  !> Grains of several packs, some of which stay in any case.
  type :: lying_type
    integer(i4) :: n = 0
    integer(i8), allocatable :: id(:)
    integer(i4), allocatable :: tile(:)   !! pack of each
    logical, allocatable :: fixed(:)      !! stay in any case
    logical, allocatable :: home(:)       !! of the pack of their place: their volume is kept
    real(wp), allocatable :: x(:, :)      !! (3, n) [m]
    real(wp), allocatable :: quat(:, :)   !! (4, n)
    real(wp), allocatable :: axes(:, :)   !! (3, n) [m]
  end type lying_type

  !> Pairs of grains of different packs that overlap.
  type :: pairs_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: grain(:, :)  !! (2, n); the first of an earlier pack
    real(wp), allocatable :: depth(:)        !! (n) [-]
    real(wp), allocatable :: volume(:)       !! (n) in both [m^3]
  end type pairs_type

contains

  !> Which grains stay; volume in two of them over that of all that are at home.
  pure subroutine choose_mosaic(lying, stay, overlap)
    type(lying_type), intent(in) :: lying
    logical, allocatable, intent(out) :: stay(:)
    real(wp), intent(out) :: overlap
    real(wp) :: volume(lying%n)
    type(pairs_type) :: pairs
    integer(i4) :: t
    volume = 4.0_wp/3.0_wp*pi*product(lying%axes(:, :lying%n), 1)
    call find_pairs(lying, volume, pairs)
    allocate (stay(lying%n), source=.true.)
    overlap = 0.0_wp
    do t = 2, maxval(lying%tile)
      call cut_pack(lying, volume, pairs, t, stay)
    end do
    overlap = sum(pairs%volume(:pairs%n), stay(pairs%grain(1, :pairs%n)) .and. &
                  stay(pairs%grain(2, :pairs%n)))/sum(volume, lying%home)
  end subroutine choose_mosaic

  !> Pairs of which one may go.
  pure subroutine find_pairs(lying, volume, pairs)
    type(lying_type), intent(in) :: lying
    real(wp), intent(in) :: volume(:)
    type(pairs_type), intent(out) :: pairs
    real(wp) :: shape(3, 3, lying%n), radius(lying%n), depth
    integer(i4) :: i, j
    do i = 1, lying%n
      shape(:, :, i) = square_of(lying%axes(:, i), lying%quat(:, i))
      radius(i) = maxval(lying%axes(:, i))
    end do
    allocate (pairs%grain(2, 64), pairs%depth(64), pairs%volume(64))
    do j = 1, lying%n
      do i = 1, j - 1
        if (lying%tile(i) == lying%tile(j) .or. (lying%fixed(i) .and. lying%fixed(j))) cycle
        if (sum((lying%x(:, j) - lying%x(:, i))**2) >= (radius(i) + radius(j))**2) cycle
        depth = depth_of(lying%x(:, j) - lying%x(:, i), shape(:, :, i), shape(:, :, j))
        if (depth <= 0.0_wp) cycle
        if (pairs%n == size(pairs%depth)) call more_room(pairs)
        pairs%n = pairs%n + 1
        pairs%grain(:, pairs%n) = merge([i, j], [j, i], lying%tile(i) < lying%tile(j))
        pairs%depth(pairs%n) = depth
        pairs%volume(pairs%n) = 0.5_wp*(volume(i) + volume(j))*depth**2*(3.0_wp - depth)/2.0_wp
      end do
    end do
  end subroutine find_pairs

  pure subroutine more_room(pairs)
    type(pairs_type), intent(inout) :: pairs
    pairs%grain = reshape([pairs%grain, pairs%grain], [2, 2*size(pairs%depth)])
    pairs%depth = [pairs%depth, pairs%depth]
    pairs%volume = [pairs%volume, pairs%volume]
  end subroutine more_room

  !> Matrix A of an ellipsoid x A^-1 x = 1 [m^2].
  pure function square_of(axes, quat) result(a)
    real(wp), intent(in) :: axes(3), quat(4)
    real(wp) :: a(3, 3), turn(3, 3)
    integer(i4) :: k
    turn = rotation_of(quat)
    do k = 1, 3
      a(:, k) = turn(:, k)*axes(k)**2
    end do
    a = matmul(a, transpose(turn))
  end function square_of

  !> Part by which two ellipsoids must shrink to touch: one less the root of the contact function of
  !! Perram and Wertheim (1985), whose maximum is found by golden section.
  pure real(wp) function depth_of(apart, one, other) result(depth)
    real(wp), intent(in) :: apart(3), one(3, 3), other(3, 3)  !! [m], see square_of
    real(wp) :: low, high, left, right
    integer(i4) :: k
    low = 0.0_wp
    high = 1.0_wp
    do k = 1, turns
      left = high - golden*(high - low)
      right = low + golden*(high - low)
      if (contact_function(left) < contact_function(right)) then
        low = left
      else
        high = right
      end if
    end do
    depth = 1.0_wp - sqrt(contact_function(0.5_wp*(low + high)))

  contains

    pure real(wp) function contact_function(share) result(value)
      real(wp), intent(in) :: share
      value = share*(1.0_wp - share) &
        *dot_product(apart, matmul(inverse_of((1.0_wp - share)*one + share*other), apart))
    end function contact_function
  end function depth_of

  !> Cut pack t against what has stayed of earlier ones, at the price that keeps the volume best: it
  !! is doubled until less is left than is wanted, then halved between.
  pure subroutine cut_pack(lying, volume, pairs, t, stay)
    type(lying_type), intent(in) :: lying
    real(wp), intent(in) :: volume(:)
    type(pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: t
    logical, intent(inout) :: stay(:)
    logical :: found(size(stay)), best(size(stay))
    real(wp) :: wanted, low, high, price
    integer(i4) :: k
    if (.not. any(lying%tile(pairs%grain(2, :pairs%n)) == t)) return
    wanted = sum(volume, lying%home .and. lying%tile <= t)
    low = 0.0_wp
    high = -1.0_wp
    price = 0.0_wp
    do k = 0, trials
      found = stay
      call cut_at(lying, volume, pairs, t, price, found)
      if (k == 0) best = found
      if (abs(error_of(found)) < abs(error_of(best))) best = found
      if (k == 0) then
        price = 1.0_wp
        cycle
      end if
      if (error_of(found) > 0.0_wp) then
        low = price
      else
        high = price
      end if
      price = merge(2.0_wp*price, 0.5_wp*(low + high), high < 0.0_wp)
    end do
    stay = best

  contains

    pure real(wp) function error_of(those)
      logical, intent(in) :: those(:)
      error_of = sum(volume, those .and. .not. lying%fixed .and. lying%tile <= t) &
        + sum(volume, lying%home .and. lying%fixed .and. lying%tile <= t) - wanted
    end function error_of
  end subroutine cut_pack

  !> Source - grain of an earlier pack - grain of pack t - sink.
  pure subroutine cut_at(lying, volume, pairs, t, price, stay)
    type(lying_type), intent(in) :: lying
    real(wp), intent(in) :: volume(:)
    type(pairs_type), intent(in) :: pairs
    integer(i4), intent(in) :: t
    real(wp), intent(in) :: price
    logical, intent(inout) :: stay(:)
    type(network_type) :: network
    logical, allocatable :: side(:)
    logical :: wired(size(stay))
    integer(i8) :: room(size(stay)), endless, cost
    integer(i4) :: k, e
    room = nint(whole/maxval(volume)*volume, i8)
    endless = sum(room) + 1
    where (lying%fixed) room = endless
    call network%begin(size(stay) + 2, pairs%n + size(stay))
    wired = .false.
    do k = 1, pairs%n
      associate (i => pairs%grain(1, k), j => pairs%grain(2, k))
        if (lying%tile(j) /= t .or. .not. stay(i)) cycle
        wired([i, j]) = .true.
        cost = endless
        if (pairs%depth(k) <= most_depth) cost = nint(min(real(endless, wp), &
          whole/maxval(volume)*price*pairs%volume(k)), i8)
        call network%add(i + 2, j + 2, cost)
      end associate
    end do
    do e = 1, size(stay)
      if (.not. wired(e)) cycle
      if (lying%tile(e) == t) then
        call network%add(e + 2, sink, room(e))
      else
        call network%add(source, e + 2, room(e))
      end if
    end do
    call network%cut(side)
    do e = 1, size(stay)
      if (wired(e) .and. .not. lying%fixed(e)) stay(e) = side(e + 2) .neqv. lying%tile(e) == t
    end do
  end subroutine cut_at
end module dem_mosaic
