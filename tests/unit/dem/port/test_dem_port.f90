!> talus-dem's service at the port: every verb, refusals, REJECT bit for bit, restart by HELLO.
!!
!! The service runs in this program itself, started as `serve SPEC DECK`. Three spheres of 1 mm: 10
!! is fixed and becomes a ghost, 20 touches it, 30 is alone and gets a force.
program test_dem_port
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, make_folder, replace_file
  use talus_message, only: message_type, verb_describe, verb_select, &
    verb_set, verb_ready, verb_advance, verb_solve, verb_force, verb_kick_drift, verb_accept, &
    verb_reject, verb_checkpoint, verb_write, verb_stop, verb_abort
  use talus_options, only: options_type
  use talus_partner, only: own_pid
  use talus_scalars, only: scalar_count, scalar_kinetic
  use talus_port_fixture, only: port_test_type, asked_to_serve
  use dem_make, only: make_grains
  use dem_model, only: dem_model_type
  use dem_packing, only: dem_group_type, write_packing
  use dem_port, only: serve
  use dem_state, only: dem_grains_type, dem_material_type
  implicit none

  character(len=*), parameter :: nl = new_line('a')
  real(wp), parameter :: overlap = 5.0e-7_wp, dt = 1.0e-7_wp
  type(port_test_type) :: test
  type(options_type) :: options
  type(message_type) :: ask, reply
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder
  real(wp) :: now_at, mass(3)

  if (asked_to_serve('talus-dem', options)) then
    call be_served()
  else
    folder = '/tmp/talus-dem-port-'//str(own_pid())
    test%folder = folder
    test%program = 'talus-dem'
    call make_input()
    call start('first')
    call look_round()
    call select_and_set()
    call advance_and_reject()
    call refusals()
    call split_steps()
    call files_and_end()
    call go_on()
    call rehearse()
    call press()
    call parts()
    call under_contact()
    call execute_command_line('rm -rf '//folder)
    call test%finish()
  end if

contains

  subroutine be_served()
    class(dem_model_type), allocatable :: model
    type(error_list_type) :: faults
    integer(i4) :: exit_code
    allocate (model)
    call serve(model, options, exit_code, faults)
    if (faults%any()) call faults%print(0)
    stop exit_code, quiet=.true.
  end subroutine be_served

  subroutine make_input()
    type(dem_grains_type) :: grains
    type(dem_material_type) :: quartz(1)
    type(dem_group_type) :: box(1)
    real(wp) :: x(3, 3), quat(4, 3), axes(3, 3), none(3, 3)

    quartz(1) = dem_material_type(young=29.0e9_wp, poisson=0.25_wp, density=2650.0_wp)
    x = 0.0_wp
    x(3, 2) = 2.0e-3_wp - overlap
    x(1, 3) = 1.0e-2_wp
    quat = 0.0_wp
    quat(1, :) = 1.0_wp
    axes = 1.0e-3_wp
    none = 0.0_wp
    call make_grains(grains, quartz, [10_i8, 20_i8, 30_i8], [1, 0, 0], [1, 1, 1], x, quat, axes, &
                     none, none, errors)
    mass = grains%mass
    box(1)%name = 'box'
    box(1)%id = [10_i8]
    call make_folder(folder, errors)
    call write_packing(folder//'/pack.h5', grains, box, errors)
    call write_deck('&history every_time = 1.0e-6 /'//nl//'&output every_time = 1.0e-6 /'//nl)
    call test%check('input is written', .not. errors%any())
  end subroutine make_input

  !> The deck, with groups of its own at the end; it replaces earlier files.
  subroutine write_deck(more)
    character(len=*), intent(in) :: more
    call replace_file(folder//'/deck.nml', '&run gravity = 0.0, 0.0, 0.0 /'//nl// &
      "&material id = 'q', density = 2650.0, young = 29.0e9, poisson = 0.25 /"//nl// &
      "&contact between = 'q', 'q', law = 'hertz_mindlin', friction = 0.5 /"//nl// &
      "&particles file = 'pack.h5', material = 'q' /"//nl//'&dynamics dt = 1.0e-7 /'//nl// &
      more, errors)
    call execute_command_line('rm -f '//folder//'/deck_* '//folder//'/deck.log')
  end subroutine write_deck

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

  subroutine look_round()
    integer(i8), allocatable :: ids(:), pairs(:, :)
    real(wp), allocatable :: force(:, :), normal(:, :)
    character(len=:), allocatable :: names

    call ask%start(verb_describe)
    call ask%put_text('what', 'grains')
    call expect('DESCRIBE grains', '')
    call reply%take_int('id', ids, errors)
    call test%check('ids', all(ids == [10_i8, 20_i8, 30_i8]))
    call ask%start(verb_describe)
    call ask%put_text('what', 'contacts')
    call expect('DESCRIBE contacts', '')
    call reply%take_int('ids', pairs, errors)
    call reply%take('normal', normal, errors)
    call reply%take('force', force, errors)
    call test%check('one contact', size(pairs, 2) == 1 .and. all(pairs(:, 1) == [10_i8, 20_i8]))
    call test%check_close('its normal', normal(3, 1), 1.0_wp, 1.0e-12_wp)
    ! Hertz: 4/3 E* sqrt(R) delta^1.5, E* = E/(2(1 - nu^2)), R = 0.5 mm
    call test%check_close('its force', force(3, 1), 4.0_wp/3.0_wp*29.0e9_wp/1.875_wp &
                          *sqrt(0.5e-3_wp)*overlap**1.5_wp, 1.0e-3_wp*force(3, 1))
    call ask%start(verb_describe)
    call ask%put_text('what', 'groups')
    call expect('DESCRIBE groups', '')
    call reply%get_text('names', names, errors)
    call test%check_text('groups', names, 'box')
    call ask%start(verb_describe)
    call ask%put_text('what', 'group')
    call ask%put_text('group', 'bux')
    call expect('unknown group', 'D240')
    call ask%start(verb_describe)
    call ask%put_text('what', 'mesh')
    call expect('no mesh', 'P255')
  end subroutine look_round

  subroutine choose(name, role, ids, code)
    character(len=*), intent(in) :: name, role, code
    integer(i8), intent(in) :: ids(:)
    call ask%start(verb_select)
    call ask%put_text('set', name)
    call ask%put_text('role', role)
    call ask%put_text('fields', '')
    call ask%put_int('id', ids)
    call expect('SELECT '//name//' '//role, code)
  end subroutine choose

  subroutine select_and_set()
    real(wp) :: before(3, 1), after(3, 1), m(1), stiffness(1), scalars(scalar_count)
    call choose('s', 'surface', [10_i8], 'P009')
    call choose('g', 'prescribe', [11_i8], 'I216')
    call choose('l', 'load', [10_i8], 'P252')
    call choose('g', 'prescribe', [10_i8], '')
    call reply%get('mass', m, errors)
    call reply%get('stiffness', stiffness, errors)
    call test%check_close('mass', m(1), mass(1), 0.0_wp)
    call test%check('stiffness', stiffness(1) > 0.0_wp)
    call choose('r', 'report', [20_i8, 30_i8], '')
    call choose('l', 'load', [30_i8], '')
    call ask%start(verb_advance, 1_i8, 0.0_wp, 1.0e-6_wp)
    call expect('ADVANCE before READY', 'P021')
    call ask%start(verb_ready)
    call expect('READY', '')
    call reply%get('g.force', before, errors)
    call test%check('the ghost is pressed down', before(3, 1) < 0.0_wp)
    call ask%start(verb_set)
    call ask%put_text('what', 'contact_weight')
    call ask%put_int('ids', reshape([20_i8, 10_i8], [2, 1]))
    call ask%put('value', [0.5_wp])
    call expect('SET contact_weight', '')
    call ask%start(verb_set)
    call ask%put_text('what', 'moduli')
    call expect('SET moduli', 'P255')
    call ask%start(verb_ready)
    call expect('READY again', '')
    call reply%get('g.force', after, errors)
    call reply%get('scalars', scalars, errors)
    call test%check_close('half the weight, half the force', after(3, 1), 0.5_wp*before(3, 1), &
                          1.0e-12_wp*abs(before(3, 1)))
    call test%check('READY without faults', .not. errors%any())
  end subroutine select_and_set

  !> One interval of 1e-6 s: the ghost rises by 1e-8 m, grain 30 carries 1e-3 N.
  subroutine ask_interval(t0, t1)
    real(wp), intent(in) :: t0, t1
    call ask%start(verb_advance, 1_i8, t0, t1)
    call ask%put('g.x', reshape([0.0_wp, 0.0_wp, 1.0e-8_wp], [3, 1]))
    call ask%put('g.quat', reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1]))
    call ask%put('l.force', reshape([1.0e-3_wp, 0.0_wp, 0.0_wp], [3, 1]))
    call ask%put('l.moment', reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]))
  end subroutine ask_interval

  subroutine advance_and_reject()
    real(wp) :: v(3, 2), x(3, 2), again(3, 2), impulse(3, 1), work
    integer(i4) :: substeps
    call ask_interval(0.0_wp, 1.0e-6_wp)
    call expect('ADVANCE', '')
    call reply%get('g.impulse', impulse, errors)
    call reply%get('g.work', work, errors)
    call reply%get('r.v', v, errors)
    call reply%get('r.x', x, errors)
    call reply%get_int('substeps', substeps, errors)
    call test%check('ten sub-steps', substeps == 10)
    call test%check_close('impulse of the ghost is the momentum of grain 20', impulse(3, 1), &
                          -mass(2)*v(3, 1), 1.0e-10_wp*abs(impulse(3, 1)))
    call test%check_close('the load accelerates grain 30', v(1, 2), 1.0e-9_wp/mass(3), &
                          1.0e-10_wp*v(1, 2))
    call test%check('work is done by the rising ghost', work > 0.0_wp)
    call ask%start(verb_reject)
    call expect('REJECT', '')
    call ask_interval(0.0_wp, 1.0e-6_wp)
    call expect('ADVANCE again', '')
    call reply%get('r.x', again, errors)
    call test%check('the same bits after REJECT', all(abs(again - x) <= 0.0_wp))
    call ask%start(verb_accept)
    call expect('ACCEPT', '')
    now_at = 1.0e-6_wp
    call test%check('ADVANCE without faults', .not. errors%any())
  end subroutine advance_and_reject

  subroutine refusals()
    call ask_interval(now_at, now_at + 1.05e-6_wp)
    call expect('no whole number of steps', 'P254')
    call ask_interval(now_at + dt, now_at + 2.0_wp*dt)
    call expect('an interval that begins elsewhere', 'P256')
    call ask_interval(now_at, now_at + dt)
    call ask%put('g.phi', 1.0_wp)
    call expect('an unknown field', 'P012')
    call ask%start(verb_advance, 1_i8, now_at, now_at + dt)
    call ask%put('g.quat', reshape([2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1]))
    call expect('no unit quaternion', 'P257')
    call ask%start(verb_solve, 1_i8, now_at, now_at + dt)
    call expect('SOLVE is not for grains', 'P259')
    call choose('h', 'prescribe', [20_i8], 'P253')
  end subroutine refusals

  !> KICK_DRIFT, yet without loads.
  subroutine ask_kick(kick, drift)
    real(wp), intent(in) :: kick, drift
    call ask%start(verb_kick_drift, 1_i8, now_at, now_at + drift)
    call ask%put('kick', kick)
    call ask%put('drift', drift)
  end subroutine ask_kick

  subroutine split_steps()
    real(wp), parameter :: load(3) = [1.0_wp, 0.0_wp, 0.0_wp], none(3) = 0.0_wp
    real(wp) :: force(3, 1), v(3, 2), before(3, 2)

    call ask_kick(0.0_wp, 0.0_wp)
    call expect('KICK_DRIFT of nothing', '')
    call reply%get('r.v', before, errors)
    call ask%start(verb_force, 1_i8, now_at, now_at)
    call ask%put_text('scope', 'interface')
    call ask%put('g.x', reshape([0.0_wp, 0.0_wp, -1.0e-4_wp], [3, 1]))
    call expect('FORCE', '')
    call reply%get('g.force', force, errors)
    call test%check_close('no force when the ghost is away', force(3, 1), 0.0_wp, 0.0_wp)
    call ask_kick(dt, dt)
    call ask%put('l.force', reshape([2.0e-3_wp, 0.0_wp, 0.0_wp], [3, 1]))
    call expect('KICK_DRIFT', '')
    call reply%get('r.v', v, errors)
    call test%check_close('kicked by its load', v(1, 2) - before(1, 2), 2.0e-3_wp*dt/mass(3), &
                          1.0e-9_wp*abs(v(1, 2)))
    call test%check_close('not kicked without force', v(3, 1), before(3, 1), 0.0_wp)
    now_at = now_at + dt
    call test%check_close('staggering of the mean force', kinetic_under(load, none, none) &
                          - kinetic_under(load, [0.3_wp, 0.0_wp, 0.0_wp], none), &
                          dt**2*0.3_wp**2/(8.0_wp*mass(3)), 1.0e-9_wp*dt**2/mass(3))
    call ask%start(verb_force, 1_i8, now_at, now_at)
    call ask%put_text('scope', 'some')
    call expect('FORCE with an unknown scope', 'P255')
    call ask%start(verb_force, 1_i8, now_at, now_at)
    call expect('FORCE after the drift', '')
    call ask%start(verb_accept)
    call expect('ACCEPT of a split step', '')
    call test%check('split steps without faults', .not. errors%any())
  end subroutine split_steps

  !> Kinetic energy reported under a load [N], and a mean force [N] and moment [N m].
  real(wp) function kinetic_under(load, mean, mean_moment) result(kinetic)
    real(wp), intent(in) :: load(3), mean(3), mean_moment(3)
    real(wp) :: scalars(scalar_count)
    call ask_kick(0.0_wp, 0.0_wp)
    call ask%put('l.force', reshape(load, [3, 1]))
    call ask%put('l.mean_force', reshape(mean, [3, 1]))
    call ask%put('l.mean_moment', reshape(mean_moment, [3, 1]))
    call expect('KICK_DRIFT with a mean force', '')
    call reply%get('scalars', scalars, errors)
    kinetic = scalars(scalar_kinetic)
  end function kinetic_under

  subroutine files_and_end()
    character(len=:), allocatable :: path, hash
    call ask%start(verb_checkpoint)
    call ask%put_text('tag', '000001')
    call expect('CHECKPOINT', '')
    call reply%get_text('path', path, errors)
    call reply%get_text('hash', hash, errors)
    call test%check_text('its path', path, folder//'/deck.000001.chk.h5')
    call test%check('it is there', file_exists(path) .and. len(hash) == 16)
    call ask%start(verb_write)
    call ask%put_text('tag', '000001')
    call expect('WRITE', '')
    call ask%start(verb_stop)
    call ask%put_int('early', 0_i4)
    call expect('STOP', '')
    call test%ends_with(0)
    call test%check('histories and summary', file_exists(folder//'/deck_energy.csv') .and. &
                    file_exists(folder//'/deck_summary.json') .and. file_exists(folder//'/deck.h5'))
  end subroutine files_and_end

  !> Another service restarts from the checkpoint, is stopped early, a third one is aborted.
  subroutine go_on()
    real(wp) :: reached
    reached = now_at
    call start('second', '000001')
    call test%check_close('it stands where the first one was', now_at, reached, 0.0_wp)
    call choose('g', 'prescribe', [10_i8], '')
    call ask%start(verb_ready)
    call expect('READY after a restart', '')
    call ask%start(verb_advance, 2_i8, now_at, now_at + dt)
    call expect('ADVANCE after a restart', '')
    call ask%start(verb_stop)
    call ask%put_int('early', 1_i4)
    call expect('STOP early', '')
    call test%ends_with(3)
    call start('third')
    call ask%start(verb_abort)
    call expect('ABORT', '')
    call test%ends_with(4)
  end subroutine go_on

  !> A rehearsal: the driven grain 30 does not move, nothing is written; then it moves from time 0.
  subroutine rehearse()
    real(wp) :: x(3, 1), v(3, 1), scalars(scalar_count)
    integer(i4) :: k
    call write_deck('&driven ids = 30, velocity = 0.0, 0.0, 0.5 /'//nl// &
                    '&history every_time = 1.0e-6 /'//nl)
    call start('fourth')
    call choose('g', 'prescribe', [10_i8], '')
    call choose('r', 'report', [30_i8], '')
    call ask%start(verb_ready)
    call ask%put_int('rehearsal', 1_i4)
    call expect('READY for a rehearsal', '')
    do k = 1, 3
      call ask%start(verb_advance, 1_i8, (k - 1)*1.0e-6_wp, k*1.0e-6_wp)
      call expect('ADVANCE in a rehearsal', '')
      call reply%get('r.x', x, errors)
      call ask%start(verb_accept)
      call expect('ACCEPT in a rehearsal', '')
    end do
    call test%check_close('the driven grain stands still', x(3, 1), 0.0_wp, 0.0_wp)
    call test%check('nothing is written', .not. (file_exists(folder//'/deck_energy.csv') .or. &
                                                 file_exists(folder//'/deck.log')))
    call ask%start(verb_ready)
    call expect('READY that ends it', '')
    call reply%get('r.v', v, errors)
    call reply%get('scalars', scalars, errors)
    call test%check_close('it moves again', v(3, 1), 0.5_wp, 0.0_wp)
    call test%check('grain 20 was pushed meanwhile', scalars(scalar_kinetic) > 0.0_wp)
    call test%check('files are open', file_exists(folder//'/deck_energy.csv'))
    call ask%start(verb_advance, 1_i8, 0.0_wp, 1.0e-6_wp)
    call expect('ADVANCE from time 0', '')
    call reply%get('r.x', x, errors)
    call test%check_close('it has moved', x(3, 1), 0.5e-6_wp, 1.0e-18_wp)
    call ask%start(verb_accept)
    call ask%put_int('final', 1_i4)
    call expect('a final ACCEPT', '')
    call ask%start(verb_advance, 1_i8, 1.0e-6_wp, 2.0e-6_wp)
    call expect('ADVANCE after it', '')
    call ask%start(verb_reject)
    call expect('REJECT after it', 'P260')
    call ask%start(verb_accept)
    call expect('ACCEPT again', '')
    call ask%start(verb_stop)
    call expect('STOP after a rehearsal', '')
    call test%ends_with(0)
    call test%check('rehearsal without faults', .not. errors%any())
  end subroutine rehearse

  !> A surcharge beside a load: both load grain 30; the third interval begins with an update of the
  !! surface, by then the stress has doubled; REJECT undoes the update.
  subroutine press()
    real(wp) :: x(3, 1), again(3, 1), v(3, 1)
    integer(i4) :: k
    call write_deck("&curve id = 'c', times = 1.1e-5, 1.15e-5, values = 1.0, 2.0 /"//nl// &
      "&surcharge stress = 100.0, curve = 'c', lower = 5.0e-3, -1.0e-3, "// &
      'upper = 15.0e-3, 1.0e-3 /'//nl)
    call start('fifth')
    call choose('l', 'load', [30_i8], '')
    call choose('r', 'report', [30_i8], '')
    call ask%start(verb_ready)
    call expect('READY with a surcharge', '')
    do k = 1, 4
      call ask%start(verb_advance, 1_i8, 6.0e-6_wp*min(k - 1, 2), 6.0e-6_wp*min(k, 3))
      call ask%put('l.force', reshape([1.0e-3_wp, 0.0_wp, 0.0_wp], [3, 1]))
      call expect('ADVANCE under a surcharge', '')
      if (k == 4) x = again
      call reply%get('r.x', again, errors)
      call reply%get('r.v', v, errors)
      call ask%start(merge(verb_reject, verb_accept, k == 3))
      call expect('ACCEPT or REJECT', '')
    end do
    call test%check('the same bits after REJECT', all(abs(again - x) <= 0.0_wp))
    call test%check_close('the load is there', v(1, 1), 1.8e-5_wp*1.0e-3_wp/mass(3), 1.0e-12_wp)
    call test%check_close('and the surcharge', v(3, 1), -(1.2e-5_wp + 2.0_wp*6.0e-6_wp) &
                          *2.0e-3_wp/mass(3), 1.0e-12_wp)
    call ask%start(verb_select)
    call ask%put_text('set', 'w')
    call ask%put_text('role', 'report')
    call ask%put_text('fields', 'load')
    call ask%put_int('id', [30_i8])
    call expect('SELECT of loads', '')
    call ask%start(verb_force)
    call expect('FORCE with loads', '')
    call reply%get('w.load', v, errors)
    call test%check_close('FORCE returns the surcharge', v(3, 1), -4.0e-3_wp, 1.0e-12_wp)
    call ask%start(verb_stop)
    call expect('STOP', '')
    call test%ends_with(0)
    call test%check('surcharge without faults', .not. errors%any())
  end subroutine press

  !> 10 and 20 are ghosts that touch, 30 is free: forces between ghosts and those on free grains
  !! come apart, and a ghost that no one foresaw at a free grain is a fault.
  subroutine parts()
    real(wp) :: x(3, 2), both(3, 2), near(3, 1), alone(3, 1)
    integer(i4) :: old
    call ghosts_without_border()
    call choose('b', 'border', [20_i8], '')
    call ask%start(verb_force)
    call ask%put_text('scope', 'split')
    call expect('FORCE split', '')
    call reply%get('g.force', both, errors)
    call reply%get('b.force', near, errors)
    call reply%get_int('border_old', old, errors)
    call test%check_close('ghosts push each other', both(3, 2), -both(3, 1), 0.0_wp)
    call test%check('with a force', both(3, 2) > 0.0_wp .and. old == 0)
    call test%check_all_close('no free grain does', near, 0.0_wp, 0.0_wp)
    call ask%start(verb_force)
    call ask%put_text('scope', 'between')
    call expect('FORCE between ghosts', '')
    call reply%get('g.force', x, errors)
    call test%check('alone the same', all(abs(x - both) <= 0.0_wp) .and. .not. reply%has('b.force'))

    x = 0.0_wp
    x(1, 2) = 1.0e-2_wp - 2.0e-3_wp + overlap
    call ask%start(verb_force)
    call ask%put_text('scope', 'interface')
    call ask%put('b.x', x(:, 2:))
    call expect('FORCE of the border', '')
    call reply%get('b.force', near, errors)
    call reply%get('r.force', alone, errors)
    call test%check_close('the same overlap, the same force', -near(1, 1), both(3, 2), &
                          1.0e-6_wp*both(3, 2))
    call test%check_close('on the free grain', alone(1, 1), -near(1, 1), 0.0_wp)

    call choose('b', 'border', [10_i8], '')
    x(3, 1) = -1.0e-2_wp
    call ask%start(verb_force)
    call ask%put_text('scope', 'split')
    call ask%put('g.x', x)
    call expect('a ghost at a free grain that is not of the border', 'N224')
    call abandon('parts')
  end subroutine parts

  !> Ghosts 10 and 20, without any free grain near them.
  subroutine ghosts_without_border()
    integer(i8), allocatable :: ids(:)
    call write_deck('')
    call start('sixth')
    call choose('g', 'prescribe', [10_i8, 20_i8], '')
    call choose('r', 'report', [30_i8], '')
    call choose('b', 'border', [30_i8], 'P252')
    call ask%start(verb_set)
    call ask%put_text('what', 'contact_weight')
    call ask%put_int('ids', reshape([10_i8, 20_i8], [2, 1]))
    call ask%put('value', [1.0_wp])
    call expect('SET of ghosts', '')
    call ask%start(verb_ready)
    call expect('READY with ghosts', '')
    call ask%start(verb_force)
    call ask%put_text('scope', 'split')
    call expect('FORCE split without a border', 'P255')
    call ask%start(verb_describe)
    call ask%put_text('what', 'border')
    call expect('DESCRIBE border', '')
    call reply%take_int('id', ids, errors)
    call test%check('no ghost is near', size(ids) == 0)
  end subroutine ghosts_without_border

  !> Ghost 10 moves sideways at free grain 20: force and moment of the contact add to a
  !! mean force and moment; the energy's dt^2/8 times the square of both shows the sign.
  subroutine under_contact()
    real(wp) :: force(3, 1), moment(3, 1)
    real(wp), parameter :: load(3) = [0.0_wp, 0.0_wp, 0.05_wp], none(3) = 0.0_wp, &
      couple(3) = [0.0_wp, 1.0e-6_wp, 0.0_wp]
    real(wp) :: inertia
    call write_deck('')
    call start('seventh')
    call choose('g', 'prescribe', [10_i8], '')
    call choose('r', 'report', [20_i8], '')
    call choose('l', 'load', [20_i8], '')
    call ask%start(verb_ready)
    call expect('READY with a contact', '')
    now_at = 0.0_wp
    call ask_kick(0.0_wp, dt)
    call expect('KICK_DRIFT with a contact', '')
    now_at = dt
    call ask%start(verb_force, 1_i8, now_at, now_at)
    call ask%put('g.v', reshape([0.1_wp, 0.0_wp, 0.0_wp], [3, 1]))
    call expect('FORCE with a ghost that goes sideways', '')
    call reply%get('r.force', force, errors)
    call reply%get('r.moment', moment, errors)
    call test%check('force up and sideways, and a moment', force(3, 1) > 0.0_wp .and. &
                    force(1, 1) > 0.0_wp .and. abs(moment(2, 1)) > 0.0_wp)
    inertia = 0.4_wp*mass(2)*1.0e-6_wp
    call test%check_close('the mean force adds to that of the contact', &
      kinetic_under(none, -load, none) - kinetic_under(none, load, none), &
      0.5_wp*dt**2*force(3, 1)*load(3)/mass(2), 1.0e-6_wp*dt**2*force(3, 1)*load(3)/mass(2))
    call test%check_close('the mean moment adds to that of the contact', &
      kinetic_under(none, none, -couple) - kinetic_under(none, none, couple), &
      0.5_wp*dt**2*moment(2, 1)*couple(2)/inertia, &
      1.0e-6_wp*dt**2*abs(moment(2, 1))*couple(2)/inertia)
    call abandon('contact')
  end subroutine under_contact

  subroutine abandon(what)
    character(len=*), intent(in) :: what
    type(error_list_type) :: faults
    call ask%start(verb_abort)
    call test%port%send(ask, faults)
    call test%check(what//': it ends', test%child%wait(20.0_wp))
    call test%port%close()
    call test%check(what//': no faults', .not. errors%any())
  end subroutine abandon
end program test_dem_port
