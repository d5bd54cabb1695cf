!> Kicks of an explicit solid: their work, and how long an exchange may be, against the maps of a
!! node alone and of a node on a spring.
program test_cpl_kicks
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_kicks, only: kicks_type, kicks_allowed
  implicit none
  type(test_type) :: test

  call work()
  call node_alone()
  call node_on_a_spring()
  call told()
  call test%finish()

contains

  !> Two nodes, one of them held along x.
  subroutine work()
    type(kicks_type) :: kicks
    real(wp), parameter :: push(3, 2) = reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 5.0_wp, 6.0_wp], &
                                                [3, 2])
    real(wp), parameter :: v(3, 2) = 0.5_wp
    real(wp) :: before, after
    kicks%mass = [2.0_wp, 4.0_wp]
    allocate (kicks%held(3, 2), source=.false.)
    kicks%held(1, 2) = .true.
    call kicks%add_work(push, v)
    before = 0.5_wp*(2.0_wp*sum(v(:, 1)**2) + 4.0_wp*sum(v(2:, 2)**2))
    after = 0.5_wp*(2.0_wp*sum((v(:, 1) + push(:, 1)/2.0_wp)**2) &
                    + 4.0_wp*sum((v(2:, 2) + push(2:, 2)/4.0_wp)**2))
    call test%check_close('work is the kinetic energy gained', kicks%work, after - before, &
                          1.0e-14_wp)
    call kicks%note_rate([8.0_wp, 12.0_wp])
    call test%check_close('largest stiffness over mass', kicks%rate, 4.0_wp, 1.0e-15_wp)
  end subroutine work

  !> Without elements behind it a node is stable up to 4 k T^2/M.
  subroutine node_alone()
    call test%check_close('no step limit', kicks_allowed(1.0_wp, 1_i4, 0.0_wp), 4.0_wp, 0.0_wp)
    call test%check_close('slow elements', kicks_allowed(1.0_wp, 1_i4, 1.0e6_wp), 4.0_wp, &
                          1.0e-11_wp)
    call test%check_close('one step: 4 - (omega T)^2', kicks_allowed(0.5_wp, 1_i4, 1.0_wp), &
                          3.0_wp, 1.0e-14_wp)
    call test%check_close('beyond half a turn', kicks_allowed(1.9_wp, 2_i4, 1.0_wp), 0.02_wp, &
                          1.0e-15_wp)
  end subroutine node_alone

  !> n steps of a node on a spring between two kicks: half the trace of the map is -1 at the limit.
  subroutine node_on_a_spring()
    real(wp), parameter :: omega = 2.0_wp  ! largest stable step 1 s
    real(wp) :: map(2, 2), kick(2, 2), step(2, 2), dt, exchange
    integer(i4) :: n, k
    do n = 1, 3
      exchange = 0.3_wp + 0.25_wp*n
      dt = exchange/n
      step = reshape([1.0_wp - 0.5_wp*(omega*dt)**2, -omega**2*dt*(1.0_wp - (0.5_wp*omega*dt)**2), &
                      dt, 1.0_wp - 0.5_wp*(omega*dt)**2], [2, 2])
      kick = reshape([1.0_wp, -0.5_wp*kicks_allowed(exchange, n, 1.0_wp)/exchange, 0.0_wp, &
                      1.0_wp], [2, 2])
      map = kick
      do k = 1, n
        map = matmul(step, map)
      end do
      map = matmul(kick, map)
      call test%check_close('half the trace', 0.5_wp*(map(1, 1) + map(2, 2)), -1.0_wp, 1.0e-13_wp)
    end do
  end subroutine node_on_a_spring

  !> The exchange that is told is stable by the same rule, and W438 comes once.
  subroutine told()
    type(kicks_type) :: kicks
    real(wp) :: limit
    kicks%active = .true.
    kicks%step_limit = 1.0_wp
    kicks%rate = 3.0_wp
    limit = kicks%limit(5.0_wp)
    call test%check('shorter than asked for', limit < 1.0_wp)
    call test%check('stable', 3.0_wp*limit**2 <= kicks_allowed(limit, 1_i4, 1.0_wp))
    call test%check('no shorter than need be', &
                    3.0_wp*(limit/0.98_wp)**2 > kicks_allowed(limit/0.98_wp, 1_i4, 1.0_wp))
    call test%check('W438', index(kicks%warning(5.0_wp), 'W438') == 1)
    call test%check('once', len(kicks%warning(5.0_wp)) == 0)
    call test%check_close('it is kept', kicks%shortest, limit, 0.0_wp)
  end subroutine told
end program test_cpl_kicks
