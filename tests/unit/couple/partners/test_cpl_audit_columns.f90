!> Columns that all audits share: names with units, and values in the same order.
program test_cpl_audit_columns
  use talus_kinds, only: wp, i4
  use talus_scalars, only: scalar_angular_momentum, scalar_count, scalar_elastic, &
    scalar_gravity, scalar_kinetic, scalar_momentum
  use talus_test, only: test_type
  use talus_text, only: string_type
  use cpl_audit_columns, only: begin_columns, append_momenta, append_vector, begin_values, momenta
  implicit none

  type(test_type) :: test
  type(string_type), allocatable :: columns(:)
  real(wp) :: grains(scalar_count), solid(scalar_count), value(10)
  integer(i4) :: k

  call begin_columns(columns)
  grains = [(real(k, wp), k=1, scalar_count)]
  solid = 100.0_wp*grains
  value = begin_values(0.5_wp, grains, solid)
  call test%check('as many names as values', size(columns) == size(value))
  call named('time [s]', 0.5_wp)
  call named('grains_kinetic [J]', grains(scalar_kinetic))
  call named('grains_gravity_work [J]', grains(scalar_gravity))
  call named('solid_elastic [J]', solid(scalar_elastic))
  call append_momenta(columns)
  call test%check('momenta are six', size(columns) == 16)
  call test%check_text('the first', columns(11)%s, 'momentum_x [kg m/s]')
  call test%check_text('the last', columns(16)%s, 'angular_momentum_z [N m s]')
  call test%check_all_close('of both sides', momenta(grains, solid), 101.0_wp*[(grains( &
    scalar_momentum + k), k=0, 2), (grains(scalar_angular_momentum + k), k=0, 2)], 1.0e-12_wp)
  call append_vector(columns, 'force_on_edge', 'N')
  call test%check_text('a vector', columns(18)%s, 'force_on_edge_y [N]')
  call test%finish()

contains

  !> A column and its value.
  subroutine named(name, expected)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: expected
    integer(i4) :: n
    n = findloc([(columns(k)%s == name, k=1, size(columns))], .true., 1)
    call test%check(name, n > 0)
    if (n > 0) call test%check_close(name//': value', value(n), expected, 0.0_wp)
  end subroutine named
end program test_cpl_audit_columns
