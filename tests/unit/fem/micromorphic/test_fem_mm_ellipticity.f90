!> Loss of ellipticity against the critical hardening of Rudnicki and Rice (1975) for a solid with
!! pressure-sensitive yield and dilatancy, and the laws that can lose it.
program test_fem_mm_ellipticity
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_mm_cones, only: make_cone
  use fem_mm_ellipticity, only: least_determinant, determinant_along
  use fem_mm_flow, only: mm_law_type
  use fem_mm_watch, only: can_lose
  implicit none

  real(wp), parameter :: shear = 2.0_wp, poisson = 0.3_wp
  real(wp), parameter :: one(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                              0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  type(test_type) :: test

  call judge('simple shear, associated', [1.0_wp, 0.0_wp, -1.0_wp], 0.0_wp, 0.0_wp)
  call judge('axial compression, associated', [1.0_wp, 1.0_wp, -2.0_wp], 0.0_wp, 0.0_wp)
  call judge('shear, friction and little dilation', [1.0_wp, 0.0_wp, -1.0_wp], 0.6_wp, 0.2_wp)
  call judge('compression, friction', [1.0_wp, 1.0_wp, -2.0_wp], 0.6_wp, 0.2_wp)
  call judge('between, friction', [1.0_wp, 0.3_wp, -1.3_wp], 0.5_wp, 0.1_wp)
  call direction()
  call laws()
  call test%finish()

contains

  !> h_cr/G = (1 + nu)/(9 (1 - nu)) (beta - mu)^2 - (1 + nu)/2 (N + (beta + mu)/3)^2, N the middle
  !! principal deviator over sqrt(J2): ellipticity is there just above it, and lost just below.
  subroutine judge(name, deviator, friction, dilation)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: deviator(3), friction, dilation  !! principal; mu, beta
    real(wp) :: critical, scaled(3), least, normal(3)
    integer(i4) :: k
    scaled = deviator/sqrt(0.5_wp*sum(deviator**2))
    critical = shear*((1.0_wp + poisson)/(9.0_wp*(1.0_wp - poisson))*(dilation - friction)**2 &
      - 0.5_wp*(1.0_wp + poisson)*(scaled(2) + (dilation + friction)/3.0_wp)**2)
    do k = 1, 2
      call least_determinant(tangent_of(scaled, friction, dilation, critical - 0.01_wp*shear), &
                             k == 2, least, normal)
      call test%check(name//': lost below', least < 0.0_wp)
      call least_determinant(tangent_of(scaled, friction, dilation, critical + 0.01_wp*shear), &
                             k == 2, least, normal)
      call test%check(name//': there above', least > 0.0_wp)
    end do
  end subroutine judge

  !> Tangent of the forces by F and chi,L: elastic-plastic in F, elastic in the gradient.
  pure function tangent_of(s, friction, dilation, hardening) result(tangent)
    real(wp), intent(in) :: s(3), friction, dilation, hardening
    real(wp) :: tangent(45, 45)
    real(wp) :: flow(3, 3), normal(3, 3), there(9), back(9), lambda
    integer(i4) :: i, j, k
    lambda = 2.0_wp*shear*poisson/(1.0_wp - 2.0_wp*poisson)
    tangent = 0.0_wp
    do k = 1, 9
      tangent(:9, k) = reshape(elastic(lambda, unit(k)), [9])
    end do
    do k = 19, 45
      tangent(k, k) = 0.5_wp
    end do
    flow = 0.0_wp
    do i = 1, 3
      flow(i, i) = 0.5_wp*s(i)
    end do
    normal = flow + friction/3.0_wp*one
    flow = flow + dilation/3.0_wp*one
    there = reshape(elastic(lambda, flow), [9])
    back = reshape(elastic(lambda, normal), [9])
    do j = 1, 9
      do i = 1, 9
        tangent(i, j) = tangent(i, j) - there(i)*back(j)/(hardening &
          + sum(normal*reshape(there, [3, 3])))
      end do
    end do
  end function tangent_of

  pure function unit(k) result(e)
    integer(i4), intent(in) :: k
    real(wp) :: e(3, 3)
    e = 0.0_wp
    e(1 + mod(k - 1, 3), 1 + (k - 1)/3) = 1.0_wp
  end function unit

  pure function elastic(lambda, e) result(s)
    real(wp), intent(in) :: lambda, e(3, 3)
    real(wp) :: s(3, 3)
    s = lambda*(e(1, 1) + e(2, 2) + e(3, 3))*one + shear*(e + transpose(e))
  end function elastic

  !> In simple shear with axes at 45 degrees the band is along one of the planes of shear.
  subroutine direction()
    real(wp) :: least, normal(3), turned
    logical, parameter :: yes = .true.
    call least_determinant(tangent_of([1.0_wp, 0.0_wp, -1.0_wp], 0.0_wp, 0.0_wp, -0.01_wp), yes, &
                           least, normal)
    turned = abs(normal(1)*normal(3))
    call test%check_close('direction of the band', turned, 0.5_wp, 1.0e-3_wp)
    call test%check_close('elastic solid', determinant_along(tangent_of([1.0_wp, 0.0_wp, -1.0_wp], &
      0.0_wp, 0.0_wp, 1.0e12_wp), normal, .false.), 2.0_wp*shear**3*(1.0_wp - poisson) &
      /(1.0_wp - 2.0_wp*poisson), 1.0e-9_wp)
  end subroutine direction

  subroutine laws()
    type(mm_law_type) :: law
    call test%check('an elastic law cannot', .not. can_lose(law))
    law%cone(1) = make_cone([0.5_wp, 0.5_wp], [-1.0_wp, -1.0_wp], 1.0_wp, 1.0_wp, 0.0_wp)
    call test%check('nor one that hardens along its normals', .not. can_lose(law))
    law%cone(1) = make_cone([0.5_wp, 0.2_wp], [-1.0_wp, -1.0_wp], 1.0_wp, 1.0_wp, 0.0_wp)
    call test%check('one that dilates less can', can_lose(law))
    law%cone(1) = make_cone([0.5_wp, 0.5_wp], [-1.0_wp, -1.0_wp], 1.0_wp, -1.0_wp, 0.0_wp)
    call test%check('one that softens can', can_lose(law))
  end subroutine laws
end program test_fem_mm_ellipticity
