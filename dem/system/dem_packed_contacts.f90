!> Contacts in packing files: tangential forces, periodic images that they belong to; loads of a
!! surcharge (manual: files, Packing).
!!
!! In a periodic cell the second grain of a contact is the image at its place plus a whole number of
!! edges, the shift of /contacts/shift; places are those of the file. A file without shifts means
!! the nearest images. Faults I232, I233, I238, I240.
module dem_packed_contacts
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_homogenise, only: inverse_of
  use dem_cell, only: is_periodic
  use dem_contacts, only: dem_contacts_type
  use dem_images, only: most_shift
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_cell_type
  implicit none
  private
  public :: read_springs, put_springs, first_missing, row_of

contains

  !> Tangential forces of contacts and loads of a surcharge, where the file has them.
  subroutine read_springs(file, known, in_cell, springs, errors)
    type(h5_file_type), intent(inout) :: file
    integer(i8), intent(in) :: known(:)  !! ids of the grains
    logical, intent(in) :: in_cell       !! the packing has a cell
    type(start_springs_type), intent(inout) :: springs
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: missing
    integer(i4) :: before

    springs = start_springs_type()
    if (file%exists('/grains/surcharge')) call file%get('/grains/surcharge', springs%load, errors)
    if (allocated(springs%load)) call check_load(springs%load, size(known), file%path, errors)
    if (.not. file%exists('/contacts/ids')) return
    before = errors%count
    call file%get('/contacts/ids', springs%ids, errors)
    call file%get('/contacts/tangential', springs%force, errors)
    if (errors%count > before) return
    associate (ids => springs%ids, force => springs%force)
      if (size(ids, 1) /= 2 .or. size(force, 1) /= 3 .or. size(ids, 2) /= size(force, 2)) then
        call errors%add('I232', "'"//file%path//"': /contacts/ids has "//str(size(ids, 2))// &
                        ' rows of '//str(size(ids, 1))//', /contacts/tangential '// &
                        str(size(force, 2))//' of '//str(size(force, 1)), &
                        file%path//':/contacts', 'each contact has a row of two ids and one of '// &
                        'three numbers')
        return
      end if
      missing = first_missing(pack(ids, .true.), known)
      if (missing /= 0) call errors%add('I233', "'"//file%path//"': a contact is of grain "// &
        str(missing)//', which the packing has not', file%path//':/contacts/ids', &
        'both ids of a contact are among /grains/id')
      if (.not. all(is_finite(force))) call errors%add('I238', "'"//file%path//"': the "// &
        'tangential force of a contact is no finite number', file%path//':/contacts/tangential', &
        'make the packing again, or leave /contacts out')
      springs%given = size(ids, 2)
    end associate
    if (file%exists('/contacts/shift')) call read_shifts(file, in_cell, springs, errors)
  end subroutine read_springs

  !> Which image of the second grain each contact belongs to (I232, I240).
  subroutine read_shifts(file, in_cell, springs, errors)
    type(h5_file_type), intent(inout) :: file
    logical, intent(in) :: in_cell
    type(start_springs_type), intent(inout) :: springs
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: shift(:, :)
    character(len=:), allocatable :: place
    integer(i4) :: before, k

    before = errors%count
    place = file%path//':/contacts/shift'
    call file%get('/contacts/shift', shift, errors)
    if (errors%count > before) return
    if (size(shift, 1) /= 3 .or. size(shift, 2) /= springs%given) then
      call errors%add('I232', "'"//file%path//"': /contacts/shift has "//str(size(shift, 2))// &
                      ' rows of '//str(size(shift, 1))//', not '//str(springs%given)// &
                      ' rows of 3', place, 'each contact has a row of three whole numbers')
      return
    end if
    k = findloc(any(shift < -most_shift .or. shift > most_shift, 1), .true., 1)
    if (k > 0) call errors%add('I240', "'"//file%path//"': contact "//str(k)//' is with an '// &
      'image '//str(shift(1, k))//', '//str(shift(2, k))//', '//str(shift(3, k))// &
      ' edges away, more than '//str(most_shift), place, &
      'edges from the second grain to the image that is touched: -1, 0 or 1 as a rule')
    if (k == 0 .and. .not. in_cell .and. any(shift /= 0)) call errors%add('I240', "'"// &
      file%path//"': contacts over faces, but no cell", place, &
      'give /cell/vectors, or take the contacts whose shift is not 0 out')
    if (errors%count == before) springs%shift = int(shift, i4)
  end subroutine read_shifts

  subroutine check_load(load, n, path, errors)
    real(wp), intent(in) :: load(:)
    integer(i4), intent(in) :: n
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    if (size(load) /= n) then
      call errors%add('I232', "'"//path//"': /grains/surcharge has "//str(size(load))// &
                      ' rows, not '//str(n), path//':/grains/surcharge', &
                      'each grain has one row in every dataset')
    else if (.not. all(is_finite(load))) then
      call errors%add('I238', "'"//path//"': the surcharge of a grain is no finite number", &
                      path//':/grains/surcharge', 'make the packing again, or leave it out')
    end if
  end subroutine check_load

  !> First of some ids that is not among the known ones, 0 if all are.
  pure integer(i8) function first_missing(ids, known) result(missing)
    integer(i8), intent(in) :: ids(:), known(:)
    logical, allocatable :: there(:)
    integer(i8) :: low, high, k

    missing = 0
    if (size(ids) == 0) return
    low = minval(known)
    high = maxval(known)
    if (high - low > 64_i8*size(known) + 1000000_i8) then
      do k = 1, size(ids)
        if (any(known == ids(k))) cycle
        missing = ids(k)
        return
      end do
      return
    end if
    allocate (there(low:high), source=.false.)
    do k = 1, size(known)
      there(known(k)) = .true.
    end do
    do k = 1, size(ids)
      if (ids(k) >= low .and. ids(k) <= high) then
        if (there(ids(k))) cycle
      end if
      missing = ids(k)
      return
    end do
  end function first_missing

  !> What tangential springs of contacts between grains bear, without the forces of dashpots; in a
  !! periodic cell with shifts.
  subroutine put_springs(file, list, id, x, cell, errors)
    type(h5_file_type), intent(inout) :: file
    type(dem_contacts_type), intent(in) :: list
    integer(i8), intent(in) :: id(:)     !! of the grains, ascending
    real(wp), intent(in) :: x(:, :)      !! (3, grains) as the file has them [m]
    type(dem_cell_type), intent(in) :: cell
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: force(:, :)
    integer(i4), allocatable :: rows(:)
    integer(i4) :: k

    rows = pack([(k, k=1, list%n)], list%ids(1, :list%n) > 0)
    force = list%spring(:, rows)
    do k = 1, size(rows)
      associate (normal => list%normal(:, rows(k)))
        force(:, k) = force(:, k) - dot_product(force(:, k), normal)*normal
      end associate
    end do
    call file%group('/contacts', errors)
    call file%put('/contacts/ids', list%ids(:, rows), errors)
    call file%put('/contacts/tangential', force, errors)
    if (is_periodic(cell)) &
      call file%put('/contacts/shift', shifts_of(list%ids(:, rows), list%branch(:, rows), id, x, &
                                                 cell), errors)
  end subroutine put_springs

  !> Whole edges (3, contacts) that branches go beyond the places of both grains.
  pure function shifts_of(ids, branch, id, x, cell) result(shift)
    integer(i8), intent(in) :: ids(:, :)     !! (2, contacts)
    real(wp), intent(in) :: branch(:, :)     !! (3, contacts) to the image [m]
    integer(i8), intent(in) :: id(:)
    real(wp), intent(in) :: x(:, :)
    type(dem_cell_type), intent(in) :: cell
    integer(i4), allocatable :: shift(:, :)
    real(wp) :: inverse(3, 3), apart(3)
    integer(i4) :: k

    allocate (shift(3, size(ids, 2)))
    inverse = inverse_of(cell%vectors)
    do k = 1, size(ids, 2)
      apart = x(:, row_of(id, ids(2, k))) - x(:, row_of(id, ids(1, k)))
      shift(:, k) = merge(nint(matmul(inverse, branch(:, k) - apart)), 0, cell%periodic)
    end do
  end function shifts_of

  !> Place of an id in an ascending list that has it.
  pure integer(i4) function row_of(id, wanted) result(low)
    integer(i8), intent(in) :: id(:), wanted
    integer(i4) :: high, middle
    low = 1
    high = size(id)
    do while (low < high)
      middle = (low + high)/2
      if (id(middle) < wanted) then
        low = middle + 1
      else
        high = middle
      end if
    end do
  end function row_of
end module dem_packed_contacts
