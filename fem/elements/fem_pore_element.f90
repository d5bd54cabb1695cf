!> An element with a liquid in its pores: pressure at its corners beside the displacements. Content
!! of liquid, Darcy's flow and the force of the pressure, and their matrices, all at the points of
!! the solid's own integrals.
!!
!! With N the corner functions, b the gradients of the volumetric strain and tau = 1/(2 G) of equal
!! orders (else 0), differences d over a step and * the mean by theta:
!!   u rows:  -int alpha p b,
!!   p rows:  -int N (alpha de_v + S dp) - int tau (N - PN) (dp - Pdp) + dt int grad N . w*,
!! w = -kappa (grad p - rho_f g), P the mean over the element: it frees equal orders of pressures
!! that alternate, and moves no liquid between elements (White and Borja 2008). In dynamics the
!! liquid falls with g - a, a the acceleration of the solid.
!! eqs. F.29 and F.30
module fem_pore_element
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_element, only: fem_shape_type, element_shape
  use fem_retention, only: fem_retention_type
  use fem_rules, only: fem_formulation_type
  use fem_strain, only: volume_gradients
  implicit none
  private
  public :: fem_skeleton_type, fem_wet_type, fem_flow_step_type, fem_flow_energy_type
  public :: fem_flow_change_type
  public :: constant_permeability, kozeny_carman, by_void_ratio, permeability_factor, mean_strain
  public :: wet_shape, wet_force, wet_matrix, wet_energy, wet_content, wet_size, darcy_flow
  public :: add_drag, fall_at

  !> How permeability depends on the pores.
  integer(i4), parameter :: constant_permeability = 1, kozeny_carman = 2, by_void_ratio = 3
  real(wp), parameter :: least_voids = 0.01_wp  !! void ratio below which pores do not close further

  !> A solid with pores and their liquid.
  type :: fem_skeleton_type
    real(wp) :: biot = 1.0_wp          !! alpha [-]
    real(wp) :: storage = 0.0_wp       !! S, content by pressure at constant strain [1/Pa]
    real(wp) :: mobility(3) = 0.0_wp   !! kappa = k/viscosity along x, y, z [m^2/(Pa s)]
    real(wp) :: porosity = 0.0_wp
    real(wp) :: density = 0.0_wp       !! of the liquid [kg/m^3]
    integer(i4) :: law = constant_permeability
    real(wp) :: slope = 0.0_wp         !! c_k of `by_void_ratio` [-]
    real(wp) :: grains = 0.0_wp        !! (alpha - n)/K_s, share of the grains in S [1/Pa]
    type(fem_retention_type) :: retention
  end type fem_skeleton_type

  !> One element at its points.
  type :: fem_wet_type
    type(fem_shape_type) :: shape
    real(wp), allocatable :: slope(:, :, :)  !! (3, corners, n) gradients of the pressure [1/m]
    real(wp), allocatable :: volume(:, :)    !! (3 nodes, n) of the volumetric strain [1/m]
    real(wp), allocatable :: steady(:, :)    !! (corners, corners) of equal orders, else 0 [m^3/Pa]
  end type fem_wet_type

  !> What a step has in common.
  type :: fem_flow_step_type
    real(wp) :: dt = 0.0_wp          !! [s]
    real(wp) :: theta = 1.0_wp       !! share of the end in the flow of the step
    real(wp) :: gravity(3) = 0.0_wp  !! [m/s^2]
    real(wp) :: inertia = 0.0_wp     !! acceleration by displacement, 0 in statics [1/s^2]
  end type fem_flow_step_type

  !> A step of one element.
  type :: fem_flow_change_type
    real(wp), allocatable :: moved(:, :)  !! (3, nodes) displacements in it [m]
    real(wp), allocatable :: p(:, :)      !! (corners, 2) pressures at its start and end [Pa]
    real(wp), allocatable :: a(:, :)      !! (3, nodes) mean acceleration, in dynamics [m/s^2]
    real(wp), allocatable :: gone(:, :)   !! (3, nodes) displacements before it, if unsaturated [m]
  end type fem_flow_change_type

  !> Energies of the liquid of an element [J].
  type :: fem_flow_energy_type
    real(wp) :: stored = 0.0_wp     !! elastic, at the end of the step
    real(wp) :: darcy = 0.0_wp      !! dissipated by the flow
    real(wp) :: fall = 0.0_wp       !! work of the liquid's weight on the flow
    real(wp) :: numerical = 0.0_wp  !! dissipated by the integration
    real(wp) :: gained = 0.0_wp     !! stored in the step, of unsaturated pores
    real(wp) :: weight = 0.0_wp     !! work of the weight that unsaturated pores lack
  end type fem_flow_energy_type

contains

  !> Gradients and weights of the element with nodes x [m]; `shear` is the modulus that steadies
  !! equal orders.
  pure subroutine wet_shape(rule, x, shear, wet)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: shear  !! [Pa]
    type(fem_wet_type), intent(inout) :: wet
    real(wp) :: tangent(3, 3), inverse(3, 3)
    integer(i4) :: q, a
    if (.not. allocated(wet%slope)) &
      allocate (wet%slope(3, rule%corners, rule%at%n), wet%volume(3*rule%nodes, rule%at%n), &
                wet%steady(rule%corners, rule%corners))
    call element_shape(rule%at, x, wet%shape)
    do q = 1, rule%at%n
      tangent = 0.0_wp
      do a = 1, rule%nodes
        tangent(:, 1) = tangent(:, 1) + rule%at%u_slope(1, a, q)*x(:, a)
        tangent(:, 2) = tangent(:, 2) + rule%at%u_slope(2, a, q)*x(:, a)
        tangent(:, 3) = tangent(:, 3) + rule%at%u_slope(3, a, q)*x(:, a)
      end do
      inverse(:, 1) = cross(tangent(:, 2), tangent(:, 3))
      inverse(:, 2) = cross(tangent(:, 3), tangent(:, 1))
      inverse(:, 3) = cross(tangent(:, 1), tangent(:, 2))
      inverse = inverse/dot_product(tangent(:, 1), inverse(:, 1))
      do a = 1, rule%corners
        wet%slope(:, a, q) = rule%at%corner_slope(1, a, q)*inverse(:, 1) &
                             + rule%at%corner_slope(2, a, q)*inverse(:, 2) &
                             + rule%at%corner_slope(3, a, q)*inverse(:, 3)
      end do
    end do
    if (rule%bbar) then
      call volume_gradients(rule, x, wet%shape, wet%volume)
    else
      wet%volume = reshape(wet%shape%u, shape(wet%volume))
    end if
    wet%steady = 0.0_wp
    if (rule%corners == rule%nodes .and. shear > 0.0_wp) &
      call steady_pressure(rule, wet%shape%weight, 0.5_wp/shear, wet%steady)
  end subroutine wet_shape

  !> Add tau int (N_a - PN_a) (N_b - PN_b) [m^3/Pa], at the points of the mass: the one point of
  !! tet4 does not see it.
  pure subroutine steady_pressure(rule, weight, tau, t)
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: weight(:)  !! of the points of the stiffness [m^3]
    real(wp), intent(in) :: tau        !! [1/Pa]
    real(wp), intent(inout) :: t(:, :)
    real(wp) :: off(rule%corners), mean(rule%corners), w(rule%mass_at%n)
    integer(i4) :: q, b
    associate (at => rule%mass_at)
      w = sum(weight)*at%weight/sum(at%weight)
      if (at%n == rule%at%n) w = weight
      mean = 0.0_wp
      do q = 1, at%n
        mean = mean + w(q)/sum(w)*at%corner(:, q)
      end do
      do q = 1, at%n
        off = at%corner(:, q) - mean
        do b = 1, rule%corners
          t(:, b) = t(:, b) + tau*w(q)*off(b)*off
        end do
      end do
    end associate
  end subroutine steady_pressure

  !> Permeability over that of the start, for a volumetric strain since then: grains keep their
  !! volume, e = e_0 + (1 + e_0) strain.
  pure real(wp) function permeability_factor(skeleton, strain) result(factor)
    type(fem_skeleton_type), intent(in) :: skeleton
    real(wp), intent(in) :: strain
    real(wp) :: e, e0
    factor = 1.0_wp
    e0 = skeleton%porosity/(1.0_wp - skeleton%porosity)
    e = max(least_voids, e0 + (1.0_wp + e0)*strain)
    select case (skeleton%law)
    case (kozeny_carman)  ! n^3/(1 - n)^2 = e^3/(1 + e)
      factor = (e/e0)**3*(1.0_wp + e0)/(1.0_wp + e)
    case (by_void_ratio)
      factor = 10.0_wp**((e - e0)/skeleton%slope)
    end select
  end function permeability_factor

  !> Mean volumetric strain of displacements u.
  pure real(wp) function mean_strain(wet, u)
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: u(:, :)  !! (3, nodes) [m]
    integer(i4) :: q
    mean_strain = 0.0_wp
    do q = 1, size(wet%volume, 2)
      mean_strain = mean_strain + wet%shape%weight(q)*sum(wet%volume(:, q)*reshape(u, [size(u)]))
    end do
    mean_strain = mean_strain/sum(wet%shape%weight)
  end function mean_strain

  !> Internal forces (3, nodes) [N] and, negative, contents less inflow (corners) [m^3] of a step.
  pure subroutine wet_force(rule, skeleton, wet, step, change, force, flow)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp), intent(out) :: force(:, :)
    real(wp), intent(out), contiguous :: flow(:)
    real(wp) :: f(3*rule%nodes), moved(3*rule%nodes), w(3), more, d(rule%corners)
    integer(i4) :: q
    f = 0.0_wp
    moved = reshape(change%moved, shape(moved))
    d = change%p(:, 2) - change%p(:, 1)
    flow = 0.0_wp
    do q = 1, rule%corners
      flow = flow - d(q)*wet%steady(:, q)
    end do
    do q = 1, rule%at%n
      associate (weight => wet%shape%weight(q), n => rule%at%corner(:, q))
        f = f - weight*skeleton%biot*dot_product(n, change%p(:, 2))*wet%volume(:, q)
        more = skeleton%biot*sum(wet%volume(:, q)*moved) + skeleton%storage*dot_product(n, d)
        w = darcy_flow(skeleton, wet, fall_at(rule, step, change, q), &
                       change%p(:, 1) + step%theta*d, q)
        call add_flow_of(step%dt*weight*w, wet%slope(:, :, q), flow)
        flow = flow - weight*more*n
      end associate
    end do
    force = reshape(f, shape(force))
  end subroutine wet_force

  !> Add grad N . w.
  pure subroutine add_flow_of(w, slope, flow)
    real(wp), intent(in) :: w(3)
    real(wp), intent(in), contiguous :: slope(:, :)  !! (3, corners)
    real(wp), intent(inout), contiguous :: flow(:)
    integer(i4) :: a
    do a = 1, size(flow)
      flow(a) = flow(a) + w(1)*slope(1, a) + w(2)*slope(2, a) + w(3)*slope(3, a)
    end do
  end subroutine add_flow_of

  !> Gradient of what has the values p at the corners.
  pure function gradient_of(slope, p) result(g)
    real(wp), intent(in), contiguous :: slope(:, :), p(:)
    real(wp) :: g(3)
    integer(i4) :: a
    g = 0.0_wp
    do a = 1, size(p)
      g = g + p(a)*slope(:, a)
    end do
  end function gradient_of

  !> What makes the liquid fall at point q: gravity less the acceleration [m/s^2].
  pure function fall_at(rule, step, change, q) result(fall)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    integer(i4), intent(in) :: q
    real(wp) :: fall(3)
    integer(i4) :: a
    fall = step%gravity
    if (.not. allocated(change%a)) return
    do a = 1, rule%nodes
      fall = fall - rule%at%u(a, q)*change%a(:, a)
    end do
  end function fall_at

  !> Couplings (3 nodes, corners) [m^2] in the rows of displacements and, transposed, of pressures,
  !! and matrix of the pressures (corners, corners) [m^3/Pa]: the slopes of `wet_force`.
  pure subroutine wet_matrix(rule, skeleton, wet, step, coupling, flow)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(out) :: coupling(:, :, :), flow(:, :)
    real(wp) :: share, drag
    integer(i4) :: q, b
    coupling = 0.0_wp
    flow = -wet%steady
    share = step%dt*step%theta
    drag = share*skeleton%density*step%inertia
    do q = 1, rule%at%n
      associate (weight => wet%shape%weight(q), n => rule%at%corner(:, q), h => wet%slope(:, :, q))
        do b = 1, rule%corners
          coupling(:, b, 1) = coupling(:, b, 1) - weight*skeleton%biot*n(b)*wet%volume(:, q)
          if (drag > 0.0_wp) call add_drag(-weight*drag*skeleton%mobility*h(:, b), &
                                           rule%at%u(:, q), coupling(:, b, 2))
          flow(:, b) = flow(:, b) - weight*skeleton%storage*n(b)*n
          call add_flow_of(-weight*share*skeleton%mobility*h(:, b), h, flow(:, b))
        end do
      end associate
    end do
    coupling(:, :, 2) = coupling(:, :, 1) + coupling(:, :, 2)
  end subroutine wet_matrix

  !> Add a vector times the functions of the displacement.
  pure subroutine add_drag(vector, n, column)
    real(wp), intent(in) :: vector(3), n(:)
    real(wp), intent(inout) :: column(:)  !! (3 nodes)
    integer(i4) :: a
    do a = 1, size(n)
      column(3*a - 2:3*a) = column(3*a - 2:3*a) + n(a)*vector
    end do
  end subroutine add_drag

  !> Darcy's flow at point q for pressures p of the corners [m/s].
  pure function darcy_flow(skeleton, wet, fall, p, q) result(w)
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: fall(3)  !! as `fall_at` [m/s^2]
    real(wp), intent(in), contiguous :: p(:)
    integer(i4), intent(in) :: q
    real(wp) :: w(3)
    w = -skeleton%mobility*(gradient_of(wet%slope(:, :, q), p) - skeleton%density*fall)
  end function darcy_flow

  !> Liquid in an element beyond that of u = 0 and p = 0 [m^3].
  pure real(wp) function wet_content(rule, skeleton, wet, u, p)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: u(:, :)  !! (3, nodes) [m]
    real(wp), intent(in) :: p(:)     !! (corners) [Pa]
    integer(i4) :: q
    wet_content = 0.0_wp
    do q = 1, rule%at%n
      wet_content = wet_content + wet%shape%weight(q)*(skeleton%storage &
        *dot_product(rule%at%corner(:, q), p) &
        + skeleton%biot*sum(wet%volume(:, q)*reshape(u, [size(u)])))
    end do
  end function wet_content

  !> Size of the volumes that a corner's balance could sum, if nothing cancelled [m^3]: what
  !! rounding is measured by.
  pure real(wp) function wet_size(skeleton, wet, step, change)
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp) :: steepest
    steepest = maxval(abs(wet%slope))
    wet_size = sum(wet%shape%weight)*(skeleton%biot*steepest*maxval(abs(change%moved)) &
      + step%dt*maxval(skeleton%mobility)*steepest*(steepest*maxval(abs(change%p)) &
      + skeleton%density*norm2(step%gravity)))
  end function wet_size

  !> Energies of a step; the pressures that steady equal orders store some, too. What acceleration
  !! does to the relative flow has no counterpart in the balance of forces: it counts as numerical.
  pure function wet_energy(rule, skeleton, wet, step, change) result(energy)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    type(fem_flow_energy_type) :: energy
    real(wp), dimension(rule%corners) :: d, start, after
    real(wp) :: w(3), fall(3), work(3)
    integer(i4) :: q
    start = change%p(:, 1)
    after = change%p(:, 2)
    d = after - start
    do q = 1, rule%corners
      energy%stored = energy%stored + 0.5_wp*after(q)*dot_product(after, wet%steady(:, q))
    end do
    do q = 1, rule%at%n
      associate (weight => wet%shape%weight(q), h => wet%slope(:, :, q), e => energy)
        e%stored = e%stored + 0.5_wp*weight*skeleton%storage &
                   *dot_product(rule%at%corner(:, q), after)**2
        fall = fall_at(rule, step, change, q)
        w = darcy_flow(skeleton, wet, fall, start + step%theta*d, q)
        work(1) = dot_product(skeleton%density*step%gravity, w)
        work(2) = dot_product(skeleton%density*fall - gradient_of(h, start + step%theta*d), w)
        work(3) = (step%theta - 0.5_wp)*dot_product(gradient_of(h, d), w) &
                  + work(1) - dot_product(skeleton%density*fall, w)
        e%fall = e%fall + weight*step%dt*work(1)
        e%darcy = e%darcy + weight*step%dt*work(2)
        e%numerical = e%numerical + weight*step%dt*work(3)
      end associate
    end do
  end function wet_energy
end module fem_pore_element
