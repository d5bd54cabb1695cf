!> Columns of the audit of facets, and the worst of it for the health line.
module cpl_audit
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use talus_scalars, only: scalar_boundary, scalar_gravity, scalar_max_overlap
  use cpl_audit_columns, only: begin_columns, append_momenta, append_vector, begin_values, momenta
  use cpl_interface, only: interface_type
  use cpl_lag, only: lag_type
  implicit none
  private
  public :: audit_type, audit_columns

  integer(i4), parameter :: column_count = 36

  !> Worst values so far.
  type :: audit_type
    real(wp) :: gap = 0.0_wp              !! largest distance between ghosts and facets [m]
    type(lag_type) :: lag
    integer(i4) :: iterations = 0         !! most in an exchange
    real(wp) :: ghost_motion = 0.0_wp     !! largest displacement of a ghost now [m]
    real(wp) :: ghost_force = 0.0_wp      !! mean force on a ghost now [N]
  contains
    procedure :: note
    procedure :: row
    procedure :: work_error
  end type audit_type

contains

  subroutine audit_columns(columns)
    type(string_type), allocatable, intent(out) :: columns(:)

    call begin_columns(columns)
    call append_string(columns, 'solid_boundary_work [J]')
    call append_string(columns, 'solid_gravity_work [J]')
    call append_string(columns, 'interface_work_on_grains [J]')
    call append_string(columns, 'interface_work_on_solid [J]')
    call append_string(columns, 'interface_work_difference [J]')
    call append_momenta(columns)
    call append_vector(columns, 'force_on_solid', 'N')
    call append_string(columns, 'largest_ghost_displacement [m]')
    call append_string(columns, 'mean_ghost_force [N]')
    call append_string(columns, 'constraint_residual [m]')
    call append_string(columns, 'force_lag [-]')
    call append_string(columns, 'spring_stiffness [N/m]')
    call append_string(columns, 'iterations [-]')
    call append_string(columns, 'lost_moment_impulse [N m s]')
    call append_string(columns, 'largest_overlap [-]')
    call append_vector(columns, 'moment_on_solid', 'N m')
    call append_string(columns, 'pieces [-]')
    if (size(columns) /= column_count) error stop 'bug: columns of the audit'
  end subroutine audit_columns

  !> Measure the interface after an exchange.
  subroutine note(self, face, gap)
    class(audit_type), intent(inout) :: self
    type(interface_type), intent(in) :: face
    real(wp), intent(out) :: gap  !! between ghosts and facets [m]
    gap = face%gap()
    self%gap = max(self%gap, gap)
    self%iterations = max(self%iterations, face%ledger%iterations)
    self%ghost_motion = sqrt(maxval(sum(face%motion%d_new(:3, :)**2, 1)))
    self%ghost_force = sum(sqrt(sum(face%forces%p_mean(:3, :)**2, 1)))/face%map%ghosts
    call self%lag%note(face%ledger%lag, self%ghost_force)
  end subroutine note

  !> Difference of the works from both sides, relative to what went through the interface.
  pure real(wp) function work_error(self, face)
    class(audit_type), intent(in) :: self
    type(interface_type), intent(in) :: face
    work_error = 0.0_wp
    if (face%ledger%work_turnover > 0.0_wp .and. self%iterations > 0) &
      work_error = abs(face%ledger%grains_work + face%ledger%solid_work)/face%ledger%work_turnover
  end function work_error

  !> A row at time [s], after the exchange was accepted.
  pure function row(self, face, time, gap) result(value)
    class(audit_type), intent(in) :: self
    type(interface_type), intent(in) :: face
    real(wp), intent(in) :: time
    real(wp), intent(in) :: gap  !! of this exchange [m]
    real(wp) :: value(column_count)

    associate (g => face%ledger%grains, s => face%ledger%solid)
      value(:10) = begin_values(time, g, s)
      value(11:12) = s([scalar_boundary, scalar_gravity])
      value(13) = face%ledger%grains_work
      value(14) = face%ledger%solid_work
      value(15) = face%ledger%grains_work + face%ledger%solid_work
      value(16:21) = momenta(g, s)
      value(22:24) = sum(face%relax%held(:3, :), 2)
      value(25) = self%ghost_motion
      value(26) = self%ghost_force
      value(27) = gap
      value(28) = face%ledger%lag
      value(29) = face%springs%stiffness
      value(30) = face%ledger%iterations
      value(31) = face%ledger%lost_impulse
      value(32) = g(scalar_max_overlap)
      value(33:35) = 0.0_wp
      value(36) = face%ledger%pieces
      if (face%transfer%rows > 3) value(33:35) = sum(face%relax%held(4:, :), 2)
    end associate
  end function row
end module cpl_audit
