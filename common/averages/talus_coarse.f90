!> Coarse-grained fields on a grid of cells (Goldhirsch 2010; theory: "Averages").
!!
!! Each grain, and each point of each branch, is spread over the cells by a kernel whose sum over
!! the unbounded grid is made 1. So what is spread is kept: total mass, momentum and the integral of
!! the stress are those of grains and contacts wherever the kernels lie within the grid.
module talus_coarse
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: dyad
  use talus_sample, only: sample_type
  implicit none
  private
  public :: grid_type, fields_type, coarse_grain, kernel_gaussian, kernel_lucy, reach_of

  integer(i4), parameter :: kernel_gaussian = 1, kernel_lucy = 2

  !> Cells and kernel. Reach: 3 widths of the Gaussian, 2 of Lucy's polynomial.
  type :: grid_type
    real(wp) :: lower(3) = 0.0_wp, upper(3) = 0.0_wp  !! [m]
    integer(i4) :: cells(3) = 1
    integer(i4) :: kernel = kernel_gaussian
    real(wp) :: width = 0.0_wp                        !! w [m]
  end type grid_type

  !> Fields, cells counted x first.
  type :: fields_type
    integer(i4) :: n = 0
    real(wp), allocatable :: solid(:)          !! solid volume over volume [-]
    real(wp), allocatable :: density(:)        !! [kg/m^3]
    real(wp), allocatable :: momentum(:, :)    !! (3, n) [kg/(m^2 s)]
    real(wp), allocatable :: velocity(:, :)    !! (3, n) momentum/density [m/s]
    real(wp), allocatable :: stress(:, :)      !! (9, n) of contacts, xx xy xz yx ... [Pa]
    real(wp), allocatable :: kinetic(:, :)     !! (9, n) of the motion about velocity [Pa]
    real(wp), allocatable :: fabric(:, :)      !! (9, n) sum V n n W: trace = solid x Z [-]
  end type fields_type

contains

  !> Radius of the kernel [m].
  pure real(wp) function reach_of(grid)
    type(grid_type), intent(in) :: grid
    reach_of = merge(3.0_wp, 2.0_wp, grid%kernel == kernel_gaussian)*grid%width
  end function reach_of

  !> Kernel, not normalised, at the square of the distance over w^2.
  pure real(wp) function kernel_value(kernel, square) result(w)
    integer(i4), intent(in) :: kernel
    real(wp), intent(in) :: square
    real(wp) :: q
    if (kernel == kernel_gaussian) then
      w = 0.0_wp
      if (square < 9.0_wp) w = exp(-0.5_wp*square)
    else
      q = 0.5_wp*sqrt(square)
      w = 0.0_wp
      if (q < 1.0_wp) w = (1.0_wp + 3.0_wp*q)*(1.0_wp - q)**3
    end if
  end function kernel_value

  !> Cells that x reaches and their weights [1/m^3]; weights times the cell sum to 1 in an
  !! unbounded grid.
  subroutine spread_over(grid, x, cell, weight, n)
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: x(3)
    integer(i4), allocatable, intent(inout) :: cell(:)  !! from 1, x fastest
    real(wp), allocatable, intent(inout) :: weight(:)
    integer(i4), intent(out) :: n
    real(wp) :: edge(3), d(3), total, w
    integer(i4) :: first(3), last(3), i, j, k, room

    edge = (grid%upper - grid%lower)/grid%cells
    first = ceiling((x - reach_of(grid) - grid%lower)/edge - 0.5_wp)
    last = floor((x + reach_of(grid) - grid%lower)/edge - 0.5_wp)
    room = product(max(last - first + 1, 0))
    if (allocated(cell)) then
      if (size(cell) < room) deallocate (cell, weight)
    end if
    if (.not. allocated(cell)) allocate (cell(room), weight(room))
    n = 0
    total = 0.0_wp
    do k = first(3), last(3)
      do j = first(2), last(2)
        do i = first(1), last(1)
          d = grid%lower + (real([i, j, k], wp) + 0.5_wp)*edge - x
          w = kernel_value(grid%kernel, sum(d**2)/grid%width**2)
          total = total + w
          if (any([i, j, k] < 0) .or. any([i, j, k] >= grid%cells)) cycle
          n = n + 1
          cell(n) = 1 + i + grid%cells(1)*(j + grid%cells(2)*k)
          weight(n) = w
        end do
      end do
    end do
    weight(:n) = weight(:n)/(total*product(edge))
  end subroutine spread_over

  !> All fields of a sample.
  subroutine coarse_grain(sample, grid, fields)
    type(sample_type), intent(in) :: sample
    type(grid_type), intent(in) :: grid
    type(fields_type), intent(out) :: fields
    integer(i4) :: n, k

    n = product(grid%cells)
    fields%n = n
    allocate (fields%solid(n), fields%density(n), source=0.0_wp)
    allocate (fields%momentum(3, n), fields%velocity(3, n), source=0.0_wp)
    allocate (fields%stress(9, n), fields%kinetic(9, n), fields%fabric(9, n), source=0.0_wp)
    call spread_grains(sample, grid, fields)
    call spread_contacts(sample, grid, fields)
    do k = 1, n
      if (.not. fields%density(k) > 0.0_wp) cycle
      fields%velocity(:, k) = fields%momentum(:, k)/fields%density(k)
      fields%kinetic(:, k) = fields%kinetic(:, k) &
                             + row9(dyad(fields%momentum(:, k), fields%velocity(:, k)))
    end do
  end subroutine coarse_grain

  !> Mass, momentum, solid volume, and -m v v W of the free grains and of the prescribed ones.
  subroutine spread_grains(sample, grid, fields)
    type(sample_type), intent(in) :: sample
    type(grid_type), intent(in) :: grid
    type(fields_type), intent(inout) :: fields
    integer(i4), allocatable :: cell(:)
    real(wp), allocatable :: weight(:)
    real(wp) :: m
    integer(i4) :: i, k, n

    do i = 1, sample%n
      call spread_over(grid, sample%x(:, i), cell, weight, n)
      m = sample%mass(i)
      do k = 1, n
        associate (c => cell(k), w => weight(k))
          fields%solid(c) = fields%solid(c) + sample%volume(i)*w
          fields%density(c) = fields%density(c) + m*w
          fields%momentum(:, c) = fields%momentum(:, c) + m*w*sample%v(:, i)
          fields%kinetic(:, c) = fields%kinetic(:, c) &
                                 - m*w*row9(dyad(sample%v(:, i), sample%v(:, i)))
        end associate
      end do
    end do
  end subroutine spread_grains

  !> Stress along both arms of each contact, fabric at the centres.
  subroutine spread_contacts(sample, grid, fields)
    type(sample_type), intent(in) :: sample
    type(grid_type), intent(in) :: grid
    type(fields_type), intent(inout) :: fields
    integer(i4), allocatable :: cell(:)
    real(wp), allocatable :: weight(:)
    real(wp) :: nn(9)
    integer(i4) :: c, k, n, side, grain

    do c = 1, sample%contacts
      associate (p => sample%point(:, c))
        call spread_arm(grid, sample%start(:, c), p, sample%force(:, c), fields)
        call spread_arm(grid, p, sample%far_end(c), sample%force(:, c), fields)
      end associate
      nn = row9(dyad(sample%normal(:, c), sample%normal(:, c)))
      do side = 1, 2
        grain = merge(sample%first(c), sample%second(c), side == 1)
        if (grain == 0) cycle
        call spread_over(grid, sample%x(:, grain), cell, weight, n)
        do k = 1, n
          fields%fabric(:, cell(k)) = fields%fabric(:, cell(k)) &
                                      + sample%volume(grain)*weight(k)*nn
        end do
      end do
    end do
  end subroutine spread_contacts

  !> (b - a) f times the kernel along the way from a to b: two Gauss points to each half of the
  !! width.
  subroutine spread_arm(grid, a, b, force, fields)
    type(grid_type), intent(in) :: grid
    real(wp), intent(in) :: a(3), b(3)   !! [m]
    real(wp), intent(in) :: force(3)     !! on the grain at a's end [N]
    type(fields_type), intent(inout) :: fields
    real(wp), parameter :: apart = 0.5_wp, gauss = 0.5_wp/sqrt(3.0_wp)
    integer(i4), allocatable :: cell(:)
    real(wp), allocatable :: weight(:)
    real(wp) :: t(9), s
    integer(i4) :: pieces, p, side, k, n

    if (.not. sum((b - a)**2) > 0.0_wp) return
    pieces = max(1, ceiling(norm2(b - a)/(apart*grid%width)))
    t = row9(dyad(b - a, force))/(2*pieces)
    do p = 1, pieces
      do side = -1, 1, 2
        s = (p - 0.5_wp + side*gauss)/pieces
        call spread_over(grid, a + s*(b - a), cell, weight, n)
        do k = 1, n
          fields%stress(:, cell(k)) = fields%stress(:, cell(k)) + weight(k)*t
        end do
      end do
    end do
  end subroutine spread_arm

  pure function row9(t) result(r)
    real(wp), intent(in) :: t(3, 3)
    real(wp) :: r(9)
    r = reshape(transpose(t), [9])
  end function row9
end module talus_coarse
