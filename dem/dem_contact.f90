!> Contact forces of one block: normal, tangential with history, damping, and their work.
!!
!! History of a lane (all zero without contact): 1-3 tangential elastic force on B, 4-6 tangential
!! damping force on B [N], 7-9 contact point from the centre of A [m], 10 normal damping force [N],
!! 11 contact radius a [m], 12 overlap [m], 13 sqrt(R_e) [m^1/2], 14 c = 8/15 E* overlap^(5/2).
!! Work columns: contact damping, friction, tangential relaxation, curvature work [J].
!! The work of a step is half that of the last forces at the last contact point and half that of
!! the new ones, both with the velocity of the step: this is what the leapfrog puts into the
!! kinetic energy, so that the ledger closes to the error of the stored energies alone.
module dem_contact
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes, history_size, column_count, dem_law_type, law_linear, &
    law_hertz_no_history
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: contact_block, contact_constants_type, constants_of, stored_energy

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
    real(wp) :: friction, damping, tangential_damping, share
  end type contact_constants_type

contains

  pure function constants_of(law) result(c)
    type(dem_law_type), intent(in) :: law
    type(contact_constants_type) :: c
    c%kn_a = 0.0_wp
    c%kt_a = 0.0_wp
    c%kn = 0.0_wp
    c%kt = 0.0_wp
    c%c = 0.0_wp
    c%spring = 1.0_wp
    if (law%kind == law_hertz_no_history) c%spring = 0.0_wp
    if (law%kind == law_linear) then
      c%kn = law%kn
      c%kt = law%kt
      c%normal_share = 1.0_wp
    else
      c%kn_a = 2.0_wp*law%e_star
      c%kt_a = 8.0_wp*law%g_star
      c%normal_share = 2.0_wp/3.0_wp
      c%c = 8.0_wp/15.0_wp*law%e_star
    end if
    c%friction = law%friction
    c%damping = 2.0_wp*law%damping_ratio
    c%tangential_damping = 2.0_wp*law%tangential_ratio
    c%share = law%share
  end function constants_of

  !> Stored normal and tangential energy of a block from its history [J].
  pure function stored_energy(c, weight, history) result(energy)
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: weight(lanes), history(lanes, history_size)
    real(wp) :: energy(2), kt, normal, tangential
    integer(i4) :: k
    normal = 0.0_wp
    tangential = 0.0_wp
    !$omp simd private(kt) reduction(+: normal, tangential)
    do k = 1, lanes
      kt = max(c%kt_a*history(k, 11) + c%kt, tiny_force)
      normal = normal + weight(k)*(history(k, 14)*history(k, 13) + 0.5_wp*c%kn*history(k, 12)**2)
      tangential = tangential + weight(k)*0.5_wp/kt &
                   *(history(k, 1)**2 + history(k, 2)**2 + history(k, 3)**2)
    end do
    energy = [normal, tangential]
  end function stored_energy

  !> Forces and moments of all lanes into block%f, history brought forward by h.
  pure subroutine contact_block(b, c, h, m_star, weight, history, columns)
    type(dem_block_type), intent(inout) :: b
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: h                            !! time since the last evaluation [s]
    real(wp), intent(in) :: m_star(lanes)                !! reduced masses [kg]
    real(wp), intent(in) :: weight(lanes)                !! contact weights [-]
    real(wp), intent(inout) :: history(lanes, history_size)
    real(wp), intent(out) :: columns(column_count)
    integer(i4) :: k
    real(wp) :: nx, ny, nz, on, overlap, root, a, kn, kt, elastic, damping, total, cap
    real(wp) :: ax, ay, az, bx, by, bz, sx, sy, sz, vn, ox, oy, oz, wx, wy, wz, spin
    real(wp) :: px, py, pz, tx, ty, tz, dx, dy, dz, t2, d2, td, factor, was, half, last
    real(wp) :: slip, work_t, work_d, energy, energy_last, length, fx, fy, fz
    real(wp) :: sum_damping, sum_friction, sum_relaxation, sum_curvature

    half = 0.5_wp*h
    sum_damping = 0.0_wp
    sum_friction = 0.0_wp
    sum_relaxation = 0.0_wp
    sum_curvature = 0.0_wp
    !$omp simd private(nx, ny, nz, on, overlap, root, a, kn, kt, elastic, damping, total, cap, &
    !$omp   ax, ay, az, bx, by, bz, sx, sy, sz, vn, ox, oy, oz, wx, wy, wz, spin, px, py, pz, &
    !$omp   tx, ty, tz, dx, dy, dz, t2, d2, td, factor, was, last, slip, work_t, work_d, energy, &
    !$omp   energy_last, length, fx, fy, fz) &
    !$omp   reduction(+: sum_damping, sum_friction, sum_relaxation, sum_curvature)
    do k = 1, lanes
      nx = b%nx(k)
      ny = b%ny(k)
      nz = b%nz(k)
      ! normal force
      overlap = max(-b%gap(k), 0.0_wp)
      on = merge(1.0_wp, 0.0_wp, overlap > 0.0_wp)
      root = on/sqrt(b%curvature(k))
      a = root*sqrt(overlap)
      kn = c%kn_a*a + c%kn*on
      kt = c%kt_a*a + c%kt*on
      elastic = c%normal_share*kn*overlap
      ! contact point and relative velocity there
      factor = c%share*b%gap(k)
      ax = b%ax(k) + factor*nx
      ay = b%ay(k) + factor*ny
      az = b%az(k) + factor*nz
      bx = ax - b%rx(k)
      by = ay - b%ry(k)
      bz = az - b%rz(k)
      dx = b%vbx(k) - b%vax(k)
      dy = b%vby(k) - b%vay(k)
      dz = b%vbz(k) - b%vaz(k)
      sx = dx + b%wby(k)*bz - b%wbz(k)*by - b%way(k)*az + b%waz(k)*ay
      sy = dy + b%wbz(k)*bx - b%wbx(k)*bz - b%waz(k)*ax + b%wax(k)*az
      sz = dz + b%wbx(k)*by - b%wby(k)*bx - b%wax(k)*ay + b%way(k)*ax
      vn = sx*nx + sy*ny + sz*nz
      ! relative velocity at the last contact point
      px = history(k, 7)
      py = history(k, 8)
      pz = history(k, 9)
      bx = px - b%rx(k) + h*dx
      by = py - b%ry(k) + h*dy
      bz = pz - b%rz(k) + h*dz
      ox = dx + b%wby(k)*bz - b%wbz(k)*by - b%way(k)*pz + b%waz(k)*py
      oy = dy + b%wbz(k)*bx - b%wbx(k)*bz - b%waz(k)*px + b%wax(k)*pz
      oz = dz + b%wbx(k)*by - b%wby(k)*bx - b%wax(k)*py + b%way(k)*px
      work_d = history(k, 10)*(b%ox(k)*ox + b%oy(k)*oy + b%oz(k)*oz) + history(k, 4)*ox &
               + history(k, 5)*oy + history(k, 6)*oz
      work_t = history(k, 1)*ox + history(k, 2)*oy + history(k, 3)*oz
      ! normal damping; the contact does not pull
      total = max(elastic - c%damping*sqrt(m_star(k)*kn)*vn, 0.0_wp)
      damping = total - elastic
      ! stored tangential force: turned with the frame (length kept), then scaled on unloading
      tx = history(k, 1)
      ty = history(k, 2)
      tz = history(k, 3)
      last = history(k, 11)
      was = tx*tx + ty*ty + tz*tz
      factor = tx*nx + ty*ny + tz*nz
      tx = tx - factor*nx
      ty = ty - factor*ny
      tz = tz - factor*nz
      spin = half*((b%wax(k) + b%wbx(k))*nx + (b%way(k) + b%wby(k))*ny &
                   + (b%waz(k) + b%wbz(k))*nz)
      px = tx + spin*(ny*tz - nz*ty)
      py = ty + spin*(nz*tx - nx*tz)
      pz = tz + spin*(nx*ty - ny*tx)
      t2 = px*px + py*py + pz*pz
      factor = sqrt(was/max(t2, tiny_force)) &
               *min(1.0_wp, kt/max(c%kt_a*last + c%kt, tiny_force))
      ! no-slip increment and Coulomb cap
      wx = sx - vn*nx
      wy = sy - vn*ny
      wz = sz - vn*nz
      length = c%spring*kt*h
      tx = factor*px - length*wx
      ty = factor*py - length*wy
      tz = factor*pz - length*wz
      cap = c%friction*elastic
      t2 = tx*tx + ty*ty + tz*tz
      length = sqrt(t2)
      slip = max(length - cap, 0.0_wp)
      factor = c%spring*on*min(1.0_wp, cap/max(length, tiny_force))
      tx = factor*tx
      ty = factor*ty
      tz = factor*tz
      t2 = factor*factor*t2
      slip = c%spring*cap*slip/max(kt, tiny_force)
      ! tangential damping, shortened so that the sum stays below the cap
      length = -c%tangential_damping*sqrt(m_star(k)*kt)
      dx = length*wx
      dy = length*wy
      dz = length*wz
      d2 = dx*dx + dy*dy + dz*dz
      td = tx*dx + ty*dy + tz*dz
      factor = (sqrt(max(td*td + d2*(cap*cap - t2), 0.0_wp)) - td)/max(d2, tiny_force)
      factor = max(min(factor, 1.0_wp), 0.0_wp)
      dx = factor*dx
      dy = factor*dy
      dz = factor*dz
      ! work of the step
      work_d = work_d + damping*vn + dx*sx + dy*sy + dz*sz
      work_t = work_t + tx*sx + ty*sy + tz*sz
      energy = 0.5_wp*t2/max(kt, tiny_force)
      energy_last = 0.5_wp*was/max(c%kt_a*last + c%kt, tiny_force)
      sum_damping = sum_damping - half*weight(k)*work_d
      sum_friction = sum_friction + weight(k)*slip
      sum_relaxation = sum_relaxation - weight(k)*(half*work_t + energy - energy_last + slip)
      factor = c%c*overlap*overlap*sqrt(overlap)
      length = history(k, 13)
      sum_curvature = sum_curvature + weight(k)*0.5_wp*(factor + history(k, 14)) &
                      *(on*merge(1.0_wp, 0.0_wp, length > 0.0_wp)*(root - length))
      ! force on B and moments
      fx = weight(k)*(total*nx + tx + dx)
      fy = weight(k)*(total*ny + ty + dy)
      fz = weight(k)*(total*nz + tz + dz)
      bx = ax - b%rx(k)
      by = ay - b%ry(k)
      bz = az - b%rz(k)
      b%f(k, 1) = fx
      b%f(k, 2) = fy
      b%f(k, 3) = fz
      b%f(k, 4) = az*fy - ay*fz
      b%f(k, 5) = ax*fz - az*fx
      b%f(k, 6) = ay*fx - ax*fy
      b%f(k, 7) = by*fz - bz*fy
      b%f(k, 8) = bz*fx - bx*fz
      b%f(k, 9) = bx*fy - by*fx
      history(k, 1) = tx
      history(k, 2) = ty
      history(k, 3) = tz
      history(k, 4) = dx
      history(k, 5) = dy
      history(k, 6) = dz
      history(k, 7) = on*ax
      history(k, 8) = on*ay
      history(k, 9) = on*az
      history(k, 10) = damping
      history(k, 11) = a
      history(k, 12) = overlap
      history(k, 13) = root
      history(k, 14) = factor
    end do
    columns = [sum_damping, sum_friction, sum_relaxation, sum_curvature]
  end subroutine contact_block
end module dem_contact
