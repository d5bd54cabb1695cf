!> The whole mesh behind the parts of the ranks: what the leader needs to write results, and
!! what every rank needs to find its share in a file. Without several ranks all of it is empty, and
!! values stay as they are.
module fem_whole
  use talus_kinds, only: wp, i4
  use talus_ranks, only: ranks_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: fem_whole_type

  type :: fem_whole_type
    type(ranks_type) :: ranks
    type(fem_mesh_type) :: mesh              !! the leader's
    integer(i4), allocatable :: part(:)      !! (elements of all) rank of each
    integer(i4), allocatable :: point(:)     !! (elements of all + 1) first point of each
    integer(i4), allocatable :: law_of(:)    !! (elements of all) law with a state
  contains
    procedure :: collect_cells
    procedure :: collect_points
    procedure :: own_points
    procedure :: points
    procedure :: elements
  end type fem_whole_type

contains

  !> Points of all ranks, of which this one has `own`.
  pure integer(i4) function points(self, own)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: own
    points = own
    if (allocated(self%point)) points = self%point(size(self%point)) - 1
  end function points

  !> Elements of all ranks, of which this one has `own`.
  pure integer(i4) function elements(self, own)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: own
    elements = own
    if (allocated(self%part)) elements = size(self%part)
  end function elements

  !> Values (m, elements) of all elements on the leader, in the order of the mesh; none elsewhere.
  subroutine collect_cells(self, values)
    class(fem_whole_type), intent(in) :: self
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: all(:, :)
    integer(i4) :: r, e, n
    if (.not. self%ranks%several()) return
    call self%ranks%collect_columns(values, all)
    deallocate (values)
    allocate (values(size(all, 1), size(all, 2)))
    if (.not. self%ranks%leads()) return
    n = 0
    do r = 0, self%ranks%ranks - 1
      do e = 1, size(self%part)
        if (self%part(e) /= r) cycle
        n = n + 1
        values(:, e) = all(:, n)
      end do
    end do
  end subroutine collect_cells

  !> Values (m, points) of all points on the leader.
  subroutine collect_points(self, values)
    class(fem_whole_type), intent(in) :: self
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: all(:, :)
    integer(i4) :: r, e, n, m
    if (.not. self%ranks%several()) return
    call self%ranks%collect_columns(values, all)
    deallocate (values)
    allocate (values(size(all, 1), size(all, 2)))
    if (.not. self%ranks%leads()) return
    n = 0
    do r = 0, self%ranks%ranks - 1
      do e = 1, size(self%part)
        if (self%part(e) /= r) cycle
        m = self%point(e + 1) - self%point(e)
        values(:, self%point(e):self%point(e + 1) - 1) = all(:, n + 1:n + m)
        n = n + m
      end do
    end do
  end subroutine collect_points

  !> Of values (m, points) of all elements those of this rank's.
  subroutine own_points(self, values)
    class(fem_whole_type), intent(in) :: self
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: mine(:, :)
    integer(i4) :: e, n, m, pass
    if (.not. self%ranks%several()) return
    do pass = 1, 2
      n = 0
      do e = 1, size(self%part)
        if (self%part(e) /= self%ranks%rank) cycle
        m = self%point(e + 1) - self%point(e)
        if (pass == 2) mine(:, n + 1:n + m) = values(:, self%point(e):self%point(e + 1) - 1)
        n = n + m
      end do
      if (pass == 1) allocate (mine(size(values, 1), n))
    end do
    call move_alloc(mine, values)
  end subroutine own_points
end module fem_whole
