!> talus-fem's service at the port: every verb, refusals, REJECT bit for bit, restart by HELLO.
!!
!! The service runs in this program itself, started as `serve SPEC DECK`. A column of five unit
!! cubes, E = 1000 Pa, nu = 0, 3 kg/m3, held at its sides and base: k = 200 N/m at its top.
program test_fem_port
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, make_folder, replace_file
  use talus_hdf5, only: h5_file_type
  use talus_message, only: message_type, verb_describe, verb_select, &
    verb_set, verb_ready, verb_advance, verb_solve, verb_force, verb_kick_drift, verb_accept, &
    verb_reject, verb_checkpoint, verb_write, verb_stop, verb_abort
  use talus_options, only: options_type
  use talus_partner, only: own_pid
  use talus_scalars, only: scalar_boundary, scalar_count, scalar_elastic, scalar_kinetic, &
    scalar_momentum
  use talus_port_fixture, only: port_test_type, asked_to_serve
  use fem_model, only: fem_model_type
  use talus_ranks, only: leave_ranks
  use fem_port, only: serve
  implicit none

  character(len=*), parameter :: nl = new_line('a')
  character(len=*), parameter :: plain = '&run gravity = 0.0, 0.0, 0.0 /'//nl// &
    "&mesh file = 'mesh.h5' /"//nl// &
    "&material id = 'm', density = 3.0, young = 1000.0, poisson = 0.0 /"//nl// &
    "&section group = 'all', material = 'm' /"//nl//"&support group = 'all', fix = 'x', 'y' /"//nl
  integer(i8), parameter :: top(4) = [21_i8, 22_i8, 23_i8, 24_i8]
  integer(i8), parameter :: middle(4) = [9_i8, 10_i8, 11_i8, 12_i8]
  real(wp), parameter :: k_top = 200.0_wp, k_spring = 600.0_wp
  type(port_test_type) :: test
  type(options_type) :: options
  type(message_type) :: ask, reply
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder
  real(wp) :: now_at

  if (asked_to_serve('talus-fem', options)) then
    call be_served()
  else
    folder = '/tmp/talus-fem-port-'//str(own_pid())
    test%folder = folder
    test%program = 'talus-fem'
    call make_input()
    call start('first')
    call look_round()
    call refusals()
    call springs_and_loads()
    call split_steps()
    call files_and_end()
    call go_on()
    call prescribed()
    call matter()
    call explicit_interval()
    call micromorphic()
    call execute_command_line('rm -rf '//folder)
    call test%finish()
  end if

contains

  subroutine be_served()
    class(fem_model_type), allocatable :: model
    type(error_list_type) :: faults
    integer(i4) :: exit_code
    allocate (model)
    call serve(model, options, exit_code, faults)
    if (faults%any()) call faults%print(0)
    call model%body%system%solver%mumps%free()
    call leave_ranks()
    stop exit_code, quiet=.true.
  end subroutine be_served

  subroutine make_input()
    type(h5_file_type) :: file
    real(wp) :: x(3, 24)
    integer(i4) :: hex8(8, 5), k

    do k = 0, 5
      x(:, 4*k + 1) = [0.0_wp, 0.0_wp, real(k, wp)]
      x(:, 4*k + 2) = [1.0_wp, 0.0_wp, real(k, wp)]
      x(:, 4*k + 3) = [1.0_wp, 1.0_wp, real(k, wp)]
      x(:, 4*k + 4) = [0.0_wp, 1.0_wp, real(k, wp)]
    end do
    hex8 = reshape([(k, k=0, 7), (k, k=4, 11), (k, k=8, 15), (k, k=12, 19), (k, k=16, 23)], [8, 5])
    call make_folder(folder, errors)
    call file%create(folder//'/mesh.h5', errors)
    call file%attr_put('/', 'format', 'talus-mesh', errors)
    call file%attr_put('/', 'version', 1_i4, errors)
    call file%group('/nodes', errors)
    call file%put('/nodes/x', x, errors)
    call file%group('/cells', errors)
    call file%put('/cells/hex8', hex8, errors)
    call file%group('/volume_groups', errors)
    call file%put('/volume_groups/all', [(k, k=0, 4)], errors)
    call file%group('/facet_groups', errors)
    call file%group('/facet_groups/the top', errors)
    call file%put('/facet_groups/the top/quad4', reshape([20, 21, 22, 23], [4, 1]), errors)
    call file%group('/node_groups', errors)
    call file%put('/node_groups/base', [0, 1, 2, 3], errors)
    call file%commit(errors)
    call replace_file(folder//'/deck.nml', plain//"&support group = 'base', fix = 'z' /"//nl// &
      "&analysis kind = 'static', dt = 0.25 /"//nl//'&history every_time = 1.0 /'//nl// &
      '&output every_time = 1.0 /'//nl, errors)
    call test%check('input is written', .not. errors%any())
    if (errors%any()) call errors%print(0)
  end subroutine make_input

  !> Start a service and greet it.
  subroutine start(name, restart)
    character(len=*), intent(in) :: name
    character(len=*), intent(in), optional :: restart
    call test%start(name, ask, reply, now_at, restart)
  end subroutine start

  !> Ask, and expect the fault `code` ('' for none).
  subroutine expect(what, code)
    character(len=*), intent(in) :: what, code
    call test%expect(what, code, ask, reply)
  end subroutine expect

  !> A verb alone, which is answered without a fault.
  subroutine command(verb, what)
    integer(i4), intent(in) :: verb
    character(len=*), intent(in) :: what
    call ask%start(verb)
    call expect(what, '')
  end subroutine command

  subroutine describe(what, group, code)
    character(len=*), intent(in) :: what, group, code
    call ask%start(verb_describe)
    call ask%put_text('what', what)
    if (len(group) > 0) call ask%put_text('group', group)
    call expect('DESCRIBE '//what//' '//group, code)
  end subroutine describe

  subroutine choose(name, role, ids, code)
    character(len=*), intent(in) :: name, role, code
    integer(i8), intent(in) :: ids(:)
    call ask%start(verb_select)
    call ask%put_text('set', name)
    call ask%put_text('role', role)
    call ask%put_int('id', ids)
    call expect('SELECT '//name//' '//role, code)
  end subroutine choose

  subroutine look_round()
    real(wp), allocatable :: mass(:), weight(:), stress(:, :), moduli(:, :)
    integer(i4), allocatable :: quad(:, :), element(:)
    integer(i8), allocatable :: ids(:)
    character(len=:), allocatable :: names

    call describe('mesh', '', '')
    call reply%take('mass_u', mass, errors)
    call test%check_close('mass of the column', sum(mass), 15.0_wp, 1.0e-12_wp)
    call describe('facets', 'the top', '')
    call reply%take_int('connectivity', quad, errors)
    call test%check('facet of the top', all(quad(:, 1) == top))
    call reply%take_int('kind', ids, errors)
    call test%check('it is a quad4', all(ids == [7_i8]))
    call describe('facets', 'base', 'D301')
    call describe('quadrature', '', '')
    call reply%take('weight', weight, errors)
    call reply%take('stress', stress, errors)
    call reply%take_int('element', element, errors)
    call test%check_close('volume', sum(weight), 5.0_wp, 1.0e-12_wp)
    call test%check('points of the last element', size(stress, 2) == 40 .and. element(40) == 5)
    call describe('moduli', '', '')
    call reply%take('moduli', moduli, errors)
    call reply%take_int('mean', element, errors)
    call test%check('moduli of every element', all(shape(moduli) == [6, 5]) .and. &
                    all(moduli(2, :) > 0.0_wp) .and. all(abs(moduli(3:, :)) <= 0.0_wp))
    call test%check('B-bar is reported', size(element) == 5 .and. all(element == element(1)))
    call describe('groups', '', '')
    call reply%get_text('names', names, errors)
    call test%check_text('groups', names, 'all'//nl//'the top'//nl//'base')
    call describe('group', 'base', '')
    call reply%take_int('id', ids, errors)
    call test%check('nodes of the base', all(ids == [1_i8, 2_i8, 3_i8, 4_i8]))
    call describe('grains', '', 'P301')
    call test%check('DESCRIBE without faults', .not. errors%any())
  end subroutine look_round

  subroutine refusals()
    call choose('s', 'surface', top, 'P301')
    call choose('l', 'load', [25_i8], 'P302')
    call ask_solve(1.0_wp, -2.5_wp)
    call expect('SOLVE before READY', 'P021')
    call ask_springs([1_i4, 2_i4, 3_i4, 24_i4])
    call expect('springs that are on no facet', 'P302')
    call ask_springs([21_i4, 22_i4, 23_i4, 99_i4])
    call expect('springs on no nodes', 'P302')
    call ask%start(verb_set)
    call ask%put_text('what', 'contact_weight')
    call expect('SET contact_weight', 'P301')
    call ask%start(verb_set)
    call ask%put_text('what', 'dead_load')
    call ask%put_text('set', 'nobody')
    call expect('dead load of an unknown set', 'P302')
    call ask%start(verb_set)
    call ask%put_text('what', 'moduli')
    call ask%put_int('element', [1_i4])
    call ask%put('young', [1000.0_wp])
    call ask%put('poisson', [0.5_wp])
    call expect('incompressible', 'P302')
  end subroutine refusals

  subroutine ask_springs(nodes)
    integer(i4), intent(in) :: nodes(4)
    call ask%start(verb_set)
    call ask%put_text('what', 'springs')
    call ask%put_int('node', int(reshape(nodes, [4, 1]), i8))
    call ask%put('weight', reshape([0.25_wp, 0.25_wp, 0.25_wp, 0.25_wp], [4, 1]))
    call ask%put('stiffness', [k_spring])
  end subroutine ask_springs

  !> A force on each node of the load set `l` at the top.
  subroutine ask_solve(t1, force)
    real(wp), intent(in) :: t1, force
    call ask%start(verb_solve, 1_i8, t1 - 1.0_wp, t1)
    call ask%put('l.force', spread([0.0_wp, 0.0_wp, force], 2, 4))
    call ask%put_int('trial', 1_i4)
  end subroutine ask_solve

  !> Springs slow the approach to the still state by s/(k + s); REJECT forgets a trial.
  subroutine springs_and_loads()
    real(wp), parameter :: still = -14.0_wp/k_top
    real(wp) :: u(3, 4), again(3, 4), mass(4), stiffness(4), scalars(scalar_count), expected

    call choose('l', 'load', top, '')
    call reply%get('mass', mass, errors)
    call reply%get('stiffness', stiffness, errors)
    call test%check_close('lumped mass', mass(1), 0.375_wp, 1.0e-12_wp)
    call test%check('stiffness', all(stiffness > 0.0_wp))
    call choose('r', 'report', middle, '')
    call ask_springs(int(top, i4))
    call expect('SET springs', '')
    call ask%start(verb_set)
    call ask%put_text('what', 'dead_load')
    call ask%put_text('set', 'l')
    call ask%put('force', spread([0.0_wp, 0.0_wp, -1.0_wp], 2, 4))
    call expect('SET dead_load', '')
    call command(verb_ready, 'READY')
    call ask_solve(1.0_wp, -2.5_wp)
    call expect('SOLVE', '')
    call reply%get('l.u', u, errors)
    expected = still*k_top/(k_top + k_spring)
    call test%check_close('with springs', u(3, 2), expected, 1.0e-13_wp)
    call command(verb_reject, 'REJECT')
    call ask_solve(1.0_wp, -2.5_wp)
    call expect('SOLVE again', '')
    call reply%get('l.u', again, errors)
    call test%check('the same bits after REJECT', all(abs(again - u) <= 0.0_wp))
    call command(verb_accept, 'ACCEPT')
    call ask_solve(2.0_wp, -2.5_wp)
    call expect('SOLVE from there', '')
    call reply%get('l.u', u, errors)
    call reply%get('scalars', scalars, errors)
    expected = still + k_spring/(k_top + k_spring)*(expected - still)
    call test%check_close('closer', u(3, 2), expected, 1.0e-13_wp)
    call test%check_close('strain energy', scalars(scalar_elastic), 0.5_wp*k_top*expected**2, &
                          1.0e-13_wp)
    call command(verb_accept, 'ACCEPT of the second')
    call ask_solve(3.0_wp, -2.5_wp)
    call ask%put('l.moment', 1.0_wp)
    call expect('an unknown field', 'P012')
    call test%check('SOLVE without faults', .not. errors%any())
  end subroutine springs_and_loads

  !> FORCE returns minus the internal forces; a kick of the middle nodes, mass doubled by factor.
  subroutine split_steps()
    real(wp) :: force(3, 4), u(3, 4), v(3, 4), scalars(scalar_count)
    real(wp), parameter :: kick = 1.0e-3_wp
    real(wp) :: before(3, 4)

    call ask%start(verb_force, 3_i8, 2.0_wp, 2.0_wp)
    call expect('FORCE', '')
    call reply%get('l.force', force, errors)
    call ask%start(verb_kick_drift, 3_i8, 2.0_wp, 2.0_wp)
    call ask%put('kick', 0.0_wp)
    call ask%put('drift', 0.0_wp)
    call expect('KICK_DRIFT of nothing', '')
    call reply%get('l.u', u, errors)
    call test%check_close('reaction of the column', sum(force(3, :)), -k_top*u(3, 1), 1.0e-11_wp)
    call choose('m', 'load', middle, '')
    call ask%start(verb_set)
    call ask%put_text('what', 'mass_factor')
    call ask%put_text('set', 'm')
    call ask%put('value', [2.0_wp, 2.0_wp, 2.0_wp, 2.0_wp])
    call expect('SET mass_factor', '')
    call ask%start(verb_set)
    call ask%put_text('what', 'mass_factor')
    call ask%put_text('set', 'm')
    call ask%put('value', [2.0_wp, 2.0_wp, 0.0_wp, 2.0_wp])
    call expect('a node without mass', 'P302')
    call ask%start(verb_force, 3_i8, 2.0_wp, 2.0_wp)
    call ask%put_text('scope', 'all')
    call expect('FORCE again', '')
    call reply%get('m.force', before, errors)
    call ask%start(verb_kick_drift, 3_i8, 2.0_wp, 2.0_wp + kick)
    call ask%put('kick', kick)
    call ask%put('drift', 0.0_wp)
    call ask%put('m.force', spread([0.0_wp, 0.0_wp, 1.5_wp], 2, 4))
    call expect('KICK_DRIFT', '')
    call reply%get('m.v', v, errors)
    call reply%get('scalars', scalars, errors)
    ! lumped mass 0.75 kg a node, doubled; the column is in balance inside
    call test%check_close('kicked', v(3, 1), kick*(1.5_wp + before(3, 1))/1.5_wp, 1.0e-14_wp)
    call test%check('held at its sides', all(abs(v(1:2, :)) <= 0.0_wp))
    call test%check('kinetic energy', scalars(scalar_kinetic) > 0.0_wp)
    call command(verb_reject, 'REJECT of a split step')
    call test%check('split steps without faults', .not. errors%any())
  end subroutine split_steps

  subroutine files_and_end()
    character(len=:), allocatable :: path, hash

    call ask%start(verb_checkpoint)
    call ask%put_text('tag', '000002')
    call expect('CHECKPOINT', '')
    call reply%get_text('path', path, errors)
    call reply%get_text('hash', hash, errors)
    call test%check_text('its path', path, folder//'/deck.000002.chk.h5')
    call test%check('it is there', file_exists(path) .and. len(hash) == 16)
    call ask%start(verb_write)
    call ask%put_text('tag', '000002')
    call expect('WRITE', '')
    call ask%start(verb_stop)
    call ask%put_int('early', 0_i4)
    call expect('STOP', '')
    call test%ends_with(0)
    call test%check('histories and summary', file_exists(folder//'/deck_energy.csv') .and. &
                    file_exists(folder//'/deck_summary.json') .and. file_exists(folder//'/deck.h5'))
  end subroutine files_and_end

  !> Another service restarts from the checkpoint and is stopped early.
  subroutine go_on()
    real(wp) :: u(3, 4)
    call start('second', '000002')
    call test%check_close('it stands where the first one was', now_at, 2.0_wp, 0.0_wp)
    call choose('l', 'load', top, '')
    call command(verb_ready, 'READY after a restart')
    call reply%get('l.u', u, errors)
    call test%check_close('its displacement', u(3, 1), -14.0_wp/k_top*(1.0_wp - 0.75_wp**2), &
                          1.0e-13_wp)
    call ask%start(verb_stop)
    call ask%put_int('early', 1_i4)
    call expect('STOP early', '')
    call test%ends_with(3)
  end subroutine go_on

  !> The top moves down by 0.05 m in four steps of its own; REJECT undoes all four.
  subroutine prescribed()
    real(wp) :: reaction(3, 4), impulse(3, 4), work, u(3, 4), first(3, 4)
    integer(i4) :: substeps, pass

    call start('third')
    call choose('top', 'prescribe', top, '')
    call choose('r', 'report', middle, '')
    call command(verb_ready, 'READY with a prescribed top')
    do pass = 1, 2
      call ask%start(verb_advance, 1_i8, 0.0_wp, 1.0_wp)
      call ask%put('top.u', spread([0.0_wp, 0.0_wp, -0.05_wp], 2, 4))
      call expect('ADVANCE', '')
      call reply%get('top.reaction', reaction, errors)
      call reply%get('top.impulse', impulse, errors)
      call reply%get('top.work', work, errors)
      call reply%get('r.u', u, errors)
      call reply%get_int('substeps', substeps, errors)
      call test%check('four steps of its own', substeps == 4)
      call test%check_close('reaction', sum(reaction(3, :)), -0.05_wp*k_top, 1.0e-12_wp)
      call test%check_close('impulse on the top', sum(impulse(3, :)), 0.025_wp*k_top, 1.0e-12_wp)
      call test%check_close('work', work, 0.5_wp*k_top*0.05_wp**2, 1.0e-13_wp)
      call test%check_close('displacement inside', u(3, 1), -0.02_wp, 1.0e-14_wp)
      if (pass == 1) first = u
      if (pass == 2) call test%check('the same bits', all(abs(u - first) <= 0.0_wp))
      call command(verb_reject, 'REJECT of all sub-steps')
      call command(verb_ready, 'READY again')
      call reply%get('r.u', u, errors)
      call test%check('back at the start', all(abs(u) <= 0.0_wp))
    end do
    call test%check('ADVANCE without faults', .not. errors%any())
    call scopes()
  end subroutine prescribed

  !> An explicit column, free to move along z: a held load and impulses give their momentum at once
  !! and exactly, wherever an interval begins; impulses work, and REJECT takes them back.
  subroutine explicit_interval()
    real(wp), parameter :: span = 0.07_wp, push(3, 4) = spread([0.0_wp, 0.0_wp, 0.25_wp], 2, 4)
    real(wp) :: scalars(scalar_count), before(scalar_count), v(3, 4)
    integer(i4) :: k

    call replace_file(folder//'/deck.nml', plain//"&analysis kind = 'explicit' /"//nl, errors)
    call start('explicit')
    call choose('l', 'load', top, '')
    call command(verb_ready, 'READY of an explicit column')
    do k = 1, 3
      call ask%start(verb_advance, int(k, i8), (k - 1)*span, k*span)
      call ask%put('l.force', spread([0.0_wp, 0.0_wp, 2.0_wp*k], 2, 4))
      call expect('ADVANCE with a held load', '')
      call reply%get('scalars', scalars, errors)
      call test%check_close('held load', scalars(scalar_momentum + 2), 4*span*k*(k + 1), 1e-13_wp)
      call command(verb_accept, 'ACCEPT of it')
    end do
    do k = 1, 2
      call ask%start(verb_advance, 4_i8, 3.0_wp*span, 4.0_wp*span)
      call ask%put('l.impulse', push)
      call expect('ADVANCE after an impulse', '')
      call reply%get('scalars', before, errors)
      call test%check_close('impulse', before(scalar_momentum + 2), 48*span + 1, 1.0e-13_wp)
      call reply%get('l.v', v, errors)
      if (k == 2) exit
      call command(verb_reject, 'REJECT of an impulse')
    end do
    call ask%start(verb_kick_drift, 4_i8, 4.0_wp*span, 4.0_wp*span)
    call ask%put('kick', 0.0_wp)
    call ask%put('drift', 0.0_wp)
    call ask%put('l.impulse', push)
    call expect('an impulse alone', '')
    call reply%get('scalars', scalars, errors)
    scalars = scalars - before
    call test%check_close('its momentum', scalars(scalar_momentum + 2), 1.0_wp, 1.0e-13_wp)
    call test%check_close('its work on nodes of 3/8 kg', scalars(scalar_kinetic), &
      sum(push*v) + 0.5_wp*sum(push**2)/0.375_wp, 1.0e-13_wp)
    call test%check_close('of loads', scalars(scalar_boundary), scalars(scalar_kinetic), 1e-13_wp)
    call test%check('impulses without faults', .not. errors%any())
    call command(verb_stop, 'STOP of the explicit column')
    call test%ends_with(0)
  end subroutine explicit_interval

  !> FORCE in the compressed state: in balance the element at the top loads its lower nodes, which
  !! scope `interface` returns, while all elements together leave them in balance.
  subroutine scopes()
    integer(i8), parameter :: below(4) = [17_i8, 18_i8, 19_i8, 20_i8]
    real(wp), parameter :: pressed = 0.05_wp*k_top
    real(wp) :: force(3, 4)

    call choose('b', 'report', below, '')
    call ask%start(verb_solve, 1_i8, 0.0_wp, 1.0_wp)
    call ask%put('top.u', spread([0.0_wp, 0.0_wp, -0.05_wp], 2, 4))
    call expect('SOLVE before FORCE', '')
    call ask_force('interface', -0.05_wp)
    call expect('FORCE, interface', '')
    call reply%get('top.force', force, errors)
    call test%check_close('the top is pushed up', sum(force(3, :)), pressed, 1.0e-11_wp)
    call reply%get('b.force', force, errors)
    call test%check_close('below it down', sum(force(3, :)), -pressed, 1.0e-11_wp)
    call reply%get('r.force', force, errors)
    call test%check_all_close('far from the interface', force, 0.0_wp, 0.0_wp)
    call ask_force('all', -0.05_wp)
    call expect('FORCE, all', '')
    call reply%get('b.force', force, errors)
    call test%check_all_close('all in balance', force, 0.0_wp, 1.0e-11_wp)
    call ask_force('all', -0.1_wp)
    call expect('FORCE with the top moved', '')
    call reply%get('top.force', force, errors)
    call test%check_close('six elements'' worth', sum(force(3, :)), 6.0_wp*pressed, 1.0e-11_wp)
    call ask_force('some', 0.0_wp)
    call expect('FORCE with an unknown scope', 'P301')
    call command(verb_reject, 'REJECT after FORCE')
    call test%check('FORCE without faults', .not. errors%any())
  end subroutine scopes

  subroutine ask_force(scope, u)
    character(len=*), intent(in) :: scope
    real(wp), intent(in) :: u  !! of the top [m]
    call ask%start(verb_force, 1_i8, 1.0_wp, 1.0_wp)
    call ask%put_text('scope', scope)
    call ask%put('top.u', spread([0.0_wp, 0.0_wp, u], 2, 4))
  end subroutine ask_force

  !> Moduli, weights and initial stress by SET change the reaction of the compressed top.
  subroutine matter()
    real(wp) :: reaction, force(3, 4)
    integer(i4) :: k

    call ask%start(verb_set)
    call ask%put_text('what', 'moduli')
    call ask%put_int('element', [(k, k=1, 5)])
    call ask%put('young', [(3000.0_wp, k=1, 5)])
    call ask%put('poisson', [(0.0_wp, k=1, 5)])
    call expect('SET moduli', '')
    call press(reaction)
    call test%check_close('three times as stiff', reaction, -0.15_wp*k_top, 1.0e-11_wp)
    call ask%start(verb_set)
    call ask%put_text('what', 'quad_weight')
    call ask%put('value', [(0.5_wp, k=1, 40)])
    call expect('SET quad_weight', '')
    call press(reaction)
    call test%check_close('half the weight', reaction, -0.075_wp*k_top, 1.0e-11_wp)
    call ask_force('interface', -0.05_wp)
    call expect('FORCE of weighted elements', '')
    call reply%get('top.force', force, errors)
    call test%check_close('the top element alone, halved', sum(force(3, :)), 75.0_wp, 1.0e-10_wp)
    call command(verb_reject, 'REJECT of weighted elements')
    call ask%start(verb_set)
    call ask%put_text('what', 'initial_stress')
    call ask%put('value', spread([0.0_wp, 0.0_wp, -4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 40))
    call expect('SET initial_stress', '')
    call ask%start(verb_set)
    call ask%put_text('what', 'initial_stress')
    call ask%put_int('element', [1_i4])
    call ask%put('value', spread([0.0_wp, 0.0_wp, -4.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 1))
    call ask%put('density', [1.0_wp])
    call expect('an element without a state does not begin anew', 'P302')
    call press(reaction)
    call test%check_close('half of it', reaction, -0.075_wp*k_top - 2.0_wp, 1.0e-11_wp)
    call command(verb_abort, 'ABORT')
    call test%ends_with(4)
    call test%check('SET without faults', .not. errors%any())
  end subroutine matter

  !> A micromorphic column: phi has three vectors a node; a rigid turn leaves no force, no couple.
  subroutine micromorphic()
    real(wp), parameter :: angle = 0.3_wp
    real(wp), allocatable :: tangent(:, :), moduli(:, :)
    integer(i4), allocatable :: marks(:)
    real(wp) :: u(3, 24), phi(3, 72), force(3, 24), couple(3, 72), inertia(72), r(3, 3), x(3)
    integer(i4) :: k
    character(len=:), allocatable :: deck

    deck = '&run gravity = 0.0, 0.0, 0.0 /'//nl//"&mesh file = 'mesh.h5' /"//nl// &
      "&micromorphic id = 'm', density = 3.0, micro_inertia = 0.1, lambda = 0.0, mu = 700.0, "// &
      'eta = 10.0, tau = 5.0, kappa = 400.0, nu = 100.0, sigma = -50.0, '// &
      'taus = 0, 0, 0, 0, 0, 0, 20.0, 0, 0, 0, 0 /'//nl// &
      "&section group = 'all', material = 'm', element = 'hex8/hex8' /"//nl// &
      "&analysis kind = 'static' /"//nl
    call replace_file(folder//'/deck.nml', deck, errors)
    call start('fourth')
    call describe('mesh', '', '')
    call reply%take_int('micromorphic', marks, errors)
    call test%check('every node has chi', size(marks) == 24 .and. all(marks == 1))
    call describe('moduli', '', '')
    call reply%take('tangent', tangent, errors)
    call reply%take('moduli', moduli, errors)
    call test%check('tangent of the law', all(shape(tangent) == [2025, 1]))
    call test%check_close('kappa', moduli(3, 1), 300.0_wp, 1.0e-12_wp)
    call ask%start(verb_select)
    call ask%put_text('set', 'c')
    call ask%put_text('role', 'prescribe')
    call ask%put_int('id', [(int(k, i8), k=1, 24)])
    call ask%put_text('fields', 'u,phi')
    call expect('SELECT with phi', '')
    call reply%get('inertia', inertia, errors)
    call test%check_close('lumped micro-inertia', sum(inertia), 3.0_wp*5.0_wp*3.0_wp*0.1_wp, &
                          1.0e-12_wp)
    call command(verb_ready, 'READY of a micromorphic column')
    r = reshape([cos(angle) - 1.0_wp, sin(angle), 0.0_wp, -sin(angle), cos(angle) - 1.0_wp, &
                 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 3])
    do k = 1, 24
      x = [merge(1.0_wp, 0.0_wp, any(mod(k, 4) == [2, 3])), &
           merge(1.0_wp, 0.0_wp, any(mod(k, 4) == [3, 0])), real((k - 1)/4, wp)]
      u(:, k) = matmul(r, x)
      phi(:, 3*k - 2:3*k) = r
    end do
    call ask_column(u, phi, force, couple)
    call test%check_all_close('a rigid turn: forces', force, 0.0_wp, 1.0e-11_wp)
    call test%check_all_close('a rigid turn: couples', couple, 0.0_wp, 1.0e-11_wp)
    phi = 0.0_wp
    phi(2, 1::3) = 1.0e-6_wp  ! chi_21, against an F that is 1
    call ask_column(0.0_wp*u, phi, force, couple)
    call test%check_close('couple of chi_21', sum(couple(2, 1::3)), -450.0_wp*5.0_wp*1.0e-6_wp, &
                          1.0e-8_wp)
    call test%check_close('couple of chi_12', sum(couple(1, 2::3)), -150.0_wp*5.0_wp*1.0e-6_wp, &
                          1.0e-8_wp)
    call command(verb_abort, 'ABORT of the column')
    call test%ends_with(4)
  end subroutine micromorphic

  !> Forces and couples of the column at u and phi.
  subroutine ask_column(u, phi, force, couple)
    real(wp), intent(in) :: u(:, :), phi(:, :)
    real(wp), intent(out) :: force(:, :), couple(:, :)
    call ask%start(verb_force, 1_i8, 0.0_wp, 0.0_wp)
    call ask%put('c.u', u)
    call ask%put('c.phi', phi)
    call expect('FORCE of the column', '')
    call reply%get('c.force', force, errors)
    call reply%get('c.moment', couple, errors)
  end subroutine ask_column

  !> Reaction of the top, 0.05 m down.
  subroutine press(reaction)
    real(wp), intent(out) :: reaction
    real(wp) :: force(3, 4)
    call ask%start(verb_solve, 1_i8, 0.0_wp, 1.0_wp)
    call ask%put('top.u', spread([0.0_wp, 0.0_wp, -0.05_wp], 2, 4))
    call expect('SOLVE with a prescribed top', '')
    call reply%get('top.reaction', force, errors)
    reaction = sum(force(3, :))
    call command(verb_reject, 'REJECT of the pressed state')
  end subroutine press
end program test_fem_port
