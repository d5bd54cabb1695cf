!> Heat conduction of two grains and a plane, by hand: flows, balance, limit of the step.
program test_dem_heat
  use talus_kinds, only: wp, i4
  use talus_text, only: append_string
  use talus_test, only: test_type
  use dem_heat, only: begin_heat, conduct, heat_content, heat_limit
  use dem_state, only: dem_data_type, lanes, history_size, history_side, history_root
  implicit none
  type(test_type) :: test
  real(wp), parameter :: radius = 0.06_wp, side = 0.3_wp  !! contact radius: root times side
  real(wp), parameter :: between = 4.0_wp*2.0_wp*6.0_wp/8.0_wp*radius
  real(wp), parameter :: at_plane = 2.0_wp*2.0_wp*radius

  call check_flows()
  call check_limit()
  call check_held()
  call test%finish()

contains

  !> Grains 1 and 2 of two materials touch; grain 1 touches the plane.
  subroutine make_grains(d)
    type(dem_data_type), intent(out) :: d
    d%grains%n = 2
    d%grains%material = [1_i4, 2_i4]
    d%grains%mass = [2.0_wp, 3.0_wp]
    d%planes%n = 1
    d%planes%material = [1_i4]
    allocate (d%materials(2))
    d%pairs%blocks = 2
    allocate (d%pairs%first(lanes, 2), d%pairs%second(lanes, 2), source=3_i4)
    allocate (d%pairs%history(lanes, history_size, 2), source=0.0_wp)
    d%pairs%first(1, 1) = 1
    d%pairs%second(1, 1) = 2
    d%pairs%first(1, 2) = 6
    d%pairs%second(1, 2) = 1
    d%pairs%history(1, history_side, :) = side
    d%pairs%history(1, history_root, :) = radius/side
    d%pairs%grain = [1_i4, 2_i4, 0_i4, 0_i4, 0_i4, 0_i4]
    d%pairs%start = [1_i4, 3_i4, 4_i4, 4_i4, 4_i4, 4_i4, 5_i4]
    d%pairs%entry = [0_i4, 2*lanes + 1_i4, 1_i4, 2*lanes]
    call begin_heat(d, 300.0_wp)
    d%heat%conductivity = [2.0_wp, 6.0_wp]
    d%heat%capacity = [10.0_wp, 20.0_wp]
    d%heat%temperature(2) = 310.0_wp
  end subroutine make_grains

  !> The plane at 330 K.
  subroutine warm_plane(d)
    type(dem_data_type), intent(inout) :: d
    d%heat%boundaries = 1
    call append_string(d%heat%name, 'plane')
    d%heat%value = [330.0_wp]
    d%heat%given = [0.0_wp]
    d%heat%plane = [1_i4]
  end subroutine warm_plane

  subroutine check_flows()
    type(dem_data_type) :: d
    real(wp), parameter :: h = 0.5_wp
    real(wp) :: before
    call make_grains(d)
    before = heat_content(d)
    call conduct(d, h)
    call test%check_close('grain 1 warms', d%heat%temperature(1), &
                          300.0_wp + h*between*10.0_wp/20.0_wp, 1.0e-12_wp)
    call test%check_close('grain 2 cools', d%heat%temperature(2), &
                          310.0_wp - h*between*10.0_wp/60.0_wp, 1.0e-12_wp)
    call test%check_close('a plane without temperature takes none', heat_content(d), before, &
                          1.0e-10_wp)
    call make_grains(d)
    call warm_plane(d)
    call conduct(d, h)
    call test%check_close('a plane gives heat', d%heat%given(1), h*at_plane*30.0_wp, 1.0e-12_wp)
    call test%check_close('which the grains have', heat_content(d) - before, d%heat%given(1), &
                          1.0e-10_wp)
    call test%check_close('ratio of the step', d%heat%ratio, h*(between + at_plane)/20.0_wp, &
                          1.0e-14_wp)
  end subroutine check_flows

  subroutine check_limit()
    type(dem_data_type) :: d
    call make_grains(d)
    call test%check_close('limit of grain 1', heat_limit(d), 20.0_wp/between, 1.0e-12_wp)
    d%pairs%history = 0.0_wp
    call test%check('no limit without contacts', heat_limit(d) > 1.0e300_wp)
  end subroutine check_limit

  !> A grain that is held gives heat, and is not part of the content.
  subroutine check_held()
    type(dem_data_type) :: d
    call make_grains(d)
    call warm_plane(d)
    d%heat%plane = 0
    d%heat%held(2) = 1
    call conduct(d, 1.0_wp)
    call test%check_close('it keeps its temperature', d%heat%temperature(2), 310.0_wp, 0.0_wp)
    call test%check_close('it gives heat', d%heat%given(1), between*10.0_wp, 1.0e-12_wp)
    call test%check_close('to the other', heat_content(d) - 20.0_wp*300.0_wp, between*10.0_wp, &
                          1.0e-10_wp)
  end subroutine check_held
end program test_dem_heat
