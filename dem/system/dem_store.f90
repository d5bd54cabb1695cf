!> The complete state as named arrays, and back, so that a run goes on bit for bit.
module dem_store
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_data_type, dem_grains_type, dem_pairs_type, dem_cell_type, &
    dem_ledger_type, dem_health_type, kind_ghost, lanes, history_size, result_size, column_count, &
    entries_ahead
  use dem_received_contacts, only: adopt_contacts, give_results
  use dem_cell, only: is_periodic
  use dem_additional_list, only: put_extras, get_extras, put_run_of_extras, get_run_of_extras, &
    layout_kept, fit_records, layout_size
  use dem_images, only: resize_images
  use dem_make, only: prescribe_some
  use dem_surface_store, only: put_surfaces, get_surfaces
  use dem_pairs, only: allocate_bodies, update_bodies, build_pairs
  use dem_records, only: plain_contact_reals
  implicit none
  private
  public :: put_state, get_state, put_run, put_grain_arrays, records

  character(len=*), parameter :: records = 'contacts'  !! of dem_records, in place of the list

contains

  !> Everything that changes in a run.
  subroutine put_state(d, archive)
    type(dem_data_type), intent(in) :: d
    type(dem_archive_type), intent(inout) :: archive

    call archive%clear()
    call put_grain_arrays(d, archive)
    call put_pairs(d%pairs, archive)
    if (is_periodic(d%cell)) call put_images(d%pairs, archive)
    if (d%surfaces%n > 0) call put_surfaces(d%surfaces, d%pairs%extras%extra_places_type, archive)
    call put_run(d, archive)
  end subroutine put_state

  !> What is no list of grains, contacts or surfaces.
  subroutine put_run(d, archive)
    type(dem_data_type), intent(in) :: d
    type(dem_archive_type), intent(inout) :: archive

    call put_planes(d, archive)
    if (d%cell%active) call put_cell(d%cell, archive)
    call put_run_of_extras(d%pairs%extras, archive)
    call archive%put_reals('pairs.skin', reshape([d%pairs%skin, d%pairs%least_skin, &
                                                  d%pairs%most_skin], [3, 1]))
    if (allocated(d%servo_seen)) call archive%put_reals('servo.seen', d%servo_seen)
    if (d%kept_volume > 0.0_wp) &
      call archive%put_reals('volume.kept', reshape([d%kept_volume], [1, 1]))
    if (allocated(d%surcharge)) then
      call archive%put_reals('surcharge.force', reshape(d%surcharge, [1, size(d%surcharge)]))
      call archive%put_reals('surcharge.seen', reshape(d%surcharge_seen, &
                                                       [1, size(d%surcharge_seen)]))
      call archive%put_reals('surcharge.top', reshape(merge(1.0_wp, 0.0_wp, d%surcharge_top), &
                                                      [1, size(d%surcharge_top)]))
    end if
    if (d%parts%active) then
      call archive%put_reals('parts.of_free', d%parts%of_free)
      call archive%put_reals('parts.of_ghosts', d%parts%of_ghosts)
      if (allocated(d%parts%spare)) call archive%put_reals('parts.spare', &
        reshape(d%parts%spare, [1, d%grains%n]))
      call archive%put_reals('parts.pending', reshape([d%parts%pending], [1, 1]))
    end if
    call archive%put_reals('ledger', ledger_row(d%ledger))
    call archive%put_reals('health.real', reshape([d%health%max_overlap, &
                           d%health%reference_energy, d%pending, d%ledger_dt, d%par%dt], [5, 1]))
    call archive%put_integers('health.count', reshape([d%health%steps, d%health%rebuilds, &
                              d%health%late_rebuilds, d%health%evaluations], [4, 1]))
    call archive%put_integers('weights.id', weight_ids(d))
    call archive%put_reals('weights.value', reshape(weight_values(d), [1, d%weights%n]))
  end subroutine put_run

  pure function weight_ids(d) result(ids)
    type(dem_data_type), intent(in) :: d
    integer(i8) :: ids(2, d%weights%n)
    if (d%weights%n > 0) ids = d%weights%id(:, :d%weights%n)
  end function weight_ids

  pure function weight_values(d) result(values)
    type(dem_data_type), intent(in) :: d
    real(wp) :: values(d%weights%n)
    if (d%weights%n > 0) values = d%weights%value(:d%weights%n)
  end function weight_values

  !> Grains, all or some, and what damping has seen of them.
  subroutine put_grain_arrays(d, archive)
    type(dem_data_type), intent(in) :: d
    type(dem_archive_type), intent(inout) :: archive
    integer(i4) :: n
    associate (g => d%grains)
      n = g%n
      call archive%put_integers('grains.id', reshape(g%id, [1, n]))
      call archive%put_integers('grains.kind', int(reshape(g%kind, [1, n]), i8))
      call archive%put_integers('grains.material', int(reshape(g%material, [1, n]), i8))
      call archive%put_reals('grains.x', g%x)
      call archive%put_reals('grains.quat', g%quat)
      call archive%put_reals('grains.v', g%v)
      call archive%put_reals('grains.omega', g%omega)
      call archive%put_reals('grains.axes', g%axes)
      call archive%put_reals('grains.mass', reshape(g%mass, [1, n]))
      call archive%put_reals('grains.inertia', g%inertia)
      call archive%put_reals('grains.force', g%force)
      call archive%put_reals('grains.moment', g%moment)
      call archive%put_reals('grains.theta', g%theta)
      call archive%put_reals('grains.extra_force', g%extra_force)
      call archive%put_reals('grains.extra_moment', g%extra_moment)
      if (size(g%work) > 0) then
        call archive%put_reals('grains.impulse', g%impulse)
        call archive%put_reals('grains.moment_impulse', g%moment_impulse)
        call archive%put_reals('grains.work', reshape(g%work, [1, n]))
        call archive%put_reals('grains.turn', g%turn)
      end if
      if (g%forms%n > 0) call archive%put_reals('grains.form', g%forms%record(5:, :n))
    end associate
    if (allocated(d%seen_kinetic)) call archive%put_reals( &
      'damping.seen_kinetic', reshape(d%seen_kinetic, [1, size(d%seen_kinetic)]))
  end subroutine put_grain_arrays

  subroutine put_planes(d, archive)
    type(dem_data_type), intent(in) :: d
    type(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('planes.point', d%planes%point)
    call archive%put_reals('planes.velocity', d%planes%velocity)
    call archive%put_reals('planes.force', d%planes%force)
    call archive%put_reals('planes.impulse', d%planes%impulse)
    call archive%put_reals('planes.work', reshape(d%planes%work, [1, d%planes%n]))
  end subroutine put_planes

  !> The list in its order, normals and history of every candidate, reference positions.
  subroutine put_pairs(p, archive)
    type(dem_pairs_type), intent(in) :: p
    type(dem_archive_type), intent(inout) :: archive
    integer(i4) :: m
    m = p%blocks
    call archive%put_integers('pairs.count', reshape([int(p%blocks, i8), &
                              int(p%grain_blocks, i8), int(p%count, i8), p%built_at], [4, 1]))
    call archive%put_integers('pairs.first', int(p%first, i8))
    call archive%put_integers('pairs.second', int(p%second, i8))
    call archive%put_integers('pairs.law', int(reshape( &
      [p%law_first, p%law_second, merge(1, 0, p%touched), merge(1, 0, p%round) + 2*p%form], &
      [m, 4]), i8))
    call archive%put_integers('pairs.group_end', int(reshape(p%group_end, [1, p%groups]), i8))
    call archive%put_integers('pairs.start', int(reshape(p%start, [size(p%start), 1]), i8))
    call archive%put_integers('pairs.entry', int(reshape(p%entry(:2*p%count), [2*p%count, 1]), i8))
    call archive%put_reals('pairs.normal', reshape(p%normal, [lanes*3, m]))
    call archive%put_reals('pairs.history', reshape(p%history, [lanes*history_size, m]))
    call archive%put_reals('pairs.result', p%result)
    call archive%put_reals('pairs.least_gap', reshape(p%least_gap, [1, m]))
    call archive%put_reals('pairs.weight', p%weight)
    call archive%put_reals('pairs.m_star', p%m_star)
    call put_extras(p%extras, archive)
    call archive%put_reals('pairs.reference_x', p%reference_x)
    if (any(p%ease < 1.0_wp)) &
      call archive%put_reals('pairs.ease', reshape(p%ease, [1, size(p%ease)]))
    call archive%put_reals('pairs.reference_q', p%reference_q)
  end subroutine put_pairs

  subroutine put_cell(c, archive)
    type(dem_cell_type), intent(in) :: c
    type(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('cell', reshape([c%vectors, c%start, c%rate, c%step, c%back, c%speed, &
                                            c%listed, c%deform], [3, 24]))
    call archive%put_reals('cell.place', reshape([c%origin, c%reach, c%stretch, c%held], [5, 3]))
  end subroutine put_cell

  !> The images of the list in a cell.
  subroutine put_images(p, archive)
    type(dem_pairs_type), intent(in) :: p
    type(dem_archive_type), intent(inout) :: archive
    call archive%put_integers('images', int(reshape([p%grain(p%plain + 1:), &
                              reshape(p%shift, [3*p%images])], [p%images, 4]), i8))
    call archive%put_reals('images.force', p%image_force)
  end subroutine put_images

  !> The same back.
  subroutine get_cell(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    integer(i8), allocatable :: images(:, :)
    integer(i4) :: n, k

    call archive%get_reals('cell', 3, 24, rows, errors)
    if (errors%any()) return
    associate (c => d%cell)
      c%vectors = rows(:, 1:3)
      c%start = rows(:, 4:6)
      c%rate = rows(:, 7:9)
      c%step = rows(:, 10:12)
      c%back = rows(:, 13:15)
      c%speed = rows(:, 16:18)
      c%listed = rows(:, 19:21)
      c%deform = rows(:, 22:24)
      call archive%get_reals('cell.place', 5, 3, rows, errors)
      if (errors%any()) return
      c%origin = rows(:3, 1)
      c%reach = rows(4, 1)
      c%stretch = rows(5, 1)
      c%held = reshape(rows(:, 2:), [10])
      if (.not. is_periodic(c) .or. archive%find(records//'.built_at') > 0) return
    end associate
    k = archive%find('images')
    n = 0
    if (k > 0) n = size(archive%item(k)%integers, 1)
    call archive%get_integers('images', n, 4, images, errors)
    call archive%get_reals('images.force', 3, n, rows, errors)
    if (errors%any()) return
    call resize_images(d%pairs, d%grains%n, int(images(:, 1), i4), &
                       int(reshape(images(:, 2:4), [3, n]), i4))
    d%pairs%image_force = rows
  end subroutine get_cell

  pure function ledger_row(l) result(row)
    type(dem_ledger_type), intent(in) :: l
    real(wp) :: row(18, 1)
    row(:, 1) = [l%kinetic, l%elastic_normal, l%elastic_tangential, l%staggering, l%friction, &
                 l%contact_damping, l%background_damping, l%curvature, l%tangential_relaxation, &
                 l%boundary, l%external, l%gravity, l%start, l%largest, l%elastic_other, &
                 l%rolling, l%breakage, l%plastic]
  end function ledger_row

  pure function ledger_from(row) result(l)
    real(wp), intent(in) :: row(18)
    type(dem_ledger_type) :: l
    l%kinetic = row(1)
    l%elastic_normal = row(2)
    l%elastic_tangential = row(3)
    l%staggering = row(4)
    l%friction = row(5)
    l%contact_damping = row(6)
    l%background_damping = row(7)
    l%curvature = row(8)
    l%tangential_relaxation = row(9)
    l%boundary = row(10)
    l%external = row(11)
    l%gravity = row(12)
    l%start = row(13)
    l%largest = row(14)
    l%elastic_other = row(15)
    l%rolling = row(16)
    l%breakage = row(17)
    l%plastic = row(18)
  end function ledger_from

  !> Take the state from an archive; grains must be those of the packing (same ids).
  subroutine get_state(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors

    call get_grains(d, archive, errors)
    if (errors%any()) return
    call allocate_bodies(d%pairs, d%grains, d%planes)
    if (d%cell%active) call get_cell(d, archive, errors)
    if (errors%any()) return
    if (archive%find(records) > 0) then
      call get_records(d, archive, errors)
    else if (archive%find(records//'.built_at') > 0) then
      call get_age(d, archive, errors)
    else
      call get_list(d, archive, errors)
    end if
    if (errors%any()) return
    call get_run(d, archive, errors)
  end subroutine get_state

  !> Contacts as many ranks wrote them: a new list takes them over.
  subroutine get_records(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    integer(i4) :: layout(layout_size)
    call get_age(d, archive, errors)
    layout = layout_kept(archive)
    call archive%get_reals(records, plain_contact_reals + layout(1), -1, rows, errors)
    if (errors%any()) return
    call fit_records(d%pairs%extras, layout, rows)
    call adopt_contacts(d, rows)
    call build_pairs(d%pairs, d%grains, d%planes, d%weights, d%par%ghost_pairs, d%cell)
    call give_results(d, rows)
  end subroutine get_records

  !> Skin of the list and when it was made; bodies as the grains are. The contacts come later.
  subroutine get_age(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: built(:, :)
    call archive%get_integers(records//'.built_at', 1, 1, built, errors)
    if (errors%any()) return
    call get_skin(d%pairs, archive, errors)
    if (errors%any()) return
    d%pairs%built_at = built(1, 1)
    call update_bodies(d%pairs, d%grains, d%planes, d%cell)
  end subroutine get_age

  subroutine get_skin(pairs, archive, errors)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: skin(:, :)
    call archive%get_reals('pairs.skin', 3, 1, skin, errors)
    pairs%skin = skin(1, 1)
    pairs%least_skin = skin(2, 1)
    pairs%most_skin = skin(3, 1)
  end subroutine get_skin

  !> The list as it was, and what is near surfaces.
  subroutine get_list(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    call get_pairs(d, archive, errors)
    if (errors%any()) return
    call get_extras(d%pairs%extras, d%pairs%blocks, archive, errors)
    if (errors%any()) return
    call update_bodies(d%pairs, d%grains, d%planes, d%cell)
    call get_surfaces(d, archive, errors)
  end subroutine get_list

  !> What is no list of grains, contacts or surfaces.
  subroutine get_run(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:, :)
    integer(i8), allocatable :: counts(:, :)
    integer(i4) :: k

    if (archive%find('damping.seen_kinetic') > 0) then
      call archive%get_reals('damping.seen_kinetic', 1, d%grains%n, row, errors)
      d%seen_kinetic = row(1, :)
    end if
    k = archive%find('servo.seen')
    if (k > 0) d%servo_seen = archive%item(k)%reals
    k = archive%find('volume.kept')
    if (k > 0) d%kept_volume = archive%item(k)%reals(1, 1)
    if (archive%find('surcharge.force') > 0) then
      call archive%get_reals('surcharge.force', 1, d%grains%n, row, errors)
      d%surcharge = row(1, :)
      call archive%get_reals('surcharge.seen', 1, -1, row, errors)
      d%surcharge_seen = row(1, :)
      d%surcharge_top = d%surcharge > 0.0_wp  ! as checkpoints without the next leave it
      if (archive%find('surcharge.top') > 0) then
        call archive%get_reals('surcharge.top', 1, d%grains%n, row, errors)
        d%surcharge_top = row(1, :) > 0.5_wp
      end if
    end if
    if (archive%find('parts.of_free') > 0) then
      call archive%get_reals('parts.of_free', 6, d%grains%n, d%parts%of_free, errors)
      call archive%get_reals('parts.of_ghosts', 6, d%grains%n, d%parts%of_ghosts, errors)
      call archive%get_reals('parts.pending', 1, 1, row, errors)
      d%parts%pending = row(1, 1)
      k = archive%find('parts.spare')
      if (k > 0) d%parts%spare = archive%item(k)%reals(1, :)
    end if
    call get_run_of_extras(d%pairs%extras, archive, errors)
    if (errors%any()) return
    call archive%get_reals('ledger', 18, 1, row, errors)
    d%ledger = ledger_from(row(:, 1))
    call archive%get_reals('health.real', 5, 1, row, errors)
    d%health%max_overlap = row(1, 1)
    d%health%reference_energy = row(2, 1)
    d%pending = row(3, 1)
    d%ledger_dt = row(4, 1)
    d%par%dt = row(5, 1)
    call archive%get_integers('health.count', 4, 1, counts, errors)
    d%health%steps = counts(1, 1)
    d%health%rebuilds = counts(2, 1)
    d%health%late_rebuilds = counts(3, 1)
    d%health%evaluations = counts(4, 1)
    call archive%get_integers('weights.id', 2, -1, counts, errors)
    d%weights%n = size(counts, 2)
    call archive%get_reals('weights.value', 1, d%weights%n, row, errors)
    d%weights%id = counts
    d%weights%value = row(1, :)
  end subroutine get_run

  subroutine get_grains(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:, :)
    integer(i4) :: n

    n = d%grains%n
    call archive%get_integers('grains.id', 1, n, ids, errors)
    if (errors%any()) return
    if (any(ids(1, :) /= d%grains%id)) then
      call errors%add('I229', 'checkpoint: its grains have other ids than the packing', &
                      hint='the checkpoint belongs to another packing, deck or version')
      return
    end if
    call archive%get_integers('grains.kind', 1, n, ids, errors)
    d%grains%kind = int(ids(1, :), i4)
    call archive%get_integers('grains.material', 1, n, ids, errors)
    d%grains%material = int(ids(1, :), i4)
    associate (g => d%grains)
      call take('grains.x', g%x)
      call take('grains.quat', g%quat)
      call take('grains.v', g%v)
      call take('grains.omega', g%omega)
      call take('grains.axes', g%axes)
      call take('grains.inertia', g%inertia)
      call take('grains.force', g%force)
      call take('grains.moment', g%moment)
      call take('grains.theta', g%theta)
      call take('grains.extra_force', g%extra_force)
      call take('grains.extra_moment', g%extra_moment)
      if (archive%find('grains.work') > 0) then
        call prescribe_some(g)
        call take('grains.impulse', g%impulse)
        call take('grains.moment_impulse', g%moment_impulse)
        call take_row('grains.work', g%work)
        call take('grains.turn', g%turn)
      end if
      call compare_forms(g, archive, errors)
      call take_row('grains.mass', g%mass)
    end associate
    if (d%grains%forms%n == 0) d%grains%radius = maxval(d%grains%axes, dim=1)
    d%grains%has_target = .false.
    call take('planes.point', d%planes%point)
    call take('planes.velocity', d%planes%velocity)
    call take('planes.force', d%planes%force)
    call take('planes.impulse', d%planes%impulse)
    call take_row('planes.work', d%planes%work)

  contains

    subroutine take(name, array)
      character(len=*), intent(in) :: name
      real(wp), intent(inout) :: array(:, :)
      real(wp), allocatable :: values(:, :)
      call archive%get_reals(name, size(array, 1), size(array, 2), values, errors)
      array = values
    end subroutine take

    subroutine take_row(name, array)
      character(len=*), intent(in) :: name
      real(wp), intent(inout) :: array(:)
      real(wp), allocatable :: values(:, :)
      call archive%get_reals(name, 1, size(array), values, errors)
      array = values(1, :)
    end subroutine take_row
  end subroutine get_grains

  !> The grains of the packing must still have the forms of the checkpoint (I229).
  subroutine compare_forms(g, archive, errors)
    type(dem_grains_type), intent(in) :: g
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: forms(:, :)
    logical :: same

    same = (archive%find('grains.form') > 0) .eqv. (g%forms%n > 0)
    if (same .and. g%forms%n > 0) then
      call archive%get_reals('grains.form', size(g%forms%record, 1) - 4, g%n, forms, errors)
      if (errors%any()) return
      same = all(abs(forms - g%forms%record(5:, :g%n)) <= 0.0_wp)
    end if
    if (same) return
    call errors%add('I229', 'checkpoint: its grains have other shapes than the packing', &
                    hint='the checkpoint belongs to another packing, deck or version')
  end subroutine compare_forms

  subroutine get_pairs(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :), law(:, :), first(:, :), second(:, :), start(:, :), &
      entry(:, :), group(:, :)
    real(wp), allocatable :: flat(:, :)
    integer(i4) :: m, bodies

    bodies = d%pairs%plain + d%pairs%images
    call archive%get_integers('pairs.count', 4, 1, counts, errors)
    if (errors%any()) return
    m = int(counts(1, 1), i4)
    call archive%get_integers('pairs.first', lanes, m, first, errors)
    call archive%get_integers('pairs.second', lanes, m, second, errors)
    call archive%get_integers('pairs.law', m, 4, law, errors)
    call archive%get_integers('pairs.group_end', 1, -1, group, errors)
    call archive%get_integers('pairs.start', bodies + 1, 1, start, errors)
    call archive%get_integers('pairs.entry', 2*int(counts(3, 1), i4), 1, entry, errors)
    if (errors%any()) return
    associate (p => d%pairs)
      p%blocks = m
      p%grain_blocks = int(counts(2, 1), i4)
      p%count = int(counts(3, 1), i4)
      p%built_at = counts(4, 1)
      p%first = int(first, i4)
      p%second = int(second, i4)
      p%law_first = int(law(:, 1), i4)
      p%law_second = int(law(:, 2), i4)
      p%touched = law(:, 3) == 1
      p%round = law(:, 4) == 1
      p%form = int(law(:, 4)/2, i4)
      p%groups = size(group, 2)
      p%group_end = int(group(1, :), i4)
      p%start = int(start(:, 1), i4)
      p%entry = int([entry(:, 1), spread(0_i8, 1, entries_ahead)], i4)
      call get_skin(p, archive, errors)
      call archive%get_reals('pairs.normal', lanes*3, m, flat, errors)
      p%normal = reshape(flat, [lanes, 3, m])
      call archive%get_reals('pairs.history', lanes*history_size, m, flat, errors)
      p%history = reshape(flat, [lanes, history_size, m])
      call archive%get_reals('pairs.result', result_size, lanes*m, flat, errors)
      p%result = flat
      call archive%get_reals('pairs.least_gap', 1, m, flat, errors)
      p%least_gap = flat(1, :)
      call count_blocks(p, d%grains%kind)
      call archive%get_reals('pairs.weight', lanes, -1, flat, errors)
      p%weight = flat
      call archive%get_reals('pairs.m_star', lanes, m, flat, errors)
      p%m_star = flat
      call archive%get_reals('pairs.reference_x', 3, p%plain, flat, errors)
      p%reference_x = flat
      if (archive%find('pairs.ease') > 0) then
        call archive%get_reals('pairs.ease', 1, p%plain, flat, errors)
        p%ease = flat(1, :)
      end if
      call archive%get_reals('pairs.reference_q', 4, p%plain, flat, errors)
      p%reference_q = flat
      p%columns = reshape(spread(0.0_wp, 1, column_count*m), [column_count, m])
    end associate
  end subroutine get_pairs

  !> How many of the first blocks hold no ghost, and no two of them. Lists of old checkpoints mix
  !! pairs with and without a ghost.
  pure subroutine count_blocks(p, kind)
    type(dem_pairs_type), intent(inout) :: p
    integer(i4), intent(in) :: kind(:)  !! of the grains
    integer(i4) :: b, n
    logical :: bare
    n = size(kind, kind=i4)
    p%bare_blocks = 0
    p%rim_blocks = 0
    do b = 1, p%grain_blocks
      associate (first => pack(p%first(:, b), p%first(:, b) <= n), &
                 second => p%grain(pack(p%second(:, b), p%first(:, b) <= n)))
        if (all(kind(first) == kind_ghost .and. kind(second) == kind_ghost)) exit
        p%rim_blocks = b
        bare = .not. any(kind(first) == kind_ghost .or. kind(second) == kind_ghost)
        if (bare .and. p%bare_blocks == b - 1) p%bare_blocks = b
      end associate
    end do
  end subroutine count_blocks
end module dem_store
