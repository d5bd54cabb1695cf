!> Micro-deformations of an overlap: nodes from grains, ghosts that turn at finite strain, couples.
program test_cpl_micro
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use talus_vectors, only: cross
  use cpl_micro, only: micro_type, parts, moment_of, columns_of_turn
  use cpl_rows, only: rows_type
  implicit none

  integer(i4), parameter :: grains = 40, ghosts = 7, nodes = 8
  real(wp), parameter :: exact = 1.0e-11_wp  !! round-off times slopes of some tens over an edge
  real(wp), parameter :: one(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                              0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  type(test_type) :: test
  type(rows_type) :: at_grains, at_ghosts
  real(wp) :: x(3, grains), w(grains), x_node(3, nodes), x_ghost(3, ghosts)

  call scatter(x, 0.37_wp)
  call scatter(x_ghost, 0.53_wp)
  w = 1.0_wp + 0.5_wp*x(1, :)
  call functions(x, at_grains)
  call functions(x_ghost, at_ghosts)
  call nodes_of_positions()
  call nodes_of_rotations()
  call rigid_turn()
  call powers()
  call faults()
  call test%finish()

contains

  !> Points all over the unit cube.
  subroutine scatter(points, seed)
    real(wp), intent(out) :: points(:, :)
    real(wp), intent(in) :: seed
    integer(i4) :: k
    do k = 1, size(points, 2)
      points(:, k) = modulo(seed*k*[1.0_wp, 1.7_wp, 2.9_wp], 1.0_wp)
    end do
  end subroutine scatter

  !> Trilinear functions of the corners of the unit cube.
  subroutine functions(points, rows)
    real(wp), intent(in) :: points(:, :)
    type(rows_type), intent(inout) :: rows
    real(wp) :: weight(nodes)
    integer(i4) :: k, a
    call rows%begin(size(points, 2, i4), nodes, nodes)
    do k = 1, size(points, 2)
      do a = 1, nodes
        x_node(:, a) = real(ibits(a - 1, [0, 1, 2], 1), wp)
        weight(a) = product(merge(points(:, k), 1.0_wp - points(:, k), x_node(:, a) > 0.5_wp))
      end do
      call rows%add_row([(a, a=1, nodes)], weight)
    end do
    call rows%finish()
  end subroutine functions

  subroutine build(micro, positions)
    type(micro_type), intent(inout) :: micro
    logical, intent(in) :: positions
    type(error_list_type) :: errors
    integer(i4) :: a
    micro%positions = positions
    call micro%begin(ghosts)
    call micro%fit(at_grains, w, x, [(a, a=1, nodes)], errors)
    call test%check('the fit has no fault', .not. errors%any())
  end subroutine build

  !> R = exp of a rotation of `angle` about a skew axis.
  pure function rotation(angle) result(r)
    real(wp), intent(in) :: angle
    real(wp) :: r(3, 3), k(3, 3)
    k = columns_of_turn([2.0_wp, -1.0_wp, 2.0_wp]/3.0_wp)
    r = one + sin(angle)*k + (1.0_wp - cos(angle))*matmul(k, k)
  end function rotation

  !> A uniform deformation gradient of any size is found at every node, whatever the rotations.
  subroutine nodes_of_positions()
    type(micro_type) :: micro
    real(wp) :: f(3, 3), phi(3, parts*nodes), turn(3, nodes)
    integer(i4) :: a
    call build(micro, .true.)
    f = matmul(rotation(1.1_wp), reshape([1.2_wp, 0.1_wp, 0.0_wp, 0.3_wp, 0.8_wp, 0.2_wp, 0.1_wp, &
                                          0.0_wp, 1.1_wp], [3, 3]))
    turn = 7.0_wp
    call micro%prescribed(matmul(f - one, x) + 0.4_wp, turn, phi)
    do a = 1, nodes
      call test%check_all_close('chi = F', phi(:, 3*a - 2:3*a) + one, f, exact)
    end do
  end subroutine nodes_of_positions

  !> The symmetric part of the gradient, and the rotation of the grains.
  subroutine nodes_of_rotations()
    type(micro_type) :: micro
    real(wp) :: g(3, 3), phi(3, parts*nodes), turn(3, nodes), wanted(3, 3)
    call build(micro, .false.)
    g = reshape([0.1_wp, 0.3_wp, -0.2_wp, 0.0_wp, 0.2_wp, 0.4_wp, 0.5_wp, 0.1_wp, -0.1_wp], [3, 3])
    turn = spread([0.01_wp, 0.02_wp, -0.03_wp], 2, nodes)
    call micro%prescribed(matmul(g, x), turn, phi)
    wanted = 0.5_wp*(g + transpose(g)) + columns_of_turn(turn(:, 1))
    call test%check_all_close('strain and rotation', phi(:, 4:6), wanted, exact)
    call test%check_close('skew part of a turn', wanted(3, 2) - wanted(2, 3), 2.0_wp*turn(1, 1), &
                          exact)
  end subroutine nodes_of_rotations

  !> chi = R(t) turns ghosts by the angle of R, in small steps, and by nothing else.
  subroutine rigid_turn()
    integer(i4), parameter :: steps = 1000
    real(wp), parameter :: angle = 1.0_wp
    type(micro_type) :: micro
    real(wp) :: phi(3, parts*nodes), turn(3, ghosts), c(3, parts*nodes)
    integer(i4) :: k, a
    call build(micro, .true.)
    turn = 0.0_wp
    do k = 1, steps
      do a = 1, nodes
        phi(:, 3*a - 2:3*a) = rotation(angle*k/steps) - one
      end do
      call micro%follow(at_ghosts, phi, turn)
    end do
    ! each step turns by the sine of its angle: short by angle/(6 steps^2)
    call test%check_all_close('turn of the ghosts', turn, spread([2.0_wp, -1.0_wp, 2.0_wp] &
      /3.0_wp*angle, 2, ghosts), angle/(5.0_wp*steps**2))
    c = 0.0_wp
    turn = 0.0_wp
    call micro%pull(at_ghosts, turn, c)
    call test%check_all_close('no moment, no couple', c, 0.0_wp, 0.0_wp)
  end subroutine rigid_turn

  !> At finite chi power and moment of ghosts are those of the couples on the nodes, and those of
  !! the prescribed nodes are those of forces and moments on the grains.
  subroutine powers()
    type(micro_type) :: micro
    real(wp) :: phi(3, parts*nodes), rate(3, parts*nodes), m(3, ghosts), before(3, ghosts)
    real(wp) :: turn(3, ghosts), c(3, parts*nodes), force(3, grains), moment(3, nodes)
    real(wp) :: q(3, grains), spin(3, nodes), total(3), chi(3)
    real(wp), parameter :: small = 1.0e-7_wp
    integer(i4) :: k, mode
    call scatter(phi, 0.71_wp)
    call scatter(rate, 0.29_wp)
    call scatter(m, 0.83_wp)
    phi = 0.3_wp*phi
    do mode = 1, 3
      call build(micro, mode == 1)
      micro%rigid = mode == 3
      call micro%take(at_ghosts, phi - small*rate)
      before = 0.0_wp
      turn = before
      call micro%follow(at_ghosts, phi, turn)
      c = 0.0_wp
      call micro%pull(at_ghosts, m, c)
      call test%check_close('power of the ghosts', sum(m*(turn - before))/small, sum(c*rate), &
                            1.0e-7_wp)
      total = 0.0_wp
      do k = 1, parts*nodes
        chi = phi(:, k) + one(:, mod(k - 1, parts) + 1)
        total = total + cross(chi, c(:, k))
      end do
      call test%check_all_close('moment at finite chi', total, sum(m, 2), exact)
      call scatter(q, 0.19_wp)
      call scatter(spin, 0.61_wp)
      force = 0.0_wp
      call micro%pull_prescribed(c, force, moment)
      call micro%prescribed(q, spin, rate)
      call test%check_close('power on prescribed', sum(force*q) + sum(moment*spin), sum(c*rate), &
                            exact)
      call test%check_all_close('no force in all', sum(force, 2), 0.0_wp, exact)
      total = sum(moment, 2)
      do k = 1, grains
        total = total + cross(x(:, k), force(:, k))
      end do
      call test%check_all_close('moment of prescribed nodes', total, moment_of(c), exact)
    end do
  end subroutine powers

  !> Grains in a plane have no micro-deformation, nor have three.
  subroutine faults()
    type(micro_type) :: micro
    type(error_list_type) :: errors
    real(wp) :: flat(3, grains), few(grains)
    integer(i4) :: a
    flat = x
    flat(3, :) = 0.5_wp
    call micro%fit(at_grains, w, flat, [(a, a=1, nodes)], errors)
    call test%check_text('grains in a plane', errors%item(1)%code, 'I425')
    call errors%clear()
    few = 0.0_wp
    few(:3) = 1.0_wp
    call micro%fit(at_grains, few, x, [(a, a=1, nodes)], errors)
    call test%check_text('three grains', errors%item(1)%code, 'I425')
  end subroutine faults
end program test_cpl_micro
