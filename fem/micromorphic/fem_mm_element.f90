!> Micromorphic element of finite strain, total Lagrangian: u on the nodes of the geometry, phi =
!! chi - 1 on its own ones (fem_rules: hex20/hex8 and the other pairs).
!!
!! Residual and stiffness have 3 numbers for each node of u, then 9 for each one of phi, components
!! 11 21 31 12 .. as in fem_mm_motion. In the energy form
!!   f_ia = int P_iI N_a,I,  f_iKb = int (Q_iK N_b + R_iKL N_b,L),
!! the stiffness of an elastic element is symmetric; the balance form has B and M for Q and R.
!! eq. F.15
module fem_mm_element
  use talus_kinds, only: wp, i4
  use fem_mm_balance, only: balance_forces, balance_tangent
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, mm_force_type, packed_force
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_mm_tensor, only: identity, inverse, determinant
  use fem_rules, only: fem_points_type
  implicit none
  private
  public :: mm_element_type, mm_response_type, prepare_element, respond, accept, element_mass
  public :: motion_at

  !> An element: shape functions and their gradients by reference place, states of its points.
  type :: mm_element_type
    integer(i4) :: nodes = 0, micro_nodes = 0, points = 0, dofs = 0
    logical :: balance = .false.                  !! balance form
    real(wp), allocatable :: weight(:)            !! (points) [m^3]
    real(wp), allocatable :: n(:, :)              !! (nodes, points)
    real(wp), allocatable :: slope(:, :, :)       !! (3, nodes, points) [1/m]
    real(wp), allocatable :: micro(:, :)          !! (micro_nodes, points)
    real(wp), allocatable :: micro_slope(:, :, :) !! (3, micro_nodes, points) [1/m]
    type(mm_state_type), allocatable :: state(:)
    type(mm_motion_type), allocatable :: motion(:)  !! of the last accepted step
  end type mm_element_type

  !> Results of the element.
  type :: mm_response_type
    type(mm_point_type), allocatable :: point(:)
    real(wp), allocatable :: force(:), stiffness(:, :)  !! (dofs), (dofs, dofs)
    integer(i4) :: failed = 0  !! a point whose law failed or that is inside out
  end type mm_response_type

contains

  !> Tables for nodes x (3, nodes) [m]; good is false where the Jacobian is not positive.
  subroutine prepare_element(at, x, element, good)
    type(fem_points_type), intent(in) :: at
    real(wp), intent(in) :: x(:, :)
    type(mm_element_type), intent(out) :: element
    logical, intent(out) :: good
    real(wp) :: jacobian(3, 3)
    integer(i4) :: q

    element%points = at%n
    element%nodes = size(at%u, 1)
    element%micro_nodes = size(at%phi, 1)
    element%dofs = 3*element%nodes + 9*element%micro_nodes
    element%n = at%u
    element%micro = at%phi
    allocate (element%weight(at%n), element%state(at%n), element%motion(at%n))
    allocate (element%slope(3, element%nodes, at%n))
    allocate (element%micro_slope(3, element%micro_nodes, at%n))
    good = .true.
    do q = 1, at%n
      jacobian = matmul(at%u_slope(:, :, q), transpose(x))  ! dx_i/dxi_j in (j, i)
      element%weight(q) = determinant(jacobian)*at%weight(q)
      good = good .and. element%weight(q) > 0.0_wp
      if (.not. good) return
      jacobian = inverse(jacobian)
      element%slope(:, :, q) = matmul(jacobian, at%u_slope(:, :, q))
      element%micro_slope(:, :, q) = matmul(jacobian, at%phi_slope(:, :, q))
    end do
  end subroutine prepare_element

  !> F, chi and grad chi of point q for u (3, nodes) [m] and phi (9, micro_nodes) [-].
  pure function motion_at(element, q, u, phi) result(motion)
    type(mm_element_type), intent(in) :: element
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: u(:, :), phi(:, :)
    type(mm_motion_type) :: motion
    motion%f = identity + matmul(u, transpose(element%slope(:, :, q)))
    motion%chi = identity + reshape(matmul(phi, element%micro(:, q)), [3, 3])
    motion%g = reshape(matmul(phi, transpose(element%micro_slope(:, :, q))), [3, 3, 3])
  end function motion_at

  !> Forces, and stiffness on request, at the end of a trial step of the element.
  subroutine respond(law, element, u, phi, wants_stiffness, response)
    type(mm_law_type), intent(in) :: law
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: u(:, :), phi(:, :)
    logical, intent(in) :: wants_stiffness
    type(mm_response_type), intent(inout) :: response
    type(mm_motion_type) :: now
    type(mm_force_type) :: force
    real(wp) :: tangent(45, 45)
    integer(i4) :: q

    call make_room(element, wants_stiffness, response)
    do q = 1, element%points
      now = motion_at(element, q, u, phi)
      response%failed = q
      if (.not. (determinant(now%f) > 0.0_wp .and. determinant(now%chi) > 0.0_wp)) return
      if (wants_stiffness) then
        call update_point(law, [element%motion(q), now], element%state(q), response%point(q), &
                          tangent)
      else
        call update_point(law, [element%motion(q), now], element%state(q), response%point(q))
      end if
      if (.not. response%point(q)%done) return
      force = response%point(q)%force
      if (element%balance) then
        if (wants_stiffness) call balance_tangent(now, force, tangent)
        force = balance_forces(now, force)
      end if
      call add_force(element, q, packed_force(force), response%force)
      if (wants_stiffness) call add_stiffness(element, q, tangent, response%stiffness)
    end do
    response%failed = 0
  end subroutine respond

  subroutine make_room(element, wants_stiffness, response)
    type(mm_element_type), intent(in) :: element
    logical, intent(in) :: wants_stiffness
    type(mm_response_type), intent(inout) :: response
    logical :: fits
    fits = allocated(response%force)
    if (fits) fits = size(response%force) == element%dofs .and. &
      size(response%point) == element%points
    if (.not. fits) then
      if (allocated(response%force)) deallocate (response%force, response%point)
      if (allocated(response%stiffness)) deallocate (response%stiffness)
      allocate (response%force(element%dofs), response%point(element%points))
    end if
    if (wants_stiffness .and. .not. allocated(response%stiffness)) &
      allocate (response%stiffness(element%dofs, element%dofs))
    response%force = 0.0_wp
    if (wants_stiffness) response%stiffness = 0.0_wp
  end subroutine make_room

  !> Accept the result as start of the next step.
  subroutine accept(element, u, phi, response)
    type(mm_element_type), intent(inout) :: element
    real(wp), intent(in) :: u(:, :), phi(:, :)
    type(mm_response_type), intent(in) :: response
    integer(i4) :: q
    do q = 1, element%points
      element%motion(q) = motion_at(element, q, u, phi)
      element%state(q) = response%point(q)%state
    end do
  end subroutine accept

  !> Add the forces of point q to those of the nodes: B^T force.
  pure subroutine add_force(element, q, force, total)
    type(mm_element_type), intent(in) :: element
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: force(45)
    real(wp), intent(inout) :: total(:)
    total = total + element%weight(q)*gathered(element, q, force)
  end subroutine add_force

  !> B^T v for 45 numbers v of point q.
  pure function gathered(element, q, v) result(total)
    type(mm_element_type), intent(in) :: element
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: v(45)
    real(wp) :: total(element%dofs)
    integer(i4) :: a, d
    do a = 1, element%nodes
      d = 3*(a - 1)
      total(d + 1:d + 3) = v(1:3)*element%slope(1, a, q) + v(4:6)*element%slope(2, a, q) &
        + v(7:9)*element%slope(3, a, q)
    end do
    do a = 1, element%micro_nodes
      d = 3*element%nodes + 9*(a - 1)
      total(d + 1:d + 9) = v(10:18)*element%micro(a, q) + v(19:27)*element%micro_slope(1, a, q) &
        + v(28:36)*element%micro_slope(2, a, q) + v(37:45)*element%micro_slope(3, a, q)
    end do
  end function gathered

  !> Add B^T tangent B of point q: first the columns of B, then the rows.
  pure subroutine add_stiffness(element, q, tangent, total)
    type(mm_element_type), intent(in) :: element
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: tangent(45, 45)
    real(wp), intent(inout) :: total(:, :)
    real(wp) :: part(45)
    integer(i4) :: a, i, d, k

    do a = 1, element%nodes
      do i = 1, 3
        d = 3*(a - 1) + i
        part = tangent(:, i)*element%slope(1, a, q) + tangent(:, i + 3)*element%slope(2, a, q) &
          + tangent(:, i + 6)*element%slope(3, a, q)
        total(:, d) = total(:, d) + element%weight(q)*gathered(element, q, part)
      end do
    end do
    do a = 1, element%micro_nodes
      do k = 1, 9
        d = 3*element%nodes + 9*(a - 1) + k
        part = tangent(:, k + 9)*element%micro(a, q) &
          + tangent(:, k + 18)*element%micro_slope(1, a, q) &
          + tangent(:, k + 27)*element%micro_slope(2, a, q) &
          + tangent(:, k + 36)*element%micro_slope(3, a, q)
        total(:, d) = total(:, d) + element%weight(q)*gathered(element, q, part)
      end do
    end do
  end subroutine add_stiffness

  !> Mass matrix of an element prepared with the points of mass: density [kg/m^3] and micro-inertia
  !! I_KL [m^2] of the reference state; it does not change with the motion.
  pure subroutine element_mass(element, density, inertia, mass)
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: density, inertia(3, 3)
    real(wp), intent(out) :: mass(:, :)
    real(wp) :: share
    integer(i4) :: q, a, b, d, e
    mass = 0.0_wp
    do q = 1, element%points
      do b = 1, element%nodes
        do a = 1, element%nodes
          share = density*element%weight(q)*element%n(a, q)*element%n(b, q)
          call add_diagonal(share, mass(3*a - 2:3*a, 3*b - 2:3*b))
        end do
      end do
      do b = 1, element%micro_nodes
        do a = 1, element%micro_nodes
          share = density*element%weight(q)*element%micro(a, q)*element%micro(b, q)
          d = 3*element%nodes + 9*(a - 1)
          e = 3*element%nodes + 9*(b - 1)
          call add_micro(share, inertia, mass(d + 1:d + 9, e + 1:e + 9))
        end do
      end do
    end do
  end subroutine element_mass

  !> Add a mass to the diagonal of a block of u.
  pure subroutine add_diagonal(share, block)
    real(wp), intent(in) :: share
    real(wp), intent(inout) :: block(:, :)
    integer(i4) :: i
    do i = 1, 3
      block(i, i) = block(i, i) + share
    end do
  end subroutine add_diagonal

  !> Add a mass times I_KL to a block of phi.
  pure subroutine add_micro(share, inertia, block)
    real(wp), intent(in) :: share, inertia(3, 3)
    real(wp), intent(inout) :: block(:, :)
    integer(i4) :: i, k, l
    do l = 1, 3
      do k = 1, 3
        do i = 1, 3
          block(i + 3*(k - 1), i + 3*(l - 1)) = block(i + 3*(k - 1), i + 3*(l - 1)) &
            + share*inertia(k, l)
        end do
      end do
    end do
  end subroutine add_micro
end module fem_mm_element
