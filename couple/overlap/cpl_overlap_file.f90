!> The state of an overlap in a checkpoint: reference positions, motion, forces, works.
module cpl_overlap_file
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use talus_hash, only: hash_text
  use talus_hdf5, only: h5_file_type
  use talus_text, only: str
  use cpl_overlap, only: overlap_type
  implicit none
  private
  public :: put_overlap, get_overlap, read_overlap_reference, hash_of

contains

  !> The state that every overlap has, into the file of a checkpoint.
  subroutine put_overlap(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: reference(:, :)

    call file%attr_put('/', 'sets_hash', o%map%sets_hash, errors)
    allocate (reference(6, size(o%pack%id)))
    reference(:3, :) = o%pack%x
    reference(4, :) = o%pack%mass
    reference(5, :) = o%pack%inertia
    reference(6, :) = o%pack%slimmest
    call file%put('/grains/reference', reference, errors)
    call o%motion%put(file, errors)
    call o%forces%put(file, errors)
    call o%map%put(file, errors)
    call o%share%put(file, errors)
    call o%start%put(file, errors)
    call o%ledger%put([o%own%damping%lost, o%own%damping_phi%lost], file, errors)
    if (o%own%damping%active) call file%put('/damping/force', o%own%damping%force, errors)
    if (o%own%damping_phi%active) call file%put('/damping/moment', o%own%damping_phi%force, errors)
    call file%put('/counts', [o%step, o%map%remaps], errors)
    if (o%forces%parts%active) call write_parts(file, o, errors)
    if (o%rules%static) then
      call file%put('/static/held', o%relax%held, errors)
      call file%put('/static/residual', o%relax%residual, errors)
      call file%put('/static/numbers', [o%relax%factor, o%start%contact_stiffness, &
                    real(o%start%contact_count, wp), o%ledger%unbalanced, merge(1.0_wp, 0.0_wp, &
                    o%relax%begun)], errors)
    end if
  end subroutine put_overlap

  !> Positions, masses and inertia of all grains in the reference state, from which sets and
  !! operators are made again.
  subroutine read_overlap_reference(checkpoint, path, reference, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    real(wp), allocatable, intent(out) :: reference(:, :)  !! (6, grains) [m], [kg], [kg m^2]
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call file%get('/grains/reference', reference, errors)
    call file%close(errors)
  end subroutine read_overlap_reference

  !> The rest, into an overlap whose sets were made again; I404 when they are others.
  subroutine get_overlap(file, path, o, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: path  !! of the file
    type(overlap_type), intent(inout) :: o
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: hash
    real(wp) :: lost(2)
    integer(i8) :: counts(2)

    counts = 0
    call file%attr_get('/', 'sets_hash', hash, errors)
    if (.not. errors%any()) then
      if (hash /= o%map%sets_hash) &
        call errors%add('I404', 'the sets of the overlap are not those of the checkpoint ('// &
                        o%map%sets_hash//', not '//hash//')', path, &
                        'go on with the mesh and the deck that wrote it')
    end if
    if (errors%any()) return
    call file%get_into('/counts', counts, errors)
    call o%motion%get(file, errors)
    if (o%op%micro%active) call o%op%micro%take(o%op%ghost_phi, o%motion%phi)
    call o%forces%get(file, errors)
    call o%map%get(file, counts(2), errors)
    call o%share%get(file, errors)
    call o%start%get(file, errors)
    call o%ledger%get(lost, file, errors)
    o%rules%stressed = allocated(o%start%stress)
    if (o%rules%static) call read_static(file, o, errors)
    if (o%rules%in_parts .and. file%exists('/parts/near')) call read_parts(file, o, errors)
    if (o%own%damping%active) call file%get_into('/damping/force', o%own%damping%force, errors)
    if (o%own%damping_phi%active) call file%get_into('/damping/moment', o%own%damping_phi%force, &
      errors)
    o%own%damping%lost = lost(1)
    o%own%damping_phi%lost = lost(2)
    o%step = counts(1)
  end subroutine get_overlap

  !> Forces on ghosts in parts.
  subroutine write_parts(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    call file%put('/parts/near', o%forces%parts%active_rows, errors)
    call file%put('/parts/p_near', o%forces%parts%p_active, errors)
    call file%put('/parts/m_near', o%forces%parts%m_active, errors)
    call file%put('/parts/p', o%forces%parts%p, errors)
    call file%put('/parts/m', o%forces%parts%m, errors)
    call file%put('/parts/p_still', o%forces%parts%p_mean, errors)
    call file%put('/parts/m_still', o%forces%parts%m_mean, errors)
    call file%put('/parts/p_sum', o%forces%parts%p_sum, errors)
    call file%put('/parts/m_sum', o%forces%parts%m_sum, errors)
    call file%put('/parts/age', [o%forces%parts%age], errors)
  end subroutine write_parts

  subroutine read_parts(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(inout) :: o
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: age(1)
    age = 0
    call o%forces%parts%begin(o%op)
    call file%get('/parts/near', o%forces%parts%active_rows, errors)
    call file%get('/parts/p_near', o%forces%parts%p_active, errors)
    call file%get('/parts/m_near', o%forces%parts%m_active, errors)
    call file%get_into('/parts/p', o%forces%parts%p, errors)
    call file%get_into('/parts/m', o%forces%parts%m, errors)
    call file%get_into('/parts/p_still', o%forces%parts%p_mean, errors)
    call file%get_into('/parts/m_still', o%forces%parts%m_mean, errors)
    call file%get_into('/parts/p_sum', o%forces%parts%p_sum, errors)
    call file%get_into('/parts/m_sum', o%forces%parts%m_sum, errors)
    call file%get_into('/parts/age', age, errors)
    o%forces%parts%age = age(1)
  end subroutine read_parts

  !> Load of the edge and its relaxation.
  subroutine read_static(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(inout) :: o
    type(error_list_type), intent(inout) :: errors
    real(wp) :: numbers(5)
    numbers = 0.0_wp
    call file%get('/static/held', o%relax%held, errors)
    call file%get('/static/residual', o%relax%residual, errors)
    call file%get_into('/static/numbers', numbers, errors)
    o%start%contact_stiffness = numbers(2)
    o%start%contact_count = nint(numbers(3))
    o%ledger%unbalanced = numbers(4)
    call o%relax%resume(numbers(1), numbers(5) > 0.0_wp)
    call o%relax_as_static()
  end subroutine read_static

  !> Hash of the sets and of the operator's weights at the ghosts.
  function hash_of(o) result(hex)
    type(overlap_type), intent(in) :: o
    character(len=16) :: hex
    hex = hash_text(str(size(o%sets%free))//str(size(o%sets%ghost))//bytes_of(real(o%sets%free, &
      wp))//bytes_of(real(o%sets%ghost, wp))//bytes_of(real(o%op%node, wp))// &
      bytes_of(o%op%ghost%weight)//bytes_of(o%op%p%n%weight)//bytes_of(o%op%p%w))
  end function hash_of

  pure function bytes_of(x) result(bytes)
    real(wp), intent(in) :: x(:)
    character(len=8*size(x)) :: bytes
    integer(i4) :: k
    do k = 1, size(x)
      bytes(8*k - 7:8*k) = transfer(x(k), 'abcdefgh')
    end do
  end function bytes_of
end module cpl_overlap_file
