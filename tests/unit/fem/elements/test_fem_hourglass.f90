!> One-point hexahedron: the fast forces are K u, linear fields leave the hourglass modes at rest,
!! six zero modes with the control and eighteen without it.
program test_fem_hourglass
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_batch, only: fem_batch_type, batch_room, batch_shape, batch_stiffness, pair
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_corners
  use fem_hourglass, only: lanes, hourglass, one_point_data, one_point_force, one_point_size
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none
  type(test_type) :: test
  type(fem_formulation_type) :: rule
  type(fem_batch_type) :: batch
  real(wp), parameter :: lame(2) = [1.4_wp, 0.9_wp]
  real(wp) :: x(3, 8)
  integer(i4) :: a, l

  call make_rule(rule_index('hex8_one_point'), rule)
  call batch_room(rule, rule%at, batch)
  batch%share = [0.05_wp, 0.1_wp, 0.0_wp, 0.2_wp, 0.05_wp, 0.07_wp, 0.3_wp, 1.0_wp]
  batch%moduli = 0.0_wp
  do l = 1, lanes
    do a = 1, 8
      batch%x(l, :, a) = (0.5_wp + 0.1_wp*l)*hex8_corners(:, a) &
        + 0.08_wp*[sin(1.3_wp*a + l), cos(2.1_wp*a), sin(0.7_wp*a)]
    end do
    batch%moduli(l, :2) = lame*l
    batch%factor(l, :) = 1.0_wp - 0.05_wp*l
  end do
  call batch_shape(rule%at, batch)
  call batch_stiffness(rule, batch)
  x = batch%x(2, :, :)
  call check_means()
  call check_forces()
  call check_linear()
  call check_rank()
  call test%finish()

contains

  !> Volume and mean gradients are those of the fully integrated element.
  subroutine check_means()
    type(hex8_geometry_type) :: geometry
    call hex8_geometry(x, geometry)
    call test%check_close('volume', batch%weight(2, 1), sum(geometry%weight), 1.0e-13_wp)
    call test%check_all_close('mean gradients', batch%u(2, :, 1, :), geometry%mean, &
                          1.0e-13_wp)
  end subroutine check_means

  !> Stiffness (24, 24) of the element in a lane.
  pure function whole(lane) result(k)
    integer(i4), intent(in) :: lane
    real(wp) :: k(24, 24)
    integer(i4) :: i, j
    do j = 1, 8
      do i = 1, j
        k(3*i - 2:3*i, 3*j - 2:3*j) = reshape(batch%k(lane, :, pair(i, j)), [3, 3])
        k(3*j - 2:3*j, 3*i - 2:3*i) = transpose(k(3*i - 2:3*i, 3*j - 2:3*j))
      end do
    end do
  end function whole

  subroutine fast_forces(u, f)
    real(wp), intent(in) :: u(lanes, 3, 8)
    real(wp), intent(out) :: f(lanes, 3, 8)
    real(wp) :: data(lanes, one_point_size)
    call one_point_data(batch%x, batch%u(:, :, 1, :), batch%weight(:, 1), batch%moduli, &
                        batch%factor(:, 1), batch%share, data)
    call one_point_force(data, u, f)
  end subroutine fast_forces

  subroutine check_forces()
    real(wp) :: u(lanes, 3, 8), f(lanes, 3, 8)
    integer(i4) :: i, lane
    do i = 1, 8
      do lane = 1, lanes
        u(lane, :, i) = [sin(1.3_wp*i*lane), cos(2.1_wp*i), sin(0.7_wp*i + 1.0_wp)]
      end do
    end do
    call fast_forces(u, f)
    do lane = 1, lanes
      call test%check_all_close('forces are K u', matmul(whole(lane), [u(lane, :, :)]), &
                                                         [f(lane, :, :)], 1.0e-12_wp)
    end do
  end subroutine check_forces

  !> A linear field has the forces of its constant stress: V sigma b, nothing from hourglassing.
  subroutine check_linear()
    real(wp) :: u(lanes, 3, 8), f(lanes, 3, 8), h(3, 3), s(3, 3), wanted(3, 8)
    integer(i4) :: i, lane
    h = reshape([0.1_wp, 0.3_wp, -0.2_wp, 0.2_wp, -0.4_wp, 0.1_wp, 0.5_wp, 0.0_wp, 0.3_wp], [3, 3])
    do i = 1, 8
      do lane = 1, lanes
        u(lane, :, i) = matmul(h, batch%x(lane, :, i))
      end do
    end do
    call fast_forces(u, f)
    do lane = 1, lanes
      s = lane*lame(2)*(h + transpose(h))
      do i = 1, 3
        s(i, i) = s(i, i) + lane*lame(1)*(h(1, 1) + h(2, 2) + h(3, 3))
      end do
      wanted = batch%factor(lane, 1)*batch%weight(lane, 1)*matmul(s, batch%u(lane, :, 1, :))
      call test%check_all_close('linear field', f(lane, :, :), wanted, 1.0e-11_wp)
    end do
  end subroutine check_linear

  subroutine check_rank()
    real(wp) :: k(24, 24), b(6, 24), bare(24, 24), d(6, 6)
    integer(i4) :: i, j
    k = whole(2)
    call test%check('six zero modes', zero_modes(k) == 6)
    b = 0.0_wp
    do i = 1, 8
      associate (g => batch%u(2, :, 1, i))
        b(:, 3*i - 2) = [g(1), 0.0_wp, 0.0_wp, g(2), 0.0_wp, g(3)]
        b(:, 3*i - 1) = [0.0_wp, g(2), 0.0_wp, g(1), g(3), 0.0_wp]
        b(:, 3*i) = [0.0_wp, 0.0_wp, g(3), 0.0_wp, g(2), g(1)]
      end associate
    end do
    d = 0.0_wp
    d(:3, :3) = 2.0_wp*lame(1)
    do j = 1, 6
      d(j, j) = d(j, j) + 2.0_wp*lame(2)*merge(2.0_wp, 1.0_wp, j <= 3)
    end do
    bare = batch%factor(2, 1)*batch%weight(2, 1)*matmul(transpose(b), matmul(d, b))
    call test%check('eighteen zero modes without control', zero_modes(bare) == 18)
    call test%check('twelve modes are controlled', zero_modes(k - bare) == 12)
    call test%check('orthogonal base vectors', &
                    max_abs(matmul(transpose(hourglass), hourglass) - 8.0_wp*unit4()) &
                    < 1.0e-14_wp)
  end subroutine check_rank

  pure function unit4() result(one)
    real(wp) :: one(4, 4)
    integer(i4) :: i
    one = 0.0_wp
    do i = 1, 4
      one(i, i) = 1.0_wp
    end do
  end function unit4

  !> Number of vanishing pivots of a symmetric elimination, the largest diagonal entry first.
  integer(i4) function zero_modes(matrix)
    real(wp), intent(in) :: matrix(24, 24)
    real(wp) :: k(24, 24), pivot
    integer(i4) :: i, j, best
    k = matrix
    zero_modes = 0
    do i = 1, 24
      best = i - 1 + int(maxloc([(k(j, j), j=i, 24)], 1), i4)
      pivot = k(best, best)
      if (pivot < 1.0e-12_wp) then
        zero_modes = 24 - i + 1
        return
      end if
      k([i, best], :) = k([best, i], :)
      k(:, [i, best]) = k(:, [best, i])
      do j = i + 1, 24
        k(j, i + 1:) = k(j, i + 1:) - k(j, i)/pivot*k(i, i + 1:)
      end do
    end do
  end function zero_modes
end program test_fem_hourglass
