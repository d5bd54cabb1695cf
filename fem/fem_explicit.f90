!> Central differences with lumped masses: the two halves of a step. Plain arrays.
!!
!! With v at whole steps: v' = v + dt/2 a, u1 = u + dt v', then a1 from the forces at u1 and
!! v1 = v' + dt/2 a1. Forces of dashpots and of a M are taken at v1 (they are diagonal by nodes, so
!! that this needs no solution of a system), those of b K at v'. U and the discrete kinetic energy
!! 1/2 v M v - dt^2/8 a M a close against trapezoidal works exactly (theory: dynamics); the second
!! term is bounded and stands under `numerical` in the ledger.
module fem_explicit
  use talus_kinds, only: wp, i4
  use fem_damping, only: fem_damping_type
  use fem_types, only: fem_state_type
  implicit none
  private
  public :: drift_half, kick_half, explicit_kinetic

contains

  !> Velocities at mid-step and displacements of what is free; u of what is fixed is in `new`.
  pure subroutine drift_half(dt, fixed, old, new, half)
    real(wp), intent(in) :: dt            !! [s]
    logical, intent(in) :: fixed(:, :)    !! (3, blocks)
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    real(wp), intent(out) :: half(:, :)   !! [m/s]
    integer(i4) :: i, c
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
  end subroutine drift_half

  !> Accelerations and velocities from `force`, all forces at u1 but those of dashpots and a M,
  !! which are added here to new%viscous. What is fixed has the velocity of the step.
  pure subroutine kick_half(dt, fixed, mass, damping, force, half, old, new)
    real(wp), intent(in) :: dt, mass(:)   !! [s], (blocks) [kg]
    logical, intent(in) :: fixed(:, :)
    type(fem_damping_type), intent(in) :: damping
    real(wp), intent(in) :: force(:, :), half(:, :)
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    real(wp) :: slow, matrix(3, 3), rest(3)
    integer(i4) :: i, c, k

    slow = 1.0_wp + 0.5_wp*dt*damping%mass
    do i = 1, size(mass)
      new%a(:, i) = (force(:, i)/mass(i) - damping%mass*half(:, i))/slow
    end do
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
    do k = 1, damping%n
      i = damping%block(k)
      new%viscous(:, i) = new%viscous(:, i) + matmul(damping%dashpot(:, :, k), new%v(:, i))
    end do
  end subroutine kick_half

  !> Solution of a symmetric positive 3 x 3 system by Cramer's rule.
  pure function solution(a, b) result(x)
    real(wp), intent(in) :: a(3, 3), b(3)
    real(wp) :: x(3), c(3, 3)
    c(:, 1) = cross(a(:, 2), a(:, 3))
    c(:, 2) = cross(a(:, 3), a(:, 1))
    c(:, 3) = cross(a(:, 1), a(:, 2))
    x = matmul(transpose(c), b)/dot_product(a(:, 1), c(:, 1))
  end function solution

  pure function cross(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross

  !> Kinetic energy 1/2 v M v [J]; growth of the discrete term -dt^2/8 a M a of what is free; what
  !! of the works of moved supports is inertia beyond trapezoidal work, du m a_mean - d(1/2 m v^2).
  pure subroutine explicit_kinetic(dt, fixed, mass, old, new, kinetic, discrete, supports)
    real(wp), intent(in) :: dt, mass(:)
    logical, intent(in) :: fixed(:, :)
    type(fem_state_type), intent(in) :: old, new
    real(wp), intent(out) :: kinetic, discrete, supports
    integer(i4) :: i, c
    kinetic = 0.0_wp
    discrete = 0.0_wp
    supports = 0.0_wp
    do i = 1, size(mass)
      do c = 1, 3
        kinetic = kinetic + 0.5_wp*mass(i)*new%v(c, i)**2
        if (fixed(c, i)) then
          supports = supports + 0.5_wp*mass(i)*((new%u(c, i) - old%u(c, i)) &
            *(new%a(c, i) + old%a(c, i)) - new%v(c, i)**2 + old%v(c, i)**2)
        else
          discrete = discrete - 0.125_wp*dt*dt*mass(i)*(new%a(c, i)**2 - old%a(c, i)**2)
        end if
      end do
    end do
  end subroutine explicit_kinetic
end module fem_explicit
