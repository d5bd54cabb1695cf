!> Motion of an overlap from its reference state, of free grains, nodes and ghosts (theory: overlap
!! coupling).
module cpl_overlap_motion
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  implicit none
  private
  public :: overlap_motion_type, nodes_type, increment_type

  !> Where all are, from the reference state.
  type :: overlap_motion_type
    real(wp), allocatable :: q(:, :), theta(:, :)  !! of the free grains (3, free) [m], [rad]
    real(wp), allocatable :: q_before(:, :), theta_before(:, :)  !! a step before
    real(wp), allocatable :: u(:, :), v(:, :)      !! of the nodes (3, nodes) [m], [m/s]
    real(wp), allocatable :: phi(:, :), w(:, :)    !! (3, nodes_phi) [rad], [rad/s]
    real(wp), allocatable :: d(:, :), turn(:, :)   !! of the ghosts (3, ghosts) [m], [rad]
    real(wp), allocatable :: quat(:, :)            !! of the ghosts (4, ghosts)
    real(wp), allocatable :: speed(:, :), spin(:, :)  !! of free grains, half a step ago [m/s]
  contains
    procedure :: init => init_motion
    procedure :: put => put_motion
    procedure :: get => get_motion
    procedure :: count_free
    procedure :: count_ghosts
    procedure :: begin_ghosts
    procedure :: put_ghosts
    procedure :: begin_speed
    procedure :: set_speed
    procedure :: begin_spin
  end type overlap_motion_type

  !> Where the nodes are.
  type :: nodes_type
    real(wp), allocatable :: u(:, :), phi(:, :)        !! (3, nodes) [m], (3, nodes_phi) [rad]
  end type nodes_type

  !> Motion in a step of the grains, for works.
  type :: increment_type
    real(wp), allocatable :: u(:, :), phi(:, :)        !! nodes at its start [m], [rad]
    real(wp), allocatable :: moved(:, :), turns(:, :)  !! of the (active) ghosts, in it
  end type increment_type

contains

  !> Zero motion; quat of the ghosts as they are.
  subroutine init_motion(self, free, nodes, nodes_phi, quat)
    class(overlap_motion_type), intent(inout) :: self
    integer(i4), intent(in) :: free, nodes, nodes_phi
    real(wp), intent(in) :: quat(:, :)  !! (4, ghosts)
    integer(i4) :: ghosts
    ghosts = size(quat, 2, i4)
    allocate (self%q(3, free), self%theta(3, free), self%q_before(3, free), &
              self%theta_before(3, free), self%speed(3, free), self%spin(3, free), source=0.0_wp)
    allocate (self%u(3, nodes), self%v(3, nodes), self%phi(3, nodes_phi), self%w(3, nodes_phi), &
              self%d(3, ghosts), self%turn(3, ghosts), source=0.0_wp)
    self%quat = quat
  end subroutine init_motion

  subroutine put_motion(self, file, errors)
    class(overlap_motion_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/free/q', self%q, errors)
    call file%put('/free/theta', self%theta, errors)
    call file%put('/ghosts/d', self%d, errors)
    call file%put('/ghosts/turn', self%turn, errors)
    call file%put('/ghosts/quat', self%quat, errors)
    call file%put('/nodes/u', self%u, errors)
    call file%put('/nodes/v', self%v, errors)
    call file%put('/rotations/phi', self%phi, errors)
    call file%put('/rotations/w', self%w, errors)
  end subroutine put_motion

  subroutine get_motion(self, file, errors)
    class(overlap_motion_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/free/q', self%q, errors)
    call file%get_into('/free/theta', self%theta, errors)
    call file%get_into('/ghosts/d', self%d, errors)
    call file%get_into('/ghosts/turn', self%turn, errors)
    call file%get_into('/ghosts/quat', self%quat, errors)
    call file%get_into('/nodes/u', self%u, errors)
    call file%get_into('/nodes/v', self%v, errors)
    call file%get_into('/rotations/phi', self%phi, errors)
    call file%get_into('/rotations/w', self%w, errors)
  end subroutine get_motion

  !> Positions in q, and rotations in theta where they matter, become motion from a reference.
  pure subroutine count_free(self, x, theta)
    class(overlap_motion_type), intent(inout) :: self
    real(wp), intent(in) :: x(:, :)                !! (3, free) [m]
    real(wp), intent(in), optional :: theta(:, :)  !! [rad]
    self%q = self%q - x
    if (present(theta)) self%theta = self%theta - theta
  end subroutine count_free

  !> The same of positions in d, and of rotations in turn.
  pure subroutine count_ghosts(self, x, theta)
    class(overlap_motion_type), intent(inout) :: self
    real(wp), intent(in) :: x(:, :)                !! (3, ghosts) [m]
    real(wp), intent(in), optional :: theta(:, :)  !! [rad]
    self%d = self%d - x
    if (present(theta)) self%turn = self%turn - theta
  end subroutine count_ghosts

  !> Hand over the motion of the ghosts and make room for what comes next, by put_ghosts.
  pure subroutine begin_ghosts(self, d, turn)
    class(overlap_motion_type), intent(inout) :: self
    real(wp), allocatable, intent(inout) :: d(:, :), turn(:, :)  !! until now (3, ghosts)
    integer(i4) :: n
    n = size(self%d, 2, i4)
    call move_alloc(self%d, d)
    call move_alloc(self%turn, turn)
    allocate (self%d(3, n), self%turn(3, n))
  end subroutine begin_ghosts

  !> Motion of some ghosts.
  pure subroutine put_ghosts(self, rows, d, turn)
    class(overlap_motion_type), intent(inout) :: self
    integer(i4), intent(in) :: rows(:)
    real(wp), intent(in) :: d(:, :), turn(:, :)  !! (3, size(rows)) [m], [rad]
    integer(i4) :: i
    do i = 1, size(rows)
      self%d(:, rows(i)) = d(:, i)
      self%turn(:, rows(i)) = turn(:, i)
    end do
  end subroutine put_ghosts

  !> Velocities of all nodes, and of those with micro-rotations their rates.
  pure subroutine set_speed(self, v, w)
    class(overlap_motion_type), intent(inout) :: self
    real(wp), intent(in) :: v(:, :), w(:, :)  !! (3, nodes) [m/s], (3, nodes_phi) [rad/s]
    self%v = v
    self%w = w
  end subroutine set_speed

  !> Velocities of the edge, which comes after so many prescribed nodes.
  pure subroutine begin_speed(self, prescribed, v)
    class(overlap_motion_type), intent(inout) :: self
    integer(i4), intent(in) :: prescribed
    real(wp), intent(in) :: v(:, :)  !! (3, edge) [m/s]
    self%v(:, prescribed + 1:) = v
  end subroutine begin_speed

  !> The same of its micro-rotations.
  pure subroutine begin_spin(self, prescribed_phi, w)
    class(overlap_motion_type), intent(inout) :: self
    integer(i4), intent(in) :: prescribed_phi
    real(wp), intent(in) :: w(:, :)  !! [rad/s]
    self%w(:, prescribed_phi + 1:) = w
  end subroutine begin_spin
end module cpl_overlap_motion
