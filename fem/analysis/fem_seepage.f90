!> Faces of pores that switch between a held pressure and a given inflow, in a step of Newton's
!! method (fem_newton): which nodes are held, when they change sides. Rules: fem_face_set.
module fem_seepage
  use talus_kinds, only: wp, i4
  use fem_body, only: fem_body_type
  use fem_face_set, only: begin_sets, cut_out, mark_held, put_outside, turn_nodes
  use fem_sparse, only: multiply_general
  implicit none
  private
  public :: begin_faces, carry_faces, cut_faces, fixed_now, lack_at_faces, settle_faces
  public :: turn_faces

  integer(i4), parameter :: free_turns = 8   !! iterations in which nodes change sides at once
  real(wp), parameter :: rounding = 1.0e-9_wp  !! of the largest pressure

contains

  !> The sets at the start of a part of a step; none while pressures rest.
  subroutine begin_faces(self)
    type(fem_body_type), intent(inout) :: self
    integer(i4) :: k
    if (.not. self%pore%active) return
    call begin_sets(self%pore%leak, self%accepted%u(1, :))
    if (.not. self%port%settling) return
    do k = 1, size(self%pore%leak)
      if (allocated(self%pore%leak(k)%held)) self%pore%leak(k)%held = .false.
    end do
  end subroutine begin_faces

  !> What is held in the trial, by supports, a partner or faces.
  pure function fixed_now(self) result(fixed)
    type(fem_body_type), intent(in) :: self
    logical :: fixed(3, self%dofs%blocks)
    fixed = self%supports%held .or. self%port%prescribed
    if (self%pore%active) call mark_held(self%pore%leak, fixed)
  end function fixed_now

  !> Pressures that held nodes of faces lack in the trial.
  subroutine lack_at_faces(self, given)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(out) :: given(:, :)  !! (3, blocks)
    given = 0.0_wp
    if (.not. self%pore%active) return
    given = self%state%u
    call put_outside(self%pore%leak, given)
    given = given - self%state%u
  end subroutine lack_at_faces

  !> The same, and what these changes do in the other rows.
  subroutine carry_faces(self, given, residual)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(out) :: given(:, :)        !! (3, blocks)
    real(wp), intent(inout) :: residual(:, :)
    real(wp) :: carried(3, self%dofs%blocks)
    call lack_at_faces(self, given)
    if (.not. maxval(abs(given)) > 0.0_wp) return
    call multiply_general(self%system%pattern, self%system%k, self%system%lower, given, carried)
    residual = residual - carried
  end subroutine carry_faces

  !> Take what faces hold out of the matrix.
  subroutine cut_faces(self)
    type(fem_body_type), intent(inout) :: self
    logical :: fixed(3, self%dofs%blocks)
    if (.not. self%pore%active) return
    fixed = .false.
    call mark_held(self%pore%leak, fixed)
    if (any(fixed)) call cut_out(self%system%pattern, fixed(1, :), self%system%k, self%system%lower)
  end subroutine cut_faces

  !> Let nodes of faces change sides: at once in the first iterations, then where the trial is in
  !! balance (`good`); balance with a set that is not the last one is none.
  subroutine turn_faces(self, raw, iteration, good, turned)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: raw(:, :)  !! (3, blocks) residual plus reactions
    integer(i4), intent(in) :: iteration
    logical, intent(inout) :: good
    logical, intent(out) :: turned
    integer(i4) :: many
    real(wp) :: slack(2), scale
    turned = .false.
    if (.not. self%pore%active .or. self%port%settling) return
    if (.not. self%pore%step%dt > 0.0_wp) return
    if (iteration > free_turns .and. .not. good) return
    scale = self%pore%step%dt
    if (self%scheme%dynamic) scale = scale*(1.0_wp - self%scheme%lag)
    associate (p => self%state%u(1, :))
      slack = [rounding*maxval(abs(p(self%dofs%solid + 1:))), &
               self%newton%tolerance*norm2(self%pore%gross)/self%pore%step%dt]
      call turn_nodes(self%pore%leak, p, raw(1, :)/scale, slack, many)
    end associate
    turned = many > 0
    good = good .and. .not. turned
  end subroutine turn_faces

  !> Held pressures of an accepted state are those outside to the last bit.
  subroutine settle_faces(self)
    type(fem_body_type), intent(inout) :: self
    if (self%pore%active) call put_outside(self%pore%leak, self%state%u)
  end subroutine settle_faces
end module fem_seepage
