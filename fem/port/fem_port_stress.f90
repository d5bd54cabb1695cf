!> SET initial_stress of the port for bodies whose laws have a state: the stress of all points, and
!! the state that starts from it.
module fem_port_stress
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_value
  use fem_body, only: fem_body_type
  use fem_elastic, only: classical
  use fem_polar, only: symmetric_of
  implicit none
  private
  public :: set_begun_stress

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
