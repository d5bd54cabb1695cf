!> Columns of the records that are sent between ranks, defined in this file alone.
!!
!! A quantity is a pair of its first and last column, `previous(2) + [1, reals]`; the records begin
!! with the first line of a block and end with its last. Another quantity is one line here, and one
!! each where it is packed and unpacked (grains and contacts: dem_records; contacts with surfaces:
!! dem_surface_records; bodies in every step: dem_swap; the rest: dem_distribute, dem_slabs).
module dem_record_layout
  use talus_kinds, only: i4
  use dem_shape, only: shape_size
  use dem_state, only: body_size, history_size, result_size
  implicit none
  private
  public :: at_force, at_moment, at_impulse, at_moment_impulse, at_work, at_id, at_kind, &
    at_material, at_position, at_quat, at_velocity, at_spin, at_axes, at_mass, at_inertia, &
    at_theta, at_extra_force, at_extra_moment, at_turn, at_body, at_kinetic
  public :: at_shape_kind, at_shape_frame, at_shape_skew, at_shape_exponent, at_shape_axes, &
    at_shape_reach, at_shape_radius, at_shape_record
  public :: sum_reals, grain_columns, shape_columns
  public :: at_first_id, at_second_id, at_normal, at_history, at_result, at_shift, contact_columns
  public :: touch_grain, touch_count, touch_load, touch_head_columns
  public :: slot_history, slot_foot, slot_normal, slot_point, slot_push, slot_motion, slot_part, &
    slot_sign, slot_offset, slot_columns
  public :: list_ids, list_point, list_normal, list_branch, list_force, list_spring, &
    list_stiffness, list_overlap, list_columns
  public :: target_position, target_quat, target_velocity, target_spin, target_given, &
    target_end_position, target_end_quat, target_turn, target_id, target_columns
  public :: load_id, load_force, load_moment, load_columns
  public :: plane_force, plane_moment, plane_impulse, plane_work, plane_columns
  public :: swap_motion, swap_ellipsoid, swap_frame, swap_columns

  ! A grain. Sums come first: of a prescribed grain each rank has a part of them.
  integer(i4), parameter :: at_force(2) = [1, 3]
  integer(i4), parameter :: at_moment(2) = at_force(2) + [1, 3]
  integer(i4), parameter :: at_impulse(2) = at_moment(2) + [1, 3]
  integer(i4), parameter :: at_moment_impulse(2) = at_impulse(2) + [1, 3]
  integer(i4), parameter :: at_work = at_moment_impulse(2) + 1
  integer(i4), parameter :: sum_reals = at_work  !! of these the sums
  integer(i4), parameter :: at_id = at_work + 1
  integer(i4), parameter :: at_kind = at_id + 1
  integer(i4), parameter :: at_material = at_kind + 1
  integer(i4), parameter :: at_position(2) = at_material + [1, 3]
  integer(i4), parameter :: at_quat(2) = at_position(2) + [1, 4]
  integer(i4), parameter :: at_velocity(2) = at_quat(2) + [1, 3]
  integer(i4), parameter :: at_spin(2) = at_velocity(2) + [1, 3]
  integer(i4), parameter :: at_axes(2) = at_spin(2) + [1, 3]
  integer(i4), parameter :: at_mass = at_axes(2) + 1
  integer(i4), parameter :: at_inertia(2) = at_mass + [1, 3]
  integer(i4), parameter :: at_theta(2) = at_inertia(2) + [1, 3]
  integer(i4), parameter :: at_extra_force(2) = at_theta(2) + [1, 3]
  integer(i4), parameter :: at_extra_moment(2) = at_extra_force(2) + [1, 3]
  integer(i4), parameter :: at_turn(2) = at_extra_moment(2) + [1, 4]
  integer(i4), parameter :: at_body(2) = at_turn(2) + [1_i4, body_size]  !! see dem_pairs_type
  integer(i4), parameter :: at_kinetic = at_body(2) + 1  !! at the last update of damping
  integer(i4), parameter :: grain_columns(2, 21) = reshape([ &
    at_force, at_moment, at_impulse, at_moment_impulse, at_work, at_work, at_id, at_id, &
    at_kind, at_kind, at_material, at_material, at_position, at_quat, at_velocity, at_spin, &
    at_axes, at_mass, at_mass, at_inertia, at_theta, at_extra_force, at_extra_moment, at_turn, &
    at_body, at_kinetic, at_kinetic], [2, 21])

  ! More of a grain in a run with other shapes than ellipsoids.
  integer(i4), parameter :: at_shape_kind = at_kinetic + 1
  integer(i4), parameter :: at_shape_frame(2) = at_shape_kind + [1, 4]
  integer(i4), parameter :: at_shape_skew(2) = at_shape_frame(2) + [1, 3]
  integer(i4), parameter :: at_shape_exponent = at_shape_skew(2) + 1
  integer(i4), parameter :: at_shape_axes(2) = at_shape_exponent + [1, 3]
  integer(i4), parameter :: at_shape_reach = at_shape_axes(2) + 1
  integer(i4), parameter :: at_shape_radius = at_shape_reach + 1
  integer(i4), parameter :: at_shape_record(2) = at_shape_radius + [1_i4, shape_size]
  integer(i4), parameter :: shape_columns(2, 8) = reshape([ &
    at_shape_kind, at_shape_kind, at_shape_frame, at_shape_skew, at_shape_exponent, &
    at_shape_exponent, at_shape_axes, at_shape_reach, at_shape_reach, at_shape_radius, &
    at_shape_radius, at_shape_record], [2, 8])

  ! A contact of two grains or of a plane and a grain; what additional models keep comes after it.
  integer(i4), parameter :: at_first_id = 1   !! the lower id, planes as -1, -2, ...
  integer(i4), parameter :: at_second_id = at_first_id + 1
  integer(i4), parameter :: at_normal(2) = at_second_id + [1, 3]
  integer(i4), parameter :: at_history(2) = at_normal(2) + [1_i4, history_size]
  integer(i4), parameter :: at_result(2) = at_history(2) + [1_i4, result_size]
  integer(i4), parameter :: at_shift(2) = at_result(2) + [1, 3]  !! of the second, in cell edges
  integer(i4), parameter :: contact_columns(2, 6) = reshape([ &
    at_first_id, at_first_id, at_second_id, at_second_id, at_normal, at_history, at_result, &
    at_shift], [2, 6])

  ! A grain that has contacts with surfaces: its head, then for each slot of it (see
  ! dem_surface_state) the columns of a slot, then what additional models keep, and their couples.
  integer(i4), parameter :: touch_grain = 1
  integer(i4), parameter :: touch_count = touch_grain + 1
  integer(i4), parameter :: touch_load(2) = touch_count + [1, 6]
  integer(i4), parameter :: touch_head_columns(2, 3) = reshape([ &
    touch_grain, touch_grain, touch_count, touch_count, touch_load], [2, 3])
  integer(i4), parameter :: slot_history(2) = [1_i4, history_size]
  integer(i4), parameter :: slot_foot(2) = slot_history(2) + [1, 3]
  integer(i4), parameter :: slot_normal(2) = slot_foot(2) + [1, 3]
  integer(i4), parameter :: slot_point(2) = slot_normal(2) + [1, 3]
  integer(i4), parameter :: slot_push(2) = slot_point(2) + [1, 3]
  integer(i4), parameter :: slot_motion(2) = slot_push(2) + [1, 6]
  integer(i4), parameter :: slot_part = slot_motion(2) + 1
  integer(i4), parameter :: slot_sign = slot_part + 1
  integer(i4), parameter :: slot_offset(2) = slot_sign + [1, 3]
  integer(i4), parameter :: slot_columns(2, 9) = reshape([ &
    slot_history, slot_foot, slot_normal, slot_point, slot_push, slot_motion, slot_part, &
    slot_part, slot_sign, slot_sign, slot_offset], [2, 9])

  ! A contact as it is written to fields.
  integer(i4), parameter :: list_ids(2) = [1, 2]
  integer(i4), parameter :: list_point(2) = list_ids(2) + [1, 3]
  integer(i4), parameter :: list_normal(2) = list_point(2) + [1, 3]
  integer(i4), parameter :: list_branch(2) = list_normal(2) + [1, 3]
  integer(i4), parameter :: list_force(2) = list_branch(2) + [1, 3]
  integer(i4), parameter :: list_spring(2) = list_force(2) + [1, 3]
  integer(i4), parameter :: list_stiffness(2) = list_spring(2) + [1, 2]
  integer(i4), parameter :: list_overlap = list_stiffness(2) + 1
  integer(i4), parameter :: list_columns(2, 8) = reshape([ &
    list_ids, list_point, list_normal, list_branch, list_force, list_spring, list_stiffness, &
    list_overlap, list_overlap], [2, 8])

  ! Motion of a prescribed grain in the next steps.
  integer(i4), parameter :: target_position(2) = [1, 3]
  integer(i4), parameter :: target_quat(2) = target_position(2) + [1, 4]
  integer(i4), parameter :: target_velocity(2) = target_quat(2) + [1, 3]
  integer(i4), parameter :: target_spin(2) = target_velocity(2) + [1, 3]
  integer(i4), parameter :: target_given = target_spin(2) + 1  !! 1: it ends on a target
  integer(i4), parameter :: target_end_position(2) = target_given + [1, 3]
  integer(i4), parameter :: target_end_quat(2) = target_end_position(2) + [1, 4]
  integer(i4), parameter :: target_turn(2) = target_end_quat(2) + [1, 4]
  integer(i4), parameter :: target_id = target_turn(2) + 1
  integer(i4), parameter :: target_columns(2, 9) = reshape([ &
    target_position, target_quat, target_velocity, target_spin, target_given, target_given, &
    target_end_position, target_end_quat, target_turn, target_id, target_id], [2, 9])

  ! Extra force of a grain.
  integer(i4), parameter :: load_id = 1
  integer(i4), parameter :: load_force(2) = load_id + [1, 3]
  integer(i4), parameter :: load_moment(2) = load_force(2) + [1, 3]
  integer(i4), parameter :: load_columns(2, 3) = reshape([ &
    load_id, load_id, load_force, load_moment], [2, 3])

  ! Sums of a plane in a report.
  integer(i4), parameter :: plane_force(2) = [1, 3]
  integer(i4), parameter :: plane_moment(2) = plane_force(2) + [1, 3]
  integer(i4), parameter :: plane_impulse(2) = plane_moment(2) + [1, 3]
  integer(i4), parameter :: plane_work = plane_impulse(2) + 1
  integer(i4), parameter :: plane_columns(2, 4) = reshape([ &
    plane_force, plane_moment, plane_impulse, plane_work, plane_work], [2, 4])

  ! A body in the exchange of every step: spheres send their motion alone, runs with ellipsoids the
  ! tensor A too, those with other shapes their frame too. The first two are columns of a body
  ! record as well, see dem_pairs_type.
  integer(i4), parameter :: swap_motion(2) = [1, 9]
  integer(i4), parameter :: swap_ellipsoid(2) = swap_motion(2) + [1, 6]
  integer(i4), parameter :: swap_frame(2) = swap_ellipsoid(2) + [1, 4]
  integer(i4), parameter :: swap_columns(2, 3) = reshape([ &
    swap_motion, swap_ellipsoid, swap_frame], [2, 3])
end module dem_record_layout
