!> Rolling and twisting resistance: elastic-plastic springs on the relative spin of two bodies.
!!
!! The moment M on B grows by -k h (w_B - w_A), turned with the contact frame, scaled down with its
!! stiffness and capped: rolling part |M| <= mu_r R_e F_n, twisting part |M_n| <= mu_t R_e F_n, with
!! k = ratio k_t R_e^2 and the elastic normal force. Relative spins are the same for every observer.
!! Kept of a lane: 1-3 rolling moment, 4 twisting moment, 5-7 damping moment [N m],
!! 8 k_t R_e^2 [N m].
!! eq. D.17
module dem_rolling
  use talus_kinds, only: wp, i4
  use dem_state, only: lanes, history_size, history_side, history_root
  use dem_additional_state, only: additional_law_type, rolling_reals
  use dem_block, only: dem_block_type
  use dem_contact, only: contact_constants_type
  implicit none
  private
  public :: rolling_block, rolling_energy

  real(wp), parameter :: tiny_moment = 1.0e-200_wp

contains

  !> Add the moments of all lanes; work: damping, relaxation, rolling and twisting [J].
  pure subroutine rolling_block(b, c, law, h, m_star, weight, history, kept, work, response)
    type(dem_block_type), intent(inout) :: b
    type(contact_constants_type), intent(in) :: c
    type(additional_law_type), intent(in) :: law
    real(wp), intent(in) :: h                             !! time since the last evaluation [s]
    real(wp), intent(in) :: m_star(lanes), weight(lanes)
    real(wp), intent(in) :: history(lanes, history_size)  !! already brought forward
    real(wp), intent(inout) :: kept(lanes, rolling_reals)
    real(wp), intent(out) :: work(3)
    real(wp), intent(in), optional :: response(3, lanes)  !! of laws that have one, dem_law_state
    type(contact_constants_type) :: mine
    real(wp) :: row(rolling_reals), moment(3), part(3)
    integer(i4) :: k

    work = 0.0_wp
    do k = 1, lanes
      if (.not. (history(k, history_side) > 0.0_wp .or. kept(k, rolling_reals) > 0.0_wp)) cycle
      row = kept(k, :)
      mine = c
      if (present(response)) mine = constants_at(c, response(:, k), history(k, history_side))
      call one_contact(b, k, mine, law, h, m_star(k), history(k, history_side), &
                       history(k, history_root), row, moment, part)
      kept(k, :) = row
      work = work + weight(k)*part
      b%load%mx(k) = b%load%mx(k) + weight(k)*moment(1)
      b%load%my(k) = b%load%my(k) + weight(k)*moment(2)
      b%load%mz(k) = b%load%mz(k) + weight(k)*moment(3)
    end do
  end subroutine rolling_block

  !> Constants that give a contact its stiffness and force at this overlap.
  pure function constants_at(c, response, side) result(mine)
    type(contact_constants_type), intent(in) :: c
    real(wp), intent(in) :: response(3), side  !! see dem_law_state, square root of the overlap
    type(contact_constants_type) :: mine
    mine = c
    mine%kn_a = 0.0_wp
    mine%kt_a = 0.0_wp
    mine%kt = response(2)
    mine%normal_share = 1.0_wp
    mine%kn = response(3)/max(side*side, tiny_moment)
  end function constants_at

  !> One lane: its springs and dashpots over the step.
  pure subroutine one_contact(b, k, c, law, h, m_star, side, root, row, moment, work)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    type(contact_constants_type), intent(in) :: c
    type(additional_law_type), intent(in) :: law
    real(wp), intent(in) :: h, m_star
    real(wp), intent(in) :: side, root        !! square roots of overlap and radius [m^1/2]
    real(wp), intent(inout) :: row(rolling_reals)
    real(wp), intent(out) :: moment(3), work(3)
    real(wp) :: n(3), spin(3), across(3), about, radius, spring, cap(2), stiff(2), was, slip(2)
    real(wp) :: old(3), dash(3), last(2)

    n = [b%nx(k), b%ny(k), b%nz(k)]
    spin = [b%b%wx(k) - b%a%wx(k), b%b%wy(k) - b%a%wy(k), b%b%wz(k) - b%a%wz(k)]
    about = dot_product(spin, n)
    across = spin - about*n
    radius = root*root
    spring = 0.0_wp
    if (side > 0.0_wp) spring = (c%kt_a*root*side + c%kt)*radius*radius
    stiff = spring*[law%rolling_stiffness, law%twisting_stiffness]
    cap = radius*c%normal_share*(c%kn_a*root*side + c%kn)*side*side*[law%rolling, law%twisting]
    was = stored(row, law)
    old = row(1:3) + row(4)*n
    dash = row(5:7)
    call turn_moment(b, k, h, n, row(1:3))
    row(:4) = row(:4)*min(1.0_wp, spring/max(row(8), tiny_moment))
    row(1:3) = row(1:3) - stiff(1)*h*across
    row(4) = row(4) - stiff(2)*h*about
    last = [norm2(row(1:3)), abs(row(4))]
    slip = cap*max(last - cap, 0.0_wp)/max(stiff, tiny_moment)
    row(1:3) = row(1:3)*min(1.0_wp, cap(1)/max(last(1), tiny_moment))
    row(4) = row(4)*min(1.0_wp, cap(2)/max(last(2), tiny_moment))
    stiff = 2.0_wp*law%rolling_damping*radius*sqrt(m_star*stiff)
    row(5:7) = capped(row(1:3), -stiff(1)*across, cap(1))
    across = capped([row(4), 0.0_wp, 0.0_wp], [-stiff(2)*about, 0.0_wp, 0.0_wp], cap(2))
    row(5:7) = row(5:7) + across(1)*n
    row(8) = spring
    moment = row(1:3) + row(4)*n
    work(1) = -0.5_wp*h*dot_product(dash + row(5:7), spin)
    work(2) = -0.5_wp*h*dot_product(old + moment, spin) - (stored(row, law) - was) - sum(slip)
    work(3) = sum(slip)
    moment = moment + row(5:7)
  end subroutine one_contact

  !> Turn a moment with the contact frame: into the new tangent plane, length kept, and by the mean
  !! spin about the normal.
  pure subroutine turn_moment(b, k, h, n, moment)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: h, n(3)
    real(wp), intent(inout) :: moment(3)
    real(wp) :: length, angle
    length = norm2(moment)
    moment = moment - dot_product(moment, n)*n
    angle = 0.5_wp*h*((b%a%wx(k) + b%b%wx(k))*n(1) + (b%a%wy(k) + b%b%wy(k))*n(2) &
                      + (b%a%wz(k) + b%b%wz(k))*n(3))
    moment = moment + angle*[n(2)*moment(3) - n(3)*moment(2), n(3)*moment(1) - n(1)*moment(3), &
                             n(1)*moment(2) - n(2)*moment(1)]
    moment = moment*(length/max(norm2(moment), tiny_moment))
  end subroutine turn_moment

  !> The damping moment, shortened so that its sum with the spring's stays below the cap.
  pure function capped(spring, damping, cap) result(kept)
    real(wp), intent(in) :: spring(3), damping(3), cap
    real(wp) :: kept(3), product, square, factor
    product = dot_product(spring, damping)
    square = sum(damping**2)
    factor = (sqrt(max(product**2 + square*(cap**2 - sum(spring**2)), 0.0_wp)) - product) &
             /max(square, tiny_moment)
    kept = max(min(factor, 1.0_wp), 0.0_wp)*damping
  end function capped

  !> Energy in the two springs of a contact [J].
  pure real(wp) function stored(row, law)
    real(wp), intent(in) :: row(rolling_reals)
    type(additional_law_type), intent(in) :: law
    stored = 0.5_wp*(sum(row(1:3)**2)/max(law%rolling_stiffness*row(8), tiny_moment) &
                     + row(4)**2/max(law%twisting_stiffness*row(8), tiny_moment))
  end function stored

  !> Energy in the springs of a block [J].
  pure real(wp) function rolling_energy(law, weight, kept) result(energy)
    type(additional_law_type), intent(in) :: law
    real(wp), intent(in) :: weight(lanes), kept(lanes, rolling_reals)
    integer(i4) :: k
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + weight(k)*stored(kept(k, :), law)
    end do
  end function rolling_energy
end module dem_rolling
