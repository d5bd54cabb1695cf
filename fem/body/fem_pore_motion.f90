!> Inertia of bodies whose pores hold less than all liquid: the mass of a body counts full pores,
!! here is what the elements lack of it.
!! eq. F.91
module fem_pore_motion
  use talus_kinds, only: wp, i4
  use fem_body_state, only: fem_body_state_type
  use fem_pore, only: shape_of
  use fem_pore_element, only: fem_wet_type
  use fem_scatter, only: add_element, add_flow
  use fem_unsaturated, only: has_retention, moist_inertia, moist_mass
  implicit none
  private
  public :: add_lacking, lacking_inertia

contains

  !> What accelerations (or velocities) lack of M a, to be added to it: negative masses [N].
  function lacking_inertia(self, u, a) result(force)
    class(fem_body_state_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)  !! (3, blocks) with the pressures [Pa]
    real(wp), intent(in) :: a(:, :)  !! (3, blocks) [m/s^2]
    real(wp) :: force(3, self%dofs%blocks)
    type(fem_wet_type) :: wet
    integer(i4) :: e, rule
    force = 0.0_wp
    if (.not. self%pore%unsaturated) return
    rule = 0
    do e = 1, self%mesh%elements
      if (.not. moist(self, e)) cycle
      call shape_of(self%pore, self%mesh, self%elastic, e, rule, wet)
      associate (block => displaced(self, e))
        force(:, block) = force(:, block) + moist_inertia(self%elastic%rule(rule), &
          self%pore%solid_of(e), wet, pressures(self, u, e), a(:, block))
      end associate
    end do
  end function lacking_inertia

  !> Add its slopes at the trial state: by displacements, `factor` of those by accelerations
  !! [1/s^2], and by pressures.
  subroutine add_lacking(self, factor, k, lower)
    class(fem_body_state_type), intent(in) :: self
    real(wp), intent(in) :: factor
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    type(fem_wet_type) :: wet
    integer(i4) :: e, rule
    if (.not. self%pore%unsaturated) return
    rule = 0
    do e = 1, self%mesh%elements
      if (.not. moist(self, e)) cycle
      call shape_of(self%pore, self%mesh, self%elastic, e, rule, wet)
      call add_one(self%elastic%rule(rule)%nodes, self%elastic%rule(rule)%corners)
    end do

  contains

    subroutine add_one(nodes, corners)
      integer(i4), intent(in) :: nodes, corners
      real(wp) :: mass(nodes, nodes), full(3*nodes, 3*nodes), by_p(3*nodes, corners, 2)
      logical :: mine(nodes)
      integer(i4) :: i
      mine = .true.
      full = 0.0_wp
      by_p = 0.0_wp
      associate (block => displaced(self, e), pattern => self%system%pattern)
        call moist_mass(self%elastic%rule(rule), self%pore%solid_of(e), wet, &
          pressures(self, self%state%u, e), self%state%a(:, block), mass, by_p(:, :, 1))
        do i = 1, 3
          full(i::3, i::3) = factor*mass
        end do
        call add_element(block, mine, pattern, .false., full, k, lower)
        call add_flow(block, wet_blocks(self, e), pattern, by_p, &
          spread(0.0_wp*mass(1, :corners), 2, corners), k, lower)
      end associate
    end subroutine add_one
  end subroutine add_lacking

  !> Can the pores of element e be unsaturated?
  pure logical function moist(self, e)
    class(fem_body_state_type), intent(in) :: self
    integer(i4), intent(in) :: e
    moist = self%pore%skeleton_of(e) > 0
    if (moist) moist = has_retention(self%pore%skeleton(self%pore%skeleton_of(e)))
  end function moist

  !> Blocks of the displacements of element e.
  pure function displaced(self, e) result(list)
    class(fem_body_state_type), intent(in) :: self
    integer(i4), intent(in) :: e
    integer(i4) :: list(self%elastic%rule(self%elastic%rule_of(e))%nodes)
    list = self%dofs%block(self%dofs%start(e):self%dofs%start(e) + size(list) - 1)
  end function displaced

  !> Blocks of the pressures of element e.
  pure function wet_blocks(self, e) result(list)
    class(fem_body_state_type), intent(in) :: self
    integer(i4), intent(in) :: e
    integer(i4) :: list(self%dofs%wet_start(e + 1) - self%dofs%wet_start(e))
    list = self%dofs%wet(self%dofs%wet_start(e):self%dofs%wet_start(e + 1) - 1)
  end function wet_blocks

  !> Pressures at the corners of element e [Pa].
  pure function pressures(self, u, e) result(p)
    class(fem_body_state_type), intent(in) :: self
    real(wp), intent(in) :: u(:, :)
    integer(i4), intent(in) :: e
    real(wp) :: p(self%dofs%wet_start(e + 1) - self%dofs%wet_start(e))
    p = u(1, wet_blocks(self, e))
  end function pressures
end module fem_pore_motion
