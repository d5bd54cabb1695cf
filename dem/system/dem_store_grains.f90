!> Grains as named arrays, and back.
module dem_store_grains
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_archive, only: dem_archive_type
  use dem_clumps, only: ready_clumps
  use dem_state, only: dem_data_type, dem_grains_type, kind_free, kind_member
  use dem_make, only: prescribe_some, allocate_grains
  use dem_shape_state, only: allocate_shapes, shape_ellipsoid, shape_powers
  implicit none
  private
  public :: put_grain_arrays, get_grains, put_clump_motion, get_clump_motion

  integer(i4), parameter :: motion_reals = 22  !! of a clump
  character(len=*), parameter :: motion = 'clumps.motion'

  !> Rows of what shapes were made from.
  integer(i4), parameter :: made_kind = 1, made_frame(2) = [2, 5], made_skew(2) = [6, 8], &
    made_exponent = 9, made_axes(2) = [10, 12], made_reach = 13, made_radius = 14, made_reals = 14

contains

  !> Grains, all or some, and what damping has seen of them.
  subroutine put_grain_arrays(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    integer(i4) :: n
    associate (g => d%grains)
      n = g%n
      call archive%put_integers('grains.id', reshape(g%id, [1, n]))
      call archive%put_integers('grains.kind', int(reshape(g%kind, [1, n]), i8))
      call archive%put_integers('grains.material', int(reshape(g%material, [1, n]), i8))
      call archive%put_reals('grains.x', g%x)
      call archive%put_reals('grains.quat', g%quat)
      call archive%put_reals('grains.v', g%v)
      call archive%put_reals('grains.omega', g%omega)
      call archive%put_reals('grains.axes', g%axes)
      call archive%put_reals('grains.mass', reshape(g%mass, [1, n]))
      call archive%put_reals('grains.inertia', g%inertia)
      call archive%put_reals('grains.force', g%force)
      call archive%put_reals('grains.moment', g%moment)
      call archive%put_reals('grains.theta', g%theta)
      call archive%put_reals('grains.extra_force', g%extra_force)
      call archive%put_reals('grains.extra_moment', g%extra_moment)
      if (size(g%work) > 0) then
        call archive%put_reals('grains.impulse', g%impulse)
        call archive%put_reals('grains.moment_impulse', g%moment_impulse)
        call archive%put_reals('grains.work', reshape(g%work, [1, n]))
        call archive%put_reals('grains.turn', g%turn)
      end if
      if (g%shapes%in_use) call put_shape_arrays(g, archive)
    end associate
    if (allocated(d%seen_kinetic)) call archive%put_reals( &
      'damping.seen_kinetic', reshape(d%seen_kinetic, [1, size(d%seen_kinetic)]))
  end subroutine put_grain_arrays

  !> How clumps move; what they are is that of the packing.
  subroutine put_clump_motion(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    real(wp) :: rows(motion_reals, d%clumps%n)
    if (d%clumps%n == 0) return
    associate (g => d%clumps%grains)
      rows(1:3, :) = g%x
      rows(4:7, :) = g%quat
      rows(8:10, :) = g%v
      rows(11:13, :) = g%omega
      rows(14:16, :) = g%theta
      rows(17:19, :) = g%force
      rows(20:22, :) = g%moment
    end associate
    call archive%put_reals(motion, rows)
  end subroutine put_clump_motion

  !> The same back; the packing must have the clumps of the checkpoint (I229).
  subroutine get_clump_motion(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    if ((archive%find(motion) > 0) .neqv. d%clumps%n > 0) then
      call errors%add('I229', 'checkpoint: its clumps are not those of the packing', &
                      hint='the checkpoint belongs to another packing, deck or version')
      return
    end if
    if (d%clumps%n == 0) return
    call archive%get_reals(motion, motion_reals, d%clumps%n, rows, errors)
    if (errors%any()) return
    associate (g => d%clumps%grains)
      g%x = rows(1:3, :)
      g%quat = rows(4:7, :)
      g%v = rows(8:10, :)
      g%omega = rows(11:13, :)
      g%theta = rows(14:16, :)
      g%force = rows(17:19, :)
      g%moment = rows(20:22, :)
    end associate
    call ready_clumps(d%clumps, d%grains)
  end subroutine get_clump_motion

  !> Shapes of grains of which some are no ellipsoids: what the kernel reads of them besides the
  !! orientation, and what they were made from.
  subroutine put_shape_arrays(g, archive)
    type(dem_grains_type), intent(in) :: g
    class(dem_archive_type), intent(inout) :: archive
    real(wp) :: rows(made_reals, g%n)
    associate (s => g%shapes, n => g%n)
      call archive%put_reals('grains.form', s%record(5:, :n))
      rows(made_kind, :) = real(s%kind(:n), wp)
      rows(made_frame(1):made_frame(2), :) = s%frame
      rows(made_skew(1):made_skew(2), :) = s%skew
      rows(made_exponent, :) = s%exponent
      rows(made_axes(1):made_axes(2), :) = s%axes
      rows(made_reach, :) = s%reach
      rows(made_radius, :) = g%radius
      call archive%put_reals('grains.made', rows)
    end associate
  end subroutine put_shape_arrays

  !> Where grains enter and leave, those of the checkpoint take the place of those of the packing.
  subroutine adopt_grains(g, archive, errors)
    type(dem_grains_type), intent(inout) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    type(dem_grains_type) :: none
    integer(i8), allocatable :: ids(:, :)
    logical :: shaped
    shaped = g%shapes%in_use
    call archive%get_integers('grains.id', 1, -1, ids, errors, [1_i8, int(huge(1_i4), i8)])
    if (errors%any()) return
    if (any(ids(1, 2:) <= ids(1, :size(ids, 2) - 1))) &
      call archive%refuse('grains.id', 'does not rise', errors)
    g = none
    g%n = size(ids, 2)
    call allocate_grains(g, archive%find('grains.work') > 0)
    g%id = ids(1, :)
    if (shaped .and. .not. errors%any()) call adopt_shapes(g, archive, errors)
  end subroutine adopt_grains

  !> Their shapes.
  subroutine adopt_shapes(g, archive, errors)
    type(dem_grains_type), intent(inout) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: form(:, :), rows(:, :)
    call allocate_shapes(g%shapes, g%n)
    call archive%get_reals('grains.form', size(g%shapes%record, 1) - 4, g%n, form, errors)
    call archive%get_reals('grains.made', made_reals, g%n, rows, errors)
    if (errors%any()) return
    associate (s => g%shapes, n => g%n)
      s%record(5:, :n) = form
      if (any(nint(rows(made_kind, :)) < shape_ellipsoid .or. &
              nint(rows(made_kind, :)) > shape_powers)) &
        call archive%refuse('grains.made', 'names a kind of shape that there is not', errors)
      s%kind(:n) = nint(rows(made_kind, :), i4)
      s%frame = rows(made_frame(1):made_frame(2), :)
      s%skew = rows(made_skew(1):made_skew(2), :)
      s%exponent = rows(made_exponent, :)
      s%axes = rows(made_axes(1):made_axes(2), :)
      s%reach = rows(made_reach, :)
      g%radius = rows(made_radius, :)
    end associate
  end subroutine adopt_shapes

  !> Grains and planes as they were.
  subroutine get_grains(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors

    if (d%open) call adopt_grains(d%grains, archive, errors)
    call compare_ids(d%grains, archive, errors)
    if (errors%any()) return
    associate (g => d%grains)
      call take_numbers(archive, 'grains.kind', [kind_free, kind_member], g%kind, errors)
      call take_numbers(archive, 'grains.material', [1_i4, size(d%materials, kind=i4)], &
                        g%material, errors)
      call take(archive, 'grains.x', g%x, errors)
      call take(archive, 'grains.quat', g%quat, errors)
      call take(archive, 'grains.v', g%v, errors)
      call take(archive, 'grains.omega', g%omega, errors)
      call take(archive, 'grains.axes', g%axes, errors)
      call take(archive, 'grains.inertia', g%inertia, errors)
      call take(archive, 'grains.force', g%force, errors)
      call take(archive, 'grains.moment', g%moment, errors)
      call take(archive, 'grains.theta', g%theta, errors)
      call take(archive, 'grains.extra_force', g%extra_force, errors)
      call take(archive, 'grains.extra_moment', g%extra_moment, errors)
      if (archive%find('grains.work') > 0) then
        call prescribe_some(g)
        call take(archive, 'grains.impulse', g%impulse, errors)
        call take(archive, 'grains.moment_impulse', g%moment_impulse, errors)
        call take_row(archive, 'grains.work', g%work, errors)
        call take(archive, 'grains.turn', g%turn, errors)
      end if
      call compare_shapes(g, archive, errors)
      call take_row(archive, 'grains.mass', g%mass, errors)
    end associate
    call check_grains(d%grains, archive, errors)
    if (.not. (d%grains%shapes%in_use .or. allocated(d%pairs%features))) &
      d%grains%radius = maxval(d%grains%axes, dim=1)
    d%grains%has_target = .false.
    call take(archive, 'planes.point', d%planes%point, errors)
    call take(archive, 'planes.velocity', d%planes%velocity, errors)
    call take(archive, 'planes.force', d%planes%force, errors)
    call take(archive, 'planes.impulse', d%planes%impulse, errors)
    call take_row(archive, 'planes.work', d%planes%work, errors)
  end subroutine get_grains

  !> Are mass, inertia and semi-axes above 0, quaternions of length 1?
  subroutine check_grains(g, archive, errors)
    type(dem_grains_type), intent(in) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: unit = 1.0e-3_wp  !! how far the square of a length may be from 1
    if (errors%any() .or. g%n == 0) return
    call above_zero('grains.mass', minval(g%mass))
    call above_zero('grains.inertia', minval(g%inertia))
    call above_zero('grains.axes', minval(g%axes))
    if (any(abs(sum(g%quat**2, dim=1) - 1.0_wp) > unit)) &
      call archive%refuse('grains.quat', 'holds a quaternion whose length is not 1', errors)

  contains

    subroutine above_zero(name, least)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: least
      if (.not. least > 0.0_wp) &
        call archive%refuse(name, 'holds '//str(least)//', which is not above 0', errors)
    end subroutine above_zero
  end subroutine check_grains

  !> An array of the archive instead of the one that is there, of the same shape.
  subroutine take(archive, name, array, errors)
    type(dem_archive_type), intent(in) :: archive
    character(len=*), intent(in) :: name
    real(wp), intent(inout) :: array(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:, :)
    call archive%get_reals(name, size(array, 1), size(array, 2), values, errors)
    array = values
  end subroutine take

  subroutine take_row(archive, name, array, errors)
    type(dem_archive_type), intent(in) :: archive
    character(len=*), intent(in) :: name
    real(wp), intent(inout) :: array(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:, :)
    call archive%get_reals(name, 1, size(array), values, errors)
    array = values(1, :)
  end subroutine take_row

  subroutine take_numbers(archive, name, range, array, errors)
    type(dem_archive_type), intent(in) :: archive
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: range(2)  !! least, greatest
    integer(i4), intent(inout) :: array(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: values(:, :)
    call archive%get_integers(name, 1, size(array), values, errors, int(range, i8))
    array = int(values(1, :), i4)
  end subroutine take_numbers

  !> The packing must still hold the grains of the checkpoint (I229).
  subroutine compare_ids(g, archive, errors)
    type(dem_grains_type), intent(in) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:, :)

    call archive%get_integers('grains.id', 1, g%n, ids, errors)
    if (errors%any()) return
    if (any(ids(1, :) /= g%id)) &
      call errors%add('I229', 'checkpoint: its grains have other ids than the packing', &
                      hint='the checkpoint belongs to another packing, deck or version')
  end subroutine compare_ids

  !> The grains of the packing must still have the shapes of the checkpoint (I229).
  subroutine compare_shapes(g, archive, errors)
    type(dem_grains_type), intent(in) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: shapes(:, :)
    logical :: same

    same = (archive%find('grains.form') > 0) .eqv. g%shapes%in_use
    if (same .and. g%shapes%in_use) then
      call archive%get_reals('grains.form', size(g%shapes%record, 1) - 4, g%n, shapes, errors)
      if (errors%any()) return
      same = all(abs(shapes - g%shapes%record(5:, :g%n)) <= 0.0_wp)
    end if
    if (same) return
    call errors%add('I229', 'checkpoint: its grains have other shapes than the packing', &
                    hint='the checkpoint belongs to another packing, deck or version')
  end subroutine compare_shapes
end module dem_store_grains
