!> Access to a system that needs no more than its grains, a list of its contacts, or sums of them:
!! on many ranks these are sent in slabs or as sums, without gathering the whole.
module dem_view
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use dem_measure, only: forces_left, wall_stiffnesses
  use dem_packing, only: dem_group_type, dem_packing_type, packed_besides_type, write_packing
  use dem_records, only: index_of
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  private
  public :: see_grains, see_contacts, keep_packing, wall_stiffness_of, balance_of_forces

contains

  !> Places, motion and forces of the grains as they are now.
  subroutine see_grains(system)
    type(dem_system_type), intent(inout) :: system
    if (system%owner_changed()) call system%rank_team%see_grains(system%dem_data_type)
  end subroutine see_grains

  !> Contacts at the last evaluation.
  subroutine see_contacts(system, list)
    type(dem_system_type), intent(inout) :: system
    type(dem_contacts_type), intent(inout) :: list
    if (system%owner_changed()) then
      call system%rank_team%see_contacts(system%dem_data_type, list)
    else
      call system%contacts(list)
    end if
  end subroutine see_contacts

  !> Write grains, and what their contacts bear by friction, as a packing.
  subroutine keep_packing(system, path, packing, errors)
    type(dem_system_type), intent(inout) :: system
    character(len=*), intent(in) :: path
    type(dem_packing_type), intent(in) :: packing  !! that the run began with: groups, templates
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type) :: list
    type(packed_besides_type) :: besides

    call see_grains(system)
    call see_contacts(system, list)
    if (allocated(system%surcharge)) besides%load = merge(system%surcharge, 0.0_wp, &
                                                          system%surcharge_top)
    besides%clumps = system%clumps
    besides%templates = packing%clumps
    call write_packing(path, system%grains, those_left(system, packing%group), errors, &
                       system%cell, list, besides)
  end subroutine keep_packing

  !> Groups without the grains that have gone through a sink.
  function those_left(system, groups) result(rest)
    type(dem_system_type), intent(in) :: system
    type(dem_group_type), intent(in) :: groups(:)
    type(dem_group_type), allocatable :: rest(:)
    integer(i4) :: k, m
    rest = groups
    if (.not. system%open) return
    do k = 1, size(rest)
      rest(k)%id = pack(rest(k)%id, [(index_of(system%dem_data_type, real(rest(k)%id(m), wp)) > 0, &
                                      m=1, size(rest(k)%id))])
    end do
  end function those_left

  !> Stiffness of the contacts of each plane [N/m].
  function wall_stiffness_of(system) result(stiffness)
    type(dem_system_type), intent(inout) :: system
    real(wp) :: stiffness(system%planes%n), sums(4 + system%planes%n)
    if (system%owner_changed()) then
      call system%rank_team%balance(sums)
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
    if (system%owner_changed()) then
      call system%rank_team%balance(all)
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
