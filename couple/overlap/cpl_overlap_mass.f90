!> Each mass belongs to one side: grains own what the free ones fill, nodes own the rest, ghosts
!! nothing. What elements outside give to prescribed nodes moves with the free grains:
!!
!! 'consistent': it stays at the nodes, whose acceleration is that of the grains, P Q'': their
!! inertia comes back by P' (cpl_inertia). 'projected': the grains get P' m, the row sums of
!! P' M P, more or less than they had. 'nearest': the eight nearest grains of each node get it.
!! (theory: overlap coupling, Who owns what)
module cpl_overlap_mass
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_cells, only: cells_type
  use cpl_elements, only: most_nodes, corner_count
  use cpl_fine_damping, only: ramp_from_ghosts
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_ghost, part_free, part_none
  implicit none
  private
  public :: own_rim, share_mass, prescribed_shares, damp_fine_scale

  integer(i4), parameter :: sharers = 8          !! grains that a node's mass goes to
  integer(i4), parameter :: named = 5            !! grains that a message names
  real(wp), parameter :: least_factor = 0.05_wp  !! on the mass of a grain

contains

  !> Nodes of a free rim own what elements outside give them, by the mesh as it was at the start:
  !! nothing moves the nodes over free grains, so that elements there are no measure later.
  subroutine own_rim(o)
    type(overlap_type), intent(inout) :: o
    type(cells_type) :: start
    if (.not. o%sets%free_rim) return
    start = o%cells
    if (allocated(o%map%base)) call o%cells%place(o%cells%x - o%map%base, start)
    call o%own%take_masses(o%cells%mass(o%op%node)*outside_share(o, start, o%op%node), &
      o%cells%inertia(o%op%node_phi)*outside_share(o, start, o%op%node_phi))
  end subroutine own_rim

  !> Factors on the masses of the free grains, or masses of the prescribed nodes. I429: grains that
  !! would keep less than a twentieth of their mass.
  subroutine share_mass(o, how, errors)
    type(overlap_type), intent(inout) :: o
    character(len=*), intent(in) :: how  !! consistent, projected or nearest
    type(error_list_type), intent(inout) :: errors
    real(wp) :: extra(o%op%free), mass(o%op%prescribed), lumped(3, o%op%prescribed), given(3, &
      o%op%free)

    call prescribed_shares(o, mass)
    o%own%moved_mass = sum(mass)
    extra = 0.0_wp
    o%own%mass(:o%op%prescribed) = 0.0_wp
    o%own%inertia(:o%op%prescribed_phi) = 0.0_wp
    select case (how)
    case ('consistent')
      o%own%mass(:o%op%prescribed) = mass
      call prescribed_inertias(o, o%own%inertia(:o%op%prescribed_phi))
      if (o%op%micro%active &
        .or. .not. o%rules%round_free) o%own%inertia(:o%op%prescribed_phi) = 0.0_wp
      call o%own%carried%build(o%op%p, o%pack%mass(o%sets%free), mass, errors)
      if (o%rules%turns .and. o%rules%round_free .and. .not. o%op%micro%active) &
        call o%own%carried_phi%build(o%op%p_phi, o%pack%inertia(o%sets%free), &
                                 o%own%inertia(:o%op%prescribed_phi), errors)
    case ('projected')
      lumped = spread(mass, 1, 3)
      given = 0.0_wp
      call o%op%p%transposed(lumped, given)
      extra = given(1, :)
    case default
      call share_nearest(o, mass, extra)
    end select
    o%own%factor = 1.0_wp + extra/o%pack%mass(o%sets%free)
    call check_factors(o, errors)
  end subroutine share_mass

  !> Damping of the fine scale, strongest at the ghosts, for cells as they are now.
  subroutine damp_fine_scale(o, cells)
    type(overlap_type), intent(inout) :: o
    type(cells_type), intent(in) :: cells
    real(wp) :: ramp(o%op%free)
    associate (rate => o%rules%fine_damping, free => o%sets%free)
      call ramp_from_ghosts(cells, o%sets%part == part_ghost, o%map%x_free, o%map%seen, ramp)
      call o%own%damping%build(rate, ramp, o%own%factor*o%pack%mass(free))
      if (o%rules%turns) call o%own%damping_phi%build(rate, ramp, &
                                                      o%own%factor*o%pack%slimmest(free))
    end associate
  end subroutine damp_fine_scale

  !> The mass of each node to the free grains nearest to it.
  subroutine share_nearest(o, mass, extra)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: mass(:)      !! of the prescribed nodes [kg]
    real(wp), intent(inout) :: extra(:)  !! of the free grains [kg]
    real(wp) :: far(o%op%free)
    integer(i4) :: a, k, n, g
    n = min(sharers, int(count(o%map%seen), i4))
    do a = 1, o%op%prescribed
      if (.not. mass(a) > 0.0_wp) cycle
      do g = 1, o%op%free
        far(g) = merge(sum((o%map%x_free(:, g) - o%map%x_node(:, a))**2), huge(1.0_wp), &
          o%map%seen(g))
      end do
      do k = 1, n
        g = minloc(far, 1)
        extra(g) = extra(g) + mass(a)/n
        far(g) = huge(1.0_wp)
      end do
    end do
  end subroutine share_nearest

  !> I429, with the grains that lose most.
  subroutine check_factors(o, errors)
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    real(wp) :: left(o%op%free)
    character(len=:), allocatable :: ids
    integer(i4) :: k, g, n

    n = count(.not. o%own%factor >= least_factor)
    if (n == 0) return
    left = o%own%factor
    ids = ''
    do k = 1, min(named, n)
      g = minloc(left, 1)
      if (k > 1) ids = ids//', '
      ids = ids//str(o%pack%id(o%sets%free(g)))
      left(g) = huge(1.0_wp)
    end do
    call errors%add('I429', str(n)//' free grains would keep less than '//str(least_factor)// &
      ' of their mass, the least '//str(minval(o%own%factor))//': '//ids, '', &
      "write mass = 'consistent' in &overlap, or take larger elements")
  end subroutine check_factors

  !> Mass of prescribed nodes that comes from elements outside, by the integrals of their functions,
  !! of elements with middle nodes by their volumes [kg].
  subroutine prescribed_shares(o, mass)
    type(overlap_type), intent(in) :: o
    real(wp), intent(out) :: mass(:)
    associate (node => o%op%node(:o%op%prescribed))
      mass = o%cells%mass(node)*outside_share(o, o%cells, node)
    end associate
  end subroutine prescribed_shares

  !> The same for micro-inertia [kg m^2].
  subroutine prescribed_inertias(o, inertia)
    type(overlap_type), intent(in) :: o
    real(wp), intent(out) :: inertia(:)
    associate (node => o%op%node_phi(:o%op%prescribed_phi))
      inertia = o%cells%inertia(node)*outside_share(o, o%cells, node)
    end associate
  end subroutine prescribed_inertias

  !> Share of nodes that elements without free grains give [-].
  pure function outside_share(o, cells, nodes) result(share_of)
    type(overlap_type), intent(in) :: o
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: nodes(:)
    real(wp) :: share_of(size(nodes))
    real(wp) :: inside(cells%nodes), outside(cells%nodes), share(most_nodes)
    integer(i4) :: e, n

    inside = 0.0_wp
    outside = 0.0_wp
    do e = 1, cells%elements
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        n = size(node)
        call cells%shares(e, share)
        if (n > corner_count(cells%kind(e))) share(:n) = cells%volume(e)
        if (o%sets%part(e) == part_free .or. o%sets%part(e) == part_none) then
          inside(node) = inside(node) + share(:n)
        else
          outside(node) = outside(node) + share(:n)
        end if
      end associate
    end do
    share_of = outside(nodes)/(inside(nodes) + outside(nodes))
  end function outside_share
end module cpl_overlap_mass
