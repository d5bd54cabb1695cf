!> HDF5 files: made whole under path.tmp and renamed, read with checks of format, kind, shape.
!!
!! Objects are named by their whole path, '/grains/x'; groups above a dataset are made as needed.
!! Fortran x(3, n) is (n, 3) for h5py. After the first fault of a file further writes do nothing,
!! and calls on a file that is not open do nothing: the fault is in the list already.
!!
!! S003 cannot be read, S004 no HDF5 file, S005 truncated or damaged, S006 another format,
!! S001, S002, S009 cannot be written; I001 no such dataset, I002 shape, I003 kind, I004 attribute,
!! I005 too large for 32 bits, I006 (of checkpoints) beyond physics; N002 NaN or infinity is put.
module talus_hdf5
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: hsize_t
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: reserve_room
  use talus_h5_file, only: h5_base_type
  use talus_h5_raw, only: kind_integer4, kind_integer8, kind_real, write_dataset, write_slab, &
    read_dataset, write_attribute, read_attribute, object_shape
  use talus_h5_text, only: write_text_dataset, read_text_dataset, write_text_attribute, &
    read_text_attribute
  use talus_text, only: str, string_type
  implicit none
  private
  public :: h5_file_type

  !> An HDF5 file with typed access; opening, closing and queries are its parent's.
  type, extends(h5_base_type) :: h5_file_type
  contains
    !> put(name, value, errors): a new dataset; real, integer(i4), integer(i8) of rank 0 to 2,
    !! text, list of text.
    generic :: put => put_int4_0, put_int4_1, put_int4_2, put_int8_0, put_int8_1, &
      put_int8_2, put_real_0, put_real_1, put_real_2, put_text, put_texts
    !> get(name, value, errors): a whole dataset; arrays are allocated to its shape.
    generic :: get => get_int4_0, get_int4_1, get_int4_2, get_int8_0, get_int8_1, &
      get_int8_2, get_real_0, get_real_1, get_real_2, get_text, get_texts
    !> get_into(name, values, errors): a dataset that must have exactly the shape of the array.
    generic :: get_into => into_int4_1, into_int4_2, into_int8_1, into_int8_2, into_real_1, &
      into_real_2
    !> attr_put(object, name, value, errors): scalar real, integers, text, or reals of rank 1.
    generic :: attr_put => attr_put_int4, attr_put_int8, attr_put_real, attr_put_reals, &
      attr_put_text
    !> attr_get(object, name, value, errors): scalar; I004 when it is not there.
    generic :: attr_get => attr_get_int4, attr_get_int8, attr_get_real, attr_get_text
    procedure, private :: put_int4_0
    procedure, private :: put_int4_1
    procedure, private :: put_int4_2
    procedure, private :: put_int8_0
    procedure, private :: put_int8_1
    procedure, private :: put_int8_2
    procedure, private :: put_real_0
    procedure, private :: put_real_1
    procedure, private :: put_real_2
    procedure, private :: put_text
    procedure, private :: put_texts
    procedure, private :: get_int4_0
    procedure, private :: get_int4_1
    procedure, private :: get_int4_2
    procedure, private :: get_int8_0
    procedure, private :: get_int8_1
    procedure, private :: get_int8_2
    procedure, private :: get_real_0
    procedure, private :: get_real_1
    procedure, private :: get_real_2
    procedure, private :: get_text
    procedure, private :: get_texts
    procedure, private :: into_int4_1
    procedure, private :: into_int4_2
    procedure, private :: into_int8_1
    procedure, private :: into_int8_2
    procedure, private :: into_real_1
    procedure, private :: into_real_2
    procedure, private :: attr_put_int4
    procedure, private :: attr_put_int8
    procedure, private :: attr_put_real
    procedure, private :: attr_put_reals
    procedure, private :: attr_put_text
    procedure, private :: attr_get_int4
    procedure, private :: attr_get_int8
    procedure, private :: attr_get_real
    procedure, private :: attr_get_text
  end type h5_file_type

  integer(i8), parameter :: widest = 8_i8  !! bytes of a value

contains

  !> A value, an array, or its part in a slab.
  subroutine put_array(self, name, kind_code, extent, data, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: kind_code
    integer(hsize_t), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: data
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call reserve(self, extent, errors)
    if (self%failed) return
    if (self%slab(2) < 0 .or. size(extent) == 0) then
      call write_dataset(self%id, self%path, name, kind_code, extent, data, errors)
    else
      call write_slab(self%id, self%path, name, kind_code, extent, self%slab, data, errors)
    end if
    call self%note(errors)
    if (kind_code == kind_real) call self%check_finite(name, product(extent), data, errors)
  end subroutine put_array

  !> Room for an array, or for the whole of which the first slab is put, so that a full disk is
  !! found before the file is touched.
  subroutine reserve(self, extent, errors)
    class(h5_file_type), intent(inout) :: self
    integer(hsize_t), intent(in) :: extent(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: values
    integer(i4) :: before
    if (self%spare == 0 .or. self%slab(1) > 0) return
    values = product(extent)
    if (self%slab(2) >= 0) values = product(extent(:size(extent) - 1))*self%slab(2)
    before = errors%count
    call reserve_room(self%actual, widest*values + self%spare, errors)
    self%failed = errors%count > before
  end subroutine reserve

  subroutine put_int4_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer4, [integer(hsize_t) ::], c_loc(value), errors)
  end subroutine put_int4_0

  subroutine put_int4_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in), contiguous, target :: values(:)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer4, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_int4_1

  subroutine put_int4_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(in), contiguous, target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer4, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_int4_2

  subroutine put_int8_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer8, [integer(hsize_t) ::], c_loc(value), errors)
  end subroutine put_int8_0

  subroutine put_int8_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous, target :: values(:)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer8, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_int8_1

  subroutine put_int8_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous, target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_integer8, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_int8_2

  subroutine put_real_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_real, [integer(hsize_t) ::], c_loc(value), errors)
  end subroutine put_real_0

  subroutine put_real_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous, target :: values(:)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_real, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_real_1

  subroutine put_real_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous, target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    call put_array(self, name, kind_real, shape(values, hsize_t), c_loc(values), errors)
  end subroutine put_real_2

  subroutine get_int8_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout), target :: value
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'integer', 0, extent, errors)
    if (.not. allocated(extent)) return
    call read_dataset(self%id, self%path, name, kind_integer8, c_loc(value), errors)
  end subroutine get_int8_0

  subroutine get_int8_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), allocatable, intent(inout), target :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'integer', 1, extent, errors)
    if (.not. allocated(extent)) return
    if (allocated(values)) deallocate (values)
    allocate (values(extent(1)))
    if (size(values) == 0) return
    call read_dataset(self%id, self%path, name, kind_integer8, c_loc(values), errors)
  end subroutine get_int8_1

  subroutine get_int8_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), allocatable, intent(inout), target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'integer', 2, extent, errors)
    if (.not. allocated(extent)) return
    if (allocated(values)) deallocate (values)
    allocate (values(extent(1), extent(2)))
    if (size(values) == 0) return
    call read_dataset(self%id, self%path, name, kind_integer8, c_loc(values), errors)
  end subroutine get_int8_2

  subroutine get_real_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout), target :: value
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'real', 0, extent, errors)
    if (.not. allocated(extent)) return
    call read_dataset(self%id, self%path, name, kind_real, c_loc(value), errors)
    call self%check_numbers(name, 1_i8, [value], errors)
  end subroutine get_real_0

  subroutine get_real_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), allocatable, intent(inout), target :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'real', 1, extent, errors)
    if (.not. allocated(extent)) return
    if (allocated(values)) deallocate (values)
    allocate (values(extent(1)))
    if (size(values) == 0) return
    call read_dataset(self%id, self%path, name, kind_real, c_loc(values), errors)
    call self%check_numbers(name, size(values, kind=i8), values, errors)
  end subroutine get_real_1

  subroutine get_real_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), allocatable, intent(inout), target :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'real', 2, extent, errors)
    if (.not. allocated(extent)) return
    if (allocated(values)) deallocate (values)
    allocate (values(extent(1), extent(2)))
    if (size(values) == 0) return
    call read_dataset(self%id, self%path, name, kind_real, c_loc(values), errors)
    call self%check_numbers(name, size(values, kind=i8), values, errors)
  end subroutine get_real_2

  subroutine get_int4_0(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: long
    integer(i4) :: before
    before = errors%count
    long = value
    call self%get_int8_0(name, long, errors)
    if (errors%count > before) return
    if (fits(self, name, [long], errors)) value = int(long, i4)
  end subroutine get_int4_0

  subroutine get_int4_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), allocatable, intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: long(:)
    call self%get_int8_1(name, long, errors)
    if (.not. allocated(long)) return
    if (.not. fits(self, name, long, errors)) return
    if (allocated(values)) deallocate (values)
    allocate (values(size(long)))
    values = int(long, i4)
  end subroutine get_int4_1

  subroutine get_int4_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), allocatable, intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: long(:, :)
    call self%get_int8_2(name, long, errors)
    if (.not. allocated(long)) return
    if (.not. fits(self, name, reshape(long, [size(long)]), errors)) return
    if (allocated(values)) deallocate (values)
    allocate (values(size(long, 1), size(long, 2)))
    values = int(long, i4)
  end subroutine get_int4_2

  !> Can all of these be held in 32 bits?
  logical function fits(self, name, long, errors)
    class(h5_file_type), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: long(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: worst
    worst = 0
    if (size(long) > 0) worst = maxval(abs(long))
    fits = worst <= huge(1_i4)
    if (.not. fits) call errors%add('I005', "'"//self%path//"': "//name//' holds '//str(worst)// &
                                    ', too large for a 32-bit integer', self%path//':'//name, &
                                    'number from 1 or 0 upwards')
  end function fits

  subroutine into_int4_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: found(:)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_int4_1

  subroutine into_int4_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: found(:, :)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_int4_2

  subroutine into_int8_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: found(:)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_int8_1

  subroutine into_int8_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: found(:, :)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_int8_2

  subroutine into_real_1(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: found(:)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_real_1

  subroutine into_real_2(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: found(:, :)
    call self%get(name, found, errors)
    if (.not. allocated(found)) return
    if (all(shape(found) == shape(values))) then
      values = found
    else
      call self%shape_fault(name, shape(found, i8), shape(values, i8), errors)
    end if
  end subroutine into_real_2

  subroutine put_text(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name, value
    type(error_list_type), intent(inout) :: errors
    type(string_type) :: list(1)
    if (self%silent()) return
    list(1)%s = value
    call write_text_dataset(self%id, self%path, name, list, .true., errors)
    call self%note(errors)
  end subroutine put_text

  subroutine put_texts(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(string_type), intent(in) :: values(:)
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_text_dataset(self%id, self%path, name, values, .false., errors)
    call self%note(errors)
  end subroutine put_texts

  subroutine get_text(self, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: list(:)
    integer(hsize_t), allocatable :: extent(:)
    integer(i4) :: before
    call self%check_dataset(name, 'text', 0, extent, errors)
    if (.not. allocated(extent)) return
    before = errors%count
    call read_text_dataset(self%id, self%path, name, 1, list, errors)
    if (errors%count == before) value = list(1)%s
  end subroutine get_text

  subroutine get_texts(self, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(string_type), allocatable, intent(inout) :: values(:)
    type(error_list_type), intent(inout) :: errors
    integer(hsize_t), allocatable :: extent(:)
    call self%check_dataset(name, 'text', 1, extent, errors)
    if (.not. allocated(extent)) return
    call read_text_dataset(self%id, self%path, name, int(extent(1)), values, errors)
  end subroutine get_texts

  subroutine attr_put_int4(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    integer(i4), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_attribute(self%id, self%path, object, name, kind_integer4, &
                         [integer(hsize_t) ::], c_loc(value), errors)
    call self%note(errors)
  end subroutine attr_put_int4

  subroutine attr_put_int8(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    integer(i8), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_attribute(self%id, self%path, object, name, kind_integer8, &
                         [integer(hsize_t) ::], c_loc(value), errors)
    call self%note(errors)
  end subroutine attr_put_int8

  subroutine attr_put_real(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    real(wp), intent(in), target :: value
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_attribute(self%id, self%path, object, name, kind_real, &
                         [integer(hsize_t) ::], c_loc(value), errors)
    call self%note(errors)
  end subroutine attr_put_real

  subroutine attr_put_reals(self, object, name, values, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    real(wp), intent(in), contiguous, target :: values(:)
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_attribute(self%id, self%path, object, name, kind_real, &
                         shape(values, hsize_t), c_loc(values), errors)
    call self%note(errors)
  end subroutine attr_put_reals

  subroutine attr_put_text(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name, value
    type(error_list_type), intent(inout) :: errors
    if (self%silent()) return
    call write_text_attribute(self%id, self%path, object, name, value, errors)
    call self%note(errors)
  end subroutine attr_put_text

  subroutine attr_get_int8(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    integer(i8), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    integer(i8), target :: found_value
    logical :: found
    if (self%id < 0) return
    found = single(self, object, name)
    if (found) call read_attribute(self%id, object, name, kind_integer8, c_loc(found_value), found)
    if (found) value = found_value
    if (.not. found) call self%attribute_fault(object, name, 'an integer', errors)
  end subroutine attr_get_int8

  subroutine attr_get_real(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    real(wp), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    real(wp), target :: found_value
    logical :: found
    if (self%id < 0) return
    found = single(self, object, name)
    if (found) call read_attribute(self%id, object, name, kind_real, c_loc(found_value), found)
    if (found) value = found_value
    if (.not. found) call self%attribute_fault(object, name, 'a number', errors)
    if (found) call self%check_numbers(object//'@'//name, 1_i8, [value], errors)
  end subroutine attr_get_real

  subroutine attr_get_int4(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    integer(i4), intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: long
    integer(i4) :: before
    before = errors%count
    long = value
    call self%attr_get_int8(object, name, long, errors)
    if (errors%count > before) return
    if (fits(self, object//'@'//name, [long], errors)) value = int(long, i4)
  end subroutine attr_get_int4

  subroutine attr_get_text(self, object, name, value, errors)
    class(h5_file_type), intent(inout) :: self
    character(len=*), intent(in) :: object, name
    character(len=:), allocatable, intent(inout) :: value
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    logical :: found
    if (self%id < 0) return
    call read_text_attribute(self%id, object, name, text, found)
    if (found) then
      value = text
    else
      call self%attribute_fault(object, name, 'text', errors)
    end if
  end subroutine attr_get_text

  !> Is there such an attribute, with one value?
  logical function single(self, object, name)
    class(h5_file_type), intent(in) :: self
    character(len=*), intent(in) :: object, name
    integer(hsize_t), allocatable :: extent(:)
    integer :: stat
    call object_shape(self%id, object, extent, stat, name)
    single = stat >= 0 .and. product(extent) == 1
  end function single
end module talus_hdf5
