!> Products of second- and third-order tensors for the micromorphic laws, of numbers and of `lanes`
!! derivatives at once: a d-array holds a derivative in each lane, its first index.
!! A leg product contracts one index of a third-order tensor with the last one of a matrix,
!!   leg 1: a_KS g_SLM,   leg 2: a_LS g_KSM,   leg 3: a_MS g_KLS.
module fem_mm_tensor
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: lanes, identity, inverse, determinant, outer
  public :: leg_one, leg_two, leg_three, fold
  public :: left, right, turned, leg_one_of, leg_two_of, leg_three_of
  public :: leg_one_by, leg_two_by, leg_three_by, fold_of

  integer(i4), parameter :: lanes = 8  !! derivatives at once: a vector of 512 bits
  real(wp), parameter :: identity(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, &
    0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])

contains

  pure real(wp) function determinant(a)
    real(wp), intent(in) :: a(3, 3)
    determinant = a(1, 1)*(a(2, 2)*a(3, 3) - a(2, 3)*a(3, 2)) &
      - a(1, 2)*(a(2, 1)*a(3, 3) - a(2, 3)*a(3, 1)) + a(1, 3)*(a(2, 1)*a(3, 2) - a(2, 2)*a(3, 1))
  end function determinant

  !> Inverse of a matrix that is not singular.
  pure function inverse(a) result(b)
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: b(3, 3)
    integer(i4) :: i, j, k, l, m, n
    do j = 1, 3
      l = mod(j, 3) + 1
      n = mod(j + 1, 3) + 1
      do i = 1, 3
        k = mod(i, 3) + 1
        m = mod(i + 1, 3) + 1
        b(j, i) = a(k, l)*a(m, n) - a(k, n)*a(m, l)
      end do
    end do
    b = b/(a(1, 1)*b(1, 1) + a(1, 2)*b(2, 1) + a(1, 3)*b(3, 1))
  end function inverse

  !> a_i b_j.
  pure function outer(a, b) result(c)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: c(3, 3)
    c = spread(a, 2, 3)*spread(b, 1, 3)
  end function outer

  pure function leg_one(a, g) result(h)
    real(wp), intent(in) :: a(3, 3), g(3, 3, 3)
    real(wp) :: h(3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          h(k, l, m) = a(k, 1)*g(1, l, m) + a(k, 2)*g(2, l, m) + a(k, 3)*g(3, l, m)
        end do
      end do
    end do
  end function leg_one

  pure function leg_two(a, g) result(h)
    real(wp), intent(in) :: a(3, 3), g(3, 3, 3)
    real(wp) :: h(3, 3, 3)
    integer(i4) :: l, m
    do m = 1, 3
      do l = 1, 3
        h(:, l, m) = a(l, 1)*g(:, 1, m) + a(l, 2)*g(:, 2, m) + a(l, 3)*g(:, 3, m)
      end do
    end do
  end function leg_two

  pure function leg_three(a, g) result(h)
    real(wp), intent(in) :: a(3, 3), g(3, 3, 3)
    real(wp) :: h(3, 3, 3)
    integer(i4) :: m
    do m = 1, 3
      h(:, :, m) = a(m, 1)*g(:, :, 1) + a(m, 2)*g(:, :, 2) + a(m, 3)*g(:, :, 3)
    end do
  end function leg_three

  !> a_KLM b_SLM.
  pure function fold(a, b) result(c)
    real(wp), intent(in) :: a(3, 3, 3), b(3, 3, 3)
    real(wp) :: c(3, 3)
    integer(i4) :: k, s
    do s = 1, 3
      do k = 1, 3
        c(k, s) = sum(a(k, :, :)*b(s, :, :))
      end do
    end do
  end function fold

  !> a db.
  pure subroutine left(a, db, dc)
    real(wp), intent(in) :: a(3, 3), db(lanes, 3, 3)
    real(wp), intent(out) :: dc(lanes, 3, 3)
    integer(i4) :: i, j
    do j = 1, 3
      do i = 1, 3
        dc(:, i, j) = a(i, 1)*db(:, 1, j) + a(i, 2)*db(:, 2, j) + a(i, 3)*db(:, 3, j)
      end do
    end do
  end subroutine left

  !> da b.
  pure subroutine right(da, b, dc)
    real(wp), intent(in) :: da(lanes, 3, 3), b(3, 3)
    real(wp), intent(out) :: dc(lanes, 3, 3)
    integer(i4) :: i, j
    do j = 1, 3
      do i = 1, 3
        dc(:, i, j) = da(:, i, 1)*b(1, j) + da(:, i, 2)*b(2, j) + da(:, i, 3)*b(3, j)
      end do
    end do
  end subroutine right

  !> Transpose.
  pure subroutine turned(da, dc)
    real(wp), intent(in) :: da(lanes, 3, 3)
    real(wp), intent(out) :: dc(lanes, 3, 3)
    integer(i4) :: i, j
    do j = 1, 3
      do i = 1, 3
        dc(:, i, j) = da(:, j, i)
      end do
    end do
  end subroutine turned

  pure subroutine leg_one_of(a, dg, dh)
    real(wp), intent(in) :: a(3, 3), dg(lanes, 3, 3, 3)
    real(wp), intent(out) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = a(k, 1)*dg(:, 1, l, m) + a(k, 2)*dg(:, 2, l, m) + a(k, 3)*dg(:, 3, l, m)
        end do
      end do
    end do
  end subroutine leg_one_of

  pure subroutine leg_two_of(a, dg, dh)
    real(wp), intent(in) :: a(3, 3), dg(lanes, 3, 3, 3)
    real(wp), intent(out) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = a(l, 1)*dg(:, k, 1, m) + a(l, 2)*dg(:, k, 2, m) + a(l, 3)*dg(:, k, 3, m)
        end do
      end do
    end do
  end subroutine leg_two_of

  pure subroutine leg_three_of(a, dg, dh)
    real(wp), intent(in) :: a(3, 3), dg(lanes, 3, 3, 3)
    real(wp), intent(out) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = a(m, 1)*dg(:, k, l, 1) + a(m, 2)*dg(:, k, l, 2) + a(m, 3)*dg(:, k, l, 3)
        end do
      end do
    end do
  end subroutine leg_three_of

  !> Add factor da_KS g_SLM to dh.
  pure subroutine leg_one_by(factor, da, g, dh)
    real(wp), intent(in) :: factor, da(lanes, 3, 3), g(3, 3, 3)
    real(wp), intent(inout) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = dh(:, k, l, m) + factor*(da(:, k, 1)*g(1, l, m) &
            + da(:, k, 2)*g(2, l, m) + da(:, k, 3)*g(3, l, m))
        end do
      end do
    end do
  end subroutine leg_one_by

  !> Add factor g_KSM da_SL to dh: the *first* index of da is contracted.
  pure subroutine leg_two_by(factor, da, g, dh)
    real(wp), intent(in) :: factor, da(lanes, 3, 3), g(3, 3, 3)
    real(wp), intent(inout) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = dh(:, k, l, m) + factor*(da(:, 1, l)*g(k, 1, m) &
            + da(:, 2, l)*g(k, 2, m) + da(:, 3, l)*g(k, 3, m))
        end do
      end do
    end do
  end subroutine leg_two_by

  !> Add factor g_KLS da_SM to dh: the *first* index of da is contracted.
  pure subroutine leg_three_by(factor, da, g, dh)
    real(wp), intent(in) :: factor, da(lanes, 3, 3), g(3, 3, 3)
    real(wp), intent(inout) :: dh(lanes, 3, 3, 3)
    integer(i4) :: k, l, m
    do m = 1, 3
      do l = 1, 3
        do k = 1, 3
          dh(:, k, l, m) = dh(:, k, l, m) + factor*(da(:, 1, m)*g(k, l, 1) &
            + da(:, 2, m)*g(k, l, 2) + da(:, 3, m)*g(k, l, 3))
        end do
      end do
    end do
  end subroutine leg_three_by

  !> Add da_KLM b_SLM to dc.
  pure subroutine fold_of(da, b, dc)
    real(wp), intent(in) :: da(lanes, 3, 3, 3), b(3, 3, 3)
    real(wp), intent(inout) :: dc(lanes, 3, 3)
    integer(i4) :: k, s, l, m
    do s = 1, 3
      do k = 1, 3
        do m = 1, 3
          do l = 1, 3
            dc(:, k, s) = dc(:, k, s) + da(:, k, l, m)*b(s, l, m)
          end do
        end do
      end do
    end do
  end subroutine fold_of
end module fem_mm_tensor
