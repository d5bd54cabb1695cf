!> Is the step of the grains stable with a bridging domain? The operator of free grains and nodes of
!! the domain with the grains that are bound to them; elements that only kick between exchanges are
!! not part of it (theory: overlap coupling, Bridging domain).
module cpl_bridge_limit
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_timers, only: timers_type
  use cpl_bridge, only: bridge_type
  use cpl_coupled, only: coupled_type, motion_type, add_contacts, add_elements
  use cpl_overlap, only: overlap_type
  use cpl_overlap_limit, only: highest_frequency, mode_type
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_overlap_weights, only: read_contacts
  use cpl_partition, only: ghost_ghost
  use cpl_solver, only: cpl_solver_type, side_grains
  use cpl_weights, only: omega_mean
  implicit none
  private
  public :: check_bridge_step, check_step_of, weigh_contacts

  type, extends(coupled_type) :: bridged_type
    type(bridge_type) :: bridge
  contains
    procedure :: start => start_bound
    procedure :: stiffness_times => bound_stiffness_times
    procedure :: accelerate => accelerate_bound
    procedure :: work => bound_work
  end type bridged_type

contains

  !> D425: the step of the grains is above the stable step 2/omega. With lumped multipliers, which
  !! bind less, the limit of the grains alone (SET mass_factor) is printed with it.
  subroutine check_bridge_step(o, b, solvers, points, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(bridge_type), intent(in) :: b
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(points_type), intent(in) :: points
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(bridged_type) :: bridged

    if (b%lumped) return
    bridged%bridge = b
    call check_step_of(bridged, o, solvers(side_grains), points, timers, errors)
  end subroutine check_bridge_step

  !> The same for whatever binds the domain.
  subroutine check_step_of(coupled, o, grains, points, timers, errors)
    class(coupled_type), intent(inout) :: coupled
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: grains
    type(points_type), intent(in) :: points
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(contacts_type) :: contacts
    type(mode_type) :: mode

    call read_contacts(grains, contacts, timers, errors)
    if (errors%any()) return
    call timers%start('stable step')
    call coupled%build(o, contacts, points, o%pack%slimmest)
    call weigh_contacts(o, coupled)
    mode = highest_frequency(o, coupled)
    call timers%stop('stable step')
    if (.not. mode%omega > 0.0_wp) return
    o%limit%step_limit = 2.0_wp/mode%omega
    if (grains%dt <= o%limit%step_limit) return
    call errors%add('D425', 'the step of the grains, '//str(grains%dt)//' s, is above the '// &
      'stable step of the overlap, '//short_number(o%limit%step_limit)//' s', grains%deck, &
      'shorten dt in its deck; if the grains alone allow the step, moduli of the solid that '// &
      'are too stiff for the pack are the cause')
  end subroutine check_step_of

  !> Contacts between bound grains count by their weights, those of the ramp.
  subroutine weigh_contacts(o, coupled)
    type(overlap_type), intent(in) :: o
    class(coupled_type), intent(inout) :: coupled
    integer(i4) :: c
    associate (p => coupled%partition)
      do c = 1, size(p%pair, 2)
        if (.not. ghost_ghost(p, c)) cycle
        p%stiffness(:, c) = p%stiffness(:, c)*max(o%rules%least_weight, omega_mean( &
          p%depth(p%pair(1, c)), p%depth(p%pair(2, c)), o%sets%depth, 0.0_wp))
      end do
    end associate
  end subroutine weigh_contacts

  !> Nodes of the domain take part, of no special form.
  subroutine start_bound(self, o, y)
    class(bridged_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(out) :: y
    integer(i4) :: k, c
    call self%coupled_type%start(o, y)
    associate (at => self%bridge%move%at)
      do k = 1, size(at)
        do c = 1, 3
          y%u(c, at(k)) = sin(2.1_wp*k + 1.9_wp*c)
        end do
      end do
    end associate
    where (o%own%held) y%u = 0.0_wp
  end subroutine start_bound

  !> r = K y, with bound grains where the nodes are; r of them is transferred to the nodes.
  subroutine bound_stiffness_times(self, o, y, r)
    class(bridged_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: y
    type(motion_type), intent(inout) :: r
    real(wp), dimension(3, o%op%ghosts) :: d
    real(wp) :: u(3, o%op%nodes), phi(3, o%op%nodes_phi)

    associate (b => self%bridge)
      call o%op%ghost%apply(y%u, d)
      y%q(:, o%sets%ghost) = d
      if (b%turns) then
        call o%op%ghost_phi%apply(y%phi, d)
        y%theta(:, o%sets%ghost) = d
      end if
      r = y
      r%q = 0.0_wp
      r%theta = 0.0_wp
      call add_contacts(self%partition, y, r)
      call add_elements(self, o, y, r)
      d = r%q(:, o%sets%ghost)
      call o%op%ghost%transposed(d, r%u)
      if (b%turns) then
        d = r%theta(:, o%sets%ghost)
        call o%op%ghost_phi%transposed(d, r%phi)
        r%theta(:, o%sets%ghost) = 0.0_wp
      end if
      r%q(:, o%sets%ghost) = 0.0_wp
      where (o%own%held) r%u = 0.0_wp
      where (o%own%held_phi) r%phi = 0.0_wp
      u = r%u
      phi = r%phi
      r%u = 0.0_wp
      r%phi = 0.0_wp
      r%u(:, b%move%at) = u(:, b%move%at)
      if (b%turns) r%phi(:, b%turn%at) = phi(:, b%turn%at)
      r%q = merge(r%q, 0.0_wp, spread(self%light, 1, 3) > 0.0_wp)
      r%theta = merge(r%theta, 0.0_wp, spread(self%inverse_inertia, 1, 3) > 0.0_wp)
    end associate
  end subroutine bound_stiffness_times

  !> Accelerations in place of forces.
  subroutine accelerate_bound(self, o, r)
    class(bridged_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: r
    r%q = r%q*spread(self%light, 1, 3)
    r%theta = r%theta*spread(self%inverse_inertia, 1, 3)
    call self%bridge%move%node_accelerations(r%u)
    if (self%bridge%turns) call self%bridge%turn%node_accelerations(r%phi)
  end subroutine accelerate_bound

  !> Work of forces on what moves.
  pure real(wp) function bound_work(self, o, y, r) result(work)
    class(bridged_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y, r
    work = sum(y%q*r%q) + sum(y%theta*r%theta) + sum(y%u*r%u) + sum(y%phi*r%phi)
  end function bound_work
end module cpl_bridge_limit
