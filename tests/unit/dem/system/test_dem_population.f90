!> Grains leave and enter: those that stay keep what their contacts remember, forces are those of
!! the new system, and the ledger books what went and what came; of grains that grow, their work.
program test_dem_population
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type, max_abs
  use dem_law, only: make_law
  use dem_ledger, only: closure_of, refresh_stored
  use dem_make, only: make_grains
  use dem_start_springs, only: start_springs_type
  use dem_state, only: kind_free, dem_grains_type, dem_ledger_type
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 1.0e-3_wp

  call check_leaving()
  call check_return()
  call check_growth()
  call test%finish()

contains

  !> Spheres in a row along x that overlap by 1e-5 m, the first of which move along y.
  subroutine make_row(grains, s, ids)
    type(dem_grains_type), intent(inout) :: grains
    type(dem_system_type), intent(in) :: s  !! materials
    integer(i8), intent(in) :: ids(:)
    type(error_list_type) :: errors
    real(wp), dimension(3, size(ids)) :: x, v, zero
    integer(i4) :: k
    zero = 0.0_wp
    x = 0.0_wp
    v = 0.0_wp
    do k = 1, size(ids)
      x(1, k) = 1.99e-3_wp*ids(k)
      v(2, k) = 0.01_wp*modulo(ids(k), 2_i8)
    end do
    call make_grains(grains, s%materials, ids, spread(kind_free, 1, size(ids)), &
                     spread(1_i4, 1, size(ids)), x, &
                     spread([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], 2, size(ids)), zero + radius, v, &
                     zero, errors)
  end subroutine make_row

  subroutine make_system(s, ids)
    type(dem_system_type), intent(out) :: s
    integer(i8), intent(in) :: ids(:)
    type(error_list_type) :: errors
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%materials(1)%young = 1.0e9_wp
    s%materials(1)%poisson = 0.25_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    call make_row(s%grains, s, ids)
    s%open = .true.
    s%par%dt = 1.0e-7_wp
    call s%init(errors)
    call s%step(50, errors)
    call s%refresh_ledger()
    call test%check('no faults', .not. errors%any())
  end subroutine make_system

  !> Kinetic and elastic energy [J].
  real(wp) function energy_of(s) result(energy)
    type(dem_system_type), intent(in) :: s
    type(dem_ledger_type) :: now
    call refresh_stored(s%dem_data_type, s%par%dt, now)
    energy = now%kinetic + now%elastic_normal + now%elastic_tangential
  end function energy_of

  !> The fourth of four leaves: the others keep springs and forces, but for its own.
  subroutine check_leaving()
    type(dem_system_type) :: s
    type(dem_contacts_type) :: before, after
    real(wp) :: energy, closure, force(3, 4)
    call make_system(s, [1_i8, 2_i8, 3_i8, 4_i8])
    call s%contacts(before)
    energy = energy_of(s)
    force = s%grains%force
    closure = closure_of(s%ledger)
    call s%leave([.false., .false., .false., .true.])
    call s%contacts(after)
    call test%check('two contacts are left', before%n == 3 .and. after%n == 2)
    call test%check('springs there were', max_abs(before%spring(:, :2)) > 1.0e-4_wp)
    call test%check_close('springs are the same', max_abs(after%spring - before%spring(:, :2)), &
                          0.0_wp, 1.0e-14_wp*max_abs(before%spring))
    call test%check_close('forces on the first two', &
                          max_abs(s%grains%force(:, :2) - force(:, :2)), 0.0_wp, &
                          1.0e-14_wp*max_abs(force))
    call test%check_close('force on the third', &
                          max_abs(s%grains%force(:, 3) - force(:, 3) - before%force(:, 3)), &
                          0.0_wp, 1.0e-14_wp*max_abs(force))
    call test%check_close('what left is what is missing', s%ledger%left, energy - energy_of(s), &
                          1.0e-14_wp*energy)
    call s%refresh_ledger()
    call test%check_close('closure', closure_of(s%ledger), closure, 1.0e-14_wp*energy)
  end subroutine check_leaving

  !> It enters again, with the force of its contact: all is as before, and goes on as before.
  subroutine check_return()
    type(dem_system_type) :: s, other
    type(dem_contacts_type) :: before, after
    type(dem_grains_type) :: fourth
    type(start_springs_type) :: springs
    type(error_list_type) :: errors
    real(wp) :: energy
    call make_system(s, [1_i8, 2_i8, 3_i8, 4_i8])
    other = s
    call s%contacts(before)
    energy = energy_of(s)
    call make_row(fourth, s, [4_i8])
    fourth%x = s%grains%x(:, 4:)
    fourth%quat = s%grains%quat(:, 4:)
    fourth%v = s%grains%v(:, 4:)
    fourth%omega = s%grains%omega(:, 4:)
    call s%leave([.false., .false., .false., .true.])
    springs%ids = reshape([3_i8, 4_i8], [2, 1])
    springs%force = before%spring(:, 3:)
    springs%given = 1
    call s%enter(fourth, springs)
    call s%contacts(after)
    call test%check('three contacts again', after%n == 3)
    call test%check_close('springs', max_abs(after%spring - before%spring), 0.0_wp, &
                          1.0e-12_wp*max_abs(before%spring))
    call test%check_close('energy', energy_of(s), energy, 1.0e-12_wp*energy)
    call test%check_close('what came is what left', s%ledger%entered, s%ledger%left, &
                          1.0e-12_wp*energy)
    call s%step(200, errors)
    call other%step(200, errors)
    call test%check_close('as if it had stayed', max_abs(s%grains%v - other%grains%v), 0.0_wp, &
                          1.0e-9_wp*max_abs(other%grains%v))
    call s%refresh_ledger()
    call other%refresh_ledger()
    call test%check_close('closure', closure_of(s%ledger), closure_of(other%ledger), &
                          1.0e-9_wp*energy)
  end subroutine check_return

  !> Two of four grow: what the contacts store more, by Hertz's closed form, is the work of the
  !! growth; masses stay, and the ledger closes as before.
  subroutine check_growth()
    type(dem_system_type) :: s
    type(dem_contacts_type) :: before, after
    type(dem_ledger_type) :: now
    real(wp), parameter :: factor(4) = [1.0_wp, 1.002_wp, 1.0_wp, 1.004_wp]
    real(wp) :: energy, closure, mass(4), wanted, tangential
    integer(i4) :: k
    call make_system(s, [1_i8, 2_i8, 3_i8, 4_i8])
    call s%contacts(before)
    energy = energy_of(s)
    closure = closure_of(s%ledger)
    mass = s%grains%mass
    call s%resize(factor)
    call refresh_stored(s%dem_data_type, s%par%dt, now)
    wanted = 0.0_wp
    do k = 1, 3
      wanted = wanted + hertz_energy(factor(k)*radius, factor(k + 1)*radius, &
                                     norm2(s%grains%x(:, k + 1) - s%grains%x(:, k)))
    end do
    call test%check_close('energy of Hertz', now%elastic_normal, wanted, 1.0e-12_wp*wanted)
    call test%check_all_close('grown', s%grains%radius, factor*radius, 1.0e-15_wp*radius)
    call test%check_all_close('masses stay', s%grains%mass, mass, 0.0_wp)
    call test%check_close('work of the growth', s%ledger%growth, energy_of(s) - energy, &
                          1.0e-14_wp*energy_of(s))
    call test%check('of some size', s%ledger%growth > 0.1_wp*energy)
    call s%contacts(after)
    call test%check('springs there were', max_abs(before%spring) > 1.0e-4_wp)
    call test%check_close('springs are the same', max_abs(after%spring - before%spring), 0.0_wp, &
                          1.0e-14_wp*max_abs(before%spring))
    call s%refresh_ledger()
    call test%check_close('closure', closure_of(s%ledger), closure, 1.0e-14_wp*energy_of(s))
    tangential = now%elastic_tangential
    call s%resize(1.0_wp/factor)
    call test%check('and back, but for what springs lose as their contacts shrink', &
                    abs(s%ledger%growth) <= tangential .and. tangential < 1.0e-3_wp*wanted)
  end subroutine check_growth

  !> Of two spheres of 1 GPa and 0.25, (8/15) E* sqrt(R) overlap^(5/2) [J].
  pure real(wp) function hertz_energy(first, second, distance) result(energy)
    real(wp), intent(in) :: first, second, distance  !! radii, of the centres [m]
    real(wp), parameter :: modulus = 1.0e9_wp/(2.0_wp*(1.0_wp - 0.25_wp**2))
    energy = 8.0_wp/15.0_wp*modulus*sqrt(first*second/(first + second)) &
             *max(first + second - distance, 0.0_wp)**2.5_wp
  end function hertz_energy
end program test_dem_population
