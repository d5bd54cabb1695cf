!> The link of the liquid in a checkpoint of the coupling.
module cpl_pore_file
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use talus_hdf5, only: h5_file_type
  use cpl_pore, only: pore_link_type
  implicit none
  private
  public :: write_pore, read_pore_reference, read_pore_state

contains

  !> Reference, state and books.
  subroutine write_pore(file, link, errors)
    type(h5_file_type), intent(inout) :: file
    type(pore_link_type), intent(in) :: link
    type(error_list_type), intent(inout) :: errors
    if (.not. link%active) return
    call file%put('/pore/id', link%hull%ghost_id, errors)
    call file%put('/pore/x_ref', link%x_ref, errors)
    call file%put('/pore/u', link%u, errors)
    call file%put('/pore/v', link%v, errors)
    call file%put('/pore/v_before', link%v_before, errors)
    call file%put('/pore/w', link%w, errors)
    call file%put('/pore/start_force', link%start_force, errors)
    call file%put('/pore/force_put', link%force_put, errors)
    associate (b => link%books)
      call file%put('/pore/books', [b%content, b%entered, b%flow_work, b%darcy, b%work, &
                                    b%to_solid, b%lent, b%passed], errors)
    end associate
    if (.not. link%permeable) return
    call file%put('/pore/storage', link%storage, errors)
    call file%put('/pore/ahead', link%ahead, errors)
    call file%put('/pore/conduct', link%conduct, errors)
    call file%put('/pore/stiffness', [link%stiffness], errors)
    call file%put('/pore/mean_flow', link%mean_flow, errors)
    call file%put('/pore/p', link%p, errors)
    call file%put('/pore/kept', link%kept, errors)
  end subroutine write_pore

  !> What the maps and the admittance were made of.
  subroutine read_pore_reference(checkpoint, path, ids, link, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    integer(i8), allocatable, intent(out) :: ids(:)
    type(pore_link_type), intent(inout) :: link
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp) :: stiffness(1)

    stiffness = 0.0_wp
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call file%get('/pore/id', ids, errors)
    call file%get('/pore/x_ref', link%x_ref, errors)
    if (link%permeable) then
      call file%get('/pore/storage', link%storage, errors)
      call file%get('/pore/ahead', link%ahead, errors)
      call file%get('/pore/conduct', link%conduct, errors)
      call file%get_into('/pore/stiffness', stiffness, errors)
      link%stiffness = stiffness(1)
    end if
    call file%close(errors)
    if (errors%any()) return
    if (size(link%x_ref, 1) /= 3 .or. size(link%x_ref, 2) /= size(ids)) &
      call file%shape_fault('/pore/x_ref', shape(link%x_ref, i8), &
                            [3_i8, size(ids, kind=i8)], errors)
  end subroutine read_pore_reference

  !> The rest, into a link whose maps were rebuilt.
  subroutine read_pore_state(checkpoint, path, link, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    type(pore_link_type), intent(inout) :: link
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp) :: books(13)

    if (.not. link%active .or. errors%any()) return
    books = 0.0_wp
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call file%get_into('/pore/u', link%u, errors)
    call file%get_into('/pore/v', link%v, errors)
    call file%get_into('/pore/v_before', link%v_before, errors)
    call file%get_into('/pore/w', link%w, errors)
    call file%get_into('/pore/start_force', link%start_force, errors)
    call file%get_into('/pore/force_put', link%force_put, errors)
    call file%get_into('/pore/books', books, errors)
    if (link%permeable) then
      call file%get_into('/pore/p', link%p, errors)
      call file%get_into('/pore/kept', link%kept, errors)
      call file%get_into('/pore/mean_flow', link%mean_flow, errors)
    end if
    call file%close(errors)
    associate (b => link%books)
      b%content = books(1:2)
      b%entered = books(3:4)
      b%flow_work = books(5:6)
      b%darcy = books(7:8)
      b%work = books(9:10)
      b%to_solid = books(11)
      b%lent = books(12)
      b%passed = books(13)
    end associate
    link%books_new = link%books
  end subroutine read_pore_state
end module cpl_pore_file
