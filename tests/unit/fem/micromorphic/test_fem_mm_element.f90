!> Micromorphic element: balance form, tangents by differences, zero modes, patch tests with uniform
!! strain, with friction and with a micro-gradient, quadratic Newton convergence, mass.
program test_fem_mm_element
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_mm_balance, only: balance_forces
  use fem_mm_cones, only: make_cone
  use fem_mm_element, only: mm_element_type, mm_response_type, prepare_element, respond, accept, &
    element_mass, motion_at
  use fem_mm_elastic, only: set_moduli, stresses, duals, mm_stress_type
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, mm_force_type, mm_spatial_type, elastic_forces, pushed, &
    strains, unpacked_motion, packed_motion
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_mm_report, only: eigenvalues
  use fem_mm_tensor, only: identity, determinant, leg_one, leg_two
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none

  !> Eight bent hexahedra about one inner corner; u on all nodes, phi on the first of each element.
  type :: patch_type
    integer(i4) :: nodes = 0
    integer(i4), allocatable :: node(:, :)   !! (nodes of an element, 8)
    real(wp), allocatable :: x(:, :)         !! (3, nodes)
    logical, allocatable :: inner(:), micro(:)
    type(mm_element_type) :: element(8)
  end type patch_type

  interface
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp, i4
      integer(i4), intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      integer(i4), intent(out) :: ipiv(*), info
    end subroutine dgesv
  end interface

  character(len=*), parameter :: pairs(6) = [character(len=11) :: 'hex8/hex8', 'hex20/hex8', &
    'hex27/hex8', 'hex20/hex20', 'tet4/tet4', 'tet10/tet4']
  real(wp), parameter :: moduli(18) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, &
    5.0_wp, 0.3_wp, 0.1_wp, 0.2_wp, 0.4_wp, -0.1_wp, 0.5_wp, 8.0_wp, 0.2_wp, 0.6_wp, 0.3_wp, 0.1_wp]
  real(wp), parameter :: stretch(3, 3) = reshape([-0.02_wp, 0.015_wp, 0.01_wp, 0.03_wp, &
    0.02_wp, -0.01_wp, 0.005_wp, -0.02_wp, -0.03_wp], [3, 3])
  type(test_type) :: test
  integer(i4) :: k

  call check_balance()
  do k = 1, size(pairs)
    call check_modes(trim(pairs(k)))
  end do
  call check_tangent('hex20/hex8', solid(.false.), .false.)
  call check_tangent('hex8/hex8', solid(.true.), .false.)
  call check_tangent('hex8/hex8', solid(.true.), .true.)
  do k = 1, 4
    call check_patch(trim(pairs(k)), solid(.false.), .false.)
    call check_patch(trim(pairs(k)), solid(.true.), .false.)
    call check_gradient_patch(trim(pairs(k)))
  end do
  call check_patch('hex20/hex8', solid(.true.), .true.)
  call check_layer()
  call check_mass()
  call test%finish()

contains

  pure function solid(plastic) result(law)
    logical, intent(in) :: plastic
    type(mm_law_type) :: law
    real(wp), parameter :: wide(2) = [-1.0_wp, -1.0_wp]
    law%elastic = set_moduli(moduli, .false.)
    law%length = 0.4_wp
    if (.not. plastic) return
    law%cone(1) = make_cone([0.5_wp, 0.15_wp], wide, 0.1_wp, 5.0_wp, 0.0_wp)
    law%cone(2) = make_cone([0.4_wp, 0.1_wp], wide, 0.15_wp, 5.0_wp, 0.0_wp)
    law%cone(3:) = make_cone([0.3_wp, 0.1_wp], wide, 0.1_wp, 1.0_wp, 0.0_wp)
  end function solid

  !> Numbers between -1 and 1 without pattern.
  pure function scatter(n, seed) result(v)
    integer(i4), intent(in) :: n, seed
    real(wp) :: v(n)
    integer(i4) :: i
    v = [(sin(12.9898_wp*i + 78.233_wp*seed), i=1, n)]
  end function scatter

  !> B = J (s - sigma)^T and M = J F^-1 m in the first leg, of any state.
  subroutine check_balance()
    type(mm_motion_type) :: motion
    type(mm_stress_type) :: stress
    type(mm_force_type) :: balance
    type(mm_spatial_type) :: spatial
    type(mm_law_type) :: law
    real(wp) :: wanted(3, 3), m(3, 3, 3)
    law = solid(.false.)
    motion = unpacked_motion(packed_motion(motion) + 0.2_wp*scatter(45, 3))
    stress = stresses(law%elastic, strains(motion), duals(law%elastic, strains(motion)))
    spatial = pushed(motion, stress)
    balance = balance_forces(motion, elastic_forces(law%elastic, motion))
    wanted = determinant(motion%f)*transpose(spatial%s - spatial%sigma)
    call test%check_all_close('micro-force is s - sigma', balance%q, wanted, &
                          1.0e-13_wp)
    m = reshape(balance%r, [3, 3, 3], order=[2, 3, 1])  ! (j, k, I) as (I, j, k)
    call test%check_all_close('micro-gradient force is m', leg_one(motion%f, m) &
      /determinant(motion%f), spatial%m, 1.0e-13_wp)
  end subroutine check_balance

  !> A bent element of a pair.
  subroutine one_element(pair, element)
    character(len=*), intent(in) :: pair
    type(mm_element_type), intent(out) :: element
    type(fem_formulation_type) :: rule
    real(wp), allocatable :: x(:, :)
    logical :: good
    call make_rule(rule_index(pair), rule)
    if (rule%corners == 8) then
      x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
        1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, &
        0.0_wp, 1.0_wp, 1.0_wp], [3, 8])
    else
      x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, &
        0.0_wp, 1.0_wp], [3, 4])
    end if
    x = x + 0.1_wp*reshape(scatter(size(x), 5), shape(x))
    call prepare_element(rule%at, matmul(x, rule%middle), element, good)
    call test%check(pair//': a good element', good)
  end subroutine one_element

  !> Symmetric in the energy form, and without energy in six modes: rigid motions, chi turning with
  !! the body.
  subroutine check_modes(pair)
    character(len=*), intent(in) :: pair
    type(mm_element_type) :: element
    type(mm_response_type) :: response
    real(wp), allocatable :: u(:, :), phi(:, :), value(:)
    call one_element(pair, element)
    allocate (u(3, element%nodes), phi(9, element%micro_nodes), source=0.0_wp)
    call respond(solid(.false.), element, u, phi, .true., response)
    call test%check_all_close(pair//': symmetry', response%stiffness, &
      transpose(response%stiffness), 1.0e-12_wp)
    value = eigenvalues(response%stiffness)
    call test%check(pair//': six zero modes', max_abs(value(:6)) < 1.0e-11_wp*maxval(value) &
                    .and. value(7) > 1.0e-6_wp*maxval(value))
  end subroutine check_modes

  !> Stiffness against differences (five points) of the second of two steps.
  subroutine check_tangent(pair, law, balance)
    character(len=*), intent(in) :: pair
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: balance
    type(mm_element_type) :: element
    type(mm_response_type) :: response, moved
    real(wp), allocatable :: v(:), found(:, :), f(:, :)
    real(wp), parameter :: h = 1.0e-5_wp, move(4) = [-2.0_wp, -1.0_wp, 1.0_wp, 2.0_wp]
    integer(i4) :: i, n
    call one_element(pair, element)
    element%balance = balance
    v = 0.05_wp*scatter(element%dofs, 7)
    call step(law, element, 0.3_wp*v, .false., response)
    call accept(element, u_of(element, 0.3_wp*v), phi_of(element, 0.3_wp*v), response)
    call step(law, element, v, .true., response)
    call test%check(pair//': response', response%failed == 0)
    call test%check(pair//': it yields', any(response%point%state%yielded) .eqv. any(law%cone%on))
    allocate (found(element%dofs, element%dofs), f(element%dofs, 4))
    do n = 1, element%dofs
      do i = 1, 4
        v(n) = v(n) + move(i)*h
        call step(law, element, v, .false., moved)
        f(:, i) = moved%force
        v(n) = v(n) - move(i)*h
      end do
      found(:, n) = (f(:, 1) - 8.0_wp*f(:, 2) + 8.0_wp*f(:, 3) - f(:, 4))/(12.0_wp*h)
    end do
    call test%check_close(pair//': stiffness against differences', max_abs(found &
      - response%stiffness)/max_abs(response%stiffness), 0.0_wp, 1.0e-7_wp)
  end subroutine check_tangent

  subroutine step(law, element, v, wants_stiffness, response)
    type(mm_law_type), intent(in) :: law
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: v(:)
    logical, intent(in) :: wants_stiffness
    type(mm_response_type), intent(inout) :: response
    call respond(law, element, u_of(element, v), phi_of(element, v), wants_stiffness, response)
  end subroutine step

  pure function u_of(element, v) result(u)
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: v(:)
    real(wp) :: u(3, element%nodes)
    u = reshape(v(:3*element%nodes), shape(u))
  end function u_of

  pure function phi_of(element, v) result(phi)
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: v(:)
    real(wp) :: phi(9, element%micro_nodes)
    phi = reshape(v(3*element%nodes + 1:), shape(phi))
  end function phi_of

  !> A cube of 2 x 2 x 2 elements whose inner corner and edges are moved.
  subroutine make_patch(pair, patch)
    character(len=*), intent(in) :: pair
    type(patch_type), intent(out) :: patch
    type(fem_formulation_type) :: rule
    real(wp) :: corner(3, 8), bent(3, 8), plain(3, 400)
    real(wp), allocatable :: at(:, :), x(:, :)
    integer(i4) :: e, a, n
    logical :: good, all_good
    call make_rule(rule_index(pair), rule)
    allocate (patch%node(rule%nodes, 8), patch%x(3, 400), patch%inner(400), patch%micro(400))
    patch%micro = .false.
    all_good = .true.
    do e = 1, 8
      do a = 1, 8
        corner(:, a) = [mod(e - 1, 2), mod((e - 1)/2, 2), (e - 1)/4] &
          + [merge(1, 0, any(a == [2, 3, 6, 7])), merge(1, 0, any(a == [3, 4, 7, 8])), &
             merge(1, 0, a > 4)]
        bent(:, a) = corner(:, a) + 0.12_wp*sin(3.0_wp*corner([2, 3, 1], a) + [0.3_wp, 1.1_wp, &
                                                                               2.0_wp])
      end do
      at = matmul(corner, rule%middle)
      x = matmul(bent, rule%middle)
      call prepare_element(rule%at, x, patch%element(e), good)
      all_good = all_good .and. good
      do a = 1, rule%nodes
        do n = 1, patch%nodes
          if (max_abs(plain(:, n) - at(:, a)) < 1.0e-9_wp) exit
        end do
        patch%nodes = max(patch%nodes, n)
        plain(:, n) = at(:, a)
        patch%x(:, n) = x(:, a)
        patch%node(a, e) = n
        patch%inner(n) = all(at(:, a) > 0.1_wp .and. at(:, a) < 1.9_wp)
        if (a <= rule%rotations) patch%micro(n) = .true.
      end do
    end do
    call test%check(pair//': a good patch', all_good)
  end subroutine make_patch

  !> Solve for the inner nodes: v (12, nodes) holds u and phi, those of the outer nodes given.
  subroutine solve_patch(law, patch, v, iterations, last)
    type(mm_law_type), intent(in) :: law
    type(patch_type), intent(inout) :: patch
    real(wp), intent(inout) :: v(:, :)
    integer(i4), intent(out) :: iterations
    real(wp), intent(out) :: last(3)  !! the last residuals
    logical :: is_free(12*patch%nodes)
    integer(i4) :: place(12*patch%nodes), pivot(12*patch%nodes), n, i, info
    real(wp) :: f(12*patch%nodes), k(12*patch%nodes, 12*patch%nodes), b(12*patch%nodes, 1)
    is_free = .false.
    do i = 1, patch%nodes
      if (patch%inner(i)) is_free(12*i - 11:12*i - 9) = .true.
      if (patch%inner(i) .and. patch%micro(i)) is_free(12*i - 8:12*i) = .true.
    end do
    n = count(is_free)
    place(:n) = pack([(i, i=1, 12*patch%nodes)], is_free)
    last = 1.0_wp
    do iterations = 1, 20
      call assemble(law, patch, v, f, k)
      last = [last(2:), norm2(f(place(:n)))]
      if (last(3) < 1.0e-13_wp) return
      b(:n, 1) = -f(place(:n))
      k(:n, :n) = k(place(:n), place(:n))
      call dgesv(n, 1, k, size(k, 1), pivot, b, size(b, 1), info)
      do i = 1, n
        v(1 + mod(place(i) - 1, 12), 1 + (place(i) - 1)/12) = &
          v(1 + mod(place(i) - 1, 12), 1 + (place(i) - 1)/12) + b(i, 1)
      end do
    end do
  end subroutine solve_patch

  subroutine assemble(law, patch, v, f, k)
    type(mm_law_type), intent(in) :: law
    type(patch_type), intent(in) :: patch
    real(wp), intent(in) :: v(:, :)
    real(wp), intent(out) :: f(:), k(:, :)
    type(mm_response_type) :: response
    integer(i4), allocatable :: dof(:)
    integer(i4) :: e, a, i, m
    f = 0.0_wp
    k = 0.0_wp
    do e = 1, 8
      associate (node => patch%node(:, e))
        m = patch%element(e)%micro_nodes
        call respond(law, patch%element(e), v(:3, node), v(4:, node(:m)), .true., response)
        dof = [([(12*node(a) - 12 + i, i=1, 3)], a=1, size(node)), &
               ([(12*node(a) - 9 + i, i=1, 9)], a=1, m)]
      end associate
      f(dof) = f(dof) + response%force
      k(dof, dof) = k(dof, dof) + response%stiffness
    end do
  end subroutine assemble

  !> chi - 1 (9) that is in equilibrium with F - 1 = stretch.
  function at_rest(law) result(phi)
    type(mm_law_type), intent(in) :: law
    real(wp) :: phi(9)
    type(mm_motion_type) :: motion(2)
    type(mm_point_type) :: point
    type(mm_state_type) :: start
    real(wp) :: tangent(45, 45), k(9, 9), b(9, 1)
    integer(i4) :: i, pivot(9), info
    motion(2)%f = identity + stretch
    do i = 1, 30
      call update_point(law, motion, start, point, tangent)
      b(:, 1) = -reshape(point%force%q, [9])
      k = tangent(10:18, 10:18)
      call dgesv(9, 1, k, 9, pivot, b, 9, info)
      motion(2)%chi = motion(2)%chi + reshape(b, [3, 3])
    end do
    phi = reshape(motion(2)%chi - identity, [9])
  end function at_rest

  !> Uniform F and chi at the outer nodes, the latter without micro-force: so they are inside.
  subroutine check_patch(pair, law, balance)
    character(len=*), intent(in) :: pair
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: balance
    type(patch_type) :: patch
    real(wp), allocatable :: v(:, :), wanted(:, :)
    real(wp) :: last(3)
    integer(i4) :: i, iterations
    character(len=:), allocatable :: name
    name = pair//merge(', friction', ', elastic ', any(law%cone%on))
    call make_patch(pair, patch)
    patch%element%balance = balance
    allocate (wanted(12, patch%nodes), source=0.0_wp)
    do i = 1, patch%nodes
      wanted(:3, i) = matmul(stretch, patch%x(:, i))
      if (patch%micro(i)) wanted(4:, i) = at_rest(law)
    end do
    v = wanted
    do i = 1, patch%nodes
      if (patch%inner(i)) v(:, i) = 0.8_wp*wanted(:, i)
    end do
    call solve_patch(law, patch, v, iterations, last)
    call test%check(name//': converged', iterations < 20)
    call test%check_all_close(name//': patch', v, wanted, 1.0e-12_wp)
    call test%check(name//': quadratic', last(2) < 0.1_wp*last(1)**2 + 1.0e-12_wp)
  end subroutine check_patch

  !> Uniform F and grad chi, with moduli of E and Gamma alone: no micro-force, so that chi is linear
  !! inside as at the outer nodes, at strains and micro-deformations that are not small.
  subroutine check_gradient_patch(pair)
    character(len=*), intent(in) :: pair
    type(patch_type) :: patch
    type(mm_law_type) :: law
    type(mm_response_type) :: response
    real(wp), allocatable :: v(:, :), wanted(:, :)
    real(wp) :: only(18), last(3), slope(9, 3), p(3, 3)
    integer(i4) :: i, iterations
    only = moduli
    only(3:7) = 0.0_wp
    law%elastic = set_moduli(only, .false.)
    call make_patch(pair, patch)
    slope = 0.2_wp*reshape(scatter(27, 11), [9, 3])
    allocate (wanted(12, patch%nodes), source=0.0_wp)
    do i = 1, patch%nodes
      wanted(:3, i) = 5.0_wp*matmul(stretch, patch%x(:, i))
      if (patch%micro(i)) wanted(4:, i) = 0.1_wp*scatter(9, 2) + matmul(slope, patch%x(:, i))
    end do
    v = wanted
    do i = 1, patch%nodes
      if (patch%inner(i)) v(:, i) = 0.7_wp*wanted(:, i)
    end do
    call solve_patch(law, patch, v, iterations, last)
    call test%check(pair//', gradient: converged', iterations < 20)
    call test%check_all_close(pair//', gradient: patch', v, wanted, 1.0e-11_wp)
    associate (node => patch%node(:, 1), m => patch%element(1)%micro_nodes)
      call respond(law, patch%element(1), v(:3, node), v(4:, node(:m)), .false., response)
    end associate
    p = response%point(1)%force%p
    do i = 2, size(response%point)
      p = p + abs(response%point(i)%force%p - response%point(1)%force%p)
    end do
    call test%check_all_close(pair//', gradient: stress is uniform', &
      p, response%point(1)%force%p, 1.0e-10_wp)
    call test%check(pair//', gradient: and felt', &
                    max_abs(response%point(1)%stress%m) > 0.1_wp)
  end subroutine check_gradient_patch

  !> Simple shear of a layer with phi = 0 at both faces, small strains, tau_7 alone: the apparent
  !! modulus rises as the layer gets thin, as in closed form, with second order of the elements.
  subroutine check_layer()
    real(wp), parameter :: thickness(3) = [0.5_wp, 2.0_wp, 8.0_wp]
    real(wp) :: found(3), wanted(3), coarse
    integer(i4) :: i
    do i = 1, 3
      wanted(i) = layer_modulus(thickness(i))
      coarse = layer_solved(thickness(i), 10)
      found(i) = layer_solved(thickness(i), 20)
      call test%check_close('layer, modulus / exact', found(i)/wanted(i), 1.0_wp, 2.0e-3_wp)
      call test%check_close('layer, order', log((coarse - wanted(i))/(found(i) - wanted(i))) &
        /log(2.0_wp), 2.0_wp, 0.1_wp)
    end do
    call test%check('thin layers are stiffer', all(wanted(:2) > 1.02_wp*wanted(2:)))
  end subroutine check_layer

  !> Closed form: with s = phi_zx + phi_xz and d = phi_zx - phi_xz, y = (s, d),
  !!   (mu + sigma + kappa) u' = T - (kappa + nu)/2 s - (kappa - nu)/2 d,
  !!   tau_7 s'' = (kappa + nu - 2 sigma)(u' + s) + 2 sigma u',  tau_7 d'' = (kappa - nu)(u' + d),
  !! so that y'' = K y + g T, y = -(1 - cosh(sqrt(K) z)/cosh(sqrt(K) h/2)) K^-1 g T.
  real(wp) function layer_modulus(h)
    real(wp), intent(in) :: h  !! thickness [m]
    real(wp) :: k(2, 2), g(2), c(2), whole, root(2), share(2), pair(2, 2), det, rest(2)
    real(wp) :: half
    integer(i4) :: i
    associate (mu => moduli(2), kappa => moduli(5), nu => moduli(6), sigma => moduli(7), &
               tau => moduli(14))
      whole = mu + sigma + kappa
      c = 0.5_wp*[kappa + nu, kappa - nu]
      g = [kappa + nu, kappa - nu]/(tau*whole)
      k(1, :) = -(kappa + nu)/(tau*whole)*c
      k(2, :) = -(kappa - nu)/(tau*whole)*c
      k(1, 1) = k(1, 1) + (kappa + nu - 2.0_wp*sigma)/tau
      k(2, 2) = k(2, 2) + (kappa - nu)/tau
    end associate
    half = 0.5_wp*(k(1, 1) + k(2, 2))
    det = k(1, 1)*k(2, 2) - k(1, 2)*k(2, 1)
    root = half + [1.0_wp, -1.0_wp]*sqrt(half**2 - det)
    rest = -[k(2, 2)*g(1) - k(1, 2)*g(2), k(1, 1)*g(2) - k(2, 1)*g(1)]/det
    do i = 1, 2  ! eigenvectors, and the mean of 1 - cosh/cosh over the layer
      pair(:, i) = [k(1, 2), root(i) - k(1, 1)]
      share(i) = 1.0_wp - tanh(0.5_wp*h*sqrt(root(i)))/(0.5_wp*h*sqrt(root(i)))
    end do
    det = pair(1, 1)*pair(2, 2) - pair(1, 2)*pair(2, 1)
    share = share*[rest(1)*pair(2, 2) - rest(2)*pair(1, 2), &
                   rest(2)*pair(1, 1) - rest(1)*pair(2, 1)]/det
    layer_modulus = whole/(1.0_wp - dot_product(c, matmul(pair, share)))
  end function layer_modulus

  !> The same by a column of hex20/hex8; nodes of one height move together.
  real(wp) function layer_solved(h, elements) result(modulus)
    real(wp), intent(in) :: h
    integer(i4), intent(in) :: elements
    real(wp) :: k(12*(2*elements + 1), 12*(2*elements + 1))
    real(wp), allocatable :: inner(:, :), b(:, :)
    integer(i4) :: place(24*elements), pivot(24*elements), i, n, top, info
    call layer_stiffness(h, elements, k)
    n = 0
    do i = 13, 24*elements  ! faces held; middle levels have no phi
      if (mod((i - 1)/12, 2) == 1 .and. mod(i - 1, 12) > 2) cycle
      n = n + 1
      place(n) = i
    end do
    top = 24*elements + 1  ! moves by one along x
    allocate (inner(n, n), b(n, 1))
    inner(:, :) = k(place(:n), place(:n))
    b(:, 1) = -k(place(:n), top)
    call dgesv(n, 1, inner, n, pivot, b, n, info)
    modulus = (k(top, top) + dot_product(k(top, place(:n)), b(:, 1)))*elements**2/h
  end function layer_solved

  subroutine layer_stiffness(h, elements, k)
    real(wp), intent(in) :: h
    integer(i4), intent(in) :: elements
    real(wp), intent(out) :: k(:, :)
    type(fem_formulation_type) :: rule
    type(mm_element_type) :: element
    type(mm_response_type) :: response
    type(mm_law_type) :: law
    real(wp) :: only(18), x(3, 8), u(3, 20), phi(9, 8)
    integer(i4) :: dof(132), e, a, i, level
    logical :: good
    only = moduli
    only([8, 9, 10, 11, 12, 13, 15, 16, 17, 18]) = 0.0_wp
    law%elastic = set_moduli(only, .false.)
    call make_rule(rule_index('hex20/hex8'), rule)
    x = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8]) &
      *(h/elements)
    call prepare_element(rule%at, matmul(x, rule%middle), element, good)
    u = 0.0_wp
    phi = 0.0_wp
    call respond(law, element, u, phi, .true., response)
    k = 0.0_wp
    do e = 1, elements
      do a = 1, 20
        level = 2*e - 2 + nint(2.0_wp*dot_product(x(3, :), rule%middle(:, a))*elements/h)
        dof(3*a - 2:3*a) = [(12*level + i, i=1, 3)]
        if (a <= 8) dof(60 + 9*a - 8:60 + 9*a) = [(12*level + 3 + i, i=1, 9)]
      end do
      do a = 1, 132
        do i = 1, 132
          k(dof(i), dof(a)) = k(dof(i), dof(a)) + response%stiffness(i, a)
        end do
      end do
    end do
  end subroutine layer_stiffness

  !> Mass of a block, and its micro-inertia.
  subroutine check_mass()
    type(fem_formulation_type) :: rule
    type(mm_element_type) :: element
    real(wp), allocatable :: mass(:, :), v(:)
    real(wp), parameter :: inertia(3, 3) = reshape([0.2_wp, 0.05_wp, 0.0_wp, 0.05_wp, 0.3_wp, &
                                                    0.01_wp, 0.0_wp, 0.01_wp, 0.4_wp], [3, 3])
    real(wp) :: rate(3, 3)
    integer(i4) :: a
    logical :: good
    call make_rule(rule_index('hex20/hex8'), rule)
    call prepare_element(rule%mass_at, matmul(reshape([0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp, &
      0.0_wp, 2.0_wp, 3.0_wp, 0.0_wp, 0.0_wp, 3.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.5_wp, 2.0_wp, &
      0.0_wp, 0.5_wp, 2.0_wp, 3.0_wp, 0.5_wp, 0.0_wp, 3.0_wp, 0.5_wp], [3, 8]), rule%middle), &
      element, good)
    allocate (mass(element%dofs, element%dofs), v(element%dofs))
    call element_mass(element, 7.0_wp, inertia, mass)
    v = 0.0_wp
    v(2:3*element%nodes:3) = 1.0_wp
    call test%check_close('mass', sum(v*matmul(mass, v)), 21.0_wp, 1.0e-12_wp)
    rate = reshape(scatter(9, 4), [3, 3])
    v = 0.0_wp
    do a = 1, element%micro_nodes
      v(3*element%nodes + 9*a - 8:3*element%nodes + 9*a) = reshape(rate, [9])
    end do
    call test%check_close('micro-inertia', sum(v*matmul(mass, v)), 21.0_wp &
      *sum(matmul(rate, inertia)*rate), 1.0e-12_wp)
  end subroutine check_mass
end program test_fem_mm_element
