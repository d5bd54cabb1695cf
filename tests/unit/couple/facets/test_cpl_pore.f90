!> The link of the liquid: liquid and forces that go over are kept, pressures are interpolated, what
!! the admittance withholds comes back, the balance sees what does not.
program test_cpl_pore
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_advance, verb_solve
  use talus_test, only: test_type
  use cpl_pore, only: pore_link_type, row_of, to_facets
  use cpl_pore_probe, only: least_answer
  use cpl_pore_setup, only: admittance
  implicit none
  type(test_type) :: test
  type(pore_link_type) :: link
  real(wp) :: x(3, 9), side(3, 12)
  integer(i4) :: facets(4, 4)

  call make_link()
  call check_transfer()
  call check_request()
  call check_withheld()
  call check_admittance()
  call check_conductance()
  call test%finish()

contains

  !> 4 x 3 nodes of a grid on 2 x 2 facets.
  subroutine make_link()
    type(error_list_type) :: errors
    integer(i4) :: i, j, k
    do k = 1, 9
      x(:, k) = [0.01_wp*modulo(k - 1, 3), 0.01_wp*((k - 1)/3), 0.0_wp]
    end do
    facets = reshape([1, 2, 5, 4, 2, 3, 6, 5, 4, 5, 8, 7, 5, 6, 9, 8], [4, 4])
    do j = 0, 2
      do i = 0, 3
        k = 4*j + i + 1
        side(:, k) = [0.02_wp*i/3.0_wp, 0.01_wp*j, 0.0_wp]
      end do
    end do
    call link%hull%build([(int(k, i8), k=1, 12)], side, facets, x, -1.0_wp, errors)
    call link%wet%build([(int(k, i8), k=1, 12)], side, facets, x, -1.0_wp, errors)
    call test%check('nodes are on the facets', .not. errors%any())
    link%storage = spread(1.0e-15_wp, 1, 9)
    link%ahead = [(1.0e-15_wp*k, k=1, 9)]
    call link%init()
  end subroutine make_link

  subroutine check_transfer()
    real(wp) :: flow(1, 12), nodal(1, 9)
    integer(i4) :: k
    flow(1, :) = [(sin(1.0_wp*k), k=1, 12)]
    nodal = to_facets(link%wet, flow)
    call test%check_close('no liquid is lost', sum(nodal), sum(flow), 1.0e-15_wp)
    call test%check_close('nor its first moment', sum(nodal(1, :)*x(1, :)), &
                          sum(flow(1, :)*side(1, :)), 1.0e-17_wp)
  end subroutine check_transfer

  !> A linear pressure and a rigid motion arrive at the grid as they are.
  subroutine check_request()
    type(message_type) :: request
    type(error_list_type) :: errors
    real(wp) :: p(12), v(3, 12)
    link%p = 1.0e3_wp + 2.0e5_wp*x(1, :) - 1.0e5_wp*x(2, :)
    link%w = spread([2.0e-7_wp, 0.0_wp, 0.0_wp], 2, 9)  ! the side is behind the facets
    link%u = link%w + spread([1.0e-6_wp, 0.0_wp, -2.0e-6_wp], 2, 9)
    call link%predict(0.5_wp, .false.)
    call request%start(verb_advance, 1_i8, 0.0_wp, 0.5_wp)
    call link%put_grains(request, 0.5_wp)
    call request%get('side.p', p, errors)
    call request%get('side.v', v, errors)
    call test%check_all_close('pressures', p, 1.0e3_wp + 2.0e5_wp*side(1, :) &
                              - 1.0e5_wp*side(2, :), 1.0e-10_wp)
    call test%check_all_close('velocities', v, spread([2.0e-6_wp, 0.0_wp, -4.0e-6_wp], 2, 12), &
                              1.0e-18_wp)
    link%w_new = link%w
    link%u = 0.0_wp
    link%w = 0.0_wp
    call test%check('numbers', link%finite())
  end subroutine check_request

  !> What goes into the solid: the liquid that came, and what was withheld before.
  subroutine check_withheld()
    type(message_type) :: request
    type(error_list_type) :: errors
    real(wp) :: volume(9), first(9), start(9)
    integer(i4) :: k
    link%force = 0.0_wp
    link%p = 100.0_wp
    start = link%p
    call link%predict(1.0_wp, .false.)
    link%flow = [(-1.0e-12_wp*k, k=1, 12)]
    call request%start(verb_solve, 1_i8, 0.0_wp, 1.0_wp)
    call link%put_solid(request)
    call request%get('wet.fluid_in', first, errors)
    call test%check_close('what leaves the grains enters', sum(first), 78.0e-12_wp, 1.0e-25_wp)
    link%p_new = 130.0_wp
    link%u_new = 0.0_wp
    link%v_new = 0.0_wp
    ! the solid gained what came, in its pores and in the storage that stands for the grains
    link%books_new%content = [-78.0e-12_wp, 78.0e-12_wp]
    call link%accept()
    call test%check_all_close('withheld', link%kept, 30.0_wp*link%ahead, 1.0e-27_wp)
    call test%check_close('balance', link%balance(), 0.0_wp, 1.0e-25_wp)
    call link%predict(1.0_wp, .false.)
    call request%start(verb_solve, 2_i8, 1.0_wp, 2.0_wp)
    call link%put_solid(request)
    call request%get('wet.fluid_in', volume, errors)
    call test%check_all_close('given back', volume - first, 30.0_wp*link%ahead, 1.0e-24_wp)
    call link%follow_facets()
    link%returned = .false.
    call request%start(verb_solve, 2_i8, 1.0_wp, 2.0_wp)
    call link%put_solid(request)
    call request%get('wet.fluid_in', volume, errors)
    call test%check_all_close('kept, at the accepted pressure', volume, first, 1.0e-24_wp)
    link%p_held = 150.0_wp
    call request%start(verb_solve, 2_i8, 1.0_wp, 2.0_wp)
    call link%put_solid(request)
    call request%get('wet.fluid_in', volume, errors)
    call test%check_all_close('counted from the pressure that was held', volume - first, &
                              20.0_wp*link%ahead, 1.0e-24_wp)
  end subroutine check_withheld

  !> Over an interval T: sqrt(kappa C T) of liquid by flow, T over rho c by the wave; over T.
  subroutine check_admittance()
    real(wp) :: y
    y = admittance(1.0e-9_wp, 4.0e-8_wp, 1.6e3_wp, 1.0e-3_wp)
    call test%check_close('of a half space', y, 2.0e-7_wp + 5.0e-6_wp, 1.0e-19_wp)
  end subroutine check_admittance

  !> A side that gives way expects the mean flow, in further trials that of the last one, and what
  !! comes to the solid is what left the grains.
  subroutine check_conductance()
    type(message_type) :: request
    type(error_list_type) :: errors
    real(wp), dimension(12) :: conduct, expected
    real(wp) :: volume(9), hull(3, 9)
    integer(i4) :: k
    link%yields = .true.
    link%returned = .true.
    link%ahead = 0.0_wp
    link%kept = 0.0_wp
    link%mean_flow = 0.0_wp
    link%conduct = [(1.0e-15_wp*k, k=1, 12)]
    call link%predict(2.0_wp, .false.)
    link%flow = [(1.0e-12_wp*(k - 3), k=1, 12)]
    call link%accept()
    call test%check_all_close('mean flow', link%mean_flow, 0.15_wp*link%flow, 1.0e-25_wp)
    call link%predict(4.0_wp, .false.)
    call request%start(verb_advance, 1_i8, 0.0_wp, 4.0_wp)
    call link%put_grains(request, 4.0_wp)
    call request%get('side.conductance', conduct, errors)
    call request%get('side.fluid_in', expected, errors)
    call test%check_all_close('conductance', conduct, link%conduct, 0.0_wp)
    call test%check_all_close('of a longer interval', expected, 0.6_wp*link%flow, 1.0e-25_wp)
    link%p_new = link%p + 8.0_wp
    call link%follow_facets()
    call test%check_all_close('in the next trial', link%expected, 0.25_wp*(link%flow &
                              + 8.0_wp*link%conduct), 1.0e-25_wp)
    call test%check_all_close('from the accepted pressure', link%p_held, link%p, 0.0_wp)
    call request%start(verb_solve, 1_i8, 0.0_wp, 4.0_wp)
    call link%put_solid(request)
    call request%get('wet.fluid_in', volume, errors)
    call test%check_close('all of it', sum(volume), -sum(link%flow), 1.0e-25_wp)
    link%force = 3.0_wp
    link%force_put = 2.0_wp
    link%start_force = 0.5_wp
    call link%predict(4.0_wp, .true.)
    call request%start(verb_solve, 1_i8, 0.0_wp, 4.0_wp)
    call link%put_solid(request)
    call request%get('hull.force', hull, errors)
    call test%check_close('a load whose mean with the one before is the mean force', &
                          sum(hull)/36.0_wp, 2.0_wp*2.5_wp - 2.0_wp, 1.0e-13_wp)
    call test%check('no fault', .not. errors%any())
    call test%check_close('least answer', least_answer([6.0_wp, 6.0_wp, 6.0_wp], &
                          [0.0_wp, 3.0_wp, 1.5_wp]), 2.0_wp, 1.0e-15_wp)
    call test%check_close('no answer', least_answer([1.0_wp], [-1.0_wp]), 0.0_wp, 1.0e-15_wp)
  end subroutine check_conductance
end program test_cpl_pore
