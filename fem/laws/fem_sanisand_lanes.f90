!> Neighbouring increments of strain of `sanisand`, side by side in the sub-steps of a recorded one
!! that yields from its beginning to its end: the same equations as in fem_sanisand, for all lanes
!! at once. Compression positive.
!! eq. F.41, F.42, F.43
module fem_sanisand_lanes
  use talus_kinds, only: wp, i4
  use fem_sanisand, only: sand_type, critical_void, bulk_and_shear, growth, start_hardening, &
    at_alpha, at_fabric, at_void, at_flow, sand_size
  use fem_sanisand_path, only: sand_record_type, tableau, on_surface, nudge
  use fem_voigt, only: unit
  implicit none
  private
  public :: follow_lanes, sand_lanes

  integer(i4), parameter :: sand_lanes = 8
  integer(i4), parameter :: stages = 6  !! the seventh is for the error alone
  real(wp), parameter :: root_2_3 = sqrt(2.0_wp/3.0_wp)
  real(wp), parameter :: root_6 = sqrt(6.0_wp)

  !> Directions and sizes at the points, see sand_flow_type.
  type :: flow_lanes_type
    real(wp), dimension(sand_lanes) :: p, bulk, shear, cosine, bounding, dilating, hardening, along
    real(wp), dimension(sand_lanes) :: drive, resistance, softness, dilation
    real(wp), dimension(sand_lanes, 6) :: ratio, n, square, flow, to_bound
  end type flow_lanes_type

contains

  !> Bring points through their increments. `good` is false where some lane does not yield all the
  !! way, or where its pressure falls below the least.
  pure subroutine follow_lanes(sand, strain, y, start, record, good)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(sand_lanes, 6)
    real(wp), intent(inout) :: y(sand_lanes, sand_size), start(sand_lanes, 6)
    type(sand_record_type), intent(in) :: record
    logical, intent(out) :: good
    real(wp) :: share, step
    integer(i4) :: k

    share = 0.0_wp
    good = record%count > 0
    if (good) good = all(yield_ratios(sand, y) > -on_surface)
    do k = 1, record%count
      if (.not. good) return
      step = min(record%size_of(k), 1.0_wp - share)
      call turn_lanes(y, start)
      call sub_step_lanes(sand, step*strain, y, start, good)
      share = share + step
      if (.not. good .or. k == record%count) exit
      call settle_lanes(sand, y, good)
    end do
    good = good .and. .not. share < 1.0_wp
  end subroutine follow_lanes

  !> Fifth-order result of a sub-step.
  pure subroutine sub_step_lanes(sand, strain, y, start, good)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(sand_lanes, 6)
    real(wp), intent(inout) :: y(sand_lanes, sand_size)
    real(wp), intent(in) :: start(sand_lanes, 6)
    logical, intent(out) :: good
    real(wp) :: rate(sand_lanes, sand_size, stages), there(sand_lanes, sand_size)
    type(flow_lanes_type) :: f
    integer(i4) :: k, j

    there = y
    do k = 1, stages
      call find_directions(sand, there, f)
      call find_flow(sand, strain, there, start, f)
      if (k == 1) good = all(f%drive > 0.0_wp)
      if (.not. good) return
      call find_rates(sand, strain, there, f, rate(:, :, k))
      there = y
      do j = 1, k
        call add_share(tableau(k, j), rate(:, :, j), there)
      end do
    end do
    y = there
    good = all(y(:, 1) + y(:, 2) + y(:, 3) > 3.0_wp*sand%least)
  end subroutine sub_step_lanes

  !> A share of a rate to all components of all lanes.
  pure subroutine add_share(share, rate, there)
    real(wp), intent(in) :: share, rate(sand_lanes*sand_size)
    real(wp), intent(inout) :: there(sand_lanes*sand_size)
    integer(i4) :: l
    !$omp simd
    do l = 1, sand_lanes*sand_size
      there(l) = there(l) + share*rate(l)
    end do
  end subroutine add_share

  !> a:b of tensor components.
  pure function contracted(a, b) result(c)
    real(wp), intent(in) :: a(sand_lanes, 6), b(sand_lanes, 6)
    real(wp) :: c(sand_lanes)
    integer(i4) :: l
    !$omp simd
    do l = 1, sand_lanes
      c(l) = a(l, 1)*b(l, 1) + a(l, 2)*b(l, 2) + a(l, 3)*b(l, 3) &
        + 2.0_wp*(a(l, 4)*b(l, 4) + a(l, 5)*b(l, 5) + a(l, 6)*b(l, 6))
    end do
  end function contracted

  !> Stress over pressure, its deviator less alpha, and the size of that.
  pure subroutine find_ratios(y, ratio, away, size_of)
    real(wp), intent(in) :: y(sand_lanes, sand_size)
    real(wp), intent(out) :: ratio(sand_lanes, 6), away(sand_lanes, 6), size_of(sand_lanes)
    real(wp) :: mean(sand_lanes)
    integer(i4) :: i
    mean = (y(:, 1) + y(:, 2) + y(:, 3))/3.0_wp
    do i = 1, 6
      ratio(:, i) = y(:, i)/mean - unit(i)
      away(:, i) = ratio(:, i) - y(:, at_alpha + i - 1)
    end do
    size_of = sqrt(contracted(away, away))
  end subroutine find_ratios

  !> Yield function over the pressure: negative inside.
  pure function yield_ratios(sand, y) result(ratios)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_lanes, sand_size)
    real(wp) :: ratios(sand_lanes), ratio(sand_lanes, 6), away(sand_lanes, 6)
    call find_ratios(y, ratio, away, ratios)
    ratios = ratios - root_2_3*sand%opening
  end function yield_ratios

  !> Bring the yield surface to the stress; not good at an elastic end.
  pure subroutine settle_lanes(sand, y, good)
    type(sand_type), intent(in) :: sand
    real(wp), intent(inout) :: y(sand_lanes, sand_size)
    logical, intent(out) :: good
    real(wp) :: ratio(sand_lanes, 6), away(sand_lanes, 6), size_of(sand_lanes)
    integer(i4) :: i
    call find_ratios(y, ratio, away, size_of)
    good = all(size_of - root_2_3*sand%opening >= -sand%opening*nudge)
    if (.not. good) return
    do i = 1, 6
      y(:, at_alpha + i - 1) = ratio(:, i) - root_2_3*sand%opening*away(:, i)/size_of
    end do
  end subroutine settle_lanes

  !> A loading begins where it turns against the last one.
  pure subroutine turn_lanes(y, start)
    real(wp), intent(in) :: y(sand_lanes, sand_size)
    real(wp), intent(inout) :: start(sand_lanes, 6)
    real(wp) :: ratio(sand_lanes, 6), away(sand_lanes, 6), along(sand_lanes)
    integer(i4) :: i
    call find_ratios(y, ratio, away, along)
    along = contracted(y(:, at_alpha:at_alpha + 5) - start, away)
    do i = 1, 6
      where (along < 0.0_wp) start(:, i) = y(:, at_alpha + i - 1)
    end do
  end subroutine turn_lanes

  !> Directions of loading, and what needs powers and roots of pressure and void ratio.
  pure subroutine find_directions(sand, y, f)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: y(sand_lanes, sand_size)
    type(flow_lanes_type), intent(out) :: f
    real(wp) :: mean, moduli(2), psi
    integer(i4) :: i

    !$omp simd private(mean)
    do i = 1, sand_lanes
      mean = (y(i, 1) + y(i, 2) + y(i, 3))/3.0_wp
      f%p(i) = max(mean, sand%least*0.5_wp)
      f%ratio(i, 1:3) = (y(i, 1:3) - mean)/f%p(i)
      f%ratio(i, 4:6) = y(i, 4:6)/f%p(i)
      f%n(i, :) = f%ratio(i, :) - y(i, at_alpha:at_alpha + 5)
    end do
    call find_squares(f)
    do i = 1, sand_lanes
      moduli = bulk_and_shear(sand, f%p(i), y(i, at_void))
      f%bulk(i) = moduli(1)
      f%shear(i) = moduli(2)
      psi = y(i, at_void) - critical_void(sand, f%p(i))
      f%bounding(i) = growth(-sand%bounding_rate*psi)
      f%dilating(i) = growth(sand%dilatancy_rate*psi)
      f%hardening(i) = start_hardening(sand, f%p(i), y(i, at_void))
    end do
  end subroutine find_directions

  !> Unit deviators, their squares and Lode angles.
  pure subroutine find_squares(f)
    type(flow_lanes_type), intent(inout) :: f
    real(wp) :: a(6), size_of(sand_lanes)
    integer(i4) :: i
    size_of = max(sqrt(contracted(f%n, f%n)), tiny(1.0_wp))
    !$omp simd private(a)
    do i = 1, sand_lanes
      a = f%n(i, :)/size_of(i)
      f%n(i, :) = a
      f%square(i, 1) = a(1)**2 + a(4)**2 + a(6)**2
      f%square(i, 2) = a(2)**2 + a(4)**2 + a(5)**2
      f%square(i, 3) = a(3)**2 + a(5)**2 + a(6)**2
      f%square(i, 4) = a(1)*a(4) + a(4)*a(2) + a(6)*a(5)
      f%square(i, 5) = a(4)*a(6) + a(2)*a(5) + a(5)*a(3)
      f%square(i, 6) = a(1)*a(6) + a(4)*a(5) + a(6)*a(3)
    end do
    f%cosine = min(1.0_wp, max(-1.0_wp, root_6*contracted(f%n, f%square)))
  end subroutine find_squares

  !> Flow, bounding and dilatancy surfaces, resistance, and the numerator of the loading index.
  pure subroutine find_flow(sand, strain, y, start, f)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(sand_lanes, 6), y(sand_lanes, sand_size), start(sand_lanes, 6)
    type(flow_lanes_type), intent(inout) :: f
    real(wp), dimension(sand_lanes) :: slope, skew, b, c
    integer(i4) :: i, l

    associate (alpha => y(:, at_alpha:at_alpha + 5))
      slope = 2.0_wp*sand%extension/(1.0_wp + sand%extension - (1.0_wp - sand%extension)*f%cosine)
      skew = (1.0_wp - sand%extension)/sand%extension*slope
      slope = slope*sand%slope
      b = 1.0_wp + 1.5_wp*skew*f%cosine
      c = 3.0_wp*sqrt(1.5_wp)*skew
      do i = 1, 6
        !$omp simd
        do l = 1, sand_lanes
          f%flow(l, i) = b(l)*f%n(l, i) - c(l)*(f%square(l, i) - unit(i)/3.0_wp)
          f%to_bound(l, i) = root_2_3*(slope(l)*f%bounding(l) - sand%opening)*f%n(l, i) &
            - alpha(l, i)
        end do
      end do
      f%along = contracted(f%n, f%ratio)
      f%dilation = sand%dilatancy*(1.0_wp + max(0.0_wp, contracted(y(:, at_fabric:at_fabric + 5), &
        f%n)))*(root_2_3*(slope*f%dilating - sand%opening) - contracted(alpha, f%n))
      f%softness = max(0.0_wp, contracted(alpha - start, f%n))/f%hardening
    end associate
    f%resistance = max(tiny(1.0_wp), 2.0_wp/3.0_wp*f%p*contracted(f%to_bound, f%n) &
      + f%softness*(2.0_wp*f%shear*(b - c*f%cosine/root_6) - f%bulk*f%dilation*f%along))
    f%drive = 2.0_wp*f%shear*contracted(f%n, strain) &
      - f%bulk*f%along*(strain(:, 1) + strain(:, 2) + strain(:, 3))
  end subroutine find_flow

  !> Rates of the points.
  pure subroutine find_rates(sand, strain, y, f, rate)
    type(sand_type), intent(in) :: sand
    real(wp), intent(in) :: strain(sand_lanes, 6), y(sand_lanes, sand_size)
    type(flow_lanes_type), intent(in) :: f
    real(wp), intent(out) :: rate(sand_lanes, sand_size)
    real(wp), dimension(sand_lanes) :: v, hard, index, swell, fade
    integer(i4) :: i, l

    v = strain(:, 1) + strain(:, 2) + strain(:, 3)
    hard = max(f%drive, 0.0_wp)/f%resistance
    index = hard*f%softness
    swell = index*f%dilation
    fade = -sand%fabric_rate*max(0.0_wp, -swell)
    do i = 1, 6
      !$omp simd
      do l = 1, sand_lanes
        rate(l, i) = 2.0_wp*f%shear(l)*(strain(l, i) - v(l)/3.0_wp*unit(i) &
          - index(l)*f%flow(l, i)) + f%bulk(l)*(v(l) - swell(l))*unit(i)
        rate(l, at_alpha + i - 1) = 2.0_wp/3.0_wp*hard(l)*f%to_bound(l, i)
        rate(l, at_fabric + i - 1) = fade(l)*(sand%fabric_limit*f%n(l, i) &
          + y(l, at_fabric + i - 1))
        rate(l, at_flow + i - 1) = index(l)*f%flow(l, i) + swell(l)/3.0_wp*unit(i)
      end do
    end do
    rate(:, at_void) = -(1.0_wp + y(:, at_void))*v
  end subroutine find_rates
end module fem_sanisand_lanes
