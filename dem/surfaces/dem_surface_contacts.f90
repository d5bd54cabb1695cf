!> The contacts of grains with surfaces: room for them, what a step keeps of them, their way from
!! one list to the next, and back from records of ranks and checkpoints. Other modules read them;
!! forces on corners (share) and loads are those of dem_surface_forces.
module dem_surface_contacts
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_additional_numbers, only: additional_work_count
  use dem_block, only: dem_block_type
  use dem_record_layout, only: slot_history, slot_foot, slot_normal, slot_point, slot_push, &
    slot_motion
  use dem_state, only: lanes, history_size, history_point, column_count
  use dem_surface_feature, only: touches_type, most_features
  use dem_surface_state, only: dem_surfaces_type, dem_touches_type
  implicit none
  private
  public :: begin_list, allocate_contacts, keep_contacts, take_contacts, drop_contacts
  public :: leave_grain, keep_touches, keep_more, keep_block, set_loads
  public :: set_contacts, set_slots, set_offsets, set_kept, set_shares

contains

  !> What is near which grain, without contacts yet.
  pure subroutine begin_list(list, grain, start, candidate, image, gap)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: grain(:)      !! (near) ascending
    integer(i4), intent(in) :: start(:)      !! (near+1)
    integer(i4), intent(in) :: candidate(:)  !! see dem_touches_type
    real(wp), intent(in) :: image(:, :)      !! (3, candidates) [m]
    real(wp), intent(in) :: gap(:)           !! (near) [m]
    list%near = size(grain)
    list%near_grain = grain
    list%near_start = start
    list%candidate = candidate
    list%image = image
    list%least_gap = gap
  end subroutine begin_list

  !> Room for the contacts of the grains of a list; none of them has any.
  subroutine allocate_contacts(s, grains, reals)
    type(dem_surfaces_type), intent(inout) :: s
    integer(i4), intent(in) :: grains
    integer(i4), intent(in) :: reals  !! kept for additional contact models
    integer(i4) :: g, some
    s%list%slots = merge(most_features, lanes, allocated(s%membranes))
    some = merge(s%list%near, 0_i4, reals > 0)
    associate (n => s%list%slots)
      allocate (s%list%kept(n, reals, some), s%list%couple(n, 3, some), &
                s%list%additional_work(additional_work_count, some), source=0.0_wp)
      allocate (s%list%contacts(s%list%near), s%list%part(n, s%list%near), source=0)
      allocate (s%list%sign(n, s%list%near), source=1.0_wp)
      allocate (s%list%history(n, history_size, s%list%near), s%list%foot(n, 3, s%list%near), &
                s%list%normal(n, 3, s%list%near), s%list%point(n, 3, s%list%near), &
                s%list%push(n, 3, s%list%near), s%list%motion(n, 6, s%list%near), &
                s%list%offset(n, 3, s%list%near), &
                s%list%load(6, s%list%near), s%list%columns(column_count, s%list%near), &
                source=0.0_wp)
    end associate
    allocate (s%list%share(3, merge(3*ubound(s%list%candidate, 1), 0, s%soft)), source=0.0_wp)
    allocate (s%list%near_of(grains), source=0)
    do g = 1, s%list%near
      s%list%near_of(s%list%near_grain(g)) = g
    end do
  end subroutine allocate_contacts

  !> Contacts of the last list, out of the way.
  subroutine keep_contacts(list, old)
    type(dem_touches_type), intent(inout) :: list
    type(dem_touches_type), intent(inout) :: old
    old%near = 0
    if (.not. allocated(list%contacts)) return
    old%near = list%near
    call move_alloc(list%near_grain, old%near_grain)
    call move_alloc(list%contacts, old%contacts)
    call move_alloc(list%history, old%history)
    call move_alloc(list%foot, old%foot)
    call move_alloc(list%normal, old%normal)
    call move_alloc(list%point, old%point)
    call move_alloc(list%push, old%push)
    call move_alloc(list%motion, old%motion)
    call move_alloc(list%offset, old%offset)
    call move_alloc(list%part, old%part)
    call move_alloc(list%sign, old%sign)
    call move_alloc(list%load, old%load)
    call move_alloc(list%kept, old%kept)
    call move_alloc(list%couple, old%couple)
    deallocate (list%additional_work, list%columns, list%share, list%near_of)
  end subroutine keep_contacts

  !> Contacts follow their grains into the new list; both ascend.
  pure subroutine take_contacts(list, old)
    type(dem_touches_type), intent(inout) :: list
    type(dem_touches_type), intent(in) :: old
    integer(i4) :: g, k
    do k = 1, old%near
      g = list%near_of(old%near_grain(k))
      if (g == 0) cycle
      list%contacts(g) = old%contacts(k)
      list%history(:, :, g) = old%history(:, :, k)
      list%foot(:, :, g) = old%foot(:, :, k)
      list%normal(:, :, g) = old%normal(:, :, k)
      list%point(:, :, g) = old%point(:, :, k)
      list%push(:, :, g) = old%push(:, :, k)
      list%motion(:, :, g) = old%motion(:, :, k)
      list%offset(:, :, g) = old%offset(:, :, k)
      list%part(:, g) = old%part(:, k)
      list%sign(:, g) = old%sign(:, k)
      list%load(:, g) = old%load(:, k)
      if (size(list%kept) == 0 .or. size(old%kept, 2) /= size(list%kept, 2)) cycle
      list%kept(:, :, g) = old%kept(:, :, k)
      list%couple(:, :, g) = old%couple(:, :, k)
    end do
  end subroutine take_contacts

  !> No contacts, and no room for any.
  pure subroutine drop_contacts(list)
    type(dem_touches_type), intent(inout) :: list
    type(dem_touches_type) :: none
    if (allocated(list%contacts)) list = none
  end subroutine drop_contacts

  !> Near grain g has no contacts.
  pure subroutine leave_grain(list, g)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g
    list%contacts(g) = 0
    list%load(:, g) = 0.0_wp
    list%columns(:, g) = 0.0_wp
    if (size(list%kept) > 0) list%additional_work(:, g) = 0.0_wp
  end subroutine leave_grain

  !> Current contacts for the next step.
  pure subroutine keep_touches(list, g, touches, block, history)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g
    type(touches_type), intent(in) :: touches
    type(dem_block_type), intent(in) :: block
    real(wp), intent(in) :: history(lanes, history_size)
    integer(i4) :: k
    list%contacts(g) = touches%n
    list%history(:, :, g) = history
    do k = 1, touches%n
      list%foot(k, :, g) = touches%foot(:, k)
      list%normal(k, :, g) = touches%normal(:, k)
      list%point(k, :, g) = touches%foot(:, k) + history(k, history_point:history_point + 2)
      list%motion(k, :, g) = touches%motion(:, k)
      list%offset(k, :, g) = touches%offset(:, k)
      list%part(k, g) = touches%part(k)
      list%push(k, :, g) = [block%load%fx(k), block%load%fy(k), block%load%fz(k)]
    end do
  end subroutine keep_touches

  !> What additional models keep, their works, and the couples that they add to the forces.
  pure subroutine keep_more(list, g, n, block, kept, work)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g, n
    type(dem_block_type), intent(in) :: block
    real(wp), intent(in) :: kept(:, :), work(:)
    integer(i4) :: k
    list%kept(:, :, g) = kept
    list%additional_work(:, g) = work
    do k = 1, n
      list%couple(k, :, g) = [block%load%mx(k), block%load%my(k), block%load%mz(k)] &
                          - cross(list%point(k, :, g), list%push(k, :, g))
    end do
  end subroutine keep_more

  !> Contacts low+1 to low+many of near grain g, of a block that began with low.
  pure subroutine keep_block(list, g, low, many, touches, block, history)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g, low, many
    type(touches_type), intent(in) :: touches
    type(dem_block_type), intent(in) :: block
    real(wp), intent(in) :: history(lanes, history_size)
    integer(i4) :: k
    list%history(low + 1:low + lanes, :, g) = history
    do k = 1, many
      list%foot(low + k, :, g) = touches%foot(:, low + k)
      list%normal(low + k, :, g) = touches%normal(:, low + k)
      list%point(low + k, :, g) = touches%foot(:, low + k) &
        + history(k, history_point:history_point + 2)
      list%motion(low + k, :, g) = touches%motion(:, low + k)
      list%offset(low + k, :, g) = touches%offset(:, low + k)
      list%part(low + k, g) = touches%part(low + k)
      list%sign(low + k, g) = touches%sign(low + k)
      list%push(low + k, :, g) = [block%load%fx(k), block%load%fy(k), block%load%fz(k)]
    end do
  end subroutine keep_block

  !> Number of contacts of near grain g, their load and works of a step.
  pure subroutine set_loads(list, g, number, load, columns)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g, number
    real(wp), intent(in) :: load(6)                !! about the centre [N], [N m]
    real(wp), intent(in) :: columns(column_count)  !! [J]
    list%contacts(g) = number
    list%load(:, g) = load
    list%columns(:, g) = columns
  end subroutine set_loads

  !> Number, parts and signs of the contacts of near grain g, and its load.
  pure subroutine set_contacts(list, g, number, part, sign, load)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g, number
    integer(i4), intent(in) :: part(:)  !! (slots or fewer)
    real(wp), intent(in) :: sign(:)     !! the same
    real(wp), intent(in) :: load(6)     !! about the centre [N], [N m]
    list%contacts(g) = number
    list%part(:size(part), g) = part
    list%sign(:size(sign), g) = sign
    list%load(:, g) = load
  end subroutine set_contacts

  !> The first slots of near grain g from columns, see dem_record_layout.
  pure subroutine set_slots(list, g, slot)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: slot(:, :)  !! (slots or fewer, columns up to the motion or more)
    integer(i4) :: n
    n = size(slot, 1)
    list%history(:n, :, g) = slot(:, slot_history(1):slot_history(2))
    list%foot(:n, :, g) = slot(:, slot_foot(1):slot_foot(2))
    list%normal(:n, :, g) = slot(:, slot_normal(1):slot_normal(2))
    list%point(:n, :, g) = slot(:, slot_point(1):slot_point(2))
    list%push(:n, :, g) = slot(:, slot_push(1):slot_push(2))
    list%motion(:n, :, g) = slot(:, slot_motion(1):slot_motion(2))
  end subroutine set_slots

  !> From the surfaces to the images that near grain g touches in its first slots.
  pure subroutine set_offsets(list, g, offset)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: offset(:, :)  !! (slots or fewer, 3) [m]
    list%offset(:size(offset, 1), :, g) = offset
  end subroutine set_offsets

  !> What additional models keep of the first slots of near grain g, and their couples.
  pure subroutine set_kept(list, g, kept, couple)
    type(dem_touches_type), intent(inout) :: list
    integer(i4), intent(in) :: g
    real(wp), intent(in) :: kept(:, :)    !! (slots or fewer, reals)
    real(wp), intent(in) :: couple(:, :)  !! (slots or fewer, 3) [N m]
    list%kept(:size(kept, 1), :, g) = kept
    list%couple(:size(couple, 1), :, g) = couple
  end subroutine set_kept

  !> Forces on the corners of the candidates.
  pure subroutine set_shares(list, share)
    type(dem_touches_type), intent(inout) :: list
    real(wp), intent(in) :: share(:, :)  !! (3, 3*candidates) [N]
    list%share = share
  end subroutine set_shares
end module dem_surface_contacts
