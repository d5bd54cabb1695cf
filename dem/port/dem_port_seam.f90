!> WAKE of grains of several tiles: where those of one meet those of another a minimum cut says who
!! wakes, and these make room for each other (theory-dem, Conversion). Fault P266.
module dem_port_seam
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_guest, field_moved, field_overlap, field_unbalanced, field_woken
  use talus_text, only: str
  use dem_bed, only: dem_bed_type, waking_type
  use dem_model, only: dem_model_type
  use dem_mosaic, only: lying_type, choose_mosaic, depth_of, square_of
  use dem_packing, only: dem_packing_type
  use dem_seam_growth, only: growth_type
  implicit none
  private
  public :: fit_in, band_of

  !> In mean diameters: half the band, how far beyond the grains in it others grow with them, and
  !! how far around these sleeping ones hold them.
  real(wp), parameter :: half_band = 1.5_wp, beyond = 1.0_wp, around = 1.6_wp
  real(wp), parameter :: touching = 0.05_wp  !! depth that a grain beside a seam may have [-]
  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i4), parameter :: from_other = 2   !! guest: of another tile than that of its place

contains

  !> How far beyond the border of two tiles grains of either may wake [m].
  pure real(wp) function band_of(bed) result(band)
    type(dem_bed_type), intent(in) :: bed
    band = half_band*diameter_of(bed)
  end function band_of

  !> Diameter of the sphere of the mean volume, of the first tile [m].
  pure real(wp) function diameter_of(bed) result(d)
    type(dem_bed_type), intent(in) :: bed
    associate (rows => bed%tile(1)%rows)
      d = 2.0_wp*(sum(product(rows%axes, 1))/rows%n)**(1.0_wp/3.0_wp)
    end associate
  end function diameter_of

  !> The batch and how it wakes, without those that do not fit.
  subroutine fit_in(model, request, reply, material, batch, waking, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    integer(i4), intent(in) :: material
    type(dem_packing_type), intent(inout) :: batch
    type(waking_type), intent(inout) :: waking
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: guest(:)
    logical, allocatable :: stay(:), moving(:)
    type(lying_type) :: lying
    type(growth_type) :: growth
    real(wp) :: overlap

    call request%take_int(field_guest, guest, errors)
    if (errors%any()) return
    if (.not. model%bed%active .or. size(guest) /= batch%n .or. &
        any(guest < 0 .or. guest > from_other)) then
      call errors%add('P266', 'WAKE has '//str(size(guest))//' marks of guests for '// &
        str(batch%n)//' grains', request%place(), &
        '0, 1 or 2 for each, of grains of a deck with tiles')
      return
    end if
    call model%timers%start('conversions')
    call lie_down(model, batch, guest, lying)
    call choose_mosaic(lying, stay, overlap)
    call reply%put_int(field_woken, merge(1_i4, 0_i4, stay(:batch%n)))
    call reply%put(field_overlap, overlap)
    call leave_out(lying, stay)
    call find_moving(model%bed, lying, count(stay(:batch%n), kind=i4), guest, stay, moving)
    if (any(moving)) then
      call add_support(model%bed, batch%id, lying, moving)
      growth%material = material
      associate (constant => model%bed%tile(1)%constant)
        growth%friction = constant(5)
        growth%pressure = constant(6)
        growth%solid = constant(7)
      end associate
      call growth%grow(lying, moving, model%system, errors)
    end if
    call model%timers%stop('conversions')
    if (errors%any()) return
    call reply%put(field_moved, growth%moved)
    call reply%put(field_unbalanced, growth%unbalanced)
    call keep(batch, waking, lying, stay(:batch%n))
  end subroutine fit_in

  !> Those that may wake, then those that are awake, as they lie.
  pure subroutine lie_down(model, batch, guest, lying)
    type(dem_model_type), intent(in) :: model
    type(dem_packing_type), intent(in) :: batch
    integer(i4), intent(in) :: guest(:)
    type(lying_type), intent(inout) :: lying
    integer(i4) :: k
    associate (g => model%system%grains)
      lying%n = batch%n + g%n
      lying%id = [batch%id, int(g%id(:g%n), i8)]
      lying%x = reshape([batch%x(:, :batch%n), g%x(:, :g%n)], [3, lying%n])
      lying%quat = reshape([batch%quat(:, :batch%n), g%quat(:, :g%n)], [4, lying%n])
      lying%axes = reshape([batch%axes(:, :batch%n), g%axes(:, :g%n)], [3, lying%n])
      lying%fixed = [guest == 0, spread(.true., 1, g%n)]
      lying%home = [guest < from_other, spread(.false., 1, g%n)]
    end associate
    allocate (lying%tile(lying%n), source=1_i4)
    do k = 1, lying%n
      if (lying%id(k) <= model%bed%grains()) lying%tile(k) = model%bed%tile_of(lying%id(k))
    end do
  end subroutine lie_down

  !> Only those that stay.
  pure subroutine leave_out(lying, stay)
    type(lying_type), intent(inout) :: lying
    logical, intent(in) :: stay(:)
    integer(i4) :: k
    associate (rows => pack([(k, k=1, lying%n)], stay))
      lying%id = lying%id(rows)
      lying%tile = lying%tile(rows)
      lying%fixed = lying%fixed(rows)
      lying%home = lying%home(rows)
      lying%x = lying%x(:, rows)
      lying%quat = lying%quat(:, rows)
      lying%axes = lying%axes(:, rows)
      lying%n = size(rows)
    end associate
  end subroutine leave_out

  !> Of the first n, which wake: those in the band of a seam and others near them.
  pure subroutine find_moving(bed, lying, n, guest, stay, moving)
    type(dem_bed_type), intent(in) :: bed
    type(lying_type), intent(in) :: lying
    integer(i4), intent(in) :: n, guest(:)  !! of all that may wake
    logical, intent(in) :: stay(:)          !! (all that may wake, and others)
    logical, allocatable, intent(out) :: moving(:)
    logical :: near(n)
    integer(i4) :: k
    real(wp) :: reach
    near = pack(guest > 0, stay(:size(guest)))
    reach = beyond*diameter_of(bed)
    allocate (moving(lying%n), source=.false.)
    do k = 1, n
      moving(k) = near(k)
      if (.not. moving(k)) &
        moving(k) = any(near .and. sum((lying%x(:, :n) - spread(lying%x(:, k), 2, n))**2, 1) &
                        < reach**2)
    end do
  end subroutine find_moving

  !> Grains that still sleep around those that move hold these, but for such that lie in what
  !! another tile fills.
  pure subroutine add_support(bed, given, lying, moving)
    type(dem_bed_type), intent(in) :: bed
    integer(i8), intent(in) :: given(:)  !! ids of all that might have woken
    type(lying_type), intent(inout) :: lying
    logical, allocatable, intent(inout) :: moving(:)
    integer(i8), allocatable :: others(:)
    type(lying_type) :: more
    integer(i4) :: k, j, n
    n = lying%n
    more = lying
    do k = 1, n
      if (.not. moving(k)) cycle
      others = bed%near(lying%id(k), around*diameter_of(bed))
      do j = 1, size(others)
        if (any(given == others(j)) .or. any(more%id == others(j))) cycle
        call try_support(bed, lying, k, others(j), more)
      end do
    end do
    lying = more
    moving = [moving, spread(.false., 1, lying%n - n)]
  end subroutine add_support

  !> One such grain beside grain k: where it sleeps, moved as that one is.
  pure subroutine try_support(bed, lying, k, id, more)
    type(dem_bed_type), intent(in) :: bed
    type(lying_type), intent(in) :: lying
    integer(i4), intent(in) :: k
    integer(i8), intent(in) :: id
    type(lying_type), intent(inout) :: more
    real(wp) :: x(3), shape(3, 3)
    integer(i4) :: r, i
    associate (tile => bed%tile(bed%tile_of(id)))
      r = 1 + int(mod(id - tile%before - 1, int(tile%rows%n, i8)), i4)
      x = bed%place_of(id) + lying%x(:, k) - bed%place_of(lying%id(k))
      shape = square_of(tile%rows%axes(:, r), tile%rows%quat(:, r))
      do i = 1, lying%n
        if (lying%tile(i) == lying%tile(k)) cycle
        if (norm2(lying%x(:, i) - x) >= maxval(lying%axes(:, i)) &
            + maxval(tile%rows%axes(:, r))) cycle
        if (depth_of(lying%x(:, i) - x, shape, square_of(lying%axes(:, i), lying%quat(:, i))) &
            > touching) return
      end do
      more%n = more%n + 1
      more%id = [more%id, id]
      more%tile = [more%tile, lying%tile(k)]
      more%fixed = [more%fixed, .true.]
      more%home = [more%home, .true.]
      more%x = reshape([more%x, x], [3, more%n])
      more%quat = reshape([more%quat, tile%rows%quat(:, r)], [4, more%n])
      more%axes = reshape([more%axes, tile%rows%axes(:, r)], [3, more%n])
    end associate
  end subroutine try_support

  !> The batch of those that wake, where they lie now.
  pure subroutine keep(batch, waking, lying, stay)
    type(dem_packing_type), intent(inout) :: batch
    type(waking_type), intent(inout) :: waking
    type(lying_type), intent(in) :: lying
    logical, intent(in) :: stay(:)
    integer(i4) :: k
    associate (rows => pack([(k, k=1, size(stay))], stay))
      batch%n = size(rows)
      batch%id = batch%id(rows)
      batch%kind = batch%kind(rows)
      batch%axes = lying%axes(:, :size(rows))
      batch%skew = batch%skew(:, rows)
      batch%exponent = batch%exponent(rows)
      batch%v = batch%v(:, rows)
      batch%omega = batch%omega(:, rows)
      batch%x = lying%x(:, :batch%n)
      batch%quat = lying%quat(:, :batch%n)
      waking%history = waking%history(rows)
      waking%turn = waking%turn(:, rows)
    end associate
  end subroutine keep
end module dem_port_seam
