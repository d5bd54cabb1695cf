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
    call file%put('/free/q', o%motion%q, errors)
    call file%put('/free/theta', o%motion%theta, errors)
    call file%put('/free/theta_ref', o%map%theta_ref, errors)
    call file%put('/free/force', o%forces%force, errors)
    call file%put('/free/moment', o%forces%moment, errors)
    call file%put('/free/force_hold', o%forces%force_hold, errors)
    call file%put('/free/moment_hold', o%forces%moment_hold, errors)
    call file%put('/ghosts/d', o%motion%d, errors)
    call file%put('/ghosts/turn', o%motion%turn, errors)
    call file%put('/ghosts/quat', o%motion%quat, errors)
    call file%put('/nodes/u', o%motion%u, errors)
    call file%put('/nodes/v', o%motion%v, errors)
    call file%put('/nodes/f', o%forces%f, errors)
    call file%put('/nodes/bulk', o%forces%bulk, errors)
    call file%put('/nodes/element', o%forces%element, errors)
    call file%put('/nodes/f_hold', o%forces%f_hold, errors)
    call file%put('/rotations/phi', o%motion%phi, errors)
    call file%put('/rotations/w', o%motion%w, errors)
    call file%put('/rotations/c', o%forces%c, errors)
    call file%put('/rotations/bulk', o%forces%bulk_phi, errors)
    call file%put('/rotations/element', o%forces%element_phi, errors)
    call file%put('/rotations/c_hold', o%forces%c_hold, errors)
    call file%put('/weights/ids', o%share%weight_ids, errors)
    call file%put('/weights/contacts', o%share%weight, errors)
    call file%put('/weights/points', o%share%beta, errors)
    call file%put('/numbers', [o%ledger%work_given, o%ledger%work_taken, o%ledger%turnover, &
      o%ledger%hold_work, o%own%damping%lost, o%own%damping_phi%lost], errors)
    if (o%own%damping%active) call file%put('/damping/force', o%own%damping%force, errors)
    if (o%own%damping_phi%active) call file%put('/damping/moment', o%own%damping_phi%force, errors)
    call file%put('/counts', [o%step, o%map%remaps], errors)
    call file%put('/map/looked', [o%map%looked], errors)
    call file%put('/map/told', merge(1_i4, 0_i4, o%map%told), errors)
    if (o%map%remaps > 0) then
      call file%put('/map/x_free', o%map%x_free, errors)
      call file%put('/map/u', o%map%u_map, errors)
      call file%put('/map/phi', o%map%phi_map, errors)
    end if
    if (allocated(o%start%moduli)) call file%put('/start/moduli', o%start%moduli, errors)
    if (allocated(o%start%stress)) then
      call file%put('/start/stress', o%start%stress, errors)
      call file%put('/start/couple', o%start%couple, errors)
    end if
    call file%put('/start/steady', o%forces%steady, errors)
    call file%put('/start/steady_phi', o%forces%steady_phi, errors)
    if (o%forces%parts%active) call write_parts(file, o, errors)
    if (o%forces%loads%active) then
      call file%put('/loads/f', o%forces%loads%f, errors)
      call file%put('/loads/c', o%forces%loads%c, errors)
    end if
    if (o%rules%static) then
      call file%put('/static/held', o%relax%held, errors)
      call file%put('/static/residual', o%relax%residual, errors)
      call file%put('/static/numbers', [o%relax%factor, o%start%contact_stiffness, &
                    real(o%start%contact_count, wp), o%ledger%unbalanced, merge(1.0_wp, 0.0_wp, &
                    o%relax%begun)], errors)
    end if
    call file%put('/scalars/grains', o%ledger%grains, errors)
    call file%put('/scalars/solid', o%ledger%solid, errors)
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
    real(wp) :: numbers(6)
    integer(i8) :: counts(2)
    real(wp) :: looked(1)
    integer(i4) :: told(o%op%free)

    numbers = 0.0_wp
    counts = 0
    looked = 0.0_wp
    told = 0
    call file%attr_get('/', 'sets_hash', hash, errors)
    if (.not. errors%any()) then
      if (hash /= o%map%sets_hash) &
        call errors%add('I404', 'the sets of the overlap are not those of the checkpoint ('// &
                        o%map%sets_hash//', not '//hash//')', path, &
                        'go on with the mesh and the deck that wrote it')
    end if
    if (errors%any()) return
    call read_motion(file, o, errors)
    call file%get('/weights/ids', o%share%weight_ids, errors)
    call file%get('/weights/contacts', o%share%weight, errors)
    call file%get('/weights/points', o%share%beta, errors)
    if (file%exists('/start/moduli')) call file%get('/start/moduli', o%start%moduli, errors)
    o%rules%stressed = file%exists('/start/stress')
    if (o%rules%stressed) call file%get('/start/stress', o%start%stress, errors)
    if (o%rules%stressed) call file%get('/start/couple', o%start%couple, errors)
    call file%get_into('/start/steady', o%forces%steady, errors)
    call file%get_into('/start/steady_phi', o%forces%steady_phi, errors)
    if (o%rules%static) call read_static(file, o, errors)
    if (o%rules%in_parts .and. file%exists('/parts/near')) call read_parts(file, o, errors)
    if (file%exists('/loads/f')) call file%get('/loads/f', o%forces%loads%f, errors)
    if (file%exists('/loads/c')) call file%get('/loads/c', o%forces%loads%c, errors)
    call file%get_into('/numbers', numbers, errors)
    call file%get_into('/counts', counts, errors)
    call file%get_into('/map/looked', looked, errors)
    call file%get_into('/map/told', told, errors)
    if (counts(2) > 0) then
      call file%get_into('/map/x_free', o%map%x_free, errors)
      call file%get_into('/map/u', o%map%u_map, errors)
      call file%get_into('/map/phi', o%map%phi_map, errors)
    end if
    if (o%own%damping%active) call file%get_into('/damping/force', o%own%damping%force, errors)
    if (o%own%damping_phi%active) call file%get_into('/damping/moment', o%own%damping_phi%force, &
      errors)
    call file%get_into('/scalars/grains', o%ledger%grains, errors)
    call file%get_into('/scalars/solid', o%ledger%solid, errors)
    o%ledger%work_given = numbers(1)
    o%ledger%work_taken = numbers(2)
    o%ledger%turnover = numbers(3)
    o%ledger%hold_work = numbers(4)
    o%own%damping%lost = numbers(5)
    o%own%damping_phi%lost = numbers(6)
    o%step = counts(1)
    o%map%remaps = counts(2)
    o%map%looked = looked(1)
    o%map%told = told == 1
  end subroutine get_overlap

  !> Forces on ghosts in parts.
  subroutine write_parts(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(in) :: o
    type(error_list_type), intent(inout) :: errors
    call file%put('/parts/near', o%forces%parts%near, errors)
    call file%put('/parts/p_near', o%forces%parts%p_near, errors)
    call file%put('/parts/m_near', o%forces%parts%m_near, errors)
    call file%put('/parts/p', o%forces%parts%p, errors)
    call file%put('/parts/m', o%forces%parts%m, errors)
    call file%put('/parts/p_still', o%forces%parts%p_still, errors)
    call file%put('/parts/m_still', o%forces%parts%m_still, errors)
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
    call file%get('/parts/near', o%forces%parts%near, errors)
    call file%get('/parts/p_near', o%forces%parts%p_near, errors)
    call file%get('/parts/m_near', o%forces%parts%m_near, errors)
    call file%get_into('/parts/p', o%forces%parts%p, errors)
    call file%get_into('/parts/m', o%forces%parts%m, errors)
    call file%get_into('/parts/p_still', o%forces%parts%p_still, errors)
    call file%get_into('/parts/m_still', o%forces%parts%m_still, errors)
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
    o%relax%factor = numbers(1)
    o%start%contact_stiffness = numbers(2)
    o%start%contact_count = nint(numbers(3))
    o%ledger%unbalanced = numbers(4)
    o%relax%begun = numbers(5) > 0.0_wp
    call o%relax_as_static()
  end subroutine read_static

  subroutine read_motion(file, o, errors)
    type(h5_file_type), intent(inout) :: file
    type(overlap_type), intent(inout) :: o
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/free/q', o%motion%q, errors)
    call file%get_into('/free/theta', o%motion%theta, errors)
    call file%get_into('/free/theta_ref', o%map%theta_ref, errors)
    call file%get_into('/free/force', o%forces%force, errors)
    call file%get_into('/free/moment', o%forces%moment, errors)
    call file%get_into('/free/force_hold', o%forces%force_hold, errors)
    call file%get_into('/free/moment_hold', o%forces%moment_hold, errors)
    call file%get_into('/ghosts/d', o%motion%d, errors)
    call file%get_into('/ghosts/turn', o%motion%turn, errors)
    call file%get_into('/ghosts/quat', o%motion%quat, errors)
    call file%get_into('/nodes/u', o%motion%u, errors)
    call file%get_into('/nodes/v', o%motion%v, errors)
    call file%get_into('/nodes/f', o%forces%f, errors)
    call file%get_into('/nodes/bulk', o%forces%bulk, errors)
    call file%get_into('/nodes/element', o%forces%element, errors)
    call file%get_into('/nodes/f_hold', o%forces%f_hold, errors)
    call file%get_into('/rotations/phi', o%motion%phi, errors)
    if (o%op%micro%active) call o%op%micro%take(o%op%ghost_phi, o%motion%phi)
    call file%get_into('/rotations/w', o%motion%w, errors)
    call file%get_into('/rotations/c', o%forces%c, errors)
    call file%get_into('/rotations/bulk', o%forces%bulk_phi, errors)
    call file%get_into('/rotations/element', o%forces%element_phi, errors)
    call file%get_into('/rotations/c_hold', o%forces%c_hold, errors)
  end subroutine read_motion

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
