!> Mixing of the liquid within bricks, which takes away the part of its pressure that alternates
!! from corner to corner.
!!
!! The linear motion that is fitted to the grains of a brick gives and takes no liquid in the
!! pattern s_x s_y s_z of its corners, and no force follows from a pressure in it. What walls,
!! bodies and neighbours leave in that pattern would stay. It flows from corner to corner instead,
!! where the bricks beside have it with the other sign; the part that is alike in all is of a smooth
!! pressure, and stays. eqs. D.80, D.81
module dem_pore_mixing
  use talus_kinds, only: wp, i4
  use dem_pore_state, only: pore_grid_type, pore_mixing_type, dem_pore_type
  use dem_pore_grid, only: brick_count, brick_edges, corners_of, place_in, sign_of
  implicit none
  private
  public :: find_beside, begin_mixing, add_mixing, mixing_diagonal, alternating

  real(wp), parameter :: pattern(8) = product(sign_of, 1)
  real(wp), parameter :: strength = 13.0_wp  !! found by measurement (D.81)

contains

  !> Mixing of the exchange under way. eq. D.81 Beside a partner there is none: what
  !! alternates would go over the side, and columns of grains sway (theory-dem).
  pure subroutine begin_mixing(pore)
    type(dem_pore_type), intent(inout) :: pore
    real(wp) :: volume, diameter
    integer(i4) :: c
    associate (rate => pore%mixing%rate)
      rate = 0.0_wp
      if (pore%partner%side > 0) return
      volume = product(brick_edges(pore%grid))
      do c = 1, size(rate)
        diameter = pore%sauter(c)
        if (.not. diameter > 0.0_wp) diameter = maxval(pore%sauter)
        rate(c) = strength*pore%span*pore%fit%yield(1, 1, c)*(volume/diameter)**2
      end do
    end associate
  end subroutine begin_mixing

  !> Corners and neighbours of all bricks, which stay; nothing mixes yet.
  pure subroutine find_beside(grid, mixing)
    type(pore_grid_type), intent(in) :: grid
    type(pore_mixing_type), intent(out) :: mixing
    integer(i4) :: c, n
    n = brick_count(grid)
    allocate (mixing%corner(8, n), mixing%beside(6, n), mixing%share(n))
    allocate (mixing%rate(n), source=0.0_wp)
    do c = 1, n
      mixing%corner(:, c) = corners_of(grid, c)
      mixing%beside(:, c) = beside_of(grid, c)
      mixing%share(c) = 1.0_wp/max(count(mixing%beside(:, c) > 0), 1)
    end do
  end subroutine find_beside

  !> Bricks across the faces of one, 0 where there is none.
  pure function beside_of(grid, c) result(beside)
    type(pore_grid_type), intent(in) :: grid
    integer(i4), intent(in) :: c
    integer(i4) :: beside(6), at(3), step(3), axis
    at = place_in(grid, c)
    step = [1_i4, grid%bricks(1), grid%bricks(1)*grid%bricks(2)]
    do axis = 1, 3
      beside(2*axis - 1) = merge(c - step(axis), 0_i4, at(axis) > 0)
      beside(2*axis) = merge(c + step(axis), 0_i4, at(axis) < grid%bricks(axis) - 1)
    end do
  end function beside_of

  !> Amplitude by which pressures alternate in each brick, less the mean of that in the bricks
  !! beside, halved: 1 where +1 and -1 alternate everywhere. eq. D.80
  pure function apart_of(mixing, p) result(apart)
    type(pore_mixing_type), intent(in) :: mixing
    real(wp), intent(in) :: p(:)                 !! (nodes) [Pa]
    real(wp), dimension(size(mixing%share)) :: apart, uneven
    integer(i4) :: c, k
    do c = 1, size(uneven)
      uneven(c) = 0.125_wp*sum(pattern*p(mixing%corner(:, c)))
    end do
    do c = 1, size(uneven)
      apart(c) = 0.5_wp*uneven(c)
      do k = 1, 6
        if (mixing%beside(k, c) > 0) &
          apart(c) = apart(c) - 0.5_wp*mixing%share(c)*uneven(mixing%beside(k, c))
      end do
    end do
  end function apart_of

  !> Rate at which liquid leaves the nodes by mixing, times a factor, added: S p. eq. D.80
  pure subroutine add_mixing(mixing, factor, p, flow)
    type(pore_mixing_type), intent(in) :: mixing
    real(wp), intent(in) :: factor      !! 1, or a time [s]
    real(wp), intent(in) :: p(:)        !! (nodes) [Pa]
    real(wp), intent(inout) :: flow(:)  !! (nodes) [m^3/s]
    real(wp), dimension(size(mixing%rate)) :: pushed, drawn
    integer(i4) :: c, k
    pushed = factor*mixing%rate*apart_of(mixing, p)
    drawn = 0.5_wp*pushed
    do c = 1, size(pushed)
      do k = 1, 6
        if (mixing%beside(k, c) > 0) drawn(mixing%beside(k, c)) = drawn(mixing%beside(k, c)) &
          - 0.5_wp*mixing%share(c)*pushed(c)
      end do
    end do
    do c = 1, size(pushed)
      flow(mixing%corner(:, c)) = flow(mixing%corner(:, c)) + 0.125_wp*drawn(c)*pattern
    end do
  end subroutine add_mixing

  !> The diagonal of S, nearly, for the solver.
  pure function mixing_diagonal(mixing, nodes) result(diagonal)
    type(pore_mixing_type), intent(in) :: mixing
    integer(i4), intent(in) :: nodes
    real(wp), parameter :: most = 0.75_wp**2/64.0_wp  !! of a corner in a brick's rate
    real(wp) :: diagonal(nodes)  !! [m^3/(Pa s)]
    integer(i4) :: c
    diagonal = 0.0_wp
    do c = 1, size(mixing%rate)
      diagonal(mixing%corner(:, c)) = diagonal(mixing%corner(:, c)) + most*mixing%rate(c)
    end do
  end function mixing_diagonal

  !> Root of the mean square of what alternates of the pressures of the bricks without a body [Pa].
  pure real(wp) function alternating(pore)
    type(dem_pore_type), intent(in) :: pore
    real(wp) :: apart(brick_count(pore%grid))
    integer(i4) :: many
    apart = apart_of(pore%mixing, pore%p)
    many = count(pore%room >= 1.0_wp)
    alternating = sqrt(sum(apart**2, mask=pore%room >= 1.0_wp)/max(many, 1))
  end function alternating
end module dem_pore_mixing
