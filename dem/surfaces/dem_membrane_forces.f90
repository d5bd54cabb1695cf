!> Contact forces between grains and surfaces in runs with membranes, whose grains may have many
!! contacts: blocks of lanes one after another, each contact with its sign (see dem_membrane_find).
!! eq. D.13
module dem_membrane_forces
  use talus_kinds, only: wp, i4, i8
  use dem_state, only: dem_data_type, dem_law_type, lanes, history_size, history_point, column_count
  use dem_surface_state, only: dem_surfaces_type, surface_membrane
  use dem_figure, only: figure_type
  use dem_surface_feature, only: touches_type, features_type
  use dem_surface_find, only: find_touches
  use dem_surface_contacts, only: leave_grain, keep_block, set_loads
  use dem_surface_forces, only: work_grain, figure_of, fill_block, distance, law_of, take_lane, &
    about_centre, clear_shares, share_loads, far_apart
  use dem_membrane_match, only: bear_pairs
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: share_near, share_anew

  real(wp), parameter :: close_by = 0.05_wp  !! far_apart on a membrane, where pairs come and go

contains

  !> Contacts of this thread's run of the grains near surfaces.
  subroutine share_near(d, h, travel, me, threads)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h       !! time since the last evaluation [s]
    real(wp), intent(in) :: travel  !! no body has moved further since the list was made [m]
    integer(i4), intent(in) :: me, threads
    integer(i4) :: g
    associate (s => d%surfaces)
      do g = 1 + int(int(s%list%near, i8)*me/threads, i4), &
        int(int(s%list%near, i8)*(me + 1)/threads, i4)
        if (s%list%contacts(g) == 0 .and. travel < 0.5_wp*s%list%least_gap(g)) then
          call leave_grain(s%list, g)
        else if (allocated(s%membranes)) then
          call work_on_membranes(d, g, h)
        else
          call work_grain(d, g, h)
        end if
      end do
    end associate
  end subroutine share_near

  !> All contacts of near grain g.
  subroutine work_on_membranes(d, g, h)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: h
    type(figure_type) :: figure
    type(features_type) :: features
    type(touches_type) :: touches
    real(wp) :: history(ubound(d%surfaces%list%history, 1), history_size), load(6)
    real(wp) :: columns(column_count)
    integer(i4) :: i, count, low

    i = d%surfaces%list%near_grain(g)
    figure = figure_of(d, i)
    figure%span = figure%radius
    associate (s => d%surfaces)
      call find_touches(s, g, figure, features, touches)
      call match(s, g, h, d%grains%radius(i), touches, count, history)
      if (count == 0) then
        call leave_grain(s%list, g)
        call clear_shares(s, g)
        return
      end if
      load = 0.0_wp
      columns = 0.0_wp
      do low = 0, count - 1, lanes
        call work_block(d, g, h, low, count, touches, history, load, columns)
      end do
      call about_centre(d%pairs%body(1:3, i), load)
      call set_loads(s%list, g, touches%n, load, columns)
      call share_loads(s, g, features, touches)
    end associate
  end subroutine work_on_membranes

  !> Forces on the corners from the current contacts, whose list was rebuilt where they were worked.
  subroutine share_anew(d)
    type(dem_data_type), intent(inout) :: d
    type(figure_type) :: figure
    type(features_type) :: features
    type(touches_type) :: touches
    integer(i4) :: g
    associate (s => d%surfaces)
      do g = 1, s%list%near
        if (s%list%contacts(g) == 0) cycle
        figure = figure_of(d, s%list%near_grain(g))
        figure%span = figure%radius
        call find_touches(s, g, figure, features, touches)
        if (touches%n == s%list%contacts(g)) call share_loads(s, g, features, touches)
      end do
    end associate
  end subroutine share_anew

  !> Contacts low+1 to low+lanes of near grain g, of `count` with those that have ended.
  subroutine work_block(d, g, h, low, count, touches, history, load, total)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: g, low, count
    real(wp), intent(in) :: h
    type(touches_type), intent(in) :: touches
    real(wp), intent(in) :: history(:, :)
    real(wp), intent(inout) :: load(6)               !! on the grain, about the origin
    real(wp), intent(inout) :: total(column_count)  !! works of the step [J]
    type(dem_block_type) :: block
    real(wp) :: mine(lanes, history_size), columns(column_count)
    integer(i4) :: i, k, many

    i = d%surfaces%list%near_grain(g)
    many = min(lanes, count - low)
    call fill_block(touches, low, many, d%pairs%body(:, i), block)
    mine = 0.0_wp
    mine(:many, :) = history(low + 1:low + many, :)
    call apply_laws(d, i, h, touches%part(low + 1:low + many), touches%sign(low + 1:low + many), &
                    block, mine, columns)
    many = min(lanes, touches%n - low)
    total = total + columns
    call keep_block(d%surfaces%list, g, low, many, touches, block, mine)
    do k = 1, many
      load = load + [block%load%fx(k), block%load%fy(k), block%load%fz(k), &
                     block%load%mx(k), block%load%my(k), block%load%mz(k)]
    end do
  end subroutine work_block

  !> History of each contact from the nearest of the last step, each taken once; what is left over
  !! has ended and is worked once more, after the contacts, for its energy.
  pure subroutine match(s, g, h, radius, touches, count, history)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: h, radius
    type(touches_type), intent(inout) :: touches
    integer(i4), intent(out) :: count
    real(wp), intent(out) :: history(:, :)
    real(wp) :: cost(touches%n, s%list%contacts(g))
    integer(i4) :: k, j, best(2), mine(s%list%contacts(g)), source(ubound(history, 1))

    mine = 0
    source = 0
    history = 0.0_wp
    do j = 1, s%list%contacts(g)
      do k = 1, touches%n
        cost(k, j) = distance(s, g, j, h, radius, touches, k)
        if (s%kind(touches%body(k)) == surface_membrane .and. .not. &
            same_critical(s, g, j, touches%sign(k), cost(k, j))) cost(k, j) = huge(1.0_wp)
      end do
    end do
    count = touches%n
    do while (s%list%contacts(g) > 0 .and. touches%n > 0)
      best = minloc(cost)
      if (cost(best(1), best(2)) > far_apart) exit
      mine(best(2)) = best(1)
      source(best(1)) = best(2)
      cost(best(1), :) = huge(1.0_wp)
      cost(:, best(2)) = huge(1.0_wp)
    end do
    call bear_pairs(s, g, h, radius, touches, source)
    do j = 1, s%list%contacts(g)
      if (mine(j) > 0) cycle
      if (count == ubound(history, 1)) cycle
      count = count + 1
      source(count) = j
      touches%part(count) = s%list%part(j, g)
      touches%sign(count) = s%list%sign(j, g)
      touches%foot(:, count) = s%list%foot(j, :, g) + h*s%list%motion(j, 1:3, g)
      touches%normal(:, count) = s%list%normal(j, :, g)
      touches%motion(:, count) = s%list%motion(j, :, g)
    end do
    do k = 1, count
      j = source(k)
      if (j == 0) cycle
      history(k, :) = s%list%history(j, :, g)
      history(k, history_point:history_point + 2) = s%list%point(j, :, g) &
        - (touches%foot(:, k) - h*touches%motion(1:3, k))
    end do
  end subroutine match

  !> May contact j of a membrane go on as a new one of this sign and distance?
  pure logical function same_critical(s, g, j, sign, distance) result(same)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g, j
    real(wp), intent(in) :: sign, distance
    same = distance < close_by .and. .not. abs(sign - s%list%sign(j, g)) > 0.0_wp
  end function same_critical

  !> The law of each contact's materials.
  pure subroutine apply_laws(d, i, h, part, sign, b, history, columns)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i        !! grain
    real(wp), intent(in) :: h
    integer(i4), intent(in) :: part(:)  !! of each contact
    real(wp), intent(in) :: sign(:)     !! weight [-]
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(out) :: columns(column_count)
    type(dem_block_type) :: mine
    real(wp) :: m_star(lanes), weight(lanes), some(column_count), kept(lanes, history_size)
    real(wp) :: none(lanes, 0)
    type(dem_law_type) :: of_both
    integer(i4) :: k, law(size(part)), lead

    columns = 0.0_wp
    m_star = d%grains%mass(i)
    weight = 1.0_wp
    weight(:size(part)) = sign
    law = [(law_of(d%surfaces, part(k)), k=1, size(part))]
    do lead = 1, size(part)
      if (any(law(:lead - 1) == law(lead))) cycle
      mine = b
      kept = history
      do k = 1, size(part)
        if (law(k) == law(lead)) cycle
        mine%gap(k) = 1.0_wp
        kept(k, :) = 0.0_wp
      end do
      of_both = d%laws(abs(law(lead)), d%grains%material(i))
      if (law(lead) < 0) of_both%share = 0.0_wp  ! on a soft body the point lies on its surface
      call of_both%base%forces(mine, of_both%law_numbers_type, .false., h, m_star, weight, kept, &
                               none, some)
      columns = columns + some
      do k = 1, size(part)
        if (law(k) /= law(lead)) cycle
        history(k, :) = kept(k, :)
        call take_lane(mine, k, k, b)
      end do
    end do
  end subroutine apply_laws
end module dem_membrane_forces
