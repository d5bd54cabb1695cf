!> Time steps and events: grid, automatic step, blocks that a stop in between does not shift.
program test_dem_clock
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use dem_clock, only: dem_clock_type, event_history, event_output, event_checkpoint, &
    event_opening, interval_ends
  implicit none

  type(test_type) :: test

  call fixed_step()
  call automatic_step()
  call blocks()
  call intervals()
  call test%finish()

contains

  !> 1000 rows of 10 steps each, no rounding gathered.
  subroutine fixed_step()
    type(dem_clock_type) :: clock
    integer(i4) :: rows

    clock%t_end = 1.0e-2_wp
    call clock%start_at(0.0_wp, 1.0e-6_wp)
    call clock%set_events([1.0e-5_wp, 5.0e-3_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    rows = 0
    do while (.not. clock%finished())
      call clock%advance(clock%steps_ahead(100_i4, clock%t_end))
      if (.not. clock%due(event_history)) cycle
      rows = rows + 1
      call clock%passed(event_history)
    end do
    call test%check('1000 rows', rows == 1000)
    call test%check('10000 steps', clock%steps == 10000_i8)
    call test%check_close('the end', clock%time(), 1.0e-2_wp, 0.0_wp)
    call test%check('no checkpoints', .not. clock%due(event_checkpoint))
    call test%check('output is due', clock%due(event_output) .and. clock%on_time(event_output))
    call clock%review(1.0e-7_wp, 5.0e-7_wp)
    call test%check('a fixed step above its limit is counted', clock%unstable == 1)
    call test%check_close('and kept', clock%dt, 1.0e-6_wp, 0.0_wp)
  end subroutine fixed_step

  !> An automatic step ends on the grid, shrinks at once and grows slowly.
  subroutine automatic_step()
    type(dem_clock_type) :: clock
    real(wp) :: dt

    clock%automatic = .true.
    clock%t_end = 1.0_wp
    call clock%set_events([1.0e-3_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    dt = clock%chosen_step(3.0e-4_wp)
    call test%check_close('four steps to the grid', dt, 2.5e-4_wp, 1.0e-18_wp)
    call clock%start_at(0.0_wp, dt)
    call clock%advance(4_i4)
    call test%check('on the grid it is reviewed', clock%review_due())
    call clock%review(2.0e-4_wp, 1.0_wp)
    call test%check_close('it shrinks', clock%dt, 2.0e-4_wp, 1.0e-17_wp)
    call clock%advance(5_i4)
    call clock%review(9.0e-4_wp, 1.0_wp)
    call test%check_close('it grows as the grid allows', clock%dt, 2.0e-4_wp, 1.0e-17_wp)
    clock%grid = 0.0_wp
    call test%check_close('without grid two digits', clock%chosen_step(4.4789e-6_wp), 4.4e-6_wp, &
                          1.0e-20_wp)
  end subroutine automatic_step

  !> Blocks end on multiples of their size whatever was in between.
  subroutine blocks()
    type(dem_clock_type) :: clock
    call clock%start_at(0.0_wp, 1.0e-6_wp)
    call clock%set_events([0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    call test%check('stopped by the end', clock%steps_ahead(50_i4, 13.0e-6_wp) == 13)
    call clock%advance(13_i4)
    call test%check('the rest of the block', clock%steps_ahead(50_i4, 1.0_wp) == 37)
    call clock%jump(1.0_wp, 37_i4)
    call test%check_close('a jump', clock%time(), 1.0_wp, 0.0_wp)
    call test%check('a whole block', clock%steps_ahead(50_i4, 2.0_wp) == 50)
  end subroutine blocks

  !> How many intervals of an event have ended, and those of multiples of it.
  subroutine intervals()
    type(dem_clock_type) :: clock
    clock%t_end = 1.0_wp
    call clock%start_at(0.0_wp, 1.0e-3_wp)
    call clock%set_events([0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0e-2_wp])
    call test%check('none yet', .not. clock%due(event_opening))
    call clock%advance(10_i4)
    call test%check('one is due', clock%due(event_opening) .and. &
                    all(clock%turns(event_opening) == [1_i8, 0_i8]))
    call clock%passed(event_opening)
    call clock%advance(25_i4)
    call test%check('two at once', all(clock%turns(event_opening) == [3_i8, 1_i8]))
    call test%check('one of two has ended', interval_ends([3_i8, 1_i8], 2_i8))
    call test%check('none of four', .not. interval_ends([3_i8, 1_i8], 4_i8))
    call test%check('the zeroth of four', interval_ends([0_i8, -1_i8], 4_i8))
  end subroutine intervals
end program test_dem_clock
