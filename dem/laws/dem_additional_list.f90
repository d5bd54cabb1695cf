!> History of the additional contact models: inherited when the list is rebuilt, written to
!! checkpoints and read back.
module dem_additional_list
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_sizes, only: lanes
  use dem_additional_numbers, only: additional_work_count
  use dem_additional_state, only: dem_additional_type, kept_places_type, most_parts
  use dem_bond_counts, only: count_lost, put_bonds, get_bonds
  use dem_liquid_counts, only: put_liquid, get_liquid
  implicit none
  private
  public :: move_additional, mark_touched, held_lanes, held_of, put_additional, get_additional
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
    call count_lost(additional, kept)
    call move_alloc(kept, additional%kept)
    if (allocated(additional%work)) deallocate (additional%work)
    allocate (additional%work(additional_work_count, blocks), source=0.0_wp)
  end subroutine move_additional

  !> Blocks with a contact that reaches over a gap are worked too.
  pure subroutine mark_touched(additional, touched)
    type(dem_additional_type), intent(in) :: additional
    logical, intent(inout) :: touched(:)  !! (blocks)
    integer(i4) :: k
    if (.not. any(additional%part%holds .and. additional%part%at > 0)) return
    do k = 1, size(touched)
      touched(k) = touched(k) .or. any(held_lanes(additional, k))
    end do
  end subroutine mark_touched

  !> Lanes of block k that a model holds, over a gap or not.
  pure function held_lanes(additional, k) result(held)
    type(dem_additional_type), intent(in) :: additional
    integer(i4), intent(in) :: k
    logical :: held(lanes)
    held = held_of(additional%kept_places_type, additional%kept(:, :, k))
  end function held_lanes

  !> The same of lanes that keep these.
  pure function held_of(places, kept) result(held)
    type(kept_places_type), intent(in) :: places
    real(wp), intent(in) :: kept(:, :)  !! (lanes, reals)
    logical :: held(lanes)
    integer(i4) :: k
    held = .false.
    do k = 1, most_parts
      if (places%part(k)%at == 0 .or. .not. places%part(k)%holds) cycle
      held = held .or. kept(:, places%part(k)%at) > 0.0_wp
    end do
  end function held_of

  !> Each law's reals by name, so that a restart may add or drop a law.
  subroutine put_additional(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    class(dem_archive_type), intent(inout) :: archive
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

  !> What is no list: bonds made and broken, liquid of bridges, and how what contacts keep is laid
  !! out.
  subroutine put_run_of_additional(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    class(dem_archive_type), intent(inout) :: archive
    if (.not. additional%active) return
    call archive%put_integers('extras.layout', reshape(int(layout_of(additional), i8), &
                                                       [layout_size, 1]))
    call put_bonds(additional, archive)
    call put_liquid(additional, archive)
  end subroutine put_run_of_additional

  !> The bonds and the liquid back.
  subroutine get_run_of_additional(additional, archive, errors)
    type(dem_additional_type), intent(inout) :: additional
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    call get_bonds(additional, archive, errors)
    if (.not. errors%any()) call get_liquid(additional, archive, errors)
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
