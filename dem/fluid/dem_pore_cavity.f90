!> Pressures that do not fall below that at which the liquid cavitates.
!!
!! A node is at the bound and lacks liquid, or above it and lacks none: an active set finds which.
!! What a node lacks stays in its compressed volume, which later motion fills first. eq. D.42
module dem_pore_cavity
  use talus_kinds, only: wp, i4
  use dem_pore_grid, only: node_count, node_place, brick_edges
  use dem_pore_solve, only: pore_equations_type, solve_pressure, apply
  use dem_pore_state, only: pore_grid_type
  implicit none
  private
  public :: solve_bounded, hydrostatic, is_cavity

  integer(i4), parameter :: most = 20             !! changes of the set
  real(wp), parameter :: at_bound = 1.0e-9_wp     !! of the bound, that counts as on it

contains

  !> As solve_pressure, with p >= low at free nodes.
  subroutine solve_bounded(grid, equations, free, low, p, turns)
    type(pore_grid_type), intent(in) :: grid
    type(pore_equations_type), intent(in) :: equations
    real(wp), intent(in) :: free(:)  !! (nodes) 1, or 0 where p is held
    real(wp), intent(in) :: low(:)   !! (nodes) [Pa]
    real(wp), intent(inout) :: p(:)
    integer(i4), intent(out) :: turns
    real(wp), dimension(size(p)) :: loose, product
    logical, dimension(size(p)) :: bound, next
    integer(i4) :: k, more

    bound = free > 0.5_wp .and. p <= low*(1.0_wp - at_bound)
    turns = 0
    do k = 1, most
      loose = merge(0.0_wp, free, bound)
      where (bound) p = low
      call solve_pressure(grid, equations, loose, p, more)
      if (more < 0) turns = -1
      if (more < 0) return
      turns = turns + more
      next = loose > 0.5_wp .and. p < low
      if (any(bound)) then
        call apply(grid, equations, p, product)
        next = next .or. (bound .and. product >= equations%rhs)
      end if
      if (.not. any(next .neqv. bound)) return
      bound = next
    end do
  end subroutine solve_bounded

  !> Is a node at the bound?
  elemental logical function is_cavity(p, low)
    real(wp), intent(in) :: p, low  !! [Pa]
    is_cavity = p <= low + at_bound*abs(low)
  end function is_cavity

  !> Pressure of the liquid at rest at all nodes, zero at the highest corner of the grid [Pa].
  pure function hydrostatic(grid, weight) result(p)
    type(pore_grid_type), intent(in) :: grid
    real(wp), intent(in) :: weight(3)  !! density times gravity [N/m^3]
    real(wp) :: p(node_count(grid)), x(3)
    integer(i4) :: a
    do a = 1, size(p)
      x = grid%lower + node_place(grid, a)*brick_edges(grid)
      p(a) = dot_product(weight, x - merge(grid%lower, grid%upper, weight > 0.0_wp))
    end do
  end function hydrostatic
end module dem_pore_cavity
