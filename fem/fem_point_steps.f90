!> What paths of classical and micropolar points share: limits of Newton's method, halving of steps,
!! columns of the state.
module fem_point_steps
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use fem_law, only: fem_law_type, common_names, common_size, at_stored, at_numerical
  implicit none
  private
  public :: step_in_parts, append_states, most_iterations, accuracy, relative, wild

  integer(i4), parameter :: most_iterations = 30
  integer(i4), parameter :: most_halvings = 12
  real(wp), parameter :: accuracy = 1.0e-13_wp   !! of the conditions, in strain
  real(wp), parameter :: relative = 1.0e-12_wp   !! of the strain so far
  real(wp), parameter :: wild = 1.0_wp           !! strain increment that cannot be meant

  abstract interface
    !> One step to a time; a step that does not converge changes nothing.
    subroutine step_interface(time, good)
      import :: wp
      real(wp), intent(in) :: time  !! s
      logical, intent(out) :: good
    end subroutine step_interface
  end interface

contains

  !> Go from now to a time, in halves where a step does not converge; now is how far it came [s].
  subroutine step_in_parts(one_step, time, now)
    procedure(step_interface) :: one_step
    real(wp), intent(in) :: time
    real(wp), intent(inout) :: now
    real(wp) :: goal, size_of, least
    logical :: good

    size_of = time - now
    least = size_of*0.5_wp**most_halvings
    do while (now < time)
      goal = now + size_of
      if (goal >= time - relative*size_of) goal = time
      call one_step(goal, good)
      if (good) then
        now = goal
        size_of = 2.0_wp*size_of
        cycle
      end if
      size_of = 0.5_wp*size_of
      if (size_of < least) return
    end do
  end subroutine step_in_parts

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
