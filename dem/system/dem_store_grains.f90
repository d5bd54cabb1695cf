!> Grains as named arrays, and back.
module dem_store_grains
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_data_type, dem_grains_type
  use dem_make, only: prescribe_some
  implicit none
  private
  public :: put_grain_arrays, get_grains

contains

  !> Grains, all or some, and what damping has seen of them.
  subroutine put_grain_arrays(d, archive)
    type(dem_data_type), intent(in) :: d
    type(dem_archive_type), intent(inout) :: archive
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
      if (g%shapes%n > 0) call archive%put_reals('grains.form', g%shapes%record(5:, :n))
    end associate
    if (allocated(d%seen_kinetic)) call archive%put_reals( &
      'damping.seen_kinetic', reshape(d%seen_kinetic, [1, size(d%seen_kinetic)]))
  end subroutine put_grain_arrays

  subroutine get_grains(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:, :)
    integer(i4) :: n

    n = d%grains%n
    call archive%get_integers('grains.id', 1, n, ids, errors)
    if (errors%any()) return
    if (any(ids(1, :) /= d%grains%id)) then
      call errors%add('I229', 'checkpoint: its grains have other ids than the packing', &
                      hint='the checkpoint belongs to another packing, deck or version')
      return
    end if
    call archive%get_integers('grains.kind', 1, n, ids, errors)
    d%grains%kind = int(ids(1, :), i4)
    call archive%get_integers('grains.material', 1, n, ids, errors)
    d%grains%material = int(ids(1, :), i4)
    associate (g => d%grains)
      call take('grains.x', g%x)
      call take('grains.quat', g%quat)
      call take('grains.v', g%v)
      call take('grains.omega', g%omega)
      call take('grains.axes', g%axes)
      call take('grains.inertia', g%inertia)
      call take('grains.force', g%force)
      call take('grains.moment', g%moment)
      call take('grains.theta', g%theta)
      call take('grains.extra_force', g%extra_force)
      call take('grains.extra_moment', g%extra_moment)
      if (archive%find('grains.work') > 0) then
        call prescribe_some(g)
        call take('grains.impulse', g%impulse)
        call take('grains.moment_impulse', g%moment_impulse)
        call take_row('grains.work', g%work)
        call take('grains.turn', g%turn)
      end if
      call compare_shapes(g, archive, errors)
      call take_row('grains.mass', g%mass)
    end associate
    if (d%grains%shapes%n == 0) d%grains%radius = maxval(d%grains%axes, dim=1)
    d%grains%has_target = .false.
    call take('planes.point', d%planes%point)
    call take('planes.velocity', d%planes%velocity)
    call take('planes.force', d%planes%force)
    call take('planes.impulse', d%planes%impulse)
    call take_row('planes.work', d%planes%work)

  contains

    subroutine take(name, array)
      character(len=*), intent(in) :: name
      real(wp), intent(inout) :: array(:, :)
      real(wp), allocatable :: values(:, :)
      call archive%get_reals(name, size(array, 1), size(array, 2), values, errors)
      array = values
    end subroutine take

    subroutine take_row(name, array)
      character(len=*), intent(in) :: name
      real(wp), intent(inout) :: array(:)
      real(wp), allocatable :: values(:, :)
      call archive%get_reals(name, 1, size(array), values, errors)
      array = values(1, :)
    end subroutine take_row
  end subroutine get_grains

  !> The grains of the packing must still have the shapes of the checkpoint (I229).
  subroutine compare_shapes(g, archive, errors)
    type(dem_grains_type), intent(in) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: shapes(:, :)
    logical :: same

    same = (archive%find('grains.form') > 0) .eqv. (g%shapes%n > 0)
    if (same .and. g%shapes%n > 0) then
      call archive%get_reals('grains.form', size(g%shapes%record, 1) - 4, g%n, shapes, errors)
      if (errors%any()) return
      same = all(abs(shapes - g%shapes%record(5:, :g%n)) <= 0.0_wp)
    end if
    if (same) return
    call errors%add('I229', 'checkpoint: its grains have other shapes than the packing', &
                    hint='the checkpoint belongs to another packing, deck or version')
  end subroutine compare_shapes
end module dem_store_grains
