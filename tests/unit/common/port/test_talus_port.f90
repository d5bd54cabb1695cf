!> The whole verb set through both transports against a dummy partner: the same bits arrive.
!!
!! The dummy is this program itself, started with `serve SPEC exchanges|echo`. Both sides know the
!! table of exchanges below; fields hold values that follow from their name, so that each side can
!! check every number of the other. The time of a round trip is printed and not judged.
program test_talus_port
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_hello, verb_describe, verb_select, verb_set, &
    verb_ready, verb_advance, verb_solve, verb_force, verb_kick_drift, verb_accept, verb_reject, &
    verb_checkpoint, verb_write, verb_stop, verb_abort, verb_name
  use talus_partner, only: now, own_pid
  use talus_port, only: port_type
  use talus_process, only: process_type
  use talus_test, only: larger, test_type
  implicit none

  !> One exchange: fields as 'name=text' or 'name:kind:components:count' (r real, i integer).
  type :: exchange_type
    integer(i4) :: verb
    character(len=320) :: request, reply
  end type exchange_type

  character(len=*), parameter :: state = &
    ' g.x:r:3:7 g.quat:r:4:7 g.v:r:3:7 g.omega:r:3:7 g.theta:r:3:7'
  character(len=*), parameter :: work = ' p.force:r:3:5 p.moment:r:3:5 p.impulse:r:3:5'// &
    ' p.moment_impulse:r:3:5 p.work:r:1:1'
  character(len=*), parameter :: scalars = ' scalars:r:1:19'
  character(len=*), parameter :: motion = ' p.x:r:3:5 p.quat:r:4:5'

  type(test_type) :: test
  type(exchange_type), allocatable :: table(:)
  character(len=512) :: argument(3)

  call get_command_argument(1, argument(1))
  call get_command_argument(2, argument(2))
  call get_command_argument(3, argument(3))
  allocate (table(0))
  call fill_table()
  if (argument(1) == 'serve') then
    if (argument(3) == 'echo') then
      call serve_echo(trim(argument(2)))
    else
      call serve_exchanges(trim(argument(2)))
    end if
  else
    call same_bits()
    call large_message()
    call two_at_once()
    call round_trips('shm:/talus-'//str(own_pid())//'-time', 10000)
    call round_trips('hdf5:talus-port-'//str(own_pid())//'/time', 200)
    call test%finish()
  end if
  deallocate (table)

contains

  subroutine add(verb, request, reply)
    integer(i4), intent(in) :: verb
    character(len=*), intent(in) :: request, reply
    type(exchange_type) :: one
    type(exchange_type), allocatable :: longer(:)
    one%verb = verb
    one%request = request
    one%reply = reply
    allocate (longer(size(table) + 1))
    longer(:size(table)) = table
    longer(size(longer)) = one
    call move_alloc(longer, table)
  end subroutine add

  subroutine fill_table()
    call add(verb_hello, 'run_id=r1 restart= protocol:i:1:1', &
             'program=talus-dem version=0.1 deck_hash=0123abcd capabilities=advance,force '// &
             'gravity:r:1:3 time:r:1:1 t_end:r:1:1 step_limit:r:1:1 ranks:i:1:1')
    call add(verb_describe, 'what=grains', 'id:i:1:7 x:r:3:7 quat:r:4:7 axes:r:3:7 '// &
             'radius:r:1:7 mass:r:1:7 inertia:r:3:7 kind:i:1:7')
    call add(verb_describe, 'what=contacts', 'ids:i:2:9 point:r:3:9 normal:r:3:9 '// &
             'branch:r:3:9 force:r:3:9 stiffness:r:2:9')
    call add(verb_describe, 'what=mesh', 'id:i:1:12 x:r:3:12 mass_u:r:1:12 connectivity:i:8:2')
    call add(verb_describe, 'what=facets group=hole', 'connectivity:i:4:6')
    call add(verb_describe, 'what=quadrature', &
             'x:r:3:16 weight:r:1:16 stress:r:6:16 element:i:1:16')
    call add(verb_describe, 'what=groups', 'names=hole,container')
    call add(verb_describe, 'what=group group=container', 'id:i:1:5')
    call add(verb_select, 'set=g role=report fields=x,quat,v,omega,theta id:i:1:7', &
             'mass:r:1:7 stiffness:r:1:7')
    call add(verb_select, 'set=p role=prescribe fields=force id:i:1:5', &
             'mass:r:1:5 stiffness:r:1:5')
    call add(verb_select, 'set=l role=load fields= id:i:1:0', 'mass:r:1:0 stiffness:r:1:0')
    call add(verb_select, 'set=s role=surface fields=force id:i:1:4', 'mass:r:1:4 stiffness:r:1:4')
    call add(verb_set, 'what=contact_weight ids:i:2:9 value:r:1:9', 'step_limit:r:1:1')
    call add(verb_set, 'what=quad_weight value:r:1:16', 'step_limit:r:1:1')
    call add(verb_set, 'what=mass_factor set=g value:r:1:7', 'step_limit:r:1:1')
    call add(verb_set, 'what=initial_stress value:r:6:16', 'step_limit:r:1:1')
    call add(verb_set, 'what=moduli element:i:1:2 young:r:1:2 poisson:r:1:2', 'step_limit:r:1:1')
    call add(verb_set, 'what=springs node:i:4:3 weight:r:4:3 stiffness:r:1:3', 'step_limit:r:1:1')
    call add(verb_set, 'what=dead_load set=l force:r:3:4', 'step_limit:r:1:1')
    call add(verb_ready, '', state//work//scalars)
    call add_steps()
    call add(verb_checkpoint, 'tag=000001', 'path=grains.chk.h5 hash=fedcba98')
    call add(verb_write, 'tag=000001', 'path=grains.h5')
    call add(verb_stop, 'early:i:1:1', '')
    call add(verb_abort, '', '')
  end subroutine fill_table

  subroutine add_steps()
    call add(verb_advance, motion//' l.force:r:3:4 l.moment:r:3:4', &
             state//work//' substeps:i:1:1'//scalars)
    call add(verb_advance, 'p.x:r:3:5 p.v:r:3:5 s.x:r:3:4 s.v:r:3:4', &
             's.force:r:3:4 b.u:r:3:8 b.v:r:3:8 p.reaction:r:3:5 p.impulse:r:3:5 substeps:i:1:1'// &
             scalars)
    call add(verb_advance, 'p.x:r:3:5 p.chi:r:9:5', 'b.u:r:3:8 b.phi:r:3:8 b.chi:r:9:8 '// &
             'p.couple:r:9:5 substeps:i:1:1'//scalars)
    call add(verb_solve, 'l.force:r:3:8 p.u:r:3:5 trial:i:1:1', &
             'b.u:r:3:8 b.v:r:3:8 b.a:r:3:8 p.reaction:r:3:5 iterations:i:1:1'//scalars)
    call add(verb_force, 'scope=all'//motion, 'p.force:r:3:5 p.moment:r:3:5 g.force:r:3:7')
    call add(verb_force, 'scope=interface p.u:r:3:5', 'p.force:r:3:5')
    call add(verb_kick_drift, 'kick:r:1:1 drift:r:1:1 l.force:r:3:4', state//scalars)
    call add(verb_accept, '', '')
    call add(verb_reject, '', '')
  end subroutine add_steps

  !> The k-th value of a field: reproducible, of any sign and size, no round numbers.
  pure real(wp) function value_of(name, k)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: k
    integer(i4) :: j, h
    h = 17
    do j = 1, len(name)
      h = mod(31*h + iachar(name(j:j)), 100003)
    end do
    value_of = sin(real(h, wp) + 0.37_wp*k)*10.0_wp**(mod(h + k, 41) - 20)
  end function value_of

  !> Next blank-separated token; '' at the end.
  subroutine next_token(text, from, token)
    character(len=*), intent(in) :: text
    integer(i4), intent(inout) :: from
    character(len=:), allocatable, intent(out) :: token
    integer :: length
    do while (from <= len(text))
      if (text(from:from) /= ' ') exit
      from = from + 1
    end do
    token = ''
    if (from > len(text)) return
    length = scan(text(from:), ' ') - 1
    if (length < 0) length = len(text) - from + 1
    token = text(from:from + length - 1)
    from = from + length
  end subroutine next_token

  !> 'name:kind:components:count' in parts.
  subroutine parts_of(token, name, kind, components, count)
    character(len=*), intent(in) :: token
    character(len=:), allocatable, intent(out) :: name
    character(len=1), intent(out) :: kind
    integer(i4), intent(out) :: components, count
    integer :: colon
    colon = index(token, ':')
    name = token(:colon - 1)
    kind = token(colon + 1:colon + 1)
    read (token(colon + 3:colon + 3), *) components
    read (token(colon + 5:), *) count
  end subroutine parts_of

  subroutine values(name, components, count, x)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: components, count
    real(wp), allocatable, intent(out) :: x(:, :)
    integer(i4) :: i, j
    allocate (x(components, count))
    do j = 1, count
      do i = 1, components
        x(i, j) = value_of(name, i + components*(j - 1))
      end do
    end do
  end subroutine values

  subroutine put_fields(m, fields)
    type(message_type), intent(inout) :: m
    character(len=*), intent(in) :: fields
    character(len=:), allocatable :: token, name
    character(len=1) :: kind
    real(wp), allocatable :: x(:, :)
    integer(i4) :: from, components, count
    from = 1
    do
      call next_token(fields, from, token)
      if (token == '') exit
      if (index(token, '=') > 0) then
        call m%put_text(token(:index(token, '=') - 1), token(index(token, '=') + 1:))
      else
        call parts_of(token, name, kind, components, count)
        call values(name, components, count, x)
        if (kind == 'r') call m%put(name, x)
        if (kind == 'i') call m%put_int(name, transfer(x, [0_i8]))
      end if
    end do
  end subroutine put_fields

  !> All fields are there with the right values, and no other.
  subroutine check_fields(m, fields, errors)
    type(message_type), intent(inout) :: m
    character(len=*), intent(in) :: fields
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: token, name, text
    character(len=1) :: kind
    real(wp), allocatable :: x(:, :), y(:, :)
    integer(i8), allocatable :: l(:)
    integer(i4) :: from, components, count
    logical :: same
    from = 1
    do
      call next_token(fields, from, token)
      if (token == '') exit
      if (index(token, '=') > 0) then
        name = token(:index(token, '=') - 1)
        call m%get_text(name, text, errors)
        same = text == token(len(name) + 2:)
      else
        call parts_of(token, name, kind, components, count)
        call values(name, components, count, x)
        allocate (y(components, count), l(components*count))
        if (kind == 'r') call m%get(name, y, errors)
        if (kind == 'r') l = transfer(y, l)
        if (kind == 'i') call m%get_int(name, l, errors)
        same = all(l == transfer(x, l))
        deallocate (y, l)
      end if
      if (.not. same) call errors%add('B001', 'field '//name//' has other values', m%place())
    end do
    call m%all_read(errors)
  end subroutine check_fields

  !> The dummy solver: check each request, answer it, leave after the last.
  subroutine serve_exchanges(spec)
    character(len=*), intent(in) :: spec
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors, faults
    integer(i4) :: k

    call port%connect(spec, errors)
    do k = 1, size(table)
      if (.not. errors%any()) call port%receive(request, errors)
      if (errors%any()) exit
      call port%beat()
      call faults%clear()
      if (request%verb /= table(k)%verb) &
        call faults%add('B002', 'verb '//verb_name(request%verb)//' came out of turn')
      call check_fields(request, table(k)%request, faults)
      call reply%answer(request)
      call put_fields(reply, table(k)%reply)
      if (faults%any()) call reply%fail_with(faults)
      call port%send(reply, errors)
    end do
    call port%close()
    if (errors%any()) call errors%print(output_unit)
    if (errors%any()) stop 4, quiet=.true.
  end subroutine serve_exchanges

  !> Answer every request with its own fields; real fields are multiplied by two.
  subroutine serve_echo(spec)
    character(len=*), intent(in) :: spec
    type(port_type) :: port
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp), allocatable :: x(:, :), a(:, :), b(:, :)

    call port%connect(spec, errors)
    allocate (a(3, 1000), b(10, 1000))
    a = 1.5_wp
    b = 2.5_wp
    do while (.not. errors%any())
      call port%receive(request, errors)
      if (errors%any()) exit
      call reply%answer(request)
      if (request%has('motion')) then
        call request%take('motion', x, errors)
        a(1, 1) = x(1, 1)
        call reply%put('x', a)
        call reply%put('rest', b)
      else if (request%has('x')) then
        call request%take('x', x, errors)
        x = 2.0_wp*x
        call reply%put('x', x)
      end if
      call port%send(reply, errors)
      if (request%verb == verb_stop) exit
    end do
    call port%close()
  end subroutine serve_echo

  subroutine launch(spec, mode, process, port, errors)
    character(len=*), intent(in) :: spec, mode
    type(process_type), intent(inout) :: process
    type(port_type), intent(inout) :: port
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: argv(:)

    call append_string(argv, '/proc/self/exe')
    call append_string(argv, 'serve')
    call append_string(argv, spec)
    call append_string(argv, mode)
    port%partner%name = 'the dummy'
    call port%create(spec, 'r1', 60.0_wp, errors)
    if (.not. errors%any()) call process%spawn(argv, '', '', 1, errors)
    if (.not. errors%any()) call port%watch(process%pid)
  end subroutine launch

  !> Run all exchanges through one transport and keep every word of the replies.
  subroutine run_exchanges(spec, words)
    character(len=*), intent(in) :: spec
    integer(i8), allocatable, intent(out) :: words(:)
    type(port_type) :: port
    type(process_type) :: process
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    integer(i4) :: k, faults
    logical :: ended, left

    allocate (words(0))
    call launch(spec, 'exchanges', process, port, errors)
    do k = 1, size(table)
      faults = errors%count
      call request%start(table(k)%verb, int(k, i8), 0.1_wp*k, 0.1_wp*k + 0.05_wp)
      call put_fields(request, table(k)%request)
      call port%ask(request, reply, errors)
      if (errors%count > faults) exit
      call check_fields(reply, table(k)%reply, errors)
      call test%check(verb_name(table(k)%verb)//' through '//spec(:4), errors%count == faults &
                      .and. reply%step == k .and. reply%t1 >= request%t1)
      words = [words, reply%word(:reply%used)]
    end do
    call errors%print(output_unit)
    inquire (file='/dev/shm'//spec(5:), exist=left)
    if (spec(:4) == 'shm:') call test%check('the name is gone while both are in', .not. left)
    call test%check('all exchanges done through '//spec(:4), k > size(table))
    ended = process%wait(10.0_wp)
    call test%check('the dummy left with 0', ended .and. process%exit_code == 0)
    call port%close()
  end subroutine run_exchanges

  subroutine same_bits()
    integer(i8), allocatable :: shm(:), file(:)
    logical :: left
    call run_exchanges('shm:/talus-'//str(own_pid())//'-a', shm)
    call run_exchanges('hdf5:talus-port-'//str(own_pid())//'/a', file)
    call test%check('sizes through both transports', size(shm) == size(file) .and. size(shm) > 0)
    if (size(shm) == size(file)) call test%check('same bits through both', all(shm == file))
    inquire (file='talus-port-'//str(own_pid())//'/.', exist=left)
    call test%check('the folder is gone', .not. left)
  end subroutine same_bits

  !> 100 MB each way: in chunks through shared memory, in one file otherwise.
  subroutine large_message()
    type(port_type) :: port
    type(process_type) :: process
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp), allocatable :: x(:, :), y(:, :)
    character(len=:), allocatable :: spec
    integer(i4) :: k, j

    allocate (x(3, 4166667))
    do j = 1, size(x, 2)
      x(:, j) = [1.0_wp*j, 0.5_wp*j, -1.0_wp/j]
    end do
    do k = 1, 2
      spec = 'shm:/talus-'//str(own_pid())//'-large'
      if (k == 2) spec = 'hdf5:talus-port-'//str(own_pid())//'/large'
      call launch(spec, 'echo', process, port, errors)
      call request%start(verb_force)
      call request%put('x', x)
      call port%ask(request, reply, errors)
      if (.not. errors%any()) call reply%take('x', y, errors)
      call test%check('100 MB there and back: '//spec(:4), .not. errors%any())
      if (allocated(y)) call test%check('100 MB unchanged', all(y >= 2.0_wp*x .and. y <= 2.0_wp*x))
      call end_echo(port, process, errors)
    end do
    call errors%print(output_unit)
  end subroutine large_message

  subroutine end_echo(port, process, errors)
    type(port_type), intent(inout) :: port
    type(process_type), intent(inout) :: process
    type(error_list_type), intent(inout) :: errors
    type(message_type) :: request, reply
    call request%start(verb_stop)
    call port%ask(request, reply, errors)
    call process%stop(5.0_wp)
    call test%check('the echo left with 0', process%exit_code == 0)
    call port%close()
  end subroutine end_echo

  !> Both partners are sent to before either is read.
  subroutine two_at_once()
    type(port_type) :: port(2)
    type(process_type) :: process(2)
    type(message_type) :: request, reply(2)
    type(error_list_type) :: errors
    real(wp) :: s(1, 1), back
    integer(i4) :: k, n

    do k = 1, 2
      call launch('shm:/talus-'//str(own_pid())//'-both'//str(k), 'echo', process(k), port(k), &
        errors)
    end do
    back = 0.0_wp
    do n = 1, 200
      do k = 1, 2
        s = real(n*k, wp)
        call request%start(verb_force)
        call request%put('x', s)
        call port(k)%send(request, errors)
      end do
      do k = 2, 1, -1
        call port(k)%receive(reply(k), errors)
        if (errors%any()) exit
        call reply(k)%get('x', s, errors)
        back = larger(back, abs(s(1, 1) - 2.0_wp*n*k))
      end do
      if (errors%any()) exit
    end do
    call errors%print(output_unit)
    call test%check('two at once', .not. errors%any() .and. back < 1.0e-12_wp)
    do k = 1, 2
      call end_echo(port(k), process(k), errors)
    end do
  end subroutine two_at_once

  !> Time of an empty exchange and of one of 1000 ghosts (7 reals there, 13 back): printed.
  subroutine round_trips(spec, count)
    character(len=*), intent(in) :: spec
    integer(i4), intent(in) :: count
    type(port_type) :: port
    type(process_type) :: process
    type(message_type) :: request, reply
    type(error_list_type) :: errors
    real(wp) :: x(7, 1000), a(3, 1000), b(10, 1000), taken(count), started
    integer(i8) :: room
    integer(i4) :: k, ghosts

    x = 1.25_wp
    call launch(spec, 'echo', process, port, errors)
    do ghosts = 0, 1
      do k = 1, count
        started = now()
        call request%start(verb_advance, int(k, i8))
        if (ghosts == 1) call request%put('motion', x)
        call port%ask(request, reply, errors)
        if (errors%any()) exit
        if (ghosts == 1) call reply%get('x', a, errors)
        if (ghosts == 1) call reply%get('rest', b, errors)
        taken(k) = now() - started
        if (k == 1) room = size(reply%word, kind=i8)
      end do
      if (errors%any()) exit
      call test%check('no allocation in steady state', room == size(reply%word, kind=i8))
      call sort(taken)
      write (output_unit, '(a,i0,a,f0.1,a,f0.1,a)') spec(:4)//' exchange of ', 1000*ghosts, &
        ' ghosts: median ', 1.0e6_wp*taken((count + 1)/2), ' us, 90 % below ', &
        1.0e6_wp*taken((9*count)/10), ' us'
    end do
    call errors%print(output_unit)
    call test%check('round trips', .not. errors%any())
    call end_echo(port, process, errors)
  end subroutine round_trips

  !> Shell sort, ascending.
  pure subroutine sort(x)
    real(wp), intent(inout) :: x(:)
    real(wp) :: one
    integer(i4) :: gap, i, j
    gap = size(x)/2
    do while (gap > 0)
      do i = gap + 1, size(x)
        one = x(i)
        j = i
        do while (j > gap)
          if (x(j - gap) <= one) exit
          x(j) = x(j - gap)
          j = j - gap
        end do
        x(j) = one
      end do
      gap = gap/2
    end do
  end subroutine sort
end program test_talus_port
