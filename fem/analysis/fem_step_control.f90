!> Lengths of the steps of consolidation: they double where the error of Euler's backward rule is
!! far below a target, and halve where it is above. The error is estimated from the difference
!! between the new state and that to which the last two lead on a line.
!! eq. F.32
module fem_step_control
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_h5_shaped, only: get_shaped
  use talus_hdf5, only: h5_file_type
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: step_control_type

  real(wp), parameter :: room = 0.25_wp  !! of the target, below which steps double
  real(wp), parameter :: near = 1.0e-9_wp

  type :: step_control_type
    logical :: active = .false.
    real(wp) :: target = 0.0_wp                 !! error of a step over the largest values so far
    real(wp) :: shortest = 0.0_wp               !! [s]
    real(wp) :: next = 0.0_wp                   !! length of the next step [s]
    real(wp) :: old_dt = 0.0_wp                 !! of the last one, 0: there was none [s]
    real(wp) :: largest(2) = 0.0_wp             !! displacement [m] and pressure [Pa] so far
    real(wp), allocatable, private :: before(:, :)  !! state before the accepted one
  contains
    procedure :: begin
    procedure :: error_of
    procedure :: learn
    procedure :: put
    procedure :: get
  end type step_control_type

contains

  !> Start with steps dt, which are the shortest.
  subroutine begin(self, body, dt)
    class(step_control_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: dt  !! [s]
    if (.not. self%active) return
    self%shortest = dt
    if (allocated(self%before)) return  ! from a checkpoint
    self%next = dt
    self%before = body%accepted%u
  end subroutine begin

  !> Error of the trial step over the target.
  pure real(wp) function error_of(self, body) result(error)
    class(step_control_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp) :: off(2), largest(2), dt
    dt = body%state%time - body%accepted%time
    error = 0.0_wp
    if (.not. self%old_dt > 0.0_wp) return
    associate (n => body%dofs%solid, s => body%state%u, old => body%accepted%u)
      off(1) = maxval(abs(s(:, :n) - old(:, :n) - (old(:, :n) - self%before(:, :n)) &
        *(dt/self%old_dt)))
      off(2) = maxval(abs(s(1, n + 1:) - old(1, n + 1:) - (old(1, n + 1:) &
        - self%before(1, n + 1:))*(dt/self%old_dt)))
      largest = max(self%largest, [maxval(abs(s(:, :n))), maxval(abs(s(1, n + 1:)))])
    end associate
    off = off*dt/(dt + self%old_dt)
    if (any(largest > 0.0_wp)) error = maxval(off/max(largest, tiny(1.0_wp)), &
      mask=largest > 0.0_wp)/self%target
  end function error_of

  !> The trial step is accepted with an `error` over the target; call before it becomes the state.
  subroutine learn(self, body, error)
    class(step_control_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: error
    real(wp) :: dt
    dt = body%state%time - body%accepted%time
    associate (n => body%dofs%solid, s => body%state%u)
      self%largest = max(self%largest, [maxval(abs(s(:, :n))), maxval(abs(s(1, n + 1:)))])
    end associate
    if (error > 1.0_wp) self%next = max(self%shortest, 0.5_wp*self%next)
    if (error < room .and. self%old_dt > 0.0_wp .and. dt > (1.0_wp - near)*self%next) &
      self%next = 2.0_wp*self%next
    self%before = body%accepted%u
    self%old_dt = dt
  end subroutine learn

  !> To a checkpoint.
  subroutine put(self, file, errors)
    class(step_control_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (.not. self%active) return
    call file%put('/state/step_control', [self%next, self%old_dt, self%largest], errors)
    call file%put('/state/before', self%before, errors)
  end subroutine put

  !> From a checkpoint.
  subroutine get(self, body, file, errors)
    class(step_control_type), intent(inout) :: self
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)
    if (.not. self%active) return
    allocate (values(4))
    call file%get_into('/state/step_control', values, errors)
    call get_shaped(file, '/state/before', [3, int(body%dofs%blocks)], self%before, errors)
    if (errors%any()) return
    self%next = values(1)
    self%old_dt = values(2)
    self%largest = values(3:4)
  end subroutine get
end module fem_step_control
