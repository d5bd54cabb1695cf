!> Law of Mindlin and Deresiewicz: closed shapes of loading, unloading, reloading, of changing
!! normal
!! force, and the energy that loops lose.
program test_dem_turning
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, test_type
  use dem_additional_state, only: turning_reals, turning_knots
  use dem_state, only: lanes
  use dem_turning, only: drop_turning
  use dem_turning_springs, only: springs_step_type, springs_mark
  use dem_turning_block, only: advance_turnings
  implicit none
  type(test_type) :: test
  real(wp), parameter :: e_star = 1.0e9_wp, g_star = 2.9e8_wp, radius = 2.0e-3_wp, mu = 0.3_wp
  real(wp), parameter :: deep = 4.0e-6_wp
  integer(i4), parameter :: lane = 5  !! of the contact; the others of its block are open
  type(springs_step_type) :: step
  real(wp) :: row(turning_reals), force(3), last(3), slipped, worked

  step%shift = 0.0_wp
  step%normal = spread([0.0_wp, 0.0_wp, 1.0_wp], 1, lanes)
  step%spin = 0.0_wp
  step%overlap = -1.0e-4_wp
  step%root = sqrt(radius)
  step%stiffness = 8.0_wp*g_star
  step%cone = mu*e_star/(4.0_wp*g_star)
  call check_loading()
  call check_cycle()
  call check_nested()
  call check_normal()
  call check_oblique()
  call check_circle()
  call check_bent()
  call check_turn()
  call test%finish()

contains

  !> Hertz force at an overlap [N].
  pure real(wp) function hertz(overlap)
    real(wp), intent(in) :: overlap
    hertz = 4.0_wp/3.0_wp*e_star*sqrt(radius)*max(overlap, 0.0_wp)**1.5_wp
  end function hertz

  !> Normal load without tangential load.
  subroutine press(overlap)
    real(wp), intent(in) :: overlap
    row = 0.0_wp
    slipped = 0.0_wp
    worked = 0.0_wp
    last = 0.0_wp
    call go([0.0_wp, 0.0_wp, 0.0_wp], overlap, 1)
  end subroutine press

  !> Move on in equal steps to an overlap, by a tangential displacement; work and slip add up.
  subroutine go(shift, overlap, steps)
    real(wp), intent(in) :: shift(3), overlap
    integer(i4), intent(in) :: steps
    real(wp) :: from, slip(lanes), kept(lanes, turning_reals), forces(lanes, 3)
    integer(i4) :: k
    from = row(3)
    kept = 0.0_wp
    kept(lane, :) = row
    step%shift(lane, :) = shift/steps
    do k = 1, steps
      step%overlap(lane) = from + (overlap - from)*k/steps
      call advance_turnings(step%overlap > -1.0e-5_wp, step, kept, forces, slip)
      force = forces(lane, :)
      row = kept(lane, :)
      worked = worked + 0.5_wp*dot_product(last + force, step%shift(lane, :))
      slipped = slipped + slip(lane)
      last = force
    end do
  end subroutine go

  !> Force of a first loading by the displacement u at an overlap [N].
  pure real(wp) function loaded(u, overlap)
    real(wp), intent(in) :: u, overlap
    loaded = mu*(hertz(overlap) - hertz(overlap - u*4.0_wp*g_star/(mu*e_star)))
  end function loaded

  !> First loading, in one step and in many, to sliding.
  subroutine check_loading()
    real(wp) :: whole, n
    whole = mu*e_star/(4.0_wp*g_star)*deep
    n = hertz(deep)
    call press(deep)
    call go([0.3_wp*whole, 0.0_wp, 0.0_wp], deep, 1)
    call test%check_close('loading in one step', force(1)/(mu*n), 1.0_wp - 0.7_wp**1.5_wp, &
                          1.0e-14_wp)
    call press(deep)
    call go([0.3_wp*whole, 0.0_wp, 0.0_wp], deep, 137)
    call test%check_close('loading in many', force(1)/(mu*n), 1.0_wp - 0.7_wp**1.5_wp, 1.0e-13_wp)
    call test%check('one knot in between', nint(row(1)) == 3)
    call go([1.7_wp*whole, 0.0_wp, 0.0_wp], deep, 1700)
    call test%check_close('sliding', force(1)/(mu*n), 1.0_wp, 1.0e-14_wp)
    call test%check_close('work of loading', worked, slipped + row(2), 1.0e-6_wp*worked)
  end subroutine check_loading

  !> A loop between +- 0.7 mu N: its curve and what it loses.
  subroutine check_cycle()
    real(wp), parameter :: top = 0.7_wp
    real(wp) :: u, n, part, before, expected
    u = mu*e_star/(4.0_wp*g_star)*deep*(1.0_wp - (1.0_wp - top)**(2.0_wp/3.0_wp))
    n = hertz(deep)
    call press(deep)
    call go([u, 0.0_wp, 0.0_wp], deep, 100)
    call test%check_close('turning point', force(1)/(mu*n), top, 1.0e-13_wp)
    before = slipped
    call go([-0.8_wp*u, 0.0_wp, 0.0_wp], deep, 700)
    part = top - 2.0_wp*loaded(0.4_wp*u, deep)/(mu*n)
    call test%check_close('unloading', force(1)/(mu*n), part, 1.0e-13_wp)
    call go([-1.2_wp*u, 0.0_wp, 0.0_wp], deep, 700)
    call test%check_close('back at the other side', force(1)/(mu*n), -top, 1.0e-13_wp)
    call go([2.0_wp*u, 0.0_wp, 0.0_wp], deep, 1400)
    call test%check_close('closed', force(1)/(mu*n), top, 1.0e-13_wp)
    call test%check('the loop leaves one knot', nint(row(1)) == 3)
    expected = 1.0_wp - (1.0_wp - top)**(5.0_wp/3.0_wp) &
               - 5.0_wp/6.0_wp*top*(1.0_wp + (1.0_wp - top)**(2.0_wp/3.0_wp))
    expected = expected*7.2_wp*(mu*n)**2/(step%stiffness*sqrt(radius*deep))
    call test%check_close('loss of the loop', (slipped - before)/expected, 1.0_wp, 1.0e-4_wp)
  end subroutine check_cycle

  !> An inner loop closes and is forgotten; more turning points than are kept cost little.
  subroutine check_nested()
    real(wp) :: u, straight, amplitude, exact
    integer(i4) :: k
    u = 0.5_wp*mu*e_star/(4.0_wp*g_star)*deep
    call press(deep)
    call go([u, 0.0_wp, 0.0_wp], deep, 10)
    straight = force(1)
    call press(deep)
    call go([0.8_wp*u, 0.0_wp, 0.0_wp], deep, 10)
    call go([-0.3_wp*u, 0.0_wp, 0.0_wp], deep, 7)
    call go([0.1_wp*u, 0.0_wp, 0.0_wp], deep, 7)
    call go([-0.1_wp*u, 0.0_wp, 0.0_wp], deep, 7)
    call test%check('turning points are kept', nint(row(1)) == 4)
    call go([0.5_wp*u, 0.0_wp, 0.0_wp], deep, 7)
    call test%check_close('closed loops are forgotten', force(1)/straight, 1.0_wp, 1.0e-13_wp)
    call press(deep)
    call go([u, 0.0_wp, 0.0_wp], deep, 1)
    exact = force(1)
    do k = 1, 24
      amplitude = u*2.0_wp*(1.0_wp - k/25.0_wp)
      call go([(-1)**k*amplitude, 0.0_wp, 0.0_wp], deep, 1)
      exact = exact + (-1)**k*2.0_wp*loaded(0.5_wp*amplitude, deep)
    end do
    call test%check('no more knots than there is room', nint(row(1)) <= turning_knots)
    call test%check_close('many turning points', force(1)/hertz(deep), exact/hertz(deep), &
                          1.0e-4_wp)
  end subroutine check_nested

  !> Normal force that grows or decreases under a tangential displacement (Mindlin and Deresiewicz).
  subroutine check_normal()
    real(wp) :: u, whole, expected
    whole = mu*e_star/(4.0_wp*g_star)
    u = 0.4_wp*whole*deep
    call press(deep)
    call go([u, 0.0_wp, 0.0_wp], deep, 5)
    call go([0.0_wp, 0.0_wp, 0.0_wp], 1.7_wp*deep, 60)
    call test%check_close('pressed on: the force stays', force(1)/hertz(deep), &
                          loaded(u, deep)/hertz(deep), 1.0e-13_wp)
    ! what slipped is stuck now: it slips again from where the two cones meet
    call go([u, 0.0_wp, 0.0_wp], 1.7_wp*deep, 40)
    expected = loaded(u, 1.7_wp*deep) + loaded(u, deep)
    if (u > whole*0.7_wp*deep) expected = loaded(2.0_wp*u, 1.7_wp*deep)
    call test%check_close('and loaded again', force(1)/hertz(deep), expected/hertz(deep), &
                          1.0e-13_wp)
    call press(deep)
    call go([u, 0.0_wp, 0.0_wp], deep, 200)
    call go([0.0_wp, 0.0_wp, 0.0_wp], 0.7_wp*deep, 60)
    call test%check_close('let go: as if loaded at the lower overlap', force(1)/hertz(deep), &
                          loaded(u, 0.7_wp*deep)/hertz(deep), 1.0e-13_wp)
    call go([0.0_wp, 0.0_wp, 0.0_wp], 0.2_wp*deep, 60)
    call test%check_close('let go until it slides', force(1)/hertz(deep), &
                          mu*hertz(0.2_wp*deep)/hertz(deep), 1.0e-13_wp)
    call test%check_close('unloading under a held displacement loses what was stored', &
                          worked, slipped + row(2), 1.0e-5_wp*worked)
    call drop_turning(row, u)
    call test%check('nothing is left', all(abs(row) <= 0.0_wp) .and. u > 0.0_wp)
  end subroutine check_normal

  !> Force and displacement that grow together: without slip below the angle of friction, sliding
  !! above it.
  subroutine check_oblique()
    real(wp) :: whole
    whole = mu*e_star/(4.0_wp*g_star)
    call press(0.0_wp)
    call go([0.8_wp*whole*deep, 0.0_wp, 0.0_wp], deep, 300)
    call test%check_close('oblique, no slip', force(1)/(mu*hertz(deep)), 0.8_wp, 1.0e-12_wp)
    call test%check_close('oblique, no loss', slipped/worked, 0.0_wp, 1.0e-12_wp)
    call press(0.0_wp)
    call go([1.3_wp*whole*deep, 0.0_wp, 0.0_wp], deep, 300)
    call test%check_close('oblique, sliding', force(1)/(mu*hertz(deep)), 1.0_wp, 1.0e-12_wp)
  end subroutine check_oblique

  !> A displacement along a curve: force and work against finer steps, nothing gained.
  subroutine check_circle()
    integer(i4) :: steps, k, j
    real(wp) :: found(3, 3), left(2), phi, u, over
    u = 0.6_wp*mu*e_star/(4.0_wp*g_star)*deep
    do j = 1, 2
      steps = 100*8**j
      call press(deep)
      do k = 1, steps
        phi = 8.0_wp*k/steps
        over = deep*(1.0_wp + 0.4_wp*sin(1.7_wp*phi))
        call go(u*8.0_wp/steps*[cos(phi), sin(phi), 0.0_wp], over, 1)
      end do
      found(:, j) = force/hertz(over)
      left(j) = (worked - slipped - row(2))/worked
    end do
    call test%check('a curved path converges', &
                    sqrt(sum((found(:, 1) - found(:, 2))**2)) < 5.0e-3_wp)
    call test%check_close('its work', left(2), 0.0_wp, 2.0e-3_wp)
    call test%check('below the cone', sqrt(sum(force**2)) <= mu*hertz(over)*(1.0_wp + 1.0e-14_wp))
  end subroutine check_circle

  !> A path that bends, under a normal force that changes, against 2000 springs written apart; as
  !! good after many steps as after few, and the work is stored or lost.
  subroutine check_bent()
    integer(i4), parameter :: many = 2000
    real(wp) :: x(many), w(3, many), shift(3), whole, over, deepest, off(2), phi, found(3), apart
    integer(i4) :: j, k, steps
    whole = mu*e_star/(4.0_wp*g_star)*deep
    deepest = 1.6_wp*deep
    do j = 1, many
      x(j) = sqrt(radius*deepest)*(j - 0.5_wp)/many
    end do
    do k = 1, 2
      steps = 250*16**(k - 1)
      w = 0.0_wp
      off(k) = 0.0_wp
      call press(deep)
      do j = 1, steps
        phi = 12.0_wp*j/steps
        shift = whole*12.0_wp/steps*[0.9_wp*cos(3.1_wp*phi), 0.7_wp*sin(2.3_wp*phi), 0.0_wp]
        over = deep*(1.0_wp + 0.5_wp*sin(1.7_wp*phi))
        call go(shift, over, 1)
        call step_springs(x, w, shift, over, found)
        found = found*step%stiffness*sqrt(radius*deepest)/many
        off(k) = larger(off(k), sqrt(sum((force - found)**2))/(mu*hertz(deep)))
      end do
      call test%check('springs keep the bent path', nint(row(1)) == nint(springs_mark))
      apart = abs(worked - slipped - row(2))/worked
      call test%check('work of a bent path', apart < 1.0e-3_wp)
    end do
    call test%check('a bent path, few steps', off(1) < 1.0e-2_wp)
    call test%check('a bent path, many steps', off(2) < 1.0e-2_wp)
    call go([0.0_wp, 0.0_wp, 0.0_wp], 40.0_wp*deep, 3)
    call go([0.0_wp, 0.0_wp, 0.0_wp], 40.0_wp*deep, 1)
    apart = sqrt(sum((force - last)**2))
    call test%check('pressed on deep: the force stays', apart < 1.0e-12_wp*mu*hertz(deep))
    call go([0.0_wp, 0.0_wp, 0.0_wp], 0.01_wp*deep, 30)
    call test%check('let go: below the cone', sqrt(sum(force**2)) &
                    <= mu*hertz(0.01_wp*deep)*(1.0_wp + 1.0e-12_wp))
    call go([0.0_wp, 0.0_wp, 0.0_wp], deep, 400)
    call go(16.0_wp*whole*[0.6_wp, 0.8_wp, 0.0_wp], deep, 400)
    call test%check_close('sliding: friction of Hertz''s force', &
                          sqrt(sum(force**2))/(mu*hertz(deep)), 1.0_wp, 1.0e-12_wp)
  end subroutine check_bent

  !> One step of springs side by side at x; the sum of their deflections.
  subroutine step_springs(x, w, shift, over, total)
    real(wp), intent(in) :: x(:), shift(3), over
    real(wp), intent(inout) :: w(:, :)
    real(wp), intent(out) :: total(3)
    real(wp) :: limit, length
    integer(i4) :: j
    total = 0.0_wp
    do j = 1, size(x)
      w(:, j) = w(:, j) + shift
      limit = max(step%cone*(over - x(j)**2/radius), 0.0_wp)
      length = sqrt(sum(w(:, j)**2))
      if (length > limit) w(:, j) = w(:, j)*(limit/length)
      total = total + w(:, j)
    end do
  end subroutine step_springs

  !> The memory turns with the contact.
  subroutine check_turn()
    real(wp) :: before, was(3)
    call press(deep)
    call go([2.0e-7_wp, 0.0_wp, 0.0_wp], deep, 3)
    call go([-1.0e-7_wp, 0.0_wp, 0.0_wp], deep, 3)
    before = sqrt(sum(force**2))
    step%spin(lane) = 1.0e-3_wp
    call go([0.0_wp, 0.0_wp, 0.0_wp], deep, 1571)
    call test%check_close('turned about the normal', force(2)/before, 1.0_wp, 1.0e-6_wp)
    call test%check_close('length kept', sqrt(sum(force**2))/before, 1.0_wp, 1.0e-12_wp)
    step%spin(lane) = 0.0_wp
    step%normal(lane, :) = [0.0_wp, 0.6_wp, 0.8_wp]
    call go([0.0_wp, 0.0_wp, 0.0_wp], deep, 1)
    call test%check_close('into the new plane', dot_product(force, step%normal(lane, :))/before, &
                          0.0_wp, 1.0e-14_wp)
    ! springs of a bent path, a quarter turn
    step%normal(lane, :) = [0.0_wp, 0.0_wp, 1.0_wp]
    call press(deep)
    call go([2.0e-7_wp, 0.0_wp, 0.0_wp], deep, 3)
    call go([0.0_wp, 1.0e-7_wp, 0.0_wp], deep, 3)
    call test%check('a bent path has springs', row(1) == springs_mark)
    was = force
    step%spin(lane) = 1.0e-3_wp
    call go([0.0_wp, 0.0_wp, 0.0_wp], deep, 1571)
    call test%check_close('springs turned about the normal', &
                          norm2(force - [-was(2), was(1), 0.0_wp])/norm2(was), 0.0_wp, 1.0e-3_wp)
    step%spin(lane) = 0.0_wp
  end subroutine check_turn
end program test_dem_turning
