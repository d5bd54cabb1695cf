!> Sums for the energy ledger in one pass over the state: stored energy and trapezoidal works; by
!! chunks, so that they are the same bits for any number of threads.
module fem_ledger
  use talus_kinds, only: wp, i4
  use fem_halo, only: fem_halo_type
  use fem_leap, only: least_shared, chunk
  use fem_types, only: fem_state_type
  implicit none
  private
  public :: step_works, fem_works_type

  !> Work of one step [J].
  type :: fem_works_type
    real(wp) :: strain = 0.0_wp   !! stored at its end
    real(wp) :: load = 0.0_wp, weight = 0.0_wp, support = 0.0_wp, spring = 0.0_wp
    real(wp) :: damping = 0.0_wp
  end type fem_works_type

contains

  !> Works between two states, over the blocks of all ranks; `weight` is that of gravity's force
  !! over the whole step.
  subroutine step_works(halo, old, new, internal, initial, gravity, works)
    type(fem_halo_type), intent(in) :: halo
    type(fem_state_type), intent(in) :: old, new
    real(wp), intent(in) :: internal(:, :)  !! K u + initial [N]
    real(wp), intent(in) :: initial(:, :)   !! forces of the initial stress [N]
    real(wp), intent(in) :: gravity(:, :)   !! weight [N]
    type(fem_works_type), intent(out) :: works
    real(wp) :: parts(6, (size(internal, 2) + chunk - 1)/chunk), sums(6)
    integer(i4) :: k

    !$omp parallel do default(none) shared(halo, old, new, internal, initial, gravity, parts) &
    !$omp private(k) schedule(static) if(size(internal, 2) > least_shared)
    do k = 1, size(parts, 2)
      parts(:, k) = chunk_works(halo, old, new, internal, initial, gravity, k)
    end do
    !$omp end parallel do
    sums = 0.0_wp
    do k = 1, size(parts, 2)
      sums = sums + parts(:, k)
    end do
    call halo%total(sums)
    works = fem_works_type(0.5_wp*sums(1), 0.5_wp*sums(2), sums(3), 0.5_wp*sums(4), &
                           0.5_wp*sums(5), 0.5_wp*sums(6))
  end subroutine step_works

  !> Sums over the blocks of chunk k.
  pure function chunk_works(halo, old, new, internal, initial, gravity, k) result(sums)
    type(fem_halo_type), intent(in) :: halo
    type(fem_state_type), intent(in) :: old, new
    real(wp), intent(in) :: internal(:, :), initial(:, :), gravity(:, :)
    integer(i4), intent(in) :: k
    real(wp) :: sums(6), moved
    integer(i4) :: i, c

    sums = 0.0_wp
    do i = (k - 1)*chunk + 1, min(k*chunk, int(size(internal, 2), i4))
      if (.not. halo%counts(i)) cycle
      do c = 1, 3
        moved = new%u(c, i) - old%u(c, i)
        sums(1) = sums(1) + new%u(c, i)*(internal(c, i) + initial(c, i))
        sums(2) = sums(2) + moved*(new%external(c, i) + old%external(c, i))
        sums(3) = sums(3) + moved*gravity(c, i)
        sums(4) = sums(4) + moved*(new%reaction(c, i) + old%reaction(c, i))
        sums(5) = sums(5) + moved*(new%tie(c, i) + old%tie(c, i))
        sums(6) = sums(6) + moved*(new%viscous(c, i) + old%viscous(c, i))
      end do
    end do
  end function chunk_works
end module fem_ledger
