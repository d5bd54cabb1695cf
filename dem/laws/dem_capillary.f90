!> Capillary bridges: a contact model with a pull along the normal in addition to the base law, by
!! the liquid between two grains. A bridge forms at the first touch, with a given volume or one in
!! proportion to R^3, and lives until its rupture distance; then the volume goes back.
!!
!! Kept of a lane: 1 volume of the bridge, 0 without [m^3], 2 pull on B along the normal, below 0
!! [N], 3 separation of the surfaces [m], 4 R = 2 R_e [m].
!! Works: what a bridge stores as it breaks, and the force that appears at once, are breakage; the
!! change of R at constant separation is curvature.
!! eq. D.33
module dem_capillary
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_law_state, only: law_numbers_type, history_size, history_root, column_curvature
  use dem_additional_numbers, only: most_own, work_breakage, work_formed, work_ruptured, &
    work_drawn, work_returned
  use dem_additional_model, only: additional_model_type, additional_given_type, &
    additional_works_type
  use dem_block, only: dem_block_type
  use dem_bridge, only: bridge_type, bridge_pull, bridge_energy, bridge_stiffness, &
    rupture_distance, longest_bridge, most_liquid
  use dem_pull, only: place_of_contact, speed_of_contact, add_pull
  implicit none
  private
  public :: capillary

  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  integer(i4), parameter :: reals = 4  !! kept of a contact

  ! constants of its own: surface tension [N/m], angle of contact, volume of a bridge [m^3], 1: by
  ! the table, volume over R^3 where no volume is given
  integer(i4), parameter :: own_tension = 1, own_angle = 2, own_volume = 3, own_tabled = 4, &
    own_ratio = 5

contains

  pure function capillary() result(model)
    type(additional_model_type) :: model
    model%name = 'capillary'
    model%constants => constants
    model%forces => forces
    model%at_surfaces => forces
    model%energy => energy
    model%stiffness => stiffness
    model%reach => reach
    model%longest => longest
    model%fit => fit
    model%shorter = 'less liquid'
    model%reals = reals
    model%holds = .true.
  end function capillary

  !> Liquid of the bridges between two materials.
  subroutine constants(deck, k, law, own, acts, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(inout) :: own(most_own)
    logical, intent(out) :: acts
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name

    call deck%get('contact', k, 'cohesion', name)
    acts = name == 'capillary'
    if (.not. acts) return
    call deck%get('contact', k, 'surface_tension', own(own_tension))
    call deck%get('contact', k, 'wetting_deg', own(own_angle))
    if (deck%given('contact', k, 'bridge_volume')) then
      call deck%get('contact', k, 'bridge_volume', own(own_volume))
    else if (deck%given('contact', k, 'bridge_ratio')) then
      call deck%get('contact', k, 'bridge_ratio', own(own_ratio))
    else
      call deck%fault(errors, 'D370', 'a capillary bridge without liquid', 'contact', k, &
        'cohesion', 'give bridge_volume [m3], or bridge_ratio, the volume over the cube of R')
    end if
    own(own_angle) = own(own_angle)*degree
    call deck%get('contact', k, 'bridge', name)
    own(own_tabled) = merge(1.0_wp, 0.0_wp, name == 'table')
  end subroutine constants

  !> The bridge of a contact of radius R that keeps a volume, or 0 where it would form.
  pure function bridge_of(given, radius, kept) result(bridge)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: radius  !! R [m]
    real(wp), intent(in) :: kept    !! [m^3]
    type(bridge_type) :: bridge
    bridge%tension = given%own(own_tension)
    bridge%angle = given%own(own_angle)
    bridge%volume = given%own(own_volume) + given%own(own_ratio)*radius**3
    if (kept > 0.0_wp) bridge%volume = kept
    bridge%tabled = given%own(own_tabled) > 0.5_wp
  end function bridge_of

  !> See forces_routine of dem_additional_model.
  pure subroutine forces(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: kept(:, :)
    type(additional_works_type), intent(inout) :: works
    type(bridge_type) :: bridge
    real(wp) :: row(reals), normal(3), point(3), radius, speed, part(2)
    integer(i4) :: k, event

    do k = 1, lanes
      if (b%gap(k) >= 0.0_wp .and. .not. kept(k, 1) > 0.0_wp) cycle
      if (given%round) then
        radius = 2.0_wp*history(k, history_root)**2
      else
        radius = 2.0_wp/b%curvature(k)
      end if
      call place_of_contact(b, given%law%share, k, normal, point)
      speed = speed_of_contact(b, k, point, normal)
      row = kept(k, :)
      bridge = bridge_of(given, min(radius, most_radius(b, k, point)), row(1))
      call one_contact(bridge, radius, b%gap(k), given%h*speed, row, part, event)
      kept(k, :) = row
      call add_pull(b, k, point, given%weight(k)*row(2)*normal)
      works%models(work_breakage) = works%models(work_breakage) + given%weight(k)*part(1)
      works%columns(column_curvature) = works%columns(column_curvature) + given%weight(k)*part(2)
      call count_event(event, given%weight(k), bridge%volume, works)
    end do
  end subroutine forces

  !> Twice the distance of the contact point from the farther centre: what R can be between spheres
  !! and on planes. Flat faces get no more liquid.
  pure real(wp) function most_radius(b, k, point) result(radius)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: point(3)  !! from the centre of A [m]
    radius = 2.0_wp*max(norm2(point), norm2(point - [b%rx(k), b%ry(k), b%rz(k)]))
  end function most_radius

  !> One lane over a step in which the bodies part by `moved`: its row brought forward, its works;
  !! event: 1 a bridge formed, -1 it broke.
  pure subroutine one_contact(bridge, radius, gap, moved, row, work, event)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: radius, gap, moved
    real(wp), intent(inout) :: row(reals)
    real(wp), intent(out) :: work(2)
    integer(i4), intent(out) :: event
    real(wp) :: last(reals)
    logical :: was, is

    last = row
    was = last(1) > 0.0_wp
    is = gap < 0.0_wp .or. (was .and. gap <= rupture_distance(bridge, radius))
    row = [0.0_wp, 0.0_wp, gap, radius]
    if (is) row(:2) = [bridge%volume, -bridge_pull(bridge, radius, gap)]
    work = 0.0_wp
    event = 0
    if (was .neqv. is) then
      event = merge(1, -1, is)
      work(1) = -0.5_wp*moved*(last(2) + row(2)) &
                - (energy_of(bridge, row) - energy_of(bridge, last))
    else if (was .and. abs(radius - last(4)) > 0.0_wp) then
      work(2) = 0.5_wp*(bridge_energy(bridge, radius, gap) - bridge_energy(bridge, last(4), gap) &
                        + bridge_energy(bridge, radius, last(3)) &
                        - bridge_energy(bridge, last(4), last(3)))
    end if
  end subroutine one_contact

  !> Bridges and their liquid, as they form and break.
  pure subroutine count_event(event, weight, volume, works)
    integer(i4), intent(in) :: event
    real(wp), intent(in) :: weight, volume
    type(additional_works_type), intent(inout) :: works
    integer(i4) :: of_count, of_volume
    if (event == 0) return
    of_count = merge(work_formed, work_ruptured, event > 0)
    of_volume = merge(work_drawn, work_returned, event > 0)
    works%models(of_count) = works%models(of_count) + weight
    works%models(of_volume) = works%models(of_volume) + weight*volume
  end subroutine count_event

  !> Energy of a contact that keeps this [J].
  pure real(wp) function energy_of(bridge, row)
    type(bridge_type), intent(in) :: bridge
    real(wp), intent(in) :: row(reals)
    energy_of = 0.0_wp
    if (row(1) > 0.0_wp) energy_of = bridge_energy(bridge, row(4), row(3))
  end function energy_of

  !> See energy_routine of dem_additional_model.
  pure real(wp) function energy(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:, :)
    integer(i4) :: k
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + given%weight(k)*energy_of(bridge_of(given, kept(k, 4), kept(k, 1)), &
                                                  kept(k, :))
    end do
  end function energy

  !> The pull falls with the separation: the slope counts as a stiffness.
  pure function stiffness(given, kept) result(of_contact)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    real(wp) :: of_contact(2)
    of_contact = 0.0_wp
    if (kept(1) > 0.0_wp) of_contact(1) = bridge_stiffness(bridge_of(given, kept(4), kept(1)), &
                                                           kept(4))
  end function stiffness

  !> Gap up to which a bridge holds, whatever its radius becomes [m].
  pure real(wp) function reach(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    reach = 0.0_wp
    if (kept(1) > 0.0_wp) reach = longest_bridge(bridge_of(given, kept(4), kept(1)))
  end function reach

  !> The same of any bridge: R is largest on a plane, twice the radius of the grain [m].
  pure real(wp) function longest(given, radius)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: radius
    longest = longest_bridge(bridge_of(given, 2.0_wp*radius, 0.0_wp))
  end function longest

  !> Bridges so large that they would meet are refused (I270).
  subroutine fit(given, least, errors)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: least  !! radius of the smallest grain [m]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: share
    share = given%own(own_volume)/least**3
    if (share <= most_liquid) return
    call errors%add('I270', 'a bridge of '//str(given%own(own_volume))//' m3 is '//str(share)// &
      ' of the cube of the radius of the smallest grain, '//str(least)//' m', &
      hint='give at most bridge_volume = '//str(most_liquid*least**3)//': more liquid joins '// &
      'several bridges, which no pair force describes')
  end subroutine fit
end module dem_capillary
