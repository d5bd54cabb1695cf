!> Shapes of grains: checks, records, mass, inertia and bounding spheres.
module dem_shape_make
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_repeated_errors, only: repeated_errors_type
  use dem_shape, only: shape_of, turned, at_centre, least_exponent, most_exponent
  use dem_shape_mass, only: shape_mass_type, mass_of_shape
  use dem_shape_state, only: allocate_shapes, shape_kind, shape_ellipsoid
  use dem_make, only: sorted_order
  use dem_ellipsoid, only: quaternion_product
  use dem_state, only: dem_grains_type, dem_material_type
  implicit none
  private
  public :: make_shapes, admit_shapes, scale_grain, octant_frames, most_slender

  real(wp), parameter :: most_skew = 0.8_wp    !! one half-axis nine times the other
  real(wp), parameter :: most_slender = 50.0_wp  !! greatest over least semi-axis
  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Forms of grains that make_grains has made as ellipsoids; nothing if all are. Arrays are in the
  !! order of `id`. Faults name the grain (I217, I218).
  subroutine make_shapes(grains, materials, id, skew, exponent, errors, always)
    type(dem_grains_type), intent(inout) :: grains
    type(dem_material_type), intent(in) :: materials(:)
    integer(i8), intent(in) :: id(:)
    real(wp), intent(in) :: skew(:, :)    !! (3, n) (upper - lower)/(upper + lower) [-]
    real(wp), intent(in) :: exponent(:)   !! (n) [-]
    type(error_list_type), intent(inout) :: errors
    logical, intent(in), optional :: always  !! also if all are ellipsoids: others may join them
    integer(i4), allocatable :: order(:)
    integer(i4) :: i, n
    logical :: needed

    call check_shapes(grains, id, skew, exponent, errors)
    if (errors%any()) return
    n = grains%n
    needed = any(abs(skew) > 0.0_wp) .or. any(exponent > least_exponent)
    if (present(always)) needed = needed .or. always
    if (.not. needed) return
    order = sorted_order(id)
    associate (f => grains%shapes)
      call allocate_shapes(f, n)
      f%skew = skew(:, order)
      f%exponent = exponent(order)
      f%axes = grains%axes
    end associate
    do i = 1, n
      call make_shape(grains, materials(grains%material(i))%density, i)
    end do
  end subroutine make_shapes

  !> Grains that are all ellipsoids get records beside which others may come to be.
  subroutine admit_shapes(grains, materials, errors)
    type(dem_grains_type), intent(inout) :: grains
    type(dem_material_type), intent(in) :: materials(:)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: even(3, grains%n), exponent(grains%n)
    if (grains%shapes%in_use) return
    even = 0.0_wp
    exponent = least_exponent
    call make_shapes(grains, materials, grains%id, even, exponent, errors, always=.true.)
  end subroutine admit_shapes

  !> One grain: its axes become those of an ellipsoid of the same volume, its orientation that of
  !! the principal frame.
  subroutine make_shape(g, density, i)
    type(dem_grains_type), intent(inout) :: g
    real(wp), intent(in) :: density  !! [kg/m^3]
    integer(i4), intent(in) :: i
    type(shape_mass_type) :: mass
    real(wp) :: upper(3), lower(3)

    associate (f => g%shapes)
      upper = f%axes(:, i)*(1.0_wp + f%skew(:, i))
      lower = f%axes(:, i)*(1.0_wp - f%skew(:, i))
      f%kind(i) = shape_kind(f%skew(:, i), f%exponent(i))
      if (f%kind(i) /= shape_ellipsoid) then
        mass = mass_of_shape(upper, lower, f%exponent(i))
        f%frame(:, i) = [mass%turn(1), -mass%turn(2:4)]
        f%reach(i) = mass%reach
        g%radius(i) = mass%radius
        g%mass(i) = density*mass%volume
        g%inertia(:, i) = density*mass%moment
        g%axes(:, i) = f%axes(:, i) &
                       *(mass%volume/(4.0_wp/3.0_wp*pi*product(f%axes(:, i))))**(1.0_wp/3.0_wp)
        g%quat(:, i) = quaternion_product(g%quat(:, i), mass%turn)
      end if
      f%record(:, i) = turned(shape_of(upper, lower, mass%centre, f%exponent(i)), &
                              quaternion_product(g%quat(:, i), f%frame(:, i)))
    end associate
  end subroutine make_shape

  !> Another size of grain i, whose mass and moments of inertia stay; its centre of mass, too.
  pure subroutine scale_grain(g, i, factor)
    type(dem_grains_type), intent(inout) :: g
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: factor  !! on all lengths [-]
    real(wp) :: centre(3)
    g%axes(:, i) = factor*g%axes(:, i)
    g%radius(i) = factor*g%radius(i)
    if (.not. g%shapes%in_use) return
    associate (f => g%shapes)
      f%axes(:, i) = factor*f%axes(:, i)
      f%reach(i) = factor*f%reach(i)
      centre = factor*f%record(at_centre:at_centre + 2, i)
      f%record(:, i) = turned(shape_of(f%axes(:, i)*(1.0_wp + f%skew(:, i)), &
                                       f%axes(:, i)*(1.0_wp - f%skew(:, i)), centre, &
                                       f%exponent(i)), f%record(1:4, i))
    end associate
  end subroutine scale_grain

  subroutine check_shapes(grains, id, skew, exponent, errors)
    type(dem_grains_type), intent(in) :: grains
    integer(i8), intent(in) :: id(:)
    real(wp), intent(in) :: skew(:, :), exponent(:)
    type(error_list_type), intent(inout) :: errors
    type(repeated_errors_type) :: few
    character(len=:), allocatable :: who
    integer(i4), allocatable :: order(:)
    real(wp) :: upper(3), lower(3)
    integer(i4) :: i, k

    allocate (order, source=sorted_order(id))
    do i = 1, grains%n
      k = order(i)
      who = 'grain '//str(id(k))//': '
      if (.not. all(abs(skew(:, k)) <= most_skew)) then
        call few%add('I217', who//'skew must lie within '//str(most_skew)//', got '// &
                     str(skew(:, k)), 'skew is (upper - lower)/(upper + lower) of the '// &
                     'semi-axes on both sides; both must be positive', errors)
        cycle
      end if
      if (.not. (exponent(k) >= least_exponent .and. exponent(k) <= most_exponent)) then
        call few%add('I218', who//'exponent must lie from '//str(least_exponent)//' to '// &
                     str(most_exponent)//', got '//str(exponent(k)), &
                     '2 is an ellipsoid; below it surfaces have edges, above corners', errors)
      end if
      if (shape_kind(skew(:, k), exponent(k)) == shape_ellipsoid) cycle
      upper = grains%axes(:, i)*(1.0_wp + skew(:, k))
      lower = grains%axes(:, i)*(1.0_wp - skew(:, k))
      if (maxval([upper, lower]) > most_slender*minval([upper, lower])) then
        call few%add('I217', who//'semi-axes '//str([upper, lower])//' m differ by more '// &
                     'than '//str(most_slender)//' times', 'such a form has '// &
                     'no well-defined contact: take a less slender one', errors)
      end if
    end do
    call few%finish('grains', errors)
  end subroutine check_shapes

  !> Orientations as files hold them: of the octants, not of the principal frame.
  pure function octant_frames(g) result(quat)
    type(dem_grains_type), intent(in) :: g
    real(wp) :: quat(4, g%n)
    integer(i4) :: i
    quat = g%quat
    do i = 1, merge(g%n, 0, g%shapes%in_use)
      if (g%shapes%kind(i) /= shape_ellipsoid) &
        quat(:, i) = quaternion_product(g%quat(:, i), g%shapes%frame(:, i))
    end do
  end function octant_frames
end module dem_shape_make
