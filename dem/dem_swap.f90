!> Bodies at the borders of domains, exchanged in every step.
module dem_swap
  use mpi, only: mpi_irecv, mpi_isend, mpi_waitall, mpi_double_precision, mpi_statuses_ignore
  use talus_kinds, only: wp, i4
  use talus_system, only: wall_clock
  use dem_halo_state, only: dem_halo_type
  implicit none
  private
  public :: swap_bodies

contains

  !> Records of the mirrors as their ranks have them; travel becomes the largest of all ranks.
  subroutine swap_bodies(body, halo, travel)
    real(wp), intent(inout), contiguous :: body(:, :)  !! records, see dem_state
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(inout) :: travel(:)               !! of each chunk [m]
    real(wp) :: begun, most(1)
    integer(i4) :: k, c

    begun = wall_clock()
    do k = 1, size(halo%out)
      do c = 1, halo%width
        halo%sent(c, k) = body(c, halo%out(k))
      end do
    end do
    call exchange(halo, halo%sent, halo%came)
    do k = 1, size(halo%in)
      do c = 1, halo%width
        body(c, halo%in(k)) = halo%came(c, k)
      end do
    end do
    most = huge(1.0_wp)
    if (all(travel <= huge(1.0_wp))) most = maxval(travel)
    call halo%team%most(most)
    travel = most(1)
    halo%swaps = halo%swaps + 1
    halo%seconds = halo%seconds + (wall_clock() - begun)
  end subroutine swap_bodies

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
