!> What paths of classical and micropolar points share: limits of Newton's method, halving of steps,
!! columns of the state.
module fem_point_steps
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use fem_law, only: fem_law_type, common_names, common_size, at_stored, at_numerical
  implicit none
  private
  public :: parts_type, append_states, most_iterations, accuracy, relative, wild

  integer(i4), parameter :: most_iterations = 30
  integer(i4), parameter :: most_halvings = 12
  real(wp), parameter :: accuracy = 1.0e-13_wp   !! of the conditions, in strain
  real(wp), parameter :: relative = 1.0e-12_wp   !! of the strain so far
  real(wp), parameter :: wild = 1.0_wp           !! largest plausible strain increment

  !> An interval of time, halved where a step does not converge. The caller steps to
  !! the goal while there is one and reports its success.
  type :: parts_type
    real(wp) :: now = 0.0_wp      !! time reached [s]
    real(wp) :: goal = 0.0_wp     !! of the next step [s]
    real(wp) :: time = 0.0_wp     !! of the end [s]
    real(wp) :: size_of = 0.0_wp  !! of a step [s]
    real(wp) :: least = 0.0_wp    !! below which the path ends [s]
  contains
    procedure :: begin => begin_parts
    procedure :: has_goal
    procedure :: judge
    procedure, private :: aim
  end type parts_type

contains

  pure subroutine begin_parts(self, now, time)
    class(parts_type), intent(inout) :: self
    real(wp), intent(in) :: now, time  !! [s]
    self%now = now
    self%time = time
    self%size_of = time - now
    self%least = self%size_of*0.5_wp**most_halvings
    call self%aim()
  end subroutine begin_parts

  !> False at the end, and where steps have become too short.
  pure logical function has_goal(self)
    class(parts_type), intent(in) :: self
    has_goal = self%now < self%time .and. .not. self%size_of < self%least
  end function has_goal

  !> Continue from the goal that was reached, or try half the step.
  pure subroutine judge(self, good)
    class(parts_type), intent(inout) :: self
    logical, intent(in) :: good  !! has the step converged?
    if (good) then
      self%now = self%goal
      self%size_of = 2.0_wp*self%size_of
    else
      self%size_of = 0.5_wp*self%size_of
    end if
    call self%aim()
  end subroutine judge

  pure subroutine aim(self)
    class(parts_type), intent(inout) :: self
    self%goal = self%now + self%size_of
    if (self%goal >= self%time - relative*self%size_of) self%goal = self%time
  end subroutine aim

  !> Names of the state of a law, with units, and of the iterations.
  subroutine append_states(law, columns)
    class(fem_law_type), intent(in) :: law
    type(string_type), allocatable, intent(inout) :: columns(:)
    integer(i4) :: k
    do k = 1, law%states
      if (k > common_size) then
        call append_string(columns, law%state_name(k))
      else if (k >= at_stored .and. k <= at_numerical) then
        call append_string(columns, trim(common_names(k))//' [J/m3]')
      else
        call append_string(columns, trim(common_names(k))//' [-]')
      end if
    end do
    call append_string(columns, 'iterations [-]')
  end subroutine append_states
end module fem_point_steps
