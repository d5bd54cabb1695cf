!> The exchange of bodies, of a rank that is its own neighbour: what is sent arrives in its place,
!! and travel is foreseen a step ahead.
program test_dem_swap
  use talus_kinds, only: wp, i4
  use talus_ranks, only: start_mpi, leave_ranks
  use talus_test, only: test_type
  use dem_state, only: dem_data_type, body_size
  use dem_swap, only: begin_swap, end_swap
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: moving = 9  !! reals of a sphere's record that change
  real(wp), parameter :: tiny_step = 1.0e-12_wp  !! round-off of sums of some metres

  call start_mpi()
  call check_bodies(.true.)
  call check_bodies(.false.)
  call check_travels(.true.)
  call check_travels(.false.)
  call leave_ranks()
  call test%finish()

contains

  !> Bodies 2 and 3 are sent, and become bodies 5 and 4.
  function lone_rank(all_near) result(d)
    logical, intent(in) :: all_near
    type(dem_data_type) :: d
    integer(i4) :: k
    allocate (d%pairs%body(body_size, 5))
    do k = 1, 5
      d%pairs%body(:, k) = real(k, wp)
    end do
    d%halo%width = moving
    d%halo%partners = 1
    d%halo%all_near = all_near
    d%halo%partner = [0_i4]
    d%halo%first_out = [1_i4, 3_i4]
    d%halo%first_in = [1_i4, 3_i4]
    d%halo%out = [2_i4, 3_i4]
    d%halo%in = [5_i4, 4_i4]
    allocate (d%halo%sent(moving, 3), d%halo%came(moving, 3), source=0.0_wp)
    allocate (d%halo%request(3), source=0)
  end function lone_rank

  !> With a reduction under way too where some ranks are no neighbours.
  subroutine check_bodies(all_near)
    logical, intent(in) :: all_near
    type(dem_data_type) :: d
    d = lone_rank(all_near)
    call begin_swap(d, [0.0_wp])
    d%pairs%body(:moving, 2) = -1.0_wp  ! it moves on: what was sent stays
    call end_swap(d)
    call test%check_close('second', d%pairs%body(1, 5), 2.0_wp, 0.0_wp)
    call test%check_close('last real of it', d%pairs%body(moving, 5), 2.0_wp, 0.0_wp)
    call test%check_close('what does not change', d%pairs%body(moving + 1, 5), 5.0_wp, 0.0_wp)
    call test%check_close('third', d%pairs%body(1, 4), 3.0_wp, 0.0_wp)
    call test%check_close('not sent', d%pairs%body(1, 1), 1.0_wp, 0.0_wp)
    call test%check('counted', d%halo%swaps == 1)
  end subroutine check_bodies

  !> The largest travel of all chunks, and twice its last growth more.
  subroutine check_travels(all_near)
    logical, intent(in) :: all_near
    type(dem_data_type) :: d
    d = lone_rank(all_near)
    call begin_swap(d, [0.5_wp, 1.0_wp, 0.2_wp])
    call end_swap(d)
    call test%check_close('travel', d%halo%travel, 1.0_wp, 0.0_wp)
    call begin_swap(d, [1.1_wp, 0.2_wp])
    call end_swap(d)
    call test%check_close('foreseen', d%halo%foreseen, 1.3_wp, tiny_step)
    call begin_swap(d, [0.9_wp])
    call end_swap(d)
    call test%check_close('on the way back', d%halo%foreseen, 0.9_wp, 0.0_wp)
    call begin_swap(d, [0.9_wp, huge(1.0_wp)])
    call end_swap(d)
    call test%check('a lost grain ends the list', .not. d%halo%foreseen < huge(1.0_wp))
  end subroutine check_travels
end program test_dem_swap
