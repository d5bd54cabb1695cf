!> Groups of nodes that move as a rigid body: a turn about an axis through a centre and a shift of
!! the centre, both by curves. A component of the shift can be free: then it is that of a mass under
!! a force and those of the body, v1 = v0 + dt (F - R)/m, x1 = x0 + dt v1, with the force and the
!! reactions R at the start of the step (stable for dt < 2/omega of the mass on the body).
module fem_rigid
  use talus_kinds, only: wp, i4
  use talus_curve, only: curve_type
  use talus_vectors, only: cross
  implicit none
  private
  public :: fem_rigid_type, place_rigid, push_rigid, moment_of

  type :: fem_rigid_type
    integer(i4), allocatable :: node(:)
    character(len=64) :: name = ''         !! of the group
    real(wp) :: centre(3) = 0.0_wp, axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]  !! [m], unit vector
    integer(i4) :: turn = 0                !! curve of the angle [rad], 0: none
    integer(i4) :: shift(3) = 0            !! curves of the centre [m], 0: none
    logical :: free(3) = .false.
    real(wp) :: mass = 0.0_wp              !! of what is free [kg]
    real(wp) :: force(3) = 0.0_wp          !! on it [N]
    integer(i4) :: curve = 0               !! of the force
    real(wp) :: d(3) = 0.0_wp, v(3) = 0.0_wp                !! free shift of the trial [m], [m/s]
    real(wp) :: accepted_d(3) = 0.0_wp, accepted_v(3) = 0.0_wp
  end type fem_rigid_type

contains

  !> Shift of the centre [m] and angle [rad] at time t.
  pure subroutine pose_of(rigid, curve, t, shift, angle)
    type(fem_rigid_type), intent(in) :: rigid
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: t
    real(wp), intent(out) :: shift(3), angle
    integer(i4) :: c
    angle = 0.0_wp
    if (rigid%turn > 0) angle = curve(rigid%turn)%at(t)
    shift = 0.0_wp
    do c = 1, 3
      if (rigid%shift(c) > 0) shift(c) = curve(rigid%shift(c))%at(t)
      if (rigid%free(c)) shift(c) = rigid%d(c)
    end do
  end subroutine pose_of

  !> Put the displacements of the nodes at time t into u: (R - 1)(X - centre) + shift.
  pure subroutine place_rigid(rigid, curve, x, t, u)
    type(fem_rigid_type), intent(in) :: rigid
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: x(:, :), t       !! (3, nodes) [m], [s]
    real(wp), intent(inout) :: u(:, :)       !! (3, blocks) [m]
    real(wp) :: shift(3), angle, arm(3), across(3)
    integer(i4) :: k
    call pose_of(rigid, curve, t, shift, angle)
    do k = 1, size(rigid%node)
      arm = x(:, rigid%node(k)) - rigid%centre
      across = cross(rigid%axis, arm)
      u(:, rigid%node(k)) = shift + sin(angle)*across &
        + (1.0_wp - cos(angle))*cross(rigid%axis, across)
    end do
  end subroutine place_rigid

  !> Free components from the accepted state at t0 to t1.
  pure subroutine push_rigid(rigid, curve, reaction, t0, t1)
    type(fem_rigid_type), intent(inout) :: rigid
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: reaction(:, :)   !! (3, blocks) at t0, on the body [N]
    real(wp), intent(in) :: t0, t1           !! [s]
    real(wp) :: value, push
    integer(i4) :: c
    value = 1.0_wp
    if (rigid%curve > 0) value = curve(rigid%curve)%at(t0)
    do c = 1, 3
      if (.not. rigid%free(c)) cycle
      push = value*rigid%force(c) - sum(reaction(c, rigid%node))
      rigid%v(c) = rigid%accepted_v(c) + (t1 - t0)*push/rigid%mass
      rigid%d(c) = rigid%accepted_d(c) + (t1 - t0)*rigid%v(c)
    end do
  end subroutine push_rigid

  !> Shift [m], angle [rad], force [N] and moment about the centre where it is [N m] with which the
  !! group holds the body.
  pure function moment_of(rigid, curve, x, u, reaction, t) result(row)
    type(fem_rigid_type), intent(in) :: rigid
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: x(:, :), u(:, :), reaction(:, :), t
    real(wp) :: row(10), shift(3), angle, moment(3)
    integer(i4) :: k
    call pose_of(rigid, curve, t, shift, angle)
    moment = 0.0_wp
    do k = 1, size(rigid%node)
      associate (n => rigid%node(k))
        moment = moment + cross(x(:, n) + u(:, n) - rigid%centre - shift, reaction(:, n))
      end associate
    end do
    row = [shift, angle, sum(reaction(:, rigid%node), 2), moment]
  end function moment_of
end module fem_rigid
