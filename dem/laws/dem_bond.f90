!> Bonds: short beams that glue pairs of grains until they break.
!!
!! A bond of radius r and length L (that between the centres as it was made) has the stiffnesses
!! k_n = E A/L, k_s = k_n/ratio, k_b = E I/L, k_t = k_s J/A. Force and moment on B grow with the
!! relative velocity and spin at the contact point and turn with the contact frame. It breaks when
!!   N/A + |M_b| r/I > tensile strength,  or  |S|/A + |M_t| r/J > shear strength.
!! Kept of a lane: 1 whether it holds, 2 pull N [N], 3-5 shear S on B [N], 6-8 bending moment on B,
!! 9 twisting moment [N m], 10 r, 11 L [m], 12-14 damping force [N], 15-17 damping moment [N m].
!! eq. D.19
module dem_bond
  use talus_kinds, only: wp, i4
  use dem_sizes, only: lanes
  use dem_law_state, only: history_size, column_damping, column_relaxation
  use dem_additional_numbers, only: most_own, work_breakage, work_torn, work_sheared
  use dem_additional_model, only: additional_model_type, additional_given_type, &
    additional_works_type
  use dem_block, only: dem_block_type
  implicit none
  private
  public :: bond, bond_type, bond_of, own_of, set_bond

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: tiny_load = 1.0e-200_wp
  integer(i4), parameter :: reals = 17  !! kept of a contact

  !> Constants of the bonds of a run.
  type :: bond_type
    real(wp) :: young = 0.0_wp             !! of the beam [Pa]
    real(wp) :: stiffness_ratio = 1.0_wp   !! normal / shear stiffness [-]
    real(wp) :: radius = 1.0_wp            !! beam / least semi-axis of the two grains [-]
    real(wp) :: tensile_strength = 0.0_wp  !! [Pa]
    real(wp) :: shear_strength = 0.0_wp    !! [Pa]
    real(wp) :: damping_ratio = 0.0_wp     !! of critical [-]
    real(wp) :: reach = 0.0_wp             !! grains with at most this gap are bonded [m]
  end type bond_type

  !> A bond of a block over a step.
  type :: step_type
    type(bond_type) :: bond
    real(wp) :: h         !! since the last evaluation [s]
    real(wp) :: m_star    !! reduced mass [kg]
    real(wp) :: point(3)  !! contact point from the centre of A [m]
  end type step_type

contains

  !> It acts between all grains of a run; its constants are those of &bond (dem_setup_bonds).
  pure function bond() result(model)
    type(additional_model_type) :: model
    model%name = 'bond'
    model%forces => forces
    model%energy => energy
    model%stiffness => stiffness
    model%reals = reals
    model%holds = .true.
  end function bond

  !> Constants as the model's own, and back.
  pure function own_of(constants) result(own)
    type(bond_type), intent(in) :: constants
    real(wp) :: own(most_own)
    own = 0.0_wp
    own(:7) = [constants%young, constants%stiffness_ratio, constants%radius, &
               constants%tensile_strength, constants%shear_strength, constants%damping_ratio, &
               constants%reach]
  end function own_of

  pure function bond_of(own) result(constants)
    real(wp), intent(in) :: own(most_own)
    type(bond_type) :: constants
    constants = bond_type(own(1), own(2), own(3), own(4), own(5), own(6), own(7))
  end function bond_of

  !> A bond without load.
  pure subroutine set_bond(kept, radius, length)
    real(wp), intent(inout) :: kept(:)        !! of the lane
    real(wp), intent(in) :: radius, length    !! [m]
    kept(1) = 1.0_wp
    kept(10) = radius
    kept(11) = length
  end subroutine set_bond

  !> See forces_routine of dem_additional_model.
  pure subroutine forces(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: kept(:, :)
    type(additional_works_type), intent(inout) :: works
    call work_bonds(b, given, kept, works)
  end subroutine forces

  !> The same with what is kept in a shape that the compiler knows.
  pure subroutine work_bonds(b, given, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(inout) :: kept(lanes, reals)
    type(additional_works_type), intent(inout) :: works
    type(step_type) :: step
    real(wp) :: row(reals), load(6), part(2), work(2)
    integer(i4) :: k, mode

    step%bond = bond_of(given%own)
    step%h = given%h
    work = 0.0_wp
    associate (share => given%law%share, weight => given%weight, of_models => works%models)
      do k = 1, lanes
        if (.not. kept(k, 1) > 0.0_wp) cycle
        row = kept(k, :)
        step%m_star = given%m_star(k)
        step%point = [b%ax(k), b%ay(k), b%az(k)] + share*b%gap(k)*[b%nx(k), b%ny(k), b%nz(k)]
        call one_bond(b, k, step, row, load, part, mode)
        kept(k, :) = row
        if (mode > 0) then
          of_models(work_breakage) = of_models(work_breakage) + weight(k)*part(2)
          of_models(mode) = of_models(mode) + 1.0_wp
        else
          work(2) = work(2) + weight(k)*part(2)
        end if
        work(1) = work(1) + weight(k)*part(1)
        load = weight(k)*load
        load(4:6) = load(4:6) + cross(step%point + b%a%x(k, :), load(1:3))
        b%load%fx(k) = b%load%fx(k) + load(1)
        b%load%fy(k) = b%load%fy(k) + load(2)
        b%load%fz(k) = b%load%fz(k) + load(3)
        b%load%mx(k) = b%load%mx(k) + load(4)
        b%load%my(k) = b%load%my(k) + load(5)
        b%load%mz(k) = b%load%mz(k) + load(6)
      end do
    end associate
    works%columns(column_damping) = works%columns(column_damping) + work(1)
    works%columns(column_relaxation) = works%columns(column_relaxation) + work(2)
  end subroutine work_bonds

  !> One bond over the step; work: damping; relaxation, or lost as it breaks [J]. mode: 0 it holds,
  !! else the work that counts its break.
  pure subroutine one_bond(b, k, step, row, load, work, mode)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    type(step_type), intent(in) :: step
    real(wp), intent(inout) :: row(reals)
    real(wp), intent(out) :: load(6), work(2)  !! on B [N, N m], [J]
    integer(i4), intent(out) :: mode
    real(wp) :: n(3), v(3), spin(3), moved(3), pulled, vn, wn, stiff(4), last(6), dash(6), was, c(4)

    associate (bond => step%bond, h => step%h, m_star => step%m_star, point => step%point)
      n = [b%nx(k), b%ny(k), b%nz(k)]
      spin = [b%b%wx(k) - b%a%wx(k), b%b%wy(k) - b%a%wy(k), b%b%wz(k) - b%a%wz(k)]
      v = velocity(b, k, point)
      moved = displacement(b, k, h, v, point)
      pulled = dot_product(moved, n)
      vn = dot_product(v, n)
      wn = dot_product(spin, n)
      stiff = stiffnesses(bond, row)
      was = stored(bond, row)
      last = elastic(row, n)
      dash = row(12:17)
      call carry(b, k, h, n, row(3:5))
      call carry(b, k, h, n, row(6:8))
      row(2) = row(2) + stiff(1)*pulled
      row(3:5) = row(3:5) - stiff(2)*(moved - pulled*n)
      row(6:8) = row(6:8) - stiff(3)*h*(spin - wn*n)
      row(9) = row(9) - stiff(4)*h*wn
      mode = break_mode(bond, row)
      c = 2.0_wp*bond%damping_ratio*sqrt(m_star*stiff*[1.0_wp, 1.0_wp, row(10)**2, row(10)**2])
      row(12:14) = -c(1)*vn*n - c(2)*(v - vn*n)
      row(15:17) = -c(3)*(spin - wn*n) - c(4)*wn*n
      if (mode > 0) row = 0.0_wp
      load = elastic(row, n)
      work(2) = -0.5_wp*h*dot_product(last + load, [v, spin]) - (stored(bond, row) - was)
      work(1) = -0.5_wp*h*dot_product(dash + row(12:17), [v, spin])
      load = load + row(12:17)
    end associate
  end subroutine one_bond

  !> Which strength is passed: 0, or the work that counts it.
  pure integer(i4) function break_mode(bond, row) result(mode)
    type(bond_type), intent(in) :: bond
    real(wp), intent(in) :: row(reals)
    real(wp) :: area
    area = pi*row(10)**2
    mode = 0
    if (norm2(row(3:5))/area + abs(row(9))*2.0_wp/(area*row(10)) > bond%shear_strength) &
      mode = work_sheared
    if (row(2)/area + norm2(row(6:8))*4.0_wp/(area*row(10)) > bond%tensile_strength) &
      mode = work_torn
  end function break_mode

  !> Elastic force and moment on B [N, N m].
  pure function elastic(row, n) result(load)
    real(wp), intent(in) :: row(reals), n(3)
    real(wp) :: load(6)
    load(1:3) = row(3:5) - row(2)*n
    load(4:6) = row(6:8) + row(9)*n
  end function elastic

  !> Stiffness of pull, shear [N/m], bending and twisting [N m].
  pure function stiffnesses(bond, row) result(stiff)
    type(bond_type), intent(in) :: bond
    real(wp), intent(in) :: row(reals)
    real(wp) :: stiff(4)
    stiff(1) = bond%young*pi*row(10)**2/row(11)
    stiff(2) = stiff(1)/bond%stiffness_ratio
    stiff(3) = 0.25_wp*stiff(1)*row(10)**2
    stiff(4) = 0.5_wp*stiff(2)*row(10)**2
  end function stiffnesses

  !> Energy in a bond [J].
  pure real(wp) function stored(bond, row)
    type(bond_type), intent(in) :: bond
    real(wp), intent(in) :: row(reals)
    stored = 0.0_wp
    if (row(1) > 0.0_wp) stored = 0.5_wp*sum([row(2)**2, sum(row(3:5)**2), sum(row(6:8)**2), &
                                              row(9)**2]/stiffnesses(bond, row))
  end function stored

  !> Energy in the bonds of a block [J].
  pure real(wp) function energy(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:, :)
    type(bond_type) :: constants
    integer(i4) :: k
    constants = bond_of(given%own)
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + given%weight(k)*stored(constants, kept(k, :))
    end do
  end function energy

  !> Of a bond against translation [N/m] and rotation [N m].
  pure function stiffness(given, kept) result(of_contact)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    real(wp) :: of_contact(2), stiff(4)
    real(wp), parameter :: arm = 0.6_wp  !! of shear, in lengths of the bond
    of_contact = 0.0_wp
    if (.not. kept(1) > 0.0_wp) return
    stiff = stiffnesses(bond_of(given%own), kept)
    of_contact = [stiff(1) + stiff(2), stiff(3) + stiff(4) + stiff(2)*(arm*kept(11))**2]
  end function stiffness

  !> Velocity of B relative to A at a point from the centre of A [m/s].
  pure function velocity(b, k, point) result(v)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: point(3)
    real(wp) :: v(3)
    v = [b%b%vx(k) - b%a%vx(k), b%b%vy(k) - b%a%vy(k), b%b%vz(k) - b%a%vz(k)] &
        + cross([b%b%wx(k), b%b%wy(k), b%b%wz(k)], point - [b%rx(k), b%ry(k), b%rz(k)]) &
        - cross([b%a%wx(k), b%a%wy(k), b%a%wz(k)], point)
  end function velocity

  !> Turn what a bond holds across its normal with the mean spin of both bodies, then into the new
  !! plane, length kept. Into the plane alone would turn it within by the square of the tilt.
  pure subroutine carry(b, k, h, n, held)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: h, n(3)
    real(wp), intent(inout) :: held(3)  !! [N] or [N m]
    real(wp) :: angle(3), length
    length = norm2(held)
    angle = 0.5_wp*h*[b%a%wx(k) + b%b%wx(k), b%a%wy(k) + b%b%wy(k), b%a%wz(k) + b%b%wz(k)]
    held = held + cross(angle, held + 0.5_wp*cross(angle, held))
    held = held - dot_product(held, n)*n
    held = held*(length/max(norm2(held), tiny_load))
  end subroutine carry

  !> How far B has moved over A at the point in the step, in the frame of its end [m]. h v alone has
  !! the arms of the end along the chord of the step: a bond that turns as a rigid body by an angle
  !! a a step would then grow by L a^2/2 each, to tears. To third order in a:
  !! (h + h^2 w x)(v - h/2 (w_B x (w_B x b) - w_A x (w_A x a))), w = (w_A + w_B)/2.
  pure function displacement(b, k, h, v, point) result(moved)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: h, v(3)   !! velocity there [m/s]
    real(wp), intent(in) :: point(3)  !! from the centre of A [m]
    real(wp) :: moved(3), of_a(3), of_b(3)
    of_a = [b%a%wx(k), b%a%wy(k), b%a%wz(k)]
    of_b = [b%b%wx(k), b%b%wy(k), b%b%wz(k)]
    moved = point - [b%rx(k), b%ry(k), b%rz(k)]
    moved = cross(of_b, cross(of_b, moved)) - cross(of_a, cross(of_a, point))
    moved = h*(v - 0.5_wp*h*moved)
    moved = moved + 0.5_wp*h*cross(of_a + of_b, moved)
  end function displacement

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross
end module dem_bond
