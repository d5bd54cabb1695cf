!> Contact forces between grains and surfaces: the law of grain pairs, one block of lanes a grain.
!!
!! A contact is recomputed in every step and inherits the history of the last step's contact that
!! lies nearest, so that a grain rolls from triangle to triangle, and over edges, without a jump.
module dem_surface_forces
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_additional_list, only: held_of
  use dem_additional_model, only: additional_given_type, additional_works_type
  use dem_additional_numbers, only: additional_work_count
  use dem_kinds, only: moved_by_forces
  use dem_state, only: dem_data_type, dem_law_type, lanes, history_size, history_point, column_count
  use dem_surface_state, only: dem_surfaces_type, is_soft
  use dem_surface_body, only: is_free
  use dem_figure, only: figure_type
  use dem_shape_state, only: shape_ellipsoid
  use dem_surface_additional, only: laws_of_surface, held_reach, corner_couples
  use dem_surface_contacts, only: leave_grain, keep_touches, keep_more
  use dem_surface_feature, only: touches_type, features_type
  use dem_surface_find, only: find_touches
  use dem_block, only: dem_block_type
  use dem_depth, only: note_touch
  use dem_ellipse, only: ratio_on_plane
  implicit none
  private
  public :: work_grain, add_surface_loads, surface_load
  public :: figure_of, fill_block, distance, law_of, take_lane, about_centre, &
    clear_shares, share_loads, far_apart

  real(wp), parameter :: far_apart = 0.5_wp  !! distance in radii and turn that no contact makes

contains

  !> All contacts of near grain g.
  subroutine work_grain(d, g, h)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: h
    type(figure_type) :: figure
    type(features_type) :: features
    type(touches_type) :: touches
    type(dem_block_type) :: block
    real(wp) :: history(lanes, history_size), kept(lanes, size(d%surfaces%list%kept, 2))
    real(wp) :: some(additional_work_count)
    integer(i4) :: i, count, part(lanes)

    i = d%surfaces%list%near_grain(g)
    figure = figure_of(d, i)
    associate (s => d%surfaces)
      if (size(s%list%kept) > 0) figure%reach = held_reach(d, g)
      figure%span = figure%radius + figure%reach
      call find_touches(s, g, figure, features, touches)
      call fill_block(touches, 0, touches%n, d%pairs%body(:, i), block)
      part = 0
      part(:touches%n) = touches%part(:touches%n)
      call match(s, g, h, d%grains%radius(i), touches, count, part, block, history, kept)
      if (count == 0) then
        call leave_grain(s%list, g)
        if (s%soft) call clear_shares(s, g)
        return
      end if
      call apply_laws(d, i, figure, h, part, count, block, history, kept, s%list%columns(:, g), &
                      some)
      if (figure%reach > 0.0_wp) call drop_torn( &
        held_of(d%pairs%additional%kept_places_type, kept), features, touches, block, history, kept)
      call keep_touches(s%list, g, touches, block, history)
      if (size(s%list%kept) > 0) call keep_more(s%list, g, touches%n, block, kept, some)
      call sum_loads(block, touches%n, d%pairs%body(1:3, i), s%list%load(:, g))
      if (s%soft) call share_loads(s, g, features, touches)
    end associate
    call note_depth(d, i, touches)
  end subroutine work_grain

  !> Contacts of grain i deeper than the limit allows are noted.
  subroutine note_depth(d, i, touches)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    type(touches_type), intent(in) :: touches
    integer(i4) :: k
    do k = 1, touches%n
      if (-touches%gap(k) > d%pairs%shallow) call note_touch(d, i, touches%body(k), -touches%gap(k))
    end do
  end subroutine note_depth

  !> Of contacts over a gap only those stay that a model holds; the others never were any.
  pure subroutine drop_torn(held, features, touches, block, history, kept)
    logical, intent(in) :: held(lanes)
    type(features_type), intent(inout) :: features
    type(touches_type), intent(inout) :: touches
    type(dem_block_type), intent(inout) :: block
    real(wp), intent(inout) :: history(lanes, history_size), kept(:, :)
    type(dem_block_type) :: was
    integer(i4) :: k, n, place(lanes)

    was = block
    n = 0
    place = lanes + 1
    do k = 1, touches%n
      if (touches%gap(k) >= 0.0_wp .and. .not. held(k)) cycle
      n = n + 1
      place(k) = n
      if (n == k) cycle
      touches%foot(:, n) = touches%foot(:, k)
      touches%offset(:, n) = touches%offset(:, k)
      touches%normal(:, n) = touches%normal(:, k)
      touches%motion(:, n) = touches%motion(:, k)
      touches%body(n) = touches%body(k)
      touches%part(n) = touches%part(k)
      history(n, :) = history(k, :)
      kept(n, :) = kept(k, :)
      call take_lane(was, k, n, block)
    end do
    do k = 1, features%n
      if (features%touch(k) <= touches%n) features%touch(k) = place(features%touch(k))
    end do
    touches%n = n
  end subroutine drop_torn

  !> Grain i as surfaces see it.
  pure function figure_of(d, i) result(figure)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(figure_type) :: figure
    figure%x = d%pairs%body(1:3, i)
    figure%radius = d%grains%radius(i)
    figure%a = d%pairs%body(10:15, i)
    figure%square = d%pairs%body(16, i)
    if (.not. d%grains%shapes%in_use) return
    figure%shaped = d%grains%shapes%kind(i) /= shape_ellipsoid
    if (figure%shaped) figure%shape = d%grains%shapes%record(:, i)
  end function figure_of

  !> Contacts low+1 to low+many as pairs of a point of the surface, A, and the grain, B; those
  !! behind touches%n have ended.
  pure subroutine fill_block(touches, low, many, grain, b)
    type(touches_type), intent(in) :: touches
    integer(i4), intent(in) :: low, many
    real(wp), intent(in) :: grain(:)
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k

    do k = 1, lanes
      b%b%vx(k) = grain(4)
      b%b%vy(k) = grain(5)
      b%b%vz(k) = grain(6)
      b%b%wx(k) = grain(7)
      b%b%wy(k) = grain(8)
      b%b%wz(k) = grain(9)
    end do
    b%ax = 0.0_wp
    b%ay = 0.0_wp
    b%az = 0.0_wp
    do k = 1, lanes
      b%gap(k) = 1.0_wp
      b%curvature(k) = 1.0_wp
      if (k > many) then
        call fill_lane(b, k, grain(1:3), [1.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.0_wp, &
                                                                  0.0_wp, 0.0_wp, 0.0_wp], grain)
      else
        call fill_lane(b, k, touches%foot(:, low + k), touches%normal(:, low + k), &
                       touches%motion(:, low + k), grain)
        if (low + k > touches%n) cycle
        b%gap(k) = touches%gap(low + k)
        b%curvature(k) = touches%curvature(low + k)
      end if
    end do
  end subroutine fill_block

  pure subroutine fill_lane(b, k, foot, normal, motion, grain)
    type(dem_block_type), intent(inout) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: foot(3), normal(3), motion(6), grain(:)
    b%a%x(k, :) = foot
    b%a%vx(k) = motion(1)
    b%a%vy(k) = motion(2)
    b%a%vz(k) = motion(3)
    b%a%wx(k) = motion(4)
    b%a%wy(k) = motion(5)
    b%a%wz(k) = motion(6)
    b%rx(k) = grain(1) - foot(1)
    b%ry(k) = grain(2) - foot(2)
    b%rz(k) = grain(3) - foot(3)
    b%nx(k) = normal(1)
    b%ny(k) = normal(2)
    b%nz(k) = normal(3)
  end subroutine fill_lane

  !> History of each contact from the nearest of the last step, each taken once; what is left over
  !! has ended and is worked once more, after the contacts, for its energy.
  pure subroutine match(s, g, h, radius, touches, count, part, b, history, kept)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: h, radius
    type(touches_type), intent(in) :: touches
    integer(i4), intent(out) :: count
    integer(i4), intent(inout) :: part(lanes)
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(out) :: history(lanes, history_size), kept(:, :)
    real(wp) :: cost(lanes, lanes), v(3), grain(9)
    integer(i4) :: k, j, best(2), mine(lanes)

    mine = 0
    history = 0.0_wp
    kept = 0.0_wp
    cost = huge(1.0_wp)
    do j = 1, s%list%contacts(g)
      do k = 1, touches%n
        cost(k, j) = distance(s, g, j, h, radius, touches, k)
      end do
    end do
    count = touches%n
    do while (s%list%contacts(g) > 0 .and. touches%n > 0)
      best = minloc(cost(:touches%n, :s%list%contacts(g)))
      if (cost(best(1), best(2)) > far_apart) exit
      mine(best(2)) = best(1)
      cost(best(1), :) = huge(1.0_wp)
      cost(:, best(2)) = huge(1.0_wp)
    end do
    grain(1:3) = [b%rx(1) + b%a%x(1, 1), b%ry(1) + b%a%x(1, 2), b%rz(1) + b%a%x(1, 3)]
    do j = 1, s%list%contacts(g)
      k = mine(j)
      v = s%list%motion(j, 1:3, g)
      if (k == 0) then
        if (count == lanes) cycle
        count = count + 1
        k = count
        part(k) = s%list%part(j, g)
        call fill_lane(b, k, s%list%foot(j, :, g) + h*v, s%list%normal(j, :, g), &
                       s%list%motion(j, :, g), grain)
      else
        v = touches%motion(1:3, k)
      end if
      history(k, :) = s%list%history(j, :, g)
      if (size(kept) > 0) kept(k, :) = s%list%kept(j, :, g)
      history(k, history_point:history_point + 2) = s%list%point(j, :, g) - (b%a%x(k, :) - h*v)
    end do
  end subroutine match

  !> Distance of new contact k from where contact j has moved, in radii, plus the turn of the
  !! normal.
  pure real(wp) function distance(s, g, j, h, radius, touches, k)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: g, j, k
    real(wp), intent(in) :: h, radius
    type(touches_type), intent(in) :: touches
    distance = huge(1.0_wp)
    if (s%list%part(j, g) < s%first_part(touches%body(k))) return
    if (s%list%part(j, g) >= s%first_part(touches%body(k) + 1)) return
    distance = sqrt(sum((touches%foot(:, k) - s%list%foot(j, :, g) &
      - h*s%list%motion(j, 1:3, g))**2))/radius &
      + sqrt(sum((touches%normal(:, k) - s%list%normal(j, :, g))**2))
  end function distance

  !> The law of each contact's materials.
  pure subroutine apply_laws(d, i, figure, h, part, count, b, history, kept, columns, work)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i  !! grain
    type(figure_type), intent(in) :: figure
    real(wp), intent(in) :: h
    integer(i4), intent(in) :: part(lanes), count
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(inout) :: history(lanes, history_size), kept(:, :)
    real(wp), intent(out) :: columns(column_count), work(additional_work_count)
    type(dem_block_type) :: mine
    type(dem_law_type) :: of_both
    type(additional_given_type) :: given
    type(additional_works_type) :: works
    real(wp) :: past(lanes, history_size)
    real(wp) :: memory(lanes, size(kept, 2))
    integer(i4) :: k, law(lanes), lead
    logical :: this(lanes)

    columns = 0.0_wp
    works%models = 0.0_wp
    given%h = h
    given%m_star = d%grains%mass(i)
    law = 0
    do k = 1, count
      law(k) = law_of(d%surfaces, part(k))
    end do
    if (allocated(d%surfaces%rigid%free)) call reduce_masses(d, i, part(:count), given%m_star)
    if (law(1) > 0 .and. all(law(:count) == law(1))) then
      history(count + 1:, :) = 0.0_wp
      kept(count + 1:, :) = 0.0_wp
      associate (of_all => d%laws(d%surfaces%material(part(1)), d%grains%material(i)))
        if (of_all%elliptic) call narrow(figure, b)
        call laws_of_surface(b, of_all, d%pairs%additional, given, history, kept, works)
      end associate
      columns = works%columns
      work = works%models
      return
    end if
    do lead = 1, count
      if (any(law(:lead - 1) == law(lead))) cycle
      this = law == law(lead)
      mine = b
      past = history
      memory = kept
      call leave_out(.not. this, mine, past, memory)
      of_both = d%laws(d%surfaces%material(part(lead)), d%grains%material(i))
      if (law(lead) < 0) of_both%share = 0.0_wp
      if (of_both%elliptic) call narrow(figure, mine)
      call laws_of_surface(mine, of_both, d%pairs%additional, given, past, memory, works)
      columns = columns + works%columns
      do k = 1, count
        if (.not. this(k)) cycle
        history(k, :) = past(k, :)
        kept(k, :) = memory(k, :)
        call take_lane(mine, k, k, b)
      end do
    end do
    work = works%models
  end subroutine apply_laws

  !> Lanes that are not worked: no contact, no memory.
  pure subroutine leave_out(others, b, history, kept)
    logical, intent(in) :: others(lanes)
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(inout) :: history(lanes, history_size), kept(:, :)
    integer(i4) :: k
    do k = 1, lanes
      if (.not. others(k)) cycle
      b%gap(k) = 1.0_wp
      history(k, :) = 0.0_wp
      kept(k, :) = 0.0_wp
    end do
  end subroutine leave_out

  !> A contact of a free body has the reduced mass of both, or that of the one that gives way.
  pure subroutine reduce_masses(d, i, part, m_star)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i        !! grain
    integer(i4), intent(in) :: part(:)  !! of each contact
    real(wp), intent(inout) :: m_star(lanes)
    real(wp) :: mass
    integer(i4) :: k, b
    do k = 1, size(part)
      b = count(d%surfaces%first_part(:d%surfaces%n) <= part(k))
      mass = d%surfaces%rigid%mass(b)
      if (.not. (is_free(d%surfaces, b) .and. mass > 0.0_wp)) cycle
      m_star(k) = merge(mass*d%grains%mass(i)/(mass + d%grains%mass(i)), mass, &
                        moved_by_forces(d%grains%kind(i)))
    end do
  end subroutine reduce_masses

  !> Elliptic areas, see dem_ellipse.
  pure subroutine narrow(figure, b)
    type(figure_type), intent(in) :: figure
    type(dem_block_type), intent(inout) :: b
    integer(i4) :: k
    do k = 1, lanes
      if (b%gap(k) < 0.0_wp) b%curvature(k) = b%curvature(k) &
        /ratio_on_plane(figure, [b%nx(k), b%ny(k), b%nz(k)])
    end do
  end subroutine narrow

  !> Material of a part, negative for soft bodies, whose contact point lies on their surface.
  pure integer(i4) function law_of(s, part)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: part
    law_of = s%material(part)
    if (is_soft(s, count(s%first_part(:s%n) <= part))) law_of = -law_of
  end function law_of

  !> Loads of lane `source` of one block into lane k of another.
  pure subroutine take_lane(from, source, k, b)
    type(dem_block_type), intent(in) :: from
    integer(i4), intent(in) :: source, k
    type(dem_block_type), intent(inout) :: b
    b%load%fx(k) = from%load%fx(source)
    b%load%fy(k) = from%load%fy(source)
    b%load%fz(k) = from%load%fz(source)
    b%load%mx(k) = from%load%mx(source)
    b%load%my(k) = from%load%my(source)
    b%load%mz(k) = from%load%mz(source)
  end subroutine take_lane

  !> Force on the grain and moment about its centre.
  pure subroutine sum_loads(b, n, x, load)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: x(3)
    real(wp), intent(out) :: load(6)
    integer(i4) :: k
    load = 0.0_wp
    do k = 1, n
      load = load + [b%load%fx(k), b%load%fy(k), b%load%fz(k), &
                     b%load%mx(k), b%load%my(k), b%load%mz(k)]
    end do
    call about_centre(x, load)
  end subroutine sum_loads

  !> The moment of a load, given about the origin, about x.
  pure subroutine about_centre(x, load)
    real(wp), intent(in) :: x(3)
    real(wp), intent(inout) :: load(6)
    load(4) = load(4) - (x(2)*load(3) - x(3)*load(2))
    load(5) = load(5) - (x(3)*load(1) - x(1)*load(3))
    load(6) = load(6) - (x(1)*load(2) - x(2)*load(1))
  end subroutine about_centre

  pure subroutine clear_shares(s, g)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: g
    s%list%share(:, 3*s%list%near_start(g) - 2:3*s%list%near_start(g + 1) - 3) = 0.0_wp
  end subroutine clear_shares

  !> Forces on the corners of soft triangles: those of each contact by its shares.
  pure subroutine share_loads(s, g, f, touches)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: g
    type(features_type), intent(in) :: f
    type(touches_type), intent(in) :: touches
    real(wp) :: turn(3, 3)
    integer(i4) :: i, k, corner

    call clear_shares(s, g)
    do i = 1, f%n
      if (f%touch(i) > touches%n .or. .not. is_soft(s, f%body(i))) cycle
      k = 3*(f%candidate(i) - 1)
      if (size(s%list%kept) > 0) then
        turn = corner_couples(s%mesh%x(:, s%mesh%corner(:, s%list%candidate(f%candidate(i)))), &
                              -f%weight(i)*s%list%couple(f%touch(i), :, g))
        s%list%share(:, k + 1:k + 3) = s%list%share(:, k + 1:k + 3) + turn
      end if
      do corner = 1, 3
        s%list%share(:, k + corner) = s%list%share(:, k + corner) &
          - f%weight(i)*f%share(corner, i)*s%list%push(f%touch(i), :, g)
      end do
    end do
  end subroutine share_loads

  !> Add the loads of surfaces to the forces and moments of grains low+1 to low+n.
  pure subroutine add_surface_loads(s, low, n, force, moment)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: low, n
    real(wp), intent(inout) :: force(:, :), moment(:, :)  !! (n, 3) [N], [N m]
    integer(i4) :: k, g
    do k = 1, n
      g = s%list%near_of(low + k)
      if (g == 0) cycle
      force(k, :) = force(k, :) + s%list%load(1:3, g)
      moment(k, :) = moment(k, :) + s%list%load(4:6, g)
    end do
  end subroutine add_surface_loads

  !> Load of the surfaces on grain i, about its centre [N, N m].
  pure function surface_load(s, i) result(load)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: i
    real(wp) :: load(6)
    load = 0.0_wp
    if (s%list%near_of(i) > 0) load = s%list%load(:, s%list%near_of(i))
  end function surface_load
end module dem_surface_forces
