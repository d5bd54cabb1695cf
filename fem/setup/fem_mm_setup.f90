!> The micromorphic solid of the deck: &micromorphic and its &cone groups.
module fem_mm_setup
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_mm_caps, only: make_ellipse, make_breakage, moments
  use fem_mm_cones, only: mm_cone_type, kind_cone, kind_ellipse, kind_breakage, make_cone, &
    by_macro_pressure
  use fem_mm_elastic, only: set_moduli, weakened
  use fem_mm_flow, only: mm_law_type
  use fem_mm_prestress, only: free_moduli, on_surface
  implicit none
  private
  public :: read_micromorphic, solid_of

  character(len=*), parameter :: name(7) = [character(len=6) :: 'lambda', 'mu', 'eta', 'tau', &
    'kappa', 'nu', 'sigma']
  real(wp), parameter :: root_2_3 = sqrt(2.0_wp/3.0_wp)
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp

contains

  !> The solid number m; fault D350 for cones that admit no flow.
  subroutine read_micromorphic(deck, m, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(mm_law_type), intent(out) :: law
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: taus(:)
    real(wp) :: moduli(18)
    character(len=:), allocatable :: text
    integer(i4) :: k

    do k = 1, 7
      call deck%get('micromorphic', m, trim(name(k)), moduli(k))
    end do
    call deck%get('micromorphic', m, 'taus', taus)
    moduli(8:) = taus
    call deck%get('micromorphic', m, 'elastic_form', text)
    law%elastic = set_moduli(moduli, text == 'reduced')
    call deck%get('micromorphic', m, 'integration', text)
    law%trapezoidal = text == 'trapezoidal'
    call deck%get('micromorphic', m, 'substeps', law%parts)
    law%modulus = maxval(abs(moduli(:7)))
    if (.not. law%modulus > 0.0_wp) call deck%fault(errors, 'D350', 'all moduli are zero', &
      'micromorphic', m, 'mu', 'an elastic solid needs mu > 0')
    if (any(taus /= 0.0_wp) .and. law%modulus > 0.0_wp) &
      law%length = sqrt(maxval(abs(taus))/law%modulus)
    do k = 1, deck%count('cone')
      if (solid_of(deck, 'cone', k, errors) == m) call read_cone(deck, k, law, errors)
    end do
    law%plastic = any(law%cone%on)
    law%exact_volume = any(law%cone%kind == kind_ellipse)
    if (deck%given('micromorphic', m, 'update')) then
      call deck%get('micromorphic', m, 'update', text)
      law%exact_volume = text == 'exact_volume'
    end if
    if (law%trapezoidal .and. law%exact_volume) call deck%fault(errors, 'D350', &
      "integration = 'trapezoidal' has no update of exact volume", 'micromorphic', m, 'update', &
      "leave `integration` out, or take update = 'euler'")
  end subroutine read_micromorphic

  !> Number of the &micromorphic that a group names by `solid`, the only one if it names none; fault
  !! D352, once.
  integer(i4) function solid_of(deck, group, k, errors) result(m)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: wanted, id
    integer(i4) :: i
    m = 0
    call deck%get(group, k, 'solid', wanted)
    if (len(wanted) == 0 .and. deck%count('micromorphic') == 1) m = 1
    do i = 1, deck%count('micromorphic')
      call deck%get('micromorphic', i, 'id', id)
      if (id == wanted) m = i
    end do
    if (m == 0 .and. .not. errors%any()) call deck%fault(errors, 'D352', &
      "there is no &micromorphic '"//wanted//"'", group, k, 'solid', &
      'name the id of one; it may be left out where there is one alone')
  end function solid_of

  !> A surface of the solid, of any kind.
  subroutine read_cone(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_law_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    type(mm_cone_type) :: cone
    character(len=:), allocatable :: level, kind
    integer(i4) :: first, last

    call deck%get('cone', k, 'level', level)
    call deck%get('cone', k, 'kind', kind)
    first = 1
    if (level == 'micro') first = 2
    if (level == 'gradient') first = 3
    last = merge(5_i4, first, first == 3)
    if (kind == 'cone') then
      call read_friction(deck, k, cone, errors)
    else if (kind == 'ellipse') then
      call read_ellipse(deck, k, cone)
    else
      call read_breakage(deck, k, law, cone, errors)
    end if
    if (kind == 'ellipse' .and. first == 3) call deck%fault(errors, 'D350', &
      'couple stresses have no ellipse', 'cone', k, 'level', &
      "ellipses are of level macro or micro; give couples a cone, of pressure = 'macro' if need be")
    if (kind == 'breakage' .and. first /= 1) call deck%fault(errors, 'D350', &
      'breakage of level '//level, 'cone', k, 'level', 'grains break by the macro-stress')
    if (first == 3) call check_gradient(deck, k, law, cone, errors)
    if (cone%of_macro .and. first /= 3) call deck%fault(errors, 'D350', &
      'a cone of level '//level//' with the pressure of the macro-stress', 'cone', k, 'pressure', &
      'that belongs to level gradient')
    if (law%cone(first)%on) call deck%fault(errors, 'D350', 'two cones of level '//level, 'cone', &
      k, 'level', 'give each level one cone')
    call check_region(deck, k, law, cone, errors)
    law%cone(first:last) = cone
  end subroutine read_cone

  !> Fault D473 for closed surfaces without an elastic region: an ellipse that is smaller than what
  !! counts as on the surface, and grains that crush in tension before they part.
  subroutine check_region(deck, k, law, cone, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_law_type), intent(in) :: law
    type(mm_cone_type), intent(in) :: cone
    type(error_list_type), intent(inout) :: errors
    real(wp) :: modulus(2), crushing
    if (errors%any()) return
    if (cone%kind == kind_ellipse) then
      if (cone%slope*(cone%cap + cone%tension) <= 2.0_wp*on_surface*law%modulus) call deck%fault( &
        errors, 'D473', 'preconsolidation + tension = '//str(cone%cap + cone%tension)// &
        ' Pa leave no elastic region beside moduli of '//str(law%modulus)//' Pa', 'cone', k, &
        'preconsolidation', 'it is the pressure that a specimen has carried')
    else if (cone%kind == kind_breakage) then
      modulus = free_moduli(law%elastic)
      crushing = sqrt(2.0_wp*modulus(2)/3.0_wp*cone%energy/law%theta(1))
      if (cone%tension >= crushing) call deck%fault(errors, 'D473', 'tension = '// &
        str(cone%tension)//' Pa is not below '//str(crushing)//' Pa, at which the grains crush', &
        'cone', k, 'tension', 'a share of it that is small beside the stresses will do')
    end if
  end subroutine check_region

  !> A cone of Drucker and Prager.
  subroutine read_friction(deck, k, cone, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_cone_type), intent(out) :: cone
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: pressure
    real(wp) :: angle(2), shape(2), cohesion, hardening, rounding, length

    call deck%get('cone', k, 'friction_deg', angle(1))
    call deck%get('cone', k, 'dilation_deg', angle(2))
    call deck%get('cone', k, 'shape', shape(1))
    shape(2) = shape(1)
    if (deck%given('cone', k, 'flow_shape')) call deck%get('cone', k, 'flow_shape', shape(2))
    call deck%get('cone', k, 'cohesion', cohesion)
    call deck%get('cone', k, 'hardening', hardening)
    call deck%get('cone', k, 'rounding', rounding)
    call deck%get('cone', k, 'pressure', pressure)
    cone = make_cone(angle*degree, shape, cohesion, hardening, rounding)
    if (cone%b_flow > cone%b) call deck%fault(errors, 'D350', 'the potential is steeper (B = '// &
      str(cone%b_flow)//') than the surface (B = '//str(cone%b)//')', 'cone', k, 'dilation_deg', &
      'plastic flow would give energy: equal angles are the limit')
    if (.not. (cohesion > 0.0_wp .or. angle(1) > 0.0_wp)) call deck%fault(errors, 'D350', &
      'the cone has neither friction nor cohesion', 'cone', k, 'cohesion', 'give one of both')
    if (pressure /= 'macro') return
    call deck%get('cone', k, 'length', length)
    cone = by_macro_pressure(cone, length)
  end subroutine read_friction

  !> An ellipse; slopes in the deck are those of q over p.
  subroutine read_ellipse(deck, k, cone)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_cone_type), intent(out) :: cone
    real(wp) :: slope(2), cap, tension, exponent
    call deck%get('cone', k, 'critical_slope', slope(1))
    slope(2) = slope(1)
    if (deck%given('cone', k, 'flow_slope')) call deck%get('cone', k, 'flow_slope', slope(2))
    call deck%get('cone', k, 'preconsolidation', cap)
    call deck%get('cone', k, 'tension', tension)
    call deck%get('cone', k, 'exponent', exponent)
    cone = make_ellipse(root_2_3*slope(1), root_2_3*slope(2), cap, tension, exponent)
  end subroutine read_ellipse

  !> The surface of breakage, and what breakage takes from the moduli.
  subroutine read_breakage(deck, k, law, cone, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_law_type), intent(inout) :: law
    type(mm_cone_type), intent(out) :: cone
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: theta(:)
    real(wp) :: slope, tension, energy, angle, largest, least, fractal
    call deck%get('cone', k, 'critical_slope', slope)
    call deck%get('cone', k, 'tension', tension)
    call deck%get('cone', k, 'breakage_energy', energy)
    call deck%get('cone', k, 'breakage_angle_deg', angle)
    cone = make_breakage(root_2_3*slope, energy, angle*degree, tension)
    if (deck%given('cone', k, 'grading_indices')) then
      call deck%get('cone', k, 'grading_indices', theta)
      law%theta = theta
    else if (deck%given('cone', k, 'grain_size_max')) then
      call deck%get('cone', k, 'grain_size_max', largest)
      call deck%get('cone', k, 'grain_size_min', least)
      call deck%get('cone', k, 'fractal_dimension', fractal)
      if (largest > least) law%theta = moments(least/largest, fractal)
      if (.not. largest > least) call deck%fault(errors, 'D350', 'grain_size_max = '// &
        str(largest)//' m is not above grain_size_min = '//str(least)//' m', 'cone', k, &
        'grain_size_max', 'the ultimate grading reaches from the smallest to the largest size')
    else
      call deck%fault(errors, 'D350', 'nothing says how far the grading can go', 'cone', k, &
        'kind', 'give grain_size_max and grain_size_min, or grading_indices')
    end if
    law%breaks = .true.
    law%fall = weakened(law%elastic, -1.0_wp - law%theta(1), law%elastic)
    law%fall%taus = -law%theta(2)*law%elastic%taus
  end subroutine read_breakage

  !> Faults of surfaces of couple stresses.
  subroutine check_gradient(deck, k, law, cone, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_law_type), intent(in) :: law
    type(mm_cone_type), intent(in) :: cone
    type(error_list_type), intent(inout) :: errors
    if (cone%kind == kind_cone .and. .not. cone%cohesion > 0.0_wp) call deck%fault(errors, 'D350', &
      'a gradient cone needs cohesion', 'cone', k, 'cohesion', &
      'couple stresses vanish at the start: they would be on the tip of the cone')
    if (all(law%elastic%taus == 0.0_wp)) call deck%fault(errors, 'D350', &
      'a gradient cone belongs to couple stresses, and all taus are zero', 'cone', k, 'level', &
      'give taus to &micromorphic')
  end subroutine check_gradient
end module fem_mm_setup
