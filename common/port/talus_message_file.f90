!> A port message as an HDF5 file: the header as attributes of the root, a dataset for each field.
!!
!! /fields/<name>: real64 (n, c), int64 (n, c) as read by h5py (one component: (n)), text as one
!! string; /order: the names in the order of the message, one a line. Read back, the message has the
!! same words and so the same checksum (manual/port.md). Behind the HDF5 data stands a seal of the
!! whole file, checked before HDF5 opens it.
module talus_message_file
  use, intrinsic :: iso_c_binding, only: c_ptr, c_loc, c_char, c_int, c_null_char
  use hdf5, only: hid_t, hsize_t, size_t, h5fcreate_f, h5fopen_f, &
    h5fclose_f, h5gcreate_f, h5gopen_f, h5gclose_f, h5gget_info_f, h5dcreate_f, h5dopen_f, &
    h5dclose_f, h5dwrite_f, h5dread_f, h5dget_space_f, h5dget_type_f, h5screate_f, &
    h5screate_simple_f, h5sclose_f, h5sget_simple_extent_ndims_f, &
    h5sget_simple_extent_dims_f, h5sget_simple_extent_type_f, h5tcopy_f, &
    h5tset_size_f, h5tset_strpad_f, h5tget_class_f, h5tget_size_f, h5tclose_f, &
    h5acreate_f, h5aopen_f, h5awrite_f, h5aread_f, h5aclose_f, h5f_acc_trunc_f, &
    h5f_acc_rdonly_f, h5s_scalar_f, h5s_null_f, h5t_std_i64le, h5t_ieee_f64le, h5t_c_s1, &
    h5t_str_nullpad_f, h5t_float_f, h5t_integer_f, h5t_string_f
  use talus_kinds, only: i4, i8
  use talus_h5_raw, only: start_library
  use talus_message_buffer, only: message_buffer_type, field_type, kind_real, kind_integer, &
    kind_text, header_words, name_length
  use talus_verbs, only: verb_name
  implicit none
  private
  public :: write_message_file, read_message_file

  !> Attributes of the root, in the order of the header words; t0, t1 and waited are reals. The last
  !! may be left out.
  character(len=8), parameter :: header_name(12) = [character(len=8) :: 'magic', 'protocol', &
    'sequence', 'verb', 'step', 't0', 't1', 'status', 'fields', 'words', 'checksum', 'waited']

  interface
    function c_seal(path) result(code) bind(c, name='talus_file_seal')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: code
    end function c_seal
    function c_check(path) result(code) bind(c, name='talus_file_check')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: code
    end function c_check
  end interface

contains

  !> Write a sealed message; `failed` names the part that could not be written, '' when all was.
  subroutine write_message_file(path, message, failed)
    character(len=*), intent(in) :: path
    class(message_buffer_type), intent(in), target :: message
    character(len=:), allocatable, intent(out) :: failed
    character(len=:), allocatable :: order
    integer(hid_t) :: file, group
    integer :: stat, close_stat
    integer(i4) :: k

    failed = ''
    call start_library()
    call h5fcreate_f(path, h5f_acc_trunc_f, file, stat)
    if (stat < 0) then
      failed = 'the file'
      return
    end if
    call write_header(file, message, stat)
    call h5gcreate_f(file, 'fields', group, close_stat)
    stat = min(stat, close_stat)
    order = ''
    do k = 1, message%field_count
      if (stat >= 0) call write_field(group, message, message%field(k), stat)
      if (stat < 0 .and. failed == '') failed = 'field '//trim(message%field(k)%name)
      order = order//trim(message%field(k)%name)//new_line('a')
    end do
    if (stat >= 0) call write_text(file, 'order', order, stat)
    call h5gclose_f(group, close_stat)
    call h5fclose_f(file, close_stat)
    if (min(stat, close_stat) < 0 .and. failed == '') failed = 'the end of the file'
    if (failed == '') then
      if (c_seal(path//c_null_char) /= 0) failed = 'the seal at the end of the file'
    end if
  end subroutine write_message_file

  subroutine write_header(file, message, stat)
    integer(hid_t), intent(in) :: file
    class(message_buffer_type), intent(in), target :: message
    integer, intent(out) :: stat
    integer(hid_t) :: space, attribute, type
    integer(i8), target :: word
    integer :: k, one_stat

    stat = 0
    call h5screate_f(h5s_scalar_f, space, one_stat)
    do k = 1, size(header_name)
      word = message%word(k)
      type = header_type(k)
      call h5acreate_f(file, trim(header_name(k)), type, space, attribute, one_stat)
      stat = min(stat, one_stat)
      if (stat >= 0) call h5awrite_f(attribute, type, c_loc(word), stat)
      if (stat >= 0) call h5aclose_f(attribute, stat)
      if (stat < 0) exit
    end do
    if (stat >= 0) call write_verb_name(file, space, verb_name(message%verb), stat)
    call h5sclose_f(space, one_stat)
  end subroutine write_header

  integer(hid_t) function header_type(k)
    integer, intent(in) :: k
    header_type = h5t_std_i64le
    if (any(header_name(k) == [character(len=8) :: 't0', 't1', 'waited'])) &
      header_type = h5t_ieee_f64le
  end function header_type

  !> For readers of the file; the number in 'verb' is what counts.
  subroutine write_verb_name(file, space, name, stat)
    integer(hid_t), intent(in) :: file, space
    character(len=*), intent(in), target :: name
    integer, intent(out) :: stat
    integer(hid_t) :: attribute, type
    integer :: close_stat

    call text_type(len(name, size_t), type)
    call h5acreate_f(file, 'verb_name', type, space, attribute, stat)
    if (stat >= 0) then
      call h5awrite_f(attribute, type, c_loc(name), stat)
      call h5aclose_f(attribute, close_stat)
    end if
    call h5tclose_f(type, close_stat)
  end subroutine write_verb_name

  subroutine text_type(length, type)
    integer(size_t), intent(in) :: length
    integer(hid_t), intent(out) :: type
    integer :: stat
    call h5tcopy_f(h5t_c_s1, type, stat)
    call h5tset_size_f(type, length, stat)
    call h5tset_strpad_f(type, h5t_str_nullpad_f, stat)
  end subroutine text_type

  subroutine write_field(group, message, field, stat)
    integer(hid_t), intent(in) :: group
    class(message_buffer_type), intent(in), target :: message
    type(field_type), intent(in) :: field
    integer, intent(out) :: stat
    integer(hid_t) :: space, type, dataset
    integer :: close_stat

    if (field%kind == kind_text) then
      if (field%count == 0) then
        call h5screate_f(h5s_null_f, space, stat)
      else
        call h5screate_f(h5s_scalar_f, space, stat)
      end if
      call text_type(max(1_size_t, int(field%count, size_t)), type)
    else
      if (field%components == 1) then
        call h5screate_simple_f(1, [int(field%count, hsize_t)], space, stat)
      else
        call h5screate_simple_f(2, int([field%components, field%count], hsize_t), space, stat)
      end if
      call h5tcopy_f(merge(h5t_ieee_f64le, h5t_std_i64le, field%kind == kind_real), type, stat)
    end if
    call h5dcreate_f(group, trim(field%name), type, space, dataset, stat)
    if (stat >= 0) then
      if (field%words > 0) &
        call h5dwrite_f(dataset, type, c_loc(message%word(field%at)), stat)
      call h5dclose_f(dataset, close_stat)
      stat = min(stat, close_stat)
    end if
    call h5tclose_f(type, close_stat)
    call h5sclose_f(space, close_stat)
  end subroutine write_field

  subroutine write_text(place, name, text, stat)
    integer(hid_t), intent(in) :: place
    character(len=*), intent(in) :: name
    character(len=*), intent(in), target :: text
    integer, intent(out) :: stat
    integer(hid_t) :: space, type, dataset
    integer :: close_stat

    if (len(text) == 0) then
      call h5screate_f(h5s_null_f, space, stat)
    else
      call h5screate_f(h5s_scalar_f, space, stat)
    end if
    call text_type(max(1_size_t, len(text, size_t)), type)
    call h5dcreate_f(place, name, type, space, dataset, stat)
    if (stat >= 0) then
      if (len(text) > 0) call h5dwrite_f(dataset, type, c_loc(text), stat)
      call h5dclose_f(dataset, close_stat)
    end if
    call h5tclose_f(type, close_stat)
    call h5sclose_f(space, close_stat)
  end subroutine write_text

  !> Rebuild a message; `failed` names the part that could not be read, '' when all was. The header
  !! is taken over unchecked: `parse` judges it.
  subroutine read_message_file(path, message, failed)
    character(len=*), intent(in) :: path
    class(message_buffer_type), intent(inout), target :: message
    character(len=:), allocatable, intent(out) :: failed
    integer(i8) :: header(header_words)
    integer(hid_t) :: file
    integer :: stat

    failed = ''
    select case (c_check(path//c_null_char))
    case (-1)
      failed = 'its bytes are not those that were sealed (damaged, or cut off)'
    case (-2)
      failed = 'it is no file'
    end select
    if (failed /= '') return
    call start_library()
    call h5fopen_f(path, h5f_acc_rdonly_f, file, stat)
    if (stat < 0) then
      failed = 'the file (no HDF5 file, or cut off)'
      return
    end if
    call read_header(file, header, failed)
    call message%start(0)
    if (failed == '') call read_fields(file, message, failed)
    message%word(:header_words) = header
    call h5fclose_f(file, stat)
  end subroutine read_message_file

  subroutine read_header(file, header, failed)
    integer(hid_t), intent(in) :: file
    integer(i8), intent(out) :: header(header_words)
    character(len=:), allocatable, intent(inout) :: failed
    integer(hid_t) :: attribute
    integer(i8), target :: word
    type(c_ptr) :: to
    integer :: k, stat, close_stat

    header = 0
    do k = 1, size(header_name)
      call h5aopen_f(file, trim(header_name(k)), attribute, stat)
      if (stat >= 0) then
        to = c_loc(word)
        call h5aread_f(attribute, header_type(k), to, stat)
        call h5aclose_f(attribute, close_stat)
      end if
      if (stat < 0) then
        if (k < size(header_name)) failed = 'attribute '//trim(header_name(k))
        return
      end if
      header(k) = word
    end do
  end subroutine read_header

  subroutine read_fields(file, message, failed)
    integer(hid_t), intent(in) :: file
    class(message_buffer_type), intent(inout), target :: message
    character(len=:), allocatable, intent(inout) :: failed
    integer(hid_t) :: group
    character(len=:), allocatable :: order
    integer :: stat, first, last, links, storage, highest

    call read_text(file, 'order', order, stat)
    if (stat >= 0) call h5gopen_f(file, 'fields', group, stat)
    if (stat < 0) then
      failed = 'the table of fields'
      return
    end if
    first = 1
    do while (first <= len(order) .and. failed == '')
      last = first + index(order(first:), new_line('a')) - 2
      if (last < first) then
        failed = 'the table of fields'
        exit
      end if
      call read_field(group, order(first:last), message, stat)
      if (stat < 0) failed = 'field '//order(first:last)
      first = last + 2
    end do
    call h5gget_info_f(group, storage, links, highest, stat)
    if (failed == '' .and. links /= message%field_count) failed = 'a field that is not in the table'
    call h5gclose_f(group, stat)
  end subroutine read_fields

  subroutine read_text(place, name, text, stat)
    integer(hid_t), intent(in) :: place
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out), target :: text
    integer, intent(out) :: stat
    integer(hid_t) :: dataset, type
    integer(size_t) :: length
    type(c_ptr) :: to
    integer :: close_stat, class

    call h5dopen_f(place, name, dataset, stat)
    if (stat < 0) return
    call h5dget_type_f(dataset, type, stat)
    call h5tget_class_f(type, class, stat)
    call h5tget_size_f(type, length, stat)
    if (class /= h5t_string_f) stat = -1
    if (stat >= 0 .and. is_empty(dataset)) length = 0
    allocate (character(len=length) :: text)
    if (stat >= 0 .and. length > 0) then
      to = c_loc(text)
      call h5dread_f(dataset, type, to, stat)
    end if
    call h5tclose_f(type, close_stat)
    call h5dclose_f(dataset, close_stat)
  end subroutine read_text

  !> Whether a dataset has no data at all.
  logical function is_empty(dataset)
    integer(hid_t), intent(in) :: dataset
    integer(hid_t) :: space
    integer :: class, stat
    call h5dget_space_f(dataset, space, stat)
    call h5sget_simple_extent_type_f(space, class, stat)
    is_empty = class == h5s_null_f
    call h5sclose_f(space, stat)
  end function is_empty

  !> Append the field of this name; stat < 0 when it is not there or of a foreign type.
  subroutine read_field(group, name, message, stat)
    integer(hid_t), intent(in) :: group
    character(len=*), intent(in) :: name
    class(message_buffer_type), intent(inout), target :: message
    integer, intent(out) :: stat
    integer(hid_t) :: dataset
    integer(i4) :: kind
    integer(i8) :: extent(2), at
    integer(hid_t) :: type
    integer :: close_stat

    stat = -1
    if (len(name) > name_length .or. message%has(name)) return
    call h5dopen_f(group, name, dataset, stat)
    if (stat < 0) return
    call h5dget_type_f(dataset, type, stat)
    call describe(dataset, type, kind, extent)
    if (kind == 0) stat = -1
    if (stat >= 0) then
      call message%add_field(name, kind, extent(1), extent(2), at)
      if (kind == kind_real) call read_data(dataset, h5t_ieee_f64le, message, at, stat)
      if (kind == kind_integer) call read_data(dataset, h5t_std_i64le, message, at, stat)
      if (kind == kind_text) call read_data(dataset, type, message, at, stat)
    end if
    call h5tclose_f(type, close_stat)
    call h5dclose_f(dataset, close_stat)
  end subroutine read_field

  subroutine read_data(dataset, type, message, at, stat)
    integer(hid_t), intent(in) :: dataset, type
    class(message_buffer_type), intent(inout), target :: message
    integer(i8), intent(in) :: at
    integer, intent(out) :: stat
    type(c_ptr) :: to

    stat = 0
    if (message%used < at) return
    to = c_loc(message%word(at))
    call h5dread_f(dataset, type, to, stat)
  end subroutine read_data

  !> Kind (0: none of ours) and shape of a dataset.
  subroutine describe(dataset, type, kind, extent)
    integer(hid_t), intent(in) :: dataset, type
    integer(i4), intent(out) :: kind
    integer(i8), intent(out) :: extent(2)
    integer(hid_t) :: space
    integer(hsize_t) :: dims(2), largest(2)
    integer(size_t) :: bytes
    integer :: class, rank, stat

    kind = 0
    extent = 1
    call h5tget_class_f(type, class, stat)
    call h5tget_size_f(type, bytes, stat)
    if (class == h5t_string_f) then
      kind = kind_text
      extent(2) = int(bytes, i8)
      if (is_empty(dataset)) extent(2) = 0
      return
    end if
    if (bytes /= 8) return
    call h5dget_space_f(dataset, space, stat)
    call h5sget_simple_extent_ndims_f(space, rank, stat)
    if (rank == 1 .or. rank == 2) then
      call h5sget_simple_extent_dims_f(space, dims(:rank), largest(:rank), stat)
      extent(3 - rank:) = int(dims(:rank), i8)
      if (class == h5t_float_f) kind = kind_real
      if (class == h5t_integer_f) kind = kind_integer
    end if
    call h5sclose_f(space, stat)
  end subroutine describe
end module talus_message_file
