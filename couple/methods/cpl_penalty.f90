!> Penalty form of the bridging domain: springs, and dashpots where wanted, between bound grains and
!! the field of the nodes in place of multipliers (theory: overlap coupling, Penalty).
!!
!! With g = q - N d, A = N M^-1 N' + m^-1 and s_i = 1/sum_j A_ij the spring of grain i has the
!! stiffness k_i = w^2 s_i. Springs alone then have the highest frequency w, whatever masses and
!! mesh are (Perron: rows of diag(s) A add up to one), which is chosen by the share of the stable
!! step that they take, penalty = (w dt/2)^2. Dashpots have c_i = 2 ratio w s_i.
module cpl_penalty
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_log, only: log_type, short_number
  use talus_text, only: str, string_type, append_string
  use cpl_bridge, only: bridge_type, bridge_field_type
  use cpl_bridge_limit, only: check_step_of
  use cpl_bridge_step, only: trial_type, trial_kick
  use cpl_coupled, only: coupled_type, motion_type, add_contacts, add_elements
  use cpl_domain_method, only: domain_method_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type, side_grains
  implicit none
  private
  public :: penalty_type, penalty_springs_type

  !> Springs and dashpots of one field, displacements or rotations.
  type :: penalty_springs_type
    real(wp) :: rate = 0.0_wp     !! w, angular frequency of the springs alone [1/s]
    real(wp) :: damping = 0.0_wp  !! ratio of the dashpots to critical ones [-]
  contains
    procedure :: forces
  end type penalty_springs_type

  type, extends(domain_method_type) :: penalty_type
    real(wp) :: factor = 0.0_wp   !! (w dt/2)^2 [-]
    type(penalty_springs_type) :: springs
  contains
    procedure :: check
    procedure :: lumped
    procedure :: check_step
    procedure :: bind
    procedure :: log_bond
    procedure :: own_columns
    procedure :: own_values
  end type penalty_type

  !> The operator whose highest frequency limits the step, with grains of the domain on springs.
  type, extends(coupled_type) :: sprung_type
    type(bridge_type) :: bridge
    real(wp) :: rate = 0.0_wp   !! [1/s]
    real(wp) :: left = 1.0_wp   !! share of the stable step that dashpots leave [-]
  contains
    procedure :: build => build_sprung
    procedure :: start => start_sprung
    procedure :: stiffness_times => sprung_stiffness_times
    procedure :: accelerate => accelerate_sprung
    procedure :: work => sprung_work
  end type sprung_type

contains

  !> D433: springs and dashpots alone are not stable with the step of the grains.
  subroutine check(self, run, errors)
    class(penalty_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call run%deck%get('overlap', 1, 'penalty', self%factor)
    call run%deck%get('overlap', 1, 'penalty_damping', self%springs%damping)
    if (taken(self) < 1.0_wp) return
    call run%deck%fault(errors, 'D433', 'penalty springs and dashpots take '//str(taken(self))// &
      ' of the stable step', 'overlap', 1, 'penalty_damping', &
      'keep penalty + 2 penalty_damping sqrt(penalty) below 1, contacts need the rest')
  end subroutine check

  !> Share of the stable step that springs and dashpots take alone; 1 is the limit of leapfrog with
  !! dashpots that act by the velocity half a step before.
  pure real(wp) function taken(self)
    class(penalty_type), intent(in) :: self
    taken = self%factor + 2.0_wp*self%springs%damping*sqrt(self%factor)
  end function taken

  !> No system of equations, but row sums: they are what springs are made of.
  logical function lumped(self, run)
    class(penalty_type), intent(in) :: self
    type(cpl_run_type), intent(in) :: run
    lumped = .true.
  end function lumped

  subroutine check_step(self, run, points, errors)
    class(penalty_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(points_type), intent(in) :: points
    type(error_list_type), intent(inout) :: errors
    type(sprung_type) :: sprung
    associate (grains => run%solvers(side_grains))
      sprung%bridge = self%bridge
      sprung%rate = 2.0_wp*sqrt(self%factor)/grains%dt
      sprung%left = 1.0_wp - (taken(self) - self%factor)
      call check_step_of(sprung, self%o, grains, points, run%timers, errors)
    end associate
  end subroutine check_step

  !> Kick of the nodes with all that acts on them, forces of springs and dashpots with it; the same
  !! forces are put on the grains.
  subroutine bind(self, grains, kick, bulk, dt)
    class(penalty_type), intent(inout) :: self
    type(cpl_solver_type), intent(in) :: grains
    real(wp), intent(in) :: kick, bulk, dt
    type(trial_type) :: trial
    real(wp) :: stored

    self%springs%rate = 2.0_wp*sqrt(self%factor)/dt
    stored = 0.0_wp
    associate (o => self%o, b => self%bridge, m => self%o%motion)
      call trial_kick(o, b, grains, kick, bulk, trial)
      call bind_field(b%move, b%move%gap(m%d, m%u), b%v, trial%before, trial%v, m%v, b%push)
      b%push = b%push + b%hold
      if (b%turns) then
        call bind_field(b%turn, b%turn%gap(m%turn, m%phi), b%spin, trial%before_phi, trial%spin, &
                        m%w, b%couple)
        b%couple = b%couple + b%hold_couple
      end if
      call o%ledger%add(0.0_wp, o%ledger%bond - stored, 0.0_wp)
      o%ledger%bond = stored
    end associate

  contains

    !> Forces of one field, what they do to the nodes, and works with the mean velocities of the
    !! kick: what nodes give, less what springs store and dashpots take, is what grains get.
    subroutine bind_field(field, gap, v, d0, after, d, force)
      type(bridge_field_type), intent(in) :: field
      real(wp), intent(in) :: gap(:, :)          !! (3, grains) [m]
      real(wp), intent(in) :: v(:, :), d0(:, :)  !! before the kick, of grains and nodes [m/s]
      real(wp), intent(inout) :: after(:, :), d(:, :)  !! after it
      real(wp), intent(out) :: force(:, :)
      real(wp), dimension(3, size(v, 2)) :: rate, dashpot
      real(wp) :: on_nodes(3, size(field%at)), given, taken, lost
      integer :: k

      rate = field%gap(v, d0)
      call self%springs%forces(field, gap, rate, force, dashpot)
      stored = stored - 0.5_wp*sum((force - dashpot)*gap)
      on_nodes = 0.0_wp
      call field%n%transposed(force, on_nodes)
      d(:, field%at) = d(:, field%at) - kick*on_nodes*field%light
      do k = 1, size(v, 2)
        after(:, k) = after(:, k) + trial%push*force(:, k)/field%grain(k)
      end do
      given = 0.5_wp*kick*sum(force*(v + after))
      taken = 0.5_wp*kick*sum(on_nodes*(d0(:, field%at) + d(:, field%at)))
      lost = -0.5_wp*kick*sum(dashpot*(rate + field%gap(after, d)))
      call self%o%ledger%add(given, taken - lost, 0.5_wp*kick*sum(abs(force*(v + after))))
      self%o%ledger%lost = self%o%ledger%lost + lost
    end subroutine bind_field
  end subroutine bind

  !> Forces on the grains; those on the nodes are -N' times them.
  pure subroutine forces(self, field, gap, rate, force, dashpot)
    class(penalty_springs_type), intent(in) :: self
    type(bridge_field_type), intent(in) :: field
    real(wp), intent(in) :: gap(:, :), rate(:, :)        !! (3, grains) [m], [m/s]
    real(wp), intent(out) :: force(:, :), dashpot(:, :)  !! all, and the part of dashpots [N]
    dashpot = -2.0_wp*self%damping*self%rate*field%share*rate
    force = dashpot - self%rate**2*field%share*gap
  end subroutine forces

  subroutine log_bond(self, log)
    class(penalty_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    call log%item('penalty springs', short_number(self%factor)//' of the stable step', &
                  'dashpots '//short_number(taken(self) - self%factor))
  end subroutine log_bond

  subroutine own_columns(self, columns)
    class(penalty_type), intent(in) :: self
    type(string_type), allocatable, intent(inout) :: columns(:)
    call append_string(columns, 'penalty_energy [J]')
  end subroutine own_columns

  function own_values(self) result(values)
    class(penalty_type), intent(in) :: self
    real(wp), allocatable :: values(:)
    values = [self%o%ledger%bond]
  end function own_values

  !> Grains of the domain move by themselves, with their share of their mass.
  subroutine build_sprung(self, o, contacts, points, inertia, kicks)
    class(sprung_type), intent(inout) :: self
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    real(wp), intent(in) :: inertia(:)  !! least principal moment of the grains [kg m^2]
    logical, intent(in), optional :: kicks
    call self%coupled_type%build(o, contacts, points, inertia, kicks)
    associate (ghost => o%sets%ghost, weight => self%bridge%weight)
      self%light(ghost) = 1.0_wp/(weight*o%pack%mass(ghost))
      self%inverse_inertia(ghost) = 1.0_wp/(weight*inertia(ghost))
    end associate
  end subroutine build_sprung

  !> All grains and the nodes of the domain take part, of no special form.
  subroutine start_sprung(self, o, y)
    class(sprung_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(out) :: y
    integer :: k, c
    call self%coupled_type%start(o, y)
    associate (at => self%bridge%move%at)
      do k = 1, size(at)
        y%u(:, at(k)) = [(sin(2.1_wp*k + 1.9_wp*c), c=1, 3)]
      end do
    end associate
    where (o%own%held) y%u = 0.0_wp
  end subroutine start_sprung

  !> r = K y: contacts, elements at the free grains, springs.
  subroutine sprung_stiffness_times(self, o, y, r)
    class(sprung_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: y
    type(motion_type), intent(inout) :: r
    type(motion_type) :: of_elements

    r = y
    r%q = 0.0_wp
    r%theta = 0.0_wp
    call add_contacts(self%partition, y, r)
    call add_elements(self, o, y, r)
    of_elements = r
    r%u = 0.0_wp
    r%phi = 0.0_wp
    associate (ghost => o%sets%ghost, b => self%bridge)
      call add_springs(b%move, y%q(:, ghost), y%u, of_elements%u, r%q, r%u)
      if (b%turns) &
        call add_springs(b%turn, y%theta(:, ghost), y%phi, of_elements%phi, r%theta, r%phi)
    end associate
    r%q = merge(r%q, 0.0_wp, spread(self%light, 1, 3) > 0.0_wp)/self%left
    r%theta = merge(r%theta, 0.0_wp, spread(self%inverse_inertia, 1, 3) > 0.0_wp)/self%left
    r%u = merge(0.0_wp, r%u, o%own%held)/self%left
    r%phi = merge(0.0_wp, r%phi, o%own%held_phi)/self%left

  contains

    !> Springs of a field; f of the nodes that are bound.
    subroutine add_springs(field, q, d, element, on_grains, f)
      type(bridge_field_type), intent(in) :: field
      real(wp), intent(in) :: q(:, :), d(:, :), element(:, :)
      real(wp), intent(inout) :: on_grains(:, :)  !! (3, all grains)
      real(wp), intent(inout) :: f(:, :)          !! (3, nodes of the overlap)
      real(wp) :: pull(3, size(q, 2)), on_nodes(3, size(field%at))
      pull = self%rate**2*field%share*field%gap(q, d)
      on_grains(:, o%sets%ghost) = on_grains(:, o%sets%ghost) + pull
      on_nodes = 0.0_wp
      call field%n%transposed(pull, on_nodes)
      f(:, field%at) = element(:, field%at) - on_nodes
    end subroutine add_springs
  end subroutine sprung_stiffness_times

  !> Accelerations in place of forces; bound grains with their share of their mass.
  subroutine accelerate_sprung(self, o, r)
    class(sprung_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(inout) :: r
    r%q = r%q*spread(self%light, 1, 3)
    r%theta = r%theta*spread(self%inverse_inertia, 1, 3)
    associate (b => self%bridge)
      r%u(:, b%move%at) = r%u(:, b%move%at)*b%move%light
      if (b%turns) r%phi(:, b%turn%at) = r%phi(:, b%turn%at)*b%turn%light
    end associate
  end subroutine accelerate_sprung

  pure real(wp) function sprung_work(self, o, y, r) result(work)
    class(sprung_type), intent(in) :: self
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y, r
    work = sum(y%q*r%q) + sum(y%theta*r%theta) + sum(y%u*r%u) + sum(y%phi*r%phi)
  end function sprung_work
end module cpl_penalty
