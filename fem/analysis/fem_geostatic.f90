!> The equilibrium step of a body with an initial stress: imbalance of loads and stress moves it,
!! and displacements, works and the ledger count from there.
module fem_geostatic
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_law, only: at_stored, at_numerical
  use fem_newton, only: newton_step
  use fem_types, only: fem_energy_type
  implicit none
  private
  public :: settle

contains

  !> Initial equilibrium under loads; `moved` is the largest displacement on the
  !! way [m], `iterations` the number of corrections. N309 where there is none.
  subroutine settle(body, moved, iterations, errors)
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(out) :: moved
    integer(i4), intent(out) :: iterations
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(3, body%dofs%blocks) :: internal, nothing
    integer(i4) :: bad, springs
    logical :: dynamic

    moved = 0.0_wp
    iterations = 0
    nothing = 0.0_wp
    call body%matter%update(body%mesh, body%dofs, body%elastic, nothing, nothing, internal, bad)
    call body%pore%force(body%mesh, body%dofs, body%elastic, body%accepted%u, nothing, internal)
    body%accepted%external = internal  ! the loads grow from those that the stress balances
    dynamic = body%scheme%dynamic
    call body%scheme%take_inertia(.false.)
    call body%hold_pressures(.true.)
    springs = body%port%robin%n
    body%port%robin%n = 0  ! a partner's springs hold what moves in a step, not what is the start
    body%port%settling = .true.
    call newton_step(body, body%accepted%time, errors)
    body%port%settling = .false.
    body%port%robin%n = springs
    call body%hold_pressures(.false.)
    call body%scheme%take_inertia(dynamic)
    if (errors%any()) call name_start(errors)
    if (errors%any()) return
    iterations = body%newton%rows
    associate (last => body%dofs%solid)
      moved = sqrt(maxval(sum(body%state%u(:, :last)**2, 1)))
      call body%dofs%halo%highest(moved)
      if (.not. body%matter%micro%active) then  ! whose state depends on total displacements
        nothing(:, last + 1:) = body%state%u(:, last + 1:)
        body%state%u = 0.0_wp
        call body%impose(body%accepted%time, body%state%u)
        body%state%u(:, last + 1:) = nothing(:, last + 1:)
      end if
    end associate
    body%matter%state(at_stored:at_numerical, :) = 0.0_wp
    call body%take_energy(fem_energy_type())
    call body%accept()
    call body%begin_liquid()
  end subroutine settle

  !> A start that is not found is told as such: the last step's fault speaks of steps and cuts.
  subroutine name_start(errors)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: reason
    if (errors%item(1)%code /= 'N311') return
    reason = errors%item(1)%message
    call errors%clear()
    call errors%add('N309', 'stress and loads at the start are not in balance and no state '// &
                    'nearby is: '//reason, '', 'write as &pressure or &traction what acts at '// &
                    'the start on every surface under stress that is not held, also where '// &
                    'grains of a partner will carry it')
  end subroutine name_start
end module fem_geostatic
