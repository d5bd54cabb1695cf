!> Groups &wear: planes and surfaces that wear. Faults D390, D391.
module dem_setup_wear
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_suggest, only: did_you_mean
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_state, only: dem_data_type
  use dem_surface_state, only: surface_membrane
  use dem_wear, only: begin_wear
  implicit none
  private
  public :: read_wear

contains

  !> Coefficients of all that wears.
  subroutine read_wear(deck, walls, served, ranks, d, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: walls(:)  !! names of the planes
    logical, intent(in) :: served              !! a partner drives the run
    integer(i4), intent(in) :: ranks
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (deck%count('wear') == 0 .or. errors%any()) return
    call begin_wear(d)
    if (served) call deck%fault(errors, 'D391', 'wear is not counted under a partner, which '// &
      'may reject steps', 'wear', 1, '', 'leave &wear out, or run talus-dem alone')
    if (ranks > 1) call deck%fault(errors, 'D391', 'wear is counted on one rank, not on '// &
      str(ranks), 'wear', 1, '', 'run with threads')
    do k = 1, deck%count('wear')
      if (deck%given('wear', k, 'wall')) then
        call read_one(deck, k, 'wall', walls, d%wear%plane_rate, errors)
      else if (d%surfaces%n > 0) then
        call read_one(deck, k, 'surface', d%surfaces%name, d%wear%body_rate, errors)
      else
        call deck%fault(errors, 'D390', 'the deck has no surface that could wear', 'wear', k, &
                        'surface', 'add the &surface, or name a wall')
      end if
    end do
    do k = 1, d%surfaces%n
      if (d%surfaces%kind(k) /= surface_membrane) cycle
      call deck%fault(errors, 'D391', 'wear is not counted in runs with a membrane', 'wear', 1, &
                      '', 'leave &wear out, or take planes in place of the membrane')
      return
    end do
  end subroutine read_wear

  !> Rate of wear of the wall or surface that group k names.
  subroutine read_one(deck, k, key, names, rate, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    character(len=*), intent(in) :: key
    type(string_type), intent(in) :: names(:)
    real(wp), intent(inout) :: rate(:)  !! of each name, 0: not given yet [1/Pa]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp) :: coefficient, hardness
    integer(i4) :: j
    call deck%get('wear', k, key, name)
    call deck%get('wear', k, 'coefficient', coefficient)
    call deck%get('wear', k, 'hardness', hardness)
    do j = 1, size(names)
      if (names(j)%s /= name) cycle
      if (rate(j) > 0.0_wp) call deck%fault(errors, 'D390', key//" '"//name//"' wears twice", &
                                            'wear', k, key, 'one group a '//key)
      rate(j) = coefficient/hardness
      return
    end do
    call deck%fault(errors, 'D390', 'there is no '//key//" '"//name//"'", 'wear', k, key, &
                    did_you_mean(name, names, key//'s of this deck:'))
  end subroutine read_one
end module dem_setup_wear
