!> The harness itself: what must fail fails, what must pass passes, and it reports where.
program test_talus_test
  use, intrinsic :: ieee_arithmetic, only: ieee_all, ieee_is_nan, ieee_positive_inf, &
    ieee_quiet_nan, ieee_set_flag, ieee_set_halting_mode, ieee_value
  use talus_kinds, only: wp
  use talus_test, only: larger, max_abs, test_type
  implicit none
  type(test_type) :: test
  real(wp) :: nan, infinity

  ! a comparison with a NaN traps in some builds; here it is the subject
  call ieee_set_halting_mode(ieee_all, .false.)
  nan = ieee_value(1.0_wp, ieee_quiet_nan)
  infinity = ieee_value(1.0_wp, ieee_positive_inf)
  call test_numbers()
  call test_arrays()
  call test_shapes()
  call test_messages()
  call test_largest()
  call ieee_set_flag(ieee_all, .false.)
  call test%finish()

contains

  !> A tally that writes to a file of its own: what fails in it is what is tested.
  subroutine start(inner)
    type(test_type), intent(out) :: inner
    open (newunit=inner%unit, status='scratch', action='readwrite')
  end subroutine start

  !> Check that the last check of an inner tally failed, or passed; then forget the tally.
  subroutine expect(name, inner, fails)
    character(len=*), intent(in) :: name
    type(test_type), intent(inout) :: inner
    logical, intent(in) :: fails
    call test%check(name, inner%failed == merge(1, 0, fails) .and. &
                    inner%passed == merge(0, 1, fails))
    close (inner%unit)
    call start(inner)
  end subroutine expect

  !> The first line that an inner tally has written.
  function said(inner) result(line)
    type(test_type), intent(in) :: inner
    character(len=200) :: line
    integer :: status
    line = ''
    rewind (inner%unit)
    read (inner%unit, '(a)', iostat=status) line
    if (status /= 0) line = 'nothing'
  end function said

  !> One number against another.
  subroutine test_numbers()
    type(test_type) :: inner
    call start(inner)
    call inner%check_close('x', 1.0_wp, 1.1_wp, 0.2_wp)
    call expect('near is close', inner, .false.)
    call inner%check_close('x', 1.0_wp, 1.1_wp, 0.05_wp)
    call expect('far is not', inner, .true.)
    call inner%check_close('x', nan, 0.0_wp, 1.0_wp)
    call expect('NaN for a number', inner, .true.)
    call inner%check_close('x', 0.0_wp, nan, 1.0_wp)
    call expect('a number for NaN', inner, .true.)
    call inner%check_close('x', 0.0_wp, 0.0_wp, nan)
    call expect('a tolerance that is NaN', inner, .true.)
    call inner%check_close('x', infinity, 0.0_wp, 1.0_wp)
    call expect('infinity for a number', inner, .true.)
    close (inner%unit)
  end subroutine test_numbers

  !> One entry in six, of each rank, that is far off, NaN or infinite.
  subroutine test_arrays()
    type(test_type) :: inner
    real(wp) :: good(6), bad(6), wrong(4)
    character(len=8), parameter :: what(4) = ['far     ', 'NaN     ', 'infinite', '-inf    ']
    integer :: i, k
    call start(inner)
    good = [(1.0_wp + i, i=1, 6)]
    wrong = [5.0_wp, nan, infinity, -infinity]
    call inner%check_all_close('x', good + 1.0e-9_wp, good, 1.0e-8_wp)
    call expect('vector, near', inner, .false.)
    do k = 1, 4
      do i = 1, 6
        bad = good
        bad(i) = wrong(k)
        if (k == 1) bad(i) = good(i) + 1.0e-3_wp
        call inner%check_all_close('x', bad, good, 1.0e-8_wp)
        call expect('vector, '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', good, bad, 1.0e-8_wp)
        call expect('vector, expected is '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', reshape(bad, [2, 3]), reshape(good, [2, 3]), 1.0e-8_wp)
        call expect('matrix, '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', reshape(bad, [1, 2, 3]), reshape(good, [1, 2, 3]), &
                                   1.0e-8_wp)
        call expect('cube, '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', bad - good, 0.0_wp, 1.0e-8_wp)
        call expect('vector for a value, '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', reshape(bad - good, [3, 2]), 0.0_wp, 1.0e-8_wp)
        call expect('matrix for a value, '//trim(what(k)), inner, .true.)
        call inner%check_all_close('x', reshape(bad - good, [3, 1, 2]), 0.0_wp, 1.0e-8_wp)
        call expect('cube for a value, '//trim(what(k)), inner, .true.)
      end do
    end do
    bad(2) = nan
    call inner%check_all_close('x', bad, bad, 1.0_wp)
    call expect('NaN for NaN', inner, .true.)
    call inner%check_all_close('x', bad, nan, 1.0_wp)
    call expect('NaN for the value NaN', inner, .true.)
    call inner%check_all_close('x', good, good, nan)
    call expect('arrays, a tolerance that is NaN', inner, .true.)
    close (inner%unit)
  end subroutine test_arrays

  !> Shapes that differ and arrays without entries fail.
  subroutine test_shapes()
    type(test_type) :: inner
    real(wp) :: x(6), none(0), flat(0, 3)
    call start(inner)
    x = 1.0_wp
    call inner%check_all_close('x', x(:5), x, 1.0_wp)
    call expect('one entry fewer', inner, .true.)
    call inner%check_all_close('x', reshape(x, [2, 3]), reshape(x, [3, 2]), 1.0_wp)
    call expect('the same size in another shape', inner, .true.)
    call inner%check_all_close('x', reshape(x, [1, 2, 3]), reshape(x, [1, 3, 2]), 1.0_wp)
    call expect('the same of a cube', inner, .true.)
    call inner%check_all_close('x', none, none, 1.0_wp)
    call expect('nothing for nothing', inner, .true.)
    call inner%check_all_close('x', none, 0.0_wp, 1.0_wp)
    call expect('nothing for a value', inner, .true.)
    call inner%check_all_close('x', flat, flat, 1.0_wp)
    call expect('a matrix without rows', inner, .true.)
    call inner%check_all_close('x', reshape(x, [2, 3]), reshape(x, [2, 3]), 0.0_wp)
    call expect('the same shape', inner, .false.)
    close (inner%unit)
  end subroutine test_shapes

  !> The worst entry is named with its place; a NaN is named before what is merely far off.
  subroutine test_messages()
    type(test_type) :: inner
    real(wp) :: x(2, 3)
    call start(inner)
    x = 0.0_wp
    x(2, 3) = 4.0_wp
    x(1, 2) = 3.0_wp
    call inner%check_all_close('field', x, 0.0_wp, 1.0_wp)
    call test%check('the worst is named', index(said(inner), 'FAILED: field: 4') == 1 .and. &
                    index(said(inner), 'at (2, 3)') > 0)
    close (inner%unit)
    call start(inner)
    x(2, 1) = nan
    call inner%check_all_close('field', x, 0.0_wp, 1.0_wp)
    call test%check('a NaN is named', index(said(inner), 'NaN') > 0 .and. &
                    index(said(inner), 'at (2, 1)') > 0)
    close (inner%unit)
    call start(inner)
    call inner%check_all_close('field', x(:, :2), x, 1.0_wp)
    call test%check_text('shapes are named', trim(said(inner)), &
                         'FAILED: field: shape (2, 2) for (2, 3)')
    close (inner%unit)
    call start(inner)
    call inner%check_all_close('field', x(:, :0), 0.0_wp, 1.0_wp)
    call test%check_text('nothing is named', trim(said(inner)), &
                         'FAILED: field: nothing to compare')
    close (inner%unit)
  end subroutine test_messages

  !> Largest values do not skip a NaN.
  subroutine test_largest()
    real(wp) :: x(6), y(2, 3), none(0)
    x = [1.0_wp, -5.0_wp, 2.0_wp, 0.0_wp, 4.0_wp, -3.0_wp]
    y = reshape(x, [2, 3])
    call test%check_close('largest size', max_abs(x), 5.0_wp, 0.0_wp)
    call test%check_close('of a matrix', max_abs(y), 5.0_wp, 0.0_wp)
    call test%check_close('of a cube', max_abs(reshape(x, [3, 1, 2])), 5.0_wp, 0.0_wp)
    x(4) = nan
    call test%check('with a NaN', ieee_is_nan(max_abs(x)))
    call test%check('of a matrix with a NaN', ieee_is_nan(max_abs(reshape(x, [2, 3]))))
    call test%check('of a cube with a NaN', ieee_is_nan(max_abs(reshape(x, [3, 1, 2]))))
    call test%check('of nothing', ieee_is_nan(max_abs(none)))
    call test%check_close('larger of two', larger(1.0_wp, 2.0_wp), 2.0_wp, 0.0_wp)
    call test%check_close('larger of three', larger(1.0_wp, 3.0_wp, 2.0_wp), 3.0_wp, 0.0_wp)
    call test%check_close('larger of four', larger(1.0_wp, 3.0_wp, 2.0_wp, 7.0_wp), 7.0_wp, 0.0_wp)
    call test%check('NaN is larger, in any place', &
                    ieee_is_nan(larger(nan, 1.0_wp)) .and. ieee_is_nan(larger(1.0_wp, nan)) &
                    .and. ieee_is_nan(larger(1.0_wp, 2.0_wp, nan)) &
                    .and. ieee_is_nan(larger(1.0_wp, 2.0_wp, 3.0_wp, nan)) &
                    .and. ieee_is_nan(larger(nan, 2.0_wp, 3.0_wp, 4.0_wp)) &
                    .and. ieee_is_nan(larger(1.0_wp, nan, 3.0_wp, 4.0_wp)))
  end subroutine test_largest
end program test_talus_test
