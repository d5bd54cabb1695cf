!> Sets of nodes that a partner has selected, and their fields in requests and replies.
module fem_sets
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use fem_types, only: fem_set_type, role_report, role_prescribe, role_load, name_length
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: fem_sets_type

  type :: fem_sets_type
    integer(i4) :: n = 0
    type(fem_set_type) :: set(32)
  contains
    procedure :: select => select_set
    procedure :: find
    procedure :: take_loads
    procedure :: take_motion
    procedure :: put_states
  end type fem_sets_type

contains

  !> Name a set of nodes; `changed` when the free degrees of freedom are others now.
  subroutine select_set(self, name, role, ids, body, changed, errors)
    class(fem_sets_type), intent(inout) :: self
    character(len=*), intent(in) :: name, role
    integer(i8), intent(in) :: ids(:)
    type(fem_body_type), intent(inout) :: body
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    logical :: before(3, body%dofs%blocks)
    integer(i4) :: k, r

    changed = .false.
    r = findloc([character(len=9) :: 'report', 'prescribe', 'load'], role, 1)
    if (r == 0) then
      call errors%add('P301', "talus-fem has no role '"//role//"' for a set", 'set '//name, &
                      'it knows report, prescribe and load')
      return
    end if
    if (any(ids < 1) .or. any(ids > body%mesh%nodes)) then
      call errors%add('P302', 'set '//name//' names nodes that do not exist', &
        hint='node ids go from 1 to '// &
                      str(body%mesh%nodes))
      return
    end if
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
    self%set(k)%role = r
    self%set(k)%node = int(ids, i4)
    before = body%prescribed
    body%prescribed = .false.
    do k = 1, self%n
      if (self%set(k)%role == role_prescribe) body%prescribed(:, self%set(k)%node) = .true.
    end do
    where (body%prescribed .and. .not. before) body%given_u = body%accepted%u
    changed = any(body%prescribed .neqv. before)
  end subroutine select_set

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

  !> Loads of all load sets in a request; without them the loads are zero.
  subroutine take_loads(self, body, request, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: force(:, :)
    integer(i4) :: k, j

    body%port_load = 0.0_wp
    do k = 1, self%n
      if (self%set(k)%role /= role_load) cycle
      if (.not. request%has(trim(self%set(k)%name)//'.force')) cycle
      if (allocated(force)) deallocate (force)
      allocate (force(3, size(self%set(k)%node)))
      call request%get(trim(self%set(k)%name)//'.force', force, errors)
      if (errors%any()) return
      do j = 1, size(self%set(k)%node)
        body%port_load(:, self%set(k)%node(j)) = body%port_load(:, self%set(k)%node(j)) &
          + force(:, j)
      end do
    end do
  end subroutine take_loads

  !> Prescribed displacements of all prescribe sets in a request.
  subroutine take_motion(self, body, request, errors)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: u(:, :)
    integer(i4) :: k

    do k = 1, self%n
      if (self%set(k)%role /= role_prescribe) cycle
      if (.not. request%has(trim(self%set(k)%name)//'.u')) cycle
      if (allocated(u)) deallocate (u)
      allocate (u(3, size(self%set(k)%node)))
      call request%get(trim(self%set(k)%name)//'.u', u, errors)
      if (errors%any()) return
      body%given_u(:, self%set(k)%node) = u
    end do
  end subroutine take_motion

  !> u, v, a of every set, reactions of prescribed ones.
  subroutine put_states(self, body, reply)
    class(fem_sets_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    character(len=:), allocatable :: name
    integer(i4) :: k
    do k = 1, self%n
      name = trim(self%set(k)%name)
      call reply%put(name//'.u', body%state%u(:, self%set(k)%node))
      call reply%put(name//'.v', body%state%v(:, self%set(k)%node))
      call reply%put(name//'.a', body%state%a(:, self%set(k)%node))
      if (self%set(k)%role == role_prescribe) &
        call reply%put(name//'.reaction', body%state%reaction(:, self%set(k)%node))
    end do
  end subroutine put_states
end module fem_sets
