!> Elements of a linear solid that is not isotropic, as `layered`: sigma = a gamma, m = b kappa.
!! Indices as in `fem_micropolar`: the first is the face's normal, and nine-vectors hold kl = 11 12
!! 13 21 22 23 31 32 33.
!! eq. F.7
module fem_layered
  use talus_kinds, only: wp, i4
  use fem_element, only: fem_shape_type, polar_strain
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: fem_layered_type, layered_stress, layered_stiffness
  public :: layered_point

  !> Moduli: sigma = a gamma [Pa], m = b kappa [N].
  type :: fem_layered_type
    real(wp) :: a(9, 9) = 0.0_wp, b(9, 9) = 0.0_wp
  end type fem_layered_type

contains

  !> sigma [Pa] and m [N/m] at a point from its strain and curvature.
  pure subroutine layered_point(law, gamma, kappa, sigma, couple)
    type(fem_layered_type), intent(in) :: law
    real(wp), intent(in) :: gamma(9), kappa(9)  !! [-], [1/m]
    real(wp), intent(out) :: sigma(9), couple(9)
    sigma = matmul(law%a, gamma)
    couple = matmul(law%b, kappa)
  end subroutine layered_point

  !> Stress (18, points) of an element, as `element_stress` has it.
  pure subroutine layered_stress(rule, shape, u, law, stress)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: u(:, :)  !! (3, blocks) [m], [rad]
    type(fem_layered_type), intent(in) :: law
    real(wp), intent(out) :: stress(:, :)
    real(wp) :: gamma(9), c(3, 3)
    integer(i4) :: q
    do q = 1, rule%at%n
      call polar_strain(rule, shape, u, q, gamma, c)
      call layered_point(law, gamma, reshape(c, [9]), stress(:9, q), stress(10:18, q))
    end do
  end subroutine layered_stress

  !> Stiffness as 3 x 3 blocks k(:, :, a, b), a <= b [N/m, N, N m].
  pure subroutine layered_stiffness(rule, shape, law, factor, k)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    type(fem_layered_type), intent(in) :: law
    real(wp), intent(in) :: factor(:)  !! weight of each point [-]
    real(wp), intent(out) :: k(:, :, :, :)
    real(wp), dimension(9, 3*(rule%nodes + rule%rotations)) :: of_u, of_phi
    real(wp) :: sums(size(of_u, 2), size(of_u, 2))
    integer(i4) :: q, a, b
    sums = 0.0_wp
    do q = 1, rule%at%n
      call strain_rows(rule, shape, q, of_u, of_phi)
      sums = sums + shape%weight(q)*factor(q)* &
        (matmul(transpose(of_u), matmul(law%a, of_u)) &
         + matmul(transpose(of_phi), matmul(law%b, of_phi)))
    end do
    do b = 1, rule%nodes + rule%rotations
      do a = 1, b
        k(:, :, a, b) = sums(3*a - 2:3*a, 3*b - 2:3*b)
      end do
    end do
  end subroutine layered_stiffness

  !> Strain gamma_kl = u_l,k + e_lkm phi_m and curvature at point q of unit freedoms.
  pure subroutine strain_rows(rule, shape, q, of_u, of_phi)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    integer(i4), intent(in) :: q
    real(wp), intent(out) :: of_u(:, :), of_phi(:, :)
    integer(i4), parameter :: plus(3) = [8, 3, 4], minus(3) = [6, 7, 2]  !! e_lkm > 0: lkm = 231..
    integer(i4) :: a, l, m
    of_u = 0.0_wp
    of_phi = 0.0_wp
    m = 3*rule%nodes
    do a = 1, rule%nodes
      do l = 1, 3
        of_u([l, 3 + l, 6 + l], 3*a - 3 + l) = shape%u(:, a, q)
      end do
    end do
    do a = 1, rule%rotations
      do l = 1, 3
        of_u(plus(l), m + 3*a - 3 + l) = rule%at%phi(a, q)
        of_u(minus(l), m + 3*a - 3 + l) = -rule%at%phi(a, q)
        of_phi([l, 3 + l, 6 + l], m + 3*a - 3 + l) = shape%phi(:, a, q)
      end do
    end do
  end subroutine strain_rows
end module fem_layered
