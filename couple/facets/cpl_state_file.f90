!> The state of the coupling itself in a checkpoint: reference, motion, forces, relaxation, works.
module cpl_state_file
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use talus_hdf5, only: h5_file_type
  use cpl_interface, only: interface_type
  use cpl_pore_file, only: write_pore
  implicit none
  private
  public :: write_state, read_state, read_reference

contains

  !> Write <stem>.<tag>.chk.h5.
  subroutine write_state(checkpoint, face, time, tag, errors)
    type(checkpoint_type), intent(inout) :: checkpoint
    type(interface_type), intent(in) :: face
    real(wp), intent(in) :: time  !! s
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file

    call checkpoint%begin(file, time, face%step, errors, tag)
    call file%attr_put('/', 'map_hash', face%transfer%hash(face%map), errors)
    call file%put('/ghosts/id', face%map%ghost_id, errors)
    call file%put('/ghosts/x_ref', face%place%x_ref, errors)
    call file%put('/ghosts/quat', face%motion%quat, errors)
    call file%put('/ghosts/p_mean', face%forces%p_mean, errors)
    call file%put('/ghosts/p_end', face%forces%p_end, errors)
    call file%put('/ghosts/p_before', face%forces%p_before, errors)
    call file%put('/ghosts/p_put', face%forces%p_put, errors)
    call file%put('/ghosts/held', face%relax%held, errors)
    call file%put('/ghosts/residual', face%relax%residual, errors)
    call file%put('/nodes/id', face%map%node_id, errors)
    call file%put('/nodes/u', face%motion%u, errors)
    call file%put('/nodes/w', face%motion%w, errors)
    call file%put('/nodes/drift', face%motion%drift, errors)
    call file%put('/nodes/u_start', face%place%u_start, errors)
    call file%put('/nodes/v', face%motion%v, errors)
    call file%put('/nodes/v_before', face%motion%v_before, errors)
    call file%put('/nodes/dead_load', face%start%dead_load, errors)
    call file%put('/numbers', [face%ledger%grains_work, face%ledger%solid_work, &
      face%ledger%work_turnover, face%ledger%lost_impulse, face%springs%stiffness, &
      face%relax%factor, face%watch%contact_stiffness, face%watch%force_at_check, &
      face%ledger%largest], errors)
    call file%put('/counts', [face%step, face%ledger%all_iterations, int(face%watch%outgrown, i8), &
                              int(face%watch%refactored, i8), merge(1_i8, 0_i8, &
                              face%relax%begun)], errors)
    call file%put('/pieces', face%pieces%kept(), errors)
    if (allocated(face%start%start_stress)) then
      call file%put('/solid/start_stress', face%start%start_stress, errors)
      call file%put('/solid/start_load', face%start%start_load, errors)
      if (allocated(face%start%start_couple)) then
        call file%put('/solid/start_couple', face%start%start_couple, errors)
        call file%put('/solid/start_moment', face%start%start_moment, errors)
      end if
    end if
    call file%put('/scalars/grains', face%ledger%grains, errors)
    call file%put('/scalars/solid', face%ledger%solid, errors)
    call write_pore(file, face%pore, errors)
    call checkpoint%finish(file, errors)
  end subroutine write_state

  !> Ids and reference positions of the ghosts: the operators are made from them.
  subroutine read_reference(checkpoint, path, ids, x_ref, map_hash, time, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    integer(i8), allocatable, intent(out) :: ids(:)
    real(wp), allocatable, intent(out) :: x_ref(:, :)
    character(len=:), allocatable, intent(out) :: map_hash
    real(wp), intent(out) :: time  !! s
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info

    map_hash = ''
    time = 0.0_wp
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    time = info%time
    call file%attr_get('/', 'map_hash', map_hash, errors)
    call file%get('/ghosts/id', ids, errors)
    call file%get('/ghosts/x_ref', x_ref, errors)
    call file%close(errors)
    if (errors%any()) return
    if (size(x_ref, 1) /= 3 .or. size(x_ref, 2) /= size(ids)) &
      call file%shape_fault('/ghosts/x_ref', shape(x_ref, i8), [3_i8, size(ids, kind=i8)], errors)
  end subroutine read_reference

  !> The rest, into an interface whose map was rebuilt.
  subroutine read_state(checkpoint, path, face, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    type(interface_type), intent(inout) :: face
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp) :: numbers(9), pieces(6)
    integer(i8) :: counts(5)

    numbers = 0.0_wp
    counts = 0
    pieces = face%pieces%kept()
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call file%get_into('/ghosts/quat', face%motion%quat, errors)
    call file%get_into('/ghosts/p_mean', face%forces%p_mean, errors)
    call file%get_into('/ghosts/p_end', face%forces%p_end, errors)
    call file%get_into('/ghosts/p_before', face%forces%p_before, errors)
    call file%get_into('/ghosts/p_put', face%forces%p_put, errors)
    call file%get_into('/ghosts/held', face%relax%held, errors)
    call file%get_into('/ghosts/residual', face%relax%residual, errors)
    call file%get_into('/nodes/u', face%motion%u, errors)
    call file%get_into('/nodes/w', face%motion%w, errors)
    call file%get_into('/nodes/drift', face%motion%drift, errors)
    call file%get_into('/nodes/u_start', face%place%u_start, errors)
    call file%get_into('/nodes/v', face%motion%v, errors)
    call file%get_into('/nodes/v_before', face%motion%v_before, errors)
    call file%get_into('/nodes/dead_load', face%start%dead_load, errors)
    call file%get_into('/numbers', numbers, errors)
    call file%get_into('/counts', counts, errors)
    if (file%exists('/pieces')) call file%get_into('/pieces', pieces, errors)
    if (file%exists('/solid/start_stress')) then
      call file%get('/solid/start_stress', face%start%start_stress, errors)
      call file%get('/solid/start_load', face%start%start_load, errors)
      if (file%exists('/solid/start_couple')) then
        call file%get('/solid/start_couple', face%start%start_couple, errors)
        call file%get('/solid/start_moment', face%start%start_moment, errors)
      end if
    end if
    call file%get_into('/scalars/grains', face%ledger%grains, errors)
    call file%get_into('/scalars/solid', face%ledger%solid, errors)
    call file%close(errors)
    face%ledger%grains_work = numbers(1)
    face%ledger%solid_work = numbers(2)
    face%ledger%work_turnover = numbers(3)
    face%ledger%lost_impulse = numbers(4)
    if (numbers(5) + face%springs%liquid > 0.0_wp) &
      call face%springs%make(numbers(5), face%map, face%transfer, face%place%radius)
    call face%relax%resume(numbers(6), counts(5) == 1)
    face%watch%contact_stiffness = numbers(7)
    face%watch%force_at_check = numbers(8)
    face%ledger%largest = numbers(9)
    call face%pieces%resume(pieces)
    face%step = counts(1)
    face%ledger%all_iterations = counts(2)
    face%watch%outgrown = int(counts(3), i4)
    face%watch%refactored = int(counts(4), i4)
    call face%resume()
  end subroutine read_state
end module cpl_state_file
