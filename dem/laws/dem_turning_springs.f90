!> Springs of the law of Mindlin and Deresiewicz (dem_turning) where paths bend: deflections w at
!! fixed places z = 0, s, 2s, ... below the overlap, straight in between and to 0 at the rim. All
!! lanes of a block at once.
!!
!! A place has the weight of its hat function over y = sqrt(z), so that full sliding gives the
!! friction of Hertz's force exactly, and is a spring of its own: forces, energies and losses are
!! sums over places, and nothing drifts with the number of steps. Weights of the last place change
!! with the overlap: where the rim moves out its deflection shrinks so that the force stays; where
!! it moves in springs slip back. s is a power of two; it doubles or halves so that 12 to 24 places
!! are below the overlap, without more force or energy.
!!
!! Kept of a contact: 1 springs_mark; 2 stored energy [J]; 3 overlap [m]; 4 s [m]; then w of each
!! place [m].
module dem_turning_springs
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes
  use dem_additional_state, only: turning_reals, turning_knots
  use dem_lanes, only: read_in_order
  implicit none
  private
  public :: springs_step_type, advance_springs, start_springs, springs_mark, most_places

  integer(i4), parameter :: most_places = 24
  integer(i4), parameter :: fewest_places = 11  !! from which on s is halved
  real(wp), parameter :: springs_mark = turning_knots + 1
  integer(i4), parameter :: at_spacing = 4
  real(wp), parameter :: tiny_length = 1.0e-200_wp

  !> y at the places for s = 1, and the parts of a hat function's integral on either side of its
  !! place.
  real(wp), parameter :: y(most_places + 1) = sqrt([ &
    0.0_wp, 1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp, 7.0_wp, 8.0_wp, 9.0_wp, 10.0_wp, &
    11.0_wp, 12.0_wp, 13.0_wp, 14.0_wp, 15.0_wp, 16.0_wp, 17.0_wp, 18.0_wp, 19.0_wp, 20.0_wp, &
    21.0_wp, 22.0_wp, 23.0_wp, 24.0_wp])
  real(wp), parameter :: inner(most_places) = [0.0_wp, &
    (y(2:most_places) + 2.0_wp*y(:most_places - 1)) &
    /(3.0_wp*(y(2:most_places) + y(:most_places - 1))**2)]
  real(wp), parameter :: outer(most_places) = (2.0_wp*y(2:) + y(:most_places)) &
    /(3.0_wp*(y(2:) + y(:most_places))**2)

  !> What moves the contacts of a block in a step.
  type :: springs_step_type
    logical :: on(lanes) = .false.     !! in contact, with springs
    real(wp) :: shift(lanes, 3)        !! tangential displacement of A over B [m]
    real(wp) :: normal(lanes, 3)       !! at its end [-]
    real(wp) :: spin(lanes)            !! turn of the frame about the normal [rad]
    real(wp) :: overlap(lanes)         !! at its end [m]
    real(wp) :: root(lanes)            !! sqrt(R_e) [m^1/2]
    real(wp) :: stiffness              !! 8 G* [Pa]
    real(wp) :: cone                   !! mu E*/(4 G*) [-]
  end type springs_step_type

  !> Rims of a block before and after the step.
  type :: rims_type
    real(wp) :: s(lanes), root_s(lanes)        !! [m], [m^1/2]
    real(wp) :: before(lanes), now(lanes)      !! overlaps [m]
    real(wp) :: last(lanes, 2)                 !! places below the overlap, before and now
    real(wp) :: on(lanes)                      !! 1, of lanes that are off 0
    real(wp) :: weight(lanes, 2)               !! of the last place, before and now [m^1/2]
    real(wp) :: ratio(lanes)                   !! by which the last deflection before shrinks
  end type rims_type

contains

  !> A step of the lanes that are on: force on B and what slip dissipates.
  pure subroutine advance_springs(step, kept, force, slip)
    type(springs_step_type), intent(in) :: step
    real(wp), intent(inout) :: kept(lanes, turning_reals)
    real(wp), intent(inout) :: force(lanes, 3)  !! [N]
    real(wp), intent(inout) :: slip(lanes)      !! [J]
    type(rims_type) :: rim
    real(wp) :: sums(lanes, 3), stored(lanes), was(lanes), lost(lanes), unit
    integer(i4) :: j, k, top

    do k = 1, lanes
      if (.not. step%on(k)) cycle
      slip(k) = 0.0_wp
      if (step%overlap(k) <= most_places*kept(k, at_spacing)) cycle
      call coarsen(step%stiffness*step%root(k), step%overlap(k), kept(k, :), slip(k))
    end do
    call find_rims(step, kept, rim)
    sums = 0.0_wp
    stored = 0.0_wp
    was = 0.0_wp
    lost = 0.0_wp
    top = nint(maxval(rim%last), i4)
    call read_in_order(kept(:, at_spacing + 1), 3*top*lanes)
    do j = 1, top
      call move_place(step, rim, j, kept(:, at_spacing + 3*j - 2:at_spacing + 3*j), sums, stored, &
                      was, lost)
    end do
    do k = 1, lanes
      if (.not. step%on(k)) cycle
      unit = step%stiffness*step%root(k)
      force(k, :) = unit*sums(k, :)
      slip(k) = slip(k) + unit*(lost(k) + 0.5_wp*was(k))
      kept(k, 2) = 0.5_wp*unit*stored(k)
      kept(k, 3) = step%overlap(k)
      if (step%overlap(k) <= fewest_places*rim%s(k)) call refine(unit, kept(k, :), slip(k))
    end do
  end subroutine advance_springs

  pure subroutine find_rims(step, kept, rim)
    type(springs_step_type), intent(in) :: step
    real(wp), intent(in) :: kept(lanes, turning_reals)
    type(rims_type), intent(out) :: rim
    real(wp) :: later
    integer(i4) :: k, last
    do k = 1, lanes
      rim%s(k) = merge(kept(k, at_spacing), 1.0_wp, step%on(k))
      rim%before(k) = merge(kept(k, 3), 0.0_wp, step%on(k))
      rim%now(k) = merge(step%overlap(k), 0.0_wp, step%on(k))
      rim%root_s(k) = sqrt(rim%s(k))
      rim%on(k) = merge(1.0_wp, 0.0_wp, step%on(k))
      last = ceiling(rim%before(k)/rim%s(k), i4)
      rim%last(k, 1) = real(last, wp)
      rim%last(k, 2) = real(ceiling(rim%now(k)/rim%s(k), i4), wp)
      rim%weight(k, 1) = weight_of_last(rim%s(k), rim%before(k))
      rim%weight(k, 2) = weight_of_last(rim%s(k), rim%now(k))
      later = 0.0_wp
      if (last > 0 .and. rim%last(k, 2) >= rim%last(k, 1)) later = rim%weight(k, 2)
      if (last > 0 .and. rim%last(k, 2) > rim%last(k, 1)) &
        later = rim%root_s(k)*(inner(last) + outer(last))
      rim%ratio(k) = 1.0_wp
      if (later > rim%weight(k, 1)) rim%ratio(k) = rim%weight(k, 1)/later
    end do
  end subroutine find_rims

  !> Weight of the last place below an overlap, whose hat function ends at the rim [m^1/2].
  pure real(wp) function weight_of_last(s, overlap) result(weight)
    real(wp), intent(in) :: s, overlap
    integer(i4) :: last
    real(wp) :: z, high, low
    weight = 0.0_wp
    last = ceiling(overlap/s, i4)
    if (last < 1) return
    z = (last - 1)*s
    high = sqrt(overlap)
    low = sqrt(z)
    weight = sqrt(s)*inner(last) + (overlap - z)*(2.0_wp*high + low)/(3.0_wp*(high + low)**2)
  end function weight_of_last

  !> Place j of all lanes: turned, shifted, cut by the cone of friction. Sums over the places of
  !! weight times w, w^2, what w^2 loses as weights change, and loss.
  pure subroutine move_place(step, rim, j, w, sums, stored, was, lost)
    type(springs_step_type), intent(in) :: step
    type(rims_type), intent(in) :: rim
    integer(i4), intent(in) :: j
    real(wp), intent(inout) :: w(lanes, 3)
    real(wp), intent(inout) :: sums(lanes, 3), stored(lanes), was(lanes), lost(lanes)
    real(wp) :: z, weight, former, limit, before, x1, x2, x3, v1, v2, v3, c, square, length, pull
    real(wp) :: share, along, slid, onset, whole, place, on
    integer(i4) :: k

    place = real(j, wp)
    whole = inner(j) + outer(j)
    !$omp simd private(z, weight, former, limit, before, x1, x2, x3, v1, v2, v3, c, square, &
    !$omp   length, pull, share, along, slid, onset, on)
    do k = 1, lanes
      on = rim%on(k)
      z = (place - 1.0_wp)*rim%s(k)
      former = merge(rim%root_s(k)*whole, 0.0_wp, place < rim%last(k, 1))
      former = merge(rim%weight(k, 1), former, place == rim%last(k, 1))
      weight = merge(rim%root_s(k)*whole, 0.0_wp, place < rim%last(k, 2))
      weight = merge(rim%weight(k, 2), weight, place == rim%last(k, 2))
      before = max(step%cone*(rim%before(k) - z), 0.0_wp)
      limit = max(step%cone*(rim%now(k) - z), 0.0_wp)
      ! into the plane across n, about n, length kept
      x1 = merge(w(k, 1), 0.0_wp, on > 0.0_wp)
      x2 = merge(w(k, 2), 0.0_wp, on > 0.0_wp)
      x3 = merge(w(k, 3), 0.0_wp, on > 0.0_wp)
      square = x1*x1 + x2*x2 + x3*x3
      c = x1*step%normal(k, 1) + x2*step%normal(k, 2) + x3*step%normal(k, 3)
      x1 = x1 - c*step%normal(k, 1)
      x2 = x2 - c*step%normal(k, 2)
      x3 = x3 - c*step%normal(k, 3)
      v1 = x1 + step%spin(k)*(step%normal(k, 2)*x3 - step%normal(k, 3)*x2)
      v2 = x2 + step%spin(k)*(step%normal(k, 3)*x1 - step%normal(k, 1)*x3)
      v3 = x3 + step%spin(k)*(step%normal(k, 1)*x2 - step%normal(k, 2)*x1)
      c = sqrt(square)/max(sqrt(v1*v1 + v2*v2 + v3*v3), tiny_length)
      c = c*merge(rim%ratio(k), 1.0_wp, place == rim%last(k, 1))
      v1 = c*v1
      v2 = c*v2
      v3 = c*v3
      was(k) = was(k) + former*square - weight*(v1*v1 + v2*v2 + v3*v3)
      ! springs that come into contact have part of the shift
      share = (rim%now(k) - z)/max(rim%now(k) - rim%before(k), tiny_length)
      share = merge(1.0_wp, min(max(share, 0.0_wp), 1.0_wp), place <= rim%last(k, 1))
      x1 = v1 + share*step%shift(k, 1)
      x2 = v2 + share*step%shift(k, 2)
      x3 = v3 + share*step%shift(k, 3)
      length = sqrt(x1*x1 + x2*x2 + x3*x3)
      c = 1.0_wp/max(length, tiny_length)
      along = (v1*x1 + v2*x2 + v3*x3)*c
      slid = max(length - limit, 0.0_wp)
      ! mean force while it slips: at its limit from the onset on, see mean_pull of dem_turning
      onset = (before - along)/max((length - along) - (limit - before), tiny_length)
      onset = min(max(onset, 0.0_wp), 1.0_wp)
      pull = 0.5_wp*(before + onset*(limit - before) + limit)
      lost(k) = lost(k) + weight*slid*pull
      c = min(limit*c, 1.0_wp)
      x1 = c*x1
      x2 = c*x2
      x3 = c*x3
      sums(k, 1) = sums(k, 1) + weight*x1
      sums(k, 2) = sums(k, 2) + weight*x2
      sums(k, 3) = sums(k, 3) + weight*x3
      stored(k) = stored(k) + weight*(x1*x1 + x2*x2 + x3*x3)
      w(k, 1) = merge(x1, w(k, 1), on > 0.0_wp)
      w(k, 2) = merge(x2, w(k, 2), on > 0.0_wp)
      w(k, 3) = merge(x3, w(k, 3), on > 0.0_wp)
    end do
  end subroutine move_place

  !> Weights of all places below an overlap.
  pure function weights_of(s, overlap) result(weight)
    real(wp), intent(in) :: s, overlap
    real(wp) :: weight(most_places)
    integer(i4) :: last
    last = ceiling(overlap/s, i4)
    weight = 0.0_wp
    if (last < 1) return
    weight(:last - 1) = sqrt(s)*(inner(:last - 1) + outer(:last - 1))
    weight(last) = weight_of_last(s, overlap)
  end function weights_of

  !> Double s until an overlap has no more places than are kept: means by weight, so that the force
  !! stays and the energy does not grow.
  pure subroutine coarsen(unit, overlap, row, slip)
    real(wp), intent(in) :: unit  !! 8 G* sqrt(R_e) [N/m^3/2]
    real(wp), intent(in) :: overlap
    real(wp), intent(inout) :: row(turning_reals), slip
    real(wp) :: weight(most_places), w(3, most_places), total(most_places), sums(3, most_places)
    real(wp) :: part
    integer(i4) :: j, to, side, last
    slip = slip + unit*half_square(row)
    do while (overlap > most_places*row(at_spacing))
      weight = weights_of(row(at_spacing), row(3))
      w = reshape(row(at_spacing + 1:at_spacing + 3*most_places), [3, most_places])
      row(at_spacing) = 2.0_wp*row(at_spacing)
      last = max(ceiling(row(3)/row(at_spacing), i4), 1)
      total = 0.0_wp
      sums = 0.0_wp
      do j = 1, most_places
        do side = 0, mod(j + 1, 2)
          to = min((j + 1)/2 + side, last)
          part = weight(j)/(1 + mod(j + 1, 2))
          total(to) = total(to) + part
          sums(:, to) = sums(:, to) + part*w(:, j)
        end do
      end do
      w = sums/spread(max(total, tiny_length), 1, 3)
      row(at_spacing + 1:at_spacing + 3*most_places) = reshape(w, [3*most_places])
    end do
    slip = slip - unit*half_square(row)
  end subroutine coarsen

  !> Halve s until the overlap has enough places: deflections in between lie on straight lines.
  pure subroutine refine(unit, row, slip)
    real(wp), intent(in) :: unit  !! 8 G* sqrt(R_e) [N/m^3/2]
    real(wp), intent(inout) :: row(turning_reals), slip
    real(wp) :: w(3, most_places + 1), fine(3, most_places), z, stored
    integer(i4) :: j, last
    stored = row(2)
    do while (row(3) <= fewest_places*row(at_spacing))
      w(:, :most_places) = reshape(row(at_spacing + 1:at_spacing + 3*most_places), [3, most_places])
      w(:, most_places + 1) = 0.0_wp
      last = ceiling(row(3)/row(at_spacing), i4)
      fine = 0.0_wp
      do j = 1, most_places
        z = 0.5_wp*(j - 1)*row(at_spacing)
        if (.not. z < row(3)) exit
        fine(:, j) = w(:, (j + 1)/2)
        if (mod(j, 2) == 1) cycle
        if ((j + 1)/2 == last) then
          fine(:, j) = w(:, last)*((row(3) - z)/(row(3) - (last - 1)*row(at_spacing)))
        else
          fine(:, j) = 0.5_wp*(w(:, j/2) + w(:, j/2 + 1))
        end if
      end do
      row(at_spacing) = 0.5_wp*row(at_spacing)
      row(at_spacing + 1:at_spacing + 3*most_places) = reshape(fine, [3*most_places])
      if (.not. row(at_spacing) > 1.0e-100_wp) exit
    end do
    row(2) = unit*half_square(row)
    slip = slip + stored - row(2)
  end subroutine refine

  !> Half the sum of weight times w^2 [m^5/2].
  pure real(wp) function half_square(row) result(half)
    real(wp), intent(in) :: row(turning_reals)
    real(wp) :: w(3, most_places)
    w = reshape(row(at_spacing + 1:at_spacing + 3*most_places), [3, most_places])
    half = 0.5_wp*sum(weights_of(row(at_spacing), row(3))*sum(w*w, 1))
  end function half_square

  !> Springs in place of a chain of knots (dem_turning): its deflections at the places, made smaller
  !! where they would hold more energy.
  pure subroutine start_springs(unit, row)
    real(wp), intent(in) :: unit  !! 8 G* sqrt(R_e) [N/m^3/2]
    real(wp), intent(inout) :: row(turning_reals)
    real(wp) :: other(turning_reals), z, t, energy
    integer(i4) :: j, k, n
    n = nint(row(1))
    other = 0.0_wp
    other(1:3) = row(1:3)
    other(1) = springs_mark
    other(at_spacing) = scale(1.0_wp, exponent(row(3)/most_places))
    k = 1
    do j = 1, most_places
      z = (j - 1)*other(at_spacing)
      if (.not. z < row(3)) exit
      do while (k < n - 1 .and. row(4*(k + 1)) <= z)
        k = k + 1
      end do
      t = (z - row(4*k))/max(row(4*k + 4) - row(4*k), tiny_length)
      other(at_spacing + 3*j - 2:at_spacing + 3*j) = row(4*k + 1:4*k + 3) &
        + t*(row(4*k + 5:4*k + 7) - row(4*k + 1:4*k + 3))
    end do
    energy = unit*half_square(other)
    if (energy > row(2)) other(at_spacing + 1:) = sqrt(row(2)/energy)*other(at_spacing + 1:)
    row = other
  end subroutine start_springs
end module dem_turning_springs
