!> The energy partition of an overlap handed to the solvers: weights of contacts between ghosts and
!! of quadrature points (theory: overlap coupling, energy partition).
module cpl_overlap_weights
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_describe, verb_set
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_order, only: sort_order
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_ghost, part_free
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: set_partition

  real(wp), parameter :: near = 1.2_wp  !! distance over sum of radii of ghosts that may touch

contains

  !> SET contact_weight and quad_weight.
  subroutine set_partition(o, solvers, choices, timers, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: pair(:, :)
    real(wp), allocatable :: w(:), beta(:)

    call near_pairs(o, pair)
    call weigh_contacts(o, pair, choices%overlap%partition == 'ramp', w)
    associate (grains => solvers(side_grains))
      call grains%start_request(verb_set, o%step, grains%time, grains%time)
      call grains%request%put_text('what', 'contact_weight')
      call grains%request%put_int('ids', reshape(o%pack%id(o%sets%ghost(reshape(pair, &
        [size(pair)]))), shape(pair)))
      call grains%request%put('value', w)
      call grains%ask(timers, errors)
      if (errors%any()) return
    end associate
    associate (solid => solvers(side_solid))
      call weigh_points(o, solid, choices%overlap%partition == 'ramp', beta, timers, errors)
      if (errors%any()) return
      call solid%start_request(verb_set, o%step, solid%time, solid%time)
      call solid%request%put_text('what', 'quad_weight')
      call solid%request%put('value', beta)
      call solid%ask(timers, errors)
    end associate
  end subroutine set_partition

  !> Ghosts that touch or may come to touch, by their rows; found along x.
  subroutine near_pairs(o, pair)
    type(overlap_type), intent(in) :: o
    integer(i4), allocatable, intent(out) :: pair(:, :)
    integer(i4) :: order(o%op%ghosts), i, j, a, b, n, pass
    real(wp) :: radius(o%op%ghosts), reach

    radius = o%pack%radius(o%sets%ghost)
    call sort_order(o%x_ghost(1, :), order)
    reach = 2.0_wp*near*maxval(radius)
    do pass = 1, 2
      n = 0
      do i = 1, size(order)
        a = order(i)
        do j = i + 1, size(order)
          b = order(j)
          if (o%x_ghost(1, b) - o%x_ghost(1, a) > reach) exit
          if (sum((o%x_ghost(:, a) - o%x_ghost(:, b))**2) > (near*(radius(a) + radius(b)))**2) cycle
          n = n + 1
          if (pass == 2) pair(:, n) = [a, b]
        end do
      end do
      if (pass == 1) allocate (pair(2, n))
    end do
  end subroutine near_pairs

  !> Share of the grains at distance s from the free grains' elements.
  pure real(wp) function omega(o, s)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: s  !! [m]
    omega = min(1.0_wp, max(0.0_wp, (o%sets%depth - s)/(o%sets%depth - o%sets%d_max)))
  end function omega

  !> Contacts between ghosts: the mean of omega at both ends.
  subroutine weigh_contacts(o, pair, ramp, w)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(in) :: pair(:, :)
    logical, intent(in) :: ramp
    real(wp), allocatable, intent(out) :: w(:)
    real(wp) :: share(o%op%ghosts)
    integer(i4) :: g
    share = 1.0_wp
    if (ramp) then
      do g = 1, o%op%ghosts
        share(g) = omega(o, o%sets%hull%distance(o%x_ghost(:, g)))
      end do
    end if
    w = 0.5_wp*(share(pair(1, :)) + share(pair(2, :)))
  end subroutine weigh_contacts

  !> Quadrature points: 0 under free grains, 1 - omega under ghosts, else 1.
  subroutine weigh_points(o, solid, ramp, beta, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: ramp
    real(wp), allocatable, intent(out) :: beta(:)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :)
    integer(i4), allocatable :: element(:)
    integer(i4) :: q

    call solid%start_request(verb_describe, 0_i8, solid%time, solid%time)
    call solid%request%put_text('what', 'quadrature')
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take('x', x, errors)
    call solid%reply%take_int('element', element, errors)
    if (errors%any()) return
    allocate (beta(size(element)), source=1.0_wp)
    do q = 1, size(element)
      select case (o%sets%part(element(q)))
      case (part_free)
        beta(q) = 0.0_wp
      case (part_ghost)
        if (ramp) beta(q) = 1.0_wp - omega(o, o%sets%hull%distance(x(:, q)))
      end select
    end do
  end subroutine weigh_points
end module cpl_overlap_weights
