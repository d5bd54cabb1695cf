!> Motion of fixed, driven and ghost grains, and the work and impulse of the forces that move them.
module dem_prescribed
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_grains_type, kind_fixed, body_size
  use dem_ellipsoid, only: rotation_of, shape_matrix, quaternion_product
  use dem_shape_state, only: shape_ellipsoid, put_frame
  use dem_integrate, only: work_count
  implicit none
  private
  public :: put_body, drift_prescribed, finish_prescribed

contains

  !> Body record of a grain; a shape is there as its bounding sphere.
  pure subroutine put_body(g, i, body)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(inout) :: body(body_size)
    body(1:3) = g%x(:, i)
    body(4:6) = g%v(:, i)
    body(7:9) = g%omega(:, i)
    if (maxval(g%axes(:, i)) > minval(g%axes(:, i))) then
      body(10:15) = shape_matrix(rotation_of(g%quat(:, i)), g%axes(:, i))
    else
      body(10:12) = g%axes(:, i)**2
      body(13:15) = 0.0_wp
    end if
    body(16) = product(g%axes(:, i)**2)
    if (.not. g%shapes%in_use) return
    if (g%shapes%kind(i) == shape_ellipsoid) return
    body(10:12) = g%radius(i)**2
    body(13:15) = 0.0_wp
  end subroutine put_body

  !> Move a prescribed grain by dt with its velocity and spin; the last step ends on the target.
  pure subroutine drift_prescribed(g, i, dt, last, body)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: dt
    logical, intent(in) :: last
    real(wp), intent(inout) :: body(:)
    real(wp) :: q(4)

    if (g%kind(i) == kind_fixed) return
    g%x(:, i) = g%x(:, i) + dt*g%v(:, i)
    q = quaternion_product(g%turn(:, i), g%quat(:, i))
    q = q/sqrt(q(1)*q(1) + q(2)*q(2) + q(3)*q(3) + q(4)*q(4))
    g%quat(:, i) = q
    g%theta(:, i) = g%theta(:, i) + dt*g%omega(:, i)
    if (last .and. g%has_target(i)) then
      g%x(:, i) = g%target_x(:, i)
      g%quat(:, i) = g%target_quat(:, i)
    end if
    call put_body(g, i, body)
    call put_frame(g%shapes, i, g%quat(:, i))
  end subroutine drift_prescribed

  !> New contact force and moment are in: impulse of the step and work of the prescription, each
  !! with the mean of the forces at both ends, as the free grains see them.
  pure subroutine finish_prescribed(g, i, dt, force, moment, work)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: dt
    real(wp), intent(in) :: force(3), moment(3)  !! new contact force and moment [N, N m]
    real(wp), intent(inout) :: work(work_count)
    real(wp) :: mean_force(3), mean_moment(3), done

    mean_force = 0.5_wp*dt*(g%force(:, i) + force)
    mean_moment = 0.5_wp*dt*(g%moment(:, i) + moment)
    g%force(:, i) = force
    g%moment(:, i) = moment
    g%impulse(:, i) = g%impulse(:, i) + mean_force
    g%moment_impulse(:, i) = g%moment_impulse(:, i) + mean_moment
    if (g%kind(i) == kind_fixed) return
    done = -dot_product(mean_force, g%v(:, i)) - dot_product(mean_moment, g%omega(:, i))
    g%work(i) = g%work(i) + done
    work(4) = work(4) + done
  end subroutine finish_prescribed
end module dem_prescribed
