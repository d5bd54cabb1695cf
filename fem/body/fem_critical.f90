!> The largest stable step of the time integration, by the element eigenvalue bound: the largest
!! frequency of the body is at most that of its stiffest element with its own mass, factors of the
!! port on it (Irons; theory: dynamics). Micro-inertia may be raised where rotations alone would
!! govern the step.
module fem_critical
  use talus_kinds, only: wp, i4, i8
  use talus_lapack, only: dsygv
  use fem_assembly, only: stiffness_of, lumped_mass_of, mass_of
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_halo, only: fem_halo_type
  use fem_spectrum, only: lanes, largest_values
  use fem_types, only: fem_mesh_type, fem_springs_type
  implicit none
  private
  public :: largest_frequency, spring_rate, scale_rotations, stable_step, newmark_step

  real(wp), parameter :: same = 1.0e-12_wp  !! relative difference of matrices that count as equal
  integer(i4), parameter :: chunks = 64          !! of elements

  !> Matrices of elements of one size, buffered until there are enough of them.
  type :: waiting_type
    integer(i4) :: n = 0
    integer(i4) :: element(lanes) = 0
    real(wp), allocatable :: matrix(:, :, :)  !! (lanes, n, n) [1/s^2]
  end type waiting_type

contains

  !> Bound of the square of the largest circular frequency [1/s^2] and the element that sets it.
  !! Elements are processed in chunks whose number does not depend on the threads, so that the bits
  !! of the step do not either.
  subroutine largest_frequency(mesh, dofs, elastic, factor, lumped, square, element)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: factor(:)   !! (blocks) on the mass [-]
    logical, intent(in) :: lumped       !! lumped or consistent mass
    real(wp), intent(out) :: square
    integer(i4), intent(out) :: element
    real(wp) :: most(chunks)
    integer(i4) :: stiffest(chunks), c
    !$omp parallel do default(none) shared(mesh, dofs, elastic, factor, lumped, most, stiffest) &
    !$omp private(c) schedule(dynamic)
    do c = 1, chunks
      call chunk_frequency(mesh, dofs, elastic, factor, lumped, c, most(c), stiffest(c))
    end do
    !$omp end parallel do
    c = int(maxloc(most, 1), i4)
    square = most(c)
    element = stiffest(c)
  end subroutine largest_frequency

  !> The same of the elements of chunk c.
  subroutine chunk_frequency(mesh, dofs, elastic, factor, lumped, c, most, element)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    real(wp), intent(in) :: factor(:)
    logical, intent(in) :: lumped
    integer(i4), intent(in) :: c
    real(wp), intent(out) :: most
    integer(i4), intent(out) :: element
    real(wp), allocatable :: k(:, :, :, :), mass(:, :), last_k(:, :, :, :), last_mass(:, :)
    type(waiting_type) :: waiting
    real(wp) :: square
    integer(i4) :: e, n, first, last

    most = 0.0_wp
    element = 0
    first = int((c - 1)*int(mesh%elements, i8)/chunks, i4) + 1
    last = int(c*int(mesh%elements, i8)/chunks, i4)
    do e = first, last
      n = dofs%start(e + 1) - dofs%start(e)
      call matrices_of(mesh, dofs, elastic, e, lumped, k, mass)
      call scale_block_mass(factor(dofs%block(dofs%start(e):dofs%start(e + 1) - 1)), mass)
      if (unchanged(k, mass, last_k, last_mass)) cycle
      if (lumped) then
        call wait_for_more(e, n, k, mass, waiting, most, element)
      else
        square = top_value(k, mass)
        if (square > most) element = e
        most = max(most, square)
      end if
      call move_alloc(k, last_k)
      call move_alloc(mass, last_mass)
    end do
    call work_off(waiting, most, element)
  end subroutine chunk_frequency

  !> Put an element with lumped mass to those that wait; full ranks, and others of another size,
  !! are processed.
  subroutine wait_for_more(e, n, k, mass, waiting, most, element)
    integer(i4), intent(in) :: e, n
    real(wp), intent(in) :: k(:, :, :, :), mass(:, :)
    type(waiting_type), intent(inout) :: waiting
    real(wp), intent(inout) :: most
    integer(i4), intent(inout) :: element

    if (allocated(waiting%matrix)) then
      if (size(waiting%matrix, 2) /= 3*n) then
        call work_off(waiting, most, element)
        deallocate (waiting%matrix)
      end if
    end if
    call put_matrix(e, k, mass, waiting)
    if (waiting%n == lanes) call work_off(waiting, most, element)
  end subroutine wait_for_more

  !> Add M^-1/2 K M^-1/2 of blocks of an element to the matrices that wait.
  subroutine put_matrix(e, k, mass, waiting)
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: k(:, :, :, :), mass(:, :)
    type(waiting_type), intent(inout) :: waiting
    integer(i4) :: a, b, i, l, n
    n = size(k, 4)
    if (.not. allocated(waiting%matrix)) allocate (waiting%matrix(lanes, 3*n, 3*n))
    waiting%n = waiting%n + 1
    l = waiting%n
    waiting%element(l) = e
    do b = 1, n
      do a = 1, b  ! the lower triangle from the blocks of the upper one
        do i = 1, 3
          waiting%matrix(l, 3*b - 2:3*b, 3*a - 3 + i) = k(i, :, a, b)/sqrt(mass(1, a)*mass(1, b))
        end do
      end do
    end do
  end subroutine put_matrix

  !> Raise `most` to the largest eigenvalue of those that wait; the first that has it is named.
  subroutine work_off(waiting, most, element)
    type(waiting_type), intent(inout) :: waiting
    real(wp), intent(inout) :: most
    integer(i4), intent(inout) :: element
    real(wp) :: top(lanes)
    integer(i4) :: l
    if (waiting%n == 0) return
    do l = waiting%n + 1, lanes
      waiting%matrix(l, :, :) = 0.0_wp
    end do
    call largest_values(waiting%matrix, top)
    do l = 1, waiting%n
      if (top(l) > most) element = waiting%element(l)
      most = max(most, top(l))
    end do
    waiting%n = 0
  end subroutine work_off

  !> Mass between blocks a and b times sqrt(f_a f_b), which leaves it positive; f of a lumped one.
  pure subroutine scale_block_mass(factor, mass)
    real(wp), intent(in) :: factor(:)
    real(wp), intent(inout) :: mass(:, :)
    integer(i4) :: a, b
    do b = 1, size(mass, 2)
      if (size(mass, 1) == 1) then
        mass(1, b) = factor(b)*mass(1, b)
      else
        do a = 1, size(mass, 1)
          mass(a, b) = sqrt(factor(a)*factor(b))*mass(a, b)
        end do
      end if
    end do
  end subroutine scale_block_mass

  !> What springs add at most to the square of a frequency [1/s^2]: their row sums over the mass.
  real(wp) function spring_rate(halo, springs, mass)
    type(fem_halo_type), intent(in) :: halo
    type(fem_springs_type), intent(in) :: springs
    real(wp), intent(in) :: mass(:)  !! (blocks) lumped [kg]
    real(wp) :: extra(1, size(mass))
    integer(i4) :: s, a
    spring_rate = 0.0_wp
    if (springs%n == 0 .and. .not. halo%dealt) return
    extra = 0.0_wp
    do s = 1, springs%n
      do a = 1, size(springs%node, 1)
        extra(1, springs%node(a, s)) = extra(1, springs%node(a, s)) + abs(springs%weight(a, s)) &
          *sum(abs(springs%weight(:, s)))*maxval(sum(abs(springs%stiffness(:, :, s)), 1))
      end do
    end do
    if (halo%dealt) call halo%sum_up(extra)
    spring_rate = maxval(extra(1, :)/mass)
    call halo%highest(spring_rate)
  end function spring_rate

  !> Stiffness of an element; its mass, lumped (1, n) or consistent (n, n).
  subroutine matrices_of(mesh, dofs, elastic, e, lumped, k, mass)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: e
    logical, intent(in) :: lumped
    real(wp), allocatable, intent(out) :: k(:, :, :, :), mass(:, :)
    real(wp), allocatable :: diagonal(:)
    integer(i4) :: n
    n = dofs%start(e + 1) - dofs%start(e)
    allocate (k(3, 3, n, n))
    k = 0.0_wp
    call stiffness_of(mesh, dofs, elastic, e, k)
    if (lumped) then
      call lumped_mass_of(mesh, dofs, elastic, e, diagonal)
      mass = reshape(diagonal, [1, n])
    else
      call mass_of(mesh, elastic, e, dofs%block(dofs%start(e):dofs%start(e + 1) - 1), mass)
    end if
  end subroutine matrices_of

  !> Is the element like the one before? Regular meshes are done at once by this.
  pure logical function unchanged(k, mass, last_k, last_mass)
    real(wp), intent(in) :: k(:, :, :, :), mass(:, :)
    real(wp), allocatable, intent(in) :: last_k(:, :, :, :), last_mass(:, :)
    unchanged = .false.
    if (.not. allocated(last_k)) return
    if (size(last_mass) /= size(mass)) return
    unchanged = maxval(abs(mass - last_mass)) <= same*maxval(mass) &
                .and. maxval(abs(k - last_k)) <= same*maxval(abs(k))
  end function unchanged

  !> Largest eigenvalue of a stiffness and its consistent mass [1/s^2].
  real(wp) function top_value(k, mass)
    real(wp), intent(in) :: k(:, :, :, :), mass(:, :)
    real(wp), dimension(3*size(k, 4), 3*size(k, 4)) :: matrix, heavy
    real(wp) :: values(size(matrix, 1)), work(12*size(matrix, 1))
    integer(i4) :: a, b, c, i, j
    integer :: info, n
    heavy = 0.0_wp
    do b = 1, size(k, 4)
      do a = 1, b
        i = 3*(a - 1)
        j = 3*(b - 1)
        matrix(i + 1:i + 3, j + 1:j + 3) = k(:, :, a, b)
        do c = 1, 3
          heavy(i + c, j + c) = mass(a, b)
        end do
      end do
    end do
    n = size(matrix, 1)
    call dsygv(1, 'N', 'U', n, matrix, n, heavy, n, values, work, size(work), info)
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
    real(wp) :: needed(mesh%elements), highest(1)
    integer(i4) :: c

    most = max(1.0_wp, factor)
    if (factor > 0.0_wp) elastic%inertia = factor*elastic%inertia
    if (factor > 0.0_wp) return
    needed = 1.0_wp
    !$omp parallel do default(none) shared(mesh, dofs, elastic, needed) private(c) schedule(dynamic)
    do c = 1, chunks
      call chunk_needs(mesh, dofs, elastic, c, needed)
    end do
    !$omp end parallel do
    elastic%inertia = needed*elastic%inertia
    highest = max(most, maxval(needed))
    call dofs%halo%most(highest)
    most = highest(1)
  end subroutine scale_rotations

  !> Square of the frequency of the rotations over that of the displacements, at least one, of the
  !! polar elements of chunk c.
  subroutine chunk_needs(mesh, dofs, elastic, c, needed)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_dofs_type), intent(in) :: dofs
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: c
    real(wp), intent(inout) :: needed(:)
    real(wp), allocatable :: k(:, :, :, :), mass(:, :), last_k(:, :, :, :), last_mass(:, :)
    type(waiting_type) :: turning, moving
    real(wp), allocatable :: square(:, :)
    integer(i4), allocatable :: like(:)
    integer(i4) :: e, m, n, first, last, latest

    first = int((c - 1)*int(mesh%elements, i8)/chunks, i4) + 1
    last = int(c*int(mesh%elements, i8)/chunks, i4)
    allocate (square(last - first + 1, 2), like(first:last))
    latest = 0
    do e = first, last
      m = elastic%rule(elastic%rule_of(e))%nodes
      n = dofs%start(e + 1) - dofs%start(e)
      like(e) = 0
      if (n == m) cycle
      call matrices_of(mesh, dofs, elastic, e, .true., k, mass)
      if (.not. unchanged(k, mass, last_k, last_mass)) then
        latest = e - first + 1
        call wait_for_value(latest, m + 1, n, k, mass, turning, square(:, 1))
        call wait_for_value(latest, 1, m, k, mass, moving, square(:, 2))
      end if
      like(e) = latest
      call move_alloc(k, last_k)
      call move_alloc(mass, last_mass)
    end do
    call values_of(turning, square(:, 1))
    call values_of(moving, square(:, 2))
    do e = first, last
      if (like(e) > 0) needed(e) = max(1.0_wp, square(like(e), 1)/square(like(e), 2))
    end do
  end subroutine chunk_needs

  !> Put blocks first to last of element e (of its chunk) into the buffer of its size.
  subroutine wait_for_value(e, first, last, k, mass, waiting, square)
    integer(i4), intent(in) :: e, first, last
    real(wp), intent(in) :: k(:, :, :, :), mass(:, :)
    type(waiting_type), intent(inout) :: waiting
    real(wp), intent(inout) :: square(:)  !! (elements of a chunk) [1/s^2]
    if (allocated(waiting%matrix)) then
      if (size(waiting%matrix, 2) /= 3*(last - first + 1)) then
        call values_of(waiting, square)
        deallocate (waiting%matrix)
      end if
    end if
    call put_matrix(e, k(:, :, first:last, first:last), mass(:, first:last), waiting)
    if (waiting%n == lanes) call values_of(waiting, square)
  end subroutine wait_for_value

  !> Largest values of the matrices that wait, each for its element.
  subroutine values_of(waiting, square)
    type(waiting_type), intent(inout) :: waiting
    real(wp), intent(inout) :: square(:)
    real(wp) :: top(lanes)
    if (waiting%n == 0) return
    waiting%matrix(waiting%n + 1:, :, :) = 0.0_wp
    call largest_values(waiting%matrix, top)
    square(waiting%element(:waiting%n)) = top(:waiting%n)
    waiting%n = 0
  end subroutine values_of

  !> Largest stable step [s] for a frequency [rad/s] and Rayleigh's stiffness factor b [s], whose
  !! forces lag by half a step.
  pure real(wp) function stable_step(frequency, stiffness_damping)
    real(wp), intent(in) :: frequency, stiffness_damping
    real(wp) :: ratio
    ratio = 0.5_wp*stiffness_damping*frequency
    stable_step = 2.0_wp/frequency*(sqrt(1.0_wp + ratio**2) - ratio)
  end function stable_step

  !> Largest stable step [s] of Newmark's scheme with 2 beta < gamma (Hughes 1987, section 9.1).
  pure real(wp) function newmark_step(frequency, beta, gamma)
    real(wp), intent(in) :: frequency, beta, gamma
    newmark_step = 1.0_wp/(frequency*sqrt(0.5_wp*gamma - beta))
  end function newmark_step
end module fem_critical
