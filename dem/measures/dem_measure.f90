!> Measures of a system: momenta, coordination, overlap, stress, runaway energy.
module dem_measure
  use talus_kinds, only: wp, i4, i8
  use talus_vectors, only: cross
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_contact, only: contact_radius
  use dem_pair_law, only: pair_stiffness
  use dem_state, only: dem_data_type, dem_grains_type, kind_free, lanes, history_side
  use dem_integrate, only: motion_type, motion_of, scaled_spin_momentum
  use dem_ellipsoid, only: rotation_of
  use dem_surface_measure, only: surface_contact_count, add_surface_coordination, &
    largest_surface_overlap
  implicit none
  private
  public :: momentum_of, angular_momentum_of, coordination_of, largest_overlap, stress_of
  public :: contact_count, check_runaway, check_overlap
  public :: fastest_grain, judge_runaway, wall_stiffness, wall_stiffnesses, forces_left

contains

  !> Linear momentum of the free grains, scaled masses [kg m/s].
  function momentum_of(d) result(p)
    type(dem_data_type), intent(in) :: d
    real(wp) :: p(3)
    type(motion_type) :: motion
    integer(i4) :: i
    motion = motion_of(d, d%par%dt)
    p = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_free) p = p + motion%mass_scale*d%grains%mass(i)*d%grains%v(:, i)
    end do
    do i = 1, d%clumps%n
      p = p + motion%mass_scale*d%clumps%grains%mass(i)*d%clumps%grains%v(:, i)
    end do
  end function momentum_of

  !> Angular momentum of the free grains about the origin, scaled masses [kg m^2/s].
  function angular_momentum_of(d) result(l)
    type(dem_data_type), intent(in) :: d
    real(wp) :: l(3)
    type(motion_type) :: motion
    integer(i4) :: i
    motion = motion_of(d, d%par%dt)
    l = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) == kind_free) l = l + moment_of_momentum(d%grains, i, motion)
    end do
    do i = 1, d%clumps%n
      l = l + moment_of_momentum(d%clumps%grains, i, motion)
    end do
  end function angular_momentum_of

  !> Angular momentum of grain i about the origin, scaled masses [kg m^2/s].
  pure function moment_of_momentum(g, i, motion) result(l)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: motion
    real(wp) :: l(3)
    l = motion%mass_scale*g%mass(i)*cross(g%x(:, i), g%v(:, i)) &
        + motion%inertia_scale*scaled_spin_momentum(rotation_of(g%quat(:, i)), g%inertia(:, i), &
                                                    g%omega(:, i))
  end function moment_of_momentum

  !> Contacts of every grain, planes included.
  function coordination_of(d) result(z)
    type(dem_data_type), intent(in) :: d
    integer(i4), allocatable :: z(:)
    integer(i4) :: k, lane, i

    allocate (z(d%grains%n), source=0)
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      do lane = 1, lanes
        if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
        i = d%pairs%first(lane, k)
        if (i <= d%grains%n) z(i) = z(i) + 1
        i = d%pairs%grain(d%pairs%second(lane, k))
        z(i) = z(i) + 1
      end do
    end do
    if (d%surfaces%list%near > 0) call add_surface_coordination(d, z)
  end function coordination_of

  !> Number of contacts.
  integer(i4) function contact_count(d)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: k
    contact_count = surface_contact_count(d)
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      contact_count = contact_count + count(d%pairs%history(:, history_side, k) > 0.0_wp)
    end do
  end function contact_count

  !> Least semi-axis of the two bodies of a pair; a plane has none [m].
  pure real(wp) function least_axis(d, first, second) result(axis)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: first, second
    axis = minval(d%grains%axes(:, second))
    if (first <= d%grains%n) axis = min(axis, minval(d%grains%axes(:, first)))
  end function least_axis

  !> Largest overlap/least semi-axis, and its pair (slot 0: no contact).
  subroutine largest_overlap(d, ratio, first, second)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(out) :: ratio
    integer(i4), intent(out) :: first, second  !! bodies, 0 without contact
    integer(i4) :: k, lane
    real(wp) :: this, least

    ratio = 0.0_wp
    first = 0
    second = 0
    least = (1.0_wp - 1.0e-9_wp)*minval(d%grains%axes)  ! for blocks that need no closer test
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      if (.not. maxval(d%pairs%history(:, history_side, k))**2 > ratio*least) cycle
      do lane = 1, lanes
        if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
        this = d%pairs%history(lane, history_side, k)**2 &
               /least_axis(d, d%pairs%first(lane, k), d%pairs%grain(d%pairs%second(lane, k)))
        if (this <= ratio) cycle
        ratio = this
        first = d%pairs%first(lane, k)
        second = d%pairs%grain(d%pairs%second(lane, k))
      end do
    end do
    if (d%surfaces%list%near > 0) call largest_surface_overlap(d, ratio, first, second)
  end subroutine largest_overlap

  !> Love-Weber stress of all grain-grain contacts over a volume, compression negative [Pa]:
  !! sigma_ij = -1/V sum of branch_i force_j, the force being that on the second grain.
  function stress_of(d, volume) result(sigma)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: volume  !! [m^3]
    real(wp) :: sigma(3, 3), branch(3), force(3)
    integer(i4) :: k, lane, j

    sigma = 0.0_wp
    do k = 1, d%pairs%grain_blocks
      if (.not. d%pairs%touched(k)) cycle
      do lane = 1, lanes
        if (.not. d%pairs%history(lane, history_side, k) > 0.0_wp) cycle
        branch = d%pairs%body(1:3, d%pairs%second(lane, k)) &
                 - d%pairs%body(1:3, d%pairs%first(lane, k))
        if (d%clumps%n > 0) branch = branch - arms(d, lane, k)
        force = d%pairs%result(1:3, (k - 1)*lanes + lane)
        do j = 1, 3
          sigma(:, j) = sigma(:, j) - branch*force(j)
        end do
      end do
    end do
    sigma = sigma/volume
  end function stress_of

  !> How much longer the branch of a contact is from member to member than between the centres of
  !! mass of their clumps [m].
  pure function arms(d, lane, k)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp) :: arms(3)
    arms = d%clumps%arm(:, d%pairs%grain(d%pairs%second(lane, k))) &
           - d%clumps%arm(:, d%pairs%first(lane, k))
  end function arms

  !> Stiffness of the contacts of each plane [N/m].
  pure function wall_stiffnesses(d) result(stiffness)
    type(dem_data_type), intent(in) :: d
    real(wp) :: stiffness(d%planes%n)
    integer(i4) :: k
    stiffness = [(wall_stiffness(d, k), k=1, d%planes%n)]
  end function wall_stiffnesses

  !> Sum of the normal stiffnesses of a plane's contacts [N/m].
  pure real(wp) function wall_stiffness(d, wall) result(stiffness)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: wall
    real(wp) :: pair(2)
    integer(i4) :: e, slot, lane, block, body

    stiffness = 0.0_wp
    body = d%grains%n + 3 + wall
    do e = d%pairs%start(body), d%pairs%start(body + 1) - 1
      slot = d%pairs%entry(e)/2
      lane = 1 + mod(slot, lanes)
      block = 1 + slot/lanes
      if (.not. d%pairs%history(lane, history_side, block) > 0.0_wp) cycle
      associate (law => d%laws(d%pairs%law_first(block), d%pairs%law_second(block)))
        if (associated(law%base%response)) then
          pair = pair_stiffness(d, lane, block)
          stiffness = stiffness + pair(1)
        else
          stiffness = stiffness &
            + 2.0_wp*law%e_star*contact_radius(d%pairs%history(lane, :, block)) + law%kn
        end if
      end associate
    end do
  end function wall_stiffness

  !> Sum of the forces left on free grains (contacts, gravity, extra forces; no background damping)
  !! [N], and their number.
  pure function forces_left(d) result(sums)
    type(dem_data_type), intent(in) :: d
    real(wp) :: sums(2), gravity(3)
    integer(i4) :: i
    gravity = d%par%gravity_scale*d%par%gravity
    sums = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      sums = sums + [norm2(d%grains%force(:, i) + d%grains%extra_force(:, i) &
                           + d%grains%mass(i)*gravity), 1.0_wp]
    end do
    do i = 1, d%clumps%n
      sums = sums + [norm2(d%clumps%grains%force(:, i) + d%clumps%grains%mass(i)*gravity), 1.0_wp]
    end do
  end function forces_left

  !> Fault N201 when kinetic energy exceeds par%energy_limit times all that was ever put in.
  subroutine check_runaway(d, errors)
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: kinetic, most
    integer(i4) :: worst
    call fastest_grain(d, kinetic, most, worst)
    if (worst == 0) then
      call judge_runaway(d, kinetic, 0_i8, 0.0_wp, errors)
    else
      call judge_runaway(d, kinetic, d%grains%id(worst), sqrt(sum(d%grains%v(:, worst)**2)), errors)
    end if
  end subroutine check_runaway

  !> Kinetic energy of the free grains, no less than it is, and the grain that has the most of it.
  pure subroutine fastest_grain(d, kinetic, most, worst)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(out) :: kinetic, most  !! [J]
    integer(i4), intent(out) :: worst       !! 0: no free grain
    type(motion_type) :: motion
    real(wp) :: this
    integer(i4) :: i

    motion = motion_of(d, d%par%dt)
    kinetic = 0.0_wp
    most = -1.0_wp
    worst = 0
    do i = 1, d%grains%n
      if (d%grains%kind(i) /= kind_free) cycle
      this = energy_bound(d%grains, i, motion)
      kinetic = kinetic + this
      if (this > most) then
        most = this
        worst = i
      end if
    end do
    do i = 1, d%clumps%n
      this = energy_bound(d%clumps%grains, i, motion)
      kinetic = kinetic + this
      if (this > most) then
        most = this
        worst = d%clumps%first(i)
      end if
    end do
  end subroutine fastest_grain

  !> Kinetic energy of grain i, no less than it is [J].
  pure real(wp) function energy_bound(g, i, motion) result(energy)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    type(motion_type), intent(in) :: motion
    energy = 0.5_wp*motion%mass_scale*g%mass(i)*sum(g%v(:, i)**2) &
             + 0.5_wp*motion%inertia_scale*maxval(g%inertia(:, i))*sum(g%omega(:, i)**2)
  end function energy_bound

  !> Compare a kinetic energy with all that was ever put in, which is kept in the health counters.
  subroutine judge_runaway(d, kinetic, id, speed, errors)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: kinetic   !! [J]
    integer(i8), intent(in) :: id     !! of the fastest grain, 0: there is none
    real(wp), intent(in) :: speed     !! of it [m/s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: scale

    scale = max(abs(d%ledger%start), abs(d%ledger%gravity), abs(d%ledger%boundary), &
                abs(d%ledger%external), abs(d%ledger%entered))
    d%health%reference_energy = max(d%health%reference_energy, scale)
    if (id == 0 .or. .not. d%health%reference_energy > 0.0_wp) return
    if (kinetic <= d%par%energy_limit*d%health%reference_energy) return
    call errors%add('N201', 'runaway energy: '//str(kinetic)//' J of motion from '// &
                    str(d%health%reference_energy)//' J put in; fastest is grain '// &
                    str(id)//' with '//str(speed)// &
                    ' m/s', place='step '//str(d%health%steps), &
                    hint='lower the time step; see its present limit in the log')
  end subroutine judge_runaway

  !> Largest overlap into the health counters; fault `code` when it passes par%overlap_limit.
  subroutine check_overlap(d, code, errors)
    type(dem_data_type), intent(inout) :: d
    character(len=*), intent(in) :: code
    type(error_list_type), intent(inout) :: errors
    real(wp) :: ratio
    integer(i4) :: first, second
    character(len=:), allocatable :: partner

    call largest_overlap(d, ratio, first, second)
    d%health%max_overlap = max(d%health%max_overlap, ratio)
    if (d%health%deepest > max(ratio, d%par%overlap_limit)) then
      d%health%max_overlap = max(d%health%max_overlap, d%health%deepest)
      call name_deepest(d, code, errors)
      return
    end if
    if (ratio <= d%par%overlap_limit) return
    if (d%surfaces%n > 0 .and. first > d%grains%n + 3 + d%planes%n) then
      partner = "surface '"//d%surfaces%name(first - d%grains%n - 3 - d%planes%n)%s//"'"
    else if (first > d%grains%n) then
      partner = 'plane '//str(first - d%grains%n - 3)
    else
      partner = 'grain '//str(d%grains%id(first))
    end if
    call add_overlap(d, code, partner, d%grains%id(second), ratio, errors)
  end subroutine check_overlap

  !> The deepest contact between two looks at all contacts, see dem_depth.
  subroutine name_deepest(d, code, errors)
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: code
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: partner
    associate (other => d%health%deepest_pair(2))
      if (other > 0) then
        partner = 'grain '//str(other)
      else if (-other <= d%planes%n) then
        partner = 'plane '//str(-other)
      else
        partner = "surface '"//d%surfaces%name(-other - d%planes%n)%s//"'"
      end if
    end associate
    call add_overlap(d, code, partner, d%health%deepest_pair(1), d%health%deepest, errors)
  end subroutine name_deepest

  subroutine add_overlap(d, code, partner, id, ratio, errors)
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: code, partner
    integer(i8), intent(in) :: id
    real(wp), intent(in) :: ratio
    type(error_list_type), intent(inout) :: errors
    call errors%add(code, partner//' and grain '//str(id)//' overlap by '// &
                    str(ratio)//' of the least semi-axis, more than the limit '// &
                    str(d%par%overlap_limit), place='step '//str(d%health%steps), &
                    hint='a stiffer material, a smaller load or a smaller time step; the '// &
                    'limit is &limits overlap')
  end subroutine add_overlap
end module dem_measure
