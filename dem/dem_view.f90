!> Looks at a system that need no more than its grains, a list of its contacts, or sums of them: of
!! many ranks these come in slabs or as sums, and the whole with its lists is not gathered.
module dem_view
  use talus_kinds, only: wp
  use dem_measure, only: forces_left, wall_stiffnesses
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  private
  public :: see_grains, see_contacts, wall_stiffness_of, balance_of_forces

contains

  !> Places, motion and forces of the grains as they are now.
  subroutine see_grains(system)
    type(dem_system_type), intent(inout) :: system
    if (system%parted()) call system%crew%see_grains(system%dem_data_type)
  end subroutine see_grains

  !> Contacts at the last evaluation.
  subroutine see_contacts(system, list)
    type(dem_system_type), intent(inout) :: system
    type(dem_contacts_type), intent(inout) :: list
    if (system%parted()) then
      call system%crew%see_contacts(system%dem_data_type, list)
    else
      call system%contacts(list)
    end if
  end subroutine see_contacts

  !> Stiffness of the contacts of each plane [N/m].
  function wall_stiffness_of(system) result(stiffness)
    type(dem_system_type), intent(inout) :: system
    real(wp) :: stiffness(system%planes%n), sums(4 + system%planes%n)
    if (system%parted()) then
      call system%crew%balance(sums)
      stiffness = sums(5:)
    else
      stiffness = wall_stiffnesses(system%dem_data_type)
    end if
  end function wall_stiffness_of

  !> Sum of the forces left on free grains [N], their number, sum of the forces of contacts [N],
  !! their number.
  function balance_of_forces(system) result(sums)
    type(dem_system_type), intent(inout) :: system
    real(wp) :: sums(4), all(4 + system%planes%n)
    type(dem_contacts_type) :: list
    integer :: i
    if (system%parted()) then
      call system%crew%balance(all)
      sums = all(:4)
      return
    end if
    sums = [forces_left(system%dem_data_type), 0.0_wp, 0.0_wp]
    call system%contacts(list)
    do i = 1, list%n
      sums(3:) = sums(3:) + [norm2(list%force(:, i)), 1.0_wp]
    end do
  end function balance_of_forces
end module dem_view
