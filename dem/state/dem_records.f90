!> Grains and contacts as rows of reals, to be sent to other ranks.
module dem_records
  use talus_kinds, only: wp, i4, i8
  use dem_shape, only: form_size
  use dem_state, only: dem_data_type, lanes, history_size, history_root, result_size, body_size
  implicit none
  private
  public :: part_size, contact_places, body_places, grain_reals, contact_reals
  public :: pack_grain, unpack_grain, pack_contact, carried, index_of

  integer(i4), parameter :: grain_size = 50 + body_size   !! reals of an ellipsoid
  integer(i4), parameter :: part_size = 13                !! of these the first that add up over
                                                          !! the ranks, see pack_grain
  integer(i4), parameter :: body_places(2) = [50, 49 + body_size]  !! of the body's record
  integer(i4), parameter :: form_reals = 14 + form_size   !! more for a form
  integer(i4), parameter :: contact_size = 8 + history_size + result_size  !! without laws on top
  integer(i4), parameter :: contact_places(5) = [3, 6, 6 + history_size, contact_size - 2, &
                                                 contact_size + 1]
                            !! where normal, history, result, shift and laws on top begin

contains

  !> Reals of a grain of this run.
  pure integer(i4) function grain_reals(formed)
    logical, intent(in) :: formed  !! some grain is no ellipsoid
    grain_reals = grain_size + merge(form_reals, 0_i4, formed)
  end function grain_reals

  !> Reals of a contact of this run.
  pure integer(i4) function contact_reals(d)
    type(dem_data_type), intent(in) :: d
    contact_reals = contact_size + d%pairs%extras%reals
  end function contact_reals

  !> All of a grain that moves with it. Force, moment, their impulses and the work come first: of a
  !! prescribed grain each rank has a part of them.
  pure subroutine pack_grain(d, i, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(out) :: row(:)
    associate (g => d%grains)
      row(:13) = 0.0_wp
      row(1:6) = [g%force(:, i), g%moment(:, i)]
      row(46:49) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      if (size(g%work) > 0) then
        row(7:13) = [g%impulse(:, i), g%moment_impulse(:, i), g%work(i)]
        row(46:49) = g%turn(:, i)
      end if
      row(14:16) = [real(g%id(i), wp), real(g%kind(i), wp), real(g%material(i), wp)]
      row(17:29) = [g%x(:, i), g%quat(:, i), g%v(:, i), g%omega(:, i)]
      row(30:36) = [g%axes(:, i), g%mass(i), g%inertia(:, i)]
      row(37:45) = [g%theta(:, i), g%extra_force(:, i), g%extra_moment(:, i)]
      row(50:49 + body_size) = d%pairs%body(:, i)
      row(grain_size) = 0.0_wp
      if (allocated(d%seen_kinetic)) row(grain_size) = d%seen_kinetic(i)
      if (size(row) == grain_size) return
      row(grain_size + 1:) = [real(g%forms%kind(i), wp), g%forms%frame(:, i), g%forms%skew(:, i), &
                              g%forms%exponent(i), g%forms%axes(:, i), g%forms%reach(i), &
                              g%radius(i), g%forms%record(:, i)]
    end associate
  end subroutine pack_grain

  !> The same back, but for the body's record.
  pure subroutine unpack_grain(row, d, i)
    real(wp), intent(in) :: row(:)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    associate (g => d%grains)
      g%force(:, i) = row(1:3)
      g%moment(:, i) = row(4:6)
      if (size(g%work) > 0) then
        g%impulse(:, i) = row(7:9)
        g%moment_impulse(:, i) = row(10:12)
        g%work(i) = row(13)
        g%turn(:, i) = row(46:49)
      end if
      g%id(i) = nint(row(14), i8)
      g%kind(i) = nint(row(15), i4)
      g%material(i) = nint(row(16), i4)
      g%x(:, i) = row(17:19)
      g%quat(:, i) = row(20:23)
      g%v(:, i) = row(24:26)
      g%omega(:, i) = row(27:29)
      g%axes(:, i) = row(30:32)
      g%radius(i) = maxval(row(30:32))
      g%mass(i) = row(33)
      g%inertia(:, i) = row(34:36)
      g%theta(:, i) = row(37:39)
      g%extra_force(:, i) = row(40:42)
      g%extra_moment(:, i) = row(43:45)
      if (allocated(d%seen_kinetic)) d%seen_kinetic(i) = row(grain_size)
      if (size(row) == grain_size) return
      associate (form => row(grain_size + 1:))
        g%forms%kind(i) = nint(form(1), i4)
        g%forms%frame(:, i) = form(2:5)
        g%forms%skew(:, i) = form(6:8)
        g%forms%exponent(i) = form(9)
        g%forms%axes(:, i) = form(10:12)
        g%forms%reach(i) = form(13)
        g%radius(i) = form(14)
        g%forms%record(:, i) = form(15:)
      end associate
    end associate
  end subroutine unpack_grain

  !> Does this candidate remember anything? The radius of two spheres is found anew.
  pure logical function carried(d, lane, block)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, block
    associate (h => d%pairs%history(lane, :, block))
      carried = any(abs(h(:history_root - 1)) > 0.0_wp) .or. any(abs(h(history_root + 1:)) > 0.0_wp)
    end associate
    if (carried .or. .not. d%pairs%extras%active) return
    carried = any(abs(d%pairs%extras%kept(lane, :, block)) > 0.0_wp)
  end function carried

  !> A contact: ids, lower one first, planes as -1, -2, ...; normal, history, force and moment, the
  !! shift of the second in edges of the cell, what laws on top keep.
  pure subroutine pack_contact(d, lane, block, row)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, block
    real(wp), intent(out) :: row(:)
    integer(i4) :: first, second
    first = d%pairs%first(lane, block)
    second = d%pairs%second(lane, block)
    if (first > d%grains%n) then
      row(1) = -real(first - d%grains%n - 3, wp)
    else
      row(1) = real(d%grains%id(first), wp)
    end if
    row(2) = real(d%grains%id(d%pairs%grain(second)), wp)
    row(3:5) = d%pairs%normal(lane, :, block)
    row(6:5 + history_size) = d%pairs%history(lane, :, block)
    row(contact_places(3):contact_places(4) - 1) = d%pairs%result(:, (block - 1)*lanes + lane)
    row(contact_places(4):contact_places(5) - 1) = 0.0_wp
    if (second > d%pairs%plain) row(contact_places(4):contact_places(5) - 1) = &
      d%pairs%shift(:, second - d%pairs%plain)
    if (d%pairs%extras%active) row(contact_places(5):) = d%pairs%extras%kept(lane, :, block)
  end subroutine pack_contact

  !> Body of an id, planes as -1, -2, ...; 0 if it is not known here.
  pure integer(i4) function index_of(d, id) result(body)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: id
    integer(i8) :: wanted
    integer(i4) :: low, high
    wanted = nint(id, i8)
    if (wanted < 0) then
      body = d%grains%n + 3 - int(wanted, i4)
      return
    end if
    low = 1
    high = d%grains%n
    do while (low <= high)
      body = (low + high)/2
      if (d%grains%id(body) == wanted) return
      if (d%grains%id(body) < wanted) then
        low = body + 1
      else
        high = body - 1
      end if
    end do
    body = 0
  end function index_of
end module dem_records
