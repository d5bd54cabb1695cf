!> Gather of records into lanes and scatter back (dem_lanes.c).
module dem_lanes
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  use dem_state, only: lanes, body_size, result_size
  use dem_block, only: dem_side_type, dem_load_type
  implicit none
  private
  public :: call_for, read_in_order, gather_side, gather_spheres, gather_motions, gather_records
  public :: put_loads, finish_puts, put_side, put_motion, take_side, take_motion
  public :: sum_results, sum_lanes

  interface
    !> Read memory from front to back, so that the processor fetches what lies behind it.
    pure subroutine read_in_order(from, reals) bind(c, name='dem_read_in_order')
      import :: c_double, c_int32_t
      real(c_double), intent(in) :: from(*)
      integer(c_int32_t), value, intent(in) :: reals
    end subroutine read_in_order

    !> Prefetch memory.
    pure subroutine call_for(from, reals) bind(c, name='dem_call_for')
      import :: c_double, c_int32_t
      real(c_double), intent(in) :: from(*)
      integer(c_int32_t), value, intent(in) :: reals
    end subroutine call_for

    !> Records body(:, index) into the lanes of a side; body(:, next) are used next, and are
    !! prefetched if far /= 0, as they may be out of the caches.
    pure subroutine gather_side(body, index, next, far, side) bind(c, name='dem_gather_side')
      import :: c_double, c_int32_t, dem_side_type, lanes, body_size
      real(c_double), intent(in) :: body(body_size, *)
      integer(c_int32_t), intent(in) :: index(lanes), next(lanes)
      integer(c_int32_t), value, intent(in) :: far
      type(dem_side_type), intent(inout) :: side
    end subroutine gather_side

    !> The same for spheres: centre, velocity, spin and s(:, 1); the rest of the side is left.
    pure subroutine gather_spheres(body, index, next, far, side) &
      bind(c, name='dem_gather_spheres')
      import :: c_double, c_int32_t, dem_side_type, lanes, body_size
      real(c_double), intent(in) :: body(body_size, *)
      integer(c_int32_t), intent(in) :: index(lanes), next(lanes)
      integer(c_int32_t), value, intent(in) :: far
      type(dem_side_type), intent(inout) :: side
    end subroutine gather_spheres

    !> The same, but centre, velocity and spin alone; the rest of the side is left.
    pure subroutine gather_motions(body, index, next, far, side) &
      bind(c, name='dem_gather_motions')
      import :: c_double, c_int32_t, dem_side_type, lanes, body_size
      real(c_double), intent(in) :: body(body_size, *)
      integer(c_int32_t), intent(in) :: index(lanes), next(lanes)
      integer(c_int32_t), value, intent(in) :: far
      type(dem_side_type), intent(inout) :: side
    end subroutine gather_motions

    !> Records of body_size reals of any kind, as gather_side.
    pure subroutine gather_records(record, index, next, far, side) &
      bind(c, name='dem_gather_records')
      import :: c_double, c_int32_t, lanes, body_size
      real(c_double), intent(in) :: record(body_size, *)
      integer(c_int32_t), intent(in) :: index(lanes), next(lanes)
      integer(c_int32_t), value, intent(in) :: far
      real(c_double), intent(inout) :: side(lanes, body_size)
    end subroutine gather_records

    !> Loads of the lanes to the records of a block; past /= 0: by streaming stores.
    pure subroutine put_loads(load, past, result) bind(c, name='dem_put_loads')
      import :: c_double, c_int32_t, dem_load_type, lanes, result_size
      type(dem_load_type), intent(in) :: load
      integer(c_int32_t), value, intent(in) :: past
      real(c_double), intent(out) :: result(result_size, lanes)
    end subroutine put_loads

    !> Fence: streaming stores become visible to other threads.
    subroutine finish_puts() bind(c, name='dem_finish_puts')
    end subroutine finish_puts

    !> The first `count` lanes of a side to records that follow each other from `body` on.
    pure subroutine put_side(side, count, body) bind(c, name='dem_put_bodies')
      import :: c_double, c_int32_t, dem_side_type, body_size
      type(dem_side_type), intent(in) :: side
      integer(c_int32_t), value, intent(in) :: count
      real(c_double), intent(inout) :: body(body_size, *)
    end subroutine put_side

    !> The same for spheres: centre, velocity and spin; the rest of the records stays.
    pure subroutine put_motion(side, count, body) bind(c, name='dem_put_motions')
      import :: c_double, c_int32_t, dem_side_type, body_size
      type(dem_side_type), intent(in) :: side
      integer(c_int32_t), value, intent(in) :: count
      real(c_double), intent(inout) :: body(body_size, *)
    end subroutine put_motion

    !> Inverse of put_side; lanes beyond `count` become zero.
    pure subroutine take_side(body, count, side) bind(c, name='dem_take_bodies')
      import :: c_double, c_int32_t, dem_side_type, body_size
      real(c_double), intent(in) :: body(body_size, *)
      integer(c_int32_t), value, intent(in) :: count
      type(dem_side_type), intent(inout) :: side
    end subroutine take_side

    !> Inverse of put_motion; lanes beyond `count` become zero, the rest of the side is left.
    pure subroutine take_motion(body, count, side) bind(c, name='dem_take_motions')
      import :: c_double, c_int32_t, dem_side_type, body_size
      real(c_double), intent(in) :: body(body_size, *)
      integer(c_int32_t), value, intent(in) :: count
      type(dem_side_type), intent(inout) :: side
    end subroutine take_motion

    !> Sum of the results named by the entries first..last of a body, in their order.
    pure subroutine sum_results(result, entry, first, last, total) bind(c, name='dem_sum_results')
      import :: c_double, c_int32_t, result_size
      real(c_double), intent(in) :: result(result_size, *)
      integer(c_int32_t), intent(in) :: entry(*)
      integer(c_int32_t), value, intent(in) :: first, last
      real(c_double), intent(out) :: total(result_size)
    end subroutine sum_results

    !> Forces and moments about their centres of `count` bodies that follow each other.
    pure subroutine sum_lanes(result, entry, start, count, x, force, moment) &
      bind(c, name='dem_sum_lanes')
      import :: c_double, c_int32_t, result_size, lanes
      real(c_double), intent(in) :: result(result_size, *)
      integer(c_int32_t), intent(in) :: entry(*), start(*)
      integer(c_int32_t), value, intent(in) :: count
      real(c_double), intent(in) :: x(lanes, 3)                              !! centres [m]
      real(c_double), intent(inout) :: force(lanes, 3), moment(lanes, 3)  !! [N], [N m]
    end subroutine sum_lanes
  end interface
end module dem_lanes
