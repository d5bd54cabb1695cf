!> Affine moduli of a micromorphic solid from the contact list (theory: "Measures, Micromorphic
!! moduli"): an upper bound, as the moduli of talus_moduli are.
!!
!! Centres of grains follow u, points of a grain at xi from its centre u + phi xi. With l the branch
!! and s the arm from its middle to the contact point a contact slides by
!! l_i (u_j,i - phi_ji) + l_i s_k phi_jk,i; with C and K of talus_moduli the energy is
!! C/2 of gamma_ij = u_j,i - phi_ji, and 1/2 sum K_jq l_i s_k phi_jk,i l_p s_r phi_qr,p /V. The even
!! strain of the grains themselves is that of their material, times the solid fraction.
!! In the strains of the law, gamma_ij = 2 E_ij - e_ji and sym phi = sym e - E.
module talus_micro_moduli
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: dyad
  use talus_moduli, only: isotropic_type
  use talus_sample, only: sample_type
  implicit none
  private
  public :: micro_type, micro_moduli, gradient_moduli, gradient_basis

  integer(i4), parameter :: count_taus = 11
  integer(i4), parameter :: size6 = 729  !! components of a tensor of rank 6

  !> Pairs of the six indices K L M N P Q = 1 to 6 that each delta joins, and the tau it belongs to.
  integer(i4), parameter :: terms = 15
  integer(i4), parameter :: joined(6, terms) = reshape([ &
    1, 2, 3, 4, 5, 6, 1, 6, 2, 3, 4, 5, 1, 2, 3, 5, 4, 6, 1, 3, 2, 6, 4, 5, 1, 2, 3, 6, 4, 5, &
    1, 4, 2, 3, 5, 6, 1, 3, 2, 4, 5, 6, 1, 5, 2, 3, 4, 6, 1, 3, 2, 5, 4, 6, 1, 4, 2, 5, 3, 6, &
    1, 5, 2, 6, 3, 4, 1, 6, 2, 4, 3, 5, 1, 4, 2, 6, 3, 5, 1, 5, 2, 4, 3, 6, 1, 6, 2, 5, 3, 4], &
                                                       [6, terms])
  integer(i4), parameter :: owner(terms) = [1, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11]

  !> The 18 moduli of the quadratic form.
  type :: micro_type
    real(wp) :: lambda = 0.0_wp, mu = 0.0_wp, eta = 0.0_wp, tau = 0.0_wp  !! [Pa]
    real(wp) :: kappa = 0.0_wp, nu = 0.0_wp, sigma = 0.0_wp              !! [Pa]
    real(wp) :: taus(count_taus) = 0.0_wp                                !! [N]
  end type micro_type

contains

  !> Moduli of the strains from the isotropic part of C and the moduli of the grains' material.
  pure function micro_moduli(iso, solid_fraction, grain_lambda, grain_mu, taus) result(m)
    type(isotropic_type), intent(in) :: iso
    real(wp), intent(in) :: solid_fraction          !! [-]
    real(wp), intent(in) :: grain_lambda, grain_mu  !! of the material [Pa]
    real(wp), intent(in) :: taus(count_taus)        !! [N]
    type(micro_type) :: m
    real(wp) :: lambda, mu
    lambda = solid_fraction*grain_lambda
    mu = solid_fraction*grain_mu
    m%lambda = 4.0_wp*iso%lambda + lambda
    m%mu = 2.0_wp*(2.0_wp*iso%mu + iso%kappa) + mu
    m%eta = -iso%lambda
    m%tau = -2.0_wp*iso%lambda - lambda
    m%sigma = -(2.0_wp*iso%mu + iso%kappa) - mu
    m%kappa = -iso%mu
    m%nu = -iso%mu - iso%kappa
    m%taus = taus
  end function micro_moduli

  !> tau_1 to tau_11, the isotropic part of K_KN s_L s_P l_M l_Q over the volume, by least squares,
  !! in N.
  pure function gradient_moduli(sample, branch, volume) result(taus)
    type(sample_type), intent(in) :: sample
    real(wp), intent(in) :: branch(:, :)  !! (3, contacts) inside the region [m]
    real(wp), intent(in) :: volume        !! [m^3]
    real(wp) :: taus(count_taus)
    real(wp) :: sums(count_taus), l(3), s(3), n(3), k(3, 3), ks, length, weight
    integer(i4) :: c, i

    sums = 0.0_wp
    do c = 1, sample%contacts
      l = sample%far_end(c) - sample%start(:, c)
      length = sum(l**2)
      if (.not. length > 0.0_wp) cycle
      n = sample%normal(:, c)
      ks = merge(0.0_wp, sample%stiffness(2, c), sample%sliding(c))
      k = (sample%stiffness(1, c) - ks)*dyad(n, n)
      do i = 1, 3
        k(i, i) = k(i, i) + ks
      end do
      s = sample%point(:, c) - 0.5_wp*(sample%start(:, c) + sample%far_end(c))
      weight = dot_product(branch(:, c), l)/length/volume
      sums = sums + weight*invariants(k, s, l)
    end do
    taus = solved(sums)
  end function gradient_moduli

  !> Full contractions of K_KN s_L s_P l_M l_Q with the tensors of tau_1 to tau_11.
  pure function invariants(k, s, l) result(t)
    real(wp), intent(in) :: k(3, 3), s(3), l(3)
    real(wp) :: t(count_taus), sl, skl, sks, lkl, trace
    sl = dot_product(s, l)
    skl = dot_product(s, matmul(k, l))
    sks = dot_product(s, matmul(k, s))
    lkl = dot_product(l, matmul(k, l))
    trace = k(1, 1) + k(2, 2) + k(3, 3)
    t([1, 2, 5, 8]) = 2.0_wp*skl*sl
    t([3, 10]) = sks*sum(l**2)
    t([4, 9]) = trace*sl**2
    t([6, 11]) = lkl*sum(s**2)
    t(7) = trace*sum(s**2)*sum(l**2)
  end function invariants

  !> The tensors that belong to tau_1 to tau_11, index K running fastest.
  pure function gradient_basis() result(basis)
    real(wp), allocatable :: basis(:, :)
    integer(i4) :: place, rest, i, term, at(6)
    allocate (basis(size6, count_taus), source=0.0_wp)
    do place = 1, size6
      rest = place - 1
      do i = 1, 6
        at(i) = mod(rest, 3)
        rest = rest/3
      end do
      do term = 1, terms
        if (any(at(joined(1:5:2, term)) /= at(joined(2:6:2, term)))) cycle
        basis(place, owner(term)) = basis(place, owner(term)) + 1.0_wp
      end do
    end do
  end function gradient_basis

  !> Factors of the tensors from the contractions with them: Gauss and Jordan with pivots.
  pure function solved(sums) result(taus)
    real(wp), intent(in) :: sums(count_taus)
    real(wp) :: taus(count_taus), a(count_taus, count_taus + 1), row(count_taus + 1)
    real(wp), allocatable :: basis(:, :)
    integer(i4) :: i, j, pivot

    allocate (basis, source=gradient_basis())
    a(:, :count_taus) = matmul(transpose(basis), basis)
    a(:, count_taus + 1) = sums
    do i = 1, count_taus
      pivot = i - 1 + maxloc(abs(a(i:, i)), 1)
      row = a(pivot, :)
      a(pivot, :) = a(i, :)
      a(i, :) = row/row(i)
      do j = 1, count_taus
        if (j /= i) a(j, :) = a(j, :) - a(j, i)*a(i, :)
      end do
    end do
    taus = a(:, count_taus + 1)
  end function solved
end module talus_micro_moduli
