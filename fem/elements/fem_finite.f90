!> An element at finite strain, total Lagrangian. Its stored energy is the sum of w W(E) over the
!! points, E Green's strain of F, or with B-bar of F-bar = (mean J / J)^(1/3) F with the mean of J
!! over the element: forces and tangent are first and second derivatives of it, so that the tangent
!! is symmetric and rigid motions do no work (theory: finite strain).
!!
!! With g_a = grad N_a, b_a = F^-T g_a, their mean b'_a weighted by J, s^2 = (mean J / J)^(2/3) and
!! beta_a = (b'_a - b_a)/3: dE = s^2 [sym(F' du_a g_a') + (beta_a . du_a) C].
!! eq. F.22
module fem_finite
  use talus_kinds, only: wp, i4
  use fem_element, only: fem_shape_type
  use fem_law_finite, only: fem_law_finite_type, at_green, at_ratio
  use fem_law, only: at_stored
  use fem_rules, only: fem_formulation_type
  use fem_strain, only: add_product
  use fem_voigt, only: twice
  implicit none
  private
  public :: fem_deformation_type, deform, finite_force, finite_tangent

  !> How an element is deformed at its points; kept between elements of one rule.
  type :: fem_deformation_type
    real(wp), allocatable :: f(:, :, :)        !! (3, 3, n) F
    real(wp), allocatable :: green(:, :)       !! (6, n) E of F, engineering shears
    real(wp), allocatable :: ratio(:)          !! (n) J
    real(wp), allocatable :: square(:)         !! (n) s^2
    real(wp), allocatable :: spatial(:, :, :)  !! (3, nodes, n) b [1/m]
    real(wp), allocatable :: beta(:, :, :)     !! (3, nodes, n) [1/m], zero without B-bar
    real(wp), allocatable :: mean(:, :)        !! (3, nodes) b' [1/m]
    real(wp), allocatable :: share(:)          !! (n) w J over their sum
  end type fem_deformation_type

contains

  !> Deformation for displacements u(3, nodes) [m]. `bad` is the first point with J <= 0, 0 if there
  !! is none; the other results are undefined then.
  pure subroutine deform(rule, shape, u, d, bad)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    real(wp), intent(in) :: u(:, :)
    type(fem_deformation_type), intent(inout) :: d
    integer(i4), intent(out) :: bad
    real(wp) :: h(3, 3), inverse(3, 3), mean_ratio
    integer(i4) :: q, i

    call make_room(rule, d)
    bad = 0
    do q = 1, rule%at%n
      h = matmul(u, transpose(shape%u(:, :, q)))
      d%f(:, :, q) = h
      do i = 1, 3
        d%f(i, i, q) = d%f(i, i, q) + 1.0_wp
      end do
      d%green(:3, q) = [h(1, 1), h(2, 2), h(3, 3)] + 0.5_wp*sum(h**2, 1)
      d%green(4:, q) = [h(1, 2) + h(2, 1) + sum(h(:, 1)*h(:, 2)), &
                        h(2, 3) + h(3, 2) + sum(h(:, 2)*h(:, 3)), &
                        h(3, 1) + h(1, 3) + sum(h(:, 3)*h(:, 1))]
      call cofactors(d%f(:, :, q), inverse, d%ratio(q))
      if (.not. d%ratio(q) > 0.0_wp .and. bad == 0) bad = q
      d%spatial(:, :, q) = matmul(inverse, shape%u(:, :, q))/d%ratio(q)
    end do
    if (.not. rule%bbar .or. bad > 0) return
    d%share = shape%weight*d%ratio
    mean_ratio = sum(d%share)/sum(shape%weight)
    d%share = d%share/sum(d%share)
    d%mean = 0.0_wp
    do q = 1, rule%at%n
      d%mean = d%mean + d%share(q)*d%spatial(:, :, q)
    end do
    do q = 1, rule%at%n
      d%square(q) = (mean_ratio/d%ratio(q))**(2.0_wp/3.0_wp)
      d%beta(:, :, q) = (d%mean - d%spatial(:, :, q))/3.0_wp
    end do
  end subroutine deform

  !> Allocate one rule.
  pure subroutine make_room(rule, d)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_deformation_type), intent(inout) :: d
    integer(i4) :: m, n
    m = rule%nodes
    n = rule%at%n
    if (allocated(d%f)) then
      if (size(d%f, 3) == n .and. size(d%mean, 2) == m) then
        d%square = 1.0_wp
        d%beta = 0.0_wp
        return
      end if
      deallocate (d%f, d%green, d%ratio, d%square, d%spatial, d%beta, d%mean, d%share)
    end if
    allocate (d%f(3, 3, n), d%green(6, n), d%ratio(n), d%share(n), d%spatial(3, m, n), d%mean(3, m))
    allocate (d%beta(3, m, n), source=0.0_wp)
    allocate (d%square(n), source=1.0_wp)
  end subroutine make_room

  !> Cofactors of F, which are J F^-T, and J.
  pure subroutine cofactors(f, cofactor, ratio)
    real(wp), intent(in) :: f(3, 3)
    real(wp), intent(out) :: cofactor(3, 3), ratio
    integer(i4) :: j, k, l
    do j = 1, 3
      k = modulo(j, 3) + 1
      l = modulo(k, 3) + 1
      cofactor(1, j) = f(2, k)*f(3, l) - f(3, k)*f(2, l)
      cofactor(2, j) = f(3, k)*f(1, l) - f(1, k)*f(3, l)
      cofactor(3, j) = f(1, k)*f(2, l) - f(2, k)*f(1, l)
    end do
    ratio = dot_product(f(:, 1), cofactor(:, 1))
  end subroutine cofactors

  !> E of F-bar at point q, engineering shears.
  pure function strain_at(d, q) result(green)
    type(fem_deformation_type), intent(in) :: d
    integer(i4), intent(in) :: q
    real(wp) :: green(6)
    green = d%square(q)*d%green(:, q)
    green(:3) = green(:3) + 0.5_wp*(d%square(q) - 1.0_wp)
  end function strain_at

  !> C of F at point q as six components.
  pure function c_at(d, q) result(c)
    type(fem_deformation_type), intent(in) :: d
    integer(i4), intent(in) :: q
    real(wp) :: c(6)
    c = d%green(:, q)
    c(:3) = 1.0_wp + 2.0_wp*c(:3)
  end function c_at

  !> Forces (3, nodes) [N] and, at the points, Cauchy's stress [Pa] and the state. `bad` is the
  !! first point without one.
  pure subroutine finite_force(law, shape, d, weight, stress, state, force, bad)
    class(fem_law_finite_type), intent(in) :: law
    type(fem_shape_type), intent(in) :: shape
    type(fem_deformation_type), intent(in) :: d
    real(wp), intent(in) :: weight(:)        !! (n) volume of the reference [m^3]
    real(wp), intent(inout) :: stress(:, :)  !! (6, n)
    real(wp), intent(inout) :: state(:, :)
    real(wp), intent(out) :: force(:, :)
    integer(i4), intent(out) :: bad
    real(wp) :: energy, second(6), unused(6, 6), ratio, s(3, 3), fs(3, 3), cauchy(3, 3)
    logical :: good
    integer(i4) :: q

    force = 0.0_wp
    bad = 0
    do q = 1, size(weight)
      call law%stored_energy(strain_at(d, q), energy, second, unused, ratio, good)
      if (.not. good) then
        if (bad == 0) bad = q
        cycle
      end if
      s = reshape(second([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3])
      fs = (weight(q)*d%square(q))*matmul(d%f(:, :, q), s)
      force = force + matmul(fs, shape%u(:, :, q)) + weight(q)*d%square(q) &
        *sum(twice*second*c_at(d, q))*d%beta(:, :, q)
      cauchy = matmul(fs, transpose(d%f(:, :, q)))/(weight(q)*ratio)
      stress(:, q) = [cauchy(1, 1), cauchy(2, 2), cauchy(3, 3), cauchy(1, 2), cauchy(2, 3), &
                      cauchy(3, 1)]
      state(:, q) = 0.0_wp
      state(at_stored, q) = energy
      state(at_green:at_green + 5, q) = strain_at(d, q)
      state(at_ratio, q) = ratio
    end do
  end subroutine finite_force

  !> Tangent (3 nodes, 3 nodes) [N/m] at a deformation for which there are forces.
  pure subroutine finite_tangent(law, rule, shape, d, weight, k)
    class(fem_law_finite_type), intent(in) :: law
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    type(fem_deformation_type), intent(in) :: d
    real(wp), intent(in) :: weight(:)
    real(wp), intent(out) :: k(:, :)
    real(wp) :: energy, second(6), modulus(6, 6), ratio, b(size(k, 1), 6), volume, pull
    logical :: good
    integer(i4) :: q

    k = 0.0_wp
    volume = 0.0_wp
    do q = 1, size(weight)
      call law%stored_energy(strain_at(d, q), energy, second, modulus, ratio, good)
      call strain_rows(shape, d, q, b)
      call add_product(int(size(k, 1), i4), b, modulus, weight(q), k)
      call add_geometric(rule, shape, d, q, weight(q)*d%square(q)*second, k)
      if (.not. rule%bbar) cycle
      pull = weight(q)*d%square(q)*sum(twice*second*c_at(d, q))/3.0_wp
      call add_crossed(d%spatial(:, :, q), pull, k)
      volume = volume + pull
    end do
    if (rule%bbar) call add_mean(d, volume, k)
  end subroutine finite_tangent

  !> dE by the displacements, transposed: (3 nodes, 6).
  pure subroutine strain_rows(shape, d, q, b)
    type(fem_shape_type), intent(in) :: shape
    type(fem_deformation_type), intent(in) :: d
    integer(i4), intent(in) :: q
    real(wp), intent(out) :: b(:, :)
    real(wp) :: c(6)
    integer(i4) :: a, i, r
    c = c_at(d, q)
    c(4:) = 2.0_wp*c(4:)
    do a = 1, size(shape%u, 2)
      do i = 1, 3
        r = 3*a - 3 + i
        associate (f => d%f(i, :, q), g => shape%u(:, a, q))
          b(r, :) = d%square(q)*[f(1)*g(1), f(2)*g(2), f(3)*g(3), f(1)*g(2) + f(2)*g(1), &
            f(2)*g(3) + f(3)*g(2), f(3)*g(1) + f(1)*g(3)]
        end associate
        b(r, :) = b(r, :) + (d%square(q)*d%beta(i, a, q))*c
      end do
    end do
  end subroutine strain_rows

  !> S : d^2 E without the second derivatives of s: with S times weight and s^2, s_a = F S g_a,
  !! (g_a . S g_b) 1 + 2 (beta_a s_b' + s_a beta_b') + 2 (S : C) beta_a beta_b'.
  pure subroutine add_geometric(rule, shape, d, q, second, k)
    type(fem_formulation_type), intent(in) :: rule
    type(fem_shape_type), intent(in) :: shape
    type(fem_deformation_type), intent(in) :: d
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: second(6)
    real(wp), intent(inout) :: k(:, :)
    real(wp) :: sg(3, rule%nodes), fsg(3, rule%nodes), along, pull
    integer(i4) :: a, b, i, j
    sg = matmul(reshape(second([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3]), shape%u(:, :, q))
    do b = 1, rule%nodes
      do a = 1, rule%nodes
        along = dot_product(shape%u(:, a, q), sg(:, b))
        do i = 1, 3
          k(3*a - 3 + i, 3*b - 3 + i) = k(3*a - 3 + i, 3*b - 3 + i) + along
        end do
      end do
    end do
    if (.not. rule%bbar) return
    fsg = 2.0_wp*matmul(d%f(:, :, q), sg)
    pull = 2.0_wp*sum(twice*second*c_at(d, q))
    do b = 1, rule%nodes
      do j = 1, 3
        do a = 1, rule%nodes
          i = 3*a - 2
          k(i:i + 2, 3*b - 3 + j) = k(i:i + 2, 3*b - 3 + j) + d%beta(j, b, q)*fsg(:, a) &
            + (fsg(j, b) + pull*d%beta(j, b, q))*d%beta(:, a, q)
        end do
      end do
    end do
  end subroutine add_geometric

  !> Minus the second derivative of ln J, times `pull`: blocks b_b b_a'.
  pure subroutine add_crossed(spatial, pull, k)
    real(wp), intent(in) :: spatial(:, :), pull
    real(wp), intent(inout) :: k(:, :)
    integer(i4) :: a, b, i, j
    do b = 1, size(spatial, 2)
      do j = 1, 3
        do a = 1, size(spatial, 2)
          i = 3*a - 2
          k(i:i + 2, 3*b - 3 + j) = k(i:i + 2, 3*b - 3 + j) + pull*spatial(j, a)*spatial(:, b)
        end do
      end do
    end do
  end subroutine add_crossed

  !> The second derivative of the logarithm of the mean of J, times `pull`: the mean over w J of
  !! b_a b_b' - b_b b_a', less b'_a b'_b'.
  pure subroutine add_mean(d, pull, k)
    type(fem_deformation_type), intent(in) :: d
    real(wp), intent(in) :: pull
    real(wp), intent(inout) :: k(:, :)
    integer(i4) :: a, b, i, j, q
    do b = 1, size(d%mean, 2)
      do j = 1, 3
        do a = 1, size(d%mean, 2)
          i = 3*a - 2
          k(i:i + 2, 3*b - 3 + j) = k(i:i + 2, 3*b - 3 + j) - pull*d%mean(j, b)*d%mean(:, a)
          do q = 1, size(d%share)
            k(i:i + 2, 3*b - 3 + j) = k(i:i + 2, 3*b - 3 + j) + pull*d%share(q) &
              *(d%spatial(j, b, q)*d%spatial(:, a, q) - d%spatial(j, a, q)*d%spatial(:, b, q))
          end do
        end do
      end do
    end do
  end subroutine add_mean
end module fem_finite
