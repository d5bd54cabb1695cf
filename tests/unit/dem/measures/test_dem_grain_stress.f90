!> Stresses of single grains: nominal areas of turned ellipsoids, the octahedral stress of a sphere
!! between two forces, all criteria of a row of spheres between planes.
program test_dem_grain_stress
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_ellipsoid, only: rotation_of, shape_matrix
  use dem_grain_stress, only: grain_stress_type, find_stresses, spare_safe, nominal_area, &
    octahedral_of, criterion_none, criterion_nominal, criterion_hertz, criterion_octahedral
  use dem_law, only: make_law, make_linear_law
  use dem_make, only: make_grains, make_planes
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: axes(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]
  real(wp), parameter :: radius = 1.0e-3_wp, overlap = 1.0e-6_wp

  call check_areas()
  call check_octahedral()
  call check_row(.false.)
  call check_row(.true.)
  call check_pressure()
  call test%finish()

contains

  !> 4 a_i a_k along the axes; a turned load as another program has it.
  subroutine check_areas()
    real(wp) :: a(6), quat(4)
    a = shape_matrix(rotation_of([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]), axes)
    call test%check_close('along a', nominal_area(a, axes, [1.0_wp, 0.0_wp, 0.0_wp]), &
                          4.0_wp*axes(1)*axes(3), 1.0e-18_wp)
    call test%check_close('along b', nominal_area(a, axes, [0.0_wp, -2.0_wp, 0.0_wp]), &
                          4.0_wp*axes(2)*axes(3), 1.0e-18_wp)
    call test%check_close('along c', nominal_area(a, axes, [0.0_wp, 0.0_wp, 0.1_wp]), &
                          4.0_wp*axes(3)*axes(2), 1.0e-18_wp)
    quat = [0.9_wp, 0.1_wp, -0.3_wp, 0.2_wp]
    a = shape_matrix(rotation_of(quat/norm2(quat)), axes)
    call test%check_close('turned', nominal_area(a, axes, [0.3_wp, 0.5_wp, -0.8_wp]), &
                          1.2047322005417552e-5_wp, 1.0e-17_wp)
  end subroutine check_areas

  !> sqrt(2)/3 6/pi / 0.9 of two opposite forces; nothing of equal pressure.
  subroutine check_octahedral()
    real(wp) :: tensor(6)
    tensor = 0.0_wp
    tensor(3) = -2.0_wp*radius*7.0_wp
    call test%check_close('two forces', octahedral_of(tensor, [radius, radius, radius]) &
                          /(7.0_wp/(2.0_wp*radius)**2), sqrt(2.0_wp)/3.0_wp*6.0_wp/pi/0.9_wp, &
                          1.0e-12_wp)
    tensor(1:3) = 5.0_wp
    call test%check_close('pressure', octahedral_of(tensor, [radius, radius, radius]), 0.0_wp, &
                          1.0e-6_wp)
  end subroutine check_octahedral

  !> Two spheres one upon the other between planes: those of a known overlap.
  subroutine check_row(linear)
    logical, intent(in) :: linear
    type(dem_system_type) :: s
    type(grain_stress_type) :: found
    type(error_list_type) :: errors
    real(wp) :: force, x(3, 2), zero(3, 2)
    real(wp), parameter :: kn = 1.0e6_wp
    allocate (s%materials(2), s%laws(2, 2))
    s%materials%density = 2650.0_wp
    s%materials%young = 1.0e9_wp
    s%materials%poisson = 0.25_wp
    s%laws = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, 0.0_wp)
    if (linear) s%laws = make_linear_law(kn, kn, 0.5_wp, 0.0_wp, 0.0_wp)
    zero = 0.0_wp
    x = 0.0_wp
    x(3, :) = [radius, 3.0_wp*radius - overlap]
    call make_grains(s%grains, s%materials, [1_i8, 2_i8], [kind_free, kind_free], [1_i4, 1_i4], x, &
                     spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 2), zero + radius, zero, zero, &
                     errors)
    call make_planes(s%planes, reshape([0.0_wp, 0.0_wp, overlap], [3, 1]), &
                     reshape([0.0_wp, 0.0_wp, 1.0_wp], [3, 1]), zero(:, :1), [2_i4])
    s%par%dt = 1.0e-8_wp
    call s%init(errors)
    call test%check('no faults', .not. errors%any())
    ! on the plane R_e = R, between the spheres R/2
    force = 4.0_wp/3.0_wp*s%laws(1, 1)%e_star*sqrt(radius*overlap**3)
    if (linear) force = kn*overlap
    call find_stresses(s%dem_data_type, [criterion_nominal, criterion_none], found)
    call test%check_all_close('nominal', found%stress, [force, merge(1.0_wp, sqrt(0.5_wp), linear) &
                          *force]/(4.0_wp*radius**2), 1.0e-9_wp*force/radius**2)
    call find_stresses(s%dem_data_type, [criterion_octahedral, criterion_none], found)
    call test%check('octahedral', found%stress(1) > found%stress(2) .and. found%stress(2) > 0.0_wp)
    call check_spared(s, found%stress)
    call find_stresses(s%dem_data_type, [criterion_none, criterion_nominal], found)
    call test%check_all_close('none of this material', found%stress, [0.0_wp, 0.0_wp], 0.0_wp)
    if (linear) return
    call find_stresses(s%dem_data_type, [criterion_nominal, criterion_none], found)
    call test%check_all_close('the largest below', found%toward(:, 1), &
                              [0.0_wp, 0.0_wp, -radius], 2.0_wp*overlap)
    call find_stresses(s%dem_data_type, [criterion_hertz, criterion_none], found)
    call test%check_close('pressure, that of the sharper contact', found%stress(1), &
                          sqrt(2.0_wp)*force/(pi*radius*overlap), &
                          1.0e-9_wp*force/(pi*radius*overlap))
  end subroutine check_row

  !> Two spheres pressed by the force that is the limit of a contact pressure of 1.9 GPa at
  !! E* = 35 GPa and R_e = 0.5 mm, as another program has it.
  subroutine check_pressure()
    type(dem_system_type) :: s
    type(grain_stress_type) :: found
    type(error_list_type) :: errors
    real(wp), parameter :: limit = 24.413883491729447_wp, pressure = 1.9e9_wp, e_star = 35.0e9_wp
    real(wp) :: x(3, 2), zero(3, 2), squeezed
    allocate (s%materials(1), s%laws(1, 1))
    s%materials%density = 2650.0_wp
    s%materials%poisson = 0.25_wp
    s%materials%young = 2.0_wp*e_star*(1.0_wp - 0.25_wp**2)
    s%laws = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, 0.0_wp)
    squeezed = (limit/(4.0_wp/3.0_wp*e_star*sqrt(0.5_wp*radius)))**(2.0_wp/3.0_wp)
    zero = 0.0_wp
    x = 0.0_wp
    x(1, 2) = 2.0_wp*radius - squeezed
    call make_grains(s%grains, s%materials, [1_i8, 2_i8], [kind_free, kind_free], [1_i4, 1_i4], x, &
                     spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, 2), zero + radius, zero, zero, &
                     errors)
    s%par%dt = 1.0e-8_wp
    call s%init(errors)
    call test%check('no faults', .not. errors%any())
    call find_stresses(s%dem_data_type, [criterion_hertz], found)
    call test%check_all_close('pressure at the limit', found%stress, [pressure, pressure], &
                              1.0e-11_wp*pressure)
    call test%check_all_close('force at the limit', found%force, [limit, limit], 1.0e-11_wp*limit)
  end subroutine check_pressure

  !> Grains above their strength have their stress to the bit, those far below it are passed over:
  !! the sum of the forces bounds the stress of the lower sphere to 1.1 times itself.
  subroutine check_spared(s, whole)
    type(dem_system_type), intent(in) :: s
    real(wp), intent(in) :: whole(:)  !! octahedral stresses of all [Pa]
    integer(i4), parameter :: criterion(2) = [criterion_octahedral, criterion_none]
    type(grain_stress_type) :: found
    call spare_safe(found, s%dem_data_type, criterion, 0.999_wp*whole)
    call find_stresses(s%dem_data_type, criterion, found)
    call test%check_all_close('above their strength', found%stress, whole, 0.0_wp)
    call spare_safe(found, s%dem_data_type, criterion, 1.2_wp*whole(1)*[1.0_wp, 1.0_wp])
    call find_stresses(s%dem_data_type, criterion, found)
    call test%check_all_close('passed over', found%stress, [0.0_wp, 0.0_wp], 0.0_wp)
  end subroutine check_spared
end program test_dem_grain_stress
