!> Forces of an overlap: on free grains and nodes, and those of ghosts, elements and loads that they
!! come from (theory: overlap coupling).
module cpl_overlap_forces
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use cpl_parts, only: parts_type
  implicit none
  private
  public :: overlap_forces_type

  !> Loads of the solid's deck on prescribed nodes, without weight.
  type :: loads_type
    logical :: active = .false.
    logical :: steady = .true.                     !! they do not change with time
    real(wp), allocatable :: f(:, :), c(:, :)      !! (3, prescribed) [N], (3, prescribed_phi) [N m]
  end type loads_type

  !> Forces on what is free, and those of ghosts and elements that they come from.
  type :: overlap_forces_type
    real(wp), allocatable :: steady(:, :), steady_phi(:, :)
    !! forces of the solid at the start, which act in every step of the grains
    real(wp), allocatable :: p(:, :), m(:, :)      !! on the ghosts [N], [N m]
    real(wp), allocatable :: f(:, :), c(:, :)      !! on the nodes, every step of the grains
    real(wp), allocatable :: bulk(:, :), bulk_phi(:, :)  !! the same, once an exchange
    real(wp), allocatable :: element(:, :), element_phi(:, :)  !! of elements with prescribed nodes
    real(wp), allocatable :: force(:, :), moment(:, :)  !! on the free grains [N], [N m]
    real(wp), allocatable :: contact(:, :), contact_moment(:, :)  !! of contacts on free grains
    real(wp), allocatable :: inertial(:, :), inertial_phi(:, :)  !! of what prescribed nodes carry
    real(wp), allocatable :: f_hold(:, :), c_hold(:, :)  !! that balance the start
    real(wp), allocatable :: force_hold(:, :), moment_hold(:, :)
    type(loads_type) :: loads                      !! of the solid's deck on prescribed nodes
    type(parts_type) :: parts                      !! forces between ghosts, once an exchange
  contains
    procedure :: init => init_forces
    procedure :: put => put_forces
    procedure :: get => get_forces
    procedure :: take_elements
    procedure :: take_reactions
    procedure :: add_weight
    procedure :: make_steady
    procedure :: hold => hold_all
    procedure :: hold_nodes
    procedure :: renew_loads
  end type overlap_forces_type

contains

  !> No forces.
  subroutine init_forces(self, free, ghosts, nodes, nodes_phi, prescribed, prescribed_phi)
    class(overlap_forces_type), intent(inout) :: self
    integer(i4), intent(in) :: free, ghosts, nodes, nodes_phi, prescribed, prescribed_phi
    allocate (self%force(3, free), self%moment(3, free), self%force_hold(3, free), &
              self%moment_hold(3, free), self%contact(3, free), self%contact_moment(3, free), &
              source=0.0_wp)
    allocate (self%inertial(3, prescribed), self%inertial_phi(3, prescribed_phi), source=0.0_wp)
    allocate (self%f(3, nodes), self%bulk(3, nodes), self%element(3, nodes), &
              self%f_hold(3, nodes), self%steady(3, nodes), source=0.0_wp)
    allocate (self%c(3, nodes_phi), self%bulk_phi(3, nodes_phi), self%element_phi(3, nodes_phi), &
              self%c_hold(3, nodes_phi), self%steady_phi(3, nodes_phi), source=0.0_wp)
    allocate (self%p(3, ghosts), self%m(3, ghosts), source=0.0_wp)
  end subroutine init_forces

  subroutine put_forces(self, file, errors)
    class(overlap_forces_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/free/force', self%force, errors)
    call file%put('/free/moment', self%moment, errors)
    call file%put('/free/force_hold', self%force_hold, errors)
    call file%put('/free/moment_hold', self%moment_hold, errors)
    call file%put('/nodes/f', self%f, errors)
    call file%put('/nodes/bulk', self%bulk, errors)
    call file%put('/nodes/element', self%element, errors)
    call file%put('/nodes/f_hold', self%f_hold, errors)
    call file%put('/rotations/c', self%c, errors)
    call file%put('/rotations/bulk', self%bulk_phi, errors)
    call file%put('/rotations/element', self%element_phi, errors)
    call file%put('/rotations/c_hold', self%c_hold, errors)
    call file%put('/start/steady', self%steady, errors)
    call file%put('/start/steady_phi', self%steady_phi, errors)
    if (.not. self%loads%active) return
    call file%put('/loads/f', self%loads%f, errors)
    call file%put('/loads/c', self%loads%c, errors)
  end subroutine put_forces

  subroutine get_forces(self, file, errors)
    class(overlap_forces_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%get_into('/free/force', self%force, errors)
    call file%get_into('/free/moment', self%moment, errors)
    call file%get_into('/free/force_hold', self%force_hold, errors)
    call file%get_into('/free/moment_hold', self%moment_hold, errors)
    call file%get_into('/nodes/f', self%f, errors)
    call file%get_into('/nodes/bulk', self%bulk, errors)
    call file%get_into('/nodes/element', self%element, errors)
    call file%get_into('/nodes/f_hold', self%f_hold, errors)
    call file%get_into('/rotations/c', self%c, errors)
    call file%get_into('/rotations/bulk', self%bulk_phi, errors)
    call file%get_into('/rotations/element', self%element_phi, errors)
    call file%get_into('/rotations/c_hold', self%c_hold, errors)
    call file%get_into('/start/steady', self%steady, errors)
    call file%get_into('/start/steady_phi', self%steady_phi, errors)
    if (file%exists('/loads/f')) call file%get('/loads/f', self%loads%f, errors)
    if (file%exists('/loads/c')) call file%get('/loads/c', self%loads%c, errors)
  end subroutine get_forces

  !> Forces on the nodes: those of elements with prescribed nodes, and what balances the start.
  pure subroutine take_elements(self)
    class(overlap_forces_type), intent(inout) :: self
    self%f = self%element + self%f_hold
    self%c = self%element_phi + self%c_hold
  end subroutine take_elements

  !> Reactions of the solid in bulk become forces of the elements without prescribed nodes: all that
  !! it exerts, less those of the others and what acts in every step.
  pure subroutine take_reactions(self)
    class(overlap_forces_type), intent(inout) :: self
    self%bulk = -self%bulk - self%element - self%steady
    self%bulk_phi = -self%bulk_phi - self%element_phi - self%steady_phi
  end subroutine take_reactions

  !> Weight of masses of the nodes, once an exchange.
  pure subroutine add_weight(self, mass, gravity)
    class(overlap_forces_type), intent(inout) :: self
    real(wp), intent(in) :: mass(:), gravity(3)  !! (nodes) [kg], [m/s^2]
    integer(i4) :: a
    do a = 1, size(mass)
      self%bulk(:, a) = self%bulk(:, a) + mass(a)*gravity
    end do
  end subroutine add_weight

  !> Forces of the elements without prescribed nodes now, on the edge, act in every step of the
  !! grains from here on.
  pure subroutine make_steady(self, prescribed, prescribed_phi)
    class(overlap_forces_type), intent(inout) :: self
    integer(i4), intent(in) :: prescribed, prescribed_phi  !! nodes before those of the edge
    self%steady(:, prescribed + 1:) = self%bulk(:, prescribed + 1:)
    self%steady_phi(:, prescribed_phi + 1:) = self%bulk_phi(:, prescribed_phi + 1:)
    self%bulk = self%bulk - self%steady
    self%bulk_phi = self%bulk_phi - self%steady_phi
    call self%parts%forget_dead()
  end subroutine make_steady

  !> What acts on the free grains and on the nodes now is balanced from here on.
  pure subroutine hold_all(self)
    class(overlap_forces_type), intent(inout) :: self
    call self%hold_nodes()
    self%force_hold = -self%force
    self%moment_hold = -self%moment
    call self%parts%forget_dead()
  end subroutine hold_all

  !> The same on the nodes alone: nothing is left there.
  pure subroutine hold_nodes(self)
    class(overlap_forces_type), intent(inout) :: self
    self%f_hold = -self%f
    self%c_hold = -self%c
    self%f = 0.0_wp
    self%c = 0.0_wp
  end subroutine hold_nodes

  !> Other loads of the solid's deck, and what is new in them on the free grains.
  pure subroutine renew_loads(self, f, c, push, turn)
    class(overlap_forces_type), intent(inout) :: self
    real(wp), intent(in) :: f(:, :), c(:, :)        !! (3, prescribed) [N], [N m]
    real(wp), intent(in) :: push(:, :), turn(:, :)  !! (3, free) [N], [N m]
    self%force = self%force + push
    self%moment = self%moment + turn
    self%loads%f = f
    self%loads%c = c
  end subroutine renew_loads
end module cpl_overlap_forces
