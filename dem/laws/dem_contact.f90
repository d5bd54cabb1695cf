!> Contact forces of one block: normal, tangential with history, damping, and their work. The whole
!! as `spring_forces`, and its steps for laws that differ in one of them.
!!
!! History of a lane (all zero without contact): 1-3 tangential elastic force on B, 4-6 damping
!! force on B [N], 7 square root of the overlap, 8 sqrt(R_e) [m^1/2], 9-11 contact point from the
!! centre of A [m]. Two spheres keep 1-7 alone: their R_e is constant and set at the start, their
!! last contact point follows from the last overlap and the velocities.
!! Work columns: see dem_law_state; plastic work is none here.
!! The work of a step is half that of the last forces at the last contact point and half that of
!! the new ones, both with the velocity of the step: this is what the leapfrog puts into the
!! kinetic energy, so that the ledger closes to the error of the stored energies alone.
module dem_contact
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes, history_size, history_side, history_root, history_point, &
    column_count, dem_pairs_type, dem_law_type
  use dem_law_state, only: law_numbers_type
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: spring_forces, contact_constants_type, constants_of, stored_energy, contact_radius, &
    contact_point, contact_stiffness
  public :: contact_scratch_type, begin_contacts, approach_contacts, tangential_springs, &
    finish_contacts

  real(wp), parameter :: tiny_force = 1.0e-200_wp

  !> Constants of the law as the loop needs them.
  type :: contact_constants_type
    real(wp) :: kn_a       !! 2 E*: k_n = kn_a a [Pa]; 0 for the linear law
    real(wp) :: kt_a       !! 8 G*: k_t = kt_a a [Pa]; 0 for the linear law
    real(wp) :: kn         !! linear stiffness [N/m]; 0 for Hertz
    real(wp) :: kt         !! linear tangential stiffness [N/m]; 0 for Hertz
    real(wp) :: spring     !! 1: tangential spring kept, 0: none
    real(wp) :: normal_share  !! elastic force = normal_share k_n overlap: 2/3 or 1
    real(wp) :: c          !! 8/15 E* [Pa]
    real(wp) :: damping             !! 2 xi: dashpot = damping sqrt(m* k_n) [-]
    real(wp) :: tangential_damping  !! the same for the tangent, times sqrt(k_t/k_n) [-]
    real(wp) :: friction, share
    logical :: frozen          !! a contact keeps the R_e of its first touch
  end type contact_constants_type

  !> What passes between the steps of a law, a lane each.
  type :: contact_scratch_type
    real(wp) :: on(lanes)                           !! 1 in contact, else 0
    real(wp) :: side(lanes), root(lanes)            !! sqrt(overlap), sqrt(R_e) [m^1/2]
    real(wp) :: c(lanes), c_last(lanes)             !! 8/15 E* overlap^(5/2) now and before
    real(wp) :: kn(lanes), kt(lanes)                !! stiffnesses [N/m]
    real(wp) :: soft(lanes), soft_last(lanes)       !! 1/k_t now and before [m/N]
    real(wp) :: dash(lanes)                         !! sqrt(m* k_n) [kg/s]
    real(wp) :: elastic(lanes), total(lanes)        !! normal force without and with damping [N]
    real(wp) :: px(lanes), py(lanes), pz(lanes)     !! contact point from the centre of A [m]
    real(wp) :: lx(lanes), ly(lanes), lz(lanes)     !! the last one [m]
    real(wp) :: sx(lanes), sy(lanes), sz(lanes)     !! relative velocity at the contact [m/s]
    real(wp) :: ox(lanes), oy(lanes), oz(lanes)     !! relative velocity at the last contact [m/s]
    real(wp) :: wx(lanes), wy(lanes), wz(lanes)     !! tangential part of s [m/s]
    real(wp) :: tx(lanes), ty(lanes), tz(lanes)     !! tangential elastic force [N]
    real(wp) :: dx(lanes), dy(lanes), dz(lanes)     !! damping force [N]
    real(wp) :: was(lanes), t2(lanes), slip(lanes)  !! |T|^2 before and now [N^2], slip work [J]
  end type contact_scratch_type

contains

  pure function constants_of(law) result(c)
    type(law_numbers_type), intent(in) :: law
    type(contact_constants_type) :: c
    c%kn_a = 2.0_wp*law%e_star
    c%kt_a = 8.0_wp*law%g_star
    c%kn = law%kn
    c%kt = law%kt
    c%c = 8.0_wp/15.0_wp*law%e_star
    c%normal_share = 2.0_wp/3.0_wp
    if (law%kn > 0.0_wp) c%normal_share = 1.0_wp
    c%spring = law%spring
    c%friction = law%friction
    c%damping = 2.0_wp*law%damping_ratio
    c%tangential_damping = 2.0_wp*law%tangential_ratio &
                           *sqrt((c%kt_a + c%kt)/max(c%kn_a + c%kn, tiny_force))
    c%share = law%share
    c%frozen = law%frozen
  end function constants_of

  !> Normal and tangential stiffness of a contact [N/m].
  pure function contact_stiffness(law, history, memory) result(stiffness)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: history(history_size), memory(:)
    real(wp) :: stiffness(2), response(3), radius
    if (associated(law%base%response)) then
      response = law%base%response(law%law_numbers_type, memory)
      stiffness = response(1:2)
    else
      radius = contact_radius(history)
      stiffness = [2.0_wp*law%e_star*radius + law%kn, 8.0_wp*law%g_star*radius + law%kt]
    end if
  end function contact_stiffness

  !> Radius of a contact from its history [m].
  pure real(wp) function contact_radius(history)
    real(wp), intent(in) :: history(history_size)
    contact_radius = history(history_root)*history(history_side)
  end function contact_radius

  !> Point of the contact in a lane from the centre of its body A [m].
  pure function contact_point(pairs, share, lane, block) result(point)
    type(dem_pairs_type), intent(in) :: pairs
    real(wp), intent(in) :: share  !! of the overlap, on the side of A [-]
    integer(i4), intent(in) :: lane, block
    real(wp) :: point(3), branch(3), overlap
    if (.not. pairs%round(block)) then
      point = pairs%history(lane, history_point:history_point + 2, block)
      return
    end if
    associate (a => pairs%body(:, pairs%first(lane, block)), &
               b => pairs%body(:, pairs%second(lane, block)))
      branch = b(1:3) - a(1:3)
      overlap = pairs%history(lane, history_side, block)**2
      point = (sqrt(a(10)) - share*overlap)/max(norm2(branch), tiny(1.0_wp))*branch
    end associate
  end function contact_point

  !> Stored normal and tangential energy of a block from its history [J].
  pure function stored_energy(c, weight, history) result(energy)
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: weight(lanes), history(lanes, history_size)
    real(wp) :: energy(2), kt, normal, tangential, overlap, a
    integer(i4) :: k
    normal = 0.0_wp
    tangential = 0.0_wp
    !$omp simd private(kt, overlap, a) reduction(+: normal, tangential)
    do k = 1, lanes
      overlap = history(k, history_side)**2
      a = history(k, history_root)*history(k, history_side)
      kt = max(c%kt_a*a + c%kt, tiny_force)
      normal = normal + weight(k)*overlap*overlap*(c%c*a + 0.5_wp*c%kn)
      tangential = tangential + weight(k)*0.5_wp/kt &
                   *(history(k, 1)**2 + history(k, 2)**2 + history(k, 3)**2)
    end do
    energy = [normal, tangential]
  end function stored_energy

  !> The forces of Hertz or linear springs: forces_routine of laws without a memory of their own.
  pure subroutine spring_forces(b, law, round, h, m_star, weight, history, memory, columns)
    type(dem_block_type), intent(inout) :: b
    type(law_numbers_type), intent(in) :: law
    logical, intent(in) :: round                             !! all pairs are of spheres
    real(wp), intent(in) :: h                                !! since the last evaluation [s]
    real(wp), intent(in) :: m_star(lanes), weight(lanes)     !! reduced masses [kg], weights [-]
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: memory(:, :)      !! (lanes, 0)
    real(wp), intent(out) :: columns(column_count)
    type(contact_constants_type) :: c
    type(contact_scratch_type) :: s

    c = constants_of(law)
    call begin_contacts(b, c, round, h, m_star, history, s)
    call approach_contacts(b, c, h, s)
    call tangential_springs(b, c, h, history, s)
    call finish_contacts(b, c, round, h, weight, s, history, columns)
  end subroutine spring_forces

  !> First step: effective radii, last contact points, normal forces, stiffnesses, contact points.
  pure subroutine begin_contacts(b, c, round, h, m_star, history, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    logical, intent(in) :: round
    real(wp), intent(in) :: h, m_star(lanes), history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    if (round) then
      call recall_spheres(b, c, h, history, s)
    else
      call recall_contacts(b, history, s)
      if (c%frozen) call freeze_radii(history, s)
    end if
    call normal_forces(b, c, m_star, history, s)
  end subroutine begin_contacts

  !> Second step: velocities at the contacts and normal damping.
  pure subroutine approach_contacts(b, c, h, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: h
    type(contact_scratch_type), intent(inout) :: s
    call relative_motion(b, h, s)
    call damp_normal(b, c, s)
  end subroutine approach_contacts

  !> Last step, after the tangential forces: their damping, works, history, loads.
  pure subroutine finish_contacts(b, c, round, h, weight, s, history, columns)
    type(dem_block_type), intent(inout) :: b
    type(contact_constants_type), intent(in) :: c
    logical, intent(in) :: round
    real(wp), intent(in) :: h, weight(lanes)
    type(contact_scratch_type), intent(inout) :: s
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(out) :: columns(column_count)
    call damp_tangent(b, c, s)
    call sum_work(h, weight, history, s, columns)
    call keep_history(s, round, history)
    call put_forces(b, weight, s)
  end subroutine finish_contacts

  !> Effective radii now and the last contact points from the history.
  pure subroutine recall_contacts(b, history, s)
    type(dem_block_type), intent(in) :: b
    real(wp), intent(in) :: history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    integer(i4) :: k
    !$omp simd
    do k = 1, lanes
      s%root(k) = 1.0_wp/sqrt(b%curvature(k))
      s%lx(k) = history(k, history_point)
      s%ly(k) = history(k, history_point + 1)
      s%lz(k) = history(k, history_point + 2)
    end do
  end subroutine recall_contacts

  !> Contacts that go on keep the effective radius of their first touch.
  pure subroutine freeze_radii(history, s)
    real(wp), intent(in) :: history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    where (history(:, history_side) > 0.0_wp) s%root = history(:, history_root)
  end subroutine freeze_radii

  !> The same for spheres: the last branch, along which the last point lay, is today's less its
  !! growth, and as long as the radii less the last overlap.
  pure subroutine recall_spheres(b, c, h, history, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: h, history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: overlap, length, factor
    integer(i4) :: k
    !$omp simd private(overlap, length, factor)
    do k = 1, lanes
      s%root(k) = history(k, history_root)
      overlap = history(k, history_side)*history(k, history_side)
      length = b%ha(k) + b%hb(k) - overlap
      factor = (b%ha(k) - c%share*overlap)/length
      s%lx(k) = factor*(b%rx(k) - h*(b%b%vx(k) - b%a%vx(k)))
      s%ly(k) = factor*(b%ry(k) - h*(b%b%vy(k) - b%a%vy(k)))
      s%lz(k) = factor*(b%rz(k) - h*(b%b%vz(k) - b%a%vz(k)))
    end do
  end subroutine recall_spheres

  !> Hertz or linear normal force, stiffnesses, contact point.
  pure subroutine normal_forces(b, c, m_star, history, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: m_star(lanes), history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: on, factor, overlap, side, a, last
    integer(i4) :: k

    !$omp simd private(on, factor, overlap, side, a, last)
    do k = 1, lanes
      overlap = max(-b%gap(k), 0.0_wp)
      on = merge(1.0_wp, 0.0_wp, overlap > 0.0_wp)
      side = sqrt(overlap)
      s%on(k) = on
      s%side(k) = side
      s%root(k) = on*s%root(k)
      a = s%root(k)*side
      s%c(k) = c%c*overlap*overlap*side
      s%kn(k) = c%kn_a*a + c%kn*on
      s%kt(k) = c%kt_a*a + c%kt*on
      s%soft(k) = 1.0_wp/max(s%kt(k), tiny_force)
      s%dash(k) = sqrt(m_star(k)*s%kn(k))
      s%elastic(k) = c%normal_share*s%kn(k)*overlap
      last = history(k, history_side)
      s%c_last(k) = c%c*last*last*last*last*last
      s%soft_last(k) = 1.0_wp/max(c%kt_a*history(k, history_root)*last + c%kt, tiny_force)
      factor = c%share*b%gap(k)
      s%px(k) = b%ax(k) + factor*b%nx(k)
      s%py(k) = b%ay(k) + factor*b%ny(k)
      s%pz(k) = b%az(k) + factor*b%nz(k)
    end do
  end subroutine normal_forces

  !> Velocity of B relative to A at the contact point and at the last one.
  pure subroutine relative_motion(b, h, s)
    type(dem_block_type), intent(in) :: b
    real(wp), intent(in) :: h
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: ax, ay, az, bx, by, bz, dx, dy, dz
    integer(i4) :: k

    !$omp simd private(ax, ay, az, bx, by, bz, dx, dy, dz)
    do k = 1, lanes
      dx = b%b%vx(k) - b%a%vx(k)
      dy = b%b%vy(k) - b%a%vy(k)
      dz = b%b%vz(k) - b%a%vz(k)
      ax = s%px(k)
      ay = s%py(k)
      az = s%pz(k)
      bx = ax - b%rx(k)
      by = ay - b%ry(k)
      bz = az - b%rz(k)
      s%sx(k) = dx + b%b%wy(k)*bz - b%b%wz(k)*by - b%a%wy(k)*az + b%a%wz(k)*ay
      s%sy(k) = dy + b%b%wz(k)*bx - b%b%wx(k)*bz - b%a%wz(k)*ax + b%a%wx(k)*az
      s%sz(k) = dz + b%b%wx(k)*by - b%b%wy(k)*bx - b%a%wx(k)*ay + b%a%wy(k)*ax
      ax = s%lx(k)
      ay = s%ly(k)
      az = s%lz(k)
      bx = ax - b%rx(k) + h*dx
      by = ay - b%ry(k) + h*dy
      bz = az - b%rz(k) + h*dz
      s%ox(k) = dx + b%b%wy(k)*bz - b%b%wz(k)*by - b%a%wy(k)*az + b%a%wz(k)*ay
      s%oy(k) = dy + b%b%wz(k)*bx - b%b%wx(k)*bz - b%a%wz(k)*ax + b%a%wx(k)*az
      s%oz(k) = dz + b%b%wx(k)*by - b%b%wy(k)*bx - b%a%wx(k)*ay + b%a%wy(k)*ax
    end do
  end subroutine relative_motion

  !> Normal damping; the contact does not pull. Leaves the tangential part of the velocity in w.
  pure subroutine damp_normal(b, c, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: vn
    integer(i4) :: k

    !$omp simd private(vn)
    do k = 1, lanes
      vn = s%sx(k)*b%nx(k) + s%sy(k)*b%ny(k) + s%sz(k)*b%nz(k)
      s%total(k) = max(s%elastic(k) - c%damping*s%dash(k)*vn, 0.0_wp)
      s%wx(k) = s%sx(k) - vn*b%nx(k)
      s%wy(k) = s%sy(k) - vn*b%ny(k)
      s%wz(k) = s%sz(k) - vn*b%nz(k)
    end do
  end subroutine damp_normal

  !> Stored tangential force: turned with the contact frame (length kept), scaled on unloading,
  !! no-slip increment, Coulomb cap by the elastic normal force.
  pure subroutine tangential_springs(b, c, h, history, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: h, history(lanes, history_size)
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: tx, ty, tz, px, py, pz, factor, spin, length, cap, t2
    integer(i4) :: k

    !$omp simd private(tx, ty, tz, px, py, pz, factor, spin, length, cap, t2)
    do k = 1, lanes
      tx = history(k, 1)
      ty = history(k, 2)
      tz = history(k, 3)
      s%was(k) = tx*tx + ty*ty + tz*tz
      factor = tx*b%nx(k) + ty*b%ny(k) + tz*b%nz(k)
      tx = tx - factor*b%nx(k)
      ty = ty - factor*b%ny(k)
      tz = tz - factor*b%nz(k)
      spin = 0.5_wp*h*((b%a%wx(k) + b%b%wx(k))*b%nx(k) + (b%a%wy(k) + b%b%wy(k))*b%ny(k) &
                       + (b%a%wz(k) + b%b%wz(k))*b%nz(k))
      px = tx + spin*(b%ny(k)*tz - b%nz(k)*ty)
      py = ty + spin*(b%nz(k)*tx - b%nx(k)*tz)
      pz = tz + spin*(b%nx(k)*ty - b%ny(k)*tx)
      t2 = px*px + py*py + pz*pz
      factor = sqrt(s%was(k)/max(t2, tiny_force))*min(1.0_wp, s%kt(k)*s%soft_last(k))
      length = c%spring*s%kt(k)*h
      tx = factor*px - length*s%wx(k)
      ty = factor*py - length*s%wy(k)
      tz = factor*pz - length*s%wz(k)
      cap = c%friction*s%elastic(k)
      t2 = tx*tx + ty*ty + tz*tz
      length = sqrt(t2)
      s%slip(k) = c%spring*cap*max(length - cap, 0.0_wp)*s%soft(k)
      factor = c%spring*s%on(k)*min(1.0_wp, cap/max(length, tiny_force))
      s%tx(k) = factor*tx
      s%ty(k) = factor*ty
      s%tz(k) = factor*tz
      s%t2(k) = factor*factor*t2
    end do
  end subroutine tangential_springs

  !> Tangential damping, shortened so that its sum with the spring stays below the cap; d becomes
  !! the whole damping force.
  pure subroutine damp_tangent(b, c, s)
    type(dem_block_type), intent(in) :: b
    type(contact_constants_type), intent(in) :: c
    type(contact_scratch_type), intent(inout) :: s
    real(wp) :: length, dx, dy, dz, d2, td, cap, factor, normal
    integer(i4) :: k

    !$omp simd private(length, dx, dy, dz, d2, td, cap, factor, normal)
    do k = 1, lanes
      length = -c%tangential_damping*s%dash(k)
      dx = length*s%wx(k)
      dy = length*s%wy(k)
      dz = length*s%wz(k)
      d2 = dx*dx + dy*dy + dz*dz
      td = s%tx(k)*dx + s%ty(k)*dy + s%tz(k)*dz
      cap = c%friction*s%elastic(k)
      factor = (sqrt(max(td*td + d2*(cap*cap - s%t2(k)), 0.0_wp)) - td)/max(d2, tiny_force)
      factor = max(min(factor, 1.0_wp), 0.0_wp)
      normal = s%total(k) - s%elastic(k)
      s%dx(k) = factor*dx + normal*b%nx(k)
      s%dy(k) = factor*dy + normal*b%ny(k)
      s%dz(k) = factor*dz + normal*b%nz(k)
    end do
  end subroutine damp_tangent

  !> Work of the step, see the head of this module.
  pure subroutine sum_work(h, weight, history, s, columns)
    real(wp), intent(in) :: h, weight(lanes), history(lanes, history_size)
    type(contact_scratch_type), intent(in) :: s
    real(wp), intent(out) :: columns(column_count)
    real(wp) :: work_d, work_t, stored, last, damping, friction, relaxation, curvature, half
    integer(i4) :: k

    half = 0.5_wp*h
    damping = 0.0_wp
    friction = 0.0_wp
    relaxation = 0.0_wp
    curvature = 0.0_wp
    !$omp simd private(work_d, work_t, stored, last) &
    !$omp   reduction(+: damping, friction, relaxation, curvature)
    do k = 1, lanes
      work_d = history(k, 4)*s%ox(k) + history(k, 5)*s%oy(k) + history(k, 6)*s%oz(k) &
               + s%dx(k)*s%sx(k) + s%dy(k)*s%sy(k) + s%dz(k)*s%sz(k)
      work_t = history(k, 1)*s%ox(k) + history(k, 2)*s%oy(k) + history(k, 3)*s%oz(k) &
               + s%tx(k)*s%sx(k) + s%ty(k)*s%sy(k) + s%tz(k)*s%sz(k)
      stored = 0.5_wp*s%t2(k)*s%soft(k)
      last = 0.5_wp*s%was(k)*s%soft_last(k)
      damping = damping - half*weight(k)*work_d
      friction = friction + weight(k)*s%slip(k)
      relaxation = relaxation - weight(k)*(half*work_t + stored - last + s%slip(k))
      last = history(k, history_root)
      curvature = curvature + weight(k)*0.5_wp*(s%c(k) + s%c_last(k)) &
                  *(s%on(k)*merge(1.0_wp, 0.0_wp, last > 0.0_wp)*(s%root(k) - last))
    end do
    columns = [damping, friction, relaxation, curvature, 0.0_wp]
  end subroutine sum_work

  pure subroutine keep_history(s, round, history)
    type(contact_scratch_type), intent(in) :: s
    logical, intent(in) :: round
    real(wp), intent(inout) :: history(lanes, history_size)
    integer(i4) :: k

    !$omp simd
    do k = 1, lanes
      history(k, 1) = s%tx(k)
      history(k, 2) = s%ty(k)
      history(k, 3) = s%tz(k)
      history(k, 4) = s%dx(k)
      history(k, 5) = s%dy(k)
      history(k, 6) = s%dz(k)
      history(k, history_side) = s%side(k)
    end do
    if (round) return
    !$omp simd
    do k = 1, lanes
      history(k, history_root) = s%root(k)
      history(k, history_point) = s%on(k)*s%px(k)
      history(k, history_point + 1) = s%on(k)*s%py(k)
      history(k, history_point + 2) = s%on(k)*s%pz(k)
    end do
  end subroutine keep_history

  !> Force on B and its moment about the origin.
  pure subroutine put_forces(b, weight, s)
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(in) :: weight(lanes)
    type(contact_scratch_type), intent(in) :: s
    real(wp) :: fx, fy, fz, px, py, pz
    integer(i4) :: k

    !$omp simd private(fx, fy, fz, px, py, pz)
    do k = 1, lanes
      fx = weight(k)*(s%elastic(k)*b%nx(k) + s%tx(k) + s%dx(k))
      fy = weight(k)*(s%elastic(k)*b%ny(k) + s%ty(k) + s%dy(k))
      fz = weight(k)*(s%elastic(k)*b%nz(k) + s%tz(k) + s%dz(k))
      px = s%px(k) + b%a%x(k, 1)
      py = s%py(k) + b%a%x(k, 2)
      pz = s%pz(k) + b%a%x(k, 3)
      b%load%fx(k) = fx
      b%load%fy(k) = fy
      b%load%fz(k) = fz
      b%load%mx(k) = py*fz - pz*fy
      b%load%my(k) = pz*fx - px*fz
      b%load%mz(k) = px*fy - py*fx
    end do
  end subroutine put_forces
end module dem_contact
