!> Groups body: surfaces that move freely in chosen directions. Faults D286 to D288.
module dem_setup_bodies
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: string_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use talus_vectors, only: cross
  use talus_suggest, only: did_you_mean
  use dem_shape_mass, only: diagonalise, quaternion_of
  use dem_surface_body, only: no_free_bodies, set_load, is_free
  use dem_surface_solid, only: encloses, solid_of_body
  use dem_surface_state, only: dem_surfaces_type, is_cylinder
  implicit none
  private
  public :: read_bodies

  real(wp), parameter :: near = 1.0e-6_wp  !! part of the size or the inertia that is none
  character(len=2), parameter :: direction(6) = ['x ', 'y ', 'z ', 'rx', 'ry', 'rz']

contains

  !> All groups body; s holds the surfaces in the order of the deck.
  subroutine read_bodies(deck, served, s, errors)
    type(deck_type), intent(in) :: deck
    logical, intent(in) :: served  !! a partner drives the run
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    if (deck%count('body') == 0) return
    if (served .or. deck%count('relaxation') > 0) &
      call deck%fault(errors, 'D288', 'bodies move freely in &dynamics, without a partner', &
                      'body', 1, '', 'take &dynamics in place of &relaxation, or give the '// &
                      'surface a velocity or a servo')
    if (s%n > 0) call no_free_bodies(s)
    do k = 1, deck%count('body')
      call read_body(deck, k, s, errors)
    end do
  end subroutine read_bodies

  subroutine read_body(deck, k, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: values(:)
    real(wp) :: free(6), load(6)
    integer(i4) :: b, j

    call find_body(deck, k, s, b, errors)
    if (b == 0) return
    call deck%get('body', k, 'free', names)
    free = 0.0_wp
    do j = 1, size(names)
      where (direction == names(j)%s) free = 1.0_wp
    end do
    s%rigid%free(:, b) = free
    if (deck%given('body', k, 'density')) call weigh(deck, k, b, s, errors)
    if (deck%given('body', k, 'mass')) call deck%get('body', k, 'mass', s%rigid%mass(b))
    if (deck%given('body', k, 'inertia')) then
      call deck%get('body', k, 'inertia', values)
      call take_inertia(deck, k, values, free, s%rigid%inertia(:, b), errors)
    end if
    call deck%get('body', k, 'force', values)
    load(:3) = values
    call deck%get('body', k, 'moment', values)
    load(4:) = values
    call set_load(s, b, load)
    call check_body(deck, k, s, b, errors)
  end subroutine read_body

  !> Mass and moments of inertia of body b from a density (D287); of one that turns about all three
  !! axes the principal moments and axes.
  subroutine weigh(deck, k, b, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, b
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    real(wp) :: density, volume, away(3), inertia(3, 3), mixed, axes(3, 3)
    integer(i4) :: j

    if (.not. encloses(s, b)) then
      call deck%fault(errors, 'D287', "surface '"//s%name(b)%s//"' encloses no volume", 'body', k, &
                      'density', 'a closed mesh or a cylinder with a length does; else give '// &
                      'mass and inertia')
      return
    end if
    call deck%get('body', k, 'density', density)
    call solid_of_body(s, b, volume, away, inertia)
    s%rigid%mass(b) = density*volume
    s%rigid%inertia(:, b) = [(density*inertia(j, j), j=1, 3)]
    if (norm2(away) > near*s%reach(b)) &
      call deck%fault(errors, 'D287', "the centre of surface '"//s%name(b)%s//"' is "// &
                      short_number(norm2(away))//' m beside its mass centre', 'body', k, &
                      'density', 'leave the centre of the surface out')
    mixed = max(abs(inertia(1, 2)), abs(inertia(1, 3)), abs(inertia(2, 3)))
    if (.not. all(s%rigid%free(4:, b) > 0.5_wp) .or. mixed <= near*maxval(abs(inertia))) return
    call principal_inertia(inertia, s%rigid%inertia(:, b), axes)
    s%rigid%inertia(:, b) = density*s%rigid%inertia(:, b)
    s%rigid%frame(:, b) = quaternion_of(axes)
  end subroutine weigh

  !> Principal moments, rising, and their axes as columns of a rotation: the splitting of a free
  !! rotation depends on the order of the axes, and shall not on how a body lies.
  subroutine principal_inertia(inertia, moment, axes)
    real(wp), intent(inout) :: inertia(3, 3)
    real(wp), intent(out) :: moment(3), axes(3, 3)
    integer(i4) :: order(3)

    call diagonalise(inertia, axes)
    moment = [inertia(1, 1), inertia(2, 2), inertia(3, 3)]
    order(1) = minloc(moment, 1)
    order(3) = maxloc(moment, 1, back=.true.)
    order(2) = 6 - order(1) - order(3)
    moment = moment(order)
    axes = axes(:, order)
    axes(:, 3) = cross(axes(:, 1), axes(:, 2))
  end subroutine principal_inertia

  !> The surface that a body names (D286).
  subroutine find_body(deck, k, s, b, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(out) :: b
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, other
    type(string_type) :: none(0)
    integer(i4) :: j

    call deck%get('body', k, 'surface', name)
    b = 0
    do j = 1, s%n
      if (s%name(j)%s == name) b = j
    end do
    if (b == 0) then
      if (s%n > 0) other = did_you_mean(name, s%name, 'surfaces of this deck:')
      if (s%n == 0) other = did_you_mean(name, none, 'surfaces of this deck: none')
      call deck%fault(errors, 'D286', "there is no surface '"//name//"'", 'body', k, 'surface', &
                      other)
      return
    end if
    if (is_free(s, b)) &
      call deck%fault(errors, 'D286', "surface '"//name//"' is named by two bodies", 'body', k, &
                      'surface', 'name all its free directions in one group')
    do j = 1, deck%count('servo')
      if (.not. deck%given('servo', j, 'surface')) cycle
      call deck%get('servo', j, 'surface', other)
      if (other == name) &
        call deck%fault(errors, 'D286', "surface '"//name//"' is a free body and has a servo", &
                        'body', k, 'surface', 'a given force is a force of the body: leave '// &
                        'the servo out')
    end do
  end subroutine find_body

  !> One moment of inertia for all free axes, or the three principal ones (D287).
  subroutine take_inertia(deck, k, values, free, inertia, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: values(:), free(6)
    real(wp), intent(out) :: inertia(3)
    type(error_list_type), intent(inout) :: errors

    inertia = values(1)
    if (size(values) == 3) inertia = values
    if (size(values) /= 3 .and. (size(values) /= 1 .or. nint(sum(free(4:))) == 3)) then
      call deck%fault(errors, 'D287', 'inertia is one number for one free axis, or three for '// &
                      'the axes x, y, z', 'body', k, 'inertia', 'give inertia = Ix, Iy, Iz')
    else if (.not. all(inertia > 0.0_wp)) then
      call deck%fault(errors, 'D287', 'a moment of inertia is not positive', 'body', k, &
                      'inertia', 'give moments in kg m2 above 0')
    else if (size(values) == 3 .and. 2.0_wp*maxval(inertia) > sum(inertia)*1.000001_wp) then
      call deck%fault(errors, 'D287', 'no body has these moments: the largest is more than the '// &
                      'sum of the others', 'body', k, 'inertia', 'a thin disc of radius R has '// &
                      'm R2/2 about its axis and m R2/4 across it')
    end if
  end subroutine take_inertia

  !> Free directions have a mass or an inertia, and one or three axes are free (D287).
  subroutine check_body(deck, k, s, b, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, b
    type(dem_surfaces_type), intent(in) :: s
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: axes
    real(wp) :: across(3)

    axes = nint(sum(s%rigid%free(4:, b)))
    if (any(s%rigid%free(:3, b) > 0.5_wp) .and. .not. s%rigid%mass(b) > 0.0_wp) &
      call deck%fault(errors, 'D287', 'a body that moves freely has no mass', 'body', k, '', &
                      'give mass = ... in kg or a density')
    if (axes > 0 .and. .not. (deck%given('body', k, 'inertia') .or. &
                              deck%given('body', k, 'density'))) &
      call deck%fault(errors, 'D287', 'a body that turns freely has no moment of inertia', &
                      'body', k, '', 'give inertia = ... in kg m2 or a density')
    if (axes == 2) &
      call deck%fault(errors, 'D287', 'a body turns freely about one axis or about all three', &
                      'body', k, 'free', 'name one of rx, ry, rz, or all of them')
    across = (1.0_wp - s%rigid%free(4:, b))*s%spin(:, b)
    if (axes == 1 .and. any(abs(across) > 0.0_wp)) &
      call deck%fault(errors, 'D287', "surface '"//s%name(b)%s//"' spins across its free axis", &
                      'body', k, 'free', 'leave that part of the spin out: the free axis would '// &
                      'turn with it')
    if (.not. is_cylinder(s, b) .or. s%round%extent(b) < huge(1.0_wp)) return
    if (sum(s%rigid%free(4:, b)*(1.0_wp - s%round%axis(:, b)**2)) > 1.0e-9_wp) &
      call deck%fault(errors, 'D287', 'a cylinder without ends turns about its axis alone', &
                      'body', k, 'free', 'give the cylinder a length')
  end subroutine check_body
end module dem_setup_bodies
