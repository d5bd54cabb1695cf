!> The hexahedron: rigid motions, linear fields, symmetry, spectrum of the reference cube, mass.
program test_fem_hex8
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stiffness, hex8_stress, hex8_forces, &
    hex8_shape, quad4_shape, hex8_corners
  implicit none
  type(test_type) :: test
  real(wp), parameter :: one(8) = 1.0_wp, bulk = 1.0_wp/1.2_wp, shear = 1.0_wp/2.6_wp
  real(wp) :: x(3, 8)

  call test%check_close('partition of unity', sum(hex8_shape([0.3_wp, -0.2_wp, 0.7_wp])), &
    1.0_wp, 1.0e-15_wp)
  call test%check_close('facet partition', sum(quad4_shape([0.3_wp, -0.9_wp])), 1.0_wp, 1.0e-15_wp)
  x = 0.5_wp*hex8_corners
  x(:, 7) = x(:, 7) + [0.1_wp, 0.05_wp, -0.08_wp]
  x(:, 2) = x(:, 2) + [-0.06_wp, 0.02_wp, 0.04_wp]
  call check_element(.false., 'full')
  call check_element(.true., 'bbar')
  call check_spectrum()
  call test%finish()

contains

  !> Full matrix of 24 rows from the blocks a <= b.
  subroutine full_matrix(k, matrix)
    real(wp), intent(in) :: k(3, 3, 8, 8)
    real(wp), intent(out) :: matrix(24, 24)
    integer(i4) :: a, b
    do b = 1, 8
      do a = 1, b
        matrix(3*a - 2:3*a, 3*b - 2:3*b) = k(:, :, a, b)
        matrix(3*b - 2:3*b, 3*a - 2:3*a) = transpose(k(:, :, a, b))
      end do
    end do
  end subroutine full_matrix

  !> Rigid motions give no force; K u equals the forces of the stresses; diagonal blocks symmetric.
  subroutine check_element(bbar, name)
    logical, intent(in) :: bbar
    character(len=*), intent(in) :: name
    type(hex8_geometry_type) :: geometry
    real(wp) :: k(3, 3, 8, 8), matrix(24, 24), u(3, 8), force(3, 8), stress(6, 8), scale, linear(6)
    integer(i4) :: a

    call hex8_geometry(x, geometry)
    call hex8_stiffness(geometry, bulk, shear, one, bbar, k)
    call full_matrix(k, matrix)
    scale = max_abs(matrix)
    call test%check(name//': symmetric', max_abs(matrix - transpose(matrix)) < 1.0e-14_wp*scale)
    u = spread([1.0_wp, 2.0_wp, -3.0_wp], 2, 8)
    call test%check(name//': translation', max_abs(matmul(matrix, [u])) < 1.0e-13_wp*scale)
    do a = 1, 8
      u(:, a) = [-x(2, a) + 2.0_wp*x(3, a), x(1, a), -2.0_wp*x(1, a)]
    end do
    call test%check(name//': rotation', max_abs(matmul(matrix, [u])) < 1.0e-13_wp*scale)
    do a = 1, 8
      u(:, a) = [sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
    end do
    call hex8_stress(geometry, u, bulk, shear, bbar, stress)
    call hex8_forces(geometry, stress, one, bbar, force)
    call test%check(name//': K u = forces of the stresses', &
                    max_abs(matmul(matrix, [u]) - [force]) < 1.0e-13_wp*scale)
    do a = 1, 8
      u(:, a) = [0.1_wp*x(1, a) + 0.2_wp*x(2, a), 0.3_wp*x(3, a), -0.4_wp*x(3, a)]
    end do
    call hex8_stress(geometry, u, bulk, shear, bbar, stress)
    linear = [2.0_wp*shear*0.2_wp + bulk*(-0.3_wp), 2.0_wp*shear*0.1_wp + bulk*(-0.3_wp), &
              2.0_wp*shear*(-0.3_wp) + bulk*(-0.3_wp), shear*0.2_wp, shear*0.3_wp, 0.0_wp]
    do a = 1, 8
      call test%check(name//': linear field, constant stress', &
                      max_abs(stress(:, a) - linear) < 1.0e-13_wp)
    end do
  end subroutine check_element

  !> Unit cube, E = 1, nu = 0.3, rho = 1, lumped: largest frequency sqrt(10)
  !! (an independent eigenvalue solution), by
  !! power iteration, and six zero energies.
  subroutine check_spectrum()
    type(hex8_geometry_type) :: geometry
    real(wp) :: k(3, 3, 8, 8), matrix(24, 24), v(24), w
    integer(i4) :: step
    call hex8_geometry(0.5_wp*hex8_corners, geometry)
    call hex8_stiffness(geometry, 1.0_wp/1.2_wp, 1.0_wp/2.6_wp, one, .false., k)
    call full_matrix(k, matrix)
    matrix = 8.0_wp*matrix
    v = [(sin(1.7_wp*step), step=1, 24)]
    do step = 1, 4000
      v = matmul(matrix, v)
      w = norm2(v)
      v = v/w
    end do
    call test%check_close('largest frequency of the cube', sqrt(w), 3.16227766017_wp, 1.0e-8_wp)
    call test%check_close('volume', sum(geometry%weight), 1.0_wp, 1.0e-14_wp)
  end subroutine check_spectrum
end program test_fem_hex8
