!> Records of random grains and contacts, packed and unpacked, by themselves and through the slabs
!! of a lone rank: every value is restored bit for bit, and every column was written.
program test_dem_slabs
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_is_nan
  use talus_kinds, only: wp, i4, i8
  use talus_ranks, only: start_mpi, leave_ranks
  use talus_test, only: test_type
  use dem_make, only: allocate_grains, make_planes
  use dem_records, only: grain_reals, contact_reals, pack_grain, unpack_grain, pack_contact, &
    unpack_contact, unpack_result, shift_of
  use dem_shape_state, only: allocate_shapes
  use dem_slabs, only: dem_slab_type, slab_of_grains, slab_of_records
  use dem_state, only: dem_data_type, dem_grains_type, lanes, history_size, result_size, &
    body_size, kind_free, kind_driven
  use dem_surface_records, only: pack_touch, unpack_touch
  use dem_surface_contacts, only: allocate_contacts
  implicit none
  integer(i4), parameter :: n = 5  !! grains
  type(test_type) :: test

  call start_mpi()
  call check_grains(.false.)
  call check_grains(.true.)
  call check_contacts()
  call check_touches(0_i4)
  call check_touches(4_i4)
  call check_slab()
  call leave_ranks()
  call test%finish()

contains

  !> Room for random grains, the first a driven one.
  subroutine make_room(d, shaped)
    type(dem_data_type), intent(out) :: d
    logical, intent(in) :: shaped
    real(wp) :: none(3, 0)
    integer(i4) :: material(0), i
    d%grains%n = n
    call allocate_grains(d%grains, .true.)
    if (shaped) call allocate_shapes(d%grains%shapes, n)
    d%halo%shaped = shaped
    d%grains%id = [(10_i8*i, i=1, n)]
    d%grains%kind = kind_free
    d%grains%kind(1) = kind_driven
    d%grains%material = 1
    call make_planes(d%planes, none, none, none, material)
    allocate (d%pairs%body(body_size, n + 3), d%seen_kinetic(n), source=0.0_wp)
  end subroutine make_room

  !> Room with a random number in every real that travels.
  subroutine make_random(d, shaped)
    type(dem_data_type), intent(out) :: d
    logical, intent(in) :: shaped
    integer(i4) :: i
    call make_room(d, shaped)
    associate (g => d%grains, shapes => d%grains%shapes)
      call random_number(g%x)
      call random_number(g%quat)
      call random_number(g%v)
      call random_number(g%omega)
      call random_number(g%axes)
      call random_number(g%mass)
      call random_number(g%inertia)
      call random_number(g%force)
      call random_number(g%moment)
      call random_number(g%theta)
      call random_number(g%extra_force)
      call random_number(g%extra_moment)
      call random_number(g%impulse)
      call random_number(g%moment_impulse)
      call random_number(g%work)
      call random_number(g%turn)
      do i = 1, n
        g%material(i) = 10 + i
        g%radius(i) = maxval(g%axes(:, i))
      end do
      if (shaped) then
        shapes%kind(:n) = [(i, i=1, n)]
        call random_number(g%radius)
        call random_number(shapes%record)
        call random_number(shapes%frame)
        call random_number(shapes%skew)
        call random_number(shapes%exponent)
        call random_number(shapes%axes)
        call random_number(shapes%reach)
      end if
    end associate
    call random_number(d%pairs%body)
    call random_number(d%seen_kinetic)
  end subroutine make_random

  !> Into a row and back into an empty system.
  subroutine check_grains(shaped)
    logical, intent(in) :: shaped
    type(dem_data_type) :: d, copy
    real(wp) :: row(grain_reals(shaped))
    integer(i4) :: i
    call make_random(d, shaped)
    call make_room(copy, shaped)
    do i = 1, n
      row = ieee_value(1.0_wp, ieee_quiet_nan)
      call pack_grain(d, i, row)
      call test%check('every column of a grain is written', .not. any(ieee_is_nan(row)))
      call unpack_grain(row, copy, i)
    end do
    call compare(d, copy)
  end subroutine check_grains

  !> The same bits in all that travels.
  subroutine compare(d, copy)
    type(dem_data_type), intent(in) :: d, copy
    call test%check('ids, kinds, materials', all(d%grains%id == copy%grains%id) .and. &
                    all(d%grains%kind == copy%grains%kind) .and. &
                    all(d%grains%material == copy%grains%material))
    call test%check('all reals of a grain', all(reals_of(d%grains) == reals_of(copy%grains)))
    call test%check('what damping has seen', all(d%seen_kinetic == copy%seen_kinetic))
    if (.not. d%grains%shapes%in_use) return
    associate (a => d%grains%shapes, b => copy%grains%shapes)
      call test%check('shapes', all(a%kind(:n) == b%kind(:n)) .and. &
                      all(a%record(:, :n) == b%record(:, :n)) .and. all(a%frame == b%frame) .and. &
                      all(a%skew == b%skew) .and. all(a%exponent == b%exponent) .and. &
                      all(a%axes == b%axes) .and. all(a%reach == b%reach))
    end associate
  end subroutine compare

  pure function reals_of(g) result(reals)
    type(dem_grains_type), intent(in) :: g
    integer(i8), allocatable :: reals(:)  !! bits
    reals = transfer([g%x, g%v, g%omega, g%axes, g%inertia, g%force, g%moment, g%theta, &
                      g%extra_force, g%extra_moment, g%impulse, g%moment_impulse], [0_i8])
    reals = [reals, transfer([g%quat, g%turn], [0_i8]), &
             transfer([g%mass, g%radius, g%work], [0_i8])]
  end function reals_of

  !> Contacts of one block, one of them with a shift, two reals kept for additional models.
  subroutine make_contacts(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: k
    associate (p => d%pairs)
      p%blocks = 1
      p%plain = n + 3
      p%images = 1
      p%additional%active = .true.
      p%additional%reals = 2
      allocate (p%first(lanes, 1), source=1_i4)
      allocate (p%second(lanes, 1), source=2_i4)
      p%second(2, 1) = p%plain + 1
      p%first(3, 1) = 2
      p%second(3, 1) = 4
      p%grain = [(k, k=1, n), 0, 0, 0, 3]
      p%shift = reshape([1_i4, -1_i4, 2_i4], [3, 1])
      allocate (p%normal(lanes, 3, 1), p%history(lanes, history_size, 1), &
                p%result(result_size, lanes), p%additional%kept(lanes, 2, 1))
      call random_number(p%normal)
      call random_number(p%history)
      call random_number(p%result)
      call random_number(p%additional%kept)
    end associate
  end subroutine make_contacts

  !> Into a row and back into an empty list.
  subroutine check_contacts()
    type(dem_data_type) :: d, copy
    real(wp), allocatable :: row(:)
    integer(i4) :: lane
    call make_random(d, .false.)
    call make_contacts(d)
    copy = d
    copy%pairs%normal = 0.0_wp
    copy%pairs%history = 0.0_wp
    copy%pairs%result = 0.0_wp
    copy%pairs%additional%kept = 0.0_wp
    allocate (row(contact_reals(d)))
    do lane = 1, lanes
      row = ieee_value(1.0_wp, ieee_quiet_nan)
      call pack_contact(d, lane, 1_i4, row)
      call test%check('every column of a contact is written', .not. any(ieee_is_nan(row)))
      call test%check('ids', nint(row(1)) == 10*d%pairs%first(lane, 1) .and. &
                      nint(row(2)) == 10*d%pairs%grain(d%pairs%second(lane, 1)))
      call test%check('shift', all(shift_of(row) == merge([1, -1, 2], [0, 0, 0], lane == 2)))
      call unpack_contact(row, copy, lane, 1_i4)
      call unpack_result(row, copy, lane)
    end do
    call test%check('normals', all(copy%pairs%normal == d%pairs%normal))
    call test%check('history', all(copy%pairs%history == d%pairs%history))
    call test%check('forces', all(copy%pairs%result == d%pairs%result))
    call test%check('what models keep', all(copy%pairs%additional%kept == d%pairs%additional%kept))
  end subroutine check_contacts

  !> Contacts of two grains with surfaces, without and with what additional models keep.
  subroutine check_touches(kept)
    integer(i4), intent(in) :: kept  !! reals
    type(dem_data_type) :: d, copy
    real(wp), allocatable :: row(:)
    integer(i4) :: g
    call make_random(d, .false.)
    associate (s => d%surfaces)
      s%list%near = 2
      s%list%near_grain = [2_i4, 4_i4]
      s%list%candidate = [integer(i4) ::]
      call allocate_contacts(s, n, kept)
      copy%surfaces = s
      s%list%contacts = [3, lanes]
      s%list%part = reshape([(g, g=1, 2*lanes)], [lanes, 2])
      call random_number(s%list%load)
      call random_number(s%list%history)
      call random_number(s%list%foot)
      call random_number(s%list%normal)
      call random_number(s%list%point)
      call random_number(s%list%push)
      call random_number(s%list%motion)
      call random_number(s%list%sign)
      call random_number(s%list%offset)
      call random_number(s%list%kept)
      call random_number(s%list%couple)
      allocate (row(8 + lanes*(history_size + 23 + merge(kept + 3, 0_i4, kept > 0))))
      do g = 1, 2
        row = ieee_value(1.0_wp, ieee_quiet_nan)
        call pack_touch(d, g, lanes, row)
        call test%check('every column is written', .not. any(ieee_is_nan(row)))
        call test%check('id', nint(row(1)) == 20*g)
        call unpack_touch(row, copy%surfaces%list, g, lanes)
      end do
      associate (c => copy%surfaces)
        call test%check('numbers', all(c%list%contacts == s%list%contacts) &
                        .and. all(c%list%part == s%list%part))
        call test%check('loads', all(c%list%load == s%list%load))
        call test%check('contacts', all(c%list%history == s%list%history) &
                        .and. all(c%list%foot == s%list%foot) &
                        .and. all(c%list%normal == s%list%normal) &
                        .and. all(c%list%point == s%list%point) &
                        .and. all(c%list%push == s%list%push) &
                        .and. all(c%list%motion == s%list%motion) &
                        .and. all(c%list%sign == s%list%sign) &
                        .and. all(c%list%offset == s%list%offset))
        call test%check('kept', all(c%list%kept == s%list%kept) &
                        .and. all(c%list%couple == s%list%couple))
      end associate
    end associate
  end subroutine check_touches

  !> Grains and records through the slabs: those of a range, the driven one with its sums.
  subroutine check_slab()
    type(dem_data_type) :: d
    type(dem_slab_type) :: slab
    real(wp), allocatable :: rows(:, :), row(:)
    call make_random(d, .true.)
    call make_contacts(d)
    allocate (d%pairs%start(n + 4), source=1_i4)
    allocate (d%pairs%entry(0))
    d%pairs%blocks = 0  ! nothing to count
    call slab_of_grains(d%halo%team, d, d%grains%id, slab)
    call compare(d, slab%some)
    call test%check('no contacts', all(slab%coordination == 0))
    d%pairs%blocks = 1
    call slab_of_records(d%halo%team, d, 20_i8, 20_i8, rows)
    call test%check('one record in the range', size(rows, 2) == 1)
    row = rows(:, 1)
    call pack_contact(d, 3_i4, 1_i4, row)
    call test%check('with its bits', all(row == rows(:, 1)))
  end subroutine check_slab
end program test_dem_slabs
