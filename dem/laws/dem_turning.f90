!> Tangential law of Mindlin and Deresiewicz: what a contact remembers of its turning points.
!!
!! The tractions that slip leaves behind are differences of Hertz tractions (Cattaneo, Mindlin,
!! Jaeger), for any path of normal and tangential load. The same force and displacement have
!! independent springs side by side over the radius x of the contact, each with the normal force
!! E* g dx, g = overlap - x^2/R_e, the tangential stiffness 4 G* dx and friction of its own (Popov
!! and Hess 2015). With z = x^2/R_e each is deflected by w(z), |w| <= mu E*/(4 G*) (overlap - z):
!!   T = 8 G* sqrt(R_e) int w dy,  energy = 4 G* sqrt(R_e) int |w|^2 dy,  y = sqrt(z).
!! w is a chain of straight pieces: an increment shifts it, the cone of friction cuts it, and each
!! cut leaves a knot, which is a turning point. Loops that are closed are cut off with their knots.
!! Many turning points under a normal force that changes leave more knots than can be kept. Such a
!! chain gets knots at fixed places z, which stay; of the others those go that matter least to the
!! force, and what their springs lose counts as slip. Paths that bend, whose springs slip in
!! directions of their own, are taken by springs at fixed places: dem_turning_springs.
!!
!! Kept of a contact: 1 knots, 0 without contact; 2 stored energy [J]; 3 overlap [m]; then for each
!! knot z and w, the force of B's springs on B being along w [m].
!! eq. D.16
module dem_turning
  use talus_kinds, only: wp, i4
  use dem_additional_state, only: turning_reals, turning_knots
  implicit none
  private
  public :: turning_step_type, advance_turning, drop_turning, path_bends

  integer(i4), parameter :: simple = 8   !! knots that need none at fixed places
  integer(i4), parameter :: places = 16  !! most fixed places within the overlap, at least half
  integer(i4), parameter :: room = 3*(turning_knots + places + 2)  !! knots within a step
  real(wp), parameter :: straight = 1.0e-13_wp  !! off the chord, over the largest deflection [-]
  real(wp), parameter :: short = 1.0e-10_wp     !! of a piece, over the overlap [-]
  real(wp), parameter :: tiny_length = 1.0e-200_wp

  !> Points and weights of Gauss on (0, 1), exact for the products of pieces in y.
  real(wp), parameter :: gauss_place(3) = 0.5_wp + sqrt(0.15_wp)*[-1.0_wp, 0.0_wp, 1.0_wp]
  real(wp), parameter :: gauss_weight(3) = [5.0_wp, 8.0_wp, 5.0_wp]/18.0_wp

  !> What moves a contact in a step.
  type :: turning_step_type
    real(wp) :: shift(3) = 0.0_wp   !! tangential displacement of A over B [m]
    real(wp) :: normal(3) = 0.0_wp  !! at its end [-]
    real(wp) :: spin = 0.0_wp       !! turn of the frame about the normal [rad]
    real(wp) :: overlap = 0.0_wp    !! at its end [m]
    real(wp) :: root = 0.0_wp       !! sqrt(R_e) [m^1/2]
    real(wp) :: stiffness = 0.0_wp  !! 8 G* [Pa]
    real(wp) :: cone = 0.0_wp       !! mu E*/(4 G*) [-]
  end type turning_step_type

  !> Knots within a step.
  type :: chain_type
    integer(i4) :: n = 0
    real(wp) :: z(room)        !! [m]
    real(wp) :: w(3, room)     !! now [m]
    real(wp) :: was(3, room)   !! at the start of the step, in the new frame [m]
    real(wp) :: limit(room)    !! of |w| now [m]
    real(wp) :: before(room)   !! the same at the start of the step [m]
  end type chain_type

contains

  !> A step of a contact that has an overlap at its end: force on B and what slip dissipates.
  pure subroutine advance_turning(step, row, force, slip)
    type(turning_step_type), intent(in) :: step
    real(wp), intent(inout) :: row(turning_reals)
    real(wp), intent(out) :: force(3)  !! [N]
    real(wp), intent(out) :: slip      !! [J]
    type(chain_type) :: c
    real(wp) :: sums(4), left

    call take_knots(step, row, c)
    call move_rim(step, row(3), c, left)
    c%limit(:c%n) = max(step%cone*(step%overlap - c%z(:c%n)), 0.0_wp)
    c%before(:c%n) = max(step%cone*(row(3) - c%z(:c%n)), 0.0_wp)
    if (c%n > simple) call fix_places(c)
    call cut_chain(c, slip)
    sums = chain_sums(c, c%w)
    slip = left + slip + 0.5_wp*sums(4)
    call straighten(c)
    sums = chain_sums(c, c%w)
    slip = step%stiffness*step%root*(slip - 0.5_wp*sums(4))
    force = step%stiffness*step%root*sums(1:3)
    row(1) = real(c%n, wp)
    row(2) = 0.5_wp*step%stiffness*step%root*sums(4)
    row(3) = step%overlap
    call put_knots(c, row)
  end subroutine advance_turning

  !> A contact that has ended: its springs have slipped back.
  pure subroutine drop_turning(row, slip)
    real(wp), intent(inout) :: row(turning_reals)
    real(wp), intent(out) :: slip
    slip = row(2)
    row = 0.0_wp
  end subroutine drop_turning

  !> Knots of the last step, turned into the new frame, and shifted.
  pure subroutine take_knots(step, row, c)
    type(turning_step_type), intent(in) :: step
    real(wp), intent(in) :: row(turning_reals)
    type(chain_type), intent(inout) :: c
    integer(i4) :: k, at
    c%n = nint(row(1))
    do k = 1, c%n
      at = 4*k
      c%z(k) = row(at)
      c%was(:, k) = turned(row(at + 1:at + 3), step%normal, step%spin)
      c%w(:, k) = c%was(:, k) + step%shift
    end do
    if (c%n > 0) return
    c%n = 1
    c%z(1) = 0.0_wp
    c%was(:, 1) = 0.0_wp
    c%w(:, 1) = step%shift
  end subroutine take_knots

  pure subroutine put_knots(c, row)
    type(chain_type), intent(in) :: c
    real(wp), intent(inout) :: row(turning_reals)
    integer(i4) :: k
    do k = 1, c%n
      row(4*k:4*k + 3) = [c%z(k), c%w(:, k)]
    end do
    row(4*c%n + 4:) = 0.0_wp
  end subroutine put_knots

  !> Into the plane across n, the length kept, then about n.
  pure function turned(w, n, spin) result(v)
    real(wp), intent(in) :: w(3), n(3), spin
    real(wp) :: v(3)
    v = w - dot_product(w, n)*n
    v = v + spin*[n(2)*v(3) - n(3)*v(2), n(3)*v(1) - n(1)*v(3), n(1)*v(2) - n(2)*v(1)]
    v = v*(sqrt(sum(w*w))/max(sqrt(sum(v*v)), tiny_length))
  end function turned

  !> The chain up to the new overlap: springs that come into contact in the step have part of its
  !! shift, those that leave slip back.
  pure subroutine move_rim(step, last, c, left)
    type(turning_step_type), intent(in) :: step
    real(wp), intent(in) :: last  !! overlap before [m]
    type(chain_type), intent(inout) :: c
    real(wp), intent(out) :: left  !! energy of those that leave, over the stiffness
    real(wp) :: t, sums(4)
    integer(i4) :: k
    left = 0.0_wp
    if (step%overlap > last) then
      c%n = c%n + 1
      c%w(:, c%n) = 0.0_wp
      c%was(:, c%n) = 0.0_wp
    else
      k = 1
      do while (k < c%n .and. c%z(min(k + 1, c%n)) < step%overlap)
        k = k + 1
      end do
      if (k < c%n) then
        sums = chain_sums(c, c%was)
        left = 0.5_wp*sums(4)
        t = (step%overlap - c%z(k))/(c%z(k + 1) - c%z(k))
        c%w(:, k + 1) = c%w(:, k) + t*(c%w(:, k + 1) - c%w(:, k))
        c%was(:, k + 1) = c%was(:, k) + t*(c%was(:, k + 1) - c%was(:, k))
        c%n = k + 1
        c%z(c%n) = step%overlap
        sums = chain_sums(c, c%was)
        left = left - 0.5_wp*sums(4)
      end if
    end if
    c%z(c%n) = step%overlap
  end subroutine move_rim

  !> Does a step leave the direction of the deflections?
  pure logical function path_bends(shift, row) result(bends)
    real(wp), intent(in) :: shift(3), row(turning_reals)
    real(wp), parameter :: least = 1.0e-6_wp  !! angle [rad]
    real(wp) :: square, product, w(3)
    integer(i4) :: k
    bends = .false.
    square = sum(shift**2)
    do k = 1, nint(row(1)) - 1
      w = row(4*k + 1:4*k + 3)
      product = dot_product(w, shift)
      bends = bends .or. square*sum(w**2)*(1.0_wp - least**2) > product**2
    end do
  end function path_bends

  !> Distance of the fixed places: a power of two, so that they are the same for half and for
  !! double the overlap.
  pure real(wp) function spacing_of(overlap) result(spacing)
    real(wp), intent(in) :: overlap
    spacing = scale(1.0_wp, exponent(overlap/places))
  end function spacing_of

  !> Those knots that there are: room is for many more.
  pure subroutine copy_chain(c, copy)
    type(chain_type), intent(in) :: c
    type(chain_type), intent(inout) :: copy
    copy%n = c%n
    copy%z(:c%n) = c%z(:c%n)
    copy%w(:, :c%n) = c%w(:, :c%n)
    copy%was(:, :c%n) = c%was(:, :c%n)
    copy%limit(:c%n) = c%limit(:c%n)
    copy%before(:c%n) = c%before(:c%n)
  end subroutine copy_chain

  !> Knots at all fixed places.
  pure subroutine fix_places(c)
    type(chain_type), intent(inout) :: c
    type(chain_type) :: old
    real(wp) :: spacing, z
    integer(i4) :: k, j

    call copy_chain(c, old)
    spacing = spacing_of(old%z(old%n))
    c%n = 0
    do k = 1, old%n
      call append(c, old, k, 0.0_wp)
      if (k == old%n) exit
      do j = int(old%z(k)/spacing, i4) + 1, places
        z = j*spacing
        if (.not. z < old%z(k + 1)) exit
        call append(c, old, k, (z - old%z(k))/(old%z(k + 1) - old%z(k)))
        c%z(c%n) = z
      end do
    end do
  end subroutine fix_places

  !> Cut the chain by the cone of friction; slip: its work over the tangential stiffness.
  pure subroutine cut_chain(c, slip)
    type(chain_type), intent(inout) :: c
    real(wp), intent(out) :: slip
    real(wp) :: slid(room), pull(room), length
    integer(i4) :: k
    logical :: over

    call insert_cuts(c)
    slid(:c%n) = 0.0_wp
    over = .false.
    do k = 1, c%n
      length = sqrt(sum(c%w(:, k)**2))
      pull(k) = c%limit(k)
      if (.not. length > c%limit(k)) cycle
      over = .true.
      slid(k) = length - c%limit(k)
      pull(k) = mean_pull(dot_product(c%was(:, k), c%w(:, k))/length, length, c%before(k), &
                          c%limit(k))
      c%w(:, k) = c%w(:, k)*(c%limit(k)/length)
    end do
    slip = 0.0_wp
    if (.not. over) return
    do k = 1, c%n - 1
      slip = slip + piece(c%z(k), c%z(k + 1), slid(k:k + 1), pull(k:k + 1))
    end do
  end subroutine cut_chain

  !> Mean force of a spring while it slips: at its limit from the onset, both of which move in
  !! straight lines over the step, to the end.
  pure real(wp) function mean_pull(was, would, before, limit)
    real(wp), intent(in) :: was, would     !! deflection along the slip before, and without slip [m]
    real(wp), intent(in) :: before, limit  !! limits before and now [m]
    real(wp) :: onset
    onset = (before - was)/max((would - was) - (limit - before), tiny_length)
    onset = min(max(onset, 0.0_wp), 1.0_wp)
    mean_pull = 0.5_wp*(before + onset*(limit - before) + limit)
  end function mean_pull

  !> Knots where pieces pass through the cone.
  pure subroutine insert_cuts(c)
    type(chain_type), intent(inout) :: c
    type(chain_type) :: old
    real(wp) :: t(2)
    integer(i4) :: k, j, cuts

    call copy_chain(c, old)
    c%n = 0
    do k = 1, old%n
      call append(c, old, k, 0.0_wp)
      if (k == old%n) exit
      call find_cuts(old%w(:, k), old%w(:, k + 1), old%limit(k), old%limit(k + 1), t, cuts)
      do j = 1, cuts
        call append(c, old, k, t(j))
      end do
    end do

  end subroutine insert_cuts

  !> Knot at the share t of the piece from knot k of the old chain on.
  pure subroutine append(c, old, k, t)
    type(chain_type), intent(inout) :: c
    type(chain_type), intent(in) :: old
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: t
    integer(i4) :: next
    next = min(k + 1, old%n)
    c%n = c%n + 1
    c%z(c%n) = old%z(k) + t*(old%z(next) - old%z(k))
    c%w(:, c%n) = old%w(:, k) + t*(old%w(:, next) - old%w(:, k))
    c%was(:, c%n) = old%was(:, k) + t*(old%was(:, next) - old%was(:, k))
    c%limit(c%n) = old%limit(k) + t*(old%limit(next) - old%limit(k))
    c%before(c%n) = old%before(k) + t*(old%before(next) - old%before(k))
  end subroutine append

  !> Places in a piece, ascending, where |w| = limit, both straight; none if all of it slips.
  pure subroutine find_cuts(w1, w2, limit1, limit2, t, cuts)
    real(wp), intent(in) :: w1(3), w2(3), limit1, limit2
    real(wp), intent(out) :: t(2)
    integer(i4), intent(out) :: cuts
    real(wp), parameter :: close_by = 1.0e-9_wp
    real(wp) :: d(3), slope, a, b, c, q, root(2)
    integer(i4) :: k

    cuts = 0
    t = 0.0_wp
    if (sum(w1*w1) > limit1*limit1 .and. sum(w2*w2) > limit2*limit2 &
        .and. dot_product(w1, w2) > 0.0_wp) return
    d = w2 - w1
    slope = limit2 - limit1
    a = sum(d*d) - slope*slope
    b = dot_product(w1, d) - limit1*slope
    c = sum(w1*w1) - limit1*limit1
    q = b*b - a*c
    if (.not. q > 0.0_wp) return
    q = -(b + sign(sqrt(q), b))
    root = -1.0_wp
    if (abs(q) > abs(a)*close_by) root(1) = q/sign(max(abs(a), tiny_length), a)
    if (abs(q) > 0.0_wp) root(2) = c/q
    if (root(1) > root(2)) root = root(2:1:-1)
    do k = 1, 2
      if (root(k) < close_by .or. root(k) > 1.0_wp - close_by) cycle
      cuts = cuts + 1
      t(cuts) = root(k)
    end do
  end subroutine find_cuts

  !> Drop knots that lie on the chord of their neighbours, then, if there are more than are kept,
  !! those that matter least to the force.
  pure subroutine straighten(c)
    type(chain_type), intent(inout) :: c
    real(wp) :: least, area, near, spacing
    integer(i4) :: k, best

    near = straight*maxval(c%limit(:c%n))
    k = 2
    do while (k < c%n)
      if (sqrt(sum(off_chord(c, k)**2)) <= near .or. c%z(k) - c%z(k - 1) <= short*c%z(c%n) &
          .or. c%z(k + 1) - c%z(k) <= short*c%z(c%n)) then
        call drop(c, k)
      else
        k = k + 1
      end if
    end do
    spacing = spacing_of(c%z(c%n))
    do while (c%n > turning_knots)
      best = 2
      least = huge(1.0_wp)
      do k = 2, c%n - 1
        if (abs(c%z(k)/spacing - anint(c%z(k)/spacing)) <= 0.0_wp) cycle
        area = sqrt(sum(off_chord(c, k)**2))*(sqrt(c%z(k + 1)) - sqrt(c%z(k - 1)))
        if (area < least) best = k
        least = min(area, least)
      end do
      call drop(c, best)
    end do
  end subroutine straighten

  !> Distance of knot k from the chord of its neighbours.
  pure function off_chord(c, k) result(off)
    type(chain_type), intent(in) :: c
    integer(i4), intent(in) :: k
    real(wp) :: off(3), t
    t = (c%z(k) - c%z(k - 1))/max(c%z(k + 1) - c%z(k - 1), tiny_length)
    off = c%w(:, k) - c%w(:, k - 1) - t*(c%w(:, k + 1) - c%w(:, k - 1))
  end function off_chord

  pure subroutine drop(c, k)
    type(chain_type), intent(inout) :: c
    integer(i4), intent(in) :: k
    integer(i4) :: j
    do j = k, c%n - 1
      c%z(j) = c%z(j + 1)
      c%w(:, j) = c%w(:, j + 1)
      c%limit(j) = c%limit(j + 1)
    end do
    c%n = c%n - 1
  end subroutine drop

  !> Integrals of w (1-3) and of |w|^2 (4) over y = sqrt(z).
  pure function chain_sums(c, deflection) result(sums)
    type(chain_type), intent(in) :: c
    real(wp), intent(in) :: deflection(3, room)  !! w, now or before [m]
    real(wp) :: sums(4), y(2), z, w(3), at, wide
    integer(i4) :: k, j
    sums = 0.0_wp
    do k = 1, c%n - 1
      y = sqrt(c%z(k:k + 1))
      wide = c%z(k + 1) - c%z(k)
      if (.not. wide > 0.0_wp) cycle
      do j = 1, 3
        z = (y(1) + gauss_place(j)*(y(2) - y(1)))**2
        at = (z - c%z(k))/wide
        w = deflection(:, k) + at*(deflection(:, k + 1) - deflection(:, k))
        sums(1:3) = sums(1:3) + gauss_weight(j)*(y(2) - y(1))*w
        sums(4) = sums(4) + gauss_weight(j)*(y(2) - y(1))*sum(w*w)
      end do
    end do
  end function chain_sums

  !> Integral over y of the product of two straight functions over a piece.
  pure real(wp) function piece(z1, z2, a, b)
    real(wp), intent(in) :: z1, z2, a(2), b(2)
    real(wp) :: y(2), at
    integer(i4) :: j
    piece = 0.0_wp
    if (.not. z2 > z1) return
    y = sqrt([z1, z2])
    do j = 1, 3
      at = ((y(1) + gauss_place(j)*(y(2) - y(1)))**2 - z1)/(z2 - z1)
      piece = piece + gauss_weight(j)*(y(2) - y(1))*(a(1) + at*(a(2) - a(1))) &
              *(b(1) + at*(b(2) - b(1)))
    end do
  end function piece
end module dem_turning
