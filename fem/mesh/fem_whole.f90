!> The whole mesh behind the parts of the ranks: what the leader needs to write results, and
!! what every rank needs to find its share in a file. Where nodes are dealt out the leader alone
!! has it, and sends the others their shares. Without several ranks all of it is empty, and values
!! stay as they are.
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
    integer(i4), allocatable :: laws(:)      !! those with a state that some element has
    logical :: dealt = .false.               !! each rank has the nodes of its elements alone
    integer(i4), allocatable :: block_of(:)  !! the leader's: all blocks in the order of owners
    integer(i4) :: all_elements = 0, all_points = 0  !! of a mesh that is dealt out
  contains
    procedure :: collect_blocks
    procedure :: deal_blocks
    procedure :: uses_law
    procedure :: collect_cells
    procedure :: collect_points
    procedure :: own_points
    procedure :: deal_points
    procedure :: points
    procedure :: elements
  end type fem_whole_type

contains

  !> Points of all ranks, of which this one has `own`.
  pure integer(i4) function points(self, own)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: own
    points = merge(self%all_points, own, self%dealt)
    if (allocated(self%point)) points = self%point(size(self%point)) - 1
  end function points

  !> Elements of all ranks, of which this one has `own`.
  pure integer(i4) function elements(self, own)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: own
    elements = merge(self%all_elements, own, self%dealt)
    if (allocated(self%part)) elements = size(self%part)
  end function elements

  !> Does an element of the mesh have law m? `own` are the laws of this rank's.
  pure logical function uses_law(self, m, own)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: m, own(:)
    if (allocated(self%laws)) then
      uses_law = any(self%laws == m)
    else
      uses_law = any(own == m)
    end if
  end function uses_law

  !> Values (m, blocks) of all blocks on the leader, in the order of the mesh; none elsewhere.
  subroutine collect_blocks(self, own, values, all)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: own(:)  !! blocks that this rank owns, where they are dealt
    real(wp), intent(in) :: values(:, :)
    real(wp), allocatable, intent(out) :: all(:, :)
    real(wp), allocatable :: parts(:, :)
    integer(i4) :: k
    if (.not. self%dealt) then
      allocate (all, source=values(:, :merge(size(values, 2), 0, self%ranks%leads())))
      return
    end if
    call self%ranks%collect_columns(values(:, own), parts)
    allocate (all, mold=parts)
    do k = 1, int(size(all, 2), i4)
      all(:, self%block_of(k)) = parts(:, k)
    end do
  end subroutine collect_blocks

  !> Of values (m, blocks) of all blocks, which the leader has, those of this rank's; `number` are
  !! the places of these in the whole.
  subroutine deal_blocks(self, number, all, values)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: number(:)
    real(wp), intent(in) :: all(:, :)
    real(wp), intent(inout), contiguous :: values(:, :)
    integer(i4), allocatable :: list(:)
    integer(i4) :: r
    if (.not. self%ranks%leads()) then
      call self%ranks%give_numbers(0_i4, number)
      call self%ranks%take_values(0_i4, values)
      return
    end if
    do r = 1, self%ranks%ranks - 1
      call self%ranks%take_numbers(r, list)
      call self%ranks%give_values(r, all(:, list))
    end do
    values = all(:, number)
  end subroutine deal_blocks

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
    if (.not. self%ranks%several()) return
    call points_of_rank(self, self%ranks%rank, values, mine)
    call move_alloc(mine, values)
  end subroutine own_points

  !> The same of values that the leader has alone, where nodes are dealt out.
  subroutine deal_points(self, all, values)
    class(fem_whole_type), intent(in) :: self
    real(wp), intent(in) :: all(:, :)
    real(wp), intent(inout), contiguous :: values(:, :)
    real(wp), allocatable :: part(:, :)
    integer(i4) :: r
    if (.not. self%ranks%leads()) then
      call self%ranks%take_values(0_i4, values)
      return
    end if
    do r = 1, self%ranks%ranks - 1
      call points_of_rank(self, r, all, part)
      call self%ranks%give_values(r, part)
    end do
    call points_of_rank(self, 0_i4, all, part)
    values = part
  end subroutine deal_points

  !> Of values (m, points) of all elements those of rank r.
  pure subroutine points_of_rank(self, r, values, mine)
    class(fem_whole_type), intent(in) :: self
    integer(i4), intent(in) :: r
    real(wp), intent(in) :: values(:, :)
    real(wp), allocatable, intent(out) :: mine(:, :)
    integer(i4) :: e, n, m, pass
    do pass = 1, 2
      n = 0
      do e = 1, size(self%part)
        if (self%part(e) /= r) cycle
        m = self%point(e + 1) - self%point(e)
        if (pass == 2) mine(:, n + 1:n + m) = values(:, self%point(e):self%point(e + 1) - 1)
        n = n + m
      end do
      if (pass == 1) allocate (mine(size(values, 1), n))
    end do
  end subroutine points_of_rank
end module fem_whole
