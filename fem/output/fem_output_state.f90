!> Results of laws with a state: cell means of the state variables, yield flags, points; the table
!! of Newton's iterations.
module fem_output_state
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use talus_xdmf, only: xdmf_type, xdmf_cell
  use fem_body, only: fem_body_type
  use fem_law, only: at_flag, at_iterations, at_dissipated, at_plastic, common_size, &
    fem_law_type
  implicit none
  private
  public :: put_states, describe_states, newton_titles, write_newton

contains

  !> Attributes of the cells.
  subroutine describe_states(body, xdmf)
    type(fem_body_type), intent(in) :: body
    type(xdmf_type), intent(inout) :: xdmf
    type(string_type), allocatable :: names(:)
    integer(i4) :: k
    call xdmf%attribute('yield', 'yield', xdmf_cell, 1)
    call xdmf%attribute('local_iterations', 'local_iterations', xdmf_cell, 1)
    call xdmf%attribute('dissipation', 'dissipation', xdmf_cell, 1)
    call xdmf%attribute('plastic_strain', 'plastic_strain', xdmf_cell, 6)
    if (body%stages%active) call xdmf%attribute('active', 'active', xdmf_cell, 1)
    call law_states(body, names)
    do k = 1, size(names)
      call xdmf%attribute(names(k)%s, names(k)%s, xdmf_cell, 1)
    end do
  end subroutine describe_states

  !> Names, without unit, of all states beyond the common ones, each once.
  subroutine law_states(body, names)
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: m, k, j
    logical :: known
    allocate (names(0))
    do m = 1, size(body%matter%law)
      if (.not. in_use(body, m)) cycle
      do k = common_size + 1, body%matter%law(m)%law%states
        known = .false.
        do j = 1, size(names)
          known = known .or. names(j)%s == plain(body%matter%law(m)%law%state_name(k))
        end do
        if (.not. known) call append_string(names, plain(body%matter%law(m)%law%state_name(k)))
      end do
    end do
  end subroutine law_states

  !> Does an element have law m?
  pure logical function in_use(body, m)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: m
    in_use = body%whole%uses_law(m, body%matter%law_of)
  end function in_use

  pure function plain(name) result(text)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    text = name(:index(name, ' ') - 1)
  end function plain

  !> Datasets of a step: yield (the largest flag of an element's points: 1 yields, 2 at the apex),
  !! local iterations (most), volume means of the others; zero where a law has no such state.
  subroutine put_states(body, points, file, group, errors)
    type(fem_body_type), intent(in) :: body
    logical, intent(in) :: points  !! write the states of all points too
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    real(wp), allocatable :: mean(:, :), cell(:, :), state(:, :), there(:, :)
    integer(i4) :: e, k
    logical :: leads

    leads = body%whole%ranks%leads()
    allocate (mean(body%matter%states, body%mesh%elements))
    associate (m => body%matter, point => body%elastic%point)
      do e = 1, body%mesh%elements
        associate (a => point(e), b => point(e + 1) - 1)
          mean(:, e) = matmul(m%accepted_state(:, a:b), m%weight(a:b)) &
            /max(sum(m%weight(a:b)), tiny(1.0_wp))
          mean(at_flag, e) = maxval(m%accepted_state(at_flag, a:b))
          mean(at_iterations, e) = maxval(m%accepted_state(at_iterations, a:b))
        end associate
      end do
    end associate
    call law_states(body, names)
    call by_name(body, names, mean, cell)
    call body%whole%collect_cells(mean)
    call body%whole%collect_cells(cell)
    if (points) then
      state = body%matter%accepted_state
      call body%whole%collect_points(state)
    end if
    if (body%stages%active) then
      there = reshape(merge(0.0_wp, 1.0_wp, body%elastic%absent), [1, body%mesh%elements])
      call body%whole%collect_cells(there)
    end if
    if (.not. leads) return
    call file%put(group//'/yield', mean(at_flag, :), errors)
    call file%put(group//'/local_iterations', mean(at_iterations, :), errors)
    call file%put(group//'/dissipation', mean(at_dissipated, :), errors)
    call file%put(group//'/plastic_strain', mean(at_plastic:at_plastic + 5, :), errors)
    do k = 1, size(names)
      call file%put(group//'/'//names(k)%s, cell(k, :), errors)
    end do
    if (points) call file%put(group//'/state_points', state, errors)
    if (body%stages%active) &
      call file%put(group//'/active', there(1, :), errors)
  end subroutine put_states

  !> Means of the states of given names (names, elements), zero where the law has no such state.
  subroutine by_name(body, names, mean, cell)
    type(fem_body_type), intent(in) :: body
    type(string_type), intent(in) :: names(:)
    real(wp), intent(in) :: mean(:, :)
    real(wp), allocatable, intent(out) :: cell(:, :)
    integer(i4) :: e, k, s
    allocate (cell(size(names), body%mesh%elements), source=0.0_wp)
    do k = 1, size(names)
      do e = 1, body%mesh%elements
        s = state_index(body%matter%law(body%matter%law_of(e))%law, names(k)%s)
        if (s > 0) cell(k, e) = mean(s, e)
      end do
    end do
  end subroutine by_name

  !> Place of the state of a name beyond the common ones, 0 if the law has none.
  pure integer(i4) function state_index(law, name)
    class(fem_law_type), intent(in) :: law
    character(len=*), intent(in) :: name
    integer(i4) :: s
    state_index = 0
    do s = common_size + 1, law%states
      if (plain(law%state_name(s)) == name) state_index = s
    end do
  end function state_index

  !> Columns of the table of iterations.
  subroutine newton_titles(columns)
    type(string_type), allocatable, intent(out) :: columns(:)
    call append_string(columns, 'time [s]')
    call append_string(columns, 'share of the step [-]')
    call append_string(columns, 'iteration [-]')
    call append_string(columns, 'residual [-]')
    call append_string(columns, 'work of the residual [J]')
    call append_string(columns, 'line search [-]')
    call append_string(columns, 'yielding points [-]')
    call append_string(columns, 'local iterations [-]')
  end subroutine newton_titles

  !> The rows of the last step, also of parts that did not converge.
  subroutine write_newton(body, table, errors)
    type(fem_body_type), intent(in) :: body
    type(history_type), intent(inout) :: table
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, body%newton%rows
      call table%write(body%newton%table(:, k), errors)
    end do
  end subroutine write_newton
end module fem_output_state
