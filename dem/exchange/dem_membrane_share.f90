!> Membranes of a run on many ranks: all ranks hold and move all of them.
module dem_membrane_share
  use talus_kinds, only: wp
  use talus_ranks, only: ranks_type
  use dem_membrane, only: set_stretches, set_forces
  use dem_surface_state, only: dem_surfaces_type
  use dem_surface_values, only: set_vertex_velocities
  use dem_broadcast, only: broadcast_matrix, broadcast_list
  implicit none
  private
  public :: broadcast_membranes, take_membranes

contains

  !> What membranes are made of and what pulls them; the others have room for it. What the grains do
  !! to them is so far what the leader has.
  subroutine broadcast_membranes(team, s)
    type(ranks_type), intent(in) :: team
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), allocatable :: inverse(:, :)
    associate (m => s%membranes)
      call broadcast_list(team, m%modulus)
      call broadcast_list(team, m%poisson)
      call broadcast_list(team, m%side)
      call broadcast_list(team, m%damping)
      call broadcast_list(team, m%limit)
      call broadcast_list(team, m%stretch)
      call broadcast_list(team, m%mass)
      call broadcast_list(team, m%area)
      inverse = reshape(m%inverse, [4, s%mesh%triangles])
      call broadcast_matrix(team, inverse)
      m%inverse = reshape(inverse, shape(m%inverse))
      call broadcast_matrix(team, m%press)
      call broadcast_matrix(team, m%pull)
      call team%broadcast_numbers(m%wall)
    end associate
    s%mesh%acting = s%mesh%force
    call broadcast_matrix(team, s%mesh%acting)
    s%counted = team%leads()
  end subroutine broadcast_membranes

  !> Motion and forces of the whole, which are those of any part.
  pure subroutine take_membranes(part, whole)
    type(dem_surfaces_type), intent(in) :: part
    type(dem_surfaces_type), intent(inout) :: whole
    call set_vertex_velocities(whole, part%mesh%v)
    call set_stretches(whole, part%membranes%stretch)
    call set_forces(whole, part%membranes%press, part%membranes%pull)
  end subroutine take_membranes
end module dem_membrane_share
