!> Sets of grains that a partner has selected, each with a role.
module dem_sets
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_port_names, only: role_border, role_load, role_number, role_prescribe, role_report, &
    role_pore, role_surface
  use dem_make, only: prescribe_some
  use dem_state, only: kind_free, kind_ghost
  use dem_system, only: dem_system_type
  use dem_parts, only: find_border
  implicit none
  private
  public :: dem_set_type, dem_sets_type, selection_type, role_report, role_prescribe, role_load, &
    role_surface, role_border, role_pore

  type :: dem_set_type
    character(len=:), allocatable :: name
    character(len=:), allocatable :: fields  !! what replies hold, ',a,b,'; ',,' for the usual
    integer(i4) :: role = 0
    integer(i4), allocatable :: index(:)     !! of the grains, or nodes of the liquid's grid
    integer(i4) :: body = 0                  !! of a surface
  contains
    procedure :: wants
  end type dem_set_type

  !> What a partner asks for with SELECT.
  type :: selection_type
    character(len=:), allocatable :: name, role  !! of the set; of its grains
    character(len=:), allocatable :: fields      !! as in the message, '' for the usual
    integer(i8), allocatable :: ids(:)           !! of the grains
  end type selection_type

  type :: dem_sets_type
    integer(i4) :: count = 0
    type(dem_set_type), allocatable :: set(:)
  contains
    procedure :: find
    procedure :: select
    procedure :: put => put_set
    procedure :: forget_grains
    procedure :: mark
    procedure :: renumber
  end type dem_sets_type

contains

  !> Does the reply hold this quantity? All usual ones unless fields were named.
  pure logical function wants(self, quantity)
    class(dem_set_type), intent(in) :: self
    character(len=*), intent(in) :: quantity
    wants = self%fields == ',,' .or. index(self%fields, ','//quantity//',') > 0
  end function wants

  !> Number of a set; an unknown one is a fault (P251) and gives 0.
  subroutine find(self, name, k, errors)
    class(dem_sets_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: k
    type(error_list_type), intent(inout) :: errors
    do k = 1, self%count
      if (self%set(k)%name == name) return
    end do
    k = 0
    call errors%add('P251', "the set '"//name//"' was not selected", 'exchange port', &
                    'SELECT comes before all other use of a set')
  end subroutine find

  !> Make a set, or replace the one of this name. changed is set if kinds of grains changed.
  subroutine select(self, wish, system, may_change, changed, errors)
    class(dem_sets_type), intent(inout) :: self
    type(selection_type), intent(in) :: wish
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: may_change  !! no step was taken yet
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: index(:)
    integer(i4) :: role, before

    before = errors%count
    changed = .false.
    call role_of(wish%role, role, errors)
    call system%find(wish%ids, index, errors)
    if (errors%count > before) return
    if (role == role_prescribe) call prescribe(system, index, may_change, changed, errors)
    if (role == role_load) call check_free(system, index, errors)
    if (role == role_border) call check_ghosts(system, index, errors)
    if (errors%count > before) return
    if (role == role_border) call system%set_border([index, unmoved(self, system)])
    call self%put(wish%name, role, wish%fields, index, 0)
  end subroutine select

  !> Ghosts near free grains that no set moves: they stand still and are touched all the same.
  function unmoved(self, system) result(index)
    class(dem_sets_type), intent(in) :: self
    type(dem_system_type), intent(in) :: system
    integer(i4), allocatable :: index(:)
    logical :: moved(system%grains%n)
    integer(i4) :: k
    moved = .false.
    do k = 1, self%count
      if (self%set(k)%role == role_prescribe) moved(self%set(k)%index) = .true.
    end do
    allocate (index(0))
    if (.not. any(system%grains%kind == kind_ghost .and. .not. moved)) return
    call find_border(system%dem_data_type, index)
    index = pack(index, .not. moved(index))
  end function unmoved

  !> A set by this name, new or instead of the one that had it.
  subroutine put_set(self, name, role, fields, index, body)
    class(dem_sets_type), intent(inout) :: self
    character(len=*), intent(in) :: name, fields
    integer(i4), intent(in) :: role, index(:)
    integer(i4), intent(in) :: body  !! of a surface, else 0
    type(dem_set_type), allocatable :: longer(:)
    integer(i4) :: k

    do k = 1, self%count
      if (self%set(k)%name == name) exit
    end do
    if (k > self%count) then
      allocate (longer(k))
      do k = 1, self%count
        call move_set(self%set(k), longer(k))
      end do
      self%count = size(longer)
      call move_alloc(longer, self%set)
      k = self%count
    end if
    self%set(k)%name = name
    self%set(k)%role = role
    self%set(k)%fields = ','//comma_list(fields)//','
    self%set(k)%index = index
    self%set(k)%body = body
  end subroutine put_set

  !> Sets of grains are gone; those of surfaces and of the liquid stay.
  subroutine forget_grains(self)
    class(dem_sets_type), intent(inout) :: self
    integer(i4) :: k, n
    n = 0
    do k = 1, self%count
      if (self%set(k)%role /= role_surface .and. self%set(k)%role /= role_pore) cycle
      n = n + 1
      if (n < k) call move_set(self%set(k), self%set(n))
    end do
    self%count = n
    if (allocated(self%set)) self%set = self%set(:n)
  end subroutine forget_grains

  !> Grains of all sets.
  pure function mark(self, n) result(marked)
    class(dem_sets_type), intent(in) :: self
    integer(i4), intent(in) :: n  !! grains
    logical :: marked(n)
    integer(i4) :: k
    marked = .false.
    do k = 1, self%count
      if (self%set(k)%role /= role_surface) marked(self%set(k)%index) = .true.
    end do
  end function mark

  !> The same grains by other numbers, as others have left and entered.
  subroutine renumber(self, before, system, errors)
    class(dem_sets_type), intent(inout) :: self
    integer(i8), intent(in) :: before(:)  !! ids by the numbers until now
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: index(:)
    integer(i4) :: k
    do k = 1, self%count
      if (self%set(k)%role == role_surface) cycle
      call system%find(before(self%set(k)%index), index, errors)
      if (errors%any()) return
      self%set(k)%index = index
    end do
  end subroutine renumber

  subroutine move_set(from, to)
    type(dem_set_type), intent(inout) :: from, to
    call move_alloc(from%name, to%name)
    call move_alloc(from%fields, to%fields)
    call move_alloc(from%index, to%index)
    to%role = from%role
    to%body = from%body
  end subroutine move_set

  subroutine role_of(name, role, errors)
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: role
    type(error_list_type), intent(inout) :: errors
    role = role_number(name)
    if (role == 0 .or. role == role_surface .or. role == role_pore) &
      call errors%add('P250', "there is no role '"//name//"' for grains", 'exchange port, SELECT', &
                      'roles: report, prescribe, load, surface, border, pore')
  end subroutine role_of

  !> Turn grains into ghosts at rest; only before the first step (P253).
  subroutine prescribe(system, index, may_change, changed, errors)
    type(dem_system_type), intent(inout) :: system
    integer(i4), intent(in) :: index(:)
    logical, intent(in) :: may_change
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    changed = any(system%grains%kind(index) /= kind_ghost)
    if (.not. changed) return
    if (.not. may_change) then
      changed = .false.
      call errors%add('P253', 'grains can become prescribed only before the first step', &
                      'exchange port, SELECT', 'select all prescribed sets before READY')
      return
    end if
    call prescribe_some(system%grains)
    do k = 1, size(index)
      if (system%grains%kind(index(k)) == kind_ghost) cycle
      system%grains%kind(index(k)) = kind_ghost
      system%grains%v(:, index(k)) = 0.0_wp
      system%grains%omega(:, index(k)) = 0.0_wp
    end do
  end subroutine prescribe

  !> Forces can be put on free grains only (P252).
  subroutine check_free(system, index, errors)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: index(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, size(index)
      if (system%grains%kind(index(k)) == kind_free) cycle
      call errors%add('P252', 'grain '//str(system%grains%id(index(k)))//' is not free: no '// &
                      'force can be put on it', 'exchange port, SELECT', &
                      'the role load is for free grains')
      return
    end do
  end subroutine check_free

  !> Only ghosts can be a border, of grains that no cell carries (P252).
  subroutine check_ghosts(system, index, errors)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: index(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (system%cell%active) &
      call errors%add('P252', 'grains in a cell have no border: all their contacts are '// &
                      'evaluated at once', 'exchange port, SELECT', 'send FORCE with scope all')
    do k = 1, size(index)
      if (system%grains%kind(index(k)) == kind_ghost) cycle
      call errors%add('P252', 'grain '//str(system%grains%id(index(k)))//' is no ghost: it '// &
                      'cannot be of the border', 'exchange port, SELECT', &
                      'the role border is for grains that have the role prescribe')
      return
    end do
  end subroutine check_ghosts

  !> Names between commas, blanks or line ends, as 'a,b,c'.
  pure function comma_list(text) result(list)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: list
    integer :: k
    list = ''
    do k = 1, len(text)
      if (text(k:k) == ',' .or. text(k:k) == ' ' .or. text(k:k) == new_line('a')) then
        if (len(list) > 0) then
          if (list(len(list):) /= ',') list = list//','
        end if
      else
        list = list//text(k:k)
      end if
    end do
    if (len(list) > 0) then
      if (list(len(list):) == ',') list = list(:len(list) - 1)
    end if
  end function comma_list
end module dem_sets
