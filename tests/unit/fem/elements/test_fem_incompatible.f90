!> Hexahedron with incompatible modes: forces of its stress are K u, linear fields on distorted
!! elements leave the modes at rest, bending of a brick has the energy of the beam.
program test_fem_incompatible
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_batch, only: fem_batch_type, batch_room, batch_shape, batch_stiffness, lanes, pair
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stress, hex8_forces, hex8_corners
  use fem_incompatible, only: add_mode_stress, mode_gradients
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none
  type(test_type) :: test
  type(fem_formulation_type) :: rule
  real(wp), parameter :: lame(2) = [1.4_wp, 0.9_wp]
  real(wp) :: x(3, 8), factor(8), bent(3, 8)
  integer(i4) :: a

  call make_rule(rule_index('hex8_incompatible'), rule)
  do a = 1, 8
    x(:, a) = 0.5_wp*hex8_corners(:, a) + 0.08_wp*[sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a)]
    factor(a) = 1.0_wp + 0.1_wp*sin(2.0_wp*a)
  end do
  call check_forces()
  call check_linear()
  call check_bending()
  call check_rank()
  call test%finish()

contains

  !> Condensed stiffness (24, 24) of nodes p.
  subroutine stiffness(p, moduli, weight, k)
    real(wp), intent(in) :: p(3, 8), moduli(2), weight(8)
    real(wp), intent(out) :: k(24, 24)
    type(fem_batch_type) :: batch
    integer(i4) :: i, j, l
    call batch_room(rule, rule%at, batch)
    batch%moduli = 0.0_wp
    do l = 1, lanes
      batch%x(l, :, :) = p
      batch%moduli(l, :2) = moduli
      batch%factor(l, :) = weight
    end do
    call batch_shape(rule%at, batch)
    call batch_stiffness(rule, batch)
    do j = 1, 8
      do i = 1, j
        k(3*i - 2:3*i, 3*j - 2:3*j) = reshape(batch%k(3, :, pair(i, j)), [3, 3])
        k(3*j - 2:3*j, 3*i - 2:3*i) = transpose(k(3*i - 2:3*i, 3*j - 2:3*j))
      end do
    end do
  end subroutine stiffness

  subroutine check_forces()
    type(hex8_geometry_type) :: geometry
    real(wp) :: k(24, 24), u(3, 8), stress(6, 8), force(3, 8), g(3, 3, 8)
    integer(i4) :: i
    call stiffness(x, lame, factor, k)
    call test%check('symmetric', max_abs(k - transpose(k)) < 1.0e-14_wp)
    do i = 1, 8
      u(:, i) = [sin(1.3_wp*i), cos(2.1_wp*i), sin(0.7_wp*i + 1.0_wp)]
    end do
    call hex8_geometry(x, geometry)
    call hex8_stress(geometry, u, lame(1) + 2.0_wp/3.0_wp*lame(2), lame(2), .false., stress)
    call add_mode_stress(rule, x, geometry, lame, factor, stress)
    call hex8_forces(geometry, stress, factor, .false., force)
    call test%check_all_close('K u = forces of the stress', matmul(k, [u]), [force], &
                          1.0e-13_wp)
    call mode_gradients(rule, x, geometry, g)
    do i = 1, 8
      g(:, :, i) = g(:, :, i)*geometry%weight(i)
    end do
    call test%check('gradients of the modes have no mean', max_abs(sum(g, 3)) < 1.0e-14_wp)
  end subroutine check_forces

  !> The stress of a linear field is that of the compatible element.
  subroutine check_linear()
    type(hex8_geometry_type) :: geometry
    real(wp) :: u(3, 8), stress(6, 8), other(6, 8), one(8)
    integer(i4) :: i
    do i = 1, 8
      u(:, i) = [0.1_wp*x(1, i) + 0.2_wp*x(2, i), 0.3_wp*x(3, i), 0.5_wp*x(1, i) - 0.4_wp*x(3, i)]
    end do
    one = 1.0_wp
    call hex8_geometry(x, geometry)
    call hex8_stress(geometry, u, 2.0_wp, lame(2), .false., stress)
    other = stress
    call add_mode_stress(rule, x, geometry, lame, one, other)
    call test%check_all_close('linear field', other, stress, 1.0e-14_wp)
  end subroutine check_linear

  !> Brick 2 x 1 x 1, curvature 1 about z, u = (x y, -x^2/2, 0); with nu = 0 the
  !! energy is E I L/2, I = 1/12.
  subroutine check_bending()
    real(wp) :: k(24, 24), p(3, 8), one(8)
    real(wp), parameter :: young = 3.0_wp
    integer(i4) :: i
    one = 1.0_wp
    do i = 1, 8
      p(:, i) = 0.5_wp*hex8_corners(:, i)*[2.0_wp, 1.0_wp, 1.0_wp]
      bent(:, i) = [p(1, i)*p(2, i), -0.5_wp*p(1, i)**2, 0.0_wp]
    end do
    call stiffness(p, [0.0_wp, 0.5_wp*young], one, k)
    call test%check_close('energy in bending', 0.5_wp*sum([bent]*matmul(k, [bent])), &
                          0.5_wp*young/12.0_wp*2.0_wp, 1.0e-14_wp)
  end subroutine check_bending

  !> Six rigid motions without energy and no other: the others keep energy above a bound, seen by
  !! the pivots of an elimination.
  subroutine check_rank()
    real(wp) :: k(24, 24), one(8), pivot
    integer(i4) :: i, j, zero, best
    one = 1.0_wp
    call stiffness(x, lame, one, k)
    zero = 0
    do i = 1, 24  ! symmetric elimination with the largest diagonal entry left
      best = i - 1 + int(maxloc([(k(j, j), j=i, 24)], 1), i4)
      pivot = k(best, best)
      if (pivot < 1.0e-12_wp) then
        zero = 24 - i + 1
        exit
      end if
      k([i, best], :) = k([best, i], :)
      k(:, [i, best]) = k(:, [best, i])
      do j = i + 1, 24
        k(j, i + 1:) = k(j, i + 1:) - k(j, i)/pivot*k(i, i + 1:)
      end do
    end do
    call test%check('six zero modes', zero == 6)
  end subroutine check_rank
end program test_fem_incompatible
