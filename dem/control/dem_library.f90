!> Several tiles of one material in one bed, each for a state of it: what they are, and what is
!! wrong with them (theory-dem, Conversion). Faults D481, D482, I286 to I288.
module dem_library
  use talus_kinds, only: wp, i4, i8
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_text, only: str
  use talus_vectors, only: cross
  use dem_packing, only: dem_packing_type
  use dem_tile_contacts, only: tile_contacts_type
  implicit none
  private
  public :: tile_type, check_library, read_stamp, density_of

  real(wp), parameter :: pi = acos(-1.0_wp)
  real(wp), parameter :: same_edge = 1.0e-6_wp    !! part of the edges by which cells may differ
  real(wp), parameter :: same_state = 1.0e-3_wp   !! of the density, in which tiles are too alike
  real(wp), parameter :: least_plastic = 1.0e-6_wp  !! strain by which they are different then
  !> Of the stamp: what all tiles of a bed have alike, friction of making, pressure [Pa], solid
  !! fraction.
  character(len=15), parameter :: constants(7) = [character(len=15) :: 'young', 'poisson', &
    'density', 'friction', 'making_friction', 'mean_wanted', 'solid_fraction']
  integer(i4), parameter :: alike = 4

  !> A tile of the bed.
  type :: tile_type
    type(dem_packing_type) :: rows        !! in the order of their ids
    type(tile_contacts_type) :: contacts
    integer(i8) :: before = 0             !! id before its first
    real(wp) :: plastic = 0.0_wp          !! strain that it stands for [-]
    real(wp) :: constant(7) = 0.0_wp      !! see constants
  end type tile_type

contains

  !> I286: a tile without a stamp, whose material no one knows.
  subroutine read_stamp(tile, path, errors)
    type(tile_type), intent(inout) :: tile
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    integer(i4) :: k
    call file%open(path, errors)
    if (errors%any()) return
    if (file%exists('/tile')) then
      do k = 1, size(constants)
        call file%attr_get('/tile', trim(constants(k)), tile%constant(k), errors)
      end do
    else
      call errors%add('I286', 'one tile of several has no stamp that tells its material', path, &
                      'take what talus pack tile has written, as it is')
    end if
    call file%close(errors)
  end subroutine read_stamp

  !> What is wrong with tiles beside the first one.
  subroutine check_library(tile, deck, errors)
    type(tile_type), intent(in) :: tile(:)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: t
    if (size(tile) == 1) return
    do t = 1, size(tile)
      if (.not. deck%given('tile', t, 'plastic_strain')) &
        call deck%fault(errors, 'D481', 'one of several tiles does not say for which state it '// &
          'stands', 'tile', t, '', 'give plastic_strain: 0.0 for the bed as it was made')
      if (any(tile(t)%rows%exponent > 2.0_wp) .or. any(abs(tile(t)%rows%skew) > 0.0_wp)) &
        call errors%add('I288', 'one of several tiles has grains that are neither spheres nor '// &
          'ellipsoids', deck%path('tile', t, 'file'), 'seams of tiles are found for these alone')
      if (t > 1) call check_pair(tile(1), tile(t), deck%path('tile', t, 'file'), errors)
      call check_states(tile(:t), deck, errors)
    end do
  end subroutine check_library

  !> I286, I287: another material or cell than the first tile's.
  subroutine check_pair(first, other, path, errors)
    type(tile_type), intent(in) :: first, other
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, alike
      if (.not. abs(first%constant(k) - other%constant(k)) > 0.0_wp) cycle
      call errors%add('I286', 'the tile is of another material than the first one: '// &
        trim(constants(k))//' '//str(other%constant(k))//' and '//str(first%constant(k)), path, &
        'all tiles of a bed are of one material')
      exit
    end do
    if (maxval(abs(first%rows%cell - other%rows%cell)) > same_edge*maxval(abs(first%rows%cell)) &
        .or. maxval(abs(first%rows%cell_origin - other%rows%cell_origin)) &
        > same_edge*maxval(abs(first%rows%cell))) &
      call errors%add('I287', 'the tile has another cell than the first one', path, &
                      'make all tiles of a bed with the same --edge and --aspect')
  end subroutine check_pair

  !> D482: the last of these tiles stands for the state of an earlier one.
  subroutine check_states(tile, deck, errors)
    type(tile_type), intent(in) :: tile(:)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: t, n
    n = size(tile)
    do t = 1, n - 1
      if (abs(tile(t)%plastic - tile(n)%plastic) > least_plastic) cycle
      if (abs(density_of(tile(t))/density_of(tile(n)) - 1.0_wp) > same_state) cycle
      call deck%fault(errors, 'D482', 'tiles '//str(t)//' and '//str(n)//' have the same '// &
        'density and stand for the same plastic strain', 'tile', n, 'plastic_strain', &
        'no element could choose between them: leave one out, or say what it stands for')
    end do
  end subroutine check_states

  !> Mass of the grains over the volume of the cell [kg/m^3].
  pure real(wp) function density_of(tile) result(density)
    type(tile_type), intent(in) :: tile
    associate (h => tile%rows%cell)
      density = tile%constant(3)*volume_of(tile%rows)/ &
        abs(dot_product(h(:, 1), cross(h(:, 2), h(:, 3))))
    end associate
  end function density_of

  !> Of the grains [m^3].
  pure real(wp) function volume_of(rows) result(volume)
    type(dem_packing_type), intent(in) :: rows
    volume = 4.0_wp/3.0_wp*pi*sum(product(rows%axes, 1))
  end function volume_of
end module dem_library
