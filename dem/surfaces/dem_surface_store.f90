!> Surfaces on their way to and from a checkpoint, bit for bit: motion, sums, candidates and current
!! contacts.
module dem_surface_store
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_record_layout, only: slot_motion
  use dem_state, only: dem_data_type
  use dem_additional_state, only: kept_places_type, most_parts
  use dem_surface_additional, only: surface_kept_reals
  use dem_surface_state, only: dem_surfaces_type, surface_soft, surface_cylinder, &
    surface_bore, soft_smooth, servo_size, is_round
  use dem_membrane, only: pull_membranes, set_pressures, set_stretches, set_forces
  use dem_surface_body, only: set_loads
  use dem_surface_contacts, only: begin_list, allocate_contacts, set_contacts, set_slots, &
    set_offsets, set_kept, set_shares
  use dem_surface_make, only: mesh_type, check_mesh
  use dem_surface_values, only: add_mesh, set_places, set_velocities, set_swell, set_press, &
    set_radii, set_sums, set_vertices, set_reference, set_vertex_loads, set_servos
  implicit none
  private
  public :: put_surfaces, get_surfaces

  integer(i4), parameter :: longest_name = 48
  integer(i4), parameter :: contact_size = slot_motion(2)  !! reals of a contact

contains

  !> Everything that changes in a run.
  subroutine put_surfaces(s, places, archive)
    type(dem_surfaces_type), intent(in) :: s
    type(kept_places_type), intent(in) :: places
    class(dem_archive_type), intent(inout) :: archive
    real(wp) :: packed(s%list%slots*contact_size, s%list%near)
    integer(i4) :: g

    call archive%put_integers('surfaces.size', &
                              int(reshape([s%n, s%parts, s%mesh%vertices, s%mesh%triangles, &
                              s%list%near], [5, 1]), i8))
    call archive%put_reals('surfaces.body', reshape([s%centre, s%velocity, s%spin, s%reference_x], &
                                                    [3*s%n, 4]))
    call archive%put_reals('surfaces.turn', reshape([s%quat, s%reference_q], [4*s%n, 2]))
    call archive%put_reals('surfaces.axis', s%round%axis)
    call archive%put_reals('surfaces.sums', reshape([s%sums%force, s%sums%moment, s%sums%impulse, &
                                                     s%sums%moment_impulse], [3*s%parts, 4]))
    call archive%put_reals('surfaces.work', reshape(s%sums%work, [1, s%parts]))
    call archive%put_reals('surfaces.vertex', reshape([s%mesh%x, s%mesh%v, s%mesh%reference, &
                           s%mesh%force, s%mesh%impulse], [3*s%mesh%vertices, 5]))
    call archive%put_integers('surfaces.near', &
                              int(reshape(s%list%near_grain, [1, s%list%near]), i8))
    call archive%put_integers('surfaces.start', &
                              int(reshape(s%list%near_start, [1, s%list%near + 1]), i8))
    call archive%put_integers('surfaces.candidate', int(reshape(s%list%candidate, &
                                                                [1, size(s%list%candidate)]), i8))
    call archive%put_integers('surfaces.contacts', &
                              int(reshape(s%list%contacts, [1, s%list%near]), i8))
    call archive%put_integers('surfaces.part', int(s%list%part, i8))
    call archive%put_reals('surfaces.gap', reshape(s%list%least_gap, [1, s%list%near]))
    call archive%put_reals('surfaces.load', s%list%load)
    call archive%put_reals('surfaces.share', s%list%share)
    do g = 1, s%list%near
      packed(:, g) = [s%list%history(:, :, g), s%list%foot(:, :, g), s%list%normal(:, :, g), &
        s%list%point(:, :, g), s%list%push(:, :, g), s%list%motion(:, :, g)]
    end do
    call archive%put_reals('surfaces.contact', packed)
    if (any(abs(s%list%image) > 0.0_wp)) call put_images(s, archive)
    if (s%soft) call put_soft(s, archive)
    if (size(s%list%kept) > 0) call put_kept(s, places, archive)
    if (allocated(s%servo)) call archive%put_reals('surfaces.servo', s%servo)
    if (any(s%kind == surface_cylinder .or. s%kind == surface_bore)) call put_bores(s, archive)
    if (allocated(s%membranes)) then
      call archive%put_reals('surfaces.membranes', &
                             reshape([s%membranes%pressure, s%membranes%stretch], [s%n, 2]))
      call archive%put_reals('surfaces.sign', s%list%sign)
      call archive%put_reals('surfaces.press', s%membranes%press)
    end if
    if (allocated(s%rigid%given)) call archive%put_reals('surfaces.given', s%rigid%given)
  end subroutine put_surfaces

  !> Images of candidates and contacts, where a cell has any.
  subroutine put_images(s, archive)
    type(dem_surfaces_type), intent(in) :: s
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('surfaces.image', s%list%image)
    call archive%put_reals('surfaces.offset', reshape(s%list%offset, &
                                                      [3*s%list%slots, s%list%near]))
  end subroutine put_images

  !> The same back.
  subroutine get_offsets(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: offset(:, :)
    integer(i4) :: g
    if (archive%find('surfaces.image') == 0) return
    call archive%get_reals('surfaces.offset', 3*s%list%slots, s%list%near, offset, errors)
    if (errors%any()) return
    do g = 1, s%list%near
      call set_offsets(s%list, g, reshape(offset(:, g), [s%list%slots, 3]))
    end do
  end subroutine get_offsets

  !> Radii of cylinders, and what presses on their walls.
  subroutine put_bores(s, archive)
    type(dem_surfaces_type), intent(in) :: s
    class(dem_archive_type), intent(inout) :: archive
    real(wp) :: rows(5, s%n)
    rows(1, :) = s%round%swell
    rows(2, :) = s%round%press
    rows(3, :) = s%round%press_impulse
    rows(4, :) = s%round%listed_radius
    rows(5, :) = s%round%start_radius
    call archive%put_reals('surfaces.bore', reshape([reshape(rows, [5*s%n]), s%round%radius], &
                           [6*s%n, 1]))
  end subroutine put_bores

  !> The same back.
  pure subroutine get_bores(s, values)
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), intent(in) :: values(:)
    real(wp) :: rows(5, s%n)
    integer(i4) :: b
    rows = reshape(values(:5*s%n), [5, s%n])
    do b = 1, s%n
      call set_swell(s, b, rows(1, b))
    end do
    call set_press(s, rows(2, :), rows(3, :))
    call set_radii(s, values(5*s%n + 1:), rows(4, :), rows(5, :))
  end subroutine get_bores

  !> History of additional contact models, each by its name, as in dem_additional_list.
  subroutine put_kept(s, places, archive)
    type(dem_surfaces_type), intent(in) :: s
    type(kept_places_type), intent(in) :: places
    class(dem_archive_type), intent(inout) :: archive
    integer(i4) :: k
    do k = 1, most_parts
      associate (part => places%part(k))
        if (part%at == 0 .or. .not. part%at_surfaces) cycle
        call archive%put_reals('surfaces.'//trim(part%name), &
                               reshape(s%list%kept(:, part%at:part%at + part%reals - 1, :), &
                                       [s%list%slots*part%reals, s%list%near]))
      end associate
    end do
    call archive%put_reals('surfaces.couple', reshape(s%list%couple, [s%list%slots*3, s%list%near]))
  end subroutine put_kept

  !> The same back; a law that the checkpoint does not have starts from nothing.
  subroutine get_kept(s, places, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(kept_places_type), intent(in) :: places
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: flat(:, :)
    real(wp) :: kept(s%list%slots, size(s%list%kept, 2), s%list%near)
    real(wp) :: couple(s%list%slots, 3, s%list%near)
    integer(i4) :: k

    if (size(s%list%kept) == 0) return
    kept = 0.0_wp
    couple = 0.0_wp
    do k = 1, most_parts
      associate (part => places%part(k))
        if (part%at == 0 .or. .not. part%at_surfaces) cycle
        if (archive%find('surfaces.'//trim(part%name)) == 0) cycle
        call archive%get_reals('surfaces.'//trim(part%name), s%list%slots*part%reals, &
                               s%list%near, flat, errors)
        if (errors%any()) return
        kept(:, part%at:part%at + part%reals - 1, :) = &
          reshape(flat, [s%list%slots, part%reals, s%list%near])
      end associate
    end do
    if (archive%find('surfaces.couple') > 0) then
      call archive%get_reals('surfaces.couple', s%list%slots*3, s%list%near, flat, errors)
      if (errors%any()) return
      couple = reshape(flat, [s%list%slots, 3, s%list%near])
    end if
    do k = 1, s%list%near
      call set_kept(s%list, k, kept(:, :, k), couple(:, :, k))
    end do
  end subroutine get_kept

  !> Soft bodies are not in the deck: name, material and triangles of each.
  subroutine put_soft(s, archive)
    type(dem_surfaces_type), intent(in) :: s
    class(dem_archive_type), intent(inout) :: archive
    character(len=:), allocatable :: number
    integer(i8) :: name(longest_name + 2, 1)
    integer(i4) :: b, k

    do b = 1, s%n
      if (s%kind(b) /= surface_soft) cycle
      number = str(b)
      name = 0
      do k = 1, min(len(s%name(b)%s), longest_name)
        name(k, 1) = iachar(s%name(b)%s(k:k))
      end do
      name(longest_name + 1:, 1) = [s%material(s%first_part(b)), b]
      call archive%put_integers('surfaces.name.'//number, name)
      call archive%put_reals('surfaces.rest.'//number, s%mesh%rest(:, s%first_vertex(b): &
                                                              s%first_vertex(b + 1) - 1))
      call archive%put_integers('surfaces.corner.'//number, &
        int(s%mesh%corner(:, s%first_triangle(b):s%first_triangle(b + 1) - 1), i8) &
        - s%first_vertex(b) + 1)
    end do
  end subroutine put_soft

  !> Soft bodies of a checkpoint, after those of the deck.
  subroutine make_soft(s, materials, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: materials
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    type(mesh_type) :: mesh
    integer(i8), allocatable :: name(:, :), corner(:, :)
    character(len=:), allocatable :: number, text
    integer(i4) :: k

    do
      number = str(s%n + 1)
      if (archive%find('surfaces.name.'//number) == 0) exit
      call archive%get_integers('surfaces.name.'//number, longest_name + 2, 1, name, errors, &
                                [0_i8, int(huge(1_i4), i8)])
      call archive%get_reals('surfaces.rest.'//number, 3, -1, mesh%x, errors)
      call archive%get_integers('surfaces.corner.'//number, 3, -1, corner, errors, &
                                [1_i8, size(mesh%x, 2, kind=i8)])
      if (any(name(:longest_name, 1) > 255) .or. name(longest_name + 1, 1) < 1 .or. &
          name(longest_name + 1, 1) > materials) &
        call archive%refuse('surfaces.name.'//number, 'has no name or no material', errors)
      if (errors%any()) return
      text = ''
      do k = 1, longest_name
        if (name(k, 1) > 0) text = text//achar(name(k, 1))
      end do
      mesh%name = text
      mesh%corner = int(corner, i4)
      call check_mesh(mesh, .false., errors)
      if (errors%any()) return
      call add_mesh(s, mesh, text, surface_soft, int(name(longest_name + 1, 1), i4), &
                    soft_smooth, [0.0_wp, 0.0_wp, 0.0_wp])
    end do
  end subroutine make_soft

  !> The same back; the deck has made the same surfaces.
  subroutine get_surfaces(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: sizes(:, :)
    integer(i4) :: before

    if (d%surfaces%n == 0 .and. archive%find('surfaces.size') == 0) return
    before = errors%count
    call make_soft(d%surfaces, size(d%materials, kind=i4), archive, errors)
    if (errors%count > before) return
    call archive%get_integers('surfaces.size', 5, 1, sizes, errors, [0_i8, int(huge(1_i4), i8)])
    if (errors%count > before) return
    associate (s => d%surfaces)
      if (any(sizes(:4, 1) /= [s%n, s%parts, s%mesh%vertices, s%mesh%triangles])) &
        call errors%add('I228', 'the checkpoint has '//str(sizes(1, 1))//' surfaces with '// &
                        str(sizes(4, 1))//' triangles, the deck has '//str(s%n)//' with '// &
                        str(s%mesh%triangles), 'checkpoint', &
                        'restart with the deck and the files that made it, or start from '// &
                        'the beginning')
      if (errors%count > before) return
      call get_moved(s, archive, errors)
      call get_bodies(s, archive, errors)
      if (errors%count > before) return
      if (allocated(s%membranes)) call get_membranes(s, archive, errors)
      if (errors%count == before) call get_contacts(s, int(sizes(5, 1), i4), d%grains%n, &
                                                    surface_kept_reals(d), archive, errors)
      if (errors%count == before) call get_kept(s, d%pairs%additional%kept_places_type, archive, &
                                                errors)
    end associate
  end subroutine get_surfaces

  !> What servos, cylinders and partners have made of the bodies.
  subroutine get_moved(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    if (archive%find('surfaces.servo') > 0) then
      call archive%get_reals('surfaces.servo', servo_size, s%n, rows, errors)
      call set_servos(s, rows)
    end if
    if (archive%find('surfaces.bore') > 0) then
      call archive%get_reals('surfaces.bore', 6*s%n, 1, rows, errors)
      call get_bores(s, rows(:, 1))
    end if
    if (archive%find('surfaces.given') > 0 .and. allocated(s%rigid%given)) then
      call archive%get_reals('surfaces.given', size(s%rigid%given, 1), size(s%rigid%given, 2), &
                             rows, errors)
      call set_loads(s, rows)
    end if
  end subroutine get_moved

  !> Pressure and stretch of membranes.
  subroutine get_membranes(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: rows(:, :)
    if (archive%find('surfaces.membranes') == 0) return
    call archive%get_reals('surfaces.membranes', s%n, 2, rows, errors)
    if (errors%any()) return
    call set_pressures(s, rows(:, 1))
    call set_stretches(s, rows(:, 2))
    call pull_membranes(s)
    ! the press is of the last step: the pressure may have changed since
    if (archive%find('surfaces.press') == 0) return
    call archive%get_reals('surfaces.press', 3, s%mesh%vertices, rows, errors)
    if (.not. errors%any()) call set_forces(s, rows)
  end subroutine get_membranes

  subroutine get_bodies(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: part(:, :)
    real(wp), allocatable :: bodies(:, :, :), turns(:, :, :), sums(:, :, :), vertices(:, :, :)

    call archive%get_reals('surfaces.body', 3*s%n, 4, part, errors)
    bodies = reshape(part, [3, s%n, 4])
    call archive%get_reals('surfaces.turn', 4*s%n, 2, part, errors)
    turns = reshape(part, [4, s%n, 2])
    call archive%get_reals('surfaces.axis', 3, s%n, part, errors)
    call set_places(s, bodies(:, :, 1), turns(:, :, 1), part)
    call set_velocities(s, bodies(:, :, 2), bodies(:, :, 3))
    call archive%get_reals('surfaces.sums', 3*s%parts, 4, part, errors)
    sums = reshape(part, [3, s%parts, 4])
    call archive%get_reals('surfaces.work', 1, s%parts, part, errors)
    call set_sums(s, sums, part(1, :))
    call archive%get_reals('surfaces.vertex', 3*s%mesh%vertices, 5, part, errors)
    vertices = reshape(part, [3, s%mesh%vertices, 5])
    call set_vertices(s, 1_i4, vertices(:, :, 1), vertices(:, :, 2))
    call set_reference(s, bodies(:, :, 4), turns(:, :, 2), vertices(:, :, 3))
    call set_vertex_loads(s, vertices(:, :, 4), vertices(:, :, 5))
  end subroutine get_bodies

  !> Grains rise, so do the places of their candidates, none of which is 0.
  subroutine check_near(s, grain, start, candidate, archive, errors)
    type(dem_surfaces_type), intent(in) :: s
    integer(i8), intent(in) :: grain(:), start(:), candidate(:)
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, near
    near = size(grain)
    if (any(grain(2:) <= grain(:near - 1))) &
      call archive%refuse('surfaces.near', 'names grains that do not rise', errors)
    if (any(start(2:) < start(:near)) .or. start(near + 1) /= size(candidate) + 1) &
      call archive%refuse('surfaces.start', 'does not rise to '//str(size(candidate) + 1), errors)
    do k = 1, size(candidate)
      if (candidate(k) > 0) cycle
      if (candidate(k) < 0) then
        if (is_round(s, int(-candidate(k), i4))) cycle
      end if
      call archive%refuse('surfaces.candidate', 'holds '//str(candidate(k))// &
                          ', neither a triangle nor a round body', errors)
      return
    end do
  end subroutine check_near

  subroutine get_contacts(s, near, grains, reals, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: near    !! grains with something near
    integer(i4), intent(in) :: grains
    integer(i4), intent(in) :: reals   !! kept for additional models
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: grain(:, :), start(:, :), candidate(:, :), number(:, :), part(:, :)
    real(wp), allocatable :: gap(:, :), load(:, :), share(:, :), sign(:, :), packed(:, :)
    real(wp), allocatable :: image(:, :)
    integer(i4) :: g

    if (near > grains) call archive%refuse('surfaces.size', 'has '//str(near)//' of '// &
                                           str(grains)//' grains', errors)
    if (errors%any()) return
    call archive%get_integers('surfaces.near', 1, near, grain, errors, [1_i8, int(grains, i8)])
    call archive%get_integers('surfaces.start', 1, near + 1, start, errors, &
                              [1_i8, int(huge(1_i4), i8)])
    call archive%get_integers('surfaces.candidate', 1, -1, candidate, errors, &
                              [-int(s%n, i8), int(s%mesh%triangles, i8)])
    call archive%get_reals('surfaces.gap', 1, near, gap, errors)
    if (errors%any()) return
    call check_near(s, grain(1, :), start(1, :), candidate(1, :), archive, errors)
    if (errors%any()) return
    allocate (image(3, size(candidate)), source=0.0_wp)
    if (archive%find('surfaces.image') > 0) &
      call archive%get_reals('surfaces.image', 3, size(candidate, kind=i4), image, errors)
    if (errors%any()) return
    call begin_list(s%list, int(grain(1, :), i4), int(start(1, :), i4), int(candidate(1, :), i4), &
                    image, gap(1, :))
    call allocate_contacts(s, grains, reals)
    call archive%get_integers('surfaces.contacts', 1, near, number, errors, &
                              [0_i8, int(s%list%slots, i8)])
    call archive%get_integers('surfaces.part', s%list%slots, near, part, errors, &
                              [0_i8, int(s%parts, i8)])
    allocate (sign(s%list%slots, near), source=1.0_wp)
    if (allocated(s%membranes)) &
      call archive%get_reals('surfaces.sign', s%list%slots, near, sign, errors)
    call archive%get_reals('surfaces.load', 6, near, load, errors)
    call archive%get_reals('surfaces.share', 3, size(s%list%share, 2), share, errors)
    call archive%get_reals('surfaces.contact', s%list%slots*contact_size, near, packed, errors)
    if (errors%any()) return
    call set_shares(s%list, share)
    if (any([(any(part(:int(number(1, g)), g) < 1), g=1, near)])) &
      call archive%refuse('surfaces.part', 'lacks the part of a contact', errors)
    if (errors%any()) return
    do g = 1, near
      call set_contacts(s%list, g, int(number(1, g), i4), int(part(:, g), i4), sign(:, g), &
                        load(:, g))
      call set_slots(s%list, g, reshape(packed(:, g), [s%list%slots, contact_size]))
    end do
    call get_offsets(s, archive, errors)
  end subroutine get_contacts
end module dem_surface_store
