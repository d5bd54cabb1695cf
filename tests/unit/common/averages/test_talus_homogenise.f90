!> Regions, stress, couple stress, fabrics, moduli and coarse-grained fields of made-up samples.
program test_talus_homogenise
  use talus_kinds, only: wp, i4
  use talus_coarse, only: grid_type, fields_type, coarse_grain, kernel_lucy
  use talus_homogenise, only: branch_inside, love_weber, couple_stress, &
    velocity_gradient, inverse_of
  use talus_measures, only: request_type, measure_columns, measure_row, moduli_columns, moduli_row
  use talus_micro_moduli, only: micro_type, micro_moduli, gradient_moduli, gradient_basis
  use talus_moduli, only: affine_moduli, isotropic_part, isotropic_type
  use talus_region, only: region_type, region_box, region_cylinder, region_sphere, ball_points
  use talus_sample, only: sample_type, rotation_matrix
  use talus_test, only: max_abs, test_type
  use talus_text, only: string_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: kn = 3.0e5_wp, ks = 2.0e5_wp

  call check_regions()
  call check_sphere()
  call check_grain_parts()
  call check_pair()
  call check_isotropic_moduli()
  call check_motion()
  call check_fields()
  call check_rows()
  call check_rattlers()
  call check_micro_strains()
  call check_micro_gradients()
  call test%finish()

contains

  !> Two unit spheres of the given places, one contact in the middle moved by `off`.
  subroutine make_pair(sample, off, force)
    type(sample_type), intent(inout) :: sample
    real(wp), intent(in) :: off(3), force(3)
    integer(i4) :: i
    call sample%make(2, 1)
    sample%x(:, 2) = [2.0_wp, 0.0_wp, 0.0_wp]
    sample%axes = 1.0_wp
    sample%mass = [2.0_wp, 3.0_wp]
    sample%volume = 4.0_wp
    do i = 1, 2
      sample%turn(:, :, i) = rotation_matrix([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end do
    sample%first = 1
    sample%second = 2
    sample%point(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp] + off
    sample%normal(1, 1) = 1.0_wp
    sample%force(:, 1) = force
    sample%stiffness(:, 1) = [kn, ks]
  end subroutine make_pair

  !> A sphere of radius 2 about (1, 0, 0): volume, points, segments, the lens of two equal spheres.
  subroutine check_sphere()
    type(region_type) :: ball
    real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                                 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
    ball%kind = region_sphere
    ball%base = [1.0_wp, 0.0_wp, 0.0_wp]
    ball%radius = 2.0_wp
    call test%check_close('volume of a sphere', ball%volume(), 32.0_wp/3.0_wp*acos(-1.0_wp), &
                          1.0e-13_wp)
    call test%check('its middle', all(abs(ball%centre() - ball%base) <= 0.0_wp))
    call test%check('inside', ball%contains([2.9_wp, 0.0_wp, 0.0_wp]))
    call test%check('outside', .not. ball%contains([1.0_wp, 1.5_wp, -1.5_wp]))
    call test%check_close('segment through a sphere', ball%part_of_segment( &
      [-3.0_wp, 0.0_wp, 0.0_wp], [5.0_wp, 0.0_wp, 0.0_wp]), 0.5_wp, 1.0e-15_wp)
    call test%check_close('segment that ends inside', ball%part_of_segment( &
      [1.0_wp, 0.0_wp, 0.0_wp], [1.0_wp, 8.0_wp, 0.0_wp]), 0.25_wp, 1.0e-15_wp)
    call test%check_close('segment beside it', ball%part_of_segment( &
      [-3.0_wp, 2.5_wp, 0.0_wp], [5.0_wp, 2.5_wp, 0.0_wp]), 0.0_wp, 0.0_wp)
    call test%check_close('lens of equal spheres, a radius apart', ball%part_of_grain( &
      [3.0_wp, 0.0_wp, 0.0_wp], spread(2.0_wp, 1, 3), unit, spread(2.0_wp, 1, 3), &
      ball_points(60)), 5.0_wp/16.0_wp, 1.0e-3_wp)
    call test%check_close('a grain within', ball%part_of_grain([1.5_wp, 0.0_wp, 0.0_wp], &
      spread(1.0_wp, 1, 3), unit, spread(1.0_wp, 1, 3), ball_points(2)), 1.0_wp, 0.0_wp)
    call test%check_close('a grain out of reach', ball%part_of_grain([4.5_wp, 0.0_wp, 0.0_wp], &
      spread(1.0_wp, 1, 3), unit, spread(1.0_wp, 1, 3), ball_points(2)), 0.0_wp, 0.0_wp)
  end subroutine check_sphere

  !> Volumes, points and parts of segments.
  subroutine check_regions()
    type(region_type) :: box, tube
    box%kind = region_box
    box%lower = [0.0_wp, 0.0_wp, 0.0_wp]
    box%upper = [1.0_wp, 2.0_wp, 3.0_wp]
    call test%check_close('volume of a box', box%volume(), 6.0_wp, 1.0e-14_wp)
    call test%check('lower corner is inside', box%contains(box%lower))
    call test%check('upper corner is outside', .not. box%contains(box%upper))
    call test%check_close('segment through a box', box%part_of_segment( &
      [-1.0_wp, 1.0_wp, 1.0_wp], [3.0_wp, 1.0_wp, 1.0_wp]), 0.25_wp, 1.0e-15_wp)
    call test%check_close('segment past a box', box%part_of_segment( &
      [-1.0_wp, 3.0_wp, 1.0_wp], [3.0_wp, 3.0_wp, 1.0_wp]), 0.0_wp, 0.0_wp)
    tube%kind = region_cylinder
    tube%axis = [0.0_wp, 1.0_wp, 0.0_wp]
    tube%radius = 0.5_wp
    tube%length = 2.0_wp
    call test%check_close('volume of a cylinder', tube%volume(), 0.5_wp*acos(-1.0_wp), 1.0e-14_wp)
    call test%check_close('segment across a cylinder', tube%part_of_segment( &
      [-1.0_wp, 1.0_wp, 0.3_wp], [1.0_wp, 1.0_wp, 0.3_wp]), 0.4_wp, 1.0e-14_wp)
    call test%check_close('segment along a cylinder', tube%part_of_segment( &
      [0.1_wp, -2.0_wp, 0.3_wp], [0.1_wp, 3.0_wp, 0.3_wp]), 0.4_wp, 1.0e-14_wp)
    call test%check_close('segment along it, outside', tube%part_of_segment( &
      [0.6_wp, -2.0_wp, 0.3_wp], [0.6_wp, 3.0_wp, 0.3_wp]), 0.0_wp, 0.0_wp)
    call test%check('centre of a cylinder', all(abs(tube%centre() - tube%axis) < 1.0e-15_wp))
  end subroutine check_regions

  !> An ellipsoid cut in halves and by a cap, and one wholly in and out.
  subroutine check_grain_parts()
    type(region_type) :: box
    real(wp) :: turn(3, 3), axes(3), half(3), points(3, 1)
    real(wp), allocatable :: many(:, :)
    many = ball_points(40)
    box%kind = region_box
    box%lower = -10.0_wp
    box%upper = [10.0_wp, 10.0_wp, 0.0_wp]
    axes = [3.0_wp, 2.0_wp, 1.0_wp]
    turn = rotation_matrix([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    half = axes
    points = 0.0_wp
    call test%check_close('half an ellipsoid', box%part_of_grain( &
      [0.0_wp, 0.0_wp, 0.0_wp], half, turn, axes, many), 0.5_wp, 1.0e-12_wp)
    ! a cap of height h of the unit ball is h^2 (3 - h)/4 of it
    call test%check_close('a cap of an ellipsoid', box%part_of_grain( &
      [0.0_wp, 0.0_wp, 0.5_wp], half, turn, axes, many), 0.15625_wp, 2.0e-3_wp)
    call test%check_close('a grain inside', box%part_of_grain( &
      [0.0_wp, 0.0_wp, -2.0_wp], half, turn, axes, points), 1.0_wp, 0.0_wp)
    call test%check_close('a grain outside', box%part_of_grain( &
      [0.0_wp, 0.0_wp, 2.0_wp], half, turn, axes, points), 0.0_wp, 0.0_wp)
  end subroutine check_grain_parts

  !> Signs and indices; a boundary's branch ends at the point.
  subroutine check_pair()
    type(sample_type) :: sample
    type(region_type) :: box
    real(wp) :: sigma(3, 3), mu(3, 3), branch(3, 1), none(3)
    none = 0.0_wp
    box%kind = region_box
    box%lower = -5.0_wp
    box%upper = 5.0_wp
    call make_pair(sample, none, [-7.0_wp, 3.0_wp, 0.0_wp])
    branch(:, 1) = branch_inside(sample, box, 1)
    sigma = love_weber(sample, branch, 2.0_wp)
    call test%check_close('pushed pair', sigma(1, 1), -7.0_wp, 1.0e-14_wp)
    call test%check_close('sheared pair, xy', sigma(1, 2), 3.0_wp, 1.0e-14_wp)
    call test%check_close('sheared pair, yx', sigma(2, 1), 0.0_wp, 0.0_wp)
    mu = couple_stress(sample, branch, 2.0_wp)
    call test%check_all_close('no couple in the middle', mu, 0.0_wp, 0.0_wp)
    mu = couple_stress(sample, branch, 2.0_wp, [0.0_wp, 0.0_wp, 0.0_wp])
    call test%check_close('couple about an origin', mu(1, 3), 3.0_wp, 1.0e-14_wp)
    call make_pair(sample, [0.0_wp, 0.5_wp, 0.0_wp], [-7.0_wp, 0.0_wp, 0.0_wp])
    mu = couple_stress(sample, branch, 2.0_wp)
    call test%check_close('couple of an arm', mu(1, 3), 3.5_wp, 1.0e-14_wp)
    sample%first = 0
    sample%start(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
    sample%point(:, 1) = sample%start(:, 1)
    branch(:, 1) = branch_inside(sample, box, 1)
    call test%check_close('branch to a wall', branch(1, 1), 1.0_wp, 1.0e-15_wp)
  end subroutine check_pair

  !> Six diameters of the icosahedron are isotropic to fourth order: the formulas hold exactly.
  subroutine check_isotropic_moduli()
    type(sample_type) :: sample
    type(isotropic_type) :: iso
    real(wp) :: n(3, 6), c9(9, 9), b9(9, 9), d9(9, 9), g, a
    integer(i4) :: k
    g = 0.5_wp*(1.0_wp + sqrt(5.0_wp))
    n = reshape([0.0_wp, 1.0_wp, g, 0.0_wp, 1.0_wp, -g, 1.0_wp, g, 0.0_wp, 1.0_wp, -g, 0.0_wp, &
                 g, 0.0_wp, 1.0_wp, -g, 0.0_wp, 1.0_wp], [3, 6])/sqrt(1.0_wp + g*g)
    call sample%make(12, 6)
    do k = 1, 6
      sample%first(k) = k
      sample%second(k) = k + 6
      sample%x(:, k + 6) = 2.0_wp*n(:, k)
      sample%point(:, k) = n(:, k)
    end do
    sample%normal = n
    sample%stiffness(1, :) = kn
    sample%stiffness(2, :) = ks
    a = 6.0_wp*4.0_wp/3.0_wp
    call affine_moduli(sample, 2.0_wp*n, 3.0_wp, c9, b9, d9)
    iso = isotropic_part(c9, b9)
    call test%check_close('lambda', iso%lambda, a*(kn - ks)/15.0_wp, 1.0e-8_wp)
    call test%check_close('mu', iso%mu, a*(kn - ks)/15.0_wp, 1.0e-8_wp)
    call test%check_close('kappa', iso%kappa, a*ks/3.0_wp, 1.0e-8_wp)
    call test%check_close('bulk modulus', iso%bulk, a*kn/9.0_wp, 1.0e-8_wp)
    call test%check_close('shear modulus', iso%shear, a*(2.0_wp*kn + 3.0_wp*ks)/30.0_wp, 1.0e-8_wp)
    call test%check_close('the tensor is isotropic', c9(1, 1), iso%lambda + 2.0_wp*iso%shear, &
                          1.0e-8_wp)
    call test%check_close('no arm, no couples', max_abs(b9) + max_abs(d9), 0.0_wp, 0.0_wp)
    ! an arm s along the branch turned by 90 degrees: gamma = A tr<S'KS>/3
    do k = 1, 6
      sample%point(:, k) = n(:, k) + 0.1_wp*perpendicular(n(:, k))
    end do
    call affine_moduli(sample, 2.0_wp*n, 3.0_wp, c9, b9, d9)
    iso = isotropic_part(c9, b9)
    call test%check_close('trace of B', 3.0_wp*(iso%alpha + 3.0_wp*iso%gamma + iso%beta), &
                          a*0.01_wp*(kn + ks), 1.0e-8_wp)
    sample%sliding = .true.
    call affine_moduli(sample, 2.0_wp*n, 3.0_wp, c9, b9, d9)
    iso = isotropic_part(c9, b9)
    call test%check_close('sliding contacts do not shear', iso%kappa, 0.0_wp, 1.0e-8_wp)
  end subroutine check_isotropic_moduli

  pure function perpendicular(n) result(p)
    real(wp), intent(in) :: n(3)
    real(wp) :: p(3), axis(3)
    axis = 0.0_wp
    axis(minloc(abs(n), 1)) = 1.0_wp
    p = axis - dot_product(axis, n)*n
    p = p/norm2(p)
  end function perpendicular

  !> A linear velocity field is found; grains in a plane give none.
  subroutine check_motion()
    type(sample_type) :: sample
    real(wp) :: wanted(3, 3), g(3, 3), one(3, 3)
    logical :: picked(5)
    integer(i4) :: i
    wanted = reshape([1.0_wp, -2.0_wp, 0.5_wp, 3.0_wp, 0.0_wp, 1.0_wp, 4.0_wp, 2.0_wp, -1.0_wp], &
                     [3, 3])
    call sample%make(5, 0)
    sample%x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.1_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.3_wp, &
                        0.4_wp, 0.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, 2.0_wp], [3, 5])
    sample%mass = [1.0_wp, 2.0_wp, 1.0_wp, 3.0_wp, 0.5_wp]
    do i = 1, 5
      sample%v(:, i) = [5.0_wp, 6.0_wp, 7.0_wp] + matmul(wanted, sample%x(:, i))
    end do
    picked = .true.
    g = velocity_gradient(sample, picked)
    call test%check_all_close('velocity gradient', g, wanted, 1.0e-12_wp)
    one = rotation_matrix([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    call test%check_all_close('inverse', matmul(wanted, inverse_of(wanted)), one, &
                          1.0e-14_wp)
    sample%x(3, :) = 0.0_wp
    g = velocity_gradient(sample, picked)
    call test%check_all_close('none in a plane', g, 0.0_wp, 0.0_wp)
  end subroutine check_motion

  !> Sums over the grid are those of grains and contacts; a grain outside does not count.
  subroutine check_fields()
    type(sample_type) :: sample
    type(grid_type) :: grid
    type(fields_type) :: fields
    real(wp) :: cell
    call make_pair(sample, [0.0_wp, 0.0_wp, 0.2_wp], [-7.0_wp, 3.0_wp, 1.0_wp])
    sample%v = reshape([1.0_wp, 2.0_wp, 3.0_wp, -1.0_wp, 0.5_wp, 0.0_wp], [3, 2])
    grid%lower = -6.0_wp
    grid%upper = 8.0_wp
    grid%cells = [14, 20, 28]
    grid%width = 1.1_wp
    cell = product((grid%upper - grid%lower)/grid%cells)
    call coarse_grain(sample, grid, fields)
    call test%check_close('mass', sum(fields%density)*cell, 5.0_wp, 1.0e-13_wp)
    call test%check_close('momentum', sum(fields%momentum(2, :))*cell, 5.5_wp, 1.0e-13_wp)
    call test%check_close('stress xy', sum(fields%stress(2, :))*cell, 6.0_wp, 1.0e-13_wp)
    call test%check_close('stress yx', sum(fields%stress(4, :))*cell, 0.0_wp, 1.0e-13_wp)
    call test%check_close('fabric', sum(fields%fabric(1, :))*cell, 8.0_wp, 1.0e-13_wp)
    call test%check('motion is a pressure', all(fields%kinetic(1, :) <= 1.0e-15_wp))
    grid%kernel = kernel_lucy
    sample%x(:, 2) = 100.0_wp
    call coarse_grain(sample, grid, fields)
    call test%check_close('mass inside', sum(fields%density)*cell, 2.0_wp, 1.0e-13_wp)
  end subroutine check_fields

  !> A chain of three on a boundary unravels from its free end; a triangle beside it stays; a grain
  !! on a fixed one and on the boundary too.
  subroutine check_rattlers()
    type(sample_type) :: sample
    type(request_type) :: request
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: row(:)
    integer(i4) :: k
    call sample%make(8, 9)
    do k = 1, 8
      sample%x(:, k) = [real(k, wp), 0.0_wp, 0.0_wp]
      sample%turn(:, :, k) = rotation_matrix([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end do
    sample%axes = 0.1_wp
    sample%mass = 1.0_wp
    sample%inertia = 1.0_wp
    sample%volume = 1.0_wp
    sample%free(8) = .false.
    sample%first = [0, 1, 2, 4, 5, 4, 0, 7, 7]
    sample%second = [1, 2, 3, 5, 6, 6, 7, 8, 3]
    do k = 1, 9
      sample%normal(:, k) = [1.0_wp, 0.0_wp, 0.0_wp]
      sample%point(:, k) = sample%x(:, sample%second(k))
      sample%start(:, k) = sample%point(:, k)
    end do
    sample%first(9) = 4
    sample%second(9) = 1
    request%region%kind = region_box
    request%region%lower = -1.0_wp
    request%region%upper = 10.0_wp
    call measure_columns(names)
    call measure_row(0.0_wp, sample, request, row)
    call test%check_close('all contacts', row(column(names, 'coordination [-]')), 15.0_wp/7.0_wp, &
                          1.0e-15_wp)
    call test%check_close('two unravel', row(column(names, 'rattlers [-]')), 2.0_wp/7.0_wp, &
                          1.0e-15_wp)
    call test%check_close('the others among themselves', &
                          row(column(names, 'mechanical_coordination [-]')), 11.0_wp/5.0_wp, &
                          1.0e-15_wp)
  end subroutine check_rattlers

  !> Titles and rows have the same length; values are in the columns of the titles.
  subroutine check_rows()
    type(sample_type) :: sample
    type(request_type) :: request
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: row(:)
    call make_pair(sample, [0.0_wp, 0.0_wp, 0.0_wp], [-7.0_wp, 3.0_wp, 0.0_wp])
    request%region%kind = region_box
    request%region%lower = -5.0_wp
    request%region%upper = 5.0_wp
    call measure_columns(names)
    call measure_row(0.5_wp, sample, request, row)
    call test%check('a title for every number', size(names) == size(row))
    call test%check_close('time', row(1), 0.5_wp, 0.0_wp)
    call test%check_close('stress', row(column(names, 'stress_xx [Pa]')), -0.014_wp, 1.0e-16_wp)
    call test%check_close('coordination', row(column(names, 'coordination [-]')), 1.0_wp, 0.0_wp)
    call test%check_close('rattlers', row(column(names, 'rattlers [-]')), 1.0_wp, 0.0_wp)
    call test%check_close('spheres have no axis', row(column(names, 'fabric_short_axis_xx [-]')), &
                          1.0_wp/3.0_wp, 1.0e-15_wp)
    call test%check_close('solid fraction', row(column(names, 'solid_fraction [-]')), 8.0e-3_wp, &
                          1.0e-16_wp)
    call moduli_columns(names)
    call moduli_row(0.5_wp, sample, request, row)
    call test%check('a title for every modulus', size(names) == size(row))
    call test%check_close('C_xy_xy', row(column(names, 'C_xy_xy [Pa]')), 4.0_wp*ks/1000.0_wp, &
                          1.0e-10_wp)
    call test%check_close('C_yx_yx', row(column(names, 'C_yx_yx [Pa]')), 0.0_wp, 0.0_wp)
  end subroutine check_rows

  integer function column(names, title)
    type(string_type), intent(in) :: names(:)
    character(len=*), intent(in) :: title
    do column = 1, size(names)
      if (names(column)%s == title) return
    end do
    error stop 'bug: no such title'
  end function column

  !> The quadratic form of the 18 moduli is the energy of contacts and grains; its limits.
  subroutine check_micro_strains()
    type(isotropic_type) :: iso
    type(micro_type) :: m
    real(wp), parameter :: solid = 0.6_wp, grain(2) = [3.0_wp, 5.0_wp]
    real(wp) :: e(3, 3), w(3, 3), g(3, 3), phi(3, 3), energy, form, taus(11), series, soft
    iso%lambda = 1.3_wp
    iso%mu = 0.7_wp
    iso%kappa = 0.9_wp
    taus = 0.0_wp
    m = micro_moduli(iso, solid, grain(1), grain(2), taus)
    e = reshape([0.1_wp, 0.4_wp, -0.3_wp, 0.4_wp, 0.7_wp, 0.2_wp, -0.3_wp, 0.2_wp, -0.5_wp], [3, 3])
    w = reshape([0.3_wp, -0.1_wp, 0.8_wp, 0.5_wp, -0.2_wp, 0.6_wp, 0.9_wp, -0.4_wp, 0.1_wp], [3, 3])
    g = 2.0_wp*e - transpose(w)
    phi = 0.5_wp*(w + transpose(w)) - e
    energy = 0.5_wp*(iso%lambda*trace(g)**2 + (iso%mu + iso%kappa)*sum(g*g) &
                     + iso%mu*sum(g*transpose(g))) &
             + 0.5_wp*solid*(grain(1)*trace(phi)**2 + 2.0_wp*grain(2)*sum(phi*phi))
    form = 0.5_wp*m%lambda*trace(e)**2 + m%mu*sum(e*e) &
           + 0.5_wp*((m%eta - m%tau)*trace(w)**2 + (m%kappa - m%sigma)*sum(w*w) &
                     + (m%nu - m%sigma)*sum(w*transpose(w))) &
           + m%tau*trace(e)*trace(w) + 2.0_wp*m%sigma*sum(e*w)
    call test%check_close('energy of the strains', form, energy, 1.0e-13_wp)
    call test%check_close('micropolar lambda', m%lambda + m%eta + m%tau, iso%lambda, 1.0e-13_wp)
    call test%check_close('micropolar kappa', m%kappa - m%nu, iso%kappa, 1.0e-13_wp)
    soft = iso%mu + 0.5_wp*iso%kappa
    call test%check_close('micropolar G', m%mu + m%sigma + 0.5_wp*(m%kappa + m%nu), soft, &
                          1.0e-13_wp)
    series = soft*solid*grain(2)/(soft + solid*grain(2))
    call test%check_close('contacts and grains in series', &
      m%mu - 2.0_wp*m%sigma**2/(m%kappa + m%nu - 2.0_wp*m%sigma), series, 1.0e-13_wp)
  end subroutine check_micro_strains

  pure real(wp) function trace(t)
    real(wp), intent(in) :: t(3, 3)
    trace = t(1, 1) + t(2, 2) + t(3, 3)
  end function trace

  !> The eleven tensors are the isotropic part of the sum: what is left is at right angles to all of
  !! them, and an isotropic sum is found again. Contacts in the middle of the branch have none.
  subroutine check_micro_gradients()
    type(sample_type) :: sample
    real(wp), parameter :: volume = 3.0_wp, off(3) = [0.2_wp, 0.3_wp, -0.1_wp]
    real(wp) :: taus(11), whole(729), basis(729, 11), k(3, 3), l(3), branch(3, 1)
    integer(i4) :: at(6), place, i, rest
    call make_pair(sample, off, [0.0_wp, 0.0_wp, 0.0_wp])
    branch(:, 1) = sample%x(:, 2) - sample%x(:, 1)
    taus = gradient_moduli(sample, branch, volume)
    basis = gradient_basis()
    l = branch(:, 1)
    k = 0.0_wp
    k(1, 1) = kn
    k(2, 2) = ks
    k(3, 3) = ks
    do place = 1, 729
      rest = place - 1
      do i = 1, 6
        at(i) = 1 + mod(rest, 3)
        rest = rest/3
      end do
      whole(place) = k(at(1), at(4))*off(at(2))*off(at(5))*l(at(3))*l(at(6))/volume
    end do
    call test%check_close('nothing isotropic is left', &
      max_abs(matmul(whole - matmul(basis, taus), basis))/sum(whole**2), 0.0_wp, 1.0e-12_wp)
    call test%check('the isotropic part is not negative', &
                    dot_product(matmul(basis, taus), whole) > 0.0_wp)
    sample%point(:, 1) = 0.5_wp*(sample%x(:, 1) + sample%x(:, 2))
    taus = gradient_moduli(sample, branch, volume)
    call test%check_all_close('no arm, no gradient moduli', taus, 0.0_wp, 0.0_wp)
  end subroutine check_micro_gradients
end program test_talus_homogenise
