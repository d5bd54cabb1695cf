!> One-point driver of the micromorphic solid: each of the 45 components of F, chi and grad chi
!! follows a curve, is free under a force that follows a curve, or (of chi) equals that of F.
!! Free components are found by Newton with the consistent tangent; steps that do not converge are
!! halved.
module fem_mm_path
  use, intrinsic :: iso_fortran_env, only: error_unit
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgesv
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, read_curves, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, packed_motion, unpacked_motion, packed_force
  use fem_mm_plastic, only: mm_point_type, update_point, failure_text
  use fem_mm_report, only: energy_warning, flow_warning, held_warning
  use fem_mm_setup, only: read_micromorphic, solid_of
  use fem_mm_table, only: open_point_table, write_point_row
  use fem_mm_tensor, only: determinant
  implicit none
  private
  public :: follow_micromorphic

  integer(i4), parameter :: most_iterations = 30, most_halvings = 10
  integer(i4), parameter :: held = 0, free = 1, tied = 2
  real(wp), parameter :: accuracy = 1.0e-12_wp   !! of forces, against moduli
  real(wp), parameter :: most_change = 0.5_wp    !! of a component in one iteration [-]

  !> Control of the 45 components.
  type :: control_type
    integer(i4) :: kind(45) = held, curve(45) = 0
    real(wp) :: scale(45) = 0.0_wp
    logical :: named(45) = .false.
  end type control_type

  !> The point as it is.
  type :: track_type
    real(wp) :: time = 0.0_wp, work = 0.0_wp
    type(mm_motion_type) :: motion
    type(mm_point_type) :: point
    integer(i4) :: iterations = 0  !! of the last step
  end type track_type

contains

  !> Follow &micro_point and write `path`; faults D351 for controls that make no sense, N350 where
  !! the path cannot be followed, N351 where it turns the body inside out.
  subroutine follow_micromorphic(deck, path, check, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: path
    logical, intent(in) :: check
    type(error_list_type), intent(inout) :: errors
    type(mm_law_type) :: law
    type(control_type) :: control
    type(curve_type), allocatable :: curve(:)
    type(track_type) :: track
    type(history_type) :: file
    character(len=:), allocatable :: text
    real(wp) :: t_end
    integer(i4) :: k, m, steps

    m = solid_of(deck, 'micro_point', 1, errors)
    if (m == 0) return
    call read_micromorphic(deck, m, law, errors)
    call read_curves(deck, 'D304', curve, errors)
    call read_controls(deck, curve, control, errors)
    call deck%get('micro_point', 1, 'steps', steps)
    t_end = 1.0_wp
    if (deck%given('run', 1, 't_end')) call deck%get('run', 1, 't_end', t_end)
    if (errors%any()) return
    text = energy_warning(law%elastic)
    if (len(text) > 0) write (error_unit, '(a)') &
      'warning: the stored energy is not positive definite: '//text
    call warn(flow_warning(law))
    call warn(held_warning(law, all(control%kind(10:18) /= free)))
    if (check) return
    call open_point_table(file, path, errors)
    if (errors%any()) return
    call update_point(law, [track%motion, track%motion], track%point%state, track%point)
    call write_point_row(file, 0.0_wp, track%motion, track%point, 0.0_wp, 0, errors)
    do k = 1, steps
      call step_to(law, control, curve, k*t_end/steps, track, errors)
      if (errors%any()) exit
      call write_point_row(file, track%time, track%motion, track%point, track%work, &
                           track%iterations, errors)
    end do
    call file%close(errors)
  end subroutine follow_micromorphic

  subroutine warn(text)
    character(len=*), intent(in) :: text
    if (len(text) > 0) write (error_unit, '(a)') 'warning: '//text
  end subroutine warn

  !> Rows for a whole field first, then those for single components.
  subroutine read_controls(deck, curve, control, errors)
    type(deck_type), intent(in) :: deck
    type(curve_type), intent(in) :: curve(:)
    type(control_type), intent(inout) :: control
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k, pass, first, last

    do pass = 1, 2
      do k = 1, deck%count('micro_control')
        call deck%get('micro_control', k, 'component', name)
        call places(name, first, last)
        if (first == 0) then
          if (pass == 1) call deck%fault(errors, 'D351', "there is no component '"//name//"'", &
            'micro_control', k, 'component', &
            "F11, chi12, grad_chi123, or 'F', 'chi', 'grad_chi' for all of them")
          cycle
        end if
        if ((pass == 1) .eqv. (first == last)) cycle
        call set_control(deck, curve, k, first, last, control, errors)
      end do
      control%named = .false.
    end do
  end subroutine read_controls

  !> Places of a name among the 45; zero if there are none.
  pure subroutine places(name, first, last)
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: first, last
    character(len=*), parameter :: field(3) = [character(len=8) :: 'F', 'chi', 'grad_chi']
    integer(i4), parameter :: begin(3) = [1, 10, 19], finish(3) = [9, 18, 45]
    integer(i4) :: f, n, i, index_of(3)
    first = 0
    last = 0
    do f = 1, 3
      n = len_trim(field(f))
      if (len(name) < n) cycle
      if (name(:n) /= trim(field(f))) cycle
      if (len(name) == n) then
        first = begin(f)
        last = finish(f)
        return
      end if
      if (len(name) /= n + merge(3, 2, f == 3)) cycle
      index_of = 1
      do i = 1, len(name) - n
        index_of(i) = index('123', name(n + i:n + i))
      end do
      if (any(index_of == 0)) return
      first = begin(f) + index_of(1) - 1 + 3*(index_of(2) - 1) + 9*(index_of(3) - 1)
      last = first
    end do
  end subroutine places

  subroutine set_control(deck, curve, k, first, last, control, errors)
    type(deck_type), intent(in) :: deck
    type(curve_type), intent(in) :: curve(:)
    integer(i4), intent(in) :: k, first, last
    type(control_type), intent(inout) :: control
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kind, name
    real(wp) :: scale
    integer(i4) :: c

    call deck%get('micro_control', k, 'component', name)
    call deck%get('micro_control', k, 'kind', kind)
    call deck%get('micro_control', k, 'scale', scale)
    call curve_index(deck, 'D303', curve, 'micro_control', k, c, errors)
    if (any(control%named(first:last))) call deck%fault(errors, 'D351', 'two rows control '//name, &
      'micro_control', k, 'component', 'name each component once')
    control%named(first:last) = .true.
    if (kind == 'macro' .and. (first < 10 .or. first > 18)) call deck%fault(errors, 'D351', &
      "kind = 'macro' makes chi equal to F: it means nothing to "//name, 'micro_control', k, &
      'kind', "use 'motion' or 'force'")
    control%kind(first:last) = held
    if (kind == 'force') control%kind(first:last) = free
    if (kind == 'macro') control%kind(first:last) = tied
    control%scale(first:last) = scale
    control%curve(first:last) = c
  end subroutine set_control

  !> Advance to a time, halving steps that do not converge.
  subroutine step_to(law, control, curve, time, track, errors)
    type(mm_law_type), intent(in) :: law
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    type(track_type), intent(inout) :: track
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: why
    real(wp) :: goal, size_of, least

    size_of = time - track%time
    least = size_of*0.5_wp**most_halvings
    do while (track%time < time)
      goal = track%time + size_of
      if (goal >= time - 0.5_wp*least) goal = time
      call one_step(law, control, curve, goal, track, why)
      if (len(why) == 0) then
        size_of = 2.0_wp*size_of
        cycle
      end if
      size_of = 0.5_wp*size_of
      if (size_of >= least) cycle
      if (index(why, 'determinant') > 0) then
        call errors%add('N351', 'the path turns the point inside out after time '// &
          str(track%time)//' s: '//why, '&micro_point', 'F and chi need positive determinants')
      else
        call errors%add('N350', 'the point cannot follow the path beyond time '// &
          str(track%time)//' s: '//why, '&micro_point', 'rounding of the cone returns from '// &
          'tension; hold a motion where a force cannot be carried')
      end if
      return
    end do
  end subroutine step_to

  !> One step to a time; '' or why it did not converge: then nothing is changed.
  subroutine one_step(law, control, curve, time, track, why)
    type(mm_law_type), intent(in) :: law
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    type(track_type), intent(inout) :: track
    character(len=:), allocatable, intent(out) :: why
    type(mm_motion_type) :: there
    type(mm_point_type) :: point
    real(wp) :: x(45), tangent(45, 45), left(45), change(45), before, now
    integer(i4) :: k

    x = packed_motion(track%motion)
    call prescribe(control, curve, time, x)
    before = huge(1.0_wp)
    do k = 1, most_iterations
      there = unpacked_motion(x)
      why = 'a determinant of F or chi is not positive'
      if (.not. (determinant(there%f) > 0.0_wp .and. determinant(there%chi) > 0.0_wp)) return
      call update_point(law, [track%motion, there], track%point%state, point, tangent)
      why = failure_text(point)
      if (.not. point%done) return
      why = 'the forces are not finite'
      if (.not. all(abs(packed_force(point%force)) <= huge(1.0_wp))) return
      left = missing(control, curve, time, packed_force(point%force))
      now = maxval(abs(left))/law%modulus
      if (now <= accuracy .and. (now > 0.1_wp*before .or. now <= 0.0_wp)) exit
      before = now
      call solve_free(law, control, tangent, left, change, why)
      if (len(why) > 0) return
      x = x + change
    end do
    why = 'the free components did not converge in '//str(most_iterations)//' iterations'
    if (k > most_iterations) return
    why = ''
    track%work = track%work + 0.5_wp*sum((packed_force(point%force) &
      + packed_force(track%point%force))*(x - packed_motion(track%motion)))
    track%motion = there
    track%point = point
    track%time = time
    track%iterations = k
  end subroutine one_step

  !> Put the prescribed components into x, and those of chi that follow F.
  pure subroutine prescribe(control, curve, time, x)
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    real(wp), intent(inout) :: x(45)
    integer(i4), parameter :: diagonal(6) = [1, 5, 9, 10, 14, 18]
    integer(i4) :: k
    do k = 1, 45
      if (control%kind(k) == held) x(k) = value_at(control, curve, time, k) &
        + merge(1.0_wp, 0.0_wp, any(diagonal == k))
    end do
    do k = 10, 18
      if (control%kind(k) == tied) x(k) = x(k - 9)
    end do
  end subroutine prescribe

  pure real(wp) function value_at(control, curve, time, k)
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    integer(i4), intent(in) :: k
    value_at = control%scale(k)
    if (control%curve(k) > 0) value_at = value_at*curve(control%curve(k))%at(time)
  end function value_at

  !> Prescribed less present force of the free components, zero for the others.
  pure function missing(control, curve, time, force) result(left)
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time, force(45)
    real(wp) :: left(45)
    integer(i4) :: k
    left = 0.0_wp
    do k = 1, 45
      if (control%kind(k) /= free) cycle
      left(k) = value_at(control, curve, time, k) - force(k)
      if (k > 9) cycle
      if (control%kind(k + 9) == tied) left(k) = left(k) - force(k + 9)
    end do
  end function missing

  !> Newton's change of the free components, and of those of chi that follow them.
  subroutine solve_free(law, control, tangent, left, change, why)
    type(mm_law_type), intent(in) :: law
    type(control_type), intent(in) :: control
    real(wp), intent(in) :: tangent(45, 45), left(45)
    real(wp), intent(out) :: change(45)
    character(len=:), allocatable, intent(out) :: why
    real(wp) :: matrix(45, 45), whole(45, 45), b(45)
    integer(i4) :: place(45), pivot(45), n, k, info

    whole = tangent
    do k = 1, 9
      if (control%kind(k + 9) /= tied) cycle
      whole(:, k) = whole(:, k) + whole(:, k + 9)
      whole(k, :) = whole(k, :) + whole(k + 9, :)
    end do
    n = count(control%kind == free)
    place(:n) = pack([(k, k=1, 45)], control%kind == free)
    matrix(:n, :n) = whole(place(:n), place(:n))
    b(:n) = left(place(:n))
    info = 0
    if (n > 0) call dgesv(n, 1, matrix, 45, pivot, b, 45, info)
    change = 0.0_wp
    change(place(:n)) = b(:n)
    do k = 1, 9
      if (control%kind(k + 9) == tied .and. control%kind(k) == free) change(k + 9) = change(k)
    end do
    why = ''
    if (info /= 0) then
      why = 'the forces leave a free component undetermined'
    else if (maxval(abs(change(:18))) > most_change &
             .or. law%length*maxval(abs(change(19:))) > most_change) then
      why = 'a free component runs away: nothing carries its force'
    end if
  end subroutine solve_free
end module fem_mm_path
