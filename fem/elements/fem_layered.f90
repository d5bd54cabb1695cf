!> Layered solid as a micropolar continuum (Adhikary & Dyskin 1997): equal elastic layers, joints
!! that open and slip elastically between them, and micro-rotations that follow the layers.
!!
!! Along the normal 3 of the layers, of modulus E, ratio nu and thickness b, G = E/(2 (1 + nu)),
!! with joints of stiffness k_n and k_s per area, G' = G b k_s/(G + b k_s):
!!   sigma_31 = G' (gamma_31 + gamma_13),  sigma_13 = G' gamma_31 + (G + G') gamma_13,
!!   m_21 = B (phi_1,2 - nu phi_2,1),      m_12 = B (phi_2,1 - nu phi_1,2),
!!   B = E b^2/(12 (1 - nu^2)) (G - G')/(G + G'),
!!   m_11 = -m_22 = B (1 - nu)/2 (phi_1,1 - phi_2,2),
!! the stretches those of layers and joints in series. The last line, the twist of the layers as
!! plates, makes the law the same for all directions in their plane; the source leaves it out.
!! Indices as in `fem_micropolar`: the first is the face's normal, and nine-vectors hold kl = 11 12
!! 13 21 22 23 31 32 33.
module fem_layered
  use talus_kinds, only: wp, i4
  use fem_element, only: fem_shape_type, polar_strain
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: fem_layered_type, fem_layers_type, layered_law, layered_stress, layered_stiffness
  public :: layered_point

  !> Constants of the layers and joints.
  type :: fem_layers_type
    real(wp) :: young = 0.0_wp, poisson = 0.0_wp   !! of the layers [Pa], [-]
    real(wp) :: thickness = 0.0_wp                 !! of a layer, b [m]
    real(wp) :: normal = 0.0_wp, shear = 0.0_wp    !! of the joints, k_n and k_s [Pa/m]
    real(wp) :: spin = 0.0_wp                      !! against spin about the normal [Pa]
    real(wp) :: axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]  !! normal of the layers
    logical :: published = .false.  !! moduli of Adhikary & Dyskin for plane strain
  end type fem_layers_type

  !> Moduli: sigma = a gamma [Pa], m = b kappa [N].
  type :: fem_layered_type
    real(wp) :: a(9, 9) = 0.0_wp, b(9, 9) = 0.0_wp
  end type fem_layered_type

contains

  !> The moduli in space.
  pure function layered_law(layers) result(law)
    type(fem_layers_type), intent(in) :: layers
    type(fem_layered_type) :: law
    real(wp) :: turn(3, 3)
    call stretch_moduli(layers, law%a)
    call shear_moduli(layers, law)
    turn = frame_of(layers%axis)
    law%a = turned(law%a, turn)
    law%b = turned(law%b, turn)
  end function layered_law

  !> Stretches along the layers and across them: layers and joints in series.
  pure subroutine stretch_moduli(layers, a)
    type(fem_layers_type), intent(in) :: layers
    real(wp), intent(inout) :: a(9, 9)
    real(wp) :: across, along, between, side, ratio, joint
    associate (e => layers%young, nu => layers%poisson)
      joint = layers%thickness*layers%normal
      ratio = nu/(1.0_wp - nu)
      across = 1.0_wp/((1.0_wp + nu)*(1.0_wp - 2.0_wp*nu)/(e*(1.0_wp - nu)) + 1.0_wp/joint)
      side = ratio*across
      along = e/(1.0_wp - nu**2) + ratio*side
      between = e*nu/(1.0_wp - nu**2) + ratio*side
      if (layers%published) between = ratio*along
    end associate
    a([1, 5], 9) = side
    a(9, [1, 5]) = side
    a(9, 9) = across
    a(1, 1) = along
    a(5, 5) = along
    a(1, 5) = between
    a(5, 1) = between
  end subroutine stretch_moduli

  !> Shears and the bending of the layers.
  pure subroutine shear_moduli(layers, law)
    type(fem_layers_type), intent(in) :: layers
    type(fem_layered_type), intent(inout) :: law
    real(wp) :: g, jointed, bending
    associate (e => layers%young, nu => layers%poisson, b => layers%thickness)
      g = e/(2.0_wp*(1.0_wp + nu))
      jointed = g*b*layers%shear/(g + b*layers%shear)
      bending = e*b**2/(12.0_wp*(1.0_wp - nu**2))*(g - jointed)/(g + jointed)
      law%b(4, [4, 2]) = bending*[1.0_wp, -nu]
      law%b(2, [2, 4]) = bending*[1.0_wp, -nu]
      if (.not. layers%published) then
        law%b(1, [1, 5]) = 0.5_wp*(1.0_wp - nu)*bending*[1.0_wp, -1.0_wp]
        law%b(5, [5, 1]) = 0.5_wp*(1.0_wp - nu)*bending*[1.0_wp, -1.0_wp]
      end if
    end associate
    law%a([2, 4], [2, 4]) = g
    law%a([2, 4], 2) = law%a([2, 4], 2) + layers%spin*[1.0_wp, -1.0_wp]
    law%a([2, 4], 4) = law%a([2, 4], 4) - layers%spin*[1.0_wp, -1.0_wp]
    law%a([7, 3], [7, 3]) = jointed
    law%a(3, 3) = g + jointed
    law%a([8, 6], [8, 6]) = jointed
    law%a(6, 6) = g + jointed
  end subroutine shear_moduli

  !> Columns are the axes of the layers, the third along the normal.
  pure function frame_of(axis) result(turn)
    real(wp), intent(in) :: axis(3)
    real(wp) :: turn(3, 3)
    integer(i4) :: least
    turn(:, 3) = axis/norm2(axis)
    if (abs(turn(3, 3)) > 1.0_wp - epsilon(1.0_wp)) then
      turn(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
    else
      least = minloc(abs(turn(:, 3)), dim=1)
      turn(:, 1) = -turn(least, 3)*turn(:, 3)
      turn(least, 1) = turn(least, 1) + 1.0_wp
      turn(:, 1) = turn(:, 1)/norm2(turn(:, 1))
    end if
    turn(:, 2) = [turn(2, 3)*turn(3, 1) - turn(3, 3)*turn(2, 1), &
                  turn(3, 3)*turn(1, 1) - turn(1, 3)*turn(3, 1), &
                  turn(1, 3)*turn(2, 1) - turn(2, 3)*turn(1, 1)]
  end function frame_of

  !> Moduli of the frame's axes in space.
  pure function turned(moduli, turn) result(space)
    real(wp), intent(in) :: moduli(9, 9), turn(3, 3)
    real(wp) :: space(9, 9), q(9, 9)
    integer(i4) :: k, l, i, j
    do l = 1, 3
      do k = 1, 3
        do j = 1, 3
          do i = 1, 3
            q(3*k - 3 + l, 3*i - 3 + j) = turn(k, i)*turn(l, j)
          end do
        end do
      end do
    end do
    space = matmul(q, matmul(moduli, transpose(q)))
  end function turned

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
