!> Grains and contacts as rows of reals, to be sent to other ranks.
module dem_records
  use talus_kinds, only: wp, i4, i8
  use dem_record_layout, only: at_force, at_moment, at_impulse, at_moment_impulse, at_work, at_id, &
    at_kind, at_material, at_position, at_quat, at_velocity, at_spin, at_axes, at_mass, &
    at_inertia, at_theta, at_extra_force, at_extra_moment, at_turn, at_body, at_kinetic, &
    at_shape_kind, at_shape_frame, at_shape_skew, at_shape_exponent, at_shape_axes, &
    at_shape_reach, at_shape_radius, at_shape_record, sum_reals, at_first_id, at_second_id, &
    at_normal, at_history, at_result, at_shift
  use dem_state, only: dem_data_type, lanes, history_root
  implicit none
  private
  public :: grain_reals, contact_reals, plain_contact_reals
  public :: pack_grain, unpack_grain, pack_contact, unpack_contact, unpack_result, shift_of
  public :: carried, index_of

  integer(i4), parameter :: grain_size = at_kinetic            !! reals of an ellipsoid
  integer(i4), parameter :: formed_size = at_shape_record(2)   !! of a grain of another shape
  integer(i4), parameter :: plain_contact_reals = at_shift(2)  !! without additional models

contains

  !> Reals of a grain of this run.
  pure integer(i4) function grain_reals(shaped)
    logical, intent(in) :: shaped  !! some grain is no ellipsoid
    grain_reals = merge(formed_size, grain_size, shaped)
  end function grain_reals

  !> Reals of a contact of this run.
  pure integer(i4) function contact_reals(d)
    type(dem_data_type), intent(in) :: d
    contact_reals = plain_contact_reals + d%pairs%additional%reals
  end function contact_reals

  !> All of a grain that moves with it. Force, moment, their impulses and the work come first: of a
  !! prescribed grain each rank has a part of them.
  pure subroutine pack_grain(d, i, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: row(:)
    associate (g => d%grains)
      row(:sum_reals) = 0.0_wp
      row(at_force(1):at_force(2)) = g%force(:, i)
      row(at_moment(1):at_moment(2)) = g%moment(:, i)
      row(at_turn(1):at_turn(2)) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      if (size(g%work) > 0) then
        row(at_impulse(1):at_impulse(2)) = g%impulse(:, i)
        row(at_moment_impulse(1):at_moment_impulse(2)) = g%moment_impulse(:, i)
        row(at_work) = g%work(i)
        row(at_turn(1):at_turn(2)) = g%turn(:, i)
      end if
      row(at_id) = real(g%id(i), wp)
      row(at_kind) = real(g%kind(i), wp)
      row(at_material) = real(g%material(i), wp)
      row(at_position(1):at_position(2)) = g%x(:, i)
      row(at_quat(1):at_quat(2)) = g%quat(:, i)
      row(at_velocity(1):at_velocity(2)) = g%v(:, i)
      row(at_spin(1):at_spin(2)) = g%omega(:, i)
      row(at_axes(1):at_axes(2)) = g%axes(:, i)
      row(at_mass) = g%mass(i)
      row(at_inertia(1):at_inertia(2)) = g%inertia(:, i)
      row(at_theta(1):at_theta(2)) = g%theta(:, i)
      row(at_extra_force(1):at_extra_force(2)) = g%extra_force(:, i)
      row(at_extra_moment(1):at_extra_moment(2)) = g%extra_moment(:, i)
      row(at_body(1):at_body(2)) = d%pairs%body(:, i)
      row(at_kinetic) = 0.0_wp
      if (allocated(d%seen_kinetic)) row(at_kinetic) = d%seen_kinetic(i)
    end associate
    if (size(row) > grain_size) call pack_shape(d, i, row)
  end subroutine pack_grain

  !> The same back, but for the body's record.
  pure subroutine unpack_grain(row, d, i)
    real(wp), intent(in) :: row(:)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    associate (g => d%grains)
      g%force(:, i) = row(at_force(1):at_force(2))
      g%moment(:, i) = row(at_moment(1):at_moment(2))
      if (size(g%work) > 0) then
        g%impulse(:, i) = row(at_impulse(1):at_impulse(2))
        g%moment_impulse(:, i) = row(at_moment_impulse(1):at_moment_impulse(2))
        g%work(i) = row(at_work)
        g%turn(:, i) = row(at_turn(1):at_turn(2))
      end if
      g%id(i) = nint(row(at_id), i8)
      g%kind(i) = nint(row(at_kind), i4)
      g%material(i) = nint(row(at_material), i4)
      g%x(:, i) = row(at_position(1):at_position(2))
      g%quat(:, i) = row(at_quat(1):at_quat(2))
      g%v(:, i) = row(at_velocity(1):at_velocity(2))
      g%omega(:, i) = row(at_spin(1):at_spin(2))
      g%axes(:, i) = row(at_axes(1):at_axes(2))
      g%radius(i) = maxval(row(at_axes(1):at_axes(2)))
      g%mass(i) = row(at_mass)
      g%inertia(:, i) = row(at_inertia(1):at_inertia(2))
      g%theta(:, i) = row(at_theta(1):at_theta(2))
      g%extra_force(:, i) = row(at_extra_force(1):at_extra_force(2))
      g%extra_moment(:, i) = row(at_extra_moment(1):at_extra_moment(2))
      if (allocated(d%seen_kinetic)) d%seen_kinetic(i) = row(at_kinetic)
    end associate
    if (size(row) > grain_size) call unpack_shape(row, d, i)
  end subroutine unpack_grain

  !> What a shape adds, see dem_shape_state.
  pure subroutine pack_shape(d, i, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(inout) :: row(:)
    associate (shapes => d%grains%shapes)
      row(at_shape_kind) = real(shapes%kind(i), wp)
      row(at_shape_frame(1):at_shape_frame(2)) = shapes%frame(:, i)
      row(at_shape_skew(1):at_shape_skew(2)) = shapes%skew(:, i)
      row(at_shape_exponent) = shapes%exponent(i)
      row(at_shape_axes(1):at_shape_axes(2)) = shapes%axes(:, i)
      row(at_shape_reach) = shapes%reach(i)
      row(at_shape_radius) = d%grains%radius(i)
      row(at_shape_record(1):at_shape_record(2)) = shapes%record(:, i)
    end associate
  end subroutine pack_shape

  pure subroutine unpack_shape(row, d, i)
    real(wp), intent(in) :: row(:)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    associate (shapes => d%grains%shapes)
      shapes%kind(i) = nint(row(at_shape_kind), i4)
      shapes%frame(:, i) = row(at_shape_frame(1):at_shape_frame(2))
      shapes%skew(:, i) = row(at_shape_skew(1):at_shape_skew(2))
      shapes%exponent(i) = row(at_shape_exponent)
      shapes%axes(:, i) = row(at_shape_axes(1):at_shape_axes(2))
      shapes%reach(i) = row(at_shape_reach)
      d%grains%radius(i) = row(at_shape_radius)
      shapes%record(:, i) = row(at_shape_record(1):at_shape_record(2))
    end associate
  end subroutine unpack_shape

  !> Has this candidate a history? The radius of two spheres is recomputed.
  pure logical function carried(d, lane, block)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, block
    associate (h => d%pairs%history(lane, :, block))
      carried = any(abs(h(:history_root - 1)) > 0.0_wp) .or. any(abs(h(history_root + 1:)) > 0.0_wp)
    end associate
    if (carried .or. .not. d%pairs%additional%active) return
    carried = any(abs(d%pairs%additional%kept(lane, :, block)) > 0.0_wp)
  end function carried

  !> A contact: ids, lower one first, planes as -1, -2, ...; normal, history, force and moment, the
  !! shift of the second in edges of the cell, what additional models keep.
  pure subroutine pack_contact(d, lane, block, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, block
    real(wp), intent(out) :: row(:)
    integer(i4) :: first, second
    first = d%pairs%first(lane, block)
    second = d%pairs%second(lane, block)
    if (first > d%grains%n) then
      row(at_first_id) = -real(first - d%grains%n - 3, wp)
    else
      row(at_first_id) = real(d%grains%id(first), wp)
    end if
    row(at_second_id) = real(d%grains%id(d%pairs%grain(second)), wp)
    row(at_normal(1):at_normal(2)) = d%pairs%normal(lane, :, block)
    row(at_history(1):at_history(2)) = d%pairs%history(lane, :, block)
    row(at_result(1):at_result(2)) = d%pairs%result(:, (block - 1)*lanes + lane)
    row(at_shift(1):at_shift(2)) = 0.0_wp
    if (second > d%pairs%plain) row(at_shift(1):at_shift(2)) = &
      d%pairs%shift(:, second - d%pairs%plain)
    if (d%pairs%additional%active) &
      row(plain_contact_reals + 1:) = d%pairs%additional%kept(lane, :, block)
  end subroutine pack_contact

  !> Normal, history and what additional models keep, back to a place in the list.
  pure subroutine unpack_contact(row, d, lane, block)
    real(wp), intent(in) :: row(:)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: lane, block
    d%pairs%normal(lane, :, block) = row(at_normal(1):at_normal(2))
    d%pairs%history(lane, :, block) = row(at_history(1):at_history(2))
    if (d%pairs%additional%active) &
      d%pairs%additional%kept(lane, :, block) = row(plain_contact_reals + 1:)
  end subroutine unpack_contact

  !> History, force and moment, back to a slot of the list.
  pure subroutine unpack_result(row, d, slot)
    real(wp), intent(in) :: row(:)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: slot
    d%pairs%history(1 + mod(slot - 1, lanes), :, 1 + (slot - 1)/lanes) = &
      row(at_history(1):at_history(2))
    d%pairs%result(:, slot) = row(at_result(1):at_result(2))
  end subroutine unpack_result

  !> Shift of the second grain, in edges of the cell.
  pure function shift_of(row) result(shift)
    real(wp), intent(in) :: row(:)
    integer(i4) :: shift(3)
    shift = nint(row(at_shift(1):at_shift(2)), i4)
  end function shift_of

  !> Body of an id, planes as -1, -2, ...; 0 if it is not known here.
  pure integer(i4) function index_of(d, id) result(body)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: id
    integer(i8) :: wanted
    integer(i4) :: low, high
    wanted = nint(id, i8)
    if (wanted < 0) then
      body = d%grains%n + 3 - int(wanted, i4)
      return
    end if
    low = 1
    high = d%grains%n
    do while (low <= high)
      body = (low + high)/2
      if (d%grains%id(body) == wanted) return
      if (d%grains%id(body) < wanted) then
        low = body + 1
      else
        high = body - 1
      end if
    end do
    body = 0
  end function index_of
end module dem_records
