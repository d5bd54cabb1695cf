!> Exact sums: the same bits in every order and for every deal over ranks, as exact as the terms.
program test_talus_exact_sums
  use talus_kinds, only: wp, i4, i8
  use talus_exact_sums, only: exact_sums_type, begin_sums, begin_step, touch, end_step, add_term, &
    add_last, exact_value, digits
  use talus_random, only: uniform
  use talus_test, only: test_type
  implicit none
  integer(i4), parameter :: many = 4000
  type(test_type) :: test
  real(wp) :: x(many)

  call draw(x)
  call any_order()
  call any_deal()
  call whole_numbers()
  call cancel()
  call over_steps()
  call few_of_many()
  call test%finish()

contains

  !> Terms of both signs between 1e-36 and 1e9.
  subroutine draw(x)
    real(wp), intent(out) :: x(:)
    real(wp) :: power, sign
    integer(i4) :: k
    do k = 1, many
      power = 45.0_wp*uniform([1_i8, int(k, i8)]) - 36.0_wp
      sign = uniform([2_i8, int(k, i8)]) - 0.5_wp
      x(k) = sign*10.0_wp**power
    end do
  end subroutine draw

  subroutine any_order()
    real(wp) :: up(digits, 1), down(digits, 1)
    integer(i4) :: k
    up = 0.0_wp
    down = 0.0_wp
    do k = 1, many
      call add_term(x(k:k), up)
      call add_term(x(many + 1 - k:many + 1 - k), down)
    end do
    call test%check('every digit is the same in both orders', all(abs(up - down) <= 0.0_wp))
    call test%check('and so is the number', abs(exact_value(up(:, 1)) - exact_value(down(:, 1))) &
                    <= 0.0_wp)
    call test%check('a plain sum differs', abs(sum(x) - sum(x(many:1:-1))) > 0.0_wp)
    call test%check_close('but for round-off, n eps sum |x|', exact_value(up(:, 1)), sum(x), &
                          many*epsilon(1.0_wp)*sum(abs(x)))
  end subroutine any_order

  !> Sums of parts added, as those of ranks are; one part is carried, the other not.
  subroutine any_deal()
    type(exact_sums_type) :: whole, part
    real(wp) :: rest(digits, 1)
    integer(i4) :: k
    call begin_sums(whole, 1_i4, 1_i4)
    call begin_sums(part, 1_i4, 1_i4)
    rest = 0.0_wp
    do k = 1, many
      call add_term(x(k:k), whole%last(:, :, 1))
      if (mod(k, 3) == 0) then
        call add_term(x(k:k), part%last(:, :, 1))
      else
        call add_term(x(k:k), rest)
      end if
    end do
    call add_last(whole, 1_i4)
    call add_last(part, 1_i4)
    call test%check('two parts make the whole', &
                    abs(exact_value(whole%all(:, 1, 1)) - exact_value(part%all(:, 1, 1) &
                                                                      + rest(:, 1))) <= 0.0_wp)
  end subroutine any_deal

  !> Sums of whole numbers are known exactly, negative ones too.
  subroutine whole_numbers()
    real(wp) :: total(digits, 2)
    integer(i4) :: k
    total = 0.0_wp
    do k = 1, many
      call add_term([1.0_wp, -1.0e-3_wp]*k, total)
    end do
    call test%check_close('1 + 2 + ...', exact_value(total(:, 1)), 0.5_wp*many*(many + 1), 0.0_wp)
    call test%check_close('-0.001 - 0.002 - ...', exact_value(total(:, 2)), &
                          -0.5e-3_wp*many*(many + 1), 1.0e-9_wp)
  end subroutine whole_numbers

  !> What cancels leaves what is small; one term comes back with all its bits.
  subroutine cancel()
    real(wp), parameter :: small = 1.234567890123456e-9_wp
    real(wp) :: total(digits, 1)
    total = 0.0_wp
    call add_term([1.0e15_wp], total)
    call add_term([-small], total)
    call add_term([-1.0e15_wp], total)
    call test%check_close('1e15 - small - 1e15', exact_value(total(:, 1)), -small, 0.0_wp)
  end subroutine cancel

  !> Many steps of large digits lose nothing.
  subroutine over_steps()
    type(exact_sums_type) :: sums
    real(wp), parameter :: term = 1.0_wp - 2.0_wp**(-53)
    integer(i4) :: k
    call begin_sums(sums, 1_i4, 1_i4)
    do k = 1, 100000
      sums%last = 0.0_wp
      call add_term([term], sums%last(:, :, 1))
      call add_last(sums, 1_i4)
    end do
    call test%check_close('100 000 steps', exact_value(sums%all(:, 1, 1)), &
                          1.0e5_wp - 1.0e5_wp*2.0_wp**(-53), 0.0_wp)
    call test%check_close('the last step', exact_value(sums%last(:, 1, 1)), term, 0.0_wp)
  end subroutine over_steps

  !> Of three things each step touches some: what the last one left alone has no last term.
  subroutine few_of_many()
    type(exact_sums_type) :: sums
    real(wp) :: total(3), last(3)
    integer(i4) :: k
    call begin_sums(sums, 1_i4, 3_i4)
    do k = 1, 4
      call begin_step(sums)
      call touch(sums, 1_i4, [1.0_wp*k])
      call touch(sums, 1_i4, [0.5_wp])
      if (k <= 2) call touch(sums, 3_i4, [-2.0_wp*k])
      call end_step(sums)
    end do
    total = [(exact_value(sums%all(:, 1, k)), k=1, 3)]
    last = [(exact_value(sums%last(:, 1, k)), k=1, 3)]
    call test%check('sums of all steps', all(abs(total - [12.0_wp, 0.0_wp, -6.0_wp]) <= 0.0_wp))
    call test%check('those of the last', all(abs(last - [4.5_wp, 0.0_wp, 0.0_wp]) <= 0.0_wp))
  end subroutine few_of_many
end program test_talus_exact_sums
