!> Changes between steps that a system makes by itself: adaptive damping (theory-dem, Equilibrium),
!! sums that restart from zero.
module dem_adaptive_damping
  use talus_kinds, only: wp, i4
  use dem_integrate, only: scaled_spin_momentum
  use dem_ellipsoid, only: rotation_of
  use dem_state, only: dem_data_type, kind_free
  use dem_surface_motion, only: reset_surfaces
  implicit none
  private
  public :: stop_slowing, reset_sums

contains

  !> Stop every free grain whose kinetic energy has fallen since the last check: it has passed the
  !! lowest point of its motion. What it loses is background damping. A grain that falls or rolls
  !! down is left alone. Translation and rotation stop together: one without the other would break
  !! rolling into sliding, and the bed would creep.
  subroutine stop_slowing(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: lost, now, scale(2), l(3)
    integer(i4) :: i

    if (.not. allocated(d%seen_kinetic)) allocate (d%seen_kinetic(d%grains%n), source=0.0_wp)
    scale = [d%par%mass_scale, d%par%inertia_scale]
    lost = 0.0_wp
    associate (g => d%grains, seen => d%seen_kinetic)
      do i = 1, g%n
        if (g%kind(i) /= kind_free) cycle
        l = scaled_spin_momentum(rotation_of(g%quat(:, i)), scale(2)*g%inertia(:, i), g%omega(:, i))
        now = 0.5_wp*scale(1)*g%mass(i)*sum(g%v(:, i)**2) + 0.5_wp*dot_product(l, g%omega(:, i))
        if (now < seen(i)) then
          lost = lost + now
          now = 0.0_wp
          g%v(:, i) = 0.0_wp
          g%omega(:, i) = 0.0_wp
        end if
        seen(i) = now
      end do
    end associate
    d%ledger%background_damping = d%ledger%background_damping + lost
  end subroutine stop_slowing

  !> Impulses and works of grains, planes and surfaces to zero (start of an exchange).
  subroutine reset_sums(d)
    type(dem_data_type), intent(inout) :: d
    d%grains%impulse = 0.0_wp
    d%grains%moment_impulse = 0.0_wp
    d%grains%work = 0.0_wp
    d%planes%impulse = 0.0_wp
    d%planes%work = 0.0_wp
    if (d%surfaces%n > 0) call reset_surfaces(d%surfaces)
  end subroutine reset_sums
end module dem_adaptive_damping
