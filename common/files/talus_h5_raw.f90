!> HDF5 without its own messages: the calls that talus_hdf5 is made of, faults returned.
!!
!! Every fault names file and object and carries the library's deepest reason (for example
!! 'No space left on device'). Objects are given by their whole path, '/grains/x'.
module talus_h5_raw
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_funloc, c_funptr, c_int, &
    c_int64_t, c_loc, c_null_char, c_ptr
  use hdf5, only: hid_t, hsize_t, size_t, h5open_f, h5eset_auto_f, h5iis_valid_f, &
    h5t_native_double, h5s_scalar_f, h5s_null_f, h5screate_f, h5screate_simple_f, h5sclose_f, &
    h5dcreate_f, h5dopen_f, h5dwrite_f, h5dread_f, h5dclose_f, h5dget_space_f, h5dget_type_f, &
    h5sget_simple_extent_ndims_f, h5sget_simple_extent_dims_f, &
    h5sget_simple_extent_type_f, h5tget_class_f, h5tclose_f, &
    h5t_integer_f, h5t_float_f, h5t_string_f, h5lexists_f, h5pcreate_f, h5pclose_f, &
    h5pset_create_inter_group_f, h5p_link_create_f, h5p_default_f, h5t_std_i32le, h5t_std_i64le, &
    h5t_ieee_f64le, h5aexists_f, h5acreate_f, h5adelete_f, h5aopen_f, h5awrite_f, h5aread_f, &
    h5aclose_f, &
    h5aget_space_f, h5aget_type_f, h5oopen_f, h5oclose_f, h5sselect_hyperslab_f, h5s_select_set_f
  use talus_kinds, only: i4, i8
  use talus_errors, only: error_list_type
  use talus_system, only: set_environment
  use talus_text, only: str
  implicit none
  private
  public :: kind_integer4, kind_integer8, kind_real
  public :: start_library, library_reason, object_exists, object_shape, dataset_class
  public :: write_dataset, write_slab, read_dataset, write_attribute, read_attribute, object_fault

  integer(i4), parameter :: kind_integer4 = 1, kind_integer8 = 2, kind_real = 3
  integer(c_int), parameter :: walk_upward = 0       !! H5E_WALK_UPWARD: deepest entry first
  integer(hid_t), parameter :: default_stack = 0     !! H5E_DEFAULT
  integer, parameter :: longest_reason = 300

  !> H5E_error2_t.
  type, bind(c) :: stack_entry_type
    integer(c_int64_t) :: class_id, major_id, minor_id
    integer(c_int) :: line
    type(c_ptr) :: function_name, file_name, description
  end type stack_entry_type

  !> What is found in the error stack.
  type, bind(c) :: reason_type
    integer(c_int) :: length
    character(kind=c_char) :: text(longest_reason)
  end type reason_type

  interface
    integer(c_int) function c_walk(stack, direction, visitor, data) bind(c, name='H5Ewalk2')
      import :: c_int, c_int64_t, c_funptr, c_ptr
      integer(c_int64_t), value :: stack
      integer(c_int), value :: direction
      type(c_funptr), value :: visitor
      type(c_ptr), value :: data
    end function c_walk
    integer(c_int) function c_dont_atexit() bind(c, name='H5dont_atexit')
      import :: c_int
    end function c_dont_atexit
  end interface

contains

  !> Start the HDF5 library once: silent, without its locks (a viewer must not stop a run) and
  !! without its own end of program (every file is closed by us).
  subroutine start_library()
    logical :: started
    integer :: stat
    integer(c_int) :: ignored
    call set_environment('HDF5_USE_FILE_LOCKING', 'FALSE', .false.)
    ignored = c_dont_atexit()
    call h5iis_valid_f(h5t_native_double, started, stat)
    if (stat /= 0 .or. .not. started) call h5open_f(stat)
    call h5eset_auto_f(0, stat)
  end subroutine start_library

  !> The deepest reason on the library's error stack: call it right after the failing call.
  function library_reason() result(text)
    character(len=:), allocatable :: text
    type(reason_type), target :: reason
    integer(c_int) :: ignored
    integer :: k
    reason%length = 0
    ignored = c_walk(default_stack, walk_upward, c_funloc(visit), c_loc(reason))
    text = ''
    do k = 1, reason%length
      text = text//reason%text(k)
    end do
    k = index(text, "error message = '")
    if (k > 0) then
      text = text(k + 17:)
      k = index(text, "'")
      if (k > 1) text = text(:k - 1)
    end if
    if (len(text) == 0) text = 'HDF5 gives no reason'
  end function library_reason

  integer(c_int) function visit(depth, entry, data) bind(c)
    integer(c_int), value :: depth
    type(stack_entry_type), intent(in) :: entry
    type(c_ptr), value :: data
    type(reason_type), pointer :: reason
    character(kind=c_char), pointer :: letters(:)
    integer :: k
    visit = 0
    if (depth > 0) return
    call c_f_pointer(data, reason)
    call c_f_pointer(entry%description, letters, [longest_reason])
    do k = 1, longest_reason
      if (letters(k) == c_null_char) exit
      reason%text(k) = letters(k)
      reason%length = k
    end do
  end function visit

  !> A fault at an object of a file, with the library's reason.
  subroutine object_fault(path, name, what, errors)
    character(len=*), intent(in) :: path, name, what
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: reason, code, hint
    reason = library_reason()
    code = 'S009'
    hint = 'check the file with h5ls'
    if (index(reason, 'No space left') > 0 .or. index(reason, 'too large') > 0 .or. &
        index(reason, 'quota') > 0) then
      code = 'S002'
      hint = 'make room, then go on with --restart=auto'
    else if (what == 'made' .and. name == 'the file') then
      code = 'S001'
      hint = 'check the folder and its permissions, or choose --output=DIR'
    end if
    call errors%add(code, "'"//path//"': "//name//' cannot be '//what//': '//reason, &
                    path//':'//name, hint)
  end subroutine object_fault

  !> Is there an object of this path, with all the groups above it?
  logical function object_exists(file, name)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer :: k, stat
    object_exists = .true.
    do k = 2, len(name)
      if (name(k:k) /= '/' .and. k < len(name)) cycle
      call h5lexists_f(file, name(:merge(k, k - 1, name(k:k) /= '/')), object_exists, stat)
      if (stat < 0) object_exists = .false.
      if (.not. object_exists) return
    end do
  end function object_exists

  !> Fortran shape of a dataset or, with attribute given, of an attribute; size 0 for a scalar, [0]
  !! where there is nothing in it (HDF5's null dataspace).
  subroutine object_shape(file, name, extent, stat, attribute)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer(hsize_t), allocatable, intent(out) :: extent(:)
    integer, intent(out) :: stat
    character(len=*), intent(in), optional :: attribute
    integer(hid_t) :: object, space, owner
    integer(hsize_t), allocatable :: limits(:)
    integer :: rank, space_class, ignored

    allocate (extent(0))
    if (present(attribute)) then
      call h5oopen_f(file, name, owner, stat)
      if (stat < 0) return
      call h5aopen_f(owner, attribute, object, stat)
      if (stat >= 0) call h5aget_space_f(object, space, stat)
    else
      call h5dopen_f(file, name, object, stat)
      if (stat < 0) return
      call h5dget_space_f(object, space, stat)
    end if
    if (stat >= 0) then
      call h5sget_simple_extent_ndims_f(space, rank, stat)
      deallocate (extent)
      allocate (extent(max(rank, 0)), limits(max(rank, 0)))
      if (rank > 0) call h5sget_simple_extent_dims_f(space, extent, limits, ignored)
      call h5sget_simple_extent_type_f(space, space_class, ignored)
      if (space_class == h5s_null_f) extent = [0_hsize_t]
      call h5sclose_f(space, ignored)
    end if
    if (present(attribute)) then
      call h5aclose_f(object, ignored)
      call h5oclose_f(owner, ignored)
    else
      call h5dclose_f(object, ignored)
    end if
  end subroutine object_shape

  !> Class of a dataset: 'integer', 'real', 'text', 'other', or '' when it is no dataset.
  function dataset_class(file, name) result(class_name)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: class_name
    integer(hid_t) :: object, type_id
    integer :: class_id, stat
    class_name = ''
    call h5dopen_f(file, name, object, stat)
    if (stat < 0) return
    call h5dget_type_f(object, type_id, stat)
    call h5tget_class_f(type_id, class_id, stat)
    class_name = class_text(class_id)
    call h5tclose_f(type_id, stat)
    call h5dclose_f(object, stat)
  end function dataset_class

  function class_text(class_id) result(text)
    integer, intent(in) :: class_id
    character(len=:), allocatable :: text
    text = 'other'
    if (class_id == h5t_integer_f) text = 'integer'
    if (class_id == h5t_float_f) text = 'real'
    if (class_id == h5t_string_f) text = 'text'
  end function class_text

  function memory_type(kind_code) result(type_id)
    integer(i4), intent(in) :: kind_code
    integer(hid_t) :: type_id
    select case (kind_code)
    case (kind_integer4)
      type_id = h5t_std_i32le
    case (kind_integer8)
      type_id = h5t_std_i64le
    case default
      type_id = h5t_ieee_f64le
    end select
  end function memory_type

  !> A dataspace of this Fortran shape; a scalar for none.
  subroutine make_space(extent, space)
    integer(hsize_t), intent(in) :: extent(:)
    integer(hid_t), intent(out) :: space
    integer :: stat
    if (size(extent) == 0) then
      call h5screate_f(h5s_scalar_f, space, stat)
    else
      call h5screate_simple_f(size(extent), extent, space, stat)
    end if
  end subroutine make_space

  !> Make a dataset and fill it; the groups above it are made too.
  subroutine write_dataset(file, path, name, kind_code, extent, data, errors, file_type)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, name
    integer(i4), intent(in) :: kind_code
    integer(hsize_t), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: data
    type(error_list_type), intent(inout) :: errors
    integer(hid_t), intent(in), optional :: file_type  !! own type (text), in place of kind_code
    integer(hid_t) :: space, dataset, links, type_id
    integer :: stat, ignored

    type_id = memory_type(kind_code)
    if (present(file_type)) type_id = file_type
    call make_space(extent, space)
    call h5pcreate_f(h5p_link_create_f, links, ignored)
    call h5pset_create_inter_group_f(links, 1, ignored)
    call h5dcreate_f(file, name, type_id, space, dataset, stat, lcpl_id=links)
    if (stat < 0) then
      call object_fault(path, name, 'made', errors)
    else
      if (product(extent) > 0) call h5dwrite_f(dataset, type_id, data, stat)
      if (stat < 0) call object_fault(path, name, 'written', errors)
      call h5dclose_f(dataset, ignored)
      if (stat >= 0 .and. ignored < 0) call object_fault(path, name, 'closed', errors)
    end if
    call h5pclose_f(links, ignored)
    call h5sclose_f(space, ignored)
  end subroutine write_dataset

  !> Fill the part of a dataset from index slab(1) on, along the last axis, which is slab(2) long
  !! in all; the first part makes the dataset and the groups above it.
  subroutine write_slab(file, path, name, kind_code, extent, slab, data, errors)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, name
    integer(i4), intent(in) :: kind_code
    integer(hsize_t), intent(in) :: extent(:)  !! of this part
    integer(i8), intent(in) :: slab(2)         !! index from 0, length of the whole
    type(c_ptr), intent(in) :: data
    type(error_list_type), intent(inout) :: errors
    integer(hid_t) :: space, memory, dataset, links
    integer(hsize_t) :: whole(size(extent)), offset(size(extent))
    integer :: stat, ignored

    whole = extent
    whole(size(whole)) = slab(2)
    offset = 0
    offset(size(offset)) = slab(1)
    call make_space(whole, space)
    if (object_exists(file, name)) then
      call h5dopen_f(file, name, dataset, stat)
    else
      call h5pcreate_f(h5p_link_create_f, links, ignored)
      call h5pset_create_inter_group_f(links, 1, ignored)
      call h5dcreate_f(file, name, memory_type(kind_code), space, dataset, stat, lcpl_id=links)
      call h5pclose_f(links, ignored)
    end if
    if (stat < 0) then
      call object_fault(path, name, 'made', errors)
    else
      if (product(extent) > 0) then
        call make_space(extent, memory)
        call h5sselect_hyperslab_f(space, h5s_select_set_f, offset, extent, stat)
        if (stat >= 0) call h5dwrite_f(dataset, memory_type(kind_code), data, stat, memory, space)
        call h5sclose_f(memory, ignored)
      end if
      if (stat < 0) call object_fault(path, name, 'written', errors)
      call h5dclose_f(dataset, ignored)
      if (stat >= 0 .and. ignored < 0) call object_fault(path, name, 'closed', errors)
    end if
    call h5sclose_f(space, ignored)
  end subroutine write_slab

  !> Read a dataset whole; its shape must have been read before.
  subroutine read_dataset(file, path, name, kind_code, data, errors, memory)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, name
    integer(i4), intent(in) :: kind_code
    type(c_ptr), intent(in) :: data
    type(error_list_type), intent(inout) :: errors
    integer(hid_t), intent(in), optional :: memory  !! own type (text), in place of kind_code
    integer(hid_t) :: dataset, type_id
    type(c_ptr) :: address
    integer :: stat, ignored
    type_id = memory_type(kind_code)
    if (present(memory)) type_id = memory
    address = data
    call h5dopen_f(file, name, dataset, stat)
    if (stat >= 0) call h5dread_f(dataset, type_id, address, stat)
    if (stat < 0) call object_fault(path, name, 'read', errors)
    if (stat >= 0) call h5dclose_f(dataset, ignored)
  end subroutine read_dataset

  !> Write an attribute of an object, in place of one of the same name.
  subroutine write_attribute(file, path, object, name, kind_code, extent, data, errors, file_type)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, object, name
    integer(i4), intent(in) :: kind_code
    integer(hsize_t), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: data
    type(error_list_type), intent(inout) :: errors
    integer(hid_t), intent(in), optional :: file_type
    integer(hid_t) :: owner, space, attribute, type_id
    logical :: there
    integer :: stat, ignored

    type_id = memory_type(kind_code)
    if (present(file_type)) type_id = file_type
    call h5oopen_f(file, object, owner, stat)
    if (stat < 0) then
      call object_fault(path, object, 'opened', errors)
      return
    end if
    call h5aexists_f(owner, name, there, stat)
    if (stat >= 0 .and. there) call h5adelete_f(owner, name, stat)
    if (stat >= 0) then
      call make_space(extent, space)
      call h5acreate_f(owner, name, type_id, space, attribute, stat)
      call h5sclose_f(space, ignored)
    end if
    if (stat >= 0) call h5awrite_f(attribute, type_id, data, stat)
    if (stat < 0) call object_fault(path, object//'@'//name, 'written', errors)
    if (stat >= 0) call h5aclose_f(attribute, ignored)
    call h5oclose_f(owner, ignored)
  end subroutine write_attribute

  !> Integers where integers are wanted, reals or integers where reals are?
  logical function holds_kind(attribute, kind_code)
    integer(hid_t), intent(in) :: attribute
    integer(i4), intent(in) :: kind_code
    integer(hid_t) :: type_id
    integer :: class_id, stat
    holds_kind = .false.
    call h5aget_type_f(attribute, type_id, stat)
    if (stat < 0) return
    call h5tget_class_f(type_id, class_id, stat)
    if (stat >= 0) holds_kind = class_id == h5t_integer_f .or. &
                                (class_id == h5t_float_f .and. kind_code == kind_real)
    call h5tclose_f(type_id, stat)
  end function holds_kind

  !> Read an attribute; found is .false. when it is not there or is of another class.
  subroutine read_attribute(file, object, name, kind_code, data, found, memory)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    integer(i4), intent(in) :: kind_code
    type(c_ptr), intent(in) :: data
    logical, intent(out) :: found
    integer(hid_t), intent(in), optional :: memory
    integer(hid_t) :: owner, attribute, type_id
    type(c_ptr) :: address
    integer :: stat, ignored

    address = data
    found = .false.
    type_id = memory_type(kind_code)
    if (present(memory)) type_id = memory
    call h5oopen_f(file, object, owner, stat)
    if (stat < 0) return
    call h5aexists_f(owner, name, found, stat)
    if (stat >= 0 .and. found) then
      call h5aopen_f(owner, name, attribute, stat)
      if (stat >= 0) then
        found = present(memory) .or. holds_kind(attribute, kind_code)
        if (found) call h5aread_f(attribute, type_id, address, stat)
        call h5aclose_f(attribute, ignored)
      end if
      found = found .and. stat >= 0
    end if
    call h5oclose_f(owner, ignored)
  end subroutine read_attribute
end module talus_h5_raw
