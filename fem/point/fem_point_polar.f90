!> A micropolar point along a path: each of the nine strains gamma_kl and the nine curvatures
!! kappa_kl, or its stress or couple stress, follows a curve; what no row names is held. Newton's
!! method with the consistent tangent; steps that do not converge are halved.
module fem_point_polar
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgesv
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use fem_law_polar, only: fem_law_polar_type
  use fem_polar, only: polar_size, full_of
  use fem_point_steps, only: parts_type, append_states, most_iterations, accuracy, relative, wild
  implicit none
  private
  public :: follow_polar

  character(len=2), parameter :: kl(9) = ['11', '12', '13', '21', '22', '23', '31', '32', '33']

  !> Control of each component.
  type :: control_type
    logical :: stress(polar_size) = .false.     !! of its stress; of its strain otherwise
    real(wp) :: scale(polar_size) = 0.0_wp
    integer(i4) :: curve(polar_size) = 0
    real(wp) :: length(polar_size) = 1.0_wp     !! that makes the component a strain [-, m]
  end type control_type

  type :: point_type
    real(wp) :: time = 0.0_wp
    real(wp) :: strain(polar_size) = 0.0_wp, stress(polar_size) = 0.0_wp
    real(wp), allocatable :: state(:)
    integer(i4) :: iterations = 0  !! of the last step
    real(wp) :: tangent(polar_size, polar_size) = 0.0_wp  !! d stress/d strain of the last step
    logical :: shows_tangent = .false.                    !! is it written?
  end type point_type

contains

  !> Follow the path and write `path`; faults D332 for rows that make no sense, D333 for a start
  !! that the law does not admit, N310 where the path cannot be followed.
  subroutine follow_polar(deck, law, curve, path, check, errors)
    type(deck_type), intent(in) :: deck
    class(fem_law_polar_type), intent(in) :: law
    type(curve_type), intent(in) :: curve(:)
    character(len=*), intent(in) :: path
    logical, intent(in) :: check
    type(error_list_type), intent(inout) :: errors
    type(control_type) :: control
    type(point_type) :: point
    type(history_type) :: file
    character(len=:), allocatable :: fault, cure
    real(wp), allocatable :: start(:)
    real(wp) :: t_end
    integer(i4) :: k, steps

    call read_controls(deck, law, curve, control, errors)
    call deck%get('point', 1, 'stress', start)
    point%stress(:9) = start(full_of)
    allocate (point%state(law%states))
    call law%begin(start, point%state, fault, cure)
    if (len(fault) > 0) call deck%fault(errors, 'D333', fault, 'point', 1, 'stress', cure)
    call deck%get('point', 1, 'steps', steps)
    call deck%get('point', 1, 'tangent', point%shows_tangent)
    t_end = 1.0_wp
    if (deck%given('run', 1, 't_end')) call deck%get('run', 1, 't_end', t_end)
    if (errors%any() .or. check) return
    call open_table(law, path, point%shows_tangent, file, errors)
    if (errors%any()) return
    call start_tangent(law, point)
    call write_row(point, file, errors)
    do k = 1, steps
      call step_to(law, control, curve, k*t_end/steps, point, errors)
      if (errors%any()) exit
      call write_row(point, file, errors)
    end do
    call file%close(errors)
  end subroutine follow_polar

  subroutine read_controls(deck, law, curve, control, errors)
    type(deck_type), intent(in) :: deck
    class(fem_law_polar_type), intent(in) :: law
    type(curve_type), intent(in) :: curve(:)
    type(control_type), intent(inout) :: control
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, kind
    logical :: named(polar_size)
    integer(i4) :: k, j, c

    named = .false.
    control%length(10:) = sqrt(maxval(law%modulus_of(4:))/law%modulus_of(1))
    if (.not. control%length(10) > 0.0_wp) control%length = 1.0_wp
    do k = 1, deck%count('control')
      call deck%get('control', k, 'component', name)
      j = 0
      do c = 1, 9
        if (name == kl(c)) j = c
        if (name == 'k'//kl(c)) j = 9 + c
      end do
      if (j == 0 .or. deck%given('control', k, 'stress_part') .or. &
          deck%given('control', k, 'strain_part')) then
        call deck%fault(errors, 'D332', "a micropolar point has no component '"//name//"'", &
          'control', k, 'component', 'it has 11 to 33 and k11 to k33, a row each')
        cycle
      end if
      if (named(j)) call deck%fault(errors, 'D332', 'the component '//name//' has two rows', &
        'control', k, 'component', 'one of its strain and stress can be prescribed')
      named(j) = .true.
      call deck%get('control', k, 'kind', kind)
      control%stress(j) = kind == 'stress'
      call deck%get('control', k, 'scale', control%scale(j))
      call curve_index(deck, 'D303', curve, 'control', k, control%curve(j), errors)
    end do
  end subroutine read_controls

  !> Tangent of a step of no length.
  subroutine start_tangent(law, point)
    class(fem_law_polar_type), intent(in) :: law
    type(point_type), intent(inout) :: point
    real(wp) :: stress(polar_size), state(size(point%state)), nothing(polar_size)
    logical :: good
    nothing = 0.0_wp
    stress = point%stress
    state = point%state
    call law%polar_update(nothing, stress, state, point%tangent, good)
  end subroutine start_tangent

  !> Advance to a time, halving steps that do not converge.
  subroutine step_to(law, control, curve, time, point, errors)
    class(fem_law_polar_type), intent(in) :: law
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    type(point_type), intent(inout) :: point
    type(error_list_type), intent(inout) :: errors
    type(parts_type) :: parts
    logical :: good

    call parts%begin(point%time, time)
    do while (parts%has_goal())
      call one_step(law, control, curve, parts%goal, point, good)
      call parts%judge(good)
    end do
    if (parts%now >= time) return
    call errors%add('N310', 'the point cannot follow the path beyond time '// &
      str(point%time)//' s, stress sigma_11 '//str(point%stress(1))//' Pa, sigma_12 '// &
      str(point%stress(2))//' Pa', 'material '//trim(law%id), &
      'is a stress prescribed that the material cannot carry? Control the strain there')
  end subroutine step_to

  !> One step to a time by Newton's method; a step that does not converge changes nothing.
  subroutine one_step(law, control, curve, time, point, good)
    class(fem_law_polar_type), intent(in) :: law
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    type(point_type), intent(inout) :: point
    logical, intent(out) :: good
    real(wp), dimension(polar_size) :: d, row, wanted, left, stress
    real(wp), dimension(polar_size, polar_size) :: matrix, tangent
    real(wp) :: change(polar_size, 1), largest, before
    real(wp) :: state(size(point%state))
    integer :: pivot(polar_size), info
    integer(i4) :: k, j

    d = 0.0_wp
    before = huge(1.0_wp)
    do j = 1, polar_size
      row(j) = control%length(j)
      if (control%stress(j)) row(j) = 1.0_wp/(control%length(j)*maxval(law%modulus_of(:3)))
      wanted(j) = control%scale(j)
      if (control%curve(j) > 0) wanted(j) = wanted(j)*curve(control%curve(j))%at(time)
    end do
    do k = 1, most_iterations
      stress = point%stress
      state = point%state
      call law%polar_update(d, stress, state, tangent, good)
      if (.not. good) return
      matrix = tangent
      left = row*(wanted - merge(stress, point%strain + d, control%stress))
      largest = maxval(abs(left))
      good = largest <= accuracy + relative*maxval(abs(control%length*(point%strain + d)))
      if (k > 1 .and. good .and. largest >= 0.1_wp*before) exit
      if (k > 1 .and. largest <= 0.0_wp) exit
      before = largest
      do j = 1, polar_size
        if (control%stress(j)) cycle
        matrix(j, :) = 0.0_wp
        matrix(j, j) = 1.0_wp
      end do
      do j = 1, polar_size
        matrix(:, j) = row*matrix(:, j)/control%length(j)
      end do
      change(:, 1) = left
      call dgesv(int(polar_size), 1, matrix, int(polar_size), pivot, change, int(polar_size), info)
      good = info == 0 .and. maxval(abs(change)) < wild
      if (.not. good) return
      d = d + change(:, 1)/control%length
    end do
    good = good .and. k <= most_iterations
    if (.not. good) return
    point%stress = stress
    point%state = state
    point%tangent = tangent
    point%strain = point%strain + d
    point%time = time
    point%iterations = k
  end subroutine one_step

  subroutine open_table(law, path, tangent, file, errors)
    class(fem_law_polar_type), intent(in) :: law
    character(len=*), intent(in) :: path
    logical, intent(in) :: tangent  !! is it written?
    type(history_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    character(len=*), parameter :: what(4) = [character(len=6) :: 'gamma', 'kappa', 'sigma', 'm']
    character(len=*), parameter :: unit_of(4) = [character(len=5) :: '-', '1/m', 'Pa', 'N/m']
    integer(i4) :: k, j
    call append_string(columns, 'time [s]')
    do j = 1, 4
      do k = 1, 9
        call append_string(columns, trim(what(j))//' '//kl(k)//' ['//trim(unit_of(j))//']')
      end do
    end do
    call append_states(law, columns)
    if (tangent) call append_tangent(what, columns)
    call file%open(path, columns, .false., errors)
  end subroutine open_table

  !> Names of the slopes of stress and couple stress by strains and curvatures, stress by stress.
  subroutine append_tangent(what, columns)
    character(len=*), intent(in) :: what(4)
    type(string_type), allocatable, intent(inout) :: columns(:)
    character(len=*), parameter :: unit_of(3) = [character(len=3) :: 'Pa', 'N/m', 'N']
    integer(i4) :: i, k, s, e
    do k = 0, polar_size - 1
      do i = 0, polar_size - 1
        s = 1 + k/9
        e = 1 + i/9
        call append_string(columns, trim(what(2 + s))//' '//kl(1 + mod(k, 9))//' by '// &
          trim(what(e))//' '//kl(1 + mod(i, 9))//' ['//trim(unit_of(s + e - 1))//']')
      end do
    end do
  end subroutine append_tangent

  subroutine write_row(point, file, errors)
    type(point_type), intent(in) :: point
    type(history_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp) :: slopes(merge(polar_size**2, 0, point%shows_tangent))
    slopes = reshape(transpose(point%tangent), shape(slopes))
    call file%write([point%time, point%strain, point%stress, point%state, &
                     real(point%iterations, wp), slopes], errors)
  end subroutine write_row
end module fem_point_polar
