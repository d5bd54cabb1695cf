!> Multipliers of a bridging domain on a chain of elements and grains: against the dense system in
!! the grains, with nodes that are held, lumped, and velocities at the start.
program test_cpl_bridge
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use cpl_bridge, only: bridge_field_type, domain_type
  use cpl_rows, only: rows_type
  implicit none

  integer(i4), parameter :: elements = 3_i4, grains = 9_i4, nodes = 5_i4  !! one node is not bound
  type(test_type) :: test

  call test_consistent(.false.)
  call test_consistent(.true.)
  call test_lumped()
  call test_start()
  call test%finish()

contains

  !> Grains at the thirds of elements between nodes 2 to 5; node 1 is of no element.
  subroutine make(field, held, lumped)
    type(bridge_field_type), intent(out) :: field
    logical, intent(in) :: held(3, nodes), lumped
    type(rows_type) :: n
    type(error_list_type) :: errors
    type(domain_type) :: domain
    real(wp) :: x_node(3, nodes), xi
    integer(i4) :: e, k
    call n%begin(grains, nodes, 2_i4)
    do e = 1, elements
      do k = 1, 3
        xi = (k - 0.7_wp)/3.0_wp
        call n%add_row([e + 1, e + 2], [1.0_wp - xi, xi])
      end do
    end do
    call n%finish()
    x_node = 0.0_wp
    x_node(1, :) = [(real(k, wp), k=1, nodes)]
    domain%n = n
    domain%bound = [.false., .true., .true., .true., .true.]
    domain%x_node = x_node
    domain%node = masses()
    domain%grain = weights()
    domain%held = held
    call field%build(domain, lumped, errors)
    call test%check('no fault', .not. errors%any())
  end subroutine make

  pure function masses() result(m)
    real(wp) :: m(nodes)
    m = [9.0_wp, 0.02_wp, 0.7_wp, 1.4_wp, 2.0_wp]
  end function masses

  pure function weights() result(m)
    real(wp) :: m(grains)
    integer(i4) :: k
    m = [(0.4_wp*(1.0_wp - (k - 0.5_wp)/grains), k=1, grains)]
  end function weights

  subroutine velocities(v, d)
    real(wp), intent(out) :: v(3, grains), d(3, nodes)
    integer(i4) :: k
    do k = 1, grains
      v(:, k) = [sin(1.3_wp*k), cos(0.8_wp*k), sin(2.2_wp*k + 0.3_wp)]
    end do
    do k = 1, nodes
      d(:, k) = [cos(1.9_wp*k), sin(0.4_wp*k), cos(1.1_wp*k + 0.2_wp)]
    end do
  end subroutine velocities

  !> The system in the grains: A L = -g, A = N M^-1 N' + 1/m, M infinite where a node is held.
  pure function dense(field, g, held) result(impulse)
    type(bridge_field_type), intent(in) :: field
    real(wp), intent(in) :: g(3, grains)
    logical, intent(in) :: held(3, nodes)
    real(wp) :: impulse(3, grains), a(grains, grains), n(grains, nodes), b(grains, 1)
    integer(i4) :: i, e, c, k
    n = 0.0_wp
    do i = 1, grains
      do e = field%n%first(i), field%n%first(i + 1) - 1
        n(i, field%at(field%n%column(e))) = field%n%weight(e)
      end do
    end do
    do c = 1, 3
      a = 0.0_wp
      do i = 1, grains
        a(i, i) = 1.0_wp/field%grain(i)
        do k = 1, nodes
          if (.not. held(c, k)) a(:, i) = a(:, i) + n(:, k)*n(i, k)*invert(k)
        end do
      end do
      b(:, 1) = -g(c, :)
      call eliminate(a, b(:, 1))
      impulse(c, :) = b(:, 1)
    end do
  end function dense

  pure real(wp) function invert(k)
    integer(i4), intent(in) :: k
    real(wp) :: m(nodes)
    m = masses()
    invert = 1.0_wp/m(k)
  end function invert

  !> Gauss, without pivots: the matrix is positive.
  pure subroutine eliminate(a, b)
    real(wp), intent(inout) :: a(:, :), b(:)
    integer(i4) :: i, j
    do i = 1, size(b)
      do j = i + 1, size(b)
        b(j) = b(j) - a(j, i)/a(i, i)*b(i)
        a(j, i + 1:) = a(j, i + 1:) - a(j, i)/a(i, i)*a(i, i + 1:)
      end do
    end do
    do i = int(size(b), i4), 1, -1
      b(i) = (b(i) - dot_product(a(i, i + 1:), b(i + 1:)))/a(i, i)
    end do
  end subroutine eliminate

  !> Bound velocities agree, momentum stays, multipliers are those of the dense system.
  subroutine test_consistent(with_held)
    logical, intent(in) :: with_held
    type(bridge_field_type) :: field
    logical :: held(3, nodes)
    real(wp), dimension(3, grains) :: v, impulse, wanted, none
    real(wp) :: d(3, nodes), before(3, nodes), total(3)
    held = .false.
    if (with_held) held(2, 3) = .true.
    if (with_held) held(:, 5) = .true.
    call make(field, held, .false.)
    call velocities(v, d)
    where (held) d = 0.0_wp
    before = d
    none = 0.0_wp
    total = matmul(v, weights()) + matmul(d(:, 2:), masses_of(2_i4))
    wanted = dense(field, field%gap(v, d), held)
    call field%bind(none, v, d, impulse)
    call test%check_all_close('multipliers of the dense system', impulse, wanted, &
                          1.0e-10_wp)
    call test%check_all_close('no gap', field%gap(v, d), 0.0_wp, 1.0e-10_wp)
    call test%check_all_close('node outside', d(:, 1), before(:, 1), 0.0_wp)
    call test%check('some are held', any(held) .eqv. with_held)
    call test%check('held', all(pack(abs(d - before) <= 0.0_wp, held)))
    if (with_held) return
    total = total - matmul(v, weights()) - matmul(d(:, 2:), masses_of(2_i4))
    call test%check_all_close('momentum', total, 0.0_wp, 1.0e-14_wp)
  end subroutine test_consistent

  pure function masses_of(first) result(m)
    integer(i4), intent(in) :: first
    real(wp) :: m(nodes - first + 1), all_of(nodes)
    all_of = masses()
    m = all_of(first:)
  end function masses_of

  !> By row sums: part of the gap is removed, momentum stays, energy drops, and a gap that is the
  !! same for all grains of a domain without limits would be taken whole.
  subroutine test_lumped()
    type(bridge_field_type) :: field
    logical :: held(3, nodes)
    real(wp), dimension(3, grains) :: v, impulse, none
    real(wp) :: d(3, nodes), total(3), energy, gap
    held = .false.
    call make(field, held, .true.)
    call velocities(v, d)
    none = 0.0_wp
    total = matmul(v, weights()) + matmul(d(:, 2:), masses_of(2_i4))
    energy = kinetic(v, d)
    gap = norm2(field%gap(v, d))
    call field%bind(none, v, d, impulse)
    total = total - matmul(v, weights()) - matmul(d(:, 2:), masses_of(2_i4))
    call test%check_all_close('lumped: momentum', total, 0.0_wp, 1.0e-14_wp)
    call test%check('lumped: energy falls', kinetic(v, d) < energy)
    call test%check('lumped: the gap closes', norm2(field%gap(v, d)) < gap)
    call test%check_close('lumped: row sum of the first grain', 1.0_wp/field%share(1, 1), &
                          first_sum(), 1.0e-12_wp*first_sum())
  end subroutine test_lumped

  pure real(wp) function kinetic(v, d)
    real(wp), intent(in) :: v(3, grains), d(3, nodes)
    kinetic = 0.5_wp*(sum(spread(weights(), 1, 3)*v**2) + &
                      sum(spread(masses_of(2_i4), 1, 3)*d(:, 2:)**2))
  end function kinetic

  !> Row sum of A of the grain at 0.1 of the first element, by hand.
  pure real(wp) function first_sum()
    real(wp) :: m(nodes), w(grains)
    m = masses()
    w = weights()
    first_sum = 1.0_wp/w(1) + 0.9_wp*1.7_wp/m(2) + 0.1_wp*3.0_wp/m(3)
  end function first_sum

  !> Velocities of a linear field are found at the nodes, held ones stay at 0.
  subroutine test_start()
    type(bridge_field_type) :: field
    type(error_list_type) :: errors
    logical :: held(3, nodes)
    real(wp) :: v(3, grains), d(3, nodes), x_node(3, nodes)
    integer(i4) :: k
    held = .false.
    call make(field, held, .true.)
    x_node = 0.0_wp
    x_node(1, :) = [(real(k, wp), k=1, nodes)]
    d = spread([0.3_wp, -1.0_wp, 0.2_wp], 2, nodes)*spread(x_node(1, :) - 2.5_wp, 1, 3)
    v = -field%gap(0.0_wp*v_zero(), d)
    d = 7.0_wp
    call field%start(v, x_node, d, errors)
    call test%check('start: no fault', .not. errors%any())
    do k = 2, nodes
      call test%check_close('start', d(2, k), 2.5_wp - k, 1.0e-9_wp)
    end do
    call test%check_close('start: node outside', d(1, 1), 7.0_wp, 0.0_wp)
  end subroutine test_start

  pure function v_zero() result(v)
    real(wp) :: v(3, grains)
    v = 0.0_wp
  end function v_zero
end program test_cpl_bridge
