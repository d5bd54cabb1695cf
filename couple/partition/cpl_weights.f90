!> Weights of contacts and quadrature points before any fit (theory: "Energy partition").
!!
!! With s the distance from the free region and T the depth of the ghosts' layer,
!! omega = clip((T - s)/(T - d_max), 0, 1): contacts between ghosts have rho times the mean of omega
!! along their branch, points of the ghosts' elements 1 - omega; what touches a free grain has 1.
module cpl_weights
  use talus_kinds, only: wp, i4
  use cpl_partition, only: partition_type, grain_free, region_free, region_ghost, ghost_ghost, &
    uniform_states
  implicit none
  private
  public :: omega, omega_mean, ramp_weights, twice_weights, share_weights, kernel_shares, &
    pack_is_disordered, moment_balance

contains

  !> Share of the grains at distance s [-].
  pure elemental real(wp) function omega(s, depth, d_max)
    real(wp), intent(in) :: s      !! from the free region [m]
    real(wp), intent(in) :: depth  !! of the ghosts' layer [m]
    real(wp), intent(in) :: d_max  !! largest diameter [m]
    omega = min(1.0_wp, max(0.0_wp, (depth - s)/(depth - d_max)))
  end function omega

  !> Mean of omega along a branch on which s runs linearly from s1 to s2 [-].
  pure elemental real(wp) function omega_mean(s1, s2, depth, d_max)
    real(wp), intent(in) :: s1, s2, depth, d_max  !! [m]
    real(wp), parameter :: level = 1.0e-6_wp
    if (abs(s2 - s1) <= level*depth) then
      omega_mean = omega(0.5_wp*(s1 + s2), depth, d_max)
    else
      omega_mean = (area(s2) - area(s1))/(s2 - s1)
    end if

  contains

    !> Integral of omega from 0 to s.
    pure real(wp) function area(s)
      real(wp), intent(in) :: s
      real(wp) :: t
      t = min(max(s, d_max), depth)
      area = min(s, d_max) + 0.5_wp*((depth - d_max)**2 - (depth - t)**2)/(depth - d_max)
    end function area
  end function omega_mean

  !> Ramps of both. rho: relaxed over affine stiffness of the pack (1 for a lattice) [-].
  pure subroutine ramp_weights(self, depth, d_max, rho, w, beta)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: depth, d_max             !! [m]
    real(wp), intent(in) :: rho                      !! [-]
    real(wp), allocatable, intent(out) :: w(:)       !! (contacts) [-]
    real(wp), allocatable, intent(out) :: beta(:)    !! (points) [-]
    integer(i4) :: c, q

    call twice_weights(self, w, beta)
    do c = 1, size(w)
      if (ghost_ghost(self, c)) w(c) = rho*omega_mean(self%depth(self%pair(1, c)), &
                                                      self%depth(self%pair(2, c)), depth, d_max)
    end do
    do q = 1, size(beta)
      if (self%region(self%element(q)) == region_ghost) &
        beta(q) = 1.0_wp - omega(self%point_depth(q), depth, d_max)
    end do
  end subroutine ramp_weights

  !> Everything counts, in the ghosts' elements twice; elements of free grains do not.
  pure subroutine twice_weights(self, w, beta)
    type(partition_type), intent(in) :: self
    real(wp), allocatable, intent(out) :: w(:), beta(:)
    allocate (w(size(self%pair, 2)), source=1.0_wp)
    beta = merge(0.0_wp, 1.0_wp, self%region(self%element) == region_free)
  end subroutine twice_weights

  !> Contacts between ghosts are skipped, points have 1 - the share of the stiffness that the other
  !! contacts hold; shares are given for each point (kernel_shares, or a volume's own).
  pure subroutine share_weights(self, share, w, beta)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: share(:)  !! (points) [-]
    real(wp), allocatable, intent(out) :: w(:), beta(:)
    integer(i4) :: c
    call twice_weights(self, w, beta)
    do c = 1, size(w)
      if (ghost_ghost(self, c)) w(c) = 0.0_wp
    end do
    where (self%region(self%element) == region_ghost) &
      beta = min(1.0_wp, max(0.0_wp, 1.0_wp - share))
  end subroutine share_weights

  !> Share of the coarse-grained stiffness at points that belongs to contacts with a free grain:
  !! sums of (k_n + 2 k_s) l^2 along the branches, smeared by Lucy's function of the given radius.
  pure subroutine kernel_shares(self, x, middle, period, radius, share)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: x(:, :)       !! (3, points) [m]
    real(wp), intent(in) :: middle(:, :)  !! (3, contacts) middles of the branches [m]
    real(wp), intent(in) :: period(3)     !! of the arrangement, 0: none [m]
    real(wp), intent(in) :: radius        !! [m]
    real(wp), allocatable, intent(out) :: share(:)  !! (points) [-]
    real(wp) :: branch(3, size(middle, 2)), reach(size(middle, 2)), wide, low
    integer(i4) :: order(size(middle, 2)), q, c, axis, bin
    integer(i4), allocatable :: start(:)

    do c = 1, size(reach)
      branch(:, c) = self%branch(c)
      reach(c) = radius + norm2(branch(:, c))
    end do
    allocate (share(size(x, 2)), source=0.0_wp)
    if (size(reach) == 0) return
    axis = maxloc(merge(0.0_wp, maxval(middle, 2) - minval(middle, 2), period > 0.0_wp), 1)
    low = minval(middle(axis, :))
    wide = maxval(reach)
    if (period(axis) > 0.0_wp) wide = huge(wide)
    call sort_by_slice(1 + int((middle(axis, :) - low)/wide, i4), order, start)
    do q = 1, size(x, 2)
      if (self%region(self%element(q)) /= region_ghost) cycle
      bin = 1 + floor(max(min((x(axis, q) - low)/wide, real(size(start), wp)), -2.0_wp), i4)
      associate (near => order(start(max(1, min(bin - 1, size(start)))): &
                               start(max(1, min(bin + 2, size(start)))) - 1))
        share(q) = share_at(x(:, q), near)
      end associate
    end do

  contains

    !> The share at one point, of contacts that may be near.
    pure real(wp) function share_at(at_point, near) result(found)
      real(wp), intent(in) :: at_point(3)
      integer(i4), intent(in) :: near(:)
      integer(i4), parameter :: pieces = 4
      real(wp) :: part, sums(2), at(3), d(3), t
      integer(i4) :: i, n, k

      sums = 0.0_wp
      do i = 1, size(near)
        n = near(i)
        d = shortest(middle(:, n) - at_point, period)
        if (d(1)*d(1) + d(2)*d(2) + d(3)*d(3) > reach(n)*reach(n)) cycle
        do k = 1, pieces
          at = d + (real(2*k - 1, wp)/(2*pieces) - 0.5_wp)*branch(:, n)
          t = norm2(at)/radius
          if (t >= 1.0_wp) cycle
          part = (1.0_wp + 3.0_wp*t)*(1.0_wp - t)**3*sum(branch(:, n)**2) &
                 *(self%stiffness(1, n) + 2.0_wp*self%stiffness(2, n))
          sums(2) = sums(2) + part
          if (any(self%kind(self%pair(:, n)) == grain_free)) sums(1) = sums(1) + part
        end do
      end do
      found = 0.0_wp
      if (sums(2) > 0.0_wp) found = sums(1)/sums(2)
    end function share_at
  end subroutine kernel_shares

  !> Numbers in the order of their slices, and where each slice begins (one past the last, too).
  pure subroutine sort_by_slice(slice, order, start)
    integer(i4), intent(in) :: slice(:)  !! from 1
    integer(i4), intent(out) :: order(:)
    integer(i4), allocatable, intent(out) :: start(:)
    integer(i4), allocatable :: fill(:)
    integer(i4) :: c
    allocate (start(maxval(slice) + 1), source=0_i4)
    do c = 1, size(slice)
      start(slice(c) + 1) = start(slice(c) + 1) + 1
    end do
    start(1) = 1
    do c = 2, size(start)
      start(c) = start(c) + start(c - 1)
    end do
    fill = start
    do c = 1, size(slice)
      order(fill(slice(c))) = c
      fill(slice(c)) = fill(slice(c)) + 1
    end do
  end subroutine sort_by_slice

  !> Shortest of the periodic images of a vector.
  pure function shortest(d, period) result(e)
    real(wp), intent(in) :: d(3), period(3)
    real(wp) :: e(3)
    e = d
    where (period > 0.0_wp) e = d - period*anint(d/max(period, tiny(1.0_wp)))
  end function shortest

  !> Do most of the free grains that have the most contacts carry forces that do not balance when
  !! the pack is strained uniformly? In a lattice none does, away from its surface. Also the median
  !! over these grains of that force over the mean contact force [-].
  pure subroutine pack_is_disordered(self, disordered, median)
    type(partition_type), intent(in) :: self
    logical, intent(out) :: disordered
    real(wp), intent(out) :: median
    real(wp), parameter :: balanced = 1.0e-6_wp
    real(wp), allocatable :: force(:, :, :), stress(:, :, :), total(:, :, :), size_of(:)
    real(wp) :: mean
    integer(i4), allocatable :: contacts(:)
    integer(i4) :: c, g, n, most

    call uniform_states(self, force, stress)
    allocate (total(3, size(force, 2), size(self%kind)), source=0.0_wp)
    allocate (contacts(size(self%kind)), source=0_i4)
    mean = 0.0_wp
    do c = 1, size(force, 3)
      associate (one => self%pair(1, c), two => self%pair(2, c))
        total(:, :, one) = total(:, :, one) + force(:, :, c)
        total(:, :, two) = total(:, :, two) - force(:, :, c)
        contacts([one, two]) = contacts([one, two]) + 1
      end associate
      mean = mean + maxval(norm2(force(:, :, c), 1))/size(force, 3)
    end do
    allocate (size_of(size(self%kind)))
    n = 0
    most = maxval(contacts, mask=self%kind == grain_free)
    do g = 1, size(self%kind)
      if (self%kind(g) /= grain_free .or. contacts(g) < most) cycle
      n = n + 1
      size_of(n) = maxval(norm2(total(:, :, g), 1))/max(mean, tiny(1.0_wp))
    end do
    median = middle_of(size_of(:n))
    disordered = median > balanced
  end subroutine pack_is_disordered

  !> Median, by counting; 0 of nothing.
  pure real(wp) function middle_of(values)
    real(wp), intent(in) :: values(:)
    real(wp) :: low, high
    integer(i4) :: k
    integer(i4), parameter :: halvings = 60
    middle_of = 0.0_wp
    if (size(values) == 0) return
    low = 0.0_wp
    high = maxval(values)
    if (2*count(values <= 0.0_wp) > size(values)) return
    do k = 1, halvings
      middle_of = 0.5_wp*(low + high)
      if (2*count(values <= middle_of) > size(values)) then
        high = middle_of
      else
        low = middle_of
      end if
    end do
  end function middle_of

  !> Nine components of sum w l f + sum beta V sigma - sum V sigma over the largest of the last, in
  !! all states; `inside` is the part of each branch in the meshed region [-].
  pure function moment_balance(self, w, beta, inside) result(balance)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: w(:), beta(:), inside(:)
    real(wp) :: balance(9, 6)
    real(wp), allocatable :: force(:, :, :), stress(:, :, :)
    real(wp) :: whole(9, 6), l(3)
    integer(i4) :: c, q, s, k

    call uniform_states(self, force, stress)
    balance = 0.0_wp
    whole = 0.0_wp
    do c = 1, size(w)
      l = w(c)*inside(c)*self%branch(c)
      do s = 1, 6
        do k = 1, 3
          balance(3*k - 2:3*k, s) = balance(3*k - 2:3*k, s) + l(k)*force(:, s, c)
        end do
      end do
    end do
    do q = 1, size(beta)
      associate (sigma => self%volume(q)*stress(:, :, self%element(q)))
        balance = balance + (beta(q) - 1.0_wp)*sigma
        whole = whole + sigma
      end associate
    end do
    balance = balance/max(maxval(abs(whole)), tiny(1.0_wp))
  end function moment_balance
end module cpl_weights
