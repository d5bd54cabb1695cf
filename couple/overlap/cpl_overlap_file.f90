!> The state of an overlap in a checkpoint: reference positions, motion, forces, works.
module cpl_overlap_file
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_checkpoint, only: checkpoint_type, checkpoint_info_type
  use talus_hash, only: hash_text
  use talus_h5_shaped, only: get_shaped
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
    call file%put('/grains/reference_id', real(o%pack%id, wp), errors)
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

  !> Positions, masses, inertia and ids of all grains in the reference state, from which sets and
  !! operators are made again; ids are 0 in files that have none.
  subroutine read_overlap_reference(checkpoint, path, reference, errors)
    type(checkpoint_type), intent(in) :: checkpoint
    character(len=*), intent(in) :: path
    real(wp), allocatable, intent(out) :: reference(:, :)  !! (7, grains) [m], [kg], [kg m^2]
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(checkpoint_info_type) :: info
    real(wp), allocatable :: rows(:, :), ids(:)
    call checkpoint%open(path, file, info, errors)
    if (errors%any()) return
    call file%get('/grains/reference', rows, errors)
    if (.not. allocated(rows)) allocate (rows(6, 0))
    if (size(rows, 1) /= 6) call file%shape_fault('/grains/reference', shape(rows, i8), &
                                                  [6_i8, size(rows, 2, i8)], errors)
    allocate (ids(size(rows, 2)), source=0.0_wp)
    if (file%exists('/grains/reference_id')) &
      call file%get_into('/grains/reference_id', ids, errors)
    call file%close(errors)
    if (errors%any()) return
    reference = reshape([transpose(rows), ids], [7, size(rows, 2)], order=[2, 1])
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
    call check_loads(file, o, errors)
    o%own%damping%lost = lost(1)
    o%own%damping_phi%lost = lost(2)
    o%step = counts(1)
  end subroutine get_overlap

  !> Have loads and weights, whose number the operators give, the right shapes?
  subroutine check_loads(file, o, errors)
    type(h5_file_type), intent(in) :: file
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    if (errors%any()) return
    if (allocated(o%forces%loads%f)) call compare('/loads/f', shape(o%forces%loads%f, i8), &
                                                  [3_i8, int(o%op%prescribed, i8)])
    if (allocated(o%forces%loads%c)) call compare('/loads/c', shape(o%forces%loads%c, i8), &
                                                  [3_i8, int(o%op%prescribed_phi, i8)])
    call compare('/weights/ids', shape(o%share%weight_ids, i8), &
                 [2_i8, size(o%share%weight, kind=i8)])
    if (o%rules%static) then
      call compare('/static/held', shape(o%relax%held, i8), &
                   [merge(6_i8, 3_i8, size(o%relax%held, 1) == 6), &
                    int(o%op%nodes - o%op%prescribed, i8)])
      call compare('/static/residual', shape(o%relax%residual, i8), shape(o%relax%held, i8))
    end if

  contains

    subroutine compare(name, seen, wanted)
      character(len=*), intent(in) :: name
      integer(i8), intent(in) :: seen(:), wanted(:)
      if (any(seen /= wanted)) call file%shape_fault(name, seen, wanted, errors)
    end subroutine compare
  end subroutine check_loads

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
    integer(i4) :: age(1), near(2)
    age = 0
    call o%forces%parts%begin(o%op)
    call file%get('/parts/near', o%forces%parts%active_rows, errors)
    if (errors%any()) return
    if (any(o%forces%parts%active_rows < 1 .or. o%forces%parts%active_rows > o%op%ghosts)) then
      call errors%add('I404', "'"//file%path//"': /parts/near names ghosts that are not there", &
                      file%path//':/parts/near', 'use an older checkpoint')
      return
    end if
    near = [3, size(o%forces%parts%active_rows)]
    call get_shaped(file, '/parts/p_near', near, o%forces%parts%p_active, errors)
    call get_shaped(file, '/parts/m_near', near, o%forces%parts%m_active, errors)
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
