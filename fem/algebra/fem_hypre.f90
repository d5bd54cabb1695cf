!> Interfaces to the C of fem_hypre.c: a matrix on ranks and its algebraic multigrid.
module fem_hypre
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_ptr
  implicit none
  private
  public :: hypre_new, hypre_add, hypre_set_up, hypre_solve, hypre_free

  interface
    !> Matrix with `rows` rows of this rank from `first` (0 is the first of all).
    type(c_ptr) function hypre_new(comm, first, rows, room) bind(c, name='talus_hypre_new')
      import :: c_int, c_ptr
      integer(c_int), value, intent(in) :: comm, first, rows
      integer(c_int), intent(in) :: room(*)  !! (rows) entries in each, about
    end function hypre_new
    !> Add to rows, of other ranks too; not zero: a fault.
    integer(c_int) function hypre_add(system, rows, counts, row, column, value) &
      bind(c, name='talus_hypre_add')
      import :: c_double, c_int, c_ptr
      type(c_ptr), value, intent(in) :: system
      integer(c_int), value, intent(in) :: rows
      integer(c_int), intent(in) :: counts(*), row(*), column(*)
      real(c_double), intent(in) :: value(*)
    end function hypre_add
    !> The hierarchy; not zero: a fault.
    integer(c_int) function hypre_set_up(system, functions, function, symmetric) &
      bind(c, name='talus_hypre_set_up')
      import :: c_int, c_ptr
      type(c_ptr), value, intent(in) :: system
      integer(c_int), value, intent(in) :: functions, symmetric
      integer(c_int), intent(in) :: function(*)  !! (rows) component, from 0
    end function hypre_set_up
    !> Iterations; negative: a fault.
    integer(c_int) function hypre_solve(system, gradients, tolerance, most, right, x, residual) &
      bind(c, name='talus_hypre_solve')
      import :: c_double, c_int, c_ptr
      type(c_ptr), value, intent(in) :: system
      integer(c_int), value, intent(in) :: gradients, most
      real(c_double), value, intent(in) :: tolerance
      real(c_double), intent(in) :: right(*)
      real(c_double), intent(out) :: x(*)
      real(c_double), intent(out) :: residual(2)  !! of the method, true
    end function hypre_solve
    subroutine hypre_free(system) bind(c, name='talus_hypre_free')
      import :: c_ptr
      type(c_ptr), value, intent(in) :: system
    end subroutine hypre_free
  end interface
end module fem_hypre
