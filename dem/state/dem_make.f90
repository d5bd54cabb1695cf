!> Grains from bare data: sorted by id, checked, with mass, inertia and work arrays.
module dem_make
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_repeated_errors, only: repeated_errors_type
  use dem_coincident, only: check_centres, order_along
  use dem_state, only: dem_grains_type, dem_planes_type, dem_material_type, kind_free, kind_fixed, &
    kind_mirror, kind_member
  implicit none
  private
  public :: make_grains, make_planes, sorted_order, allocate_grains, prescribe_some, &
    is_prescribed

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: least_axis = 1.0e-60_wp  !! m; mass and inertia of less are no numbers

contains

  !> Fill `grains` from arrays in any order; faults name the grain (I210 to
  !! I214, I237).
  subroutine make_grains(grains, materials, id, kind, material, x, quat, axes, v, omega, errors)
    type(dem_grains_type), intent(out) :: grains
    type(dem_material_type), intent(in) :: materials(:)
    integer(i8), intent(in) :: id(:)
    integer(i4), intent(in) :: kind(:), material(:)
    real(wp), intent(in) :: x(:, :)      !! (3, n) [m]
    real(wp), intent(in) :: quat(:, :)   !! (4, n) w, x, y, z
    real(wp), intent(in) :: axes(:, :)   !! (3, n) semi-axes [m]
    real(wp), intent(in) :: v(:, :)      !! (3, n) [m/s]
    real(wp), intent(in) :: omega(:, :)  !! (3, n) space frame [rad/s]
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: order(:)
    integer(i4) :: i, k
    real(wp) :: axis(3), q(4)

    call check_grains(id, kind, material, size(materials), x, quat, axes, v, omega, errors)
    if (errors%any()) return
    call check_centres(id, merge(kind_fixed, kind, kind == kind_member), x, axes, &
                       sorted_order(order_along(x)), errors)
    if (errors%any()) return
    grains%n = size(id)
    call allocate_grains(grains, any(is_prescribed(kind)))
    order = sorted_order(id)
    do i = 1, grains%n
      k = order(i)
      if (i > 1) then
        if (id(k) == id(order(i - 1))) then
          call errors%add('I213', 'grain id '//str(id(k))//' is given twice', &
                          hint='ids of a packing must differ')
          return
        end if
      end if
      axis = axes(:, k)
      q = quat(:, k)/sqrt(sum(quat(:, k)**2))
      grains%id(i) = id(k)
      grains%kind(i) = kind(k)
      grains%material(i) = material(k)
      grains%x(:, i) = x(:, k)
      grains%quat(:, i) = q
      grains%v(:, i) = v(:, k)
      grains%omega(:, i) = omega(:, k)
      grains%axes(:, i) = axis
      grains%radius(i) = maxval(axis)
      grains%mass(i) = materials(material(k))%density*4.0_wp/3.0_wp*pi*product(axis)
      grains%inertia(:, i) = 0.2_wp*grains%mass(i)*(sum(axis**2) - axis**2)
    end do
  end subroutine make_grains

  !> Faults I210 to I214 of every grain, the first few of each.
  subroutine check_grains(id, kind, material, n_materials, x, quat, axes, v, omega, errors)
    integer(i8), intent(in) :: id(:)
    integer(i4), intent(in) :: kind(:), material(:), n_materials
    real(wp), intent(in) :: x(:, :), quat(:, :), axes(:, :), v(:, :), omega(:, :)
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: hint = 'make the packing again or correct the file'
    type(repeated_errors_type) :: few
    character(len=:), allocatable :: who
    integer(i4) :: k

    do k = 1, size(id)
      who = 'grain '//str(id(k))//': '
      if (.not. is_within([x(:, k), v(:, k), omega(:, k)])) then
        call few%add('I210', who//'position, velocity or spin is not a number, or beyond all '// &
                     'models: '//str([x(:, k), v(:, k), omega(:, k)]), hint, errors)
      end if
      if (.not. all(axes(:, k) > least_axis .and. axes(:, k) < 1.0_wp/least_axis)) then
        call few%add('I211', who//'semi-axes must be positive, got '//str(axes(:, k)), hint, errors)
      end if
      if (id(k) < 1 .or. id(k) > huge(1_i4)) then
        call few%add('I213', 'grain id '//str(id(k))//' is not from 1 to '//str(huge(1_i4)), &
                     'decks and ports name grains by ids', errors)
      end if
      if (.not. is_unit(quat(:, k))) then
        call few%add('I212', who//'orientation is no unit quaternion: '//str(quat(:, k)), &
                     'order w, x, y, z, length 1', errors)
      end if
      if (all(kind(k) /= [0_i4, 1_i4, 2_i4, 3_i4, kind_member]) .or. material(k) < 1 .or. &
          material(k) > n_materials) then
        call few%add('I214', who//'unknown kind '//str(kind(k))//' or material '// &
                     str(material(k)), 'kinds: 0 free, 1 fixed, 2 driven', errors)
      end if
    end do
    call few%finish('grains', errors)
  end subroutine check_grains

  !> Numbers whose squares and products stay numbers.
  pure logical function is_within(values)
    real(wp), intent(in) :: values(:)
    real(wp), parameter :: most = 1.0e12_wp
    is_within = all(is_finite(values))
    if (is_within) is_within = all(abs(values) < most)
  end function is_within

  !> A quaternion of length 1, to 5e-4; far from it nothing is squared.
  pure logical function is_unit(quat)
    real(wp), intent(in) :: quat(4)
    is_unit = all(abs(quat) < 2.0_wp)
    if (is_unit) is_unit = abs(sum(quat**2) - 1.0_wp) < 1.0e-3_wp
  end function is_unit

  !> Arrays for g%n grains.
  subroutine allocate_grains(g, prescribed)
    type(dem_grains_type), intent(inout) :: g
    logical, intent(in) :: prescribed  !! some are
    integer(i4) :: n
    n = g%n
    allocate (g%id(n), source=0_i8)
    allocate (g%kind(n), g%material(n), source=0_i4)
    allocate (g%x(3, n), g%v(3, n), g%omega(3, n), g%axes(3, n), g%inertia(3, n), source=0.0_wp)
    allocate (g%force(3, n), g%moment(3, n), g%theta(3, n), g%quat(4, n), source=0.0_wp)
    allocate (g%extra_force(3, n), g%extra_moment(3, n), source=0.0_wp)
    allocate (g%radius(n), g%mass(n), source=0.0_wp)
    call allocate_prescribed(g, merge(n, 0_i4, prescribed))
  end subroutine allocate_grains

  !> Does something else than forces move grains of this kind?
  elemental logical function is_prescribed(kind)
    integer(i4), intent(in) :: kind
    is_prescribed = kind /= kind_free .and. kind /= kind_mirror .and. kind /= kind_member
  end function is_prescribed

  !> Arrays of what only prescribed grains have, from now on if there were none.
  subroutine prescribe_some(g)
    type(dem_grains_type), intent(inout) :: g
    if (size(g%work) == g%n) return
    deallocate (g%impulse, g%moment_impulse, g%work, g%target_x, g%target_quat, g%turn, &
                g%has_target)
    call allocate_prescribed(g, g%n)
  end subroutine prescribe_some

  subroutine allocate_prescribed(g, n)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: n
    allocate (g%impulse(3, n), g%moment_impulse(3, n), g%work(n), source=0.0_wp)
    allocate (g%target_x(3, n), g%target_quat(4, n), g%turn(4, n), source=0.0_wp)
    allocate (g%has_target(n), source=.false.)
    g%turn(1, :) = 1.0_wp
  end subroutine allocate_prescribed

  !> Planes from points, normals (any length), velocities and materials.
  subroutine make_planes(planes, point, normal, velocity, material)
    type(dem_planes_type), intent(out) :: planes
    real(wp), intent(in) :: point(:, :), normal(:, :), velocity(:, :)  !! (3, n)
    integer(i4), intent(in) :: material(:)
    integer(i4) :: k, n

    n = size(material)
    planes%n = n
    allocate (planes%material, source=material)
    allocate (planes%point(3, n), planes%normal(3, n), planes%velocity(3, n), source=0.0_wp)
    allocate (planes%force(3, n), planes%moment(3, n), planes%impulse(3, n), source=0.0_wp)
    allocate (planes%work(n), source=0.0_wp)
    do k = 1, n
      planes%point(:, k) = point(:, k)
      planes%normal(:, k) = normal(:, k)/sqrt(sum(normal(:, k)**2))
      planes%velocity(:, k) = velocity(:, k)
    end do
  end subroutine make_planes

  !> Order that sorts keys upwards (merge sort, stable).
  pure function sorted_order(keys) result(order)
    integer(i8), intent(in) :: keys(:)
    integer(i4), allocatable :: order(:), other(:)
    integer(i4) :: n, width, low, middle, high, k

    n = size(keys)
    allocate (order(n), other(n))
    order = [(k, k=1, n)]
    width = 1
    do while (width < n)
      low = 1
      do while (low <= n)
        middle = min(low + width, n + 1)
        high = min(low + 2*width, n + 1)
        call merge_runs(keys, order(low:middle - 1), order(middle:high - 1), other(low:high - 1))
        low = high
      end do
      order = other
      width = 2*width
    end do
  end function sorted_order

  !> Two sorted runs become one; of equal keys that of the first run comes first.
  pure subroutine merge_runs(keys, first, second, merged)
    integer(i8), intent(in) :: keys(:)
    integer(i4), intent(in) :: first(:), second(:)
    integer(i4), intent(out) :: merged(:)
    integer(i4) :: a, b, k
    logical :: take_first

    a = 1
    b = 1
    do k = 1, size(merged)
      take_first = a <= size(first)
      if (take_first .and. b <= size(second)) take_first = keys(first(a)) <= keys(second(b))
      if (take_first) then
        merged(k) = first(a)
        a = a + 1
      else
        merged(k) = second(b)
        b = b + 1
      end if
    end do
  end subroutine merge_runs
end module dem_make
