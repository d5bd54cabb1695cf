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
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_sizes, only: lanes
  use dem_law_state, only: law_numbers_type, history_size, history_side, history_root, &
    column_damping, column_relaxation
  use dem_additional_numbers, only: most_own, work_rolling
  use dem_additional_model, only: additional_model_type, additional_given_type, &
    additional_works_type
  use dem_block, only: dem_block_type
  use dem_contact, only: contact_constants_type, constants_of
  implicit none
  private
  public :: rolling

  real(wp), parameter :: tiny_moment = 1.0e-200_wp
  integer(i4), parameter :: reals = 8  !! kept of a contact

  ! constants of its own: rolling and twisting friction, moment / (R_e force) [-]; stiffness of both
  ! springs / (k_t R_e^2) [-]; fraction of critical damping with m* R_e^2 as inertia [-]
  integer(i4), parameter :: own_friction(2) = [1, 2], own_stiffness(2) = [3, 4], own_damping = 5

  !> A contact, its constants, and the step.
  type :: turn_type
    type(contact_constants_type) :: c
    real(wp) :: friction(2), stiffness(2)  !! rolling, twisting [-]
    real(wp) :: damping                    !! ratio [-]
    real(wp) :: h                          !! since the last evaluation [s]
    real(wp) :: m_star                     !! reduced mass [kg]
    real(wp) :: side, root                 !! square roots of overlap and radius [m^1/2]
  end type turn_type

contains

  pure function rolling() result(model)
    type(additional_model_type) :: model
    model%name = 'rolling'
    model%constants => constants
    model%forces => forces
    model%at_surfaces => forces
    model%energy => energy
    model%stiffness => stiffness
    model%reals = reals
    model%wants_response = .true.
    model%damping = own_damping
  end function rolling

  !> Its keys; without rolling_damping that of the normal contact.
  subroutine constants(deck, k, law, own, acts, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(law_numbers_type), intent(in) :: law
    real(wp), intent(inout) :: own(most_own)
    logical, intent(out) :: acts
    type(error_list_type), intent(inout) :: errors
    call deck%get('contact', k, 'rolling_friction', own(own_friction(1)))
    call deck%get('contact', k, 'twisting_friction', own(own_friction(2)))
    call deck%get('contact', k, 'rolling_stiffness', own(own_stiffness(1)))
    call deck%get('contact', k, 'twisting_stiffness', own(own_stiffness(2)))
    own(own_damping) = law%damping_ratio
    if (deck%given('contact', k, 'rolling_damping')) &
      call deck%get('contact', k, 'rolling_damping', own(own_damping))
    acts = any(own(own_friction) > 0.0_wp)
  end subroutine constants

  !> See forces_routine of dem_additional_model.
  pure subroutine forces(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout), contiguous :: kept(:, :)
    type(additional_works_type), intent(inout) :: works
    call turn_block(b, given, history, kept, works)
  end subroutine forces

  !> The same with what is kept in a shape that the compiler knows.
  pure subroutine turn_block(b, given, history, kept, works)
    type(dem_block_type), intent(inout) :: b
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: history(lanes, history_size)
    real(wp), intent(inout) :: kept(lanes, reals)
    type(additional_works_type), intent(inout) :: works
    type(contact_constants_type) :: c
    type(turn_type) :: turn
    real(wp) :: row(reals), moment(3), part(3), work(3)
    integer(i4) :: k

    c = constants_of(given%law)
    turn%friction = given%own(own_friction)
    turn%stiffness = given%own(own_stiffness)
    turn%damping = given%own(own_damping)
    turn%h = given%h
    work = 0.0_wp
    do k = 1, lanes
      if (.not. (history(k, history_side) > 0.0_wp .or. kept(k, reals) > 0.0_wp)) cycle
      row = kept(k, :)
      turn%c = c
      if (given%responds) &
        turn%c = constants_at(c, given%response(:, k), history(k, history_side))
      turn%m_star = given%m_star(k)
      turn%side = history(k, history_side)
      turn%root = history(k, history_root)
      call one_contact(b, k, turn, row, moment, part)
      kept(k, :) = row
      work = work + given%weight(k)*part
      b%load%mx(k) = b%load%mx(k) + given%weight(k)*moment(1)
      b%load%my(k) = b%load%my(k) + given%weight(k)*moment(2)
      b%load%mz(k) = b%load%mz(k) + given%weight(k)*moment(3)
    end do
    works%columns(column_damping) = works%columns(column_damping) + work(1)
    works%columns(column_relaxation) = works%columns(column_relaxation) + work(2)
    works%models(work_rolling) = works%models(work_rolling) + work(3)
  end subroutine turn_block

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

  !> One lane: its springs and dashpots over the step; work: damping, relaxation, slip [J].
  pure subroutine one_contact(b, k, turn, row, moment, work)
    type(dem_block_type), intent(in) :: b
    integer(i4), intent(in) :: k
    type(turn_type), intent(in) :: turn
    real(wp), intent(inout) :: row(reals)
    real(wp), intent(out) :: moment(3), work(3)
    real(wp) :: n(3), spin(3), across(3), about, radius, spring, cap(2), stiff(2), was, slip(2)
    real(wp) :: old(3), dash(3), last(2)

    associate (c => turn%c, h => turn%h, side => turn%side, root => turn%root)
      n = [b%nx(k), b%ny(k), b%nz(k)]
      spin = [b%b%wx(k) - b%a%wx(k), b%b%wy(k) - b%a%wy(k), b%b%wz(k) - b%a%wz(k)]
      about = dot_product(spin, n)
      across = spin - about*n
      radius = root*root
      spring = 0.0_wp
      if (side > 0.0_wp) spring = (c%kt_a*root*side + c%kt)*radius*radius
      stiff = spring*turn%stiffness
      cap = radius*c%normal_share*(c%kn_a*root*side + c%kn)*side*side*turn%friction
      was = stored(row, turn%stiffness)
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
      stiff = 2.0_wp*turn%damping*radius*sqrt(turn%m_star*stiff)
      row(5:7) = capped(row(1:3), -stiff(1)*across, cap(1))
      across = capped([row(4), 0.0_wp, 0.0_wp], [-stiff(2)*about, 0.0_wp, 0.0_wp], cap(2))
      row(5:7) = row(5:7) + across(1)*n
      row(8) = spring
      moment = row(1:3) + row(4)*n
      work(1) = -0.5_wp*h*dot_product(dash + row(5:7), spin)
      work(2) = -0.5_wp*h*dot_product(old + moment, spin) - (stored(row, turn%stiffness) - was) &
                - sum(slip)
      work(3) = sum(slip)
      moment = moment + row(5:7)
    end associate
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
  pure real(wp) function stored(row, stiffness)
    real(wp), intent(in) :: row(reals), stiffness(2)
    stored = 0.5_wp*(sum(row(1:3)**2)/max(stiffness(1)*row(8), tiny_moment) &
                     + row(4)**2/max(stiffness(2)*row(8), tiny_moment))
  end function stored

  !> Energy in the springs of a block [J].
  pure real(wp) function energy(given, kept)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:, :)
    integer(i4) :: k
    energy = 0.0_wp
    do k = 1, lanes
      energy = energy + given%weight(k)*stored(kept(k, :), given%own(own_stiffness))
    end do
  end function energy

  !> Of the stiffer of both springs.
  pure function stiffness(given, kept) result(of_contact)
    type(additional_given_type), intent(in) :: given
    real(wp), intent(in) :: kept(:)
    real(wp) :: of_contact(2)
    of_contact = [0.0_wp, kept(reals)*maxval(given%own(own_stiffness))]
  end function stiffness
end module dem_rolling
