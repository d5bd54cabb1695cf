!> Memory that a deck needs, on stdout, for --check: of one process after the first forces, of ranks
!! after their peaks, of other numbers of ranks as predicted.
module dem_memory
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_memory_text, only: foretold_type, text_of_ranks, span
  use talus_system, only: memory_free, memory_resident, memory_most
  use talus_text, only: str
  use dem_archive, only: dem_archive_type
  use dem_rank_memory, only: rank_loads_type, find_loads, memory_estimate
  use dem_model, only: dem_model_type
  use dem_relist, only: rebuild_list
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: foretell_memory, check_ranks

  real(wp), parameter :: mebibyte = 1048576.0_wp

  !> Arrays of a checkpoint that nobody writes.
  type, extends(dem_archive_type) :: unwritten_archive_type
  contains
    procedure :: put_reals => no_reals
    procedure :: put_integers => no_integers
  end type unwritten_archive_type

contains

  !> Each planned rank must have a grain (D291).
  subroutine check_ranks(model, errors)
    type(dem_model_type), intent(in) :: model
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: free
    free = int(count(model%system%grains%kind == kind_free), i4)
    if (model%options%ranks <= free) return
    call errors%add('D291', 'there are '//str(free)//' free grains for '// &
                    str(model%options%ranks)//' ranks', 'command line', &
                    'some 1500 grains a rank and more are worth it')
  end subroutine check_ranks

  !> Of the run that was prepared.
  subroutine foretell_memory(model, foretold)
    type(dem_model_type), intent(inout) :: model
    type(foretold_type), intent(out) :: foretold
    if (allocated(model%system%rank_team)) then
      call memory_of_ranks(model%system, gathers(model), foretold)
    else
      call memory_of_one(model%system, foretold%text)
      foretold%most = [memory_most()/mebibyte]
      if (model%options%ranks > 0) foretold%text = foretold%text//new_line('a')//estimated(model)
    end if
    foretold%entities = model%system%grains%n
    if (model%breakage%active()) foretold%text = foretold%text//model%breakage%foretold()
  end subroutine foretell_memory

  !> Does anything require that the whole be gathered from time to time?
  logical function gathers(model)
    type(dem_model_type), intent(in) :: model
    gathers = model%needs_whole()
    if (model%deck%count('checkpoint') == 0) return
    gathers = gathers .or. model%system%surfaces%n > 0
  end function gathers

  !> Now, at the peak of steps with new lists, and at that of a checkpoint. Lists are made twice:
  !! the second carries over all that the first holds, and leaves gaps that the heap keeps. The
  !! state is not that of the start any more.
  subroutine memory_of_one(system, text)
    type(dem_system_type), intent(inout) :: system
    character(len=:), allocatable, intent(out) :: text
    type(unwritten_archive_type) :: archive
    type(error_list_type) :: ignored  ! the run will tell
    integer(i8) :: now
    integer(i4) :: k
    now = memory_resident()
    text = 'memory: '//short_number(now/mebibyte)//' MiB in use, '// &
           str(now/max(system%grains%n, 1))//' bytes a grain'
    do k = 1, 3
      if (system%par%dt > 0.0_wp) call system%step(1_i4, ignored)
      if (k < 3) call rebuild_list(system%dem_data_type, 0.0_wp, 0.0_wp)
    end do
    text = text//'; '//short_number(memory_most()/mebibyte)//' MiB in steps with new lists'
    if (memory_free() <= memory_resident()) return
    call system%export_state(archive)
    text = text//'; '//short_number(memory_most()/mebibyte)//' MiB with a checkpoint'
  end subroutine memory_of_one

  subroutine no_reals(self, name, values)
    class(unwritten_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous :: values(:, :)
  end subroutine no_reals

  subroutine no_integers(self, name, values)
    class(unwritten_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous :: values(:, :)
  end subroutine no_integers

  !> Most of each rank [MiB]; in words with the grains and mirrors that they hold.
  subroutine memory_of_ranks(system, gathers, foretold)
    type(dem_system_type), intent(inout) :: system
    logical, intent(in) :: gathers  !! the whole from time to time
    type(foretold_type), intent(inout) :: foretold
    real(wp), allocatable :: rows(:, :)
    call system%rank_team%try_out(system%dem_data_type, gathers, rows)
    foretold%most = rows(1, :)/mebibyte
    foretold%text = text_of_ranks(foretold%most)//new_line('a')// &
      holdings(rows(2, :), rows(3, :), rows(4, :))
  end subroutine memory_of_ranks

  !> The same as predicted for other numbers of ranks.
  function estimated(model) result(text)
    type(dem_model_type), intent(in) :: model
    character(len=:), allocatable :: text
    type(rank_loads_type) :: loads
    real(wp), allocatable :: most(:)
    call find_loads(model%system%dem_data_type, model%options%ranks, loads)
    most = memory_estimate(model%system%dem_data_type, loads, .not. model%starts_whole(), &
                           gathers(model))
    text = 'memory of '//str(size(most))//' ranks, foretold to a fifth: the first '// &
           short_number(most(1)/mebibyte)//' MiB'
    if (size(most) > 1) text = text//', the others '//span(most(2:)/mebibyte)//' MiB'
    text = text//new_line('a')//holdings(real(loads%own, wp), real(loads%mirrors, wp), &
                                         real(loads%pairs, wp))
  end function estimated

  function holdings(own, mirrors, pairs) result(text)
    real(wp), intent(in) :: own(:), mirrors(:), pairs(:)  !! (ranks)
    character(len=:), allocatable :: text
    text = 'a rank holds '//span(own)//' free grains, '//span(mirrors)// &
           ' mirrors of others, '//span(pairs)//' candidate pairs'
  end function holdings
end module dem_memory
