!> One step of statics by arc length (Crisfield 1981, Ramm 1981): all loads and motions have one
!! factor, which is sought together with the displacements so that these change by a given length.
!! Limit points of the load and of the motion are passed; the path continues without turning
!! back along the last step (Feng, Peric and Owen 1995).
!! eq. F.20
module fem_arc
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_h5_shaped, only: get_shaped
  use talus_hdf5, only: h5_file_type
  use fem_body, only: fem_body_type
  use fem_follower, only: follower_force
  use fem_newton, only: part_type, inner_force, balance, assemble, solve, measure, note, finish, &
    blame, give_up, element_at
  use fem_sparse, only: multiply_general
  implicit none
  private
  public :: fem_arc_data_type, arc_step, put_arc, get_arc

  !> State of a path.
  type :: fem_arc_data_type
    logical :: settled = .false.        !! the loads at time 0 act from the start
    real(wp) :: t_end = 0.0_wp          !! whose loads and motions have the factor 1 [s]
    real(wp) :: first = 0.0_wp          !! factor of the first step [-]
    real(wp) :: growth = 1.0_wp         !! of the arc over the first one, at most [-]
    integer(i4) :: wanted = 5           !! iterations of a step
    real(wp) :: factor = 0.0_wp         !! of loads and motions, now [-]
    real(wp) :: radius = -1.0_wp        !! of the next step, < 0: not yet determined [m]
    real(wp) :: first_radius = 0.0_wp   !! [m]
    integer(i4) :: iterations = 0       !! of the last step
    integer(i4) :: limits = 0           !! changes of sign of the factor's steps so far
    real(wp) :: last = 0.0_wp           !! change of the factor in the last step [-]
    real(wp), allocatable :: step(:, :) !! the last one (3, blocks) [m], [rad]
  end type fem_arc_data_type

  real(wp), parameter :: most_change = 2.0_wp   !! of the radius from step to step
  real(wp), parameter :: diverged = 1.0e4_wp    !! residual over the first one

contains

  !> From the accepted state along the path; N311 where it cannot be followed. Time is but the
  !! number of the step times dt.
  subroutine arc_step(self, arc, t1, errors)
    type(fem_body_type), intent(inout) :: self
    type(fem_arc_data_type), intent(inout) :: arc
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    type(part_type) :: part
    real(wp) :: radius, change, step(3, self%dofs%blocks)
    integer(i4) :: cuts, iterations
    logical :: good

    call self%number(errors)
    if (errors%any()) return
    self%newton%rows = 0
    call begin_path(self, arc, part)
    radius = arc%radius
    do cuts = 0, self%newton%most_cuts
      self%state%time = t1
      call try_step(self, arc, part, radius, step, iterations, good)
      if (good) exit
      call self%reject()
      radius = 0.5_wp*radius
      if (.not. radius > 0.0_wp) exit
    end do
    if (.not. good) then
      call give_up(self, part, 0.5_wp**cuts, errors)
      return
    end if
    change = part%after - arc%factor
    if (change*arc%last < 0.0_wp) arc%limits = arc%limits + 1
    if (arc%first_radius <= 0.0_wp) arc%first_radius = radius
    arc%last = change
    arc%factor = part%after
    arc%step = step
    arc%iterations = iterations
    arc%radius = min(arc%growth*arc%first_radius, radius*min(most_change, max(1.0_wp &
      /most_change, sqrt(real(arc%wanted, wp)/iterations))))
  end subroutine arc_step

  !> Loads and motions at the factors 0 and 1.
  subroutine begin_path(self, arc, part)
    type(fem_body_type), intent(inout) :: self
    type(fem_arc_data_type), intent(in) :: arc
    type(part_type), intent(inout) :: part
    integer(i4) :: k
    allocate (part%load, mold=self%accepted%u)
    allocate (part%goal_load, part%raw, mold=self%accepted%u)
    part%u = self%accepted%u
    part%goal_u = self%accepted%u
    call self%impose(0.0_wp, part%u)
    call self%impose(arc%t_end, part%goal_u)
    call self%external_at(0.0_wp, part%load)
    call self%external_at(arc%t_end, part%goal_load)
    if (.not. arc%settled) part%load = 0.0_wp
    if (.not. allocated(self%loads%follower)) return
    allocate (part%follower(size(self%loads%follower)), &
      part%goal_follower(size(self%loads%follower)), source=1.0_wp)
    do k = 1, size(self%loads%follower)
      associate (f => self%loads%follower(k))
        if (f%curve > 0) part%goal_follower(k) = self%loads%curve(f%curve)%at(arc%t_end)
        if (f%curve > 0) part%follower(k) = self%loads%curve(f%curve)%at(0.0_wp)
      end associate
    end do
    if (.not. arc%settled) part%follower = 0.0_wp
  end subroutine begin_path

  !> Predict along the tangent, then correct on the sphere; a radius below zero is that of the first
  !! factor. The reason of a failure is in part%reason.
  subroutine try_step(self, arc, part, radius, step, iterations, good)
    type(fem_body_type), intent(inout) :: self
    type(fem_arc_data_type), intent(in) :: arc
    type(part_type), intent(inout) :: part
    real(wp), intent(inout) :: radius
    real(wp), intent(out) :: step(:, :)
    integer(i4), intent(out) :: iterations
    logical, intent(out) :: good
    real(wp), dimension(3, self%dofs%blocks) :: residual, along, back
    real(wp) :: change, size_of, scale, first
    integer(i4) :: n

    n = self%dofs%nodes
    iterations = 0
    step = 0.0_wp
    part%before = arc%factor
    part%after = part%before
    part%inverted = .false.
    call look(self, part, step, residual, good)
    if (good) call directions(self, part, residual, back, along, good)
    if (.not. good) return
    good = norm2(along(:, :n)) > 0.0_wp
    if (.not. good) part%reason = 'no load and no motion changes between time 0 and t_end'
    if (.not. good) return
    if (radius < 0.0_wp) radius = arc%first*norm2(along(:, :n))
    change = radius/norm2(along(:, :n))
    if (allocated(arc%step)) &
      change = sign(change, sum(arc%step(:, :n)*along(:, :n)))
    do iterations = 1, self%newton%most_iterations
      step = step + back + change*along
      part%after = part%after + change
      call look(self, part, step, residual, good)
      if (.not. good) return
      call measure(self, part, residual, size_of, scale)
      if (iterations == 1) first = size_of
      call note(self, part, iterations, size_of, scale, sum(step*residual), 1.0_wp)
      if (size_of <= self%newton%tolerance*scale) exit
      part%reason = 'the residual is '//str(size_of/max(scale, tiny(1.0_wp)))// &
        ' of loads and reactions on the arc, most in element '//str(element_at(self, &
        int(maxloc(sum(residual**2, 1), 1), i4)))
      good = is_finite(size_of) .and. size_of <= diverged*max(first, scale)
      if (.not. good) return
      call directions(self, part, residual, back, along, good)
      if (good) call stay_on_arc(radius, step(:, :n), back(:, :n), along(:, :n), change, good)
      if (.not. good) return
    end do
    good = iterations <= self%newton%most_iterations
    if (good) call finish(self, part, size_of, scale)
  end subroutine try_step

  !> Residual for displacements `step` since the accepted state at the factor of the part.
  subroutine look(self, part, step, residual, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: step(:, :)
    real(wp), intent(out) :: residual(:, :)
    logical, intent(out) :: good
    real(wp) :: internal(3, self%dofs%blocks)
    integer(i4) :: bad
    part%dead = part%load + part%after*(part%goal_load - part%load)
    call inner_force(self, step, internal, bad)
    good = bad == 0
    self%state%u = self%accepted%u + step
    if (.not. good) then
      call blame(self, part)
      return
    end if
    call balance(self, part, step, internal, residual)
  end subroutine look

  !> What removes the residual (`back`), and the motion along the path for a factor of one.
  subroutine directions(self, part, residual, back, along, good)
    type(fem_body_type), intent(inout) :: self
    type(part_type), intent(inout) :: part
    real(wp), intent(in) :: residual(:, :)
    real(wp), intent(out) :: back(:, :), along(:, :)
    logical, intent(out) :: good
    type(error_list_type) :: errors
    real(wp), dimension(3, self%dofs%blocks) :: push, given, carried
    integer(i4) :: k
    push = part%goal_load - part%load
    if (allocated(self%loads%follower)) then
      do k = 1, size(self%loads%follower)
        call follower_force(self%mesh, self%loads%follower(k), part%goal_follower(k) &
                            - part%follower(k), self%state%u, push)
      end do
    end if
    call assemble(self, part)
    given = merge(part%goal_u - part%u, 0.0_wp, self%supports%held .or. self%port%prescribed)
    call multiply_general(self%system%pattern, self%system%k, self%system%lower, given, carried)
    call solve(self, part, residual, back, good)
    if (.not. good) return
    call self%system%solver%solve(self%system%pattern, merge(0.0_wp, push - carried, &
                                               self%supports%held .or. self%port%prescribed), &
                                                 along, errors)
    along = along + given
    good = .not. errors%any()
    if (good) good = is_finite(sum(abs(along)))
    if (.not. good) part%reason = 'the tangent is singular'
  end subroutine directions

  !> Change of the factor that leaves the step as long as the radius; of two the one that turns
  !! less.
  pure subroutine stay_on_arc(radius, step, back, along, change, good)
    real(wp), intent(in) :: radius, step(:, :), back(:, :), along(:, :)
    real(wp), intent(out) :: change
    logical, intent(out) :: good
    real(wp) :: a, b, c, root
    a = sum(along**2)
    b = sum((step + back)*along)
    c = sum((step + back)**2) - radius**2
    change = 0.0_wp
    good = b*b - a*c >= 0.0_wp
    if (.not. good) return
    root = sqrt(b*b - a*c)
    change = (-b + sign(root, sum(step*along)))/a
  end subroutine stay_on_arc

  !> State of the path, to a checkpoint.
  subroutine put_arc(arc, file, errors)
    type(fem_arc_data_type), intent(in) :: arc
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/state/arc', [arc%factor, arc%radius, arc%first_radius, arc%last, &
                                 real(arc%iterations, wp), real(arc%limits, wp)], errors)
    if (allocated(arc%step)) call file%put('/state/arc_step', arc%step, errors)
  end subroutine put_arc

  !> And back.
  subroutine get_arc(arc, blocks, file, errors)
    type(fem_arc_data_type), intent(inout) :: arc
    integer(i4), intent(in) :: blocks  !! of unknowns
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)
    call get_shaped(file, '/state/arc', 6, values, errors)
    if (errors%any()) return
    arc%factor = values(1)
    arc%radius = values(2)
    arc%first_radius = values(3)
    arc%last = values(4)
    arc%iterations = nint(values(5), i4)
    arc%limits = nint(values(6), i4)
    if (arc%radius > 0.0_wp) call get_shaped(file, '/state/arc_step', [3, blocks], arc%step, errors)
  end subroutine get_arc
end module fem_arc
