!> Who owns which mass in a bridging domain: nodes have a of the continuum's, grains 1 - a of their
!! own, a the weight of the continuum, which runs from the free grains to the end of the domain
!! (theory: overlap coupling, Bridging domain).
!! eq. C.16
module cpl_bridge_mass
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_bridge, only: bridge_type
  use cpl_cells, only: cells_type
  use cpl_elements, only: most_nodes, corner_count, locate
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: points_type
  use cpl_sets, only: part_rest, part_ghost
  use cpl_weights, only: omega
  implicit none
  private
  public :: check_domain, share_domain

contains

  !> I431 a free element that touches continuum alone, I432 grains that are held in the domain, D431
  !! a micromorphic solid.
  subroutine check_domain(o, errors)
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: e, g

    if (o%cells%micromorphic) call errors%add('D431', "method = 'bridging_domain' does not "// &
      'know micromorphic solids', '', "write method = 'bridging_scale' in &overlap")
    e = findloc(o%sets%fast .and. o%sets%part == part_rest, .true., 1)
    if (e > 0) call errors%add('I431', 'element '//str(e)//' of continuum alone touches one of '// &
      'free grains', '', 'elements of ghosts, which are the bridging domain, must lie all '// &
      'around those of the free grains')
    g = findloc(o%pack%kind(o%sets%ghost) /= 0, .true., 1)
    if (g > 0) call errors%add('I432', str(count(o%pack%kind(o%sets%ghost) /= 0))//' grains of '// &
      'the bridging domain are held by the deck of the grains, such as '// &
      str(o%pack%id(o%sets%ghost(g))), '', 'grains of the domain move with its nodes: let them '// &
      'be free there')
  end subroutine check_domain

  !> Weights of the bound grains, masses of all nodes of the overlap.
  subroutine share_domain(o, b, points)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(inout) :: b
    type(points_type), intent(in) :: points
    real(wp), dimension(o%cells%nodes) :: all_of, own, all_phi, own_phi
    real(wp) :: share(most_nodes), weight(most_nodes, o%cells%elements)
    integer(i4) :: g, e, n

    allocate (b%weight(o%op%ghosts))
    do g = 1, o%op%ghosts
      b%weight(g) = clipped(o, omega(o%sets%hull%distance(o%map%x_ghost(:, g)), &
                                            o%sets%depth, 0.0_wp))
    end do
    call element_weights(o, points, weight)
    all_of = 0.0_wp
    own = 0.0_wp
    do e = 1, o%cells%elements
      associate (node => o%cells%node(o%cells%start(e):o%cells%start(e + 1) - 1))
        n = size(node)
        call o%cells%shares(e, share)
        if (n > corner_count(o%cells%kind(e))) share(:n) = o%cells%volume(e)
        all_of(node) = all_of(node) + share(:n)
        own(node) = own(node) + share(:n)*weight(:n, e)
      end associate
    end do
    own_phi = own/all_of
    all_phi = o%cells%inertia*own_phi
    own = o%cells%mass*own_phi
    b%weight_excess = own(o%op%node) - o%cells%mass(o%op%node)
    call o%own%take_masses(own(o%op%node), all_phi(o%op%node_phi))
    o%own%moved_mass = sum(b%weight*o%pack%mass(o%sets%ghost))
  end subroutine share_domain

  pure elemental real(wp) function clipped(o, weight)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: weight
    clipped = min(1.0_wp - o%rules%least_weight, max(o%rules%least_weight, weight))
  end function clipped

  !> Mean weight of the continuum around each node of each element: with its function as weight in
  !! linear elements, with its square in others, which is never negative.
  subroutine element_weights(o, points, weight)
    type(overlap_type), intent(in) :: o
    type(points_type), intent(in) :: points
    real(wp), intent(out) :: weight(:, :)  !! (most_nodes, elements)
    real(wp) :: total(most_nodes, o%cells%elements), n(most_nodes), slope(3, most_nodes), xi(3), a
    integer(i4) :: q, e, k
    logical :: found

    weight = spread(merge(1.0_wp, 0.0_wp, o%sets%part == part_rest), 1, most_nodes)
    total = 0.0_wp
    do q = 1, size(points%element)
      e = points%element(q)
      if (o%sets%part(e) /= part_ghost) cycle
      associate (node => o%cells%nodes_of(e), x => points%x(:, q))
        k = size(node)
        call locate(o%cells%kind(e), o%cells%x(:, node), x, xi, n, slope, found)
        if (k > corner_count(o%cells%kind(e))) n(:k) = n(:k)**2
        a = clipped(o, 1.0_wp - omega(o%sets%hull%distance(x), o%sets%depth, 0.0_wp))
        weight(:k, e) = weight(:k, e) + points%weight(q)*a*n(:k)
        total(:k, e) = total(:k, e) + points%weight(q)*n(:k)
      end associate
    end do
    where (total > 0.0_wp) weight = weight/total
  end subroutine element_weights
end module cpl_bridge_mass
