!> Stress of elements that have held free grains and get continuum again, where its law has a state
!! (theory-overlap, Closing): that of their grains, and how far the law has to take it back.
!!
!! Branches of contacts are cut into pieces, each of the element that it lies in; stresses and
!! densities are means over the elements around, about their change with depth. eq. C.50, C.51
module cpl_reborn
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_set
  use talus_port_names, only: can_element_stress, field_density, field_element, field_value, &
    field_what, what_initial_stress
  use talus_timers, only: timers_type
  use cpl_cells, only: cells_type, spot_type
  use cpl_gap, only: mean_stress, read_stress, six, stress_type
  use cpl_homogenise, only: pack_average_type, extend_average, smooth_over_nodes
  use cpl_overlap_partition, only: contacts_type, rows_of_ids
  use cpl_overlap_weights, only: read_contacts
  use cpl_sets, only: pack_type, part_none, part_rest, part_ghost, part_free
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: reborn_type, average_grains

  integer(i4), parameter :: pieces = 8          !! of a branch
  real(wp), parameter :: away = 1.0_wp/sqrt(5.0_wp)  !! of the radius, along each axis: an eighth of
                                                !! the mass at eight such points turns as a sphere

  !> Elements that were given a stress in the last conversion.
  type :: reborn_type
    real(wp) :: density = 1.0_wp    !! mean of the solid at the start [kg/m^3]
    integer(i4) :: count = 0
    real(wp) :: beyond(2) = 0.0_wp  !! taken back by the law, over the mean pressure: most and mean
  contains
    procedure :: give_stress
    procedure, private :: judge
  end type reborn_type

contains

  !> SET initial_stress of elements that lose their free grains now, while all contacts are there.
  subroutine give_stress(self, solvers, cells, parts, pack_of, timers, errors)
    class(reborn_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cells_type), intent(in) :: cells     !! where the nodes are now
    integer(i4), intent(in) :: parts(:, :)    !! (elements, 2) until now, from now on
    type(pack_type), intent(in) :: pack_of    !! as it is now
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    logical, dimension(cells%elements) :: open, chosen
    real(wp) :: average(7, cells%elements)
    type(contacts_type) :: contacts

    self%count = 0
    self%beyond = 0.0_wp
    if (.not. solvers(side_solid)%can(can_element_stress)) return
    open = parts(:, 1) == part_none .or. parts(:, 1) == part_free
    chosen = open .and. (parts(:, 2) == part_ghost .or. parts(:, 2) == part_rest)
    self%count = int(count(chosen), i4)
    if (self%count == 0) return
    call read_contacts(solvers(side_grains), contacts, timers, errors)
    if (errors%any()) return
    call average_grains(cells, open, chosen, solvers(side_solid)%gravity, pack_of, contacts, &
                        average)
    average(7, :) = average(7, :)/self%density
    call send(solvers(side_solid), chosen, average, timers, errors)
    if (.not. errors%any()) &
      call self%judge(solvers(side_solid), chosen, average, timers, errors)
  end subroutine give_stress

  !> Stress of the grains in chosen elements, xx yy zz xy yz zx [Pa], and their mass over the volume
  !! [kg/m^3]; `open` are those whose contacts are all there.
  subroutine average_grains(cells, open, chosen, gravity, pack_of, contacts, average)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: open(:), chosen(:)   !! (elements)
    real(wp), intent(in) :: gravity(3)          !! [m/s^2]
    type(pack_type), intent(in) :: pack_of
    type(contacts_type), intent(in) :: contacts
    real(wp), intent(out) :: average(:, :)      !! (7, elements)
    logical :: near(cells%elements), found(cells%elements)
    real(wp) :: sums(7, cells%elements), volume(cells%elements)
    integer(i4) :: e

    call find_near(cells, open, chosen, near)
    sums = 0.0_wp
    call add_contacts(cells, near, pack_of, contacts, sums)
    call add_masses(cells, near, pack_of, sums)
    volume = 0.0_wp
    do e = 1, cells%elements
      if (near(e)) volume(e) = cells%volume(e)
      if (volume(e) > 0.0_wp) sums(:, e) = sums(:, e)/volume(e)
    end do
    call fit_of(cells, gravity, volume, sums, average)
    sums = sums - average
    call smooth_over_nodes(cells, volume, chosen, sums, found)
    average = average + sums
  end subroutine average_grains

  !> Open elements that share a node with a chosen one.
  subroutine find_near(cells, open, chosen, near)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: open(:), chosen(:)
    logical, intent(out) :: near(:)
    logical :: node(cells%nodes)
    integer(i4) :: e
    node = .false.
    do e = 1, cells%elements
      if (chosen(e)) node(cells%nodes_of(e)) = .true.
    end do
    near = open
    do e = 1, cells%elements
      if (near(e)) near(e) = any(node(cells%nodes_of(e)))
    end do
  end subroutine find_near

  !> Love and Weber's sums: pieces of the branch of each contact times its force.
  subroutine add_contacts(cells, near, pack_of, contacts, sums)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: near(:)
    type(pack_type), intent(in) :: pack_of
    type(contacts_type), intent(in) :: contacts
    real(wp), intent(inout) :: sums(:, :)    !! (7, elements) [N m]
    integer(i4), allocatable :: pair(:, :)
    integer(i4) :: c, end_of
    real(wp) :: from(3)
    logical :: touched(size(pack_of%id))

    call find_grains(cells, near, pack_of, touched)
    call rows_of_ids(pack_of%id, contacts%ids, pair)
    do c = 1, size(pair, 2)
      end_of = pair(2, c)
      if (end_of == 0) cycle
      from = contacts%point(:, c)
      if (pair(1, c) > 0) from = pack_of%x(:, pair(1, c))
      if (.not. touched(end_of)) then
        if (pair(1, c) == 0) cycle
        if (.not. touched(pair(1, c))) cycle
      end if
      call add_branch(cells, near, from, pack_of%x(:, end_of), contacts%force(:, c), sums)
    end do
  end subroutine add_contacts

  !> Grains whose centre lies in the box around the elements, or a diameter beside it.
  subroutine find_grains(cells, near, pack_of, touched)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: near(:)
    type(pack_type), intent(in) :: pack_of
    logical, intent(out) :: touched(:)   !! (grains)
    real(wp) :: low(3), high(3)
    integer(i4) :: g
    low = minval(cells%low, 2, spread(near, 1, 3))
    high = maxval(cells%high, 2, spread(near, 1, 3))
    do g = 1, size(touched)
      associate (x => pack_of%x(:, g), r => 2.0_wp*pack_of%radius(g))
        touched(g) = all(x > low - r) .and. all(x < high + r)
      end associate
    end do
  end subroutine find_grains

  !> One branch in pieces, symmetric.
  subroutine add_branch(cells, near, from, to, force, sums)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: near(:)
    real(wp), intent(in) :: from(3), to(3), force(3)  !! [m], [m], [N] on the grain at `from`
    real(wp), intent(inout) :: sums(:, :)
    real(wp) :: piece(3), both(9)
    integer(i4) :: k, e
    piece = (to - from)/pieces
    both = reshape(0.5_wp*(spread(piece, 2, 3)*spread(force, 1, 3) &
                           + spread(force, 2, 3)*spread(piece, 1, 3)), [9])
    do k = 1, pieces
      e = element_at(cells, near, from + (k - 0.5_wp)*piece)
      if (e > 0) sums(:6, e) = sums(:6, e) + both(six)
    end do
  end subroutine add_branch

  !> Masses of the grains, an eighth each at eight points.
  subroutine add_masses(cells, near, pack_of, sums)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: near(:)
    type(pack_type), intent(in) :: pack_of
    real(wp), intent(inout) :: sums(:, :)    !! (7, elements) [kg]
    logical :: touched(size(pack_of%id))
    integer(i4) :: g, k, e
    call find_grains(cells, near, pack_of, touched)
    do g = 1, size(touched)
      if (.not. touched(g)) cycle
      do k = 0, 7
        e = element_at(cells, near, pack_of%x(:, g) + away*pack_of%radius(g) &
                       *[2*mod(k, 2) - 1, 2*mod(k/2, 2) - 1, 2*(k/4) - 1])
        if (e > 0) sums(7, e) = sums(7, e) + 0.125_wp*pack_of%mass(g)
      end do
    end do
  end subroutine add_masses

  !> The element near by that a point lies in, 0: none.
  integer(i4) function element_at(cells, near, x)
    type(cells_type), intent(in) :: cells
    logical, intent(in) :: near(:)
    real(wp), intent(in) :: x(3)  !! [m]
    type(spot_type) :: spot
    call cells%find(x, merge(1_i4, 0_i4, near), spot)
    element_at = 0
    if (spot%element == 0) return
    if (near(spot%element)) element_at = spot%element
  end function element_at

  !> What changes evenly with depth, or the mean: at a surface means over the elements around would
  !! be those of a deeper place.
  subroutine fit_of(cells, gravity, volume, sums, fit)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: gravity(3)
    real(wp), intent(in) :: volume(:)      !! (elements), 0: not to be counted [m^3]
    real(wp), intent(in) :: sums(:, :)     !! (7, elements)
    real(wp), intent(out) :: fit(:, :)     !! the same
    type(pack_average_type) :: average
    real(wp) :: x(3)
    integer(i4) :: e
    allocate (average%stress(9, size(volume)), source=0.0_wp)
    average%stress(:7, :) = sums
    average%volume = volume
    average%own = volume > 0.0_wp
    call extend_average(cells, gravity, average)
    do e = 1, size(volume)
      x = sum(cells%x(:, cells%nodes_of(e)), 2)/size(cells%nodes_of(e))
      fit(:, e) = average%mean(:7) + dot_product(average%down, x - average%middle)*average%slope(:7)
    end do
  end subroutine fit_of

  !> The request; densities are over the mean of the solid.
  subroutine send(solid, chosen, average, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: chosen(:)
    real(wp), intent(in) :: average(:, :)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: e
    associate (element => pack([(e, e=1, size(chosen))], chosen))
      call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
      call solid%request%put_text(field_what, what_initial_stress)
      call solid%request%put_int(field_element, element)
      call solid%request%put(field_value, average(:6, element))
      call solid%request%put(field_density, average(7, element))
      call solid%ask(timers, errors)
    end associate
  end subroutine send

  !> How far the solid's stresses are from those that it was given.
  subroutine judge(self, solid, chosen, average, timers, errors)
    class(reborn_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: chosen(:)
    real(wp), intent(in) :: average(:, :)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(stress_type) :: points
    real(wp) :: pressure, apart
    integer(i4) :: e
    call read_stress(solid, points, timers, errors)
    if (errors%any()) return
    pressure = -sum(average(:3, :), spread(chosen, 1, 3))/(3.0_wp*self%count)
    if (.not. pressure > 0.0_wp) return
    do e = 1, size(chosen)
      if (.not. chosen(e)) cycle
      apart = maxval(abs(mean_stress(points, e) - average(:6, e)))/pressure
      self%beyond(1) = max(self%beyond(1), apart)
      self%beyond(2) = self%beyond(2) + apart/self%count
    end do
  end subroutine judge
end module cpl_reborn
