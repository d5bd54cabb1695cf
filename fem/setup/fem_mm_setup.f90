!> The micromorphic solid of the deck: &micromorphic and its &cone groups.
module fem_mm_setup
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_mm_cones, only: mm_cone_type, make_cone
  use fem_mm_elastic, only: set_moduli
  use fem_mm_flow, only: mm_law_type
  implicit none
  private
  public :: read_micromorphic, solid_of

  character(len=*), parameter :: name(7) = [character(len=6) :: 'lambda', 'mu', 'eta', 'tau', &
    'kappa', 'nu', 'sigma']
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
    if (deck%given('micromorphic', m, 'update')) then
      call deck%get('micromorphic', m, 'update', text)
      law%exact_volume = text == 'exact_volume'
    end if
    if (law%trapezoidal .and. law%exact_volume) call deck%fault(errors, 'D350', &
      "integration = 'trapezoidal' has no update of exact volume", 'micromorphic', m, 'update', &
      "leave `integration` out, or take update = 'euler'")
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

  subroutine read_cone(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(mm_law_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    type(mm_cone_type) :: cone
    character(len=:), allocatable :: level
    real(wp) :: angle(2), shape(2), cohesion, hardening, rounding
    integer(i4) :: first, last

    call deck%get('cone', k, 'level', level)
    call deck%get('cone', k, 'friction_deg', angle(1))
    call deck%get('cone', k, 'dilation_deg', angle(2))
    call deck%get('cone', k, 'shape', shape(1))
    shape(2) = shape(1)
    if (deck%given('cone', k, 'flow_shape')) call deck%get('cone', k, 'flow_shape', shape(2))
    call deck%get('cone', k, 'cohesion', cohesion)
    call deck%get('cone', k, 'hardening', hardening)
    call deck%get('cone', k, 'rounding', rounding)
    cone = make_cone(angle*degree, shape, cohesion, hardening, rounding)
    if (cone%b_flow > cone%b) call deck%fault(errors, 'D350', 'the potential is steeper (B = '// &
      str(cone%b_flow)//') than the surface (B = '//str(cone%b)//')', 'cone', k, 'dilation_deg', &
      'plastic flow would give energy: equal angles are the limit')
    if (.not. (cohesion > 0.0_wp .or. angle(1) > 0.0_wp)) call deck%fault(errors, 'D350', &
      'the cone has neither friction nor cohesion', 'cone', k, 'cohesion', 'give one of both')
    first = 1
    if (level == 'micro') first = 2
    if (level == 'gradient') first = 3
    last = merge(5_i4, first, first == 3)
    if (first == 3 .and. .not. cohesion > 0.0_wp) call deck%fault(errors, 'D350', &
      'a gradient cone needs cohesion', 'cone', k, 'cohesion', &
      'couple stresses vanish at the start: they would be on the tip of the cone')
    if (first == 3 .and. all(law%elastic%taus == 0.0_wp)) call deck%fault(errors, 'D350', &
      'a gradient cone belongs to couple stresses, and all taus are zero', 'cone', k, 'level', &
      'give taus to &micromorphic')
    if (law%cone(first)%on) call deck%fault(errors, 'D350', 'two cones of level '//level, 'cone', &
      k, 'level', 'give each level one cone')
    law%cone(first:last) = cone
  end subroutine read_cone
end module fem_mm_setup
