!> Levels of meshes, and which solver costs less: the estimate against what was measured.
program test_fem_solver_choice
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_breadth, only: level_count, levels_from
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8, hex20, hex27, tet4, tet10, wedge6
  use fem_solver_choice, only: direct_over_iterative, estimate_costs, turn
  use fem_types, only: fem_mesh_type
  implicit none
  type(test_type) :: test

  call check_levels()
  call check_measured()
  call check_growth()
  call test%finish()

contains

  !> A row of n cubes, or two rows apart, their elements in an order of no use.
  pure function row_of(n, rows) result(mesh)
    integer(i4), intent(in) :: n, rows
    type(fem_mesh_type) :: mesh
    integer(i4) :: e, r, k, first
    mesh%elements = n*rows
    mesh%nodes = 4*(n + 1)*rows
    allocate (mesh%kind(mesh%elements), mesh%start(mesh%elements + 1), mesh%node(8*mesh%elements))
    mesh%kind = hex8
    mesh%start = [(8*e - 7, e=1, mesh%elements + 1)]
    do r = 1, rows
      do e = 1, n
        k = 1 + mod(7*e, n) + (r - 1)*n  ! n and 7 without a common factor
        first = 4*(n + 1)*(r - 1) + 4*(e - 1)
        mesh%node(8*k - 7:8*k) = first + [1, 2, 3, 4, 5, 6, 7, 8]
      end do
    end do
  end function row_of

  subroutine check_levels()
    integer(i4) :: n
    call test%check('levels of one cube', level_count(row_of(1, 1)) == 2)
    call test%check('levels of a row', level_count(row_of(10, 1)) == 11)
    call test%check('levels of two rows', level_count(row_of(10, 2)) == 22)
    call test%check('from an end', levels_from(row_of(10, 1), [(n <= 4, n=1, 44)]) == 11)
    call test%check('from the middle', levels_from(row_of(10, 1), [(n == 21, n=1, 44)]) == 6)
    call test%check('from nowhere', levels_from(row_of(10, 1), [(.false., n=1, 44)]) == 0)
  end subroutine check_levels

  !> Cubes and slender bodies that were measured on both sides (manual, Statics).
  subroutine check_measured()
    call test%check('cube of hex8', direct_over_iterative(hex8, 45000, [25, 25], 0.4_wp) > 1.0_wp)
    call test%check('small cube of tet10', &
                    direct_over_iterative(tet10, 34914, [23, 23], 0.4_wp) > 1.0_wp)
    call test%check('slab of tet10 held at an edge', &
                    direct_over_iterative(tet10, 49400, [49, 49], 0.4_wp) < 1.0_wp)
    call test%check('slab of tet10 held at a face', &
                    direct_over_iterative(tet10, 43200, [49, 7], 0.4_wp) > 1.0_wp)
    call test%check('slab of hex20 held at an edge', &
                    direct_over_iterative(hex20, 27000, [25, 25], 0.4_wp) < 1.0_wp)
    call test%check('bar of hex8', direct_over_iterative(hex8, 49000, [97, 97], 0.4_wp) < 1.0_wp)
    call test%check('cube of hex20', direct_over_iterative(hex20, 66000, [18, 18], 0.4_wp) > 1.0_wp)
    call test%check('cube of hex27', direct_over_iterative(hex27, 72000, [15, 15], 0.4_wp) > 1.0_wp)
    call test%check('cube of tet4', direct_over_iterative(tet4, 86490, [61, 61], 0.4_wp) > 1.0_wp)
    call test%check('cube of wedge6', &
                    direct_over_iterative(wedge6, 86490, [61, 61], 0.4_wp) > 1.0_wp)
  end subroutine check_measured

  !> A cube of twice the cells a side: four times; nearly incompressible: less by the power 2/3.
  subroutine check_growth()
    type(fem_elastic_type) :: elastic
    real(wp) :: one, compressible, quotient
    logical :: multigrid
    integer(i4), parameter :: n = 5000
    logical :: held(3, 4*(n + 1))
    one = direct_over_iterative(hex8, 10000, [20, 20], 0.4_wp)
    call test%check('small bodies take factors', &
                    abs(direct_over_iterative(hex8, 9999, [5, 5], 0.4_wp)) <= 0.0_wp)
    call test%check_close('larger cube', direct_over_iterative(hex8, 80000, [40, 40], 0.4_wp)/one, &
                          4.0_wp, 1.0e-12_wp)
    call test%check_close('multigrid beyond the turn', &
      direct_over_iterative(hex8, 640000, [4*turn(hex8), 4*turn(hex8)], 0.4_wp)/ &
      direct_over_iterative(hex8, 80000, [2*turn(hex8), 2*turn(hex8)], 0.4_wp), 8.0_wp, 1.0e-12_wp)
    call test%check_close('incompressible', &
                          direct_over_iterative(hex8, 10000, [20, 20], 0.0004_wp)/one, &
                          0.01_wp, 1.0e-12_wp)
    call elastic%start(n)
    elastic%moduli(1, :) = 1.5_wp
    elastic%moduli(2, :) = 1.0_wp
    held = .false.
    held(:, :4) = .true.
    call estimate_costs(row_of(n, 1), elastic, held, .false., compressible, multigrid)
    call test%check('many levels: multigrid', multigrid)
    call test%check_close('a body', compressible, &
                          direct_over_iterative(hex8, 12*n, [n + 1, n + 1], 0.4_wp), &
                          1.0e-20_wp)
    elastic%moduli(1, 7) = 2499.0_wp
    call estimate_costs(row_of(n, 1), elastic, held, .false., quotient, multigrid)
    call test%check_close('its least compressible element counts', quotient/compressible, &
                          0.01_wp, 1.0e-12_wp)
    call estimate_costs(row_of(20, 1), elastic, held(:, :84), .false., quotient, multigrid)
    call test%check('few levels: conjugate gradients', .not. multigrid)
    call estimate_costs(row_of(20, 1), elastic, held(:, :84), .true., quotient, multigrid)
    call test%check('laws with a state: multigrid', multigrid)
  end subroutine check_growth
end program test_fem_solver_choice
