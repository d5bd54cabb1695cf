!> Columns that the audits of all methods share, and their values.
module cpl_audit_columns
  use talus_kinds, only: wp, i4
  use talus_scalars, only: scalar_kinetic, scalar_elastic, scalar_friction, &
    scalar_contact_damping, scalar_background_damping, scalar_boundary, scalar_gravity, &
    scalar_momentum, scalar_angular_momentum
  use talus_text, only: string_type, append_string
  implicit none
  private
  public :: begin_columns, append_momenta, append_vector, begin_values, momenta

contains

  !> Time, and energies and works of grains and solid: ten columns.
  subroutine begin_columns(columns)
    type(string_type), allocatable, intent(out) :: columns(:)
    call append_string(columns, 'time [s]')
    call append_string(columns, 'grains_kinetic [J]')
    call append_string(columns, 'grains_elastic [J]')
    call append_string(columns, 'grains_friction [J]')
    call append_string(columns, 'grains_contact_damping [J]')
    call append_string(columns, 'grains_background_damping [J]')
    call append_string(columns, 'grains_boundary_work [J]')
    call append_string(columns, 'grains_gravity_work [J]')
    call append_string(columns, 'solid_kinetic [J]')
    call append_string(columns, 'solid_elastic [J]')
  end subroutine begin_columns

  !> Their values.
  pure function begin_values(time, grains, solid) result(value)
    real(wp), intent(in) :: time                !! [s]
    real(wp), intent(in) :: grains(:), solid(:)  !! scalars of both
    real(wp) :: value(10)
    value(1) = time
    value(2:8) = grains([scalar_kinetic, scalar_elastic, scalar_friction, &
      scalar_contact_damping, scalar_background_damping, scalar_boundary, scalar_gravity])
    value(9:10) = solid([scalar_kinetic, scalar_elastic])
  end function begin_values

  !> Momentum and angular momentum of both: six columns.
  subroutine append_momenta(columns)
    type(string_type), allocatable, intent(inout) :: columns(:)
    call append_vector(columns, 'momentum', 'kg m/s')
    call append_vector(columns, 'angular_momentum', 'N m s')
  end subroutine append_momenta

  !> Their values [kg m/s], [N m s].
  pure function momenta(grains, solid) result(value)
    real(wp), intent(in) :: grains(:), solid(:)  !! scalars of both
    real(wp) :: value(6)
    value(:3) = grains(scalar_momentum:scalar_momentum + 2) &
      + solid(scalar_momentum:scalar_momentum + 2)
    value(4:) = grains(scalar_angular_momentum:scalar_angular_momentum + 2) &
      + solid(scalar_angular_momentum:scalar_angular_momentum + 2)
  end function momenta

  !> Components along x, y and z.
  subroutine append_vector(columns, name, unit)
    type(string_type), allocatable, intent(inout) :: columns(:)
    character(len=*), intent(in) :: name, unit
    character(len=*), parameter :: axes(3) = ['x', 'y', 'z']
    integer(i4) :: k
    do k = 1, 3
      call append_string(columns, name//'_'//axes(k)//' ['//unit//']')
    end do
  end subroutine append_vector
end module cpl_audit_columns
