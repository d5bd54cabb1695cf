!> Facet map: identities on distorted facets, edges, ghosts beside facets.
program test_cpl_facet_map
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use cpl_facet_map, only: facet_map_type
  use cpl_shapes, only: shapes_at
  implicit none

  type(test_type) :: test
  ! a surface of 2 x 2 facets, warped and skewed
  real(wp) :: x(3, 9)
  integer(i4) :: facets(4, 4)
  integer(i4) :: i, j, k

  k = 0
  do j = 0, 2
    do i = 0, 2
      k = k + 1
      x(:, k) = 0.01_wp*[i + 0.2_wp*j + 0.1_wp*sin(3.0_wp*k), j - 0.15_wp*i*j/2.0_wp, &
                         0.3_wp*cos(2.0_wp*k)]
    end do
  end do
  facets = reshape([1, 2, 5, 4, 2, 3, 6, 5, 4, 5, 8, 7, 5, 6, 9, 8], [4, 4])

  call distorted()
  call edges()
  call outside()
  call empty()
  call test%finish()

contains

  !> Points made from known natural coordinates are found again.
  subroutine distorted()
    integer(i4), parameter :: n = 40
    type(facet_map_type) :: map
    type(error_list_type) :: errors
    real(wp) :: natural(2, n), ghost(3, n), worst
    integer(i8) :: ids(n)
    integer(i4) :: g, on(n)

    do g = 1, n
      on(g) = 1 + mod(g, 4)
      natural(:, g) = [sin(1.7_wp*g), cos(2.3_wp*g)]*0.97_wp
      ghost(:, g) = matmul(x(:, facets(:, on(g))), shapes_at(4, natural(:, g)))
      ids(g) = 100 + g
    end do
    call map%build(ids, ghost, facets, x, -1.0_wp, errors)
    call test%check('no faults', .not. errors%any())
    call test%check('facets found', all(map%facet == on))
    call test%check_all_close('natural coordinates', map%natural, natural, &
      1.0e-11_wp)
    call map%identity_error(ghost, x, worst, errors)
    call test%check_close('identities', worst, 0.0_wp, 1.0e-13_wp)
    call test%check('hash', map%hash() /= repeat(' ', 16))
  end subroutine distorted

  !> On an edge of two facets, and on the corner of four: the lowest number, whatever the order.
  subroutine edges()
    type(facet_map_type) :: map
    type(error_list_type) :: errors
    real(wp) :: ghost(3, 3)
    ghost(:, 1) = 0.5_wp*(x(:, 2) + x(:, 5))
    ghost(:, 2) = x(:, 5)
    ghost(:, 3) = 0.3_wp*x(:, 5) + 0.7_wp*x(:, 6)
    call map%build([1_i8, 2_i8, 3_i8], ghost, facets, x, -1.0_wp, errors)
    call test%check('edge: no faults', .not. errors%any())
    call test%check('edge of 1 and 2', map%facet(1) == 1)
    call test%check('corner of all', map%facet(2) == 1)
    call test%check('edge of 2 and 4', map%facet(3) == 2)
  end subroutine edges

  !> Beside and above the facets: named with distance; max_offset lets it on.
  subroutine outside()
    type(facet_map_type) :: map
    type(error_list_type) :: errors
    real(wp) :: flat(3, 4), ghost(3, 2)
    flat = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, &
                    0.0_wp, 1.0_wp, 0.0_wp], [3, 4])
    ghost(:, 1) = [0.5_wp, 0.5_wp, 0.25_wp]
    ghost(:, 2) = [1.5_wp, 0.5_wp, 0.0_wp]
    call map%build([7_i8, 8_i8], ghost, reshape([1, 2, 3, 4], [4, 1]), flat, -1.0_wp, errors)
    call test%check('outside: one fault', errors%count == 1)
    call test%check_text('outside: code', errors%item(1)%code, 'I401')
    call test%check('outside: ids and distances', index(errors%item(1)%message, &
                    '2 of 2 ghosts lie on no facet: grain 7 (0.25 m), grain 8 (0.5 m)') > 0)
    call errors%clear()
    call map%build([7_i8], ghost(:, :1), reshape([1, 2, 3, 4], [4, 1]), flat, 0.3_wp, errors)
    call test%check('offset allowed', .not. errors%any())
    call test%check_close('offset', map%offset(3, 1), 0.25_wp, 1.0e-15_wp)
  end subroutine outside

  subroutine empty()
    type(facet_map_type) :: map
    type(error_list_type) :: errors
    real(wp) :: none(3, 0)
    call map%build([integer(i8) ::], none, facets, x, -1.0_wp, errors)
    call test%check_text('empty: code', errors%item(1)%code, 'I402')
  end subroutine empty
end program test_cpl_facet_map
