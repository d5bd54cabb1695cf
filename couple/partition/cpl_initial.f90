!> Initial stress in balance with the contact forces of the pack (theory: "Initial state").
!!
!! The rows of the actual contact forces and of the initial stress leave a rest n_0. The stress, not
!! the weights, takes it: sigma_0 += M' (M M')^-1 (-n_0), the least change, with M the rows of unit
!! stresses at the points that may change. M M' is solved by conjugate gradients with its diagonal;
!! couple stress is measured by stress times the mean arm of the contacts.
module cpl_initial
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_partition, only: partition_type, residual_rows, add_point, mean_sizes
  implicit none
  private
  public :: initial_type, initial_state_type, correct_initial, initial_rest, balanced

  real(wp), parameter :: balanced = 1.0e-10_wp  !! largest rest that is let pass [-]
  real(wp), parameter :: goal = 1.0e-14_wp
  real(wp), parameter :: spoilt = 1.0e4_wp  !! growth at which rounds end: the rows do not agree
  integer(i4), parameter :: restarts = 4_i4

  !> What the correction did.
  type :: initial_type
    real(wp) :: before = 0.0_wp, after = 0.0_wp  !! largest row over the mean force (and arm) [-]
    real(wp) :: change = 0.0_wp                  !! largest |d sigma| over the pressure [-]
    integer(i4) :: element = 0                   !! where it is
    integer(i4) :: rounds = 0                    !! of conjugate gradients
  end type initial_type

  !> Weights, forces and stresses of a partition at the start.
  type :: initial_state_type
    real(wp), allocatable :: w(:), beta(:)   !! (contacts), (points)
    real(wp), allocatable :: force(:, :)     !! (3, contacts) on the first grain [N]
    real(wp), allocatable :: stress(:, :)    !! (9, points) [Pa]
    real(wp), allocatable :: couple(:, :)    !! (9, points) [N/m]
    real(wp), allocatable :: load(:, :)      !! (3, blocks) from outside, such as weight [N], [N m]
  end type initial_state_type

  !> Rows that count, and what scales them.
  type :: rows_type
    real(wp), allocatable :: scale(:, :, :)  !! (3, 1, blocks) 0: the row does not count
    logical, allocatable :: picked(:)        !! (points) may change
    real(wp), allocatable :: factor(:)       !! (points) beta V [m^3]
    integer(i4) :: components = 0            !! unknowns of a point: 6, or 18 in a polar body
    real(wp) :: arm = 0.0_wp                 !! [m]
  end type rows_type

contains

  !> Rest of the rows: contact forces, initial stress and couple stress, less loads from outside.
  pure subroutine initial_rest(self, state, row)
    type(partition_type), intent(in) :: self
    type(initial_state_type), intent(in) :: state
    real(wp), allocatable, intent(out) :: row(:, :, :)  !! (3, 1, blocks)
    real(wp), allocatable :: none(:, :, :)
    integer(i4) :: q

    allocate (none(9, 1, size(self%region)), source=0.0_wp)
    call residual_rows(self, state%w, state%beta(:0), &
                       reshape(state%force, [3, 1, size(state%force, 2)]), none, row)
    do q = 1, size(state%beta)
      if (.not. state%beta(q) > 0.0_wp) cycle
      call add_point(self, q, state%beta(q)*self%volume(q), state%stress(:, q:q), row, &
                     state%couple(:, q:q))
    end do
    row(:, 1, :) = row(:, 1, :) - state%load
  end subroutine initial_rest

  !> Bring the rest of the rows that are free to zero by changing stress and couple stress of the
  !! points of chosen elements. N442 when a rest above 1e-10 of the mean contact force stays.
  subroutine correct_initial(self, state, free, chosen, report, errors)
    type(partition_type), intent(in) :: self
    type(initial_state_type), intent(inout) :: state
    logical, intent(in) :: free(:, :)   !! (3, blocks) no support holds it
    logical, intent(in) :: chosen(:)    !! (elements)
    type(initial_type), intent(out) :: report
    type(error_list_type), intent(inout) :: errors
    type(rows_type) :: rows
    real(wp), allocatable :: rest(:, :, :), old(:, :), y(:, :, :)
    integer(i4) :: k

    call make_rows(self, state%beta, state%force, free, chosen, rows)
    allocate (old, source=state%stress)
    do k = 0, restarts
      call initial_rest(self, state, rest)
      rest = rest*rows%scale
      report%after = maxval(abs(rest))
      if (k == 0) report%before = report%after
      if (report%after <= goal .or. k == restarts) exit
      call solve(self, rows, rest, y, report%rounds)
      call change(self, rows, y, state%stress, state%couple)
    end do
    call largest_change(self, state%stress - old, state%stress, report)
    if (report%after > balanced) &
      call errors%add('N442', 'the initial stress leaves '//str(report%after)//' of a mean '// &
                      'contact force at the nodes under ghosts', 'initial state', &
                      'contacts of ghosts and stress of the elements beyond do not carry the '// &
                      'same load: homogenise over more grains, or let more elements change')
  end subroutine correct_initial

  !> Scales of the rows that points which may change reach.
  subroutine make_rows(self, beta, force, free, chosen, rows)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: beta(:), force(:, :)
    logical, intent(in) :: free(:, :), chosen(:)
    type(rows_type), intent(inout) :: rows
    real(wp) :: mean_force(1)
    integer(i4) :: q, a, b

    call mean_sizes(self, reshape(force, [3, 1, size(force, 2)]), mean_force, rows%arm)
    rows%components = merge(18, 6, self%polar)
    rows%factor = beta*self%volume
    rows%picked = chosen(self%element) .and. beta > 0.0_wp
    allocate (rows%scale(3, 1, self%blocks()), source=0.0_wp)
    if (.not. mean_force(1) > 0.0_wp) return
    do q = 1, size(beta)
      if (.not. rows%picked(q)) cycle
      do a = 1, size(self%node_u, 1)
        b = self%node_u(a, self%element(q))
        if (b > 0) rows%scale(:, 1, b) = merge(1.0_wp, 0.0_wp, free(:, b))/mean_force(1)
      end do
      if (.not. self%polar) cycle
      do a = 1, size(self%node_phi, 1)
        b = self%node_phi(a, self%element(q)) + self%nodes
        if (b > self%nodes) rows%scale(:, 1, b) = merge(1.0_wp, 0.0_wp, free(:, b)) &
          /(mean_force(1)*rows%arm)
      end do
    end do
  end subroutine make_rows

  !> (M M') y = rest, conjugate gradients with the diagonal.
  subroutine solve(self, rows, rest, y, rounds)
    type(partition_type), intent(in) :: self
    type(rows_type), intent(in) :: rows
    real(wp), intent(in) :: rest(:, :, :)
    real(wp), allocatable, intent(out) :: y(:, :, :)
    integer(i4), intent(inout) :: rounds
    real(wp), allocatable :: diagonal(:, :, :), r(:, :, :), p(:, :, :), ap(:, :, :), z(:, :, :)
    real(wp), allocatable :: best(:, :, :)
    real(wp) :: rz, rz_new, alpha, start, pap, least
    integer(i4) :: k, most

    call diagonal_of(self, rows, diagonal)
    allocate (y, mold=rest)
    y = 0.0_wp
    r = rest
    z = r/diagonal
    p = z
    rz = sum(r*z)
    start = rz
    least = rz
    allocate (best, source=y)
    most = 20 + 3*count(rows%scale > 0.0_wp)
    do k = 1, most
      if (.not. rz > goal**2*start .or. rz > spoilt*least) exit
      call apply(self, rows, p, ap)
      pap = sum(p*ap)
      if (.not. pap > 0.0_wp) exit
      alpha = rz/pap
      y = y + alpha*p
      r = r - alpha*ap
      z = r/diagonal
      rz_new = sum(r*z)
      p = z + (rz_new/rz)*p
      rz = rz_new
      rounds = rounds + 1
      if (rz >= least) cycle
      least = rz
      best = y
    end do
    y = best
  end subroutine solve

  !> Unknowns of a point that rows y ask for: M' y. Six symmetric components, or nine and nine.
  pure subroutine gather(self, rows, y, q, sigma, couple)
    type(partition_type), intent(in) :: self
    type(rows_type), intent(in) :: rows
    real(wp), intent(in) :: y(:, :, :)
    integer(i4), intent(in) :: q
    real(wp), intent(out) :: sigma(9), couple(9)
    real(wp) :: t(3, 3), m(3, 3), v(3), p
    integer(i4) :: a, b, k

    t = 0.0_wp   ! t(l, k) belongs to sigma_kl
    m = 0.0_wp
    p = 0.0_wp
    do a = 1, size(self%node_u, 1)
      b = self%node_u(a, self%element(q))
      if (b == 0) cycle
      v = y(:, 1, b)*rows%scale(:, 1, b)
      do k = 1, 3
        t(:, k) = t(:, k) + v*self%slope_u(k, a, q)
      end do
      p = p + dot_product(v, self%slope_mean(:, a, q) - self%slope_u(:, a, q))/3.0_wp
    end do
    do k = 1, 3
      t(k, k) = t(k, k) + p
    end do
    if (self%polar) then
      do a = 1, size(self%node_phi, 1)
        b = self%node_phi(a, self%element(q)) + self%nodes
        if (b == self%nodes) cycle
        v = y(:, 1, b)*rows%scale(:, 1, b)
        do k = 1, 3
          m(:, k) = m(:, k) + v*self%slope_phi(k, a, q)
        end do
        v = v*self%value_phi(a, q)
        t(2, 3) = t(2, 3) + v(1)
        t(3, 2) = t(3, 2) - v(1)
        t(3, 1) = t(3, 1) + v(2)
        t(1, 3) = t(1, 3) - v(2)
        t(1, 2) = t(1, 2) + v(3)
        t(2, 1) = t(2, 1) - v(3)
      end do
    else
      t = 0.5_wp*(t + transpose(t))
    end if
    sigma = rows%factor(q)*reshape(t, [9])
    couple = rows%factor(q)*rows%arm**2*reshape(m, [9])
  end subroutine gather

  !> M M' p
  pure subroutine apply(self, rows, p, ap)
    type(partition_type), intent(in) :: self
    type(rows_type), intent(in) :: rows
    real(wp), intent(in) :: p(:, :, :)
    real(wp), allocatable, intent(out) :: ap(:, :, :)
    real(wp) :: sigma(9, 1), couple(9, 1)
    integer(i4) :: q
    allocate (ap, mold=p)
    ap = 0.0_wp
    do q = 1, size(rows%picked)
      if (.not. rows%picked(q)) cycle
      call gather(self, rows, p, q, sigma(:, 1), couple(:, 1))
      call add_point(self, q, rows%factor(q), sigma, ap, couple)
    end do
    ap = ap*rows%scale
  end subroutine apply

  !> Diagonal of M M'; 1 on rows that do not count.
  pure subroutine diagonal_of(self, rows, diagonal)
    type(partition_type), intent(in) :: self
    type(rows_type), intent(in) :: rows
    real(wp), allocatable, intent(out) :: diagonal(:, :, :)
    real(wp) :: g2
    integer(i4) :: q, a, b
    allocate (diagonal, mold=rows%scale)
    diagonal = 0.0_wp
    do q = 1, size(rows%picked)
      if (.not. rows%picked(q)) cycle
      do a = 1, size(self%node_u, 1)
        b = self%node_u(a, self%element(q))
        if (b == 0) cycle
        g2 = sum(self%slope_u(:, a, q)**2)
        diagonal(:, 1, b) = diagonal(:, 1, b) + rows%factor(q)**2*g2
      end do
      if (.not. self%polar) cycle
      do a = 1, size(self%node_phi, 1)
        b = self%node_phi(a, self%element(q)) + self%nodes
        if (b == self%nodes) cycle
        g2 = 2.0_wp*self%value_phi(a, q)**2 + rows%arm**2*sum(self%slope_phi(:, a, q)**2)
        diagonal(:, 1, b) = diagonal(:, 1, b) + rows%factor(q)**2*g2
      end do
    end do
    diagonal = diagonal*rows%scale**2
    where (.not. diagonal > 0.0_wp) diagonal = 1.0_wp
  end subroutine diagonal_of

  !> Stress -= M' y.
  subroutine change(self, rows, y, stress, couple)
    type(partition_type), intent(in) :: self
    type(rows_type), intent(in) :: rows
    real(wp), intent(in) :: y(:, :, :)
    real(wp), intent(inout) :: stress(:, :), couple(:, :)
    real(wp) :: sigma(9), turn(9)
    integer(i4) :: q
    do q = 1, size(rows%picked)
      if (.not. rows%picked(q)) cycle
      call gather(self, rows, y, q, sigma, turn)
      stress(:, q) = stress(:, q) - sigma
      couple(:, q) = couple(:, q) - turn
    end do
  end subroutine change

  !> Largest change of stress (Frobenius) over the mean pressure of the points.
  pure subroutine largest_change(self, d, stress, report)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: d(:, :), stress(:, :)  !! (9, points) [Pa]
    type(initial_type), intent(inout) :: report
    real(wp) :: pressure, size_of(size(d, 2))
    integer(i4) :: q
    if (size(size_of) == 0) return
    pressure = abs(sum(self%volume*(stress(1, :) + stress(5, :) + stress(9, :)))) &
               /(3.0_wp*sum(self%volume))
    size_of = norm2(d, 1)
    q = maxloc(size_of, 1)
    report%element = self%element(q)
    report%change = size_of(q)/max(pressure, tiny(1.0_wp))
  end subroutine largest_change
end module cpl_initial
