!> Integrals of an element with a liquid in its pores that no step changes: in statics forces,
!! contents and energies of fem_pore_element are products with them, without its points.
!!
!! For the flow pressures count from those of a liquid at rest, p_1 + r_b with r_b = rho_f g .
!! (x_b - x_1). Corner functions carry these but for the curvature of edges; what they leave,
!! grad r - rho_f g, has integrals of its own. So a liquid at rest dissipates the square of
!! rounding.
!! eqs. F.29 and F.30
module fem_pore_integrals
  use talus_kinds, only: wp, i4
  use fem_pore_element, only: fem_flow_energy_type, fem_flow_step_type, fem_skeleton_type, &
    fem_wet_type
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: fem_wet_integrals_type, integrate_wet, integrals_size
  public :: flow_force, flow_matrix, flow_energy, flow_content, flow_size, flow_strain

  integer(i4), parameter :: extra = 3  !! single numbers at the end of a column

  !> Of one element; mobilities are those of the start.
  type :: fem_wet_integrals_type
    integer(i4) :: solid = 0    !! rows of displacements, 3 nodes
    integer(i4) :: corners = 0
    real(wp) :: biot = 0.0_wp     !! alpha [-]
    !> A column a corner b: int N_b times the gradients of the volumetric strain [m^2]; content by
    !! pressure, S int N_b N + tau int (N_b - PN_b)(N - PN) [m^3/Pa]; int grad N_b . kappa grad N
    !! [m^3/(Pa s)]; r_b [Pa]; int grad N_b . kappa (grad r - rho_f g) and int grad N_b . kappa
    !! rho_f g [m^3/s]
    real(wp), allocatable :: column(:, :)
    real(wp) :: left = 0.0_wp     !! int (grad r - rho_f g) . kappa (grad r - rho_f g) [J/s]
    real(wp) :: weight = 0.0_wp   !! int rho_f g . kappa (grad r - rho_f g) [J/s]
    real(wp) :: volume = 0.0_wp   !! [m^3]
    real(wp) :: steepest = 0.0_wp !! largest gradient of a corner function [1/m]
  end type fem_wet_integrals_type

contains

  !> Reals that an element keeps.
  pure integer(i4) function integrals_size(rule) result(reals)
    type(fem_formulation_type), intent(in) :: rule
    reals = (3*rule%nodes + 2*rule%corners + extra)*rule%corners
  end function integrals_size

  !> The integrals of an element with nodes x [m].
  subroutine integrate_wet(rule, skeleton, wet, x, gravity, self)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_wet_type), intent(in) :: wet
    real(wp), intent(in) :: x(:, :)
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    type(fem_wet_integrals_type), intent(inout) :: self
    real(wp) :: weight(3), over(3)
    integer(i4) :: q, b, n, m
    n = 3*rule%nodes
    m = rule%corners
    self = fem_wet_integrals_type(n, m, skeleton%biot)
    allocate (self%column(n + 2*m + extra, m), source=0.0_wp)
    self%volume = sum(wet%shape%weight)
    self%steepest = maxval(abs(wet%slope))
    self%column(n + 1:n + m, :) = wet%steady
    weight = skeleton%density*gravity
    do b = 1, m
      self%column(n + 2*m + 1, b) = dot_product(weight, x(:, b) - x(:, 1))
    end do
    do q = 1, rule%at%n
      over = matmul(wet%slope(:, :, q), self%column(n + 2*m + 1, :)) - weight
      self%left = self%left + wet%shape%weight(q)*dot_product(over, skeleton%mobility*over)
      self%weight = self%weight + wet%shape%weight(q)*dot_product(weight, skeleton%mobility*over)
      do b = 1, m
        call add_point(wet%shape%weight(q), rule%at%corner(:, q), wet%slope(:, :, q))
      end do
    end do

  contains

    subroutine add_point(w, at, slope)
      real(wp), intent(in) :: w, at(:), slope(:, :)
      real(wp) :: flux(3)
      associate (c => self%column(:, b))
        flux = w*skeleton%mobility*slope(:, b)
        c(:n) = c(:n) + w*at(b)*wet%volume(:, q)
        c(n + 1:n + m) = c(n + 1:n + m) + w*skeleton%storage*at(b)*at
        c(n + m + 1:n + 2*m) = c(n + m + 1:n + 2*m) + matmul(flux, slope)
        c(n + 2*m + 2) = c(n + 2*m + 2) + dot_product(flux, over)
        c(n + 2*m + 3) = c(n + 2*m + 3) + dot_product(flux, weight)
      end associate
    end subroutine add_point
  end subroutine integrate_wet

  !> As `wet_force` for displacements `moved` [m] and pressures p (corners, 2) at start and end
  !! [Pa]; `pervious` is the mobility over that of the start.
  pure subroutine flow_force(self, pervious, step, moved, p, force, flow)
    type(fem_wet_integrals_type), intent(in) :: self
    real(wp), intent(in) :: pervious
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(in) :: moved(self%solid), p(self%corners, 2)
    real(wp), intent(out) :: force(self%solid), flow(self%corners)
    real(wp) :: d(self%corners), above(self%corners), gained, run
    integer(i4) :: b, n, m
    n = self%solid
    m = self%corners
    d = p(:, 2) - p(:, 1)
    above = p(:, 1) + step%theta*d
    above = above - above(1) - self%column(n + 2*m + 1, :)
    force = 0.0_wp
    do b = 1, m
      associate (c => self%column(:, b))
        force = force - self%biot*p(b, 2)*c(:n)
        gained = self%biot*product_of(c(:n), moved) + dot_product(c(n + 1:n + m), d)
        run = dot_product(c(n + m + 1:n + 2*m), above) + c(n + 2*m + 2)
        flow(b) = -gained - step%dt*pervious*run
      end associate
    end do
  end subroutine flow_force

  !> a . b, summed in lanes.
  pure real(wp) function product_of(a, b) result(total)
    real(wp), intent(in), contiguous :: a(:), b(:)
    integer(i4) :: i
    total = 0.0_wp
    !$omp simd reduction(+:total)
    do i = 1, size(a)
      total = total + a(i)*b(i)
    end do
  end function product_of

  !> As `wet_matrix`: couplings (3 nodes, corners), and matrix of the pressures.
  pure subroutine flow_matrix(self, pervious, step, coupling, flow)
    type(fem_wet_integrals_type), intent(in) :: self
    real(wp), intent(in) :: pervious
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(out) :: coupling(:, :, :), flow(:, :)
    integer(i4) :: n, m
    n = self%solid
    m = self%corners
    coupling(:, :, 1) = -self%biot*self%column(:n, :)
    coupling(:, :, 2) = coupling(:, :, 1)
    flow = -self%column(n + 1:n + m, :) &
           - step%dt*step%theta*pervious*self%column(n + m + 1:n + 2*m, :)
  end subroutine flow_matrix

  !> As `wet_energy`, in statics.
  pure function flow_energy(self, pervious, step, p) result(energy)
    type(fem_wet_integrals_type), intent(in) :: self
    real(wp), intent(in) :: pervious
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(in) :: p(self%corners, 2)
    type(fem_flow_energy_type) :: energy
    real(wp) :: d(self%corners), above(self%corners), run
    integer(i4) :: b, n, m
    n = self%solid
    m = self%corners
    d = p(:, 2) - p(:, 1)
    above = p(:, 1) + step%theta*d
    above = above - above(1) - self%column(n + 2*m + 1, :)
    energy%darcy = self%left
    energy%fall = self%weight
    do b = 1, m
      associate (c => self%column(:, b))
        run = dot_product(c(n + m + 1:n + 2*m), above) + c(n + 2*m + 2)
        energy%stored = energy%stored + 0.5_wp*p(b, 2)*dot_product(c(n + 1:n + m), p(:, 2))
        energy%darcy = energy%darcy + above(b)*(run + c(n + 2*m + 2))
        energy%fall = energy%fall + above(b)*c(n + 2*m + 3)
        energy%numerical = energy%numerical + d(b)*run
      end associate
    end do
    energy%darcy = step%dt*pervious*energy%darcy
    energy%fall = -step%dt*pervious*energy%fall
    energy%numerical = -(step%theta - 0.5_wp)*step%dt*pervious*energy%numerical
  end function flow_energy

  !> As `wet_content`: corner functions add up to 1, those that steady equal orders to 0.
  pure real(wp) function flow_content(self, u, p) result(content)
    type(fem_wet_integrals_type), intent(in) :: self
    real(wp), intent(in) :: u(self%solid), p(self%corners)
    integer(i4) :: b
    content = self%biot*self%volume*flow_strain(self, u)
    do b = 1, self%corners
      content = content + p(b)*sum(self%column(self%solid + 1:self%solid + self%corners, b))
    end do
  end function flow_content

  !> As `mean_strain`.
  pure real(wp) function flow_strain(self, u) result(strain)
    type(fem_wet_integrals_type), intent(in) :: self
    real(wp), intent(in) :: u(self%solid)  !! [m]
    integer(i4) :: b
    strain = 0.0_wp
    do b = 1, self%corners
      strain = strain + product_of(self%column(:self%solid, b), u)
    end do
    strain = strain/self%volume
  end function flow_strain

  !> As `wet_size`; mobility is that of the step.
  pure real(wp) function flow_size(self, skeleton, step, moved, p) result(reach)
    type(fem_wet_integrals_type), intent(in) :: self
    type(fem_skeleton_type), intent(in) :: skeleton
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(in) :: moved(self%solid), p(self%corners, 2)
    reach = self%volume*(self%biot*self%steepest*maxval(abs(moved)) &
      + step%dt*maxval(skeleton%mobility)*self%steepest*(self%steepest*maxval(abs(p)) &
      + skeleton%density*norm2(step%gravity)))
  end function flow_size
end module fem_pore_integrals
