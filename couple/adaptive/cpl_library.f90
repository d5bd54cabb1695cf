!> Several tiles of grains in one bed, each for a state of the material: which one an element wakes,
!! and which grains may wake beside the border of two (theory-overlap, Conversion). Faults D483,
!! D484.
module cpl_library
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_message, only: message_type
  use talus_port_names, only: can_element_stress, field_band, field_density, field_plastic, &
    field_start
  use cpl_cells, only: cells_type
  use cpl_roles, only: roles_type
  use cpl_sets, only: part_rest
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: library_type

  integer(i4), parameter :: at_home = 0, in_band = 1, from_other = 2  !! marks of guests at the port
  integer(i4), parameter :: stays_away = -1

  type :: library_type
    logical :: active = .false.
    integer(i8), allocatable :: before(:)   !! (tiles) id before the first of each
    real(wp), allocatable :: density(:)     !! (tiles) of the bed [kg/m^3]
    real(wp), allocatable :: plastic(:)     !! (tiles) strain that each stands for [-]
    real(wp) :: band = 0.0_wp               !! beyond the border of two, in which both may wake [m]
    real(wp), allocatable :: at_rest(:)     !! (elements) density [kg/m^3]
    integer(i4), allocatable :: tile(:)     !! (elements) that it wakes, 0: not chosen yet
    integer(i4), allocatable :: first(:), beside(:)  !! elements beside each
  contains
    procedure :: read => read_library
    procedure :: by_strain
    procedure :: choose
    procedure :: take_over
    procedure :: mark
    procedure :: put => put_library
    procedure :: get => get_library
  end type library_type

contains

  !> What DESCRIBE asleep tells, if there are several tiles. D483, D484: what they do not go with.
  subroutine read_library(self, reply, cells, roles, solid, errors)
    class(library_type), intent(inout) :: self
    type(message_type), intent(inout) :: reply
    type(cells_type), intent(in) :: cells    !! not displaced
    type(roles_type), intent(in) :: roles
    type(cpl_solver_type), intent(in) :: solid
    type(error_list_type), intent(inout) :: errors
    self%active = reply%has(field_start)
    if (.not. self%active) return
    call reply%take_int(field_start, self%before, errors)
    call reply%take(field_density, self%density, errors)
    call reply%take(field_plastic, self%plastic, errors)
    call reply%get(field_band, self%band, errors)
    if (errors%any()) return
    if (roles%replay .or. roles%close_behind > 0.0_wp) &
      call errors%add('D483', 'the grains have several tiles, which are not replayed and do '// &
        'not close', solid%deck, "leave birth = 'replay' and close_behind out of &adapt, or "// &
        'take one tile')
    if (self%by_strain() .and. .not. solid%can(can_element_stress)) &
      call errors%add('D484', 'tiles stand for different plastic strains, and '//solid%title()// &
        ' has none', solid%deck, 'take a law with a state, or tiles that differ in density alone')
    if (.not. allocated(self%tile)) self%tile = spread(0_i4, 1, cells%elements)
    self%at_rest = densities(cells)
    call find_beside(self, cells, roles)
  end subroutine read_library

  !> Do tiles differ in plastic strain?
  pure logical function by_strain(self)
    class(library_type), intent(in) :: self
    by_strain = .false.
    if (self%active) by_strain = maxval(self%plastic) > minval(self%plastic)
  end function by_strain

  !> Density of each element, from the masses of its nodes [kg/m^3].
  pure function densities(cells) result(density)
    type(cells_type), intent(in) :: cells
    real(wp) :: density(cells%elements), volume(cells%nodes)
    integer(i4) :: e
    volume = 0.0_wp
    do e = 1, cells%elements
      associate (node => cells%nodes_of(e))
        volume(node) = volume(node) + cells%volume(e)/size(node)
      end associate
    end do
    do e = 1, cells%elements
      associate (node => cells%nodes_of(e))
        density(e) = sum(cells%mass(node)/volume(node))/size(node)
      end associate
    end do
  end function densities

  !> Elements that share a node with each.
  pure subroutine find_beside(self, cells, roles)
    class(library_type), intent(inout) :: self
    type(cells_type), intent(in) :: cells
    type(roles_type), intent(in) :: roles
    logical :: near(cells%elements)
    integer(i4), allocatable :: found(:)
    integer(i4) :: e, k, j
    allocate (self%first(cells%elements + 1), found(0))
    self%first(1) = 1
    do e = 1, cells%elements
      near = .false.
      associate (node => cells%nodes_of(e))
        do k = 1, size(node)
          near(roles%element(roles%start(node(k)):roles%start(node(k) + 1) - 1)) = .true.
        end do
      end associate
      near(e) = .false.
      found = [found, pack([(j, j=1, cells%elements)], near)]
      self%first(e + 1) = size(found) + 1
    end do
    call move_alloc(found, self%beside)
  end subroutine find_beside

  !> Tiles of elements that hold grains from now on: the nearest in density and plastic strain, each
  !! over its range among the tiles. eq. C.70
  pure subroutine choose(self, part, volume, plastic)
    class(library_type), intent(inout) :: self
    integer(i4), intent(in) :: part(:)      !! (elements) from now on
    real(wp), intent(in) :: volume(:)       !! (elements) now, over that at rest
    real(wp), intent(in) :: plastic(:)      !! (elements) strain [-]
    real(wp) :: range(2), apart(size(self%density))
    integer(i4) :: e
    range = [maxval(self%density) - minval(self%density), &
             maxval(self%plastic) - minval(self%plastic)]
    do e = 1, size(part)
      if (part(e) == part_rest .or. self%tile(e) > 0) cycle
      apart = 0.0_wp
      if (range(1) > 0.0_wp) apart = ((self%density - self%at_rest(e)/volume(e))/range(1))**2
      if (range(2) > 0.0_wp) apart = apart + ((self%plastic - plastic(e))/range(2))**2
      self%tile(e) = minloc(apart, 1)
    end do
  end subroutine choose

  !> An element that grains of the packing fill has their tile.
  pure subroutine take_over(self, element, id)
    class(library_type), intent(inout) :: self
    integer(i4), intent(in) :: element
    integer(i8), intent(in) :: id
    if (self%active) self%tile(element) = count(self%before < id)
  end subroutine take_over

  !> Marks for WAKE of grains that sleep in elements which hold grains from now on: at home, at home
  !! within the band beside another tile, from that other tile, or none where it stays away.
  pure subroutine mark(self, cells, part, element, id, x, marks)
    class(library_type), intent(in) :: self
    type(cells_type), intent(in) :: cells   !! at rest
    integer(i4), intent(in) :: part(:)      !! (elements) from now on
    integer(i4), intent(in) :: element(:)   !! (grains)
    integer(i8), intent(in) :: id(:)
    real(wp), intent(in) :: x(:, :)         !! in the bed at rest [m]
    integer(i4), intent(out) :: marks(:)
    integer(i4) :: k, t
    do k = 1, size(id)
      associate (e => element(k))
        t = count(self%before < id(k))
        if (t == self%tile(e)) then
          marks(k) = merge(in_band, at_home, is_beside(self, cells, part, e, x(:, k), 0_i4))
        else
          marks(k) = stays_away
          if (is_beside(self, cells, part, e, x(:, k), t)) marks(k) = from_other
        end if
      end associate
    end do
  end subroutine mark

  !> Is a place in an element within the band of one of tile t (0: of any other) that holds grains?
  pure logical function is_beside(self, cells, part, e, x, t)
    class(library_type), intent(in) :: self
    type(cells_type), intent(in) :: cells
    integer(i4), intent(in) :: part(:), e, t
    real(wp), intent(in) :: x(3)
    real(wp) :: apart(3)
    integer(i4) :: k
    is_beside = .false.
    do k = self%first(e), self%first(e + 1) - 1
      associate (other => self%beside(k))
        if (part(other) == part_rest .or. self%tile(other) == self%tile(e)) cycle
        if (t > 0 .and. self%tile(other) /= t) cycle
        apart = max(cells%low(:, other) - x, x - cells%high(:, other), 0.0_wp)
        is_beside = norm2(apart) < self%band
        if (is_beside) return
      end associate
    end do
  end function is_beside

  subroutine put_library(self, file, errors)
    class(library_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (self%active) call file%put('/adapt/tile', self%tile, errors)
  end subroutine put_library

  !> The same from a checkpoint (I404).
  subroutine get_library(self, elements, file, errors)
    class(library_type), intent(inout) :: self
    integer(i4), intent(in) :: elements
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    if (.not. file%exists('/adapt/tile')) return
    self%tile = spread(0_i4, 1, elements)
    call file%get_into('/adapt/tile', self%tile, errors)
    if (any(self%tile < 0)) call errors%add('I404', "'"//file%path//"': /adapt/tile names "// &
      'tiles that there are not', file%path//':/adapt/tile', 'use an older checkpoint')
  end subroutine get_library
end module cpl_library
