!> SET places: nodes are somewhere else at rest from now on, as a partner wants it whose elements
!! are born again where material has moved (theory of overlap coupling, Closing).
module fem_port_places
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_node, field_x
  use talus_text, only: str, is_finite
  use fem_body, only: fem_body_type
  implicit none
  private
  public :: set_places

contains

  !> Places `x` of nodes at rest (3, nodes) [m]: elements around them are made anew.
  subroutine set_places(body, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: node(:)
    real(wp), allocatable :: x(:, :)

    call request%take_int(field_node, node, errors)
    if (errors%any()) return
    allocate (x(3, size(node)))
    call request%get(field_x, x, errors)
    if (errors%any()) return
    if (any(node < 1) .or. any(node > body%mesh%nodes) .or. .not. all(is_finite(x))) then
      call errors%add('P302', 'places are given of nodes that do not exist, or are no numbers', &
                      request%place(), 'node ids go from 1 to '//str(body%mesh%nodes))
      return
    end if
    if (size(node) == 0) return
    if (.not. allocated(body%port%moved)) &
      allocate (body%port%moved(3, body%mesh%nodes), source=0.0_wp)
    body%port%moved(:, node) = body%port%moved(:, node) + x - body%mesh%x(:, node)
    body%mesh%x(:, node) = x
    if (allocated(body%whole%mesh%x)) body%whole%mesh%x(:, node) = x
    call body%assemble()
  end subroutine set_places
end module fem_port_places
