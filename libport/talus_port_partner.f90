!> The exchange port for solvers of another make in Fortran: libtalus_port (talus_port.h) with
!! Fortran's arrays and texts. Names and numbers are those of talus_verbs, talus_port_names and
!! talus_scalars.
!!
!! A partner opens the port, then answers requests until STOP or ABORT:
!!
!!     call port%open()
!!     do while (port%next('report,load,solve,reject,rehearsal'))
!!       select case (port%verb) ... end select
!!       call port%reply()
!!     end do
!!     call port%leave(code)
!!
!! Arrays of a request are views of its message: they hold until the reply. What is missing, of
!! another kind or of another shape makes the reply a fault by itself; the view is then null.
module talus_port_partner
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t, c_ptr, c_null_char, &
    c_null_ptr, c_associated, c_f_pointer
  use, intrinsic :: iso_fortran_env, only: error_unit
  use talus_kinds, only: wp, i4, i8
  use talus_port_names, only: name_length, dot_a, dot_force, dot_u, dot_v, &
    field_connectivity, field_held, field_iterations, field_kind, field_mass, field_rehearsal, &
    field_scalars, field_speed, field_stiffness
  use talus_verbs, only: verb_stop, verb_abort
  implicit none
  private
  public :: port_type, set_type, status_system, status_numerical, cell_hex8, cell_hex20, &
    cell_hex27, cell_tet4, cell_tet10, cell_wedge6, cell_quad4, cell_quad8, cell_quad9, cell_tri3, &
    cell_tri6

  integer(i4), parameter :: status_numerical = 2, status_system = 4
  integer(i4), parameter :: cell_hex8 = 1, cell_hex20 = 2, cell_hex27 = 3, cell_tet4 = 4, &
    cell_tet10 = 5, cell_wedge6 = 6, cell_quad4 = 7, cell_quad8 = 8, cell_quad9 = 9, &
    cell_tri3 = 10, cell_tri6 = 11

  !> A set that SELECT named.
  type :: set_type
    character(len=:), allocatable :: name, role
    integer(i8), pointer :: id(:) => null()
  end type set_type

  !> struct talus_port_set of talus_port.h.
  type, bind(c) :: c_set_type
    character(kind=c_char) :: name(name_length + 1), role(16), fields(128)
    integer(c_int64_t) :: count
    type(c_ptr) :: id, own
  end type c_set_type

  !> One end of a port.
  type :: port_type
    integer(i4) :: verb = 0                     !! of the request
    type(c_ptr), private :: handle = c_null_ptr
    integer(i4), private :: left = -1           !! exit code after STOP
  contains
    procedure :: open => open_port    !! (): join the port of --port=SPEC
    procedure :: next                 !! (capabilities): is there another request?
    procedure :: reply                !! (): send what was put, or the fault
    procedure :: leave                !! (code): exit code of the program
    procedure :: beat                 !! (): sign of life in long work
    procedure :: t0, t1               !! (): interval of the request [s]
    procedure :: has, flag            !! (name): is a field there; is it there and 1?
    procedure :: reals, integers      !! (name, components, count, view): fields of the request
    procedure :: text                 !! (name): a text
    procedure :: select_set           !! (entities): keep the set of SELECT
    procedure :: list_sets            !! (sets): all sets
    procedure :: put_reals, put_integers, put_text, put_real, put_integer  !! (name, value)
    procedure :: load_on              !! (set): forces on its nodes
    procedure :: put_nodes            !! (set, mass, stiffness, held): reply of SELECT of nodes
    procedure :: put_motion           !! (set, u, v, a): how its nodes move
    procedure :: put_step             !! (iterations, scalars): of READY and steps
    procedure :: put_facets           !! (cell, node): reply of DESCRIBE facets
    procedure :: put_hello            !! (program, version, deck_hash)
    procedure :: put_mesh             !! (cell, x, node)
    procedure :: fail, failed         !! (status, code, message, hint): make the reply a fault
  end type port_type

  interface
    function c_open(spec) result(port) bind(c, name='talus_port_open')
      import :: c_char, c_ptr
      character(kind=c_char), intent(in) :: spec(*)
      type(c_ptr) :: port
    end function c_open
    function c_why(port) result(text) bind(c, name='talus_port_why')
      import :: c_ptr
      type(c_ptr), value :: port
      type(c_ptr) :: text
    end function c_why
    subroutine c_beat(port) bind(c, name='talus_port_beat')
      import :: c_ptr
      type(c_ptr), value :: port
    end subroutine c_beat
    subroutine c_close(port) bind(c, name='talus_port_close')
      import :: c_ptr
      type(c_ptr), value :: port
    end subroutine c_close
    function c_next(port, capabilities) result(verb) bind(c, name='talus_port_next')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: capabilities(*)
      integer(c_int) :: verb
    end function c_next
    function c_reply(port) result(state) bind(c, name='talus_port_reply')
      import :: c_int, c_ptr
      type(c_ptr), value :: port
      integer(c_int) :: state
    end function c_reply
    function c_t0(port) result(t) bind(c, name='talus_port_t0')
      import :: c_double, c_ptr
      type(c_ptr), value :: port
      real(c_double) :: t
    end function c_t0
    function c_t1(port) result(t) bind(c, name='talus_port_t1')
      import :: c_double, c_ptr
      type(c_ptr), value :: port
      real(c_double) :: t
    end function c_t1
    function c_has(port, name) result(yes) bind(c, name='talus_port_has')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int) :: yes
    end function c_has
    function c_flag(port, name) result(yes) bind(c, name='talus_port_flag')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int) :: yes
    end function c_flag
    function c_reals(port, name, components, count) result(view) bind(c, name='talus_port_reals')
      import :: c_char, c_int64_t, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int64_t), value :: components, count
      type(c_ptr) :: view
    end function c_reals
    function c_integers(port, name, components, count) result(view) &
      bind(c, name='talus_port_integers')
      import :: c_char, c_int64_t, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int64_t), value :: components, count
      type(c_ptr) :: view
    end function c_integers
    function c_text(port, name) result(view) bind(c, name='talus_port_text')
      import :: c_char, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      type(c_ptr) :: view
    end function c_text
    function c_select(port, entities) result(set) bind(c, name='talus_port_select')
      import :: c_int64_t, c_ptr
      type(c_ptr), value :: port
      integer(c_int64_t), value :: entities
      type(c_ptr) :: set
    end function c_select
    function c_sets(port, count) result(set) bind(c, name='talus_port_sets')
      import :: c_int, c_ptr
      type(c_ptr), value :: port
      integer(c_int), intent(out) :: count
      type(c_ptr) :: set
    end function c_sets
    function c_put_reals(port, name, components, count, data) result(room) &
      bind(c, name='talus_port_put_reals')
      import :: c_char, c_double, c_int64_t, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int64_t), value :: components, count
      real(c_double), intent(in) :: data(*)
      type(c_ptr) :: room
    end function c_put_reals
    function c_put_integers(port, name, components, count, data) result(room) &
      bind(c, name='talus_port_put_integers')
      import :: c_char, c_int64_t, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int64_t), value :: components, count
      integer(c_int64_t), intent(in) :: data(*)
      type(c_ptr) :: room
    end function c_put_integers
    subroutine c_put_text(port, name, text) bind(c, name='talus_port_put_text')
      import :: c_char, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: name(*), text(*)
    end subroutine c_put_text
    subroutine c_put_hello(port, program, version, deck_hash) bind(c, name='talus_port_put_hello')
      import :: c_char, c_ptr
      type(c_ptr), value :: port
      character(kind=c_char), intent(in) :: program(*), version(*), deck_hash(*)
    end subroutine c_put_hello
    subroutine c_put_mesh(port, cell, nodes, x, elements, corners, node) &
      bind(c, name='talus_port_put_mesh')
      import :: c_double, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: port
      integer(c_int), value :: cell
      integer(c_int64_t), value :: nodes, elements, corners
      real(c_double), intent(in) :: x(*)
      integer(c_int64_t), intent(in) :: node(*)
    end subroutine c_put_mesh
    subroutine c_fail(port, status, code, message, place, hint) bind(c, name='talus_port_fail')
      import :: c_char, c_int, c_ptr
      type(c_ptr), value :: port
      integer(c_int), value :: status
      character(kind=c_char), intent(in) :: code(*), message(*), place(*), hint(*)
    end subroutine c_fail
    function c_failed(port) result(yes) bind(c, name='talus_port_failed')
      import :: c_int, c_ptr
      type(c_ptr), value :: port
      integer(c_int) :: yes
    end function c_failed
    function c_length(text) result(length) bind(c, name='strlen')
      import :: c_int64_t, c_ptr
      type(c_ptr), value :: text
      integer(c_int64_t) :: length
    end function c_length
  end interface

contains

  !> Join the port that --port=SPEC names among the arguments of the program. Where it cannot be
  !! joined, next() is false and leave() gives 4.
  subroutine open_port(self)
    class(port_type), intent(inout) :: self
    character(len=4096) :: argument
    character(len=:), allocatable :: spec
    integer :: k
    spec = ''
    do k = command_argument_count(), 1, -1
      call get_command_argument(k, argument)
      if (index(argument, '--port=') == 1) spec = trim(argument(8:))
    end do
    self%handle = c_open(spec//c_null_char)
  end subroutine open_port

  !> Wait for the next request; false after the last one. Capabilities: words of the page, comma
  !! between; what lacks its word is refused.
  logical function next(self, capabilities)
    class(port_type), intent(inout) :: self
    character(len=*), intent(in) :: capabilities
    next = .false.
    if (self%left >= 0) return
    self%verb = c_next(self%handle, capabilities//c_null_char)
    next = self%verb > 0
    if (self%verb == verb_stop) self%left = merge(3_i4, 0_i4, self%flag('early'))
    if (self%verb == verb_abort) self%left = status_system
  end function next

  subroutine reply(self)
    class(port_type), intent(inout) :: self
    if (c_reply(self%handle) < 0 .and. self%left < 0) self%left = status_system
  end subroutine reply

  !> Close the port. Exit code of the program: 0, 3 after an early STOP, 4; of a port that was lost
  !! the reason goes to standard error.
  subroutine leave(self, code)
    class(port_type), intent(inout) :: self
    integer(i4), intent(out) :: code
    character(len=:), allocatable :: why
    why = text_at(c_why(self%handle))
    if (len(why) > 0) write (error_unit, '(2a)') 'error ', why
    code = merge(self%left, status_system, self%left >= 0)
    call c_close(self%handle)
    self%handle = c_null_ptr
  end subroutine leave

  subroutine beat(self)
    class(port_type), intent(in) :: self
    call c_beat(self%handle)
  end subroutine beat

  real(wp) function t0(self)
    class(port_type), intent(in) :: self
    t0 = c_t0(self%handle)
  end function t0

  real(wp) function t1(self)
    class(port_type), intent(in) :: self
    t1 = c_t1(self%handle)
  end function t1

  !> Is a field of the request there? It then counts as read.
  logical function has(self, name)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    has = c_has(self%handle, name//c_null_char) /= 0
  end function has

  !> Is an optional field there, and 1?
  logical function flag(self, name)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    flag = c_flag(self%handle, name//c_null_char) /= 0
  end function flag

  !> A view (components, count) of a required field, null with a fault (P009 to P011).
  subroutine reals(self, name, components, count, view)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: components, count
    real(wp), pointer, intent(out) :: view(:, :)
    type(c_ptr) :: place
    view => null()
    place = c_reals(self%handle, name//c_null_char, components, count)
    if (c_associated(place)) call c_f_pointer(place, view, [components, count])
  end subroutine reals

  !> The same of whole numbers.
  subroutine integers(self, name, components, count, view)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: components, count
    integer(i8), pointer, intent(out) :: view(:, :)
    type(c_ptr) :: place
    view => null()
    place = c_integers(self%handle, name//c_null_char, components, count)
    if (c_associated(place)) call c_f_pointer(place, view, [components, count])
  end subroutine integers

  !> A text of the request; empty with a fault.
  function text(self, name)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    text = text_at(c_text(self%handle, name//c_null_char))
  end function text

  !> A text of C.
  function text_at(place) result(text)
    type(c_ptr), intent(in) :: place
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letter(:)
    integer(i8) :: k
    text = ''
    if (.not. c_associated(place)) return
    call c_f_pointer(place, letter, [c_length(place)])
    text = repeat(' ', size(letter))
    do k = 1, size(letter, kind=i8)
      text(k:k) = letter(k)
    end do
  end function text_at

  !> Keep the set of SELECT, in place of one of its name; ids go from 1 to `entities` (P425). Empty
  !! with a fault.
  function select_set(self, entities) result(set)
    class(port_type), intent(in) :: self
    integer(i8), intent(in) :: entities
    type(set_type) :: set
    type(c_ptr) :: place
    type(c_set_type), pointer :: c_set
    set%name = ''
    set%role = ''
    allocate (set%id(0))
    place = c_select(self%handle, entities)
    if (.not. c_associated(place)) return
    deallocate (set%id)
    call c_f_pointer(place, c_set)
    set = set_of(c_set)
  end function select_set

  !> All sets that were selected; they hold until another is.
  subroutine list_sets(self, sets)
    class(port_type), intent(in) :: self
    type(set_type), allocatable, intent(out) :: sets(:)
    type(c_set_type), pointer :: c_set(:)
    type(c_ptr) :: place
    integer(c_int) :: count
    integer :: k
    place = c_sets(self%handle, count)
    allocate (sets(count))
    if (count == 0) return
    call c_f_pointer(place, c_set, [count])
    do k = 1, count
      sets(k) = set_of(c_set(k))
    end do
  end subroutine list_sets

  function set_of(c_set) result(set)
    type(c_set_type), intent(in) :: c_set
    type(set_type) :: set
    set%name = text_until_zero(c_set%name)
    set%role = text_until_zero(c_set%role)
    call c_f_pointer(c_set%id, set%id, [c_set%count])
  end function set_of

  pure function text_until_zero(letter) result(text)
    character(kind=c_char), intent(in) :: letter(:)
    character(len=:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, size(letter)
      if (letter(k) == c_null_char) return
      text = text//letter(k)
    end do
  end function text_until_zero

  !> A field (components, count) of the reply.
  subroutine put_reals(self, name, value)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value(:, :)
    type(c_ptr) :: room
    room = c_put_reals(self%handle, name//c_null_char, size(value, 1, i8), size(value, 2, i8), value)
  end subroutine put_reals

  subroutine put_integers(self, name, value)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value(:, :)
    type(c_ptr) :: room
    room = c_put_integers(self%handle, name//c_null_char, size(value, 1, i8), size(value, 2, i8), &
                          value)
  end subroutine put_integers

  subroutine put_text(self, name, text)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name, text
    call c_put_text(self%handle, name//c_null_char, text//c_null_char)
  end subroutine put_text

  subroutine put_real(self, name, value)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value
    call self%put_reals(name, reshape([value], [1, 1]))
  end subroutine put_real

  subroutine put_integer(self, name, value)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: value
    call self%put_integers(name, reshape([value], [1, 1]))
  end subroutine put_integer

  !> Forces (3, nodes) on the nodes of a set in a step [N], zero where the request has none.
  function load_on(self, set) result(load)
    class(port_type), intent(in) :: self
    type(set_type), intent(in) :: set
    real(wp) :: load(3, size(set%id))
    real(wp), pointer :: view(:, :)
    load = 0.0_wp
    if (.not. self%has(set%name//dot_force)) return
    call self%reals(set%name//dot_force, 3_i8, size(set%id, kind=i8), view)
    if (associated(view)) load = view
  end function load_on

  !> The reply of SELECT of nodes of a solid without waves (speed 0).
  subroutine put_nodes(self, set, mass, stiffness, held)
    class(port_type), intent(in) :: self
    type(set_type), intent(in) :: set
    real(wp), intent(in) :: mass(:)       !! (nodes) lumped [kg]
    real(wp), intent(in) :: stiffness(:)  !! (nodes) diagonal of the stiffness [N/m]
    logical, intent(in) :: held(:, :)     !! (3, nodes) by supports
    call self%put_reals(field_mass, reshape(mass, [1, size(mass)]))
    call self%put_reals(field_speed, reshape([real(wp) ::], [3, size(set%id)], pad=[0.0_wp]))
    call self%put_reals(field_stiffness, reshape(stiffness, [1, size(stiffness)]))
    call self%put_integers(field_held, merge(1_i8, 0_i8, held))
  end subroutine put_nodes

  !> Displacement [m], velocity and acceleration (3, nodes) of the nodes of a set after a step.
  subroutine put_motion(self, set, u, v, a)
    class(port_type), intent(in) :: self
    type(set_type), intent(in) :: set
    real(wp), intent(in) :: u(:, :), v(:, :), a(:, :)
    call self%put_reals(set%name//dot_u, u)
    call self%put_reals(set%name//dot_v, v)
    call self%put_reals(set%name//dot_a, a)
  end subroutine put_motion

  !> What a step took and the scalars (1, scalar_count) after it. `rehearsal` of READY counts as read.
  subroutine put_step(self, iterations, scalars)
    class(port_type), intent(in) :: self
    integer(i8), intent(in) :: iterations
    real(wp), intent(in) :: scalars(:, :)
    logical :: rehearsal
    rehearsal = self%flag(field_rehearsal)
    call self%put_integer(field_iterations, iterations)
    call self%put_reals(field_scalars, scalars)
  end subroutine put_step

  !> The reply of DESCRIBE facets of one kind, nodes (corners, facets) in VTK's order.
  subroutine put_facets(self, cell, node)
    class(port_type), intent(in) :: self
    integer(i4), intent(in) :: cell  !! cell_...
    integer(i8), intent(in) :: node(:, :)
    call self%put_integer(field_kind, int(cell, i8))
    call self%put_integers(field_connectivity, node)
  end subroutine put_facets

  !> The reply of HELLO: no gravity, time 0, one rank; fields put after it take their place.
  subroutine put_hello(self, program, version, deck_hash)
    class(port_type), intent(in) :: self
    character(len=*), intent(in) :: program, version, deck_hash
    call c_put_hello(self%handle, program//c_null_char, version//c_null_char, &
                     deck_hash//c_null_char)
  end subroutine put_hello

  !> The reply of DESCRIBE mesh for elements of one kind, nodes in VTK's order.
  subroutine put_mesh(self, cell, x, node)
    class(port_type), intent(in) :: self
    integer(i4), intent(in) :: cell                     !! cell_...
    real(wp), intent(in) :: x(:, :)         !! (3, nodes) [m]
    integer(i8), intent(in) :: node(:, :)   !! (corners, elements) from 1
    call c_put_mesh(self%handle, cell, size(x, 2, i8), x, size(node, 2, i8), size(node, 1, i8), node)
  end subroutine put_mesh

  !> Make the reply a fault; the first one counts.
  subroutine fail(self, status, code, message, hint)
    class(port_type), intent(in) :: self
    integer(i4), intent(in) :: status  !! status_...
    character(len=*), intent(in) :: code, message, hint
    call c_fail(self%handle, status, code//c_null_char, message//c_null_char, c_null_char, &
                hint//c_null_char)
  end subroutine fail

  logical function failed(self)
    class(port_type), intent(in) :: self
    failed = c_failed(self%handle) /= 0
  end function failed
end module talus_port_partner
