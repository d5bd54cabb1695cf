!> Clumps of packing files: templates and where they stand (manual/files.md, version 3). Faults
!! I281, I282.
module dem_clump_file
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_vectors, only: cross
  use dem_ellipsoid, only: rotation_of, quaternion_product
  use dem_state, only: dem_clumps_type, dem_grains_type, dem_cell_type
  use dem_cell, only: folded
  implicit none
  private
  public :: packed_clumps_type, read_clumps, put_templates, put_clumps, clump_origins, clump_frames

  !> Templates and clumps as a file has them.
  type :: packed_clumps_type
    integer(i4) :: n = 0                         !! clumps
    integer(i4), allocatable :: spheres(:)       !! (templates) number of spheres
    real(wp), allocatable :: centre(:, :)        !! (3, spheres of all templates) [m]
    real(wp), allocatable :: radius(:)           !! (spheres of all templates) [m]
    integer(i4), allocatable :: corners(:)       !! (spheres of all templates) 0: a sphere of a
                                                 !! clump; of polyhedra 1: a vertex, 2: an edge,
                                                 !! more: a face; not there without polyhedra
    integer(i4), allocatable :: corner(:)        !! these corners, vertices of their template
    real(wp), allocatable :: volume(:)           !! (templates), if given [m^3]
    real(wp), allocatable :: middle(:, :)        !! (3, templates) centre of mass, if given [m]
    real(wp), allocatable :: inertia(:, :)       !! (6, templates) about it for density 1,
                                                 !! xx yy zz xy yz zx, if given [m^5]
    integer(i8), allocatable :: first(:)         !! (n) id of the first member
    integer(i4), allocatable :: template(:)      !! (n) from 1
    real(wp), allocatable :: scale(:)            !! (n) of the template's lengths [-]
    real(wp), allocatable :: x(:, :)             !! (3, n) origin of the template [m]
    real(wp), allocatable :: quat(:, :)          !! (4, n) template to space
    real(wp), allocatable :: v(:, :)             !! (3, n) of the centre of mass [m/s]
    real(wp), allocatable :: omega(:, :)         !! (3, n) in space [rad/s]
  end type packed_clumps_type

contains

  !> Templates and clumps, if the file has them.
  subroutine read_clumps(file, clumps, errors)
    type(h5_file_type), intent(inout) :: file
    type(packed_clumps_type), intent(out) :: clumps
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: before

    if (.not. file%exists('/clumps/first')) return
    before = errors%count
    call file%get('/templates/spheres', clumps%spheres, errors)
    call file%get('/templates/centre', clumps%centre, errors)
    call file%get('/templates/radius', clumps%radius, errors)
    if (file%exists('/templates/corners')) then
      call file%get('/templates/corners', clumps%corners, errors)
      call file%get('/templates/corner', clumps%corner, errors)
    end if
    if (file%exists('/templates/volume')) then
      call file%get('/templates/volume', clumps%volume, errors)
      call file%get('/templates/middle', clumps%middle, errors)
      call file%get('/templates/inertia', clumps%inertia, errors)
    end if
    call file%get('/clumps/first', clumps%first, errors)
    call file%get('/clumps/template', clumps%template, errors)
    call file%get('/clumps/scale', clumps%scale, errors)
    call file%get('/clumps/x', clumps%x, errors)
    call file%get('/clumps/quat', clumps%quat, errors)
    call file%get('/clumps/v', clumps%v, errors)
    call file%get('/clumps/omega', clumps%omega, errors)
    if (errors%count > before) return
    clumps%n = size(clumps%first, kind=i4)
    call check_templates(clumps, file%path, errors)
    if (errors%count == before .and. allocated(clumps%corners)) &
      call check_corners(clumps, file%path, errors)
    if (errors%count == before) call check_clumps(clumps, file%path, errors)
  end subroutine read_clumps

  !> Sizes and values of templates (I281).
  subroutine check_templates(c, path, errors)
    type(packed_clumps_type), intent(in) :: c
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    integer :: t

    t = size(c%spheres)
    what = ''
    if (any(c%spheres < 1) .or. sum(c%spheres) /= size(c%radius)) then
      what = str(size(c%radius))//' radii for '//str(sum(c%spheres))//' spheres'
    else if (size(c%centre, 1) /= 3 .or. size(c%centre, 2) /= size(c%radius)) then
      what = str(size(c%centre, 2))//' centres for '//str(size(c%radius))//' radii'
    else if (.not. (all(is_finite(reshape(c%centre, [size(c%centre)]))) .and. &
                    all(c%radius > 0.0_wp .and. is_finite(c%radius)))) then
      what = 'a centre or radius that is no length'
    else if (allocated(c%volume)) then
      if (size(c%volume) /= t .or. any(shape(c%middle) /= [3, t]) .or. &
          any(shape(c%inertia) /= [6, t])) then
        what = 'mass properties of other templates'
      else if (.not. (all(c%volume > 0.0_wp) .and. all(c%inertia(:3, :) > 0.0_wp))) then
        what = 'a volume or moment of inertia that is not above 0'
      end if
    end if
    if (len(what) > 0) call errors%add('I281', "'"//path//"' has "//what, path//':/templates', &
                                       'make the packing again')
  end subroutine check_templates

  !> Sizes and values of corners (I284).
  subroutine check_corners(c, path, errors)
    type(packed_clumps_type), intent(in) :: c
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    what = ''
    if (size(c%corners) /= size(c%radius)) then
      what = str(size(c%corners))//' numbers of corners for '//str(size(c%radius))//' members'
    else if (any(c%corners < 0) .or. sum(c%corners) /= size(c%corner)) then
      what = str(size(c%corner))//' corners instead of '//str(sum(c%corners))
    else if (any(c%corner < 1)) then
      what = 'a corner that is no vertex'
    end if
    if (len(what) > 0) call errors%add('I284', "'"//path//"' has "//what, path//':/templates', &
                                       'make the packing again')
  end subroutine check_corners

  !> Sizes and values of clumps (I282).
  subroutine check_clumps(c, path, errors)
    type(packed_clumps_type), intent(in) :: c
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    integer :: bad

    what = ''
    if (any([size(c%template), size(c%scale), size(c%x, 2), size(c%quat, 2), size(c%v, 2), &
             size(c%omega, 2)] /= c%n) .or. any([size(c%x, 1), size(c%quat, 1), size(c%v, 1), &
                                                 size(c%omega, 1)] /= [3, 4, 3, 3])) then
      what = 'datasets of different lengths'
    else
      bad = findloc([(is_clump(int(bad, i4)), bad=1, c%n)], .false., 1)
      if (bad > 0) what = 'a clump, number '//str(bad)//', whose template, scale, place '// &
        'or motion is none'
    end if
    if (len(what) > 0) call errors%add('I282', "'"//path//"' has "//what, path//':/clumps', &
                                       'make the packing again')

  contains

    pure logical function is_clump(k)
      integer(i4), intent(in) :: k
      real(wp), parameter :: most = 1.0e12_wp, unit = 1.0e-3_wp
      is_clump = c%template(k) >= 1 .and. c%template(k) <= size(c%spheres) .and. &
                 c%scale(k) > 0.0_wp .and. all(is_finite([c%scale(k), c%x(:, k), c%quat(:, k), &
                                                          c%v(:, k), c%omega(:, k)]))
      if (is_clump) is_clump = all(abs([c%scale(k), c%x(:, k), c%v(:, k), c%omega(:, k)]) < most) &
        .and. abs(sum(c%quat(:, k)**2) - 1.0_wp) < unit
    end function is_clump
  end subroutine check_clumps

  !> Origins of the templates of clumps in space [m].
  pure function clump_origins(clumps) result(x)
    type(dem_clumps_type), intent(in) :: clumps
    real(wp) :: x(3, clumps%n)
    integer(i4) :: k
    do k = 1, clumps%n
      x(:, k) = clumps%grains%x(:, k) + matmul(rotation_of(clumps%grains%quat(:, k)), &
                                               clumps%origin(:, k))
    end do
  end function clump_origins

  !> Orientations of the templates of clumps in space.
  pure function clump_frames(clumps) result(quat)
    type(dem_clumps_type), intent(in) :: clumps
    real(wp) :: quat(4, clumps%n)
    integer(i4) :: k
    do k = 1, clumps%n
      quat(:, k) = quaternion_product(clumps%grains%quat(:, k), clumps%frame(:, k))
      quat(:, k) = quat(:, k)/norm2(quat(:, k))
    end do
  end function clump_frames

  !> Templates of a packing.
  subroutine put_templates(file, clumps, errors)
    type(h5_file_type), intent(inout) :: file
    type(packed_clumps_type), intent(in) :: clumps
    type(error_list_type), intent(inout) :: errors
    call file%group('/templates', errors)
    call file%put('/templates/spheres', clumps%spheres, errors)
    call file%put('/templates/centre', clumps%centre, errors)
    call file%put('/templates/radius', clumps%radius, errors)
    if (allocated(clumps%corners)) then
      call file%put('/templates/corners', clumps%corners, errors)
      call file%put('/templates/corner', clumps%corner, errors)
    end if
    if (.not. allocated(clumps%volume)) return
    call file%put('/templates/volume', clumps%volume, errors)
    call file%put('/templates/middle', clumps%middle, errors)
    call file%put('/templates/inertia', clumps%inertia, errors)
  end subroutine put_templates

  !> Clumps as they are now, their members' places with them: both are folded into the cell as
  !! clumps.
  subroutine put_clumps(file, clumps, grains, cell, x, errors)
    type(h5_file_type), intent(inout) :: file
    type(dem_clumps_type), intent(in) :: clumps
    type(dem_grains_type), intent(in) :: grains
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(inout) :: x(:, :)  !! (3, grains) places as they are written [m]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: home(3, clumps%n)
    integer(i4) :: k, i

    home = folded(cell, clumps%grains%x)
    do k = 1, clumps%n
      do i = clumps%first(k), clumps%last(k)
        x(:, i) = home(:, k) + clumps%arm(:, i)
      end do
    end do
    call file%group('/clumps', errors)
    call file%put('/clumps/first', grains%id(clumps%first), errors)
    call file%put('/clumps/template', clumps%template, errors)
    call file%put('/clumps/scale', clumps%scale, errors)
    call file%put('/clumps/x', clump_origins(clumps) + (home - clumps%grains%x), errors)
    call file%put('/clumps/quat', clump_frames(clumps), errors)
    call file%put('/clumps/v', clumps%grains%v, errors)
    call file%put('/clumps/omega', clumps%grains%omega, errors)
  end subroutine put_clumps
end module dem_clump_file
