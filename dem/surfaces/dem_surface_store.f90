!> Surfaces on their way to and from a checkpoint, bit for bit: motion, sums, the list of what is
!! near
!! and the contacts in hand.
module dem_surface_store
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_data_type, lanes, history_size, column_count
  use dem_additional_state, only: extra_places_type, extra_work_count, most_parts, part_bond
  use dem_surface_additional, only: surface_kept_reals
  use dem_surface_state, only: dem_surfaces_type, surface_soft, surface_cylinder, &
    soft_smooth
  use dem_membrane, only: pull_membranes
  use dem_surface_feature, only: most_features
  use dem_surface_make, only: mesh_type, check_mesh, add_mesh
  implicit none
  private
  public :: put_surfaces, get_surfaces

  integer(i4), parameter :: longest_name = 48
  integer(i4), parameter :: contact_size = history_size + 18  !! reals of a contact

contains

  !> Everything that changes in a run.
  subroutine put_surfaces(s, places, archive)
    type(dem_surfaces_type), intent(in) :: s
    type(extra_places_type), intent(in) :: places
    type(dem_archive_type), intent(inout) :: archive
    real(wp) :: packed(s%slots*contact_size, s%near)
    integer(i4) :: g

    call archive%put_integers('surfaces.size', &
                              int(reshape([s%n, s%parts, s%vertices, s%triangles, s%near], [5, &
                                1]), i8))
    call archive%put_reals('surfaces.body', reshape([s%centre, s%velocity, s%spin, s%reference_x], &
                                                    [3*s%n, 4]))
    call archive%put_reals('surfaces.turn', reshape([s%quat, s%reference_q], [4*s%n, 2]))
    call archive%put_reals('surfaces.axis', s%axis)
    call archive%put_reals('surfaces.sums', reshape([s%force, s%moment, s%impulse, &
                                                     s%moment_impulse], [3*s%parts, 4]))
    call archive%put_reals('surfaces.work', reshape(s%work, [1, s%parts]))
    call archive%put_reals('surfaces.vertex', reshape([s%x, s%v, s%reference, s%vertex_force, &
                                                       s%vertex_impulse], [3*s%vertices, 5]))
    call archive%put_integers('surfaces.near', int(reshape(s%near_grain, [1, s%near]), i8))
    call archive%put_integers('surfaces.start', int(reshape(s%near_start, [1, s%near + 1]), i8))
    call archive%put_integers('surfaces.candidate', int(reshape(s%candidate, &
                                                                [1, size(s%candidate)]), i8))
    call archive%put_integers('surfaces.contacts', int(reshape(s%contacts, [1, s%near]), i8))
    call archive%put_integers('surfaces.part', int(s%part, i8))
    call archive%put_reals('surfaces.gap', reshape(s%least_gap, [1, s%near]))
    call archive%put_reals('surfaces.load', s%load)
    call archive%put_reals('surfaces.share', s%share)
    do g = 1, s%near
      packed(:, g) = [s%history(:, :, g), s%foot(:, :, g), s%normal(:, :, g), s%point(:, :, g), &
                      s%push(:, :, g), s%motion(:, :, g)]
    end do
    call archive%put_reals('surfaces.contact', packed)
    if (s%soft) call put_soft(s, archive)
    if (size(s%kept) > 0) call put_kept(s, places, archive)
    if (allocated(s%servo)) call archive%put_reals('surfaces.servo', s%servo)
    if (any(s%kind == surface_cylinder)) &
      call archive%put_reals('surfaces.bore', reshape([reshape(s%bore, [5*s%n]), s%cone(3, :)], &
                                                      [6*s%n, 1]))
    if (allocated(s%membranes)) then
      call archive%put_reals('surfaces.membranes', &
                             reshape([s%membranes%pressure, s%membranes%stretch], [s%n, 2]))
      call archive%put_reals('surfaces.sign', s%sign)
      call archive%put_reals('surfaces.press', s%membranes%press)
    end if
    if (allocated(s%given)) call archive%put_reals('surfaces.given', s%given)
  end subroutine put_surfaces

  !> What contacts keep for laws on top, each law by its name, as dem_additional_list does.
  subroutine put_kept(s, places, archive)
    type(dem_surfaces_type), intent(in) :: s
    type(extra_places_type), intent(in) :: places
    type(dem_archive_type), intent(inout) :: archive
    integer(i4) :: k
    do k = 1, most_parts
      if (k == part_bond) cycle
      associate (part => places%part(k))
        if (part%at > 0) call archive%put_reals('surfaces.'//trim(part%name), reshape( &
          s%kept(:, part%at:part%at + part%reals - 1, :), [s%slots*part%reals, s%near]))
      end associate
    end do
    call archive%put_reals('surfaces.couple', reshape(s%couple, [s%slots*3, s%near]))
  end subroutine put_kept

  !> The same back; a law that the checkpoint does not have starts from nothing.
  subroutine get_kept(s, places, reals, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(extra_places_type), intent(in) :: places
    integer(i4), intent(in) :: reals
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: flat(:, :)
    integer(i4) :: k, some

    some = merge(s%near, 0_i4, reals > 0)
    allocate (s%kept(s%slots, reals, some), s%couple(s%slots, 3, some), &
              s%extra_work(extra_work_count, some), source=0.0_wp)
    if (some == 0) return
    do k = 1, most_parts
      if (k == part_bond) cycle
      associate (part => places%part(k))
        if (part%at == 0) cycle
        if (archive%find('surfaces.'//trim(part%name)) == 0) cycle
        call archive%get_reals('surfaces.'//trim(part%name), s%slots*part%reals, s%near, flat, &
                               errors)
        if (errors%any()) return
        s%kept(:, part%at:part%at + part%reals - 1, :) = &
          reshape(flat, [s%slots, part%reals, s%near])
      end associate
    end do
    if (archive%find('surfaces.couple') == 0) return
    call archive%get_reals('surfaces.couple', s%slots*3, s%near, flat, errors)
    if (.not. errors%any()) s%couple = reshape(flat, [s%slots, 3, s%near])
  end subroutine get_kept

  !> Soft bodies are not in the deck: name, material and triangles of each.
  subroutine put_soft(s, archive)
    type(dem_surfaces_type), intent(in) :: s
    type(dem_archive_type), intent(inout) :: archive
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
      call archive%put_reals('surfaces.rest.'//number, s%rest(:, s%first_vertex(b): &
                                                              s%first_vertex(b + 1) - 1))
      call archive%put_integers('surfaces.corner.'//number, &
        int(s%corner(:, s%first_triangle(b):s%first_triangle(b + 1) - 1), i8) &
        - s%first_vertex(b) + 1)
    end do
  end subroutine put_soft

  !> Soft bodies of a checkpoint, after those of the deck.
  subroutine make_soft(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    type(mesh_type) :: mesh
    integer(i8), allocatable :: name(:, :), corner(:, :)
    character(len=:), allocatable :: number, text
    integer(i4) :: k

    do
      number = str(s%n + 1)
      if (archive%find('surfaces.name.'//number) == 0) exit
      call archive%get_integers('surfaces.name.'//number, longest_name + 2, 1, name, errors)
      call archive%get_reals('surfaces.rest.'//number, 3, -1, mesh%x, errors)
      call archive%get_integers('surfaces.corner.'//number, 3, -1, corner, errors)
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
    integer(i4) :: before, k

    if (d%surfaces%n == 0 .and. archive%find('surfaces.size') == 0) return
    before = errors%count
    call make_soft(d%surfaces, archive, errors)
    if (errors%count > before) return
    call archive%get_integers('surfaces.size', 5, 1, sizes, errors)
    associate (s => d%surfaces)
      if (any(sizes(:4, 1) /= [s%n, s%parts, s%vertices, s%triangles])) &
        call errors%add('I228', 'the checkpoint has '//str(sizes(1, 1))//' surfaces with '// &
                        str(sizes(4, 1))//' triangles, the deck has '//str(s%n)//' with '// &
                        str(s%triangles), 'checkpoint', &
                        'restart with the deck and the files that made it, or start anew')
      if (errors%count > before) return
      s%near = int(sizes(5, 1), i4)
      k = archive%find('surfaces.servo')
      if (k > 0) s%servo = archive%item(k)%reals
      k = archive%find('surfaces.bore')
      if (k > 0) then
        s%bore = reshape(archive%item(k)%reals(:5*s%n, 1), [5, s%n])
        s%cone(3, :) = archive%item(k)%reals(5*s%n + 1:, 1)
      end if
      k = archive%find('surfaces.given')
      if (k > 0 .and. allocated(s%given)) s%given = archive%item(k)%reals
      call get_bodies(s, archive, errors)
      k = archive%find('surfaces.membranes')
      if (k > 0 .and. allocated(s%membranes)) then
        s%membranes%pressure = archive%item(k)%reals(:, 1)
        s%membranes%stretch = archive%item(k)%reals(:, 2)
        call pull_membranes(s)
        k = archive%find('surfaces.press')  ! of the last step; the pressure may have changed since
        if (k > 0) s%membranes%press = archive%item(k)%reals
      end if
      if (errors%count == before) call get_contacts(s, d%grains%n, archive, errors)
      if (errors%count == before) call get_kept(s, d%pairs%extras%extra_places_type, &
                                                surface_kept_reals(d), archive, errors)
    end associate
  end subroutine get_surfaces

  subroutine get_bodies(s, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: part(:, :)

    call archive%get_reals('surfaces.body', 3*s%n, 4, part, errors)
    s%centre = reshape(part(:, 1), [3, s%n])
    s%velocity = reshape(part(:, 2), [3, s%n])
    s%spin = reshape(part(:, 3), [3, s%n])
    s%reference_x = reshape(part(:, 4), [3, s%n])
    call archive%get_reals('surfaces.turn', 4*s%n, 2, part, errors)
    s%quat = reshape(part(:, 1), [4, s%n])
    s%reference_q = reshape(part(:, 2), [4, s%n])
    call archive%get_reals('surfaces.axis', 3, s%n, part, errors)
    s%axis = part
    call archive%get_reals('surfaces.sums', 3*s%parts, 4, part, errors)
    s%force = reshape(part(:, 1), [3, s%parts])
    s%moment = reshape(part(:, 2), [3, s%parts])
    s%impulse = reshape(part(:, 3), [3, s%parts])
    s%moment_impulse = reshape(part(:, 4), [3, s%parts])
    call archive%get_reals('surfaces.work', 1, s%parts, part, errors)
    s%work = part(1, :)
    call archive%get_reals('surfaces.vertex', 3*s%vertices, 5, part, errors)
    s%x = reshape(part(:, 1), [3, s%vertices])
    s%v = reshape(part(:, 2), [3, s%vertices])
    s%reference = reshape(part(:, 3), [3, s%vertices])
    s%vertex_force = reshape(part(:, 4), [3, s%vertices])
    s%vertex_impulse = reshape(part(:, 5), [3, s%vertices])
    s%target = s%x
    s%has_target = .false.
  end subroutine get_bodies

  subroutine get_contacts(s, grains, archive, errors)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: grains
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :)
    real(wp), allocatable :: packed(:, :)
    integer(i4) :: g

    call archive%get_integers('surfaces.near', 1, s%near, counts, errors)
    s%near_grain = int(counts(1, :), i4)
    call archive%get_integers('surfaces.start', 1, s%near + 1, counts, errors)
    s%near_start = int(counts(1, :), i4)
    call archive%get_integers('surfaces.candidate', 1, -1, counts, errors)
    s%candidate = int(counts(1, :), i4)
    call archive%get_integers('surfaces.contacts', 1, s%near, counts, errors)
    s%contacts = int(counts(1, :), i4)
    s%slots = merge(most_features, lanes, allocated(s%membranes))
    call archive%get_integers('surfaces.part', s%slots, s%near, counts, errors)
    s%part = int(counts, i4)
    allocate (s%sign(s%slots, s%near), source=1.0_wp)
    if (allocated(s%membranes)) then
      call archive%get_reals('surfaces.sign', s%slots, s%near, packed, errors)
      s%sign = packed
    end if
    call archive%get_reals('surfaces.gap', 1, s%near, packed, errors)
    s%least_gap = packed(1, :)
    call archive%get_reals('surfaces.load', 6, s%near, packed, errors)
    s%load = packed
    call archive%get_reals('surfaces.share', 3, -1, packed, errors)
    s%share = packed
    call archive%get_reals('surfaces.contact', s%slots*contact_size, s%near, packed, errors)
    associate (n => s%slots)
      allocate (s%history(n, history_size, s%near), s%foot(n, 3, s%near), s%normal(n, 3, s%near), &
                s%point(n, 3, s%near), s%push(n, 3, s%near), s%motion(n, 6, s%near), &
                s%columns(column_count, s%near))
    end associate
    s%columns = 0.0_wp
    allocate (s%near_of(grains), source=0)
    do g = 1, s%near
      s%near_of(s%near_grain(g)) = g
      call unpack_contact(s, g, reshape(packed(:, g), [s%slots, contact_size]))
    end do
  end subroutine get_contacts

  pure subroutine unpack_contact(s, g, row)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: row(:, :)
    s%history(:, :, g) = row(:, :history_size)
    s%foot(:, :, g) = row(:, history_size + 1:history_size + 3)
    s%normal(:, :, g) = row(:, history_size + 4:history_size + 6)
    s%point(:, :, g) = row(:, history_size + 7:history_size + 9)
    s%push(:, :, g) = row(:, history_size + 10:history_size + 12)
    s%motion(:, :, g) = row(:, history_size + 13:history_size + 18)
  end subroutine unpack_contact
end module dem_surface_store
