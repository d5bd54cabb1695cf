!> The largest stable step of central differences, by the element eigenvalue bound: the largest
!! frequency of the body is at most that of its stiffest element with its own lumped mass (Irons;
!! theory: dynamics). Micro-inertia may be raised where rotations alone would govern the step.
module fem_critical
  use talus_kinds, only: wp, i4
  use fem_assembly, only: stiffness_of, lumped_mass_of
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_types, only: fem_mesh_type, fem_springs_type
  implicit none
  private
  public :: largest_frequency, scale_rotations, stable_step

  real(wp), parameter :: same = 1.0e-12_wp  !! relative difference of matrices that count as equal

  interface
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: wp
      character(len=1), intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(wp), intent(inout) :: a(lda, *)
      real(wp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev
  end interface

contains

  !> Bound of the largest circular frequency [rad/s] and the element that sets it; springs to the
  !! ground add their row sums.
  subroutine largest_frequency(mesh, dofs, elastic, springs, lumped, frequency, element)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_springs_type), intent(in) :: springs
    real(wp), intent(in) :: lumped(:)          !! (blocks) [kg]
    real(wp), intent(out) :: frequency
    integer(i4), intent(out) :: element
    real(wp), allocatable :: k(:, :, :, :), mass(:), last_k(:, :, :, :), last_mass(:)
    real(wp) :: square, most, extra(size(lumped))
    integer(i4) :: e, n, s, a

    most = 0.0_wp
    element = 0
    square = 0.0_wp
    do e = 1, mesh%elements
      n = dofs%start(e + 1) - dofs%start(e)
      call matrices_of(mesh, dofs, elastic, e, k, mass)
      if (.not. unchanged(k, mass, last_k, last_mass)) square = top_value(k, mass, 1, n)
      if (square > most) then
        most = square
        element = e
      end if
      call move_alloc(k, last_k)
      call move_alloc(mass, last_mass)
    end do
    extra = 0.0_wp
    do s = 1, springs%n
      do a = 1, size(springs%node, 1)
        extra(springs%node(a, s)) = extra(springs%node(a, s)) + abs(springs%weight(a, s)) &
          *sum(abs(springs%weight(:, s)))*maxval(sum(abs(springs%stiffness(:, :, s)), 1))
      end do
    end do
    frequency = sqrt(most + maxval(extra/lumped))
  end subroutine largest_frequency

  !> Stiffness and lumped mass of an element.
  subroutine matrices_of(mesh, dofs, elastic, e, k, mass)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    real(wp), allocatable, intent(out) :: k(:, :, :, :), mass(:)
    integer(i4) :: n
    n = dofs%start(e + 1) - dofs%start(e)
    allocate (k(3, 3, n, n))
    k = 0.0_wp
    call stiffness_of(mesh, dofs, elastic, e, k)
    call lumped_mass_of(mesh, dofs, elastic, e, mass)
  end subroutine matrices_of

  !> Is the element like the one before? Regular meshes are done at once by this.
  pure logical function unchanged(k, mass, last_k, last_mass)
    real(wp), intent(in) :: k(:, :, :, :), mass(:)
    real(wp), allocatable, intent(in) :: last_k(:, :, :, :), last_mass(:)
    unchanged = .false.
    if (.not. allocated(last_k)) return
    if (size(last_mass) /= size(mass)) return
    unchanged = maxval(abs(mass - last_mass)) <= same*maxval(mass) &
                .and. maxval(abs(k - last_k)) <= same*maxval(abs(k))
  end function unchanged

  !> Largest eigenvalue of the lumped mass and stiffness of blocks first to last [1/s^2].
  real(wp) function top_value(k, mass, first, last)
    real(wp), intent(in) :: k(:, :, :, :), mass(:)
    integer(i4), intent(in) :: first, last
    real(wp) :: matrix(3*(last - first + 1), 3*(last - first + 1))
    real(wp) :: values(size(matrix, 1)), work(12*size(matrix, 1))
    integer(i4) :: a, b, i, j
    integer :: info
    do b = first, last
      do a = first, b
        i = 3*(a - first)
        j = 3*(b - first)
        matrix(i + 1:i + 3, j + 1:j + 3) = k(:, :, a, b)/sqrt(mass(a)*mass(b))
      end do
    end do
    call dsyev('N', 'U', size(matrix, 1), matrix, size(matrix, 1), values, work, size(work), info)
    top_value = merge(values(size(values)), huge(1.0_wp), info == 0)
  end function top_value

  !> Raise the micro-inertia of all elements by a factor; factor <= 0: of each element so far that
  !! its rotations alone are no faster than its displacements. `most` is the largest factor.
  subroutine scale_rotations(mesh, dofs, elastic, factor, most)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(inout) :: elastic
    real(wp), intent(in) :: factor
    real(wp), intent(out) :: most
    real(wp), allocatable :: k(:, :, :, :), mass(:), last_k(:, :, :, :), last_mass(:)
    real(wp) :: needed
    integer(i4) :: e, m, n

    most = max(1.0_wp, factor)
    if (factor > 0.0_wp) elastic%inertia = factor*elastic%inertia
    if (factor > 0.0_wp) return
    needed = 1.0_wp
    do e = 1, mesh%elements
      m = elastic%rule(elastic%rule_of(e))%nodes
      n = dofs%start(e + 1) - dofs%start(e)
      if (n == m) cycle
      call matrices_of(mesh, dofs, elastic, e, k, mass)
      if (.not. unchanged(k, mass, last_k, last_mass)) &
        needed = max(1.0_wp, top_value(k, mass, m + 1, n)/top_value(k, mass, 1, m))
      elastic%inertia(e) = needed*elastic%inertia(e)
      most = max(most, needed)
      call move_alloc(k, last_k)
      call move_alloc(mass, last_mass)
    end do
  end subroutine scale_rotations

  !> Largest stable step [s] for a frequency [rad/s] and Rayleigh's stiffness factor b [s], whose
  !! forces lag by half a step.
  pure real(wp) function stable_step(frequency, stiffness_damping)
    real(wp), intent(in) :: frequency, stiffness_damping
    real(wp) :: ratio
    ratio = 0.5_wp*stiffness_damping*frequency
    stable_step = 2.0_wp/frequency*(sqrt(1.0_wp + ratio**2) - ratio)
  end function stable_step
end module fem_critical
