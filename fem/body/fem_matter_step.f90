!> The largest stable step of elements at finite strain, by the element eigenvalue bound with the
!! tangent where they are; it shrinks as they are compressed.
module fem_matter_step
  use talus_kinds, only: wp, i4, i8
  use fem_assembly, only: lumped_mass_of
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_matter, only: fem_matter_type
  use fem_points, only: fem_work_type
  use fem_spectrum, only: lanes, largest_values
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: tangent_frequency

  integer(i4), parameter :: chunks = 64  !! of elements

contains

  !> Raise the square of the largest circular frequency [1/s^2] to that of the elements at finite
  !! strain in their trial state, and name the element. The same bits for any number of threads.
  subroutine tangent_frequency(mesh, dofs, elastic, matter, factor, square, element)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_matter_type), intent(in) :: matter
    real(wp), intent(in) :: factor(:)        !! (blocks) on the mass [-]
    real(wp), intent(inout) :: square
    integer(i4), intent(inout) :: element
    real(wp) :: most(chunks)
    integer(i4) :: stiffest(chunks), c
    !$omp parallel do default(none) shared(mesh, dofs, elastic, matter, factor, most, stiffest) &
    !$omp private(c) schedule(dynamic)
    do c = 1, chunks
      call chunk_frequency(mesh, dofs, elastic, matter, factor, c, most(c), stiffest(c))
    end do
    !$omp end parallel do
    c = int(maxloc(most, 1), i4)
    if (most(c) <= square) return
    square = most(c)
    element = stiffest(c)
  end subroutine tangent_frequency

  !> The elements of chunk c; neighbours of one rule are processed together, the last pads.
  subroutine chunk_frequency(mesh, dofs, elastic, matter, factor, c, most, element)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_matter_type), intent(in) :: matter
    real(wp), intent(in) :: factor(:)
    integer(i4), intent(in) :: c
    real(wp), intent(out) :: most
    integer(i4), intent(out) :: element
    real(wp), allocatable :: matrix(:, :, :)
    real(wp) :: top(lanes)
    integer(i4) :: e, first, last, l, n, waiting(lanes)

    most = 0.0_wp
    element = 0
    first = int((c - 1)*int(mesh%elements, i8)/chunks, i4) + 1
    last = int(c*int(mesh%elements, i8)/chunks, i4)
    l = 0
    do e = first, last
      if (at_finite_strain(matter, e)) then
        n = 3*(dofs%start(e + 1) - dofs%start(e))
        if (l == 0) allocate (matrix(lanes, n, n))
        l = l + 1
        waiting(l:) = e
        call matrix_of(mesh, dofs, elastic, matter, factor, e, l, matrix)
      end if
      if (l == 0) cycle
      if (e < last .and. l < lanes) then
        if (elastic%rule_of(e + 1) == elastic%rule_of(waiting(l))) cycle
      end if
      do n = l + 1, lanes
        matrix(n, :, :) = matrix(l, :, :)
      end do
      call largest_values(matrix, top)
      n = int(maxloc(top, 1), i4)
      if (top(n) > most) element = waiting(n)
      most = max(most, top(n))
      deallocate (matrix)
      l = 0
    end do
  end subroutine chunk_frequency

  pure logical function at_finite_strain(matter, e)
    type(fem_matter_type), intent(in) :: matter
    integer(i4), intent(in) :: e
    at_finite_strain = matter%micro%active
    if (.not. at_finite_strain) at_finite_strain = matter%law(matter%law_of(e))%law%finite
  end function at_finite_strain

  !> m^-1/2 K m^-1/2 of element e into lane l, with lumped mass and the symmetric part of K [1/s^2].
  subroutine matrix_of(mesh, dofs, elastic, matter, factor, e, l, matrix)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_matter_type), intent(in) :: matter
    real(wp), intent(in) :: factor(:)
    integer(i4), intent(in) :: e, l
    real(wp), intent(inout) :: matrix(:, :, :)
    type(fem_work_type) :: work
    real(wp), allocatable :: lumped(:)
    real(wp) :: k(size(matrix, 2), size(matrix, 2)), root(size(matrix, 2))
    integer(i4) :: i, j
    work%element = e
    call matter%element_tangent(mesh, dofs, elastic, work, k)
    call lumped_mass_of(mesh, dofs, elastic, e, lumped)
    lumped = lumped*factor(dofs%block(dofs%start(e):dofs%start(e + 1) - 1))
    root = [(1.0_wp/sqrt(lumped((i + 2)/3)), i=1, size(root))]
    do j = 1, size(root)
      do i = 1, size(root)
        matrix(l, i, j) = 0.5_wp*root(i)*(k(i, j) + k(j, i))*root(j)
      end do
    end do
  end subroutine matrix_of
end module fem_matter_step
