!> Geometry of the periodic cell and of the homogeneous flow (theory-dem, "Periodic cell").
!!
!! A step of length dt with the velocity gradient L carries x to o + E (x - o), o the origin,
!! E = (1 - dt L/2)^-1 (1 + dt L/2): exact for simple shear, a rotation where L is one.
!! eq. D.8
module dem_cell
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: cross, inverse_of
  use dem_state, only: dem_cell_type
  implicit none
  private
  public :: advance_cell, reduced_basis, least_width, cell_volume, list_in_cell, set_cell
  public :: shift_of, is_periodic, fractions, determinant, folded

  real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                               0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
  integer(i4), parameter :: most_rounds = 1000  !! of the reduction of a basis
  real(wp), parameter :: less = 1.0_wp - 1.0e-9_wp  !! an edge is not changed for one as long

contains

  !> A cell at rest.
  pure subroutine set_cell(cell, origin, vectors, periodic)
    type(dem_cell_type), intent(inout) :: cell
    real(wp), intent(in) :: origin(3), vectors(3, 3)  !! [m]
    logical, intent(in) :: periodic(3)
    cell%active = .true.
    cell%origin = origin
    cell%vectors = vectors
    cell%start = vectors
    cell%listed = vectors
    cell%periodic = periodic
    cell%deform = unit
    cell%back = unit
  end subroutine set_cell

  pure logical function is_periodic(cell)
    type(dem_cell_type), intent(in) :: cell
    is_periodic = cell%active .and. any(cell%periodic)
  end function is_periodic

  pure real(wp) function determinant(a)
    real(wp), intent(in) :: a(3, 3)
    determinant = dot_product(a(:, 1), cross(a(:, 2), a(:, 3)))
  end function determinant

  !> [m^3]
  pure real(wp) function cell_volume(cell)
    type(dem_cell_type), intent(in) :: cell
    cell_volume = determinant(cell%vectors)
  end function cell_volume

  !> Place of a point in units of the edges [-].
  pure function fractions(cell, x) result(s)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: x(3)  !! [m]
    real(wp) :: s(3), inverse(3, 3)
    inverse = inverse_of(cell%vectors)
    s = matmul(inverse, x - cell%origin)
  end function fractions

  !> Vector of a shift [m].
  pure function shift_of(cell, shift) result(r)
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: shift(3)
    real(wp) :: r(3)
    r = shift(1)*cell%vectors(:, 1) + shift(2)*cell%vectors(:, 2) + shift(3)*cell%vectors(:, 3)
  end function shift_of

  !> Points (3, n) moved by whole periodic edges into the cell [m].
  pure function folded(cell, x) result(inside)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: x(:, :)
    real(wp), allocatable :: inside(:, :)
    real(wp) :: s(3)
    integer(i4) :: i, k
    inside = x
    if (.not. is_periodic(cell)) return
    do i = 1, size(x, 2)
      s = fractions(cell, x(:, i))
      do k = 1, 3
        if (cell%periodic(k)) inside(:, i) = inside(:, i) - floor(s(k))*cell%vectors(:, k)
      end do
    end do
  end function folded

  !> Edges and maps of a step of length dt; the cell is advanced to its end.
  pure subroutine advance_cell(cell, dt)
    type(dem_cell_type), intent(inout) :: cell
    real(wp), intent(in) :: dt  !! [s]
    real(wp) :: half(3, 3), grown(3, 3), inverse(3, 3), less_half(3, 3)

    half = 0.5_wp*dt*cell%rate
    less_half = unit - half
    inverse = inverse_of(less_half)
    cell%step = 2.0_wp*matmul(inverse, half)
    inverse = inverse_of(unit + half)
    cell%back = matmul(inverse, less_half)
    grown = matmul(cell%step, cell%vectors)
    cell%speed = grown/dt
    cell%vectors = cell%vectors + grown
    inverse = inverse_of(cell%listed)
    cell%deform = matmul(cell%vectors, inverse)
    cell%stretch = 0.5_wp*sqrt(sum((cell%deform - unit)**2))*cell%reach
  end subroutine advance_cell

  !> The list is made now and holds branches up to reach [m].
  pure subroutine list_in_cell(cell, reach)
    type(dem_cell_type), intent(inout) :: cell
    real(wp), intent(in) :: reach
    cell%listed = cell%vectors
    cell%deform = unit
    cell%reach = reach
    cell%stretch = 0.0_wp
  end subroutine list_in_cell

  !> Short edges of the same lattice, vectors = edges of the cell times whole numbers; edges that
  !! are not periodic stay.
  pure subroutine reduced_basis(cell, vectors, whole)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(out) :: vectors(3, 3)      !! columns [m]
    integer(i4), intent(out) :: whole(3, 3)     !! vectors = matmul(cell%vectors, whole)
    integer(i4) :: i, j, m, round
    logical :: changed

    vectors = cell%vectors
    whole = nint(unit)
    do round = 1, most_rounds
      changed = .false.
      do i = 1, 3
        do j = 1, 3
          if (i == j .or. .not. (cell%periodic(i) .and. cell%periodic(j))) cycle
          m = nint(less*dot_product(vectors(:, i), vectors(:, j))/sum(vectors(:, j)**2))
          if (m == 0) cycle
          vectors(:, i) = vectors(:, i) - m*vectors(:, j)
          whole(:, i) = whole(:, i) - m*whole(:, j)
          changed = .true.
        end do
      end do
      if (.not. changed) exit
    end do
    do i = 1, 3
      vectors(:, i) = shift_of(cell, whole(:, i))
    end do
  end subroutine reduced_basis

  !> Least distance of two opposite periodic faces of the reduced cell [m]; huge without any.
  pure real(wp) function least_width(cell) result(width)
    type(dem_cell_type), intent(in) :: cell
    real(wp) :: h(3, 3), area(3)
    integer(i4) :: whole(3, 3), k

    width = huge(1.0_wp)
    call reduced_basis(cell, h, whole)
    do k = 1, 3
      if (.not. cell%periodic(k)) cycle
      area = cross(h(:, 1 + mod(k, 3)), h(:, 1 + mod(k + 1, 3)))
      width = min(width, abs(determinant(h))/norm2(area))
    end do
  end function least_width
end module dem_cell
