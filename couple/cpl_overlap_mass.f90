!> Each mass belongs to one side: grains own what the free ones fill, nodes own the rest, ghosts
!! nothing. What elements outside would give to hat nodes goes to the free grains nearest to them.
module cpl_overlap_mass
  use talus_kinds, only: wp, i4
  use cpl_elements, only: most_nodes, corner_count
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_free
  implicit none
  private
  public :: share_mass

  integer(i4), parameter :: sharers = 8  !! grains that a node's mass goes to

contains

  !> Factors on the masses of the free grains.
  subroutine share_mass(o)
    type(overlap_type), intent(inout) :: o
    real(wp) :: extra(o%op%free), mass(o%op%hats), far(o%op%free)
    integer(i4) :: a, k, n, g

    call hat_masses(o, mass)
    extra = 0.0_wp
    n = min(sharers, o%op%free)
    do a = 1, o%op%hats
      if (.not. mass(a) > 0.0_wp) cycle
      do g = 1, o%op%free
        far(g) = sum((o%x_free(:, g) - o%x_node(:, a))**2)
      end do
      do k = 1, n
        g = minloc(far, 1)
        extra(g) = extra(g) + mass(a)/n
        far(g) = huge(1.0_wp)
      end do
    end do
    o%moved_mass = sum(mass)
    o%factor = 1.0_wp + extra/o%pack%mass(o%sets%free)
  end subroutine share_mass

  !> Mass of hat nodes that comes from elements outside, by the integrals of their functions, of
  !! elements with middle nodes by their volumes [kg].
  subroutine hat_masses(o, mass)
    type(overlap_type), intent(in) :: o
    real(wp), intent(out) :: mass(:)
    real(wp) :: inside(o%cells%nodes), outside(o%cells%nodes), share(most_nodes)
    integer(i4) :: e, n

    inside = 0.0_wp
    outside = 0.0_wp
    do e = 1, o%cells%elements
      associate (node => o%cells%node(o%cells%start(e):o%cells%start(e + 1) - 1))
        n = size(node)
        call o%cells%shares(e, share)
        if (n > corner_count(o%cells%kind(e))) share(:n) = o%cells%volume(e)
        if (o%sets%part(e) == part_free) then
          inside(node) = inside(node) + share(:n)
        else
          outside(node) = outside(node) + share(:n)
        end if
      end associate
    end do
    associate (node => o%op%node(:o%op%hats))
      mass = o%cells%mass(node)*outside(node)/(inside(node) + outside(node))
    end associate
  end subroutine hat_masses
end module cpl_overlap_mass
