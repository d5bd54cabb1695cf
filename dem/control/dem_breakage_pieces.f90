!> Fragments of single grains, as records that a system takes (theory-dem, Breakage of grains).
!!
!! They move as the grain did: velocity v + omega x (x_i - x), its spin, its axes.
module dem_breakage_pieces
  use talus_kinds, only: wp, i4, i8
  use talus_random, only: unit_number, turn_of
  use talus_vectors, only: cross
  use dem_breakage_group, only: breakage_type, semi_axes_of
  use dem_ellipsoid, only: rotation_of
  use dem_fragments, only: fragment_type, make_fragments, created_area, split_axis, &
    family_fourteen
  use dem_packing, only: dem_packing_type
  use dem_shape, only: at_centre
  use dem_shape_mass, only: shape_mass_type, mass_of_shape
  use dem_shape_make, only: most_slender
  use dem_shape_state, only: shape_ellipsoid
  use dem_state, only: dem_data_type, dem_grains_type
  implicit none
  private
  public :: put_pieces, balance_of

  integer(i8), parameter :: stride = 1000003  !! between the seeds of the numbers of a turn

contains

  !> Fragments of grain i behind those of a batch; the surface that appears.
  subroutine put_pieces(d, i, group, toward, first_id, batch, surface)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(breakage_type), intent(in) :: group
    real(wp), intent(in) :: toward(3)        !! to the contact of the largest force [m]
    integer(i8), intent(in) :: first_id
    type(dem_packing_type), intent(inout) :: batch
    real(wp), intent(out) :: surface         !! [m^2]
    type(fragment_type), allocatable :: fragment(:)
    real(wp) :: upper(3), lower(3), exponent, quat(4), r(3, 3), origin(3), load(3)
    integer(i4) :: k, n, axis

    call semi_axes_of(d, i, upper, lower, exponent)
    call frame_of(d, i, quat, origin)
    r = rotation_of(quat)
    load = matmul(toward, r)/max(norm2(toward), tiny(1.0_wp))
    axis = split_axis(upper, lower, load, exponent, most_slender)
    call make_fragments(group%family, upper, lower, exponent, turn_in(d, i, group), axis, fragment)
    surface = created_area(group%family, upper, lower, exponent, axis)
    do k = 1, size(fragment)
      batch%n = batch%n + 1
      n = batch%n
      batch%id(n) = first_id + k - 1
      batch%axes(:, n) = 0.5_wp*(fragment(k)%upper + fragment(k)%lower)
      batch%skew(:, n) = 0.0_wp
      where (abs(fragment(k)%upper - fragment(k)%lower) > 0.0_wp) batch%skew(:, n) = &
        (fragment(k)%upper - fragment(k)%lower)/(fragment(k)%upper + fragment(k)%lower)
      batch%exponent(n) = exponent
      batch%quat(:, n) = quat
      batch%x(:, n) = d%grains%x(:, i) + matmul(r, fragment(k)%origin - origin &
                                               + centre_of(fragment(k), exponent))
      batch%omega(:, n) = d%grains%omega(:, i)
      batch%v(:, n) = d%grains%v(:, i) + cross(d%grains%omega(:, i), batch%x(:, n) &
                                               - d%grains%x(:, i))
    end do
  end subroutine put_pieces

  !> Orientation of the octants of grain i and its centre of mass from their origin.
  pure subroutine frame_of(d, i, quat, origin)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: quat(4), origin(3)
    quat = d%grains%quat(:, i)
    origin = 0.0_wp
    if (.not. d%grains%shapes%in_use) return
    if (d%grains%shapes%kind(i) == shape_ellipsoid) return
    quat = d%grains%shapes%record(1:4, i)
    quat = quat/norm2(quat)
    origin = d%grains%shapes%record(at_centre:at_centre + 2, i)
  end subroutine frame_of

  !> Turn of the family in the unit ball: that of the id, for spheres and ellipsoids.
  pure function turn_in(d, i, group) result(turn)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    type(breakage_type), intent(in) :: group
    real(wp) :: turn(4)
    integer(i8) :: k
    turn = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    if (group%family /= family_fourteen) return
    if (d%grains%shapes%in_use) then
      if (d%grains%shapes%kind(i) /= shape_ellipsoid) return
    end if
    turn = turn_of([(unit_number(d%grains%id(i), group%seed + stride*k), k=1, 3)])
  end function turn_in

  !> Centre of mass of a fragment from the origin of its octants [m].
  pure function centre_of(fragment, exponent) result(centre)
    type(fragment_type), intent(in) :: fragment
    real(wp), intent(in) :: exponent
    real(wp) :: centre(3)
    type(shape_mass_type) :: mass
    centre = 0.0_wp
    if (all(abs(fragment%upper - fragment%lower) <= 0.0_wp)) return
    mass = mass_of_shape(fragment%upper, fragment%lower, exponent)
    centre = mass%centre
  end function centre_of

  !> Mass, momentum and angular momentum about the origin of grain i.
  pure function balance_of(g, i) result(balance)
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: i
    real(wp) :: balance(7), r(3, 3)  !! [kg], [N s], [N m s]
    r = rotation_of(g%quat(:, i))
    balance(1) = g%mass(i)
    balance(2:4) = g%mass(i)*g%v(:, i)
    balance(5:7) = cross(g%x(:, i), balance(2:4)) &
                   + matmul(r, g%inertia(:, i)*matmul(g%omega(:, i), r))
  end function balance_of
end module dem_breakage_pieces
