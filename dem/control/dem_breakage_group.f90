!> A &breakage group: strength of the grains of a material, and what may come of them (theory-dem,
!! Breakage of grains). Faults D354 to D356, D358 to D362.
!! eq. D.26
module dem_breakage_group
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use talus_random, only: unit_number
  use dem_breakage_growth, only: growth_factor
  use dem_breakage_masses, only: mass_names, mass_solid, mass_parent, density_factor
  use dem_fragments, only: family_names, family_count, family_radii, family_fourteen, &
    family_halves, slenderness_of_halves
  use dem_grain_stress, only: criterion_names, criterion_hertz
  use dem_limits, only: rayleigh_of
  use dem_shape_make, only: most_slender
  use dem_state, only: dem_data_type, kind_free
  implicit none
  private
  public :: breakage_type, read_breakage, check_foreseen, diameter_of, semi_axes_of

  integer(i4), parameter :: block = 100      !! looks are made at its divisors or multiples
  integer(i4), parameter :: most_steps = 24  !! of a size, followed at most
  real(wp), parameter :: half_axis = 0.75_wp !! of a half, of the semi-axis

  !> One group.
  type :: breakage_type
    character(len=:), allocatable :: name  !! of the material
    integer(i4) :: material = 0
    real(wp) :: strength = 0.0_wp          !! that 37 % of grains of the size survive [Pa]
    real(wp) :: size = 0.0_wp              !! diameter that it belongs to [m]
    real(wp) :: modulus = 0.0_wp           !! of Weibull; 0: all grains of a size are alike [-]
    real(wp) :: size_exponent = 0.0_wp     !! [-]
    real(wp) :: smallest = 0.0_wp          !! grains up to it do not break [m]
    real(wp) :: fracture_energy = 0.0_wp   !! [J/m^2]; 0: not given
    integer(i8) :: seed = 1
    integer(i4) :: criterion = 0           !! of dem_grain_stress
    integer(i4) :: family = 0              !! of dem_fragments
    integer(i4) :: mass = mass_solid       !! of dem_breakage_masses
    integer(i4) :: every = 20              !! steps between two looks
    real(wp) :: regrow = 0.0_wp            !! time in which fragments grow [s]; 0: they do not
    integer(i4) :: most_grains = 0         !! in the run; 0: as fit into memory
    integer(i4) :: generations = 0         !! that there may be
    real(wp) :: least = 0.0_wp             !! diameter that there may be [m]
    real(wp) :: grains = 0.0_wp            !! that there are if all break
    real(wp) :: step = 0.0_wp              !! Rayleigh time of the least fragments [s]
  contains
    procedure :: strength_of
    procedure :: due
    procedure :: text
  end type breakage_type

contains

  !> Group k of the deck; its material is known.
  subroutine read_breakage(deck, k, material, name, group, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, material
    character(len=*), intent(in) :: name
    type(breakage_type), intent(inout) :: group
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: word
    integer(i4) :: seed, j
    real(wp), parameter :: volume = 3.0_wp  !! one population of flaws

    group%material = material
    group%name = name
    call deck%get('breakage', k, 'strength', group%strength)
    call deck%get('breakage', k, 'size', group%size)
    call deck%get('breakage', k, 'modulus', group%modulus)
    call deck%get('breakage', k, 'size_exponent', group%size_exponent)
    call deck%get('breakage', k, 'smallest', group%smallest)
    call deck%get('breakage', k, 'fracture_energy', group%fracture_energy)
    call deck%get('breakage', k, 'most_grains', group%most_grains)
    call deck%get('breakage', k, 'seed', seed)
    call deck%get('breakage', k, 'check_every', group%every)
    call deck%get('breakage', k, 'regrow', group%regrow)
    group%seed = seed
    call deck%get('breakage', k, 'criterion', word)
    group%criterion = findloc([(criterion_names(j) == word, j=1, size(criterion_names))], .true., 1)
    call deck%get('breakage', k, 'family', word)
    group%family = findloc([(family_names(j) == word, j=1, size(family_names))], .true., 1)
    call deck%get('breakage', k, 'fragment_mass', word)
    group%mass = findloc([(mass_names(j) == word, j=1, size(mass_names))], .true., 1)
    if (.not. deck%given('breakage', k, 'size_exponent')) then
      if (group%modulus > 0.0_wp) then
        group%size_exponent = volume/group%modulus
      else
        call deck%fault(errors, 'D354', 'neither modulus nor size_exponent is given: strengths '// &
                        'of other sizes do not follow', 'breakage', k, '', &
                        'give modulus (then size_exponent is 3/modulus), or size_exponent')
      end if
    end if
    if (modulo(block, max(group%every, 1)) /= 0 .and. modulo(group%every, block) /= 0) &
      call deck%fault(errors, 'D362', 'looks are made at divisors or multiples of 100 steps', &
                      'breakage', k, 'check_every', 'take 10, 20, 50, 100, 200, ...')
  end subroutine read_breakage

  !> Strength of a grain, from its id alone [Pa].
  pure real(wp) function strength_of(self, id, diameter) result(strength)
    class(breakage_type), intent(in) :: self
    integer(i8), intent(in) :: id
    real(wp), intent(in) :: diameter  !! [m]
    strength = self%strength*(diameter/self%size)**(-self%size_exponent)
    if (self%modulus > 0.0_wp) &
      strength = strength*(-log(unit_number(id, self%seed)))**(1.0_wp/self%modulus)
  end function strength_of

  !> Is there a look at this step? Under a partner: was there one since its last exchange?
  pure logical function due(self, steps, since)
    class(breakage_type), intent(in) :: self
    integer(i8), intent(in) :: steps            !! so far
    integer(i8), intent(in), optional :: since  !! steps then
    due = modulo(steps, int(self%every, i8)) == 0
    if (present(since)) due = steps/self%every > since/self%every
  end function due

  !> Diameter of the sphere of a grain's volume [m].
  pure real(wp) function diameter_of(d, i) result(diameter)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    diameter = 2.0_wp*product(d%grains%axes(:, i))**(1.0_wp/3.0_wp)
  end function diameter_of

  !> Semi-axes on both sides and exponent of grain i.
  pure subroutine semi_axes_of(d, i, upper, lower, exponent)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: upper(3), lower(3), exponent
    if (d%grains%shapes%in_use) then
      associate (s => d%grains%shapes)
        upper = s%axes(:, i)*(1.0_wp + s%skew(:, i))
        lower = s%axes(:, i)*(1.0_wp - s%skew(:, i))
        exponent = s%exponent(i)
      end associate
    else
      upper = d%grains%axes(:, i)
      lower = upper
      exponent = 2.0_wp
    end if
  end subroutine semi_axes_of

  !> What may come of the grains of the start; what that does not allow is a fault.
  subroutine check_foreseen(deck, k, d, group, dt, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_data_type), intent(in) :: d
    type(breakage_type), intent(inout) :: group
    real(wp), intent(in) :: dt  !! fixed step [s]; 0: automatic, or above all limits on purpose
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, before
    logical :: found

    before = errors%count
    found = .false.
    group%least = huge(1.0_wp)
    group%step = huge(1.0_wp)
    group%grains = 0.0_wp
    do i = 1, d%grains%n
      if (d%grains%material(i) /= group%material .or. d%grains%kind(i) /= kind_free) cycle
      found = .true.
      if (diameter_of(d, i) < group%smallest) call deck%fault(errors, 'D355', 'grain '// &
        str(d%grains%id(i))//' has a diameter of '//short_number(diameter_of(d, i))// &
        ' m: it is below smallest, as all of its size it would never break', 'breakage', k, &
        'smallest', 'take less than the least diameter of the grains')
      if (group%family == family_halves) call check_slender(deck, k, d, i, errors)
      if (errors%count > before) return
      call foresee_grain(d, i, group)
    end do
    if (.not. found) return  ! they may come from sources
    if (group%grains > real(huge(1_i4), wp) - maxval(d%grains%id)) &
      call deck%fault(errors, 'D361', 'there may be '//short_number(group%grains)// &
                      ' grains in '//str(group%generations)//' generations, ids go to '// &
                      str(huge(1_i4)), 'breakage', k, 'smallest', 'take a larger one')
    if (dt > group%step) call deck%fault(errors, 'D360', 'fragments may have '//short_number( &
      group%least)//' m after '//str(group%generations)//' generations: their Rayleigh time is '// &
      short_number(group%step)//' s, the fixed step '//short_number(dt)//' s', 'breakage', k, &
      'smallest', 'leave dt out, take a smaller one or a larger smallest, or set '// &
      'allow_unstable = .true.')
  end subroutine check_foreseen

  !> Halves of a slender grain may be more slender than shapes can be, wherever it is cut (D358).
  !! Where one cut leaves halves that can be, those of the halves can, too: that across the longest
  !! axis.
  subroutine check_slender(deck, k, d, i, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, i
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: upper(3), lower(3), exponent
    integer(i4) :: j
    call semi_axes_of(d, i, upper, lower, exponent)
    if (any([(slenderness_of_halves(upper, lower, exponent, j), j=1, 3)] <= most_slender)) return
    call deck%fault(errors, 'D358', 'halves of grain '//str(d%grains%id(i))//', with semi-axes '// &
                    str(upper)//' m, are more slender than 1 to '//str(most_slender)// &
                    ' wherever it is cut', 'breakage', k, 'family', "take 'fourteen', whose "// &
                    "fragments keep the shape, or 'none'")
  end subroutine check_slender

  !> Generations, least size and step, and number of what may come of grain i.
  subroutine foresee_grain(d, i, group)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(breakage_type), intent(inout) :: group
    real(wp) :: number(0:most_steps, 0:most_steps), ratio(2), each(2), upper(3), lower(3), p, size
    real(wp) :: least, step, kept
    integer(i4) :: a, b

    call semi_axes_of(d, i, upper, lower, p)
    call ratios_of(group%family, p, ratio, each)
    number = 0.0_wp
    number(0, 0) = 1.0_wp
    least = diameter_of(d, i)
    step = 1.0_wp
    kept = sum(each*ratio**3)
    if (group%regrow > 0.0_wp .and. kept > 0.0_wp) then  ! grown ones set the step, eq. D.70
      ratio = ratio*growth_factor(1.0_wp, each*ratio**3)
      kept = 1.0_wp
    end if
    do a = 0, most_steps - 1
      do b = 0, most_steps - 1
        if (.not. number(a, b) > 0.0_wp) cycle
        size = diameter_of(d, i)*ratio(1)**a*ratio(2)**b
        least = min(least, size)
        step = min(step, time_factor(group%mass, kept, size/diameter_of(d, i), a + b))
        if (size > group%smallest) then
          group%generations = max(group%generations, a + b + 1)
          number(a + 1, b) = number(a + 1, b) + each(1)*number(a, b)
          number(a, b + 1) = number(a, b + 1) + each(2)*number(a, b)
        else
          group%grains = group%grains + number(a, b)
        end if
      end do
    end do
    group%least = min(group%least, least)
    group%step = min(group%step, rayleigh_of(d, i)*step)
  end subroutine foresee_grain

  !> Rayleigh time of a fragment over that of the grain of the start.
  pure real(wp) function time_factor(mass, kept, ratio, generation) result(factor)
    integer(i4), intent(in) :: mass        !! of dem_breakage_masses
    real(wp), intent(in) :: kept, ratio    !! of the volume in a generation, of the diameter [-]
    integer(i4), intent(in) :: generation
    factor = ratio
    if (mass == mass_solid .or. generation == 0) return
    factor = ratio*sqrt(density_factor(mass, kept**merge(generation, 1, mass == mass_parent), &
                                       ratio))
  end function time_factor

  !> Sizes of the fragments of a family, of the grain's, and how many of each.
  pure subroutine ratios_of(family, exponent, ratio, each)
    integer(i4), intent(in) :: family
    real(wp), intent(in) :: exponent
    real(wp), intent(out) :: ratio(2), each(2)
    real(wp) :: place
    ratio = 1.0_wp
    each = [real(family_count(family), wp), 0.0_wp]
    if (family == family_halves) &
      ratio = (0.5_wp*half_axis**(2.0_wp/exponent))**(1.0_wp/3.0_wp)
    if (family /= family_fourteen) return
    call family_radii(exponent, ratio, place)
    each = [6.0_wp, 8.0_wp]
  end subroutine ratios_of

  !> One line for the log.
  function text(self)
    class(breakage_type), intent(in) :: self
    character(len=:), allocatable :: text
    text = self%name//": '"//trim(criterion_names(self%criterion))//"', '"// &
      trim(family_names(self%family))//"'"
    if (self%criterion == criterion_hertz) text = text//' (the force at the strength goes with '// &
      '1/E*^2: softened grains want another strength)'
    if (self%regrow > 0.0_wp) text = text//', fragments grow in '//short_number(self%regrow)//' s'
    if (.not. self%grains > 0.0_wp) return
    text = text//', '//str(self%generations)// &
      trim(merge(' generation ', ' generations', self%generations == 1))//' at most: '// &
      short_number(self%grains)//' grains down to '//short_number(self%least)// &
      ' m, with a Rayleigh time of '//short_number(self%step)//' s'
  end function text
end module dem_breakage_group
