!> The &analysis of the deck: kind, time integration, damping, absorbing faces.
module fem_setup_analysis
  use talus_kinds, only: i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_absorbing, only: absorb
  use fem_analyses, only: choose_analysis
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_mesh, only: find_group, group_hint
  use fem_types, only: group_facet
  implicit none
  private
  public :: read_analysis, read_absorbing

contains

  !> The analysis and its numbers.
  subroutine read_analysis(deck, body, analysis, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    class(fem_analysis_type), allocatable, intent(out) :: analysis
    type(error_list_type), intent(inout) :: errors

    call choose_analysis(deck, analysis)
    call analysis%read(deck, body%scheme, errors)
    body%scheme%massive = body%scheme%massive .or. body%scheme%dynamic
    body%scheme%damped = body%scheme%damped .or. body%scheme%dynamic
    call deck%get('analysis', 1, 'rayleigh_mass', body%damping%mass)
    call deck%get('analysis', 1, 'rayleigh_stiffness', body%damping%stiffness)
  end subroutine read_analysis

  !> Dashpots of the absorbing faces, once their elements are known.
  subroutine read_absorbing(deck, body, errors)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: s, g, lost

    do s = 1, deck%count('absorbing')
      call deck%get('absorbing', s, 'group', name)
      g = find_group(body%mesh, name, [group_facet])
      if (g == 0) then
        call deck%fault(errors, 'D301', "the mesh has no facet group '"//name//"'", 'absorbing', &
                        s, 'group', group_hint(body%mesh, name, [group_facet]))
        cycle
      end if
      if (any_layered(body, g)) then
        call deck%fault(errors, 'D329', 'absorbing faces cannot absorb the waves of a layered '// &
                        'solid', 'absorbing', s, 'group', 'put a solid without layers there')
        cycle
      end if
      call absorb(body%mesh, body%dofs, body%elastic, body%mesh%group(g), body%damping, lost, &
                  body%pore%undrained(body%mesh%elements))
      if (lost > 0) call deck%fault(errors, 'D326', 'the element of facet '//str(lost)//" of '"// &
        name//"' is not in the mesh file", 'absorbing', s, 'group', &
        "make the mesh with `talus mesh`, which writes the dataset 'cell' of facet groups")
    end do
    if (deck%count('absorbing') > 0) call body%damping%complete(body%dofs%halo)
  end subroutine read_absorbing

  !> Has an element of facet group g layers?
  pure logical function any_layered(body, g)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: g
    integer(i4) :: f
    any_layered = .false.
    if (.not. allocated(body%mesh%group(g)%element)) return
    do f = 1, size(body%mesh%group(g)%element)
      associate (e => body%mesh%group(g)%element(f))
        if (e > 0) any_layered = any_layered .or. body%elastic%layered_of(e) > 0
      end associate
    end do
  end function any_layered
end module fem_setup_analysis
