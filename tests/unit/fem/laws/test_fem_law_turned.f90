!> Isotropy of laws with a state: a path of strain that is turned as a whole, about an axis that is
!! none of the mesh's, gives the turned stress, turned states (plastic strain; axis, fabric and
!! start of loading of sand), the turned tangent, and the same scalars. Its legs load, turn back and
!! load in another direction.
program test_fem_law_turned
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use fem_law, only: integrate, fem_law_type, at_flag, at_plastic, at_stored, at_numerical, &
    common_size, flag_yielding
  use fem_law_breakage, only: fem_law_breakage_type, grading_index
  use fem_law_clay, only: fem_law_clay_type
  use fem_law_drucker, only: fem_law_drucker_type
  use fem_law_sanisand, only: fem_law_sanisand_type
  use fem_voigt, only: unit, twice
  implicit none
  type(test_type) :: test
  real(wp), parameter :: axis(3) = [2.0_wp, -1.0_wp, 3.0_wp]/sqrt(14.0_wp)
  real(wp), parameter :: angle = 1.1_wp  !! [rad]
  real(wp), parameter :: legs(6, 3) = reshape([ &
    0.2_wp, 0.4_wp, -1.0_wp, 0.5_wp, -0.7_wp, 0.2_wp, &
    -0.1_wp, -0.3_wp, 0.5_wp, -0.4_wp, 0.3_wp, -0.3_wp, &
    -0.9_wp, 0.1_wp, 0.3_wp, 0.1_wp, 0.6_wp, -0.8_wp], [6, 3])
  integer(i4), parameter :: steps = 8  !! of a leg
  real(wp) :: q(3, 3)

  q = turn_about(axis, angle)
  call check_drucker()
  call check_clay()
  call check_sand()
  call check_breakage()
  call test%finish()

contains

  !> Rotation about a unit axis (Rodrigues).
  pure function turn_about(along, by) result(r)
    real(wp), intent(in) :: along(3), by
    real(wp) :: r(3, 3), cross(3, 3)
    integer(i4) :: k
    cross = reshape([0.0_wp, along(3), -along(2), -along(3), 0.0_wp, along(1), along(2), &
                     -along(1), 0.0_wp], [3, 3])
    r = sin(by)*cross + (1.0_wp - cos(by))*matmul(cross, cross)
    do k = 1, 3
      r(k, k) = r(k, k) + 1.0_wp
    end do
  end function turn_about

  !> A symmetric tensor, turned.
  pure function turned(a) result(b)
    real(wp), intent(in) :: a(6)
    real(wp) :: b(6), t(3, 3)
    t = reshape([a(1), a(4), a(6), a(4), a(2), a(5), a(6), a(5), a(3)], [3, 3])
    t = matmul(q, matmul(t, transpose(q)))
    b = [t(1, 1), t(2, 2), t(3, 3), t(1, 2), t(2, 3), t(3, 1)]
  end function turned

  !> Follow the legs as they are and turned, from isotropic pressure; `tensors` are the places of
  !! states that turn, `scalars` of those that do not.
  subroutine check_law(law, pressure, size_of, tensors, scalars, limits)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: pressure, size_of  !! [Pa], [-] of each increment
    integer(i4), intent(in) :: tensors(:), scalars(:)
    real(wp), intent(in) :: limits(2)  !! of stress and states, of the tangent; relative
    real(wp) :: limit, stress(6, 2), state(law%states, 2), tangent(6, 6, 2), strain(6), largest
    character(len=:), allocatable :: name
    integer(i4) :: leg, k, j, yields

    name = trim(law%name)
    limit = limits(1)
    call begin_both(law, pressure, stress, state)
    yields = 0
    do leg = 1, size(legs, 2)
      strain = size_of*legs(:, leg)
      do k = 1, steps
        call advance(law, strain, stress(:, 1), state(:, 1), tangent(:, :, 1))
        call advance(law, twice*turned(strain/twice), stress(:, 2), state(:, 2), tangent(:, :, 2))
        largest = max_abs(stress(:, 1))
        call test%check_all_close(name//': stress', (stress(:, 2) - turned(stress(:, 1)))/largest, &
                                  0.0_wp, limit)
        if (state(at_flag, 1) >= flag_yielding) yields = yields + 1
      end do
    end do
    call test%check(name//': yields in half of the increments', 2*yields >= 3*steps)
    associate (plastic => state(at_plastic:at_plastic + 5, :))
      call test%check_all_close(name//': plastic strain', (plastic(:, 2) - twice*turned( &
        plastic(:, 1)/twice))/max_abs(plastic(:, 1)), 0.0_wp, limit)
    end associate
    do k = 1, int(size(tensors), i4)
      j = tensors(k)
      largest = max_abs(state(j:j + 5, 1))
      call test%check(name//': a state that is not zero', largest > 1.0e-2_wp)
      call test%check_all_close(name//': '//trim(law%state_names(j - common_size)), &
        (state(j:j + 5, 2) - turned(state(j:j + 5, 1)))/largest, 0.0_wp, limit)
    end do
    do k = 1, int(size(scalars), i4)
      j = scalars(k)
      call test%check_close(name//': a scalar', state(j, 2)/state(j, 1), 1.0_wp, limit)
    end do
    strain = size_of*[0.3_wp, -0.5_wp, 0.2_wp, 0.7_wp, -0.4_wp, 0.9_wp]
    associate (there => matmul(tangent(:, :, 1), strain))
      call test%check_all_close(name//': tangent', (matmul(tangent(:, :, 2), &
        twice*turned(strain/twice)) - turned(there))/max_abs(there), 0.0_wp, &
        limits(2))
    end associate
  end subroutine check_law

  subroutine begin_both(law, pressure, stress, state)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: pressure
    real(wp), intent(out) :: stress(6, 2), state(law%states, 2)
    character(len=:), allocatable :: fault, cure
    integer(i4) :: k
    do k = 1, 2
      stress(:, k) = -pressure*unit
      call law%begin(stress(:, k), state(:, k), fault, cure)
      call test%check_text(trim(law%name)//': begins', fault, '')
    end do
  end subroutine begin_both

  subroutine advance(law, strain, stress, state, tangent)
    class(fem_law_type), intent(in) :: law
    real(wp), intent(in) :: strain(6)
    real(wp), intent(inout) :: stress(6), state(:)
    real(wp), intent(out) :: tangent(6, 6)
    logical :: good
    call integrate(law, strain, stress, state, tangent, good)
    call test%check(trim(law%name)//': converges', good)
  end subroutine advance

  subroutine check_drucker()
    type(fem_law_drucker_type) :: law
    integer(i4), parameter :: none(0) = [integer(i4) ::]
    call law%define()
    law%bulk = 1.0e7_wp
    law%shear = 6.0e6_wp
    law%cone%a = 0.9_wp
    law%cone%b = 0.8_wp
    law%cone%a_flow = 1.0_wp
    law%cone%b_flow = 0.2_wp
    law%cone%cohesion = 100.0_wp
    law%cone%hardening = 1.0e4_wp
    call check_law(law, 500.0_wp, 2.0e-4_wp, none, [at_stored, at_stored + 1_i4, &
      common_size + 1_i4], [1.0e-11_wp, 1.0e-10_wp])
  end subroutine check_drucker

  subroutine check_clay()
    type(fem_law_clay_type) :: law
    integer(i4), parameter :: none(0) = [integer(i4) ::]
    call law%define()
    law%slope = 1.2_wp
    law%swelling = 0.005_wp
    law%plastic = 0.05_wp
    law%ratio = 0.5_wp
    law%overconsolidation = 1.5_wp
    call check_law(law, 1.0e5_wp, 2.0e-3_wp, none, [at_stored, common_size + 1_i4], &
                   [1.0e-11_wp, 1.0e-10_wp])
  end subroutine check_clay

  !> Dense sand, so that it dilates and its fabric grows. The sub-steps are the same; the tangent is
  !! by differences in a strain that changes by 1e-5.
  subroutine check_sand()
    type(fem_law_sanisand_type) :: law
    call law%define()
    law%void_ratio = 0.72_wp
    law%least_void = 0.8_wp*law%void_ratio
    associate (sand => law%sand)
      sand%shear = 125.0_wp
      sand%ratio = 2.0_wp*1.05_wp/(3.0_wp*0.9_wp)
      sand%slope = 1.25_wp
      sand%extension = 0.712_wp
      sand%line_void = 0.934_wp
      sand%line_slope = 0.019_wp
      sand%hardening = 7.05_wp
      sand%hardening_void = 0.968_wp
      sand%bounding_rate = 1.1_wp
      sand%dilatancy = 0.704_wp
      sand%dilatancy_rate = 3.5_wp
      sand%fabric_limit = 4.0_wp
      sand%fabric_rate = 600.0_wp
      sand%residual = 500.0_wp
      sand%least = 50.0_wp
    end associate
    call check_law(law, 1.0e5_wp, 1.0e-3_wp, common_size + [1_i4, 7_i4, 13_i4], &
                   common_size + [19_i4, 20_i4], [1.0e-9_wp, 1.0e-4_wp])
  end subroutine check_sand

  subroutine check_breakage()
    type(fem_law_breakage_type) :: law
    integer(i4), parameter :: none(0) = [integer(i4) ::]
    call law%define()
    law%bulk = 13833.0e6_wp
    law%shear = 7588.0e6_wp
    law%slope = 1.7_wp
    law%critical = 4.65e6_wp
    law%crush = cos(70.0_wp*acos(-1.0_wp)/180.0_wp)**2
    law%index = grading_index(0.001_wp/0.105_wp, 2.6_wp)
    call check_law(law, 2.0e8_wp, 4.0e-3_wp, none, [at_stored, at_numerical, common_size + 1_i4, &
      common_size + 2_i4], [1.0e-10_wp, 1.0e-10_wp])
  end subroutine check_breakage
end program test_fem_law_turned
