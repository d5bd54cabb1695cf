!> Packing files (HDF5, format 'talus-packing', version 1 to 4): read, check, write.
!!
!! Version 2 has grains that are no ellipsoids: /grains/skew and /grains/exponent beside the axes;
!! version 3 has clumps (dem_clump_file), version 4 polyhedra among them.
!! Faults of the file itself come from talus_hdf5; here I230 to I233: version,
!! sizes, groups; those of contacts in dem_packed_contacts.
!! What a grain may be is checked where grains are made (dem_make).
module dem_packing
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_suggest, only: did_you_mean
  use dem_cell, only: folded
  use dem_clump_file, only: packed_clumps_type, read_clumps, put_templates, put_clumps
  use dem_contacts, only: dem_contacts_type
  use dem_packed_contacts, only: read_springs, put_springs, first_missing
  use dem_shape_make, only: octant_frames
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_grains_type, dem_clumps_type, dem_cell_type, kind_ghost, kind_driven, &
    kind_member, kind_free
  implicit none
  private
  public :: dem_packing_type, dem_group_type, read_packing, write_packing, group_index, put_shapes
  public :: drop_grains, empty_packing, packed_besides_type

  character(len=*), parameter :: format_name = 'talus-packing'
  integer(i4), parameter :: format_version = 1  !! ellipsoids alone
  integer(i4), parameter :: shapes_version = 2   !! with skew and exponent
  integer(i4), parameter :: clumps_version = 3   !! with clumps
  integer(i4), parameter :: polyhedra_version = 4  !! with polyhedra

  !> A named group of grains.
  type :: dem_group_type
    character(len=:), allocatable :: name
    integer(i8), allocatable :: id(:)
  end type dem_group_type

  !> What a packing file holds, in the order of the file.
  type :: dem_packing_type
    integer(i4) :: n = 0
    integer(i8), allocatable :: id(:)
    integer(i4), allocatable :: kind(:)   !! 0 free, 1 fixed, 2 driven
    real(wp), allocatable :: x(:, :)      !! (3, n) [m]
    real(wp), allocatable :: quat(:, :)   !! (4, n) w, x, y, z
    real(wp), allocatable :: axes(:, :)   !! (3, n) semi-axes, means of both sides [m]
    real(wp), allocatable :: skew(:, :)   !! (3, n) (upper - lower)/(upper + lower) [-]
    real(wp), allocatable :: exponent(:)  !! (n) 2 for ellipsoids [-]
    real(wp), allocatable :: v(:, :)      !! (3, n) [m/s]
    real(wp), allocatable :: omega(:, :)  !! (3, n) space frame [rad/s]
    type(dem_group_type), allocatable :: group(:)
    type(start_springs_type) :: springs   !! tangential forces of contacts, if the file has them
    type(packed_clumps_type) :: clumps    !! of spheres among the grains
    logical :: has_cell = .false.         !! it was made in a periodic cell
    real(wp) :: cell(3, 3) = 0.0_wp       !! its edges as columns [m]
    real(wp) :: cell_origin(3) = 0.0_wp   !! its corner [m]
  end type dem_packing_type

  !> What some packings have besides grains.
  type :: packed_besides_type
    real(wp), allocatable :: load(:)       !! (grains) surcharge, downwards [N]
    type(dem_clumps_type) :: clumps        !! as they are now
    type(packed_clumps_type) :: templates  !! of the clumps
  end type packed_besides_type

contains

  !> Leave groups, cell and templates of clumps: the grains are in the system now.
  pure subroutine drop_grains(packing)
    type(dem_packing_type), intent(inout) :: packing
    type(dem_packing_type) :: rest
    if (allocated(packing%group)) call move_alloc(packing%group, rest%group)
    rest%clumps = packing%clumps
    rest%has_cell = packing%has_cell
    rest%cell = packing%cell
    rest%cell_origin = packing%cell_origin
    packing = dem_packing_type()
    packing%clumps = rest%clumps
    packing%has_cell = rest%has_cell
    packing%cell = rest%cell
    packing%cell_origin = rest%cell_origin
    if (allocated(rest%group)) call move_alloc(rest%group, packing%group)
  end subroutine drop_grains

  !> A packing without grains.
  pure subroutine empty_packing(packing)
    type(dem_packing_type), intent(inout) :: packing
    packing = dem_packing_type()
    allocate (packing%id(0), packing%kind(0), packing%x(3, 0), packing%quat(4, 0), &
              packing%axes(3, 0), packing%skew(3, 0), packing%exponent(0), packing%v(3, 0), &
              packing%omega(3, 0), packing%group(0))
  end subroutine empty_packing

  !> Read a packing; all faults of the file are found in one go.
  subroutine read_packing(packing, path, errors)
    type(dem_packing_type), intent(inout) :: packing
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4) :: before, version

    before = errors%count
    call file%open(path, errors, format=format_name)
    if (errors%count > before) return
    version = 0
    call file%attr_get('/', 'version', version, errors)
    if (errors%count == before .and. (version < format_version .or. &
                                    version > polyhedra_version)) then
      call errors%add('I230', "'"//path//"' is a packing of version "//str(version)//', '// &
                      str(format_version)//' to '//str(polyhedra_version)//' are read', path, &
                      "make it again with the 'talus pack' of this version")
    end if
    if (errors%count == before) then
      call file%get('/grains/id', packing%id, errors)
      call file%get('/grains/kind', packing%kind, errors)
      call file%get('/grains/x', packing%x, errors)
      call file%get('/grains/quat', packing%quat, errors)
      call file%get('/grains/axes', packing%axes, errors)
      call file%get('/grains/v', packing%v, errors)
      call file%get('/grains/omega', packing%omega, errors)
    end if
    if (errors%count == before) call read_shapes(packing, file, errors)
    if (errors%count == before) call check_sizes(packing, path, errors)
    if (errors%count == before) call read_groups(packing, file, errors)
    if (errors%count == before) call read_clumps(file, packing%clumps, errors)
    packing%has_cell = file%exists('/cell/vectors')
    if (errors%count == before) &
      call read_springs(file, packing%id, packing%has_cell, packing%springs, errors)
    if (errors%count == before .and. packing%has_cell) then
      call file%get_into('/cell/vectors', packing%cell, errors)
      call file%get_into('/cell/origin', packing%cell_origin, errors)
    end if
    call file%close(errors)
  end subroutine read_packing

  !> Skew and exponent where the file has them, else those of ellipsoids.
  subroutine read_shapes(packing, file, errors)
    type(dem_packing_type), intent(inout) :: packing
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (allocated(packing%skew)) deallocate (packing%skew, packing%exponent)
    allocate (packing%skew(3, size(packing%id)), source=0.0_wp)
    allocate (packing%exponent(size(packing%id)), source=2.0_wp)
    if (file%exists('/grains/skew')) call file%get('/grains/skew', packing%skew, errors)
    if (file%exists('/grains/exponent')) &
      call file%get('/grains/exponent', packing%exponent, errors)
  end subroutine read_shapes

  subroutine check_sizes(packing, path, errors)
    type(dem_packing_type), intent(inout) :: packing
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors

    packing%n = size(packing%id)
    if (packing%n == 0) then
      call errors%add('I231', "'"//path//"' holds no grains", path//':/grains/id', &
                      "inspect the file with h5ls, or make it again with 'talus pack'")
      return
    end if
    call check('kind', 1, 1, size(packing%kind))
    call check('x', size(packing%x, 1), 3, size(packing%x, 2))
    call check('quat', size(packing%quat, 1), 4, size(packing%quat, 2))
    call check('axes', size(packing%axes, 1), 3, size(packing%axes, 2))
    call check('v', size(packing%v, 1), 3, size(packing%v, 2))
    call check('omega', size(packing%omega, 1), 3, size(packing%omega, 2))
    call check('skew', size(packing%skew, 1), 3, size(packing%skew, 2))
    call check('exponent', 1, 1, size(packing%exponent))

  contains

    subroutine check(name, width, expected, rows)
      character(len=*), intent(in) :: name
      integer, intent(in) :: width, expected, rows
      if (width == expected .and. rows == packing%n) return
      call errors%add('I232', "'"//path//"': /grains/"//name//' has '//str(rows)//' rows of '// &
                      str(width)//', not '//str(packing%n)//' rows of '//str(expected), &
                      path//':/grains/'//name, 'each grain has one row in every dataset')
    end subroutine check
  end subroutine check_sizes

  subroutine read_groups(packing, file, errors)
    type(dem_packing_type), intent(inout) :: packing
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    integer(i8) :: missing
    integer(i4) :: k, before

    before = errors%count
    call file%names('/groups', names)
    if (allocated(packing%group)) deallocate (packing%group)
    allocate (packing%group(size(names)))
    do k = 1, size(names)
      packing%group(k)%name = names(k)%s
      call file%get('/groups/'//names(k)%s, packing%group(k)%id, errors)
      if (errors%count > before) return
      missing = first_missing(packing%group(k)%id, packing%id)
      if (missing /= 0) then
        call errors%add('I233', "'"//file%path//"': group '"//names(k)%s//"' holds grain "// &
                        str(missing)//', which the packing has not', &
                        file%path//':/groups/'//names(k)%s, 'a group lists ids of /grains/id')
        return
      end if
    end do
  end subroutine read_groups

  !> Position of a group; 0 and a hint (the nearest name, or all) when there is none.
  subroutine group_index(groups, name, k, hint)
    type(dem_group_type), intent(in) :: groups(:)
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: k
    character(len=:), allocatable, intent(out) :: hint
    type(string_type), allocatable :: names(:)
    integer(i4) :: j

    hint = ''
    do k = 1, size(groups)
      if (groups(k)%name == name) return
    end do
    k = 0
    hint = 'the packing has no groups'
    if (size(groups) == 0) return
    allocate (names(size(groups)))
    do j = 1, size(groups)
      names(j)%s = groups(j)%name
    end do
    hint = did_you_mean(name, names, 'groups of the packing:')
  end subroutine group_index

  !> Orientation and shape of grains into a group, as packings and fields have them.
  subroutine put_shapes(file, group, grains, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_grains_type), intent(in) :: grains
    type(error_list_type), intent(inout) :: errors
    if (.not. grains%shapes%in_use) then
      call file%put(group//'/quat', grains%quat, errors)
      call file%put(group//'/axes', grains%axes, errors)
      return
    end if
    call file%put(group//'/quat', octant_frames(grains), errors)
    call file%put(group//'/axes', grains%shapes%axes, errors)
    call file%put(group//'/skew', grains%shapes%skew, errors)
    call file%put(group//'/exponent', grains%shapes%exponent, errors)
  end subroutine put_shapes

  !> Least version of the format that has all that the grains are.
  pure integer(i4) function version_of(grains, besides) result(version)
    type(dem_grains_type), intent(in) :: grains
    type(packed_besides_type), intent(in), optional :: besides
    version = merge(shapes_version, format_version, grains%shapes%in_use)
    if (allocated(grains%clump)) version = clumps_version
    if (.not. present(besides)) return
    if (allocated(besides%templates%corners)) version = polyhedra_version
  end function version_of

  !> Write the present state of grains as a packing; ghosts are written as fixed.
  subroutine write_packing(path, grains, groups, errors, cell, contacts, besides)
    character(len=*), intent(in) :: path
    type(dem_grains_type), intent(in) :: grains
    type(dem_group_type), intent(in) :: groups(:)
    type(error_list_type), intent(inout) :: errors
    type(dem_cell_type), intent(in), optional :: cell  !! centres are folded into it
    type(dem_contacts_type), intent(in), optional :: contacts  !! whose tangential forces go along
    type(packed_besides_type), intent(in), optional :: besides
    type(h5_file_type) :: file
    type(dem_cell_type) :: own
    real(wp), allocatable :: x(:, :)
    integer(i4) :: k, before

    if (present(cell)) own = cell
    before = errors%count
    call file%create(path, errors, format=format_name)
    if (errors%count > before) return
    call file%attr_put('/', 'version', version_of(grains, besides), errors)
    call file%group('/grains', errors)
    call file%put('/grains/id', grains%id, errors)
    call file%put('/grains/kind', merge(1_i4, min(merge(kind_free, grains%kind, &
                                                        grains%kind == kind_member), kind_driven), &
                                        grains%kind == kind_ghost), errors)
    x = folded(own, grains%x)
    if (allocated(grains%clump)) then
      call put_templates(file, besides%templates, errors)
      call put_clumps(file, besides%clumps, grains, own, x, errors)
    end if
    call file%put('/grains/x', x, errors)
    call put_shapes(file, '/grains', grains, errors)
    call file%put('/grains/v', grains%v, errors)
    call file%put('/grains/omega', grains%omega, errors)
    if (present(besides)) then
      if (allocated(besides%load)) call file%put('/grains/surcharge', besides%load, errors)
    end if
    if (own%active) then
      call file%group('/cell', errors)
      call file%put('/cell/vectors', own%vectors, errors)
      call file%put('/cell/origin', own%origin, errors)
    end if
    call file%group('/groups', errors)
    do k = 1, size(groups)
      call file%put('/groups/'//groups(k)%name, groups(k)%id, errors)
    end do
    if (present(contacts)) call put_springs(file, contacts, grains%id, x, own, errors)
    call file%commit(errors)
  end subroutine write_packing
end module dem_packing
