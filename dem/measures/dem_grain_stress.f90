!> Stress of single grains, by which they break: the largest force over a nominal area, the largest
!! contact pressure, or the octahedral stress (theory-dem, Breakage of grains).
!!
!! Forces are the elastic ones of the last evaluation, from the history of touched blocks.
!! eq. D.27
module dem_grain_stress
  use talus_kinds, only: wp, i4
  use dem_contact, only: contact_point
  use dem_ellipsoid, only: rotation_of, shape_matrix, matrix_times
  use dem_law_registry, only: place_of_memory
  use dem_shape_state, only: shape_ellipsoid
  use dem_state, only: dem_data_type, dem_law_type, kind_free, kind_ghost, lanes, &
    history_size, history_side, history_root
  use dem_surface_state, only: surface_membrane
  implicit none
  private
  public :: grain_stress_type, find_stresses, spare_safe, nominal_area, octahedral_of
  public :: criterion_names, criterion_none, criterion_nominal, criterion_hertz, &
    criterion_octahedral

  integer(i4), parameter :: criterion_none = 0, criterion_nominal = 1, criterion_hertz = 2, &
                            criterion_octahedral = 3
  character(len=10), parameter :: criterion_names(3) = [character(len=10) :: 'nominal', 'hertz', &
    'octahedral']
  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: rounding = 1.0e-9_wp  !! of areas and forces, amply

  !> What grains bear.
  type :: grain_stress_type
    real(wp), allocatable :: stress(:)     !! (grains) of the criterion; 0 without one [Pa]
    real(wp), allocatable :: force(:)      !! (grains) largest elastic normal force [N]
    real(wp), allocatable :: toward(:, :)  !! (3, grains) from the centre to where it acts [m]
    real(wp), allocatable :: tensor(:, :)  !! (6, grains) sum f r, if asked for [J]
    real(wp), allocatable :: force_below(:)     !! (grains) forces of no interest [N]
    real(wp), allocatable :: pressure_below(:)  !! (grains) contact pressures of no interest [Pa]
    real(wp), allocatable :: load_below(:)      !! (grains) sums of forces of no interest [N]
  end type grain_stress_type

  !> A contact as one of its grains sees it.
  type :: load_type
    real(wp) :: force      !! elastic normal force [N]
    real(wp) :: plain      !! the same of this point alone, whatever its sign [N]
    real(wp) :: patch      !! square of the radius of the area [m^2]
    real(wp) :: push(3)    !! with that of the tangential spring, on the grain [N]
    real(wp) :: arm(3)     !! contact point from the grain's centre [m]
  end type load_type

contains

  !> Stresses of all free and prescribed grains whose material has a criterion; of those that
  !! spare_safe knows to be safe under all their contacts, nothing.
  subroutine find_stresses(d, criterion, found)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:)  !! (materials) criterion_...
    type(grain_stress_type), intent(inout) :: found
    integer(i4) :: k, i

    call make_room(found, d%grains%n, any(criterion == criterion_octahedral))
    if (any(criterion == criterion_octahedral)) call spare_lightly_loaded(d, criterion, found)
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      if (criterion(block_material(d, k)) + criterion(d%pairs%law_second(k)) == 0) cycle
      call add_block(d, criterion, k, found)
    end do
    if (d%surfaces%list%near > 0) call add_surfaces(d, criterion, found)
    if (.not. any(criterion == criterion_octahedral)) return
    do i = 1, d%grains%n
      if (criterion(d%grains%material(i)) /= criterion_octahedral) cycle
      if (.not. any(abs(found%tensor(:, i)) > 0.0_wp)) cycle
      found%stress(i) = octahedral_of(found%tensor(:, i), d%grains%axes(:, i))
    end do
  end subroutine find_stresses

  !> Loads of a block's contacts on their grains.
  subroutine add_block(d, criterion, k, found)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:), k
    type(grain_stress_type), intent(inout) :: found
    type(load_type) :: load, other
    real(wp) :: force, side, root, patch, hertz, kn
    integer(i4) :: lane, i, j
    logical :: known

    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
      known = allocated(found%force_below) .and. .not. associated(law%base%response)
      hertz = 4.0_wp/3.0_wp*law%e_star
      kn = law%kn
    end associate
    do lane = 1, lanes
      side = d%pairs%history(lane, history_side, k)
      if (.not. side > 0.0_wp) cycle
      i = d%pairs%first(lane, k)
      j = d%pairs%grain(d%pairs%second(lane, k))
      if (known) then
        root = d%pairs%history(lane, history_root, k)
        patch = pi*(root*side)**2
        force = (hertz*root*side + kn)*side*side &
                *d%pairs%weight(lane, min(k, size(d%pairs%weight, 2)))
        if (is_safe(i, force, patch, found) .and. is_safe(j, force, patch, found)) cycle
      end if
      call read_pair(d, lane, k, load, other)
      if (i <= d%grains%n) call add_load(d, criterion, i, load, found)
      call add_load(d, criterion, j, other, found)
    end do
  end subroutine add_block

  !> Grains that all their forces together would leave below their strength, whatever their
  !! directions, are passed over in this look.
  subroutine spare_lightly_loaded(d, criterion, found)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:)  !! (materials) criterion_...
    type(grain_stress_type), intent(inout) :: found
    real(wp) :: load(d%grains%n)
    integer(i4) :: k, g, i

    if (.not. allocated(found%load_below)) return
    load = 0.0_wp
    do k = 1, d%pairs%blocks
      if (.not. d%pairs%touched(k)) cycle
      if (criterion(block_material(d, k)) == criterion_octahedral .or. &
          criterion(d%pairs%law_second(k)) == criterion_octahedral) call add_sizes(d, k, load)
    end do
    do g = 1, d%surfaces%list%near
      if (d%surfaces%list%contacts(g) > 0) load(d%surfaces%list%near_grain(g)) = huge(1.0_wp)
    end do
    do i = 1, d%grains%n
      if (criterion(d%grains%material(i)) /= criterion_octahedral) cycle
      found%force_below(i) = merge(huge(1.0_wp), 0.0_wp, load(i) <= found%load_below(i))
    end do
  end subroutine spare_lightly_loaded

  !> Sizes of the forces of a block's contacts to the sums of their grains [N]; those of laws with a
  !! response of their own are not known here.
  pure subroutine add_sizes(d, k, load)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k
    real(wp), intent(inout) :: load(:)
    real(wp) :: size_of(lanes), side(lanes), hertz, kn
    integer(i4) :: lane, i, j

    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)), &
               h => d%pairs%history(:, :, k))
      hertz = 4.0_wp/3.0_wp*law%e_star
      kn = law%kn
      side = h(:, history_side)
      size_of = (hertz*h(:, history_root)*side + kn)*side*side &
                + sqrt(h(:, 1)**2 + h(:, 2)**2 + h(:, 3)**2)
      size_of = size_of*d%pairs%weight(:, min(k, size(d%pairs%weight, 2)))
      if (associated(law%base%response)) size_of = huge(1.0_wp)/real(lanes*d%grains%n, wp)
    end associate
    do lane = 1, lanes
      if (.not. side(lane) > 0.0_wp) cycle
      i = d%pairs%first(lane, k)
      j = d%pairs%grain(d%pairs%second(lane, k))
      if (i <= d%grains%n) load(i) = load(i) + size_of(lane)
      load(j) = load(j) + size_of(lane)
    end do
  end subroutine add_sizes

  !> Is a force of no interest to a body? Planes are behind the grains.
  pure logical function is_safe(i, force, patch, found)
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: force, patch  !! [N], area of the contact [m^2]
    type(grain_stress_type), intent(in) :: found
    is_safe = .true.
    if (i > size(found%force_below)) return
    is_safe = force <= found%force_below(i) .and. force <= patch*found%pressure_below(i)
  end function is_safe

  !> Contacts that leave a grain below this stress, wherever they are, are passed over from now on:
  !! no nominal area is less than 4 times the product of the two least semi-axes.
  subroutine spare_safe(found, d, criterion, least)
    type(grain_stress_type), intent(inout) :: found
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:)  !! (materials) criterion_...
    real(wp), intent(in) :: least(:)         !! (grains) [Pa]
    real(wp) :: axes(3)
    integer(i4) :: i

    if (allocated(found%force_below)) deallocate (found%force_below, found%pressure_below, &
                                                 found%load_below)
    allocate (found%force_below(d%grains%n), found%pressure_below(d%grains%n), &
              found%load_below(d%grains%n), source=huge(1.0_wp))
    do i = 1, d%grains%n
      if (least(i) >= huge(1.0_wp)) cycle
      axes = d%grains%axes(:, i)
      if (d%grains%shapes%in_use) axes = d%grains%shapes%axes(:, i)
      select case (criterion(d%grains%material(i)))
      case (criterion_nominal)
        found%force_below(i) = least(i)*4.0_wp*product(axes)/maxval(axes)*(1.0_wp - rounding)
      case (criterion_hertz)
        found%pressure_below(i) = least(i)*(1.0_wp - rounding)
      case (criterion_octahedral)
        found%force_below(i) = 0.0_wp
        found%load_below(i) = least(i)/most_octahedral(d%grains%axes(:, i), d%grains%radius(i))
      end select
    end do
  end subroutine spare_safe

  !> Material of the first bodies of a block; planes have none that breaks.
  pure integer(i4) function block_material(d, k) result(material)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k
    material = d%pairs%law_second(k)
    if (k <= d%pairs%grain_blocks) material = d%pairs%law_first(k)
  end function block_material

  subroutine make_room(found, n, tensor)
    type(grain_stress_type), intent(inout) :: found
    integer(i4), intent(in) :: n
    logical, intent(in) :: tensor
    if (allocated(found%stress)) then
      if (size(found%stress) /= n .or. size(found%tensor, 2) /= merge(n, 0_i4, tensor)) &
        deallocate (found%stress, found%force, found%toward, found%tensor)
    end if
    if (.not. allocated(found%stress)) &
      allocate (found%stress(n), found%force(n), found%toward(3, n), &
                found%tensor(6, merge(n, 0_i4, tensor)))
    found%stress = 0.0_wp
    found%force = 0.0_wp
    if (tensor) found%tensor = 0.0_wp
  end subroutine make_room

  !> The contact in a lane, from both sides.
  pure subroutine read_pair(d, lane, k, first, second)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    type(load_type), intent(out) :: first, second
    real(wp) :: branch(3), normal(3), none(0), weight, history(history_size)
    integer(i4) :: range(2)

    history = d%pairs%history(lane, :, k)
    associate (law => d%laws(d%pairs%law_first(k), d%pairs%law_second(k)))
      weight = d%pairs%weight(lane, min(k, size(d%pairs%weight, 2)))
      if (law%base%reals > 0) then
        range = place_of_memory(law, d%pairs%additional)
        second%force = weight*elastic_force(law, history, &
                                            d%pairs%additional%kept(lane, range(1):range(2), k))
      else
        second%force = weight*elastic_force(law, history, none)
      end if
      branch = d%pairs%body(1:3, d%pairs%second(lane, k)) &
               - d%pairs%body(1:3, d%pairs%first(lane, k))
      normal = d%pairs%normal(lane, :, k)
      if (d%pairs%round(k)) normal = branch/norm2(branch)
      second%patch = (history(history_root)*history(history_side))**2
      second%push = second%force*normal + weight*history(1:3)
      second%plain = second%force
      first = second
      first%push = -second%push
      first%arm = contact_point(d%pairs, law%share, lane, k)
      second%arm = first%arm - branch
    end associate
  end subroutine read_pair

  !> Elastic normal force of a contact [N].
  pure real(wp) function elastic_force(law, history, memory) result(force)
    type(dem_law_type), intent(in) :: law
    real(wp), intent(in) :: history(history_size), memory(:)
    real(wp) :: response(3), overlap
    if (associated(law%base%response)) then
      response = law%base%response(law%law_numbers_type, memory)
      force = response(3)
    else
      overlap = history(history_side)**2
      force = overlap*(4.0_wp/3.0_wp*law%e_star*history(history_root)*history(history_side) &
                       + law%kn)
    end if
  end function elastic_force

  !> Contacts with surfaces.
  subroutine add_surfaces(d, criterion, found)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:)
    type(grain_stress_type), intent(inout) :: found
    type(load_type), allocatable :: load(:)
    integer(i4) :: g, k, i, first

    first = huge(1_i4)
    if (allocated(d%surfaces%membranes)) &
      first = d%surfaces%first_part(findloc(d%surfaces%kind, surface_membrane, 1))
    do g = 1, d%surfaces%list%near
      i = d%surfaces%list%near_grain(g)
      if (criterion(d%grains%material(i)) == criterion_none) cycle
      load = [(surface_load(d, k, g), k=1, d%surfaces%list%contacts(g))]
      if (first < huge(first) .and. criterion(d%grains%material(i)) == criterion_nominal) &
        call join_loads(d, g, first, load)
      do k = 1, size(load)
        call add_load(d, criterion, i, load(k), found)
      end do
    end do
  end subroutine add_surfaces

  !> A membrane that lies around a grain touches it at many points of one patch: each of them stands
  !! for the sum of those on its side, at their mean place.
  !! eq. D.73
  pure subroutine join_loads(d, g, first, load)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: g      !! near grain
    integer(i4), intent(in) :: first  !! part of a membrane
    type(load_type), intent(inout) :: load(:)
    type(load_type) :: point(size(load))
    real(wp) :: normal(3), other(3), total(7), force
    integer(i4) :: k, j

    point = load
    associate (list => d%surfaces%list)
      do k = 1, size(load)
        if (list%part(k, g) < first .or. list%sign(k, g) < 0.0_wp) cycle
        normal = list%normal(k, :, g)
        total = 0.0_wp
        do j = 1, size(load)
          other = list%normal(j, :, g)
          if (list%part(j, g) /= list%part(k, g) .or. dot_product(normal, other) <= 0.0_wp) cycle
          force = list%sign(j, g)*point(j)%plain
          total = total + force*[other, point(j)%arm, 1.0_wp]
        end do
        load(k)%force = norm2(total(1:3))
        if (total(7) > 0.0_wp) load(k)%arm = total(4:6)/total(7)
      end do
    end associate
  end subroutine join_loads

  !> Contact k of near grain g.
  pure function surface_load(d, k, g) result(load)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: k, g
    type(load_type) :: load
    real(wp) :: none(0), history(history_size)
    integer(i4) :: i, range(2)

    i = d%surfaces%list%near_grain(g)
    history = d%surfaces%list%history(k, :, g)
    associate (law => d%laws(d%surfaces%material(d%surfaces%list%part(k, g)), &
                             d%grains%material(i)))
      if (law%base%reals > 0) then
        range = place_of_memory(law, d%pairs%additional)
        load%force = elastic_force(law, history, d%surfaces%list%kept(k, range(1):range(2), g))
      else
        load%force = elastic_force(law, history, none)
      end if
    end associate
    load%plain = load%force
    load%patch = (history(history_root)*history(history_side))**2
    load%push = load%force*d%surfaces%list%normal(k, :, g) + history(1:3)
    load%arm = d%surfaces%list%point(k, :, g) - d%pairs%body(1:3, i)
    if (d%surfaces%list%sign(k, g) >= 0.0_wp) return
    load%push = d%surfaces%list%sign(k, g)*load%push  ! taken off again at an edge
    load%force = 0.0_wp
  end function surface_load

  !> A load on grain i.
  pure subroutine add_load(d, criterion, i, load, found)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: criterion(:), i
    type(load_type), intent(in) :: load
    type(grain_stress_type), intent(inout) :: found
    real(wp) :: this

    if (all(d%grains%kind(i) /= [kind_free, kind_ghost])) return
    select case (criterion(d%grains%material(i)))
    case (criterion_nominal)
      this = load%force/grain_area(d, i, load%arm)
    case (criterion_hertz)
      this = load%plain/(pi*load%patch)
    case (criterion_octahedral)
      this = 0.0_wp
      found%tensor(:, i) = found%tensor(:, i) + symmetric_product(load%push, load%arm)
    case default
      return
    end select
    found%stress(i) = max(found%stress(i), this)
    if (load%force <= found%force(i)) return
    found%force(i) = load%force
    found%toward(:, i) = load%arm
  end subroutine add_load

  !> Nominal area of grain i under a load along a vector [m^2].
  pure real(wp) function grain_area(d, i, arm) result(area)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: arm(3)
    real(wp) :: axes(3)
    axes = d%grains%axes(:, i)
    if (d%grains%shapes%in_use) then
      if (d%grains%shapes%kind(i) /= shape_ellipsoid) then
        axes = d%grains%shapes%axes(:, i)
        area = nominal_area(shape_matrix(rotation_of(d%grains%shapes%record(1:4, i)), axes), axes, &
                            arm)
        return
      end if
    end if
    if (maxval(axes) <= minval(axes)) then
      area = 4.0_wp*axes(1)**2
    else
      area = nominal_area(d%pairs%body(10:15, i), axes, arm)
    end if
  end function grain_area

  !> Square of the diameter of the circle as large as the smallest central section through a line:
  !! 4abc/sqrt(lambda), lambda the larger eigenvalue of A = Q diag(a^2,b^2,c^2) Q^T in the plane
  !! across the line [m^2].
  pure real(wp) function nominal_area(a, axes, line) result(area)
    real(wp), intent(in) :: a(6)     !! A as xx yy zz xy yz zx [m^2]
    real(wp), intent(in) :: axes(3)  !! [m]
    real(wp), intent(in) :: line(3)  !! of any length
    real(wp) :: u(3), cofactor(6), trace, minor
    u = line/norm2(line)
    cofactor = [a(2)*a(3) - a(5)**2, a(1)*a(3) - a(6)**2, a(1)*a(2) - a(4)**2, &
                a(5)*a(6) - a(3)*a(4), a(4)*a(6) - a(1)*a(5), a(4)*a(5) - a(2)*a(6)]
    trace = a(1) + a(2) + a(3) - dot_product(u, matrix_times(a, u))
    minor = dot_product(u, matrix_times(cofactor, u))
    area = 4.0_wp*product(axes) &
           /sqrt(0.5_wp*(trace + sqrt(max(trace*trace - 4.0_wp*minor, 0.0_wp))))
  end function nominal_area

  !> Octahedral stress over 0.9, F/d^2 of two opposite forces on a sphere [Pa].
  pure real(wp) function octahedral_of(tensor, axes) result(stress)
    real(wp), intent(in) :: tensor(6)  !! sum f r as xx yy zz xy yz zx [J]
    real(wp), intent(in) :: axes(3)    !! of an ellipsoid of the grain's volume [m]
    real(wp), parameter :: factor = 0.9_wp
    real(wp) :: t(6)
    t = tensor/(4.0_wp/3.0_wp*pi*product(axes))
    t(1:3) = t(1:3) - sum(t(1:3))/3.0_wp
    stress = sqrt((sum(t(1:3)**2) + 2.0_wp*sum(t(4:6)**2))/3.0_wp)/factor
  end function octahedral_of

  !> Octahedral stress over 0.9 of a unit force anywhere within a radius, at most: the deviator of
  !! its f r is sqrt(2/3) f r, where both are parallel [1/m^2].
  pure real(wp) function most_octahedral(axes, radius) result(stress)
    real(wp), intent(in) :: axes(3)  !! of an ellipsoid of the grain's volume [m]
    real(wp), intent(in) :: radius   !! of the sphere around the grain [m]
    real(wp), parameter :: amply = 1.1_wp  !! contact points are in both grains but for rounding
    stress = octahedral_of([amply*radius, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], axes)
  end function most_octahedral

  !> Symmetric part of f r as xx yy zz xy yz zx.
  pure function symmetric_product(f, r) result(t)
    real(wp), intent(in) :: f(3), r(3)
    real(wp) :: t(6)
    t = [f(1)*r(1), f(2)*r(2), f(3)*r(3), 0.5_wp*(f(1)*r(2) + f(2)*r(1)), &
         0.5_wp*(f(2)*r(3) + f(3)*r(2)), 0.5_wp*(f(3)*r(1) + f(1)*r(3))]
  end function symmetric_product
end module dem_grain_stress
