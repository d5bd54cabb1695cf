!> Grains that break under a partner: between two exchanges, when one is accepted.
!!
!! What the partner counts on never breaks (W433): ghosts, grains of its sets, those with a mass
!! factor and those with contacts that it weighs. Fault N233.
module dem_port_breakage
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use dem_breakage, only: partner_type
  use dem_clock, only: dem_clock_type
  use dem_model, only: dem_model_type
  use dem_records, only: index_of
  use dem_sets, only: dem_sets_type
  use dem_state, only: dem_data_type, kind_ghost
  implicit none
  private
  public :: break_accepted

contains

  !> Free grains above their strength break, if a look has been due since the last exchange; sets
  !! have their grains by the new numbers.
  subroutine break_accepted(model, sets, since, drift, changed, errors)
    type(dem_model_type), intent(inout) :: model
    type(dem_sets_type), intent(inout) :: sets
    type(dem_clock_type), intent(in) :: since  !! clock of the last exchange
    real(wp), intent(in) :: drift              !! step that the partner takes; 0: own steps [s]
    logical, intent(out) :: changed
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: before(:), border(:)
    integer(i4), allocatable :: index(:)
    type(partner_type) :: partner

    changed = .false.
    if (.not. model%breakage%due(model%clock%steps, since%steps)) return
    before = model%system%grains%id
    allocate (border(0))
    if (model%system%parts%active) border = before(model%system%parts%near)
    call model%timers%start('breakage')
    partner%since = since%steps
    partner%held = counted_on(model%system%dem_data_type, sets)
    call model%breakage%look(model%system, model%clock%steps, model%clock%time(), changed, errors, &
                             partner)
    call warn_once(model)
    if (changed .and. .not. errors%any()) then
      call sets%renumber(before, model%system, errors)
      call model%histories%find_driven(model%system)
      call model%system%find(border, index, errors)
      if (size(border) > 0) call model%system%set_border(index)
    end if
    if (maxval(model%system%crushed) > 0.0_wp .and. .not. errors%any()) &
      call check_drift(model, drift, errors)
    call model%timers%stop('breakage')
  end subroutine break_accepted

  !> Grains that a partner counts on.
  pure function counted_on(d, sets) result(held)
    type(dem_data_type), intent(in) :: d
    type(dem_sets_type), intent(in) :: sets
    logical :: held(d%grains%n)
    real(wp), parameter :: same = 1.0e-12_wp
    integer(i4) :: k, j, i
    held = sets%mark(d%grains%n) .or. d%grains%kind == kind_ghost
    if (allocated(d%base)) held = held .or. abs(d%grains%mass - d%base(1, :)) > same*d%base(1, :)
    do k = 1, d%weights%n
      if (abs(d%weights%value(k) - 1.0_wp) <= same) cycle
      do j = 1, 2
        i = index_of(d, real(d%weights%id(j, k), wp))
        if (i > 0) held(i) = .true.
      end do
    end do
  end function counted_on

  !> W433 as soon as one of them is above its strength; how many there were is told at the end.
  subroutine warn_once(model)
    type(dem_model_type), intent(inout) :: model
    if (model%breakage%warned .or. len(model%breakage%told_above()) == 0) return
    model%breakage%warned = .true.
    call model%log%warn(model%breakage%told_above())
  end subroutine warn_once

  !> Fragments and their contacts must bear the step of a partner that steps with the grains (N233).
  subroutine check_drift(model, drift, errors)
    type(dem_model_type), intent(in) :: model
    real(wp), intent(in) :: drift
    type(error_list_type), intent(inout) :: errors
    real(wp) :: limit
    if (.not. drift > 0.0_wp) return
    limit = model%system%step_limit()
    if (drift <= limit) return
    call errors%add('N233', 'grains have broken: the stable step is '//short_number(limit)// &
                    ' s now, the partner steps by '//short_number(drift)//' s', &
                    model%deck%source%path, 'take a shorter step from the start, or a larger '// &
                    '&breakage smallest')
  end subroutine check_drift
end module dem_port_breakage
