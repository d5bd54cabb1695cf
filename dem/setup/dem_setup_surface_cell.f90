!> Surfaces in a cell: which of them can have images. Fault D274.
module dem_setup_surface_cell
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use dem_cell, only: is_periodic
  use dem_state, only: dem_cell_type
  use dem_surface_images, only: body_width, turned_width, crosses_edges, &
    endless_along
  use dem_surface_state, only: dem_surfaces_type, is_round
  implicit none
  private
  public :: check_surfaces_in_cell

  character(len=12), parameter :: groups(4) = [character(len=12) :: 'surface', 'penetrometer', &
    'cylinder', 'membrane']  !! in the order of the bodies
  character(len=12), parameter :: motions(3) = [character(len=12) :: 'cell_rate', 'cell_stress', &
    'probe']
  real(wp), parameter :: widest = 1.0_wp - 1.0e-6_wp  !! of an edge, with a gap to the image
  real(wp), parameter :: along_axis = 1.0e-9_wp  !! part of a spin across an axis that is none

contains

  !> Surfaces stand in cells that keep their edges, each apart from its own images (D274).
  subroutine check_surfaces_in_cell(deck, cell, s, errors)
    type(deck_type), intent(in) :: deck
    type(dem_cell_type), intent(in) :: cell
    type(dem_surfaces_type), intent(in) :: s
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: b, k

    if (.not. cell%active .or. s%n == 0) return
    do k = 1, size(motions)
      if (deck%count(trim(motions(k))) == 0) cycle
      call refuse(deck, 1_i4, 'a cell that deforms has no surfaces', 'take the surfaces or &'// &
                  trim(motions(k))//' out', errors)
      return
    end do
    if (.not. is_periodic(cell)) return
    if (deck%count('membrane') > 0) then
      call refuse(deck, s%n, 'a periodic cell has no membranes', 'take the membranes or the '// &
                  'cell out', errors)
      return
    end if
    do b = 1, s%n
      call check_body(deck, cell, s, b, errors)
    end do
  end subroutine check_surfaces_in_cell

  subroutine check_body(deck, cell, s, b, errors)
    type(deck_type), intent(in) :: deck
    type(dem_cell_type), intent(in) :: cell
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    type(error_list_type), intent(inout) :: errors
    logical :: turns, free, one_axis
    real(wp) :: across(3), axis(3), width
    integer(i4) :: k

    free = .false.
    if (allocated(s%rigid%free)) free = any(s%rigid%free(4:, b) > 0.5_wp)  ! turns by forces
    call find_axis(deck, s, b, axis, one_axis)
    turns = free .or. any(abs(axis) > 0.0_wp)
    across = s%spin(:, b) - dot_product(s%spin(:, b), s%round%axis(:, b))*s%round%axis(:, b)
    if (crosses_edges(s, b, cell)) then
      call refuse(deck, b, "'"//s%name(b)%s//"' has no end and leaves the periodic cell at an "// &
                  'angle', 'give it a length, or its axis the direction of an edge', errors)
      return
    end if
    do k = 1, 3
      if (.not. cell%periodic(k)) cycle
      if (endless_along(s, b, cell, k)) then
        if (.not. free .and. norm2(across) <= along_axis*norm2(s%spin(:, b))) cycle
        call refuse(deck, b, "'"//s%name(b)%s//"' has no end along edge "//str(k)//' of the '// &
                    'cell and turns away from it', 'give it a length, or spin about its axis', &
                    errors)
        cycle
      end if
      if (turns .and. .not. free .and. one_axis .and. .not. is_round(s, b)) then
        width = turned_width(s, b, cell, k, axis)
      else
        width = body_width(s, b, cell, k, turns)
      end if
      if (width < widest) cycle
      call refuse(deck, b, "'"//s%name(b)%s//"' reaches over "//short_number(width)// &
                  ' of edge '//str(k)//' of the periodic cell: it would meet its own image', &
                  'a wider cell; floors and plates without end are walls, bars without end '// &
                  'cylinders without length', errors)
    end do
  end subroutine check_body

  !> Direction of the axis about which body b turns by its own spin and its motions, zero if it does
  !! not; whether that is one axis.
  subroutine find_axis(deck, s, b, axis, one_axis)
    type(deck_type), intent(in) :: deck
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(out) :: axis(3)
    logical, intent(out) :: one_axis
    character(len=:), allocatable :: surface
    real(wp), allocatable :: spin(:)
    integer(i4) :: k

    one_axis = .true.
    axis = s%spin(:, b)
    if (norm2(axis) > 0.0_wp) axis = axis/norm2(axis)
    do k = 1, deck%count('motion')
      call deck%get('motion', k, 'surface', surface)
      call deck%get('motion', k, 'spin', spin)
      if (surface /= s%name(b)%s .or. .not. norm2(spin) > 0.0_wp) cycle
      spin = spin/norm2(spin)
      one_axis = one_axis .and. (norm2(axis) <= 0.0_wp .or. &
                                 abs(dot_product(axis, spin)) >= 1.0_wp - along_axis)
      axis = spin
    end do
  end subroutine find_axis

  !> Fault of body b in its group of the deck.
  subroutine refuse(deck, b, text, hint, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: b
    character(len=*), intent(in) :: text, hint
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: g, k
    k = b
    do g = 1, size(groups)
      if (k <= deck%count(trim(groups(g)))) exit
      k = k - deck%count(trim(groups(g)))
    end do
    if (g > size(groups)) error stop 'bug: a body that no group of the deck has made'
    call deck%fault(errors, 'D274', text, trim(groups(g)), k, '', hint)
  end subroutine refuse
end module dem_setup_surface_cell
