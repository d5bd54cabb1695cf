!> Parts of a body: loads one after the other, supports, what a partner moves.
program test_fem_parts
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_parts, only: fem_loads_type, fem_port_values_type, fem_scheme_type, fem_supports_type
  use fem_types, only: fem_load_type
  implicit none

  type(test_type) :: test

  call loads_and_supports()
  call partner_moves()
  call schemes()
  call test%finish()

contains

  subroutine loads_and_supports()
    type(fem_loads_type) :: loads
    type(fem_load_type) :: load
    type(fem_supports_type) :: supports
    integer(i4) :: k
    allocate (loads%load(0))
    do k = 1, 3
      load%curve = k
      load%force = spread([1.0_wp, 2.0_wp, real(k, wp)], 2, 4)
      call loads%append(load)
    end do
    call test%check('loads in the order given', all(loads%load%curve == [1, 2, 3]))
    call test%check_close('with their forces', loads%load(2)%force(3, 4), 2.0_wp, 0.0_wp)
    allocate (supports%held(3, 4), source=.false.)
    call supports%hold(2_i4, [1_i4, 4_i4])
    call test%check('one component is held', count(supports%held) == 2 .and. &
                    all(supports%held(2, [1, 4])))
  end subroutine loads_and_supports

  subroutine partner_moves()
    type(fem_port_values_type) :: port
    real(wp) :: u(3, 2)
    logical :: chosen(3, 2)
    allocate (port%prescribed(3, 2), source=.false.)
    allocate (port%given_u(3, 2), source=0.0_wp)
    chosen = .false.
    chosen(:, 1) = .true.
    u = 5.0_wp
    call port%prescribe(chosen, u)
    call test%check_all_close('a new node stays where it is', port%given_u(:, 1), 5.0_wp, 0.0_wp)
    call test%check_all_close('others are not asked', port%given_u(:, 2), 0.0_wp, 0.0_wp)
    call port%prescribe(spread([.true., .true., .true.], 2, 2), 2.0_wp*u)
    call test%check_all_close('moved before: as it was', port%given_u(:, 1), 5.0_wp, 0.0_wp)
    call test%check_all_close('moved from now on', port%given_u(:, 2), 10.0_wp, 0.0_wp)
    call port%move_along(u, 3.0_wp*u, 0.25_wp)
    call test%check_all_close('a quarter of the way', port%given_u, 7.5_wp, 0.0_wp)
    call port%fix_at(chosen, u)
    call test%check('only these', all(port%prescribed .eqv. chosen))
    call test%check_all_close('are kept', port%given_u(:, 1), 5.0_wp, 0.0_wp)
    call test%check_all_close('no other', port%given_u(:, 2), 0.0_wp, 0.0_wp)
  end subroutine partner_moves

  subroutine schemes()
    type(fem_scheme_type) :: scheme
    call scheme%take_inertia(.true.)
    call test%check('in time', scheme%dynamic)
    call scheme%take_inertia(.false.)
    call test%check('in balance', .not. scheme%dynamic)
    call scheme%keep_linear(massive=.true.)
    call test%check('linear, with mass', scheme%linear_only .and. scheme%massive)
  end subroutine schemes
end program test_fem_parts
