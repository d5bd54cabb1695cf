!> Affine moduli from the contact list (theory: "From grains to continuum parameters"): an upper
!! bound of what a pack has.
!!
!! With l the branch, s the arm from its middle to the contact point, S = [s]x and
!! K = kn n n + ks (1 - n n): C_ijkl = 1/V sum l_i l_k K_jl, B_ijkl = 1/V sum l_i l_k (S' K S)_jl,
!! D_ijkl = -1/V sum l_i l_k (K S)_jl. Rows of the 9 x 9 forms are ij = xx xy xz yx yy yz zx zy zz.
module talus_moduli
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: dyad
  use talus_sample, only: sample_type
  implicit none
  private
  public :: affine_moduli, isotropic_part, isotropic_type

  !> C_ijkl = lambda d_ij d_kl + (mu + kappa) d_ik d_jl + mu d_il d_jk, B with alpha, gamma, beta.
  type :: isotropic_type
    real(wp) :: lambda = 0.0_wp, mu = 0.0_wp, kappa = 0.0_wp  !! [Pa]
    real(wp) :: alpha = 0.0_wp, beta = 0.0_wp, gamma = 0.0_wp !! [N]
    real(wp) :: bulk = 0.0_wp, shear = 0.0_wp                 !! lambda + 2G/3, G = mu+kappa/2 [Pa]
    real(wp) :: coupling_number = 0.0_wp  !! N^2 = kappa/(2(mu + kappa)) [-]
    real(wp) :: bending_length = 0.0_wp   !! l_b = sqrt(gamma/(2(2 mu + kappa))) [m]
  end type isotropic_type

contains

  !> The three tensors as 9 x 9 matrices [Pa], [N], [N/m]; sliding contacts have ks = 0.
  pure subroutine affine_moduli(sample, branch, volume, c9, b9, d9)
    type(sample_type), intent(in) :: sample
    real(wp), intent(in) :: branch(:, :)  !! (3, contacts) inside the region [m]
    real(wp), intent(in) :: volume        !! [m^3]
    real(wp), intent(out) :: c9(9, 9), b9(9, 9), d9(9, 9)
    real(wp) :: k(3, 3), s(3, 3), l(3), n(3), ll, ks
    integer(i4) :: c

    c9 = 0.0_wp
    b9 = 0.0_wp
    d9 = 0.0_wp
    do c = 1, sample%contacts
      l = sample%far_end(c) - sample%start(:, c)
      ll = sum(l**2)
      if (.not. ll > 0.0_wp) cycle
      n = sample%normal(:, c)
      ks = merge(0.0_wp, sample%stiffness(2, c), sample%sliding(c))
      k = (sample%stiffness(1, c) - ks)*dyad(n, n)
      k(1, 1) = k(1, 1) + ks
      k(2, 2) = k(2, 2) + ks
      k(3, 3) = k(3, 3) + ks
      s = arm_matrix(sample%point(:, c) - 0.5_wp*(sample%start(:, c) &
                                                  + sample%far_end(c)))
      ll = dot_product(branch(:, c), l)/ll/volume
      call add(c9, ll, l, k)
      call add(b9, ll, l, matmul(transpose(s), matmul(k, s)))
      call add(d9, -ll, l, matmul(k, s))
    end do
  end subroutine affine_moduli

  !> t_(ij)(kl) += w l_i l_k m_jl
  pure subroutine add(t, w, l, m)
    real(wp), intent(inout) :: t(9, 9)
    real(wp), intent(in) :: w, l(3), m(3, 3)
    integer(i4) :: i, k
    do k = 1, 3
      do i = 1, 3
        t(3*i - 2:3*i, 3*k - 2:3*k) = t(3*i - 2:3*i, 3*k - 2:3*k) + w*l(i)*l(k)*m
      end do
    end do
  end subroutine add

  !> [s]x
  pure function arm_matrix(s) result(m)
    real(wp), intent(in) :: s(3)
    real(wp) :: m(3, 3)
    m(:, 1) = [0.0_wp, s(3), -s(2)]
    m(:, 2) = [-s(3), 0.0_wp, s(1)]
    m(:, 3) = [s(2), -s(1), 0.0_wp]
  end function arm_matrix

  !> Best isotropic tensors (least squares over all components).
  pure function isotropic_part(c9, b9) result(iso)
    real(wp), intent(in) :: c9(9, 9), b9(9, 9)
    type(isotropic_type) :: iso
    real(wp) :: p(3)

    p = projected(c9)
    iso%lambda = p(1)
    iso%mu = p(3)
    iso%kappa = p(2) - p(3)
    iso%shear = 0.5_wp*(p(2) + p(3))
    iso%bulk = iso%lambda + 2.0_wp*iso%shear/3.0_wp
    p = projected(b9)
    iso%alpha = p(1)
    iso%gamma = p(2)
    iso%beta = p(3)
    if (iso%mu + iso%kappa > 0.0_wp) iso%coupling_number = iso%kappa/(2.0_wp*(iso%mu + iso%kappa))
    if (iso%shear > 0.0_wp) iso%bending_length = sqrt(max(0.0_wp, iso%gamma)/(4.0_wp*iso%shear))
  end function isotropic_part

  !> Factors of d_ij d_kl, d_ik d_jl, d_il d_jk.
  pure function projected(t) result(p)
    real(wp), intent(in) :: t(9, 9)
    real(wp) :: p(3), trace(3)
    integer(i4) :: i, j
    trace = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        trace(1) = trace(1) + t(4*i - 3, 4*j - 3)
        trace(2) = trace(2) + t(3*i + j - 3, 3*i + j - 3)
        trace(3) = trace(3) + t(3*i + j - 3, 3*j + i - 3)
      end do
    end do
    p = (trace - sum(trace)/5.0_wp)/6.0_wp
  end function projected
end module talus_moduli
