!> One static step of a body whose laws have a state: Newton's method with the consistent tangent
!! and a line search. Loads and motions grow in proportion over the step; where an iteration does
!! not converge the step is halved, and doubled again after parts that did.
module fem_newton
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_sparse, only: add_springs, multiply_general, spring_force
  implicit none
  private
  public :: newton_step, newton_columns

  integer(i4), parameter :: newton_columns = 8   !! of the table: see `note`
  integer(i4), parameter :: few = 6              !! iterations after which a part is doubled
  integer(i4), parameter :: most_searches = 5
  real(wp), parameter :: slack = 0.8_wp          !! |du'R| after over before that is good enough
  real(wp), parameter :: shortest = 0.1_wp       !! step of the line search
  real(wp), parameter :: diverged = 1.0e4_wp     !! residual over the first one
  real(wp), parameter :: complete = 1.0e-12_wp   !! share of the step that may be left

  !> What a part of a step begins with and heads for.
  type :: part_type
    real(wp), allocatable :: load(:, :), goal_load(:, :)  !! at start and end of the step [N]
    real(wp), allocatable :: u(:, :), goal_u(:, :)        !! of what is held or moved [m]
    real(wp) :: before = 0.0_wp, after = 0.0_wp           !! shares of the step
    real(wp) :: weight_before = 0.0_wp                    !! share of gravity at the start
    character(len=:), allocatable :: reason               !! why it did not converge
  end type part_type

contains

  !> From the accepted state to time t1; the new state stays a trial, parts before it are accepted.
  !! N311 where no equilibrium is found; the last converged state is the accepted one then.
  subroutine newton_step(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    type(part_type) :: part
    real(wp) :: size_of, t0
    integer(i4) :: iterations
    logical :: good

    call self%number(errors)
    if (errors%any()) return
    self%newton%rows = 0
    t0 = self%accepted%time
    part%load = self%accepted%external
    part%u = self%accepted%u
    part%goal_u = self%accepted%u
    call self%impose(t1, part%goal_u)
    allocate (part%goal_load, mold=part%load)
    call self%external_at(t1, part%goal_load)
    if (any(abs(part%load) > 0.0_wp)) part%weight_before = 1.0_wp
    size_of = 1.0_wp
    do
      part%after = min(1.0_wp, part%before + size_of)
      if (1.0_wp - part%after <= complete) part%after = 1.0_wp
      call try_part(self, t0, t1, part, iterations, good)
      if (.not. good) then
        call self%reject()
        size_of = 0.5_wp*size_of
        if (size_of >= 0.5_wp**self%newton%most_cuts) cycle
        call errors%add('N311', 'no equilibrium beyond time '//str(self%accepted%time)// &
          ' s, the step cut to 1/'//str(nint(1.0_wp/size_of, i4))//': '//part%reason, '', &
          'do the loads exceed what the body carries? Prescribe motions in their place, or '// &
          'look at the yielding points of the last state; max_iterations and step_cuts may '// &
          'be raised')
        return
      end if
      if (part%after >= 1.0_wp) return
      call self%accept()
      part%before = part%after
      if (iterations <= few) size_of = 2.0_wp*size_of
    end do
  end subroutine newton_step

  !> A part of the step by Newton's method.
  subroutine try_part(self, t0, t1, part, iterations, good)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t0, t1
    type(part_type), intent(inout) :: part
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: internal, residual, du
    real(wp) :: first, size_of, scale, search
    integer(i4) :: bad

    associate (s => self%state)
      s%time = t0 + part%after*(t1 - t0)
      s%external = part%load + part%after*(part%goal_load - part%load)
      s%u = self%accepted%u
      iterations = 0
      call predict(self, part, du, good)
      if (.not. good) return
      call line_search(self, part, du, .false., internal, residual, search, good)
      if (.not. good) return
      do iterations = 1, self%newton%most_iterations
        call measure(self, internal, residual, size_of, scale)
        if (iterations == 1) first = size_of
        call note(self, part, iterations, size_of, scale, sum(du*residual), search)
        good = size_of <= self%newton%tolerance*scale
        if (good .or. .not. is_finite(size_of) .or. size_of > diverged*first) exit
        if (iterations == self%newton%most_iterations) exit
        call correct(self, residual, du, part%reason, good)
        if (.not. good) return
        call line_search(self, part, du, .true., internal, residual, search, good)
        if (.not. good) return
      end do
      bad = int(maxloc(sum(residual**2, 1), 1), i4)
      if (.not. good) part%reason = 'the residual is '//str(size_of/max(scale, tiny(1.0_wp)))// &
        ' of loads and reactions after '//str(iterations)//' iterations, most at node '// &
        str(bad)//', element '//str(element_at(self, bad))
      if (good) call finish(self, part, internal, size_of, scale)
    end associate
  end subroutine try_part

  !> Displacements by the tangent of the accepted state: what is moved goes to its place, the rest
  !! follows.
  subroutine predict(self, part, du, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(out) :: du(:, :)
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: internal, residual, given, carried
    integer(i4) :: bad

    given = 0.0_wp
    where (self%held .or. self%prescribed) &
      given = part%u + part%after*(part%goal_u - part%u) - self%accepted%u
    call evaluate(self, 0.0_wp*given, internal, residual, bad)
    good = bad == 0
    if (good) call assemble(self)
    if (good) call multiply_general(self%pattern, self%k, self%lower, given, carried)
    if (good) call solve(self, residual - carried, du, part%reason, good)
    du = du + given
  end subroutine predict

  !> Correction by the tangent of the trial state.
  subroutine correct(self, residual, du, reason, good)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    character(len=:), allocatable, intent(inout) :: reason
    logical, intent(out) :: good
    call assemble(self)
    call solve(self, residual, du, reason, good)
  end subroutine correct

  subroutine assemble(self)
    type(fem_body_type), intent(inout) :: self
    call self%matter%assemble(self%mesh, self%dofs, self%elastic, self%pattern, self%k, self%lower)
    call add_springs(self%ground, self%pattern, self%k, self%lower)
  end subroutine assemble

  !> Factor and solve; a singular tangent is a reason to halve the step.
  subroutine solve(self, residual, du, reason, good)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    character(len=:), allocatable, intent(inout) :: reason
    logical, intent(out) :: good
    type(error_list_type) :: errors
    du = 0.0_wp
    call self%solver%factor(self%pattern, self%k, self%mass, 0.0_wp, errors, self%lower)
    if (.not. errors%any()) call self%solver%solve(self%pattern, residual, du, errors)
    good = .not. errors%any()
    if (good) good = is_finite(sum(abs(du)))
    if (good) return
    reason = 'the tangent is singular'
    if (errors%any()) reason = errors%item(1)%message
  end subroutine solve

  !> Internal forces and residual for displacements `moved` since the accepted state; `bad` is the
  !! first point without a state.
  subroutine evaluate(self, moved, internal, residual, bad)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: moved(:, :)
    real(wp), intent(out) :: internal(:, :), residual(:, :)
    integer(i4), intent(out) :: bad
    call self%matter%update(self%mesh, self%dofs, self%elastic, moved, internal, bad)
    if (self%ground%n > 0) then
      call spring_force(self%ground, 0.0_wp*moved, self%accepted%u + moved, residual)
      internal = internal - residual
    end if
    residual = self%state%external - internal
    where (self%held .or. self%prescribed) residual = 0.0_wp
  end subroutine evaluate

  !> Go along du: all of it, or (`seek`) as far as the residual's work on it falls; shorter where a
  !! point has no state.
  subroutine line_search(self, part, du, seek, internal, residual, share, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: du(:, :)
    logical, intent(in) :: seek
    real(wp), intent(inout) :: internal(:, :), residual(:, :)
    real(wp), intent(out) :: share
    logical, intent(out) :: good
    real(wp) :: start(3, self%dofs%blocks), before, after
    integer(i4) :: k, bad, at(2)

    start = self%state%u - self%accepted%u
    before = 0.0_wp
    if (seek) before = sum(du*residual)
    share = 1.0_wp
    do k = 1, most_searches
      call evaluate(self, start + share*du, internal, residual, bad)
      good = bad == 0
      if (.not. good) then
        if (.not. seek) exit
        share = 0.5_wp*share
        cycle
      end if
      after = sum(du*residual)
      if (.not. seek .or. abs(after) <= slack*abs(before) .or. share <= shortest) exit
      if (k == most_searches .or. after*before >= before**2) exit
      share = max(shortest, share*max(0.1_wp, before/(before - after)))
    end do
    self%state%u = self%accepted%u + start + share*du
    if (good) return
    at = self%matter%element_of(self%elastic, bad)
    part%reason = 'the law of point '//str(at(2))//' of element '//str(at(1))//' finds no state'
  end subroutine line_search

  !> Norm of the residual, and of loads and reactions.
  subroutine measure(self, internal, residual, size_of, scale)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: internal(:, :), residual(:, :)
    real(wp), intent(out) :: size_of, scale
    size_of = sqrt(sum(residual**2))
    scale = sqrt(sum(merge((internal - self%state%external)**2, self%state%external**2, &
                           self%held .or. self%prescribed)))
  end subroutine measure

  !> A row of the table: time [s], share of the step, iteration, residual, work of the residual on
  !! the correction [J], share of the line search, yielding points, most local iterations.
  subroutine note(self, part, iteration, size_of, scale, work, share)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(in) :: part
    integer(i4), intent(in) :: iteration
    real(wp), intent(in) :: size_of, scale, work, share
    real(wp), allocatable :: longer(:, :)
    associate (n => self%newton)
      if (.not. allocated(n%table)) allocate (n%table(newton_columns, 64))
      if (n%rows == size(n%table, 2)) then
        allocate (longer(newton_columns, 2*n%rows))
        longer(:, :n%rows) = n%table
        call move_alloc(longer, n%table)
      end if
      n%rows = n%rows + 1
      n%table(:, n%rows) = [self%state%time, part%after - part%before, real(iteration, wp), &
        size_of/max(scale, tiny(1.0_wp)), abs(work), share, real(self%matter%yielding(), wp)]
    end associate
  end subroutine note

  !> Reactions and ledger of a part that converged.
  subroutine finish(self, part, internal, size_of, scale)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: internal(:, :), size_of, scale
    real(wp) :: moved(3, self%dofs%blocks), works(3), weight(2)
    associate (s => self%state, old => self%accepted, e => self%energy)
      s%reaction = merge(internal - s%external, 0.0_wp, self%held .or. self%prescribed)
      if (scale > 0.0_wp) self%residual = max(self%residual, size_of/scale)
      moved = s%u - old%u
      works = self%matter%works()
      weight = 1.0_wp
      if (part%weight_before < 1.0_wp) weight = [part%before, part%after]
      e = self%accepted_energy
      e%strain = works(1)
      if (self%ground%n > 0) e%strain = e%strain + ground_energy(self)
      e%plastic = works(2)
      e%numerical = works(3)
      e%load = e%load + 0.5_wp*sum(moved*(s%external + old%external))
      e%gravity = e%gravity + 0.5_wp*sum(weight)*sum(moved*self%weight_force)
      e%support = e%support + 0.5_wp*sum(moved*(s%reaction + old%reaction))
    end associate
  end subroutine finish

  !> Energy in the springs to the ground [J].
  real(wp) function ground_energy(self)
    type(fem_body_type), intent(in) :: self
    real(wp) :: force(3, self%dofs%blocks)
    call spring_force(self%ground, 0.0_wp*self%state%u, self%state%u, force)
    ground_energy = -0.5_wp*sum(force*self%state%u)
  end function ground_energy

  !> First element that has a node.
  pure integer(i4) function element_at(self, block)
    type(fem_body_type), intent(in) :: self
    integer(i4), intent(in) :: block
    integer(i4) :: place
    place = int(findloc(self%dofs%block, block, 1), i4)
    element_at = int(count(self%dofs%start <= place), i4)
  end function element_at
end module fem_newton
