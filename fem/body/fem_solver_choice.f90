!> Factors, conjugate gradients or multigrid: an estimate of what each costs, from counts alone.
!!
!! A body of n unknowns and d levels (fem_breadth) has cross-sections of n/d unknowns. Factors cost
!! like the cube of the largest front, (n/d)^3; iterations are as many as the levels s from what is
!! held, each at a cost of n: n s. The quotient is n^2/(d^3 s) over a constant of the element kind,
!! which was measured (manual, Statics). Multigrid costs n, as much as conjugate gradients for a
!! number of levels that each kind has. Near incompressibility the iterations grow like
!! (1 - 2 nu)^(-2/3). Factors of small bodies take no time and are exact to rounding.
module fem_solver_choice
  use talus_kinds, only: wp, i4
  use fem_breadth, only: level_count, levels_from
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8, solid_kinds
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: direct_over_iterative, estimate_costs, turn

  !> n^2/(d^3 s) where both cost the same, at nu = 0.3, by kind: hex8, hex20, hex27, tet4, tet10,
  !! wedge6.
  real(wp), parameter :: even(solid_kinds) = &
    [1400.0_wp, 13000.0_wp, 60000.0_wp, 100.0_wp, 2000.0_wp, 90.0_wp]
  !> Levels from which on multigrid costs less than conjugate gradients, by kind.
  integer(i4), parameter :: turn(solid_kinds) = [45, 16, 11, 48, 17, 54]
  integer(i4), parameter :: slender = 2       !! multigrid needs as much more where it is
  integer(i4), parameter :: small = 10000     !! unknowns below which factors are made always
  real(wp), parameter :: usual_room = 0.4_wp  !! 1 - 2 nu at nu = 0.3

contains

  !> Cost of factors over that of what costs less of both iterations, for a body, and whether that
  !! is multigrid: always if it `must` be.
  pure subroutine estimate_costs(mesh, elastic, held, must, quotient, multigrid)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    logical, intent(in) :: held(:, :)  !! (3, blocks), those of the nodes first
    logical, intent(in) :: must
    real(wp), intent(out) :: quotient
    logical, intent(out) :: multigrid
    real(wp) :: room
    integer(i4) :: k, kind, most, levels(2)
    room = usual_room
    do k = 1, mesh%elements
      associate (m => elastic%moduli(:, k))
        if (m(1) + m(2) > 0.0_wp) room = min(room, m(2)/(m(1) + m(2)))
      end associate
    end do
    kind = hex8
    most = 0
    do k = 1, solid_kinds
      if (count(mesh%kind == k) <= most) cycle
      most = int(count(mesh%kind == k), i4)
      kind = k
    end do
    levels(1) = level_count(mesh)
    levels(2) = levels_from(mesh, all(held(:, :mesh%nodes), 1))
    if (levels(2) == 0) levels(2) = levels(1)  ! by planes of symmetry, or springs
    multigrid = must .or. levels(2) > turn(kind)
    if (must) levels(2) = turn(kind)
    quotient = direct_over_iterative(kind, int(count(.not. held), i4), levels, room)
  end subroutine estimate_costs

  !> The estimate: above one iterations cost less. Zero for small bodies.
  pure real(wp) function direct_over_iterative(kind, unknowns, levels, room)
    integer(i4), intent(in) :: kind      !! of most elements
    integer(i4), intent(in) :: unknowns
    integer(i4), intent(in) :: levels(2) !! of the body, and from what is held
    real(wp), intent(in) :: room         !! least 1 - 2 nu
    direct_over_iterative = 0.0_wp
    if (unknowns < small) return
    direct_over_iterative = real(unknowns, wp)**2/(real(levels(1), wp)**3* &
      real(min(levels(2), slender*turn(kind)), wp))/even(kind) &
      *min(1.0_wp, room/usual_room)**(2.0_wp/3.0_wp)
  end function direct_over_iterative
end module fem_solver_choice
