!> `talus-couple FILE.h5 --weights`: weights of an overlap that a file describes, without solvers.
!!
!! Reads grains, contacts, elements and points as cpl_partition has them, chooses the weights as the
!! file's attribute `method` says, and writes FILE_weights.h5: /w, /beta, residual rows of the six
!! uniform states, and, where actual forces and stresses are given, the corrected initial stress.
module cpl_partition_file
  use talus_kinds, only: wp, i4
  use talus_text, only: is_finite
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use cpl_initial, only: initial_type, initial_state_type, correct_initial
  use cpl_weight_choice, only: weight_choice_type, choose_weights, weight_choice_of, weights_given
  use cpl_partition, only: partition_type, grain_ghost, state_count, turn_none, turn_curl, &
    turn_micro, uniform_states, residual_rows, mean_sizes, worst_rows
  use cpl_weight_fit, only: fit_type
  use cpl_weights, only: kernel_shares, moment_balance
  implicit none
  private
  public :: weigh_file

  character(len=*), parameter :: format_name = 'talus-overlap'
  character(len=*), parameter :: turning_names(0:2) = [character(len=5) :: 'none', 'curl', 'micro']

contains

  !> Read, weigh, write.
  subroutine weigh_file(path, output, errors)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: output  !! folder of the result, '': beside the file
    type(error_list_type), intent(inout) :: errors
    type(partition_type) :: overlap
    type(weight_choice_type) :: method
    type(h5_file_type) :: file, result
    type(fit_type) :: fit
    real(wp), allocatable :: w(:), beta(:)

    call file%open(path, errors, format=format_name)
    if (errors%any()) return
    call read_overlap(file, overlap, errors)
    if (.not. errors%any()) call check_overlap(overlap, path, errors)
    if (.not. errors%any()) call read_method(file, overlap, method, w, beta, errors)
    if (.not. errors%any()) call choose_weights(overlap, method, w, beta, fit, errors)
    if (errors%any()) return
    call result%create(result_path(path, output), errors, format='talus-weights')
    call write_weights(overlap, method, w, beta, fit, result, errors)
    if (file%exists('/contacts/force')) call write_initial(file, overlap, w, beta, result, errors)
    call file%close(errors)
    if (.not. errors%any()) call result%commit(errors)
    if (errors%any()) call result%discard()
  end subroutine weigh_file

  !> FILE.h5 gives FILE_weights.h5.
  pure function result_path(path, output) result(name)
    character(len=*), intent(in) :: path, output
    character(len=:), allocatable :: name
    integer :: from, to
    from = scan(path, '/', back=.true.) + 1
    to = len(path)
    if (to > 3) then
      if (path(to - 2:) == '.h5') to = to - 3
    end if
    name = path(from:to)//'_weights.h5'
    if (len(output) > 0) then
      name = output//'/'//name
    else
      name = path(:from - 1)//name
    end if
  end function result_path

  subroutine read_overlap(file, overlap, errors)
    type(h5_file_type), intent(inout) :: file
    type(partition_type), intent(inout) :: overlap
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: flat(:, :)
    integer(i4) :: polar

    call file%attr_get('/', 'nodes', overlap%nodes, errors)
    polar = 0
    call file%attr_get('/', 'polar', polar, errors)
    call file%attr_get('/', 'turning', overlap%turning, errors)
    overlap%polar = polar == 1
    call file%get('/grains/kind', overlap%kind, errors)
    call file%get('/grains/cell', overlap%cell, errors)
    call file%get('/grains/depth', overlap%depth, errors)
    call file%get('/grains/shape_u', overlap%shape_u, errors)
    call file%get('/grains/shape_phi', overlap%shape_phi, errors)
    call file%get('/grains/shape_slope', flat, errors)
    if (.not. errors%any()) overlap%shape_slope = deep(flat)
    call file%get('/contacts/pair', overlap%pair, errors)
    call file%get('/contacts/arm', flat, errors)
    if (.not. errors%any()) overlap%arm = deep(flat)
    call file%get('/contacts/normal', overlap%normal, errors)
    call file%get('/contacts/stiffness', overlap%stiffness, errors)
    call file%get('/elements/node_u', overlap%node_u, errors)
    call file%get('/elements/node_phi', overlap%node_phi, errors)
    call file%get('/elements/region', overlap%region, errors)
    call file%get('/elements/moduli', flat, errors)
    if (.not. errors%any()) overlap%moduli = reshape(flat, [9, 9, size(flat, 2)])
    call file%get('/points/element', overlap%element, errors)
    call file%get('/points/volume', overlap%volume, errors)
    call file%get('/points/depth', overlap%point_depth, errors)
    call file%get('/points/slope_u', flat, errors)
    if (.not. errors%any()) overlap%slope_u = deep(flat)
    call file%get('/points/slope_mean', flat, errors)
    if (.not. errors%any()) overlap%slope_mean = deep(flat)
    call file%get('/points/value_phi', overlap%value_phi, errors)
    call file%get('/points/slope_phi', flat, errors)
    if (.not. errors%any()) overlap%slope_phi = deep(flat)
  end subroutine read_overlap

  !> (3 m, n) as (3, m, n)
  pure function deep(flat) result(array)
    real(wp), intent(in) :: flat(:, :)
    real(wp), allocatable :: array(:, :, :)
    array = reshape(flat, [3, size(flat, 1)/3, size(flat, 2)])
  end function deep

  !> I440: arrays that do not belong together, or numbers of what does not exist.
  subroutine check_overlap(overlap, path, errors)
    type(partition_type), intent(in) :: overlap
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: grains, contacts, elements, points, u, phi
    logical :: good

    grains = size(overlap%kind, kind=i4)
    contacts = size(overlap%pair, 2, i4)
    elements = size(overlap%region, kind=i4)
    points = size(overlap%element, kind=i4)
    u = size(overlap%node_u, 1, i4)
    phi = size(overlap%node_phi, 1, i4)
    good = all([size(overlap%cell), size(overlap%depth), size(overlap%shape_u, 2), &
                size(overlap%shape_phi, 2), size(overlap%shape_slope, 3)] == grains) .and. &
      all([size(overlap%arm, 3), size(overlap%normal, 2), size(overlap%stiffness, 2)] &
          == contacts) .and. &
      all([size(overlap%node_u, 2), size(overlap%node_phi, 2), size(overlap%moduli, 3)] &
          == elements) .and. &
      all([size(overlap%volume), size(overlap%point_depth), size(overlap%slope_u, 3), &
           size(overlap%slope_mean, 3), size(overlap%value_phi, 2), size(overlap%slope_phi, 3)] &
          == points) .and. &
      all([size(overlap%shape_u, 1), size(overlap%shape_slope, 2), size(overlap%slope_u, 2), &
           size(overlap%slope_mean, 2)] == u) .and. &
      all([size(overlap%shape_phi, 1), size(overlap%value_phi, 1), size(overlap%slope_phi, 2)] &
          == phi) .and. size(overlap%pair, 1) == 2 .and. size(overlap%arm, 2) == 2
    if (good) good = within(overlap%element, elements) .and. &
      all(overlap%cell >= 0 .and. overlap%cell <= elements) .and. &
      all(overlap%node_u >= 0 .and. overlap%node_u <= overlap%nodes) .and. &
      all(overlap%node_phi >= 0 .and. overlap%node_phi <= overlap%nodes) .and. &
      all(overlap%pair >= 1 .and. overlap%pair <= grains) .and. &
      any(overlap%turning == [turn_none, turn_curl, turn_micro])
    if (good) good = all(overlap%cell > 0 .or. overlap%kind /= grain_ghost)
    if (good) good = all(is_finite(overlap%stiffness)) .and. &
      all(is_finite(reshape(overlap%moduli, [size(overlap%moduli)])))
    if (.not. good) call errors%add('I440', 'the arrays of grains, contacts, elements and '// &
                                    'points do not belong together', path, 'shapes and numbers'// &
                                    ' as the page of the files says; ids count from 1')
  end subroutine check_overlap

  pure logical function within(list, most)
    integer(i4), intent(in) :: list(:), most
    within = all(list >= 1 .and. list <= most)
  end function within

  subroutine read_method(file, overlap, method, w, beta, errors)
    type(h5_file_type), intent(inout) :: file
    type(partition_type), intent(in) :: overlap
    type(weight_choice_type), intent(inout) :: method
    real(wp), allocatable, intent(inout) :: w(:), beta(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: x(:, :), middle(:, :), period(:)
    real(wp) :: radius

    call file%attr_get('/', 'method', name, errors)
    call file%attr_get('/', 'depth', method%depth, errors)
    call file%attr_get('/', 'd_max', method%d_max, errors)
    call file%attr_get('/', 'rho', method%rho, errors)
    if (errors%any()) return
    call weight_choice_of(name, method, file%path, errors)
    if (method%kind == weights_given) then
      call file%get('/given/w', w, errors)
      call file%get('/given/beta', beta, errors)
    end if
    if (file%exists('/points/share')) then
      call file%get('/points/share', method%share, errors)
    else if (file%exists('/points/x')) then
      call file%get('/points/x', x, errors)
      call file%get('/contacts/middle', middle, errors)
      call file%get('/period', period, errors)
      radius = method%d_max
      call file%attr_get('/', 'radius', radius, errors)
      if (.not. errors%any()) call kernel_shares(overlap, x, middle, period, radius, method%share)
    end if
  end subroutine read_method

  subroutine write_weights(overlap, method, w, beta, fit, file, errors)
    type(partition_type), intent(in) :: overlap
    type(weight_choice_type), intent(in) :: method
    real(wp), intent(in) :: w(:), beta(:)
    type(fit_type), intent(in) :: fit
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: force(:, :, :), stress(:, :, :), row(:, :, :), inside(:)
    real(wp) :: mean_force(state_count), mean_arm, worst(2)

    call uniform_states(overlap, force, stress)
    call residual_rows(overlap, w, beta, force, stress, row)
    call mean_sizes(overlap, force, mean_force, mean_arm)
    worst = worst_rows(overlap, row, mean_force, mean_arm)
    call file%put('/w', w, errors)
    call file%put('/beta', beta, errors)
    call file%put('/rows', reshape(row, [3*state_count, size(row, 3)]), errors)
    call file%put('/mean_force', mean_force, errors)
    allocate (inside(size(w)), source=1.0_wp)
    call file%put('/balance', moment_balance(overlap, w, beta, inside), errors)
    call file%attr_put('/', 'method', method%name, errors)
    call file%attr_put('/', 'turning', trim(turning_names(overlap%turning)), errors)
    call file%attr_put('/', 'mean_arm', mean_arm, errors)
    call file%attr_put('/', 'worst_force', worst(1), errors)
    call file%attr_put('/', 'worst_moment', worst(2), errors)
    call file%attr_put('/', 'rows', fit%rows, errors)
    call file%attr_put('/', 'unknowns', fit%unknowns, errors)
    call file%attr_put('/', 'rounds', fit%rounds, errors)
    call file%attr_put('/', 'clipped', fit%clipped, errors)
    call file%attr_put('/', 'before', fit%before, errors)
    call file%attr_put('/', 'after', fit%after, errors)
  end subroutine write_weights

  !> Correct the initial stress where actual contact forces are given.
  subroutine write_initial(file, overlap, w, beta, result, errors)
    type(h5_file_type), intent(inout) :: file, result
    type(partition_type), intent(in) :: overlap
    real(wp), intent(in) :: w(:), beta(:)
    type(error_list_type), intent(inout) :: errors
    type(initial_type) :: report
    type(initial_state_type) :: state
    integer(i4), allocatable :: free(:, :), chosen(:)

    allocate (state%w, source=w)
    allocate (state%beta, source=beta)
    allocate (state%force(3, size(w)), state%stress(9, size(beta)), state%couple(9, size(beta)), &
              state%load(3, overlap%blocks()))
    allocate (free(3, overlap%blocks()), chosen(size(overlap%region)))
    call file%get_into('/contacts/force', state%force, errors)
    call file%get_into('/points/stress', state%stress, errors)
    call file%get_into('/points/couple', state%couple, errors)
    call file%get_into('/blocks/load', state%load, errors)
    call file%get_into('/blocks/free', free, errors)
    call file%get_into('/elements/chosen', chosen, errors)
    if (errors%any()) return
    call correct_initial(overlap, state, free == 1, chosen == 1, report, errors)
    call result%put('/stress', state%stress, errors)
    call result%put('/couple', state%couple, errors)
    call result%attr_put('/', 'initial_before', report%before, errors)
    call result%attr_put('/', 'initial_after', report%after, errors)
    call result%attr_put('/', 'initial_change', report%change, errors)
    call result%attr_put('/', 'initial_element', report%element, errors)
    call result%attr_put('/', 'initial_rounds', report%rounds, errors)
  end subroutine write_initial
end module cpl_partition_file
