!> Opening, closing and querying an HDF5 file: the parent of talus_hdf5's typed access.
module talus_h5_file
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_ptr
  use hdf5, only: hid_t, hsize_t, size_t, h5fcreate_f, h5fopen_f, h5fclose_f, h5fflush_f, &
    h5fis_hdf5_f, h5f_acc_trunc_f, h5f_acc_rdonly_f, h5f_acc_rdwr_f, h5f_scope_global_f, &
    h5gcreate_f, h5gclose_f, h5gget_info_by_name_f, h5lget_name_by_idx_f, h5ldelete_f, &
    h5pcreate_f, h5pclose_f, h5pset_create_inter_group_f, h5p_link_create_f, h5p_file_create_f, &
    h5pset_userblock_f, h5_index_name_f, h5_iter_inc_f
  use talus_kinds, only: i4, i8, wp
  use talus_errors, only: error_list_type
  use talus_files, only: file_exists, folder_exists, file_size, remove_file, rename_file, &
    sync_file, sync_folder
  use talus_file_checksum, only: write_checksum, check_checksum, room_for_checksum
  use talus_h5_raw, only: start_library, library_reason, object_exists, object_shape, &
    dataset_class, object_fault
  use talus_h5_text, only: read_text_attribute, write_text_attribute
  use talus_text, only: str, string_type, is_finite
  implicit none
  private
  public :: h5_base_type, free_place

  !> A file that is open, or not (id = -1).
  type :: h5_base_type
    integer(hid_t) :: id = -1                 !! HDF5's handle
    character(len=:), allocatable :: path     !! name that the user knows
    character(len=:), allocatable :: actual   !! name now: path.tmp until commit
    logical :: writes = .false.               !! open for writing
    logical :: failed = .false.               !! a write has failed: no more are tried
    integer(i8) :: spare = 0_i8               !! bytes that stay reserved behind the file, for
                                              !! what HDF5 adds to arrays; 0: none, nor for these
    logical :: checked = .false.              !! it has a checksum, or gets one with its name
    logical :: bounded = .false.              !! numbers that are none or beyond physics are faults
    logical :: tainted = .false.              !! NaN or infinity was put (and reported once)
    integer(i8) :: slab(2) = [0_i8, -1_i8]    !! arrays that are put now begin at this index from 0
                                              !! of datasets of this length; < 0: they are whole
  contains
    procedure :: create
    procedure :: open => open_file
    procedure :: commit
    procedure :: close => close_file
    procedure :: discard
    procedure :: is_open
    procedure :: flush => flush_file
    procedure :: group
    procedure :: delete
    procedure :: exists
    procedure :: shape => dataset_shape
    procedure :: class_of
    procedure :: names
    procedure :: silent
    procedure :: note
    procedure :: check_dataset
    procedure :: check_numbers
    procedure :: check_finite
    procedure :: shape_fault
    procedure :: attribute_fault
  end type h5_base_type

  real(wp), parameter :: densest = 2000.0_wp  !! values a byte, packed (deflate: 1032 bytes a byte)

  real(wp), parameter :: beyond_physics = 1.0e51_wp  !! as in decks (D016)

contains

  !> Make a new file under path.tmp; commit gives it its name and its checksum. format becomes its
  !! attribute.
  subroutine create(self, path, errors, format, grows, own)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=*), intent(in), optional :: format
    logical, intent(in), optional :: grows  !! .true.: added to later, so without a checksum
    logical, intent(in), optional :: own    !! .true.: what it replaces is of this run
    integer(hid_t) :: layout
    integer :: stat, ignored
    logical :: look

    call start_library()
    self%path = path
    self%actual = path//'.tmp'
    self%writes = .true.
    self%id = -1
    look = present(format)
    if (present(own)) look = look .and. .not. own
    if (look) then
      if (.not. free_place(path, format, errors)) then
        self%failed = .true.
        return
      end if
    end if
    self%failed = .false.
    self%spare = 0
    self%bounded = .false.
    self%tainted = .false.
    self%checked = .true.
    if (present(grows)) self%checked = .not. grows
    call h5pcreate_f(h5p_file_create_f, layout, ignored)
    if (self%checked) call h5pset_userblock_f(layout, int(room_for_checksum, hsize_t), ignored)
    call h5fcreate_f(self%actual, h5f_acc_trunc_f, self%id, stat, creation_prp=layout)
    if (stat < 0) then
      self%id = -1
      self%failed = .true.
      call object_fault(path, 'the file', 'made', errors)
    else if (present(format)) then
      call write_text_attribute(self%id, path, '/', 'format', format, errors)
      call self%note(errors)
    end if
    call h5pclose_f(layout, ignored)
  end subroutine create

  !> Is there no file whose content is of another format (S016)? A damaged one has none.
  logical function free_place(path, format, errors)
    character(len=*), intent(in) :: path, format
    type(error_list_type), intent(inout) :: errors
    type(error_list_type) :: ignored
    type(h5_base_type) :: old
    character(len=:), allocatable :: seen
    logical :: found

    free_place = .true.
    if (.not. file_exists(path)) return
    call old%open(path, ignored)
    if (.not. old%is_open()) return
    call read_text_attribute(old%id, '/', 'format', seen, found)
    free_place = found
    if (found) free_place = seen == format
    call old%close(ignored)
    if (free_place) return
    if (.not. found) seen = 'unknown'
    call errors%add('S016', "'"//path//"' would be overwritten: it is no "//format// &
                    " file, its format is '"//seen//"'", path, &
                    'rename it or the deck, or write elsewhere with --output=DIR')
  end function free_place

  !> Open a file that is there and as it was written (if it has a checksum); with format given its
  !! attribute must be this one.
  subroutine open_file(self, path, errors, format, write)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=*), intent(in), optional :: format
    logical, intent(in), optional :: write  !! .true.: datasets will be added in place
    integer :: stat

    call start_library()
    self%path = path
    self%actual = path
    self%writes = .false.
    self%failed = .false.
    self%spare = 0
    self%bounded = .false.
    self%id = -1
    if (present(write)) self%writes = write
    if (.not. looks_right(path, self%checked, errors)) return
    call h5fopen_f(path, merge(h5f_acc_rdwr_f, h5f_acc_rdonly_f, self%writes), self%id, stat)
    if (stat < 0) then
      self%id = -1
      call open_fault(path, library_reason(), errors)
      return
    end if
    if (present(format)) call check_format(self, format, errors)
  end subroutine open_file

  !> There, not a folder, not empty, with its checksum if it has one, with HDF5's signature?
  logical function looks_right(path, checked, errors)
    character(len=*), intent(in) :: path
    logical, intent(out) :: checked  !! it has a checksum
    type(error_list_type), intent(inout) :: errors
    logical :: is_hdf5
    integer(i4) :: before
    integer :: stat
    looks_right = .false.
    checked = .false.
    before = errors%count
    if (.not. file_exists(path)) then
      call errors%add('S003', "'"//path//"' cannot be read: "// &
                      trim(merge('it is a folder       ', 'there is no such file', &
                                 folder_exists(path))), path, 'check the name and the folder')
      return
    end if
    if (file_size(path) == 0) then
      call errors%add('S005', "'"//path//"' is empty", path, 'make it again')
      return
    end if
    call check_checksum(path, checked, errors)
    if (errors%count > before) return
    call h5fis_hdf5_f(path, is_hdf5, stat)
    if (stat < 0) then
      call open_fault(path, library_reason(), errors)
    else if (.not. is_hdf5) then
      call errors%add('S004', "'"//path//"' is not an HDF5 file", path, &
                      "make packings with 'talus pack' and meshes with 'talus mesh'")
    else
      looks_right = .true.
    end if
  end function looks_right

  subroutine open_fault(path, reason, errors)
    character(len=*), intent(in) :: path, reason
    type(error_list_type), intent(inout) :: errors
    if (index(reason, 'ermission') > 0) then
      call errors%add('S003', "'"//path//"' cannot be read: "//reason, path, &
                      'check the permissions')
    else
      call errors%add('S005', "'"//path//"' is truncated or damaged ("//str(file_size(path))// &
                      ' bytes): '//reason, path, 'make it again or use an older one')
    end if
  end subroutine open_fault

  subroutine check_format(self, format, errors)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: format
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: seen, message
    logical :: found

    call read_text_attribute(self%id, '/', 'format', seen, found)
    if (found .and. seen == format) return
    message = "'"//self%path//"' is no "//format//' file: '
    if (found) then
      message = message//"its attribute 'format' is '"//seen//"'"
    else
      message = message//"it has no attribute 'format'"
    end if
    call errors%add('S006', message, self%path, "it must say format = '"//format//"'")
    call self%close(errors)
  end subroutine check_format

  !> Give a new file its name: flushed, closed, with its checksum, synced, renamed. After a fault
  !! an older file of this name is still there, untouched.
  subroutine commit(self, errors)
    class(h5_base_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before

    before = errors%count
    call self%close(errors)
    if (self%failed .or. errors%count > before) then
      call self%discard()
      return
    end if
    if (self%actual == self%path) return
    if (self%checked) call write_checksum(self%actual, errors)
    if (errors%count == before) call sync_file(self%actual, errors)
    if (errors%count == before) call rename_file(self%actual, self%path, errors)
    if (errors%count == before) call sync_folder(self%path, errors)
    if (errors%count > before) call self%discard()
    self%actual = self%path
  end subroutine commit

  !> Close; a file that was written to is flushed first, and that may fail.
  subroutine close_file(self, errors)
    class(h5_base_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer :: stat
    if (self%id < 0) return
    if (self%writes .and. .not. self%failed) call self%flush(errors)
    call h5fclose_f(self%id, stat)
    self%id = -1
    if (stat < 0 .and. .not. self%failed) then
      call object_fault(self%path, 'the file', 'closed', errors)
      self%failed = .true.
    end if
  end subroutine close_file

  !> Close and forget; the unfinished path.tmp is removed.
  subroutine discard(self)
    class(h5_base_type), intent(inout) :: self
    integer :: stat
    if (self%id >= 0) call h5fclose_f(self%id, stat)
    self%id = -1
    if (.not. allocated(self%actual)) return
    if (self%actual /= self%path) call remove_file(self%actual)
  end subroutine discard

  pure logical function is_open(self)
    class(h5_base_type), intent(in) :: self
    is_open = self%id >= 0
  end function is_open

  !> Bring all that was written to the file.
  subroutine flush_file(self, errors)
    class(h5_base_type), intent(inout) :: self
    type(error_list_type), intent(inout) :: errors
    integer :: stat
    if (self%silent()) return
    call h5fflush_f(self%id, h5f_scope_global_f, stat)
    if (stat >= 0) return
    call object_fault(self%path, 'the file', 'written', errors)
    self%failed = .true.
  end subroutine flush_file

  !> Make a group, with those above it; one that is there already is no fault.
  subroutine group(self, name, errors)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(error_list_type), intent(inout) :: errors
    integer(hid_t) :: links, made
    integer :: stat, ignored
    if (self%silent()) return
    if (object_exists(self%id, name)) return
    call h5pcreate_f(h5p_link_create_f, links, ignored)
    call h5pset_create_inter_group_f(links, 1, ignored)
    call h5gcreate_f(self%id, name, made, stat, lcpl_id=links)
    if (stat < 0) then
      call object_fault(self%path, name, 'made', errors)
      self%failed = .true.
    else
      call h5gclose_f(made, ignored)
    end if
    call h5pclose_f(links, ignored)
  end subroutine group

  !> Remove a dataset or a group with all in it; its room in the file is not given back.
  subroutine delete(self, name, errors)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(error_list_type), intent(inout) :: errors
    integer :: stat
    if (self%silent()) return
    call h5ldelete_f(self%id, name, stat)
    if (stat < 0) call object_fault(self%path, name, 'removed', errors)
    call self%note(errors)
  end subroutine delete

  !> Is there a dataset or group of this path?
  logical function exists(self, name)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    exists = .false.
    if (self%id >= 0) exists = object_exists(self%id, name)
  end function exists

  !> Fortran shape of a dataset; size 0 for a scalar and for what is not there.
  function dataset_shape(self, name) result(extent)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), allocatable :: extent(:)
    integer(hsize_t), allocatable :: found(:)
    integer :: stat
    allocate (extent(0))
    if (.not. self%exists(name)) return
    call object_shape(self%id, name, found, stat)
    if (stat >= 0) extent = int(found, i8)
  end function dataset_shape

  !> 'integer', 'real', 'text', 'other', or '' when there is no dataset of this path.
  function class_of(self, name) result(class_name)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: class_name
    class_name = ''
    if (self%exists(name)) class_name = dataset_class(self%id, name)
  end function class_of

  !> Names in a group, sorted; none when there is no such group.
  subroutine names(self, group_name, list)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: group_name
    type(string_type), allocatable, intent(out) :: list(:)
    character(len=1024) :: name
    integer(hsize_t) :: k
    integer(size_t) :: length
    integer :: storage, link_count, order, stat

    link_count = 0
    if (self%id >= 0) call h5gget_info_by_name_f(self%id, group_name, storage, link_count, order, &
                                                 stat)
    if (self%id < 0 .or. stat < 0) link_count = 0
    allocate (list(link_count))
    do k = 1, link_count
      call h5lget_name_by_idx_f(self%id, group_name, h5_index_name_f, h5_iter_inc_f, k - 1, name, &
                                stat, length)
      list(k)%s = name(:min(int(length), len(name)))
    end do
  end subroutine names

  !> No use in writing on?
  pure logical function silent(self)
    class(h5_base_type), intent(in) :: self
    silent = self%id < 0 .or. self%failed
  end function silent

  !> Remember that the last write failed.
  subroutine note(self, errors)
    class(h5_base_type), intent(inout) :: self
    type(error_list_type), intent(in) :: errors
    if (errors%count == 0) return
    if (errors%item(errors%count)%code == 'N002') return
    if (index(errors%item(errors%count)%place, self%path) == 1) self%failed = .true.
  end subroutine note

  !> Is there a dataset of this class and rank? extent stays unallocated after a fault.
  subroutine check_dataset(self, name, class_name, rank, extent, errors)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: class_name  !! 'integer', 'real' (integers do) or 'text'
    integer, intent(in) :: rank                 !! rank 0 also accepts one value of rank 1
    integer(hsize_t), allocatable, intent(out) :: extent(:)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: found(:)
    character(len=:), allocatable :: seen
    integer :: stat

    if (self%id < 0) return
    seen = self%class_of(name)
    if (seen == '') then
      call errors%add('I001', "'"//self%path//"' has no dataset "//name, self%path//':'//name, &
                      'h5ls -r shows what it has')
    else if (seen /= class_name .and. .not. (class_name == 'real' .and. seen == 'integer')) then
      call errors%add('I003', "'"//self%path//"': "//name//' holds values of kind '//seen// &
                      ', not '//class_name, self%path//':'//name, 'write it as '//class_name)
    else
      call object_shape(self%id, name, found, stat)
      if (product(real(found, wp)) > densest*real(file_size(self%path), wp)) then
        call errors%add('S005', "'"//self%path//"' is damaged: "//name//' has the shape '// &
                        shape_text(int(found, i8))//', more than '//str(file_size(self%path))// &
                        ' bytes can hold', self%path//':'//name, &
                        'make it again or use an older one')
      else if (size(found) == rank .or. (rank == 0 .and. product(found) == 1)) then
        call move_alloc(found, extent)
      else
        call errors%add('I002', "'"//self%path//"': "//name//' has '//str(size(found))// &
                        ' dimensions, '//shape_text(int(found, i8))//', not '//str(rank), &
                        self%path//':'//name, 'see the file formats in the manual')
      end if
    end if
  end subroutine check_dataset

  !> Of a bounded file: are all numbers finite and within physics? huge(1.0) stands for no limit.
  subroutine check_numbers(self, name, count, values, errors)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: count
    real(wp), intent(in) :: values(count)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: k
    if (.not. self%bounded) return
    do k = 1, count
      if (.not. is_finite(values(k))) exit
      if (abs(values(k)) >= beyond_physics .and. abs(values(k)) < huge(1.0_wp)) exit
    end do
    if (k > count) return
    call errors%add('I006', "'"//self%path//"': "//name//' holds '//str(values(k))// &
                    ', no number that a run leaves', self%path//':'//name, &
                    'the file is damaged or was changed: make it again or use an older one')
  end subroutine check_numbers

  !> Are numbers that were put finite? If not: fault N002, once a file. A file with a checksum has
  !! failed then, so that a checkpoint without NaN is kept; in others the values can be looked at.
  subroutine check_finite(self, name, count, data, errors)
    class(h5_base_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(hsize_t), intent(in) :: count
    type(c_ptr), intent(in) :: data  !! reals
    type(error_list_type), intent(inout) :: errors
    real(wp), pointer :: values(:)
    integer(i8) :: k
    if (self%tainted .or. count == 0) return
    call c_f_pointer(data, values, [count])
    do k = 1, count  ! no array of logicals
      if (.not. is_finite(values(k))) exit
    end do
    if (k > count) return
    self%tainted = .true.
    if (self%checked) self%failed = .true.
    call errors%add('N002', "'"//self%path//"': value "//str(k)//' of '//str(count)//' of '// &
                    name//' is '//str(values(k)), self%path//':'//name, 'a time step too long ' &
                    //'or a material too weak for its loads are the usual causes')
  end subroutine check_finite

  subroutine shape_fault(self, name, seen, wanted, errors)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: seen(:), wanted(:)  !! Fortran shapes
    type(error_list_type), intent(inout) :: errors
    call errors%add('I002', "'"//self%path//"': "//name//' has the shape '//shape_text(seen)// &
                    ', not '//shape_text(wanted), self%path//':'//name, &
                    'see the file formats in the manual')
  end subroutine shape_fault

  subroutine attribute_fault(self, object, name, kind_name, errors)
    class(h5_base_type), intent(in) :: self
    character(len=*), intent(in) :: object, name, kind_name
    type(error_list_type), intent(inout) :: errors
    call errors%add('I004', "'"//self%path//"': "//object//" has no attribute '"//name// &
                    "' that is "//kind_name, self%path//':'//object//'@'//name, &
                    'see the file formats in the manual')
  end subroutine attribute_fault

  !> Shape as h5py shows it: '(2760, 3)'.
  pure function shape_text(extent) result(text)
    integer(i8), intent(in) :: extent(:)
    character(len=:), allocatable :: text
    integer :: k
    text = '('
    do k = size(extent), 1, -1
      text = text//str(extent(k))
      if (k > 1) text = text//', '
    end do
    text = text//')'
  end function shape_text
end module talus_h5_file
