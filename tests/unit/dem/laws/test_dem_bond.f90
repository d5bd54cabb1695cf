!> Stiffnesses of a bond, each by a small step of its own; bonds that turn as rigid bodies, about
!! axes across, along and oblique to the bond: one at rest stays without load, and what a loaded one
!! holds turns with it.
program test_dem_bond
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use talus_vectors, only: cross
  use dem_additional_model, only: additional_given_type, additional_model_type, &
    additional_works_type
  use dem_block, only: dem_block_type
  use dem_bond, only: bond, bond_type, own_of
  use dem_state, only: lanes, history_size
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), length = 2.0e-3_wp, beam = 0.8e-3_wp
  real(wp), parameter :: step_time = 1.0e-5_wp  !! [s]
  real(wp), parameter :: load = 0.1_wp  !! of each kind, moments over the length [N]
  real(wp), parameter :: axes(3, 4) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
    0.0_wp, 0.0_wp, 1.0_wp, 0.48_wp, 0.64_wp, 0.6_wp], [3, 4])
  integer(i4), parameter :: lane = 3, turns = 2
  character(len=7), parameter :: name(4) = ['x      ', 'y      ', 'z      ', 'oblique']
  integer(i4) :: k

  call check_stiffnesses()
  do k = 1, 4
    call check_turns(trim(name(k)), axes(:, k), 0.0_wp)
    call check_turns(trim(name(k)), axes(:, k), load)
  end do
  call test%finish()

contains

  !> Rotation of a vector about a unit axis (Rodrigues).
  pure function rotated(axis, angle, v) result(w)
    real(wp), intent(in) :: axis(3), angle, v(3)
    real(wp) :: w(3)
    w = cos(angle)*v + sin(angle)*cross(axis, v) + (1.0_wp - cos(angle))*dot_product(axis, v)*axis
  end function rotated

  !> A bond that breaks not, without load, in one lane.
  subroutine begin_bond(young, ratio, model, given, kept)
    real(wp), intent(in) :: young, ratio  !! [Pa], [-]
    type(additional_model_type), intent(out) :: model
    type(additional_given_type), intent(out) :: given
    real(wp), allocatable, intent(out) :: kept(:, :)
    type(bond_type) :: constants
    model = bond()
    constants%young = young
    constants%stiffness_ratio = ratio
    constants%tensile_strength = huge(1.0_wp)
    constants%shear_strength = huge(1.0_wp)
    given%own = own_of(constants)
    given%h = step_time
    given%m_star = 1.0_wp
    given%weight = 1.0_wp
    allocate (kept(lanes, model%reals), source=0.0_wp)
    kept(lane, [1, 10, 11]) = [1.0_wp, beam, length]
  end subroutine begin_bond

  !> A pull, a shift, a bend and a twist of one step: E A/l, the same over the ratio, E I/l, G J/l.
  subroutine check_stiffnesses()
    real(wp), parameter :: step = 1.0e-9_wp, young = 1.0e7_wp, ratio = 2.5_wp
    real(wp), parameter :: area = pi*beam**2, angle = 1.0e-6_wp
    real(wp), parameter :: limit = angle*young*area/length*step  ! second order in the angle [N]
    type(dem_block_type) :: b
    type(additional_model_type) :: model
    type(additional_given_type) :: given
    type(additional_works_type) :: works
    real(wp), allocatable :: kept(:, :)
    real(wp) :: history(lanes, history_size)
    real(wp), dimension(3) :: along, across

    call begin_bond(young, ratio, model, given, kept)
    along = [0.0_wp, 0.0_wp, length]
    across = [step, 0.0_wp, 0.0_wp]
    call place(b, along, (across + [0.0_wp, 0.0_wp, 3.0_wp*step])/step_time, [0.0_wp, 0.0_wp, &
                                                                             0.0_wp])
    ! half a turn on each side leaves the contact point where it is
    b%a%wy(lane) = -0.5_wp*angle/step_time
    b%b%wy(lane) = 0.5_wp*angle/step_time
    b%a%wz(lane) = -angle/step_time
    b%b%wz(lane) = angle/step_time
    history = 0.0_wp
    works%columns = 0.0_wp
    works%models = 0.0_wp
    call model%forces(b, given, history, kept, works)
    call test%check_close('pull of a bond', kept(lane, 2), young*area/length*3.0_wp*step, limit)
    call test%check_all_close('shear of a bond', kept(lane, 3:5), &
                              -young*area/(ratio*length)*across, limit)
    call test%check_all_close('bending of a bond', kept(lane, 6:8), &
      -young*0.25_wp*area*beam**2/length*[0.0_wp, angle, 0.0_wp], 1.0e-14_wp)
    call test%check_close('twisting of a bond', kept(lane, 9), &
      -young/ratio*0.5_wp*area*beam**2/length*2.0_wp*angle, 1.0e-14_wp)
  end subroutine check_stiffnesses

  !> What changes in two turns decreases with the square of the step: 400 and 800 steps a turn.
  subroutine check_turns(which, axis, held)
    character(len=*), intent(in) :: which
    real(wp), intent(in) :: axis(3), held
    character(len=:), allocatable :: text
    real(wp) :: coarse(4), fine(4), chord
    text = 'about '//which//merge(', loaded', ', free  ', held > 0.0_wp)
    call turn(axis, held, 400, coarse)
    call turn(axis, held, 800, fine)
    ! the partner moves along chords, the spins along arcs: a^3/6 a step [of the length]
    chord = (2.0_wp*pi/800.0_wp)**2*2.0_wp*pi*turns/6.0_wp
    call test%check_all_close(text//': pull, shear / (k_n x length)', fine(1:2), 0.0_wp, &
                              1.1_wp*chord)
    ! the frame turns by the tangent of the angle: a^3/3 a step [of the load]
    call test%check_all_close(text//': bending and twisting', fine(3:4), 0.0_wp, &
                              2.2_wp*chord*held)
    call test%check(text//': of second order', max_abs(fine) <= 0.3_wp*max_abs(coarse) + 1.0e-12_wp)
  end subroutine check_turns

  !> Turn a bond along z at first; off: of pull and shear over k_n L, of bending and twisting [N m]
  !! over L, from loads that turn with the pair.
  subroutine turn(axis, held, steps, off)
    real(wp), intent(in) :: axis(3), held
    integer(i4), intent(in) :: steps
    real(wp), intent(out) :: off(4)
    type(dem_block_type) :: b
    type(additional_model_type) :: model
    type(additional_given_type) :: given
    type(additional_works_type) :: works
    real(wp), allocatable :: kept(:, :)
    real(wp) :: history(lanes, history_size), h, angle, stiffness
    real(wp) :: r(3), last(3), n(3), across(3)
    integer(i4) :: i

    h = step_time
    stiffness = 1.0e7_wp*pi*beam**2/length
    call begin_bond(1.0e7_wp, 2.0_wp, model, given, kept)
    kept(lane, [1, 2, 9, 10, 11]) = [1.0_wp, held, held*length, beam, length]
    kept(lane, 3:8) = held*[1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, length, 0.0_wp]
    history = 0.0_wp
    works%columns = 0.0_wp
    works%models = 0.0_wp
    last = [0.0_wp, 0.0_wp, length]
    do i = 1, turns*steps
      angle = 2.0_wp*pi*i/steps
      r = rotated(axis, angle, [0.0_wp, 0.0_wp, length])
      call place(b, r, (r - last)/h, 2.0_wp*pi/(steps*h)*axis)
      call model%forces(b, given, history, kept, works)
      last = r
    end do
    n = r/length
    across = rotated(axis, angle, [1.0_wp, 0.0_wp, 0.0_wp])
    off(1) = abs(kept(lane, 2) - held)/(stiffness*length)
    off(2) = norm2(kept(lane, 3:5) - held*across)/(stiffness*length)
    off(3) = norm2(kept(lane, 6:8)/length - held*cross(n, across))
    off(4) = abs(kept(lane, 9)/length - held)
  end subroutine turn

  !> Two equal spheres that just touch: B at r from A, its velocity, one spin of both.
  subroutine place(b, r, v, spin)
    type(dem_block_type), intent(inout) :: b
    real(wp), intent(in) :: r(3), v(3), spin(3)
    b%rx(lane) = r(1)
    b%ry(lane) = r(2)
    b%rz(lane) = r(3)
    b%nx(lane) = r(1)/length
    b%ny(lane) = r(2)/length
    b%nz(lane) = r(3)/length
    b%ax(lane) = 0.5_wp*r(1)
    b%ay(lane) = 0.5_wp*r(2)
    b%az(lane) = 0.5_wp*r(3)
    b%gap(lane) = 0.0_wp
    b%a%x = 0.0_wp
    b%a%vx(lane) = 0.0_wp
    b%a%vy(lane) = 0.0_wp
    b%a%vz(lane) = 0.0_wp
    b%b%vx(lane) = v(1)
    b%b%vy(lane) = v(2)
    b%b%vz(lane) = v(3)
    b%a%wx(lane) = spin(1)
    b%a%wy(lane) = spin(2)
    b%a%wz(lane) = spin(3)
    b%b%wx(lane) = spin(1)
    b%b%wy(lane) = spin(2)
    b%b%wz(lane) = spin(3)
    b%load%fx = 0.0_wp
    b%load%fy = 0.0_wp
    b%load%fz = 0.0_wp
    b%load%mx = 0.0_wp
    b%load%my = 0.0_wp
    b%load%mz = 0.0_wp
  end subroutine place
end program test_dem_bond
