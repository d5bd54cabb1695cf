!> Stresses at quadrature points, element means, nodal means; forces of stresses.
module fem_recover
  use talus_kinds, only: wp, i4
  use fem_dofs, only: fem_dofs_type
  use fem_layered, only: layered_stress
  use fem_elastic, only: fem_elastic_type, classical
  use fem_element, only: fem_shape_type, element_shape, element_stress, element_force, points_at
  use fem_rules, only: fem_formulation_type
  use fem_strain, only: volume_gradients
  use fem_hex8, only: hex8_geometry, hex8_geometry_type, hex8_stress, hex8_forces
  use fem_hourglass, only: lanes, one_point_size, one_point_data, one_point_force
  use fem_incompatible, only: add_mode_stress
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: point_stress, mean_stress, nodal_stress, initial_stress_force, point_positions
  public :: point_weights, element_forces, add_element_forces, nodal_rotation

  integer(i4), parameter :: full(9) = [1, 4, 6, 4, 2, 5, 6, 5, 3]  !! six components as nine
  integer(i4), parameter :: six(6) = [1, 5, 9, 2, 6, 7]            !! and back

contains

  !> Stress at all points (components, points), the initial stress included: xx yy zz xy yz zx [Pa]
  !! or, where a part of the body is polar, sigma_kl [Pa] and m_kl [N/m], nine each.
  subroutine point_stress(mesh, dofs, elastic, u, stress)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: stress(:, :)
    integer(i4) :: e
    !$omp parallel do default(none) shared(mesh, dofs, elastic, u, stress) private(e) &
    !$omp schedule(static)
    do e = 1, mesh%elements
      call stress_of(mesh, dofs, elastic, e, u, &
                     stress(:, elastic%point(e):elastic%point(e + 1) - 1))
    end do
    !$omp end parallel do
    if (elastic%has_initial) stress = stress + elastic%initial
  end subroutine point_stress

  !> Stress of element e without the initial stress, in the components of the body.
  subroutine stress_of(mesh, dofs, elastic, e, u, stress)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: stress(:, :)
    type(hex8_geometry_type) :: geometry
    type(fem_shape_type) :: shape
    real(wp) :: six_values(classical, size(stress, 2))

    associate (rule => elastic%rule(elastic%rule_of(e)), m => elastic%moduli(:, e), &
               block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      if (rule%brick) then
        call hex8_geometry(mesh%x(:, block), geometry)
        call hex8_stress(geometry, u(:, block), m(1) + 2.0_wp/3.0_wp*m(2), m(2), rule%bbar, &
                         six_values)
        if (rule%modes > 0) call add_mode_stress(rule, mesh%x(:, block), geometry, m(:2), &
          elastic%factor(elastic%point(e):elastic%point(e + 1) - 1), six_values)
      else
        call element_shape(rule%at, mesh%x(:, block(:rule%nodes)), shape)
        if (elastic%layered_of(e) > 0) then
          call layered_stress(rule, shape, u(:, block), elastic%layered(elastic%layered_of(e)), &
                              stress)
          return
        else if (rule%polar) then
          call element_stress(rule, shape, u(:, block), m, stress)
          return
        end if
        call element_stress(rule, shape, u(:, block), m, six_values)
        if (rule%linear_volume) call fit_pressure(rule, mesh%x(:, block), shape, u(:, block), &
          m(1) + 2.0_wp/3.0_wp*m(2), six_values)
      end if
    end associate
    if (size(stress, 1) == classical) then
      stress = six_values
    else
      stress(:9, :) = six_values(full, :)
      stress(10:, :) = 0.0_wp
    end if
  end subroutine stress_of

  !> Replace the volumetric strain in the stress of an element by that of B-bar.
  subroutine fit_pressure(rule, x, shape, u, bulk, stress)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :), u(:, :), bulk  !! (3, nodes) [m], [Pa]
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(inout) :: stress(:, :)         !! (6, points) [Pa]
    real(wp) :: fitted(3*rule%nodes, rule%at%n), volume
    integer(i4) :: q
    call volume_gradients(rule, x, shape, fitted)
    do q = 1, rule%at%n
      volume = dot_product(fitted(:, q), reshape(u, [3*rule%nodes])) - sum(shape%u(:, :, q)*u)
      stress(:3, q) = stress(:3, q) + bulk*volume
    end do
  end subroutine fit_pressure

  !> Forces of the mean stress act by the gradients of B-bar.
  subroutine fit_forces(rule, x, shape, stress, factor, force)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :), stress(:, :), factor(:)  !! (3, nodes), (6, points), (points)
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(inout) :: force(:, :)                    !! (3, nodes) [N]
    real(wp) :: fitted(3*rule%nodes, rule%at%n), push
    integer(i4) :: q
    call volume_gradients(rule, x, shape, fitted)
    do q = 1, rule%at%n
      push = factor(q)*shape%weight(q)*sum(stress(:3, q))/3.0_wp
      force = force + push*(reshape(fitted(:, q), [3, rule%nodes]) - shape%u(:, :, q))
    end do
  end subroutine fit_forces

  !> Forces of the stress of element e, which has the components of the body.
  subroutine force_of(mesh, dofs, elastic, e, stress, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: stress(:, :)
    real(wp), intent(out) :: force(:, :)
    type(hex8_geometry_type) :: geometry
    type(fem_shape_type) :: shape
    real(wp) :: six_values(classical, size(stress, 2))

    associate (rule => elastic%rule(elastic%rule_of(e)), &
               factor => elastic%factor(elastic%point(e):elastic%point(e + 1) - 1), &
               block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      if (size(stress, 1) == classical) then
        six_values = stress
      else
        six_values = stress(six, :)
      end if
      if (rule%brick) then
        call hex8_geometry(mesh%x(:, block), geometry)
        call hex8_forces(geometry, six_values, factor, rule%bbar, force)
        return
      end if
      call element_shape(rule%at, mesh%x(:, block(:rule%nodes)), shape)
      if (rule%polar) then
        call element_force(rule, shape, stress, factor, force)
      else
        call element_force(rule, shape, six_values, factor, force)
        if (rule%linear_volume) call fit_forces(rule, mesh%x(:, block), shape, six_values, factor, &
          force)
      end if
    end associate
  end subroutine force_of

  !> Means over the elements (components, elements) by volume.
  subroutine mean_stress(mesh, dofs, elastic, stress, mean)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: stress(:, :)
    real(wp), intent(out) :: mean(:, :)
    real(wp) :: weight(elastic%points)
    integer(i4) :: e
    call point_weights(mesh, dofs, elastic, weight)
    do e = 1, mesh%elements
      associate (first => elastic%point(e), last => elastic%point(e + 1) - 1)
        mean(:, e) = matmul(stress(:, first:last), weight(first:last))/sum(weight(first:last))
      end associate
    end do
  end subroutine mean_stress

  !> Nodal stresses (components, nodes). Bricks share theirs by shape functions, sum of N sigma w
  !! over sum of N w; the others by a least squares fit of the corner functions in the element, and
  !! nodes between corners have the mean of the fits there.
  subroutine nodal_stress(mesh, dofs, elastic, stress, nodal)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: stress(:, :)
    real(wp), intent(out) :: nodal(:, :)
    real(wp) :: share(mesh%nodes), weight(elastic%points)
    real(wp), allocatable :: corner(:, :), volume(:)
    integer(i4) :: e, a

    nodal = 0.0_wp
    share = 0.0_wp
    call point_weights(mesh, dofs, elastic, weight)
    do e = 1, mesh%elements
      if (elastic%is_absent(e)) cycle
      associate (rule => elastic%rule(elastic%rule_of(e)), first => elastic%point(e), &
                 last => elastic%point(e + 1) - 1, node => dofs%block(dofs%start(e):))
        volume = matmul(rule%at%corner, weight(first:last))
        if (rule%brick) then
          call add_brick(rule%at%corner, node, weight(first:last), stress(:, first:last), nodal)
          share(node(:8)) = share(node(:8)) + volume
          cycle
        end if
        corner = matmul(stress(:, first:last), transpose(rule%spread))
        do a = 1, rule%nodes
          nodal(:, node(a)) = nodal(:, node(a)) + sum(volume)*matmul(corner, rule%middle(:, a))
          share(node(a)) = share(node(a)) + sum(volume)
        end do
      end associate
    end do
    call complete(dofs, nodal, share)
    do a = 1, mesh%nodes
      nodal(:, a) = nodal(:, a)/max(share(a), tiny(1.0_wp))  ! nodes of absent elements
    end do
  end subroutine nodal_stress

  !> Add the stresses of the points of a brick to its corners, weighted by N w.
  pure subroutine add_brick(corner, node, weight, stress, nodal)
    real(wp), intent(in) :: corner(:, :)  !! (corners, points) N
    integer(i4), intent(in) :: node(:)
    real(wp), intent(in) :: weight(:), stress(:, :)
    real(wp), intent(inout) :: nodal(:, :)
    integer(i4) :: q, a
    do q = 1, size(weight)
      do a = 1, size(corner, 1)
        nodal(:, node(a)) = nodal(:, node(a)) + corner(a, q)*weight(q)*stress(:, q)
      end do
    end do
  end subroutine add_brick

  !> Sums at the nodes over the elements of all ranks.
  subroutine complete(dofs, nodal, share)
    type(fem_dofs_type), intent(in) :: dofs
    real(wp), intent(inout) :: nodal(:, :), share(:)
    real(wp), allocatable :: both(:, :)
    integer(i4) :: c
    if (.not. dofs%halo%several()) return
    c = int(size(nodal, 1), i4)
    allocate (both(c + 1, dofs%blocks), source=0.0_wp)
    both(:c, :dofs%nodes) = nodal
    both(c + 1, :dofs%nodes) = share
    call dofs%halo%sum_up(both)
    nodal = both(:c, :dofs%nodes)
    share = both(c + 1, :dofs%nodes)
  end subroutine complete

  !> Micro-rotations at all nodes, rows 1 to 3 of `nodal`: between corners as the element
  !! interpolates them, zero where there are none. `u` may be the rates too.
  subroutine nodal_rotation(dofs, elastic, u, nodal)
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)        !! (3, blocks)
    real(wp), intent(inout) :: nodal(:, :)
    real(wp), allocatable :: turn(:, :)
    integer(i4) :: e, a, n
    nodal(:3, :) = 0.0_wp
    do e = 1, size(elastic%rule_of)
      associate (rule => elastic%rule(elastic%rule_of(e)), block => dofs%block(dofs%start(e):))
        if (.not. rule%polar) cycle
        do a = 1, rule%nodes
          n = block(a)
          if (dofs%phi(n) > 0) nodal(:3, n) = u(:, dofs%phi(n))
          if (dofs%phi(n) > 0) cycle
          nodal(:3, n) = matmul(u(:, block(rule%nodes + 1:rule%nodes + rule%corners)), &
                                rule%middle(:, a))
        end do
      end associate
    end do
    if (.not. dofs%halo%several()) return
    allocate (turn(3, dofs%blocks), source=0.0_wp)
    turn(:, :dofs%nodes) = nodal(:3, :)
    call dofs%halo%spread_out(turn)
    nodal(:3, :) = turn(:, :dofs%nodes)
  end subroutine nodal_rotation

  !> Internal forces (3, blocks) of the (weighted) initial stress [N, N m].
  subroutine initial_stress_force(mesh, dofs, elastic, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(out) :: force(:, :)
    integer(i4) :: e
    force = 0.0_wp
    if (.not. elastic%has_initial) return
    do e = 1, mesh%elements
      call add_force(mesh, dofs, elastic, e, &
                     elastic%initial(:, elastic%point(e):elastic%point(e + 1) - 1), force)
    end do
    call dofs%halo%sum_up(force)
  end subroutine initial_stress_force

  !> Internal forces (3, blocks) of chosen elements at displacements u [N, N m].
  subroutine element_forces(mesh, dofs, elastic, u, list, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)
    integer(i4), intent(in) :: list(:)  !! elements
    real(wp), intent(out) :: force(:, :)
    integer(i4) :: k
    force = 0.0_wp
    do k = 1, size(list)
      call add_element_forces(mesh, dofs, elastic, u, list(k), force)
    end do
  end subroutine element_forces

  !> Add the forces of element e to those of its blocks.
  subroutine add_element_forces(mesh, dofs, elastic, u, e, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: u(:, :)
    integer(i4), intent(in) :: e
    real(wp), intent(inout) :: force(:, :)
    real(wp), allocatable :: stress(:, :)
    integer(i4) :: first, last
    first = elastic%point(e)
    last = elastic%point(e + 1) - 1
    allocate (stress(elastic%components, last - first + 1))
    call stress_of(mesh, dofs, elastic, e, u, stress)
    if (elastic%has_initial) stress = stress + elastic%initial(:, first:last)
    call add_force(mesh, dofs, elastic, e, stress, force)
    if (elastic%rule(elastic%rule_of(e))%one_point) &
      call add_hourglass_force(mesh, elastic, e, u, force)
  end subroutine add_element_forces

  !> Forces that a one-point element has from its hourglass modes.
  subroutine add_hourglass_force(mesh, elastic, e, u, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(inout) :: force(:, :)
    type(fem_shape_type) :: shape
    real(wp) :: data(lanes, one_point_size), f(lanes, 3, 8)
    real(wp), dimension(lanes, 3, 8) :: x, b, moved
    associate (node => mesh%node(mesh%start(e):mesh%start(e) + 7))
      call element_shape(elastic%rule(elastic%rule_of(e))%at, mesh%x(:, node), shape)
      x = spread(mesh%x(:, node), 1, lanes)
      b = spread(shape%u(:, :, 1), 1, lanes)
      moved = spread(u(:, node), 1, lanes)
      call one_point_data(x, b, spread(shape%weight(1), 1, lanes), &
                          spread(elastic%moduli(:, e), 1, lanes), &
                          spread(elastic%factor(elastic%point(e)), 1, lanes), &
                          spread(elastic%hourglass(e), 1, lanes), data)
      data(:, 37:38) = 0.0_wp  ! the stress of the point is counted already
      call one_point_force(data, moved, f)
      force(:, node) = force(:, node) + f(1, :, :)
    end associate
  end subroutine add_hourglass_force

  subroutine add_force(mesh, dofs, elastic, e, stress, force)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: stress(:, :)
    real(wp), intent(inout) :: force(:, :)
    real(wp), allocatable :: fe(:, :)
    associate (block => dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
      allocate (fe(3, size(block)))
      call force_of(mesh, dofs, elastic, e, stress, fe)
      force(:, block) = force(:, block) + fe
    end associate
  end subroutine add_force

  !> Positions of all points (3, points) [m], element by element.
  subroutine point_positions(mesh, dofs, elastic, x)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(out) :: x(:, :)
    integer(i4) :: e
    do e = 1, mesh%elements
      associate (rule => elastic%rule(elastic%rule_of(e)))
        x(:, elastic%point(e):elastic%point(e + 1) - 1) = points_at(rule%at, &
          mesh%x(:, dofs%block(dofs%start(e):dofs%start(e) + rule%nodes - 1)))
      end associate
    end do
  end subroutine point_positions

  !> Volumes of all points (points) [m^3].
  subroutine point_weights(mesh, dofs, elastic, weight)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(out) :: weight(:)
    type(hex8_geometry_type) :: geometry
    type(fem_shape_type) :: shape
    integer(i4) :: e, last
    last = 0
    do e = 1, mesh%elements
      associate (rule => elastic%rule(elastic%rule_of(e)), first => elastic%point(e), &
                 node => dofs%block(dofs%start(e):))
        if (rule%brick) then
          call hex8_geometry(mesh%x(:, node(:8)), geometry)
          weight(first:first + 7) = geometry%weight
          cycle
        end if
        if (allocated(shape%weight) .and. elastic%rule_of(e) /= last) &
          deallocate (shape%weight, shape%u, shape%phi)
        last = elastic%rule_of(e)
        call element_shape(rule%at, mesh%x(:, node(:rule%nodes)), shape)
        weight(first:elastic%point(e + 1) - 1) = shape%weight
      end associate
    end do
  end subroutine point_weights
end module fem_recover
