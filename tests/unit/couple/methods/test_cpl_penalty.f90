!> Penalty springs on a chain of elements and grains: their highest frequency is the one that was
!! chosen, whatever masses are, so that leapfrog is stable below the limit and not above it, with
!! dashpots and without; momentum is kept and energy bounded.
program test_cpl_penalty
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use cpl_bridge, only: bridge_field_type, domain_type
  use cpl_penalty, only: penalty_springs_type
  use cpl_rows, only: rows_type
  implicit none

  integer(i4), parameter :: elements = 3_i4, grains = 9_i4, nodes = 5_i4, steps = 4000_i4
  real(wp), parameter :: dt = 1.0e-3_wp  !! [s]
  type(test_type) :: test

  call stable('springs below the limit', 0.99_wp, 0.0_wp, .true.)
  call stable('springs above the limit', 1.01_wp, 0.0_wp, .false.)
  call stable('dashpots below the limit', 0.5_wp, 0.49_wp/(2.0_wp*sqrt(0.5_wp)), .true.)
  call stable('dashpots above the limit', 0.5_wp, 0.51_wp/(2.0_wp*sqrt(0.5_wp)), .false.)
  call stiffness()
  call test%finish()

contains

  !> Grains at the thirds of elements between nodes 2 to 5; node 1 is of no element.
  subroutine make(field, grain, node)
    type(bridge_field_type), intent(out) :: field
    real(wp), intent(in) :: grain(grains), node(nodes)
    type(rows_type) :: n
    type(error_list_type) :: errors
    type(domain_type) :: domain
    real(wp) :: xi
    integer(i4) :: e, k
    call n%begin(grains, nodes, 2_i4)
    do e = 1, elements
      do k = 1, 3
        xi = (k - 0.7_wp)/3.0_wp
        call n%add_row([e + 1, e + 2], [1.0_wp - xi, xi])
      end do
    end do
    call n%finish()
    domain%n = n
    domain%bound = [.false., .true., .true., .true., .true.]
    allocate (domain%x_node(3, nodes), source=0.0_wp)
    domain%x_node(1, :) = [(real(k, wp), k=1, nodes)]
    domain%node = node
    domain%grain = grain
    allocate (domain%held(3, nodes), source=.false.)
    call field%build(domain, .true., errors)
    call test%check('no fault', .not. errors%any())
  end subroutine make

  !> Leapfrog of grains and nodes that nothing but springs binds.
  subroutine stable(name, factor, damping, bounded)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: factor, damping
    logical, intent(in) :: bounded
    type(bridge_field_type) :: field
    type(penalty_springs_type) :: springs
    real(wp), dimension(3, grains) :: q, v, force, dashpot
    real(wp), dimension(3, nodes) :: u, d
    real(wp) :: on_nodes(3, 4), grain(grains), node(nodes), before(3), after(3), largest, first
    integer(i4) :: k, i

    grain = [(0.4_wp*(1.0_wp - (k - 0.5_wp)/grains), k=1, grains)]
    node = [9.0_wp, 0.02_wp, 0.7_wp, 1.4_wp, 2.0_wp]
    call make(field, grain, node)
    springs = penalty_springs_type(2.0_wp*sqrt(factor)/dt, damping)
    q = 0.0_wp
    u = 0.0_wp
    v = reshape([(sin(1.3_wp*k), k=1, 3*grains)], [3, grains])
    d = reshape([(cos(1.9_wp*k), k=1, 3*nodes)], [3, nodes])
    d(:, 1) = 0.0_wp
    before = matmul(v, grain) + matmul(d, node)
    first = energy(grain, v, node, d)
    largest = 0.0_wp
    do i = 1, steps
      call springs%forces(field, field%gap(q, u), field%gap(v, d), force, dashpot)
      on_nodes = 0.0_wp
      call field%n%transposed(force, on_nodes)
      d(:, field%at) = d(:, field%at) - dt*on_nodes*field%light
      do k = 1, grains
        v(:, k) = v(:, k) + dt*force(:, k)/grain(k)
      end do
      q = q + dt*v
      u = u + dt*d
      largest = max(largest, energy(grain, v, node, d))
      if (.not. largest < 1.0e9_wp*first) exit
    end do
    after = matmul(v, grain) + matmul(d, node)
    if (bounded) then
      call test%check(name//': energy is bounded', largest < 200.0_wp*first)
      call test%check_close(name//': momentum', norm2(after - before)/norm2(before), 0.0_wp, &
                            1.0e-11_wp)
      if (damping > 0.0_wp) &
        call test%check(name//': they take energy', energy(grain, v, node, d) < 0.9_wp*first)
    else
      call test%check(name//': energy grows', largest > 1.0e6_wp*first)
    end if
  end subroutine stable

  !> Kinetic energy [J].
  pure real(wp) function energy(grain, v, node, d)
    real(wp), intent(in) :: grain(:), v(:, :), node(:), d(:, :)
    energy = 0.5_wp*(sum(grain*sum(v**2, 1)) + sum(node*sum(d**2, 1)))
  end function energy

  !> k = w^2 a (1 - a) m where grains have 1 - a, and nodes a of the mass m of each grain: three
  !! grains to an element, and nodes that have all their mass inside.
  subroutine stiffness()
    type(bridge_field_type) :: field
    type(penalty_springs_type) :: springs
    real(wp), parameter :: m = 0.3_wp, a = 0.7_wp, w = 50.0_wp
    real(wp), dimension(3, grains) :: gap, rate, force, dashpot
    real(wp) :: node(nodes), share(nodes)
    integer(i4) :: k
    share = 0.0_wp
    do k = 1, elements
      share(k + 1) = share(k + 1) + sum(1.0_wp - [0.3_wp, 1.3_wp, 2.3_wp]/3.0_wp)
      share(k + 2) = share(k + 2) + sum([0.3_wp, 1.3_wp, 2.3_wp]/3.0_wp)
    end do
    node = a*m*share
    node(1) = 1.0_wp
    call make(field, [((1.0_wp - a)*m, k=1, grains)], node)
    springs = penalty_springs_type(w, 0.25_wp)
    gap = 2.0e-3_wp
    rate = 0.0_wp
    call springs%forces(field, gap, rate, force, dashpot)
    call test%check_close('stiffness of a uniform domain', maxval(force), &
                          -w**2*a*(1.0_wp - a)*m*2.0e-3_wp, 1.0e-15_wp)
    call test%check_close('the same for all grains', minval(force), maxval(force), 1.0e-15_wp)
    rate = 3.0_wp
    call springs%forces(field, 0.0_wp*gap, rate, force, dashpot)
    call test%check_close('dashpots', force(2, 5), -0.5_wp*w*a*(1.0_wp - a)*m*3.0_wp, 1.0e-12_wp)
    call test%check_close('dashpots are all of it', dashpot(2, 5), force(2, 5), 1.0e-15_wp)
  end subroutine stiffness
end program test_cpl_penalty
