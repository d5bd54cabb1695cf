!> Dashpots of an absorbing face of a micropolar solid: the sum over the nodes is, per area, the
!! density times the speed of each plane wave along the normal, whatever the face's inclination.
program test_fem_absorbing
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_absorbing, only: absorb
  use fem_damping, only: fem_damping_type
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: quad4
  use fem_types, only: fem_mesh_type, fem_group_type
  implicit none
  type(test_type) :: test
  ! lambda, mu, kappa [Pa], alpha, beta, gamma [N]; density [kg/m^3], micro-inertia [m^2]
  real(wp), parameter :: moduli(6) = [3.0_wp, 2.0_wp, 1.4_wp, 0.3_wp, 0.2_wp, 0.9_wp]
  real(wp), parameter :: density = 1.7_wp, inertia = 0.6_wp
  real(wp), parameter :: area = 6.0_wp, n(3) = [0.6_wp, 0.0_wp, 0.8_wp]
  type(fem_mesh_type) :: mesh
  type(fem_dofs_type) :: dofs
  type(fem_elastic_type) :: elastic
  type(fem_group_type) :: group
  type(fem_damping_type) :: damping
  real(wp) :: outer(3, 3), one(3, 3)
  integer(i4) :: lost, rule, k

  ! a rectangle of 2 by 3 m whose normal is n, on an element with rotations at all nodes
  mesh%x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 3.0_wp, 0.0_wp, -1.6_wp, 3.0_wp, 1.2_wp, &
                    -1.6_wp, 0.0_wp, 1.2_wp], [3, 4])
  dofs%phi = [5_i4, 6_i4, 7_i4, 8_i4]
  call elastic%start(1)
  call elastic%use_rule('hex8/hex8', rule)
  elastic%rule_of = rule
  elastic%moduli(:, 1) = moduli
  elastic%density = density
  elastic%inertia = inertia
  group%element = [1_i4]
  group%facet_kind = [quad4]
  group%facet = reshape([1_i4, 2_i4, 3_i4, 4_i4], [4, 1])
  call absorb(mesh, dofs, elastic, group, damping, lost)
  call test%check('the face has its element', lost == 0)

  one = 0.0_wp
  do k = 1, 3
    one(k, k) = 1.0_wp
    outer(:, k) = n*n(k)
  end do
  ! low frequencies: rotations follow, and shear has mu + kappa/2 of the static solid
  call check('translations', 1, sqrt(density*(moduli(1) + 2.0_wp*moduli(2) + moduli(3))), &
             sqrt(density*(moduli(2) + 0.5_wp*moduli(3))))
  ! high frequencies: couple stresses alone
  call check('rotations', 5, sqrt(density*inertia*sum(moduli(4:6))), &
             sqrt(density*inertia*moduli(6)))
  call test%finish()

contains

  !> Dashpots of the blocks from `first` on: `press` along the normal and `shear` across, per area.
  subroutine check(name, first, press, shear)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: first
    real(wp), intent(in) :: press, shear
    real(wp) :: total(3, 3)
    integer(i4) :: b
    total = 0.0_wp
    do b = 1, damping%n
      if (damping%block(b) >= first .and. damping%block(b) < first + 4) &
        total = total + damping%dashpot(:, :, b)
    end do
    call test%check_all_close('dashpots of '//name, total, &
                              area*(press*outer + shear*(one - outer)), 1.0e-13_wp*area*press)
  end subroutine check
end program test_fem_absorbing
