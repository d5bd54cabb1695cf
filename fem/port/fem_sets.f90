!> Sets of nodes that a partner has selected, and their fields in requests and replies.
module fem_sets
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_a, dot_force, dot_impulse, dot_moment, dot_phi, &
    dot_phi_acceleration, dot_phi_rate, dot_reaction, dot_reaction_moment, dot_u, dot_v, &
    field_phi, field_u, role_name, role_number, role_pore
  use fem_types, only: fem_set_type, role_report, role_prescribe, role_load, name_length
  use fem_body, only: fem_body_type
  use fem_edge, only: fem_edge_type
  use fem_halo, only: fem_halo_type
  use fem_port_pore, only: check_wet, put_wet, take_wet
  implicit none
  private
  public :: fem_sets_type

  type :: fem_sets_type
    integer(i4) :: n = 0
    logical :: begun = .false.     !! the run has, at READY
    type(fem_set_type) :: set(32)
    type(fem_edge_type) :: edge    !! the elements of a set that is requested often
    integer(i4) :: edge_of = 0     !! that set
    real(wp), allocatable :: known_u(:, :), known_force(:, :)  !! whole_force found last
  contains
    procedure :: select => select_set
    procedure :: find
    procedure :: elements_of
    procedure :: forget_elements
    procedure :: put_force_of_elements
    procedure :: put_forces
    procedure :: put_parts
    procedure :: whole_force
    procedure :: take_loads
    procedure :: take_impulses
    procedure :: take_motion
    procedure :: take_speeds
    procedure :: put_states
  end type fem_sets_type

contains

  !> Name a set of nodes; `changed` when the free degrees of freedom are others now. With `phi`
  !! among the fields the set acts on micro-rotations too; with phi alone only on them. In a
  !! micromorphic body phi is the micro-deformation, whose three columns at each node follow one
  !! another.
  subroutine select_set(self, name, role, fields, ids, body, changed, errors)
    class(fem_sets_type), intent(inout) :: self
    character(len=*), intent(in) :: name, role
    character(len=*), intent(in) :: fields  !! 'u', 'u,v,a', 'u,phi', 'phi'; '' means u
    integer(i8), intent(in) :: ids(:)
    type(fem_body_type), intent(inout) :: body
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    logical :: turns
    integer(i4) :: k, r, c

    changed = .false.
    self%edge%ready = .false.
    turns = index(','//fields//',', ','//field_phi//',') > 0
    call check_set(name, role, ids, turns, body, errors)
    if (errors%any()) return
    call self%find(name, k)
    if (k == 0) then
      if (self%n == size(self%set)) then
        call errors%add('P302', 'more than '//str(int(size(self%set), i4))//' sets were selected')
        return
      end if
      self%n = self%n + 1
      k = self%n
    end if
    self%set(k)%name = name
    self%set(k)%role = role_number(role)
    self%set(k)%node = int(ids, i4)
    self%set(k)%moves = .not. turns .or. index(','//fields//',', ','//field_u//',') > 0
    if (allocated(self%set(k)%phi)) deallocate (self%set(k)%phi)
    if (allocated(self%set(k)%element)) deallocate (self%set(k)%element)
    allocate (self%set(k)%phi(0))
    if (role == role_name(role_pore)) self%set(k)%moves = .false.
    if (turns) self%set(k)%phi = [((body%dofs%phi(ids(r)) + c, c=0, body%dofs%parts - 1), &
                                   r=1, int(size(ids), i4))]
    call mark_prescribed(self, body, changed)
  end subroutine select_set

  !> Faults P301 of the role, P302 of nodes of a set that do not exist or have no micro-rotation.
  subroutine check_set(name, role, ids, turns, body, errors)
    character(len=*), intent(in) :: name, role
    integer(i8), intent(in) :: ids(:)
    logical, intent(in) :: turns  !! the set acts on micro-rotations
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (role_number(role) == role_pore) call check_wet(body, name, ids, errors)
    if (errors%any() .or. role_number(role) == role_pore) return
    if (role_number(role) == 0 .or. role_number(role) > role_load) then
      call errors%add('P301', "talus-fem has no role '"//role//"' for a set", 'set '//name, &
                      'choices: report, prescribe, load and pore')
      return
    end if
    if (any(ids < 1) .or. any(ids > body%mesh%nodes)) then
      k = findloc(ids < 1 .or. ids > body%mesh%nodes, .true., 1)
      call errors%add('P302', 'set '//name//' names node '//str(ids(k))// &
                      ', which does not exist', 'set '//name, &
                      'node ids go from 1 to '//str(body%mesh%nodes))
      return
    end if
    if (.not. turns) return
    if (.not. any(body%dofs%phi(ids) == 0)) return
    k = int(ids(findloc(body%dofs%phi(ids), 0, 1)), i4)
    call errors%add('P302', 'set '//name//': node '//str(k)//' has no micro-rotation', &
      hint='only corner nodes of mixed pairs and micropolar or micromorphic sections have them')
  end subroutine check_set

  !> Mark what the prescribe sets move; what they did not move before keeps its displacement;
  !! within a run its partner knows from now on how it moves. What they do not move any more goes
  !! on with the velocity that came last.
  subroutine mark_prescribed(self, body, changed)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    logical, intent(out) :: changed
    logical :: chosen(3, body%dofs%blocks)
    integer(i4) :: k
    chosen = .false.
    do k = 1, self%n
      if (self%set(k)%role /= role_prescribe) cycle
      if (self%set(k)%moves) chosen(:, self%set(k)%node) = .true.
      chosen(:, self%set(k)%phi) = .true.
    end do
    changed = any(chosen .neqv. body%port%prescribed)
    if (self%begun) then
      where (chosen .and. .not. body%port%prescribed)
        body%state%v = 0.0_wp
        body%state%a = 0.0_wp
        body%accepted%v = 0.0_wp
        body%accepted%a = 0.0_wp
      end where
      where (body%port%prescribed .and. .not. chosen)
        body%state%v = body%port%given_v
        body%accepted%v = body%port%given_v
      end where
    end if
    call body%port%prescribe(chosen, body%accepted%u)
  end subroutine mark_prescribed

  !> Index of a set, 0 if there is none.
  subroutine find(self, name, k)
    class(fem_sets_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: k
    do k = 1, self%n
      if (self%set(k)%name == name) return
    end do
    k = 0
  end subroutine find

  !> List the elements that have a node of a set and a weight in the stored energy.
  subroutine elements_of(self, k, body)
    class(fem_sets_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(fem_body_type), intent(in) :: body
    logical :: chosen(body%mesh%nodes), wanted(body%mesh%elements)
    integer(i4) :: e
    if (allocated(self%set(k)%element)) return
    chosen = .false.
    chosen(self%set(k)%node) = .true.
    do e = 1, body%mesh%elements
      wanted(e) = any(chosen(body%mesh%node(body%mesh%start(e):body%mesh%start(e + 1) - 1))) .and. &
        any(abs(body%elastic%factor(body%elastic%point(e):body%elastic%point(e + 1) - 1)) > 0.0_wp)
    end do
    self%set(k)%element = pack([(e, e=1, body%mesh%elements)], wanted)
  end subroutine elements_of

  !> Inner forces of the elements of set k on all sets, as on the partner; laws with a state
  !! have no map.
  subroutine put_force_of_elements(self, k, body, reply, errors)
    class(fem_sets_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: f(:, :)
    call self%elements_of(k, body)
    if (body%matter%active) then
      allocate (f(3, body%dofs%blocks))
      call body%interface_force(body%state%u, f, self%set(k)%element)
      call body%matter_fault(errors)
      if (.not. errors%any()) call self%put_parts(body%dofs%halo, f, reply)
      return
    end if
    if (.not. self%edge%ready .or. self%edge_of /= k) then
      call self%edge%build(body%mesh, body%dofs, body%elastic, self%set(k)%element)
      self%edge_of = k
    end if
    call self%edge%force(body%state%u)
    call self%put_parts(body%dofs%halo, self%edge%f, reply)
  end subroutine put_force_of_elements

  !> Forces of which each rank has a part, that of its elements: those of the sets alone are added
  !! up, in the order of the ranks.
  subroutine put_parts(self, halo, f, reply)
    class(fem_sets_type), intent(in) :: self
    type(fem_halo_type), intent(in) :: halo
    real(wp), intent(in) :: f(:, :)  !! (3, blocks) [N, N m]
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: total(:, :), values(:)
    integer(i4), allocatable :: block(:)
    integer(i4) :: s
    if (.not. halo%several()) then
      call self%put_forces(f, reply)
      return
    end if
    allocate (block(0))
    do s = 1, self%n
      block = [block, self%set(s)%node, self%set(s)%phi]
    end do
    values = reshape(f(:, block), [3*size(block)])
    call halo%add_in_order(values)
    allocate (total, mold=f)
    total(:, block) = reshape(values, [3, size(block)])
    call self%put_forces(total, reply)
  end subroutine put_parts

  !> Inner forces (3, blocks) on all sets, as on the partner.
  subroutine put_forces(self, f, reply)
    class(fem_sets_type), intent(in) :: self
    real(wp), intent(in) :: f(:, :)
    type(message_type), intent(inout) :: reply
    integer(i4) :: s
    do s = 1, self%n
      if (self%set(s)%role == role_pore) cycle
      call reply%put(trim(self%set(s)%name)//dot_force, -f(:, self%set(s)%node))
      if (size(self%set(s)%phi) > 0) &
        call reply%put(trim(self%set(s)%name)//dot_moment, -f(:, self%set(s)%phi))
    end do
  end subroutine put_forces

  !> Inner forces of the body at its displacements. A partner that kicks at the end of an interval
  !! and again at the start of the next requests them twice. Of laws with a state that start has the
  !! accepted stresses.
  subroutine whole_force(self, body, f)
    class(fem_sets_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(out) :: f(:, :)
    logical :: found
    if (body%matter%active) then
      found = .false.
      if (.not. body%pore%active .and. body%supports%ground%n == 0) then
        if (all(abs(body%state%u - body%accepted%u) <= 0.0_wp)) &
          call body%matter%held_force(body%dofs, body%elastic, f, found)
      end if
      if (.not. found) call body%trial_force(body%state%u, f)
      return
    end if
    if (allocated(self%known_u)) then
      if (all(abs(body%state%u - self%known_u) <= 0.0_wp)) then
        f = self%known_force
        return
      end if
    end if
    call body%trial_force(body%state%u, f)
    self%known_u = body%state%u
    self%known_force = f
  end subroutine whole_force

  !> After weights, moduli or initial stresses have changed.
  subroutine forget_elements(self)
    class(fem_sets_type), intent(inout) :: self
    integer(i4) :: k
    self%edge%ready = .false.
    if (allocated(self%known_u)) deallocate (self%known_u)
    do k = 1, self%n
      if (allocated(self%set(k)%element)) deallocate (self%set(k)%element)
    end do
  end subroutine forget_elements

  !> Forces, and moments on micro-rotations, of all load sets in a request; without them the loads
  !! are zero.
  subroutine take_loads(self, body, request, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    body%port%port_load = 0.0_wp
    do k = 1, self%n
      if (self%set(k)%role == role_pore) call take_wet(body, self%set(k), request, errors)
      if (self%set(k)%role /= role_load) cycle
      if (self%set(k)%moves) call add(self%set(k)%node, dot_force)
      if (size(self%set(k)%phi) > 0) call add(self%set(k)%phi, dot_moment)
      if (errors%any()) return
    end do

  contains

    subroutine add(block, field)
      integer(i4), intent(in) :: block(:)
      character(len=*), intent(in) :: field
      real(wp) :: value(3, size(block))
      integer(i4) :: j
      if (.not. request%has(trim(self%set(k)%name)//field)) return
      call request%get(trim(self%set(k)%name)//field, value, errors)
      if (errors%any()) return
      do j = 1, size(block)
        body%port%port_load(:, block(j)) = body%port%port_load(:, block(j)) + value(:, j)
      end do
    end subroutine add
  end subroutine take_loads

  !> Impulses of all load sets in a request [N s]; `given` where there are any.
  subroutine take_impulses(self, body, request, given, push, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: request
    logical, intent(out) :: given
    real(wp), allocatable, intent(out) :: push(:, :)  !! (3, blocks), where there are any
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:, :)
    integer(i4) :: k, j

    given = .false.
    do k = 1, self%n
      associate (set => self%set(k))
        if (set%role /= role_load .or. .not. set%moves) cycle
        if (.not. request%has(trim(set%name)//dot_impulse)) cycle
        if (.not. given) allocate (push(3, body%dofs%blocks), source=0.0_wp)
        given = .true.
        allocate (value(3, size(set%node)))
        call request%get(trim(set%name)//dot_impulse, value, errors)
        if (errors%any()) return
        do j = 1, size(set%node)
          push(:, set%node(j)) = push(:, set%node(j)) + value(:, j)
        end do
        deallocate (value)
      end associate
    end do
  end subroutine take_impulses

  !> Prescribed displacements and micro-rotations of all prescribe sets in a request, and
  !! velocities.
  subroutine take_motion(self, body, request, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    do k = 1, self%n
      associate (set => self%set(k))
        if (set%role /= role_prescribe) cycle
        if (set%moves) call take(set%name, set%node, dot_u, request, body%port%given_u, errors)
        if (size(set%phi) > 0) call take(set%name, set%phi, dot_phi, request, body%port%given_u, &
          errors)
      end associate
      if (errors%any()) return
    end do
    call self%take_speeds(body, request, errors)
  end subroutine take_motion

  !> Velocities of the nodes of all prescribe sets, for the field output, and for those that the
  !! sets do not move any more.
  subroutine take_speeds(self, body, request, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, self%n
      associate (set => self%set(k))
        if (set%role == role_prescribe .and. set%moves) &
          call take(set%name, set%node, dot_v, request, body%port%given_v, errors)
        if (set%role == role_prescribe .and. size(set%phi) > 0) &
          call take(set%name, set%phi, dot_phi_rate, request, body%port%given_v, errors)
      end associate
    end do
  end subroutine take_speeds

  !> Values of one field, if it is there.
  subroutine take(name, block, field, request, given, errors)
    character(len=*), intent(in) :: name, field
    integer(i4), intent(in) :: block(:)
    type(message_type), intent(inout) :: request
    real(wp), intent(inout) :: given(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: value(3, size(block))
    if (errors%any()) return
    if (.not. request%has(trim(name)//field)) return
    call request%get(trim(name)//field, value, errors)
    if (.not. errors%any()) given(:, block) = value
  end subroutine take

  !> u, v, a of every set and phi, phi_rate, phi_acceleration where it has them; reactions and
  !! their moments of prescribed ones.
  subroutine put_states(self, body, reply)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    character(len=:), allocatable :: name
    integer(i4) :: k
    do k = 1, self%n
      name = trim(self%set(k)%name)
      if (self%set(k)%role == role_pore) then
        call put_wet(body, self%set(k), reply)
        cycle
      end if
      call reply%put(name//dot_u, body%state%u(:, self%set(k)%node))
      call reply%put(name//dot_v, body%state%v(:, self%set(k)%node))
      call reply%put(name//dot_a, body%state%a(:, self%set(k)%node))
      if (self%set(k)%role == role_prescribe) &
        call reply%put(name//dot_reaction, body%state%reaction(:, self%set(k)%node))
      if (size(self%set(k)%phi) == 0) cycle
      call reply%put(name//dot_phi, body%state%u(:, self%set(k)%phi))
      call reply%put(name//dot_phi_rate, body%state%v(:, self%set(k)%phi))
      call reply%put(name//dot_phi_acceleration, body%state%a(:, self%set(k)%phi))
      if (self%set(k)%role == role_prescribe) &
        call reply%put(name//dot_reaction_moment, body%state%reaction(:, self%set(k)%phi))
    end do
  end subroutine put_states
end module fem_sets
