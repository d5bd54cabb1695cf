!> Text in HDF5 files: written as UTF-8 of any length (h5py hands it out as str), read in any form.
!! Reading texts of any length is watched (talus_h5_watch.c): damaged ones hold HDF5 for ever.
module talus_h5_text
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_int64_t, c_loc, &
    c_associated, c_null_char, c_ptr, c_size_t
  use hdf5, only: hid_t, hsize_t, size_t, h5t_c_s1, h5t_cset_utf8_f, h5tcopy_f, h5tget_class_f, &
    h5t_string_f, h5tset_cset_f, h5tclose_f, h5tis_variable_str_f, h5tget_size_f, h5dopen_f, &
      h5dget_type_f, &
    h5dclose_f, h5aopen_f, h5aget_type_f, h5aclose_f, h5oopen_f, h5oclose_f
  use talus_kinds, only: i4
  use talus_errors, only: error_list_type
  use talus_h5_raw, only: write_dataset, read_dataset, write_attribute, read_attribute, kind_real, &
    object_fault, object_shape
  use talus_text, only: string_type
  implicit none
  private
  public :: write_text_dataset, read_text_dataset, write_text_attribute, read_text_attribute

  character(len=*), parameter :: gone = 'error '//'S017'//': HDF5 does not come back from a '// &
    'text in a file that is read at the start'//new_line('a')// &
    '  at checkpoint, packing or mesh'//new_line('a')// &
    '  hint: the file is damaged: take another copy of it, or make it again'// &
    new_line('a')//c_null_char  !! last words, where HDF5 cannot be stopped

  interface
    integer(c_size_t) function c_strlen(address) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value :: address
    end function c_strlen
    integer(c_int) function c_free_memory(address) bind(c, name='H5free_memory')
      import :: c_ptr, c_int
      type(c_ptr), value :: address
    end function c_free_memory
    integer(c_int) function c_set_variable(type_id, size) bind(c, name='H5Tset_size')
      import :: c_int, c_int64_t, c_size_t
      integer(c_int64_t), value :: type_id
      integer(c_size_t), value :: size
    end function c_set_variable
    subroutine watch_begin(text) bind(c, name='talus_c_watch_begin')
      import :: c_char
      character(kind=c_char), intent(in) :: text(*)
    end subroutine watch_begin
    subroutine watch_end() bind(c, name='talus_c_watch_end')
    end subroutine watch_end
  end interface

contains

  !> UTF-8 text of any length.
  subroutine variable_text(type_id)
    integer(hid_t), intent(out) :: type_id
    integer :: stat
    integer(c_int) :: ignored
    call h5tcopy_f(h5t_c_s1, type_id, stat)
    ignored = c_set_variable(type_id, -1_c_size_t)
    call h5tset_cset_f(type_id, h5t_cset_utf8_f, stat)
  end subroutine variable_text

  !> Strings one after the other, each closed by a null, and where each begins.
  subroutine pack_strings(list, letters, start)
    type(string_type), intent(in) :: list(:)
    character(kind=c_char), allocatable, intent(out) :: letters(:)
    integer, allocatable, intent(out) :: start(:)
    integer :: k, m, n
    n = 0
    allocate (start(size(list)))
    do k = 1, size(list)
      start(k) = n + 1
      n = n + len(list(k)%s) + 1
    end do
    allocate (letters(max(n, 1)))
    do k = 1, size(list)
      do m = 1, len(list(k)%s)
        letters(start(k) + m - 1) = list(k)%s(m:m)
      end do
      letters(start(k) + len(list(k)%s)) = c_null_char
    end do
  end subroutine pack_strings

  subroutine write_text_dataset(file, path, name, list, scalar, errors)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, name
    type(string_type), intent(in) :: list(:)
    logical, intent(in) :: scalar  !! list(1) as a scalar
    type(error_list_type), intent(inout) :: errors
    character(kind=c_char), allocatable, target :: letters(:)
    type(c_ptr), target :: address(max(size(list), 1))
    integer, allocatable :: start(:)
    integer(hid_t) :: type_id
    integer(hsize_t) :: extent(1)
    integer :: k, stat

    call pack_strings(list, letters, start)
    do k = 1, size(list)
      address(k) = c_loc(letters(start(k)))
    end do
    extent = size(list)
    call variable_text(type_id)
    call write_dataset(file, path, name, kind_real, extent(:merge(0, 1, scalar)), c_loc(address), &
                       errors, type_id)
    call h5tclose_f(type_id, stat)
  end subroutine write_text_dataset

  subroutine write_text_attribute(file, path, object, name, text, errors)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, object, name, text
    type(error_list_type), intent(inout) :: errors
    type(string_type) :: list(1)
    character(kind=c_char), allocatable, target :: letters(:)
    type(c_ptr), target :: address
    integer, allocatable :: start(:)
    integer(hid_t) :: type_id
    integer(hsize_t) :: none(0)
    integer :: stat

    list(1)%s = text
    call pack_strings(list, letters, start)
    address = c_loc(letters(1))
    call variable_text(type_id)
    call write_attribute(file, path, object, name, kind_real, none, c_loc(address), errors, type_id)
    call h5tclose_f(type_id, stat)
  end subroutine write_text_attribute

  !> Read count strings of a dataset of text.
  subroutine read_text_dataset(file, path, name, count, list, errors)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: path, name
    integer, intent(in) :: count
    type(string_type), allocatable, intent(out) :: list(:)
    type(error_list_type), intent(inout) :: errors
    integer(hid_t) :: object, type_id
    character(kind=c_char), allocatable, target :: letters(:)
    type(c_ptr), allocatable, target :: address(:)
    logical :: variable
    integer(size_t) :: width
    integer(i4) :: before
    integer :: stat

    before = errors%count
    allocate (list(count))
    call h5dopen_f(file, name, object, stat)
    if (stat >= 0) call h5dget_type_f(object, type_id, stat)
    if (stat < 0) then
      call object_fault(path, name, 'read', errors)
      return
    end if
    call text_form(type_id, variable, width)
    if (variable) then
      allocate (address(max(count, 1)))
      call watch_begin(gone)
      call read_dataset(file, path, name, kind_real, c_loc(address), errors, type_id)
      call watch_end()
      if (errors%count == before) call take_variable(address(:count), list)
    else
      allocate (letters(max(width*count, 1_size_t)))
      call read_dataset(file, path, name, kind_real, c_loc(letters), errors, type_id)
      if (errors%count == before) call take_fixed(letters, int(width), list)
    end if
    call h5tclose_f(type_id, stat)
    call h5dclose_f(object, stat)
  end subroutine read_text_dataset

  !> Text of an attribute; found is .false. when it is not there, is no text or is several.
  subroutine read_text_attribute(file, object, name, text, found)
    integer(hid_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    character(len=:), allocatable, intent(out) :: text
    logical, intent(out) :: found
    integer(hid_t) :: owner, attribute, type_id
    integer(hsize_t), allocatable :: extent(:)
    type(string_type) :: list(1)
    type(c_ptr), target :: address(1)
    character(kind=c_char), allocatable, target :: letters(:)
    logical :: variable
    integer(size_t) :: width
    integer :: stat, class_id

    text = ''
    found = .false.
    call object_shape(file, object, extent, stat, name)
    if (stat < 0 .or. product(extent) /= 1) return
    call h5oopen_f(file, object, owner, stat)
    if (stat < 0) return
    call h5aopen_f(owner, name, attribute, stat)
    if (stat >= 0) then
      call h5aget_type_f(attribute, type_id, stat)
      call h5tget_class_f(type_id, class_id, stat)
      call text_form(type_id, variable, width)
      if (class_id /= h5t_string_f) then
        continue
      else if (variable) then
        call watch_begin(gone)
        call read_attribute(file, object, name, kind_real, c_loc(address), found, type_id)
        call watch_end()
        if (found) call take_variable(address, list)
      else
        allocate (letters(max(width, 1_size_t)))
        call read_attribute(file, object, name, kind_real, c_loc(letters), found, type_id)
        if (found) call take_fixed(letters, int(width), list)
      end if
      if (found) text = list(1)%s
      call h5tclose_f(type_id, stat)
      call h5aclose_f(attribute, stat)
    end if
    call h5oclose_f(owner, stat)
  end subroutine read_text_attribute

  !> Of any length, or of a fixed width [byte]?
  subroutine text_form(type_id, variable, width)
    integer(hid_t), intent(in) :: type_id
    logical, intent(out) :: variable
    integer(size_t), intent(out) :: width
    integer :: stat
    call h5tis_variable_str_f(type_id, variable, stat)
    if (stat < 0) variable = .false.
    call h5tget_size_f(type_id, width, stat)
  end subroutine text_form

  !> Take strings from the library's memory and give that back.
  subroutine take_variable(address, list)
    type(c_ptr), intent(in) :: address(:)
    type(string_type), intent(inout) :: list(:)
    character(kind=c_char), pointer :: letters(:)
    integer(c_int) :: ignored
    integer :: k, m, n
    do k = 1, size(list)
      list(k)%s = ''
      if (.not. c_associated(address(k))) cycle
      n = int(c_strlen(address(k)))
      call c_f_pointer(address(k), letters, [n])
      list(k)%s = repeat(' ', n)
      do m = 1, n
        list(k)%s(m:m) = letters(m)
      end do
      ignored = c_free_memory(address(k))
    end do
  end subroutine take_variable

  !> Strings of fixed width, padded by nulls or blanks.
  subroutine take_fixed(letters, width, list)
    character(kind=c_char), intent(in) :: letters(:)
    integer, intent(in) :: width
    type(string_type), intent(inout) :: list(:)
    integer :: k, m
    do k = 1, size(list)
      list(k)%s = ''
      do m = 1, width
        if (letters((k - 1)*width + m) == c_null_char) exit
        list(k)%s = list(k)%s//letters((k - 1)*width + m)
      end do
      list(k)%s = trim(list(k)%s)
    end do
  end subroutine take_fixed
end module talus_h5_text
