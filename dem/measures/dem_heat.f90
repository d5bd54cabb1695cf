!> Heat conduction through contacts, by explicit steps: the conductance of a contact is that of the
!! constriction between two half spaces, 2 k a. One thread takes the steps, in the order of the
!! grains, so that the thread count changes no bit. eq. D.86, D.87
module dem_heat
  use talus_kinds, only: wp, i4
  use talus_log, only: short_number
  use dem_contact, only: contact_radius
  use dem_state, only: dem_data_type, lanes, history_side
  use dem_surface_measure, only: body_of_part
  implicit none
  private
  public :: begin_heat, conduct, heat_content, heat_limit, told_of_heat

contains

  !> All grains at one temperature, nothing is held at one, no material conducts yet.
  subroutine begin_heat(d, temperature)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: temperature  !! [K]
    d%heat%active = .true.
    allocate (d%heat%conductivity(size(d%materials)), d%heat%capacity(size(d%materials)), &
              source=0.0_wp)
    allocate (d%heat%temperature(d%grains%n), source=temperature)
    allocate (d%heat%held(d%grains%n), d%heat%plane(d%planes%n), d%heat%body(d%surfaces%n), &
              source=0_i4)
    allocate (d%heat%name(0), d%heat%value(0), d%heat%given(0))
  end subroutine begin_heat

  !> Heat content of the grains whose temperature is free [J].
  pure real(wp) function heat_content(d) result(content)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: i
    content = 0.0_wp
    do i = 1, d%grains%n
      if (d%heat%held(i) == 0) content = content + capacity_of(d, i)*d%heat%temperature(i)
    end do
  end function heat_content

  !> m c of grain i [J/K].
  pure real(wp) function capacity_of(d, i) result(capacity)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    capacity = d%grains%mass(i)*d%heat%capacity(d%grains%material(i))
  end function capacity_of

  !> Largest step without overshoot: the least m c over the conductances of a grain; huge without
  !! contacts [s].
  real(wp) function heat_limit(d) result(limit)
    type(dem_data_type), intent(in) :: d
    real(wp) :: flow(0:d%heat%boundaries), conductance
    integer(i4) :: i
    limit = huge(1.0_wp)
    do i = 1, d%grains%n
      if (d%heat%held(i) > 0) cycle
      call sum_contacts(d, i, flow, conductance)
      if (conductance > 0.0_wp) limit = min(limit, capacity_of(d, i)/conductance)
    end do
  end function heat_limit

  !> How near the steps came to the limit of conduction, and a warning (W440) where they passed it.
  subroutine told_of_heat(d, text, warning)
    type(dem_data_type), intent(in) :: d
    character(len=:), allocatable, intent(out) :: text, warning
    text = 'largest step '//short_number(d%heat%ratio)//' of the limit of conduction'
    warning = ''
    if (d%heat%ratio > 1.0_wp) warning = 'W440'//': steps were up to '// &
      short_number(d%heat%ratio)//' times the limit of heat conduction, beyond which '// &
      'temperatures overshoot: take a smaller dt, or a larger capacity'
  end subroutine told_of_heat

  !> A step h [s] of all temperatures, with the contacts as they are.
  subroutine conduct(d, h)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h
    real(wp) :: change(d%grains%n), flow(0:d%heat%boundaries), conductance
    integer(i4) :: i
    change = 0.0_wp
    do i = 1, d%grains%n
      if (d%heat%held(i) > 0) cycle
      call sum_contacts(d, i, flow, conductance)
      change(i) = h*sum(flow)/capacity_of(d, i)
      d%heat%given = d%heat%given + h*flow(1:)
      d%heat%ratio = max(d%heat%ratio, h*conductance/capacity_of(d, i))
    end do
    d%heat%temperature = d%heat%temperature + change
  end subroutine conduct

  !> Heat that flows into grain i, from other grains (0) and from each boundary [W], and the sum of
  !! its conductances [W/K].
  pure subroutine sum_contacts(d, i, flow, conductance)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: flow(0:), conductance
    integer(i4) :: k
    flow = 0.0_wp
    conductance = 0.0_wp
    call sum_pairs(d, i, i, flow, conductance)
    if (d%pairs%images > 0) then
      do k = d%pairs%image_start(i), d%pairs%image_start(i + 1) - 1
        call sum_pairs(d, i, d%pairs%plain + k, flow, conductance)
      end do
    end if
    if (d%surfaces%list%near > 0) call sum_surfaces(d, i, flow, conductance)
  end subroutine sum_contacts

  !> Contacts of one body, which is grain i or an image of it, by the ids of the partners.
  pure subroutine sum_pairs(d, i, body, flow, conductance)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, body
    real(wp), intent(inout) :: flow(0:), conductance
    integer(i4) :: e, slot, lane, block, partner, b
    real(wp) :: radius
    do e = d%pairs%start(body), d%pairs%start(body + 1) - 1
      slot = d%pairs%entry(e)/2
      lane = 1 + mod(slot, lanes)
      block = 1 + slot/lanes
      if (.not. d%pairs%history(lane, history_side, block) > 0.0_wp) cycle
      radius = contact_radius(d%pairs%history(lane, :, block))
      partner = d%pairs%second(lane, block)
      if (mod(d%pairs%entry(e), 2) == 1) partner = d%pairs%first(lane, block)
      b = d%pairs%grain(partner)
      if (b > 0) then
        call add_flow(d, i, conductance_of(d, i, d%grains%material(b), radius), &
                      d%heat%temperature(b), d%heat%held(b), flow, conductance)
      else
        b = partner - d%grains%n - 3
        if (d%heat%plane(b) > 0) call add_flow(d, i, &
          conductance_of(d, i, d%planes%material(b), radius), d%heat%value(d%heat%plane(b)), &
          d%heat%plane(b), flow, conductance)
      end if
    end do
  end subroutine sum_pairs

  !> Contacts of grain i with surfaces.
  pure subroutine sum_surfaces(d, i, flow, conductance)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(inout) :: flow(0:), conductance
    integer(i4) :: g, k, b
    g = d%surfaces%list%near_of(i)
    if (g == 0) return
    associate (list => d%surfaces%list)
      do k = 1, list%contacts(g)
        b = d%heat%body(body_of_part(d, list%part(k, g)))
        if (b > 0) call add_flow(d, i, &
          conductance_of(d, i, d%surfaces%material(list%part(k, g)), &
                         contact_radius(list%history(k, :, g))), d%heat%value(b), b, flow, &
          conductance)
      end do
    end associate
  end subroutine sum_surfaces

  !> Conductance of a contact of grain i with a material, 4 k1 k2/(k1 + k2) a [W/K].
  pure real(wp) function conductance_of(d, i, material, radius)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, material
    real(wp), intent(in) :: radius  !! of the contact [m]
    associate (one => d%heat%conductivity(d%grains%material(i)), &
               two => d%heat%conductivity(material))
      conductance_of = 4.0_wp*one*two/(one + two)*radius
    end associate
  end function conductance_of

  !> What flows into grain i through a conductance h [W/K] from a temperature [K].
  pure subroutine add_flow(d, i, h, temperature, boundary, flow, conductance)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, boundary
    real(wp), intent(in) :: h, temperature
    real(wp), intent(inout) :: flow(0:), conductance
    flow(boundary) = flow(boundary) + h*(temperature - d%heat%temperature(i))
    conductance = conductance + h
  end subroutine add_flow
end module dem_heat
