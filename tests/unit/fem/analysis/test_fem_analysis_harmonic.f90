!> The doubled system of a harmonic response against the complex one, and amplitudes with phases.
program test_fem_analysis_harmonic
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_ranks, only: leave_ranks
  use talus_test, only: max_abs, test_type
  use fem_analysis_harmonic, only: double_entries, amplitude_phase
  use fem_mumps, only: mumps_type
  use fem_sparse, only: fem_pattern_type
  implicit none
  type(test_type) :: test

  call doubled()
  call phases()
  call leave_ranks()
  call test%finish()

contains

  !> Two coupled blocks, one component held: (A + i B) (R + i I) = F for the R, I that MUMPS finds
  !! with pivots of 2 x 2, as A has zeros on its diagonal.
  subroutine doubled()
    integer(i4), parameter :: rows = 5
    type(fem_pattern_type) :: pattern
    type(mumps_type) :: mumps
    type(error_list_type) :: errors
    integer(i4) :: equation(3, 2), k
    integer(i4), allocatable :: irn(:), jcn(:)
    real(wp), allocatable :: value(:)
    real(wp) :: a(3, 3, 3), b(3, 3, 3), dense(2*rows, 2*rows), right(2*rows), x(2*rows)
    complex(wp) :: whole(rows, rows), u(rows), f(rows)

    pattern%nodes = 2
    pattern%start = [1, 3, 4]
    pattern%column = [1, 2, 2]
    a(:, :, 1) = symmetric([0.0_wp, 1.0_wp, 2.0_wp, 0.0_wp, -1.0_wp, 3.0_wp])
    a(:, :, 2) = 0.5_wp*reshape([real(wp) :: 2, 4, 6, -2, 0, 4, 1, 2, -4], [3, 3])
    a(:, :, 3) = symmetric([1.0_wp, 0.0_wp, 4.0_wp, -2.0_wp, 1.0_wp, 0.0_wp])
    b = 0.1_wp*a
    b(:, :, 3) = b(:, :, 3) + symmetric([1.0_wp, 0.2_wp, 0.0_wp, 2.0_wp, 0.3_wp, 1.0_wp])
    equation = reshape([1, 0, 2, 3, 4, 5], [3, 2])
    whole = reshape([(0.0_wp, k=1, rows*rows)], [rows, rows])
    call add(whole, equation(:, 1), equation(:, 1), cmplx(a(:, :, 1), b(:, :, 1), wp))
    call add(whole, equation(:, 1), equation(:, 2), cmplx(a(:, :, 2), b(:, :, 2), wp))
    call add(whole, equation(:, 2), equation(:, 1), transpose(cmplx(a(:, :, 2), b(:, :, 2), wp)))
    call add(whole, equation(:, 2), equation(:, 2), cmplx(a(:, :, 3), b(:, :, 3), wp))

    call double_entries(equation, pattern, a, b, irn, jcn, value)
    dense = 0.0_wp
    do k = 1, size(value)
      dense(irn(k), jcn(k)) = dense(irn(k), jcn(k)) + value(k)
      if (irn(k) /= jcn(k)) dense(jcn(k), irn(k)) = dense(jcn(k), irn(k)) + value(k)
    end do
    call test%check_close('real rows', max_abs(dense(1::2, 1::2) - real(whole, wp)), 0.0_wp, &
                          1.0e-15_wp)
    call test%check_close('mixed rows', max_abs(dense(1::2, 2::2) + aimag(whole)), 0.0_wp, &
                          1.0e-15_wp)
    call test%check_close('imaginary rows', max_abs(dense(2::2, 2::2) + real(whole, wp)), &
                          0.0_wp, 1.0e-15_wp)

    f = [(cmplx(k, 2 - k, wp), k=1, rows)]
    right(1::2) = real(f, wp)
    right(2::2) = -aimag(f)
    mumps%indefinite = .true.
    mumps%pivoting = .true.
    call mumps%analyse(2*rows, irn, jcn, [(k, k=1, 2*rows)], errors)
    call mumps%factor(value, errors)
    x = right
    call mumps%solve(x, errors)
    call test%check('solved', .not. errors%any())
    u = cmplx(x(1::2), x(2::2), wp)
    call test%check('solution is finite', all(abs(x) < huge(1.0_wp)))
    call test%check_close('(A + i B) U = F', max_abs(abs(matmul(whole, u) - f)), 0.0_wp, 1.0e-12_wp)
    call mumps%free()
  end subroutine doubled

  !> Add a block where both rows are free.
  pure subroutine add(whole, row, column, block)
    complex(wp), intent(inout) :: whole(:, :)
    integer(i4), intent(in) :: row(3), column(3)
    complex(wp), intent(in) :: block(3, 3)
    integer(i4) :: c, d
    do d = 1, 3
      do c = 1, 3
        if (row(c) > 0 .and. column(d) > 0) whole(row(c), column(d)) = block(c, d)
      end do
    end do
  end subroutine add

  !> xx xy xz yy yz zz.
  pure function symmetric(v) result(m)
    real(wp), intent(in) :: v(6)
    real(wp) :: m(3, 3)
    m = reshape([v(1), v(2), v(3), v(2), v(4), v(5), v(3), v(5), v(6)], [3, 3])
  end function symmetric

  !> The mean of 3 + 4 i and 3 - 4 i has the phase 0, -2 i that of a quarter late.
  subroutine phases()
    real(wp) :: u(3, 2, 2), values(6)
    u = 0.0_wp
    u(1, :, 1) = 1.5_wp
    u(1, :, 2) = [2.0_wp, -2.0_wp]
    u(3, :, 2) = -1.0_wp
    values = amplitude_phase(u)
    call test%check_close('amplitude', values(1), 3.0_wp, 1.0e-15_wp)
    call test%check_close('phase', values(2), 0.0_wp, 1.0e-15_wp)
    call test%check_close('nothing', values(3), 0.0_wp, 0.0_wp)
    call test%check_close('amplitude of z', values(5), 2.0_wp, 1.0e-15_wp)
    call test%check_close('a quarter late', values(6), -0.5_wp*acos(-1.0_wp), 1.0e-15_wp)
  end subroutine phases
end program test_fem_analysis_harmonic
