!> Time steps that the contacts allow (theory-dem, Motion).
!!
!! Gershgorin: dt_s = min over free grains of 2/sqrt(L_i), L_i the larger of sum f (k_n + k_t)/(s m)
!! and sum f k_t |r_c|^2/(s_I I_min), with f = 2 for a free partner and 1 for a prescribed one.
!! eq. D.3
module dem_limits
  use talus_kinds, only: wp, i4
  use dem_kinds, only: moved_by_forces, gives_way
  use dem_state, only: dem_data_type, kind_free, kind_member, lanes, mode_relaxation, history_side
  use dem_contact, only: contact_point
  use dem_pair_law, only: pair_stiffness
  use dem_damped_limit, only: damped_step
  use dem_additional, only: additional_stiffness
  use dem_membrane, only: membrane_rate, corner_stiffness
  use dem_surface_measure, only: add_surface_rows, body_rows, body_rate
  implicit none
  private
  public :: gershgorin_step, rayleigh_step, rayleigh_of, foreseen_step

  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Step limit of the current contacts [s]; huge without contacts. On ranks free bodies and
  !! membranes are the leader's, see dem_part.
  real(wp) function gershgorin_step(d) result(limit)
    type(dem_data_type), intent(in) :: d
    real(wp), allocatable :: lambda(:, :)
    real(wp) :: kn, weight, scale(2), point(3), stiffness(2)
    integer(i4) :: k, lane, i

    allocate (lambda(2, d%grains%n), source=0.0_wp)
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      do lane = 1, lanes
        if (d%pairs%additional%active) call add_additional(d, lane, k, lambda)
        if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
        weight = d%pairs%weight(lane, min(k, size(d%pairs%weight, 2)))
        stiffness = weight*pair_stiffness(d, lane, k)
        point = contact_point(d%pairs, d%laws(d%pairs%law_first(k), d%pairs%law_second(k))%share, &
                              lane, k)
        call add_pair(d, d%pairs%first(lane, k), d%pairs%second(lane, k), stiffness, point, lambda)
      end do
    end do
    if (d%surfaces%list%near > 0) call add_surface_rows(d, lambda)
    scale = 1.0_wp
    if (d%par%mode == mode_relaxation) scale = [d%par%mass_scale, d%par%inertia_scale]
    limit = huge(1.0_wp)
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      kn = max(lambda(1, i)/(scale(1)*d%grains%mass(i)), &
               lambda(2, i)/(scale(2)*minval(d%grains%inertia(:, i))))
      if (kn > 0.0_wp) limit = min(limit, 2.0_wp/sqrt(kn))
    end do
    do i = 1, d%clumps%n
      kn = clump_rate(d, i, scale, lambda)
      if (kn > 0.0_wp) limit = min(limit, 2.0_wp/sqrt(kn))
    end do
    kn = 0.0_wp
    if (allocated(d%surfaces%rigid%free) .and. .not. allocated(d%surfaces%rigid%acting)) &
      kn = body_rate(d%surfaces, body_rows(d))
    if (allocated(d%surfaces%membranes) .and. .not. allocated(d%surfaces%mesh%acting)) &
      kn = max(kn, membrane_rate(d%surfaces, corner_stiffness(d)))
    if (kn > 0.0_wp) limit = min(limit, 2.0_wp/sqrt(kn))
  end function gershgorin_step

  !> Rate of a clump from the row sums of its members: forces on a member meet its least effective
  !! mass, turns about its centre the least moment of inertia of the clump [1/s^2].
  !! eq. D.91
  pure real(wp) function clump_rate(d, clump, scale, lambda) result(rate)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: clump
    real(wp), intent(in) :: scale(2), lambda(:, :)
    real(wp) :: part(2), mass, inertia
    integer(i4) :: i
    mass = d%clumps%grains%mass(clump)
    inertia = scale(2)*minval(d%clumps%grains%inertia(:, clump))
    part = 0.0_wp
    do i = d%clumps%first(clump), d%clumps%last(clump)
      part = part + [d%clumps%lightness(i)*lambda(1, i)/mass, lambda(2, i)/inertia]
    end do
    if (d%clumps%first(clump) == d%clumps%last(clump)) then
      rate = max(part(1)/scale(1), part(2))
    else
      rate = part(1)/minval(scale) + part(2)
    end if
  end function clump_rate

  !> Add a contact to the row sums of its grains.
  pure subroutine add_pair(d, first, other, stiffness, point, lambda)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: first, other
    real(wp), intent(in) :: stiffness(2), point(3)  !! k_n, k_t [N/m], from the first [m]
    real(wp), intent(inout) :: lambda(:, :)
    real(wp) :: factor, arm(3), kn, kt
    integer(i4) :: second

    kn = stiffness(1)
    kt = stiffness(2)
    arm = point - (d%pairs%body(1:3, other) - d%pairs%body(1:3, first))
    second = d%pairs%grain(other)
    factor = 1.0_wp
    if (first <= d%grains%n) then
      if (gives_way(d%grains%kind(first))) factor = 2.0_wp
    end if
    lambda(1, second) = lambda(1, second) + factor*(kn + kt)
    lambda(2, second) = lambda(2, second) + factor*kt*sum(arm**2)
    if (first > d%grains%n) return
    factor = 1.0_wp
    if (gives_way(d%grains%kind(second))) factor = 2.0_wp
    lambda(1, first) = lambda(1, first) + factor*(kn + kt)
    lambda(2, first) = lambda(2, first) + factor*kt*sum(point**2)
  end subroutine add_pair

  !> Add the stiffness of additional contact models to the rows of their grains.
  pure subroutine add_additional(d, lane, k, lambda)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp), intent(inout) :: lambda(:, :)
    real(wp) :: stiffness(2)
    integer(i4) :: first, second

    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
      stiffness = d%pairs%weight(lane, min(k, size(d%pairs%weight, 2))) &
                  *additional_stiffness(law, lane, k, d%pairs)
    end associate
    if (.not. any(stiffness > 0.0_wp)) return
    first = d%pairs%first(lane, k)
    second = d%pairs%grain(d%pairs%second(lane, k))
    lambda(:, second) = lambda(:, second) + factor_of(d, first)*stiffness
    if (first <= d%grains%n) lambda(:, first) = lambda(:, first) + factor_of(d, second)*stiffness
  end subroutine add_additional

  !> Gershgorin's factor of a contact with a partner: 2 if that moves, 1 if it is prescribed.
  pure real(wp) function factor_of(d, partner)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: partner
    factor_of = 1.0_wp
    if (partner > d%grains%n) return
    if (gives_way(d%grains%kind(partner))) factor_of = 2.0_wp
  end function factor_of

  !> Least Rayleigh time of the free grains, at the least radius of curvature, with scaled mass [s].
  real(wp) function rayleigh_step(d) result(limit)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: i
    limit = huge(1.0_wp)
    do i = 1, d%grains%n
      if (moved_by_forces(d%grains%kind(i))) limit = min(limit, rayleigh_of(d, i))
    end do
  end function rayleigh_step

  !> That of grain i; huge if its material is rigid [s].
  pure real(wp) function rayleigh_of(d, i) result(time)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp) :: least, shear, density, scale, axis(3)
    scale = 1.0_wp
    if (d%par%mode == mode_relaxation) scale = d%par%mass_scale
    time = huge(1.0_wp)
    associate (m => d%materials(d%grains%material(i)))
      shear = m%young/(2.0_wp*(1.0_wp + m%poisson))
      if (.not. shear > 0.0_wp) return
      axis = d%grains%axes(:, i)
      least = minval(axis)**2/maxval(axis)
      density = scale*d%grains%mass(i)/(4.0_wp/3.0_wp*pi*product(axis))
      if (d%grains%kind(i) == kind_member) density = scale*m%density
      time = pi*least*sqrt(density/shear)/(0.1631_wp*m%poisson + 0.8766_wp)
    end associate
  end function rayleigh_of

  !> Least of impact_step and of what the dashpots of contacts allow, with its own margin whatever
  !! dt_factor is [s].
  real(wp) function foreseen_step(d, speed) result(limit)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: speed  !! approach speed [m/s]
    real(wp), parameter :: margin = 0.95_wp
    real(wp) :: damped
    limit = impact_step(d, speed)
    damped = damped_step(d, d%par%dt_factor/margin)
    if (damped < huge(1.0_wp)) limit = min(limit, margin/d%par%dt_factor*damped)
  end function foreseen_step

  !> Step limit that foresees one more contact of each free grain with an equal one at the given
  !! approach speed: Hertz stiffness at the overlap of that impact; linear laws as given [s].
  real(wp) function impact_step(d, speed) result(limit)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: speed  !! approach speed [m/s]
    real(wp) :: overlap, k, m, root, scale
    integer(i4) :: i

    scale = 1.0_wp
    if (d%par%mode == mode_relaxation) scale = d%par%mass_scale
    limit = huge(1.0_wp)
    do i = 1, d%grains%n
      if (.not. moved_by_forces(d%grains%kind(i))) cycle
      associate (law => d%laws(d%grains%material(i), d%grains%material(i)))
        m = d%grains%mass(i)*scale
        if (associated(law%base%impact)) then
          k = law%base%impact(law%law_numbers_type, 0.5_wp*m, 0.5_wp*d%grains%radius(i), speed)
          if (.not. k > 0.0_wp) cycle
        else if (law%kind > 0 .and. speed > 0.0_wp) then
          root = sqrt(0.5_wp*d%grains%radius(i))
          overlap = (15.0_wp*0.5_wp*m*speed**2/(16.0_wp*law%e_star*root))**0.4_wp
          k = (2.0_wp*law%e_star + 8.0_wp*law%g_star)*root*sqrt(overlap)
        else
          cycle
        end if
        if (d%clumps%n > 0) m = m/d%clumps%lightness(i)
        limit = min(limit, 2.0_wp/sqrt(2.0_wp*k/m))
      end associate
    end do
  end function impact_step
end module dem_limits
