!> Bodies at the borders of domains, exchanged in every step.
!!
!! One message is sent to and one received from each partner: records of the bodies, and in a last
!! column the travel of the sender's grains now and predicted for the next step. Pairs inside a
!! domain are evaluated meanwhile. Whether the list is used up is known one step ahead from the
!! predictions of all ranks: these travel with the bodies if all ranks are partners, else by a
!! non-blocking reduction.
module dem_swap
  use mpi, only: mpi_iallreduce, mpi_irecv, mpi_isend, mpi_waitall, mpi_max, &
    mpi_in_place, mpi_double_precision, mpi_request_null, mpi_statuses_ignore, mpi_f_sync_reg
  use talus_kinds, only: wp, i4
  use talus_system, only: wall_clock, set_environment
  use dem_halo_state, only: dem_halo_type
  use dem_record_layout, only: swap_ellipsoid, swap_frame
  use dem_images, only: place_image
  use dem_state, only: dem_data_type
  use dem_surface_motion, only: loads_of_bodies, loads_of_vertices
  use dem_surface_state, only: first_corner
  implicit none
  private
  public :: prefer_copies, agree_travel, begin_swap, end_swap, add_loads

  real(wp), parameter :: ahead = 2.0_wp  !! largest predicted travel over that of the last step

contains

  !> Before MPI starts: OpenMPI copies messages of some hundred bodies through shared memory, in a
  !! third of the time of its protocol for large ones, and the sender need not wait for the
  !! receiver. Settings of the user are kept.
  subroutine prefer_copies()
    call set_environment('OMPI_MCA_btl_vader_eager_limit', '65536', .false.)
    call set_environment('OMPI_MCA_btl_sm_eager_limit', '65536', .false.)  ! its name in OpenMPI 5
  end subroutine prefer_copies

  !> Find the largest travel of all ranks' grains, at once. All threads call it.
  subroutine agree_travel(d, travel)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: travel(:)  !! of each chunk [m]
    real(wp) :: begun, most(1)
    !$omp master
    begun = wall_clock()
    most = largest(travel)
    call d%halo%team%most(most)
    d%halo%most = most(1)
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
    !$omp end master
    !$omp barrier
  end subroutine agree_travel

  !> Send this rank's bodies, with its travel, and what that may be after the next step.
  subroutine begin_swap(d, travel)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: travel(:)  !! of each chunk [m]
    real(wp) :: begun, most
    begun = wall_clock()
    most = largest(travel)
    d%halo%asked = most
    if (most < huge(most)) d%halo%asked = most + ahead*max(most - d%halo%before, 0.0_wp)
    d%halo%travel = most
    d%halo%before = most
    call pack_bodies(d%pairs%body, d%halo)
    if (d%halo%shaped) call pack_frames(d%grains%shapes%record, d%halo)
    call post(d%halo, d%halo%sent, d%halo%came, d%halo%asked)
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
  end subroutine begin_swap

  !> Records of the mirrors as their ranks have them; largest travels of this rank and its partners,
  !! and of all ranks after the next step.
  subroutine end_swap(d)
    type(dem_data_type), intent(inout) :: d
    real(wp) :: begun
    integer(i4) :: p
    begun = wall_clock()
    call await_all(d%halo, d%halo%came, d%halo%asked)
    call unpack_bodies(d%halo, d%pairs%body)
    if (d%halo%shaped) call unpack_frames(d%halo, d%grains%shapes%record)
    if (d%pairs%images > 0) call follow_mirrors(d)
    d%halo%foreseen = d%halo%asked(1)
    do p = 1, d%halo%partners
      associate (told => d%halo%came(:2, d%halo%first_in(p + 1) + p - 1))
        d%halo%travel = max(d%halo%travel, told(1))
        if (d%halo%all_near) d%halo%foreseen = max(d%halo%foreseen, told(2))
      end associate
    end do
    d%halo%swaps = d%halo%swaps + 1
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
  end subroutine end_swap

  !> The largest travel; huge if one is no number.
  pure real(wp) function largest(travel)
    real(wp), intent(in) :: travel(:)
    largest = huge(1.0_wp)
    if (all(travel <= huge(1.0_wp))) largest = maxval(travel)
  end function largest

  !> What the grains of all ranks do to free bodies and membranes, added in the order of the ranks:
  !! all ranks have the same bits. Called by all threads.
  subroutine add_loads(d)
    type(dem_data_type), intent(inout) :: d
    real(wp), allocatable :: bodies(:, :), corners(:, :), loads(:)
    real(wp) :: begun
    integer(i4) :: n
    if (.not. (allocated(d%surfaces%rigid%acting) .or. allocated(d%surfaces%mesh%acting))) return
    !$omp master
    begun = wall_clock()
    associate (s => d%surfaces)
      n = 0
      allocate (loads(0))
      if (allocated(s%rigid%acting)) then
        bodies = loads_of_bodies(s)
        n = size(bodies)
        loads = reshape(bodies, [n])
      end if
      if (allocated(s%mesh%acting)) then
        corners = loads_of_vertices(s)
        loads = [loads, corners(:, first_corner(s):)]
      end if
      call d%halo%team%add_in_order(loads)
      if (allocated(s%rigid%acting)) s%rigid%acting = reshape(loads(:n), [6, s%n])
      if (allocated(s%mesh%acting)) &
        s%mesh%acting(:, first_corner(s):) = reshape(loads(n + 1:), [3, size(loads(n + 1:))/3])
    end associate
    d%halo%seconds = d%halo%seconds + (wall_clock() - begun)
    !$omp end master
    !$omp barrier
  end subroutine add_loads

  !> Columns of a message: the bodies of a partner, and one for the travels.
  pure subroutine pack_bodies(body, halo)
    real(wp), intent(in), contiguous :: body(:, :)  !! records, see dem_state
    type(dem_halo_type), intent(inout) :: halo
    integer(i4) :: p, k, c, many
    many = merge(swap_ellipsoid(2), halo%width, halo%shaped)
    do p = 1, halo%partners
      do k = halo%first_out(p), halo%first_out(p + 1) - 1
        do c = 1, many
          halo%sent(c, k + p - 1) = body(c, halo%out(k))
        end do
      end do
      halo%sent(:2, halo%first_out(p + 1) + p - 1) = [halo%travel, halo%asked(1)]
    end do
  end subroutine pack_bodies

  pure subroutine unpack_bodies(halo, body)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(inout), contiguous :: body(:, :)
    integer(i4) :: p, k, c, many
    many = merge(swap_ellipsoid(2), halo%width, halo%shaped)
    do p = 1, halo%partners
      do k = halo%first_in(p), halo%first_in(p + 1) - 1
        do c = 1, many
          body(c, halo%in(k)) = halo%came(c, k + p - 1)
        end do
      end do
    end do
  end subroutine unpack_bodies

  !> Orientations of grains that are no ellipsoids.
  pure subroutine pack_frames(record, halo)
    real(wp), intent(in), contiguous :: record(:, :)  !! see dem_shape
    type(dem_halo_type), intent(inout) :: halo
    integer(i4) :: p, k
    do p = 1, halo%partners
      do k = halo%first_out(p), halo%first_out(p + 1) - 1
        halo%sent(swap_frame(1):swap_frame(2), k + p - 1) = record(1:4, halo%out(k))
      end do
    end do
  end subroutine pack_frames

  pure subroutine unpack_frames(halo, record)
    type(dem_halo_type), intent(in) :: halo
    real(wp), intent(inout), contiguous :: record(:, :)
    integer(i4) :: p, k
    do p = 1, halo%partners
      do k = halo%first_in(p), halo%first_in(p + 1) - 1
        record(1:4, halo%in(k)) = halo%came(swap_frame(1):swap_frame(2), k + p - 1)
      end do
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

  !> One message to and from each partner, and the reduction where some are none: under way.
  subroutine post(halo, sent, came, asked)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(in), contiguous, asynchronous :: sent(:, :)
    real(wp), intent(inout), contiguous, asynchronous :: came(:, :), asked(:)
    integer, parameter :: tag = 1
    integer :: status
    integer(i4) :: p, n

    n = halo%partners
    do p = 1, n
      call mpi_irecv(came(1, halo%first_in(p) + p - 1), &
                     halo%width*(halo%first_in(p + 1) - halo%first_in(p) + 1), &
                     mpi_double_precision, halo%partner(p), tag, halo%team%comm, &
                     halo%request(p), status)
    end do
    do p = 1, n
      call mpi_isend(sent(1, halo%first_out(p) + p - 1), &
                     halo%width*(halo%first_out(p + 1) - halo%first_out(p) + 1), &
                     mpi_double_precision, halo%partner(p), tag, halo%team%comm, &
                     halo%request(n + p), status)
    end do
    halo%request(2*n + 1) = mpi_request_null
    if (halo%all_near) return
    call mpi_iallreduce(mpi_in_place, asked, 1, mpi_double_precision, mpi_max, halo%team%comm, &
                        halo%request(2*n + 1), status)
  end subroutine post

  !> Wait for all that was posted.
  subroutine await_all(halo, came, asked)
    type(dem_halo_type), intent(inout) :: halo
    real(wp), intent(inout), contiguous, asynchronous :: came(:, :), asked(:)
    integer :: status
    call mpi_waitall(size(halo%request), halo%request, mpi_statuses_ignore, status)
    call mpi_f_sync_reg(came)
    call mpi_f_sync_reg(asked)
  end subroutine await_all
end module dem_swap
