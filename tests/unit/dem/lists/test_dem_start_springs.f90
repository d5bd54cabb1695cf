!> Tangential forces that contacts begin with: two spheres in a cell so narrow that they touch over
!! two images, each contact with its own force; nearest images; faces that are open.
program test_dem_start_springs
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_cell, only: set_cell
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_start_springs, only: start_springs_type, count_unreachable
  use dem_state, only: kind_free, dem_cell_type
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 1.0e-3_wp
  real(wp), parameter :: width = 3.9e-3_wp  !! of the cell: the spheres overlap by 6e-5 and 4e-5 m
  real(wp), parameter :: near(3) = [0.0_wp, 0.02_wp, -0.01_wp]  !! force over the near side [N]
  real(wp), parameter :: over(3) = [0.0_wp, -0.03_wp, 0.04_wp]  !! over the face [N]

  call check_two_images()
  call check_turned()
  call check_nearest()
  call check_unreachable()
  call test%finish()

contains

  !> Spheres 1 and 2 in a row along x: 2 touches 1, and its image at -1 touches 1 from below.
  subroutine make_pair(s, springs, list)
    type(dem_system_type), intent(out) :: s
    type(start_springs_type), intent(in) :: springs
    type(dem_contacts_type), intent(inout) :: list
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), zero(3, 2)

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%materials(1)%young = 1.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    x = 5.0e-3_wp
    x(1, 1) = 0.5e-3_wp
    x(1, 2) = x(1, 1) + 1.94e-3_wp
    zero = 0.0_wp
    call make_grains(s%grains, s%materials, [4_i8, 9_i8], spread(kind_free, 1, 2), &
                     spread(1_i4, 1, 2), x, spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 2), &
                     spread(spread(radius, 1, 3), 2, 2), zero, zero, errors)
    call set_cell(s%cell, [0.0_wp, 0.0_wp, 0.0_wp], &
                  reshape([width, 0.0_wp, 0.0_wp, 0.0_wp, 1.0e-2_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                           1.0e-2_wp], [3, 3]), [.true., .true., .true.])
    s%springs = springs
    s%par%dt = 1.0e-8_wp
    call s%init(errors)
    call s%contacts(list)
    call test%check('no faults', .not. errors%any())
    call test%check('two contacts', list%n == 2)
  end subroutine make_pair

  !> Force of the contact whose branch points this way along x.
  pure function force_along(list, side) result(force)
    type(dem_contacts_type), intent(in) :: list
    real(wp), intent(in) :: side
    real(wp) :: force(3)
    integer(i4) :: k
    force = 0.0_wp
    do k = 1, list%n
      if (list%branch(1, k)*side > 0.0_wp) force = list%spring(:, k)
    end do
  end function force_along

  subroutine check_two_images()
    type(dem_system_type) :: s
    type(start_springs_type) :: springs
    type(dem_contacts_type) :: list
    springs%ids = reshape([4_i8, 9_i8, 4_i8, 9_i8], [2, 2])
    springs%force = reshape([over, near], [3, 2])
    springs%shift = reshape([-1, 0, 0, 0, 0, 0], [3, 2])
    springs%given = 2
    call make_pair(s, springs, list)
    call test%check('both forces are used', s%springs%used == 2)
    call test%check_all_close('over the near side', force_along(list, 1.0_wp), near, 1.0e-17_wp)
    call test%check_all_close('over the face', force_along(list, -1.0_wp), over, 1.0e-17_wp)
  end subroutine check_two_images

  !> The higher id first: its force on the lower one, the image of the lower one.
  subroutine check_turned()
    type(dem_system_type) :: s
    type(start_springs_type) :: springs
    type(dem_contacts_type) :: list
    springs%ids = reshape([9_i8, 4_i8, 9_i8, 4_i8], [2, 2])
    springs%force = -reshape([near, over], [3, 2])
    springs%shift = reshape([0, 0, 0, 1, 0, 0], [3, 2])
    springs%given = 2
    call make_pair(s, springs, list)
    call test%check_all_close('turned, near side', force_along(list, 1.0_wp), near, 1.0e-17_wp)
    call test%check_all_close('turned, over the face', force_along(list, -1.0_wp), over, &
                              1.0e-17_wp)
    springs%shift(1, 2) = 2
    call make_pair(s, springs, list)
    call test%check('an image that does not touch', s%springs%used == 1)
  end subroutine check_turned

  !> Without shifts the nearest image takes the force: here the near side.
  subroutine check_nearest()
    type(dem_system_type) :: s
    type(start_springs_type) :: springs
    type(dem_contacts_type) :: list
    springs%ids = reshape([4_i8, 9_i8], [2, 1])
    springs%force = reshape(near, [3, 1])
    springs%given = 1
    call make_pair(s, springs, list)
    call test%check_all_close('the nearest', force_along(list, 1.0_wp), near, 1.0e-17_wp)
    call test%check_all_close('not the other', force_along(list, -1.0_wp), 0.0_wp*over, 0.0_wp)
  end subroutine check_nearest

  !> Contacts over faces that the run does not have as periodic ones.
  subroutine check_unreachable()
    type(start_springs_type) :: springs
    type(dem_cell_type) :: cell
    springs%given = 3
    springs%shift = reshape([0, 0, 0, 1, 0, 0, 0, 0, -1], [3, 3])
    call test%check('no cell', count_unreachable(springs, cell) == 2)
    cell%active = .true.
    cell%periodic = [.true., .true., .false.]
    call test%check('walls below and above', count_unreachable(springs, cell) == 1)
    cell%periodic = .true.
    call test%check('all periodic', count_unreachable(springs, cell) == 0)
    deallocate (springs%shift)
    call test%check('no shifts', count_unreachable(springs, dem_cell_type()) == 0)
  end subroutine check_unreachable
end program test_dem_start_springs
