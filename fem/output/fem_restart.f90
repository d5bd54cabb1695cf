!> Checkpoints of a body: everything that changes in time, to and from an HDF5 file.
module fem_restart
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_h5_shaped, only: get_shaped
  use talus_hdf5, only: h5_file_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use fem_types, only: fem_energy_type
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: write_checkpoint, read_checkpoint

contains

  !> Write the accepted state; tag '' is the run's own series. All ranks call it together.
  subroutine write_checkpoint(checkpoint, body, analysis, steps, tag, errors)
    type(checkpoint_type), intent(inout) :: checkpoint
    type(fem_body_type), intent(in) :: body
    class(fem_analysis_type), intent(in) :: analysis
    integer(i8), intent(in) :: steps
    character(len=*), intent(in) :: tag
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4) :: k

    if (.not. body%whole%ranks%leads()) then
      call give_blocks(body)
      if (body%matter%active) call give_points(body)
      return
    end if
    if (len(tag) > 0) then
      call checkpoint%begin(file, body%accepted%time, steps, errors, tag)
    else
      call checkpoint%begin(file, body%accepted%time, steps, errors)
    end if
    call file%group('/state', errors)
    call file%attr_put('/state', 'kind', analysis%kind, errors)
    call put_blocks(file, 'u', body, body%accepted%u, errors)
    call put_blocks(file, 'v', body, body%accepted%v, errors)
    call put_blocks(file, 'a', body, body%accepted%a, errors)
    call put_blocks(file, 'external', body, body%accepted%external, errors)
    call put_blocks(file, 'reaction', body, body%accepted%reaction, errors)
    call put_blocks(file, 'tie', body, body%accepted%tie, errors)
    call put_blocks(file, 'viscous', body, body%accepted%viscous, errors)
    call file%put('/state/factored_dt', body%system%factored_dt, errors)
    call put_blocks(file, 'port_load', body, body%port%port_load, errors)
    call put_blocks(file, 'given_u', body, body%port%given_u, errors)
    associate (e => body%accepted_energy)
      call file%put('/state/energy', &
                    [e%strain, e%kinetic, e%load, e%gravity, e%support, e%spring, &
                     e%damping, e%numerical, e%start, e%plastic, e%largest], errors)
      call analysis%put(body, file, errors)
      if (body%matter%active) then
        call file%put('/state/largest_force', body%newton%largest, errors)
        call put_points(file, '/state/point_stress', body, body%matter%accepted_stress, errors)
        call put_points(file, '/state/point_state', body, body%matter%accepted_state, errors)
        call file%put('/state/leaps', real(body%limit%leaps, wp), errors)
        call file%put('/state/step_limit', body%limit%step, errors)
      end if
    end associate
    if (body%pore%active) call put_liquid(file, body, errors)
    if (allocated(body%supports%rigid)) call file%put('/state/rigid', &
      reshape([(body%supports%rigid(k)%accepted_d, &
      body%supports%rigid(k)%accepted_v, k=1, size(body%supports%rigid))], [6, &
        size(body%supports%rigid)]), errors)
    call checkpoint%finish(file, errors)
  end subroutine write_checkpoint

  !> Read the state of a checkpoint; the body has the same mesh.
  subroutine read_checkpoint(checkpoint, path, body, analysis, steps, deck_changed, errors)
    type(checkpoint_type), intent(inout) :: checkpoint
    character(len=*), intent(in) :: path
    type(fem_body_type), intent(inout) :: body
    class(fem_analysis_type), intent(inout) :: analysis
    integer(i8), intent(out) :: steps
    logical, intent(out) :: deck_changed
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp) :: energy(11), leaps

    steps = 0
    leaps = 0.0_wp
    deck_changed = .false.
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call check_kind(path, file, analysis, errors)
    call read_motion(file, path, body, errors)
    if (.not. errors%any()) call analysis%get(body, file, errors)
    if (.not. errors%any()) then
      call get_blocks(file, 'v', body, body%state%v, errors)
      call get_blocks(file, 'a', body, body%state%a, errors)
      call get_blocks(file, 'external', body, body%state%external, errors)
      call get_blocks(file, 'reaction', body, body%state%reaction, errors)
      call get_blocks(file, 'tie', body, body%state%tie, errors)
      call get_blocks(file, 'viscous', body, body%state%viscous, errors)
      call file%get('/state/factored_dt', body%system%restored_dt, errors)
      call get_blocks(file, 'port_load', body, body%port%port_load, errors)
      call get_blocks(file, 'given_u', body, body%port%given_u, errors)
      call file%get_into('/state/energy', energy, errors)
      if (body%matter%active) call get_matter(file, body, leaps, errors)
      if (body%pore%active) call get_liquid(file, body, errors)
      if (allocated(body%supports%rigid)) call read_rigid(file, body, errors)
    end if
    call file%close(errors)
    call body%whole%ranks%agree(errors)
    if (.not. errors%any()) call check_counts(path, leaps, body, errors)
    if (errors%any()) return
    body%state%time = info%time
    call body%take_energy(fem_energy_type(energy(1), energy(2), energy(3), energy(4), energy(5), &
                                          energy(6), energy(7), energy(8), energy(9), &
                                          energy(10), energy(11), body%energy%liquid, &
                                          body%energy%darcy, body%energy%flow))
    steps = info%step
    if (body%matter%active) body%limit%leaps = nint(leaps, i8)
    deck_changed = info%deck_hash /= checkpoint%deck_hash
    call body%accept()
  end subroutine read_checkpoint

  !> Displacements; fault I306 where those of the checkpoint are of another mesh.
  subroutine read_motion(file, path, body, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: u(:, :)
    integer(i4) :: blocks
    blocks = body%dofs%blocks
    if (body%whole%dealt) blocks = body%mesh%total_nodes()
    if (body%whole%ranks%leads() .or. .not. body%whole%dealt) then
      call file%get('/state/u', u, errors)
      if (.not. errors%any()) then
        if (size(u, 1) /= 3 .or. size(u, 2) /= blocks) &
          call errors%add('I306', 'the checkpoint has '//str(int(size(u, 2), i4))// &
                          ' blocks of unknowns, the model '//str(blocks), path, &
                          'restart with the mesh that wrote it')
      end if
    else
      allocate (u(3, 0))
    end if
    call body%whole%ranks%agree(errors)
    if (errors%any()) return
    if (body%whole%dealt) then
      call body%whole%deal_blocks(body%mesh%number, u, body%state%u)
    else
      body%state%u = u
    end if
  end subroutine read_motion

  !> Values at all blocks; each rank has those of its own where they are dealt out.
  subroutine get_blocks(file, name, body, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(fem_body_type), intent(in) :: body
    real(wp), intent(inout), contiguous :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: all(:, :)
    if (.not. body%whole%dealt) then
      call file%get_into('/state/'//name, values, errors)
      return
    end if
    allocate (all(size(values, 1), merge(body%mesh%total_nodes(), 0, body%whole%ranks%leads())), &
      source=0.0_wp)
    if (body%whole%ranks%leads()) call file%get_into('/state/'//name, all, errors)
    call body%whole%deal_blocks(body%mesh%number, all, values)
  end subroutine get_blocks

  !> Values at the blocks of all ranks.
  subroutine put_blocks(file, name, body, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: all(:, :)
    if (.not. body%whole%dealt) then
      call file%put('/state/'//name, values, errors)
      return
    end if
    call body%collect_blocks(values, all)
    call file%put('/state/'//name, all, errors)
  end subroutine put_blocks

  !> Values of the other ranks that the leader writes, in its order.
  subroutine give_blocks(body)
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable :: none(:, :)
    if (.not. body%whole%dealt) return
    associate (s => body%accepted)
      call body%collect_blocks(s%u, none)
      call body%collect_blocks(s%v, none)
      call body%collect_blocks(s%a, none)
      call body%collect_blocks(s%external, none)
      call body%collect_blocks(s%reaction, none)
      call body%collect_blocks(s%tie, none)
      call body%collect_blocks(s%viscous, none)
    end associate
    call body%collect_blocks(body%port%port_load, none)
    call body%collect_blocks(body%port%given_u, none)
  end subroutine give_blocks

  !> Fault I311 where the checkpoint is of a kind of analysis from which this one cannot go on.
  subroutine check_kind(path, file, analysis, errors)
    character(len=*), intent(in) :: path
    type(h5_file_type), intent(inout) :: file
    class(fem_analysis_type), intent(in) :: analysis
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: dynamics(3) = [character(len=8) :: 'newmark', 'hht', 'explicit']
    character(len=:), allocatable :: kind
    kind = ''
    call file%attr_get('/state', 'kind', kind, errors)
    if (errors%any() .or. kind == analysis%kind .or. kind == analysis%follows) return
    if (any(dynamics == kind) .and. any(dynamics == analysis%kind)) return
    call errors%add('I311', "the checkpoint is of kind = '"//kind//"', the deck has '"// &
                    analysis%kind//"'", path, &
                    'restart with the deck that wrote it; dynamics begin '// &
                    "from a static state with &analysis follows = 'static'")
  end subroutine check_kind

  !> Counts of leaps and lengths of steps that are below 0 are faults (I306).
  subroutine check_counts(path, leaps, body, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: leaps
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=*), parameter :: hint = 'use an older checkpoint, or start from the beginning'
    if (leaps < 0.0_wp .or. leaps > real(huge(1_i4), wp)) &
      call errors%add('I306', 'the checkpoint counts '//str(leaps)//' leaps', &
                      path//':/state/leaps', hint)
    if (.not. body%matter%active) return
    if (.not. body%limit%step > 0.0_wp) &
      call errors%add('I306', 'the checkpoint has a longest step of '//str(body%limit%step)//' s', &
                      path//':/state/step_limit', hint)
  end subroutine check_counts

  !> Values at all points; each rank has those of its elements.
  subroutine get_points(file, name, body, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(inout) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: all(:, :)
    integer(i4) :: rows
    if (body%whole%dealt) then
      allocate (all(size(values, 1), merge(body%whole%all_points, 0, body%whole%ranks%leads())), &
        source=0.0_wp)
      if (body%whole%ranks%leads()) call file%get_into(name, all, errors)
      call body%whole%deal_points(all, values)
      return
    end if
    if (body%whole%ranks%several()) then
      rows = size(values, 1)
      deallocate (values)
      allocate (values(rows, body%whole%points(body%elastic%points)))
    end if
    call file%get_into(name, values, errors)
    call body%whole%own_points(values)
  end subroutine get_points

  !> Values at the points of all ranks.
  subroutine put_points(file, name, body, values, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: values(:, :)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: all(:, :)
    if (body%whole%ranks%several()) then
      allocate (all, source=values)
      call body%whole%collect_points(all)
      call file%put(name, all, errors)
    else
      call file%put(name, values, errors)
    end if
  end subroutine put_points

  !> Values of the other ranks that the leader writes.
  subroutine give_points(body)
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable :: stress(:, :), state(:, :)
    allocate (stress, source=body%matter%accepted_stress)
    call body%whole%collect_points(stress)
    allocate (state, source=body%matter%accepted_state)
    call body%whole%collect_points(state)
  end subroutine give_points

  !> State of the points, and what steps need beside it.
  subroutine get_matter(file, body, leaps, errors)
    type(h5_file_type), intent(inout) :: file
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(inout) :: leaps
    type(error_list_type), intent(inout) :: errors
    call file%get('/state/largest_force', body%newton%largest, errors)
    call get_points(file, '/state/point_stress', body, body%matter%stress, errors)
    call get_points(file, '/state/point_state', body, body%matter%state, errors)
    call file%get('/state/leaps', leaps, errors)
    call file%get('/state/step_limit', body%limit%step, errors)
  end subroutine get_matter

  !> Energies, books and start of the pore liquid.
  subroutine put_liquid(file, body, errors)
    type(h5_file_type), intent(inout) :: file
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    associate (e => body%accepted_energy, b => body%pore%accepted_books)
      call file%put('/state/liquid', [e%liquid, e%darcy, e%flow, b%content, b%numerical, &
                                      b%through, b%entered, b%rate], errors)
      call file%put('/state/liquid_start', body%pore%start, errors)
      if (body%pore%unsaturated) call file%put('/state/liquid_kept', b%kept, errors)
      if (size(body%pore%leak) > 0) call file%put('/state/liquid_leaks', real(b%leaks, wp), errors)
    end associate
  end subroutine put_liquid

  subroutine get_liquid(file, body, errors)
    type(h5_file_type), intent(inout) :: file
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)
    real(wp) :: leaks
    integer(i4) :: n
    n = int(size(body%pore%books%entered), i4)
    allocate (values(6 + 2*n))
    call file%get_into('/state/liquid', values, errors)
    call file%get_into('/state/liquid_start', body%pore%start, errors)
    if (body%pore%unsaturated) call file%get('/state/liquid_kept', body%pore%books%kept, errors)
    leaks = 0.0_wp
    if (size(body%pore%leak) > 0) call file%get('/state/liquid_leaks', leaks, errors)
    if (errors%any()) return
    associate (e => body%energy, b => body%pore%books)
      e%liquid = values(1)
      e%darcy = values(2)
      e%flow = values(3)
      b%content = values(4)
      b%leaks = nint(leaks, i4)
      b%numerical = values(5)
      b%through = values(6)
      b%entered = values(7:6 + n)
      b%rate = values(7 + n:)
    end associate
  end subroutine get_liquid

  !> Free shifts of rigid groups.
  subroutine read_rigid(file, body, errors)
    type(h5_file_type), intent(inout) :: file
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:, :)
    integer(i4) :: k
    call get_shaped(file, '/state/rigid', [6, size(body%supports%rigid)], values, errors)
    if (errors%any()) return
    do k = 1, size(body%supports%rigid)
      body%supports%rigid(k)%d = values(:3, k)
      body%supports%rigid(k)%v = values(4:, k)
    end do
  end subroutine read_rigid
end module fem_restart
