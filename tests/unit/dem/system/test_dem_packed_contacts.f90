!> Contacts of packings in a periodic cell: shifts as the file's places have them, faults named.
program test_dem_packed_contacts
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: remove_file
  use talus_hdf5, only: h5_file_type
  use talus_partner, only: own_pid
  use talus_test, only: test_type
  use dem_cell, only: set_cell, shift_of
  use dem_contacts, only: dem_contacts_type, make_contacts
  use dem_make, only: make_grains
  use dem_packed_contacts, only: read_springs, first_missing
  use dem_packing, only: dem_packing_type, dem_group_type, read_packing, write_packing
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_grains_type, dem_material_type, dem_cell_type
  implicit none
  type(test_type) :: test
  type(dem_grains_type) :: grains
  type(dem_cell_type) :: cell
  type(dem_group_type) :: none(0)
  type(error_list_type) :: errors
  character(len=:), allocatable :: path

  path = '/tmp/talus-packed-contacts-'//str(own_pid())//'.h5'
  call make_two()
  call check_written()
  call check_faults()
  call remove_file(path)
  call test%check('a stranger among few ids', first_missing([1_i8, 4_i8], [1_i8, 3_i8]) == 4_i8)
  call test%check('a stranger among ids far apart', &
                  first_missing([1_i8, 4_i8], [1_i8, 2_i8**40]) == 4_i8)
  call test%finish()

contains

  !> Two grains that have moved out of a sheared cell, by +2 and by -1 edges.
  subroutine make_two()
    type(dem_material_type) :: stone(1)
    real(wp) :: x(3, 2), zero(3, 2)
    stone(1) = dem_material_type(young=1.0e9_wp, poisson=0.2_wp, density=2000.0_wp)
    call set_cell(cell, [0.1_wp, 0.0_wp, 0.0_wp], &
                  reshape([1.0_wp, 0.0_wp, 0.0_wp, 2.3_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                           1.0_wp], [3, 3]), [.true., .true., .false.])
    x(:, 1) = [0.5_wp, 0.05_wp, 0.5_wp] + shift_of(cell, [2, 0, 0])
    x(:, 2) = [0.9_wp, 0.1_wp, 1.5_wp] + shift_of(cell, [0, -1, 0])
    zero = 0.0_wp
    call make_grains(grains, stone, [3_i8, 8_i8], [0, 0], [1, 1], x, &
                     spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 2), zero + 0.1_wp, zero, zero, &
                     errors)
  end subroutine make_two

  !> The image that a branch leads to is named from the places in the file, folded into the cell;
  !! what is normal in a force stays away.
  subroutine check_written()
    type(dem_contacts_type) :: list
    type(dem_packing_type) :: packing
    integer(i4), parameter :: shift(3, 3) = reshape([0, 0, 0, -1, 0, 0, 4, -2, 0], [3, 3])
    integer(i4) :: k

    call make_contacts(list, 3)
    list%n = 3
    do k = 1, 3
      list%ids(:, k) = [3_i8, 8_i8]
      list%normal(:, k) = [0.0_wp, 0.0_wp, 1.0_wp]
      list%spring(:, k) = [1.0_wp*k, 2.0_wp, 9.0_wp]
      list%branch(:, k) = grains%x(:, 2) - grains%x(:, 1) + shift_of(cell, shift(:, k)) &
                          + shift_of(cell, [2, 1, 0])
    end do
    call write_packing(path, grains, none, errors, cell, list)
    call read_packing(packing, path, errors)
    call test%check('no faults', .not. errors%any())
    if (errors%any()) call errors%print(6)
    call test%check('shifts', all(packing%springs%shift == shift))
    call test%check_all_close('forces', packing%springs%force(:, 3), [3.0_wp, 2.0_wp, 0.0_wp], &
                              1.0e-15_wp)
    call write_packing(path, grains, none, errors, contacts=list)
    call read_packing(packing, path, errors)
    call test%check('no shifts without a cell', .not. allocated(packing%springs%shift))
  end subroutine check_written

  !> Shifts that are no triples of small numbers, or of a packing without cell.
  subroutine check_faults()
    call check_code('as many as contacts', reshape([0_i8, 0_i8, 0_i8], [3, 1]), .true., 'I232')
    call check_code('triples', reshape([0_i8, 0_i8, 0_i8, 0_i8], [2, 2]), .true., 'I232')
    call check_code('small', reshape([0_i8, 1_i8, 0_i8, 0_i8, 4096_i8, 0_i8], [3, 2]), .true., &
                    'I240')
    call check_code('no cell', reshape([0_i8, 1_i8, 0_i8, 0_i8, 0_i8, 0_i8], [3, 2]), .false., &
                    'I240')
    call check_code('', reshape([0_i8, -4095_i8, 0_i8, 0_i8, 4095_i8, 0_i8], [3, 2]), .true., '')
    call check_code('', spread(spread(0_i8, 1, 3), 2, 2), .false., '')
  end subroutine check_faults

  !> The first fault of a file with these shifts of two contacts.
  subroutine check_code(name, shift, in_cell, code)
    character(len=*), intent(in) :: name, code
    integer(i8), intent(in) :: shift(:, :)
    logical, intent(in) :: in_cell
    type(h5_file_type) :: file
    type(start_springs_type) :: springs
    real(wp) :: force(3, 2)
    force = 0.0_wp
    errors = error_list_type()
    call file%create(path, errors, format='talus-packing')
    call file%group('/contacts', errors)
    call file%put('/contacts/ids', reshape([3_i8, 8_i8, 3_i8, 8_i8], [2, 2]), errors)
    call file%put('/contacts/tangential', force, errors)
    call file%put('/contacts/shift', shift, errors)
    call file%commit(errors)
    call file%open(path, errors, format='talus-packing')
    call read_springs(file, [3_i8, 8_i8], in_cell, springs, errors)
    call file%close(errors)
    if (len(code) == 0) then
      call test%check('no fault', .not. errors%any() .and. allocated(springs%shift))
    else
      call test%check_text(name, errors%item(1)%code, code)
    end if
    errors = error_list_type()
  end subroutine check_code
end program test_dem_packed_contacts
