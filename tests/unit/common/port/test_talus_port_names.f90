!> Roles and verbs by name and number; fields of sets are the names with a dot before them.
program test_talus_port_names
  use talus_kinds, only: i4
  use talus_port_names, only: role_name, role_number, role_count, role_surface, field_force, &
    dot_force, field_moment_impulse, dot_moment_impulse, name_length
  use talus_scalars, only: scalar_count, scalar_flags, scalar_momentum, scalar_angular_momentum
  use talus_test, only: test_type
  use talus_verbs, only: verb_first, verb_last, verb_name
  implicit none

  type(test_type) :: test
  integer(i4) :: k
  logical :: same

  same = .true.
  do k = 1, role_count
    same = same .and. role_number(role_name(k)) == k
  end do
  call test%check('roles have one number each', same .and. role_count == 6)
  call test%check_text('a role', role_name(role_surface), 'surface')
  call test%check('no role', role_number('surf') == 0 .and. role_number('') == 0)
  call test%check_text('a verb', verb_name(verb_last), 'RELAX')
  call test%check_text('no verb', verb_name(verb_first - 1), 'verb 0')
  call test%check_text('field of a set', dot_force, '.'//field_force)
  call test%check_text('a longer one', dot_moment_impulse, '.'//field_moment_impulse)
  call test%check('set and field fit into a name', name_length >= 48)
  call test%check('vectors among the scalars', scalar_angular_momentum == scalar_momentum + 3)
  call test%check('the flags are the last scalar', scalar_flags == scalar_count)
  call test%finish()
end program test_talus_port_names
