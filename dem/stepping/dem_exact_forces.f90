!> What free grains do to bodies that a partner moves, in sums that do not depend on how the grains
!! are dealt out over ranks: forces and moments on ghosts, forces on vertices, and their impulses.
!!
!! Every rank adds the contacts of its own grains to exact sums (talus_exact_sums). After a block of
!! steps those of the ranks are added; the first rank holds what they give, the others nothing. One
!! process does the same, so that any number of ranks has its bits. eq. C.65, C.66
module dem_exact_forces
  use talus_kinds, only: wp, i4
  use talus_exact_sums, only: exact_sums_type, begin_sums, begin_step, touch, end_step, &
    add_term, add_last, exact_value
  use dem_kinds, only: gives_way
  use dem_state, only: dem_data_type, kind_ghost, result_size
  use dem_exact_state, only: dem_exact_type
  use dem_lanes, only: sum_results
  use dem_surface_forces, only: surface_load
  use dem_surface_state, only: dem_surfaces_type, surface_soft
  use dem_surface_values, only: set_sums, set_vertex_loads
  implicit none
  private
  public :: begin_exact, find_places, note_ghost, note_vertices, settle_exact, sum_anew

  integer(i4), parameter :: ghost_reals = 6  !! force and moment

contains

  !> A block of steps begins.
  subroutine begin_exact(d)
    type(dem_data_type), intent(inout) :: d
    call begin_for(d, d%grains%kind(:d%grains%n) == kind_ghost)
  end subroutine begin_exact

  !> Nothing has acted on marked grains and on vertices so far.
  subroutine begin_for(d, marked)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: marked(:)  !! (grains)
    integer(i4) :: i, soft
    soft = 0
    if (d%surfaces%n > 0) then
      if (any(d%surfaces%kind == surface_soft)) soft = d%surfaces%mesh%vertices
    end if
    call find_places(d, marked)
    call begin_sums(d%exact%grains, ghost_reals, int(count(marked), i4))
    call begin_sums(d%exact%vertices, 3_i4, soft)
    if (allocated(d%exact%grain_start)) deallocate (d%exact%grain_start)
    allocate (d%exact%grain_start(2*ghost_reals + 1, count(marked)))
    do i = 1, d%grains%n
      if (marked(i)) d%exact%grain_start(:, d%exact%place(i)) = [d%grains%force(:, i), &
        d%grains%moment(:, i), d%grains%impulse(:, i), d%grains%moment_impulse(:, i), &
        d%grains%work(i)]
    end do
    if (soft == 0) return
    d%exact%work_start = d%surfaces%sums%work
    d%exact%vertex_start = reshape([transpose(d%surfaces%mesh%force), &
                                    transpose(d%surfaces%mesh%impulse)], [6_i4, soft], order=[2, 1])
  end subroutine begin_for

  !> Columns of grains, whose numbers a new list may change.
  subroutine find_places(d, marked)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: marked(:)  !! (grains)
    integer(i4) :: i, n
    if (allocated(d%exact%place)) deallocate (d%exact%place)
    allocate (d%exact%place(size(marked)), source=0_i4)
    n = 0
    do i = 1, size(marked)
      if (.not. marked(i)) cycle
      n = n + 1
      d%exact%place(i) = n
    end do
  end subroutine find_places

  !> The contacts of grain i in this step.
  subroutine note_ghost(d, i)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp) :: total(result_size), load(ghost_reals)
    integer(i4) :: k
    logical :: touched
    touched = .false.
    associate (sums => d%exact%grains, j => d%exact%place(i), x => d%pairs%body(1:3, i))
      sums%last(:, :, j) = 0.0_wp
      do k = d%pairs%start(i), d%pairs%start(i + 1) - 1
        call sum_results(d%pairs%result, d%pairs%entry, k, k, total)
        if (all(abs(total(:ghost_reals)) <= 0.0_wp)) cycle  ! no contact
        touched = .true.
        load(1:3) = total(1:3)
        load(4) = total(4) - (x(2)*total(3) - x(3)*total(2))
        load(5) = total(5) - (x(3)*total(1) - x(1)*total(3))
        load(6) = total(6) - (x(1)*total(2) - x(2)*total(1))
        call add_term(load, sums%last(:, :, j))
      end do
      load = 0.0_wp
      if (d%surfaces%list%near > 0) load = surface_load(d%surfaces, i)
      if (any(abs(load) > 0.0_wp)) then
        touched = .true.
        call add_term(load, sums%last(:, :, j))
      end if
      if (touched) call add_last(sums, j)
    end associate
  end subroutine note_ghost

  !> The contacts of vertices that a partner moves in this step.
  subroutine note_vertices(s, sums)
    type(dem_surfaces_type), intent(in) :: s
    type(exact_sums_type), intent(inout) :: sums
    integer(i4) :: g, c, k
    if (.not. allocated(sums%last)) return
    if (size(sums%last) == 0) return
    call begin_step(sums)
    do g = 1, s%list%near
      if (s%list%contacts(g) == 0) cycle
      do c = s%list%near_start(g), s%list%near_start(g + 1) - 1
        if (s%list%candidate(c) <= 0) cycle
        if (s%kind(s%mesh%owner(s%list%candidate(c))) /= surface_soft) cycle
        do k = 1, 3
          call touch(sums, s%mesh%corner(k, s%list%candidate(c)), s%list%share(:, 3*(c - 1) + k))
        end do
      end do
    end do
    call end_step(sums)
  end subroutine note_vertices

  !> The sums of all ranks take the place of this rank's: forces at the end and, after steps, their
  !! integrals by the trapezoidal rule, and works, as what a partner moves has a constant velocity.
  !! Collective over all ranks.
  subroutine settle_exact(d, dt)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt  !! of the steps, 0: none were taken [s]
    integer(i4) :: i
    call add_ranks(d, d%exact%grains)
    call add_ranks(d, d%exact%vertices)
    do i = 1, d%grains%n
      if (d%exact%place(i) > 0) call settle_ghost(d, i, d%exact%place(i), dt)
    end do
    if (size(d%exact%vertices%last) > 0) call settle_vertices(d, dt)
    call begin_sums(d%exact%grains, ghost_reals, 0_i4)
    call begin_sums(d%exact%vertices, 3_i4, 0_i4)
  end subroutine settle_exact

  !> Digits of all ranks.
  subroutine add_ranks(d, sums)
    type(dem_data_type), intent(in) :: d
    type(exact_sums_type), intent(inout) :: sums
    real(wp), allocatable :: flat(:)
    if (size(sums%last) == 0 .or. .not. d%halo%team%several()) return
    flat = [sums%all, sums%last]
    call d%halo%team%add_up(flat)
    sums%all = reshape(flat(:size(sums%all)), shape(sums%all))
    sums%last = reshape(flat(size(sums%all) + 1:), shape(sums%last))
  end subroutine add_ranks

  subroutine settle_ghost(d, i, column, dt)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i, column
    real(wp), intent(in) :: dt
    real(wp) :: load(ghost_reals), integral(ghost_reals), start(2*ghost_reals + 1)
    real(wp) :: work
    integer(i4) :: k
    start = d%exact%grain_start(:, column)
    do k = 1, ghost_reals
      load(k) = exact_value(d%exact%grains%last(:, k, column))
      integral(k) = integral_of(start(k), exact_value(d%exact%grains%all(:, k, column)), load(k), &
                                dt)
    end do
    work = start(2*ghost_reals + 1) - dot_product(integral, [d%grains%v(:, i), &
                                                             d%grains%omega(:, i)])
    integral = start(ghost_reals + 1:2*ghost_reals) + integral
    if (.not. holds_sums(d)) then
      load = 0.0_wp
      integral = 0.0_wp
      work = 0.0_wp
    end if
    d%grains%force(:, i) = load(1:3)
    d%grains%moment(:, i) = load(4:6)
    if (.not. dt > 0.0_wp) return
    d%grains%impulse(:, i) = integral(1:3)
    d%grains%moment_impulse(:, i) = integral(4:6)
    d%grains%work(i) = work
  end subroutine settle_ghost

  !> Vertices of soft bodies; those of membranes stay as they are.
  subroutine settle_vertices(d, dt)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: dt
    real(wp) :: force(3, d%surfaces%mesh%vertices), impulse(3, d%surfaces%mesh%vertices)
    real(wp) :: work(d%surfaces%parts)
    integer(i4) :: b, v
    associate (s => d%surfaces)
      force = s%mesh%force
      impulse = s%mesh%impulse
      work = s%sums%work
      do b = 1, s%n
        if (s%kind(b) /= surface_soft) cycle
        work(s%first_part(b)) = d%exact%work_start(s%first_part(b))
        do v = s%first_vertex(b), s%first_vertex(b + 1) - 1
          call settle_vertex(d%exact, v, dt, force(:, v), impulse(:, v))
          work(s%first_part(b)) = work(s%first_part(b)) &
            - dot_product(impulse(:, v) - d%exact%vertex_start(4:6, v), s%mesh%v(:, v))
        end do
        if (holds_sums(d)) cycle
        force(:, s%first_vertex(b):s%first_vertex(b + 1) - 1) = 0.0_wp
        impulse(:, s%first_vertex(b):s%first_vertex(b + 1) - 1) = 0.0_wp
        work(s%first_part(b)) = 0.0_wp
      end do
      call set_vertex_loads(s, force, merge(impulse, s%mesh%impulse, dt > 0.0_wp))
      if (dt > 0.0_wp) call set_sums(s, reshape([s%sums%force, s%sums%moment, s%sums%impulse, &
        s%sums%moment_impulse], [3_i4, s%parts, 4_i4]), work)
    end associate
  end subroutine settle_vertices

  pure subroutine settle_vertex(exact, v, dt, force, impulse)
    type(dem_exact_type), intent(in) :: exact
    integer(i4), intent(in) :: v
    real(wp), intent(in) :: dt
    real(wp), intent(out) :: force(3), impulse(3)
    integer(i4) :: k
    do k = 1, 3
      force(k) = exact_value(exact%vertices%last(:, k, v))
      impulse(k) = exact%vertex_start(3 + k, v) &
        + integral_of(exact%vertex_start(k, v), exact_value(exact%vertices%all(:, k, v)), &
                      force(k), dt)
    end do
  end subroutine settle_vertex

  !> Trapezoidal rule over steps of dt: half of the first and of the last value, all between.
  pure real(wp) function integral_of(first, all, last, dt) result(integral)
    real(wp), intent(in) :: first  !! before the first step
    real(wp), intent(in) :: all    !! sum of those after each step
    real(wp), intent(in) :: last   !! after the last step
    real(wp), intent(in) :: dt
    integral = dt*(0.5_wp*(first - last) + all)
  end function integral_of

  !> Is it this rank that has the sums of all?
  pure logical function holds_sums(d)
    type(dem_data_type), intent(in) :: d
    holds_sums = d%halo%team%rank == 0
  end function holds_sums

  !> Forces and moments on all prescribed grains and vertices from the contacts as they are, which
  !! were evaluated without steps. Collective over all ranks. In a cell sums stay as they are.
  subroutine sum_anew(d)
    type(dem_data_type), intent(inout) :: d
    integer(i4) :: i
    if (d%cell%active) return
    call begin_for(d, .not. gives_way(d%grains%kind(:d%grains%n)))
    do i = 1, d%grains%n
      if (d%exact%place(i) > 0) call note_ghost(d, i)
    end do
    call note_vertices(d%surfaces, d%exact%vertices)
    call settle_exact(d, 0.0_wp)
  end subroutine sum_anew
end module dem_exact_forces
