!> Make the interface from what the solvers describe, or from a checkpoint's reference state.
module cpl_setup
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: verb_select, verb_set, verb_ready
  use talus_port_names, only: field_a, field_connectivity, field_force, field_held, field_id, &
    field_mass, field_moment, field_phi, field_polar, field_quat, field_radius, field_rehearsal, &
    field_scalars, field_set, field_stiffness, field_u, field_v, field_what, field_x, &
    role_load, what_dead_load, what_facets, what_grains, what_group, what_mesh
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type, interface_springs, rotation_micro
  use talus_log, only: short_number
  use cpl_exchange, only: note_kicks, set_springs, read_forces, read_motion
  use cpl_interface, only: interface_type, select_ghosts, node_set, phi_set
  use cpl_start, only: put_reference
  use cpl_shapes, only: corner_count, node_count
  use cpl_solid_mesh, only: solid_mesh_type
  use cpl_order, only: sort_order
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: find_ghosts, find_vertices, find_radii, make_map, select_sets, begin_interface
  public :: end_rehearsal, read_mesh

  real(wp), parameter :: first_stiffness = 1.5_wp  !! springs over the contacts' stiffness

contains

  !> DESCRIBE: ids and positions of the ghosts.
  subroutine find_ghosts(grains, group, ids, x, timers, errors)
    type(cpl_solver_type), intent(inout) :: grains
    character(len=*), intent(in) :: group
    integer(i8), allocatable, intent(out) :: ids(:)
    real(wp), allocatable, intent(out) :: x(:, :)  !! (3, n) [m]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: all_ids(:)
    real(wp), allocatable :: all_x(:, :)
    integer(i4), allocatable :: row(:)
    integer(i4) :: k

    call grains%describe(what_group, group, timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, ids, errors)
    call grains%describe(what_grains, '', timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, all_ids, errors)
    call grains%reply%take(field_x, all_x, errors)
    if (errors%any()) return
    allocate (row(size(ids)))
    call places_of(ids, all_ids, row)
    k = int(findloc(row, 0, 1), i4)
    if (k == 0) then
      x = all_x(:, row)
      return
    end if
    call errors%add('I403', 'the group of the ghosts names grain '//str(ids(k))// &
                    ', which the packing does not hold', '', 'make the packing again')
  end subroutine find_ghosts

  !> Corner nodes of the facets of a surface, as if they were ghosts: ids and places.
  subroutine find_vertices(solid, group, ids, x, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: group
    integer(i8), allocatable, intent(out) :: ids(:)
    real(wp), allocatable, intent(out) :: x(:, :)  !! (3, n) [m]
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(solid_mesh_type) :: mesh
    logical, allocatable :: used(:)
    integer(i4) :: k

    call read_mesh(solid, group, mesh, timers, errors)
    if (errors%any()) return
    allocate (used(size(mesh%x, 2)), source=.false.)
    do k = 1, size(mesh%facets, 2)
      used(mesh%facets(:corner_count(node_count(mesh%facets(:, k))), k)) = .true.
    end do
    ids = pack([(int(k, i8), k=1, size(used))], used)
    x = mesh%x(:, ids)
  end subroutine find_vertices

  !> Triangles of the facets' corners, four corners cut along their shorter diagonal.
  subroutine cut_facets(mesh, ids, triangle)
    type(solid_mesh_type), intent(in) :: mesh
    integer(i8), intent(in) :: ids(:)
    integer(i8), allocatable, intent(out) :: triangle(:, :)  !! (3, k) places in ids
    integer(i8), allocatable :: place(:)
    integer(i4) :: k, n, node(4)

    allocate (place(size(mesh%x, 2)), triangle(3, 2*size(mesh%facets, 2)))
    place = 0
    place(ids) = [(int(k, i8), k=1, size(ids))]
    n = 0
    do k = 1, size(mesh%facets, 2)
      n = n + 1
      node = mesh%facets([1, 2, 3, 1], k)
      if (corner_count(node_count(mesh%facets(:, k))) == 4) then
        node(4) = mesh%facets(4, k)
        if (norm2(mesh%x(:, node(3)) - mesh%x(:, node(1))) > (1.0_wp + 1.0e-12_wp) &
            *norm2(mesh%x(:, node(4)) - mesh%x(:, node(2)))) node = cshift(node, 1)
        triangle(:, n + 1) = place(node([1, 3, 4]))
      end if
      triangle(:, n) = place(node(:3))
      if (corner_count(node_count(mesh%facets(:, k))) == 4) n = n + 1
    end do
    triangle = triangle(:, :n)
  end subroutine cut_facets

  !> Places of ids among all, 0 where one is not there: n log n.
  pure subroutine places_of(ids, all_ids, row)
    integer(i8), intent(in) :: ids(:), all_ids(:)
    integer(i4), intent(out) :: row(:)
    integer(i4) :: order(size(all_ids)), g, low, high, middle
    call sort_order(real(all_ids, wp), order)
    do g = 1, size(ids)
      low = 1
      high = size(order)
      do while (low < high)
        middle = (low + high)/2
        if (all_ids(order(middle)) < ids(g)) then
          low = middle + 1
        else
          high = middle
        end if
      end do
      row(g) = 0
      if (high == 0) cycle
      if (all_ids(order(low)) == ids(g)) row(g) = order(low)
    end do
  end subroutine places_of

  !> Facets and mesh of the solid; the operator N and its identities.
  subroutine make_map(face, solid, choices, ids, x_ghost, identity, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(cpl_choices_type), intent(in) :: choices
    integer(i8), intent(in) :: ids(:)
    real(wp), intent(in) :: x_ghost(:, :)  !! reference positions (3, n) [m]
    real(wp), intent(out) :: identity
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    type(solid_mesh_type) :: mesh
    real(wp) :: turned
    integer(i8) :: k

    identity = 0.0_wp
    call read_mesh(solid, choices%facets, mesh, timers, errors)
    if (errors%any()) return
    face%place%material = choices%surface
    if (len(face%place%material) > 0) call cut_facets(mesh, ids, face%place%triangle)
    call face%map%build(ids, x_ghost, mesh%facets, mesh%x, choices%max_offset, errors)
    if (errors%any()) return
    call face%map%identity_error(x_ghost, mesh%x, identity, errors)
    if (.not. errors%any()) call face%transfer%build(face%map, mesh, choices%spread, &
                                                     choices%rotation, errors)
    if (errors%any()) return
    call face%init(x_ghost, mesh%x)
    face%place%polar_id = pack([(k, k=1, size(mesh%polar, kind=i8))], mesh%polar == 1)
    call face%transfer%identity_error(face%place%x_node, x_ghost, turned, errors)
    identity = max(identity, turned)
    call face%relax%init(choices%interface, choices%theta, face%transfer%rows, face%map%ghosts)
    face%place%radius = spread(0.0_wp, 1, face%map%ghosts)
  end subroutine make_map

  !> DESCRIBE: a group of facets and the mesh behind them.
  subroutine read_mesh(solid, group, mesh, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    character(len=*), intent(in) :: group
    type(solid_mesh_type), intent(inout) :: mesh
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call solid%describe(what_facets, group, timers, errors)
    if (errors%any()) return
    call solid%reply%take_int(field_connectivity, mesh%facets, errors)
    call solid%describe(what_mesh, '', timers, errors)
    if (errors%any()) return
    call solid%reply%take(field_x, mesh%x, errors)
    allocate (mesh%hex8(8, 0))
    if (solid%reply%has(field_connectivity)) &
      call solid%reply%take_int(field_connectivity, mesh%hex8, errors)
    if (errors%any()) return
    allocate (mesh%polar(size(mesh%x, 2)), source=0_i4)
    if (solid%reply%has(field_polar)) call solid%reply%take_int(field_polar, mesh%polar, errors)
    if (.not. errors%any()) call mesh%check(errors)
  end subroutine read_mesh

  !> DESCRIBE: radii of the ghosts, for springs that hold their rotation, and their orientations.
  subroutine find_radii(face, grains, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: grains
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: all_ids(:)
    real(wp), allocatable :: radius(:), quat(:, :)
    integer(i4) :: row(face%map%ghosts)

    call grains%describe(what_grains, '', timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, all_ids, errors)
    call grains%reply%take(field_radius, radius, errors)
    call grains%reply%take(field_quat, quat, errors)
    if (errors%any()) return
    call places_of(face%map%ghost_id, all_ids, row)
    face%place%radius = radius(row)
    call face%orient(quat(:, row))
    face%relax%arm = sum(face%place%radius)/face%map%ghosts
  end subroutine find_radii

  !> SELECT the ghosts and the interface nodes.
  subroutine select_sets(face, solvers, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: stiffness(face%map%ghosts)
    integer(i4) :: k

    do k = 1, 2
      if (k == side_grains) then
        call solvers(k)%start_request(verb_select, face%step, solvers(k)%time, solvers(k)%time)
        call select_ghosts(face, solvers(k)%request)
      else
        call solvers(k)%start_select(face%step, node_set, role_load, face%map%node_id, &
                                     field_u//','//field_v//','//field_a)
      end if
      call solvers(k)%send(timers, errors)
    end do
    do k = 1, 2
      if (.not. errors%any()) call solvers(k)%receive(timers, errors)
    end do
    if (face%transfer%rotation == rotation_micro .and. .not. errors%any()) &
      call select_rotations(face, solvers(side_solid), timers, errors)
    if (errors%any()) return
    call solvers(side_grains)%reply%get(field_stiffness, stiffness, errors)
    if (errors%any()) return
    call face%watch%note_stiffness(stiffness)
    if (face%kicks%active) call take_masses(face, solvers(side_solid), errors)
  end subroutine select_sets

  !> Masses and supports of the interface nodes from the solid's reply to SELECT.
  subroutine take_masses(face, solid, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: held(3, face%map%nodes)
    allocate (face%kicks%mass(face%map%nodes))
    call solid%reply%get(field_mass, face%kicks%mass, errors)
    call solid%reply%get_int(field_held, held, errors)
    face%kicks%held = held == 1
    face%kicks%step_limit = solid%step_limit
  end subroutine take_masses

  !> D424: kicks of an exchange so long make the interface nodes unstable, whatever is behind them.
  subroutine check_exchange(face, exchange, errors)
    type(interface_type), intent(inout) :: face
    real(wp), intent(in) :: exchange  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: most = 4.0_wp
    call note_kicks(face)
    if (face%kicks%rate*exchange**2 <= most) return
    call errors%add('D424', 'an exchange of '//str(exchange)//' s is too long for the contacts '// &
                    'of the ghosts, '//short_number(face%watch%contact_stiffness)//' N/m at '// &
                    'most: it may be '//short_number(face%kicks%limit(exchange))//' s', &
                    '&clock exchange', &
                    "shorten it, or write scheme = 'iterated'")
  end subroutine check_exchange

  !> SELECT the micro-rotations of the interface nodes.
  subroutine select_rotations(face, solid, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_select(face%step, phi_set, role_load, face%transfer%phi_id, field_phi)
    call solid%ask(timers, errors)
  end subroutine select_rotations

  !> READY grains, springs and dead load on the solid, READY solid. Before that a fresh run
  !! rehearses READY with the solid: what it must refuse it refuses while there are no files. A
  !! fresh run takes forces and motion from the replies; a restarted one keeps what its checkpoint
  !! says.
  !! With initial = 'relax' the first READY begins the rehearsal: `end_rehearsal` comes after it.
  subroutine begin_interface(face, solvers, choices, again, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(cpl_choices_type), intent(in) :: choices
    logical, intent(in) :: again  !! after a restart
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: p(face%transfer%rows, face%map%ghosts), stiffness, load(3, face%transfer%blocks)
    logical :: rehearsal

    rehearsal = choices%relaxed .and. .not. again
    if (face%kicks%active) call check_exchange(face, choices%exchange, errors)
    if (errors%any()) return
    if (.not. again) call ready(solvers(side_solid), .true., face%step, timers, errors)
    if (errors%any()) return
    call ready(solvers(side_grains), rehearsal, face%step, timers, errors)
    if (errors%any()) return
    if (.not. again) then
      call read_forces(face, solvers(side_grains), p, errors)
      call solvers(side_grains)%reply%get(field_scalars, face%ledger%grains, errors)
      call face%pore%start_grains(solvers(side_grains)%reply, choices%dead_load, errors)
      if (errors%any()) return
      call face%forces%begin(p)
      call face%watch%note_force(p)
      if (choices%interface == interface_springs) then
        stiffness = choices%stiffness
        if (.not. stiffness > 0.0_wp) stiffness = first_stiffness*face%watch%contact_stiffness
        if (stiffness > 0.0_wp) &
          call face%springs%make(stiffness, face%map, face%transfer, face%place%radius)
      end if
      if (choices%dead_load) then
        call face%transfer%to_nodes(p, load)
        face%start%dead_load = face%start%dead_load - load
        call face%relax%hold(p)
        face%relax%begun = .true.
      end if
    end if
    if (face%springs%n > 0) &
      call set_springs(face, solvers(side_solid), solvers(side_solid)%time, timers, errors)
    if (any(abs(face%start%dead_load) > 0.0_wp) .and. .not. (errors%any() .or. face%kicks%active)) &
      call put_dead_load(face, solvers(side_solid), timers, errors)  ! else in the kicks
    if (again .and. choices%relaxed .and. .not. errors%any()) &
      call put_reference(face, solvers(side_solid), timers, errors)
    if (errors%any()) return
    call ready(solvers(side_solid), rehearsal, face%step, timers, errors)
    if (again .or. errors%any()) return
    call take_solid(face, solvers(side_solid), errors)
  end subroutine begin_interface

  !> READY to both after the rehearsal: the run begins at this state.
  subroutine end_rehearsal(face, solvers, timers, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solvers(2)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    real(wp) :: p(face%transfer%rows, face%map%ghosts)

    call ready(solvers(side_grains), .false., face%step, timers, errors)
    if (errors%any()) return
    call read_forces(face, solvers(side_grains), p, errors)
    call solvers(side_grains)%reply%get(field_scalars, face%ledger%grains, errors)
    call face%forces%begin(p)
    call face%watch%note_force(p)
    if (.not. errors%any()) call ready(solvers(side_solid), .false., face%step, timers, errors)
    if (.not. errors%any()) call take_solid(face, solvers(side_solid), errors)
  end subroutine end_rehearsal

  !> State of the interface nodes from the solid's reply to READY.
  subroutine take_solid(face, solid, errors)
    type(interface_type), intent(inout) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(error_list_type), intent(inout) :: errors
    call read_motion(face, solid, face%motion%u, face%motion%v, errors)
    call solid%reply%get(field_scalars, face%ledger%solid, errors)
    call face%pore%start_solid(solid%reply, errors)
    face%motion%v_before = face%motion%v
    face%motion%u_new = face%motion%u
  end subroutine take_solid

  subroutine ready(solver, rehearsal, step, timers, errors)
    type(cpl_solver_type), intent(inout) :: solver
    logical, intent(in) :: rehearsal
    integer(i8), intent(in) :: step
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solver%start_request(verb_ready, step, solver%time, solver%time)
    if (rehearsal) call solver%request%put_int(field_rehearsal, 1_i4)
    call solver%ask(timers, errors)
  end subroutine ready

  subroutine put_dead_load(face, solid, timers, errors)
    type(interface_type), intent(in) :: face
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors

    call put_load(node_set, field_force, face%start%dead_load(:, :face%map%nodes))
    if (face%transfer%rotation /= rotation_micro .or. errors%any()) return
    call put_load(phi_set, field_moment, face%start%dead_load(:, face%map%nodes + 1:))

  contains

    subroutine put_load(set, field, load)
      character(len=*), intent(in) :: set, field
      real(wp), intent(in) :: load(:, :)
      call solid%start_request(verb_set, face%step, solid%time, solid%time)
      call solid%request%put_text(field_what, what_dead_load)
      call solid%request%put_text(field_set, set)
      call solid%request%put(field, load)
      call solid%ask(timers, errors)
    end subroutine put_load
  end subroutine put_dead_load
end module cpl_setup
