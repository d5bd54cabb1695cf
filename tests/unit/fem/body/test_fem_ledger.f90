!> Works of one step: stored energy at its end, works of loads, supports, springs and dashpots with
!! the mean of the forces at both ends, weight as given.
program test_fem_ledger
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_halo, only: fem_halo_type
  use fem_ledger, only: step_works, fem_works_type
  use fem_types, only: fem_state_type
  implicit none
  integer(i4), parameter :: blocks = 3000  ! some chunks
  type(test_type) :: test
  type(fem_halo_type) :: alone
  type(fem_state_type) :: old, new
  type(fem_works_type) :: works
  real(wp), dimension(3, blocks) :: internal, initial, gravity, moved
  real(wp) :: limit

  call random_init(repeatable=.true., image_distinct=.false.)
  call fill(old)
  call fill(new)
  call random_number(internal)
  call random_number(initial)
  call random_number(gravity)
  moved = new%u - old%u
  limit = 1.0e-14_wp*size(moved)  ! sums in another order
  call step_works(alone, old, new, internal, initial, gravity, works)
  call test%check_close('stored', works%strain, 0.5_wp*sum(new%u*(internal + initial)), limit)
  call test%check_close('loads', works%load, 0.5_wp*sum(moved*(old%external + new%external)), limit)
  call test%check_close('weight', works%weight, sum(moved*gravity), limit)
  call test%check_close('supports', works%support, 0.5_wp*sum(moved*(old%reaction &
                                                                     + new%reaction)), limit)
  call test%check_close('springs', works%spring, 0.5_wp*sum(moved*(old%tie + new%tie)), limit)
  call test%check_close('dashpots', works%damping, 0.5_wp*sum(moved*(old%viscous &
                                                                     + new%viscous)), limit)
  call test%finish()

contains

  !> Any state.
  subroutine fill(state)
    type(fem_state_type), intent(inout) :: state
    allocate (state%u(3, blocks), state%external(3, blocks), state%reaction(3, blocks), &
              state%tie(3, blocks), state%viscous(3, blocks))
    call random_number(state%u)
    call random_number(state%external)
    call random_number(state%reaction)
    call random_number(state%tie)
    call random_number(state%viscous)
  end subroutine fill
end program test_fem_ledger
