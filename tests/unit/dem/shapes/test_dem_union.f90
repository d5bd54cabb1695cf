!> Volume, centre and inertia of unions of spheres against closed forms.
program test_dem_union
  use talus_kinds, only: wp, i4
  use dem_ellipsoid, only: rotation_of
  use dem_union, only: union_mass_type, mass_of_union, principal_frame
  use talus_test, only: test_type
  implicit none

  real(wp), parameter :: pi = acos(-1.0_wp)
  type(test_type) :: test

  call judge_lens()
  call judge_hidden()
  call judge_apart()
  call judge_frame()
  call test%finish()

contains

  !> Two spheres that overlap, whatever their direction: sum less the lens of both caps.
  subroutine judge_lens()
    real(wp), parameter :: r(2) = [1.0_wp, 0.7_wp], d = 1.1_wp
    real(wp), parameter :: way(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, &
                                                0.48_wp, 0.64_wp, 0.6_wp], [3, 3])
    type(union_mass_type) :: mass
    real(wp) :: x(3, 2), lens
    integer(i4) :: k
    lens = pi*(sum(r) - d)**2*(d*d + 2.0_wp*d*sum(r) - 3.0_wp*(r(1) - r(2))**2)/(12.0_wp*d)
    do k = 1, 3
      x(:, 1) = [5.0_wp, -3.0_wp, 2.0_wp]
      x(:, 2) = x(:, 1) + d*way(:, k)
      mass = mass_of_union(x, r)
      call test%check_close('volume of two spheres', mass%volume, &
                            4.0_wp/3.0_wp*pi*sum(r**3) - lens, 1.0e-9_wp)
      call test%check_close('their centre lies on the line of centres', &
                            norm2(mass%centre - x(:, 1) - way(:, k) &
                                  *dot_product(way(:, k), mass%centre - x(:, 1))), 0.0_wp, &
                            1.0e-9_wp)
    end do
  end subroutine judge_lens

  !> Spheres that are twice there, or inside others, add nothing.
  subroutine judge_hidden()
    type(union_mass_type) :: mass
    real(wp) :: x(3, 3)
    x = 0.0_wp
    x(1, 3) = 0.3_wp
    mass = mass_of_union(x, [1.0_wp, 1.0_wp, 0.5_wp])
    call test%check_close('hidden spheres: volume', mass%volume, 4.0_wp/3.0_wp*pi, 1.0e-12_wp)
    call test%check_close('hidden spheres: centre', norm2(mass%centre), 0.0_wp, 1.0e-12_wp)
    call test%check_close('hidden spheres: moment', mass%inertia(1), 8.0_wp/15.0_wp*pi, 1.0e-12_wp)
  end subroutine judge_hidden

  !> Many spheres apart: sums and Steiner's parts, on the path without ends of pairs.
  subroutine judge_apart()
    integer(i4), parameter :: n = 20
    type(union_mass_type) :: mass
    real(wp) :: x(3, n), r(n), v(n), centre(3), xy, xx
    integer(i4) :: k
    do k = 1, n
      x(:, k) = [2.1_wp*k, 0.3_wp*k - 0.1_wp*k*k, 1.7_wp*mod(k, 4)]
      r(k) = 0.5_wp + 0.02_wp*k
    end do
    v = 4.0_wp/3.0_wp*pi*r**3
    centre = matmul(x, v)/sum(v)
    xx = sum(v*(0.4_wp*r**2 + (x(2, :) - centre(2))**2 + (x(3, :) - centre(3))**2))
    xy = -sum(v*(x(1, :) - centre(1))*(x(2, :) - centre(2)))
    mass = mass_of_union(x, r)
    call test%check_close('spheres apart: volume', mass%volume/sum(v), 1.0_wp, 1.0e-6_wp)
    call test%check_close('spheres apart: centre', norm2(mass%centre - centre), 0.0_wp, 1.0e-5_wp)
    call test%check_close('spheres apart: moment', mass%inertia(1)/xx, 1.0_wp, 1.0e-6_wp)
    call test%check_close('spheres apart: product', mass%inertia(4)/xy, 1.0_wp, 1.0e-6_wp)
  end subroutine judge_apart

  !> The principal frame turns the principal moments back to the tensor.
  subroutine judge_frame()
    real(wp), parameter :: inertia(6) = [3.0_wp, 4.0_wp, 5.0_wp, -0.3_wp, 0.2_wp, 0.4_wp]
    real(wp) :: moment(3), quat(4), r(3, 3), back(3, 3)
    integer(i4) :: k
    call principal_frame(inertia, moment, quat)
    r = rotation_of(quat)
    back = 0.0_wp
    do k = 1, 3
      back = back + moment(k)*spread(r(:, k), 2, 3)*spread(r(:, k), 1, 3)
    end do
    call test%check_close('tensor from its principal frame', &
      norm2([back(1, 1), back(2, 2), back(3, 3), back(1, 2), back(2, 3), back(3, 1)] - inertia), &
      0.0_wp, 1.0e-13_wp)
  end subroutine judge_frame
end program test_dem_union
