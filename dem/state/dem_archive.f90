!> Named arrays: the complete state of a system on its way to or from a checkpoint. An extension may
!! send each array on when it is put, so that the state need not be in memory twice.
module dem_archive
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  implicit none
  private
  public :: dem_archive_type

  !> One named array: real (components, n) or integer (components, n).
  type :: dem_item_type
    character(len=32) :: name = ''
    logical :: is_real = .true.
    real(wp), allocatable :: reals(:, :)
    integer(i8), allocatable :: integers(:, :)
  end type dem_item_type

  !> All items, in the order in which they were put.
  type :: dem_archive_type
    integer(i4) :: count = 0
    type(dem_item_type), allocatable :: item(:)
    character(len=:), allocatable :: path   !! of the file from which it was read
  contains
    procedure :: refuse
    procedure :: put_reals
    procedure :: put_integers
    procedure :: get_reals
    procedure :: get_integers
    procedure :: find
    procedure :: clear
  end type dem_archive_type

contains

  subroutine clear(self)
    class(dem_archive_type), intent(inout) :: self
    self%count = 0
    if (allocated(self%item)) deallocate (self%item)
  end subroutine clear

  !> Room for one more item; arrays are moved, not copied.
  subroutine grow(self)
    class(dem_archive_type), intent(inout) :: self
    type(dem_item_type), allocatable :: longer(:)
    integer(i4) :: k

    if (.not. allocated(self%item)) allocate (self%item(32))
    if (self%count == size(self%item)) then
      allocate (longer(2*self%count))
      do k = 1, self%count
        longer(k)%name = self%item(k)%name
        longer(k)%is_real = self%item(k)%is_real
        call move_alloc(self%item(k)%reals, longer(k)%reals)
        call move_alloc(self%item(k)%integers, longer(k)%integers)
      end do
      call move_alloc(longer, self%item)
    end if
    self%count = self%count + 1
  end subroutine grow

  subroutine put_reals(self, name, values)
    class(dem_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous :: values(:, :)
    call grow(self)
    self%item(self%count)%name = name
    self%item(self%count)%is_real = .true.
    allocate (self%item(self%count)%reals(size(values, 1), size(values, 2)))
    self%item(self%count)%reals(:, :) = values
  end subroutine put_reals

  subroutine put_integers(self, name, values)
    class(dem_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous :: values(:, :)
    call grow(self)
    self%item(self%count)%name = name
    self%item(self%count)%is_real = .false.
    allocate (self%item(self%count)%integers(size(values, 1), size(values, 2)))
    self%item(self%count)%integers(:, :) = values
  end subroutine put_integers

  !> Position of an item, 0 if there is none of that name.
  pure integer(i4) function find(self, name) result(k)
    class(dem_archive_type), intent(in) :: self
    character(len=*), intent(in) :: name
    do k = 1, self%count
      if (self%item(k)%name == name) return
    end do
    k = 0
  end function find

  !> Array of an item; a missing one or one of the wrong shape is a fault (I229).
  subroutine get_reals(self, name, components, n, values, errors)
    class(dem_archive_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: components, n  !! expected shape; n < 0: any
    real(wp), allocatable, intent(out) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    k = find(self, name)
    if (k > 0) then
      if (self%item(k)%is_real .and. allocated(self%item(k)%reals)) then
        if (size(self%item(k)%reals, 1) == components .and. &
            (n < 0 .or. size(self%item(k)%reals, 2) == n)) then
          allocate (values, source=self%item(k)%reals)
          return
        end if
      end if
    end if
    allocate (values(components, max(n, 0)), source=0.0_wp)
    call self%refuse(name, 'is missing or has another size', errors)
  end subroutine get_reals

  !> As get_reals, for integers; one outside a range is a fault, too.
  subroutine get_integers(self, name, components, n, values, errors, range)
    class(dem_archive_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: components, n
    integer(i8), allocatable, intent(out) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8), intent(in), optional :: range(2)  !! least, greatest
    integer(i4) :: k

    k = find(self, name)
    if (k > 0) then
      if (.not. self%item(k)%is_real .and. allocated(self%item(k)%integers)) then
        if (size(self%item(k)%integers, 1) == components .and. &
            (n < 0 .or. size(self%item(k)%integers, 2) == n)) then
          allocate (values, source=self%item(k)%integers)
          if (present(range)) call check_range(self, name, range, values, errors)
          return
        end if
      end if
    end if
    allocate (values(components, max(n, 0)), source=0_i8)
    if (present(range)) values = range(1)
    call self%refuse(name, 'is missing or has another size', errors)
  end subroutine get_integers

  !> Values that are all in the range from then on.
  subroutine check_range(self, name, range, values, errors)
    class(dem_archive_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: range(2)
    integer(i8), intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: worst
    if (size(values) == 0) return
    worst = minval(values)
    if (worst >= range(1)) worst = maxval(values)
    if (worst >= range(1) .and. worst <= range(2)) return
    call self%refuse(name, 'holds '//str(worst)//', no number from '//str(range(1))//' to '// &
                     str(range(2)), errors)
    values = range(1)
  end subroutine check_range

  !> A fault of an array of the file.
  subroutine refuse(self, name, what, errors)
    class(dem_archive_type), intent(in) :: self
    character(len=*), intent(in) :: name, what
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: place
    place = ''
    if (allocated(self%path)) place = self%path//':/state/'//name
    call errors%add('I229', "checkpoint: array '"//name//"' "//what, place, &
                    'the checkpoint belongs to another packing, deck or version')
  end subroutine refuse
end module dem_archive
