!> Cohesion: an attraction along the normal in addition to the Hertz force, by one of three laws.
!!
!! constant: a given force while the bodies overlap. dmt: 2 pi w R_e while they overlap. jkr: the
!! force of a neck of radius a,
!!   overlap = a^2/R_e - sqrt(2 pi w a/E*),  F = 4 E* a^3/(3 R_e) - sqrt(8 pi w E* a^3),
!! which forms at the first touch and tears at the overlap -3/4 (pi^2 w^2 R_e/E*^2)^(1/3), where its
!! stable branch ends; dU = F d(overlap) along it gives its energy.
!! Kept of a lane: 1 neck radius, or 1 where the force acts [m], 2 pull on B along the normal [N],
!! 3 overlap [m], 4 R_e [m].
!! Works: of a force that appears or vanishes at once; of the change of R_e at constant overlap.
!! eq. D.18
module dem_cohesion
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_law_state, only: law_numbers_type, history_size, history_root, column_curvature
  use dem_additional_numbers, only: most_own, work_breakage
  use dem_additional_model, only: additional_model_type, additional_given_type, &
    additional_works_type
  use dem_block, only: dem_block_type
  use dem_pull, only: place_of_contact, speed_of_contact, add_pull
  implicit none
  private
  public :: cohesion, cohesion_type, tear_overlap, neck_radius
  public :: cohesion_constant, cohesion_dmt, cohesion_jkr

  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i4), parameter :: reals = 4  !! kept of a contact
  integer(i4), parameter :: cohesion_none = 0, cohesion_constant = 1, cohesion_dmt = 2, &
    cohesion_jkr = 3

  ! constants of its own: one of cohesion_..., the given force [N], w to part a unit of area [J/m^2]
  integer(i4), parameter :: own_kind = 1, own_pull = 2, own_energy = 3

  !> Constants of a pair of materials.
  type :: cohesion_type
    integer(i4) :: kind = cohesion_none
    real(wp) :: pull = 0.0_wp            !! of cohesion_constant [N]
    real(wp) :: surface_energy = 0.0_wp  !! w, to part a unit of area [J/m^2]
    real(wp) :: e_star = 0.0_wp          !! contact modulus E* [Pa]
  end type cohesion_type

contains

  pure function cohesion() result(model)
    type(additional_model_type) :: model
    model%name = 'cohesion'
    model%constants => constants
    model%forces => forces
    model%at_surfaces => forces
    model%energy => energy
    model%stiffness => stiffness
    model%reach => reach
    model%longest => longest
    model%shorter = 'less surface_energy: such grains are mere jelly'
    model%reals = reals
    model%holds = .true.
  end function cohesion

  !> Which one, and its one parameter.
  subroutine constants(deck, k, law, own, acts, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(inout) :: own(most_own)
    logical, intent(out) :: acts
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: kind

    call deck%get('contact', k, 'cohesion', name)
    kind = cohesion_none
    if (name == 'constant') kind = cohesion_constant
    if (name == 'dmt') kind = cohesion_dmt
    if (name == 'jkr') kind = cohesion_jkr
    if (kind == cohesion_constant) call deck%get('contact', k, 'pull_force', own(own_pull))
    if (kind == cohesion_dmt .or. kind == cohesion_jkr) &
      call deck%get('contact', k, 'surface_energy', own(own_energy))
    own(own_kind) = real(kind, wp)
    acts = kind /= cohesion_none
  end subroutine constants

  pure function constants_of(given) result(law)
    type(additional_given_type), intent(in) :: given
    type(cohesion_type) :: law
    law%kind = nint(given%own(own_kind))
    law%pull = given%own(own_pull)
    law%surface_energy = given%own(own_energy)
    law%e_star = given%law%e_star
  end function constants_of

  !> See forces_routine of dem_additional_model.
  pure subroutine forces(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: kept(:, :)
    type(additional_works_type), intent(inout) :: works
    call pull_block(b, given, history, kept, works)
  end subroutine forces

  !> The same with what is kept in a shape that the compiler knows.
  pure subroutine pull_block(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout) :: kept(lanes, reals)
    type(additional_works_type), intent(inout) :: works
    type(cohesion_type) :: law
    real(wp) :: row(reals), radius, normal(3), point(3), part(2), work(2), speed
    integer(i4) :: k

    law = constants_of(given)
    work = 0.0_wp
    do k = 1, lanes
      if (b%gap(k) >= 0.0_wp .and. .not. kept(k, 1) > 0.0_wp) cycle
      if (given%round) then
        radius = history(k, history_root)**2
      else
        radius = 1.0_wp/b%curvature(k)
      end if
      call place_of_contact(b, given%law%share, k, normal, point)
      row = kept(k, :)
      speed = speed_of_contact(b, k, point, normal)
      call one_contact(law, given%h, radius, -b%gap(k), speed, row, part)
      kept(k, :) = row
      work = work + given%weight(k)*part
      call add_pull(b, k, point, given%weight(k)*row(2)*normal)
    end do
    works%columns(column_curvature) = works%columns(column_curvature) + work(2)
    works%models(work_breakage) = works%models(work_breakage) + work(1)
  end subroutine pull_block

  !> One lane over the step: its row brought forward, and its works.
  pure subroutine one_contact(law, h, radius, overlap, speed, row, work)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: h, radius, overlap, speed
    real(wp), intent(inout) :: row(reals)
    real(wp), intent(out) :: work(2)
    real(wp) :: last(reals), paid
    logical :: was

    last = row
    was = last(1) > 0.0_wp
    row = [0.0_wp, 0.0_wp, overlap, radius]
    if (law%kind /= cohesion_jkr) then
      if (overlap > 0.0_wp) row(1) = 1.0_wp
    else if (overlap > 0.0_wp .or. (was .and. overlap >= tear_overlap(law, radius))) then
      row(1) = neck_radius(law, radius, overlap)
    end if
    if (row(1) > 0.0_wp) row(2) = pull(law, row)
    work = 0.0_wp
    if (was .neqv. row(1) > 0.0_wp) then
      paid = -0.5_wp*h*(last(2) + row(2))*speed
      work(1) = paid - (energy_of(law, row) - energy_of(law, last))
    else if (was .and. abs(radius - last(4)) > 0.0_wp) then
      work(2) = 0.5_wp*(energy_at(law, radius, overlap) - energy_at(law, last(4), overlap) &
                        + energy_at(law, radius, last(3)) - energy_at(law, last(4), last(3)))
    end if
  end subroutine one_contact

  !> Force on B along the normal in addition to Hertz [N].
  pure real(wp) function pull(law, row)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: row(reals)
    real(wp) :: a
    select case (law%kind)
    case (cohesion_constant)
      pull = -law%pull
    case (cohesion_dmt)
      pull = -2.0_wp*pi*law%surface_energy*row(4)
    case default
      a = row(1)
      pull = 4.0_wp/3.0_wp*law%e_star*a**3/row(4) &
             - sqrt(8.0_wp*pi*law%surface_energy*law%e_star*a**3) &
             - 4.0_wp/3.0_wp*law%e_star*sqrt(row(4))*max(row(3), 0.0_wp)**1.5_wp
    end select
  end function pull

  !> Energy of a contact in addition to Hertz [J].
  pure real(wp) function energy_of(law, row) result(energy)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: row(reals)
    real(wp) :: a, root
    energy = 0.0_wp
    if (.not. row(1) > 0.0_wp) return
    if (law%kind /= cohesion_jkr) then
      energy = pull(law, row)*row(3)
      return
    end if
    a = row(1)
    root = sqrt(2.0_wp*pi*law%surface_energy*a/law%e_star)
    energy = law%e_star*a*(8.0_wp/15.0_wp*(a**2/row(4))**2 - 4.0_wp/3.0_wp*root*a**2/row(4)) &
             + pi*law%surface_energy*a**2 &
             - 8.0_wp/15.0_wp*law%e_star*sqrt(row(4))*max(row(3), 0.0_wp)**2.5_wp
  end function energy_of

  !> The same at a radius and an overlap, which is kept on the stable branch [J].
  pure real(wp) function energy_at(law, radius, overlap) result(energy)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap
    real(wp) :: row(reals)
    row = [1.0_wp, 0.0_wp, overlap, radius]
    if (law%kind == cohesion_jkr) then
      row(3) = max(overlap, tear_overlap(law, radius))
      row(1) = neck_radius(law, radius, row(3))
    end if
    energy = energy_of(law, row)
  end function energy_at

  !> Overlap at which a neck tears: the least one that has a neck, below 0 [m].
  pure real(wp) function tear_overlap(law, radius) result(overlap)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: radius  !! R_e [m]
    real(wp) :: c
    c = sqrt(2.0_wp*pi*law%surface_energy/law%e_star)
    overlap = -0.75_wp*c*(0.25_wp*c*radius)**(1.0_wp/3.0_wp)
  end function tear_overlap

  !> Radius of the neck on the stable branch: Newton from above on s^4/R - c s = overlap, s^2 = a.
  pure real(wp) function neck_radius(law, radius, overlap) result(a)
    type(cohesion_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap  !! R_e, overlap [m]
    real(wp) :: c, s, step, least
    integer(i4) :: k
    integer(i4), parameter :: most_steps = 60
    c = sqrt(2.0_wp*pi*law%surface_energy/law%e_star)
    least = (0.25_wp*c*radius)**(1.0_wp/3.0_wp)
    s = sqrt(sqrt(radius*max(overlap, 0.0_wp))) + (c*radius)**(1.0_wp/3.0_wp)
    do k = 1, most_steps
      step = (s**4/radius - c*s - overlap)/max(4.0_wp*s**3/radius - c, 1.0e-12_wp*c)
      s = max(s - step, least)
      if (abs(step) <= 4.0_wp*epsilon(s)*s) exit
    end do
    a = s*s
  end function neck_radius

  !> See energy_routine of dem_additional_model.
  pure real(wp) function energy(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:, :)
    type(cohesion_type) :: law
    integer(i4) :: k
    law = constants_of(given)
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + given%weight(k)*energy_of(law, kept(k, :))
    end do
  end function energy

  !> Bound of the stiffness that a neck adds to Hertz'.
  pure function stiffness(given, kept) result(of_contact)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    real(wp) :: of_contact(2)
    of_contact = 0.0_wp
    if (nint(given%own(own_kind)) == cohesion_jkr) &
      of_contact(1) = 2.0_wp*given%law%e_star*kept(1)
  end function stiffness

  !> Gap at which a neck tears, with a margin [m].
  pure real(wp) function reach(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    real(wp), parameter :: ample = 2.0_wp  !! radii grow as a grain turns
    reach = 0.0_wp
    if (kept(1) > 0.0_wp) reach = longest(given, ample*kept(4))
  end function reach

  !> Gap at which necks of an effective radius tear [m].
  pure real(wp) function longest(given, radius)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: radius
    longest = 0.0_wp
    if (nint(given%own(own_kind)) == cohesion_jkr) &
      longest = -tear_overlap(constants_of(given), radius)
  end function longest
end module dem_cohesion
