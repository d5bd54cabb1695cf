!> Checkpoints of a run: state, clock and works to and from an HDF5 file, bit for bit.
module dem_restart
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_h5_columns, only: get_columns
  use talus_hdf5, only: h5_file_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use dem_archive, only: dem_archive_type
  use dem_clock, only: dem_clock_type
  use dem_system, only: dem_system_type
  use dem_additional_list, only: layout_kept, fit_records, layout_size
  use dem_histories, only: dem_histories_type
  use dem_records, only: plain_contact_reals
  use dem_slabs, only: dem_slab_type, slab_grains
  use dem_store, only: put_grain_arrays, put_run, records
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

  integer(i8), parameter :: slab_contacts = 100000  !! read at a time

  !> The arrays of /state go to the file as they are put.
  type, extends(dem_archive_type) :: written_archive_type
    type(h5_file_type) :: file
    type(error_list_type) :: errors
  contains
    procedure :: put_reals => write_reals
    procedure :: put_integers => write_integers
  end type written_archive_type

contains

  !> Write a checkpoint of an accepted state; with a tag it is set apart.
  subroutine write_checkpoint(checkpoint, system, clock, histories, tag, errors)
    type(checkpoint_type), intent(inout) :: checkpoint
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(in) :: clock
    type(dem_histories_type), intent(in) :: histories
    character(len=*), intent(in) :: tag  !! '' for the run's own series
    type(error_list_type), intent(inout) :: errors
    type(written_archive_type) :: state

    associate (file => state%file)
      if (len(tag) > 0) then
        call checkpoint%begin(file, clock%time(), clock%steps, errors, tag)
      else
        call checkpoint%begin(file, clock%time(), clock%steps, errors)
      end if
      call file%group('/clock', errors)
      call file%put('/clock/reals', [clock%base, clock%dt, system%par%dt], errors)
      call file%put('/clock/integers', [clock%count, clock%steps, clock%unstable], errors)
      call file%put('/clock/driven_work', histories%driven_work, errors)
      call file%put('/clock/wall_work', histories%wall_work, errors)
      if (size(histories%surface_work) > 0) &
        call file%put('/clock/surface_work', histories%surface_work, errors)
      call file%group('/state', errors)
      if (system%owner_changed()) then
        call write_slabs(state, system)
        call put_run(system%dem_data_type, state)
      else
        call system%export_state(state)
      end if
      call errors%take(state%errors)
      call checkpoint%finish(file, errors)
    end associate
  end subroutine write_checkpoint

  subroutine write_reals(self, name, values)
    class(written_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(wp), intent(in), contiguous :: values(:, :)
    call self%file%put('/state/'//trim(name), values, self%errors)
  end subroutine write_reals

  subroutine write_integers(self, name, values)
    class(written_archive_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i8), intent(in), contiguous :: values(:, :)
    call self%file%put('/state/'//trim(name), values, self%errors)
  end subroutine write_integers

  !> Grains of many ranks and what their contacts keep, slab by slab.
  subroutine write_slabs(state, system)
    type(written_archive_type), intent(inout) :: state
    type(dem_system_type), intent(inout) :: system
    type(dem_slab_type) :: slab
    integer(i4) :: low, high
    integer(i8) :: done

    done = 0
    do low = 1, system%grains%n, slab_grains
      high = min(low + slab_grains - 1, system%grains%n)
      associate (id => system%grains%id)
        call system%rank_team%some_grains(id(low:high), slab)
        state%file%slab = [low - 1, system%grains%n]
        call put_grain_arrays(slab%some, state)
        call write_records(id(low), id(high))
      end associate
    end do
    if (system%planes%n > 0) call write_records(-int(system%planes%n, i8), -1_i8)
    state%file%slab = [0, -1]
    call state%put_integers(records//'.built_at', reshape([system%pairs%built_at], [1, 1]))

  contains

    subroutine write_records(first, last)
      integer(i8), intent(in) :: first, last
      real(wp), allocatable :: rows(:, :)
      call system%rank_team%some_records(first, last, rows)
      state%file%slab = [done, nint(system%rank_team%marks%contacts(2), i8)]
      call state%put_reals(records, rows)
      done = done + size(rows, 2)
    end subroutine write_records
  end subroutine write_slabs

  !> Go on from a checkpoint; the system holds the same grains, not yet initialised.
  subroutine read_checkpoint(checkpoint, path, system, clock, histories, deck_changed, errors)
    type(checkpoint_type), intent(inout) :: checkpoint
    character(len=*), intent(in) :: path
    type(dem_system_type), intent(inout) :: system
    type(dem_clock_type), intent(inout) :: clock
    type(dem_histories_type), intent(inout) :: histories
    logical, intent(out) :: deck_changed
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    type(dem_archive_type) :: archive
    real(wp), allocatable :: reals(:), driven(:), walls(:), surfaces(:)
    integer(i8), allocatable :: integers(:)
    integer(i4) :: before, layout(layout_size)
    logical :: slabs

    before = errors%count
    deck_changed = .false.
    call checkpoint%open(path, file, info, errors)
    if (errors%count > before) return
    call file%get('/clock/reals', reals, errors)
    call file%get('/clock/integers', integers, errors)
    call file%get('/clock/driven_work', driven, errors)
    call file%get('/clock/wall_work', walls, errors)
    if (file%exists('/clock/surface_work')) call file%get('/clock/surface_work', surfaces, errors)
    slabs = system%apart .and. file%exists('/state/'//records)
    call read_archive(file, slabs, archive, errors)
    if (.not. slabs) call file%close(errors)
    if (errors%count > before) return
    call check_clock(path, reals, integers, errors)
    if (errors%count > before) return
    if (size(driven) /= size(histories%driven_work) .or. &
        size(walls) /= size(histories%wall_work)) then
      call errors%add('I235', "checkpoint '"//path//"' has "//str(size(driven))// &
                      ' driven grains and '//str(size(walls))//' walls, the deck has '// &
                      str(size(histories%driven_work))//' and '// &
                      str(size(histories%wall_work)), path, &
                      'restart with the deck that made it, or start from the beginning')
      return
    end if
    histories%driven_work = driven
    histories%wall_work = walls
    clock%base = reals(1)
    clock%dt = reals(2)
    clock%count = integers(1)
    clock%steps = integers(2)
    clock%unstable = integers(3)
    system%par%dt = reals(3)
    call system%import_state(archive, errors)
    layout = layout_kept(archive)
    call archive%clear()
    if (slabs .and. errors%count == before) call read_slabs(file, layout, system, errors)
    if (slabs) call file%close(errors)
    if (errors%count == before .and. allocated(surfaces)) &
      call take_surface_work(path, surfaces, system%surfaces%parts, histories, errors)
    deck_changed = info%deck_hash /= checkpoint%deck_hash
  end subroutine read_checkpoint

  !> Works of the parts of surfaces, of intervals that are over (I229 where they are not as many).
  subroutine take_surface_work(path, work, parts, histories, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: work(:)  !! [J]
    integer(i4), intent(in) :: parts
    type(dem_histories_type), intent(inout) :: histories
    type(error_list_type), intent(inout) :: errors
    if (all(size(work) /= [size(histories%surface_work), int(parts)])) &
      call errors%add('I229', "checkpoint '"//path//"' has the work of "//str(size(work))// &
                      ' surfaces, not of '//str(parts), path//':/clock/surface_work', &
                      'the checkpoint belongs to another packing, deck or version')
    histories%surface_work = work
  end subroutine take_surface_work

  !> Three reals: time, steps [s], and three counts.
  subroutine check_clock(path, reals, integers, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: reals(:)
    integer(i8), intent(in) :: integers(:)
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: hint = 'the checkpoint belongs to another deck or version'
    if (size(reals) /= 3 .or. size(integers) /= 3) then
      call errors%add('I229', "checkpoint '"//path//"' has "//str(size(reals))//' times and '// &
                      str(size(integers))//' counts of steps, not 3 and 3', path//':/clock', hint)
    else if (any(integers < 0)) then
      call errors%add('I229', "checkpoint '"//path//"' counts "//str(minval(integers))//' steps', &
                      path//':/clock/integers', hint)
    else if (any(reals(2:) < 0.0_wp)) then
      call errors%add('I229', "checkpoint '"//path//"' has a step of "//str(minval(reals(2:)))// &
                      ' s', path//':/clock/reals', hint)
    end if
  end subroutine check_clock

  !> Contacts for many ranks, some at a time.
  subroutine read_slabs(file, layout, system, errors)
    type(h5_file_type), intent(inout) :: file
    integer(i4), intent(in) :: layout(layout_size)  !! of what additional contact models keep
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    integer(i8) :: done
    integer(i4) :: wanted
    call system%rank_team%begin_again(system%dem_data_type)
    wanted = plain_contact_reals + layout(1)
    done = 0
    do
      call get_columns(file, '/state/'//records, done + 1, slab_contacts, rows, errors)
      if (errors%any()) return
      if (done == 0 .and. size(rows, 1) /= wanted) then
        call errors%add('I229', 'checkpoint: '//records//' has '//str(size(rows, 1))// &
                        ' values a contact, not '//str(wanted), &
                        file%path, 'the checkpoint belongs to another packing, deck or version')
        return
      end if
      if (size(rows, 2) == 0) exit
      call fit_records(system%pairs%additional, layout, rows)
      call system%rank_team%add_records(rows)
      done = done + size(rows, 2)
    end do
    call system%rank_team%receive_records(system%dem_data_type)
  end subroutine read_slabs

  subroutine read_archive(file, slabs, archive, errors)
    type(h5_file_type), intent(inout) :: file
    logical, intent(in) :: slabs  !! contacts are read elsewhere
    type(dem_archive_type), intent(inout) :: archive
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: reals(:, :)
    integer(i8), allocatable :: integers(:, :)
    integer(i4) :: k, before

    before = errors%count
    archive%path = file%path
    call file%names('/state', names)
    do k = 1, size(names)
      if (slabs .and. names(k)%s == records) cycle
      if (file%class_of('/state/'//names(k)%s) == 'integer') then
        call file%get('/state/'//names(k)%s, integers, errors)
        if (errors%count == before) call archive%put_integers(names(k)%s, integers)
      else
        call file%get('/state/'//names(k)%s, reals, errors)
        if (errors%count == before) call archive%put_reals(names(k)%s, reals)
      end if
    end do
  end subroutine read_archive
end module dem_restart
