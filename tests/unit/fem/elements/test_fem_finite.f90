!> Elements at finite strain: forces are slopes of the stored energy and the tangent is that of the
!! forces, rotations of the whole rotate the forces, small motions are those of linear elements;
!! pressures that follow the surface and their tangent.
program test_fem_finite
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_body, only: fem_body_type
  use fem_dofs, only: number_fields
  use fem_follower, only: fem_follower_type, follower_force, add_follower_stiffness
  use fem_kinds, only: hex8, hex20, hex27, tet4, tet10, wedge6, node_count, reference_nodes, &
    face_kind, face_nodes
  use fem_law, only: common_size
  use fem_law_finite, only: fem_law_finite_type
  use fem_law_registry, only: make_law
  use fem_sparse, only: multiply, multiply_general
  use fem_topology, only: set_elements
  implicit none
  type(test_type) :: test
  character(len=*), parameter :: kirchhoff = 'st_venant_kirchhoff', neo_hookean = 'neo_hookean'
  real(wp), parameter :: lambda = 700.0_wp, mu = 400.0_wp

  call check_element('hex8_full', hex8, neo_hookean)
  call check_element('hex8_bbar', hex8, neo_hookean)
  call check_element('hex8_bbar', hex8, kirchhoff)
  call check_element('hex20', hex20, neo_hookean)
  call check_element('hex27', hex27, kirchhoff)
  call check_element('tet4', tet4, neo_hookean)
  call check_element('tet10', tet10, neo_hookean)
  call check_element('wedge6', wedge6, neo_hookean)
  call check_bbar()
  call check_inverted()
  call check_follower()
  call test%finish()

contains

  !> One distorted element.
  subroutine make_body(rule, kind, law_name, body)
    character(len=*), intent(in) :: rule
    integer(i4), intent(in) :: kind
    character(len=*), intent(in) :: law_name
    type(fem_body_type), intent(inout) :: body
    integer(i4) :: m, i, r
    m = node_count(kind)
    body%mesh%x = reference_nodes(kind)
    body%mesh%x = body%mesh%x + noise(m, 0.05_wp, 3.1_wp)
    allocate (body%mesh%group(0))
    call set_elements(body%mesh, kind, reshape([(i, i=1, m)], [m, 1]))
    call body%elastic%start(1)
    call body%elastic%use_rule(rule, r)
    body%elastic%rule_of = r
    body%elastic%moduli(1, :) = lambda
    body%elastic%moduli(2, :) = mu
    body%elastic%density = 3.0_wp
    call body%elastic%number_points()
    call number_fields(body%mesh, body%elastic%rotations(), body%dofs)
    allocate (body%loads%curve(0), body%loads%load(0), body%supports%motion(0))
    call body%allocate_state()
    call body%assemble()
    associate (matter => body%matter)
      allocate (matter%law(1))
      allocate (matter%law_of(1), source=1_i4)
      call make_law(law_name, matter%law(1)%law)
      select type (law => matter%law(1)%law)
      class is (fem_law_finite_type)
        law%lambda = lambda
        law%mu = mu
      end select
      matter%active = .true.
      matter%finite = .true.
      matter%states = matter%law(1)%law%states
      allocate (matter%stress(6, body%elastic%points), source=0.0_wp)
      allocate (matter%state(matter%states, body%elastic%points), source=0.0_wp)
      call matter%prepare(body%mesh, body%dofs, body%elastic)
    end associate
  end subroutine make_body

  pure function noise(n, size_of, start) result(u)
    integer(i4), intent(in) :: n
    real(wp), intent(in) :: size_of, start
    real(wp) :: u(3, n)
    integer(i4) :: i
    u = reshape([(size_of*sin(start + 7.3_wp*i), i=1, 3*n)], [3, n])
  end function noise

  !> Forces and energy for displacements u.
  subroutine forces_at(body, u, force, energy)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: u(:, :)
    real(wp), intent(out) :: force(:, :), energy
    real(wp) :: works(3)
    integer(i4) :: bad
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    if (bad > 0) call test%check('an element without a state', .false.)
    works = body%matter%works()
    energy = works(1)
  end subroutine forces_at

  subroutine check_element(rule, kind, law_name)
    character(len=*), intent(in) :: rule
    integer(i4), intent(in) :: kind
    character(len=*), intent(in) :: law_name
    type(fem_body_type) :: body
    real(wp), allocatable, dimension(:, :) :: u, way, force, high, low, product, back
    real(wp) :: energy, up, down
    real(wp), parameter :: step = 1.0e-6_wp, shorter = 3.0e-6_wp
    call make_body(rule, kind, law_name, body)
    u = noise(body%dofs%blocks, 0.1_wp, 0.3_wp)
    if (kind == hex20 .or. kind == hex27 .or. kind == tet10) u = 0.4_wp*u
    way = noise(body%dofs%blocks, 1.0_wp, 2.3_wp)
    allocate (force, high, low, product, back, mold=u)
    call forces_at(body, u, force, energy)
    call body%matter%assemble(body%mesh, body%dofs, body%elastic, body%system%pattern, &
      body%system%k, body%system%lower)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, way, product)
    call multiply_general(body%system%pattern, body%system%k, body%system%lower, u, back)
    call forces_at(body, u + step*way, high, up)
    call forces_at(body, u - step*way, low, down)
    call test%check_close(rule//': forces are slopes of the energy', (up - down) &
                          /(2.0_wp*step*sum(force*way)), 1.0_wp, 1.0e-7_wp)
    call test%check_close(rule//': tangent', max_abs((high - low)/(2.0_wp*step) - product) &
                          /max_abs(product), 0.0_wp, 1.0e-7_wp)
    call test%check_close(rule//': tangent is symmetric', sum(u*product)/sum(way*back), 1.0_wp, &
                          1.0e-12_wp)
    call test%check_close(rule//': forces sum to nothing', max_abs(sum(force, 2)) &
                          /max_abs(force), 0.0_wp, 1.0e-13_wp)
    call check_rotation(rule, body, u, force, energy)
    call multiply(body%system%pattern, linear_stiffness(body), u, product)
    call forces_at(body, shorter*u, force, energy)
    call test%check_close(rule//': small motions are linear', max_abs(force - shorter*product) &
                          /max_abs(force), 0.0_wp, 20.0_wp*shorter)
  end subroutine check_element

  !> Stiffness of linear elasticity, which `make_body` assembled before the law was there.
  function linear_stiffness(body) result(k)
    type(fem_body_type), intent(inout) :: body
    real(wp), allocatable :: k(:, :, :)
    body%matter%active = .false.
    call body%assemble()
    body%matter%active = .true.
    k = body%system%k
  end function linear_stiffness

  !> A turn of the deformed element by 2 rad turns the forces and leaves the energy; forces have no
  !! moment about the deformed positions.
  subroutine check_rotation(rule, body, u, force, energy)
    character(len=*), intent(in) :: rule
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: u(:, :), force(:, :), energy
    real(wp), parameter :: angle = 2.0_wp, axis(3) = [2.0_wp, -1.0_wp, 2.0_wp]/3.0_wp
    real(wp) :: q(3, 3), x(3, size(u, 2)), turned(3, size(u, 2)), stored, moment(3)
    integer(i4) :: i
    do i = 1, 3
      q(:, i) = (1.0_wp - cos(angle))*axis(i)*axis
      q(i, i) = q(i, i) + cos(angle)
    end do
    q = q + sin(angle)*reshape([0.0_wp, axis(3), -axis(2), -axis(3), 0.0_wp, axis(1), axis(2), &
                                -axis(1), 0.0_wp], [3, 3])
    x = body%mesh%x + u
    moment = 0.0_wp
    do i = 1, size(x, 2)
      moment = moment + [x(2, i)*force(3, i) - x(3, i)*force(2, i), &
                         x(3, i)*force(1, i) - x(1, i)*force(3, i), &
                         x(1, i)*force(2, i) - x(2, i)*force(1, i)]
    end do
    call test%check_close(rule//': forces have no moment', max_abs(moment) &
                          /max_abs(force), 0.0_wp, 1.0e-13_wp)
    call forces_at(body, matmul(q, x) - body%mesh%x, turned, stored)
    call test%check_close(rule//': turned forces', max_abs(turned - matmul(q, force)) &
                          /max_abs(force), 0.0_wp, 1.0e-13_wp)
    call test%check_close(rule//': energy of a turn', stored/energy, 1.0_wp, 1.0e-13_wp)
  end subroutine check_rotation

  !> With B-bar the volume ratio is the same at all points of an element.
  subroutine check_bbar()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), force(:, :)
    real(wp) :: energy
    call make_body('hex8_bbar', hex8, neo_hookean, body)
    u = noise(8, 0.1_wp, 0.3_wp)
    allocate (force, mold=u)
    call forces_at(body, u, force, energy)
    associate (ratio => body%matter%state(common_size + 7, :))
      call test%check_all_close('B-bar: one volume ratio', ratio, ratio(1), 1.0e-14_wp)
      call test%check('B-bar: it is not one', abs(ratio(1) - 1.0_wp) > 1.0e-3_wp)
    end associate
  end subroutine check_bbar

  !> An element turned inside out is named, with its point and volume ratio.
  subroutine check_inverted()
    type(fem_body_type) :: body
    real(wp), allocatable :: u(:, :), force(:, :)
    character(len=:), allocatable :: text
    integer(i4) :: bad
    logical :: inverted
    call make_body('hex8_full', hex8, neo_hookean, body)
    u = noise(8, 0.0_wp, 0.0_wp)
    u(3, 5:) = -2.5_wp  ! the upper face below the lower one
    allocate (force, mold=u)
    call body%matter%update(body%mesh, body%dofs, body%elastic, u, u, force, bad)
    call test%check('inside out: found', bad == 1)
    call body%matter%trouble(body%elastic, text, inverted)
    call test%check('inside out: named', inverted .and. index(text, 'element 1 ') > 0 .and. &
                    index(text, 'volume is -0.') > 0)
  end subroutine check_inverted

  !> Pressure on all faces of an element, and on one: forces, work, tangent.
  subroutine check_follower()
    type(fem_body_type) :: body
    type(fem_follower_type) :: follower
    real(wp), allocatable, dimension(:, :) :: u, way, force, high, low, product
    real(wp), parameter :: step = 1.0e-6_wp
    integer(i4) :: faces, f
    call make_body('hex20', hex20, neo_hookean, body)
    u = noise(20, 0.1_wp, 0.3_wp)
    way = noise(20, 1.0_wp, 2.3_wp)
    allocate (force, high, low, product, mold=u)
    do faces = 1, 6, 5
      deallocate (body%mesh%group)
      allocate (body%mesh%group(1))
      associate (group => body%mesh%group(1))
        allocate (group%facet(8, faces), group%facet_kind(faces))
        do f = 1, faces
          group%facet(:, f) = face_nodes(hex20, f)
          group%facet_kind(f) = face_kind(hex20, f)
        end do
      end associate
      follower%group = 1
      follower%pressure = 1.0_wp
      follower%slope = 0.0_wp
      force = 0.0_wp
      call follower_force(body%mesh, follower, 2.0_wp, u, force)
      if (faces == 6) call test%check_all_close('follower: a closed surface', &
        sum(force, 2), 0.0_wp, 1.0e-13_wp)
      follower%slope = [0.3_wp, -0.7_wp, 0.4_wp]
      high = 0.0_wp
      call follower_force(body%mesh, follower, 2.0_wp, u + step*way, high)
      low = 0.0_wp
      call follower_force(body%mesh, follower, 2.0_wp, u - step*way, low)
      body%system%k = 0.0_wp*body%system%k
      if (allocated(body%system%lower)) deallocate (body%system%lower)
      allocate (body%system%lower, source=body%system%k)
      call add_follower_stiffness(body%mesh, follower, 2.0_wp, u, body%system%pattern, &
        body%system%k, body%system%lower)
      call multiply_general(body%system%pattern, body%system%k, body%system%lower, way, product)
      call test%check_close('follower: tangent', max_abs((low - high)/(2.0_wp*step) - product) &
                            /max_abs(product), 0.0_wp, 1.0e-8_wp)
    end do
  end subroutine check_follower
end program test_fem_finite
