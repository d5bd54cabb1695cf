!> Return to the yield surfaces of the micromorphic solid: Newton's method with line search on the
!! plastic parts and the multipliers of the active surfaces, and the active set that satisfies
!! gamma >= 0, f <= 0, gamma f = 0 (theory: micromorphic plasticity).
module fem_mm_return
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgetrf, dgetrs
  use fem_mm_cones, only: surfaces, kind_cone, open_yield, cohesion_slope
  use fem_mm_elastic, only: mm_strain_type, mm_strain_d_type
  use fem_mm_flow, only: mm_law_type, mm_old_type, mm_iterate_type, mm_change_type
  use fem_mm_flow, only: mm_residual_d_type, evaluate, residual_of, change_strains, unit_columns
  use fem_mm_tensor, only: lanes, leg_two, leg_three, determinant
  implicit none
  private
  public :: mm_system_type, return_to_surfaces, factor_system, back_substitute, set_unknowns
  public :: pack_change, yield_scale, unpack_rows

  integer(i4), parameter :: most = 45 + surfaces  !! unknowns
  integer(i4), parameter :: most_iterations = 30, most_cuts = 8, most_sets = 12
  real(wp), parameter :: enough = 1.0e-10_wp      !! largest scaled residual [-]
  real(wp), parameter :: near = 1.0e-3_wp         !! above which a negative multiplier counts [-]
  real(wp), parameter :: least_strain = 1.0e-4_wp
  real(wp), parameter :: decrease = 1.0e-4_wp     !! least share of the predicted decrease

  !> The linear system of an iterate.
  type :: mm_system_type
    integer(i4) :: parts = 0        !! unknowns among the 45 plastic parts
    integer(i4) :: n = 0            !! all unknowns: parts, then active surfaces
    integer(i4) :: part(45) = 0     !! which of the 45
    integer(i4) :: surface(surfaces) = 0
    real(wp) :: row(most) = 1.0_wp  !! scale of each residual
    real(wp) :: yield_weight = 1.0_wp  !! of the first yield function in the line search
    real(wp) :: matrix(most, most)
    integer(i4) :: pivot(most)
    integer(i4) :: iterations = 0   !! of Newton, for the report
    logical :: singular = .false.
  end type mm_system_type

contains

  !> Find the state at the end of a step; `at` is the trial state on entry, evaluated. Without
  !! success done is false and `at` holds the last iterate with its active surfaces.
  subroutine return_to_surfaces(law, total, old, at, system, done)
    type(mm_law_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: total
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(inout) :: at
    type(mm_system_type), intent(inout) :: system
    logical, intent(out) :: done
    real(wp) :: scale(surfaces)
    integer(i4) :: pass

    scale = yield_scale(law, at)
    at%gamma = 0.0_wp
    at%active = at%yield > enough*scale
    system%iterations = 0
    done = .true.
    if (.not. any(at%active)) return
    done = all(at%yield < open_yield)  ! else there is nothing to return to
    if (.not. done) return
    do pass = 1, most_sets
      call set_unknowns(law, at%active, scale, .false., system)
      call newton(law, total, old, at, system, done)
      if (.not. done) return
      if (any(at%active .and. at%gamma < 0.0_wp)) then
        at%active(minloc(at%gamma/scale_of_gamma(law), dim=1)) = .false.
        if (.not. any(at%active)) exit
        at%state = old%state  ! restore the parts that moved with the surface dropped
        at%gamma = 0.0_wp
      else if (any(.not. at%active .and. at%yield > enough*scale)) then
        at%active = at%active .or. at%yield > enough*scale
      else
        return
      end if
    end do
    done = .false.
  end subroutine return_to_surfaces

  !> Multipliers of gradients are rates of curvature: they are compared times the length; that of
  !! breakage is an energy.
  pure function scale_of_gamma(law) result(scale)
    type(mm_law_type), intent(in) :: law
    real(wp) :: scale(surfaces)
    scale(:2) = 1.0_wp
    if (law%breaks) scale(1) = law%cone(1)%energy
    scale(3:) = 1.0_wp/law%length
  end function scale_of_gamma

  !> What a yield function is small against; the stress of a small strain, whose rounding is far
  !! less than what is enough, or more.
  pure function yield_scale(law, at) result(scale)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    real(wp) :: scale(surfaces)
    scale = at%surface%size
    scale(:2) = max(scale(:2), least_strain*law%modulus)
    scale(3:) = max(scale(3:), least_strain*law%modulus*law%length)
    if (law%breaks) scale(1) = 1.0_wp
    where (.not. scale > 0.0_wp) scale = 1.0_wp
  end function yield_scale

  !> Which of the plastic parts change with these active surfaces, or all of them.
  pure subroutine set_unknowns(law, active, scale, all_parts, system)
    type(mm_law_type), intent(in) :: law
    logical, intent(in) :: active(surfaces)
    real(wp), intent(in) :: scale(surfaces)
    logical, intent(in) :: all_parts
    type(mm_system_type), intent(inout) :: system
    logical :: used(45)
    integer(i4) :: k

    used(:9) = any(active(:2)) .or. all_parts
    used(10:18) = active(2) .or. all_parts
    used(19:) = any(active(2:)) .or. all_parts
    system%parts = count(used)
    system%part(:system%parts) = pack([(k, k=1, 45)], used)
    system%n = system%parts + count(active)
    system%surface(:count(active)) = pack([(k, k=1, surfaces)], active)
    do k = 1, system%parts
      system%row(k) = merge(law%length, 1.0_wp, system%part(k) > 18)
    end do
    do k = system%parts + 1, system%n
      system%row(k) = 1.0_wp/scale(system%surface(k - system%parts))
    end do
    system%yield_weight = 1.0_wp
    if (law%breaks .and. active(1)) system%yield_weight = sqrt(law%cone(1)%energy/law%modulus)
  end subroutine set_unknowns

  !> Newton's method with line search on the set of active surfaces; it may stop short of the end
  !! with a negative multiplier.
  subroutine newton(law, total, old, at, system, done)
    type(mm_law_type), intent(in) :: law
    type(mm_strain_type), intent(in) :: total
    type(mm_old_type), intent(in) :: old
    type(mm_iterate_type), intent(inout) :: at
    type(mm_system_type), intent(inout) :: system
    logical, intent(out) :: done
    type(mm_iterate_type) :: tried
    real(wp) :: step(most), r(most), size_now, size_new, share
    integer(i4) :: k, cut

    done = .false.
    call evaluate(law, total, old, at)
    r = residual(at, system)
    do k = 1, most_iterations
      if (.not. all(abs(r(:system%n)) <= huge(1.0_wp))) return
      done = maxval(abs(r(:system%n))) < enough
      if (maxval(abs(r(:system%n))) < near) done = done .or. any(at%active .and. at%gamma < 0.0_wp)
      if (done) return
      call factor_system(law, at, old, system)
      if (system%singular) return
      step(:system%n) = -r(:system%n)
      call back_substitute(system, 1, step)
      system%iterations = system%iterations + 1
      size_now = merit(system, r)
      share = 1.0_wp
      do cut = 0, most_cuts
        tried = at
        call move(tried, system, share*step)
        if (determinant(tried%state%fp) > 0.0_wp .and. determinant(tried%state%xp) > 0.0_wp) then
          call evaluate(law, total, old, tried)
          r = residual(tried, system)
          size_new = merit(system, r)
          if (size_new <= (1.0_wp - decrease*share)*size_now) exit
        end if
        share = 0.5_wp*share
      end do
      if (cut > most_cuts) exit
      at = tried
    end do
    ! a closed surface that does not belong to the set can stop it far from the end
    done = any(law%cone%kind /= kind_cone) .and. any(at%active .and. at%gamma < 0.0_wp)
  end subroutine newton

  !> What the line search makes smaller. The yield function of breakage changes by one in the strain
  !! sqrt(E_c/modulus): it counts as a strain there, like the other residuals.
  pure real(wp) function merit(system, r)
    type(mm_system_type), intent(in) :: system
    real(wp), intent(in) :: r(most)
    real(wp) :: weighted(most)
    weighted = r
    weighted(system%parts + 1) = system%yield_weight*r(system%parts + 1)
    merit = norm2(weighted(:system%n))
  end function merit

  !> Scaled residuals.
  pure function residual(at, system) result(r)
    type(mm_iterate_type), intent(in) :: at
    type(mm_system_type), intent(in) :: system
    real(wp) :: r(most)
    real(wp) :: parts(45)
    integer(i4) :: k
    parts(:9) = reshape(at%rf, [9])
    parts(10:18) = reshape(at%rx, [9])
    parts(19:) = reshape(at%rg, [27])
    r = 0.0_wp
    do k = 1, system%parts
      r(k) = system%row(k)*parts(system%part(k))
    end do
    do k = system%parts + 1, system%n
      r(k) = system%row(k)*at%yield(system%surface(k - system%parts))
    end do
  end function residual

  !> Add a step to plastic parts and multipliers.
  pure subroutine move(at, system, step)
    type(mm_iterate_type), intent(inout) :: at
    type(mm_system_type), intent(in) :: system
    real(wp), intent(in) :: step(most)
    real(wp) :: all_parts(45), y(3, 3, 3)
    integer(i4) :: k
    all_parts = 0.0_wp
    do k = 1, system%parts
      all_parts(system%part(k)) = step(k)
    end do
    do k = system%parts + 1, system%n
      at%gamma(system%surface(k - system%parts)) = at%gamma(system%surface(k - system%parts)) &
        + step(k)
    end do
    y = reshape(all_parts(19:), [3, 3, 3])
    at%state%gp = at%state%gp + leg_three(transpose(at%state%fp), &
                                          leg_two(transpose(at%state%xp), y))
    at%state%fp = at%state%fp + matmul(reshape(all_parts(:9), [3, 3]), at%state%fp)
    at%state%xp = at%state%xp + matmul(reshape(all_parts(10:18), [3, 3]), at%state%xp)
  end subroutine move

  !> The matrix of scaled derivatives at an iterate, factored.
  subroutine factor_system(law, at, old, system)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_old_type), intent(in) :: old
    type(mm_system_type), intent(inout) :: system
    type(mm_change_type) :: change
    type(mm_strain_d_type) :: d
    type(mm_residual_d_type) :: r
    real(wp) :: rows(most, lanes), column(45)
    integer(i4) :: first, last, k, s, info

    do first = 1, system%parts, lanes
      last = min(first + lanes - 1, system%parts)
      call seed_change(system%part(first:last), change)
      d%c = 0.0_wp
      d%psi = 0.0_wp
      d%gamma = 0.0_wp
      call change_strains(at, change, d)
      call residual_of(law, at, old, change, d, r)
      call unpack_rows(system, r, rows)
      system%matrix(:system%n, first:last) = rows(:system%n, :last - first + 1)
    end do
    system%matrix(system%parts + 1:system%n, system%parts + 1:system%n) = 0.0_wp
    do k = system%parts + 1, system%n
      s = system%surface(k - system%parts)
      column = unit_columns(law, at, old, s)
      system%matrix(:system%parts, k) = system%row(:system%parts) &
        *column(system%part(:system%parts))
      system%matrix(k, k) = -system%row(k)*law%cone(s)%a*law%cone(s)%a_flow &
        *cohesion_slope(law%cone(s), at%state%z(s))
    end do
    if (law%breaks .and. at%active(1)) call add_breakage(law, at, old, system)
    call dgetrf(system%n, system%n, system%matrix, most, system%pivot, info)
    system%singular = info /= 0
  end subroutine factor_system

  !> Add what the breakage of the first multiplier does to its column.
  pure subroutine add_breakage(law, at, old, system)
    type(mm_law_type), intent(in) :: law
    type(mm_iterate_type), intent(in) :: at
    type(mm_old_type), intent(in) :: old
    type(mm_system_type), intent(inout) :: system
    type(mm_change_type) :: change
    type(mm_strain_d_type) :: none
    type(mm_residual_d_type) :: r
    real(wp) :: rows(most, lanes)
    integer(i4) :: k
    change%w = 0.0_wp
    change%x = 0.0_wp
    change%y = 0.0_wp
    change%b(1) = at%b_slope
    none%c = 0.0_wp
    none%psi = 0.0_wp
    none%gamma = 0.0_wp
    call residual_of(law, at, old, change, none, r)
    call unpack_rows(system, r, rows)
    k = system%parts + 1
    system%matrix(:system%n, k) = system%matrix(:system%n, k) + rows(:system%n, 1)
  end subroutine add_breakage

  !> Unit changes of the parts of a list, one a lane.
  pure subroutine seed_change(part, change)
    integer(i4), intent(in) :: part(:)
    type(mm_change_type), intent(out) :: change
    integer(i4) :: l, k
    change%w = 0.0_wp
    change%x = 0.0_wp
    change%y = 0.0_wp
    do l = 1, size(part)
      k = part(l) - 1
      if (k < 9) then
        change%w(l, 1 + mod(k, 3), 1 + k/3) = 1.0_wp
      else if (k < 18) then
        change%x(l, 1 + mod(k, 3), k/3 - 2) = 1.0_wp
      else
        change%y(l, 1 + mod(k, 3), 1 + mod(k/3, 3), k/9 - 1) = 1.0_wp
      end if
    end do
  end subroutine seed_change

  !> Scaled rows of the system from derivatives of residuals.
  pure subroutine unpack_rows(system, r, rows)
    type(mm_system_type), intent(in) :: system
    type(mm_residual_d_type), intent(in) :: r
    real(wp), intent(out) :: rows(most, lanes)
    integer(i4) :: k, p
    do k = 1, system%parts
      p = system%part(k) - 1
      if (p < 9) then
        rows(k, :) = r%f(:, 1 + mod(p, 3), 1 + p/3)
      else if (p < 18) then
        rows(k, :) = r%x(:, 1 + mod(p, 3), p/3 - 2)
      else
        rows(k, :) = system%row(k)*r%g(:, 1 + mod(p, 3), 1 + mod(p/3, 3), p/9 - 1)
      end if
    end do
    do k = system%parts + 1, system%n
      rows(k, :) = system%row(k)*r%yield(:, system%surface(k - system%parts))
    end do
  end subroutine unpack_rows

  !> Columns of right-hand sides become the solutions.
  subroutine back_substitute(system, columns, b)
    type(mm_system_type), intent(in) :: system
    integer(i4), intent(in) :: columns
    real(wp), intent(inout) :: b(most, columns)
    integer(i4) :: info
    call dgetrs('N', system%n, columns, system%matrix, most, system%pivot, b, most, info)
    if (info /= 0) error stop 'bug: solution of the local system'
  end subroutine back_substitute

  !> Changes of `lanes` solutions.
  pure subroutine pack_change(system, columns, change)
    type(mm_system_type), intent(in) :: system
    real(wp), intent(in) :: columns(most, lanes)
    type(mm_change_type), intent(out) :: change
    integer(i4) :: k, p
    change%w = 0.0_wp
    change%x = 0.0_wp
    change%y = 0.0_wp
    do k = 1, system%parts
      p = system%part(k) - 1
      if (p < 9) then
        change%w(:, 1 + mod(p, 3), 1 + p/3) = columns(k, :)
      else if (p < 18) then
        change%x(:, 1 + mod(p, 3), p/3 - 2) = columns(k, :)
      else
        change%y(:, 1 + mod(p, 3), 1 + mod(p/3, 3), p/9 - 1) = columns(k, :)
      end if
    end do
  end subroutine pack_change
end module fem_mm_return
