!> Results of micromorphic bodies: fields of both motions, stresses, states of the points as means
!! over the elements, columns of the histories.
module fem_mm_output
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_xdmf, only: xdmf_type, xdmf_node, xdmf_cell
  use fem_body, only: fem_body_type
  use fem_law, only: at_flag, at_iterations, at_dissipated, at_plastic, common_size
  use fem_mm_body, only: phi_columns
  use fem_mm_store, only: named_states, state_title, point_stresses
  use fem_recover, only: mean_stress, nodal_stress, point_positions
  implicit none
  private
  public :: describe_micro, put_micro, chi_names, chi_values

  character(len=*), parameter :: tensors(3) = [character(len=13) :: 'stress', 'micro_stress', &
    'couple_stress']
  integer(i4), parameter :: first(3) = [1, 10, 19], last(3) = [9, 18, 45]
  character(len=*), parameter :: moving(6) = [character(len=12) :: 'u', 'v', 'reaction', 'phi', &
    'phi_rate', 'reaction_phi']

contains

  !> Attributes for ParaView.
  subroutine describe_micro(xdmf)
    type(xdmf_type), intent(inout) :: xdmf
    integer(i4) :: k
    do k = 1, size(moving)
      call xdmf%attribute(trim(moving(k)), trim(moving(k)), xdmf_node, merge(3, 9, k < 4))
    end do
    do k = 1, size(tensors)
      call xdmf%attribute(trim(tensors(k)), trim(tensors(k)), xdmf_cell, last(k) - first(k) + 1)
      call xdmf%attribute(trim(tensors(k))//'_nodal', trim(tensors(k))//'_nodal', xdmf_node, &
                          last(k) - first(k) + 1)
    end do
    call xdmf%attribute('yield', 'yield', xdmf_cell, 1)
    call xdmf%attribute('local_iterations', 'local_iterations', xdmf_cell, 1)
    call xdmf%attribute('dissipation', 'dissipation', xdmf_cell, 1)
    call xdmf%attribute('plastic_strain', 'plastic_strain', xdmf_cell, 6)
    do k = common_size + 1, named_states
      call xdmf%attribute(state_title(k), state_title(k), xdmf_cell, 1)
    end do
  end subroutine describe_micro

  !> Datasets of a step; all ranks call it together, the leader writes.
  subroutine put_micro(body, points, file, group, errors)
    type(fem_body_type), intent(in) :: body
    logical, intent(in) :: points  !! write the data of the points too
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: mean(:, :), nodal(:, :)

    allocate (mean(point_stresses, body%mesh%elements), nodal(point_stresses, body%mesh%nodes))
    call put_motions(body, file, group, errors)
    call mean_stress(body%mesh, body%dofs, body%elastic, body%matter%accepted_stress, mean)
    call nodal_stress(body%mesh, body%dofs, body%elastic, body%matter%accepted_stress, nodal)
    call body%whole%collect_cells(mean)
    if (body%whole%ranks%leads()) then
      call put_tensors(mean, '', file, group, errors)
      call put_tensors(nodal, '_nodal', file, group, errors)
    end if
    call put_means(body, file, group, errors)
    if (points) call put_points(body, file, group, errors)
  end subroutine put_micro

  !> Both motions with their rates and reactions.
  subroutine put_motions(body, file, group, errors)
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    real(wp), dimension(9, body%mesh%nodes) :: phi, rate, reaction
    integer(i4) :: n
    associate (s => body%accepted)
      call nodal_chi(body, s%u, .true., phi)
      call nodal_chi(body, s%v, .true., rate)
      call nodal_chi(body, s%reaction, .false., reaction)
      if (.not. body%whole%ranks%leads()) return
      n = body%mesh%nodes
      call file%put(group//'/u', s%u(:, :n), errors)
      call file%put(group//'/v', s%v(:, :n), errors)
      call file%put(group//'/reaction', s%reaction(:, :n), errors)
      call file%put(group//'/phi', phi, errors)
      call file%put(group//'/phi_rate', rate, errors)
      call file%put(group//'/reaction_phi', reaction, errors)
    end associate
  end subroutine put_motions

  !> The three stresses of cells, nodes or points.
  subroutine put_tensors(stress, where_from, file, group, errors)
    real(wp), intent(in) :: stress(:, :)
    character(len=*), intent(in) :: where_from  !! '', '_nodal', '_points'
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    do k = 1, size(tensors)
      call file%put(group//'/'//trim(tensors(k))//where_from, stress(first(k):last(k), :), errors)
    end do
  end subroutine put_tensors

  !> Places, stresses and states of the points.
  subroutine put_points(body, file, group, errors)
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: position(:, :), stress(:, :), state(:, :)
    allocate (position(3, body%elastic%points))
    call point_positions(body%mesh, body%dofs, body%elastic, position)
    stress = body%matter%accepted_stress
    state = body%matter%accepted_state
    call body%whole%collect_points(position)
    call body%whole%collect_points(stress)
    call body%whole%collect_points(state)
    if (.not. body%whole%ranks%leads()) return
    call put_tensors(stress, '_points', file, group, errors)
    call file%put(group//'/points_x', position, errors)
    call file%put(group//'/state_points', state, errors)
  end subroutine put_points

  !> Flags and iterations (largest of an element's points), volume means of the others.
  subroutine put_means(body, file, group, errors)
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: mean(:, :)
    integer(i4) :: e, k
    allocate (mean(named_states, body%mesh%elements))
    do e = 1, body%mesh%elements
      associate (a => body%elastic%point(e), b => body%elastic%point(e + 1) - 1, m => body%matter)
        ! where grains stand for an element whole, it has no weight
        mean(:, e) = matmul(m%accepted_state(:named_states, a:b), m%weight(a:b)) &
          /max(sum(m%weight(a:b)), tiny(1.0_wp))
        mean(at_flag, e) = maxval(m%accepted_state(at_flag, a:b))
        mean(at_iterations, e) = maxval(m%accepted_state(at_iterations, a:b))
      end associate
    end do
    call body%whole%collect_cells(mean)
    if (.not. body%whole%ranks%leads()) return
    call file%put(group//'/yield', mean(at_flag, :), errors)
    call file%put(group//'/local_iterations', mean(at_iterations, :), errors)
    call file%put(group//'/dissipation', mean(at_dissipated, :), errors)
    call file%put(group//'/plastic_strain', mean(at_plastic:at_plastic + 5, :), errors)
    do k = common_size + 1, named_states
      call file%put(group//'/'//state_title(k), mean(k, :), errors)
    end do
  end subroutine put_means

  !> Nine components 11 12 13 21 .. at all nodes of a field on the blocks of phi; between the nodes
  !! that have it as the elements interpolate it, or zero.
  subroutine nodal_chi(body, u, between, nodal)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: u(:, :)   !! (3, blocks)
    logical, intent(in) :: between
    real(wp), intent(out) :: nodal(:, :)  !! (9, nodes)
    integer(i4), parameter :: order(9) = [1, 4, 7, 2, 5, 8, 3, 6, 9]
    real(wp) :: corner(9, 8)
    real(wp), allocatable :: whole(:, :)
    integer(i4) :: e, a, n
    nodal = 0.0_wp
    do e = 1, body%mesh%elements
      associate (rule => body%elastic%rule(body%elastic%rule_of(e)), dofs => body%dofs, &
                 block => body%dofs%block(body%dofs%start(e):))
        do a = 1, rule%corners
          corner(:, a) = nine(u, dofs%phi(block(a)))
        end do
        do a = 1, rule%nodes
          n = block(a)
          if (dofs%phi(n) > 0) nodal(:, n) = nine(u, dofs%phi(n))
          if (dofs%phi(n) > 0 .or. .not. between) cycle
          nodal(:, n) = matmul(corner(:, :rule%corners), rule%middle(:, a))
        end do
      end associate
    end do
    nodal = nodal(order, :)
    if (.not. body%dofs%halo%several()) return
    allocate (whole(9, body%dofs%blocks), source=0.0_wp)
    whole(:, :body%mesh%nodes) = nodal
    call body%dofs%halo%spread_out(whole)
    nodal = whole(:, :body%mesh%nodes)
  end subroutine nodal_chi

  !> The columns of phi from a block on, as nine numbers.
  pure function nine(u, block) result(v)
    real(wp), intent(in) :: u(:, :)
    integer(i4), intent(in) :: block
    real(wp) :: v(9)
    v = reshape(u(:, block:block + phi_columns - 1), [9])
  end function nine

  !> Columns of the reactions of a group on chi.
  subroutine chi_names(name, columns)
    character(len=*), intent(in) :: name
    type(string_type), allocatable, intent(inout) :: columns(:)
    integer(i4) :: i, k
    do i = 1, 3
      do k = 1, 3
        call append_string(columns, name//' chi'//str(i)//str(k)//' [N m]')
      end do
    end do
  end subroutine chi_names

  !> Their values, for the first blocks of the group's nodes.
  pure function chi_values(body, block) result(v)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: block(:)
    real(wp) :: v(9), q(3, 3)
    integer(i4) :: c
    do c = 1, 3
      q(:, c) = sum(body%accepted%reaction(:, block + c - 1), 2)
    end do
    v = reshape(transpose(q), [9])
  end function chi_values
end module fem_mm_output
