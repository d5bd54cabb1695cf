!> Step that the dashpots of contacts allow (theory-dem, Motion).
!!
!! Their force is that of the velocity half a step ago. A mode of stiffness k and dashpot c, both
!! over its inertia, then grows beyond dt = 4/(c + sqrt(c^2 + 4 k)). Of a grain both are bounded by
!! the matrices of its translation, of its rotation and of what couples them, with f = 2 for a free
!! partner and 1 for a prescribed one.
module dem_damped_limit
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_contact, only: contact_constants_type, constants_of, contact_point
  use dem_pair_law, only: pair_stiffness
  use dem_surface_measure, only: surface_stiffness
  use dem_additional, only: additional_stiffness, models_damping
  use dem_kinds, only: gives_way
  use dem_state, only: dem_data_type, kind_free, lanes, mode_relaxation, history_side, history_root
  use dem_surface_body, only: is_free
  implicit none
  private
  public :: damped_step, mode_step

  !> Sums over the contacts of a grain, of stiffnesses or of dashpots.
  type :: block_type
    real(wp) :: motion(6) = 0.0_wp    !! xx yy zz xy yz zx
    real(wp) :: turn(6) = 0.0_wp
    real(wp) :: mixed(3, 3) = 0.0_wp  !! force of a turn
  end type block_type

  !> A contact as one of its grains sees it.
  type :: spring_type
    real(wp) :: arm(3) = 0.0_wp     !! from the grain's centre [m]
    real(wp) :: normal(3) = 0.0_wp  !! [-]
    real(wp) :: k(3) = 0.0_wp       !! normal, tangential [N/m], rotation [N m]
    real(wp) :: c(3) = 0.0_wp       !! the same of the dashpots [kg/s], [N m s]
  end type spring_type

contains

  !> Least step of all free grains [s]; huge where dashpots are too weak to count at steps of this
  !! share of the limit of springs, with as many as `most` contacts of full stiffness one way.
  real(wp) function damped_step(d, share) result(limit)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: share  !! [-]
    real(wp), parameter :: most = 20.0_wp
    type(block_type), allocatable :: sums(:, :)
    real(wp) :: ratio, y, bound(2), mass, inertia
    integer(i4) :: i

    limit = huge(1.0_wp)
    y = min(max(share, 1.0e-6_wp), 1.0_wp)
    ratio = max(maxval(d%laws%damping_ratio), maxval(d%laws%tangential_ratio), turn_damping(d))
    if (.not. ratio*sqrt(most) > (1.0_wp - y*y)/(2.0_wp*y)) return
    allocate (sums(2, d%grains%n))
    call add_pairs(d, sums)
    if (d%surfaces%list%near > 0) call add_surfaces(d, sums)
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      mass = d%grains%mass(i)
      inertia = minval(d%grains%inertia(:, i))
      if (d%par%mode == mode_relaxation) then
        mass = d%par%mass_scale*mass
        inertia = d%par%inertia_scale*inertia
      end if
      bound = [bound_of(sums(1, i), mass, inertia), bound_of(sums(2, i), mass, inertia)]
      if (bound(2) > 0.0_wp) limit = min(limit, mode_step(bound(1), bound(2)))
    end do
    do i = 1, d%clumps%n
      bound = clump_bound(d, i, sums)
      if (bound(2) > 0.0_wp) limit = min(limit, mode_step(bound(1), bound(2)))
    end do
  end function damped_step

  !> Bounds of a clump: those of its members, with their least effective mass, add up.
  pure function clump_bound(d, clump, sums) result(bound)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: clump
    type(block_type), intent(in) :: sums(:, :)
    real(wp) :: bound(2), mass, inertia
    integer(i4) :: i
    bound = 0.0_wp
    inertia = minval(d%clumps%grains%inertia(:, clump))
    if (d%par%mode == mode_relaxation) inertia = d%par%inertia_scale*inertia
    do i = d%clumps%first(clump), d%clumps%last(clump)
      mass = d%clumps%grains%mass(clump)/d%clumps%lightness(i)
      if (d%par%mode == mode_relaxation) mass = min(d%par%mass_scale, d%par%inertia_scale)*mass
      bound = bound + [bound_of(sums(1, i), mass, inertia), bound_of(sums(2, i), mass, inertia)]
    end do
  end function clump_bound

  !> Largest damping ratio of turns of all additional contact models [-].
  pure real(wp) function turn_damping(d) result(ratio)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: a, b
    ratio = 0.0_wp
    do a = 1, size(d%laws, 1)
      do b = 1, size(d%laws, 2)
        ratio = max(ratio, models_damping(d%laws(a, b), d%pairs%additional))
      end do
    end do
  end function turn_damping

  !> Largest step of a mode [s].
  pure real(wp) function mode_step(k, c) result(dt)
    real(wp), intent(in) :: k  !! stiffness over inertia [1/s^2]
    real(wp), intent(in) :: c  !! dashpot over inertia [1/s]
    dt = 4.0_wp/(c + sqrt(c*c + 4.0_wp*k))
  end function mode_step

  !> Contacts of grains with each other and with planes.
  subroutine add_pairs(d, sums)
    type(dem_data_type), intent(in) :: d
    type(block_type), intent(inout) :: sums(:, :)
    type(spring_type) :: s
    real(wp) :: weight
    integer(i4) :: k, lane, first, other, second

    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
        do lane = 1, lanes
          if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
          first = d%pairs%first(lane, k)
          other = d%pairs%second(lane, k)
          second = d%pairs%grain(other)
          weight = d%pairs%weight(lane, min(k, size(d%pairs%weight, 2)))
          call set_springs(constants_of(law%law_numbers_type), pair_stiffness(d, lane, k), &
                           d%pairs%m_star(lane, k), weight, s)
          if (d%pairs%additional%active .and. law%additional%used) call set_turning( &
            additional_stiffness(law, lane, k, d%pairs), models_damping(law, d%pairs%additional), &
            d%pairs%history(lane, history_root, k)**2, d%pairs%m_star(lane, k), weight, s)
          s%arm = contact_point(d%pairs, law%share, lane, k)
          s%normal = normal_of(d, lane, k)
          if (first <= d%grains%n) call add_spring(s, factor_of(d, second), sums(:, first))
          s%arm = s%arm - (d%pairs%body(1:3, other) - d%pairs%body(1:3, first))
          call add_spring(s, factor_of(d, first), sums(:, second))
        end do
      end associate
    end do
  end subroutine add_pairs

  !> Normal of a lane; spheres keep none in the list.
  pure function normal_of(d, lane, k) result(n)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp) :: n(3)
    n = d%pairs%normal(lane, :, k)
    if (.not. d%pairs%round(k)) return
    n = d%pairs%body(1:3, d%pairs%second(lane, k)) - d%pairs%body(1:3, d%pairs%first(lane, k))
    n = n/norm2(n)
  end function normal_of

  !> 2 for a partner that gives way, else 1.
  pure real(wp) function factor_of(d, partner)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: partner
    factor_of = 1.0_wp
    if (partner > d%grains%n) return
    if (gives_way(d%grains%kind(partner))) factor_of = 2.0_wp
  end function factor_of

  !> Contacts of grains with surfaces.
  subroutine add_surfaces(d, sums)
    type(dem_data_type), intent(in) :: d
    type(block_type), intent(inout) :: sums(:, :)
    type(spring_type) :: s
    integer(i4) :: g, k, i, body

    do g = 1, d%surfaces%list%near
      i = d%surfaces%list%near_grain(g)
      do k = 1, d%surfaces%list%contacts(g)
        if (.not. d%surfaces%list%history(k, history_side, g) > 0.0_wp) cycle
        associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                                 d%grains%material(i)))
          call set_springs(constants_of(law%law_numbers_type), surface_stiffness(d, k, g), &
                           d%grains%mass(i), 1.0_wp, s)
        end associate
        s%arm = d%surfaces%list%point(k, :, g) - d%pairs%body(1:3, i)
        s%normal = d%surfaces%list%normal(k, :, g)
        body = count(d%surfaces%first_part(:d%surfaces%n) <= d%surfaces%list%part(k, g))
        call add_spring(s, merge(2.0_wp, 1.0_wp, is_free(d%surfaces, body)), sums(:, i))
      end do
    end do
  end subroutine add_surfaces

  !> Springs and dashpots of the base law.
  pure subroutine set_springs(c, stiffness, m_star, weight, s)
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: stiffness(2), m_star, weight  !! k_n, k_t [N/m], [kg], [-]
    type(spring_type), intent(out) :: s
    s%k = weight*[stiffness, 0.0_wp]
    s%c = weight*sqrt(m_star*stiffness(1))*[c%damping, c%tangential_damping, 0.0_wp]
  end subroutine set_springs

  !> Those of additional contact models, against rotation.
  pure subroutine set_turning(stiffness, ratio, radius, m_star, weight, s)
    real(wp), intent(in) :: stiffness(2), ratio, radius, m_star, weight
    type(spring_type), intent(inout) :: s
    s%k(3) = weight*stiffness(2)
    s%c(3) = weight*2.0_wp*ratio*radius*sqrt(m_star*stiffness(2))
  end subroutine set_turning

  !> Add a contact to the sums of a grain: 1 stiffness, 2 dashpots.
  pure subroutine add_spring(s, factor, sums)
    type(spring_type), intent(in) :: s
    real(wp), intent(in) :: factor
    type(block_type), intent(inout) :: sums(2)
    call add_one(s, factor*s%k, sums(1))
    call add_one(s, factor*s%c, sums(2))
  end subroutine add_spring

  !> One kind of it: with u = x + w x arm the form k_n (u.n)^2 + k_t |u - (u.n) n|^2 + k_r w^2.
  pure subroutine add_one(s, k, sum_of)
    type(spring_type), intent(in) :: s
    real(wp), intent(in) :: k(3)
    type(block_type), intent(inout) :: sum_of
    real(wp), parameter :: one(6) = [1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    real(wp) :: lever(3), e(3)
    integer(i4) :: j
    lever = cross(s%arm, s%normal)
    sum_of%motion = sum_of%motion + k(2)*one + (k(1) - k(2))*square(s%normal)
    sum_of%turn = sum_of%turn + (k(2)*sum(s%arm**2) + k(3))*one - k(2)*square(s%arm) &
                  + (k(1) - k(2))*square(lever)
    do j = 1, 3
      e = 0.0_wp
      e(j) = 1.0_wp
      sum_of%mixed(:, j) = sum_of%mixed(:, j) + k(2)*cross(e, s%arm) &
                           + (k(1) - k(2))*lever(j)*s%normal
    end do
  end subroutine add_one

  pure function square(v) result(p)
    real(wp), intent(in) :: v(3)
    real(wp) :: p(6)
    p = [v(1)*v(1), v(2)*v(2), v(3)*v(3), v(1)*v(2), v(2)*v(3), v(3)*v(1)]
  end function square

  !> Bound of the largest eigenvalue over mass and inertia, from those of the parts.
  pure real(wp) function bound_of(s, mass, inertia) result(bound)
    type(block_type), intent(in) :: s
    real(wp), intent(in) :: mass, inertia
    real(wp) :: a, b, c, g(3, 3)
    a = largest_of(s%motion)/mass
    b = largest_of(s%turn)/inertia
    g = matmul(transpose(s%mixed), s%mixed)
    c = largest_of([g(1, 1), g(2, 2), g(3, 3), g(1, 2), g(2, 3), g(3, 1)])/(mass*inertia)
    bound = 0.5_wp*(a + b) + sqrt(0.25_wp*(a - b)**2 + c)
  end function bound_of

  !> Largest eigenvalue of a symmetric matrix.
  pure real(wp) function largest_of(m) result(value)
    real(wp), intent(in) :: m(6)  !! xx yy zz xy yz zx
    real(wp) :: mean, spread, d(3), cubic
    mean = sum(m(1:3))/3.0_wp
    d = m(1:3) - mean
    spread = sqrt((sum(d**2) + 2.0_wp*sum(m(4:6)**2))/6.0_wp)
    value = mean
    if (.not. spread > epsilon(1.0_wp)*abs(mean)) return
    cubic = d(1)*(d(2)*d(3) - m(5)**2) - m(4)*(m(4)*d(3) - m(5)*m(6)) &
            + m(6)*(m(4)*m(5) - d(2)*m(6))
    cubic = min(max(0.5_wp*cubic/spread**3, -1.0_wp), 1.0_wp)
    value = mean + 2.0_wp*spread*cos(acos(cubic)/3.0_wp)
  end function largest_of
end module dem_damped_limit
