!> The complete state as named arrays, and back, so that a run continues bit for bit.
module dem_store
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_data_type, dem_cell_type, dem_ledger_type, servo_seen_size, &
    surcharge_seen_size, fed_size, drained_size, window_size, crushed_size, grown_size, &
    graded_size
  use dem_received_contacts, only: receive_contacts, give_results
  use dem_cell, only: is_periodic
  use dem_additional_list, only: put_run_of_additional, get_run_of_additional, layout_kept, &
    fit_records, layout_size
  use dem_images, only: resize_images
  use dem_surface_store, only: put_surfaces
  use dem_pairs, only: allocate_bodies, update_bodies, build_pairs
  use dem_records, only: plain_contact_reals
  use dem_store_grains, only: put_grain_arrays, get_grains, put_clump_motion, get_clump_motion
  use dem_store_pairs, only: put_pairs, put_images, get_skin, get_list
  use dem_store_pore, only: put_pore, get_pore
  use dem_store_fields, only: put_wear_and_heat, get_wear_and_heat
  implicit none
  private
  public :: put_state, get_state, put_run, put_grain_arrays, records

  integer(i8), parameter :: furthest_image = 4095  !! in edges of the cell, see dem_images
  integer(i4), parameter :: ledger_reals = 20
  character(len=*), parameter :: records = 'contacts'  !! of dem_records, in place of the list

contains

  !> Everything that changes in a run.
  subroutine put_state(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive

    call archive%clear()
    call put_grain_arrays(d, archive)
    call put_clump_motion(d, archive)
    call put_pairs(d%pairs, archive)
    if (is_periodic(d%cell)) call put_images(d%pairs, archive)
    if (d%surfaces%n > 0) &
      call put_surfaces(d%surfaces, d%pairs%additional%kept_places_type, archive)
    call put_run(d, archive)
  end subroutine put_state

  !> What is no list of grains, contacts or surfaces.
  subroutine put_run(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive

    call put_planes(d, archive)
    if (d%cell%active) call put_cell(d%cell, archive)
    call put_run_of_additional(d%pairs%additional, archive)
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
    if (d%pore%active) call put_pore(d%pore, archive)
    if (d%open) call put_open(d, archive)
    if (allocated(d%crushed)) call put_crushed(d, archive)
    call put_wear_and_heat(d, archive)
    if (allocated(d%graded)) &
      call archive%put_reals('grading.start', reshape(d%graded, [graded_size, 1]))
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

  !> What sources and sinks have done so far.
  subroutine put_open(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_integers('last_id', reshape([d%last_id], [1, 1]))
    call archive%put_reals('sources.fed', d%fed)
    call archive%put_reals('sinks.drained', d%drained)
    if (allocated(d%window)) call archive%put_reals('window', reshape(d%window, [window_size, 1]))
    if (allocated(d%base)) call archive%put_reals('grains.base', d%base)
  end subroutine put_open

  !> The same back.
  subroutine get_open(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: last(:, :)
    real(wp), allocatable :: window(:, :)
    integer(i4) :: sources, sinks
    sources = size(d%fed, 2)
    sinks = size(d%drained, 2)
    call archive%get_integers('last_id', 1, 1, last, errors, [0_i8, int(huge(1_i4), i8)])
    call archive%get_reals('sources.fed', fed_size, sources, d%fed, errors)
    call archive%get_reals('sinks.drained', drained_size, sinks, d%drained, errors)
    if (allocated(d%window)) call archive%get_reals('window', window_size, 1, window, errors)
    if (archive%find('grains.base') > 0) &
      call archive%get_reals('grains.base', 4, d%grains%n, d%base, errors)
    if (errors%any()) return
    d%last_id = last(1, 1)
    if (allocated(d%window)) d%window = window(:, 1)
  end subroutine get_open

  !> What broken grains have left so far.
  subroutine put_crushed(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('breakage.sums', reshape([d%crushed, d%ledger%released, &
                                                     d%ledger%fines], [crushed_size + 2, 1]))
    call archive%put_integers('breakage.lineage', d%lineage)
    call archive%put_reals('breakage.fines', d%fines)
    if (.not. allocated(d%growing)) return
    call archive%put_reals('breakage.growing', d%growing)
    call archive%put_reals('breakage.growth', reshape([d%ledger%growth], [1, 1]))
  end subroutine put_crushed

  !> The same back, after the ledger; a checkpoint of a run without breakage has none.
  subroutine get_crushed(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: sums(:, :)
    if (archive%find('breakage.sums') == 0) return
    call archive%get_reals('breakage.sums', crushed_size + 2, 1, sums, errors)
    call archive%get_integers('breakage.lineage', 3, -1, d%lineage, errors, &
                              [0_i8, int(huge(1_i4), i8)])
    call archive%get_reals('breakage.fines', 2, -1, d%fines, errors)
    if (errors%any()) return
    d%crushed = sums(:crushed_size, 1)
    d%ledger%released = sums(crushed_size + 1, 1)
    d%ledger%fines = sums(crushed_size + 2, 1)
    if (.not. allocated(d%growing) .or. archive%find('breakage.growing') == 0) return
    call archive%get_reals('breakage.growing', grown_size, -1, d%growing, errors)
    call archive%get_reals('breakage.growth', 1, 1, sums, errors)
    if (errors%any()) return
    d%ledger%growth = sums(1, 1)
  end subroutine get_crushed

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

  subroutine put_planes(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('planes.point', d%planes%point)
    call archive%put_reals('planes.velocity', d%planes%velocity)
    call archive%put_reals('planes.force', d%planes%force)
    call archive%put_reals('planes.impulse', d%planes%impulse)
    call archive%put_reals('planes.work', reshape(d%planes%work, [1, d%planes%n]))
  end subroutine put_planes

  subroutine put_cell(c, archive)
    type(dem_cell_type), intent(in) :: c
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('cell', reshape([c%vectors, c%start, c%rate, c%step, c%back, c%speed, &
                                            c%listed, c%deform], [3, 24]))
    call archive%put_reals('cell.place', reshape([c%origin, c%reach, c%stretch, c%held], [5, 3]))
  end subroutine put_cell

  !> Owners of images are grains, shifts lie within what keys of images can hold.
  subroutine check_images(images, archive, errors)
    integer(i8), intent(in) :: images(:, :)  !! (n, 4) owner, shift
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    if (all(images(:, 1) >= 1) .and. all(images(:, 2:) <= furthest_image)) return
    call archive%refuse('images', 'holds '//str(minval(images(:, 1)))//' as a grain or '// &
                        str(maxval(images(:, 2:)))//' as a shift', errors)
  end subroutine check_images

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
    if (k > 0) then
      if (allocated(archive%item(k)%integers)) n = size(archive%item(k)%integers, 1)
    end if
    call archive%get_integers('images', n, 4, images, errors, [-furthest_image, &
                                                               int(d%grains%n, i8)])
    if (.not. errors%any()) call check_images(images, archive, errors)
    call archive%get_reals('images.force', 3, n, rows, errors)
    if (errors%any()) return
    call resize_images(d%pairs, d%grains%n, int(images(:, 1), i4), &
                       int(reshape(images(:, 2:4), [3, n]), i4))
    d%pairs%image_force = rows
  end subroutine get_cell

  pure function ledger_row(l) result(row)
    type(dem_ledger_type), intent(in) :: l
    real(wp) :: row(ledger_reals, 1)
    row(:, 1) = [l%kinetic, l%elastic_normal, l%elastic_tangential, l%staggering, l%friction, &
                 l%contact_damping, l%background_damping, l%curvature, l%tangential_relaxation, &
                 l%boundary, l%external, l%gravity, l%start, l%largest, l%elastic_other, &
                 l%rolling, l%breakage, l%plastic, l%entered, l%left]
  end function ledger_row

  pure function ledger_from(row) result(l)
    real(wp), intent(in) :: row(ledger_reals)
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
    l%entered = row(19)
    l%left = row(20)
  end function ledger_from

  !> Take the state from an archive; grains must be those of the packing (same ids).
  subroutine get_state(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors

    call get_grains(d, archive, errors)
    if (errors%any()) return
    call get_clump_motion(d, archive, errors)
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

  !> Contacts as many ranks wrote them: a new list inherits them.
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
    call fit_records(d%pairs%additional, layout, rows)
    call receive_contacts(d, rows)
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

  !> Loads of a surcharge and what its last update saw.
  subroutine get_surcharge(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:, :)
    call archive%get_reals('surcharge.force', 1, d%grains%n, row, errors)
    d%surcharge = row(1, :)
    call archive%get_reals('surcharge.seen', 1, surcharge_seen_size, row, errors)
    d%surcharge_seen = row(1, :)
    d%surcharge_top = d%surcharge > 0.0_wp  ! as checkpoints without the next leave it
    if (archive%find('surcharge.top') == 0) return
    call archive%get_reals('surcharge.top', 1, d%grains%n, row, errors)
    d%surcharge_top = row(1, :) > 0.5_wp
  end subroutine get_surcharge

  !> What is no list of grains, contacts or surfaces.
  subroutine get_run(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:, :)
    integer(i8), allocatable :: counts(:, :)

    if (archive%find('damping.seen_kinetic') > 0) then
      call archive%get_reals('damping.seen_kinetic', 1, d%grains%n, row, errors)
      d%seen_kinetic = row(1, :)
    end if
    if (archive%find('servo.seen') > 0) &
      call archive%get_reals('servo.seen', servo_seen_size, d%planes%n, d%servo_seen, errors)
    if (archive%find('volume.kept') > 0) then
      call archive%get_reals('volume.kept', 1, 1, row, errors)
      d%kept_volume = row(1, 1)
    end if
    if (archive%find('surcharge.force') > 0) call get_surcharge(d, archive, errors)
    if (d%open) call get_open(d, archive, errors)
    if (errors%any()) return
    if (archive%find('parts.of_free') > 0) then
      call archive%get_reals('parts.of_free', 6, d%grains%n, d%parts%of_free, errors)
      call archive%get_reals('parts.of_ghosts', 6, d%grains%n, d%parts%of_ghosts, errors)
      call archive%get_reals('parts.pending', 1, 1, row, errors)
      d%parts%pending = row(1, 1)
      if (archive%find('parts.spare') > 0) then
        call archive%get_reals('parts.spare', 1, d%grains%n, row, errors)
        d%parts%spare = row(1, :)
      end if
    end if
    call get_run_of_additional(d%pairs%additional, archive, errors)
    if (errors%any()) return
    call archive%get_reals('ledger', ledger_reals, 1, row, errors)
    d%ledger = ledger_from(row(:, 1))
    call get_pore(d, archive, errors)
    if (errors%any()) return
    if (allocated(d%crushed)) call get_crushed(d, archive, errors)
    call get_wear_and_heat(d, archive, errors)
    if (allocated(d%graded) .and. archive%find('grading.start') > 0) then
      call archive%get_reals('grading.start', graded_size, 1, row, errors)
      if (errors%any()) return
      d%graded = row(:, 1)
    end if
    call archive%get_reals('health.real', 5, 1, row, errors)
    d%health%max_overlap = row(1, 1)
    d%health%reference_energy = row(2, 1)
    d%pending = row(3, 1)
    d%ledger_dt = row(4, 1)
    d%par%dt = row(5, 1)
    call archive%get_integers('health.count', 4, 1, counts, errors, [0_i8, huge(1_i8)])
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
end module dem_store
