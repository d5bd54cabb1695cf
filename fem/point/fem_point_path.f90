!> Material point along a path of &control rows: six linear conditions on stress and strain at every
!! time, solved by Newton with the consistent tangent; steps that do not converge are halved.
module fem_point_path
  use talus_kinds, only: wp, i4
  use talus_lapack, only: dgesv
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use fem_law, only: fem_law_type, integrate
  use fem_point_steps, only: parts_type, append_states, most_iterations, accuracy, relative, wild
  use fem_voigt, only: unit, trace, magnitude
  implicit none
  private
  public :: follow_path

  character(len=2), parameter :: component(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'zx']

  !> The six conditions: part_stress sigma + part_strain epsilon = scale curve(t).
  type :: control_type
    integer(i4) :: n = 0
    real(wp) :: stress(6, 6) = 0.0_wp, strain(6, 6) = 0.0_wp  !! rows
    real(wp) :: scale(6) = 0.0_wp
    integer(i4) :: curve(6) = 0
  end type control_type

  !> The point as it is.
  type :: point_type
    real(wp) :: time = 0.0_wp
    real(wp) :: strain(6) = 0.0_wp, stress(6) = 0.0_wp
    real(wp), allocatable :: state(:)
    integer(i4) :: iterations = 0  !! of the last step
    real(wp) :: tangent(6, 6) = 0.0_wp  !! d stress/d strain of the last step [Pa]
    logical :: shows_tangent = .false.  !! is it written?
  end type point_type

contains

  !> Follow the path and write `path`; faults D332 for conditions that are not six, D333 for a start
  !! that the law does not admit, N310 where the path cannot be followed.
  subroutine follow_path(deck, law, curve, path, check, errors)
    type(deck_type), intent(in) :: deck
    class(fem_law_type), intent(in) :: law
    type(curve_type), intent(in) :: curve(:)
    character(len=*), intent(in) :: path
    logical, intent(in) :: check
    type(error_list_type), intent(inout) :: errors
    type(control_type) :: control
    type(point_type) :: point
    type(history_type) :: file
    real(wp), allocatable :: start(:)
    real(wp) :: t_end
    integer(i4) :: k, steps

    call read_controls(deck, curve, control, errors)
    call deck%get('point', 1, 'stress', start)
    point%stress = start
    allocate (point%state(law%states))
    call begin_point(deck, law, point, errors)
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
  end subroutine follow_path

  !> Rows of the deck, and those that hold shear strains which no row names.
  subroutine read_controls(deck, curve, control, errors)
    type(deck_type), intent(in) :: deck
    type(curve_type), intent(in) :: curve(:)
    type(control_type), intent(inout) :: control
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, kind
    real(wp), allocatable :: parts(:)
    integer(i4) :: k, j, n

    control%n = deck%count('control')
    n = min(6_i4, control%n)
    do k = 1, n
      call deck%get('control', k, 'component', name)
      call deck%get('control', k, 'kind', kind)
      if (verify(name, 'k123') == 0 .and. len(name) > 0) then
        call deck%fault(errors, 'D332', "'"//name//"' is a component of micropolar points", &
          'control', k, 'component', 'of this law it is xx, yy, zz, xy, yz or zx')
      else if (len(name) > 0) then
        j = (index('xx yy zz xy yz zx', name) + 2)/3
        if (kind == 'stress') control%stress(k, j) = 1.0_wp
        if (kind == 'strain') control%strain(k, j) = 1.0_wp
      else
        call deck%get('control', k, 'stress_part', parts)
        control%stress(k, :) = parts
        call deck%get('control', k, 'strain_part', parts)
        control%strain(k, :) = parts
      end if
      call deck%get('control', k, 'scale', control%scale(k))
      call curve_index(deck, 'D303', curve, 'control', k, control%curve(k), errors)
      if (all(abs(control%stress(k, :)) + abs(control%strain(k, :)) <= 0.0_wp)) call deck%fault( &
        errors, 'D332', 'the row controls nothing', 'control', k, 'component', &
        'give component, or stress_part or strain_part')
    end do
    do j = 4, 6
      if (control%n >= 6) exit
      if (any(abs(control%stress(:n, j)) + abs(control%strain(:n, j)) > 0.0_wp)) cycle
      control%n = control%n + 1
      control%strain(control%n, j) = 1.0_wp
    end do
    if (control%n /= 6) call deck%fault(errors, 'D332', 'the path has '//str(control%n)// &
      ' conditions (shear strains that no row names are held), not 6', 'point', 1, '', &
      'give three &control rows for a path without shear')
  end subroutine read_controls

  subroutine begin_point(deck, law, point, errors)
    type(deck_type), intent(in) :: deck
    class(fem_law_type), intent(in) :: law
    type(point_type), intent(inout) :: point
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: fault, cure
    call law%begin(point%stress, point%state, fault, cure)
    if (len(fault) > 0) call deck%fault(errors, 'D333', fault, 'point', 1, 'stress', cure)
  end subroutine begin_point

  !> Tangent of a step of no length.
  subroutine start_tangent(law, point)
    class(fem_law_type), intent(in) :: law
    type(point_type), intent(inout) :: point
    real(wp) :: stress(6), state(size(point%state)), nothing(6)
    logical :: good
    nothing = 0.0_wp
    stress = point%stress
    state = point%state
    call integrate(law, nothing, stress, state, point%tangent, good)
  end subroutine start_tangent

  !> Advance to a time, halving steps that do not converge.
  subroutine step_to(law, control, curve, time, point, errors)
    class(fem_law_type), intent(in) :: law
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
      str(point%time)//' s, strain '//str(point%strain(3))//' along z, stress '// &
      str(point%stress(3))//' Pa', 'material '//trim(law%id), &
      'is a stress prescribed that the material cannot carry? Control the strain there')
  end subroutine step_to

  !> One step to a time by Newton's method; a step that does not converge changes nothing.
  subroutine one_step(law, control, curve, time, point, good)
    class(fem_law_type), intent(in) :: law
    type(control_type), intent(in) :: control
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time
    type(point_type), intent(inout) :: point
    logical, intent(out) :: good
    real(wp), dimension(6) :: d, row, wanted, left, stress
    real(wp) :: matrix(6, 6), tangent(6, 6), change(6, 1), moduli(2), state(size(point%state))
    real(wp) :: largest, before
    integer :: pivot(6), info
    integer(i4) :: k, j

    d = 0.0_wp
    before = huge(1.0_wp)
    moduli = law%modulus(point%stress)
    do j = 1, 6
      row(j) = 1.0_wp/max(maxval(abs(control%strain(j, :))), &
                          maxval(abs(control%stress(j, :)))*maxval(moduli))
      wanted(j) = control%scale(j)
      if (control%curve(j) > 0) wanted(j) = wanted(j)*curve(control%curve(j))%at(time)
    end do
    do k = 1, most_iterations
      stress = point%stress
      state = point%state
      call integrate(law, d, stress, state, tangent, good)
      if (.not. good) return
      matrix = matmul(control%stress, tangent) + control%strain
      left = wanted - matmul(control%stress, stress) - matmul(control%strain, point%strain + d)
      largest = maxval(abs(row*left))
      good = largest <= accuracy + relative*maxval(abs(point%strain + d))
      if (k > 1 .and. good .and. largest >= 0.1_wp*before) exit
      if (k > 1 .and. largest <= 0.0_wp) exit
      before = largest
      change(:, 1) = row*left
      do j = 1, 6
        matrix(:, j) = row*matrix(:, j)
      end do
      call dgesv(6, 1, matrix, 6, pivot, change, 6, info)
      good = info == 0 .and. maxval(abs(change)) < wild
      if (.not. good) return
      d = d + change(:, 1)
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
    class(fem_law_type), intent(in) :: law
    character(len=*), intent(in) :: path
    logical, intent(in) :: tangent  !! is it written?
    type(history_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    integer(i4) :: k, j
    call append_string(columns, 'time [s]')
    do k = 1, 6
      call append_string(columns, 'strain '//component(k)//' [-]')
    end do
    do k = 1, 6
      call append_string(columns, 'stress '//component(k)//' [Pa]')
    end do
    call append_string(columns, 'p [Pa]')
    call append_string(columns, 'q [Pa]')
    call append_states(law, columns)
    do k = 1, merge(6, 0, tangent)
      do j = 1, 6
        call append_string(columns, 'stress '//component(k)//' by strain '//component(j)//' [Pa]')
      end do
    end do
    call file%open(path, columns, .false., errors)
  end subroutine open_table

  !> p is the mean compressive stress, q = sqrt(3/2 s:s).
  subroutine write_row(point, file, errors)
    type(point_type), intent(in) :: point
    type(history_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp) :: p, slopes(merge(36, 0, point%shows_tangent))
    p = -trace(point%stress)/3.0_wp
    slopes = reshape(transpose(point%tangent), shape(slopes))
    call file%write([point%time, point%strain, point%stress, p, &
      sqrt(1.5_wp)*magnitude(point%stress + p*unit), point%state, &
      real(point%iterations, wp), slopes], errors)
  end subroutine write_row
end module fem_point_path
