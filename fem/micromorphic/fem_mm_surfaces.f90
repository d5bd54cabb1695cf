!> Yield functions and flow of all kinds of surfaces of the micromorphic solid, and their
!! derivatives: with dev = root e and the derivative `slope` of the potential by p,
!!   N = e + (slope - e:C^-1) C/3.
module fem_mm_surfaces
  use talus_kinds, only: wp, i4
  use fem_mm_caps, only: look_ellipse, turn_ellipse, look_breakage, turn_breakage
  use fem_mm_cones, only: mm_cone_type, mm_place_type, mm_surface_type, mm_turn_type, &
    mm_rate_type, kind_cone, kind_ellipse, look_cone, turn_cone
  use fem_mm_tensor, only: lanes
  implicit none
  private
  public :: surface_at, turn_surface

  real(wp), parameter :: least = 1.0e-60_wp  !! |dev| that is divided by, at the axis

contains

  pure function surface_at(cone, place) result(surface)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type) :: surface
    surface%p = sum(place%c*place%stress)/3.0_wp
    surface%e = place%stress - surface%p*place%inverse_c
    select case (cone%kind)
    case (kind_cone)
      call look_cone(cone, place, surface)
    case (kind_ellipse)
      call look_ellipse(cone, place, surface)
    case default
      call look_breakage(cone, place, surface)
    end select
    surface%t = sum(surface%e*place%inverse_c)
    surface%flow = surface%e + (surface%slope - surface%t)/3.0_wp*place%c
  end function surface_at

  !> Derivatives of the yield function (df), at fixed cohesion, and of the flow (dn).
  pure subroutine turn_surface(cone, place, surface, turn, df, dn)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(in) :: surface
    type(mm_turn_type), intent(in) :: turn
    real(wp), intent(out) :: df(lanes), dn(lanes, 3, 3)
    type(mm_rate_type) :: rate
    real(wp) :: dt(lanes)
    integer(i4) :: i, j

    rate%p = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        rate%p = rate%p + turn%c(:, i, j)*place%stress(i, j) + place%c(i, j)*turn%stress(:, i, j)
      end do
    end do
    rate%p = rate%p/3.0_wp
    rate%along = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = turn%stress(:, i, j) - rate%p*place%inverse_c(i, j) &
          - surface%p*turn%inverse_c(:, i, j)
        rate%along = rate%along + surface%e(i, j)*dn(:, i, j)
      end do
    end do
    call turn_numbers(cone, place, surface, turn, rate)
    dt = 0.0_wp
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = (dn(:, i, j) - surface%e(i, j)*rate%root)/max(surface%root, least)
        dt = dt + dn(:, i, j)*place%inverse_c(i, j) + surface%e(i, j)*turn%inverse_c(:, i, j)
      end do
    end do
    do j = 1, 3
      do i = 1, 3
        dn(:, i, j) = dn(:, i, j) + (surface%slope - surface%t)/3.0_wp*turn%c(:, i, j) &
          - place%c(i, j)/3.0_wp*(dt - rate%slope)
      end do
    end do
    df = rate%yield
  end subroutine turn_surface

  pure subroutine turn_numbers(cone, place, surface, turn, rate)
    type(mm_cone_type), intent(in) :: cone
    type(mm_place_type), intent(in) :: place
    type(mm_surface_type), intent(in) :: surface
    type(mm_turn_type), intent(in) :: turn
    type(mm_rate_type), intent(inout) :: rate
    select case (cone%kind)
    case (kind_cone)
      call turn_cone(cone, place, turn, rate)
    case (kind_ellipse)
      call turn_ellipse(cone, place, surface, turn, rate)
    case default
      call turn_breakage(cone, place, surface, turn, rate)
    end select
  end subroutine turn_numbers
end module fem_mm_surfaces
