!> Forces between ghosts that are evaluated once an exchange (theory: overlap coupling, Time).
!!
!! What they were in the mean of a window of exchanges (`mean`) acts in every step of the grains
!! like a dead load; what they are besides (`remainder`) acts in kicks of half an exchange at its
!! start and at its end. As forces of the contacts change slowly the kicks are weak, however large
!! the forces are. Kicks keep an energy that differs from the true one by h^2 remainder^2/m: the
!! value at an instant in place of the mean makes the remainder vanish there, always to the same
!! side, and energy drifts; a mean does not depend on the instant.
module cpl_parts
  use talus_kinds, only: wp, i4
  use cpl_operators, only: operators_type
  implicit none
  private
  public :: parts_type, pulled_type

  integer(i4), parameter :: window = 100_i4  !! exchanges

  !> Forces on what is free.
  type :: pulled_type
    real(wp), allocatable :: f(:, :), c(:, :)          !! nodes (3, nodes) [N], (3, nodes_phi) [N m]
    real(wp), allocatable :: force(:, :), moment(:, :)  !! free grains (3, free)
  end type pulled_type

  type :: parts_type
    logical :: active = .false.
    integer(i4), allocatable :: active_rows(:)     !! rows of the ghosts that move with the steps
    integer(i4), allocatable :: other_rows(:)      !! rows of the others
    real(wp), allocatable :: p_active(:, :), m_active(:, :)  !! of free grains on these [N], [N m]
    real(wp), allocatable :: x_active(:, :), quat_active(:, :)  !! where they were at first [m]; now
    real(wp), allocatable :: d_active(:, :), turn_active(:, :)  !! how far they have come [m], [rad]
    real(wp), allocatable :: kick(:, :), kick_phi(:, :)  !! remainder on free grains, with that of
                                                   !! what prescribed nodes carry (3, free)
    real(wp), allocatable :: p(:, :), m(:, :)      !! of ghosts on ghosts (3, ghosts) [N], [N m]
    real(wp), allocatable :: p_sum(:, :), m_sum(:, :)      !! the same over the window so far
    real(wp), allocatable :: p_mean(:, :), m_mean(:, :)  !! the mean over the window before
    integer(i4) :: age = 0                         !! exchanges since
    logical :: old = .false.                       !! the active ghosts must be chosen again
    type(pulled_type) :: mean, remainder
    real(wp), allocatable :: dead(:, :), dead_phi(:, :)  !! mean on free grains, with loads that
                                                   !! balance the start (3, free)
    real(wp), allocatable :: dead_f(:, :), dead_c(:, :)  !! the same on nodes, with what is steady
    logical :: dead_known = .false.                !! they are of now
    real(wp), allocatable :: d(:, :), turn(:, :)   !! ghosts at the start of the exchange
    real(wp), allocatable :: v(:, :), spin(:, :)   !! of ghosts in the mean of it [m/s], [rad/s]
    real(wp), allocatable :: q(:, :), theta(:, :)  !! free grains then
    real(wp), allocatable :: u(:, :), phi(:, :)    !! nodes then
  contains
    procedure :: begin
    procedure :: settle
    procedure :: gather
    procedure :: is_due
    procedure :: renew
    procedure :: pull_all
    procedure :: pull_remainder
    procedure :: forget_dead
  end type parts_type

contains

  !> Allocate for the ghosts, free grains and nodes of the operators.
  subroutine begin(self, op)
    class(parts_type), intent(inout) :: self
    type(operators_type), intent(in) :: op
    self%active = .true.
    allocate (self%p(3, op%ghosts), self%m(3, op%ghosts), self%p_mean(3, op%ghosts), &
              self%m_mean(3, op%ghosts), self%p_sum(3, op%ghosts), self%m_sum(3, op%ghosts), &
              source=0.0_wp)
    call make_room(op, self%mean)
    call make_room(op, self%remainder)
  end subroutine begin

  pure subroutine make_room(op, pulled)
    type(operators_type), intent(in) :: op
    type(pulled_type), intent(inout) :: pulled
    allocate (pulled%f(3, op%nodes), pulled%c(3, op%nodes_phi), pulled%force(3, op%free), &
              pulled%moment(3, op%free), source=0.0_wp)
  end subroutine make_room

  !> What acts now acts in every step from here on.
  subroutine settle(self, op)
    class(parts_type), intent(inout) :: self
    type(operators_type), intent(in) :: op
    self%p_mean = self%p
    self%m_mean = self%m
    call clear(self)
    call self%pull_all(op)
  end subroutine settle

  pure subroutine clear(self)
    class(parts_type), intent(inout) :: self
    self%p_sum = 0.0_wp
    self%m_sum = 0.0_wp
    self%age = 0
  end subroutine clear

  !> The forces at the end of an exchange belong to the window.
  pure subroutine gather(self)
    class(parts_type), intent(inout) :: self
    self%p_sum = self%p_sum + self%p
    self%m_sum = self%m_sum + self%m
    self%age = self%age + 1
  end subroutine gather

  !> Is the window full?
  pure logical function is_due(self)
    class(parts_type), intent(in) :: self
    is_due = self%active .and. self%age >= window
  end function is_due

  !> The mean of the window acts in every step from here on.
  subroutine renew(self, op)
    class(parts_type), intent(inout) :: self
    type(operators_type), intent(in) :: op
    self%p_mean = self%p_sum/self%age
    self%m_mean = self%m_sum/self%age
    call clear(self)
    call self%pull_all(op)
  end subroutine renew

  !> Both on what is free, after a change of the mean part or of the operators.
  subroutine pull_all(self, op)
    class(parts_type), intent(inout) :: self
    type(operators_type), intent(in) :: op
    call self%forget_dead()
    call pull(op, self%p_mean, self%m_mean, self%mean)
    call self%pull_remainder(op)
  end subroutine pull_all

  !> Loads in every step are others from now on.
  pure subroutine forget_dead(self)
    class(parts_type), intent(inout) :: self
    self%dead_known = .false.
  end subroutine forget_dead

  subroutine pull_remainder(self, op)
    class(parts_type), intent(inout) :: self
    type(operators_type), intent(in) :: op
    call pull(op, self%p, self%m, self%remainder)
    self%remainder%f = self%remainder%f - self%mean%f
    self%remainder%c = self%remainder%c - self%mean%c
    self%remainder%force = self%remainder%force - self%mean%force
    self%remainder%moment = self%remainder%moment - self%mean%moment
  end subroutine pull_remainder

  subroutine pull(op, p, m, pulled)
    type(operators_type), intent(in) :: op
    real(wp), intent(in) :: p(:, :), m(:, :)
    type(pulled_type), intent(inout) :: pulled
    pulled%f = 0.0_wp
    pulled%c = 0.0_wp
    call op%pull(p, m, pulled%f, pulled%c, pulled%force, pulled%moment)
  end subroutine pull
end module cpl_parts
