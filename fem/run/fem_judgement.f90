!> Health of a run of talus-fem; what the figures and their limits mean stands in the manual
!! (running, Health).
module fem_judgement
  use talus_kinds, only: wp, i4
  use talus_health, only: health_type
  use fem_body, only: fem_body_type
  use fem_model, only: fem_model_type
  use fem_output, only: energy_error
  implicit none
  private
  public :: watch_gradient, judge_health, largest_gradient

  real(wp), parameter :: none = huge(1.0_wp)
  real(wp), parameter :: energy_limits(2) = [1.0e-2_wp, 1.0e-1_wp]  !! closure over the largest term
  real(wp), parameter :: gradient_limits(2) = [0.1_wp, 10.0_wp]     !! of displacements

contains

  !> Largest displacement gradient so far, at the states that are looked at.
  subroutine watch_gradient(model)
    type(fem_model_type), intent(inout) :: model
    if (model%analysis%listed) return  ! modes have any length, amplitudes are not those of a time
    model%gradient = max(model%gradient, largest_gradient(model%body))
  end subroutine watch_gradient

  !> All figures of the run so far. All ranks call it together.
  subroutine judge_health(model, health)
    type(fem_model_type), intent(inout) :: model
    type(health_type), intent(inout) :: health
    real(wp) :: top(1), limits(2)
    call watch_gradient(model)
    top = model%gradient
    call model%ranks%most(top)
    limits = energy_limits
    ! results of statics do not hang on the work of their path; what passes the port is judged by
    ! talus-couple
    if (model%served .or. .not. model%body%scheme%dynamic) limits(2) = none
    call health%judge(model%deck, 'energy_error', 'the energy error', energy_error(model%body), &
                      limits, 'a smaller dt')
    limits = gradient_limits
    if (model%served) limits(2) = none
    call health%judge(model%deck, 'displacement_gradient', &
                      'in a law for small strains the displacement gradient', top(1), limits, &
                      'check loads, young and units, or take a law of finite strain')
  end subroutine judge_health

  !> Largest |u_b - u_a|/|x_b - x_a| of two corners of an element whose law is one of small strains:
  !! stretch and turn together [-].
  pure real(wp) function largest_gradient(body) result(largest)
    type(fem_body_type), intent(in) :: body
    integer(i4) :: e
    largest = 0.0_wp
    do e = 1, body%mesh%elements
      if (at_finite_strain(body, e)) cycle
      associate (nodes => body%mesh%node(body%mesh%start(e):body%mesh%start(e + 1) - 1))
        largest = max(largest, sqrt(square_of(nodes(:corners_of(size(nodes, kind=i4))), &
                                              body%mesh%x, body%accepted%u)))
      end associate
    end do
  end function largest_gradient

  !> Its square of all pairs of some nodes.
  pure real(wp) function square_of(node, x, u) result(square)
    integer(i4), intent(in) :: node(:)
    real(wp), intent(in) :: x(:, :), u(:, :)  !! (3, nodes), (3, blocks) [m]
    integer(i4) :: a, b
    square = 0.0_wp
    do a = 1, size(node) - 1
      do b = a + 1, size(node)
        square = max(square, sum((u(:, node(b)) - u(:, node(a)))**2) &
                     /sum((x(:, node(b)) - x(:, node(a)))**2))
      end do
    end do
  end function square_of

  !> Corners, which come first, of an element with n nodes.
  pure integer(i4) function corners_of(n)
    integer(i4), intent(in) :: n
    corners_of = n
    if (n > 8) corners_of = 8
    if (n == 10) corners_of = 4
  end function corners_of

  pure logical function at_finite_strain(body, e)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e
    at_finite_strain = body%matter%micro%active
    if (at_finite_strain .or. .not. body%matter%finite) return
    at_finite_strain = body%matter%law(body%matter%law_of(e))%law%finite
  end function at_finite_strain
end module fem_judgement
