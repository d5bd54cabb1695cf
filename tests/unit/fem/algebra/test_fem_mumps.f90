!> Factors of symmetric and general matrices, in memory and on disk; new values on one analysis.
program test_fem_mumps
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: max_abs, test_type
  use fem_mumps, only: mumps_type, storage_memory, storage_disk
  use talus_ranks, only: leave_ranks
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 60
  real(wp) :: matrix(n, n)

  call fill()
  call general(storage_memory)
  call general(storage_disk)
  call symmetric()
  call nowhere()
  call leave_ranks()
  call test%finish()

contains

  !> A band matrix that is not symmetric, with a pivot of zero on its diagonal.
  subroutine fill()
    integer(i4) :: i, j
    matrix = 0.0_wp
    do j = 1, n
      do i = max(1, j - 3), min(n, j + 3)
        matrix(i, j) = cos(1.7_wp*i - 0.9_wp*j) + merge(4.0_wp, 0.0_wp, i == j)
      end do
    end do
    matrix(5, 5) = 0.0_wp
  end subroutine fill

  !> Solution for three right-hand sides and two sets of values on one analysis.
  subroutine general(storage)
    integer(i4), intent(in) :: storage
    type(mumps_type) :: mumps
    type(error_list_type) :: errors
    integer(i4), allocatable :: row(:), column(:)
    real(wp) :: x(n), b(n)
    logical :: used(n, n)
    integer(i4) :: i, k, pass
    used = abs(matrix) > 0.0_wp
    used(5, 5) = .true.
    row = pack(spread([(i, i=1, n)], 2, n), used)
    column = pack(spread([(i, i=1, n)], 1, n), used)
    mumps%general = .true.
    mumps%storage = storage
    mumps%scratch = '/tmp'
    call mumps%analyse(n, row, column, [(i, i=1, n)], errors)
    do pass = 1, 2
      call mumps%factor(pass*pack(matrix, used), errors)
      call test%check('where they are', mumps%on_disk .eqv. storage == storage_disk)
      do k = 1, 3
        b = [(sin(real(k*i, wp)), i=1, n)]
        x = b
        call mumps%solve(x, errors)
        call test%check('solution of a general matrix', &
                        max_abs(pass*matmul(matrix, x) - b) &
                        < 1.0e-13_wp*max_abs(matmul(abs(matrix), abs(pass*x))))
      end do
    end do
    call test%check('no fault', .not. errors%any())
    call mumps%free()
  end subroutine general

  !> One triangle of A'A + I.
  subroutine symmetric()
    type(mumps_type) :: mumps
    type(error_list_type) :: errors
    real(wp) :: square(n, n), x(n), b(n)
    logical :: upper(n, n)
    integer(i4) :: i, j
    square = matmul(transpose(matrix), matrix)
    do i = 1, n
      square(i, i) = square(i, i) + 1.0_wp
    end do
    upper = reshape([((i <= j, i=1, n), j=1, n)], [n, n])
    call mumps%analyse(n, pack(spread([(i, i=1, n)], 2, n), upper), &
                       pack(spread([(i, i=1, n)], 1, n), upper), [(i, i=1, n)], errors)
    call mumps%factor(pack(square, upper), errors)
    b = [(cos(real(i, wp)), i=1, n)]
    x = b
    call mumps%solve(x, errors)
    call test%check('solution of one triangle', max_abs(matmul(square, x) - b) < 1.0e-12_wp)
    call mumps%factor(-pack(square, upper), errors)
    call test%check_text('negative pivots', errors%item(1)%code, 'N302')
    call mumps%free()
  end subroutine symmetric

  !> A folder that is not there.
  subroutine nowhere()
    type(mumps_type) :: mumps
    type(error_list_type) :: errors
    mumps%storage = storage_disk
    mumps%scratch = 'no-such-folder'
    call mumps%analyse(2, [1, 2], [1, 2], [1, 2], errors)
    call mumps%factor([2.0_wp, 3.0_wp], errors)
    call test%check_text('no folder', errors%item(1)%code, 'S305')
    call test%check_text('its name', errors%item(1)%place, 'no-such-folder')
    call mumps%free()
  end subroutine nowhere
end program test_fem_mumps
