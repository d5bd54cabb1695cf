!> Energy partition on two elements of a simple cubic lattice with one spring constant: rows of
!! uniform strain, ramps, the joint fit, and the correction of an initial stress.
program test_cpl_weights
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use talus_errors, only: error_list_type
  use cpl_initial, only: initial_type, initial_state_type, correct_initial
  use cpl_weight_choice, only: weight_choice_type, choose_weights, weight_choice_of
  use cpl_overlap_partition, only: elastic_tensor
  use cpl_partition, only: partition_type, grain_free, grain_ghost, region_free, region_ghost, &
    region_rest, turn_curl, turn_micro, uniform_states, residual_rows, mean_sizes, worst_rows
  use cpl_weight_fit, only: fit_type, fit_joint, fit_elements
  use cpl_weights, only: omega, omega_mean, ramp_weights, twice_weights, share_weights, &
    pack_is_disordered, moment_balance
  implicit none

  integer(i4), parameter :: n = 3_i4, layers = 5_i4       !! grains an edge, elements
  integer(i4), parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, &
                                                    0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
  real(wp), parameter :: h = 3.0_wp, kn = 2.0_wp, ks = 0.7_wp
  type(test_type) :: test

  call test_ramp()
  call test_lattice(.true.)
  call test_lattice(.false.)
  call test_columns()
  call test_initial(.true.)
  call test_initial(.false.)
  call test_elements()
  call test_surface()
  call test_faults()
  call test%finish()

contains

  !> omega at its ends, and its mean along branches against fine sums.
  subroutine test_ramp()
    real(wp) :: fine
    integer(i4) :: k
    integer(i4), parameter :: pieces = 20000_i4
    call test%check_close('omega near', omega(0.9_wp, 3.0_wp, 1.0_wp), 1.0_wp, 0.0_wp)
    call test%check_close('omega half', omega(2.0_wp, 3.0_wp, 1.0_wp), 0.5_wp, 1.0e-15_wp)
    call test%check_close('omega far', omega(3.1_wp, 3.0_wp, 1.0_wp), 0.0_wp, 0.0_wp)
    call test%check_close('mean inside', omega_mean(1.5_wp, 2.5_wp, 3.0_wp, 1.0_wp), 0.5_wp, &
                          1.0e-14_wp)
    call test%check_close('mean level', omega_mean(1.5_wp, 1.5_wp, 3.0_wp, 1.0_wp), 0.75_wp, &
                          1.0e-14_wp)
    fine = 0.0_wp
    do k = 1, pieces
      fine = fine + omega(0.5_wp + 3.0_wp*(k - 0.5_wp)/pieces, 3.0_wp, 1.0_wp)/pieces
    end do
    call test%check_close('mean over both kinks', omega_mean(0.5_wp, 3.5_wp, 3.0_wp, 1.0_wp), &
                          fine, 1.0e-8_wp)
    ! 1 from 1/2 to 1, then the ramp from 1 to 1/2 at 2
    call test%check_close('mean over one kink', omega_mean(0.5_wp, 2.0_wp, 3.0_wp, 1.0_wp), &
                          (0.5_wp + 0.75_wp)/1.5_wp, 1.0e-15_wp)
    call test%check_close('mean backwards', omega_mean(3.5_wp, 0.5_wp, 3.0_wp, 1.0_wp), fine, &
                          1.0e-8_wp)
  end subroutine test_ramp

  !> The column is periodic: ghosts below and above the free grains, one element without grains.
  subroutine test_lattice(polar)
    logical, intent(in) :: polar
    type(partition_type) :: overlap
    type(weight_choice_type) :: method
    type(fit_type) :: fit
    type(error_list_type) :: errors
    real(wp), allocatable :: w(:), beta(:), inside(:)
    real(wp) :: worst(2), balance(9, 6), median
    logical :: disordered
    logical, allocatable :: ghost(:)

    call make_column(polar, overlap)
    call pack_is_disordered(overlap, disordered, median)
    call test%check('a lattice is no disordered pack', .not. disordered .and. median < 1.0e-12_wp)
    call twice_weights(overlap, w, beta)
    worst = worst_now(overlap, w, beta)
    call test%check('counted twice leaves a face of forces', worst(1) > 9.0_wp)
    call weight_choice_of('auto', method, 'test', errors)
    method%depth = h
    method%d_max = 1.0_wp
    call choose_weights(overlap, method, w, beta, fit, errors)
    call test%check('fit chosen for a lattice', method%name == 'fit' .and. .not. errors%any())
    worst = worst_now(overlap, w, beta)
    call test%check('fit closes the rows', max_abs(worst) < 1.0e-12_wp)
    call test%check('within bounds', all(w >= 0.0_wp) .and. all(w <= 1.0_wp) .and. &
                    all(beta >= 0.0_wp) .and. all(beta <= 1.0_wp))
    call test%check('contacts of free grains stay', &
                    all(abs(pack(w, free_contacts(overlap)) - 1.0_wp) <= 0.0_wp))
    call test%check('elements keep their kinds', &
                    all(pack(beta, overlap%region(overlap%element) == region_free) <= 0.0_wp) &
                    .and. all(pack(beta, overlap%region(overlap%element) == region_rest) &
                              >= 1.0_wp))
    allocate (inside(size(w)), source=1.0_wp)
    balance = moment_balance(overlap, w, beta, inside)
    call test%check('nine components', max_abs(balance) < 1.0e-13_wp)
    call share_weights(overlap, spread(1.0_wp/6.0_wp, 1, size(beta)), w, beta)
    call test%check('ghosts skipped', all(abs(pack(w, .not. free_contacts(overlap))) <= 0.0_wp))
    ghost = overlap%region(overlap%element) == region_ghost
    call test%check_all_close('points have the rest', pack(beta, ghost), 5.0_wp/6.0_wp, 1.0e-15_wp)
    worst = worst_now(overlap, w, beta)
    call test%check('skipped ghosts leave moments', (.not. polar) .or. worst(2) > 1.0_wp)
  end subroutine test_lattice

  !> A wrong scalar for the fit: points alone cannot take the moments of ghosts.
  subroutine test_columns()
    type(partition_type) :: overlap
    type(fit_type) :: fit
    type(error_list_type) :: errors
    real(wp), allocatable :: w(:), beta(:)
    call make_column(.true., overlap)
    call share_weights(overlap, spread(1.0_wp/6.0_wp, 1, size(overlap%element)), w, beta)
    call fit_joint(overlap, .false., w, beta, fit, errors)
    call test%check('points alone: no error of their own', .not. errors%any())
    call test%check('points alone close forces', &
                    worst_force(overlap, w, beta) < 1.0e-10_wp)
    call test%check('contacts were left alone', &
                    all(abs(pack(w, .not. free_contacts(overlap))) <= 0.0_wp))
  end subroutine test_columns

  !> Actual forces of a strain, and a wrong initial stress: the correction finds the balance.
  subroutine test_initial(polar)
    logical, intent(in) :: polar
    type(partition_type) :: overlap
    type(initial_type) :: report
    type(error_list_type) :: errors
    type(initial_state_type) :: start
    real(wp), allocatable :: force(:, :, :), state(:, :, :)
    logical, allocatable :: free(:, :), chosen(:)
    integer(i4) :: q

    call make_column(polar, overlap)
    call ramp_weights(overlap, h, 1.0_wp, 1.0_wp, start%w, start%beta)
    call uniform_states(overlap, force, state)
    start%force = force(:, 3, :)
    allocate (start%stress(9, size(start%beta)), start%couple(9, size(start%beta)), &
              start%load(3, overlap%blocks()), source=0.0_wp)
    allocate (free(3, overlap%blocks()), source=.true.)
    chosen = overlap%region == region_ghost
    do q = 1, size(start%beta)
      start%stress(:, q) = state(:, 3, overlap%element(q))
    end do
    call correct_initial(overlap, start, free, chosen, report, errors)
    call test%check('initial stress closes', report%after < 1.0e-13_wp .and. .not. errors%any())
    call test%check('there was a rest', report%before > 1.0e-2_wp)
    call test%check('a small change', report%change < 0.5_wp .and. report%change > 1.0e-3_wp)
    call test%check('where it may change', overlap%region(report%element) == region_ghost)
    call test%check('other elements keep theirs', all(abs(start%stress(:, 33:40) - &
                    spread(state(:, 3, 5), 2, 8)) <= 0.0_wp))
    free(3, :) = .false.
    chosen = .false.
    call correct_initial(overlap, start, free, chosen, report, errors)
    call test%check('nothing may change: nothing asked', report%after <= 0.0_wp)
    free = .true.
    chosen = overlap%region == region_ghost
    start%load(1, 1) = 1.0_wp
    call correct_initial(overlap, start, free, chosen, report, errors)
    call test%check('a load that nothing carries is N442', errors%count == 1)
  end subroutine test_initial

  !> One scalar an element: points halved by mistake are recovered.
  subroutine test_elements()
    type(partition_type) :: overlap
    type(fit_type) :: fit
    type(error_list_type) :: errors
    type(weight_choice_type) :: method
    real(wp), allocatable :: w(:), beta(:), right(:), force(:, :, :), stress(:, :, :)
    logical, allocatable :: chosen(:)

    call make_column(.true., overlap)
    call weight_choice_of('fit', method, 'test', errors)
    method%depth = h
    method%d_max = 1.0_wp
    call choose_weights(overlap, method, w, beta, fit, errors)
    allocate (right, source=beta)
    where (overlap%element == 1) beta = 0.5_wp*beta
    call uniform_states(overlap, force, stress)
    allocate (chosen(overlap%blocks()), source=.true.)
    call fit_elements(overlap, force, stress, chosen, w, beta, fit)
    call test%check('a scalar an element', max_abs(beta - right) < 1.0e-6_wp)
    call test%check('its rows', fit%after < 1.0e-6_wp .and. fit%before > 0.1_wp)
  end subroutine test_elements

  !> Rows of nodes on the mesh's surface do not count; the tensor of Eringen's moduli.
  subroutine test_surface()
    type(partition_type) :: overlap
    type(fit_type) :: fit
    type(error_list_type) :: errors
    real(wp), allocatable :: w(:), beta(:), before(:)
    real(wp) :: sigma(9)
    call make_column(.true., overlap)
    call ramp_weights(overlap, h, 1.0_wp, 1.0_wp, w, beta)
    allocate (before, source=beta)
    allocate (overlap%outer(overlap%nodes), source=.true.)
    call fit_joint(overlap, .true., w, beta, fit, errors)
    call test%check('no row counts, nothing changes', fit%rows == 0 .and. &
                    all(abs(beta - before) <= 0.0_wp))
    overlap%outer = [.false., .true., .true., .true., .true.]
    call fit_joint(overlap, .true., w, beta, fit, errors)
    call test%check('one node counts', fit%rows > 0 .and. fit%rows <= 36 .and. &
                    fit%after < 1.0e-12_wp)
    sigma = matmul(elastic_tensor([2.0_wp, 3.0_wp, 5.0_wp]), &
                   [1.0_wp, 10.0_wp, 0.0_wp, 20.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    call test%check('stress of Eringen''s moduli', max_abs(sigma - [13.0_wp, 140.0_wp, &
      0.0_wp, 190.0_wp, 2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp]) < 1.0e-12_wp)
  end subroutine test_surface

  subroutine test_faults()
    type(partition_type) :: overlap
    type(weight_choice_type) :: method
    type(fit_type) :: fit
    type(error_list_type) :: errors, others
    real(wp), allocatable :: w(:), beta(:)
    call weight_choice_of('rampe', method, 'deck.nml', errors)
    call test%check_text('unknown method', errors%item(1)%code, 'D440')
    call make_column(.true., overlap)
    call weight_choice_of('ramp', method, 'deck.nml', errors)
    method%depth = 1.0_wp
    method%d_max = 1.0_wp
    call choose_weights(overlap, method, w, beta, fit, errors)
    call test%check_text('layer too thin', errors%item(2)%code, 'D441')
    call weight_choice_of('share', method, 'deck.nml', errors)
    call choose_weights(overlap, method, w, beta, fit, errors)
    call test%check_text('no shares', errors%item(3)%code, 'D442')
    overlap%moduli(:, :, layers) = 5.0_wp*overlap%moduli(:, :, layers)
    method%depth = h
    call weight_choice_of('fit', method, 'deck.nml', errors)
    call choose_weights(overlap, method, w, beta, fit, others)
    call test%check_text('no balance within bounds', others%item(1)%code, 'N443')
  end subroutine test_faults

  pure function free_contacts(overlap) result(mask)
    type(partition_type), intent(in) :: overlap
    logical, allocatable :: mask(:)
    mask = overlap%kind(overlap%pair(1, :)) == grain_free &
           .or. overlap%kind(overlap%pair(2, :)) == grain_free
  end function free_contacts

  pure real(wp) function worst_force(overlap, w, beta)
    type(partition_type), intent(in) :: overlap
    real(wp), intent(in) :: w(:), beta(:)
    real(wp) :: worst(2)
    worst = worst_now(overlap, w, beta)
    worst_force = worst(1)
  end function worst_force

  pure function worst_now(overlap, w, beta) result(worst)
    type(partition_type), intent(in) :: overlap
    real(wp), intent(in) :: w(:), beta(:)
    real(wp) :: worst(2), mean_force(6), mean_arm
    real(wp), allocatable :: force(:, :, :), stress(:, :, :), row(:, :, :)
    call uniform_states(overlap, force, stress)
    call residual_rows(overlap, w, beta, force, stress, row)
    call mean_sizes(overlap, force, mean_force, mean_arm)
    worst = worst_rows(overlap, row, mean_force, mean_arm)
  end function worst_now

  !> A periodic column of five elements with one node a level: ghosts, free, free, ghosts, none.
  subroutine make_column(polar, overlap)
    logical, intent(in) :: polar
    type(partition_type), intent(out) :: overlap
    integer(i4), parameter :: kinds(layers) = [region_ghost, region_free, region_free, &
                                               region_ghost, region_rest]
    real(wp), parameter :: shift(3) = [0.31_wp, 0.23_wp, 0.17_wp]
    real(wp) :: xi(3), gauss
    integer(i4) :: grains, e, q, g, i, j, k, level

    grains = n*n*n*(layers - 1)
    overlap%nodes = layers
    overlap%polar = polar
    overlap%turning = merge(turn_micro, turn_curl, polar)
    overlap%region = kinds
    allocate (overlap%node_u(8, layers), overlap%node_phi(merge(8, 0, polar), layers))
    do e = 1, layers
      overlap%node_u(:, e) = 1 + mod(e - 1 + corner(3, :), layers)
      if (polar) overlap%node_phi(:, e) = overlap%node_u(:, e)
    end do
    allocate (overlap%kind(grains), overlap%cell(grains), overlap%depth(grains))
    allocate (overlap%shape_u(8, grains), overlap%shape_phi(merge(8, 0, polar), grains), &
              overlap%shape_slope(3, 8, grains))
    do k = 0, n*(layers - 1) - 1
      do j = 0, n - 1
        do i = 0, n - 1
          g = grain_of(i, j, k)
          level = 1 + k/n
          overlap%kind(g) = merge(grain_free, grain_ghost, kinds(level) == region_free)
          overlap%cell(g) = merge(0_i4, level, overlap%kind(g) == grain_free)
          overlap%depth(g) = depth_of(k + shift(3))
          xi = ([i, j, mod(k, n)] + shift)/h
          call shapes(xi, overlap%shape_u(:, g), overlap%shape_slope(:, :, g))
          if (polar) overlap%shape_phi(:, g) = overlap%shape_u(:, g)
        end do
      end do
    end do
    call make_contacts(overlap)
    allocate (overlap%element(8*layers), overlap%volume(8*layers), overlap%point_depth(8*layers))
    allocate (overlap%slope_u(3, 8, 8*layers), overlap%value_phi(merge(8, 0, polar), 8*layers), &
              overlap%slope_phi(3, merge(8, 0, polar), 8*layers))
    gauss = 1.0_wp/sqrt(3.0_wp)
    do e = 1, layers
      do k = 1, 8
        q = 8*(e - 1) + k
        xi = 0.5_wp + 0.5_wp*gauss*(2*corner(:, k) - 1)
        overlap%element(q) = e
        overlap%volume(q) = h**3/8.0_wp
        overlap%point_depth(q) = depth_of((e - 1 + xi(3))*h)
        call point_shapes(polar, xi, q, overlap)
      end do
    end do
    overlap%slope_mean = overlap%slope_u
  end subroutine make_column

  pure subroutine point_shapes(polar, xi, q, overlap)
    logical, intent(in) :: polar
    real(wp), intent(in) :: xi(3)
    integer(i4), intent(in) :: q
    type(partition_type), intent(inout) :: overlap
    real(wp) :: value(8)
    call shapes(xi, value, overlap%slope_u(:, :, q))
    if (polar) overlap%value_phi(:, q) = value
    if (polar) overlap%slope_phi(:, :, q) = overlap%slope_u(:, :, q)
  end subroutine point_shapes

  !> Distance from the free elements, which are from h to 3 h.
  pure real(wp) function depth_of(z)
    real(wp), intent(in) :: z
    depth_of = max(0.0_wp, h - z, z - 3.0_wp*h)
  end function depth_of

  pure integer(i4) function grain_of(i, j, k)
    integer(i4), intent(in) :: i, j, k
    grain_of = 1 + modulo(i, n) + n*(modulo(j, n) + n*k)
  end function grain_of

  !> Contacts along the axes; none across the element without grains. Moduli are their sum.
  subroutine make_contacts(overlap)
    type(partition_type), intent(inout) :: overlap
    integer(i4) :: j, k, c, axis, step(3), most
    real(wp) :: normal(3), local(3, 3)

    most = 3*n*n*n*(layers - 1) - n*n
    allocate (overlap%pair(2, most), overlap%arm(3, 2, most), overlap%normal(3, most), &
              overlap%stiffness(2, most))
    allocate (overlap%moduli(9, 9, layers), source=0.0_wp)
    c = 0
    do axis = 1, 3
      step = 0
      step(axis) = 1
      normal = step
      do k = 0, n*(layers - 1) - step(3) - 1
        do j = 0, n**2 - 1
          c = c + 1
          overlap%pair(:, c) = [grain_of(mod(j, n), j/n, k), &
                                grain_of(mod(j, n) + step(1), j/n + step(2), k + step(3))]
          overlap%normal(:, c) = normal
          overlap%arm(:, 1, c) = 0.5_wp*normal
          overlap%arm(:, 2, c) = -0.5_wp*normal
          overlap%stiffness(:, c) = [kn, ks]
        end do
      end do
      local = 0.0_wp
      do j = 1, 3
        local(j, j) = merge(kn, ks, j == axis)
      end do
      overlap%moduli(3*axis - 2:3*axis, 3*axis - 2:3*axis, :) = spread(local, 3, layers)
    end do
  end subroutine make_contacts

  !> Values and slopes of the cube's functions at xi in [0, 1].
  pure subroutine shapes(xi, value, slope)
    real(wp), intent(in) :: xi(3)
    real(wp), intent(out) :: value(8), slope(3, 8)
    real(wp) :: f(3)
    integer(i4) :: a, i
    do a = 1, 8
      f = merge(xi, 1.0_wp - xi, corner(:, a) == 1)
      value(a) = product(f)
      do i = 1, 3
        slope(i, a) = (2*corner(i, a) - 1)/h*product(f(:i - 1))*product(f(i + 1:))
      end do
    end do
  end subroutine shapes
end program test_cpl_weights
