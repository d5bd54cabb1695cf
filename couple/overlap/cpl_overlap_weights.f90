!> The energy partition of an overlap sent to the solvers: weights of contacts between ghosts and
!! of quadrature points (theory: overlap coupling, energy partition).
!!
!! They are found once, in the reference state, and are in the checkpoint. Ghosts that do not
!! touch yet have the ramp's weight, for when they will.
module cpl_overlap_weights
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_describe, verb_set
  use talus_port_names, only: field_element, field_force, field_ids, field_law, field_mean, &
    field_moduli, field_normal, field_point, field_stiffness, field_tangent, field_value, &
    field_weight, field_what, field_x, what_contact_weight, what_contacts, what_moduli, &
    what_quad_weight, what_quadrature
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_weight_choice, only: weight_choice_type, choose_weights, weight_choice_of, weights_fit, &
    weights_share
  use cpl_order, only: sort_order
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type, fill_partition
  use cpl_partition, only: partition_type, ghost_ghost
  use cpl_sets, only: part_ghost, part_free, part_none
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  use cpl_weights, only: omega, omega_mean, kernel_shares
  implicit none
  private
  public :: set_partition, send_weights, send_contacts, find_pairs, read_contacts, read_points

  real(wp), parameter :: near = 1.2_wp  !! distance over sum of radii of ghosts that may touch

contains

  !> Weights of contacts and points, found from what both sides describe.
  subroutine set_partition(o, choices, contacts, points, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(contacts_type), intent(in) :: contacts  !! whole; not used for ramps
    type(points_type), intent(in) :: points
    type(error_list_type), intent(inout) :: errors
    o%share%shared = choices%overlap%partition
    call ramp(o, choices, points)
    if (any(choices%overlap%partition == [character(len=5) :: 'auto', 'fit', 'share'])) &
      call fit(o, choices, contacts, points, errors)
  end subroutine set_partition

  !> SET contact_weight and quad_weight.
  subroutine send_weights(o, solvers, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call send_contacts(o, solvers(side_grains), o%share%weight, timers, errors)
    if (errors%any()) return
    associate (solid => solvers(side_solid))
      call solid%start_request(verb_set, o%step, solid%time, solid%time)
      call solid%request%put_text(field_what, what_quad_weight)
      call solid%request%put(field_value, o%share%beta)
      call solid%ask(timers, errors)
    end associate
  end subroutine send_weights

  subroutine send_contacts(o, grains, value, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: grains
    real(wp), intent(in) :: value(:)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call grains%start_request(verb_set, o%step, grains%time, grains%time)
    call grains%request%put_text(field_what, what_contact_weight)
    call grains%request%put_int(field_ids, o%share%weight_ids)
    call grains%request%put(field_value, value)
    call grains%ask(timers, errors)
  end subroutine send_contacts

  !> Ramps, or ones, of all ghosts that are close to one another and of all points.
  subroutine ramp(o, choices, points)
    type(overlap_type), intent(inout) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(points_type), intent(in) :: points
    real(wp), allocatable :: depth(:)
    integer(i4) :: g, q
    real(wp) :: flat
    logical :: fades

    fades = choices%overlap%partition /= 'twice'
    flat = merge(0.0_wp, o%sets%d_max, o%rules%least_weight > 0.0_wp)
    allocate (depth(o%op%ghosts))
    do g = 1, o%op%ghosts
      depth(g) = o%sets%hull%distance(o%map%x_ghost(:, g))
    end do
    associate (pair => o%share%active_ghosts)
      allocate (o%share%weight(size(pair, 2)), o%share%beta(size(points%element)), source=1.0_wp)
      if (fades) o%share%weight = choices%overlap%rho*omega_mean(depth(pair(1, :)), &
        depth(pair(2, :)), o%sets%depth, flat)
      if (fades .and. o%rules%least_weight > 0.0_wp) o%share%weight = clipped(o%share%weight)
    end associate
    do q = 1, size(o%share%beta)
      select case (o%sets%part(points%element(q)))
      case (part_free, part_none)
        o%share%beta(q) = 0.0_wp
      case (part_ghost)
        if (fades) o%share%beta(q) = 1.0_wp - omega(o%sets%hull%distance(points%x(:, q)), &
                                              o%sets%depth, flat)
        if (fades .and. o%rules%least_weight > 0.0_wp) o%share%beta(q) = clipped(o%share%beta(q))
      end select
    end do

  contains

    !> Weights of a bridging domain stay off 0 and 1.
    pure elemental real(wp) function clipped(weight)
      real(wp), intent(in) :: weight
      clipped = min(1.0_wp - o%rules%least_weight, max(o%rules%least_weight, weight))
    end function clipped
  end subroutine ramp

  !> The joint fit where it is asked for, or where the pack is a lattice; `auto` keeps the ramps
  !! where the fit finds no weights. Shares of the stiffness where contacts between ghosts do not
  !! count.
  subroutine fit(o, choices, contacts, points, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(error_list_type), intent(inout) :: errors
    type(partition_type) :: partition
    type(weight_choice_type) :: method
    type(error_list_type) :: refused
    real(wp), allocatable :: w(:), beta(:)
    integer(i4), allocatable :: row(:), at(:)
    integer(i4) :: k

    call fill_partition(o, contacts, points, partition, row, at)
    call weight_choice_of(choices%overlap%partition, method, '&overlap', errors)
    method%depth = o%sets%depth
    method%d_max = o%sets%d_max
    method%rho = choices%overlap%rho
    if (method%kind == weights_share) call find_shares(o, partition, points%x(:, at), method%share)
    call choose_weights(partition, method, w, beta, o%share%fit, refused)
    o%share%shared = method%name
    o%share%disorder = method%disorder
    if (refused%any() .and. choices%overlap%partition == 'auto') then
      o%share%shared = 'ramp'
      o%share%unfit = .true.
    else if (refused%any()) then
      call errors%add(refused%item(1)%code, refused%item(1)%message, refused%item(1)%place, &
                      refused%item(1)%hint)
    else if (method%kind == weights_fit .or. method%kind == weights_share) then
      do k = 1, size(at)
        o%share%beta(at(k)) = beta(k)
      end do
      if (method%kind == weights_share) o%share%weight = 0.0_wp
      if (method%kind == weights_fit) call put_weights(o, partition, w)
    end if
  end subroutine fit

  !> Share of the coarse-grained stiffness at points that contacts of free grains have.
  subroutine find_shares(o, partition, x, share)
    type(overlap_type), intent(in) :: o
    type(partition_type), intent(in) :: partition
    real(wp), intent(in) :: x(:, :)                 !! (3, points) [m]
    real(wp), allocatable, intent(out) :: share(:)  !! (points) [-]
    real(wp), parameter :: none(3) = 0.0_wp
    real(wp) :: middle(3, size(partition%pair, 2))
    integer(i4) :: c
    do c = 1, size(middle, 2)
      middle(:, c) = o%pack%x(:, partition%pair(1, c)) + 0.5_wp*partition%branch(c)
    end do
    call kernel_shares(partition, x, middle, none, o%sets%d_max, share)
  end subroutine find_shares

  !> Weights of contacts into the list of ghosts that may touch.
  subroutine put_weights(o, partition, w)
    type(overlap_type), intent(inout) :: o
    type(partition_type), intent(in) :: partition
    real(wp), intent(in) :: w(:)
    real(wp), allocatable :: key(:)
    integer(i4), allocatable :: order(:)
    real(wp) :: wanted
    integer(i4) :: c, low, high, middle

    allocate (key(size(o%share%weight)), order(size(o%share%weight)))
    key = key_of(minval(o%share%weight_ids, 1), maxval(o%share%weight_ids, 1))
    call sort_order(key, order)
    do c = 1, size(w)
      if (.not. ghost_ghost(partition, c)) cycle
      associate (id => o%pack%id(partition%pair(:, c)))
        wanted = key_of(minval(id), maxval(id))
      end associate
      low = 1
      high = size(order)
      do while (low < high)
        middle = (low + high)/2
        if (key(order(middle)) < wanted) then
          low = middle + 1
        else
          high = middle
        end if
      end do
      if (low > size(order)) cycle
      if (.not. abs(key(order(low)) - wanted) > 0.0_wp) o%share%weight(order(low)) = w(c)
    end do

  contains

    !> One number of two ids, exact below 9e7.
    pure elemental real(wp) function key_of(a, b)
      integer(i8), intent(in) :: a, b
      real(wp), parameter :: stride = 9.0e7_wp
      key_of = stride*real(a, wp) + real(b, wp)
    end function key_of
  end subroutine put_weights

  !> DESCRIBE contacts.
  subroutine read_contacts(grains, contacts, timers, errors)
    type(cpl_solver_type), intent(inout) :: grains
    type(contacts_type), intent(inout) :: contacts
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call grains%start_request(verb_describe, 0_i8, grains%time, grains%time)
    call grains%request%put_text(field_what, what_contacts)
    call grains%ask(timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_ids, contacts%ids, errors)
    call grains%reply%take(field_point, contacts%point, errors)
    call grains%reply%take(field_normal, contacts%normal, errors)
    call grains%reply%take(field_force, contacts%force, errors)
    if (allocated(contacts%force)) contacts%force = -contacts%force  ! at the port: on the second
    call grains%reply%take(field_stiffness, contacts%stiffness, errors)
  end subroutine read_contacts

  !> DESCRIBE quadrature and moduli.
  subroutine read_points(solid, points, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    type(points_type), intent(inout) :: points
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_request(verb_describe, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_quadrature)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take(field_x, points%x, errors)
    call solid%reply%take(field_weight, points%weight, errors)
    call solid%reply%take_int(field_element, points%element, errors)
    if (errors%any()) return
    call solid%start_request(verb_describe, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_moduli)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take(field_moduli, points%moduli, errors)
    call solid%reply%take_int(field_mean, points%mean, errors)
    if (.not. solid%reply%has(field_tangent)) return
    call solid%reply%take(field_tangent, points%tangent, errors)
    call solid%reply%take_int(field_law, points%law, errors)
  end subroutine read_points

  !> List the ghosts that touch or may come to touch.
  subroutine find_pairs(o)
    type(overlap_type), intent(inout) :: o
    call near_pairs(o, o%share%active_ghosts)
    associate (pair => o%share%active_ghosts)
      o%share%weight_ids = reshape(o%pack%id(o%sets%ghost(reshape(pair, [size(pair)]))), &
        shape(pair))
    end associate
  end subroutine find_pairs

  !> Ghosts that touch or may come to touch, by their rows; found along x.
  subroutine near_pairs(o, pair)
    type(overlap_type), intent(in) :: o
    integer(i4), allocatable, intent(out) :: pair(:, :)
    integer(i4) :: order(o%op%ghosts), i, j, a, b, n, pass
    real(wp) :: radius(o%op%ghosts), reach

    radius = o%pack%radius(o%sets%ghost)
    call sort_order(o%map%x_ghost(1, :), order)
    reach = 2.0_wp*near*maxval(radius)
    do pass = 1, 2
      n = 0
      do i = 1, size(order)
        a = order(i)
        do j = i + 1, size(order)
          b = order(j)
          if (o%map%x_ghost(1, b) - o%map%x_ghost(1, a) > reach) exit
          if (sum((o%map%x_ghost(:, a) - o%map%x_ghost(:, b))**2) > (near*(radius(a) &
            + radius(b)))**2) cycle
          n = n + 1
          if (pass == 2) pair(:, n) = [a, b]
        end do
      end do
      if (pass == 1) allocate (pair(2, n))
    end do
  end subroutine near_pairs
end module cpl_overlap_weights
