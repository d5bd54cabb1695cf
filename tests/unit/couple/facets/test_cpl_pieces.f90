!> Pieces of an exchange: many at the start and where the solid lags, few where it does not.
program test_cpl_pieces
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use cpl_lag, only: lag_limit
  use cpl_pieces, only: pieces_type
  implicit none
  type(test_type) :: test

  call one()
  call fewer()
  call more()
  call waits()
  call resumes()
  call test%finish()

contains

  !> A deck without pieces never has any.
  subroutine one()
    type(pieces_type) :: pieces
    real(wp) :: longer
    call pieces%begin(1_i4)
    call pieces%choose(0.5_wp, longer)
    call test%check('one: stays', pieces%now == 1)
    call test%check_close('one: as long', longer, 1.0_wp, 0.0_wp)
  end subroutine one

  !> Divisors of 10 one after the other, some ten pieces apart; the length of a piece grows.
  subroutine fewer()
    type(pieces_type) :: pieces
    real(wp) :: longer, length
    integer(i4) :: k, numbers(10)
    call pieces%begin(10_i4)
    length = 0.1_wp
    do k = 1, 10
      call pieces%choose(0.0_wp, longer)
      length = length*longer
      numbers(k) = pieces%now
    end do
    call test%check('fewer: numbers', all(numbers == [5, 5, 5, 2, 2, 2, 2, 2, 2, 1]))
    call test%check_close('fewer: length', length, 1.0_wp, 1.0e-14_wp)
  end subroutine fewer

  !> Four times the limit: two pieces would leave the limit itself, five leave less.
  subroutine more()
    type(pieces_type) :: pieces
    real(wp) :: longer
    pieces = pieces_type(most=10, now=1)
    call pieces%choose(4.0_wp*lag_limit, longer)
    call test%check('more: at once', pieces%now == 5)
    call test%check_close('more: shorter', longer, 0.2_wp, 1.0e-15_wp)
    call test%check('more: of another length', pieces%changed)
    pieces = pieces_type(most=10, now=2)
    call pieces%choose(100.0_wp*lag_limit, longer)
    call test%check('more: not above the most', pieces%now == 10)
    pieces = pieces_type(most=10, now=2)
    call pieces%choose(0.9_wp*lag_limit, longer)
    call test%check('more: below the limit none', pieces%now == 2 .and. .not. pieces%changed)
  end subroutine more

  !> After more pieces fewer are not tried at once, and each time later.
  subroutine waits()
    type(pieces_type) :: pieces
    real(wp) :: longer
    integer(i4) :: k, waited(3), turn
    pieces = pieces_type(most=2, now=1)
    do turn = 1, 3
      call pieces%choose(1.2_wp*lag_limit, longer)
      call test%check('waits: two', pieces%now == 2)
      do k = 1, 300
        call pieces%choose(0.0_wp, longer)
        if (pieces%now == 1) exit
      end do
      waited(turn) = k
      do k = 1, 12
        call pieces%choose(0.0_wp, longer)
      end do
    end do
    call test%check('waits: longer each time', waited(1) < waited(2) .and. waited(2) < waited(3))
  end subroutine waits

  !> What is kept gives the same numbers again; a number that does not divide gives way.
  subroutine resumes()
    type(pieces_type) :: a, b
    real(wp) :: longer(2)
    integer(i4) :: k
    logical :: same
    a = pieces_type(most=12, now=3)
    call a%choose(1.2_wp*lag_limit, longer(1))
    call b%begin(12_i4)
    call b%resume(a%kept())
    same = .true.
    do k = 1, 40
      call a%choose(merge(0.05_wp, 0.0_wp, k == 20), longer(1))
      call b%choose(merge(0.05_wp, 0.0_wp, k == 20), longer(2))
      same = same .and. a%now == b%now .and. .not. abs(longer(1) - longer(2)) > 0.0_wp
    end do
    call test%check('resumes: the same', same)
    b = pieces_type(most=10, now=10)
    call b%resume([4.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 0.0_wp, 0.0_wp])
    call test%check('resumes: no divisor', b%now == 10)
  end subroutine resumes
end program test_cpl_pieces
