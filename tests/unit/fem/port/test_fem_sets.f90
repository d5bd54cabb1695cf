!> Sets of the port with micro-rotations: loads with moments, prescribed rotations, reactions.
program test_fem_sets
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_solve
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_edge, only: fem_edge_type
  use fem_kinds, only: hex8
  use fem_recover, only: element_forces
  use talus_ranks, only: leave_ranks
  use fem_sets, only: fem_sets_type
  use fem_linear_step, only: linear_step
  use fem_topology, only: set_elements
  implicit none

  real(wp), parameter :: kappa = 6.0_wp, gamma = 2.0_wp
  type(test_type) :: test

  call turned_block()
  call loaded_block()
  call refused()
  call shared_maps()
  call known_forces()
  call leave_ranks()
  call test%finish()

contains

  !> A unit cube of a micropolar solid, displacements held.
  subroutine make_cube(body)
    type(fem_body_type), intent(inout) :: body
    call make_row(body, [0.0_wp, 1.0_wp])
    body%supports%held(:, :8) = .true.
  end subroutine make_cube

  !> Bricks between the given heights, 1 by 1 wide.
  subroutine make_row(body, z)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: z(:)
    integer(i4) :: k, e, n
    n = size(z)
    allocate (body%mesh%x(3, 4*n), body%mesh%group(0))
    do k = 1, n
      body%mesh%x(:, 4*k - 3:4*k) = reshape([0.0_wp, 0.0_wp, z(k), 1.0_wp, 0.0_wp, z(k), 1.0_wp, &
        1.0_wp, z(k), 0.0_wp, 1.0_wp, z(k)], [3, 4])
    end do
    call set_elements(body%mesh, hex8, reshape([([(4*e + k, k=-3, 4)], e=1, n - 1)], [8, n - 1]))
    call body%elastic%start(n - 1)
    do e = 1, n - 1
      call body%elastic%use_rule('hex8/hex8', body%elastic%rule_of(e))
    end do
    body%elastic%moduli = spread([1.0_wp, -1.0_wp, kappa, 0.0_wp, 0.0_wp, gamma], 2, n - 1)
    body%elastic%density = 3.0_wp
    body%elastic%inertia = 0.5_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    call body%assemble()
  end subroutine make_row

  !> The whole block turned by phi against held displacements: moment 2 kappa phi per volume.
  subroutine turned_block()
    type(fem_body_type) :: body
    type(fem_sets_type) :: sets
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp) :: phi(3, 8), moment(3, 8)
    integer(i8) :: ids(8)
    integer(i4) :: k
    logical :: changed

    call make_cube(body)
    ids = [(int(k, i8), k=1, 8)]
    call sets%select('all', 'prescribe', 'phi', ids, body, changed, errors)
    call test%check('micro-rotations are prescribed', changed .and. all(body%port%prescribed(:, &
      9:)))
    call test%check('displacements are not', .not. any(body%port%prescribed(:, :8)))
    phi = spread([0.1_wp, 0.0_wp, -0.2_wp], 2, 8)
    call request%start(verb_solve)
    call request%put('all.phi', phi)
    call sets%take_motion(body, request, errors)
    call linear_step(body, 1.0_wp, errors)
    call reply%start(verb_solve)
    call sets%put_states(body, reply)
    call reply%get('all.reaction_moment', moment, errors)
    call test%check('no fault', .not. errors%any())
    call test%check_close('moment about x', sum(moment(1, :)), 2.0_wp*kappa*0.1_wp, 1.0e-13_wp)
    call test%check_close('moment about z', sum(moment(3, :)), -4.0_wp*kappa*0.1_wp, 1.0e-13_wp)
    call test%check_close('work is stored', body%energy%support, body%energy%strain, 1.0e-14_wp)
    call body%system%solver%mumps%free()
  end subroutine turned_block

  !> Moments on micro-rotations against held displacements: phi = m / (2 kappa V).
  subroutine loaded_block()
    type(fem_body_type) :: body
    type(fem_sets_type) :: sets
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp) :: phi(3, 8)
    integer(i8) :: ids(8)
    integer(i4) :: k
    logical :: changed

    call make_cube(body)
    ids = [(int(k, i8), k=1, 8)]
    call sets%select('all', 'load', 'u,phi', ids, body, changed, errors)
    call request%start(verb_solve)
    call request%put('all.force', 0.0_wp*phi_like(1.0_wp))
    call request%put('all.moment', phi_like(0.25_wp))
    call sets%take_loads(body, request, errors)
    call linear_step(body, 1.0_wp, errors)
    call reply%start(verb_solve)
    call sets%put_states(body, reply)
    call reply%get('all.phi', phi, errors)
    call test%check('no fault of loads', .not. errors%any())
    call test%check('uniform rotation', max_abs(phi(2, :) - 2.0_wp/(2.0_wp*kappa)) < 1.0e-14_wp)
    call test%check('about y alone', max_abs(phi([1, 3], :)) < 1.0e-15_wp)
    call body%system%solver%mumps%free()
  end subroutine loaded_block

  !> Elements of one shape share a map of their forces; what the maps give is what elements give.
  subroutine shared_maps()
    type(fem_body_type) :: body
    type(fem_edge_type) :: edge
    real(wp), allocatable :: u(:, :), f(:, :)
    integer(i4) :: k, list(3) = [1, 2, 4]

    call make_row(body, [0.0_wp, 0.7_wp, 1.4_wp, 1.9_wp, 2.9_wp])
    allocate (u(3, body%dofs%blocks), f(3, body%dofs%blocks))
    u = reshape([(sin(1.3_wp*k), k=1, int(size(u), i4))], shape(u))
    call edge%build(body%mesh, body%dofs, body%elastic, list)
    call test%check('two of three maps', size(edge%k) == 2*48**2 .and. edge%at(1) == edge%at(2))
    do k = 1, 2  ! nothing is left over from the time before
      call edge%force(u)
      call element_forces(body%mesh, body%dofs, body%elastic, u, list, f)
      call test%check_close('forces of maps', max_abs(edge%f - f)/max_abs(f), 0.0_wp, &
                            1.0e-13_wp)
      u = 0.5_wp*u + 0.1_wp
    end do
    call test%check('other nodes than theirs', size(edge%of) == body%dofs%blocks)
    call edge%build(body%mesh, body%dofs, body%elastic, [4])
    call edge%force(u)
    call test%check('only of the last', size(edge%of) == 16 .and. &
                    all(abs(edge%f(:, :12)) <= 0.0_wp) .and. any(abs(edge%f(:, 13:20)) > 0.0_wp))
    call body%system%solver%mumps%free()
  end subroutine shared_maps

  !> Forces of the body are recomputed when it has moved or its stiffness was changed.
  subroutine known_forces()
    type(fem_body_type) :: body
    type(fem_sets_type) :: sets
    real(wp), allocatable, dimension(:, :) :: first, again
    integer(i4) :: k

    call make_row(body, [0.0_wp, 1.0_wp, 2.0_wp])
    allocate (first(3, body%dofs%blocks), again(3, body%dofs%blocks))
    body%state%u = reshape([(cos(0.7_wp*k), k=1, int(size(first), i4))], shape(first))
    call sets%whole_force(body, first)
    call sets%whole_force(body, again)
    call test%check('the same again', all(abs(first - again) <= 0.0_wp) .and. any(first > 0.0_wp))
    body%system%k = 2.0_wp*body%system%k
    call sets%forget_elements()
    call sets%whole_force(body, again)
    call test%check('of another stiffness', all(abs(2.0_wp*first - again) <= 0.0_wp))
    body%state%u(1, 5) = body%state%u(1, 5) + 1.0_wp
    call sets%whole_force(body, first)
    call body%trial_force(body%state%u, again)
    call test%check('of another place', all(abs(first - again) <= 0.0_wp))
    call body%system%solver%mumps%free()
  end subroutine known_forces

  pure function phi_like(value) result(field)
    real(wp), intent(in) :: value
    real(wp) :: field(3, 8)
    field = 0.0_wp
    field(2, :) = value
  end function phi_like

  !> A node without micro-rotation is named.
  subroutine refused()
    type(fem_body_type) :: body
    type(fem_sets_type) :: sets
    type(error_list_type) :: errors
    logical :: changed
    call make_cube(body)
    body%dofs%phi(5) = 0
    call sets%select('all', 'load', 'u,phi', [1_i8, 5_i8], body, changed, errors)
    call test%check('one fault', errors%count == 1)
    call test%check_text('its code', errors%item(1)%code, 'P302')
    call test%check('the node is named', index(errors%item(1)%message, 'node 5') > 0)
  end subroutine refused
end program test_fem_sets
