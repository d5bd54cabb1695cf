!> Masses that nodes carry with free grains, masses transferred by P', and damping of the fine
!! scale, on a chain of grains under linear elements.
program test_cpl_inertia
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: max_abs, test_type
  use cpl_fine_damping, only: fine_damping_type
  use cpl_inertia, only: inertia_type
  use cpl_projection, only: projection_type
  use cpl_rows, only: rows_type
  implicit none

  integer(i4), parameter :: elements = 5, per_element = 6, grains = elements*per_element
  integer(i4), parameter :: nodes = elements + 1
  real(wp), parameter :: tight = 1.0e-12_wp  !! round-off
  type(test_type) :: test
  type(error_list_type) :: errors
  type(projection_type) :: p
  real(wp) :: mass(grains), x(grains), x_node(3, nodes)

  call make()
  call carries_mass()
  call hands_mass_over()
  call damps_the_fine_scale()
  call test%finish()

contains

  !> Grains of different masses, unevenly spaced.
  subroutine make()
    type(rows_type) :: n
    integer(i4) :: k, e
    real(wp) :: t
    call n%begin(grains, nodes, 2)
    do k = 1, grains
      x(k) = (k - 0.5_wp + 0.2_wp*sin(3.0_wp*k))/per_element
      e = 1 + int(x(k))
      t = x(k) - (e - 1)
      mass(k) = 2.0_wp + sin(1.9_wp*k)
      call n%add_row([e, e + 1_i4], [1.0_wp - t, t])
    end do
    call n%finish()
    x_node = 0.0_wp
    x_node(1, :) = [(k - 1.0_wp, k=1, nodes)]
    call p%build_l2(n, mass, x_node, [(k, k=1, nodes)], errors)
    call test%check('the chain can be projected', .not. errors%any())
  end subroutine make

  !> (M + P' m P) a = F for any forces, and no momentum is lost.
  subroutine carries_mass()
    type(inertia_type) :: carried
    real(wp) :: node(nodes), force(3, grains), a(3, grains), there(3, nodes), inertial(3, nodes)
    integer(i4) :: k
    node = 0.0_wp
    node(nodes) = 30.0_wp
    node(2) = 4.0_wp
    do k = 1, grains
      force(:, k) = [sin(0.7_wp*k), cos(2.0_wp*k), sin(1.1_wp*k + 1.0_wp)]
    end do
    call carried%build(p, mass, node, errors)
    call test%check('nodes carry mass', carried%active .and. .not. errors%any())
    call carried%resist(force, inertial)
    a = force
    call p%transposed(inertial, a)
    do k = 1, grains
      a(:, k) = a(:, k)/mass(k)
    end do
    call p%apply(a, there)
    do k = 1, nodes
      call test%check('inertia is that of the node''s own acceleration', &
                      all(abs(inertial(:, k) + node(k)*there(:, k)) < tight*30.0_wp))
    end do
    call test%check('momentum', max_abs(matmul(a, mass) + matmul(there, node) &
                                           - sum(force, 2)) < tight*sum(abs(force)))
    call carried%build(p, mass, 0.0_wp*node, errors)
    call test%check('nothing to carry', .not. carried%active)
  end subroutine carries_mass

  !> P' m keeps the total and the first moment.
  subroutine hands_mass_over()
    real(wp) :: node(3, nodes), given(3, grains)
    node = 0.0_wp
    node(1, nodes) = 3.0_wp
    node(1, 3) = 1.0_wp
    given = 0.0_wp
    call p%transposed(node, given)
    call test%check_close('total', sum(given(1, :)), 4.0_wp, tight)
    call test%check_close('first moment', dot_product(given(1, :), x), &
                          dot_product(node(1, :), x_node(1, :)), 10.0_wp*tight)
    call test%check('some grains lose', minval(given(1, :)) < 0.0_wp)
  end subroutine hands_mass_over

  !> The nodes never feel it, it never adds energy, and it leaves coarse motion alone.
  subroutine damps_the_fine_scale()
    type(fine_damping_type) :: damping
    real(wp) :: v(3, grains), force(3, grains), back(3, nodes), prescribed(3, nodes), ramp(grains)
    integer(i4) :: k
    ramp = [(real(k, wp)/grains, k=1, grains)]
    call damping%build(0.3_wp, ramp, mass)
    do k = 1, grains
      v(:, k) = [sin(5.7_wp*k), cos(2.0_wp*k), sin(0.1_wp*k)]
    end do
    force = 0.0_wp
    call damping%act(p, v, force)
    back = 0.0_wp
    call p%n%transposed(force, back)
    call test%check('nodes do not feel it', max_abs(back) < tight*sum(abs(force)))
    call test%check('takes energy', sum(force*v) < 0.0_wp)
    call damping%note(0.1_wp*v)
    call test%check_close('counts what it takes', damping%lost, -0.05_wp*sum(force*v), tight)
    do k = 1, nodes
      prescribed(:, k) = [sin(1.3_wp*k), cos(3.1_wp*k), real(k, wp)]
    end do
    call p%n%apply(prescribed, v)
    force = 0.0_wp
    call damping%act(p, v, force)
    call test%check('coarse motion is free', max_abs(force) < tight*max_abs(v))
  end subroutine damps_the_fine_scale
end program test_cpl_inertia
