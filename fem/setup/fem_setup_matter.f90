!> Laws with a state for a body: which elements have them, their initial stress from &initial_stress
!! and &geostatic, and settings of their equilibrium iteration.
module fem_setup_matter
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_body, only: fem_body_type
  use fem_elastic, only: classical, polar
  use fem_mesh, only: find_group, group_hint
  use fem_polar, only: full_of
  use fem_recover, only: point_positions
  use fem_setup_micro, only: read_micro_laws, begin_micro_points
  use fem_types, only: group_volume
  implicit none
  private
  public :: read_matter

contains

  !> No action for bodies of elastic laws alone.
  subroutine read_matter(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: m

    if (.not. body%matter%active) then
      call refuse_idle(deck, body, errors)
      return
    end if
    call refuse_others(deck, body, errors)
    if (body%matter%micro%active) call read_micro_laws(deck, body, errors)
    do m = 1, size(body%matter%law)
      if (.not. body%whole%uses_law(m, body%matter%law_of)) cycle
      body%matter%symmetric = body%matter%symmetric .and. body%matter%law(m)%law%symmetric
      body%matter%states = max(body%matter%states, body%matter%law(m)%law%states)
      body%matter%finite = body%matter%finite .or. body%matter%law(m)%law%finite
    end do
    if (body%matter%finite .and. body%elastic%components == polar) call deck%fault(errors, 'D334', &
      'a body at finite strain has micropolar parts', 'section', 1, 'material', &
      'micropolar laws are those of small strains: run them alone')
    if (allocated(body%loads%follower)) body%matter%symmetric = .false.
    if (deck%given('analysis', 1, 'tolerance')) &
      call deck%get('analysis', 1, 'tolerance', body%newton%tolerance)
    if (deck%given('analysis', 1, 'max_iterations')) &
      call deck%get('analysis', 1, 'max_iterations', body%newton%most_iterations)
    call deck%get('analysis', 1, 'step_cuts', body%newton%most_cuts)
    if (errors%any()) return
    call read_stress(deck, body, errors)
    if (errors%any()) return
    if (body%matter%micro%active) then
      call begin_micro_points(deck, body, errors)
    else
      call begin_points(deck, body, errors)
    end if
  end subroutine read_matter

  !> Keys and groups of laws with a state where there are none.
  subroutine refuse_idle(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: keys(7) = [character(len=14) :: 'tolerance', &
      'max_iterations', 'step_cuts', 'continuation', 'first_share', 'arc_growth', 'arc_iterations']
    character(len=*), parameter :: groups(2) = [character(len=14) :: 'initial_stress', 'geostatic']
    character(len=:), allocatable :: kind, solver
    integer(i4) :: k
    call deck%get('analysis', 1, 'kind', kind)
    call deck%get('analysis', 1, 'solver', solver)
    if (kind == 'static' .or. kind == 'newmark' .or. kind == 'hht') then
      do k = 1, size(keys)
        if (keys(k) == 'tolerance' .and. (solver == 'iterative' .or. solver == 'multigrid')) cycle
        if (deck%given('analysis', 1, trim(keys(k)))) call deck%fault(errors, 'D325', &
          trim(keys(k))//' means nothing to linear solids', 'analysis', 1, trim(keys(k)), &
          'no section has a law with a state')
      end do
    end if
    if (allocated(body%loads%follower)) call deck%fault(errors, 'D336', &
      'a pressure follows the surface of a linear solid', 'pressure', 1, 'follower', &
      "leave follower out, or take a law with a state (law = 'neo_hookean')")
    do k = 1, size(groups)
      if (deck%count(trim(groups(k))) > 0) call deck%fault(errors, 'D335', &
        'no section has a law with a state', trim(groups(k)), 1, '', &
        'linear solids count their stress from the start: leave it out')
    end do
  end subroutine refuse_idle

  !> Fault D334 for analyses and elements that do not support a state.
  subroutine refuse_others(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind, solver, path
    integer(i4) :: e
    call deck%get('analysis', 1, 'kind', kind)
    call deck%get('analysis', 1, 'solver', solver)
    call deck%get('analysis', 1, 'continuation', path)
    if (body%scheme%linear_only) call deck%fault(errors, 'D334', "kind = '"//kind// &
      "' supports linear laws alone, and a section has one with a state", 'analysis', 1, &
      'kind', "use kind = 'static', 'newmark', 'hht' or 'explicit'")
    if (body%matter%micro%active) call refuse_micro(deck, body, errors)
    if (body%damping%stiffness > 0.0_wp) call deck%fault(errors, 'D334', &
      'rayleigh_stiffness supports linear laws alone, and a section has one with a state', &
      'analysis', 1, 'rayleigh_stiffness', 'use rayleigh_mass, dashpots, or the numerical '// &
      "damping of kind = 'hht'")
    if (solver == 'iterative') call deck%fault(errors, 'D334', &
      'tangents of laws with a state need factors or multigrid', 'analysis', 1, 'solver', &
      "take solver = 'direct' or 'multigrid', or leave it out")
    if (solver == 'multigrid' .and. (path == 'arc_length' .or. body%matter%micro%active)) &
      call deck%fault(errors, 'D334', trim(merge('a path by arc length    ', &
      'a micromorphic solid    ', path == 'arc_length'))//' needs factors', 'analysis', 1, &
      'solver', "take solver = 'direct' or leave it out")
    if (body%matter%micro%active) return
    if (any(body%elastic%layered_of > 0)) call deck%fault(errors, 'D334', 'element '// &
      str(int(findloc(body%elastic%layered_of > 0, .true., 1), i4))//' is of a layered solid, '// &
      'in a body that has a law with a state', 'section', 1, 'material', &
      'layers and joints are elastic: run them alone')
    do e = 1, body%mesh%elements
      associate (rule => body%elastic%rule(body%elastic%rule_of(e)))
        if (rule%linear_volume .and. body%matter%law(body%matter%law_of(e))%law%finite) then
          call deck%fault(errors, 'D334', 'element '//str(e)//' is hex27_bbar at finite strain', &
            'section', 1, 'element', 'its volumetric strain is a small one: use hex8_bbar')
          return
        end if
        if (rule%modes == 0 .and. .not. rule%one_point) cycle
        call deck%fault(errors, 'D334', 'element '//str(e)//' is '//trim(rule%name)// &
          ', which has elastic laws alone, in a body that has one with a state', 'section', 1, &
          'element', 'use an element that integrates in full: hex8_bbar, hex8_full, hex20, ...')
        return
      end associate
    end do
  end subroutine refuse_others

  !> Fault D334 for options of dynamics for other solids alone.
  subroutine refuse_micro(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp) :: factor
    if (body%scheme%dynamic .and. .not. body%scheme%explicit &
      .and. 2.0_wp*body%scheme%beta < body%scheme%gamma) &
      call deck%fault(errors, 'D334', 'beta < gamma/2 with a micromorphic solid, whose largest '// &
        'stable step is unknown', 'analysis', 1, 'beta', 'use beta >= gamma/2')
    call deck%get('analysis', 1, 'rotation_mass', factor)
    if (.not. factor > 0.0_wp) call deck%fault(errors, 'D334', &
      "rotation_mass = 'auto' supports micropolar solids alone", 'analysis', 1, 'rotation_mass', &
      'give a factor on micro_inertia')
    if (deck%count('absorbing') > 0) call deck%fault(errors, 'D334', &
      'absorbing faces exclude micromorphic solids', 'absorbing', 1, 'group', 'leave them out')
  end subroutine refuse_micro

  !> Initial stress of all points; where groups share elements the last one counts.
  subroutine read_stress(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:), x(:, :)
    real(wp) :: level, k0, surcharge
    integer(i4) :: s, g, k, e, q

    allocate (body%matter%stress(6, body%elastic%points), source=0.0_wp)
    do s = 1, deck%count('initial_stress')
      call find_volume(deck, body, 'initial_stress', s, g, errors)
      if (g == 0) cycle
      call deck%get('initial_stress', s, 'value', value)
      do k = 1, size(body%mesh%group(g)%element)
        e = body%mesh%group(g)%element(k)
        do q = body%elastic%point(e), body%elastic%point(e + 1) - 1
          body%matter%stress(:, q) = value
        end do
      end do
    end do
    if (deck%count('geostatic') == 0) return
    allocate (x(3, body%elastic%points))
    call point_positions(body%mesh, body%dofs, body%elastic, x)
    do s = 1, deck%count('geostatic')
      call find_volume(deck, body, 'geostatic', s, g, errors)
      if (.not. norm2(body%loads%gravity) > 0.0_wp) call deck%fault(errors, 'D335', &
        'a geostatic stress needs gravity', 'geostatic', s, '', 'give gravity in &run')
      if (g == 0 .or. errors%any()) cycle
      call deck%get('geostatic', s, 'level', level)
      call deck%get('geostatic', s, 'k0', k0)
      call deck%get('geostatic', s, 'surcharge', surcharge)
      do k = 1, size(body%mesh%group(g)%element)
        e = body%mesh%group(g)%element(k)
        do q = body%elastic%point(e), body%elastic%point(e + 1) - 1
          body%matter%stress(:, q) = stress_at(x(:, q), body%loads%gravity, level, &
            surcharge - lift(body, e, q), k0, body%elastic%density(e))
        end do
      end do
    end do
  end subroutine read_stress

  !> Share of the pore pressure in the total stress at a point [Pa].
  pure real(wp) function lift(body, e, p)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e, p
    lift = 0.0_wp
    if (.not. body%pore%active) return
    if (body%pore%skeleton_of(e) > 0) lift = body%pore%skeleton(body%pore%skeleton_of(e))%biot &
      *body%pore%borne_at(body%dofs, body%elastic, body%accepted%u, e, &
        p - body%elastic%point(e) + 1)
  end function lift

  !> Stress under a level surface, k0 times the vertical one sideways [Pa].
  pure function stress_at(x, gravity, level, surcharge, k0, density) result(stress)
    real(wp), intent(in) :: x(3), gravity(3), level, surcharge, k0, density
    real(wp) :: stress(6), up(3), vertical
    up = -gravity/norm2(gravity)
    vertical = -surcharge - density*norm2(gravity)*max(0.0_wp, level - dot_product(up, x))
    stress = vertical*k0*[1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp] &
      + vertical*(1.0_wp - k0)*[up(1)**2, up(2)**2, up(3)**2, up(1)*up(2), up(2)*up(3), up(3)*up(1)]
  end function stress_at

  subroutine find_volume(deck, body, group, s, g, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: s
    integer(i4), intent(out) :: g
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    call deck%get(group, s, 'group', name)
    g = find_group(body%mesh, name, [group_volume])
    if (g == 0) call deck%fault(errors, 'D301', "the mesh has no volume group '"//name//"'", &
      group, s, 'group', group_hint(body%mesh, name, [group_volume]))
  end subroutine find_volume

  !> State of all points at their initial stress; fault D333 names the first that cannot be. Elastic
  !! moduli of the elements are those of their first points.
  subroutine begin_points(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fault, cure
    real(wp), allocatable :: wide(:, :)
    integer(i4) :: e, q, n

    allocate (body%matter%state(body%matter%states, body%elastic%points), source=0.0_wp)
    do e = 1, body%mesh%elements
      associate (law => body%matter%law(body%matter%law_of(e))%law, first => body%elastic%point(e))
        n = law%states
        do q = first, body%elastic%point(e + 1) - 1
          call law%begin(body%matter%stress(:, q), body%matter%state(:n, q), fault, cure)
          if (len(fault) == 0) cycle
          call deck%fault(errors, 'D333', 'element '//str(e)//', point '//str(q - first + 1)// &
            ': '//fault, 'material', body%matter%law_of(e), 'id', cure)
          return
        end do
      end associate
    end do
    if (body%elastic%components /= classical) then
      allocate (wide(body%elastic%components, body%elastic%points), source=0.0_wp)
      wide(:9, :) = body%matter%stress(full_of, :)
      call move_alloc(wide, body%matter%stress)
    end if
    call body%matter%renew_moduli(body%elastic)
  end subroutine begin_points
end module fem_setup_matter
