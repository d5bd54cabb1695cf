!> The energy ledger: what is stored now, and how well all columns close.
module dem_ledger
  use talus_kinds, only: wp, i4
  use dem_state, only: dem_data_type, dem_grains_type, dem_ledger_type, kind_free
  use dem_pair_law, only: pair_energy
  use dem_additional, only: additional_energy
  use dem_integrate, only: motion_type, motion_of, scaled_spin_momentum
  use dem_ellipsoid, only: rotation_of
  use dem_membrane, only: membranes_energy
  use dem_surface_body, only: body_energy
  use dem_surface_additional, only: surface_additional_energy
  use dem_surface_measure, only: surface_energy
  implicit none
  private
  public :: refresh_stored, start_ledger, follow_step, closure_of, turnover_of
  public :: staggering_of, follow_load, content

contains

  !> Kinetic, elastic and staggering columns at the current state, for step dt.
  subroutine refresh_stored(d, dt, ledger)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: dt
    type(dem_ledger_type), intent(inout) :: ledger
    type(motion_type) :: motion
    real(wp) :: energy(2), part(2), other, sheet(3)
    integer(i4) :: i, k

    motion = motion_of(d, dt)
    ledger%kinetic = 0.0_wp
    ledger%staggering = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      part = grain_energy(d%grains, i, motion)
      ledger%kinetic = ledger%kinetic + part(1)
      ledger%staggering = ledger%staggering + part(2)
    end do
    do i = 1, d%clumps%n
      part = grain_energy(d%clumps%grains, i, motion)
      ledger%kinetic = ledger%kinetic + part(1)
      ledger%staggering = ledger%staggering + part(2)
    end do
    if (allocated(d%surfaces%rigid%free)) then
      part = bodies_energy(d, motion)
      ledger%kinetic = ledger%kinetic + part(1)
      ledger%staggering = ledger%staggering + part(2)
    end if
    ledger%elastic_normal = 0.0_wp
    ledger%elastic_tangential = 0.0_wp
    ledger%elastic_other = 0.0_wp
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      energy = pair_energy(d, k)
      if (allocated(d%pairs%share)) energy = d%pairs%share(k)*energy
      ledger%elastic_normal = ledger%elastic_normal + energy(1)
      ledger%elastic_tangential = ledger%elastic_tangential + energy(2)
      if (.not. d%pairs%additional%active) cycle
      other = additional_energy(d%laws(d%pairs%law_first(k), d%pairs%law_second(k)), k, d%pairs)
      if (allocated(d%pairs%share)) other = d%pairs%share(k)*other
      ledger%elastic_other = ledger%elastic_other + other
    end do
    if (allocated(d%surfaces%membranes)) then
      sheet = membranes_energy(d%surfaces, motion)
      ledger%kinetic = ledger%kinetic + sheet(1)
      ledger%staggering = ledger%staggering + sheet(2)
      ledger%elastic_other = ledger%elastic_other + sheet(3)
    end if
    if (d%surfaces%list%near == 0) return
    energy = surface_energy(d)
    ledger%elastic_normal = ledger%elastic_normal + energy(1)
    ledger%elastic_tangential = ledger%elastic_tangential + energy(2)
    if (size(d%surfaces%list%kept) > 0) ledger%elastic_other = ledger%elastic_other &
      + surface_additional_energy(d)
  end subroutine refresh_stored

  !> Kinetic energy of a free grain with scaled masses, and the leapfrog's part of it: the works of
  !! the half kicks add up to m v-.v+/2 = m v^2/2 - dt^2 G^2/(8 m), G the total force [J].
  pure function grain_energy(g, i, motion) result(part)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: motion
    real(wp) :: part(2), m, total(3), l(3), moment(3), inertia(3), r(3, 3)

    m = motion%mass_scale*g%mass(i)
    inertia = motion%inertia_scale*g%inertia(:, i)
    r = rotation_of(g%quat(:, i))
    l = scaled_spin_momentum(r, inertia, g%omega(:, i))
    part(1) = 0.5_wp*m*sum(g%v(:, i)**2) + 0.5_wp*dot_product(l, g%omega(:, i))
    total = g%force(:, i) + g%extra_force(:, i) + g%mass(i)*motion%gravity &
            - motion%damping*m*g%v(:, i)
    moment = g%moment(:, i) + g%extra_moment(:, i) - motion%damping*l
    moment = matmul(moment, r)
    part(2) = motion%dt**2/8.0_wp*(sum(total**2)/m + sum(moment**2/inertia))
  end function grain_energy

  !> The same of all free bodies [J].
  pure function bodies_energy(d, motion) result(part)
    type(dem_data_type), intent(in) :: d
    type(motion_type), intent(in) :: motion
    real(wp) :: part(2)
    integer(i4) :: b
    part = 0.0_wp
    do b = 1, d%surfaces%n
      part = part + body_energy(d%surfaces, b, motion%dt, motion%gravity)
    end do
  end function bodies_energy

  !> Energy content now, as the steps see it [J].
  pure real(wp) function content(ledger)
    type(dem_ledger_type), intent(in) :: ledger
    content = ledger%kinetic - ledger%staggering + ledger%elastic_normal &
              + ledger%elastic_tangential + ledger%elastic_other
  end function content

  !> Begin a ledger at the current state for step dt; all works are zero.
  subroutine start_ledger(d, dt)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    type(dem_ledger_type) :: fresh
    call refresh_stored(d, dt, fresh)
    fresh%start = content(fresh)
    d%ledger = fresh
    d%ledger_dt = dt
  end subroutine start_ledger

  !> A step of another length changes the staggering, not the energy: move the start along.
  subroutine follow_step(d, dt)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    type(dem_ledger_type) :: before, after
    if (.not. abs(dt - d%ledger_dt) > 0.0_wp) return
    call refresh_stored(d, d%ledger_dt, before)
    call refresh_stored(d, dt, after)
    d%ledger%start = d%ledger%start - (after%staggering - before%staggering)
    d%ledger_dt = dt
  end subroutine follow_step

  !> Staggering of all free grains for the ledger's step [J].
  pure real(wp) function staggering_of(d) result(sum)
    type(dem_data_type), intent(in) :: d
    type(motion_type) :: motion
    real(wp) :: part(2), sheet(3)
    integer(i4) :: i
    motion = motion_of(d, d%ledger_dt)
    sum = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      part = grain_energy(d%grains, i, motion)
      sum = sum + part(2)
    end do
    do i = 1, d%clumps%n
      part = grain_energy(d%clumps%grains, i, motion)
      sum = sum + part(2)
    end do
    if (allocated(d%surfaces%membranes)) then
      sheet = membranes_energy(d%surfaces, motion)
      sum = sum + sheet(2)
    end if
    if (.not. allocated(d%surfaces%rigid%free)) return
    part = bodies_energy(d, motion)
    sum = sum + part(2)
  end function staggering_of

  !> Extra forces have changed between two steps: so has the staggering, not the energy.
  subroutine follow_load(d, before)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: before  !! staggering before the change [J]
    d%ledger%start = d%ledger%start - (staggering_of(d) - before)
  end subroutine follow_load

  !> Closure error: input minus all the rest, 0 for a perfect ledger [J].
  pure real(wp) function closure_of(ledger) result(error)
    type(dem_ledger_type), intent(in) :: ledger
    error = ledger%start + ledger%boundary + ledger%external + ledger%gravity + ledger%curvature &
            + ledger%entered - ledger%left + ledger%growth - content(ledger) - ledger%friction &
            - ledger%contact_damping - ledger%background_damping - ledger%tangential_relaxation &
            - ledger%rolling - ledger%breakage - ledger%plastic - ledger%released - ledger%fines &
            + liquid_closure(ledger)
  end function closure_of

  !> The same of the liquid over the exchanges that have ended; its work on the grains is `external`
  !! to these [J].
  pure real(wp) function liquid_closure(ledger) result(error)
    type(dem_ledger_type), intent(in) :: ledger
    error = ledger%liquid_flow - ledger%liquid_work - ledger%liquid - ledger%darcy &
            - ledger%liquid_drag - ledger%liquid_exchange
  end function liquid_closure

  !> Energy turned over so far, the scale of the closure error [J].
  pure real(wp) function turnover_of(ledger) result(scale)
    type(dem_ledger_type), intent(in) :: ledger
    scale = max(abs(ledger%start), ledger%kinetic + ledger%elastic_normal, abs(ledger%boundary) &
                + abs(ledger%external) + abs(ledger%gravity) + abs(ledger%entered) &
                + abs(ledger%left), ledger%friction + ledger%contact_damping &
                + ledger%background_damping + ledger%rolling + ledger%plastic &
                + ledger%released + ledger%fines, abs(ledger%growth))
  end function turnover_of
end module dem_ledger
