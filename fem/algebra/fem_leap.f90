!> A step of central differences without damping, in two passes over the degrees of freedom: before
!! and after the internal forces. The formulas are those of fem_explicit; the second pass adds all
!! sums of the ledger, chunk by chunk: the same bits for any number of threads.
module fem_leap
  use talus_kinds, only: wp, i4
  use fem_types, only: fem_state_type
  implicit none
  private
  public :: fem_leap_type, drift_all, kick_all, least_shared, chunk

  integer(i4), parameter :: least_shared = 2000  !! least number of blocks for threads
  integer(i4), parameter :: chunk = 1024         !! blocks whose sums are added first

  !> Workspace kept between steps, and the sums of the last one.
  type :: fem_leap_type
    real(wp), allocatable :: internal(:, :), half(:, :)  !! (3, blocks) [N], [m/s]
    real(wp), allocatable :: sums(:, :)                  !! (6, chunks)
    real(wp) :: dt = 0.0_wp        !! [s]
    logical, allocatable :: fixed(:, :)                  !! (3, blocks)
    logical, allocatable :: counted(:)  !! (blocks) in the sums here? Not given: all are
    real(wp) :: strain = 0.0_wp    !! u . (K u + forces of the initial stress) / 2 [J]
    real(wp) :: load = 0.0_wp      !! work of the loads in the step [J]
    real(wp) :: weight = 0.0_wp    !! weight . moved [J]
    real(wp) :: support = 0.0_wp   !! work of supports in the step, less inertia [J]
    real(wp) :: kinetic = 0.0_wp   !! [J]
    real(wp) :: discrete = 0.0_wp  !! growth of -dt^2/8 a M a [J]
  end type fem_leap_type

contains

  !> Displacements at the end of the step, velocities at its middle; `given` moves what is
  !! prescribed, what is held stays at zero.
  subroutine drift_all(dt, held, prescribed, given, old, new, work)
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in), contiguous :: held(:, :), prescribed(:, :)
    real(wp), intent(in), contiguous :: given(:, :)  !! [m]
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    type(fem_leap_type), intent(inout) :: work
    integer(i4) :: i, c
    if (.not. allocated(work%half)) then
      allocate (work%half, mold=given)
      allocate (work%internal, mold=given)
      allocate (work%fixed, mold=held)
      allocate (work%sums(6, (size(given, 2) + chunk - 1)/chunk))
    end if
    !$omp parallel do default(none) shared(dt, held, prescribed, given, old, new, work) &
    !$omp private(i, c) schedule(static) if(size(given, 2) > least_shared)
    do i = 1, size(given, 2)
      do c = 1, 3
        work%fixed(c, i) = held(c, i) .or. prescribed(c, i)
        if (work%fixed(c, i)) then
          new%u(c, i) = merge(given(c, i), 0.0_wp, prescribed(c, i))
          work%half(c, i) = (new%u(c, i) - old%u(c, i))/dt
        else
          work%half(c, i) = old%v(c, i) + 0.5_wp*dt*old%a(c, i)
          new%u(c, i) = old%u(c, i) + dt*work%half(c, i)
        end if
      end do
    end do
    !$omp end parallel do
  end subroutine drift_all

  !> Accelerations, velocities, reactions and the sums of the step.
  subroutine kick_all(dt, mass, initial, weight, old, new, work)
    real(wp), intent(in) :: dt
    real(wp), intent(in), contiguous :: mass(:)        !! (blocks) [kg, kg m^2]
    real(wp), intent(in), contiguous :: initial(:, :)  !! forces of the initial stress [N]
    real(wp), intent(in), contiguous :: weight(:, :)   !! forces of gravity [N]
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    type(fem_leap_type), intent(inout) :: work
    real(wp) :: total(6)
    integer(i4) :: c

    work%dt = dt
    !$omp parallel do default(none) shared(mass, initial, weight, old, new, work) private(c) &
    !$omp schedule(static) if(size(mass) > least_shared)
    do c = 1, size(work%sums, 2)
      call kick_chunk(mass, initial, weight, c, old, new, work)
    end do
    !$omp end parallel do
    total = 0.0_wp
    do c = 1, size(work%sums, 2)
      total = total + work%sums(:, c)
    end do
    work%strain = 0.5_wp*total(1)
    work%load = 0.5_wp*total(2)
    work%weight = total(3)
    work%support = 0.5_wp*total(4)
    work%kinetic = 0.5_wp*total(5)
    work%discrete = -0.125_wp*dt*dt*total(6)
  end subroutine kick_all

  !> The blocks of chunk c.
  pure subroutine kick_chunk(mass, initial, weight, c, old, new, work)
    real(wp), intent(in), contiguous :: mass(:), initial(:, :), weight(:, :)
    integer(i4), intent(in) :: c
    type(fem_state_type), intent(in) :: old
    type(fem_state_type), intent(inout) :: new
    type(fem_leap_type), intent(inout) :: work
    real(wp) :: strain, load, fall, support, kinetic, discrete
    integer(i4) :: i

    strain = 0.0_wp
    load = 0.0_wp
    fall = 0.0_wp
    support = 0.0_wp
    kinetic = 0.0_wp
    discrete = 0.0_wp
    do i = (c - 1)*chunk + 1, min(c*chunk, int(size(mass), i4))
      call kick_block(work%dt, mass(i), work%fixed(:, i), work%half(:, i), work%internal(:, i), &
                      new%external(:, i), old%v(:, i), new%a(:, i), new%v(:, i), new%reaction(:, i))
      if (allocated(work%counted)) then
        if (.not. work%counted(i)) cycle
      end if
      strain = strain + sum(new%u(:, i)*(work%internal(:, i) + initial(:, i)))
      load = load + sum((new%external(:, i) + old%external(:, i))*(new%u(:, i) - old%u(:, i)))
      fall = fall + sum(weight(:, i)*(new%u(:, i) - old%u(:, i)))
      kinetic = kinetic + mass(i)*sum(new%v(:, i)**2)
      discrete = discrete + mass(i)*sum(merge(0.0_wp, new%a(:, i)**2 - old%a(:, i)**2, &
                                              work%fixed(:, i)))
      if (.not. any(work%fixed(:, i))) cycle
      support = support + sum((new%reaction(:, i) + old%reaction(:, i)) &
        *(new%u(:, i) - old%u(:, i))) - mass(i)*sum(merge((new%u(:, i) - old%u(:, i)) &
        *(new%a(:, i) + old%a(:, i)) - new%v(:, i)**2 + old%v(:, i)**2, 0.0_wp, work%fixed(:, i)))
    end do
    work%sums(:, c) = [strain, load, fall, support, kinetic, discrete]
  end subroutine kick_chunk

  !> What is fixed has the velocity of the step, and a reaction.
  pure subroutine kick_block(dt, mass, fixed, half, internal, external, old_v, a, v, reaction)
    real(wp), intent(in) :: dt, mass
    logical, intent(in) :: fixed(3)
    real(wp), intent(in) :: half(3), internal(3), external(3), old_v(3)
    real(wp), intent(out) :: a(3), v(3), reaction(3)
    real(wp) :: force
    integer(i4) :: c
    do c = 1, 3
      force = external(c) - internal(c)
      if (fixed(c)) then
        v(c) = half(c)
        a(c) = (half(c) - old_v(c))/dt
        reaction(c) = mass*a(c) - force
      else
        a(c) = force/mass
        v(c) = half(c) + 0.5_wp*dt*a(c)
        reaction(c) = 0.0_wp
      end if
    end do
  end subroutine kick_block
end module fem_leap
