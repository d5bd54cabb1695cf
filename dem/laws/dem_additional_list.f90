!> History of the additional contact models: inherited when the list is rebuilt, written to
!! checkpoints and read back.
module dem_additional_list
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: lanes
  use dem_additional_state, only: dem_extras_type, extra_work_count, most_parts
  implicit none
  private
  public :: move_extras, mark_touched, held_lanes, count_broken, put_extras, get_extras
  public :: put_run_of_extras, get_run_of_extras, layout_kept, fit_records, layout_size

  integer(i4), parameter :: layout_size = 1 + most_parts  !! reals, and where each part begins

contains

  !> Arrays for `blocks` blocks; slot(k) inherits the history of slot old(k) of the last list, 0:
  !! none.
  pure subroutine move_extras(extras, blocks, old, slot)
    type(dem_extras_type), intent(inout) :: extras
    integer(i4), intent(in) :: blocks, old(:), slot(:)
    real(wp), allocatable :: kept(:, :, :)
    integer(i4) :: k

    allocate (kept(lanes, extras%reals, blocks), source=0.0_wp)
    do k = 1, size(slot)
      if (old(k) == 0) cycle
      kept(1 + mod(slot(k) - 1, lanes), :, 1 + (slot(k) - 1)/lanes) = &
        extras%kept(1 + mod(old(k) - 1, lanes), :, 1 + (old(k) - 1)/lanes)
    end do
    if (extras%bond_at > 0 .and. allocated(extras%kept)) extras%lost = extras%lost &
      + count(extras%kept(:, extras%bond_at, :) > 0.0_wp, kind=i8) &
      - count(kept(:, extras%bond_at, :) > 0.0_wp, kind=i8)
    call move_alloc(kept, extras%kept)
    if (allocated(extras%work)) deallocate (extras%work)
    allocate (extras%work(extra_work_count, blocks), source=0.0_wp)
  end subroutine move_extras

  !> Blocks with a contact that reaches over a gap are worked too.
  pure subroutine mark_touched(extras, touched)
    type(dem_extras_type), intent(in) :: extras
    logical, intent(inout) :: touched(:)  !! (blocks)
    integer(i4) :: k
    if (extras%cohesion_at + extras%bond_at == 0) return
    do k = 1, size(touched)
      touched(k) = touched(k) .or. any(held_lanes(extras, k))
    end do
  end subroutine mark_touched

  !> Lanes of a block that a neck or a bond holds, over a gap or not.
  pure function held_lanes(extras, k) result(held)
    type(dem_extras_type), intent(in) :: extras
    integer(i4), intent(in) :: k
    logical :: held(lanes)
    held = .false.
    if (extras%cohesion_at > 0) held = extras%kept(:, extras%cohesion_at, k) > 0.0_wp
    if (extras%bond_at > 0) held = held .or. extras%kept(:, extras%bond_at, k) > 0.0_wp
  end function held_lanes

  !> Bonds broken so far, in whole numbers.
  pure subroutine count_broken(extras)
    type(dem_extras_type), intent(inout) :: extras
    extras%torn = nint(extras%broken(1), i8)
    extras%sheared = nint(extras%broken(2), i8)
  end subroutine count_broken

  !> Each law's reals by name, so that a restart may add or drop a law.
  subroutine put_extras(extras, archive)
    type(dem_extras_type), intent(in) :: extras
    type(dem_archive_type), intent(inout) :: archive
    integer(i4) :: k
    do k = 1, most_parts
      associate (part => extras%part(k))
        if (part%at > 0) call put_part('extras.'//trim(part%name), part%at, part%reals)
      end associate
    end do

  contains

    subroutine put_part(name, at, reals)
      character(len=*), intent(in) :: name
      integer(i4), intent(in) :: at, reals
      call archive%put_reals(name, reshape(extras%kept(:, at:at + reals - 1, :), &
                                           [lanes*reals, size(extras%kept, 3)]))
    end subroutine put_part
  end subroutine put_extras

  !> The same back; a law that the checkpoint does not have starts from nothing.
  subroutine get_extras(extras, blocks, archive, errors)
    type(dem_extras_type), intent(inout) :: extras
    integer(i4), intent(in) :: blocks
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: none(0), k

    if (.not. extras%active) return
    if (allocated(extras%kept)) deallocate (extras%kept)
    call move_extras(extras, blocks, none, none)
    do k = 1, most_parts
      associate (part => extras%part(k))
        if (part%at > 0) call get_part('extras.'//trim(part%name), part%at, part%reals)
      end associate
    end do

  contains

    subroutine get_part(name, at, reals)
      character(len=*), intent(in) :: name
      integer(i4), intent(in) :: at, reals
      real(wp), allocatable :: flat(:, :)
      if (archive%find(name) == 0) return
      call archive%get_reals(name, lanes*reals, blocks, flat, errors)
      if (errors%any()) return
      extras%kept(:, at:at + reals - 1, :) = reshape(flat, [lanes, reals, blocks])
    end subroutine get_part
  end subroutine get_extras

  !> What is no list: bonds made and broken, and how what contacts keep is laid out.
  subroutine put_run_of_extras(extras, archive)
    type(dem_extras_type), intent(in) :: extras
    type(dem_archive_type), intent(inout) :: archive
    if (.not. extras%active) return
    call archive%put_integers('extras.layout', reshape(int(layout_of(extras), i8), &
                                                       [layout_size, 1]))
    if (extras%bond_at > 0) call archive%put_integers('extras.bonds', &
      reshape([extras%made, extras%torn, extras%sheared], [3, 1]))
  end subroutine put_run_of_extras

  !> The bonds back.
  subroutine get_run_of_extras(extras, archive, errors)
    type(dem_extras_type), intent(inout) :: extras
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :)
    if (extras%bond_at == 0 .or. archive%find('extras.bonds') == 0) return
    call archive%get_integers('extras.bonds', 3, 1, counts, errors)
    if (errors%any()) return
    extras%made = counts(1, 1)
    extras%broken = real(counts(2:3, 1), wp)
    call count_broken(extras)
  end subroutine get_run_of_extras

  !> Layout of a checkpoint; without additional contact models all zero.
  function layout_kept(archive) result(layout)
    type(dem_archive_type), intent(in) :: archive
    integer(i4) :: layout(layout_size), k
    layout = 0
    k = archive%find('extras.layout')
    if (k == 0) return
    if (size(archive%item(k)%integers) == layout_size) &
      layout = int(reshape(archive%item(k)%integers, [layout_size]), i4)
  end function layout_kept

  pure function layout_of(extras) result(layout)
    type(dem_extras_type), intent(in) :: extras
    integer(i4) :: layout(layout_size)
    layout = [extras%reals, extras%part%at]
  end function layout_of

  !> Records of contacts from a checkpoint with another layout: a law that it does not have starts
  !! from nothing, one that the run does not have is left out.
  pure subroutine fit_records(extras, layout, rows)
    type(dem_extras_type), intent(in) :: extras
    integer(i4), intent(in) :: layout(layout_size)     !! of the rows
    real(wp), allocatable, intent(inout) :: rows(:, :)  !! (before + layout(1), contacts)
    real(wp), allocatable :: fitted(:, :)
    integer(i4) :: own(layout_size), before, k, last

    own = layout_of(extras)
    if (all(own == layout)) return
    before = size(rows, 1) - layout(1)
    allocate (fitted(before + own(1), size(rows, 2)), source=0.0_wp)
    fitted(:before, :) = rows(:before, :)
    do k = 2, layout_size
      if (own(k) == 0 .or. layout(k) == 0) cycle
      last = extras%part(k - 1)%reals - 1
      fitted(before + own(k):before + own(k) + last, :) = &
        rows(before + layout(k):before + layout(k) + last, :)
    end do
    call move_alloc(fitted, rows)
  end subroutine fit_records
end module dem_additional_list
