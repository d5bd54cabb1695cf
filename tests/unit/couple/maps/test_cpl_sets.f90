!> Rows of a pack for the ids of a checkpoint, of which some have broken since.
program test_cpl_sets
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use cpl_sets, only: pack_type
  implicit none
  type(test_type) :: test

  call lays_out()
  call test%finish()

contains

  !> Ids 2 and 9 are there no more, 5 has come since: rows of the others stay with their ids.
  subroutine lays_out()
    type(pack_type) :: pack
    integer(i8), parameter :: ids(5) = [1_i8, 2_i8, 4_i8, 7_i8, 9_i8]
    pack = pack_of([1_i8, 4_i8, 5_i8, 7_i8])
    call pack%lay_out(ids)
    call test%check('ids', all(pack%id == ids))
    call test%check_all_close('radii', pack%radius, [1.0_wp, 0.0_wp, 4.0_wp, 7.0_wp, 0.0_wp], &
                              0.0_wp)
    call test%check_all_close('masses', pack%mass, 10.0_wp*pack%radius, 0.0_wp)
    call test%check_all_close('places', pack%x(3, :), -pack%radius, 0.0_wp)
    call test%check_all_close('volumes', pack%volume, 20.0_wp*pack%radius, 0.0_wp)
    call test%check('kinds', all(pack%kind == [1_i4, 0_i4, 4_i4, 7_i4, 0_i4]))
    call test%check('round', all(pack%round .eqv. [.true., .false., .true., .true., .false.]))
    call test%check_all_close('turned by nothing', pack%quat(1, :), &
                              [0.5_wp, 1.0_wp, 0.5_wp, 0.5_wp, 1.0_wp], 0.0_wp)
  end subroutine lays_out

  !> Grains whose values follow from their ids.
  function pack_of(id) result(pack)
    integer(i8), intent(in) :: id(:)
    type(pack_type) :: pack
    pack%id = id
    pack%radius = real(id, wp)
    pack%mass = 10.0_wp*pack%radius
    pack%inertia = pack%radius
    pack%slimmest = pack%radius
    pack%volume = 20.0_wp*pack%radius
    pack%kind = int(id, i4)
    allocate (pack%x(3, size(id)), pack%quat(4, size(id)), source=0.5_wp)
    pack%x(3, :) = -pack%radius
    allocate (pack%round(size(id)), source=.true.)
  end function pack_of
end program test_cpl_sets
