!> Surfaces of a partner: triangles whose vertices it moves, forces on each vertex in return. They
!! are made by SELECT with the role surface (P258), or again from a checkpoint.
module dem_port_surface
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_force, dot_impulse, dot_v, dot_work, dot_x, field_fields, &
    field_force, field_impulse, field_material, field_triangle, field_work, field_x
  use dem_model, only: dem_model_type
  use dem_sets, only: dem_set_type, dem_sets_type, role_surface
  use dem_surface_make, only: mesh_type, check_mesh
  use dem_surface_values, only: add_mesh, aim_vertices, set_vertices
  use dem_surface_state, only: surface_soft, soft_smooth
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: select_surface, take_vertices, place_vertices, put_vertices

  real(wp), parameter :: beyond = 1.0e6_wp  !! [m], [m/s] that no vertex reaches

contains

  !> SELECT: vertices x(3, n), triangle i(3, m) of rows from 1, and the deck's name of a material.
  subroutine select_surface(model, sets, request, name, ids, changed, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(inout) :: sets
    type(message_type), intent(inout) :: request
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: ids(:)  !! the partner's ids of the vertices
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    type(mesh_type) :: mesh
    integer(i8), allocatable :: triangle(:, :)
    character(len=:), allocatable :: fields
    integer(i4) :: material, body, k, before

    before = errors%count
    changed = .false.
    fields = ''
    if (request%has(field_fields)) call request%get_text(field_fields, fields, errors)
    allocate (mesh%x(3, size(ids)))
    call request%get(field_x, mesh%x, errors)
    call request%take_int(field_triangle, triangle, errors)
    call find_material(model, request, material, errors)
    call request%all_read(errors)
    if (errors%count > before) return
    mesh%name = "surface '"//name//"'"
    call check_rows(mesh, triangle, request, errors)
    if (errors%count > before) return
    mesh%corner = int(triangle, i4)
    body = body_of(model%system, name)
    if (body > 0) then
      call check_same(model%system, body, mesh, request, errors)
    else if (model%clock%steps > 0) then
      call errors%add('P253', 'a surface can be selected only before the first step', &
                      request%place(), 'select all surfaces before READY')
    else
      call check_mesh(mesh, .false., errors)
      if (errors%count > before) return
      call add_mesh(model%system%surfaces, mesh, name, surface_soft, material, soft_smooth, &
                    0.5_wp*(minval(mesh%x, 2) + maxval(mesh%x, 2)))
      body = model%system%surfaces%n
      changed = .true.
    end if
    if (errors%count > before) return
    call sets%put(name, role_surface, fields, [(k, k=1, size(ids))], body)
  end subroutine select_surface

  !> The material that the partner names must have a law with those of all grains (P258).
  subroutine find_material(model, request, material, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: request
    integer(i4), intent(out) :: material
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k

    material = 0
    call request%get_text(field_material, name, errors)
    if (errors%any()) return
    do k = 1, size(model%choices%material)
      if (model%choices%material(k)%s == name) material = k
    end do
    if (material == 0) then
      call errors%add('P258', "the grains' deck has no material '"//name//"' for a surface", &
                      request%place(), 'define it with &material id = ..., and its &contact')
      return
    end if
    do k = 1, size(model%choices%material)
      if (.not. any(model%system%grains%material == k)) cycle
      if (model%system%laws(material, k)%kind /= 0) cycle
      call errors%add('P258', "the grains' deck has no contact law for '"//name//"' and '"// &
                      model%choices%material(k)%s//"'", request%place(), &
                      'add &contact between = ... to the deck of the grains')
      return
    end do
  end subroutine find_material

  !> Triangles name rows of x, which are numbers (P258).
  subroutine check_rows(mesh, triangle, request, errors)
    type(mesh_type), intent(in) :: mesh
    integer(i8), intent(in) :: triangle(:, :)
    type(message_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (size(triangle, 1) /= 3 .or. size(triangle, 2) == 0) then
      call errors%add('P258', mesh%name//' has no triangles', request%place(), &
                      'triangle has three rows of x for each')
      return
    end if
    do k = 1, size(triangle, 2)
      if (all(triangle(:, k) >= 1 .and. triangle(:, k) <= size(mesh%x, 2))) then
        if (all(is_finite(mesh%x(:, triangle(:, k))))) then
          if (all(abs(mesh%x(:, triangle(:, k))) < beyond)) cycle
        end if
      end if
      call errors%add('P258', mesh%name//': triangle '//str(k)//' names a vertex that is not '// &
                      'there or has no place: '//str(int(triangle(:, k), i4)), request%place(), &
                      'rows of x count from 1 to '//str(int(size(mesh%x, 2), i4)))
      return
    end do
  end subroutine check_rows

  !> Number of the soft body of this name, 0 if there is none.
  pure integer(i4) function body_of(system, name) result(body)
    type(dem_system_type), intent(in) :: system
    character(len=*), intent(in) :: name
    do body = 1, system%surfaces%n
      if (system%surfaces%name(body)%s == name .and. system%surfaces%kind(body) == surface_soft) &
        return
    end do
    body = 0
  end function body_of

  !> A surface that is there already (a restart, or selected twice) has the same triangles (P253).
  subroutine check_same(system, body, mesh, request, errors)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: body
    type(mesh_type), intent(in) :: mesh
    type(message_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    logical :: same
    associate (s => system%surfaces, low => system%surfaces%first_triangle(body))
      same = s%first_vertex(body + 1) - s%first_vertex(body) == size(mesh%x, 2) .and. &
             s%first_triangle(body + 1) - low == size(mesh%corner, 2)
      if (same) same = all(s%mesh%corner(:, low:s%first_triangle(body + 1) - 1) &
                           - s%first_vertex(body) + 1 == mesh%corner)
    end associate
    if (.not. same) call errors%add('P253', mesh%name//' was made of other triangles', &
                                    request%place(), 'select it as before')
  end subroutine check_same

  !> ADVANCE: where the vertices are at t1, in a straight line; a set not mentioned stays at rest.
  subroutine take_vertices(system, set, request, span, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    real(wp), intent(in) :: span  !! of the interval [s]
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :)
    integer(i4) :: low, high

    low = system%surfaces%first_vertex(set%body)
    high = system%surfaces%first_vertex(set%body + 1) - 1
    allocate (x, source=system%surfaces%mesh%x(:, low:high))
    if (request%has(set%name//dot_x)) call request%get(set%name//dot_x, x, errors)
    call check_numbers(set, x, errors)
    if (errors%any()) return
    call aim_vertices(system%surfaces, low, (x - system%surfaces%mesh%x(:, low:high))/span, x)
  end subroutine take_vertices

  !> FORCE: place and velocity of the vertices now; what is not mentioned stays.
  subroutine place_vertices(system, set, request, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :), v(:, :)
    integer(i4) :: low, high

    low = system%surfaces%first_vertex(set%body)
    high = system%surfaces%first_vertex(set%body + 1) - 1
    allocate (x, source=system%surfaces%mesh%x(:, low:high))
    allocate (v, source=system%surfaces%mesh%v(:, low:high))
    if (request%has(set%name//dot_x)) call request%get(set%name//dot_x, x, errors)
    if (request%has(set%name//dot_v)) call request%get(set%name//dot_v, v, errors)
    call check_numbers(set, x, errors)
    call check_numbers(set, v, errors)
    if (errors%any()) return
    call set_vertices(system%surfaces, low, x, v)
  end subroutine place_vertices

  subroutine check_numbers(set, x, errors)
    type(dem_set_type), intent(in) :: set
    real(wp), intent(in) :: x(:, :)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, size(x, 2)
      if (all(is_finite(x(:, k)))) then
        if (all(abs(x(:, k)) < beyond)) cycle
      end if
      call errors%add('P257', "set '"//set%name//"': vertex "//str(k)//' was sent to '// &
                      str(x(:, k)), 'exchange port', 'positions and velocities must be numbers')
      return
    end do
  end subroutine check_numbers

  !> Forces of the grains on the vertices, and, after motion, their impulses and the work.
  subroutine put_vertices(system, set, motion, reply)
    type(dem_system_type), intent(in) :: system
    type(dem_set_type), intent(in) :: set
    logical, intent(in) :: motion
    type(message_type), intent(inout) :: reply
    integer(i4) :: low, high
    associate (s => system%surfaces)
      low = s%first_vertex(set%body)
      high = s%first_vertex(set%body + 1) - 1
      if (set%wants(field_force)) call reply%put(set%name//dot_force, s%mesh%force(:, low:high))
      if (.not. motion) return
      if (set%wants(field_impulse)) &
        call reply%put(set%name//dot_impulse, s%mesh%impulse(:, low:high))
      if (set%wants(field_work)) call reply%put(set%name//dot_work, &
        s%sums%work(s%first_part(set%body)))
    end associate
  end subroutine put_vertices
end module dem_port_surface
