!> An increment of strain of `sanisand`: elastic part up to the yield surface (Pegasus), then
!! Dormand and Prince's pair in sub-steps of 1/2, 1/4, ... of what is left, chosen by their error.
!! The sub-steps are recorded, so that a neighbouring increment can be followed in the same ones and
!! differences are those of a smooth function.
!! eq. F.43
module fem_sanisand_path
  use talus_kinds, only: wp, i4
  use fem_law, only: flag_elastic, flag_yielding, flag_apex
  use fem_sanisand, only: sand_type, elastic_path, yield_ratio, rates, &
    at_alpha, at_fabric, at_void, at_flow, sand_size
  use fem_voigt, only: unit, twice, trace, magnitude
  implicit none
  private
  public :: sand_record_type, follow_strain, tableau, on_surface, nudge

  integer(i4), parameter :: most_steps = 2048
  integer(i4), parameter :: most_rounds = 40
  integer(i4), parameter :: most_trials = 60
  integer(i4), parameter :: stages = 7
  real(wp), parameter :: accuracy = 1.0e-7_wp       !! of a sub-step, relative
  real(wp), parameter :: easy = 1.0_wp/64.0_wp      !! error over its limit, for twice the sub-step
  real(wp), parameter :: smallest = 0.5_wp**16      !! sub-step
  real(wp), parameter :: stable = 2.5_wp            !! sub-step times its fastest rate
  real(wp), parameter :: on_surface = 1.0e-9_wp     !! of the yield ratio
  real(wp), parameter :: found = 1.0e-15_wp         !! of the crossing
  real(wp), parameter :: nudge = 1.0e-6_wp          !! of an increment that grazes the surface

  !> Dormand and Prince (1980), rows of stages 2 to 7; the last is the result of fifth order.
  real(wp), parameter :: tableau(stages - 1, stages - 1) = reshape([ &
    1.0_wp/5.0_wp, 3.0_wp/40.0_wp, 44.0_wp/45.0_wp, 19372.0_wp/6561.0_wp, 9017.0_wp/3168.0_wp, &
    35.0_wp/384.0_wp, &
    0.0_wp, 9.0_wp/40.0_wp, -56.0_wp/15.0_wp, -25360.0_wp/2187.0_wp, -355.0_wp/33.0_wp, 0.0_wp, &
    0.0_wp, 0.0_wp, 32.0_wp/9.0_wp, 64448.0_wp/6561.0_wp, 46732.0_wp/5247.0_wp, &
    500.0_wp/1113.0_wp, &
    0.0_wp, 0.0_wp, 0.0_wp, -212.0_wp/729.0_wp, 49.0_wp/176.0_wp, 125.0_wp/192.0_wp, &
    0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, -5103.0_wp/18656.0_wp, -2187.0_wp/6784.0_wp, &
    0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 11.0_wp/84.0_wp], [stages - 1, stages - 1])
  real(wp), parameter :: difference(stages) = [71.0_wp/57600.0_wp, 0.0_wp, -71.0_wp/16695.0_wp, &
    71.0_wp/1920.0_wp, -17253.0_wp/339200.0_wp, 22.0_wp/525.0_wp, -1.0_wp/40.0_wp]

  !> Sub-steps of an increment, each over what is left when its round began.
  type :: sand_record_type
    logical :: known = .false.    !! follow them, do not choose
    logical :: lost = .false.     !! no sub-step is small enough
    integer(i4) :: count = 0
    integer(i4) :: next = 1
    real(wp) :: size_of(most_steps)
  end type sand_record_type

contains

  !> Bring a point through an increment. `flag` as in fem_law; `good` is false where no sub-step is
  !! small enough.
  pure subroutine follow_strain(sand, strain, y, start, record, flag, good)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: y(sand_size), start(6)
    type(sand_record_type), intent(inout) :: record
    real(wp), intent(out) :: flag
    logical, intent(out) :: good
    real(wp) :: left(6), share
    logical :: held
    integer(i4) :: k

    flag = flag_elastic
    left = strain
    record%next = 1
    record%lost = .false.
    do k = 1, most_rounds
      if (loads(sand, left, y, start)) then
        flag = flag_yielding
        call yielding_part(sand, left, y, start, record, share, held)
      else
        call elastic_part(sand, left, y, share, held)
      end if
      good = .not. record%lost
      if (.not. good) return
      left = (1.0_wp - share)*left
      if (held) call hold(sand, left, y)
      if (held) flag = flag_apex
      if (held .or. .not. share < 1.0_wp) return
    end do
    good = .false.
  end subroutine follow_strain

  !> Is the point on the yield surface, and does the strain lead out of it?
  pure logical function loads(sand, strain, y, start)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), y(sand_size), start(6)
    real(wp) :: rate(sand_size), drive, fast
    loads = yield_ratio(sand, y) > -on_surface
    if (.not. loads) return
    call rates(sand, strain, y, start, rate, drive, fast)
    loads = drive > 0.0_wp
  end function loads

  !> Elastic up to the yield surface or the least pressure (`held`); `share` of the strain is used.
  pure subroutine elastic_part(sand, strain, y, share, held)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: y(sand_size)
    real(wp), intent(out) :: share
    logical, intent(out) :: held
    real(wp) :: there(sand_size), fall, root, far, low

    root = sqrt(trace(y(:6))/3.0_wp)
    call elastic_path(sand, strain, y, there, fall)
    share = 1.0_wp
    held = fall < sqrt(sand%least)
    if (held) then
      share = max(0.0_wp, (root - sqrt(sand%least))/(root - fall))
      call elastic_path(sand, share*strain, y, there, fall)
      there(:6) = there(:6) + (max(fall, sqrt(sand%least))**2 - trace(there(:6))/3.0_wp)*unit
    end if
    if (yield_ratio(sand, there) > 0.0_wp) then
      held = .false.
      far = share
      low = 0.0_wp
      if (yield_ratio(sand, y) > -on_surface) low = min(far, closest_share(sand, strain, y))
      call cross(sand, strain, y, low, far, share)
      call elastic_path(sand, share*strain, y, there, fall)
    end if
    y = there
  end subroutine elastic_part

  !> Share of an elastic increment at which the stress is nearest to the axis of the yield surface.
  pure real(wp) function closest_share(sand, strain, y)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), y(sand_size)
    real(wp) :: there(sand_size), fall, from(6), to(6)
    call elastic_path(sand, nudge*strain, y, there, fall)
    from = y(:6) - trace(y(:6))/3.0_wp*(unit + y(at_alpha:at_alpha + 5))
    to = (there(:6) - trace(there(:6))/3.0_wp*(unit + y(at_alpha:at_alpha + 5)) - from)/nudge
    closest_share = max(nudge, -sum(twice*from*to)/max(sum(twice*to*to), tiny(1.0_wp)))
  end function closest_share

  !> Share at which an elastic increment meets the yield surface between two (Pegasus).
  pure subroutine cross(sand, strain, y, low, far, share)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), y(sand_size), low, far
    real(wp), intent(out) :: share
    real(wp) :: a, b, fa, fb, f
    integer(i4) :: k
    a = low
    b = far
    fa = ratio_at(a)
    fb = ratio_at(b)
    share = a
    if (fa >= 0.0_wp) return
    do k = 1, most_trials
      share = b - fb*(b - a)/(fb - fa)
      f = ratio_at(share)
      if (abs(f) <= found .or. abs(b - a) <= epsilon(1.0_wp)) return
      if (f*fb < 0.0_wp) then
        a = b
        fa = fb
      else
        fa = fa*fb/(fb + f)
      end if
      b = share
      fb = f
    end do
  contains
    pure real(wp) function ratio_at(part)
      real(wp), intent(in) :: part
      real(wp) :: there(sand_size), fall
      call elastic_path(sand, part*strain, y, there, fall)
      ratio_at = yield_ratio(sand, there)
    end function ratio_at
  end subroutine cross

  !> Sub-steps on the yield surface, as long as the strain leads out of it.
  pure subroutine yielding_part(sand, strain, y, start, record, share, held)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: y(sand_size), start(6)
    type(sand_record_type), intent(inout) :: record
    real(wp), intent(out) :: share
    logical, intent(out) :: held
    real(wp) :: step, fault, there(sand_size)
    logical :: again

    share = 0.0_wp
    step = 1.0_wp
    held = .false.
    call turn(sand, y, start)
    do while (share < 1.0_wp)
      again = record%known .and. record%next <= record%count
      if (again) step = min(record%size_of(record%next), 1.0_wp - share)
      call sub_step(sand, step*strain, y, start, .not. again, there, fault)
      if (.not. fault <= 1.0_wp .and. (again .or. step <= smallest)) then
        held = fault >= huge(1.0_wp)
        record%lost = .not. (held .or. again)
        if (held .or. record%lost) return
      else if (.not. fault <= 1.0_wp) then
        step = 0.5_wp*step
        cycle
      end if
      record%lost = record%next >= most_steps
      if (record%lost) return
      if (.not. record%known) record%count = record%next
      if (.not. record%known) record%size_of(record%next) = step
      record%next = record%next + 1
      share = share + step
      y = there
      call settle(sand, y)
      if (share < 1.0_wp .and. .not. loads(sand, strain, y, start)) return
      call turn(sand, y, start)
      if (fault < easy .and. modulo(share, 2.0_wp*step) <= 0.0_wp) step = 2.0_wp*step
    end do
  end subroutine yielding_part

  !> One sub-step and its error over the limit, huge where the pressure falls below the least. One
  !! that is not stable is refused before its error shows it: whether that is just below its limit
  !! would hang on the last digits of the strain, and Newton's method around the point would stop.
  pure subroutine sub_step(sand, strain, y, start, choose, there, fault)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6), y(sand_size), start(6)
    logical, intent(in) :: choose  !! may the sub-step be refused?
    real(wp), intent(out) :: there(sand_size), fault
    real(wp) :: rate(sand_size, stages), off(sand_size), drive, fast, p
    integer(i4) :: k
    there = y
    do k = 1, stages
      call rates(sand, strain, there, start, rate(:, k), drive, fast)
      if (k == 1) fault = fast
      if (k == 1 .and. choose .and. fast > stable) return
      if (k < stages) there = y + matmul(rate(:, :k), tableau(k, :k))
    end do
    p = trace(there(:6))/3.0_wp
    fault = huge(1.0_wp)
    if (.not. p > sand%least) return
    off = matmul(rate, difference)
    fault = max(magnitude(off(:6))/p, magnitude(off(at_alpha:at_alpha + 5)), &
                magnitude(off(at_fabric:at_fabric + 5))/max(sand%fabric_limit, 1.0_wp), &
                abs(off(at_void)), magnitude(off(at_flow:)))/accuracy
  end subroutine sub_step

  !> Bring the yield surface to the stress.
  pure subroutine settle(sand, y)
    type(sand_type), intent(in) :: sand
    real(wp), intent(inout) :: y(sand_size)
    real(wp) :: ratio(6), n(6)
    if (yield_ratio(sand, y) < -sand%opening*nudge) return  ! an elastic end
    ratio = 3.0_wp*y(:6)/trace(y(:6)) - unit
    n = ratio - y(at_alpha:at_alpha + 5)
    y(at_alpha:at_alpha + 5) = ratio - sqrt(2.0_wp/3.0_wp)*sand%opening*n/magnitude(n)
  end subroutine settle

  !> A loading begins where it turns against the last one.
  pure subroutine turn(sand, y, start)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_size)
    real(wp), intent(inout) :: start(6)
    real(wp) :: n(6)
    n = 3.0_wp*y(:6)/trace(y(:6)) - unit - y(at_alpha:at_alpha + 5)
    if (sum(twice*(y(at_alpha:at_alpha + 5) - start)*n) < 0.0_wp) &
      start = y(at_alpha:at_alpha + 5)
  end subroutine turn

  !> Hold the point at the least pressure; the strain that is left is plastic.
  pure subroutine hold(sand, strain, y)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: y(sand_size)
    y(:6) = sand%least*(unit + y(at_alpha:at_alpha + 5))
    y(at_void) = (1.0_wp + y(at_void))*exp(-trace(strain)) - 1.0_wp
    y(at_flow:) = y(at_flow:) + strain
  end subroutine hold
end module fem_sanisand_path
