!> Central differences with lumped masses: the two halves of a step. Plain arrays.
!!
!! With v at whole steps: v' = v + dt/2 a, u1 = u + dt v', then a1 from the forces at u1 and
!! v1 = v' + dt/2 a1. Forces of dashpots and of a M are those at v1 (they are diagonal by nodes, so
!! that this needs no solution of a system), those of b K at v'. U and the discrete kinetic energy
!! 1/2 v M v - dt^2/8 a M a close against trapezoidal works exactly (theory: dynamics); the second
!! term is bounded and is listed under `numerical` in the ledger.
module fem_explicit
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use fem_damping, only: fem_damping_type
  use fem_leap, only: least_shared, chunk
  use fem_types, only: fem_state_type
  implicit none
  private
  public :: drift_half, kick_half, kick_lumped, explicit_kinetic

contains

  !> Velocities at mid-step and displacements of what is free; u of what is fixed is in `new`.
  subroutine drift_half(dt, fixed, old, new, half)
    real(wp), intent(in) :: dt            !! [s]
    logical, intent(in) :: fixed(:, :)    !! (3, blocks)
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    real(wp), intent(out) :: half(:, :)   !! [m/s]
    integer(i4) :: i, c
    !$omp parallel do default(none) shared(dt, fixed, old, new, half) private(i, c) &
    !$omp schedule(static) if(size(half, 2) > least_shared)
    do i = 1, size(half, 2)
      do c = 1, 3
        if (fixed(c, i)) then
          half(c, i) = (new%u(c, i) - old%u(c, i))/dt
        else
          half(c, i) = old%v(c, i) + 0.5_wp*dt*old%a(c, i)
          new%u(c, i) = old%u(c, i) + dt*half(c, i)
        end if
      end do
    end do
    !$omp end parallel do
  end subroutine drift_half

  !> Accelerations and velocities from `force`, all forces at u1 but those of dashpots and a M,
  !! which are added here to new%viscous. What is fixed has the velocity of the step.
  subroutine kick_half(dt, fixed, mass, damping, force, half, old, new)
    real(wp), intent(in) :: dt, mass(:)   !! [s], (blocks) [kg]
    logical, intent(in) :: fixed(:, :)
    type(fem_damping_type), intent(in) :: damping
    real(wp), intent(in) :: force(:, :), half(:, :)
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    real(wp) :: slow, matrix(3, 3), rest(3)
    integer(i4) :: i, c, k

    slow = 1.0_wp + 0.5_wp*dt*damping%mass
    !$omp parallel do default(none) shared(mass, force, damping, half, slow, new) private(i) &
    !$omp schedule(static) if(size(mass) > least_shared)
    do i = 1, size(mass)
      new%a(:, i) = (force(:, i)/mass(i) - damping%mass*half(:, i))/slow
    end do
    !$omp end parallel do
    do k = 1, damping%n
      i = damping%block(k)
      matrix = 0.5_wp*dt*damping%dashpot(:, :, k)
      do c = 1, 3
        matrix(c, c) = matrix(c, c) + mass(i)*slow
      end do
      rest = force(:, i) - mass(i)*damping%mass*half(:, i) &
             - matmul(damping%dashpot(:, :, k), half(:, i))
      new%a(:, i) = solution(matrix, rest)
    end do
    !$omp parallel do default(none) shared(dt, mass, fixed, damping, half, old, new) private(i, c) &
    !$omp schedule(static) if(size(mass) > least_shared)
    do i = 1, size(mass)
      do c = 1, 3
        if (fixed(c, i)) then
          new%v(c, i) = half(c, i)
          new%a(c, i) = (half(c, i) - old%v(c, i))/dt
        else
          new%v(c, i) = half(c, i) + 0.5_wp*dt*new%a(c, i)
        end if
      end do
      if (damping%mass > 0.0_wp) new%viscous(:, i) = new%viscous(:, i) &
        + damping%mass*mass(i)*new%v(:, i)
    end do
    !$omp end parallel do
    do k = 1, damping%n
      i = damping%block(k)
      new%viscous(:, i) = new%viscous(:, i) + matmul(damping%dashpot(:, :, k), new%v(:, i))
    end do
  end subroutine kick_half

  !> v += dt (f - C v)/m of what is free: dashpots and a M act by the mean of the velocities before
  !! and after the kick.
  subroutine kick_lumped(dt, fixed, mass, damping, f, v)
    real(wp), intent(in) :: dt            !! [s]
    logical, intent(in) :: fixed(:, :)    !! (3, blocks)
    real(wp), intent(in) :: mass(:)       !! [kg, kg m^2]
    type(fem_damping_type), intent(in) :: damping
    real(wp), intent(in) :: f(:, :)       !! without these [N, N m]
    real(wp), intent(inout) :: v(:, :)    !! [m/s]
    real(wp) :: slow, matrix(3, 3), change(3, damping%n)
    integer(i4) :: i, c, k

    slow = 1.0_wp + 0.5_wp*dt*damping%mass
    do k = 1, damping%n
      i = damping%block(k)
      matrix = 0.5_wp*dt*damping%dashpot(:, :, k)
      do c = 1, 3
        matrix(c, c) = matrix(c, c) + mass(i)*slow
      end do
      change(:, k) = v(:, i) + dt*solution(matrix, f(:, i) - mass(i)*damping%mass*v(:, i) &
                                           - matmul(damping%dashpot(:, :, k), v(:, i)))
    end do
    !$omp parallel do default(none) shared(dt, fixed, mass, damping, f, v, slow) private(i) &
    !$omp schedule(static) if(size(mass) > least_shared)
    do i = 1, size(mass)
      where (.not. fixed(:, i)) v(:, i) = v(:, i) &
        + dt*(f(:, i)/mass(i) - damping%mass*v(:, i))/slow
    end do
    !$omp end parallel do
    do k = 1, damping%n
      i = damping%block(k)
      where (.not. fixed(:, i)) v(:, i) = change(:, k)
    end do
  end subroutine kick_lumped

  !> Solution of a symmetric positive 3 x 3 system by Cramer's rule.
  pure function solution(a, b) result(x)
    real(wp), intent(in) :: a(3, 3), b(3)
    real(wp) :: x(3), c(3, 3)
    c(:, 1) = cross(a(:, 2), a(:, 3))
    c(:, 2) = cross(a(:, 3), a(:, 1))
    c(:, 3) = cross(a(:, 1), a(:, 2))
    x = matmul(transpose(c), b)/dot_product(a(:, 1), c(:, 1))
  end function solution

  !> Kinetic energy 1/2 v M v [J]; growth of the discrete term -dt^2/8 a M a of what is free; what
  !! of the works of moved supports is inertia beyond trapezoidal work, du m a_mean - d(1/2 m v^2).
  subroutine explicit_kinetic(dt, fixed, mass, old, new, kinetic, discrete, supports)
    real(wp), intent(in) :: dt, mass(:)
    logical, intent(in) :: fixed(:, :)
    type(fem_state_type), intent(in) :: old, new
    real(wp), intent(out) :: kinetic, discrete, supports
    real(wp) :: sums(3, (size(mass) + chunk - 1)/chunk)
    integer(i4) :: k
    !$omp parallel do default(none) shared(mass, fixed, old, new, sums) private(k) &
    !$omp schedule(static) if(size(mass) > least_shared)
    do k = 1, size(sums, 2)
      call kinetic_chunk(mass, fixed, k, old, new, sums(:, k))
    end do
    !$omp end parallel do
    kinetic = 0.0_wp
    discrete = 0.0_wp
    supports = 0.0_wp
    do k = 1, size(sums, 2)
      kinetic = kinetic + sums(1, k)
      discrete = discrete - dt*dt*sums(2, k)
      supports = supports + sums(3, k)
    end do
  end subroutine explicit_kinetic

  !> The blocks of chunk k, the second sum without dt^2.
  pure subroutine kinetic_chunk(mass, fixed, k, old, new, sums)
    real(wp), intent(in) :: mass(:)
    logical, intent(in) :: fixed(:, :)
    integer(i4), intent(in) :: k
    type(fem_state_type), intent(in) :: old, new
    real(wp), intent(out) :: sums(3)
    integer(i4) :: i, c
    sums = 0.0_wp
    do i = (k - 1)*chunk + 1, min(k*chunk, int(size(mass), i4))
      do c = 1, 3
        sums(1) = sums(1) + 0.5_wp*mass(i)*new%v(c, i)**2
        if (fixed(c, i)) then
          sums(3) = sums(3) + 0.5_wp*mass(i)*((new%u(c, i) - old%u(c, i)) &
            *(new%a(c, i) + old%a(c, i)) - new%v(c, i)**2 + old%v(c, i)**2)
        else
          sums(2) = sums(2) + 0.125_wp*mass(i)*(new%a(c, i)**2 - old%a(c, i)**2)
        end if
      end do
    end do
  end subroutine kinetic_chunk
end module fem_explicit
