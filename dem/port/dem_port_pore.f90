!> The liquid among the grains at the port: the side of its grid that a partner has, its pressures
!! and motion in an interval, and what it reports. eqs. D.60, D.61
module dem_port_pore
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_conductance, dot_content, dot_darcy, dot_entered, &
    dot_flow_work, dot_fluid_in, dot_force, dot_p, dot_v, dot_work, field_area, &
    field_compressibility, field_fields, field_id, field_mobility, field_p, field_storage, field_x
  use dem_model, only: dem_model_type
  use dem_pore_cavity, only: hydrostatic
  use dem_pore_exchange, only: end_exchange
  use dem_pore_grid, only: brick_count, brick_edges, corners_of, node_count, node_place, on_side, &
    side_share
  use dem_pore_operator, only: storage
  use dem_pore_partner, only: axis_of, begin_interval, end_of, side_force, side_of_nodes, &
    take_side, yield_to
  use dem_pore_state, only: dem_pore_type, drain_none, sum_darcy, sum_flow, sum_inflow, &
    sum_partner, sum_swept
  use dem_sets, only: dem_set_type, dem_sets_type, role_pore
  implicit none
  private
  public :: describe_pore, select_pore, take_side_motion, wet_steps, fit_exchanges, put_pore_sets

contains

  !> DESCRIBE pore: the nodes on the sides of the grid (D452 without a liquid).
  subroutine describe_pore(model, reply, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: area(:, :), c(:), most(:, :), x(:, :)
    integer(i4), allocatable :: node(:)
    integer(i4) :: a, side

    if (.not. model%pore%active) then
      call no_liquid(model, errors)
      return
    end if
    associate (pore => model%system%pore)
      allocate (c(node_count(pore%grid)), area(6, node_count(pore%grid)), source=0.0_wp)
      do a = 1, size(c)
        do side = 1, 6
          if (on_side(pore%grid, a, end_of(side), axis_of(side))) &
            area(side, a) = side_share(pore%grid, a, axis_of(side))
        end do
      end do
      node = pack([(a, a=1, size(c))], any(area > 0.0_wp, 1))
      x = reshape([(pore%grid%lower + node_place(pore%grid, node(a))*brick_edges(pore%grid), &
                    a=1, size(node))], [3, size(node)])
      call storage(pore%grid, pore%porosity, pore%liquid%compliance, c)
      most = largest_around(pore)
      call reply%put_int(field_id, node)
      call reply%put(field_x, x)
      call reply%put(field_area, area(:, node))
      call reply%put(field_storage, c(node))
      call reply%put(field_mobility, most(1, node))
      call reply%put(field_compressibility, most(2, node))
    end associate
  end subroutine describe_pore

  subroutine no_liquid(model, errors)
    type(dem_model_type), intent(in) :: model
    type(error_list_type), intent(inout) :: errors
    call errors%add('D452', 'the grains have no liquid in their pores', model%deck%source%path, &
                    'add &pore_grid, or leave &pore_interface out')
  end subroutine no_liquid

  !> Mobility [m^2/(Pa s)] and compressibility n/K_f [1/Pa] at nodes, the largest of the bricks.
  pure function largest_around(pore) result(most)
    type(dem_pore_type), intent(in) :: pore
    real(wp) :: most(2, node_count(pore%grid))
    integer(i4) :: c, node(8)
    most = 0.0_wp
    do c = 1, brick_count(pore%grid)
      node = corners_of(pore%grid, c)
      most(1, node) = max(most(1, node), pore%mobility(c))
      most(2, node) = max(most(2, node), pore%porosity(c)*pore%liquid%compliance)
    end do
  end function largest_around

  !> SELECT with the role pore: a whole side of the grid on which nothing else is (D451, D452).
  subroutine select_pore(model, sets, request, name, ids, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(inout) :: sets
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: ids(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fields
    integer(i4) :: side, end, axis

    fields = ''
    if (request%has(field_fields)) call request%get_text(field_fields, fields, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (.not. model%pore%active) then
      call no_liquid(model, errors)
      return
    end if
    associate (pore => model%system%pore)
      side = 0
      if (all(ids >= 1 .and. ids <= node_count(pore%grid))) &
        side = side_of_nodes(pore%grid, int(ids, i4))
      if (side == 0) then
        call errors%add('D451', str(size(ids))//' nodes are not all nodes of one side of the '// &
                        'liquid''s grid', 'exchange port, SELECT', 'let the grid end at the '// &
                        'facets, and the facets cover its side')
        return
      end if
      end = end_of(side)
      axis = axis_of(side)
      if (pore%wall(end, axis) > 0 .or. pore%drain(end, axis) /= drain_none) then
        call errors%add('D451', 'a wall or a &drain is on the side of the liquid''s grid that '// &
                        'is the interface', 'exchange port, SELECT', 'leave it out')
        return
      end if
      call take_side(pore, side, index(','//fields//',', ','//field_p//',') > 0)
      call sets%put(name, role_pore, fields, pore%partner%node, side)
    end associate
  end subroutine select_pore

  !> ADVANCE: pressures that are held and velocities of the side, which stay for the interval.
  subroutine take_side_motion(model, set, request, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: p(size(set%index)), v(3, size(set%index))
    real(wp), allocatable :: rest(:)

    p = 0.0_wp
    v = 0.0_wp
    associate (pore => model%system%pore)
      if (request%has(set%name//dot_p)) then
        rest = resting(model)
        call request%get(set%name//dot_p, p, errors)
        if (pore%partner%held) pore%partner%p = p - rest(set%index)
      end if
      call take_conductance(pore, set, request, errors)
      if (request%has(set%name//dot_v)) call request%get(set%name//dot_v, v, errors)
      if (.not. (all(is_finite(p)) .and. all(is_finite(v)))) &
        call errors%add('P257', "set '"//set%name//"': a pressure or a velocity is no number", &
                        'exchange port', 'see the log of the solid')
      pore%partner%v = v(axis_of(pore%partner%side), :)
      call begin_interval(pore)
    end associate
  end subroutine take_side_motion

  !> ADVANCE: by how much the side gives way, and what comes besides; without it p is held.
  subroutine take_conductance(pore, set, request, errors)
    type(dem_pore_type), intent(inout) :: pore
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(size(set%index)) :: conduct, volume
    conduct = 0.0_wp
    volume = 0.0_wp
    if (request%has(set%name//dot_conductance)) &
      call request%get(set%name//dot_conductance, conduct, errors)
    if (request%has(set%name//dot_fluid_in)) &
      call request%get(set%name//dot_fluid_in, volume, errors)
    if (errors%any()) return
    if (.not. (all(is_finite(conduct)) .and. all(is_finite(volume)) .and. &
               minval(conduct) >= 0.0_wp .and. request%t1 > request%t0)) then
      call errors%add('P257', "set '"//set%name//"': a conductance is negative, or it or a "// &
                      'volume no number', 'exchange port', 'see the log of the solid')
      return
    end if
    call yield_to(pore, conduct, volume/(request%t1 - request%t0))
  end subroutine take_conductance

  !> Pressure of the liquid at rest at all nodes [Pa].
  function resting(model) result(p)
    type(dem_model_type), intent(in) :: model
    real(wp), allocatable :: p(:)
    associate (d => model%system)
      p = hydrostatic(d%pore%grid, d%pore%liquid%density*d%par%gravity_scale*d%par%gravity)
    end associate
  end function resting

  !> Steps of an interval are a whole number of exchanges: more of them, if they may be cut (D450).
  subroutine fit_exchanges(model, may_cut, substeps, errors)
    type(dem_model_type), intent(in) :: model
    logical, intent(in) :: may_cut
    integer(i4), intent(inout) :: substeps
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: every
    if (.not. model%pore%active) return
    every = model%system%pore%every
    if (modulo(substeps, every) == 0) return
    if (may_cut) then
      substeps = every*(substeps/every + 1)
      return
    end if
    call errors%add('D450', 'the interval is '//str(substeps)//' steps, an exchange of grains '// &
                    'and liquid '//str(every), model%deck%source%path, &
                    'take exchange = '//str(divisor(substeps))//' in &pore_grid, or leave dt out')

  contains

    !> The largest of 1, 2 and 4 that divides the steps.
    pure integer(i4) function divisor(n)
      integer(i4), intent(in) :: n
      divisor = 1
      if (modulo(n, 2) == 0) divisor = 2
      if (modulo(n, 4) == 0) divisor = 4
    end function divisor
  end subroutine fit_exchanges

  !> Steps of an interval to t1 with their exchanges, the last of which ends with it (N232).
  subroutine wet_steps(model, t1, substeps, errors)
    type(dem_model_type), intent(inout) :: model
    real(wp), intent(in) :: t1  !! [s]
    integer(i4), intent(in) :: substeps
    type(error_list_type), intent(inout) :: errors
    logical :: aimed(model%system%grains%n)
    real(wp) :: t0
    integer(i4) :: k
    t0 = model%clock%time()
    associate (system => model%system)
      aimed = system%grains%has_target  ! ghosts are there at t1, not after the first exchange
      do k = 0, substeps - 1, system%pore%every
        call model%pore%exchange(system%dem_data_type, t0 + k*system%par%dt, errors)
        system%grains%has_target = aimed .and. k + system%pore%every >= substeps
        if (.not. errors%any()) call system%step(system%pore%every, errors)
        if (errors%any()) return
      end do
      call end_exchange(system%dem_data_type, t1)
      call model%pore%watch(system%dem_data_type, t1, system%recent_limit(), errors)
    end associate
  end subroutine wet_steps

  !> What the sides report: mean forces of an interval of this length, or (0) those now.
  subroutine put_pore_sets(model, sets, span, reply)
    type(dem_model_type), intent(in) :: model
    type(dem_sets_type), intent(in) :: sets
    real(wp), intent(in) :: span  !! [s]
    type(message_type), intent(inout) :: reply
    integer(i4) :: k
    do k = 1, sets%count
      if (sets%set(k)%role == role_pore) call put_side(model, sets%set(k)%name, span, reply)
    end do
  end subroutine put_pore_sets

  subroutine put_side(model, name, span, reply)
    type(dem_model_type), intent(in) :: model
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: span
    type(message_type), intent(inout) :: reply
    real(wp), allocatable :: force(:, :)
    associate (pore => model%system%pore, side => model%system%pore%partner)
      allocate (force(3, size(side%node)), source=0.0_wp)
      if (span > 0.0_wp) then
        force(axis_of(side%side), :) = side%impulse/span
      else
        force(axis_of(side%side), :) = side_force(pore, resting(model))
      end if
      call reply%put(name//dot_force, force)
      call reply%put(name//dot_fluid_in, side%inflow)
      call reply%put(name//dot_work, side%work)
      call reply%put(name//dot_content, sum(pore%omega) - pore%sums(sum_swept))
      call reply%put(name//dot_entered, pore%sums(sum_inflow) - pore%sums(sum_partner))
      call reply%put(name//dot_flow_work, pore%sums(sum_flow))
      call reply%put(name//dot_darcy, pore%sums(sum_darcy))
    end associate
  end subroutine put_side
end module dem_port_pore
