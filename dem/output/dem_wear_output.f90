!> Wear in the results: a history of what each plane and surface has lost, and the wear of every
!! triangle in the field file.
module dem_wear_output
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use dem_state, only: dem_data_type
  use dem_surface_output, only: surface_mesh_sizes
  use dem_wear, only: worn_volumes
  implicit none
  private
  public :: dem_wear_history_type, put_wear

  character(len=14), parameter :: columns(5) = [character(len=14) :: 'time [s]', 'wall [-]', &
    'surface [-]', 'volume [m3]', 'load_path [J]']

  type :: dem_wear_history_type
    type(history_type) :: history
  contains
    procedure :: open => open_history
    procedure :: write => write_rows
  end type dem_wear_history_type

contains

  !> Begin the file of a run with wear, or go on in it after a restart at time >= 0.
  subroutine open_history(self, d, stem, time, errors)
    class(dem_wear_history_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    if (d%wear%active) call self%history%begin(stem//'_wear.csv', columns, time, errors)
  end subroutine open_history

  !> A row for every plane and surface that wears.
  subroutine write_rows(self, time, d, errors)
    class(dem_wear_history_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (.not. self%history%is_open()) return
    do k = 1, d%planes%n
      if (d%wear%plane_rate(k) > 0.0_wp) &
        call self%history%write([time, real(k, wp), 0.0_wp, d%wear%plane_rate(k)*d%wear%plane(k), &
                                 d%wear%plane(k)], errors)
    end do
    do k = 1, d%surfaces%n
      if (d%wear%body_rate(k) > 0.0_wp) &
        call self%history%write([time, 0.0_wp, real(k, wp), d%wear%body_rate(k)*d%wear%body(k), &
                                 d%wear%body(k)], errors)
    end do
  end subroutine write_rows

  !> Worn volume [m^3] and its depth [m] of every triangle of the surface mesh; 0 on the polygons
  !! that stand for cones and cylinders.
  subroutine put_wear(file, group, d, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: volume(:), depth(:)
    integer(i4) :: points, triangles, t
    call surface_mesh_sizes(d%surfaces, points, triangles)
    allocate (volume(triangles), depth(triangles), source=0.0_wp)
    volume(:d%surfaces%mesh%triangles) = worn_volumes(d)
    do t = 1, d%surfaces%mesh%triangles
      associate (x => d%surfaces%mesh%x(:, d%surfaces%mesh%corner(:, t)))
        depth(t) = volume(t)/(0.5_wp*norm2(cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))))
      end associate
    end do
    call file%put(group//'/wear', volume, errors)
    call file%put(group//'/wear_depth', depth, errors)
  end subroutine put_wear
end module dem_wear_output
