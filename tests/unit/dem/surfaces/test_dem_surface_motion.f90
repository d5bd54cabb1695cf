!> Work of a surface on grains: all of its motion where it is prescribed, the motion in held
!! directions alone where it is free; impulses with the mean of the forces at both ends of a step.
program test_dem_surface_motion
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_surface_make, only: mesh_type
  use dem_surface_values, only: add_mesh
  use dem_surface_motion, only: finish_surfaces
  use dem_surface_state, only: dem_surfaces_type, surface_rigid
  implicit none
  type(test_type) :: test
  real(wp), parameter :: step = 1.0e-4_wp                           ! [s]
  real(wp), parameter :: force(3) = [3.0_wp, -5.0_wp, 7.0_wp]       ! of the grains, now gone [N]
  real(wp), parameter :: moment(3) = [0.2_wp, 0.3_wp, -0.4_wp]      ! [N m]
  real(wp), parameter :: velocity(3) = [0.5_wp, 0.2_wp, -0.1_wp]    ! [m/s]
  real(wp), parameter :: spin(3) = [4.0_wp, -2.0_wp, 1.0_wp]        ! [rad/s]
  real(wp), parameter :: half = 0.5_wp*step                         ! weight of the forces before

  call check_body('prescribed', [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                  dot_product(force, velocity) + dot_product(moment, spin))
  call check_body('a wheel: driven along x and about y', &
                  [0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], &
                  sum(force(:2)*velocity(:2)) + dot_product(moment, spin))
  call check_body('free to turn about y', [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], &
                  dot_product(force, velocity) + moment(1)*spin(1) + moment(3)*spin(3))
  call check_body('all free', [1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp], 0.0_wp)
  call test%finish()

contains

  !> One body under `force` and `moment` that are gone at the end of the step.
  subroutine check_body(name, free, power)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: free(6)  !! 1: moves or turns by its forces
    real(wp), intent(in) :: power    !! of the forces on what is prescribed [W]
    type(dem_surfaces_type) :: s
    type(mesh_type) :: mesh
    real(wp) :: boundary

    mesh%x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], &
                     [3, 3])
    mesh%corner = reshape([1_i4, 2_i4, 3_i4], [3, 1])
    mesh%mate = reshape([0_i4, 0_i4, 0_i4], [3, 1])
    call add_mesh(s, mesh, 'plate', surface_rigid, 1, 1.0_wp, [0.0_wp, 0.0_wp, 0.0_wp])
    s%rigid%free = reshape(free, [6, 1])
    s%velocity(:, 1) = velocity
    s%spin(:, 1) = spin
    s%sums%force(:, 1) = force
    s%sums%moment(:, 1) = moment
    boundary = 0.0_wp
    call finish_surfaces(s, step, boundary)
    call test%check_close(name//': work on the grains', boundary, -half*power, 1.0e-18_wp)
    call test%check_close(name//': work of the body', s%sums%work(1), &
      -half*(dot_product(force, velocity) + dot_product(moment, spin)), 1.0e-18_wp)
    call test%check_all_close(name//': impulse', s%sums%impulse(:, 1), half*force, 1.0e-18_wp)
    call test%check_all_close(name//': force now', s%sums%force(:, 1), 0.0_wp, 0.0_wp)
  end subroutine check_body
end program test_dem_surface_motion
