!> Bodies at the borders of domains, exchanged in every step.
module dem_swap
  use mpi, only: mpi_allgather, mpi_irecv, mpi_isend, mpi_waitall, mpi_double_precision, &
    mpi_statuses_ignore
  use talus_kinds, only: wp, i4
  use talus_system, only: wall_clock
  use dem_halo_state, only: dem_halo_type
  use dem_images, only: place_image
  use dem_state, only: dem_data_type
  use dem_surface_motion, only: loads_of_bodies
  implicit none
  private
  public :: swap_bodies, add_loads

contains

  !> Records of the mirrors as their ranks have them; travel becomes the largest of all ranks. All
  !! threads call it.
  subroutine swap_bodies(d, travel)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(inout) :: travel(:)  !! of each chunk [m]
    real(wp) :: begun, most(1)

    !$omp master
    begun = wall_clock()
    call pack_bodies(d%pairs%body, d%halo)
    if (d%halo%formed) call pack_frames(d%grains%forms%record, d%halo)
    call exchange(d%halo, d%halo%sent, d%halo%came)
    call unpack_bodies(d%halo, d%pairs%body)
    if (d%halo%formed) call unpack_frames(d%halo, d%grains%forms%record)
    if (d%pairs%images > 0) call follow_mirrors(d)
    most = huge(1.0_wp)
    if (all(travel <= huge(1.0_wp))) most = maxval(travel)
    call d%halo%team%most(most)
    travel = most(1)
    d%halo%swaps = d%halo%swaps + 1
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
    !$omp end master
    !$omp barrier
  end subroutine swap_bodies

  !> What the grains of all ranks do to free bodies, added in the order of the ranks: all ranks have
  !! the same bits. Called by all threads.
  subroutine add_loads(d)
    type(dem_data_type), intent(inout) :: d
    real(wp), allocatable :: mine(:, :), all_ranks(:, :, :)
    real(wp) :: begun
    integer :: status
    integer(i4) :: r
    if (.not. allocated(d%surfaces%acting)) return
    !$omp master
    begun = wall_clock()
    mine = loads_of_bodies(d%surfaces)
    allocate (all_ranks(6, d%surfaces%n, d%halo%team%ranks))
    call mpi_allgather(mine, size(mine), mpi_double_precision, all_ranks, size(mine), &
                       mpi_double_precision, d%halo%team%comm, status)
    d%surfaces%acting = 0.0_wp
    do r = 1, d%halo%team%ranks
      d%surfaces%acting = d%surfaces%acting + all_ranks(:, :, r)
    end do
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
    !$omp end master
    !$omp barrier
  end subroutine add_loads

  pure subroutine pack_bodies(body, halo)
    real(wp), intent(in), contiguous :: body(:, :)  !! records, see dem_state
    type(dem_halo_type), intent(inout) :: halo
    integer(i4) :: k, c
    do k = 1, size(halo%out)
      do c = 1, merge(15_i4, halo%width, halo%formed)
        halo%sent(c, k) = body(c, halo%out(k))
      end do
    end do
  end subroutine pack_bodies

  pure subroutine unpack_bodies(halo, body)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(inout), contiguous :: body(:, :)
    integer(i4) :: k, c
    do k = 1, size(halo%in)
      do c = 1, merge(15_i4, halo%width, halo%formed)
        body(c, halo%in(k)) = halo%came(c, k)
      end do
    end do
  end subroutine unpack_bodies

  !> Orientations of grains that are no ellipsoids.
  pure subroutine pack_frames(record, halo)
    real(wp), intent(in), contiguous :: record(:, :)  !! see dem_form
    type(dem_halo_type), intent(inout) :: halo
    integer(i4) :: k
    do k = 1, size(halo%out)
      halo%sent(16:19, k) = record(1:4, halo%out(k))
    end do
  end subroutine pack_frames

  pure subroutine unpack_frames(halo, record)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(inout), contiguous :: record(:, :)
    integer(i4) :: k
    do k = 1, size(halo%in)
      record(1:4, halo%in(k)) = halo%came(16:19, k)
    end do
  end subroutine unpack_frames

  !> Images of mirrors over the faces of a cell.
  pure subroutine follow_mirrors(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: k, m
    do k = 1, size(d%halo%in)
      do m = d%pairs%image_start(d%halo%in(k)), d%pairs%image_start(d%halo%in(k) + 1) - 1
        call place_image(d%pairs, d%cell, m)
      end do
    end do
  end subroutine follow_mirrors

  !> One message to and from each partner.
  subroutine exchange(halo, sent, came)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(in), contiguous, asynchronous :: sent(:, :)
    real(wp), intent(inout), contiguous, asynchronous :: came(:, :)
    integer, parameter :: tag = 1
    integer :: request(2*halo%partners), status
    integer(i4) :: p

    do p = 1, halo%partners
      call mpi_irecv(came(1, halo%first_in(p)), &
                     halo%width*(halo%first_in(p + 1) - halo%first_in(p)), mpi_double_precision, &
                     halo%partner(p), tag, halo%team%comm, request(p), status)
    end do
    do p = 1, halo%partners
      call mpi_isend(sent(1, halo%first_out(p)), &
                     halo%width*(halo%first_out(p + 1) - halo%first_out(p)), &
                     mpi_double_precision, halo%partner(p), tag, halo%team%comm, &
                     request(halo%partners + p), status)
    end do
    call mpi_waitall(2*halo%partners, request, mpi_statuses_ignore, status)
  end subroutine exchange
end module dem_swap
