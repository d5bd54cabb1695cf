!> Methods in which grains of the overlap are free and bound to the nodes of the continuum there
!! (theory: overlap coupling, Bridging domain). How they are bound is the method's own: `bind` is
!! called with every kick of the grains.
module cpl_domain_method
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_log, only: log_type, short_number
  use talus_port_names, only: field_scalars
  use cpl_bridge, only: bridge_type
  use cpl_bridge_setup, only: make_bridge, begin_domain, start_domain
  use cpl_bridge_step, only: drift, send_push, bridge_forces, bridge_bulk, read_bound
  use cpl_choices, only: cpl_choices_type
  use cpl_overlap_ask, only: kick_type, send_bulk, accept_both
  use cpl_overlap_method, only: overlap_method_type
  use cpl_overlap_partition, only: points_type
  use cpl_overlap_start, only: start_type
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: domain_method_type

  type, abstract, extends(overlap_method_type) :: domain_method_type
    type(bridge_type) :: bridge
  contains
    procedure :: share => share_domain
    procedure :: begin
    procedure :: exchange
    procedure :: put_own
    procedure :: get_own
    procedure :: fine_scale => gap_of_both
    procedure :: log_own => log_domain
    procedure(bond_part), deferred :: log_bond
    procedure(row_sums), deferred :: lumped
    procedure(limit_part), deferred :: check_step
    procedure(bind_part), deferred :: bind
  end type domain_method_type

  abstract interface
    !> Masses are bound by row sums, without a system of equations.
    logical function row_sums(self, run)
      import
      class(domain_method_type), intent(in) :: self
      type(cpl_run_type), intent(in) :: run
    end function row_sums

    !> D425: the step of the grains is above what is stable with what binds them.
    subroutine limit_part(self, run, points, errors)
      import
      class(domain_method_type), intent(inout) :: self
      type(cpl_run_type), intent(inout) :: run
      type(points_type), intent(in) :: points
      type(error_list_type), intent(inout) :: errors
    end subroutine limit_part

    !> Kick of nodes, and what is put on the bound grains for theirs.
    subroutine bind_part(self, grains, kick, bulk, dt)
      import
      class(domain_method_type), intent(inout) :: self
      type(cpl_solver_type), intent(in) :: grains
      real(wp), intent(in) :: kick, bulk  !! of contacts and fast elements, of others [s]
      real(wp), intent(in) :: dt          !! step of the grains [s]
    end subroutine bind_part

    !> How grains and nodes are bound.
    subroutine bond_part(self, log)
      import
      class(domain_method_type), intent(in) :: self
      type(log_type), intent(inout) :: log
    end subroutine bond_part
  end interface

contains

  !> Grains keep their masses until the domain is weighed.
  subroutine share_domain(self, run, errors)
    class(domain_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    call make_bridge(self%o, self%bridge, self%lumped(run), errors)
  end subroutine share_domain

  subroutine begin(self, run, errors)
    class(domain_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    type(start_type) :: start
    call begin_domain(self%o, self%bridge, run, start, errors)
    if (.not. (run%again .or. errors%any())) call self%check_step(run, start%points, errors)
    if (.not. errors%any()) call start_domain(self%o, self%bridge, run, errors)
  end subroutine begin

  !> From t0 to t1 [s], accepted on both sides; after a fault nothing was accepted. As in
  !! cpl_overlap_step contacts and the elements at the free grains act in every step of the grains,
  !! the other elements in kicks of half an exchange.
  subroutine exchange(self, run, t0, t1, errors)
    class(domain_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1
    type(error_list_type), intent(inout) :: errors
    real(wp) :: dt, kick, now, h
    integer(i4) :: k

    h = run%choices%exchange
    associate (o => self%o, b => self%bridge, solvers => run%solvers, timers => run%timers)
      dt = h/o%rules%substeps
      call send_bulk(o, solvers(side_solid), kick_type(0.5_wp*h, h, t0, t1), timers, errors)
      do k = 1, o%rules%substeps
        now = merge(t1, t0 + k*dt, k == o%rules%substeps)
        kick = merge(0.5_wp*dt, dt, k == 1)
        call timers%start('binding')
        call self%bind(solvers(side_grains), kick, merge(0.5_wp*h, 0.0_wp, k == 1), dt)
        call timers%stop('binding')
        call send_push(o, b, solvers(side_grains), kick_type(kick, dt, now - dt, now), timers, &
                       errors)
        if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
        if (k == 1 .and. .not. errors%any()) call solvers(side_solid)%receive(timers, errors)
        if (errors%any()) return
        call read_bound(o, b, solvers(side_grains), k == o%rules%substeps, errors)
        call drift(o, b, dt, k == o%rules%substeps)
        call bridge_forces(o, b, solvers, now, timers, errors)
        if (errors%any()) return
      end do
      call bridge_bulk(o, b, solvers(side_solid), 0.5_wp*h, t1, timers, errors)
      if (errors%any()) return
      call self%bind(solvers(side_grains), 0.5_wp*dt, 0.5_wp*h, dt)
      call send_push(o, b, solvers(side_grains), kick_type(0.5_wp*dt, 0.0_wp, t1, t1), timers, &
                     errors)
      if (.not. errors%any()) call solvers(side_grains)%receive(timers, errors)
      if (errors%any()) return
      call read_bound(o, b, solvers(side_grains), .true., errors)
      call solvers(side_grains)%reply%get(field_scalars, o%ledger%grains, errors)
    end associate
    if (.not. errors%any()) call accept(self, run, t0, t1, errors)
  end subroutine exchange

  !> ACCEPT where all are numbers (N407).
  subroutine accept(self, run, t0, t1, errors)
    class(domain_method_type), intent(inout) :: self
    type(cpl_run_type), intent(inout) :: run
    real(wp), intent(in) :: t0, t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    associate (o => self%o)
      if (.not. o%finite()) then
        call errors%add('N407', 'a force or displacement of the overlap is no number', &
                        'exchange to '//str(t1)//' s', 'one side has become unstable: check '// &
                        'the steps of both against their limits')
        return
      end if
      o%map%fine = self%fine_scale()
      o%map%past = 0.0_wp
      call accept_both(o, run%solvers, t0, t1, run%timers, errors)
      if (.not. errors%any()) call o%count_exchange()
    end associate
  end subroutine accept

  !> Who owns what, and how its sides are bound.
  subroutine log_domain(self, log, choices)
    class(domain_method_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    type(cpl_choices_type), intent(in) :: choices
    logical :: idle
    associate (o => self%o, b => self%bridge)
      call log%item('bridging domain', str(o%op%ghosts)//' grains are bound to '// &
        str(size(b%move%at))//' nodes', 'weights '//short_number(o%rules%least_weight)//' to '// &
        short_number(1.0_wp - o%rules%least_weight)//'; rotations '// &
        trim(merge('to micro-rotations', 'are free          ', b%turns)))
      call log%item('masses there', short_number(o%own%moved_mass)//' kg of grains', &
        short_number(sum(o%own%mass))// &
        ' kg of nodes, those at the far end with their outer elements')
      call self%log_bond(log)
      if (o%limit%step_limit < huge(1.0_wp)) call log%item('stable step', &
        short_number(o%limit%step_limit)// ' s', 'of grains and nodes that step with them')
      if (.not. o%forces%loads%active) return
      idle = any(abs(o%forces%loads%f) > 0.0_wp .and. &
                 spread(.not. o%own%mass(:o%op%prescribed) > 0.0_wp, 1, 3))
      if (idle) call log%warn('loads of the solid''s deck on elements of free grains do '// &
        'nothing: nodes beyond the bridging domain only follow the grains; put them on the grains')
    end associate
  end subroutine log_domain

  !> Gap between bound grains and nodes, root mean square [m].
  function gap_of_both(self) result(fine)
    class(domain_method_type), intent(in) :: self
    real(wp) :: fine
    associate (o => self%o)
      fine = sqrt(sum(self%bridge%move%gap(o%motion%d, o%motion%u)**2)/max(1, o%op%ghosts))
    end associate
  end function gap_of_both

  !> Velocities of bound grains, forces that balance their start, what binds them has taken.
  subroutine put_own(self, file, errors)
    class(domain_method_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    associate (o => self%o, b => self%bridge)
      call file%put('/bridge/v', b%v, errors)
      call file%put('/bridge/spin', b%spin, errors)
      call file%put('/bridge/force', o%forces%p, errors)
      call file%put('/bridge/moment', o%forces%m, errors)
      call file%put('/bridge/hold', b%hold, errors)
      call file%put('/bridge/hold_couple', b%hold_couple, errors)
      call file%put('/bridge/theta_ref', b%theta_ref, errors)
      call o%ledger%put_bond(file, errors)
    end associate
  end subroutine put_own

  subroutine get_own(self, file, errors)
    class(domain_method_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    associate (o => self%o, b => self%bridge)
      call file%get_into('/bridge/v', b%v, errors)
      call file%get_into('/bridge/spin', b%spin, errors)
      call file%get_into('/bridge/force', o%forces%p, errors)
      call file%get_into('/bridge/moment', o%forces%m, errors)
      call file%get_into('/bridge/hold', b%hold, errors)
      call file%get_into('/bridge/hold_couple', b%hold_couple, errors)
      call file%get_into('/bridge/theta_ref', b%theta_ref, errors)
      call o%ledger%get_bond(file, errors)
    end associate
  end subroutine get_own
end module cpl_domain_method
