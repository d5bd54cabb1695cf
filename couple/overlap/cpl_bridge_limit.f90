!> Is the step of the grains stable with a bridging domain? Power iteration on free grains and nodes
!! of the domain with the grains that are bound to them; elements that only kick between exchanges
!! are not part of it (theory: overlap coupling, Bridging domain).
module cpl_bridge_limit
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_timers, only: timers_type
  use cpl_coupled, only: coupled_type, motion_type, add_contacts, add_elements
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_overlap_weights, only: read_contacts
  use cpl_partition, only: ghost_ghost
  use cpl_solver, only: cpl_solver_type, side_grains
  use cpl_weights, only: omega_mean
  implicit none
  private
  public :: check_bridge_step

  integer(i4), parameter :: most_rounds = 300, quiet_rounds = 5
  real(wp), parameter :: settled = 1.0e-4_wp  !! change of the frequency in a round, relative

contains

  !> D425: the step of the grains is above the stable step 2/omega. With lumped multipliers, which
  !! bind less, the limit of the grains alone (SET mass_factor) stands beside it.
  subroutine check_bridge_step(o, solvers, points, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(points_type), intent(in) :: points
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(contacts_type) :: contacts
    type(coupled_type) :: coupled
    real(wp) :: rate

    if (o%bridge%lumped) return
    call read_contacts(solvers(side_grains), contacts, timers, errors)
    if (errors%any()) return
    call timers%start('stable step')
    call coupled%build(o, contacts, points, o%pack%slimmest)
    call weigh_contacts(o, coupled)
    rate = highest_rate(o, coupled)
    call timers%stop('stable step')
    if (.not. rate > 0.0_wp) return
    o%step_limit = 2.0_wp/rate
    associate (grains => solvers(side_grains))
      if (grains%dt <= o%step_limit) return
      call errors%add('D425', 'the step of the grains, '//str(grains%dt)//' s, is above the '// &
        'stable step of the overlap, '//short_number(o%step_limit)//' s', grains%deck, &
        'shorten dt in its deck; if the grains alone allow the step, moduli of the solid that '// &
        'are too stiff for the pack are the cause')
    end associate
  end subroutine check_bridge_step

  !> Contacts between bound grains count by their weights, those of the ramp.
  subroutine weigh_contacts(o, coupled)
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(inout) :: coupled
    integer(i4) :: c
    associate (p => coupled%partition)
      do c = 1, size(p%pair, 2)
        if (.not. ghost_ghost(p, c)) cycle
        p%stiffness(:, c) = p%stiffness(:, c)*max(o%bridge%least, omega_mean( &
          p%depth(p%pair(1, c)), p%depth(p%pair(2, c)), o%sets%depth, 0.0_wp))
      end do
    end associate
  end subroutine weigh_contacts

  !> Largest eigenvalue of M^-1 K by its quotient r'a / y'r, as cpl_overlap_limit has it [1/s].
  real(wp) function highest_rate(o, coupled) result(rate)
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    type(motion_type) :: y, r, a
    real(wp) :: square, before, power, largest
    integer(i4) :: quiet, rounds

    call coupled%start(o, y)
    call start_nodes(o, y)
    square = 0.0_wp
    quiet = 0
    rounds = 0
    rate = 0.0_wp
    do while (rounds < most_rounds .and. quiet < quiet_rounds)
      rounds = rounds + 1
      call stiffness_times(o, coupled, y, r)
      a = r
      a%q = a%q*spread(coupled%light, 1, 3)
      a%theta = a%theta*spread(coupled%nimble, 1, 3)
      call o%bridge%move%node_accelerations(a%u)
      if (o%bridge%turns) call o%bridge%turn%node_accelerations(a%phi)
      power = work(y, r)
      if (.not. power > 0.0_wp) return
      before = square
      square = work(a, r)/power
      quiet = merge(quiet + 1, 0_i4, abs(square - before) <= 2.0_wp*settled*square)
      largest = max(maxval(abs(a%q)), maxval(abs(a%u)), tiny(1.0_wp))
      y%q = a%q/largest
      y%theta = a%theta/largest
      y%u = a%u/largest
      y%phi = a%phi/largest
    end do
    rate = sqrt(square)
  end function highest_rate

  !> Nodes of the domain take part, of no special form.
  subroutine start_nodes(o, y)
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: y
    integer(i4) :: k, c
    associate (at => o%bridge%move%at)
      do k = 1, size(at)
        do c = 1, 3
          y%u(c, at(k)) = sin(2.1_wp*k + 1.9_wp*c)
        end do
      end do
    end associate
    where (o%held) y%u = 0.0_wp
  end subroutine start_nodes

  !> r = K y, with bound grains where the nodes are; r of them is handed to the nodes.
  subroutine stiffness_times(o, coupled, y, r)
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    type(motion_type), intent(inout) :: y, r
    real(wp), dimension(3, o%op%ghosts) :: d
    real(wp) :: u(3, o%op%nodes), phi(3, o%op%nodes_phi)

    call o%op%ghost%apply(y%u, d)
    y%q(:, o%sets%ghost) = d
    if (o%bridge%turns) then
      call o%op%ghost_phi%apply(y%phi, d)
      y%theta(:, o%sets%ghost) = d
    end if
    r = y
    r%q = 0.0_wp
    r%theta = 0.0_wp
    call add_contacts(coupled%partition, y, r)
    call add_elements(coupled, o, y, r)
    d = r%q(:, o%sets%ghost)
    call o%op%ghost%transposed(d, r%u)
    if (o%bridge%turns) then
      d = r%theta(:, o%sets%ghost)
      call o%op%ghost_phi%transposed(d, r%phi)
      r%theta(:, o%sets%ghost) = 0.0_wp
    end if
    r%q(:, o%sets%ghost) = 0.0_wp
    where (o%held) r%u = 0.0_wp
    where (o%held_phi) r%phi = 0.0_wp
    u = r%u
    phi = r%phi
    r%u = 0.0_wp
    r%phi = 0.0_wp
    r%u(:, o%bridge%move%at) = u(:, o%bridge%move%at)
    if (o%bridge%turns) r%phi(:, o%bridge%turn%at) = phi(:, o%bridge%turn%at)
    r%q = merge(r%q, 0.0_wp, spread(coupled%light, 1, 3) > 0.0_wp)
    r%theta = merge(r%theta, 0.0_wp, spread(coupled%nimble, 1, 3) > 0.0_wp)
  end subroutine stiffness_times

  !> Work of forces on what moves.
  pure real(wp) function work(y, r)
    type(motion_type), intent(in) :: y, r
    work = sum(y%q*r%q) + sum(y%theta*r%theta) + sum(y%u*r%u) + sum(y%phi*r%phi)
  end function work
end module cpl_bridge_limit
