!> One static or implicit step of a body whose laws have a state: Newton's method with the
!! consistent tangent and a line search. Loads and motions grow in proportion over the step; where
!! an iteration does not converge the step is halved, and doubled again after parts that did.
module fem_newton
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_flow_step, only: begin_flow, finish_flow, matrix_step, measure_leak, out_of_balance, &
    resting_force, same_matrix, swing, take_length, tight, work_on
  use fem_follower, only: follower_force, add_follower_stiffness
  use fem_newmark, only: newmark_motion, dynamic_work
  use fem_pore_motion, only: add_lacking, lacking_inertia
  use fem_seepage, only: begin_faces, carry_faces, cut_faces, fixed_now, lack_at_faces, &
    settle_faces, turn_faces
  use fem_sparse, only: add_springs, largest_entry, multiply_general, multiply_mass, spring_force
  use fem_trouble, only: element_at, most_yielding
  implicit none
  private
  public :: newton_step, newton_columns
  public :: part_type, inner_force, balance, assemble, solve, measure, note, finish, blame
  public :: give_up, element_at

  integer(i4), parameter :: newton_columns = 8   !! of the table: see `note`
  integer(i4), parameter :: few = 6              !! iterations after which a part is doubled
  integer(i4), parameter :: most_searches = 5
  real(wp), parameter :: slack = 0.8_wp          !! |du'R| after over before that is good enough
  real(wp), parameter :: shortest = 0.1_wp       !! step of the line search
  real(wp), parameter :: diverged = 1.0e4_wp     !! residual over the first one
  real(wp), parameter :: complete = 1.0e-12_wp   !! share of the step that may be left

  !> Start and target of a part of a step.
  type :: part_type
    real(wp), allocatable :: load(:, :), goal_load(:, :)  !! at start and end of the step [N]
    real(wp), allocatable :: follower(:), goal_follower(:)  !! shares of pressures that follow [-]
    real(wp), allocatable :: dead(:, :)                   !! loads of the part [N]
    real(wp), allocatable :: raw(:, :)                    !! residual plus reactions [N]
    real(wp), allocatable :: inertia(:, :), balance(:, :) !! M a, and that before the part (HHT) [N]
    real(wp) :: dt = 0.0_wp                               !! of the part [s]
    real(wp), allocatable :: u(:, :), goal_u(:, :)        !! of what is held or moved [m]
    real(wp) :: before = 0.0_wp, after = 0.0_wp           !! shares of the step
    real(wp) :: weight_before = 0.0_wp                    !! share of gravity at the start
    character(len=:), allocatable :: reason               !! why it did not converge
    logical :: inverted = .false.                         !! an element turned inside out
    real(wp) :: leak = 0.0_wp                             !! liquid out of balance, of what moves
    real(wp) :: leaked = 0.0_wp                           !! the same in the iteration before
  end type part_type

contains

  !> From the accepted state to time t1; the new state stays a trial, parts before it are accepted.
  !! N311 where no equilibrium is found, N312 where the load turns an element inside out; the last
  !! converged state is the accepted one then.
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
    call begin_step(self, t1, part)
    size_of = 1.0_wp
    do
      part%after = min(1.0_wp, part%before + size_of)
      if (1.0_wp - part%after <= complete) part%after = 1.0_wp
      part%inverted = .false.
      call try_part(self, t0, t1, part, iterations, good)
      if (.not. good) then
        call self%reject()
        size_of = 0.5_wp*size_of
        if (size_of >= 0.5_wp**self%newton%most_cuts) cycle
        call give_up(self, part, size_of, errors)
        return
      end if
      if (part%after >= 1.0_wp) return
      call self%accept()
      part%before = part%after
      if (iterations <= few) size_of = 2.0_wp*size_of
    end do
  end subroutine newton_step

  !> What the step heads for.
  subroutine begin_step(self, t1, part)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1
    type(part_type), intent(inout) :: part
    logical :: loaded
    part%load = self%accepted%external
    part%u = self%accepted%u
    part%goal_u = self%accepted%u
    call self%push(t1)
    call self%impose(t1, part%goal_u)
    allocate (part%goal_load, part%raw, mold=part%load)
    call self%external_at(t1, part%goal_load)
    loaded = any(abs(part%load) > 0.0_wp)
    call self%dofs%halo%anywhere(loaded)
    if (loaded) part%weight_before = 1.0_wp
    if (allocated(self%loads%follower)) call begin_pressures(self, t1, part)
    if (.not. self%scheme%dynamic) return
    allocate (part%inertia, mold=part%load)
    allocate (part%balance(3, self%dofs%blocks), source=0.0_wp)
  end subroutine begin_step

  !> Pressures that follow the surface are no part of the loads that grow in proportion.
  subroutine begin_pressures(self, t1, part)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: t1
    type(part_type), intent(inout) :: part
    integer(i4) :: k
    allocate (part%follower(size(self%loads%follower)), source=part%weight_before)
    allocate (part%goal_follower(size(self%loads%follower)), source=1.0_wp)
    do k = 1, size(self%loads%follower)
      associate (f => self%loads%follower(k))
        if (f%curve > 0) then
          part%goal_follower(k) = self%loads%curve(f%curve)%at(t1)
          part%follower(k) = part%follower(k)*self%loads%curve(f%curve)%at(self%accepted%time)
        end if
        call follower_force(self%mesh, f, -part%follower(k), self%accepted%u, part%load)
      end associate
    end do
  end subroutine begin_pressures

  !> The fault of a step that was cut too often.
  subroutine give_up(self, part, size_of, errors)
    type(fem_body_type), intent(in) :: self
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: size_of
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: cut
    cut = ' beyond time '//str(self%accepted%time)//' s, the step cut to 1/'// &
      str(nint(1.0_wp/size_of, i4))//': '
    if (part%inverted) then
      call errors%add('N312', 'an element turns inside out'//cut//part%reason, '', &
        'the load is more than this mesh can follow: use a finer mesh or a stiffer law there, '// &
        'or less load; the last converged state is written')
    else
      call errors%add('N311', 'no equilibrium'//cut//part%reason, '', &
        'do the loads exceed what the body carries? Prescribe motions in their place, or '// &
        'check the yielding points of the last state; max_iterations and step_cuts may '// &
        'be raised')
    end if
  end subroutine give_up

  !> A part of the step by Newton's method. In statics the residual is measured by the largest loads
  !! and reactions of the run, so that a body can be unloaded; not to nothing in one step that began
  !! with loads, which is how a body that softens leaps to where it carries nothing at all.
  subroutine try_part(self, t0, t1, part, iterations, good)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t0, t1
    type(part_type), intent(inout) :: part
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: residual, du
    real(wp), parameter :: loaded = 1.0e-2_wp, empty = 1.0e-6_wp  !! of the largest loads
    real(wp) :: first, size_of, scale, search, forces(2)
    logical :: emptied

    emptied = .false.
    part%leak = huge(1.0_wp)
    associate (s => self%state)
      s%time = t0 + part%after*(t1 - t0)
      part%dt = s%time - self%accepted%time
      call begin_flow(self, part%dt)
      call begin_faces(self)
      part%dead = part%load + part%after*(part%goal_load - part%load)
      s%external = part%dead
      s%u = self%accepted%u
      iterations = 0
      call predict(self, part, du, good)
      if (.not. good) return
      call line_search(self, part, du, .false., residual, search, good)
      if (.not. good) return
      do iterations = 1, self%newton%most_iterations
        call measure(self, part, residual, size_of, scale)
        part%leaked = part%leak
        call measure_leak(self, residual, part%leak)
        if (iterations == 1) then
          first = size_of
          forces = scale
        end if
        forces(2) = scale
        if (.not. self%scheme%dynamic) scale = max(scale, self%newton%largest)
        call note(self, part, iterations, size_of, scale, work_on(self, du, residual), search)
        good = size_of <= self%newton%tolerance*scale .and. tight(self, part%leak, part%leaked)
        call let_turn(self, part, iterations, residual, good)
        emptied = good .and. forces(1) > loaded*scale .and. forces(2) < empty*scale
        if (emptied) good = .false.
        if (good .or. emptied .or. .not. is_finite(size_of) .or. size_of > diverged*first) exit
        if (iterations == self%newton%most_iterations) exit
        call correct(self, part, residual, du, good)
        if (.not. good) return
        call line_search(self, part, du, .true., residual, search, good)
        if (.not. good) return
      end do
      if (.not. good) call blame_balance(self, part, residual, iterations, size_of/max(scale, &
        tiny(1.0_wp)))
      if (emptied) part%reason = 'loads and reactions fall to nothing in one step'
      if (good) call finish(self, part, size_of, scale)
    end associate
  end subroutine try_part

  !> Faces of pores after a correction: the residual is that with what they hold then.
  subroutine let_turn(self, part, iteration, residual, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    integer(i4), intent(in) :: iteration
    real(wp), intent(inout) :: residual(:, :)
    logical, intent(inout) :: good
    real(wp), dimension(3, self%dofs%blocks) :: moved, internal
    integer(i4) :: bad
    logical :: turned
    call turn_faces(self, part%raw, iteration, good, turned)
    if (.not. turned) return
    moved = self%state%u - self%accepted%u
    call inner_force(self, moved, internal, bad)
    call balance(self, part, moved, internal, residual)
  end subroutine let_turn

  !> Why a part did not converge: forces or the liquid out of balance, and where.
  subroutine blame_balance(self, part, residual, iterations, ratio)
    type(fem_body_type), intent(in) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: residual(:, :), ratio
    integer(i4), intent(in) :: iterations
    integer(i4) :: bad, n
    real(wp) :: most
    n = self%dofs%solid
    if (part%leak > ratio) then
      bad = self%dofs%node(n + int(maxloc(abs(residual(1, n + 1:)), 1), i4))
      part%reason = 'the liquid out of balance is '//str(part%leak)//' of what moves'
    else
      bad = self%mesh%number_of(int(maxloc(sum(residual(:, :n)**2, 1), 1), i4))
      most = maxval(sum(residual(:, :n)**2, 1))
      if (self%dofs%halo%dealt) call self%dofs%halo%largest(most, bad)
      part%reason = 'the residual is '//str(ratio)//' of loads and reactions'
    end if
    part%reason = part%reason//' after '//str(iterations)//' iterations, most at node '// &
      str(bad)//', element '//str(element_at(self, self%mesh%place_of(bad)))
  end subroutine blame_balance

  !> Displacements by the tangent of the accepted state: prescribed ones to their values, the others
  !! follows.
  subroutine predict(self, part, du, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(out) :: du(:, :)
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: internal, residual, given, carried
    real(wp) :: most
    integer(i4) :: bad

    call lack_at_faces(self, given)
    where (self%supports%held .or. self%port%prescribed) &
      given = part%u + part%after*(part%goal_u - part%u) - self%accepted%u
    bad = 0
    if (.not. same_matrix(self, part%dt) .or. self%scheme%dynamic) &
      call inner_force(self, 0.0_wp*given, internal, bad)
    if (self%pore%constant .and. .not. self%scheme%dynamic) call resting_force(self, internal)
    good = bad == 0
    if (.not. good) then
      call blame(self, part)
      return
    end if
    if (self%scheme%lag > 0.0_wp) then
      part%balance = self%accepted%external + self%accepted%reaction - internal &
        - self%accepted%viscous
      part%balance(:, self%dofs%solid + 1:) = 0.0_wp  ! contents have no balance before the step
    end if
    call balance(self, part, given, internal, residual)
    call assemble(self, part)
    carried = 0.0_wp
    most = maxval(abs(given))
    call self%dofs%halo%highest(most)
    if (most > 0.0_wp) call multiply_general(self%system%pattern, self%system%k, &
      self%system%lower, given, carried)
    call solve(self, part, residual - carried, du, good)
    du = du + given
  end subroutine predict

  !> Correction by the tangent of the trial state.
  subroutine correct(self, part, residual, du, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: given, left
    call assemble(self, part)
    left = residual
    call carry_faces(self, given, left)
    call solve(self, part, left, du, good)
    du = du + given
  end subroutine correct

  !> The slopes of the residual but for those of inertia.
  subroutine assemble(self, part)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(in) :: part
    integer(i4) :: k
    if (same_matrix(self, part%dt)) return
    call self%matter%assemble(self%mesh, self%dofs, self%elastic, self%system%pattern, &
      self%system%k, self%system%lower)
    if (self%pore%active) then
      call take_length(self, matrix_step(self, part%dt))
      call self%pore%add_matrix(self%mesh, self%dofs, self%elastic, self%system%pattern, &
        self%system%k, self%system%lower)
      call take_length(self, part%dt)
    end if
    call add_springs(self%supports%ground, self%system%pattern, self%system%k, self%system%lower)
    if (allocated(self%loads%follower)) then
      do k = 1, size(self%loads%follower)
        call add_follower_stiffness(self%mesh, self%loads%follower(k), follower_now(part, k), &
                                    self%state%u, self%system%pattern, self%system%k, &
                                      self%system%lower)
      end do
    end if
    if (self%scheme%dynamic .and. self%scheme%lag > 0.0_wp) then
      self%system%k = (1.0_wp - self%scheme%lag)*self%system%k
      self%system%lower = (1.0_wp - self%scheme%lag)*self%system%lower
    end if
    call add_springs(self%port%robin, self%system%pattern, self%system%k, self%system%lower)
  end subroutine assemble

  !> Share of a pressure that follows the surface, in the part [-].
  pure real(wp) function follower_now(part, k)
    type(part_type), intent(in) :: part
    integer(i4), intent(in) :: k
    follower_now = part%follower(k) + part%after*(part%goal_follower(k) - part%follower(k))
  end function follower_now

  !> Factor and solve; a singular tangent is a reason to halve the step.
  subroutine solve(self, part, residual, du, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    logical, intent(out) :: good
    type(error_list_type) :: errors
    real(wp) :: rate, mass_term
    logical :: lost
    du = 0.0_wp
    mass_term = 0.0_wp
    if (.not. same_matrix(self, part%dt)) then
      if (self%scheme%dynamic) then
        rate = (1.0_wp - self%scheme%lag)*self%scheme%gamma/(self%scheme%beta &
          *matrix_step(self, part%dt))
        mass_term = 1.0_wp/(self%scheme%beta*matrix_step(self, part%dt)**2) + rate*self%damping%mass
        call self%damping%add_dashpots(self%system%pattern, rate, self%system%k)
        call add_lacking(self, 1.0_wp/(self%scheme%beta*matrix_step(self, part%dt)**2), &
          self%system%k, self%system%lower)
      end if
      call cut_faces(self)
      call self%system%solver%factor(self%system%pattern, self%system%k, self%system%mass, &
        mass_term, errors, self%system%lower)
      if (self%pore%constant) call self%system%keep_factors(matrix_step(self, part%dt))
    end if
    if (.not. errors%any()) call self%system%solver%solve(self%system%pattern, &
      merge(0.0_wp, residual, fixed_now(self)), du, errors)
    if (errors%any() .and. self%system%solver%iterative .and. self%system%solver%by_choice) &
      call solve_by_factors(self, residual, du, errors)
    lost = .not. is_finite(sum(abs(du)))
    call self%dofs%halo%anywhere(lost)
    good = .not. (errors%any() .or. lost)
    if (good) return
    part%reason = 'the tangent is singular'
    if (errors%any()) part%reason = errors%item(1)%message
    part%reason = part%reason//most_yielding(self)
  end subroutine solve

  !> The same by factors, from now on: multigrid was chosen and did not converge.
  subroutine solve_by_factors(self, residual, du, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: du(:, :)
    type(error_list_type), intent(inout) :: errors
    call errors%clear()
    du = 0.0_wp
    call self%system%solver%turn_to_factors()
    call self%system%forget_numbers()
    call self%number(errors)
    if (.not. errors%any()) call self%system%solver%factor(self%system%pattern, self%system%k, &
      self%system%mass, 0.0_wp, errors, self%system%lower)
    if (.not. errors%any()) call self%system%solver%solve(self%system%pattern, residual, du, errors)
  end subroutine solve_by_factors

  !> Internal forces for displacements `moved` since the accepted state; `bad` is the first point
  !! without a state.
  subroutine inner_force(self, moved, internal, bad)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: moved(:, :)
    real(wp), intent(out) :: internal(:, :)
    integer(i4), intent(out) :: bad
    real(wp) :: springs(3, self%dofs%blocks)
    call self%matter%update(self%mesh, self%dofs, self%elastic, self%accepted%u + moved, moved, &
                            internal, bad)
    if (self%pore%active .and. self%scheme%dynamic) call swing(self, moved)
    call self%pore%force(self%mesh, self%dofs, self%elastic, self%accepted%u, moved, internal)
    if (.not. self%supports%sprung()) return
    call self%ground_force(self%accepted%u + moved, springs)
    internal = internal - springs
  end subroutine inner_force

  !> Residual of the part from its internal forces; loads, inertia and ties are those for
  !! displacements `moved`.
  subroutine balance(self, part, moved, internal, residual)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: moved(:, :), internal(:, :)
    real(wp), intent(out) :: residual(:, :)
    integer(i4) :: k
    associate (s => self%state)
      s%u = self%accepted%u + moved
      s%external = part%dead
      if (allocated(self%loads%follower)) then
        do k = 1, size(self%loads%follower)
          call follower_force(self%mesh, self%loads%follower(k), follower_now(part, k), s%u, &
            s%external)
        end do
      end if
      part%raw = s%external - internal
      if (self%scheme%dynamic) then
        call newmark_motion(self, part%dt)
        call multiply_mass(self%system%pattern, self%system%mass, s%a, part%inertia)
        if (self%pore%unsaturated) part%inertia = part%inertia + lacking_inertia(self, s%u, s%a)
        call self%viscous_force(s%v, s%viscous)
        part%raw = (1.0_wp - self%scheme%lag)*(part%raw - s%viscous) &
          + self%scheme%lag*part%balance - part%inertia
      end if
      if (self%port%robin%n > 0) then
        call spring_force(self%port%robin, part%u, s%u, s%tie)
        part%raw = part%raw + s%tie
      end if
      residual = merge(0.0_wp, part%raw, fixed_now(self))
    end associate
  end subroutine balance

  !> Step along du: all of it, or (`seek`) as far as the residual's work on it falls; less where a
  !! point has no state. With a pore liquid forces that fall are enough: where it does not flow a
  !! correction changes pressures alone, whose work is rounding; and with unsaturated pores a
  !! liquid closer to balance.
  subroutine line_search(self, part, du, seek, residual, share, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: du(:, :)
    logical, intent(in) :: seek
    real(wp), intent(inout) :: residual(:, :)
    real(wp), intent(out) :: share
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: start, internal
    real(wp) :: before, after, forces, flow
    integer(i4) :: k, bad

    start = 0.0_wp
    if (seek) start = self%state%u - self%accepted%u
    before = 0.0_wp
    if (seek) before = work_on(self, du, residual)
    forces = self%dofs%halo%total_of(residual(:, :self%dofs%solid)**2)
    flow = out_of_balance(self, residual)
    share = 1.0_wp
    do k = 1, most_searches
      call inner_force(self, start + share*du, internal, bad)
      good = bad == 0
      if (.not. good) then
        if (.not. seek) exit
        share = 0.5_wp*share
        cycle
      end if
      call balance(self, part, start + share*du, internal, residual)
      after = work_on(self, du, residual)
      if (.not. seek .or. abs(after) <= slack*abs(before) .or. share <= shortest) exit
      if (self%pore%active .and. sum(residual(:, :self%dofs%solid)**2) < slack**2*forces) exit
      if (self%pore%unsaturated .and. out_of_balance(self, residual) < flow) exit
      if (k == most_searches .or. after*before >= before**2) exit
      share = max(shortest, share*max(0.1_wp, before/(before - after)))
    end do
    self%state%u = self%accepted%u + start + share*du
    if (.not. good) call blame(self, part)
  end subroutine line_search

  !> Store the fault of the first point without a state.
  subroutine blame(self, part)
    type(fem_body_type), intent(in) :: self
    type(part_type), intent(inout) :: part
    call self%matter%trouble(self%elastic, part%reason, part%inverted)
  end subroutine blame

  !> Norm of the residual, and what it is measured by: the norm of loads, reactions and inertia; in
  !! free flight of what would change the momentum by a millionth, at finite strain at least of a
  !! millionth of stiffness times displacement: turns of bodies without load leave round-off alone.
  subroutine measure(self, part, residual, size_of, scale)
    type(fem_body_type), intent(in) :: self
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: size_of, scale
    real(wp), parameter :: floor_of = 1.0e-6_wp
    real(wp) :: momentum(3, self%dofs%blocks), stiffest
    integer(i4) :: n
    n = self%dofs%solid
    size_of = sqrt(self%dofs%halo%total_of(residual(:, :n)**2))
    scale = self%dofs%halo%total_of(merge(part%raw(:, :n)**2, self%state%external(:, :n)**2, &
                      self%supports%held(:, :n) .or. self%port%prescribed(:, :n)))
    if (self%scheme%dynamic) then
      call multiply_mass(self%system%pattern, self%system%mass, self%state%v, momentum)
      scale = scale + sum(part%inertia**2) + sum((floor_of/part%dt*momentum)**2)
    end if
    if (.not. self%matter%finite) then
      scale = sqrt(scale)
    else
      stiffest = largest_entry(self%system%pattern, self%system%k)
      scale = sqrt(scale + (floor_of*stiffest)**2*self%dofs%halo%total_of(self%state%u**2))
      scale = max(scale, stiffest*round_off(self)/self%newton%tolerance)
    end if
  end subroutine measure

  !> Norm of displacements that deformation gradients of finite strain cannot tell from none [m]:
  !! some units in the last place of 1 over an element, at every node.
  real(wp) function round_off(self)
    type(fem_body_type), intent(in) :: self
    real(wp), parameter :: units = 8.0_wp
    real(wp) :: extent, nodes
    nodes = real(self%mesh%total_nodes(), wp)
    extent = self%dofs%halo%extent(self%mesh%x)
    round_off = units*epsilon(1.0_wp)*extent/nodes**(1.0_wp/3.0_wp)*sqrt(nodes)
  end function round_off

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
        max(part%leak, size_of/max(scale, tiny(1.0_wp))), abs(work), share, 0.0_wp, 0.0_wp]
      call self%count_yielding(n%table(newton_columns - 1:, n%rows))
    end associate
  end subroutine note

  !> Reactions and ledger of a part that converged.
  subroutine finish(self, part, size_of, scale)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: size_of, scale
    real(wp) :: moved(3, self%dofs%blocks), weight(2), share
    integer(i4) :: n
    associate (s => self%state, old => self%accepted, e => self%energy)
      share = 1.0_wp
      if (self%scheme%dynamic) share = 1.0_wp - self%scheme%lag
      n = self%dofs%solid
      s%reaction = merge(-part%raw/share, 0.0_wp, fixed_now(self))
      call settle_faces(self)
      if (scale > 0.0_wp) self%residual = max(self%residual, size_of/scale)
      if (.not. self%scheme%dynamic) self%newton%largest = max(self%newton%largest, scale)
      moved = s%u - old%u
      weight = 1.0_wp
      if (part%weight_before < 1.0_wp) weight = [part%before, part%after]
      call self%begin_energy()
      call self%matter_energy()
      e%load = e%load + 0.5_wp*self%dofs%halo%total_of(moved*(s%external + old%external))
      e%gravity = e%gravity + 0.5_wp*sum(weight) &
        *self%dofs%halo%total_of(moved*self%system%weight_force)
      e%support = e%support + 0.5_wp*self%dofs%halo%total_of(moved(:, :n) &
        *(s%reaction(:, :n) + old%reaction(:, :n)))
      if (self%port%robin%n > 0) e%spring = e%spring + 0.5_wp*sum(moved*(s%tie + old%tie))
    end associate
    if (self%pore%active) call finish_flow(self)
    if (self%scheme%dynamic) call finish_motion(self, part, moved)
  end subroutine finish

  !> Kinetic energy, damping and numerical dissipation of the scheme.
  subroutine finish_motion(self, part, moved)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(in) :: part
    real(wp), intent(in) :: moved(:, :)
    real(wp) :: momentum(3, self%dofs%blocks)
    associate (s => self%state, old => self%accepted, e => self%energy)
      call multiply_mass(self%system%pattern, self%system%mass, s%v, momentum)
      if (self%pore%unsaturated) momentum = momentum + lacking_inertia(self, s%u, s%v)
      e%kinetic = 0.5_wp*sum(s%v*momentum)
      e%damping = e%damping + 0.5_wp*sum(moved*(s%viscous + old%viscous))
      call dynamic_work(self, part%dt, part%inertia, part%balance)
    end associate
  end subroutine finish_motion
end module fem_newton
