!> Packing files: written and read unchanged, faults named.
program test_dem_packing
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: remove_file
  use talus_partner, only: own_pid
  use talus_test, only: test_type
  use dem_make, only: make_grains
  use dem_contacts, only: dem_contacts_type, make_contacts
  use dem_packing, only: dem_packing_type, dem_group_type, read_packing, write_packing, group_index
  use dem_state, only: dem_grains_type, dem_material_type, kind_ghost
  implicit none

  type(test_type) :: test
  type(dem_grains_type) :: grains
  type(dem_material_type) :: stone(1)
  type(dem_group_type) :: group(2)
  type(dem_packing_type) :: packing
  type(dem_contacts_type) :: list
  type(error_list_type) :: errors
  character(len=:), allocatable :: path, hint
  real(wp) :: x(3, 3), quat(4, 3), axes(3, 3), v(3, 3), omega(3, 3)
  integer(i4) :: k

  path = '/tmp/talus-packing-'//str(own_pid())//'.h5'
  stone(1) = dem_material_type(young=1.0e9_wp, poisson=0.2_wp, density=2000.0_wp)
  x = reshape([(0.1_wp*k, k=1, 9)], [3, 3])
  quat = spread([0.5_wp, -0.5_wp, 0.5_wp, 0.5_wp], 2, 3)
  axes = spread([3.0e-3_wp, 2.0e-3_wp, 1.0e-3_wp], 2, 3)
  v = -2.0_wp*x
  omega = 7.0_wp*x
  call make_grains(grains, stone, [7_i8, 3_i8, 5_i8], [0, 1, 2], [1, 1, 1], x, quat, axes, v, &
                   omega, errors)
  grains%kind(3) = kind_ghost
  group(1)%name = 'odd'
  group(1)%id = [3_i8, 7_i8]
  group(2)%name = 'tool'
  group(2)%id = [5_i8]
  call write_packing(path, grains, group, errors)
  call read_packing(packing, path, errors)
  call test%check('no faults', .not. errors%any())
  if (errors%any()) call errors%print(6)
  call test%check('ids upwards', all(packing%id == [3_i8, 5_i8, 7_i8]))
  call test%check('a ghost is written as fixed', all(packing%kind == [1, 2, 1]))
  call test%check('positions', all(abs(packing%x - x(:, [2, 3, 1])) <= 0.0_wp))
  call test%check('orientations', all(abs(packing%quat - quat) <= 0.0_wp))
  call test%check('velocities', all(abs(packing%v - v(:, [2, 3, 1])) <= 0.0_wp))
  call test%check('spins', all(abs(packing%omega - omega(:, [2, 3, 1])) <= 0.0_wp))
  call test%check('two groups', size(packing%group) == 2)
  call group_index(packing%group, 'tool', k, hint)
  call test%check('group tool', all(packing%group(k)%id == [5_i8]))
  call group_index(packing%group, 'tol', k, hint)
  call test%check('no group tol', k == 0 .and. index(hint, "'tool'") > 0)
  group(2)%id = [99_i8]
  call write_packing(path, grains, group, errors)
  call read_packing(packing, path, errors)
  call test%check_text('a stranger in a group', errors%item(1)%code, 'I233')
  group(2)%id = [5_i8]
  call contacts_too()
  call remove_file(path)
  call test%finish()

contains

  !> Tangential forces of contacts between grains; those with walls stay away.
  subroutine contacts_too()
    real(wp) :: hole
    errors = error_list_type()
    call make_contacts(list, 3)
    list%n = 3
    list%ids = reshape([3_i8, 5_i8, 5_i8, 7_i8, -1_i8, 7_i8], [2, 3])
    list%normal = reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.6_wp, 0.8_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                           0.0_wp], [3, 3])
    list%spring = reshape([1.0_wp, 2.0_wp, 9.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 1.0_wp, 1.0_wp, &
                           1.0_wp], [3, 3])
    call write_packing(path, grains, group, errors, contacts=list)
    call read_packing(packing, path, errors)
    call test%check('contacts: no faults', .not. errors%any())
    if (errors%any()) call errors%print(6)
    call test%check('two of three contacts', packing%springs%given == 2)
    call test%check('their ids', all(packing%springs%ids == list%ids(:, :2)))
    call test%check('what is tangential of their forces', all(abs(packing%springs%force &
      - reshape([1.0_wp, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 5.0_wp], [3, 2])) < 1.0e-15_wp))
    call write_packing(path, grains, group, errors)
    call read_packing(packing, path, errors)
    call test%check('none in a file without', packing%springs%given == 0)
    list%ids(2, 2) = 8
    call write_packing(path, grains, group, errors, contacts=list)
    call read_packing(packing, path, errors)
    call test%check_text('a contact of a stranger', errors%item(1)%code, 'I233')
    errors = error_list_type()
    list%ids(2, 2) = 7
    hole = 0.0_wp
    list%spring(1, 1) = hole/hole
    call write_packing(path, grains, group, errors, contacts=list)
    call test%check_text('a force that is no number', errors%item(1)%code, 'N002')
    errors = error_list_type()
    call read_packing(packing, path, errors)
    call test%check_text('the packing before it stays', errors%item(1)%code, 'I233')
  end subroutine contacts_too
end program test_dem_packing
