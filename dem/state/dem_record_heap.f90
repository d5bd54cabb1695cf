!> Contacts of a checkpoint that a rank keeps from the broadcast: those of its own grains.
module dem_record_heap
  use talus_kinds, only: wp, i4
  use dem_record_layout, only: at_first_id, at_second_id
  use dem_records, only: contact_reals, index_of
  use dem_state, only: dem_data_type, kind_free
  implicit none
  private
  public :: record_heap_type

  type :: record_heap_type
    integer(i4) :: n = 0
    real(wp), allocatable :: row(:, :)  !! (reals, room), see dem_records
  contains
    procedure :: keep
    procedure :: take
  end type record_heap_type

contains

  !> Keep what touches a free grain of this part that is no mirror.
  subroutine keep(self, part, rows)
    class(record_heap_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: rows(:, :)
    real(wp), allocatable :: longer(:, :)
    integer(i4) :: k
    do k = 1, size(rows, 2)
      if (.not. (is_own(part, rows(at_first_id, k)) .or. is_own(part, rows(at_second_id, k)))) cycle
      if (.not. allocated(self%row)) allocate (self%row(size(rows, 1), 1024))
      if (self%n == size(self%row, 2)) then
        allocate (longer(size(rows, 1), 2*self%n))
        longer(:, :self%n) = self%row
        call move_alloc(longer, self%row)
      end if
      self%n = self%n + 1
      self%row(:, self%n) = rows(:, k)
    end do
  end subroutine keep

  !> All that was kept.
  subroutine take(self, part, rows)
    class(record_heap_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: part
    real(wp), allocatable, intent(out) :: rows(:, :)
    if (self%n > 0) then
      allocate (rows, source=self%row(:, :self%n))
      deallocate (self%row)
    else
      allocate (rows(contact_reals(part), 0))
    end if
    self%n = 0
  end subroutine take

  pure logical function is_own(part, id)
    type(dem_data_type), intent(in) :: part
    real(wp), intent(in) :: id
    integer(i4) :: i
    is_own = .false.
    if (id < 0.0_wp) return
    i = index_of(part, id)
    if (i > 0) is_own = part%grains%kind(i) == kind_free
  end function is_own
end module dem_record_heap
