!> What talus-fem reports at the port (HELLO, scalars) and receives (SET). All ranks call it
!! together: values come of all elements and points, and each rank keeps those of its own.
module fem_port_state
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, name_length
  use talus_port_names, only: can_advance, can_checkpoint, can_dead_load, can_element_stress, &
    can_force, can_impulse, &
    can_initial_stress, can_kick_drift, can_load, can_mass_factor, can_moduli, can_places, &
    can_pore, can_prescribe, can_quad_weight, can_rehearsal, can_reject, can_report, can_solve, &
    can_springs, field_analysis, field_capabilities, field_couple, field_deck_hash, &
    field_element, field_force, &
    field_gravity, field_micropolar, field_moment, field_node, field_node_phi, field_poisson, &
    field_program, field_ranks, field_scalars, field_set, field_step_limit, field_stiffness, &
    field_stiffness_phi, field_t_end, field_time, field_value, field_value_phi, field_version, &
    field_weight, field_weight_phi, field_what, field_young, what_dead_load, what_initial_stress, &
    what_mass_factor, what_moduli, what_places, what_pore_storage, what_quad_weight, what_springs
  use talus_scalars, only: scalar_count, scalar_kinetic, scalar_elastic, scalar_boundary, &
    scalar_plastic, &
    scalar_background_damping, &
    scalar_gravity, scalar_momentum, scalar_angular_momentum, scalar_step_limit
  use talus_vectors, only: cross
  use talus_serve, only: limit_told
  use talus_version, only: version_text
  use fem_types, only: fem_springs_type, role_load
  use fem_body, only: fem_body_type
  use fem_port_places, only: set_places
  use fem_port_pore, only: store_at
  use fem_elastic, only: fem_elastic_type, classical
  use fem_micropolar, only: lame_moduli, violated_inequality
  use fem_port_stress, only: set_begun_stress, set_element_stress, can_begin_elements
  use fem_mm_body, only: phi_columns
  use fem_model, only: fem_model_type, program_name
  use fem_sets, only: fem_sets_type
  use fem_sparse, only: multiply_mass, holders_of
  implicit none
  private
  public :: reply_hello, set_values, put_scalars

  character(len=*), parameter :: capabilities = can_report//','//can_prescribe//','//can_load// &
    ','//can_advance//','//can_force//','//can_kick_drift//','//can_reject//','// &
    can_checkpoint//','//can_rehearsal//','//can_springs//','//can_dead_load//','// &
    can_initial_stress//','//can_quad_weight//','//can_moduli//','//can_mass_factor

contains

  subroutine reply_hello(model, reply)
    type(fem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: reply
    call reply%put_text(field_program, program_name)
    call reply%put_text(field_version, version_text())
    call reply%put_text(field_deck_hash, model%deck%hash())
    call reply%put_text(field_capabilities, capabilities//what_else(model))
    call reply%put_text(field_analysis, model%analysis%kind)
    call reply%put(field_gravity, model%body%loads%gravity)
    call reply%put(field_time, model%body%accepted%time)
    call reply%put(field_t_end, model%analysis%t_end)
    call reply%put(field_step_limit, limit_told(model%body%limit%step))
    call reply%put_int(field_ranks, model%ranks%ranks)
  end subroutine reply_hello

  !> Capabilities that not every body has, each after a comma.
  pure function what_else(model) result(text)
    type(fem_model_type), intent(in) :: model
    character(len=:), allocatable :: text
    text = ','//can_impulse
    if (model%analysis%solves) text = ','//can_solve
    if (can_move_nodes(model%body)) text = text//','//can_places
    if (can_begin_elements(model%body)) text = text//','//can_element_stress
    if (model%body%pore%active .and. .not. model%ranks%several()) text = text//','//can_pore
  end function what_else

  !> Can nodes be somewhere else at rest? Where laws have a state their elements must begin anew.
  pure logical function can_move_nodes(body)
    type(fem_body_type), intent(in) :: body
    can_move_nodes = .not. body%matter%active .or. can_begin_elements(body)
  end function can_move_nodes

  !> SET: springs, dead loads, initial stress, weights, moduli, mass factors.
  subroutine set_values(body, sets, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what

    call request%get_text(field_what, what, errors)
    if (body%matter%active .and. (what == what_moduli .or. &
                                  (what == what_places .and. .not. can_move_nodes(body)))) &
      call errors%add('P302', "talus-fem cannot set '"//what//"' where laws have a state", &
      request%place(), 'give the constants in the deck of the solid, or use linear laws')
    if (errors%any()) return
    select case (what)
    case (what_springs)
      call set_springs(body, request, errors)
    case (what_dead_load)
      call set_dead_load(body, sets, request, errors)
    case (what_initial_stress)
      if (request%has(field_element)) then
        call set_element_stress(body, request, errors)
      else if (body%matter%active) then
        call set_begun_stress(body, request, errors)
      else
        call set_initial(body, request, errors)
      end if
    case (what_quad_weight)
      call set_weights(body, request, errors)
    case (what_moduli)
      call set_moduli(body, request, errors)
    case (what_places)
      call set_places(body, request, errors)
    case (what_mass_factor)
      call set_mass_factor(body, sets, request, errors)
    case (what_pore_storage)
      call set_storage(body, sets, request, errors)
    case default
      call errors%add('P301', "talus-fem cannot set '"//what//"'", request%place(), 'choices: '// &
                      'springs, dead_load, initial_stress, quad_weight, moduli, places, '// &
                      'pore_storage and mass_factor')
    end select
  end subroutine set_values

  !> Liquid that the nodes of a set store besides the pores.
  subroutine set_storage(body, sets, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k
    call request%get_text(field_set, name, errors)
    if (errors%any()) return
    call find_set(sets, name, k, request, errors)
    if (.not. errors%any()) call store_at(body, sets%set(k), request, errors)
  end subroutine set_storage

  !> Springs of the partner on displacements, and with `node_phi` on micro-rotations; they replace
  !! those set before.
  subroutine set_springs(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    type(fem_springs_type) :: springs, turning

    call read_springs(body, request, [character(len=name_length) :: field_node, field_weight, &
      field_stiffness], springs, errors)
    if (request%has(field_node_phi)) call read_springs(body, request, &
      [character(len=name_length) :: field_node_phi, field_weight_phi, field_stiffness_phi], &
      turning, errors)
    if (errors%any()) return
    if (turning%n > 0) call join_springs(turning, springs)
    body%port%robin = springs
    call body%system%forget_factors()
    call body%limit_step()
  end subroutine set_springs

  !> Nodes, weights and stiffness of springs, from fields of these names; P302 when they do not fit.
  subroutine read_springs(body, request, names, springs, errors)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: names(3)
    type(fem_springs_type), intent(inout) :: springs
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: stiffness(:)
    integer(i4), allocatable :: holder(:)
    integer(i4) :: s, c

    call request%take_int(trim(names(1)), springs%node, errors)
    call request%take(trim(names(2)), springs%weight, errors)
    call request%take(trim(names(3)), stiffness, errors)
    if (errors%any()) return
    springs%n = size(stiffness)
    if (size(springs%node, 2) /= springs%n .or. &
        any(shape(springs%node) /= shape(springs%weight))) then
      call errors%add('P302', 'springs need as many weights as nodes, and one stiffness each', &
                      request%place(), 'facets of fewer nodes repeat one with weight zero')
      return
    end if
    if (.not. (all(is_finite(springs%weight)) .and. all(is_finite(stiffness)))) then
      call errors%add('P302', 'a spring''s weight or stiffness is no number', request%place())
      return
    end if
    if (names(1) == field_node_phi) call turn_nodes(body, springs, request%place(), errors)
    if (errors%any()) return
    allocate (springs%stiffness(3, 3, springs%n), source=0.0_wp)
    allocate (holder(springs%n))
    call holders_of(body%system%pattern, springs, holder)
    s = int(findloc(holder, -1_i4, 1), i4)
    if (s > 0) call errors%add('P302', 'the nodes '//str(springs%node(:, s))//' of spring '// &
                               str(s)//' are not those of a facet', request%place())
    springs%here = holder == body%dofs%halo%rank
    do c = 1, 3
      springs%stiffness(c, c, :) = stiffness
    end do
  end subroutine read_springs

  !> Node ids become the numbers of their micro-rotations.
  subroutine turn_nodes(body, springs, place, errors)
    type(fem_body_type), intent(in) :: body
    type(fem_springs_type), intent(inout) :: springs
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: s, a, node, block
    if (body%matter%micro%active) then
      call errors%add('P302', 'micromorphic solids have no springs on micro-rotations', place, &
                      'leave node_phi out')
      return
    end if
    do s = 1, springs%n
      do a = 1, size(springs%node, 1)
        node = springs%node(a, s)
        block = 0
        if (node >= 1 .and. node <= body%mesh%nodes) block = body%dofs%phi(node)
        if (block == 0) then
          call errors%add('P302', 'spring '//str(s)//' on micro-rotations names node '// &
                          str(node)//', which has none', place)
          return
        end if
        springs%node(a, s) = block
      end do
    end do
  end subroutine turn_nodes

  !> Add springs, of lists as long or shorter, behind others.
  pure subroutine join_springs(more, springs)
    type(fem_springs_type), intent(in) :: more
    type(fem_springs_type), intent(inout) :: springs
    type(fem_springs_type) :: all
    integer(i4) :: s, m, k
    all%n = springs%n + more%n
    m = max(size(springs%node, 1), size(more%node, 1))
    allocate (all%node(m, all%n), all%stiffness(3, 3, all%n))
    allocate (all%weight(m, all%n), source=0.0_wp)
    do s = 1, all%n
      k = s - springs%n
      if (k <= 0) then
        all%node(:, s) = springs%node(1, s)
        all%node(:size(springs%node, 1), s) = springs%node(:, s)
        all%weight(:size(springs%node, 1), s) = springs%weight(:, s)
      else
        all%node(:, s) = more%node(1, k)
        all%node(:size(more%node, 1), s) = more%node(:, k)
        all%weight(:size(more%node, 1), s) = more%weight(:, k)
      end if
    end do
    all%stiffness(:, :, :springs%n) = springs%stiffness
    all%stiffness(:, :, springs%n + 1:) = more%stiffness
    all%here = [springs%here, more%here]
    springs = all
  end subroutine join_springs

  !> A dead load on a set that a partner loads answers its forces, which come with the first step:
  !! the body finds the equilibrium of its start without it.
  subroutine set_dead_load(body, sets, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: force(:, :)
    integer(i4) :: k

    call request%get_text(field_set, name, errors)
    if (errors%any()) return
    call find_set(sets, name, k, request, errors)
    if (errors%any()) return
    allocate (force(3, size(sets%set(k)%node)))
    if (sets%set(k)%moves .or. request%has(field_force)) then
      call request%get(field_force, force, errors)
      if (.not. errors%any()) body%port%dead_load(:, sets%set(k)%node) = force
      body%port%answering(sets%set(k)%node) = sets%set(k)%role == role_load
    end if
    if (size(sets%set(k)%phi) == 0 .or. .not. request%has(field_moment)) return
    deallocate (force)
    allocate (force(3, size(sets%set(k)%phi)))
    call request%get(field_moment, force, errors)
    if (.not. errors%any()) body%port%dead_load(:, sets%set(k)%phi) = force
    body%port%answering(sets%set(k)%phi) = sets%set(k)%role == role_load
  end subroutine set_dead_load

  subroutine find_set(sets, name, k, request, errors)
    type(fem_sets_type), intent(in) :: sets
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: k
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    call sets%find(name, k)
    if (k == 0) call errors%add('P302', "no set '"//name//"' was selected", request%place(), &
                                'SELECT it first')
  end subroutine find_set

  !> Initial stress `value` of every point (6, points) [Pa]; in a polar body sigma_kl (9, points)
  !! and couple stress `couple` (9, points) [N/m], zero if left out.
  subroutine set_initial(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: stress(:, :), couple(:, :)

    allocate (stress(merge(6, 9, body%elastic%components == classical), &
                     body%whole%points(body%elastic%points)))
    call request%get(field_value, stress, errors)
    if (errors%any()) return
    call body%whole%own_points(stress)
    if (.not. allocated(body%elastic%initial)) &
      allocate (body%elastic%initial(body%elastic%components, body%elastic%points))
    body%elastic%initial = 0.0_wp
    body%elastic%initial(:size(stress, 1), :) = stress
    if (body%elastic%components > classical .and. request%has(field_couple)) then
      allocate (couple(9, body%whole%points(body%elastic%points)))
      call request%get(field_couple, couple, errors)
      if (errors%any()) return
      call body%whole%own_points(couple)
      body%elastic%initial(10:, :) = couple
    end if
    body%elastic%has_initial = .true.
    call body%assemble()
  end subroutine set_initial

  !> Weight of every quadrature point in the stored energy.
  subroutine set_weights(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: weight(:, :)
    allocate (weight(1, body%whole%points(body%elastic%points)))
    call request%get(field_value, weight, errors)
    if (errors%any()) return
    call body%whole%own_points(weight)
    body%elastic%factor = weight(1, :)
    call body%assemble()
  end subroutine set_weights

  !> Moduli of elements: young and poisson, or Eringen's six as `micropolar` (6, elements).
  subroutine set_moduli(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: element(:)
    real(wp), allocatable :: young(:), poisson(:), moduli(:, :)
    integer(i4) :: k

    call request%take_int(field_element, element, errors)
    if (errors%any()) return
    allocate (moduli(6, size(element)), young(size(element)), poisson(size(element)))
    if (request%has(field_micropolar)) then
      call request%get(field_micropolar, moduli, errors)
    else
      call request%get(field_young, young, errors)
      call request%get(field_poisson, poisson, errors)
    end if
    if (errors%any()) return
    if (any(element < 1) .or. any(element > body%whole%elements(body%mesh%elements))) then
      call errors%add('P302', 'moduli are given for elements that do not exist', request%place())
      return
    end if
    do k = 1, size(element)
      element(k) = body%elastic%place_of(element(k))
      if (element(k) == 0) cycle  ! another rank has it
      if (.not. request%has(field_micropolar)) moduli(:, k) = [young(k), poisson(k), 0.0_wp, &
        0.0_wp, 0.0_wp, 0.0_wp]
      call read_moduli(body%elastic, element(k), request%has(field_micropolar), request%place(), &
                       moduli(:, k), errors)
      if (errors%any()) exit
    end do
    call body%dofs%halo%agree(errors)
    if (errors%any()) return
    do k = 1, size(element)
      if (element(k) > 0) body%elastic%moduli(:, element(k)) = moduli(:, k)
    end do
    call body%assemble()
  end subroutine set_moduli

  !> Moduli of element e from what came: Eringen's six if it is `micropolar`, or young and poisson.
  !! Fault P302 of others than its law has, or of such that make no sense.
  subroutine read_moduli(elastic, e, micropolar, place, moduli, errors)
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    logical, intent(in) :: micropolar
    character(len=*), intent(in) :: place
    real(wp), intent(inout) :: moduli(6)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: broken

    if (elastic%layered_of(e) > 0) then
      call errors%add('P302', 'moduli of layered elements cannot be set', place)
    else if (elastic%rule(elastic%rule_of(e))%polar .neqv. micropolar) then
      call errors%add('P302', 'moduli of element '//str(elastic%number_of(e))//' are of the '// &
        'other law', place, 'give micropolar where the element is, young and poisson elsewhere')
    else if (micropolar) then
      broken = violated_inequality(moduli)
      if (len(broken) > 0) &
        call errors%add('P302', 'moduli of element '//str(elastic%number_of(e))//': '//broken, &
                        place)
    else if (.not. (moduli(1) > 0.0_wp .and. abs(moduli(2) + 0.25_wp) < 0.75_wp)) then
      call errors%add('P302', 'moduli must be young > 0 and -1 < poisson < 0.5', place)
    else
      moduli = lame_moduli(moduli(1), moduli(2))
    end if
  end subroutine read_moduli

  !> Factors on the mass of the nodes of a set, and with it on their weight; `value_phi` on the
  !! micro-inertia. The step limit follows.
  subroutine set_mass_factor(body, sets, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_sets_type), intent(in) :: sets
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: value(:), value_phi(:)
    integer(i4) :: k
    logical :: polar
    call request%get_text(field_set, name, errors)
    if (errors%any()) return
    call find_set(sets, name, k, request, errors)
    if (errors%any()) return
    allocate (value(size(sets%set(k)%node)), value_phi(size(sets%set(k)%phi)))
    call request%get(field_value, value, errors)
    polar = size(sets%set(k)%phi) > 0 .and. request%has(field_value_phi)
    if (polar) call request%get(field_value_phi, value_phi, errors)
    if (errors%any()) return
    if (.not. polar) value_phi = 1.0_wp
    if (.not. (all(is_finite(value)) .and. all(is_finite(value_phi)) .and. &
               minval([value, value_phi]) > 0.0_wp)) then
      call errors%add('P302', 'mass factors must be above 0, the least is '// &
        str(minval([value, value_phi])), request%place(), &
        'a node without mass has no acceleration: prescribe it')
      return
    end if
    body%port%mass_factor(sets%set(k)%node) = value
    if (polar) body%port%mass_factor(sets%set(k)%phi) = value_phi
    call body%assemble()
  end subroutine set_mass_factor

  !> Energies, momentum and angular momentum of the trial state.
  subroutine put_scalars(body, reply)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    real(wp) :: scalars(scalar_count), p(3, body%dofs%blocks), x(3)
    integer(i4) :: i

    scalars = 0.0_wp
    scalars(scalar_kinetic) = body%energy%kinetic
    scalars(scalar_elastic) = body%energy%strain
    scalars(scalar_boundary) = body%energy%support + body%energy%spring + body%energy%load &
                               - body%energy%gravity
    scalars(scalar_gravity) = body%energy%gravity
    scalars(scalar_plastic) = body%energy%plastic
    scalars(scalar_background_damping) = body%energy%damping + body%energy%numerical
    scalars(scalar_step_limit) = limit_told(body%limit%step)
    if (body%scheme%dynamic) then
      if (body%scheme%explicit) then
        p = spread(body%system%node_mass, 1, 3)*body%state%v
      else
        call multiply_mass(body%system%pattern, body%system%mass, body%state%v, p)
      end if
      scalars(scalar_momentum:scalar_momentum + 2) = sum(p(:, :body%mesh%nodes), 2)
      associate (l => scalars(scalar_angular_momentum:scalar_angular_momentum + 2))
        do i = 1, body%mesh%nodes
          x = body%mesh%x(:, i) + body%state%u(:, i)
          l(1) = l(1) + x(2)*p(3, i) - x(3)*p(2, i)
          l(2) = l(2) + x(3)*p(1, i) - x(1)*p(3, i)
          l(3) = l(3) + x(1)*p(2, i) - x(2)*p(1, i)
        end do
        l = l + spin_momentum(body, p(:, body%mesh%nodes + 1:))
      end associate
    end if
    call reply%put(field_scalars, scalars)
  end subroutine put_scalars

  !> Angular momentum of the second field with momenta p of its blocks: their sum for
  !! micro-rotations, sum over K of chi_K x p_K for columns of chi [N m s].
  pure function spin_momentum(body, p) result(l)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: p(:, :)
    real(wp) :: l(3), chi(3)
    integer(i4) :: k
    l = 0.0_wp
    if (.not. body%matter%micro%active) then
      l = sum(p, 2)
      return
    end if
    do k = 1, size(p, 2)
      chi = body%state%u(:, body%mesh%nodes + k)
      associate (c => mod(k - 1_i4, phi_columns) + 1)
        chi(c) = chi(c) + 1.0_wp
      end associate
      l = l + cross(chi, p(:, k))
    end do
  end function spin_momentum
end module fem_port_state
