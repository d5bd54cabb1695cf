!> Do grains and solid of an overlap speak of the same material? Density and stiffness of both where
!! they overlap must be of one order; units of one side that are others show here.
module cpl_overlap_units
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type, rows_of_contacts
  use cpl_sets, only: part_free
  implicit none
  private
  public :: check_units

  real(wp), parameter :: most = 100.0_wp  !! ratio of one side over the other that is let pass

contains

  !> I446 stiffness, I447 density; contacts are not checked if there are none.
  subroutine check_units(o, contacts, points, errors)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(error_list_type), intent(inout) :: errors
    real(wp) :: volume, pack, solid, shear(size(points%moduli, 2))

    volume = free_volume(o, points)
    solid = sum(o%cells%mass)/sum(points%weight)
    pack = sum(o%pack%mass(o%sets%free), o%sets%free_spot%element > 0)/volume
    if (differ(pack, solid)) &
      call errors%add('I447', 'the grains in the elements of free grains have '// &
        short_number(pack)//' kg/m3, the solid '//short_number(solid)//' kg/m3', '', &
        'both are the same ground: check density and units of both decks, of packing and mesh')
    if (.not. allocated(contacts%stiffness)) return
    pack = contact_shear(o, contacts)/volume
    shear = points%moduli(2, :) + 0.5_wp*points%moduli(3, :)
    solid = maxval(shear)
    if (differ(pack, solid)) &
      call errors%add('I446', 'the contacts of the free grains give a shear modulus of '// &
        short_number(pack)//' Pa (an upper bound), the solid has '// &
        short_number(solid)//' Pa', '', &
        "both are the same ground: check units and moduli of both decks, or write moduli = "// &
        "'affine' or 'probed' in &overlap")
  end subroutine check_units

  pure logical function differ(a, b)
    real(wp), intent(in) :: a, b
    differ = a > 0.0_wp .and. b > 0.0_wp .and. max(a, b) > most*min(a, b)
  end function differ

  !> Volume of the elements of free grains [m^3].
  pure real(wp) function free_volume(o, points)
    type(overlap_type), intent(in) :: o
    type(points_type), intent(in) :: points
    free_volume = sum(points%weight, o%sets%part(points%element) == part_free)
  end function free_volume

  !> Sum of l^2 (2 kn + 3 ks)/30 over the contacts of free grains under elements, half of those with
  !! others [J].
  real(wp) function contact_shear(o, contacts) result(total)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    integer(i4), allocatable :: pair(:, :)
    logical :: seen(size(o%pack%id))
    integer(i4) :: c
    seen = .false.
    seen(o%sets%free) = o%sets%free_spot%element > 0
    call rows_of_contacts(o, contacts, pair)
    total = 0.0_wp
    do c = 1, size(pair, 2)
      if (any(pair(:, c) == 0)) cycle
      total = total + 0.5_wp*count(seen(pair(:, c))) &
              *sum((o%pack%x(:, pair(2, c)) - o%pack%x(:, pair(1, c)))**2) &
              *(2.0_wp*contacts%stiffness(1, c) + 3.0_wp*contacts%stiffness(2, c))/30.0_wp
    end do
  end function contact_shear
end module cpl_overlap_units
