!> Replies of the port that change nothing: HELLO, DESCRIBE, SELECT, scalars.
module dem_port_state
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: can_advance, can_border, can_checkpoint, can_contact_weight, &
    can_force, can_kick_drift, can_load, can_mass_factor, can_population, can_pore, can_prescribe, &
    can_rehearsal, can_reject, can_report, can_surface, field_axes, field_band, &
    field_branch, field_capabilities, field_deck_hash, field_density, field_dt, field_force, &
    field_gravity, field_id, field_ids, field_inertia, field_kind, field_mass, field_motion, &
    field_names, field_normal, field_plastic, field_point, field_program, field_quat, &
    field_radius, field_ranks, field_scalars, field_start, field_step_limit, field_stiffness, &
    field_t_end, field_tile, field_time, field_version, field_x, what_asleep, what_border, &
    what_contacts, what_grains, what_group, what_groups, what_pore
  use talus_scalars, only: scalar_kinetic, scalar_elastic, scalar_friction, scalar_plastic, &
    scalar_contact_damping, scalar_background_damping, scalar_curvature, &
    scalar_tangential_relaxation, scalar_boundary, scalar_gravity, scalar_momentum, &
    scalar_angular_momentum, scalar_step_limit, scalar_max_overlap, scalar_flags, scalar_count, &
    flag_late_rebuild, flag_large_overlap
  use talus_serve, only: limit_told
  use talus_version, only: version_text
  use dem_contacts, only: stiffness_on
  use dem_library, only: density_of
  use dem_measure, only: momentum_of, angular_momentum_of
  use dem_packing, only: group_index
  use dem_parts, only: find_border
  use dem_port_seam, only: band_of
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_model, only: dem_model_type, program_name
  use dem_surface_measure, only: vertex_stiffness
  use dem_port_pore, only: describe_pore
  use dem_sets, only: dem_set_type, role_surface, role_border, role_pore
  use dem_state, only: mode_relaxation
  implicit none
  private
  public :: reply_hello, reply_describe, reply_selected, put_scalars

  character(len=*), parameter :: capabilities = can_report//','//can_prescribe//','//can_load// &
    ','//can_surface//','//can_border//','//can_advance//','//can_force//','//can_kick_drift// &
    ','//can_reject//','//can_checkpoint//','//can_rehearsal//','//can_contact_weight//','// &
    can_mass_factor//','//can_population
  !> With a liquid among the grains whole intervals alone.
  character(len=*), parameter :: with_liquid = can_report//','//can_prescribe//','//can_advance// &
    ','//can_reject//','//can_checkpoint//','//can_mass_factor//','//can_pore

contains

  !> Name, version and present time.
  subroutine reply_hello(model, reply)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: reply
    call reply%put_text(field_program, program_name)
    call reply%put_text(field_version, version_text())
    call reply%put_text(field_deck_hash, model%deck%hash())
    if (model%pore%active) then
      call reply%put_text(field_capabilities, with_liquid)
    else
      call reply%put_text(field_capabilities, capabilities)
    end if
    call reply%put(field_gravity, model%system%par%gravity_scale*model%system%par%gravity)
    call reply%put(field_time, model%clock%time())
    call reply%put(field_t_end, model%clock%t_end)
    call reply%put(field_step_limit, limit_told(model%system%step_limit()))
    if (.not. model%clock%automatic) call reply%put(field_dt, model%choices%dt)
    associate (par => model%system%par)
      call reply%put(field_motion, [merge(2.0_wp/max(model%choices%dt, tiny(1.0_wp)), par%damping, &
        par%full_damping), merge([par%mass_scale, par%inertia_scale], [1.0_wp, 1.0_wp], &
        par%mode == mode_relaxation)])
    end associate
    call reply%put_int(field_ranks, model%ranks%ranks)
  end subroutine reply_hello

  !> Grains, contacts, ghosts that free grains can reach, groups, a group.
  subroutine reply_describe(model, what, group, reply, errors)
    type(dem_model_type), intent(in) :: model
    character(len=*), intent(in) :: what, group
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: names, hint
    integer(i4), allocatable :: near(:)
    integer(i4) :: k

    select case (what)
    case (what_grains)
      call put_grains(model%system, reply)
    case (what_contacts)
      call put_contacts(model%system, reply)
    case (what_asleep)
      call put_asleep(model, reply, errors)
    case (what_border)
      call find_border(model%system%dem_data_type, near)
      call reply%put_int(field_id, model%system%grains%id(near))
    case (what_pore)
      call describe_pore(model, reply, errors)
    case (what_groups)
      names = ''
      do k = 1, size(model%packing%group)
        if (k > 1) names = names//new_line('a')
        names = names//model%packing%group(k)%name
      end do
      call reply%put_text(field_names, names)
    case (what_group)
      call group_index(model%packing%group, group, k, hint)
      if (k == 0) then
        call errors%add('D240', "the packing has no group '"//group//"'", &
                        model%deck%path('particles', 1, 'file'), hint)
      else
        call reply%put_int(field_id, model%packing%group(k)%id)
      end if
    case default
      call errors%add('P255', "talus-dem cannot describe '"//what//"'", 'exchange port, DESCRIBE', &
                      'valid are grains, contacts, asleep, border, pore, groups and group')
    end select
  end subroutine reply_describe

  !> What a partner could wake (P255 without a tile).
  subroutine put_asleep(model, reply, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    real(wp), allocatable :: x(:, :)
    integer(i4) :: k
    if (.not. model%bed%active) then
      call errors%add('P255', 'the grains have no tile: none are asleep', &
                      'exchange port, DESCRIBE', 'add &tile to '//model%deck%source%path)
      return
    end if
    call model%bed%list_asleep(model%system%dem_data_type, ids, x)
    call reply%put_int(field_id, ids)
    call reply%put(field_x, x)
    associate (bed => model%bed)
      if (size(bed%tile) == 1) return
      call reply%put_int(field_tile, [(bed%tile_of(ids(k)), k=1, size(ids))])
      call reply%put_int(field_start, bed%tile%before)
      call reply%put(field_density, [(density_of(bed%tile(k)), k=1, size(bed%tile))])
      call reply%put(field_plastic, bed%tile%plastic)
      call reply%put(field_band, band_of(bed))
    end associate
  end subroutine put_asleep

  subroutine put_grains(system, reply)
    type(dem_system_type), intent(in) :: system
    type(message_type), intent(inout) :: reply
    associate (g => system%grains)
      call reply%put_int(field_id, g%id)
      call reply%put(field_x, g%x)
      call reply%put(field_quat, g%quat)
      call reply%put(field_axes, g%axes)
      call reply%put(field_radius, g%radius)
      call reply%put(field_mass, g%mass)
      call reply%put(field_inertia, g%inertia)
      call reply%put_int(field_kind, g%kind)
    end associate
  end subroutine put_grains

  subroutine put_contacts(system, reply)
    type(dem_system_type), intent(in) :: system
    type(message_type), intent(inout) :: reply
    type(dem_contacts_type) :: list
    call system%contacts(list)
    call reply%put_int(field_ids, list%ids(:, :list%n))
    call reply%put(field_point, list%point(:, :list%n))
    call reply%put(field_normal, list%normal(:, :list%n))
    call reply%put(field_branch, list%branch(:, :list%n))
    call reply%put(field_force, list%force(:, :list%n))
    call reply%put(field_stiffness, list%stiffness(:, :list%n))
  end subroutine put_contacts

  !> Mass of each grain of a set, and the sum of the normal stiffness of its contacts; vertices of a
  !! surface have no mass.
  subroutine reply_selected(system, set, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: stiffness(:)

    if (set%role == role_border .or. set%role == role_pore) return
    if (set%role == role_surface) then
      stiffness = vertex_stiffness(system%dem_data_type, set%body)
      call reply%put(field_mass, 0.0_wp*stiffness)
      call reply%put(field_stiffness, stiffness)
      return
    end if
    call reply%put(field_mass, system%grains%mass(set%index))
    call reply%put(field_stiffness, stiffness_on(system%dem_data_type, set%index))
  end subroutine reply_selected

  !> Ledger, momentum, limits and flags; late is the number of late rebuilds reported so far.
  subroutine put_scalars(system, late, reply)
    type(dem_system_type), intent(inout) :: system
    integer(i8), intent(inout) :: late
    type(message_type), intent(inout) :: reply
    real(wp) :: value(scalar_count)
    integer(i4) :: flags

    call system%refresh_ledger()
    value = 0.0_wp
    associate (l => system%ledger)
      value(scalar_kinetic) = l%kinetic - l%staggering
      value(scalar_elastic) = l%elastic_normal + l%elastic_tangential + l%elastic_other
      value(scalar_friction) = l%friction + l%rolling + l%breakage + l%released + l%fines
      value(scalar_plastic) = l%plastic
      value(scalar_contact_damping) = l%contact_damping
      value(scalar_background_damping) = l%background_damping
      value(scalar_curvature) = l%curvature
      value(scalar_tangential_relaxation) = l%tangential_relaxation
      value(scalar_boundary) = l%boundary + l%external
      value(scalar_gravity) = l%gravity
    end associate
    value(scalar_momentum:scalar_momentum + 2) = momentum_of(system%dem_data_type)
    value(scalar_angular_momentum:scalar_angular_momentum + 2) = &
      angular_momentum_of(system%dem_data_type)
    value(scalar_step_limit) = limit_told(system%recent_limit())
    value(scalar_max_overlap) = system%health%max_overlap
    flags = 0
    if (system%health%late_rebuilds > late) flags = flags + flag_late_rebuild
    if (system%health%max_overlap > system%par%overlap_limit) flags = flags + flag_large_overlap
    value(scalar_flags) = flags
    late = system%health%late_rebuilds
    call reply%put(field_scalars, value)
  end subroutine put_scalars
end module dem_port_state
