!> Micropolar elements whose law has a state: strain and curvature at the points, forces, tangent.
module fem_polar_element
  use talus_kinds, only: wp, i4
  use fem_element, only: fem_shape_type, element_force, polar_strain
  use fem_law_polar, only: fem_law_polar_type
  use fem_polar, only: polar_size
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: polar_answer, polar_tangent

contains

  !> Stress, state and tangent of all points for displacements and micro-rotations since the
  !! accepted state, and the forces; `bad` is the first point without a state, 0 if there is none.
  pure subroutine polar_answer(law, rule, shape, moved, factor, stress, state, tangent, force, bad)
    class(fem_law_polar_type), intent(in) :: law
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: moved(:, :)            !! (3, blocks) [m], [rad]
    real(wp), intent(in) :: factor(:)              !! weight of each point [-]
    real(wp), intent(inout) :: stress(:, :)        !! (18, points) [Pa], [N/m]
    real(wp), intent(inout) :: state(:, :)         !! (states, points)
    real(wp), intent(inout) :: tangent(:, :, :)    !! (18, 18, points)
    real(wp), intent(out) :: force(:, :)           !! (3, blocks) [N], [N m]
    integer(i4), intent(out) :: bad
    real(wp) :: gamma(9), c(3, 3)
    logical :: good
    integer(i4) :: q
    bad = 0
    do q = 1, rule%at%n
      call polar_strain(rule, shape, moved, q, gamma, c)
      call law%polar_update([gamma, reshape(c, [9])], stress(:, q), state(:, q), &
                            tangent(:, :, q), good)
      if (.not. good .and. bad == 0) bad = q
    end do
    call element_force(rule, shape, stress, factor, force)
  end subroutine polar_answer

  !> Stiffness (3 blocks, 3 blocks) from the tangents of the points [N/m, N, N m].
  pure subroutine polar_tangent(rule, shape, tangent, weight, k)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: tangent(:, :, :)  !! (18, 18, points)
    real(wp), intent(in) :: weight(:)         !! [m^3]
    real(wp), intent(out) :: k(:, :)
    real(wp), dimension(size(k, 1), polar_size) :: b, c
    integer(i4) :: q, j, r, s
    k = 0.0_wp
    do q = 1, rule%at%n
      call polar_matrix(rule, shape, q, b)
      c = 0.0_wp  ! w B' D
      do r = 1, polar_size
        do s = 1, polar_size
          c(:, r) = c(:, r) + weight(q)*tangent(s, r, q)*b(:, s)
        end do
      end do
      do j = 1, size(k, 2)  ! three to five components of a row are not zero
        do r = 1, polar_size
          if (abs(b(j, r)) > 0.0_wp) k(:, j) = k(:, j) + b(j, r)*c(:, r)
        end do
      end do
    end do
  end subroutine polar_tangent

  !> B' of point q (3 blocks, 18): gamma_kl = u_l,k + e_lkm phi_m, then phi_l,k.
  pure subroutine polar_matrix(rule, shape, q, b)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    integer(i4), intent(in) :: q
    real(wp), intent(out) :: b(:, :)
    integer(i4) :: a, k, l, i
    b = 0.0_wp
    do a = 1, rule%nodes
      do k = 1, 3
        do l = 1, 3
          b(3*a - 3 + l, 3*k - 3 + l) = shape%u(k, a, q)
        end do
      end do
    end do
    do a = 1, rule%rotations
      i = 3*(rule%nodes + a) - 3
      associate (n => rule%at%phi(a, q))
        b(i + 3, 2) = -n   ! 12
        b(i + 2, 3) = n    ! 13
        b(i + 3, 4) = n    ! 21
        b(i + 1, 6) = -n   ! 23
        b(i + 2, 7) = -n   ! 31
        b(i + 1, 8) = n    ! 32
      end associate
      do k = 1, 3
        do l = 1, 3
          b(i + l, 9 + 3*k - 3 + l) = shape%phi(k, a, q)
        end do
      end do
    end do
  end subroutine polar_matrix
end module fem_polar_element
