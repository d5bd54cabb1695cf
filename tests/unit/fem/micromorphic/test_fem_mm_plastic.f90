!> Plastic micromorphic point: published values of the yield functions, multipliers and yields that
!! satisfy Kuhn and Tucker, tangents by differences, rotations, order in the step, dissipation.
program test_fem_mm_plastic
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_mm_cones, only: mm_surface_type, mm_cone_type, mm_place_type, make_cone, surfaces
  use fem_mm_elastic, only: set_moduli
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, packed_motion, unpacked_motion, packed_force
  use fem_mm_motion, only: elastic_tangent
  use fem_mm_plastic, only: mm_point_type, update_point, failure_text
  use fem_mm_surfaces, only: surface_at
  use fem_mm_tensor, only: determinant, identity, inverse, leg_one
  implicit none
  type(test_type) :: test
  real(wp), parameter :: o_s(9) = [ &
    0.77189588_wp, -0.84417528_wp, 0.95929231_wp, -0.50465708_wp, 0.50576944_wp, &
    0.05335127_wp, 0.81510751_wp, 0.76814059_wp, -0.82146208_wp]
  real(wp), parameter :: o_c(9) = [ &
    0.03468919_wp, -0.31275742_wp, -0.57541261_wp, -0.27865312_wp, -0.45844965_wp, &
    0.52325004_wp, -0.0439162_wp, -0.80201065_wp, -0.44921044_wp]
  real(wp), parameter :: o_m(27) = [ &
    0.80732114_wp, 0.79202055_wp, 0.17990022_wp, 0.97454675_wp, 0.703207_wp, -0.58236697_wp, &
    0.53324571_wp, -0.93438873_wp, -0.40650796_wp, 0.14071918_wp, 0.66933708_wp, &
    -0.67854069_wp, -0.30317772_wp, -0.93821882_wp, 0.97270622_wp, 0.00295302_wp, &
    -0.12441126_wp, 0.30539971_wp, -0.0580227_wp, 0.89696105_wp, 0.17567709_wp, &
    -0.9592962_wp, 0.63535407_wp, 0.95437804_wp, -0.64531877_wp, 0.69978907_wp, 0.81327586_wp]
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: moduli(18) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, &
    5.0_wp, 0.3_wp, 0.1_wp, 0.2_wp, 0.4_wp, -0.1_wp, 0.5_wp, 8.0_wp, 0.2_wp, 0.6_wp, 0.3_wp, 0.1_wp]
  logical, parameter :: yes = .true., no = .false.
  real(wp) :: way(45)
  integer(i4) :: n

  way = [(0.03_wp*sin(1.0_wp + 1.7_wp*n), n=1, 45)]
  way([1, 5, 9]) = way([1, 5, 9]) - sum(way([1, 5, 9]))/3.0_wp - 0.001_wp  ! slightly compressed
  way([10, 14, 18]) = way([10, 14, 18]) - sum(way([10, 14, 18]))/3.0_wp
  way(19:) = 3.0_wp*way(19:)
  call check_published()
  call check_mohr_coulomb()
  call check_step('macro', solid([yes, no, no], no, no), [yes, no, no, no, no])
  call check_step('micro', solid([no, yes, no], no, no), [no, yes, no, no, no])
  call check_step('gradient', solid([no, no, yes], no, no), [no, no, yes, yes, yes])
  call check_step('all', solid([yes, yes, yes], no, no), [yes, yes, yes, yes, yes])
  call check_step('reduced, all', solid([yes, yes, yes], yes, no), [yes, yes, yes, yes, yes])
  call check_tangent('trapezoidal', solid([yes, yes, yes], no, yes), 1)
  call check_tangent('substeps', in_parts(solid([yes, yes, yes], no, no), 5), 5)
  call check_step('volume, macro', volumes(solid([yes, no, no], no, no)), [yes, no, no, no, no])
  call check_step('volume', volumes(solid([yes, yes, yes], no, no)), [yes, yes, yes, yes, yes])
  call check_tangent('volume, substeps', in_parts(volumes(solid([yes, yes, yes], no, no)), 5), 5)
  call check_volume()
  call check_unloading()
  call check_order(solid([yes, no, yes], no, no), 1.0_wp)
  call check_order(solid([no, yes, yes], no, no), 1.0_wp)
  call check_order(solid([yes, no, yes], no, yes), 2.0_wp)
  call check_order(solid([no, yes, yes], no, yes), 2.0_wp)
  call check_path()
  call check_energy()
  call check_failure()
  call check_tension()
  call check_softening()
  call test%finish()

contains

  !> A solid with friction at macro, micro and gradient level as given.
  pure function solid(on, reduced, trapezoidal) result(law)
    logical, intent(in) :: on(3), reduced, trapezoidal
    type(mm_law_type) :: law
    integer(i4) :: k
    law%elastic = set_moduli(moduli, reduced)
    law%trapezoidal = trapezoidal
    law%length = 0.6_wp
    if (on(1)) law%cone(1) = make_cone([30.0_wp, 10.0_wp]*degree, [-1.0_wp, -1.0_wp], 0.08_wp, &
                                       20.0_wp, 0.0_wp)
    if (on(2)) law%cone(2) = make_cone([25.0_wp, 8.0_wp]*degree, [-1.0_wp, 0.3_wp], 0.073_wp, &
                                       20.0_wp, 0.0_wp)
    do k = 3, surfaces
      if (on(3)) law%cone(k) = make_cone([20.0_wp, 5.0_wp]*degree, [0.0_wp, 0.0_wp], 0.1_wp, &
                                       0.3_wp, 0.0_wp)
    end do
    law%plastic = any(on)
  end function solid

  pure function in_parts(one, parts) result(law)
    type(mm_law_type), intent(in) :: one
    integer(i4), intent(in) :: parts
    type(mm_law_type) :: law
    law = one
    law%parts = parts
  end function in_parts

  pure function volumes(one) result(law)
    type(mm_law_type), intent(in) :: one
    type(mm_law_type) :: law
    law = one
    law%exact_volume = .true.
  end function volumes

  !> det Fp = exp(B_psi gamma) of a cone, and of the micro-cone det chi_p too; backward Euler is
  !! wrong by half the square of the step.
  subroutine check_volume()
    type(mm_law_type) :: law
    type(mm_state_type) :: start
    type(mm_point_type) :: point
    real(wp) :: off(2), flow(2), wanted, wanted_f
    law = volumes(solid([yes, yes, yes], no, no))
    call update_point(law, [motion_at(0.0_wp), motion_at(1.0_wp)], start, point)
    wanted = law%cone(2)%b_flow*point%gamma(2)
    wanted_f = wanted + law%cone(1)%b_flow*point%gamma(1)
    call test%check_close('det Fp', log(determinant(point%state%fp)), wanted_f, 1.0e-9_wp)
    call test%check_close('det chi_p', log(determinant(point%state%xp)), wanted, 1.0e-9_wp)
    call drift(1.0_wp, off(1), flow(1))
    call drift(0.5_wp, off(2), flow(2))
    ! figures of the manual: 3 % of shear, as a volume and over that of 10 degrees of dilation
    call test%check_close('backward Euler has another volume', off(1), 1.5e-4_wp, 5.0e-6_wp)
    call test%check_close('its share of the dilation', off(1)/flow(1), 0.03_wp, 5.0e-3_wp)
    call test%check_close('of the order of the square', off(1)/off(2), 4.0_wp, 1.0_wp)
  end subroutine check_volume

  !> ln det Fp of a step of backward Euler less that of the flow, in simple shear whose
  !! elastic part hardly counts, and that of the flow.
  subroutine drift(share, off, flow)
    real(wp), intent(in) :: share
    real(wp), intent(out) :: off, flow
    type(mm_law_type) :: law
    type(mm_state_type) :: start
    type(mm_point_type) :: point
    type(mm_motion_type) :: there
    law = solid([yes, no, no], no, no)
    law%cone(1) = make_cone([30.0_wp, 10.0_wp]*degree, [-1.0_wp, -1.0_wp], 1.0e-3_wp, 0.0_wp, &
                            0.0_wp)
    there%f(1, 2) = 0.03_wp*share
    there%chi = there%f
    call update_point(law, [motion_at(0.0_wp), there], start, point)
    flow = law%cone(1)%b_flow*point%gamma(1)
    off = log(determinant(point%state%fp)) - flow
  end subroutine drift

  !> Values of a published unit test, for second- and third-order stress.
  subroutine check_published()
    type(mm_cone_type) :: cone
    type(mm_surface_type) :: surface
    real(wp) :: c(3, 3), m(3, 3, 3), f
    real(wp), parameter :: cohesion(3) = [0.51_wp, 0.71_wp, 0.14_wp]
    real(wp), parameter :: wanted(3) = [3.90579607126_wp, 0.863009700232_wp, 4.63923709262_wp]
    integer(i4) :: k
    cone = make_cone([0.46_wp, 0.1_wp], [0.34_wp, 0.0_wp], 0.51_wp, 0.0_wp, 0.0_wp)
    c = transpose(reshape(o_c, [3, 3]))
    m = reshape(o_m, [3, 3, 3], order=[3, 2, 1])
    call test%check_close('A', cone%a, 1.39315236742_wp, 1.0e-11_wp)
    call test%check_close('B', cone%b, 0.690235625633_wp, 1.0e-11_wp)
    surface = surface_at(cone, place_at(transpose(reshape(o_s, [3, 3])), c))
    f = surface%norm + cone%b*surface%p - cone%a*cone%cohesion
    call test%check_close('yield of second order', f, 3.23680754328_wp, 1.0e-10_wp)
    do k = 1, 3
      surface = surface_at(cone, place_at(m(:, :, k), c))
      f = surface%norm + cone%b*surface%p - cone%a*cohesion(k)
      call test%check_close('yield of third order', f, wanted(k), 1.0e-10_wp)
    end do
  end subroutine check_published

  pure function place_at(stress, c) result(place)
    real(wp), intent(in) :: stress(3, 3), c(3, 3)
    type(mm_place_type) :: place
    place%stress = stress
    place%c = c
    place%inverse_c = inverse(c)
  end function place_at

  !> With shape -1 the cone meets Mohr-Coulomb in triaxial compression, with +1 in extension.
  subroutine check_mohr_coulomb()
    real(wp), parameter :: angle = 35.0_wp*degree, cohesion = 20.0_wp, lateral = -100.0_wp
    real(wp) :: axial
    axial = (lateral*(1.0_wp + sin(angle)) - 2.0_wp*cohesion*cos(angle))/(1.0_wp - sin(angle))
    call test%check_close('compression', yield_at(-1.0_wp, axial, lateral), 0.0_wp, 1.0e-12_wp)
    axial = (lateral*(1.0_wp - sin(angle)) + 2.0_wp*cohesion*cos(angle))/(1.0_wp + sin(angle))
    call test%check_close('extension', yield_at(1.0_wp, axial, lateral), 0.0_wp, 1.0e-12_wp)
  end subroutine check_mohr_coulomb

  pure real(wp) function yield_at(shape, axial, lateral)
    real(wp), intent(in) :: shape, axial, lateral
    type(mm_cone_type) :: cone
    type(mm_surface_type) :: surface
    real(wp) :: s(3, 3)
    cone = make_cone([35.0_wp, 0.0_wp]*degree, [shape, 0.0_wp], 20.0_wp, 0.0_wp, 0.0_wp)
    s = lateral*identity
    s(3, 3) = axial
    surface = surface_at(cone, place_at(s, identity))
    yield_at = (surface%norm + cone%b*surface%p - cone%a*cone%cohesion)/abs(axial)
  end function yield_at

  !> A share of the way from the undeformed point.
  pure function motion_at(share) result(motion)
    real(wp), intent(in) :: share
    type(mm_motion_type) :: motion
    type(mm_motion_type) :: undeformed
    motion = unpacked_motion(packed_motion(undeformed) + share*way)
  end function motion_at

  !> One step over the whole way.
  subroutine check_step(name, law, wanted)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: wanted(surfaces)
    type(mm_state_type) :: start
    type(mm_point_type) :: point, turned
    type(mm_motion_type) :: there
    real(wp), parameter :: q(3, 3) = reshape([0.36_wp, 0.48_wp, -0.8_wp, -0.8_wp, 0.6_wp, 0.0_wp, &
                                              0.48_wp, 0.64_wp, 0.6_wp], [3, 3])
    call update_point(law, [motion_at(0.0_wp), motion_at(1.0_wp)], start, point)
    call test%check(name//': done in one', point%done .and. point%substeps == 1)
    call test%check(name//': surfaces that yield', all(point%active .eqv. wanted))
    call test%check(name//': multipliers >= 0', all(point%gamma >= 0.0_wp))
    call test%check_all_close(name//': yields <= 0', larger(point%yield, 0.0_wp), 0.0_wp, &
                          1.0e-9_wp)
    call test%check_all_close(name//': gamma f', point%gamma*point%yield, 0.0_wp, &
                          1.0e-9_wp)
    call test%check(name//': dissipation', point%state%dissipated > 0.0_wp)
    there = motion_at(1.0_wp)
    there%f = matmul(q, there%f)
    there%chi = matmul(q, there%chi)
    there%g = leg_one(q, there%g)
    call update_point(law, [motion_at(0.0_wp), there], start, turned)
    call test%check_close(name//': S does not turn', max_abs(turned%stress%s - point%stress%s) &
      /max_abs(point%stress%s), 0.0_wp, 1.0e-12_wp)
    call test%check_all_close(name//': Fp does not turn', &
      turned%state%fp, point%state%fp, 1.0e-12_wp)
    call check_tangent(name, law, 1)
  end subroutine check_step

  !> Tangent of a second step, 0.2 to 1 of the way, against differences (five points, truncation
  !! ~ h^4).
  subroutine check_tangent(name, law, substeps)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    integer(i4), intent(in) :: substeps
    type(mm_state_type) :: start
    type(mm_point_type) :: point, moved
    type(mm_motion_type) :: here, there
    real(wp) :: tangent(45, 45), found(45, 45), x(45), f(45, 4)
    real(wp), parameter :: h = 1.0e-5_wp, move(4) = [-2.0_wp, -1.0_wp, 1.0_wp, 2.0_wp]
    integer(i4) :: i, k
    call update_point(law, [motion_at(0.0_wp), motion_at(0.2_wp)], start, point)
    start = point%state
    here = motion_at(0.2_wp)
    there = motion_at(1.0_wp)
    call update_point(law, [here, there], start, point, tangent)
    call test%check(name//': done', point%done)
    call test%check(name//': substeps', point%substeps == substeps)
    do k = 1, 45
      do i = 1, 4
        x = packed_motion(there)
        x(k) = x(k) + move(i)*h
        call update_point(law, [here, unpacked_motion(x)], start, moved)
        f(:, i) = packed_force(moved%force)
      end do
      found(:, k) = (f(:, 1) - 8.0_wp*f(:, 2) + 8.0_wp*f(:, 3) - f(:, 4))/(12.0_wp*h)
    end do
    call test%check_close(name//': tangent against differences', &
      max_abs(found - tangent)/max_abs(tangent), 0.0_wp, 1.0e-7_wp)
  end subroutine check_tangent

  !> After a plastic step a small step back is elastic, and its tangent symmetric.
  subroutine check_unloading()
    type(mm_law_type) :: law
    type(mm_point_type) :: point, back
    type(mm_state_type) :: start
    real(wp) :: tangent(45, 45)
    law = solid([yes, yes, yes], no, no)
    call update_point(law, [motion_at(0.0_wp), motion_at(1.0_wp)], start, point)
    call update_point(law, [motion_at(1.0_wp), motion_at(0.99_wp)], point%state, back, tangent)
    call test%check('unloading is elastic', back%done .and. .not. any(back%active))
    call test%check_close('plastic parts stay', max_abs(back%state%gp - point%state%gp) &
      + max_abs(back%state%fp - point%state%fp), 0.0_wp, 0.0_wp)
    call test%check_close('its tangent is symmetric', max_abs(tangent - transpose(tangent)) &
      /max_abs(tangent), 0.0_wp, 1.0e-12_wp)
    call test%check('energy is stored', back%stored > 0.0_wp .and. back%stored < point%stored)
  end subroutine check_unloading

  !> Changes of S when the number of steps doubles, over a way on which the same surfaces yield.
  subroutine check_order(law, order)
    type(mm_law_type), intent(in) :: law
    real(wp), intent(in) :: order
    real(wp) :: s(3, 3, 3)
    s(:, :, 1) = stress_after(law, 16)
    s(:, :, 2) = stress_after(law, 32)
    s(:, :, 3) = stress_after(law, 64)
    call test%check_close('order in the step', log(norm2(s(:, :, 1) - s(:, :, 2)) &
      /norm2(s(:, :, 2) - s(:, :, 3)))/log(2.0_wp), order, 0.15_wp)
  end subroutine check_order

  function stress_after(law, steps) result(s)
    type(mm_law_type), intent(in) :: law
    integer(i4), intent(in) :: steps
    real(wp) :: s(3, 3)
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_law_type) :: first
    integer(i4) :: i
    first = law
    first%trapezoidal = .false.
    call update_point(first, [motion_at(0.0_wp), motion_at(0.6_wp)], state, point)
    do i = 1, steps
      state = point%state
      call update_point(law, [motion_at(0.6_wp + 0.4_wp*(i - 1)/steps), &
                              motion_at(0.6_wp + 0.4_wp*i/steps)], state, point)
    end do
    s = point%stress%s
  end function stress_after

  !> To and fro: yields, multipliers and dissipation at every step.
  subroutine check_path()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: here, there
    real(wp) :: worst, dissipated
    logical :: fine
    integer(i4) :: i
    law = solid([yes, yes, yes], no, yes)
    here = motion_at(0.0_wp)
    worst = 0.0_wp
    fine = .true.
    do i = 1, 200
      there = motion_at(1.5_wp*sin(0.07_wp*i))
      dissipated = state%dissipated
      call update_point(law, [here, there], state, point)
      fine = fine .and. point%done .and. all(point%gamma >= 0.0_wp) &
        .and. point%state%dissipated >= dissipated
      worst = larger(worst, max_abs(larger(point%yield, 0.0_wp)))
      state = point%state
      here = there
    end do
    call test%check('every step ends, multipliers and dissipation rise', fine)
    call test%check_close('and no yield is above zero', worst, 0.0_wp, 1.0e-9_wp)
  end subroutine check_path

  !> Work is stored, dissipated or shifted; what is missing decreases with the step (dissipation is
  !! counted with the stress at the end of a step) and vanishes in the limit.
  subroutine check_energy()
    real(wp) :: missing(2)
    missing = [gap(100), gap(200)]
    call test%check_close('what is missing, order', missing(2)/missing(1), 0.5_wp, 0.02_wp)
    call test%check_close('what is missing, limit', 2.0_wp*missing(2) - missing(1), 0.0_wp, &
                          1.0e-4_wp)
  end subroutine check_energy

  !> Share of the work that is missing after so many steps.
  real(wp) function gap(steps)
    integer(i4), intent(in) :: steps
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    real(wp) :: work, force(45)
    integer(i4) :: i
    law = solid([yes, yes, yes], no, yes)
    work = 0.0_wp
    force = 0.0_wp
    do i = 1, steps
      call update_point(law, [motion_at(1.5_wp*(i - 1)/steps), motion_at(1.5_wp*i/steps)], state, &
                        point)
      work = work + 0.75_wp/steps*sum(way*(force + packed_force(point%force)))
      force = packed_force(point%force)
      state = point%state
    end do
    gap = 1.0_wp - (point%stored + state%dissipated + state%shifted)/work
  end function gap

  !> Tension beyond the apex of a cone has no admissible stress without dilation: a failure that
  !! names its surfaces.
  subroutine check_failure()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: there
    law = solid([yes, no, no], no, no)
    law%cone(1) = make_cone([30.0_wp, 0.0_wp]*degree, [-1.0_wp, -1.0_wp], 0.1_wp, 0.0_wp, 0.0_wp)
    there%f = 1.3_wp*identity
    there%chi = 1.3_wp*identity
    call update_point(law, [motion_at(0.0_wp), there], state, point)
    call test%check('beyond the apex', .not. point%done)
    call test%check('names the surface', index(failure_text(point), 'active: macro (f = ') > 0)
  end subroutine check_failure

  !> A rounded cone returns from any tension, with a consistent tangent at the axis too.
  subroutine check_tension()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: there
    real(wp) :: p
    law = solid([yes, no, no], no, no)
    law%cone(1) = make_cone([30.0_wp, 10.0_wp]*degree, [-1.0_wp, -1.0_wp], 0.1_wp, 0.0_wp, 0.05_wp)
    there%f = 1.05_wp*identity
    there%chi = there%f
    call update_point(law, [motion_at(0.0_wp), there], state, point)
    call test%check('a rounded cone returns from the axis', point%done .and. point%active(1))
    p = (law%cone(1)%a*0.1_wp - law%cone(1)%rounding)/law%cone(1)%b
    call test%check_close('to its tip', point%stress%s(1, 1)*there%f(1, 1)**2 &
      /(point%state%fp(1, 1)**3*p), 1.0_wp, 1.0e-8_wp)
    call check_tangent('rounded', law, 1)
  end subroutine check_tension

  !> Cohesion softens to its rest and no further.
  subroutine check_softening()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    integer(i4) :: i
    law = solid([yes, no, no], no, no)
    law%cone(1) = make_cone([30.0_wp, 5.0_wp]*degree, [-1.0_wp, -1.0_wp], 0.1_wp, -1.0_wp, 0.2_wp)
    do i = 1, 20
      call update_point(law, [motion_at(0.1_wp*(i - 1)), motion_at(0.1_wp*i)], state, point)
      state = point%state
    end do
    call test%check('softened', point%done .and. 0.1_wp - 2.0_wp*point%state%z(1) < 0.0_wp)
    call test%check_close('on the last cone', point%yield(1), 0.0_wp, 1.0e-9_wp)
  end subroutine check_softening
end program test_fem_mm_plastic
