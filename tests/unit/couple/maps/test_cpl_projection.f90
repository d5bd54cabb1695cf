!> Moving least squares: the coefficients of a row are those of the normal equations with weights
!! w (1 - r^2/R^2)^2, solved by LAPACK; linear fields are reproduced; grains in a plane are refused.
program test_cpl_projection
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgesv
  use talus_test, only: test_type
  use cpl_projection, only: fit_row
  implicit none
  integer(i4), parameter :: grains = 9
  real(wp), parameter :: reach = 2.5_wp, at(3) = [0.3_wp, -0.2_wp, 0.4_wp]
  type(test_type) :: test

  call random_init(repeatable=.true., image_distinct=.false.)
  call check_row()
  call check_plane()
  call test%finish()

contains

  subroutine check_row()
    real(wp) :: x(3, grains), weight(grains), value(grains)
    logical :: good
    integer(i4) :: k

    call random_number(x)
    x = 2.0_wp*x - 1.0_wp  ! all within reach
    call random_number(weight)
    weight = 0.5_wp + weight
    value = weight
    call fit_row(x, at, reach, value, good)
    call test%check('a fit', good)
    call test%check_all_close('coefficients', value, normal_equations(x, weight), 1.0e-13_wp)
    call test%check_close('a constant', sum(value), 1.0_wp, 1.0e-14_wp)
    do k = 1, 3
      call test%check_close('a linear field', sum(value*x(k, :)), at(k), 1.0e-14_wp)
    end do
  end subroutine check_row

  !> First row of (P W P^T)^-1 P W, in coordinates that are not scaled.
  function normal_equations(x, weight) result(row)
    real(wp), intent(in) :: x(3, grains), weight(grains)
    real(wp) :: row(grains), p(4, grains), w(grains), m(4, 4), c(4, 1)
    integer(i4) :: pivot(4), info
    p(1, :) = 1.0_wp
    p(2:, :) = x - spread(at, 2, grains)
    w = weight*(1.0_wp - sum(p(2:, :)**2, 1)/reach**2)**2
    m = matmul(p*spread(w, 1, 4), transpose(p))
    c = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1])
    call dgesv(4_i4, 1_i4, m, 4_i4, pivot, c, 4_i4, info)
    call test%check('normal equations', info == 0)
    row = w*matmul(c(:, 1), p)
  end function normal_equations

  subroutine check_plane()
    real(wp) :: x(3, grains), value(grains)
    logical :: good
    call random_number(x)
    x(3, :) = 0.1_wp
    value = 1.0_wp
    call fit_row(x, at, reach, value, good)
    call test%check('grains in a plane do not give a slope', .not. good)
  end subroutine check_plane
end program test_cpl_projection
