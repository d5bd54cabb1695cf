!> Shapes of the grains of a run: records that the contact kernel reads, there only if some grain
!! is, or may come to be, no ellipsoid.
module dem_shape_state
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  use talus_kinds, only: wp, i4
  use dem_shape, only: shape_size, shape_of, least_exponent
  implicit none
  private
  public :: dem_shapes_type, allocate_shapes, put_frame, put_frames, shape_kind
  public :: shape_ellipsoid, shape_octants, shape_powers

  integer(i4), parameter :: shape_ellipsoid = 0  !! spheres and ellipsoids
  integer(i4), parameter :: shape_octants = 1    !! semi-axes that differ from side to side
  integer(i4), parameter :: shape_powers = 2     !! exponents above 2

  !> Forms of all grains; ellipsoids have records too, as partners of the others.
  type :: dem_shapes_type
    logical :: in_use = .false.                !! no: all grains are ellipsoids
    integer(i4) :: n = 0                       !! grains, if in use
    integer(i4), allocatable :: kind(:)        !! (n+3) form_...; pads are ellipsoids
    real(wp), allocatable :: record(:, :)      !! (shape_size, n+3) see dem_shape
    real(wp), allocatable :: frame(:, :)       !! (4, n) octants' frame in the principal one
    real(wp), allocatable :: skew(:, :)        !! (3, n) (upper - lower)/(upper + lower) [-]
    real(wp), allocatable :: exponent(:)       !! (n) [-]
    real(wp), allocatable :: axes(:, :)        !! (3, n) (upper + lower)/2 [m]
    real(wp), allocatable :: reach(:)          !! (n) how far rotations move surfaces at most [m]
  end type dem_shapes_type

  interface
    !> Orientations of frames in bodies, to the first reals of records (dem_lanes.c).
    pure subroutine turn_frames(quat, stride, count, frame, record) bind(c, name='dem_put_frames')
      import :: c_double, c_int32_t, shape_size
      integer(c_int32_t), value, intent(in) :: stride, count
      real(c_double), intent(in) :: quat(stride, 4)  !! of the bodies
      real(c_double), intent(in) :: frame(4, *)      !! octants' frames in the principal ones
      real(c_double), intent(inout) :: record(shape_size, *)
    end subroutine turn_frames
  end interface

contains

  !> Room for the shapes of n grains; pads are spheres.
  pure subroutine allocate_shapes(shapes, n)
    type(dem_shapes_type), intent(inout) :: shapes
    integer(i4), intent(in) :: n
    real(wp) :: none(3)
    integer(i4) :: i
    none = 0.0_wp
    shapes%in_use = .true.
    shapes%n = n
    allocate (shapes%kind(n + 3), source=shape_ellipsoid)
    allocate (shapes%record(shape_size, n + 3), shapes%frame(4, n), shapes%skew(3, n), &
              shapes%exponent(n), shapes%axes(3, n), shapes%reach(n), source=0.0_wp)
    shapes%frame(1, :) = 1.0_wp
    do i = n + 1, n + 3
      shapes%record(:, i) = shape_of(none + 1.0_wp, none + 1.0_wp, none, least_exponent)
    end do
  end subroutine allocate_shapes

  !> Kind of a form.
  pure integer(i4) function shape_kind(skew, exponent) result(kind)
    real(wp), intent(in) :: skew(3), exponent
    kind = shape_ellipsoid
    if (any(abs(skew) > 0.0_wp)) kind = shape_octants
    if (exponent > 2.0_wp) kind = shape_powers
  end function shape_kind

  !> Orientation of the octants of grain i from that of its principal frame.
  pure subroutine put_frame(shapes, i, quat)
    type(dem_shapes_type), intent(inout) :: shapes
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: quat(4)
    if (shapes%in_use) call turn_frames(quat, 1, 1, shapes%frame(:, i), shapes%record(:, i))
  end subroutine put_frame

  !> The same of `count` grains that follow grain `low`.
  pure subroutine put_frames(shapes, low, count, quat)
    type(dem_shapes_type), intent(inout) :: shapes
    integer(i4), intent(in) :: low, count
    real(wp), intent(in) :: quat(:, :)  !! (at least count, 4)
    if (shapes%in_use) call turn_frames(quat, size(quat, 1), count, shapes%frame(:, low + 1:), &
                                      shapes%record(:, low + 1:))
  end subroutine put_frames
end module dem_shape_state
