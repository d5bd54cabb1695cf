!> Drag on grains that do not move with the liquid's skeleton, a continuous field.
!!
!! The linear fields of the bricks, averaged at the nodes, make a trilinear field P v that is exact
!! for every rigid motion and uniform strain. What is left, R v = v - P v, is dragged: F = -R'(c V
!! R v) dissipates for any motion and has no resultant and no moment. What a grain does against its
!! brick, and what bricks strain without their neighbours, which the divergence does not see, are
!! both in it. eq. D.40
module dem_pore_drag
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type
  use dem_pore_grid, only: brick_count, node_count, corners_of, sign_of
  use dem_pore_medium, only: drag_in
  use dem_pore_tips, only: clear_tip_drag
  use dem_pore_tools, only: is_in, tool_drag
  implicit none
  private
  public :: set_drag

contains

  !> Forces of the exchange that begins.
  subroutine set_drag(d, field)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: field(:, :, :)  !! (4, 3, bricks) fitted to the grains' velocities
    real(wp) :: at(3, node_count(d%pore%grid)), many(node_count(d%pore%grid))
    real(wp) :: pull(3, 8, size(field, 3))
    integer(i4) :: c, a, node(8)

    call average_fields(d, field, at, many)
    !$omp parallel do default(none) schedule(static) private(c) shared(d, at, pull)
    do c = 1, size(pull, 3)
      call drag_brick(d, c, drag_rate(d, c), at(:, corners_of(d%pore%grid, c)), pull(:, :, c))
    end do
    !$omp end parallel do
    at = 0.0_wp
    do c = 1, size(field, 3)
      node = corners_of(d%pore%grid, c)
      do a = 1, 8
        at(:, node(a)) = at(:, node(a)) + pull(:, a, c)
      end do
    end do
    do a = 1, size(many)
      at(:, a) = at(:, a)/max(many(a), 1.0_wp)
    end do
    !$omp parallel do default(none) schedule(static) private(c) shared(d, at, pull)
    do c = 1, size(pull, 3)
      call give_back(d, c, at(:, corners_of(d%pore%grid, c)))
    end do
    !$omp end parallel do
    if (d%pore%fit%tools%n > 0) d%pore%fit%tools%drag = 0.0_wp
    call clear_tip_drag(d%pore%fit%tools)
    do c = 1, size(pull, 3)
      if (is_in(d%pore%fit%tools, c)) &
        call tool_drag(d%pore%grid, c, returned(d, c, at(:, corners_of(d%pore%grid, c))), &
                       d%pore%fit%tools)
    end do
  end subroutine set_drag

  !> Mean at each node of the linear fields of the bricks around it that have grains, and how many
  !! these are.
  subroutine average_fields(d, field, at, many)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: field(:, :, :)
    real(wp), intent(out) :: at(:, :)  !! (3, nodes) [m/s]
    real(wp), intent(out) :: many(:)   !! (nodes)
    integer(i4) :: c, a, node(8)
    at = 0.0_wp
    many = 0.0_wp
    do c = 1, brick_count(d%pore%grid)
      if (d%pore%fit%start(c + 1) == d%pore%fit%start(c) .and. &
          .not. is_in(d%pore%fit%tools, c)) cycle
      node = corners_of(d%pore%grid, c)
      do a = 1, 8
        at(:, node(a)) = at(:, node(a)) + matmul(corner_base(a), field(:, :, c))
        many(node(a)) = many(node(a)) + 1.0_wp
      end do
    end do
    do a = 1, size(many)
      at(:, a) = at(:, a)/max(many(a), 1.0_wp)
    end do
  end subroutine average_fields

  !> 1 and the place of a corner in its brick.
  pure function corner_base(a) result(base)
    integer(i4), intent(in) :: a
    real(wp) :: base(4)
    base = [1.0_wp, 0.5_wp*sign_of(:, a)]
  end function corner_base

  !> -c V R v of the grains of a brick, and its sums with the functions of the corners.
  pure subroutine drag_brick(d, c, rate, corner, pull)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: rate          !! [Pa s/m^2]
    real(wp), intent(in) :: corner(3, 8)  !! velocities of the corners [m/s]
    real(wp), intent(out) :: pull(3, 8)   !! [N]
    real(wp) :: n(8), low(3), high(3), force(3), w
    integer(i4) :: k, i, a
    pull = 0.0_wp
    associate (fit => d%pore%fit)
      do k = fit%start(c), fit%start(c + 1) - 1
        i = fit%grain(k)
        low = 0.5_wp - fit%local(:, k)
        high = 0.5_wp + fit%local(:, k)
        n(1:2) = [low(1), high(1)]*low(2)
        n(3:4) = [low(1), high(1)]*high(2)
        n(5:8) = n(1:4)*high(3)
        n(1:4) = n(1:4)*low(3)
        w = -rate*fit%weight(k)
        force = d%grains%v(:, i)
        do a = 1, 8
          force = force - n(a)*corner(:, a)
        end do
        force = w*force
        do a = 1, 8
          pull(:, a) = pull(:, a) + n(a)*force
        end do
        d%pore%drag(:, i) = force
      end do
    end associate
  end subroutine drag_brick

  !> Force at the nodes of a brick as a density, linear within it, for what was fitted there.
  pure function returned(d, c, corner) result(q)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: corner(3, 8)  !! forces over the number of bricks [N]
    real(wp) :: q(4, 3)
    integer(i4) :: a, j
    q = 0.0_wp
    do a = 1, 8
      do j = 1, 3
        q(:, j) = q(:, j) + corner(j, a)*corner_base(a)
      end do
    end do
    q = matmul(d%pore%fit%inverse(:, :, c), q)
  end function returned

  !> The forces at the nodes go back to the grains of the bricks that made the nodes' velocities.
  pure subroutine give_back(d, c, corner)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: corner(3, 8)  !! forces over the number of bricks [N]
    real(wp) :: q(4, 3)
    integer(i4) :: k, i, j
    q = returned(d, c, corner)
    associate (fit => d%pore%fit, drag => d%pore%drag)
      do k = fit%start(c), fit%start(c + 1) - 1
        i = fit%grain(k)
        do j = 1, 3
          drag(j, i) = drag(j, i) - fit%weight(k)*(q(1, j) + dot_product(fit%local(:, k), q(2:, j)))
        end do
      end do
    end associate
  end subroutine give_back

  !> Drag over volume and relative velocity in a brick, bounded by what stops its lightest grain
  !! within the exchange [Pa s/m^2].
  pure real(wp) function drag_rate(d, c) result(rate)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: c
    real(wp), parameter :: clear = 0.01_wp, safe = 4.0_wp
    real(wp) :: lightest
    integer(i4) :: k
    associate (pore => d%pore, fit => d%pore%fit)
      lightest = huge(1.0_wp)
      do k = fit%start(c), fit%start(c + 1) - 1
        lightest = min(lightest, d%grains%mass(fit%grain(k))/fit%weight(k))
      end do
      rate = drag_in(pore, c)/(pore%liquid%factor*max(1.0_wp - pore%porosity(c), clear))
      rate = rate/(1.0_wp + safe*rate*pore%span/lightest)
    end associate
  end function drag_rate
end module dem_pore_drag
