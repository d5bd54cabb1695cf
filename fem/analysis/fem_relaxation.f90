!> Dynamic relaxation: equilibrium as the rest state of a damped pseudo-motion, without a solution
!! of equations (Underwood 1983). The pseudo-masses are row sums that keep a step of one stable, the
!! damping is critical for the lowest frequency that the motion shows.
module fem_relaxation
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str, is_finite
  use fem_body, only: fem_body_type
  use fem_sparse, only: fem_pattern_type, multiply
  implicit none
  private
  public :: relax

  real(wp), parameter :: margin = 1.1_wp  !! of the pseudo-masses above the stable ones

contains

  !> One static step to time t1; `iterations` is their number. Fault N307 if |residual| has not
  !! decreased to the tolerance times |loads and reactions|.
  subroutine relax(body, t1, tolerance, most, iterations, errors)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1, tolerance
    integer(i4), intent(in) :: most
    integer(i4), intent(out) :: iterations
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, body%dofs%blocks) :: mass, v, residual, force, internal
    logical :: free(3, body%dofs%blocks)
    real(wp) :: damping, scale
    logical :: settled

    free = .not. (body%supports%held .or. body%port%prescribed)
    call pseudo_mass(body%system%pattern, body%system%k, mass)
    v = 0.0_wp
    damping = 0.0_wp
    associate (s => body%state, old => body%accepted)
      s%time = t1
      s%u = old%u
      call body%impose(t1, s%u)
      call body%external_at(t1, s%external)
      call body%internal_force(s%u, internal)
      do iterations = 0, most
        residual = merge(s%external - internal, 0.0_wp, free)
        scale = sqrt(sum(merge(s%external, internal, free)**2))
        settled = norm2(residual) <= tolerance*scale
        if (settled .or. .not. is_finite(scale)) exit
        v = ((2.0_wp - damping)*v + 2.0_wp*residual/mass)/(2.0_wp + damping)
        s%u = s%u + v
        call multiply(body%system%pattern, body%system%k, v, force)
        internal = internal + force
        damping = critical(v, force, mass, free)
      end do
      if (.not. settled) then
        call errors%add('N307', 'dynamic relaxation has not converged in '//str(most)// &
          ' iterations: residual '//str(norm2(residual)/scale), 'time '//str(t1)//' s', &
          "raise max_iterations or tolerance, or take kind = 'static'")
        return
      end if
      call body%internal_force(s%u, internal)
      s%reaction = merge(0.0_wp, internal - s%external, free)
      s%tie = 0.0_wp
      call body%update_energy(internal)
    end associate
  end subroutine relax

  !> Critical damping of the frequency by Rayleigh's quotient of the motion, at most 2.
  pure real(wp) function critical(v, force, mass, free)
    real(wp), intent(in) :: v(:, :), force(:, :), mass(:, :)
    logical, intent(in) :: free(:, :)
    real(wp) :: stiff, heavy
    stiff = sum(v*force, mask=free)
    heavy = sum(v*mass*v, mask=free)
    critical = 0.0_wp
    if (heavy > 0.0_wp .and. stiff > 0.0_wp) critical = min(1.9_wp, 2.0_wp*sqrt(stiff/heavy))
  end function critical

  !> Masses for which a step of one is stable: a quarter of the absolute row sums (Gershgorin).
  subroutine pseudo_mass(pattern, k, mass)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: k(:, :, :)
    real(wp), intent(out) :: mass(:, :)
    integer(i4) :: i, j, p
    mass = 0.0_wp
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        mass(:, i) = mass(:, i) + 0.25_wp*margin*sum(abs(k(:, :, p)), 2)
        if (j /= i) mass(:, j) = mass(:, j) + 0.25_wp*margin*sum(abs(k(:, :, p)), 1)
      end do
    end do
    call pattern%halo%sum_up(mass)
  end subroutine pseudo_mass
end module fem_relaxation
