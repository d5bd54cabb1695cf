!> Fits that bring the residual rows of the six uniform strain states to zero (theory: "Energy
!! partition").
!!
!! Unknowns are weights of contacts between ghosts and of points in the ghosts' elements, in [0, 1].
!! The least change is sought: min |x - x_0|^2 with A x + c = 0 and bounds. With multipliers y
!! of the rows x = clip(x_0 - A' y), and y comes from Newton's rounds
!!   (A_F A_F' + e I) dy = A x + c,   e a thousandth of the largest row,
!! F the unknowns inside the bounds at that time: what is clipped is fixed for a round and comes
!! back by itself; steps are shortened until the dual function grows (Zhao, Sun and Toh 2010). Rows
!! are scaled by the mean force of their state (and arm). A A' is dense: 8 rows^2 bytes and rows^3/3
!! operations a round (a second for 3700 rows), some five rounds.
!! eq. C.6
module cpl_weight_fit
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use cpl_dense, only: factor_dense, solve_dense
  use cpl_partition, only: partition_type, grain_ghost, region_ghost, state_count, &
    uniform_states, residual_rows, add_grain, add_point, ghost_ghost, mean_sizes
  implicit none
  private
  public :: fit_type, fit_joint, fit_elements, most_rows, closed

  integer(i4), parameter :: most_rows = 20000_i4  !! of a fit (3.2 GB)
  integer(i4), parameter :: most_rounds = 40_i4, most_halvings = 30_i4, most_raises = 4_i4
  integer(i4), parameter :: a_block = 3*state_count  !! rows of a block
  real(wp), parameter :: ridge = 1.0e-12_wp, share = 1.0e-3_wp
  real(wp), parameter :: closed = 1.0e-9_wp  !! rows that a fit may leave [-]
  real(wp), parameter :: done = 1.0e-13_wp   !! rows at which rounds end [-]

  !> What a fit did.
  type :: fit_type
    integer(i4) :: rows = 0, unknowns = 0, rounds = 0, clipped = 0
    real(wp) :: before = 0.0_wp, after = 0.0_wp  !! largest scaled row [-]
    real(wp) :: change = 0.0_wp                  !! largest of a weight [-]
  end type fit_type

  !> Weights for some multipliers.
  type :: trial_type
    real(wp), allocatable :: x(:), r(:)      !! weights, their rows
    logical, allocatable :: free(:)          !! inside the bounds
    real(wp) :: value = 0.0_wp               !! of the dual function
  end type trial_type

  !> Columns of A, sparse.
  type :: columns_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: contact(:), point(:)   !! of each column, 0: of the other kind
    integer(i4) :: rows = 0                            !! that any column reaches
    integer(i4), allocatable :: active(:)              !! (all rows) number, 0: not reached
    integer(i4), allocatable :: start(:), row(:)
    real(wp), allocatable :: value(:)
  end type columns_type

contains

  !> Fit weights of contacts and points together; with_contacts = .false. leaves contacts alone.
  subroutine fit_joint(self, with_contacts, w, beta, fit, errors)
    type(partition_type), intent(in) :: self
    logical, intent(in) :: with_contacts
    real(wp), intent(inout) :: w(:), beta(:)
    type(fit_type), intent(out) :: fit
    type(error_list_type), intent(inout) :: errors
    type(columns_type) :: columns
    real(wp), allocatable :: force(:, :, :), stress(:, :, :), scale(:), x(:), r(:), x0(:)

    call uniform_states(self, force, stress)
    call row_scales(self, force, scale)
    call make_columns(self, with_contacts, force, stress, scale, columns)
    fit%rows = columns%rows
    fit%unknowns = columns%n
    if (fit%rows > most_rows) then
      call errors%add('N440', 'the fit of the weights has '//str(fit%rows)//' rows, more than '// &
                      str(most_rows), 'energy partition', "its matrix is dense: take "// &
                      "partition = 'ramp', or fewer nodes under ghosts")
      return
    end if
    if (fit%rows == 0) return
    allocate (x0(columns%n))
    call read_weights(columns, w, beta, x0)
    call rows_now(self, w, beta, force, stress, scale, r)
    r = pack(r, columns%active > 0)
    fit%before = maxval(abs(r))
    call least_change(columns, x0, r, x, fit, errors)
    if (errors%any()) return
    call write_weights(columns, x, w, beta)
    call rows_now(self, w, beta, force, stress, scale, r)
    fit%after = maxval(abs(r), mask=columns%active > 0)
    fit%clipped = count(x <= 0.0_wp .or. x >= 1.0_wp)
    fit%change = maxval(abs(x - x0))
  end subroutine fit_joint

  !> 1 over mean force (times mean arm) of each row; 0 where a state has no forces.
  pure subroutine row_scales(self, force, scale)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: force(:, :, :)  !! (3, states, contacts) [N]
    real(wp), allocatable, intent(out) :: scale(:)
    real(wp) :: mean_force(size(force, 2)), mean_arm
    integer(i4) :: b, s, k
    call mean_sizes(self, force, mean_force, mean_arm)
    allocate (scale(a_block*self%blocks()), source=0.0_wp)
    do b = 1, self%blocks()
      do s = 1, state_count
        k = a_block*(b - 1) + 3*(s - 1)
        if (mean_force(s) > 0.0_wp) scale(k + 1:k + 3) = 1.0_wp/mean_force(s)
        if (b > self%nodes) scale(k + 1:k + 3) = scale(k + 1:k + 3)/mean_arm
        if (is_outer(self, b)) scale(k + 1:k + 3) = 0.0_wp
      end do
    end do
  end subroutine row_scales

  pure logical function is_outer(self, block)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: block
    is_outer = .false.
    if (allocated(self%outer)) is_outer = self%outer(1 + mod(block - 1, self%nodes))
  end function is_outer

  !> Scaled rows of all blocks.
  pure subroutine rows_now(self, w, beta, force, stress, scale, r)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: w(:), beta(:), force(:, :, :), stress(:, :, :), scale(:)
    real(wp), allocatable, intent(out) :: r(:)
    real(wp), allocatable :: row(:, :, :)
    call residual_rows(self, w, beta, force, stress, row)
    r = reshape(row, [size(scale)])*scale
  end subroutine rows_now

  !> What each unknown puts on the rows.
  pure subroutine make_columns(self, with_contacts, force, stress, scale, columns)
    type(partition_type), intent(in) :: self
    logical, intent(in) :: with_contacts
    real(wp), intent(in) :: force(:, :, :), stress(:, :, :), scale(:)
    type(columns_type), intent(inout) :: columns
    real(wp), allocatable :: row(:, :, :)
    integer(i4) :: c, q, n

    allocate (row(3, state_count, self%blocks()), source=0.0_wp)
    n = size(self%pair, 2) + size(self%element)
    allocate (columns%contact(n), columns%point(n), source=0_i4)
    allocate (columns%start(n + 1), columns%row(1024), columns%value(1024))
    columns%start(1) = 1
    if (with_contacts) then
      do c = 1, size(self%pair, 2)
        if (.not. ghost_ghost(self, c)) cycle
        call add_grain(self, c, 1_i4, 1.0_wp, force(:, :, c), row)
        call add_grain(self, c, 2_i4, 1.0_wp, force(:, :, c), row)
        columns%contact(columns%n + 1) = c
        call take_column(self, self%cell(self%pair(:, c)), scale, row, columns)
      end do
    end if
    do q = 1, size(self%element)
      if (self%region(self%element(q)) /= region_ghost) cycle
      call add_point(self, q, self%volume(q), stress(:, :, self%element(q)), row)
      columns%point(columns%n + 1) = q
      call take_column(self, self%element(q:q), scale, row, columns)
    end do
    call number_rows(size(scale, kind=i4), columns)
  end subroutine make_columns

  !> Move the rows of some elements' blocks into a new column and clear them.
  pure subroutine take_column(self, elements, scale, row, columns)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: elements(:)
    real(wp), intent(in) :: scale(:)
    real(wp), intent(inout) :: row(:, :, :)
    type(columns_type), intent(inout) :: columns
    integer(i4), allocatable :: longer(:)
    real(wp), allocatable :: longer_value(:)
    integer(i4) :: k, a, b, last

    last = columns%start(columns%n + 1) - 1
    k = last + a_block*size(elements)*(size(self%node_u, 1) + size(self%node_phi, 1))
    if (k > size(columns%row)) then
      allocate (longer(2*k), longer_value(2*k))
      longer(:last) = columns%row(:last)
      longer_value(:last) = columns%value(:last)
      call move_alloc(longer, columns%row)
      call move_alloc(longer_value, columns%value)
    end if
    do k = 1, size(elements)
      do a = 1, size(self%node_u, 1) + size(self%node_phi, 1)
        b = block_of(self, a, elements(k))
        if (b == 0) cycle
        call append_block(b, row(:, :, b), scale, columns, last)
        row(:, :, b) = 0.0_wp
      end do
    end do
    columns%n = columns%n + 1
    columns%start(columns%n + 1) = last + 1
  end subroutine take_column

  !> Entries of a block that are not 0, after the last one.
  pure subroutine append_block(b, block, scale, columns, last)
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: block(:, :)  !! (3, states)
    real(wp), intent(in) :: scale(:)
    type(columns_type), intent(inout) :: columns
    integer(i4), intent(inout) :: last
    integer(i4) :: s, i, at
    do s = 1, state_count
      do i = 1, 3
        at = a_block*(b - 1) + 3*(s - 1) + i
        if (.not. abs(block(i, s)*scale(at)) > 0.0_wp) cycle
        last = last + 1
        columns%row(last) = at
        columns%value(last) = block(i, s)*scale(at)
      end do
    end do
  end subroutine append_block

  !> Block of place a in an element's lists, 0 if there is none.
  pure integer(i4) function block_of(self, a, element) result(b)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: a, element
    if (a <= size(self%node_u, 1)) then
      b = self%node_u(a, element)
    else
      b = self%node_phi(a - size(self%node_u, 1), element)
      if (.not. self%polar) b = 0
      if (b > 0) b = b + self%nodes
    end if
  end function block_of

  !> Number the rows that any column reaches, and name them by it.
  pure subroutine number_rows(rows, columns)
    integer(i4), intent(in) :: rows
    type(columns_type), intent(inout) :: columns
    integer(i4) :: k, last
    allocate (columns%active(rows), source=0_i4)
    last = columns%start(columns%n + 1) - 1
    columns%active(columns%row(:last)) = 1
    do k = 1, rows
      if (columns%active(k) == 0) cycle
      columns%rows = columns%rows + 1
      columns%active(k) = columns%rows
    end do
    columns%row(:last) = columns%active(columns%row(:last))
  end subroutine number_rows

  !> Newton's rounds for the multipliers. r0: rows at x0; x: the weights found.
  subroutine least_change(columns, x0, r0, x, fit, errors)
    type(columns_type), intent(in) :: columns
    real(wp), intent(in) :: x0(:), r0(:)
    real(wp), allocatable, intent(out) :: x(:)
    type(fit_type), intent(inout) :: fit
    type(error_list_type), intent(inout) :: errors
    type(trial_type) :: now, next
    real(wp), allocatable :: matrix(:, :), y(:), dy(:)
    real(wp) :: part, before
    integer(i4) :: k
    logical :: good

    allocate (matrix(columns%rows, columns%rows), y(columns%rows), source=0.0_wp)
    call weights_at(columns, x0, r0, y, now)
    do while (fit%rounds < most_rounds .and. maxval(abs(now%r)) > done)
      fit%rounds = fit%rounds + 1
      do k = 1, most_raises
        call square(columns, now%free, max(ridge, share*min(1.0_wp, maxval(abs(now%r)))) &
                    *share**(1 - k), matrix)
        call factor_dense(matrix, good)
        if (good) exit
      end do
      if (.not. good) then
        call errors%add('N441', 'the matrix of the fit of the weights cannot be factored', &
                        'energy partition', 'contacts without stiffness, or elements turned over?')
        return
      end if
      dy = now%r
      call solve_dense(matrix, dy)
      before = maxval(abs(now%r))
      part = 1.0_wp
      do k = 1, most_halvings
        call weights_at(columns, x0, r0, y + part*dy, next)
        if (next%value >= now%value + 1.0e-4_wp*part*dot_product(now%r, dy) .or. &
            maxval(abs(next%r)) < 0.5_wp*before) exit
        part = 0.5_wp*part
      end do
      y = y + part*dy
      now = next
      if (before < closed .and. maxval(abs(now%r)) > 0.5_wp*before) exit
    end do
    x = now%x
  end subroutine least_change

  !> Weights x = clip(x0 - A' y), their rows, which are inside the bounds, and the dual function.
  pure subroutine weights_at(columns, x0, r0, y, trial)
    type(columns_type), intent(in) :: columns
    real(wp), intent(in) :: x0(:), r0(:), y(:)
    type(trial_type), intent(out) :: trial
    real(wp) :: wanted
    integer(i4) :: j
    allocate (trial%x(columns%n), trial%free(columns%n))
    allocate (trial%r, source=r0)
    associate (x => trial%x, r => trial%r)
      do j = 1, columns%n
        associate (from => columns%start(j), to => columns%start(j + 1) - 1)
          wanted = x0(j) - dot_product(columns%value(from:to), y(columns%row(from:to)))
          x(j) = min(1.0_wp, max(0.0_wp, wanted))
          trial%free(j) = wanted >= 0.0_wp .and. wanted <= 1.0_wp
          r(columns%row(from:to)) = r(columns%row(from:to)) + (x(j) - x0(j))*columns%value(from:to)
        end associate
      end do
      trial%value = 0.5_wp*sum((x - x0)**2) + dot_product(y, r)
    end associate
  end subroutine weights_at

  !> A A' + raise, lower triangle, over the free columns.
  pure subroutine square(columns, free, raise, matrix)
    type(columns_type), intent(in) :: columns
    logical, intent(in) :: free(:)
    real(wp), intent(in) :: raise
    real(wp), intent(out) :: matrix(:, :)
    integer(i4) :: j, k, m
    matrix = 0.0_wp
    do j = 1, size(matrix, 1)
      matrix(j, j) = raise
    end do
    do j = 1, columns%n
      if (.not. free(j)) cycle
      do k = columns%start(j), columns%start(j + 1) - 1
        do m = columns%start(j), columns%start(j + 1) - 1
          if (columns%row(m) >= columns%row(k)) matrix(columns%row(m), columns%row(k)) = &
            matrix(columns%row(m), columns%row(k)) + columns%value(m)*columns%value(k)
        end do
      end do
    end do
  end subroutine square

  pure subroutine read_weights(columns, w, beta, x)
    type(columns_type), intent(in) :: columns
    real(wp), intent(in) :: w(:), beta(:)
    real(wp), intent(out) :: x(:)
    integer(i4) :: j
    do j = 1, columns%n
      if (columns%contact(j) > 0) then
        x(j) = w(columns%contact(j))
      else
        x(j) = beta(columns%point(j))
      end if
    end do
  end subroutine read_weights

  pure subroutine write_weights(columns, x, w, beta)
    type(columns_type), intent(in) :: columns
    real(wp), intent(in) :: x(:)
    real(wp), intent(inout) :: w(:), beta(:)
    integer(i4) :: j
    do j = 1, columns%n
      if (columns%contact(j) > 0) then
        w(columns%contact(j)) = x(j)
      else
        beta(columns%point(j)) = x(j)
      end if
    end do
  end subroutine write_weights

  !> One factor on the points' weights of each element of ghosts, by least squares over the rows of
  !! chosen blocks, for forces and stresses that are given: free grains at rest between nodes that
  !! move with the strain.
  subroutine fit_elements(self, force, stress, chosen, w, beta, fit)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: force(:, :, :)   !! (3, states, contacts) [N]
    real(wp), intent(in) :: stress(:, :, :)  !! (9, states, elements) [Pa]
    logical, intent(in) :: chosen(:)         !! (blocks)
    real(wp), intent(in) :: w(:)
    real(wp), intent(inout) :: beta(:)
    type(fit_type), intent(out) :: fit
    real(wp), allocatable :: scale(:), r(:), a(:, :), matrix(:, :), change(:), row(:, :, :)
    integer(i4), allocatable :: list(:)
    integer(i4) :: e, q, j
    logical :: good

    fit%rounds = 1
    call row_scales(self, force, scale)
    do j = 1, self%blocks()
      if (.not. chosen(j)) scale(a_block*(j - 1) + 1:a_block*j) = 0.0_wp
    end do
    call rows_now(self, w, beta, force, stress, scale, r)
    fit%rows = count(scale > 0.0_wp)
    allocate (list(size(self%region)), source=0_i4)
    do e = 1, size(self%region)
      if (self%region(e) /= region_ghost) cycle
      fit%unknowns = fit%unknowns + 1
      list(e) = fit%unknowns
    end do
    if (fit%unknowns == 0) return
    fit%before = maxval(abs(r))
    allocate (a(size(scale), fit%unknowns), source=0.0_wp)
    allocate (row(3, size(force, 2), self%blocks()))
    do e = 1, size(self%region)
      if (list(e) == 0) cycle
      row = 0.0_wp
      do q = 1, size(beta)
        if (self%element(q) == e) call add_point(self, q, beta(q)*self%volume(q), &
                                                 stress(:, :, e), row)
      end do
      a(:, list(e)) = reshape(row, [size(scale)])*scale
    end do
    matrix = matmul(transpose(a), a)
    do j = 1, fit%unknowns
      matrix(j, j) = matrix(j, j)*(1.0_wp + closed) + tiny(1.0_wp)
    end do
    change = -matmul(transpose(a), r)
    call factor_dense(matrix, good)
    if (good) call solve_dense(matrix, change)
    if (.not. good) change = 0.0_wp
    do q = 1, size(beta)
      j = list(self%element(q))
      if (j > 0) beta(q) = min(1.0_wp, max(0.0_wp, beta(q)*(1.0_wp + change(j))))
    end do
    fit%change = maxval(abs(change))
    call rows_now(self, w, beta, force, stress, scale, r)
    fit%after = maxval(abs(r))
  end subroutine fit_elements
end module cpl_weight_fit
