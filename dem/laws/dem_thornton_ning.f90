!> Base law 'thornton_ning': elastic-plastic normal force of spheres without adhesion (Thornton and
!! Ning 1998, Powder Technology 99, 154-162), tangential force of Mindlin at the present radius.
!!
!! Loading: Hertz up to the overlap d_y = (pi p_y/(2 E*))^2 R_e, where the pressure in the middle is
!! the yield pressure p_y, then F = F_y + pi R_e p_y (d - d_y). From the largest overlap d* and its
!! force F* the contact unloads and reloads along a Hertz curve of the same contact radius there:
!!   F = 4/3 E* sqrt(R_p) (d - d_p)^(3/2),  R_p = R_e F_e(d*)/F*,  d_p = d* (1 - R_e/R_p),
!! F_e the force of Hertz. Work done less energy stored is plastic work, a function of d*
!! alone. R_e is that of the first touch. The flat that is left is forgotten when
!! the bodies part.
!! Kept of a contact: 1 d* beyond d_y [m], else 0; 2 contact radius [m]; 3 normal force [N];
!! 4 elastic overlap d - d_p [m]; 5 energy of the tangential spring [J].
module dem_thornton_ning
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_law_state, only: base_law_type, law_numbers_type, history_size, &
    column_count, column_plastic
  use dem_block, only: dem_block_type
  use dem_contact, only: contact_constants_type, contact_scratch_type, constants_of, &
    begin_contacts, approach_contacts, tangential_springs, finish_contacts
  implicit none
  private
  public :: thornton_ning, yield_overlap, plastic_work

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: tiny_stiffness = 1.0e-200_wp
  integer(i4), parameter :: own_pressure = 1  !! place of p_y among the law's own numbers [Pa]

contains

  pure function thornton_ning() result(base)
    type(base_law_type) :: base
    base%name = 'thornton_ning'
    base%constants => constants
    base%forces => forces
    base%energy => energy
    base%response => response
    base%impact => impact
    base%memory = 'yielded'
    base%reals = 5
    base%hertz = .false.
    base%plastic = .true.
  end function thornton_ning

  !> The yield pressure; contacts keep their R_e.
  subroutine constants(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(law_numbers_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    law%frozen = .true.
    if (deck%given('contact', k, 'yield_pressure')) &
      call deck%get('contact', k, 'yield_pressure', law%own(own_pressure))
  end subroutine constants

  !> See forces_routine of dem_law_state.
  pure subroutine forces(b, law, round, h, m_star, weight, history, memory, columns)
    type(dem_block_type), intent(inout) :: b
    type(law_numbers_type), intent(in) :: law
    logical, intent(in) :: round
    real(wp), intent(in) :: h, m_star(lanes), weight(lanes)
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: memory(:, :)
    real(wp), intent(out) :: columns(column_count)
    type(contact_constants_type) :: c
    type(contact_scratch_type) :: s
    real(wp) :: lost, work
    integer(i4) :: k

    c = constants_of(law)
    call begin_contacts(b, c, round, h, m_star, history, s)
    lost = 0.0_wp
    do k = 1, lanes
      s%soft_last(k) = 1.0_wp/max(c%kt_a*memory(k, 2), tiny_stiffness)
      call load_contact(law, s%root(k)**2, -b%gap(k), memory(k, :), work)
      lost = lost + weight(k)*work
      s%kn(k) = c%kn_a*memory(k, 2)
      s%kt(k) = c%kt_a*memory(k, 2)
      s%soft(k) = 1.0_wp/max(s%kt(k), tiny_stiffness)
      s%dash(k) = sqrt(m_star(k)*s%kn(k))
      s%elastic(k) = memory(k, 3)
    end do
    call approach_contacts(b, c, h, s)
    call tangential_springs(b, c, h, history, s)
    memory(:, 5) = 0.5_wp*s%t2*s%soft
    call finish_contacts(b, c, round, h, weight, s, history, columns)
    columns(column_plastic) = lost
  end subroutine forces

  !> Bring a contact to an overlap; work: plastic work on the way [J].
  pure subroutine load_contact(law, radius, overlap, kept, work)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap  !! R_e, d [m]
    real(wp), intent(inout) :: kept(:)
    real(wp), intent(out) :: work
    real(wp) :: first, ratio

    work = 0.0_wp
    if (.not. overlap > 0.0_wp) then
      kept = 0.0_wp
      return
    end if
    first = yield_overlap(law, radius)
    if (overlap > max(first, kept(1))) then
      work = plastic_work(law, radius, overlap)
      if (kept(1) > 0.0_wp) work = work - plastic_work(law, radius, kept(1))
      kept(1) = overlap
    end if
    ratio = 1.0_wp
    if (kept(1) > 0.0_wp) ratio = force_ratio(kept(1)/first)
    kept(4) = max(overlap - kept(1)*(1.0_wp - ratio), 0.0_wp)
    kept(2) = sqrt(radius*kept(4)/ratio)
    kept(3) = 4.0_wp/3.0_wp*law%e_star*kept(2)*kept(4)
  end subroutine load_contact

  !> Overlap at which yield begins [m].
  pure real(wp) function yield_overlap(law, radius) result(overlap)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: radius  !! R_e [m]
    overlap = (0.5_wp*pi*law%own(own_pressure)/law%e_star)**2*radius
  end function yield_overlap

  !> Force on the line of yield over that of Hertz, which is R_e/R_p; u: overlap in d_y.
  pure real(wp) function force_ratio(u) result(ratio)
    real(wp), intent(in) :: u
    ratio = (1.5_wp*u - 0.5_wp)/(u*sqrt(u))
  end function force_ratio

  !> Plastic work of a first loading up to an overlap beyond yield_overlap [J].
  pure real(wp) function plastic_work(law, radius, overlap) result(work)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap  !! R_e, d* [m]
    real(wp) :: first, u
    first = yield_overlap(law, radius)
    u = overlap/first
    work = pi*radius*law%own(own_pressure)*first**2 &
           *(0.5_wp*u*u - u/3.0_wp + 0.1_wp - 0.6_wp*(u - 1.0_wp/3.0_wp)**2/sqrt(u))
  end function plastic_work

  !> See energy_routine of dem_law_state.
  pure subroutine energy(law, weight, memory, energy_of)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: weight(lanes), memory(:, :)
    real(wp), intent(inout) :: energy_of(2)
    energy_of(1) = sum(weight*0.4_wp*memory(:, 3)*memory(:, 4))
    energy_of(2) = sum(weight*memory(:, 5))
  end subroutine energy

  !> See response_routine of dem_law_state; k_n is that of unloading.
  pure function response(law, memory) result(of_contact)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: memory(:)
    real(wp) :: of_contact(3)
    of_contact = [2.0_wp*law%e_star*memory(2), 8.0_wp*law%g_star*memory(2), memory(3)]
  end function response

  !> See impact_routine of dem_law_state: the largest overlap from the work of loading.
  pure real(wp) function impact(law, mass, radius, speed)
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(in) :: mass, radius, speed
    real(wp) :: first, overlap, ratio
    first = yield_overlap(law, radius)
    ratio = mass*speed**2/(8.0_wp/15.0_wp*pi*radius*law%own(own_pressure)*first**2)
    overlap = first*ratio**0.4_wp
    if (ratio > 1.0_wp) overlap = first*(1.0_wp + sqrt(4.8_wp*ratio - 0.8_wp))/3.0_wp
    impact = (2.0_wp*law%e_star + 8.0_wp*law%g_star)*sqrt(radius*overlap)
  end function impact
end module dem_thornton_ning
