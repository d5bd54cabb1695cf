!> Contacts of a tile by its rows, and those that grains of copies bring along when they wake.
module dem_tile_contacts
  use talus_kinds, only: wp, i4, i8
  use dem_packed_contacts, only: row_of
  use dem_start_springs, only: start_springs_type
  implicit none
  private
  public :: tile_contacts_type, sort_contacts

  !> Tangential forces of contacts between rows of the tile and of its neighbour copies.
  type :: tile_contacts_type
    integer(i4), allocatable :: row(:, :)    !! (2, contacts) first and second
    integer(i4), allocatable :: shift(:, :)  !! (3, contacts) edges from the second to its image
    real(wp), allocatable :: force(:, :)     !! (3, contacts) on the second [N]
    integer(i4), allocatable :: start(:)     !! (rows + 1) in contact
    integer(i4), allocatable :: contact(:)   !! of each row, those in which it is the second with
                                             !! a minus
  end type tile_contacts_type

contains

  !> Contacts of a packing whose rows stand in the order of their ids.
  pure subroutine sort_contacts(contacts, id, springs)
    type(tile_contacts_type), intent(out) :: contacts
    integer(i8), intent(in) :: id(:)  !! rising
    type(start_springs_type), intent(in) :: springs
    integer(i4), allocatable :: fill(:)
    integer(i4) :: c, r

    allocate (contacts%row(2, springs%given), contacts%start(size(id) + 1), source=0_i4)
    allocate (contacts%shift(3, springs%given), source=0_i4)
    if (allocated(springs%shift)) contacts%shift = springs%shift(:, :springs%given)
    contacts%force = springs%force(:, :springs%given)
    do c = 1, springs%given
      contacts%row(:, c) = [row_of(id, springs%ids(1, c)), row_of(id, springs%ids(2, c))]
      contacts%start(contacts%row(:, c) + 1) = contacts%start(contacts%row(:, c) + 1) + 1
    end do
    contacts%start(1) = 1
    do r = 1, size(id)
      contacts%start(r + 1) = contacts%start(r + 1) + contacts%start(r)
    end do
    allocate (contacts%contact(2*springs%given))
    fill = contacts%start
    do c = 1, springs%given
      associate (first => fill(contacts%row(1, c)))
        contacts%contact(first) = c
        first = first + 1
      end associate
      associate (second => fill(contacts%row(2, c)))
        contacts%contact(second) = -c
        second = second + 1
      end associate
    end do
  end subroutine sort_contacts
end module dem_tile_contacts
