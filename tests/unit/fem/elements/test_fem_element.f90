!> Elements of every formulation, distorted: six zero modes, linear fields with constant
!! micro-rotation, forces of stresses against K u, mass of each field, the reference spectra.
program test_fem_element
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_element, only: fem_shape_type, element_shape, element_stiffness, element_mass, &
    element_stress, element_force, points_at
  use fem_micropolar, only: micropolar_strain, micropolar_stress
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  use fem_shape, only: reference_nodes
  implicit none

  interface
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: wp
      character(len=1), intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev
  end interface

  type(test_type) :: test
  character(len=11), parameter :: names(13) = [character(len=11) :: 'hex8_full', 'hex20', 'hex27', &
    'tet4', 'tet10', 'wedge6', 'hex8/hex8', 'hex20/hex8', 'hex27/hex8', 'hex20/hex20', &
    'tet4/tet4', 'tet10/tet4', 'hex8_bbar']
  integer(i4) :: k

  do k = 1, 12
    call check_element(trim(names(k)))
  end do
  call check_spectrum(1.0_wp, 0.2_wp, 0.01_wp, 0.02_wp, 4.5607017004_wp)
  call check_spectrum(1.0_wp, 0.2_wp, 0.01_wp, 0.0005_wp, 28.2984098493_wp)
  call check_spectrum(0.5_wp, 0.5_wp, 0.2_wp, 0.05_wp, 8.43070354821_wp)
  call test%finish()

contains

  !> Nodes moved about, smoothly so that edges stay quadratic at most.
  pure function distorted(at) result(x)
    real(wp), intent(in) :: at(:, :)
    real(wp) :: x(3, size(at, 2))
    integer(i4) :: a
    do a = 1, size(at, 2)
      associate (p => at(:, a))
        x(:, a) = [0.7_wp, 0.5_wp, 0.9_wp]*p + 0.06_wp*[p(2)*p(3), p(1)*p(3), p(1)*p(2)] &
                  + 0.1_wp*[p(2), p(3), p(1)]
      end associate
    end do
  end function distorted

  subroutine full_matrix(blocks, matrix)
    real(wp), intent(in) :: blocks(:, :, :, :)
    real(wp), intent(out) :: matrix(:, :)
    integer(i4) :: a, b
    do b = 1, size(blocks, 4)
      do a = 1, b
        matrix(3*a - 2:3*a, 3*b - 2:3*b) = blocks(:, :, a, b)
        matrix(3*b - 2:3*b, 3*a - 2:3*a) = transpose(blocks(:, :, a, b))
      end do
    end do
  end subroutine full_matrix

  subroutine check_element(name)
    character(len=*), intent(in) :: name
    type(fem_formulation_type) :: rule
    type(fem_shape_type) :: shape
    real(wp), allocatable :: x(:, :), k(:, :, :, :), matrix(:, :), u(:, :), stress(:, :), f(:, :), &
      one(:), values(:), work(:)
    real(wp) :: moduli(6), scale, h(3, 3), phi(3), sigma(9), couple(9)
    integer(i4) :: a, n, i
    integer :: info

    call make_rule(rule_index(name), rule)
    n = rule%nodes + rule%rotations
    moduli = [1.0_wp, 0.8_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    if (rule%polar) moduli = [1.0_wp, 0.8_wp, 0.5_wp, 0.03_wp, 0.01_wp, 0.06_wp]
    x = distorted(reference_nodes(rule%kind))
    call element_shape(rule%at, x, shape)
    allocate (k(3, 3, n, n), matrix(3*n, 3*n), u(3, n), f(3, n), values(3*n), work(30*n))
    allocate (stress(merge(18, 6, rule%polar), rule%at%n), one(rule%at%n))
    one = 1.0_wp
    call element_stiffness(rule, shape, moduli, one, k)
    call full_matrix(k, matrix)
    scale = max_abs(matrix)
    ! forces of the stresses of any state are K u
    do a = 1, n
      u(:, a) = [sin(1.3_wp*a), cos(2.1_wp*a), sin(0.7_wp*a + 1.0_wp)]
    end do
    call element_stress(rule, shape, u, moduli, stress)
    call element_force(rule, shape, stress, one, f)
    call test%check(name//': forces', max_abs(matmul(matrix, [u]) - [f]) < 1.0e-13_wp*scale*n)
    ! a linear displacement with constant micro-rotation
    h = reshape([1.0e-3_wp, 5.0e-4_wp, -6.0e-4_wp, 3.0e-4_wp, -7.0e-4_wp, 1.0e-4_wp, -2.0e-4_wp, &
                 4.0e-4_wp, 8.0e-4_wp], [3, 3])
    phi = [2.0e-4_wp, -5.0e-4_wp, 7.0e-4_wp]
    if (.not. rule%polar) phi = 0.5_wp*[h(3, 2) - h(2, 3), h(1, 3) - h(3, 1), h(2, 1) - h(1, 2)]
    u(:, :rule%nodes) = matmul(h, x)
    do a = rule%nodes + 1, n
      u(:, a) = phi
    end do
    call element_stress(rule, shape, u, moduli, stress)
    call micropolar_stress(moduli, micropolar_strain(h, phi), 0.0_wp*h, sigma, couple)
    scale = max_abs(sigma)
    if (rule%polar) then
      call test%check(name//': linear field', max_abs(stress(:9, :) - spread(sigma, 2, &
        rule%at%n)) < 1.0e-13_wp*scale .and. max_abs(stress(10:, :)) < 1.0e-13_wp*scale)
    else
      call test%check(name//': linear field', max_abs(stress - &
        spread(sigma([1, 5, 9, 2, 6, 7]), 2, rule%at%n)) < 1.0e-13_wp*scale)
    end if
    call check_mass(name, rule, x)
    ! six zero modes, in the volume's weight
    scale = max_abs(matrix)
    call dsyev('N', 'U', 3*n, matrix, 3*n, values, work, size(work), info)
    i = int(count(abs(values) < 1.0e-12_wp*scale*n), i4)
    call test%check_close(name//': zero modes', real(i, wp), 6.0_wp, 0.5_wp)
    call test%check(name//': no negative mode', values(1) > -1.0e-12_wp*scale*n)
  end subroutine check_element

  !> Mass of the fields of an element with nodes x; positive lumping is tested in the body.
  subroutine check_mass(name, rule, x)
    character(len=*), intent(in) :: name
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :)
    type(fem_shape_type) :: shape
    real(wp) :: mass(rule%nodes + rule%rotations, rule%nodes + rule%rotations), whole

    call element_shape(rule%mass_at, x, shape)
    call element_mass(rule, shape, 3.0_wp, 0.5_wp, mass)
    whole = 3.0_wp*sum(shape%weight)
    call test%check_close(name//': mass', sum(mass(:rule%nodes, :rule%nodes))/whole, 1.0_wp, &
                          1.0e-13_wp)
    if (rule%polar) call test%check_close(name//': micro-inertia', &
      sum(mass(rule%nodes + 1:, rule%nodes + 1:))/whole, 0.5_wp, 1.0e-13_wp)
  end subroutine check_mass

  !> Largest frequency of the hex8/hex8 cube of side h with lumped masses
  !! (an independent eigenvalue solution).
  subroutine check_spectrum(h, kappa, gamma, inertia, expected)
    real(wp), intent(in) :: h, kappa, gamma, inertia, expected
    type(fem_formulation_type) :: rule
    type(fem_shape_type) :: shape
    real(wp) :: k(3, 3, 16, 16), matrix(48, 48), values(48), work(1000), m(16), moduli(6)
    real(wp) :: mass(16, 16), one(8), each(48)
    integer(i4) :: i, j
    integer :: info

    call make_rule(rule_index('hex8/hex8'), rule)
    call element_shape(rule%at, 0.5_wp*h*reference_nodes(rule%kind), shape)
    moduli = [0.3_wp/(1.3_wp*0.4_wp), 1.0_wp/2.6_wp - 0.5_wp*kappa, kappa, 0.0_wp, 0.0_wp, gamma]
    one = 1.0_wp
    call element_stiffness(rule, shape, moduli, one, k)
    call full_matrix(k, matrix)
    call element_mass(rule, shape, 1.0_wp, inertia, mass)
    m = sum(mass, 2)
    each = reshape(spread(m, 1, 3), [48])
    do j = 1, 48
      do i = 1, 48
        matrix(i, j) = matrix(i, j)/sqrt(each(i)*each(j))
      end do
    end do
    call dsyev('N', 'U', 48, matrix, 48, values, work, size(work), info)
    call test%check_close('largest frequency', sqrt(values(48))/expected, 1.0_wp, 1.0e-8_wp)
  end subroutine check_spectrum
end program test_fem_element
