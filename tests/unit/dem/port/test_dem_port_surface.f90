!> The role surface at the port: triangles that a partner moves, forces on their vertices; refusals,
!! REJECT and restart bit for bit. A sphere of 1 mm is on a square of two triangles.
!!
!! The service runs in this program itself, started as `serve SPEC DECK`.
program test_dem_port_surface
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_files, only: make_folder, replace_file
  use talus_message, only: message_type, verb_select, verb_ready, &
    verb_advance, verb_force, verb_kick_drift, verb_accept, verb_reject, verb_checkpoint, verb_stop
  use talus_options, only: options_type
  use talus_scalars, only: scalar_count, scalar_kinetic, scalar_elastic, scalar_boundary, &
    scalar_momentum, scalar_friction, scalar_contact_damping, scalar_curvature, &
    scalar_tangential_relaxation
  use talus_partner, only: own_pid
  use talus_test, only: max_abs
  use talus_port_fixture, only: port_test_type, asked_to_serve
  use dem_make, only: make_grains
  use dem_model, only: dem_model_type
  use dem_packing, only: dem_group_type, write_packing
  use dem_port, only: serve
  use dem_state, only: dem_grains_type, dem_material_type
  implicit none
  character(len=*), parameter :: nl = new_line('a')
  real(wp), parameter :: span = 1.0e-5_wp
  type(port_test_type) :: test
  type(options_type) :: options
  type(message_type) :: ask, reply
  type(error_list_type) :: errors
  character(len=:), allocatable :: folder
  real(wp) :: corner(3, 4), last(3, 4), now_at

  corner = 2.0e-3_wp*reshape([-1.0_wp, -1.2_wp, 0.0_wp, 1.3_wp, -1.0_wp, 0.0_wp, 1.0_wp, 1.1_wp, &
                              0.0_wp, -1.2_wp, 1.0_wp, 0.0_wp], [3, 4])
  if (asked_to_serve('talus-dem', options)) then
    call be_served()
  else
    folder = '/tmp/talus-dem-port-surface-'//str(own_pid())
    test%folder = folder
    test%program = 'talus-dem'
    call make_input()
    call start('first')
    call refuse()
    call push()
    call split()
    call go_on()
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
    type(dem_group_type) :: none(0)
    real(wp) :: zero(3, 1)

    quartz(1) = dem_material_type(young=29.0e9_wp, poisson=0.25_wp, density=2650.0_wp)
    zero = 0.0_wp
    call make_grains(grains, quartz, [5_i8], [0], [1], &
                     reshape([1.0e-4_wp, 2.0e-4_wp, 1.0e-3_wp], [3, 1]), &
                     reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [4, 1]), &
                     reshape([1.0e-3_wp, 1.0e-3_wp, 1.0e-3_wp], [3, 1]), zero, zero, errors)
    call make_folder(folder, errors)
    call write_packing(folder//'/pack.h5', grains, none, errors)
    call replace_file(folder//'/deck.nml', '&run gravity = 0.0, 0.0, 0.0 /'//nl// &
      "&material id = 'q', density = 2650.0, young = 29.0e9, poisson = 0.25 /"//nl// &
      "&material id = 'rubber', density = 1000.0, young = 1.0e9, poisson = 0.4 /"//nl// &
      "&material id = 'air', density = 1.0, young = 1.0, poisson = 0.0 /"//nl// &
      "&contact between = 'q', 'q', law = 'hertz_mindlin', friction = 0.5 /"//nl// &
      "&contact between = 'q', 'rubber', law = 'hertz_mindlin', friction = 0.5,"//nl// &
      "  rolling_friction = 0.1, cohesion = 'jkr', surface_energy = 1.0e-4 /"//nl// &
      "&particles file = 'pack.h5', material = 'q' /"//nl//'&dynamics dt = 1.0e-7 /'//nl// &
      '&history every_time = 1.0e-5 /'//nl//'&output every_time = 1.0e-5 /'//nl, errors)
    call test%check('input is written', .not. errors%any())
  end subroutine make_input

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

  subroutine choose(name, material, triangle, code)
    character(len=*), intent(in) :: name, material, code
    integer(i8), intent(in) :: triangle(:)
    call ask%start(verb_select)
    call ask%put_text('set', name)
    call ask%put_text('role', 'surface')
    call ask%put_text('fields', '')
    call ask%put_text('material', material)
    call ask%put_int('id', [11_i8, 12_i8, 13_i8, 14_i8])
    call ask%put('x', corner)
    call ask%put_int('triangle', reshape(triangle, [3, size(triangle)/3]))
    call expect('SELECT '//name, code)
  end subroutine choose

  subroutine refuse()
    call choose('s', 'steel', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], 'P258')
    call choose('s', 'air', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], 'P258')
    call choose('s', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 5_i8], 'P258')
    call choose('s', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 4_i8, 3_i8], 'I224')
    call choose('s', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], '')
    call choose('s', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], '')
    call ask%start(verb_ready)
    call expect('READY', '')
    call reply%get('s.force', last, errors)
    call test%check('nothing touches yet', all(abs(last) <= 0.0_wp) .and. .not. errors%any())
  end subroutine refuse

  !> The surface at the end of interval k: it rises, slides, and is drawn out.
  pure function place(k) result(x)
    integer(i4), intent(in) :: k
    real(wp) :: x(3, 4)
    x = corner*(1.0_wp + 1.0e-4_wp*k)
    x(1, :) = x(1, :) + 2.0e-7_wp*k
    x(3, :) = 1.0e-7_wp*k + 1.0e-5_wp*k*corner(1, :)
  end function place

  subroutine advance(k)
    integer(i4), intent(in) :: k
    call ask%start(verb_advance, int(k, i8), (k - 1)*span, k*span)
    call ask%put('s.x', place(k))
    call expect('ADVANCE '//str(k), '')
  end subroutine advance

  !> Force, impulse, momentum and work fit together; REJECT restores bit for bit.
  subroutine push()
    real(wp) :: force(3, 4), again(3, 4), impulse(3, 4), scalars(scalar_count)
    real(wp) :: sum_of(3), work, all_work
    integer(i4) :: k

    sum_of = 0.0_wp
    all_work = 0.0_wp
    do k = 1, 3
      call advance(k)
      call reply%get('s.impulse', impulse, errors)
      call reply%get('s.force', force, errors)
      call reply%get('s.work', work, errors)
      call reply%get('scalars', scalars, errors)
      sum_of = sum_of + sum(impulse, 2)
      all_work = all_work + work
      if (k == 2) then
        call ask%start(verb_reject)
        call expect('REJECT', '')
        call advance(k)
        call reply%get('s.force', again, errors)
        call test%check('the same bits after REJECT', all(abs(again - force) <= 0.0_wp))
      end if
      call ask%start(verb_accept)
      call expect('ACCEPT', '')
    end do
    call test%check('it is pressed down', sum(force(3, :)) < 0.0_wp)
    associate (momentum => scalars(scalar_momentum:scalar_momentum + 2))
      call test%check_all_close('impulses are minus the momentum', sum_of + momentum, &
                            0.0_wp, 1.0e-12_wp*max_abs(momentum))
      call test%check('drawn along by friction', momentum(1) > 0.0_wp)
    end associate
    call test%check_close('work of the vertices is that of the boundary', all_work, &
                          scalars(scalar_boundary), 1.0e-12_wp*all_work)
    call test%check_close('and all energy', scalars(scalar_kinetic) + scalars(scalar_elastic) &
                          + scalars(scalar_friction) + scalars(scalar_contact_damping) &
                          + scalars(scalar_tangential_relaxation) - scalars(scalar_curvature), &
                          all_work, 1.0e-4_wp*all_work)
    call choose('t', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], 'P253')
    call ask%start(verb_advance, 4_i8, 3.0_wp*span, 4.0_wp*span)
    impulse = place(4)
    impulse(2, 3) = huge(1.0_wp)
    call ask%put('s.x', impulse)
    call expect('a vertex at infinity', 'P257')
    call ask%start(verb_checkpoint)
    call ask%put_text('tag', '000003')
    call expect('CHECKPOINT', '')
    call advance(4)
    call reply%get('s.force', last, errors)
    call ask%start(verb_accept)
    call expect('ACCEPT', '')
    call test%check('push without faults', .not. errors%any())
  end subroutine push

  !> FORCE places the vertices at once, KICK_DRIFT moves them with their velocity.
  subroutine split()
    real(wp) :: force(3, 4), v(3, 4), x(3, 4)
    x = place(4)
    x(3, :) = x(3, :) - 1.0e-4_wp
    v = 0.0_wp
    v(3, :) = 1.0e3_wp
    call ask%start(verb_force, 5_i8, 4.0_wp*span, 4.0_wp*span)
    call ask%put('s.x', x)
    call ask%put('s.v', v)
    call expect('FORCE', '')
    call reply%get('s.force', force, errors)
    call test%check('no force when the surface is away', all(abs(force) <= 0.0_wp))
    call ask%start(verb_kick_drift, 5_i8, 4.0_wp*span, 4.0_wp*span + 1.0e-7_wp)
    call ask%put('kick', 0.0_wp)
    call ask%put('drift', 1.0e-7_wp)
    call expect('KICK_DRIFT', '')
    call ask%start(verb_force, 5_i8, 4.0_wp*span, 4.0_wp*span)
    call expect('FORCE again', '')
    call reply%get('s.force', force, errors)
    call test%check('back with its velocity', sum(force(3, :)) < 0.0_wp .and. .not. errors%any())
    call ask%start(verb_stop)
    call expect('STOP', '')
    call test%ends_with(0)
  end subroutine split

  !> Another service restarts from the checkpoint: other triangles are refused, same bits.
  subroutine go_on()
    real(wp) :: force(3, 4)
    call start('second', '000003')
    call choose('s', 'rubber', [1_i8, 2_i8, 4_i8, 2_i8, 3_i8, 4_i8], 'P253')
    call choose('s', 'rubber', [1_i8, 2_i8, 3_i8, 1_i8, 3_i8, 4_i8], '')
    call ask%start(verb_ready)
    call expect('READY after a restart', '')
    call advance(4)
    call reply%get('s.force', force, errors)
    call test%check('the same bits after a restart', all(abs(force - last) <= 0.0_wp) .and. &
                    any(abs(last) > 0.0_wp))
    call ask%start(verb_stop)
    call expect('STOP', '')
    call test%ends_with(0)
    call test%check('going on without faults', .not. errors%any())
  end subroutine go_on
end program test_dem_port_surface
