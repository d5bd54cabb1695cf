!> SET initial_stress of the port for bodies whose laws have a state: the stress of all points, and
!! the state that starts from it, of the whole body or, within a run, of some elements.
module fem_port_stress
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_density, field_element, field_value
  use fem_body, only: fem_body_type
  use fem_elastic, only: classical
  use fem_polar, only: symmetric_of
  implicit none
  private
  public :: set_begun_stress, set_element_stress, can_begin_elements

contains

  !> Values (6, points) [Pa], in a body with micropolar parts sigma_kl (9, points), symmetric. Fault
  !! P302 where a law has no such start; nothing is changed then.
  subroutine set_begun_stress(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: value(:, :), state(:, :)
    if (body%matter%finite .or. body%matter%micro%active) then
      call errors%add('P302', "talus-fem cannot set 'initial_stress' at finite strain", &
        request%place(), 'give the state in the deck of the solid, or use laws of small strain')
      return
    end if
    allocate (value(merge(6, 9, body%elastic%components == classical), &
                    body%whole%points(body%elastic%points)))
    call request%get(field_value, value, errors)
    if (errors%any()) return
    call body%whole%own_points(value)
    state = body%matter%state
    call begin_points(body, value, request%place(), state, errors)
    call body%dofs%halo%agree(errors)
    if (errors%any()) return
    body%matter%state = state
    body%matter%stress(:size(value, 1), :) = value
    call body%matter%renew_moduli(body%elastic)
    call body%assemble()
  end subroutine set_begun_stress

  !> Can elements of this body begin anew, with a stress of their own?
  pure logical function can_begin_elements(body)
    type(fem_body_type), intent(in) :: body
    can_begin_elements = body%matter%active .and. body%elastic%components == classical
    if (can_begin_elements) can_begin_elements = .not. (body%matter%finite .or. &
      body%matter%micro%active .or. body%pore%active)
  end function can_begin_elements

  !> Stress `value` (6, elements) [Pa] and `density` of elements that begin anew: all points of an
  !! element have the same. Fault P302 where there are none such; nothing is changed then.
  subroutine set_element_stress(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: element(:)
    real(wp), allocatable :: value(:, :), density(:)

    if (.not. can_begin_elements(body)) then
      call errors%add('P302', 'no element of this body can begin anew with a stress', &
        request%place(), 'it needs laws of small strain with a state, and no pore liquid')
      return
    end if
    call request%take_int(field_element, element, errors)
    if (errors%any()) return
    allocate (value(6, size(element)), density(size(element)))
    call request%get(field_value, value, errors)
    call request%get(field_density, density, errors)
    if (errors%any()) return
    if (any(element < 1) .or. any(element > body%whole%elements(body%mesh%elements))) then
      call errors%add('P302', 'stresses are given of elements that do not exist', request%place())
    else if (.not. (all(is_finite(value)) .and. all(is_finite(density)))) then
      call errors%add('P302', 'stresses or densities are no numbers', request%place())
    end if
    if (errors%any()) return
    call body%matter%reject()
    call take_over(body, element, value, density, request%place(), errors)
    call body%dofs%halo%agree(errors)
    if (errors%any()) then
      call body%matter%reject()
      return
    end if
    call body%matter%accept()
    call body%matter%renew_moduli(body%elastic)
    call body%assemble()
  end subroutine set_element_stress

  !> Stress and state of the points of these elements, as far as they are this rank's.
  subroutine take_over(body, element, value, density, place, errors)
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: element(:)
    real(wp), intent(in) :: value(:, :), density(:)
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fault, cure
    integer(i4) :: k, e, q
    do k = 1, size(element)
      e = body%elastic%place_of(element(k))
      if (e == 0) cycle  ! another rank has it
      associate (law => body%matter%law(body%matter%law_of(e))%law)
        do q = body%elastic%point(e), body%elastic%point(e + 1) - 1
          body%matter%stress(:, q) = value(:, k)
          call law%take_over(density(k), body%matter%stress(:, q), &
                             body%matter%state(:law%states, q), fault, cure)
          if (len(fault) == 0) cycle
          call errors%add('P302', 'element '//str(element(k))//': '//fault, place, cure)
          return
        end do
      end associate
    end do
  end subroutine take_over

  !> States of the points of this rank's elements; fault P302 of the first law without such a start.
  subroutine begin_points(body, value, place, state, errors)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: value(:, :)     !! (6 or 9, points) [Pa]
    character(len=*), intent(in) :: place
    real(wp), intent(inout) :: state(:, :)  !! (states, points)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fault, cure
    real(wp) :: six(6)
    integer(i4) :: e, q
    do e = 1, body%mesh%elements
      associate (law => body%matter%law(body%matter%law_of(e))%law, first => body%elastic%point(e))
        do q = first, body%elastic%point(e + 1) - 1
          six = value(:6, q)
          if (size(value, 1) > 6) six = value(symmetric_of, q)
          call law%begin(six, state(:law%states, q), fault, cure)
          if (len(fault) == 0) cycle
          call errors%add('P302', 'element '//str(body%elastic%number_of(e))//', point '// &
                          str(q - first + 1)//': '//fault, place, cure)
          return
        end do
      end associate
    end do
  end subroutine begin_points
end module fem_port_stress
