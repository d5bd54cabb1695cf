!> What closed surfaces enclose: volume, mass centre and inertia of a turned brick, of a cylinder,
!! and which bodies enclose nothing.
program test_dem_surface_solid
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_surface_make, only: mesh_type, round_type, join_corners, check_mesh
  use dem_surface_solid, only: solid_of_triangles, solid_of_body, encloses
  use dem_surface_state, only: dem_surfaces_type, surface_rigid
  use dem_surface_values, only: add_mesh, add_cylinder, add_cone
  implicit none
  type(test_type) :: test
  type(dem_surfaces_type) :: s
  type(mesh_type) :: mesh
  type(error_list_type) :: errors
  real(wp), parameter :: edge(3) = [0.3_wp, 0.2_wp, 0.1_wp], place(3) = [1.0_wp, -2.0_wp, 0.5_wp]
  real(wp), parameter :: rounding = 1.0e-12_wp
  real(wp) :: corner(3, 3, 12), turn(3, 3), volume, centre(3), away(3), second(3, 3), &
    inertia(3, 3), expected(3, 3), own(3, 3), pi
  integer(i4) :: k

  pi = acos(-1.0_wp)
  turn = reshape([0.36_wp, 0.48_wp, -0.8_wp, -0.8_wp, 0.6_wp, 0.0_wp, 0.48_wp, 0.64_wp, &
                  0.6_wp], [3, 3])
  call make_brick(corner)
  call join_corners(corner, mesh)
  call check_mesh(mesh, .true., errors)
  call test%check('a closed brick', .not. errors%any())
  call solid_of_triangles(mesh%x, mesh%corner, volume, centre, second)
  call test%check_close('volume', volume, product(edge), rounding)
  call test%check_all_close('mass centre', centre, place, rounding)

  call add_mesh(s, mesh, 'brick', surface_rigid, 1_i4, 0.9_wp, place)
  call add_mesh(s, mesh, 'shifted', surface_rigid, 1_i4, 0.9_wp, place - [0.1_wp, 0.0_wp, 0.2_wp])
  call add_cylinder(s, 'roller', 1_i4, round_type(place, [0.0_wp, 3.0_wp, 0.0_wp], 0.2_wp, &
                                                  0.5_wp), .false.)
  call add_cylinder(s, 'drum', 1_i4, round_type(place, [0.0_wp, 3.0_wp, 0.0_wp], 0.2_wp, 0.5_wp), &
                    .true.)
  call add_cylinder(s, 'bar', 1_i4, round_type(place, [0.0_wp, 3.0_wp, 0.0_wp], 0.2_wp), .false.)
  call add_cone(s, 'cone', [1_i4, 1_i4, 1_i4], round_type(place, [0.0_wp, 0.0_wp, 1.0_wp], &
                                                          0.1_wp, 0.7_wp), pi/6.0_wp)
  call join_corners(corner(:, :, :11), mesh)
  call check_mesh(mesh, .false., errors)
  call add_mesh(s, mesh, 'open', surface_rigid, 1_i4, 0.9_wp, place)

  own = 0.0_wp
  do k = 1, 3
    own(k, k) = product(edge)*(sum(edge**2) - edge(k)**2)/12.0_wp
  end do
  expected = matmul(turn, matmul(own, transpose(turn)))
  call solid_of_body(s, 1_i4, volume, away, inertia)
  call test%check_all_close('centre at the mass centre', away, [0.0_wp, 0.0_wp, 0.0_wp], rounding)
  call test%check_all_close('inertia of a turned brick', reshape(inertia, [9]), &
                            reshape(expected, [9]), rounding)
  call solid_of_body(s, 2_i4, volume, away, inertia)
  call test%check_all_close('a centre beside it', away, [0.1_wp, 0.0_wp, 0.2_wp], rounding)
  call test%check_close('and Steiner', inertia(2, 2), expected(2, 2) + product(edge)*0.05_wp, &
                        rounding)
  call solid_of_body(s, 3_i4, volume, away, inertia)
  call test%check_close('volume of a cylinder', volume, pi*0.04_wp, rounding)
  call test%check_close('about its axis', inertia(2, 2), volume*0.02_wp, rounding)
  call test%check_close('across it', inertia(1, 1), volume*(0.01_wp + 1.0_wp/12.0_wp), rounding)
  call test%check('bodies that enclose a volume', all([(encloses(s, k), k=1, 7)] .eqv. &
    [.true., .true., .true., .false., .false., .false., .false.]))
  call test%finish()

contains

  !> The twelve triangles of a turned brick about its place, seen from outside.
  subroutine make_brick(corner)
    real(wp), intent(out) :: corner(3, 3, 12)
    integer(i4), parameter :: faces(4, 6) = reshape([1, 3, 4, 2, 5, 6, 8, 7, 1, 2, 6, 5, 3, 7, 8, &
                                                     4, 1, 5, 7, 3, 2, 4, 8, 6], [4, 6])
    real(wp) :: x(3, 8)
    integer(i4) :: f, i, j, n
    n = 0
    do f = 0, 1
      do j = 0, 1
        do i = 0, 1
          n = n + 1
          x(:, n) = place + matmul(turn, (real([i, j, f], wp) - 0.5_wp)*edge)
        end do
      end do
    end do
    do f = 1, 6
      corner(:, :, 2*f - 1) = x(:, faces([1, 2, 3], f))
      corner(:, :, 2*f) = x(:, faces([1, 3, 4], f))
    end do
  end subroutine make_brick
end program test_dem_surface_solid
