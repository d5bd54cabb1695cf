!> History of the additional contact models: inherited when the list is rebuilt, written to
!! checkpoints and read back.
module dem_additional_list
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: lanes
  use dem_additional_state, only: dem_additional_type, additional_work_count, most_parts
  implicit none
  private
  public :: move_additional, mark_touched, held_lanes, count_broken, put_additional, get_additional
  public :: put_run_of_additional, get_run_of_additional, layout_kept, fit_records, layout_size

  integer(i4), parameter :: layout_size = 1 + most_parts  !! reals, and where each part begins

contains

  !> Arrays for `blocks` blocks; slot(k) inherits the history of slot old(k) of the last list, 0:
  !! none.
  pure subroutine move_additional(additional, blocks, old, slot)
    type(dem_additional_type), intent(inout) :: additional
    integer(i4), intent(in) :: blocks, old(:), slot(:)
    real(wp), allocatable :: kept(:, :, :)
    integer(i4) :: k

    allocate (kept(lanes, additional%reals, blocks), source=0.0_wp)
    do k = 1, size(slot)
      if (old(k) == 0) cycle
      kept(1 + mod(slot(k) - 1, lanes), :, 1 + (slot(k) - 1)/lanes) = &
        additional%kept(1 + mod(old(k) - 1, lanes), :, 1 + (old(k) - 1)/lanes)
    end do
    if (additional%bond_at > 0 .and. allocated(additional%kept)) additional%lost = additional%lost &
      + count(additional%kept(:, additional%bond_at, :) > 0.0_wp, kind=i8) &
      - count(kept(:, additional%bond_at, :) > 0.0_wp, kind=i8)
    call move_alloc(kept, additional%kept)
    if (allocated(additional%work)) deallocate (additional%work)
    allocate (additional%work(additional_work_count, blocks), source=0.0_wp)
  end subroutine move_additional

  !> Blocks with a contact that reaches over a gap are worked too.
  pure subroutine mark_touched(additional, touched)
    type(dem_additional_type), intent(in) :: additional
    logical, intent(inout) :: touched(:)  !! (blocks)
    integer(i4) :: k
    if (additional%cohesion_at + additional%bond_at == 0) return
    do k = 1, size(touched)
      touched(k) = touched(k) .or. any(held_lanes(additional, k))
    end do
  end subroutine mark_touched

  !> Lanes of a block that a neck or a bond holds, over a gap or not.
  pure function held_lanes(additional, k) result(held)
    type(dem_additional_type), intent(in) :: additional
    integer(i4), intent(in) :: k
    logical :: held(lanes)
    held = .false.
    if (additional%cohesion_at > 0) held = additional%kept(:, additional%cohesion_at, k) > 0.0_wp
    if (additional%bond_at > 0) held = held .or. additional%kept(:, additional%bond_at, k) > 0.0_wp
  end function held_lanes

  !> Bonds broken so far, in whole numbers.
  pure subroutine count_broken(additional)
    type(dem_additional_type), intent(inout) :: additional
    additional%torn = nint(additional%broken(1), i8)
    additional%sheared = nint(additional%broken(2), i8)
  end subroutine count_broken

  !> Each law's reals by name, so that a restart may add or drop a law.
  subroutine put_additional(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    type(dem_archive_type), intent(inout) :: archive
    integer(i4) :: k
    do k = 1, most_parts
      associate (part => additional%part(k))
        if (part%at > 0) call put_part('extras.'//trim(part%name), part%at, part%reals)
      end associate
    end do

  contains

    subroutine put_part(name, at, reals)
      character(len=*), intent(in) :: name
      integer(i4), intent(in) :: at, reals
      call archive%put_reals(name, reshape(additional%kept(:, at:at + reals - 1, :), &
                                           [lanes*reals, size(additional%kept, 3)]))
    end subroutine put_part
  end subroutine put_additional

  !> The same back; a law that the checkpoint does not have starts from nothing.
  subroutine get_additional(additional, blocks, archive, errors)
    type(dem_additional_type), intent(inout) :: additional
    integer(i4), intent(in) :: blocks
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: none(0), k

    if (.not. additional%active) return
    if (allocated(additional%kept)) deallocate (additional%kept)
    call move_additional(additional, blocks, none, none)
    do k = 1, most_parts
      associate (part => additional%part(k))
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
      additional%kept(:, at:at + reals - 1, :) = reshape(flat, [lanes, reals, blocks])
    end subroutine get_part
  end subroutine get_additional

  !> What is no list: bonds made and broken, and how what contacts keep is laid out.
  subroutine put_run_of_additional(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    type(dem_archive_type), intent(inout) :: archive
    if (.not. additional%active) return
    call archive%put_integers('extras.layout', reshape(int(layout_of(additional), i8), &
                                                       [layout_size, 1]))
    if (additional%bond_at > 0) call archive%put_integers('extras.bonds', &
      reshape([additional%made, additional%torn, additional%sheared], [3, 1]))
  end subroutine put_run_of_additional

  !> The bonds back.
  subroutine get_run_of_additional(additional, archive, errors)
    type(dem_additional_type), intent(inout) :: additional
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :)
    if (additional%bond_at == 0 .or. archive%find('extras.bonds') == 0) return
    call archive%get_integers('extras.bonds', 3, 1, counts, errors)
    if (errors%any()) return
    additional%made = counts(1, 1)
    additional%broken = real(counts(2:3, 1), wp)
    call count_broken(additional)
  end subroutine get_run_of_additional

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

  pure function layout_of(additional) result(layout)
    type(dem_additional_type), intent(in) :: additional
    integer(i4) :: layout(layout_size)
    layout = [additional%reals, additional%part%at]
  end function layout_of

  !> Records of contacts from a checkpoint with another layout: a law that it does not have starts
  !! from nothing, one that the run does not have is left out.
  pure subroutine fit_records(additional, layout, rows)
    type(dem_additional_type), intent(in) :: additional
    integer(i4), intent(in) :: layout(layout_size)     !! of the rows
    real(wp), allocatable, intent(inout) :: rows(:, :)  !! (before + layout(1), contacts)
    real(wp), allocatable :: fitted(:, :)
    integer(i4) :: own(layout_size), before, k, last

    own = layout_of(additional)
    if (all(own == layout)) return
    before = size(rows, 1) - layout(1)
    allocate (fitted(before + own(1), size(rows, 2)), source=0.0_wp)
    fitted(:before, :) = rows(:before, :)
    do k = 2, layout_size
      if (own(k) == 0 .or. layout(k) == 0) cycle
      last = additional%part(k - 1)%reals - 1
      fitted(before + own(k):before + own(k) + last, :) = &
        rows(before + layout(k):before + layout(k) + last, :)
    end do
    call move_alloc(fitted, rows)
  end subroutine fit_records
end module dem_additional_list
