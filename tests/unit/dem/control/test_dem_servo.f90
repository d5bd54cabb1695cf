!> Curves and their means; areas between walls; stiffness of a wall; a servo finds its stress.
program test_dem_servo
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, test_type
  use talus_text, only: string_type
  use talus_curve, only: curve_type
  use dem_state, only: kind_free
  use dem_law, only: make_linear_law
  use dem_make, only: make_grains, make_planes
  use dem_measure, only: wall_stiffness, wall_stiffnesses
  use dem_servo, only: dem_servo_type, measured_area
  use dem_surface_make, only: mesh_type, join_corners, check_mesh
  use dem_surface_values, only: add_mesh
  use dem_surface_servo, only: surface_servo_type, surface_stiffness_along
  use dem_surface_state, only: surface_rigid
  use dem_system, only: dem_system_type
  use dem_volume, only: constant_volume_type, box_pairs
  implicit none
  type(test_type) :: test

  call check_curve()
  call check_area()
  call check_servo()
  call check_surface_servo()
  call check_volume()
  call test%finish()

contains

  !> Value, integral and mean of a ramp from 1 to 3 between times 2 and 4.
  subroutine check_curve()
    type(curve_type) :: c
    c%time = [2.0_wp, 4.0_wp]
    c%value = [1.0_wp, 3.0_wp]
    call test%check_close('before', c%at(0.0_wp), 1.0_wp, 0.0_wp)
    call test%check_close('between', c%at(2.5_wp), 1.5_wp, 1.0e-15_wp)
    call test%check_close('after', c%at(9.0_wp), 3.0_wp, 0.0_wp)
    call test%check_close('mean over the ramp', c%mean(2.0_wp, 4.0_wp), 2.0_wp, 1.0e-15_wp)
    call test%check_close('mean from before to after', c%mean(1.0_wp, 6.0_wp), &
                          (1.0_wp + 4.0_wp + 6.0_wp)/5.0_wp, 1.0e-15_wp)
    call test%check_close('mean before', c%mean(-3.0_wp, 0.0_wp), 1.0_wp, 1.0e-15_wp)
    c%time = [1.0_wp]
    c%value = [5.0_wp]
    call test%check_close('one point is a constant', c%mean(0.0_wp, 2.0_wp), 5.0_wp, 1.0e-15_wp)
  end subroutine check_curve

  !> A box 2 x 3 x 4: walls in the order x, x, y, y, z, z; then one wall less.
  subroutine check_area()
    type(dem_system_type) :: s
    real(wp) :: point(3, 6), normal(3, 6), v(3, 6)
    integer(i4) :: k
    point = 0.0_wp
    normal = 0.0_wp
    v = 0.0_wp
    do k = 1, 3
      normal(k, 2*k - 1) = 1.0_wp
      normal(k, 2*k) = -1.0_wp
      point(k, 2*k) = 1.0_wp + k
    end do
    call make_planes(s%planes, point, normal, v, [1, 1, 1, 1, 1, 1])
    call test%check_close('area of x', measured_area(s%dem_data_type, 1), 12.0_wp, 1.0e-14_wp)
    call test%check_close('area of y', measured_area(s%dem_data_type, 4), 8.0_wp, 1.0e-14_wp)
    call test%check_close('area of z', measured_area(s%dem_data_type, 6), 6.0_wp, 1.0e-14_wp)
    call make_planes(s%planes, point(:, :5), normal(:, :5), v(:, :5), [1, 1, 1, 1, 1])
    call test%check_close('a pair is wanting', measured_area(s%dem_data_type, 1), 0.0_wp, 0.0_wp)
    call test%check_close('not for z', measured_area(s%dem_data_type, 5), 6.0_wp, 1.0e-14_wp)
  end subroutine check_area

  !> A sphere with linear contacts between a fixed and a servo wall: force, stiffness and place.
  subroutine check_servo()
    type(dem_system_type) :: s
    type(dem_servo_type) :: servo
    type(error_list_type) :: errors
    real(wp), parameter :: r = 1.0e-3_wp, kn = 1.0e5_wp, wanted = 2.0_wp
    real(wp) :: x(3, 1), q(4, 1), zero(3, 1), up(3, 2), at(3, 2)
    integer(i4) :: k

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_linear_law(kn, kn, 0.0_wp, 0.5_wp, 0.5_wp)
    zero = 0.0_wp
    x = zero
    x(3, 1) = r
    q(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    call make_grains(s%grains, s%materials, [1_i8], [kind_free], [1], x, q, x(3, 1) + zero, zero, &
                     zero, errors)
    up = 0.0_wp
    up(3, :) = [1.0_wp, -1.0_wp]
    at = 0.0_wp
    at(3, 2) = 2.01_wp*r
    call make_planes(s%planes, at, up, 0.0_wp*up, [1, 1])
    s%par%dt = 2.0e-6_wp
    call s%init(errors)
    allocate (servo%name(2), servo%curve(0), servo%wall_curve(2), servo%servo(1))
    servo%wall_curve = 0
    servo%wall_velocity = 0.0_wp*up
    servo%servo(1)%wall = 2
    servo%servo(1)%stress = 2.0e4_wp
    servo%servo(1)%area = wanted/2.0e4_wp
    servo%servo(1)%speed = 0.05_wp
    servo%servo(1)%gain = 0.2_wp
    servo%servo(1)%tolerance = 1.0e-6_wp
    servo%servo(1)%until = 1.0_wp
    call servo%start(s%dem_data_type, 0.0_wp, wall_stiffnesses(s%dem_data_type))
    call test%check_close('a wall without contact comes at its speed', &
                          s%planes%velocity(3, 2), -0.05_wp, 0.0_wp)
    do k = 1, 5000
      call s%step(10, errors)
      call servo%update(s%dem_data_type, 10*k*s%par%dt, wall_stiffnesses(s%dem_data_type))
    end do
    call test%check('no faults', .not. errors%any())
    call test%check_close('stiffness of the wall', wall_stiffness(s%dem_data_type, 2), kn, 0.0_wp)
    call test%check_close('force on the servo wall', s%planes%force(3, 2), wanted, 1.0e-6_wp)
    call test%check_close('force on the other wall', s%planes%force(3, 1), -wanted, 1.0e-6_wp)
    call test%check_close('where it stands', s%planes%point(3, 2), 2.0_wp*r - 2.0_wp*wanted/kn, &
                          1.0e-10_wp)
    servo%servo(1)%until = huge(1.0_wp)
    call test%check('satisfied', servo%satisfied(s%dem_data_type))
    servo%servo(1)%stress = 3.0e4_wp
    call servo%update(s%dem_data_type, 1.0_wp, wall_stiffnesses(s%dem_data_type))
    call test%check('a new target is not held', .not. servo%satisfied(s%dem_data_type))
    call servo%judge(s%dem_data_type, 1.0_wp, wall_stiffnesses(s%dem_data_type), 'deck.nml', &
                     errors)
    call test%check('and is a fault', errors%any())
  end subroutine check_servo

  !> A sphere with linear contacts between a wall and a plate just above it.
  subroutine make_pressed(s, r, kn, kt)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: r, kn, kt
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    real(wp) :: x(3, 1), q(4, 1), zero(3, 1), up(3, 1), corner(3, 3, 2)

    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_linear_law(kn, kt, 0.0_wp, 0.5_wp, 0.5_wp)
    zero = 0.0_wp
    x = zero
    x(3, 1) = r
    q(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    call make_grains(s%grains, s%materials, [1_i8], [kind_free], [1], x, q, x(3, 1) + zero, zero, &
                     zero, errors)
    up = 0.0_wp
    up(3, 1) = 1.0_wp
    call make_planes(s%planes, zero, up, zero, [1])
    corner(:, :, 1) = r*reshape([-9.0_wp, -9.0_wp, 2.01_wp, 9.0_wp, -9.0_wp, 2.01_wp, 9.0_wp, &
                                 9.0_wp, 2.01_wp], [3, 3])
    corner(:, :, 2) = corner(:, [1, 3, 3], 1)
    corner(1, 3, 2) = -9.0_wp*r
    mesh%name = 'plate'
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    call add_mesh(s%surfaces, mesh, 'plate', surface_rigid, 1, 0.94_wp, 2.01_wp*r*up(:, 1))
    s%surfaces%velocity(:, 1) = [0.01_wp, 0.0_wp, 0.0_wp]
    s%par%dt = 2.0e-6_wp
    call s%init(errors)
    call test%check('a sphere and a plate', .not. errors%any())
  end subroutine make_pressed

  !> A plate that loads a sphere with 2 N downwards and has a velocity of its own across: force,
  !! stiffness along and across, place, what is left of both.
  subroutine check_surface_servo()
    type(dem_system_type) :: s
    type(surface_servo_type) :: servo
    type(curve_type) :: none(0)
    type(error_list_type) :: errors
    real(wp), parameter :: r = 1.0e-3_wp, kn = 1.0e5_wp, kt = 0.4e5_wp, wanted = 2.0_wp
    real(wp), parameter :: down(3) = [0.0_wp, 0.0_wp, -1.0_wp]
    integer(i4) :: k

    call make_pressed(s, r, kn, kt)
    allocate (servo%servo(1), servo%name(1))
    servo%name(1)%s = 'plate'
    servo%velocity = s%surfaces%velocity
    servo%curved = [.false.]
    servo%servo(1)%body = 1
    servo%servo(1)%force = wanted
    servo%servo(1)%direction = down
    servo%servo(1)%speed = 0.05_wp
    servo%servo(1)%gain = 0.2_wp
    servo%servo(1)%tolerance = 1.0e-6_wp
    servo%servo(1)%until = huge(1.0_wp)
    call servo%start(s%dem_data_type, 0.0_wp)
    call servo%update(s%dem_data_type, 0.0_wp, none)
    call test%check_close('a plate without contact comes at its speed', &
                          s%surfaces%velocity(3, 1), -0.05_wp, 0.0_wp)
    do k = 1, 5000
      call s%step(10, errors)
      call servo%update(s%dem_data_type, 10*k*s%par%dt, none)
    end do
    call test%check('no faults', .not. errors%any())
    call test%check_close('force on the plate', s%surfaces%sums%force(3, 1), wanted, 1.0e-6_wp)
    call test%check_close('where it stands', s%surfaces%centre(3, 1), &
                          2.0_wp*r - 2.0_wp*wanted/kn, 1.0e-10_wp)
    call test%check_close('its own way across', s%surfaces%centre(1, 1), 0.001_wp, 1.0e-12_wp)
    call test%check_close('stiffness along', surface_stiffness_along(s%dem_data_type, 1, down), &
                          kn, 1.0e-6_wp)
    call test%check_close('stiffness across', &
      surface_stiffness_along(s%dem_data_type, 1, [1.0_wp, 0.0_wp, 0.0_wp]), kt, 1.0e-6_wp)
    call test%check('satisfied', servo%satisfied(s%dem_data_type))
    servo%servo(1)%force = 3.0_wp
    call servo%update(s%dem_data_type, 1.0_wp, none)
    call test%check('a new target is not held', .not. servo%satisfied(s%dem_data_type))
    call servo%judge(s%dem_data_type, 1.0_wp, 'deck.nml', errors)
    call test%check('and is a fault', errors%any())
    servo%servo(1)%until = 0.5_wp
    call servo%update(s%dem_data_type, 1.0_wp, none)
    call test%check_close('ended: its own velocity', s%surfaces%velocity(3, 1), 0.0_wp, 0.0_wp)
  end subroutine check_surface_servo

  !> A box 2 x 3 x 4 whose z walls move: x and y follow, both by one factor; then x alone.
  subroutine check_volume()
    type(dem_system_type) :: s
    type(constant_volume_type) :: volume
    real(wp), parameter :: ahead = 1.0e-3_wp
    real(wp) :: point(3, 6), normal(3, 6), v(3, 6), length(3), worst
    integer(i4) :: k
    point = 0.0_wp
    normal = 0.0_wp
    v = 0.0_wp
    do k = 1, 3
      normal(k, 2*k - 1) = 1.0_wp
      normal(k, 2*k) = -1.0_wp
      point(k, 2*k) = 1.0_wp + k
    end do
    call make_planes(s%planes, point(:, :5), normal(:, :5), v(:, :5), [1, 1, 1, 1, 1])
    call test%check('no box', all(box_pairs(s%dem_data_type) == 0))
    call make_planes(s%planes, point, normal, v, [1, 1, 1, 1, 1, 1])
    volume%pair = box_pairs(s%dem_data_type)
    call test%check('a box', all(volume%pair == reshape([1, 2, 3, 4, 5, 6], [2, 3])))
    volume%active = .true.
    volume%since = 0.5_wp
    volume%moves = [.true., .true., .false.]
    call volume%set(s%dem_data_type, 0.4_wp, ahead)
    call test%check('not before its time', .not. s%kept_volume > 0.0_wp)
    worst = 0.0_wp
    do k = 1, 500
      if (k == 300) volume%moves(2) = .false.
      s%planes%velocity = 0.0_wp
      s%planes%velocity(3, 5) = sin(0.1_wp*k)
      s%planes%velocity(3, 6) = -cos(0.03_wp*k)
      call volume%set(s%dem_data_type, 0.5_wp + k*ahead, ahead)
      s%planes%point = s%planes%point + ahead*s%planes%velocity
      length = [(s%planes%point(k/2, k) - s%planes%point(k/2, k - 1), k=2, 6, 2)]
      worst = larger(worst, abs(product(length)/24.0_wp - 1.0_wp))
      if (k == 299) call test%check_close('one factor', length(2)/length(1), 1.5_wp, 1.0e-13_wp)
    end do
    call test%check_close('the volume stays', worst, 0.0_wp, 1.0e-13_wp)
    call test%check_close('y has stopped', length(2)/length(1), &
                          1.5_wp*(length(2)/3.0_wp)**2*length(3)/4.0_wp, 1.0e-12_wp)
    call test%check_close('both walls share', s%planes%point(1, 1) + s%planes%point(1, 2), 2.0_wp, &
                          1.0e-13_wp)
  end subroutine check_volume
end program test_dem_servo
