!> The law of Mindlin and Deresiewicz for a block of contacts: chains of knots as long as paths are
!! straight (dem_turning), lane by lane, and springs at fixed places once they bend
!! (dem_turning_springs), all lanes at once.
module dem_turning_block
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes
  use dem_additional_state, only: turning_reals
  use dem_turning, only: turning_step_type, advance_turning, drop_turning, path_bends
  use dem_turning_springs, only: springs_step_type, advance_springs, start_springs, springs_mark
  implicit none
  private
  public :: advance_turnings

contains

  !> A step of a block: forces on B and what slip dissipates, 0 of lanes without contact.
  pure subroutine advance_turnings(touches, step, kept, force, slip)
    logical, intent(in) :: touches(lanes)           !! there is an overlap at the end of the step
    type(springs_step_type), intent(inout) :: step  !! `on` is found here
    real(wp), intent(inout) :: kept(lanes, turning_reals)
    real(wp), intent(out) :: force(lanes, 3)        !! [N]
    real(wp), intent(out) :: slip(lanes)            !! [J]
    real(wp) :: row(turning_reals)
    integer(i4) :: k

    force = 0.0_wp
    slip = 0.0_wp
    step%on = touches .and. kept(:, 1) >= springs_mark
    do k = 1, lanes
      if (step%on(k) .or. .not. (touches(k) .or. kept(k, 1) > 0.0_wp)) cycle
      row = kept(k, :)
      if (.not. touches(k)) then
        call drop_turning(row, slip(k))
      else if (path_bends(step%shift(k, :), row)) then
        call start_springs(step%stiffness*step%root(k), row)
        step%on(k) = .true.
      else
        call straight_step(step, k, row, force(k, :), slip(k))
      end if
      kept(k, :) = row
    end do
    if (any(step%on)) call advance_springs(step, kept, force, slip)
  end subroutine advance_turnings

  !> A step of lane k along a straight path.
  pure subroutine straight_step(block, k, row, force, slip)
    type(springs_step_type), intent(in) :: block
    integer(i4), intent(in) :: k
    real(wp), intent(inout) :: row(turning_reals)
    real(wp), intent(out) :: force(3), slip
    type(turning_step_type) :: step
    step%shift = block%shift(k, :)
    step%normal = block%normal(k, :)
    step%spin = block%spin(k)
    step%overlap = block%overlap(k)
    step%root = block%root(k)
    step%stiffness = block%stiffness
    step%cone = block%cone
    call advance_turning(step, row, force, slip)
  end subroutine straight_step
end module dem_turning_block
