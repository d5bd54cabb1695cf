!> Stress in a periodic cell: of the current contacts or, on many ranks, from the sums that these
!! reported.
module dem_cell_stress
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: dyad
  use dem_cell, only: cell_volume
  use dem_pair_law, only: pair_stiffness
  use dem_halo_state, only: cell_reals
  use dem_state, only: dem_data_type, lanes, history_side
  implicit none
  private
  public :: cell_stress, cell_sums

contains

  !> Stress of the contacts (Love-Weber, sigma_ij = 1/V sum l_i f_j) and the stiffness against each
  !! component if all grains followed the flow [Pa].
  pure subroutine cell_stress(d, sigma, stiffness)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(out) :: sigma(3, 3), stiffness(10)
    real(wp) :: sums(cell_reals)
    if (d%halo%cell_seen) then
      sums = d%halo%cell_sums
    else
      sums = cell_sums(d)
    end if
    sigma = reshape(sums(:9), [3, 3])/cell_volume(d%cell)
    stiffness = sums(10:)/cell_volume(d%cell)
  end subroutine cell_stress

  !> Stress and stiffness times the volume, of the contacts of this rank: half of those over a
  !! border [J].
  pure function cell_sums(d) result(sums)
    type(dem_data_type), intent(in) :: d
    real(wp) :: sums(cell_reals)
    integer(i4) :: k, lane

    sums = 0.0_wp
    do k = 1, d%pairs%grain_blocks
      if (.not. d%pairs%touched(k)) cycle
      do lane = 1, lanes
        if (d%pairs%history(lane, history_side, k) > 0.0_wp) call add_contact(d, lane, k, sums)
      end do
    end do
  end function cell_sums

  !> What the contact in a lane of block k adds to the sums.
  pure subroutine add_contact(d, lane, k, sums)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp), intent(inout) :: sums(cell_reals)
    real(wp) :: l(3), n(3), branch(3), kn, kt, weight, stiffness(2), part(cell_reals)
    integer(i4) :: i, j

    l = d%pairs%body(1:3, d%pairs%second(lane, k)) - d%pairs%body(1:3, d%pairs%first(lane, k))
    n = d%pairs%normal(lane, :, k)
    if (d%pairs%round(k)) n = l/norm2(l)
    branch = l
    if (d%clumps%n > 0) branch = l - d%clumps%arm(:, d%pairs%grain(d%pairs%second(lane, k))) &
      + d%clumps%arm(:, d%pairs%first(lane, k))
    part(:9) = reshape(-dyad(branch, d%pairs%result(1:3, (k - 1)*lanes + lane)), [9])
    stiffness = pair_stiffness(d, lane, k)
    weight = d%pairs%weight(lane, min(k, size(d%pairs%weight, 2)))
    kt = weight*stiffness(2)
    kn = weight*stiffness(1) - kt
    do i = 1, 3
      do j = 1, 3
        part(6 + 3*i + j) = l(j)**2*(kn*n(i)**2 + kt)
      end do
    end do
    part(19) = (kn*dot_product(l, n)**2 + kt*sum(l**2))/3.0_wp
    if (allocated(d%pairs%share)) part = d%pairs%share(k)*part
    sums = sums + part
  end subroutine add_contact
end module dem_cell_stress
