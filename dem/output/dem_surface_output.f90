!> Surfaces in the results: a history of force, moment and work of each part, and the triangles of
!! every step as a surface mesh (cones as polygons of revolution).
module dem_surface_output
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use dem_surface_state, only: dem_surfaces_type, surface_cone, is_round
  implicit none
  private
  public :: open_surface_history, write_surface_rows, surface_mesh_sizes, put_surface_mesh
  public :: open_body_history, write_body_rows

  character(len=16), parameter :: columns(13) = [character(len=16) :: 'time [s]', 'surface [-]', &
    'part [-]', 'x [m]', 'y [m]', 'z [m]', 'force_x [N]', 'force_y [N]', 'force_z [N]', &
    'moment_x [N m]', 'moment_y [N m]', 'moment_z [N m]', 'work [J]']
  character(len=18), parameter :: body_columns(15) = [character(len=18) :: 'time [s]', &
    'surface [-]', 'x [m]', 'y [m]', 'z [m]', 'velocity_x [m/s]', 'velocity_y [m/s]', &
    'velocity_z [m/s]', 'spin_x [rad/s]', 'spin_y [rad/s]', 'spin_z [rad/s]', 'turn_w [-]', &
    'turn_x [-]', 'turn_y [-]', 'turn_z [-]']
  integer(i4), parameter :: sides = 48  !! of a cone or cylinder in the mesh
  real(wp), parameter :: endless = 5.0_wp  !! half the length, in radii, of a cylinder without ends
  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Begin the file, or go on in it after a restart at time >= 0.
  subroutine open_surface_history(history, stem, time, errors)
    type(history_type), intent(inout) :: history
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    call history%begin(stem//'_surfaces.csv', columns, time, errors)
  end subroutine open_surface_history

  !> The same for free bodies.
  subroutine open_body_history(history, stem, time, errors)
    type(history_type), intent(inout) :: history
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    type(error_list_type), intent(inout) :: errors
    call history%begin(stem//'_bodies.csv', body_columns, time, errors)
  end subroutine open_body_history

  !> A row a free body: place, velocity, spin and turn since the start, a quaternion.
  subroutine write_body_rows(history, time, s, errors)
    type(history_type), intent(inout) :: history
    real(wp), intent(in) :: time  !! [s]
    type(dem_surfaces_type), intent(in) :: s
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: b
    do b = 1, s%n
      if (.not. any(s%rigid%free(:, b) > 0.5_wp)) cycle
      call history%write([time, real(b, wp), s%centre(:, b), s%velocity(:, b), s%spin(:, b), &
                          s%quat(:, b)], errors)
    end do
  end subroutine write_body_rows

  !> A row a part; works of intervals that are over are added.
  subroutine write_surface_rows(history, time, s, work, errors)
    type(history_type), intent(inout) :: history
    real(wp), intent(in) :: time     !! [s]
    type(dem_surfaces_type), intent(in) :: s
    real(wp), intent(in) :: work(:)  !! (parts) [J]
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: b, p
    do b = 1, s%n
      do p = s%first_part(b), s%first_part(b + 1) - 1
        call history%write([time, real(b, wp), real(p - s%first_part(b) + 1, wp), s%centre(:, b), &
                           s%sums%force(:, p), s%sums%moment(:, p), work(p) + s%sums%work(p)], &
                           errors)
      end do
    end do
  end subroutine write_surface_rows

  !> Points and triangles of the surface mesh.
  pure subroutine surface_mesh_sizes(s, points, triangles)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(out) :: points, triangles
    integer(i4) :: cones, b
    cones = count([(is_round(s, b), b=1, s%n)])
    points = s%mesh%vertices + cones*(1 + 2*sides)
    triangles = s%mesh%triangles + cones*3*sides
  end subroutine surface_mesh_sizes

  !> Group surfaces of a step: x, triangles (nodes from 0) and the number of the body of each.
  subroutine put_surface_mesh(file, group, s, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_surfaces_type), intent(in) :: s
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :)
    integer(i4), allocatable :: corner(:, :), body(:)
    integer(i4) :: points, triangles, b

    call surface_mesh_sizes(s, points, triangles)
    allocate (x(3, points), corner(3, triangles), body(triangles))
    x(:, :s%mesh%vertices) = s%mesh%x
    corner(:, :s%mesh%triangles) = s%mesh%corner - 1
    body(:s%mesh%triangles) = s%mesh%owner
    points = s%mesh%vertices
    triangles = s%mesh%triangles
    do b = 1, s%n
      if (.not. is_round(s, b)) cycle
      body(triangles + 1:triangles + 3*sides) = b
      call draw_cone(s, b, x, corner, points, triangles)
    end do
    call file%group(group, errors)
    call file%put(group//'/x', x, errors)
    call file%put(group//'/triangles', corner, errors)
    call file%put(group//'/surface', body, errors)
  end subroutine put_surface_mesh

  !> Tip, ring of the shoulder, ring at the top; of a cylinder the lower end, a disc, is drawn too.
  pure subroutine draw_cone(s, b, x, corner, points, triangles)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(inout) :: x(:, :)
    integer(i4), intent(inout) :: corner(:, :), points, triangles
    real(wp) :: e(3), f(3), ring(3), height, length, low_end
    integer(i4) :: k, low, high

    e = 0.0_wp
    e(minloc(abs(s%round%axis(:, b)), 1)) = 1.0_wp
    e = e - dot_product(e, s%round%axis(:, b))*s%round%axis(:, b)
    e = e/sqrt(sum(e*e))
    f = [s%round%axis(2, b)*e(3) - s%round%axis(3, b)*e(2), s%round%axis(3, b)*e(1) &
         - s%round%axis(1, b)*e(3), s%round%axis(1, b)*e(2) - s%round%axis(2, b)*e(1)]
    low_end = 0.0_wp
    if (s%kind(b) == surface_cone) then
      height = s%round%radius(b)*s%round%cosine(b)/s%round%sine(b)
      length = s%round%extent(b)
    else
      length = 2.0_wp*min(s%round%extent(b), endless*s%round%radius(b))
      height = -0.5_wp*length
      low_end = height
    end if
    x(:, points + 1) = s%centre(:, b) + low_end*s%round%axis(:, b)
    do k = 1, sides
      ring = s%round%radius(b)*(cos(2.0_wp*pi*k/sides)*e + sin(2.0_wp*pi*k/sides)*f) &
        + s%centre(:, b)
      x(:, points + 1 + k) = ring + height*s%round%axis(:, b)
      x(:, points + 1 + sides + k) = ring + (height + length)*s%round%axis(:, b)
      low = points + k
      high = points + 1 + mod(k, sides)
      corner(:, triangles + 1) = [points, high, low]
      corner(:, triangles + 2) = [low, high, low + sides]
      corner(:, triangles + 3) = [high, high + sides, low + sides]
      triangles = triangles + 3
    end do
    points = points + 1 + 2*sides
  end subroutine draw_cone
end module dem_surface_output
