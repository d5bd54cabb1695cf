!> Steps of grains in a cell: the flow carries them, they move relative to it (theory-dem, cell).
!!
!! In a step a centre goes from x to x + u + dt c, u = (E - 1)(x - o) the displacement of the flow,
!! and c becomes E^-1 c, which is Newton's law where the flow is steady simple shear or the cell is
!! at rest. Contacts see the velocity u/dt + c. The flow's work is counted as boundary work: half of
!! the forces before and half of those after the step times -u, of every body, images too; and what
!! E^-1 does to the kinetic energy. With it the ledger closes as without a cell.
module dem_carry
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type, kind_free, kind_fixed, kind_mirror, kind_member, lanes
  use dem_images, only: place_image
  use dem_integrate, only: motion_type, kick_block, drift_block, work_count
  use dem_integration_block, only: integration_block_type, block_state_type, put_bodies, &
    travel_of_block
  use dem_forces, only: sum_body
  use dem_prescribed, only: drift_prescribed
  implicit none
  private
  public :: start_carried, finish_carried, recall_carried, sum_images, slow_down, lead

contains

  !> First half of a step for the grains of a block, which is loaded.
  subroutine start_carried(d, block, motion, last, state, work, travel)
    type(dem_data_type), intent(inout) :: d
    type(integration_block_type), intent(inout) :: block
    type(motion_type), intent(in) :: motion
    logical, intent(in) :: last
    type(block_state_type), intent(inout) :: state
    real(wp), intent(inout) :: work(work_count)
    real(wp), intent(inout) :: travel  !! since the list was made [m]
    real(wp) :: u(3, lanes), x0(3, lanes)
    integer(i4) :: k, i

    do k = 1, block%count
      u(:, k) = matmul(d%cell%step, state%s%x(k, :) - d%cell%origin)
      x0(:, k) = d%cell%origin + matmul(d%cell%deform, &
                                        d%pairs%reference_x(:, block%low + k) - d%cell%origin)
    end do
    if (block%free_count > 0) then
      call kick_block(block, state, motion, .true., work)
      do k = 1, block%count
        state%s%x(k, :) = state%s%x(k, :) + u(:, k)
        work(4) = work(4) - 0.5_wp*block%free(k)*dot_product(state%f(k, :), u(:, k))
      end do
      call drift_block(block, state, motion%dt)
      call put_bodies(block, state, d%pairs%body, d%grains%shapes)
      associate (low => block%low + 1, high => block%low + block%count)
        travel = travel_of_block(block, state, x0, d%pairs%reference_q(:, low:high), &
                                 d%pairs%reach(low:high))
      end associate
    end if
    do k = 1, block%count
      i = block%low + k
      if (moved_elsewhere(d%grains%kind(i))) cycle
      if (d%grains%kind(i) == kind_free) then
        call slow_down(d%cell%back, motion%mass_scale*block%mass(k), &
                       [state%s%vx(k), state%s%vy(k), state%s%vz(k)], d%grains%v(:, i), work)
      else
        call move_prescribed(d, i, motion%dt, last, u(:, k), x0(:, k), work, travel)
      end if
      d%pairs%body(4:6, i) = d%pairs%body(4:6, i) + u(:, k)/motion%dt
    end do
    travel = travel + d%cell%stretch
    call move_images(d, block, motion%dt, work)
  end subroutine start_carried

  !> Are grains of this kind moved by another rank or with their clump?
  pure logical function moved_elsewhere(kind)
    integer(i4), intent(in) :: kind
    moved_elsewhere = kind == kind_mirror .or. kind == kind_member
  end function moved_elsewhere

  !> Relative velocity in a flow that spreads, E^-1 c, kept with the grain; the flow's work on it.
  pure subroutine slow_down(back, mass, c, kept, work)
    real(wp), intent(in) :: back(3, 3), mass
    real(wp), intent(in) :: c(3)       !! before [m/s]
    real(wp), intent(out) :: kept(3)   !! after [m/s]
    real(wp), intent(inout) :: work(work_count)
    kept = matmul(back, c)
    work(4) = work(4) + 0.5_wp*mass*dot_product(kept + c, kept - c)
  end subroutine slow_down

  !> Velocities relative to the flow, which bodies do not have.
  pure subroutine recall_carried(d, block, state)
    type(dem_data_type), intent(in) :: d
    type(integration_block_type), intent(in) :: block
    type(block_state_type), intent(inout) :: state
    integer(i4) :: k
    do k = 1, block%count
      if (.not. block%free(k) > 0.5_wp) cycle
      state%s%vx(k) = d%grains%v(1, block%low + k)
      state%s%vy(k) = d%grains%v(2, block%low + k)
      state%s%vz(k) = d%grains%v(3, block%low + k)
    end do
  end subroutine recall_carried

  !> A fixed or driven grain: its own motion and that of the flow.
  subroutine move_prescribed(d, i, dt, last, u, x0, work, travel)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: dt
    logical, intent(in) :: last
    real(wp), intent(in) :: u(3)   !! displacement of the flow [m]
    real(wp), intent(in) :: x0(3)  !! to where the flow has carried it since the list was made [m]
    real(wp), intent(inout) :: work(work_count), travel

    call drift_prescribed(d%grains, i, dt, last, d%pairs%body(:, i))
    if (d%grains%kind(i) == kind_fixed) d%pairs%body(4:6, i) = 0.0_wp
    d%grains%x(:, i) = d%grains%x(:, i) + u
    d%pairs%body(1:3, i) = d%grains%x(:, i)
    work(4) = work(4) - 0.5_wp*dot_product(d%grains%force(:, i), u)
    travel = max(travel, norm2(d%grains%x(:, i) - x0) &
                 + 2.0_wp*d%pairs%reach(i)*min(1.0_wp, norm2(d%grains%quat(:, i) &
                                                             - d%pairs%reference_q(:, i))))
  end subroutine move_prescribed

  !> Images follow their grains.
  subroutine move_images(d, block, dt, work)
    type(dem_data_type), intent(inout) :: d
    type(integration_block_type), intent(in) :: block
    real(wp), intent(in) :: dt
    real(wp), intent(inout) :: work(work_count)
    integer(i4) :: k
    if (d%pairs%images == 0) return
    do k = d%pairs%image_start(block%low + 1), d%pairs%image_start(block%low + block%count + 1) - 1
      if (moved_elsewhere(d%grains%kind(d%pairs%grain(d%pairs%plain + k)))) cycle
      call place_image(d%pairs, d%cell, k)
      work(4) = work(4) - 0.5_wp*dt*dot_product(d%pairs%image_force(:, k), lead(d, k))
    end do
  end subroutine move_images

  !> Velocity of an image relative to its grain [m/s].
  pure function lead(d, k) result(v)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k  !! image
    real(wp) :: v(3)
    v = d%pairs%body(4:6, d%pairs%plain + k) - d%pairs%body(4:6, d%pairs%grain(d%pairs%plain + k))
  end function lead

  !> After the new sums of the block's grains: those of their images, and the flow's work.
  subroutine finish_carried(d, block, dt, state, work)
    type(dem_data_type), intent(inout) :: d
    type(integration_block_type), intent(in) :: block
    real(wp), intent(in) :: dt
    type(block_state_type), intent(inout) :: state
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: c(3)
    integer(i4) :: k, i, m

    do k = 1, block%count
      i = block%low + k
      if (moved_elsewhere(d%grains%kind(i))) cycle
      call sum_images(d, i, state%f(k, :), state%m(k, :))
      if (d%pairs%images > 0) then
        do m = d%pairs%image_start(i), d%pairs%image_start(i + 1) - 1
          work(4) = work(4) - 0.5_wp*dt*dot_product(d%pairs%image_force(:, m), lead(d, m))
        end do
      end if
      c = d%grains%v(:, i)
      work(4) = work(4) - 0.5_wp*dt*dot_product(state%f(k, :), d%pairs%body(4:6, i) - c)
    end do
  end subroutine finish_carried

  !> Add what acts on the images of grain i, in the order of their shifts.
  subroutine sum_images(d, i, force, moment)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(inout) :: force(3), moment(3)  !! [N], [N m]
    real(wp) :: f(3), m(3)
    integer(i4) :: k
    if (d%pairs%images == 0) return
    do k = d%pairs%image_start(i), d%pairs%image_start(i + 1) - 1
      call sum_body(d%pairs, d%pairs%plain + k, f, m)
      d%pairs%image_force(:, k) = f
      force = force + f
      moment = moment + m
    end do
  end subroutine sum_images
end module dem_carry
