!> Measure a field file afterwards: `talus-dem --measure=run.h5 deck.nml`, by the same procedures as
!! in the run. The deck gives regions, grids, masses and laws; the file positions and contacts.
module dem_measure_file
  use, intrinsic :: iso_fortran_env, only: output_unit
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_files, only: make_folder, folder_of
  use talus_hdf5, only: h5_file_type
  use talus_text, only: str, string_type
  use dem_model, only: dem_model_type
  use dem_system, only: dem_contacts_type
  implicit none
  private
  public :: measure_file

contains

  !> All steps of a field file into the files that the run would have written; the deck is read.
  !! Faults: D264 nothing to measure, I260 no contacts in the file, I261 other grains.
  subroutine measure_file(model, path, errors)
    type(dem_model_type), intent(inout) :: model
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(string_type), allocatable :: names(:)
    type(dem_contacts_type) :: list
    real(wp) :: time
    integer(i4) :: k

    if (model%measures%n + model%measures%grids == 0) then
      call errors%add('D264', 'the deck has no measures', model%deck%source%path, &
                      "add &measure id = 'whole' / or &grid ... /")
      return
    end if
    call file%open(path, errors, format='talus-grains')
    if (errors%any()) return
    call file%names('/steps', names)
    if (size(names) == 0) call errors%add('I260', 'there is no step in the file', path, &
                                          'the run has written no output yet')
    if (.not. errors%any()) call make_folder(folder_of(model%stem), errors)
    do k = 1, size(names)
      if (errors%any()) exit
      call file%attr_get('/steps/'//names(k)%s, 'time', time, errors)
      call read_step(model, file, path, '/steps/'//names(k)%s, list, errors)
      if (k == 1 .and. .not. errors%any()) call model%measures%open(model%stem, -1.0_wp, errors)
      if (.not. errors%any()) &
        call model%measures%write(time, model%system, .true., errors, list)
    end do
    call file%close(errors)
    call model%measures%close(errors)
    if (.not. errors%any()) call say_files(model, size(names))
  end subroutine measure_file

  !> Grains and contacts of one step.
  subroutine read_step(model, file, path, group, list, errors)
    type(dem_model_type), intent(inout) :: model
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path, group
    type(dem_contacts_type), intent(inout) :: list
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: id(:)
    logical :: same

    if (.not. file%exists(group//'/contacts/stiffness')) then
      call errors%add('I260', 'the file has no contacts with stiffness', path//', '//group, &
                      "run with &output fields = 'contacts'")
      return
    end if
    call file%get(group//'/grains/id', id, errors)
    if (errors%any()) return
    associate (g => model%system%grains)
      same = size(id) == g%n
      if (same) same = all(id == g%id)
      if (.not. same) then
        call errors%add('I261', 'the file has other grains than the packing of the deck ('// &
                        str(size(id))//' and '//str(g%n)//')', path//', '//group, &
                        'give the deck with which the run was made')
        return
      end if
      call file%get_into(group//'/grains/x', g%x, errors)
      call file%get_into(group//'/grains/quat', g%quat, errors)
      call file%get_into(group//'/grains/v', g%v, errors)
      call file%get_into(group//'/grains/omega', g%omega, errors)
      call file%get_into(group//'/grains/kind', g%kind, errors)
    end associate
    if (model%system%cell%active .and. file%exists(group//'/cell/vectors')) then
      call file%get_into(group//'/cell/vectors', model%system%cell%vectors, errors)
      call file%get_into(group//'/cell/rate', model%system%cell%rate, errors)
      model%system%cell%rate = transpose(model%system%cell%rate)
    end if
    call file%get(group//'/contacts/ids', list%ids, errors)
    call file%get(group//'/contacts/point', list%point, errors)
    call file%get(group//'/contacts/normal', list%normal, errors)
    call file%get(group//'/contacts/force', list%force, errors)
    call file%get(group//'/contacts/stiffness', list%stiffness, errors)
    call file%get(group//'/contacts/overlap', list%overlap, errors)
    if (.not. errors%any()) list%n = size(list%overlap)
  end subroutine read_step

  subroutine say_files(model, steps)
    type(dem_model_type), intent(in) :: model
    integer, intent(in) :: steps
    integer(i4) :: k
    write (output_unit, '(a)') str(steps)//' steps measured:'
    associate (m => model%measures)
      do k = 1, m%n
        write (output_unit, '(a)') model%stem//'_measure_'//m%item(k)%id//'.csv'
        if (m%item(k)%moduli) &
          write (output_unit, '(a)') model%stem//'_moduli_'//m%item(k)%id//'.csv', &
          model%stem//'_micromorphic_'//m%item(k)%id//'.csv'
      end do
      do k = 1, m%grids
        write (output_unit, '(a)') model%stem//'_grid_'//m%grid(k)%id//'.h5'
      end do
    end associate
  end subroutine say_files
end module dem_measure_file
