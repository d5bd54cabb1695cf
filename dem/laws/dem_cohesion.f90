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
  use dem_state, only: lanes, history_size, history_root, dem_law_type
  use dem_additional_state, only: cohesion_constant, cohesion_dmt, cohesion_jkr, cohesion_reals
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: cohesion_block, cohesion_energy, tear_overlap, neck_radius, neck_stiffness

  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Add the pulls of all lanes; work: breakage, curvature [J].
  pure subroutine cohesion_block(b, law, round, h, weight, history, kept, work)
    type(dem_block_type), intent(inout) :: b
    type(dem_law_type), intent(in) :: law
    logical, intent(in) :: round                          !! all pairs are of spheres
    real(wp), intent(in) :: h                             !! time since the last evaluation [s]
    real(wp), intent(in) :: weight(lanes)
    real(wp), intent(in) :: history(lanes, history_size)  !! already brought forward
    real(wp), intent(inout) :: kept(lanes, cohesion_reals)
    real(wp), intent(out) :: work(2)
    real(wp) :: row(cohesion_reals), radius, normal(3), point(3), force(3), part(2)
    integer(i4) :: k

    work = 0.0_wp
    do k = 1, lanes
      if (b%gap(k) >= 0.0_wp .and. .not. kept(k, 1) > 0.0_wp) cycle
      if (round) then
        radius = history(k, history_root)**2
      else
        radius = 1.0_wp/b%curvature(k)
      end if
      normal = [b%nx(k), b%ny(k), b%nz(k)]
      point = [b%ax(k), b%ay(k), b%az(k)] + law%share*b%gap(k)*normal
      row = kept(k, :)
      call one_contact(law, h, radius, -b%gap(k), approach(b, k, point, normal), row, part)
      kept(k, :) = row
      work = work + weight(k)*part
      force = weight(k)*row(2)*normal
      point = point + b%a%x(k, :)
      b%load%fx(k) = b%load%fx(k) + force(1)
      b%load%fy(k) = b%load%fy(k) + force(2)
      b%load%fz(k) = b%load%fz(k) + force(3)
      b%load%mx(k) = b%load%mx(k) + point(2)*force(3) - point(3)*force(2)
      b%load%my(k) = b%load%my(k) + point(3)*force(1) - point(1)*force(3)
      b%load%mz(k) = b%load%mz(k) + point(1)*force(2) - point(2)*force(1)
    end do
  end subroutine cohesion_block

  !> Velocity of B from A along the normal at a point from the centre of A [m/s].
  pure real(wp) function approach(b, k, point, normal) result(speed)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: point(3), normal(3)
    real(wp) :: arm(3), v(3)
    arm = point - [b%rx(k), b%ry(k), b%rz(k)]
    v = [b%b%vx(k) - b%a%vx(k), b%b%vy(k) - b%a%vy(k), b%b%vz(k) - b%a%vz(k)] &
        + cross([b%b%wx(k), b%b%wy(k), b%b%wz(k)], arm) &
        - cross([b%a%wx(k), b%a%wy(k), b%a%wz(k)], point)
    speed = dot_product(v, normal)
  end function approach

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

  !> One lane over the step: its row brought forward, and its works.
  pure subroutine one_contact(law, h, radius, overlap, speed, row, work)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: h, radius, overlap, speed
    real(wp), intent(inout) :: row(cohesion_reals)
    real(wp), intent(out) :: work(2)
    real(wp) :: last(cohesion_reals), paid
    logical :: was

    last = row
    was = last(1) > 0.0_wp
    row = [0.0_wp, 0.0_wp, overlap, radius]
    if (law%additional%cohesion /= cohesion_jkr) then
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
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: row(cohesion_reals)
    real(wp) :: a
    select case (law%additional%cohesion)
    case (cohesion_constant)
      pull = -law%additional%pull
    case (cohesion_dmt)
      pull = -2.0_wp*pi*law%additional%surface_energy*row(4)
    case default
      a = row(1)
      pull = 4.0_wp/3.0_wp*law%e_star*a**3/row(4) &
             - sqrt(8.0_wp*pi*law%additional%surface_energy*law%e_star*a**3) &
             - 4.0_wp/3.0_wp*law%e_star*sqrt(row(4))*max(row(3), 0.0_wp)**1.5_wp
    end select
  end function pull

  !> Energy of a contact in addition to Hertz [J].
  pure real(wp) function energy_of(law, row) result(energy)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: row(cohesion_reals)
    real(wp) :: a, root
    energy = 0.0_wp
    if (.not. row(1) > 0.0_wp) return
    if (law%additional%cohesion /= cohesion_jkr) then
      energy = pull(law, row)*row(3)
      return
    end if
    a = row(1)
    root = sqrt(2.0_wp*pi*law%additional%surface_energy*a/law%e_star)
    energy = law%e_star*a*(8.0_wp/15.0_wp*(a**2/row(4))**2 - 4.0_wp/3.0_wp*root*a**2/row(4)) &
             + pi*law%additional%surface_energy*a**2 &
             - 8.0_wp/15.0_wp*law%e_star*sqrt(row(4))*max(row(3), 0.0_wp)**2.5_wp
  end function energy_of

  !> The same at a radius and an overlap, which is kept on the stable branch [J].
  pure real(wp) function energy_at(law, radius, overlap) result(energy)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap
    real(wp) :: row(cohesion_reals)
    row = [1.0_wp, 0.0_wp, overlap, radius]
    if (law%additional%cohesion == cohesion_jkr) then
      row(3) = max(overlap, tear_overlap(law, radius))
      row(1) = neck_radius(law, radius, row(3))
    end if
    energy = energy_of(law, row)
  end function energy_at

  !> Overlap at which a neck tears: the least one that has a neck, below 0 [m].
  pure real(wp) function tear_overlap(law, radius) result(overlap)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: radius  !! R_e [m]
    real(wp) :: c
    c = sqrt(2.0_wp*pi*law%additional%surface_energy/law%e_star)
    overlap = -0.75_wp*c*(0.25_wp*c*radius)**(1.0_wp/3.0_wp)
  end function tear_overlap

  !> Radius of the neck on the stable branch: Newton from above on s^4/R - c s = overlap, s^2 = a.
  pure real(wp) function neck_radius(law, radius, overlap) result(a)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: radius, overlap  !! R_e, overlap [m]
    real(wp) :: c, s, step, least
    integer(i4) :: k
    integer(i4), parameter :: most_steps = 60
    c = sqrt(2.0_wp*pi*law%additional%surface_energy/law%e_star)
    least = (0.25_wp*c*radius)**(1.0_wp/3.0_wp)
    s = sqrt(sqrt(radius*max(overlap, 0.0_wp))) + (c*radius)**(1.0_wp/3.0_wp)
    do k = 1, most_steps
      step = (s**4/radius - c*s - overlap)/max(4.0_wp*s**3/radius - c, 1.0e-12_wp*c)
      s = max(s - step, least)
      if (abs(step) <= 4.0_wp*epsilon(s)*s) exit
    end do
    a = s*s
  end function neck_radius

  !> Bound of the stiffness that a neck adds to Hertz' [N/m].
  pure real(wp) function neck_stiffness(law, row) result(stiffness)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: row(cohesion_reals)
    stiffness = 0.0_wp
    if (law%additional%cohesion == cohesion_jkr) stiffness = 2.0_wp*law%e_star*row(1)
  end function neck_stiffness

  !> Energy of cohesion of a block [J].
  pure real(wp) function cohesion_energy(law, weight, kept) result(energy)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: weight(lanes), kept(lanes, cohesion_reals)
    integer(i4) :: k
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + weight(k)*energy_of(law, kept(k, :))
    end do
  end function cohesion_energy
end module dem_cohesion
