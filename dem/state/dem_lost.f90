!> Lost grains: not a number, out of bounds, or beyond the halo of their rank.
module dem_lost
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: all_finite, name_lost_grain, name_stray

contains

  !> Are all states of grains finite and within bounds? All ranks return the same answer.
  logical function all_finite(d)
    type(dem_data_type), intent(in) :: d
    real(wp), parameter :: far = 1.0e6_wp
    real(wp) :: lost(1)
    all_finite = all(abs(d%grains%x) < far) .and. all(abs(d%grains%v) < huge(1.0_wp)) &
                 .and. all(abs(d%grains%omega) < huge(1.0_wp))
    if (.not. d%halo%team%several()) return
    lost = merge(0.0_wp, 1.0_wp, all_finite)
    call d%halo%team%most(lost)
    all_finite = .not. lost(1) > 0.0_wp
  end function all_finite

  !> Fault N200 for the first grain whose state is no number or has left the world.
  subroutine name_lost_grain(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i
    do i = 1, d%grains%n
      if (all(abs(d%grains%x(:, i)) < 1.0e6_wp) .and. all(abs(d%grains%v(:, i)) < huge(1.0_wp)) &
          .and. all(abs(d%grains%omega(:, i)) < huge(1.0_wp))) cycle
      call errors%add('N200', 'the motion of grain '//str(d%grains%id(i))//' is lost: position '// &
                      str(d%grains%x(:, i))//' m, velocity '//str(d%grains%v(:, i))//' m/s', &
                      place='step '//str(d%health%steps), &
                      hint='lower the time step, or search for grains that overlap at the start')
      return
    end do
  end subroutine name_lost_grain

  !> Fault N240 for a grain that left its domain by more than the halo between two lists.
  subroutine name_stray(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    if (d%halo%stray == 0) return
    call errors%add('N240', 'grain '//str(d%halo%stray)//' has gone '//str(d%halo%stray_way)// &
                    ' m beyond the domain of its rank in one step; ranks hold the grains of '// &
                    'others within '//str(d%halo%range)//' m alone', &
                    place='step '//str(d%health%steps), &
                    hint='contacts on its way were missed: take a smaller time step, or a '// &
                    'larger &search skin')
  end subroutine name_stray
end module dem_lost
