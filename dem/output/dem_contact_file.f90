!> The contacts of a region one by one, step by step in HDF5, described in XDMF as points.
module dem_contact_file
  use talus_kinds, only: wp, i4, i8
  use talus_contact_measures, only: contacts_inside
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_measures, only: request_type
  use talus_sample, only: sample_type
  use talus_series, only: series_type
  use talus_xdmf, only: xdmf_type, xdmf_node
  implicit none
  private
  public :: dem_contact_file_type

  character(len=*), parameter :: format_name = 'talus-contacts'

  type :: dem_contact_file_type
    type(series_type) :: series
    type(xdmf_type) :: xdmf
  contains
    procedure :: open => open_contacts
    procedure :: write => write_contacts
  end type dem_contact_file_type

contains

  !> Begin the file, or go on in it after a restart at time >= 0.
  subroutine open_contacts(self, path, time, errors)
    class(dem_contact_file_type), intent(inout) :: self
    character(len=*), intent(in) :: path  !! without extension
    real(wp), intent(in) :: time          !! [s]
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    logical :: found
    found = .false.
    if (time >= 0.0_wp) call self%series%resume(path//'.h5', format_name, time, found, errors)
    if (.not. found .and. .not. errors%any()) then
      call self%series%start(path//'.h5', format_name, file, errors)
      call file%commit(errors)
    end if
    call self%xdmf%describe_points(path//'.xdmf', 'point')
    call self%xdmf%attribute('normal', 'normal', xdmf_node, 3)
    call self%xdmf%attribute('branch', 'branch', xdmf_node, 3)
    call self%xdmf%attribute('force', 'force', xdmf_node, 3)
    call self%xdmf%attribute('overlap', 'overlap', xdmf_node, 1)
    call self%xdmf%attribute('sliding', 'sliding', xdmf_node, 1, 'int4')
  end subroutine open_contacts

  !> One more step; forces are those on the second grain.
  subroutine write_contacts(self, time, sample, request, errors)
    class(dem_contact_file_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    character(len=:), allocatable :: group
    integer(i4), allocatable :: row(:)
    real(wp), allocatable :: branch(:, :)
    integer(i4) :: c

    row = pack([(c, c=1, sample%contacts)], contacts_inside(sample, request))
    allocate (branch(3, size(row)))
    do c = 1, size(row)
      branch(:, c) = sample%far_end(row(c)) - sample%start(:, row(c))
    end do
    call self%series%begin_step(time, file, group, errors)
    call file%put(group//'/ids', sample%ids(:, row), errors)
    call file%put(group//'/point', sample%point(:, row), errors)
    call file%put(group//'/normal', sample%normal(:, row), errors)
    call file%put(group//'/branch', branch, errors)
    call file%put(group//'/force', -sample%force(:, row), errors)
    call file%put(group//'/stiffness', sample%stiffness(:, row), errors)
    call file%put(group//'/overlap', sample%overlap(row), errors)
    call file%put(group//'/sliding', merge(1_i4, 0_i4, sample%sliding(row)), errors)
    call self%series%end_step(int(size(row), i8), file, errors)
    call self%xdmf%write(self%series, errors)
  end subroutine write_contacts
end module dem_contact_file
