!> Surfaces of a run on many ranks: all ranks hold and move all of them, each with the contacts of
!! its own grains (dem_surface_records). What the grains do to them is the sum of the ranks' parts.
module dem_surface_share
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  use dem_surface_body, only: no_free_bodies
  use dem_membrane_share, only: broadcast_membranes, take_membranes
  use dem_membrane, only: no_membranes
  use dem_surface_state, only: dem_surfaces_type
  use dem_surface_values, only: surface_sizes_type, make_room, mark_reference, set_aimed, &
    set_sums, set_velocities, copy_places, set_press, set_vertex_loads
  use dem_broadcast, only: broadcast_matrix, broadcast_list, broadcast_table
  implicit none
  private
  public :: broadcast_surfaces, broadcast_motion
  public :: surface_reals, surface_report, take_surfaces

  integer(i4), parameter :: part_reals = 13                 !! of a part in a report

contains

  !> Everything but contacts and sums, which stay with the leader.
  subroutine broadcast_surfaces(team, s)
    type(ranks_type), intent(in) :: team
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4) :: sizes(8)

    sizes = [s%n, s%parts, s%mesh%vertices, s%mesh%triangles, merge(1_i4, 0_i4, s%soft), 0_i4, &
             merge(1_i4, 0_i4, allocated(s%rigid%free)), merge(1_i4, 0_i4, allocated(s%membranes))]
    if (allocated(s%mesh%fan)) sizes(6) = ubound(s%mesh%fan, 1)
    call team%broadcast_numbers(sizes)
    if (sizes(1) == 0) return
    if (.not. team%leads()) then
      call make_room(s, surface_sizes_type(sizes(1), sizes(2), sizes(3), sizes(4), sizes(6), &
                                           sizes(5) > 0))
      if (sizes(7) > 0) call no_free_bodies(s)
      if (sizes(8) > 0) call no_membranes(s)
    end if
    call team%broadcast_numbers(s%kind)
    call broadcast_list(team, s%cos_smooth)
    call broadcast_list(team, s%reach)
    call broadcast_matrix(team, s%centre)
    call broadcast_matrix(team, s%quat)
    call broadcast_matrix(team, s%round%rest_axis)
    call broadcast_matrix(team, s%round%axis)
    call broadcast_list(team, s%round%sine)
    call broadcast_list(team, s%round%cosine)
    call broadcast_list(team, s%round%radius)
    call broadcast_list(team, s%round%extent)
    call broadcast_list(team, s%round%listed_radius)
    call broadcast_list(team, s%round%start_radius)
    call team%broadcast_numbers(s%first_part)
    call team%broadcast_numbers(s%first_vertex)
    call team%broadcast_numbers(s%first_triangle)
    call team%broadcast_numbers(s%material)
    call broadcast_matrix(team, s%mesh%rest)
    call broadcast_matrix(team, s%mesh%x)
    if (sizes(7) > 0) call broadcast_bodies(team, s)
    if (sizes(8) > 0) call broadcast_membranes(team, s)
    call broadcast_motion(team, s)
    if (s%mesh%triangles > 0) call broadcast_triangles(team, s)
    call mark_reference(s)
  end subroutine broadcast_surfaces

  !> Bodies that move freely: all ranks move them alike, by what all grains do to them; the leader
  !! counts their works.
  subroutine broadcast_bodies(team, s)
    type(ranks_type), intent(in) :: team
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4) :: b, p
    call broadcast_matrix(team, s%rigid%free)
    call broadcast_list(team, s%rigid%mass)
    call broadcast_matrix(team, s%rigid%inertia)
    call broadcast_matrix(team, s%rigid%frame)
    if (allocated(s%rigid%acting)) deallocate (s%rigid%acting)
    allocate (s%rigid%acting(6, s%n), source=0.0_wp)
    do b = 1, s%n
      do p = s%first_part(b), s%first_part(b + 1) - 1
        s%rigid%acting(:, b) = s%rigid%acting(:, b) + [s%sums%force(:, p), s%sums%moment(:, p)]
      end do
    end do
    call broadcast_matrix(team, s%rigid%acting)
    s%counted = team%leads()
  end subroutine broadcast_bodies

  subroutine broadcast_triangles(team, s)
    type(ranks_type), intent(in) :: team
    type(dem_surfaces_type), intent(inout) :: s
    call team%broadcast_numbers(s%mesh%home)
    call team%broadcast_numbers(s%mesh%fan_start)
    call team%broadcast_numbers(s%mesh%fan)
    call broadcast_table(team, s%mesh%corner)
    call team%broadcast_numbers(s%mesh%owner)
    call broadcast_table(team, s%mesh%mate)
  end subroutine broadcast_triangles

  !> Velocities of surfaces for the next steps.
  subroutine broadcast_motion(team, s)
    type(ranks_type), intent(in) :: team
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4) :: aimed(1)
    call broadcast_matrix(team, s%velocity)
    call broadcast_matrix(team, s%spin)
    call broadcast_list(team, s%round%swell)
    if (allocated(s%rigid%free)) call broadcast_matrix(team, s%rigid%given)
    if (.not. s%soft) return
    aimed = merge(1_i4, 0_i4, s%mesh%has_target)
    call team%broadcast_numbers(aimed)
    call set_aimed(s, aimed(1) > 0)
    call broadcast_matrix(team, s%mesh%v)
    call broadcast_matrix(team, s%mesh%target)
    if (allocated(s%membranes)) call broadcast_list(team, s%membranes%pressure)
  end subroutine broadcast_motion

  !> Reals of the surfaces in a report.
  pure integer(i4) function surface_reals(s)
    type(dem_surfaces_type), intent(in) :: s
    surface_reals = part_reals*s%parts + 2*s%n + merge(6*s%mesh%vertices, 0_i4, s%soft)
  end function surface_reals

  !> Sums over this rank's grains.
  pure function surface_report(s) result(report)
    type(dem_surfaces_type), intent(in) :: s
    real(wp) :: report(surface_reals(s))
    integer(i4) :: n
    if (s%n == 0) return
    n = part_reals*s%parts
    report(:n) = [s%sums%force, s%sums%moment, s%sums%impulse, s%sums%moment_impulse, s%sums%work]
    report(n + 1:n + s%n) = s%round%press
    report(n + s%n + 1:n + 2*s%n) = s%round%press_impulse
    if (s%soft) report(n + 2*s%n + 1:) = [s%mesh%force, s%mesh%impulse]
  end function surface_report

  !> Sums over all grains from added reports, and the motion, which is that of any part.
  pure subroutine take_surfaces(part, report, whole)
    type(dem_surfaces_type), intent(in) :: part
    real(wp), intent(in) :: report(:)
    type(dem_surfaces_type), intent(inout) :: whole
    integer(i4) :: n, v
    n = 3*whole%parts
    v = part_reals*whole%parts
    call set_sums(whole, reshape(report(:4*n), [3, whole%parts, 4]), report(4*n + 1:v))
    if (allocated(whole%rigid%free)) call set_velocities(whole, part%velocity, part%spin)
    call copy_places(part, whole)
    call set_press(whole, report(v + 1:v + whole%n), report(v + whole%n + 1:v + 2*whole%n))
    if (.not. whole%soft) return
    v = v + 2*whole%n
    n = 3*whole%mesh%vertices
    call set_vertex_loads(whole, reshape(report(v + 1:v + n), [3, whole%mesh%vertices]), &
                          reshape(report(v + n + 1:v + 2*n), [3, whole%mesh%vertices]))
    if (allocated(whole%membranes)) call take_membranes(part, whole)
  end subroutine take_surfaces
end module dem_surface_share
