!> Places of nodes that had no continuum and get some, where elements close behind a body
!! (theory-overlap, Closing).
!!
!! Nodes of the free surface go where the grains end now, what the deck of the solid holds stays,
!! and all others are the mean of their neighbours. eq. C.24. Faults D460, N464, I404.
module cpl_rebirth
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_log, only: short_number
  use talus_message, only: verb_set
  use talus_port_names, only: can_places, field_node, field_what, field_x, what_places
  use talus_text, only: str
  use talus_timers, only: timers_type
  use cpl_cells, only: cells_type
  use cpl_hull, only: outer_faces
  use cpl_overlap_carry, only: carried_type
  use cpl_sets, only: pack_type, part_none
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: rebirth_type

  integer(i4), parameter :: free = 0            !! kind at the port
  integer(i4), parameter :: sweeps = 400        !! at most
  real(wp), parameter :: settled = 1.0e-8_wp    !! change of a sweep, of an element's size
  real(wp), parameter :: around = 0.6_wp        !! grains that tell the height, of that size
  real(wp), parameter :: cover = 0.6_wp         !! share of a disc that the uppermost of them cover
  real(wp), parameter :: upright = 0.7_wp       !! least cosine of a free surface with the vertical
  real(wp), parameter :: thinnest = 0.2_wp      !! of its volume that an element may be born with
  real(wp), parameter :: far = 1.0e6_wp         !! [m] where no node is

  type :: rebirth_type
    type(cells_type) :: cells                !! of the deck, at rest
    real(wp), allocatable :: x(:, :)         !! of the nodes at rest, from now on (3, n) [m]
    logical, allocatable :: fresh(:)         !! (nodes) have got continuum
  contains
    procedure :: begin
    procedure :: place
    procedure :: put => put_places
    procedure :: get => get_places
    procedure, private :: find
    procedure, private :: check
    procedure, private :: send
  end type rebirth_type

contains

  !> D460: a solid whose nodes cannot be put elsewhere. After a restart they are.
  subroutine begin(self, solid, timers, errors)
    class(rebirth_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    if (.not. solid%can(can_places)) then
      call errors%add('D460', 'elements cannot close in '//solid%title(), solid%deck, &
        'leave close_behind out of &adapt, or take a solver with the capability '// &
        "'"//can_places//"'")
      return
    end if
    call self%send(solid, any(abs(self%x - self%cells%x) > 0.0_wp, 1), timers, errors)
  end subroutine begin

  !> At a conversion: new nodes are put where the grains around them are.
  subroutine place(self, solid, part, pack_of, carried, timers, errors)
    class(rebirth_type), intent(inout) :: self
    type(cpl_solver_type), intent(inout) :: solid
    integer(i4), intent(in) :: part(:)          !! of the elements, from now on
    type(pack_type), intent(in) :: pack_of      !! as it is now
    type(carried_type), intent(inout) :: carried
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call self%find(part, solid%gravity, pack_of, carried)
    call self%check(part, self%x + carried%u, solid%time, errors)
    if (.not. errors%any()) call self%send(solid, self%fresh, timers, errors)
  end subroutine place

  !> SET places of some nodes of the solid, if there are any.
  subroutine send(self, solid, chosen, timers, errors)
    class(rebirth_type), intent(in) :: self
    type(cpl_solver_type), intent(inout) :: solid
    logical, intent(in) :: chosen(:)  !! (nodes)
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: node(:)
    integer(i4) :: a
    if (.not. any(chosen)) return
    node = pack([(a, a=1, size(chosen))], chosen)
    call solid%start_request(verb_set, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_places)
    call solid%request%put_int(field_node, node)
    call solid%request%put(field_x, self%x(:, node))
    call solid%ask(timers, errors)
  end subroutine send

  !> N464: an element would have hardly any volume.
  subroutine check(self, part, x, time, errors)
    class(rebirth_type), intent(in) :: self
    integer(i4), intent(in) :: part(:)
    real(wp), intent(in) :: x(:, :)  !! of the nodes (3, n) [m]
    real(wp), intent(in) :: time     !! [s]
    type(error_list_type), intent(inout) :: errors
    type(cells_type) :: placed
    real(wp) :: share
    integer(i4) :: e

    if (.not. any(self%fresh)) return
    call self%cells%place(x, placed)
    do e = 1, placed%elements
      if (part(e) == part_none .or. .not. any(self%fresh(placed%nodes_of(e)))) cycle
      share = placed%volume(e)/self%cells%volume(e)
      if (share > thinnest) cycle
      call errors%add('N464', 'element '//str(e)//' would be born again with '// &
        short_number(share)//' of its volume', 'conversion at '//str(time)//' s', &
        'the body has left a hollow there: close elements farther behind it, or leave them open')
      return
    end do
  end subroutine check

  !> Where new nodes are at rest, their displacements and velocities.
  subroutine find(self, part, gravity, pack_of, carried)
    class(rebirth_type), intent(inout) :: self
    integer(i4), intent(in) :: part(:)
    real(wp), intent(in) :: gravity(3)          !! [m/s^2]
    type(pack_type), intent(in) :: pack_of
    type(carried_type), intent(inout) :: carried
    logical, dimension(self%cells%nodes) :: known
    logical, dimension(3, self%cells%nodes) :: fixed, anew
    real(wp) :: tolerance
    integer(i4) :: e

    known = .false.
    self%fresh = spread(.false., 1, self%cells%nodes)
    do e = 1, self%cells%elements
      if (carried%part(e) /= part_none) known(self%cells%nodes_of(e)) = .true.
      if (part(e) /= part_none) self%fresh(self%cells%nodes_of(e)) = .true.
    end do
    self%fresh = self%fresh .and. .not. known
    if (.not. any(self%fresh)) return
    fixed = spread(known, 1, 3) .or. carried%held
    anew = carried%held .and. spread(self%fresh, 1, 3)
    tolerance = settled*size_of(self%cells, part)
    where (anew)
      carried%u = 0.0_wp
      carried%v = 0.0_wp
      self%x = self%cells%x
    end where
    call spread_out(self%cells, part, self%fresh, fixed, tolerance, carried%v)
    call spread_out(self%cells, part, self%fresh, fixed, tolerance, carried%u)
    self%x = self%x - self%cells%x
    if (any(abs(gravity) > 0.0_wp)) call find_surface(self, gravity, pack_of, carried%u, fixed)
    call spread_out(self%cells, part, self%fresh, fixed, tolerance, self%x)
    self%x = self%x + self%cells%x
  end subroutine find

  !> Edge of a cube as large as the mean element [m].
  pure real(wp) function size_of(cells, part)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:)
    integer(i4) :: e
    size_of = 0.0_wp
    do e = 1, cells%elements
      if (part(e) /= part_none) size_of = size_of + cells%volume(e)
    end do
    size_of = (size_of/max(1, count(part /= part_none)))**(1.0_wp/3.0_wp)
  end function size_of

  !> New nodes at which an outer face looks up go along gravity where the grains end; those of other
  !! outer faces stay in them.
  subroutine find_surface(self, gravity, pack_of, u, fixed)
    type(rebirth_type), intent(inout) :: self  !! x is the change of the places at rest
    real(wp), intent(in) :: gravity(3)         !! [m/s^2]
    type(pack_type), intent(in) :: pack_of
    real(wp), intent(in) :: u(:, :)            !! (3, nodes) [m]
    logical, intent(inout) :: fixed(:, :)
    integer(i4), allocatable :: faces(:, :)
    real(wp), allocatable :: normal(:, :)
    real(wp) :: up
    integer(i4) :: axis, c, f

    axis = maxloc(abs(gravity), 1)
    up = -sign(1.0_wp, gravity(axis))
    call outer_faces(self%cells, spread(.true., 1, self%cells%elements), faces, normal)
    do f = 1, size(faces, 2)
      if (up*normal(axis, f) > upright) cycle
      c = maxloc(abs(normal(:, f)), 1)
      associate (node => faces(:count(faces(:, f) > 0), f))
        where (self%fresh(node) .and. .not. fixed(c, node)) self%x(c, node) = 0.0_wp
        fixed(c, node) = .true.
      end associate
    end do
    do f = 1, size(faces, 2)
      if (up*normal(axis, f) > upright) &
        call raise_face(self, faces(:count(faces(:, f) > 0), f), axis, up, pack_of, u, fixed)
    end do
  end subroutine find_surface

  !> New nodes of a face of the surface.
  subroutine raise_face(self, node, axis, up, pack_of, u, fixed)
    type(rebirth_type), intent(inout) :: self
    integer(i4), intent(in) :: node(:), axis
    real(wp), intent(in) :: up         !! +-1
    type(pack_type), intent(in) :: pack_of
    real(wp), intent(in) :: u(:, :)
    logical, intent(inout) :: fixed(:, :)
    real(wp) :: height, reach
    integer(i4) :: k
    logical :: found

    associate (x => self%cells%x)
      reach = around*max(norm2(x(:, node(1)) - x(:, node(2))), norm2(x(:, node(2)) - x(:, node(3))))
      do k = 1, size(node)
        associate (a => node(k))
          if (.not. self%fresh(a) .or. fixed(axis, a)) cycle
          call find_height(pack_of, axis, up, x(:, a), reach, height, found)
          if (.not. found) cycle
          self%x(axis, a) = height - u(axis, a) - x(axis, a)
          fixed(axis, a) = .true.
        end associate
      end do
    end associate
  end subroutine raise_face

  !> Mean height of the uppermost free grains beside a line, if there are enough.
  subroutine find_height(pack_of, axis, up, x, reach, height, found)
    type(pack_type), intent(in) :: pack_of
    integer(i4), intent(in) :: axis
    real(wp), intent(in) :: up, x(3), reach  !! +-1, [m], [m]
    real(wp), intent(out) :: height          !! [m]
    logical, intent(out) :: found
    real(wp) :: top(size(pack_of%id)), far(3), mean_radius
    integer(i4) :: g, n, k, wanted

    n = 0
    mean_radius = 0.0_wp
    do g = 1, size(top)
      if (pack_of%kind(g) /= free) cycle
      far = pack_of%x(:, g) - x
      far(axis) = 0.0_wp
      if (sum(far**2) > reach**2) cycle
      n = n + 1
      top(n) = up*pack_of%x(axis, g) + pack_of%radius(g)
      mean_radius = mean_radius + pack_of%radius(g)
    end do
    height = 0.0_wp
    found = n > 0
    if (.not. found) return
    mean_radius = mean_radius/n
    wanted = max(3, nint(cover*(reach/mean_radius)**2))
    found = n >= wanted
    if (.not. found) return
    do k = 1, wanted
      g = maxloc(top(:n), 1)
      height = height + up*top(g)/wanted
      top(g) = -huge(1.0_wp)
    end do
  end subroutine find_height

  !> Components that nothing fixes become the mean of those of the elements around, over and over.
  subroutine spread_out(cells, part, wanted, fixed, tolerance, value)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:)
    logical, intent(in) :: wanted(:)         !! (nodes)
    logical, intent(in) :: fixed(:, :)       !! (3, nodes)
    real(wp), intent(in) :: tolerance
    real(wp), intent(inout) :: value(:, :)   !! (3, nodes)
    logical :: has(3, cells%nodes), taken(3, cells%nodes)
    real(wp) :: mean(3, cells%nodes)
    integer(i4), allocatable :: near(:)
    integer(i4) :: e, sweep
    logical :: done

    near = pack([(e, e=1, cells%elements)], [(part(e) /= part_none .and. &
                                              any(wanted(cells%nodes_of(e))), e=1, cells%elements)])
    has = fixed
    do sweep = 1, sweeps
      call mean_around(cells, near, has, value, mean, taken)
      taken = taken .and. spread(wanted, 1, 3) .and. .not. fixed
      done = all(has .or. .not. taken) .and. .not. any(taken .and. abs(mean - value) > tolerance)
      where (taken) value = mean
      has = has .or. taken
      if (done) return
    end do
  end subroutine spread_out

  !> Means over what the nodes of the elements around each node have.
  subroutine mean_around(cells, near, has, value, mean, found)
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: near(:)       !! elements
    logical, intent(in) :: has(:, :)         !! (3, nodes)
    real(wp), intent(in) :: value(:, :)      !! (3, nodes)
    real(wp), intent(out) :: mean(:, :)
    logical, intent(out) :: found(:, :)
    integer(i4) :: counted(3, cells%nodes), k, c
    mean = 0.0_wp
    counted = 0
    do k = 1, size(near)
      associate (node => cells%nodes_of(near(k)))
        do c = 1, 3
          mean(c, node) = mean(c, node) + sum(value(c, node), has(c, node))
          counted(c, node) = counted(c, node) + count(has(c, node))
        end do
      end associate
    end do
    found = counted > 0
    mean = mean/max(1, counted)
  end subroutine mean_around

  subroutine put_places(self, file, errors)
    class(rebirth_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/adapt/places', self%x, errors)
  end subroutine put_places

  !> The same from a checkpoint (I404).
  subroutine get_places(self, file, errors)
    class(rebirth_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/adapt/places', self%x, errors)
    if (.not. all(abs(self%x) < far)) call errors%add('I404', "'"//file%path// &
      "': /adapt/places is no place", file%path//':/adapt/places', 'use an older checkpoint')
  end subroutine get_places
end module cpl_rebirth
