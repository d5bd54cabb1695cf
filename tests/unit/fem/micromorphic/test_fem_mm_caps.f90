!> Closed surfaces of a micromorphic point: tangents by differences, Kuhn and Tucker, volumes,
!! hardening, critical state, dissipation and energies of ellipses and of breakage.
program test_fem_mm_caps
  use talus_kinds, only: wp, i4
  use talus_test, only: larger, max_abs, test_type
  use fem_mm_caps, only: make_ellipse, make_breakage, moments, breakage_after
  use fem_mm_cones, only: mm_cone_type, make_cone, by_macro_pressure, surfaces
  use fem_mm_elastic, only: set_moduli, weakened
  use fem_mm_ellipticity, only: least_determinant
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, packed_motion, unpacked_motion, packed_force
  use fem_mm_plastic, only: mm_point_type, update_point, failure_text
  use fem_mm_prestress, only: start_state
  use fem_mm_report, only: flow_warning, held_warning, inertia_warning
  use fem_mm_tensor, only: determinant, identity, inverse, leg_one
  use fem_mm_watch, only: can_lose
  implicit none
  type(test_type) :: test
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: moduli(18) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, &
    5.0_wp, 0.3_wp, 0.1_wp, 0.2_wp, 0.4_wp, -0.1_wp, 0.5_wp, 8.0_wp, 0.2_wp, 0.6_wp, 0.3_wp, 0.1_wp]
  integer(i4), parameter :: none = 0, ellipse = 1, breakage = 2, cones = 1, macro_cones = 2
  real(wp) :: way(45)
  integer(i4) :: n

  way = [(0.006_wp*sin(1.0_wp + 1.7_wp*n), n=1, 45)]
  way([1, 5, 9]) = way([1, 5, 9]) - sum(way([1, 5, 9]))/3.0_wp - 0.008_wp  ! compressed
  way(10:18) = way(:9) + 0.3_wp*way(10:18)  ! chi is near F
  way(19:) = 3.0_wp*way(19:)
  call check_step('macro', solid([ellipse, none, none]))
  call check_step('micro', solid([none, ellipse, none]))
  call check_step('cones', solid([ellipse, ellipse, cones]))
  call check_step('macro-pressure', solid([ellipse, ellipse, macro_cones]))
  call check_step('macro-pressure alone', solid([none, none, macro_cones]))
  call check_tangent('substeps', in_parts(solid([ellipse, ellipse, macro_cones]), 4))
  call check_step('breakage', solid([breakage, none, none]))
  call check_step('breakage, micro', solid([breakage, ellipse, macro_cones]))
  call check_tangent('breakage, substeps', in_parts(solid([breakage, ellipse, macro_cones]), 4))
  call check_tangent('trapezoidal', by_trapezoids(solid([ellipse, ellipse, macro_cones])))
  call check_tangent('breakage, trapezoidal', by_trapezoids(solid([breakage, ellipse, none])))
  call check_tangent('exact breakage', exactly(solid([breakage, none, none])))
  call check_reduced()
  call check_hardening()
  call check_critical(1, 1.0_wp)
  call check_critical(1, 0.9_wp)
  call check_critical(2, 1.1_wp)
  call check_moments()
  call check_growth()
  call check_tension()
  call check_prestress()
  call check_ellipticity()
  call check_warnings()
  call check_energy('ellipses', solid([ellipse, ellipse, macro_cones]))
  call check_energy('breakage', solid([breakage, none, none]))
  call test%finish()

contains

  !> A solid with a surface of a kind, or none, in the macro- and the micro-stress, and in couples.
  pure function solid(kind) result(law)
    integer(i4), intent(in) :: kind(3)
    type(mm_law_type) :: law
    integer(i4) :: k
    law%elastic = set_moduli(moduli, .false.)
    law%length = 0.6_wp
    law%modulus = 60.0_wp
    law%exact_volume = kind(1) /= breakage
    if (kind(1) == ellipse) law%cone(1) = make_ellipse(0.98_wp, 0.8_wp, 0.2_wp, 0.005_wp, 20.0_wp)
    if (kind(1) == breakage) then
      law%cone(1) = make_breakage(0.98_wp, 0.01_wp, 60.0_wp*degree, 0.01_wp)
      law%breaks = .true.
      law%theta = [0.8_wp, 0.9_wp, 0.95_wp]
      law%fall = weakened(law%elastic, -1.8_wp, law%elastic)
      law%fall%taus = -0.9_wp*law%elastic%taus
    end if
    if (kind(2) == ellipse) law%cone(2) = make_ellipse(0.9_wp, 0.9_wp, &
      merge(2.0_wp, 0.5_wp, kind(1) == breakage), 0.01_wp, 15.0_wp)
    do k = 3, surfaces
      if (kind(3) == none) cycle
      law%cone(k) = make_cone([20.0_wp, 5.0_wp]*degree, [0.0_wp, 0.0_wp], 0.02_wp, 0.3_wp, 0.0_wp)
      if (kind(3) == macro_cones) law%cone(k) = by_macro_pressure(law%cone(k), 0.1_wp)
    end do
    law%plastic = .true.
  end function solid

  pure function in_parts(one, parts) result(law)
    type(mm_law_type), intent(in) :: one
    integer(i4), intent(in) :: parts
    type(mm_law_type) :: law
    law = one
    law%parts = parts
  end function in_parts

  pure function by_trapezoids(one) result(law)
    type(mm_law_type), intent(in) :: one
    type(mm_law_type) :: law
    law = one
    law%trapezoidal = .true.
    law%exact_volume = .false.
  end function by_trapezoids

  pure function exactly(one) result(law)
    type(mm_law_type), intent(in) :: one
    type(mm_law_type) :: law
    law = one
    law%exact_volume = .true.
  end function exactly

  !> A share of the way from the undeformed point.
  pure function motion_at(share) result(motion)
    real(wp), intent(in) :: share
    type(mm_motion_type) :: motion, undeformed
    motion = unpacked_motion(packed_motion(undeformed) + share*way)
  end function motion_at

  !> A step over the whole way: all surfaces that there are yield; rotations; the tangent.
  subroutine check_step(name, law)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    type(mm_state_type) :: start
    type(mm_point_type) :: point, turned
    type(mm_motion_type) :: there
    real(wp), parameter :: q(3, 3) = reshape([0.36_wp, 0.48_wp, -0.8_wp, -0.8_wp, 0.6_wp, 0.0_wp, &
                                              0.48_wp, 0.64_wp, 0.6_wp], [3, 3])
    call update_point(law, [motion_at(0.0_wp), motion_at(1.0_wp)], start, point)
    call test%check(name//': done', point%done .and. point%substeps == 1)
    call test%check(name//': surfaces that yield', all(point%active .eqv. law%cone%on))
    call test%check(name//': multipliers >= 0', all(point%gamma >= 0.0_wp))
    call test%check_all_close(name//': yields <= 0', larger(point%yield, 0.0_wp), 0.0_wp, &
                              1.0e-9_wp)
    call test%check(name//': dissipation', point%state%dissipated > 0.0_wp)
    there = motion_at(1.0_wp)
    there%f = matmul(q, there%f)
    there%chi = matmul(q, there%chi)
    there%g = leg_one(q, there%g)
    call update_point(law, [motion_at(0.0_wp), there], start, turned)
    call test%check_close(name//': S does not turn', max_abs(turned%stress%s - point%stress%s) &
      /max_abs(point%stress%s), 0.0_wp, 1.0e-11_wp)
    call check_tangent(name, law)
  end subroutine check_step

  !> Tangent of a second step, 0.4 to 1 of the way, against differences of fourth order.
  subroutine check_tangent(name, law)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    type(mm_state_type) :: start
    type(mm_point_type) :: point, moved
    type(mm_motion_type) :: here, there
    real(wp) :: tangent(45, 45), found(45, 45), x(45), f(45, 4)
    real(wp), parameter :: h = 1.0e-5_wp, move(4) = [-2.0_wp, -1.0_wp, 1.0_wp, 2.0_wp]
    integer(i4) :: i, k
    call update_point(law, [motion_at(0.0_wp), motion_at(0.4_wp)], start, point)
    start = point%state
    here = motion_at(0.4_wp)
    there = motion_at(1.0_wp)
    call update_point(law, [here, there], start, point, tangent)
    call test%check(name//': second step', point%done .and. point%substeps == law%parts)
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

  !> Stresses without products of strains, whose breakage and tangent are their own; unloading is
  !! elastic, with what breakage left of the moduli.
  subroutine check_reduced()
    type(mm_law_type) :: law
    type(mm_state_type) :: start
    type(mm_point_type) :: point, back
    real(wp) :: tangent(45, 45)
    law = solid([breakage, none, none])
    law%elastic%reduced = .true.
    law%fall%reduced = .true.
    call check_tangent('reduced', law)
    law = solid([breakage, ellipse, macro_cones])
    call update_point(law, [motion_at(0.0_wp), motion_at(1.0_wp)], start, point)
    call update_point(law, [motion_at(1.0_wp), motion_at(0.99_wp)], point%state, back, tangent)
    call test%check('unloading is elastic', back%done .and. .not. any(back%active))
    call test%check_close('breakage stays', back%breakage, point%breakage, 0.0_wp)
    call test%check_close('its tangent is symmetric', max_abs(tangent - transpose(tangent)) &
      /max_abs(tangent), 0.0_wp, 1.0e-12_wp)
  end subroutine check_reduced

  !> p_c (det Fp)^zeta stays, along a path with both ellipses, and det follows the multipliers.
  subroutine check_hardening()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    real(wp) :: kept(2)
    integer(i4) :: i
    law = solid([ellipse, ellipse, macro_cones])
    do i = 1, 20
      call update_point(law, [motion_at(0.05_wp*(i - 1)), motion_at(0.05_wp*i)], state, point)
      state = point%state
    end do
    kept = point%cap*[determinant(state%fp), determinant(state%xp)]**law%cone(:2)%exponent
    call test%check_all_close('p_c det^zeta', kept/law%cone(:2)%cap, 1.0_wp, 1.0e-12_wp)
    call test%check('it hardened', all(point%cap > 1.05_wp*law%cone(:2)%cap))
  end subroutine check_hardening

  !> Isotropic compression, then much simple shear of F and chi: the stress of the surface comes to
  !! the top of the ellipse, whatever the slope of the flow. Macro: without micro-moduli.
  subroutine check_critical(level, slope_flow)
    integer(i4), intent(in) :: level
    real(wp), intent(in) :: slope_flow  !! over that of the surface
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: here, there
    real(wp), parameter :: slope = 0.98_wp
    real(wp) :: left, top, elastic(3, 3), stress(3, 3), p
    integer(i4) :: i
    law = solid([none, none, none])
    law%cone(level) = make_ellipse(slope, slope_flow*slope, 0.3_wp, 0.005_wp, 20.0_wp)
    if (level == 1) law%elastic = set_moduli([moduli(:2), (0.0_wp, i=1, 5), moduli(8:)], .false.)
    do i = 1, 60
      there%f = (1.0_wp - 0.012_wp*min(i, 20)/20.0_wp)*identity
      there%f(1, 2) = 0.015_wp*max(i - 20, 0)
      there%chi = there%f
      call update_point(law, [here, there], state, point)
      state = point%state
      here = there
    end do
    elastic = matmul(there%f, inverse(state%fp))
    stress = point%stress%s
    if (level == 2) stress = point%stress%sigma
    p = sum(matmul(transpose(there%f), there%f)*stress)/(3.0_wp*determinant(state%fp))
    top = 0.5_wp*(0.005_wp - point%cap(level))
    left = p/top - 1.0_wp
    call test%check('critical: done', point%done .and. point%active(level))
    call test%check_close('critical: pressure', left, 0.0_wp, 1.0e-6_wp)
    call test%check_close('critical: no more volume', determinant(elastic) &
      *determinant(state%fp)/determinant(there%f), 1.0_wp, 1.0e-12_wp)
  end subroutine check_critical

  !> Moments of a fractal grading, computed independently.
  subroutine check_moments()
    real(wp), parameter :: wanted(3) = [0.80266_wp, 0.89236_wp, 0.91229_wp]
    call test%check_all_close('moments', moments(0.001_wp/0.105_wp, 2.6_wp), wanted, 5.0e-6_wp)
  end subroutine check_moments

  !> 1/(1 - B) grows by 2 cos^2 omega gamma/E_c; slopes against differences.
  subroutine check_growth()
    type(mm_cone_type) :: cone
    real(wp) :: b, at(2), slope(2), none_of(2)
    real(wp), parameter :: h = 1.0e-6_wp, gamma = 1.0e-3_wp, before = 0.3_wp
    cone = make_breakage(1.0_wp, 2.0e-3_wp, 60.0_wp*degree, 0.0_wp)
    call breakage_after(cone, before, gamma, b, slope(1), slope(2))
    call test%check_close('B', 1.0_wp/(1.0_wp - b), 1.0_wp/(1.0_wp - before) + 0.25_wp, 1.0e-14_wp)
    call breakage_after(cone, before, gamma + h, at(1), none_of(1), none_of(2))
    call breakage_after(cone, before, gamma - h, at(2), none_of(1), none_of(2))
    call test%check_close('dB/dgamma', (at(1) - at(2))/(2.0_wp*h), slope(1), 1.0e-4_wp)
    call breakage_after(cone, before + h, gamma, at(1), none_of(1), none_of(2))
    call breakage_after(cone, before - h, gamma, at(2), none_of(1), none_of(2))
    call test%check_close('dB/dB_n', (at(1) - at(2))/(2.0_wp*h), slope(2), 1.0e-9_wp)
  end subroutine check_growth

  !> An ellipse returns from any tension; breakage has no surface there, and says so.
  subroutine check_tension()
    type(mm_state_type) :: start
    type(mm_point_type) :: point
    type(mm_motion_type) :: there
    there%f = 1.05_wp*identity
    there%chi = there%f
    call update_point(solid([ellipse, none, none]), [motion_at(0.0_wp), there], start, point)
    call test%check('an ellipse returns from tension', point%done .and. point%active(1))
    call update_point(solid([breakage, none, none]), [motion_at(0.0_wp), there], start, point)
    call test%check('breakage does not', .not. point%done)
    call test%check('and says so', index(failure_text(point), 'no surface in tension') > 0)
    call update_point(solid([breakage, none, none]), [motion_at(0.0_wp), motion_at(0.0_wp)], &
      start, point)
    call test%check('without stress it is inside', point%done .and. .not. any(point%active))
  end subroutine check_tension

  !> p_c counts from the initial stress.
  subroutine check_prestress()
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    character(len=:), allocatable :: fault
    real(wp), parameter :: stress(6) = [-0.2_wp, -0.2_wp, -0.15_wp, 0.01_wp, 0.0_wp, 0.0_wp]
    law = solid([ellipse, ellipse, none])
    call start_state(law, stress, state, fault)
    call test%check('inside', len(fault) == 0)
    call update_point(law, [motion_at(0.0_wp), motion_at(0.0_wp)], state, point)
    call test%check('elastic', point%done .and. .not. any(point%active))
    call test%check_all_close('p_c', point%cap/law%cone(:2)%cap, 1.0_wp, 1.0e-14_wp)
    call start_state(law, 2.0_wp*stress, state, fault)
    call test%check('outside', index(fault, 'outside the macro surface') > 0)
  end subroutine check_prestress

  !> An ellipse without micro-moduli stays elliptic while it hardens in compression, and loses it
  !! where it softens on the dry side.
  subroutine check_ellipticity()
    real(wp) :: least(2)
    least = [least_after(0.04_wp), least_after(0.0003_wp)]
    call test%check('hardening ellipse is elliptic', least(1) > 0.0_wp)
    call test%check('softening ellipse is not', least(2) < 0.0_wp)
  end subroutine check_ellipticity

  !> Least determinant after a compression and a tenth of simple shear.
  real(wp) function least_after(pressed) result(least)
    real(wp), intent(in) :: pressed
    type(mm_law_type) :: law
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    type(mm_motion_type) :: here, there
    real(wp) :: tangent(45, 45), normal(3)
    integer(i4) :: i
    law = solid([ellipse, none, none])
    law%elastic = set_moduli([moduli(:2), (0.0_wp, i=1, 16)], .false.)
    do i = 1, 15
      there%f = (1.0_wp - pressed*min(i, 10)/10.0_wp)*identity
      there%f(1, 2) = 0.01_wp*max(i - 10, 0)
      there%chi = there%f
      call update_point(law, [here, there], state, point, tangent)
      state = point%state
      here = there
    end do
    call test%check('yields', point%done .and. point%active(1))
    call least_determinant(tangent, .false., least, normal)
  end function least_after

  !> Warnings of steep flow and of a macro-surface alone beside a chi that is held.
  subroutine check_warnings()
    type(mm_law_type) :: law
    law = solid([ellipse, none, none])
    call test%check('no warning', len(flow_warning(law)) == 0 .and. &
                    len(held_warning(law, .false.)) == 0)
    call test%check('chi is held', index(held_warning(law, .true.), 'W305') == 1)
    call test%check('two surfaces', len(held_warning(solid([ellipse, ellipse, none]), .true.)) == 0)
    law%cone(1)%slope_flow = 1.5_wp*law%cone(1)%slope
    call test%check('steep flow', index(flow_warning(law), 'W304') == 1)
    law = solid([breakage, none, none])
    call test%check('inertia', index(inertia_warning(law, .true.), 'W306') == 1)
    call test%check('watched', all(can_lose([solid([ellipse, none, none]), law])))
  end subroutine check_warnings

  !> Work is stored, dissipated or shifted; what is missing decreases with the step and vanishes in
  !! the limit. Dissipation never falls.
  subroutine check_energy(name, law)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    real(wp) :: missing(2)
    missing = [gap(law, 100), gap(law, 200)]
    call test%check_close(name//': what is missing, order', missing(2)/missing(1), 0.5_wp, 0.02_wp)
    call test%check_close(name//': in the limit', 2.0_wp*missing(2) - missing(1), 0.0_wp, 1.0e-4_wp)
  end subroutine check_energy

  !> Share of the work that is missing after so many steps.
  real(wp) function gap(law, steps)
    type(mm_law_type), intent(in) :: law
    integer(i4), intent(in) :: steps
    type(mm_state_type) :: state
    type(mm_point_type) :: point
    real(wp) :: work, force(45), before
    logical :: rises
    integer(i4) :: i
    work = 0.0_wp
    force = 0.0_wp
    rises = .true.
    do i = 1, steps
      before = state%dissipated
      call update_point(law, [motion_at(1.5_wp*(i - 1)/steps), motion_at(1.5_wp*i/steps)], state, &
                        point)
      rises = rises .and. point%done .and. point%state%dissipated >= before
      work = work + 0.75_wp/steps*sum(way*(force + packed_force(point%force)))
      force = packed_force(point%force)
      state = point%state
    end do
    call test%check('dissipation rises', rises)
    gap = 1.0_wp - (point%stored + state%dissipated + state%shifted)/work
  end function gap
end program test_fem_mm_caps
