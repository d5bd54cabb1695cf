!> Memory that a deck takes, on stdout, for --check: of one process after the first forces, of ranks
!! after all that makes them large was tried out.
module dem_memory
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: wp, i4, i8
  use talus_log, only: short_number
  use talus_system, only: memory_free, memory_resident, memory_most
  use talus_text, only: str
  use dem_archive, only: dem_archive_type
  use dem_model, only: dem_model_type
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: report_memory

  real(wp), parameter :: mebibyte = 1048576.0_wp

contains

  !> Of the run that was prepared.
  subroutine report_memory(model)
    type(dem_model_type), intent(inout) :: model
    character(len=:), allocatable :: text
    if (allocated(model%system%crew)) then
      text = memory_of_ranks(model%system, gathers(model))
    else
      text = memory_of_one(model%system)
    end if
    write (output_unit, '(a)') text
    flush (output_unit)
  end subroutine report_memory

  !> Is there anything for which ranks hand in the whole from time to time?
  logical function gathers(model)
    type(dem_model_type), intent(in) :: model
    gathers = model%needs_whole()
    if (model%deck%count('checkpoint') == 0) return
    gathers = gathers .or. model%system%surfaces%n > 0 .or. model%system%pairs%extras%active
  end function gathers

  !> Now, and where there is room for it as checkpoints ask for it.
  function memory_of_one(system) result(text)
    type(dem_system_type), intent(in) :: system
    character(len=:), allocatable :: text
    type(dem_archive_type) :: archive
    integer(i8) :: now
    now = memory_resident()
    text = 'memory: '//short_number(now/mebibyte)//' MiB in use, '// &
           str(now/max(system%grains%n, 1))//' bytes a grain'
    if (memory_free() <= now) return
    call system%export_state(archive)
    text = text//'; '//short_number(memory_most()/mebibyte)//' MiB with a checkpoint'
  end function memory_of_one

  !> Most of the first rank and of the others, and the grains and mirrors that they hold.
  function memory_of_ranks(system, gathers) result(text)
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: gathers  !! the whole from time to time
    character(len=:), allocatable :: text
    real(wp), allocatable :: rows(:, :)
    call system%crew%try_out(system%dem_data_type, gathers, rows)
    text = 'memory of '//str(size(rows, 2))//' ranks at most: the first '// &
           short_number(rows(1, 1)/mebibyte)//' MiB, the others '// &
           span(rows(1, 2:)/mebibyte)//' MiB'//new_line('a')// &
           'a rank holds '//span(rows(2, :))//' free grains, '//span(rows(3, :))// &
           ' mirrors of others, '//span(rows(4, :))//' candidate pairs'
  end function memory_of_ranks

  !> Least and most.
  function span(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    text = short_number(minval(values))
    if (maxval(values) > minval(values)) text = text//' to '//short_number(maxval(values))
  end function span
end module dem_memory
