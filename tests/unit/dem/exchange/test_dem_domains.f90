!> Domains of ranks: equal work, whose box a point is in, whose boxes are near it.
program test_dem_domains
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_domains, only: cut_domains, rank_at, ranks_near, distance_to_domain, place_of, &
    turn_to_cell
  use dem_halo_state, only: dem_halo_type
  use dem_state, only: dem_cell_type
  implicit none
  type(test_type) :: test
  integer(i4), parameter :: n = 20000, boxes = 12
  real(wp) :: x(3, n), work(n)

  call random_init(repeatable=.true., image_distinct=.false.)
  call check_shares()
  call check_places()
  call check_few()
  call check_images()
  call test%finish()

contains

  !> Twelve boxes of points that crowd at one end, half of which count three times.
  subroutine cut_crowd(halo)
    type(dem_halo_type), intent(out) :: halo
    call random_number(x)
    x(1, :) = x(1, :)**2
    work = 1.0_wp
    work(::2) = 3.0_wp
    halo%parts = [3, 2, 2]
    halo%cut = .true.  ! this many, whatever the ranks
    call cut_domains(halo, x, work)
  end subroutine cut_crowd

  subroutine check_shares()
    type(dem_halo_type) :: halo
    real(wp) :: share(0:boxes - 1)
    integer(i4) :: k, r

    call cut_crowd(halo)
    share = 0.0_wp
    do k = 1, n
      r = rank_at(halo, x(:, k))
      share(r) = share(r) + work(k)
    end do
    call test%check_close('work of all boxes', sum(share), sum(work), 0.0_wp)
    ! a bin of 2048 holds some 1e-3 of the work along an axis where the points crowd
    call test%check('every box has its share', all(abs(share*boxes/sum(work) - 1.0_wp) < 0.02_wp))
  end subroutine check_shares

  subroutine check_places()
    type(dem_halo_type) :: halo
    integer(i4) :: near(0:boxes - 1), count, k, r
    logical :: in_box, complete
    real(wp), parameter :: reach = 0.03_wp

    call cut_crowd(halo)
    in_box = .true.
    complete = .true.
    do k = 1, 500
      in_box = in_box .and. distance_to_domain(halo, rank_at(halo, x(:, k)), x(:, k)) <= 0.0_wp
      call ranks_near(halo, x(:, k), reach, near, count)
      do r = 0, boxes - 1
        complete = complete .and. &
          (any(near(:count - 1) == r) .eqv. distance_to_domain(halo, r, x(:, k)) <= reach)
      end do
    end do
    call test%check('points are in their boxes', in_box)
    call test%check('near boxes are those within reach', complete)
    call test%check('outer boxes have no end', rank_at(halo, [-9.0_wp, -9.0_wp, -9.0_wp]) == 0 &
                    .and. rank_at(halo, [9.0_wp, 9.0_wp, 9.0_wp]) == boxes - 1)
  end subroutine check_places

  !> More boxes than points, and no points at all: every place has a box still.
  subroutine check_few()
    type(dem_halo_type) :: halo
    integer(i4) :: a, b
    halo%parts = [3, 2, 2]
    halo%cut = .true.
    call cut_domains(halo, x(:, :2), work(:2))
    a = rank_at(halo, x(:, 1))
    b = rank_at(halo, x(:, 2))
    call test%check('two points in two of twelve boxes', a /= b .and. min(a, b) >= 0 &
                    .and. max(a, b) < boxes)
    call cut_domains(halo, x(:, :0), work(:0))
    a = rank_at(halo, x(:, 1))
    call test%check('boxes without points', a >= 0 .and. a < boxes)
  end subroutine check_few

  !> All images of a point in a sheared cell, open along z, have its place, between 0 and 1.
  subroutine check_images()
    type(dem_halo_type) :: halo
    type(dem_cell_type) :: cell
    real(wp) :: inside(3), place(3), image(3)
    integer(i4) :: i, j

    cell%active = .true.
    cell%periodic = [.true., .true., .false.]
    cell%origin = [0.3_wp, -0.2_wp, 0.1_wp]
    cell%vectors = reshape([2.0_wp, 0.0_wp, 0.0_wp, 0.6_wp, 1.5_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                            1.0_wp], [3, 3])
    call turn_to_cell(halo, cell)
    inside = [0.25_wp, 0.75_wp, 2.5_wp]  ! shares of the edges; along z beyond the faces
    place = cell%origin + matmul(cell%vectors, inside)
    do j = -2, 2
      do i = -2, 2
        image = place + i*cell%vectors(:, 1) + j*cell%vectors(:, 2)
        call test%check_all_close('place of an image', place_of(halo, image), inside, 1.0e-14_wp)
      end do
    end do
  end subroutine check_images
end program test_dem_domains
