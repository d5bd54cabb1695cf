!> From the deck: materials, contact laws of every pair that can meet, walls. Faults D230 to D238.
module dem_setup_laws
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use talus_suggest, only: did_you_mean
  use dem_state, only: dem_material_type, dem_law_type, dem_planes_type
  use dem_additional_model, only: additional_model_type
  use dem_additional_numbers, only: most_models
  use dem_additional_registry, only: list_models
  use dem_law, only: make_law, mirrored_law, damping_ratio_for, restitution_of
  use dem_make, only: make_planes
  implicit none
  private
  public :: read_materials, read_contacts, read_walls, check_pair, material_index, law_lines

contains

  !> Materials of the deck; a name given twice is a fault (D230).
  subroutine read_materials(deck, materials, names, errors)
    type(deck_type), intent(in) :: deck
    type(dem_material_type), allocatable, intent(out) :: materials(:)
    type(string_type), allocatable, intent(out) :: names(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, j, n

    n = deck%count('material')
    allocate (materials(n), names(n))
    do k = 1, n
      call deck%get('material', k, 'id', names(k)%s)
      call deck%get('material', k, 'young', materials(k)%young)
      call deck%get('material', k, 'poisson', materials(k)%poisson)
      call deck%get('material', k, 'density', materials(k)%density)
      do j = 1, k - 1
        if (names(j)%s /= names(k)%s) cycle
        call deck%fault(errors, 'D230', "two materials are named '"//names(k)%s//"'", 'material', &
                        k, 'id', 'give each material its own id')
      end do
    end do
  end subroutine read_materials

  !> Numbers of the materials that a key names; an unknown name is a fault there (D231) and gives 0.
  subroutine find_materials(deck, names, group, instance, key, number, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    integer(i4), intent(out) :: number(:)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: given(:)
    integer(i4) :: k, j

    if (size(number) > 1) then
      call deck%get(group, instance, key, given)
    else
      allocate (given(1))
      call deck%get(group, instance, key, given(1)%s)
    end if
    number = 0
    do j = 1, size(number)
      do k = size(names), 1, -1
        if (names(k)%s == given(j)%s) number(j) = k
      end do
      if (number(j) == 0) &
        call deck%fault(errors, 'D231', "there is no material '"//given(j)%s//"'", group, &
                        instance, key, did_you_mean(given(j)%s, names, 'materials of this deck:'))
    end do
  end subroutine find_materials

  !> The same of one material.
  subroutine material_index(deck, names, group, instance, key, k, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)
    character(len=*), intent(in) :: group, key
    integer(i4), intent(in) :: instance
    integer(i4), intent(out) :: k
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: number(1)
    call find_materials(deck, names, group, instance, key, number, errors)
    k = number(1)
  end subroutine material_index

  !> Contact laws as a table over pairs of materials; kind 0 where the deck has none.
  subroutine read_contacts(deck, materials, names, laws, errors)
    type(deck_type), intent(in) :: deck
    type(dem_material_type), intent(in) :: materials(:)
    type(string_type), intent(in) :: names(:)
    type(dem_law_type), allocatable, intent(out) :: laws(:, :)
    type(error_list_type), intent(inout) :: errors
    type(dem_law_type) :: law
    integer(i4) :: k, a, b, before, pair(2)

    allocate (laws(size(materials), size(materials)))
    do k = 1, deck%count('contact')
      before = errors%count
      call find_materials(deck, names, 'contact', k, 'between', pair, errors)
      if (errors%count > before) cycle
      a = pair(1)
      b = pair(2)
      if (laws(a, b)%kind /= 0) then
        call deck%fault(errors, 'D232', "the contact of '"//names(a)%s//"' and '"//names(b)%s// &
                        "' is given twice", 'contact', k, 'between', &
                        'one group a pair; the order of the names does not matter')
        cycle
      end if
      call read_law(deck, k, materials(a), materials(b), law, errors)
      call read_additional(deck, k, law, errors)
      laws(a, b) = law
      if (a /= b) laws(b, a) = mirrored_law(law)
    end do
  end subroutine read_contacts

  subroutine read_law(deck, k, first, second, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_material_type), intent(in) :: first, second
    type(dem_law_type), intent(out) :: law
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, radius, area
    real(wp) :: friction, ratio, tangential, e

    call deck%get('contact', k, 'law', name)
    call deck%get('contact', k, 'friction', friction)
    call deck%get('contact', k, 'radius', radius)
    ratio = 0.0_wp
    if (deck%given('contact', k, 'restitution')) then
      call deck%get('contact', k, 'restitution', e)
      law = make_law(name, first, second, friction, ratio, ratio)
      ratio = damping_ratio_for(law%base%oscillator, e)
    else if (deck%given('contact', k, 'damping_ratio')) then
      call deck%get('contact', k, 'damping_ratio', ratio)
    end if
    tangential = ratio
    if (deck%given('contact', k, 'tangential_damping')) &
      call deck%get('contact', k, 'tangential_damping', tangential)
    law = make_law(name, first, second, friction, ratio, tangential)
    law%frozen = radius == 'frozen'
    call deck%get('contact', k, 'contact_area', area)
    law%elliptic = area == 'ellipse' .and. law%base%hertz
    if (associated(law%base%constants)) &
      call law%base%constants(deck, k, law%law_numbers_type, errors)
  end subroutine read_law

  !> Additional contact models.
  subroutine read_additional(deck, k, law, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_law_type), intent(inout) :: law
    type(error_list_type), intent(inout) :: errors
    type(additional_model_type) :: model(most_models)
    integer(i4) :: m, models

    call list_models(model, models)
    do m = 1, models
      if (.not. associated(model(m)%constants)) cycle
      call model(m)%constants(deck, k, law%law_numbers_type, law%additional%own(:, m), &
                              law%additional%acts(m), errors)
    end do
    law%additional%used = any(law%additional%acts)
  end subroutine read_additional

  !> A pair that can meet needs a law (D233).
  subroutine check_pair(deck, laws, names, a, b, why, errors)
    type(deck_type), intent(in) :: deck
    type(dem_law_type), intent(in) :: laws(:, :)
    type(string_type), intent(in) :: names(:)
    integer(i4), intent(in) :: a, b
    character(len=*), intent(in) :: why  !! who meets: 'grains and walls'
    type(error_list_type), intent(inout) :: errors

    if (a == 0 .or. b == 0) return
    if (laws(a, b)%kind /= 0) return
    call deck%fault(errors, 'D233', "no contact law for '"//names(a)%s//"' and '"//names(b)%s// &
                    "' ("//why//')', 'contact', 1, 'between', &
                    "add &contact between = '"//names(a)%s//"', '"//names(b)%s//"', ... /")
  end subroutine check_pair

  !> Walls of the deck as planes, and their names.
  subroutine read_walls(deck, names, planes, wall_names, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)
    type(dem_planes_type), intent(inout) :: planes
    type(string_type), allocatable, intent(out) :: wall_names(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: point(:, :), normal(:, :), velocity(:, :), values(:)
    integer(i4), allocatable :: material(:)
    integer(i4) :: k, j, n, before

    before = errors%count
    n = deck%count('wall')
    allocate (point(3, n), normal(3, n), velocity(3, n), material(n), wall_names(n))
    do k = 1, n
      call deck%get('wall', k, 'id', wall_names(k)%s)
      do j = 1, k - 1
        if (wall_names(j)%s == wall_names(k)%s) &
          call deck%fault(errors, 'D237', "two walls are named '"//wall_names(k)%s//"'", 'wall', &
                          k, 'id', 'give each wall its own id')
      end do
      call deck%get('wall', k, 'point', values)
      point(:, k) = values
      call deck%get('wall', k, 'velocity', values)
      velocity(:, k) = values
      call deck%get('wall', k, 'normal', values)
      normal(:, k) = values
      if (.not. sum(values**2) > 0.0_wp) &
        call deck%fault(errors, 'D238', 'the normal of a wall has no length', 'wall', k, 'normal', &
                        'give the direction that points into the grains')
      call material_index(deck, names, 'wall', k, 'material', material(k), errors)
    end do
    if (errors%count == before) call make_planes(planes, point, normal, velocity, material)
  end subroutine read_walls

  !> One line a contact law for the log: damping ratio and the restitution that it gives.
  subroutine law_lines(deck, laws, names, lines)
    type(deck_type), intent(in) :: deck
    type(dem_law_type), intent(in) :: laws(:, :)
    type(string_type), intent(in) :: names(:)
    type(string_type), allocatable, intent(out) :: lines(:)
    integer(i4) :: a, b, n

    allocate (lines(deck%count('contact')))
    n = 0
    do a = 1, size(laws, 1)
      do b = a, size(laws, 2)
        if (laws(a, b)%kind == 0 .or. n == size(lines)) cycle
        n = n + 1
        lines(n)%s = names(a)%s//' - '//names(b)%s//': friction '//str(laws(a, b)%friction)// &
          ', damping ratio '//short_number(laws(a, b)%damping_ratio)//', restitution '// &
          short_number(restitution_of(laws(a, b)%base%oscillator, laws(a, b)%damping_ratio))
      end do
    end do
  end subroutine law_lines
end module dem_setup_laws
