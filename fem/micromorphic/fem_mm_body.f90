!> Micromorphic elements of a body: laws and tables, response of an element to displacements
!! and micro-deformations since the accepted state, and its stiffness, kept for the assembly.
!! Blocks of an element are u of its nodes, then the three columns of phi of each micro-node.
module fem_mm_body
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use fem_mm_balance, only: balance_forces
  use fem_mm_element, only: mm_element_type, mm_response_type, prepare_element, respond, motion_at
  use fem_mm_flow, only: mm_law_type
  use fem_mm_motion, only: mm_motion_type, mm_force_type
  use fem_mm_plastic, only: failure_text
  use fem_mm_store, only: state_of, store_point, stress_row
  use fem_mm_tensor, only: determinant
  use fem_rules, only: fem_formulation_type
  implicit none
  private
  public :: fem_micro_type, phi_columns

  integer(i4), parameter :: phi_columns = 3  !! blocks of phi at a node

  type :: fem_micro_type
    logical :: active = .false.               !! all elements of the body are micromorphic
    type(mm_law_type), allocatable :: law(:)
    logical, allocatable :: balance(:)        !! (laws) balance form
    integer(i4), allocatable :: law_of(:)     !! (elements)
    type(mm_element_type), allocatable :: element(:)
    real(wp), allocatable :: stiffness(:, :, :)  !! (dofs, dofs, elements) of the trial state
    logical :: wants_stiffness = .true.       !! of the next updates
    character(len=:), allocatable :: trouble  !! why a point found no state, in the last update
  contains
    procedure :: prepare
    procedure :: answer
    procedure :: stiffen
    procedure :: explain
  end type fem_micro_type

contains

  !> Tables of element e with the volumes of its points, factors included.
  subroutine prepare(self, e, rule, x, weight)
    class(fem_micro_type), intent(inout) :: self
    integer(i4), intent(in) :: e
    type(fem_formulation_type), intent(in) :: rule
    real(wp), intent(in) :: x(:, :)     !! (3, nodes) [m]
    real(wp), intent(in) :: weight(:)   !! (points) [m^3]
    logical :: good
    call prepare_element(rule%at, x, self%element(e), good)
    if (.not. good) error stop 'bug: the mesh has an element inside out'
    self%element(e)%balance = self%balance(self%law_of(e))
    self%element(e)%weight = weight
  end subroutine prepare

  !> Forces, stress and states of element e from the accepted motion `old`, whose states are
  !! `before`, to that of `now`. `failed` is the first point without a state.
  subroutine answer(self, e, old, now, before, response, stress, state, failed)
    class(fem_micro_type), intent(inout) :: self
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: old(:, :), now(:, :)  !! (3, blocks) [m], [-]
    real(wp), intent(in) :: before(:, :)          !! (states, points)
    type(mm_response_type), intent(inout) :: response
    real(wp), intent(out) :: stress(:, :), state(:, :)
    integer(i4), intent(out) :: failed
    type(mm_motion_type) :: motion(2)
    type(mm_force_type) :: force
    real(wp), allocatable :: u(:, :), phi(:, :)
    integer(i4) :: q

    associate (element => self%element(e), law => self%law(self%law_of(e)))
      call fields(element, old, u, phi)
      do q = 1, element%points
        element%motion(q) = motion_at(element, q, u, phi)
        element%state(q) = state_of(before(:, q))
      end do
      call fields(element, now, u, phi)
      call respond(law, element, u, phi, self%wants_stiffness, response)
      failed = response%failed
      if (failed > 0) then
        state = before
        stress = 0.0_wp
        return
      end if
      if (self%wants_stiffness) &
        self%stiffness(:element%dofs, :element%dofs, e) = response%stiffness
      do q = 1, element%points
        motion = [element%motion(q), motion_at(element, q, u, phi)]
        force = response%point(q)%force
        if (element%balance) force = balance_forces(motion(2), force)
        call store_point(motion, response%point(q), force, before(:, q), state(:, q))
        stress(:, q) = stress_row(motion(2), response%point(q))
      end do
    end associate
  end subroutine answer

  !> Elastic stiffness of element e at a motion, with the plastic parts of the states `column`.
  subroutine stiffen(self, e, now, column, response)
    class(fem_micro_type), intent(inout) :: self
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: now(:, :), column(:, :)
    type(mm_response_type), intent(inout) :: response
    type(mm_law_type) :: law
    real(wp), allocatable :: u(:, :), phi(:, :)
    integer(i4) :: q
    law = self%law(self%law_of(e))
    law%cone%on = .false.
    associate (element => self%element(e))
      call fields(element, now, u, phi)
      do q = 1, element%points
        element%motion(q) = motion_at(element, q, u, phi)
        element%state(q) = state_of(column(:, q))
      end do
      call respond(law, element, u, phi, .true., response)
      if (response%failed == 0) &
        self%stiffness(:element%dofs, :element%dofs, e) = response%stiffness
    end associate
  end subroutine stiffen

  !> u (3, nodes) and phi (9, micro-nodes) of the blocks of an element.
  pure subroutine fields(element, block, u, phi)
    type(mm_element_type), intent(in) :: element
    real(wp), intent(in) :: block(:, :)
    real(wp), allocatable, intent(inout) :: u(:, :), phi(:, :)
    u = block(:, :element%nodes)
    phi = reshape(block(:, element%nodes + 1:), [9, element%micro_nodes])
  end subroutine fields

  !> Report in `trouble` why point q of element e found no state.
  subroutine explain(self, e, q, old, now, before)
    class(fem_micro_type), intent(inout) :: self
    integer(i4), intent(in) :: e, q
    real(wp), intent(in) :: old(:, :), now(:, :), before(:, :)
    type(mm_response_type) :: response
    type(mm_motion_type) :: motion
    real(wp), allocatable :: u(:, :), phi(:, :), stress(:, :), state(:, :)
    integer(i4) :: failed

    associate (element => self%element(e))
      call fields(element, now, u, phi)
      motion = motion_at(element, q, u, phi)
      self%trouble = ''
      if (.not. determinant(motion%f) > 0.0_wp) then
        self%trouble = 'the determinant of F is '//str(determinant(motion%f))
      else if (.not. determinant(motion%chi) > 0.0_wp) then
        self%trouble = 'the determinant of chi is '//str(determinant(motion%chi))
      else
        allocate (stress(45, element%points), state(size(before, 1), element%points))
        call self%answer(e, old, now, before, response, stress, state, failed)
        if (failed > 0) self%trouble = failure_text(response%point(failed))
      end if
    end associate
  end subroutine explain
end module fem_mm_body
