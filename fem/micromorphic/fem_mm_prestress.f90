!> A micromorphic point that starts with a stress: at F = chi = 1 its elastic parts are stretches
!! along the principal axes of the stress, under which Cauchy and micro-stress are the given one;
!! their inverses are the plastic parts of the start.
module fem_mm_prestress
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dsyev
  use talus_text, only: str
  use fem_mm_cones, only: surfaces, surface_name, kind_ellipse
  use fem_mm_elastic, only: mm_elastic_type, mm_strain_type
  use fem_mm_flow, only: mm_law_type, mm_state_type, mm_old_type, mm_iterate_type, evaluate
  use fem_mm_tensor, only: determinant
  implicit none
  private
  public :: start_state, free_moduli, on_surface

  integer(i4), parameter :: most_iterations = 200
  real(wp), parameter :: accuracy = 4.0_wp*epsilon(1.0_wp)  !! of stretches
  real(wp), parameter :: on_surface = 1.0e-10_wp            !! f over modulus that counts as zero

contains

  !> State of a point that starts with a stress xx yy zz xy yz zx [Pa]; `fault` is what is wrong
  !! with it, '' if nothing is.
  subroutine start_state(law, stress, state, fault)
    type(mm_law_type), intent(in) :: law
    real(wp), intent(in) :: stress(6)
    type(mm_state_type), intent(out) :: state
    character(len=:), allocatable, intent(out) :: fault
    real(wp) :: axes(3, 3), principal(3), work(32), stretch(3), micro(3)
    type(mm_old_type) :: old
    type(mm_iterate_type) :: at
    type(mm_strain_type) :: none
    real(wp) :: size_of(surfaces)
    integer(i4) :: info, k

    fault = ''
    if (law%breaks .and. .not. law%cone(1)%tension > 0.0_wp .and. &
        .not. sum(stress(:3)) < 0.0_wp) then
      fault = 'breakage without tension needs a compressive mean stress, not p = '// &
        str(-sum(stress(:3))/3.0_wp)//' Pa'
      return
    end if
    if (any(abs(stress) > 0.0_wp)) then
      axes = reshape(stress([1, 4, 6, 4, 2, 5, 6, 5, 3]), [3, 3])
      call dsyev('V', 'U', 3, axes, 3, principal, work, size(work), info)
      if (info /= 0) error stop 'bug: principal stresses'
      call stretches(law%elastic, principal, stretch, micro, fault)
      if (len(fault) > 0) return
      state%fp = matmul(axes*spread(1.0_wp/stretch, 1, 3), transpose(axes))
      state%xp = matmul(axes*spread(1.0_wp/micro, 1, 3), transpose(axes))
    end if
    do k = 1, 2  ! p_c counts from here
      if (law%cone(k)%kind == kind_ellipse) state%z(k) = log(merge(determinant(state%fp), &
        determinant(state%xp), k == 1))
    end do
    at%state = state
    old%state = state
    call evaluate(law, none, old, at)
    size_of = law%modulus
    if (law%breaks) size_of(1) = 1.0_wp
    k = int(maxloc(at%yield/size_of, 1), i4)
    if (at%yield(k) > on_surface*size_of(k)) fault = 'the initial stress lies outside the '// &
      trim(surface_name(k))//' surface, f = '//str(at%yield(k))
  end subroutine start_state

  !> Moduli of chi against F: of its deviator, and of its trace. [Pa]
  pure subroutine relative_moduli(law, shear, bulk)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(out) :: shear, bulk
    shear = law%kappa + law%nu - 2.0_wp*law%sigma
    bulk = shear + 3.0_wp*(law%eta - law%tau)
  end subroutine relative_moduli

  !> Shear modulus and three times the bulk modulus where chi is free and homogeneous [Pa].
  pure function free_moduli(law) result(modulus)
    type(mm_elastic_type), intent(in) :: law
    real(wp) :: modulus(2), shear, bulk
    call relative_moduli(law, shear, bulk)
    modulus = [law%mu, 3.0_wp*law%lambda + 2.0_wp*law%mu]
    if (abs(shear*bulk) > 0.0_wp) modulus = modulus &
      - [2.0_wp*law%sigma**2/shear, (3.0_wp*law%tau + 2.0_wp*law%sigma)**2/bulk]
  end function free_moduli

  !> Principal stretches of F^e and chi^e: with P^ = 0, E^ is linear in E with the moduli of a
  !! free chi, and sigma_i = l_i^2 E^_i/(l_1 l_2 l_3).
  subroutine stretches(law, principal, stretch, micro, fault)
    type(mm_elastic_type), intent(in) :: law
    real(wp), intent(in) :: principal(3)  !! [Pa]
    real(wp), intent(out) :: stretch(3), micro(3)
    character(len=:), allocatable, intent(inout) :: fault
    real(wp) :: shear, bulk, e(3), trace, green(3), dual(3), last(3), modulus(2)
    integer(i4) :: k
    logical :: found

    found = .false.
    micro = 1.0_wp
    call relative_moduli(law, shear, bulk)
    modulus = free_moduli(law)
    stretch = 1.0_wp
    do k = 1, most_iterations
      dual = principal*product(stretch)/stretch**2
      trace = sum(dual)/modulus(2)
      green = (dual - sum(dual)/3.0_wp)/(2.0_wp*modulus(1)) + trace/3.0_wp
      last = stretch
      if (.not. all(1.0_wp + 2.0_wp*green > 0.0_wp)) exit
      stretch = sqrt(1.0_wp + 2.0_wp*green)
      found = all(abs(stretch - last) <= accuracy)
      if (found) exit
    end do
    if (.not. found) then
      fault = 'no elastic strain carries the initial stress of '//str(principal)
      return
    end if
    e = 0.0_wp
    if (abs(shear*bulk) > 0.0_wp) e = -(2.0_wp*law%sigma*green + (law%tau - (law%eta - law%tau) &
      *(3.0_wp*law%tau + 2.0_wp*law%sigma)/bulk)*sum(green))/shear
    micro = (1.0_wp + e)/stretch
  end subroutine stretches
end module fem_mm_prestress
