!> Liquid of capillary bridges as a run counts it: drawn as bridges form, returned as they break,
!! held by those that are there.
module dem_liquid_counts
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_additional_numbers, only: additional_work_count, work_formed, work_ruptured, &
    work_drawn, work_returned
  use dem_additional_state, only: dem_additional_type, kept_places_type
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: capillary_at, count_liquid, held_liquid, put_liquid, get_liquid

  integer(i4), parameter :: counted = 4  !! reals that a checkpoint keeps

contains

  !> First of the reals that a bridge keeps, its volume; 0: the run has no bridges.
  pure integer(i4) function capillary_at(places) result(at)
    class(kept_places_type), intent(in) :: places
    at = places%first_of('capillary')
  end function capillary_at

  !> Bridges that formed and broke in a step.
  pure subroutine count_liquid(additional, works)
    type(dem_additional_type), intent(inout) :: additional
    real(wp), intent(in) :: works(additional_work_count)
    associate (l => additional%liquid)
      l%formed = l%formed + works(work_formed)
      l%ruptured = l%ruptured + works(work_ruptured)
      l%drawn = l%drawn + works(work_drawn)
      l%returned = l%returned + works(work_returned)
    end associate
  end subroutine count_liquid

  !> Bridges that are there [-] and their liquid [m^3], of grains and at surfaces; of a whole that
  !! is spread over ranks those of their last report.
  pure function held_liquid(d) result(held)
    type(dem_data_type), intent(in) :: d
    real(wp) :: held(2)
    integer(i4) :: at, k
    real(wp) :: share
    held = [d%pairs%additional%liquid%bridges, d%pairs%additional%liquid%held]
    at = capillary_at(d%pairs%additional)
    if (at == 0 .or. .not. allocated(d%pairs%additional%kept)) return
    held = 0.0_wp
    do k = 1, d%pairs%blocks
      share = 1.0_wp
      if (allocated(d%pairs%share)) share = d%pairs%share(k)
      associate (weight => d%pairs%weight(:, min(k, size(d%pairs%weight, 2))), &
                 volume => d%pairs%additional%kept(:, at, k))
        held = held + share*[sum(weight, mask=volume > 0.0_wp), sum(weight*volume)]
      end associate
    end do
    if (.not. allocated(d%surfaces%list%kept)) return
    if (size(d%surfaces%list%kept) == 0) return
    do k = 1, d%surfaces%list%near
      associate (volume => d%surfaces%list%kept(:d%surfaces%list%contacts(k), at, k))
        held = held + [real(count(volume > 0.0_wp), wp), sum(volume)]
      end associate
    end do
  end function held_liquid

  subroutine put_liquid(additional, archive)
    type(dem_additional_type), intent(in) :: additional
    class(dem_archive_type), intent(inout) :: archive
    if (capillary_at(additional) == 0) return
    associate (l => additional%liquid)
      call archive%put_reals('extras.liquid', reshape([l%formed, l%ruptured, l%drawn, &
                                                       l%returned], [counted, 1]))
    end associate
  end subroutine put_liquid

  subroutine get_liquid(additional, archive, errors)
    type(dem_additional_type), intent(inout) :: additional
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: counts(:, :)
    if (capillary_at(additional) == 0 .or. archive%find('extras.liquid') == 0) return
    call archive%get_reals('extras.liquid', counted, 1, counts, errors)
    if (errors%any()) return
    associate (l => additional%liquid)
      l%formed = counts(1, 1)
      l%ruptured = counts(2, 1)
      l%drawn = counts(3, 1)
      l%returned = counts(4, 1)
    end associate
  end subroutine get_liquid
end module dem_liquid_counts
