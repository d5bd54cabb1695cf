!> OBJ files: faces of three and more corners, numbers from both ends, textures and normals, and
!! lines that are none.
program test_dem_obj
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_obj, only: read_obj
  implicit none
  type(test_type) :: test
  character(len=*), parameter :: path = 'test_dem_obj.obj', tab = achar(9)
  real(wp), parameter :: square(3, 4) = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
                                                 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, &
                                                 -2.5e-3_wp], [3, 4])
  character(len=*), parameter :: corners = '# a square'//new_line('a')//'v 0 0 0'// &
    new_line('a')//'v 1.0 0 0 0.5 0.5 0.5'//new_line('a')//'v'//tab//'1 1 0'//achar(13)// &
    new_line('a')//'v 0 1. -2.5e-3'//new_line('a')//'vn 0 0 1'//new_line('a')//'vt 0 0'// &
    new_line('a')

  call check_square('quadrilateral', 'f 1 2 3 4')
  call check_square('textures and normals', 'usemtl steel'//new_line('a')// &
                    'f 1/7/1 2//2 3/1 4/1/1')
  call check_square('from the end', 'f -4 -3 -2  -1 ')
  call check_square('two triangles', 'f 1 2 3'//new_line('a')//'f 1 3 4')
  call check_fault('a corner that does not come', corners//'f 1 2 5', 'I279')
  call check_fault('corner 0', corners//'f 0 1 2', 'I279')
  call check_fault('before the first', corners//'f 1 2 -5', 'I279')
  call check_fault('letters', corners//'f a b c', 'I279')
  call check_fault('two corners', corners//'f 1 2', 'I279')
  call check_fault('a short corner', 'v 1.0 2.0', 'I279')
  call check_fault('no faces', corners, 'I221')
  call check_fault('nan', corners//'v nan 0 0'//new_line('a')//'f 1 2 5', 'I222')
  call remove()
  call test%finish()

contains

  subroutine write_text(text)
    character(len=*), intent(in) :: text
    integer :: unit
    open (newunit=unit, file=path, access='stream', form='unformatted', status='replace')
    write (unit) text
    close (unit)
  end subroutine write_text

  subroutine remove()
    integer :: unit
    open (newunit=unit, file=path)
    close (unit, status='delete')
  end subroutine remove

  subroutine check_square(name, faces)
    character(len=*), intent(in) :: name, faces
    real(wp), allocatable :: corner(:, :, :)
    type(error_list_type) :: errors
    call write_text(corners//faces//new_line('a'))
    call read_obj(path, corner, errors)
    call test%check(name//' is read', .not. errors%any())
    if (errors%any()) return
    call test%check_all_close(name, reshape(corner, [size(corner)]), &
                              [square(:, [1, 2, 3]), square(:, [1, 3, 4])], 0.0_wp)
  end subroutine check_square

  subroutine check_fault(name, text, code)
    character(len=*), intent(in) :: name, text, code
    real(wp), allocatable :: corner(:, :, :)
    type(error_list_type) :: errors
    call write_text(text)
    call read_obj(path, corner, errors)
    call test%check(name//' is a fault', errors%count == 1)
    if (errors%count > 0) call test%check(name, errors%item(1)%code == code)
  end subroutine check_fault
end program test_dem_obj
