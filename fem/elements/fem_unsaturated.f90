!> An element whose pores hold liquid under suction: the counterparts of fem_pore_element.
!!
!! With N the corner functions, V_a = int N_a, Q_a = alpha int N_a b and what corner a has by its
!! pressure, S_a, k_r and Bishop's pi_a = chi_a p_a:
!!   content of a:  zeta_a = S_a (n V_a + Q_a . u + V_a (c_f p_a + c_s pi_a)),
!!   u rows:        -sum pi_a Q_a - int N (S - 1) n rho_f g, S = sum N_a S_a,
!!   p rows:        -(zeta_a' - zeta_a) + dt int grad N_a . w*,
!! w = -k_r kappa (grad p - rho_f g). Contents stand at corners (lumped), so that fronts do not
!! undershoot, and are functions of the state: what a body gains is exact for any step.
!! eqs. F.83, F.84 and F.88
module fem_unsaturated
  use talus_kinds, only: wp, i4
  use fem_pore_element, only: fem_flow_change_type, fem_flow_energy_type, fem_flow_step_type, &
    fem_skeleton_type, fem_wet_type, add_drag, darcy_flow, fall_at
  use fem_retention, only: no_retention, bear, conduct, retain
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: has_retention, moist_force, moist_matrix, moist_energy, moist_gain, moist_size
  public :: moist_flow, moist_inertia, moist_mass, moist_means

  !> An element's integrals, and its corners at start and end of a step.
  type :: moist_type
    real(wp), allocatable :: share(:)       !! V_a [m^3]
    real(wp), allocatable :: squeeze(:, :)  !! (3 nodes, corners) Q_a [m^2]
    real(wp), allocatable :: s(:, :)        !! (corners, 2) saturations
    real(wp), allocatable :: rise(:)        !! slope of the saturation at the end [1/Pa]
    real(wp), allocatable :: borne(:, :)    !! (corners, 2) chi p [Pa]
    real(wp), allocatable :: lift(:)        !! slope of that at the end
    real(wp), allocatable :: pore(:)        !! pores at the start of the step [m^3]
    real(wp), allocatable :: opened(:)      !! what the step opens of them [m^3]
  end type moist_type

contains

  !> Can the pores be unsaturated?
  elemental logical function has_retention(skeleton)
    type(fem_skeleton_type), intent(in) :: skeleton
    has_retention = skeleton%retention%law /= no_retention
  end function has_retention

  !> What the corners have in a step.
  pure subroutine moisten(rule, skeleton, wet, change, self)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_change_type), intent(in) :: change
    type(moist_type), intent(out) :: self
    real(wp) :: unused(rule%corners), liquid
    integer(i4) :: q, a, m
    m = rule%corners
    allocate (self%share(m), self%squeeze(3*rule%nodes, m), source=0.0_wp)
    allocate (self%s(m, 2), self%borne(m, 2), self%rise(m), self%lift(m))
    do q = 1, rule%at%n
      associate (w => wet%shape%weight(q), n => rule%at%corner(:, q))
        self%share = self%share + w*n
        do a = 1, m
          self%squeeze(:, a) = self%squeeze(:, a) + w*skeleton%biot*n(a)*wet%volume(:, q)
        end do
      end associate
    end do
    associate (law => skeleton%retention, p => change%p)
      call retain(law, p(:, 1), self%s(:, 1), unused)
      call bear(law, p(:, 1), self%borne(:, 1), unused)
      call retain(law, p(:, 2), self%s(:, 2), self%rise)
      call bear(law, p(:, 2), self%borne(:, 2), self%lift)
      liquid = skeleton%storage - skeleton%grains
      self%pore = self%share*(skeleton%porosity + liquid*p(:, 1) &
        + skeleton%grains*self%borne(:, 1)) + matmul(flat(change%gone), self%squeeze)
      self%opened = self%share*(liquid*(p(:, 2) - p(:, 1)) + skeleton%grains &
        *(self%borne(:, 2) - self%borne(:, 1))) + matmul(flat(change%moved), self%squeeze)
    end associate
  end subroutine moisten

  pure function flat(u)
    real(wp), intent(in) :: u(:, :)
    real(wp) :: flat(size(u))
    flat = reshape(u, [size(u)])
  end function flat

  !> Content that the corners gain in a step [m^3].
  pure function gained(self) result(volume)
    type(moist_type), intent(in) :: self
    real(wp) :: volume(size(self%share))
    volume = self%s(:, 2)*self%opened + (self%s(:, 2) - self%s(:, 1))*self%pore
  end function gained

  !> As `wet_force`.
  pure subroutine moist_force(rule, skeleton, wet, step, change, force, flow)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp), intent(out) :: force(:, :), flow(:)
    type(moist_type) :: self
    real(wp), dimension(rule%corners) :: mean, d
    integer(i4) :: q
    call moisten(rule, skeleton, wet, change, self)
    d = change%p(:, 2) - change%p(:, 1)
    mean = change%p(:, 1) + step%theta*d
    flow = -gained(self) - matmul(wet%steady, d)
    do q = 1, rule%at%n
      flow = flow + step%dt*wet%shape%weight(q) &
        *matmul(moist_flow(rule, skeleton, wet, fall_at(rule, step, change, q), mean, q), &
                wet%slope(:, :, q))
    end do
    force = reshape(-matmul(self%squeeze, self%borne(:, 2)), shape(force)) &
      - lightened(rule, skeleton, wet, step, self%s(:, 2) - 1.0_wp)
  end subroutine moist_force

  !> Weight of saturations at the corners [N].
  pure function lightened(rule, skeleton, wet, step, s) result(weight)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(in) :: s(:)  !! (corners)
    real(wp) :: weight(3, rule%nodes)
    real(wp) :: amount
    integer(i4) :: q, a
    weight = 0.0_wp
    do q = 1, rule%at%n
      amount = wet%shape%weight(q)*skeleton%porosity*skeleton%density &
        *dot_product(rule%at%corner(:, q), s)
      do a = 1, rule%nodes
        weight(:, a) = weight(:, a) + amount*rule%at%u(a, q)*step%gravity
      end do
    end do
  end function lightened

  !> Darcy's flow at point q for pressures p of the corners [m/s].
  pure function moist_flow(rule, skeleton, wet, fall, p, q) result(w)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: fall(3)  !! gravity less the acceleration [m/s^2]
    real(wp), intent(in) :: p(:)
    integer(i4), intent(in) :: q
    real(wp) :: w(3), share, slope
    call conduct(skeleton%retention, dot_product(rule%at%corner(:, q), p), share, slope)
    w = share*darcy_flow(skeleton, wet, fall, p, q)
  end function moist_flow

  !> Couplings in the rows of displacements and of pressures, and matrix of the pressures (row,
  !! column): the slopes of `moist_force`, which are not symmetric.
  pure subroutine moist_matrix(rule, skeleton, wet, step, change, coupling, flow)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp), intent(out) :: coupling(:, :, :), flow(:, :)
    type(moist_type) :: self
    real(wp) :: unit(rule%corners), mean(rule%corners), share, slope, by(3), drag
    integer(i4) :: a, q
    call moisten(rule, skeleton, wet, change, self)
    flow = -wet%steady
    do a = 1, rule%corners
      unit = 0.0_wp
      unit(a) = self%rise(a)
      coupling(:, a, 1) = -self%lift(a)*self%squeeze(:, a) &
        - flat(lightened(rule, skeleton, wet, step, unit))
      coupling(:, a, 2) = -self%s(a, 2)*self%squeeze(:, a)
      flow(a, a) = flow(a, a) - self%rise(a)*(self%pore(a) + self%opened(a)) &
        - self%s(a, 2)*self%share(a)*(skeleton%storage - skeleton%grains &
                                      + skeleton%grains*self%lift(a))
    end do
    mean = change%p(:, 1) + step%theta*(change%p(:, 2) - change%p(:, 1))
    drag = step%dt*step%theta*skeleton%density*step%inertia
    do q = 1, rule%at%n
      call conduct(skeleton%retention, dot_product(rule%at%corner(:, q), mean), share, slope)
      do a = 1, rule%corners
        if (drag > 0.0_wp) call add_drag(-wet%shape%weight(q)*share*drag*skeleton%mobility &
          *wet%slope(:, a, q), rule%at%u(:, q), coupling(:, a, 2))
        by = slope*rule%at%corner(a, q)*darcy_flow(skeleton, wet, fall_at(rule, step, change, q), &
          mean, q) - share*skeleton%mobility*wet%slope(:, a, q)
        flow(:, a) = flow(:, a) + step%theta*step%dt*wet%shape%weight(q) &
          *matmul(by, wet%slope(:, :, q))
      end do
    end do
  end subroutine moist_matrix

  !> Mass of the liquid that saturations at the corners lack at point q, negative [kg].
  pure real(wp) function lacking(rule, skeleton, wet, s, q)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: s(:)  !! (corners) less 1, or a change of them
    integer(i4), intent(in) :: q
    lacking = wet%shape%weight(q)*skeleton%porosity*skeleton%density &
      *dot_product(rule%at%corner(:, q), s)
  end function lacking

  !> Inertia that an element lacks, whose pores hold less than all liquid: int N n rho_f (S - 1) a
  !! (3, nodes) [N]. eq. F.91
  pure function moist_inertia(rule, skeleton, wet, p, a) result(force)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: p(:)     !! (corners) [Pa]
    real(wp), intent(in) :: a(:, :)  !! (3, nodes) [m/s^2]
    real(wp) :: force(3, rule%nodes)
    real(wp), dimension(rule%corners) :: s, slope
    integer(i4) :: q, b
    call retain(skeleton%retention, p, s, slope)
    force = 0.0_wp
    do q = 1, rule%at%n
      do b = 1, rule%nodes
        force(:, b) = force(:, b) + lacking(rule, skeleton, wet, s - 1.0_wp, q)*rule%at%u(b, q) &
          *matmul(a, rule%at%u(:, q))
      end do
    end do
  end function moist_inertia

  !> Slopes of `moist_inertia`: by accelerations (nodes, nodes) [kg], the same for all components,
  !! and by pressures of the corners (3 nodes, corners) [m^2].
  pure subroutine moist_mass(rule, skeleton, wet, p, a, mass, by_p)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: p(:)     !! (corners) [Pa]
    real(wp), intent(in) :: a(:, :)  !! (3, nodes) [m/s^2]
    real(wp), intent(out) :: mass(:, :), by_p(:, :)
    real(wp), dimension(rule%corners) :: s, slope, unit
    integer(i4) :: q, b
    call retain(skeleton%retention, p, s, slope)
    mass = 0.0_wp
    by_p = 0.0_wp
    do q = 1, rule%at%n
      associate (n => rule%at%u(:, q))
        do b = 1, rule%nodes
          mass(:, b) = mass(:, b) + lacking(rule, skeleton, wet, s - 1.0_wp, q)*n(b)*n
        end do
        do b = 1, rule%corners
          unit = 0.0_wp
          unit(b) = slope(b)
          call add_drag(lacking(rule, skeleton, wet, unit, q)*matmul(a, n), n, by_p(:, b))
        end do
      end associate
    end do
  end subroutine moist_mass

  !> Liquid that a step brings into an element [m^3].
  pure real(wp) function moist_gain(rule, skeleton, wet, change)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_change_type), intent(in) :: change
    type(moist_type) :: self
    call moisten(rule, skeleton, wet, change, self)
    moist_gain = sum(gained(self))
  end function moist_gain

  !> As `wet_size`, with the largest permeability of the corners.
  pure real(wp) function moist_size(skeleton, wet, step, change)
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    real(wp), dimension(size(change%p, 1), 2) :: share, slope
    real(wp) :: steepest
    call conduct(skeleton%retention, change%p, share, slope)
    steepest = maxval(abs(wet%slope))
    moist_size = sum(wet%shape%weight)*(skeleton%biot*steepest*maxval(abs(change%moved)) &
      + step%dt*maxval(share)*maxval(skeleton%mobility)*steepest*(steepest*maxval(abs(change%p)) &
      + skeleton%density*norm2(step%gravity)))
  end function moist_size

  !> As `wet_energy`. What the liquid and its surfaces keep is no function of the state: it counts
  !! by its work in the step, and so does the weight that the skeleton takes on.
  pure function moist_energy(rule, skeleton, wet, step, change) result(energy)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    type(fem_flow_step_type), intent(in) :: step
    type(fem_flow_change_type), intent(in) :: change
    type(fem_flow_energy_type) :: energy
    type(moist_type) :: self
    real(wp) :: d(rule%corners), mean(rule%corners), w(3), fall(3), dt
    integer(i4) :: q
    call moisten(rule, skeleton, wet, change, self)
    associate (p => change%p, moved => change%moved)
      d = p(:, 2) - p(:, 1)
      mean = p(:, 1) + step%theta*d
      energy%stored = 0.5_wp*dot_product(p(:, 2), matmul(wet%steady, p(:, 2)))
      energy%gained = 0.5_wp*dot_product(p(:, 1) + p(:, 2), gained(self)) - 0.5_wp &
        *dot_product(self%borne(:, 1) + self%borne(:, 2), matmul(flat(moved), self%squeeze))
      energy%weight = sum(moved*lightened(rule, skeleton, wet, step, &
                                          0.5_wp*(self%s(:, 1) + self%s(:, 2)) - 1.0_wp))
      do q = 1, rule%at%n
        fall = fall_at(rule, step, change, q)
        w = moist_flow(rule, skeleton, wet, fall, mean, q)
        dt = step%dt*wet%shape%weight(q)
        energy%fall = energy%fall + dt*skeleton%density*dot_product(step%gravity, w)
        energy%darcy = energy%darcy + dt*dot_product(skeleton%density*fall &
          - matmul(wet%slope(:, :, q), mean), w)
        energy%numerical = energy%numerical + dt*dot_product((step%theta - 0.5_wp) &
          *matmul(wet%slope(:, :, q), d) + skeleton%density*(step%gravity - fall), w)
      end do
    end associate
  end function moist_energy

  !> Means over an element with pressures p of the corners: Darcy's flow [m/s], what the skeleton
  !! bears [Pa], and the saturation.
  pure function moist_means(rule, skeleton, wet, fall, p) result(means)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: fall(3)  !! gravity [m/s^2]
    real(wp), intent(in) :: p(:)
    real(wp) :: means(5)
    real(wp), dimension(rule%corners) :: borne, s, slope
    integer(i4) :: q
    means = 0.0_wp
    call bear(skeleton%retention, p, borne, slope)
    call retain(skeleton%retention, p, s, slope)
    do q = 1, rule%at%n
      associate (n => rule%at%corner(:, q))
        means = means + wet%shape%weight(q)*[moist_flow(rule, skeleton, wet, fall, p, q), &
                                             dot_product(n, borne), dot_product(n, s)]
      end associate
    end do
    means = means/sum(wet%shape%weight)
  end function moist_means
end module fem_unsaturated
