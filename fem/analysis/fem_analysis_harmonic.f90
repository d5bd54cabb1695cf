!> kind = 'harmonic': steady-state response u = Re(U exp(i w t)) of a linear body to loads and
!! motions that are all in phase. For each frequency
!!   (A + i B) U = F,  A = K - w^2 M,  B = eta K + w C,
!! with the loss factor eta of structural damping and the viscous C of fem_damping. U = R + i I is
!! found from the symmetric real system of twice the order
!!   | A  -B | | R |   |  Re F |
!!   | -B -A | | I | = | -Im F |
!! whose pivots are indefinite (theory: harmonic response). <deck>_harmonic.csv has a row a
!! frequency; two field steps each, real and imaginary part.
module fem_analysis_harmonic
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str, string_type, append_string
  use talus_deck, only: deck_type
  use talus_log, only: log_type, short_number
  use fem_analysis, only: fem_analysis_type
  use fem_body, only: fem_body_type
  use fem_mesh, only: find_group, group_hint
  use fem_parts, only: fem_scheme_type
  use fem_sparse, only: fem_pattern_type, multiply
  use fem_types, only: group_facet, group_node, group_volume
  implicit none
  private
  public :: fem_analysis_harmonic_type, double_entries, amplitude_phase

  integer(i4), parameter :: any_kind(3) = [group_facet, group_node, group_volume]
  real(wp), parameter :: pi = acos(-1.0_wp)

  type, extends(fem_analysis_type) :: fem_analysis_harmonic_type
    real(wp), allocatable :: frequency(:)      !! [Hz]
    real(wp) :: loss = 0.0_wp                  !! eta [-]
    integer(i4), allocatable :: watched(:)     !! groups whose mean motion is written
    integer(i4), allocatable :: reacting(:)    !! groups whose reactions are written
    integer(i4) :: parts = 0                   !! real and imaginary parts found so far
    integer(i4), allocatable :: equation(:, :) !! (3, blocks) pair of rows, 0 = held
    real(wp), allocatable :: u(:, :, :)        !! (3, blocks, 2) R and I [m], [rad]
    real(wp), allocatable :: reaction(:, :, :) !! (3, blocks, 2) [N], [N m]
    real(wp) :: residual = 0.0_wp              !! |F - (A + i B) U|/|F| of what is free [-]
  contains
    procedure :: read => read_harmonic
    procedure :: check
    procedure :: check_port
    procedure :: begin
    procedure :: complete
    procedure :: step
    procedure :: columns
    procedure :: row
    procedure :: report
  end type fem_analysis_harmonic_type

  !> Entries of a sparse matrix by row and column.
  type :: triplets_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: irn(:), jcn(:)
    real(wp), allocatable :: value(:)
  contains
    procedure :: put => put_triplet
  end type triplets_type

contains

  subroutine read_harmonic(self, deck, scheme, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_scheme_type), intent(inout) :: scheme
    type(error_list_type), intent(inout) :: errors
    self%table = 'harmonic'
    self%listed = .true.
    scheme%damped = .true.
    call scheme%keep_linear(massive=.true.)
    call deck%get('analysis', 1, 'loss_factor', self%loss)
    call read_frequencies(deck, self%frequency)
  end subroutine read_harmonic

  !> The list, or the range from first to last in equal parts.
  subroutine read_frequencies(deck, frequency)
    type(deck_type), intent(in) :: deck
    real(wp), allocatable, intent(out) :: frequency(:)  !! [Hz]
    real(wp), allocatable :: ends(:)
    integer(i4) :: n, k
    if (deck%given('analysis', 1, 'frequencies')) then
      call deck%get('analysis', 1, 'frequencies', frequency)
    else
      call deck%get('analysis', 1, 'frequency_range', ends)
      call deck%get('analysis', 1, 'frequency_count', n)
      frequency = [(ends(1) + (ends(2) - ends(1))*real(k, wp)/real(n - 1, wp), k=0, n - 1)]
    end if
  end subroutine read_frequencies

  !> Groups of the table, and faults D345 for what has no steady state.
  subroutine check(self, deck, body, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    character(len=*), parameter :: none(2) = [character(len=5) :: 'stage', 'rigid']
    integer(i4) :: k, g
    do k = 1, size(none)
      if (deck%count(trim(none(k))) > 0) call deck%fault(errors, 'D345', 'a harmonic response '// &
        'does not support &'//trim(none(k)), trim(none(k)), 1, '', &
        'it is linear, about one state: leave it out, or integrate in time with kind = ''newmark''')
    end do
    allocate (self%watched(0), self%reacting(0))
    if (deck%given('analysis', 1, 'response')) call deck%get('analysis', 1, 'response', names)
    if (.not. allocated(names)) allocate (names(0))
    do k = 1, size(names)
      g = find_group(body%mesh, names(k)%s, any_kind)
      if (g > 0) self%watched = [self%watched, g]
      if (g == 0) call deck%fault(errors, 'D301', "the mesh has no group '"//names(k)%s//"'", &
        'analysis', 1, 'response', group_hint(body%mesh, names(k)%s, any_kind))
    end do
    call find_reacting(deck, body, 'support', self%reacting)
    call find_reacting(deck, body, 'motion', self%reacting)
  end subroutine check

  !> The groups that are supported or moved, each once.
  subroutine find_reacting(deck, body, what, list)
    type(deck_type), intent(in) :: deck
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: what
    integer(i4), allocatable, intent(inout) :: list(:)
    character(len=:), allocatable :: name
    integer(i4) :: s, g
    do s = 1, deck%count(what)
      call deck%get(what, s, 'group', name)
      g = find_group(body%mesh, name, any_kind)
      if (g > 0 .and. .not. any(list == g)) list = [list, g]
    end do
  end subroutine find_reacting

  subroutine check_port(self, deck, errors)
    class(fem_analysis_harmonic_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D345', 'a coupled run integrates in time, a harmonic one does '// &
                    'not', 'analysis', 1, 'kind', 'run this deck alone')
  end subroutine check_port

  !> Two steps of one a frequency; factors are computed as needed.
  subroutine begin(self, body, dt, fresh, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: dt  !! [s]
    logical, intent(in) :: fresh
    type(error_list_type), intent(inout) :: errors
    self%dt = 1.0_wp
    self%t_end = real(2*size(self%frequency), wp)
  end subroutine begin

  logical function complete(self, body)
    class(fem_analysis_harmonic_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    complete = self%parts >= 2*size(self%frequency)
  end function complete

  !> The real part of the next frequency, which is solved then, or the imaginary part of this one.
  subroutine step(self, body, t1, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! number of the part
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: part
    if (.not. allocated(self%equation)) call number(self, body, errors)
    if (errors%any()) return
    part = 1 + modulo(self%parts, 2_i4)
    if (part == 1) call respond(self, body, 2.0_wp*pi*self%frequency(1 + self%parts/2), errors)
    if (errors%any()) return
    self%parts = self%parts + 1
    body%state%time = real(self%parts, wp)
    body%state%u = self%u(:, :, part)
    body%state%reaction = self%reaction(:, :, part)
    body%state%v = 0.0_wp
  end subroutine step

  !> Pairs of rows of what is free, and the analysis of the pattern.
  subroutine number(self, body, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: irn(:), jcn(:), order(:)
    real(wp), allocatable :: value(:)
    integer(i4) :: i, c, n
    associate (system => body%system, blocks => body%dofs%blocks)
      allocate (self%equation(3, blocks), source=0_i4)
      allocate (self%u(3, blocks, 2), self%reaction(3, blocks, 2), source=0.0_wp)
      n = 0
      do i = 1, blocks
        do c = 1, 3
          if (body%supports%held(c, i)) cycle
          n = n + 1
          self%equation(c, i) = n
        end do
      end do
      if (n == 0) then
        call errors%add('N305', 'the body has no free degree of freedom', '', &
                        'leave out some &support')
        return
      end if
      call eliminate(self%equation, body, n, order, errors)
      if (errors%any()) return
      call double_entries(self%equation, system%pattern, system%k, system%k, irn, jcn, value)
      system%solver%free = 2*n
      system%solver%mumps%indefinite = .true.
      system%solver%mumps%pivoting = .true.
      system%solver%mumps%ranks = system%pattern%halo%ranks_type
      call system%solver%mumps%analyse(2*n, irn, jcn, order, errors)
    end associate
  end subroutine number

  !> Elimination order of the 2 n rows: that of the nodes by METIS, both rows of a pair in turn;
  !! none on other ranks than the leader.
  subroutine eliminate(equation, body, n, order, errors)
    integer(i4), intent(in) :: equation(:, :), n
    type(fem_body_type), intent(inout) :: body
    integer(i4), allocatable, intent(out) :: order(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: first(:), blocks(:)
    integer(i4) :: i, c, k, place
    call body%system%solver%order_nodes(body%dofs, body%system%pattern, errors)
    if (errors%any()) return
    if (size(body%system%solver%position) < body%dofs%nodes) then
      allocate (order(0))
      return
    end if
    allocate (first(body%dofs%nodes + 1), source=0_i4)
    allocate (blocks(body%dofs%blocks), order(2*n))
    associate (place_of => body%system%solver%position(body%dofs%node))
      do i = 1, body%dofs%blocks  ! blocks of the nodes in their order
        first(place_of(i) + 1) = first(place_of(i) + 1) + 1
      end do
      do i = 2, body%dofs%nodes + 1
        first(i) = first(i) + first(i - 1)
      end do
      do i = 1, body%dofs%blocks
        k = place_of(i)
        first(k) = first(k) + 1
        blocks(first(k)) = i
      end do
    end associate
    place = 0
    do k = 1, body%dofs%blocks
      do c = 1, 3
        i = equation(c, blocks(k))
        if (i == 0) cycle
        order(2*i - 1:2*i) = place + [1, 2]
        place = place + 2
      end do
    end do
  end subroutine eliminate

  !> Entries of one triangle of | A -B; -B -A | from the blocks a and b of the pattern (3, 3,
  !! entries), where both rows are free.
  pure subroutine double_entries(equation, pattern, a, b, irn, jcn, value)
    integer(i4), intent(in) :: equation(:, :)  !! (3, blocks) pair of rows, 0 = held
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: a(:, :, :), b(:, :, :)
    integer(i4), allocatable, intent(out) :: irn(:), jcn(:)
    real(wp), allocatable, intent(out) :: value(:)
    type(triplets_type) :: list
    integer(i4) :: i, j, p, pass

    do pass = 1, 2
      list%n = 0
      do i = 1, pattern%nodes
        do p = pattern%start(i), pattern%start(i + 1) - 1
          j = pattern%column(p)
          call double_block(equation(:, i), equation(:, j), i == j, a(:, :, p), b(:, :, p), list)
        end do
      end do
      if (pass == 1) allocate (list%irn(list%n), list%jcn(list%n), list%value(list%n))
    end do
    call move_alloc(list%irn, irn)
    call move_alloc(list%jcn, jcn)
    call move_alloc(list%value, value)
  end subroutine double_entries

  !> The entries of one block of each of A and B; of diagonal blocks one triangle.
  pure subroutine double_block(rows, columns, diagonal, a, b, list)
    integer(i4), intent(in) :: rows(3), columns(3)  !! pairs, 0 = held
    logical, intent(in) :: diagonal
    real(wp), intent(in) :: a(3, 3), b(3, 3)
    type(triplets_type), intent(inout) :: list
    integer(i4) :: c, d
    do d = 1, 3
      do c = 1, merge(d, 3_i4, diagonal)
        if (rows(c) == 0 .or. columns(d) == 0) cycle
        call list%put(2*rows(c) - 1, 2*columns(d) - 1, a(c, d))
        call list%put(2*rows(c), 2*columns(d), -a(c, d))
        call list%put(2*rows(c) - 1, 2*columns(d), -b(c, d))
        if (rows(c) /= columns(d)) call list%put(2*rows(c), 2*columns(d) - 1, -b(c, d))
      end do
    end do
  end subroutine double_block

  !> Append an entry; counts it alone as long as there are no arrays.
  pure subroutine put_triplet(self, row, column, value)
    class(triplets_type), intent(inout) :: self
    integer(i4), intent(in) :: row, column
    real(wp), intent(in) :: value
    self%n = self%n + 1
    if (.not. allocated(self%value)) return
    self%irn(self%n) = row
    self%jcn(self%n) = column
    self%value(self%n) = value
  end subroutine put_triplet

  !> U and reactions at the circular frequency w [rad/s].
  subroutine respond(self, body, w, errors)
    class(fem_analysis_harmonic_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: w
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: a(:, :, :), b(:, :, :), value(:), right(:)
    integer(i4), allocatable :: irn(:), jcn(:)
    real(wp) :: load(3, body%dofs%blocks), left(3, body%dofs%blocks, 2), scale

    call matrices(body, w, self%loss, a, b)
    call amplitudes(body, load)
    self%u = 0.0_wp
    call body%impose(0.0_wp, self%u(:, :, 1))
    call missing(body%system%pattern, a, b, load, self%u, left)
    call double_entries(self%equation, body%system%pattern, a, b, irn, jcn, value)
    call gather(self%equation, left, right)
    call body%system%solver%mumps%factor(value, errors)
    body%system%solver%factorisations = body%system%solver%factorisations + 1
    if (.not. errors%any()) call body%system%solver%mumps%solve(right, errors)
    if (errors%any()) return
    call scatter(self%equation, right, self%u)
    call missing(body%system%pattern, a, b, load, self%u, left)
    self%reaction = -merge(left, 0.0_wp, spread(self%equation == 0, 3, 2))
    scale = norm2(load) + norm2(self%reaction)
    self%residual = 0.0_wp
    if (scale > 0.0_wp) self%residual = norm2(merge(left, 0.0_wp, &
                                                    spread(self%equation > 0, 3, 2)))/scale
  end subroutine respond

  !> A = K - w^2 M and B = (eta + w b) K + w a M + w dashpots, blocks of the pattern.
  subroutine matrices(body, w, loss, a, b)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: w, loss
    real(wp), allocatable, intent(out) :: a(:, :, :), b(:, :, :)
    integer(i4) :: c
    a = body%system%k
    b = (loss + w*body%damping%stiffness)*body%system%k
    do c = 1, 3
      a(c, c, :) = a(c, c, :) - w*w*body%system%mass
      b(c, c, :) = b(c, c, :) + w*body%damping%mass*body%system%mass
    end do
    call body%damping%add_dashpots(body%system%pattern, w, b)
  end subroutine matrices

  !> Amplitudes of the loads: their values at time 0; weight does not vibrate.
  subroutine amplitudes(body, load)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(out) :: load(:, :)  !! (3, blocks) [N], [N m]
    real(wp) :: value
    integer(i4) :: k
    load = 0.0_wp
    do k = 1, size(body%loads%load)
      value = 1.0_wp
      associate (l => body%loads%load(k))
        if (l%curve > 0) value = body%loads%curve(l%curve)%at(0.0_wp)
        load = load + value*l%force
      end associate
    end do
  end subroutine amplitudes

  !> F - (A + i B) U, real and imaginary part.
  subroutine missing(pattern, a, b, load, u, left)
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: a(:, :, :), b(:, :, :), load(:, :), u(:, :, :)
    real(wp), intent(out) :: left(:, :, :)  !! (3, blocks, 2) [N], [N m]
    real(wp), dimension(3, size(u, 2)) :: au, bu
    call multiply(pattern, a, u(:, :, 1), au)
    call multiply(pattern, b, u(:, :, 2), bu)
    left(:, :, 1) = load - au + bu
    call multiply(pattern, b, u(:, :, 1), bu)
    call multiply(pattern, a, u(:, :, 2), au)
    left(:, :, 2) = -bu - au
  end subroutine missing

  !> The right-hand side of the doubled system.
  pure subroutine gather(equation, left, right)
    integer(i4), intent(in) :: equation(:, :)
    real(wp), intent(in) :: left(:, :, :)
    real(wp), allocatable, intent(out) :: right(:)
    integer(i4) :: i, c
    allocate (right(2*maxval(equation)))
    do i = 1, size(equation, 2)
      do c = 1, 3
        if (equation(c, i) == 0) cycle
        right(2*equation(c, i) - 1) = left(c, i, 1)
        right(2*equation(c, i)) = -left(c, i, 2)
      end do
    end do
  end subroutine gather

  !> Its solution, to what is free.
  pure subroutine scatter(equation, x, u)
    integer(i4), intent(in) :: equation(:, :)
    real(wp), intent(in) :: x(:)
    real(wp), intent(inout) :: u(:, :, :)
    integer(i4) :: i, c
    do i = 1, size(equation, 2)
      do c = 1, 3
        if (equation(c, i) > 0) u(c, i, :) = x(2*equation(c, i) - 1:2*equation(c, i))
      end do
    end do
  end subroutine scatter

  subroutine columns(self, body, names)
    class(fem_analysis_harmonic_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: k
    call append_string(names, 'frequency [Hz]')
    call append_string(names, 'residual [-]')
    do k = 1, size(self%watched)
      call name_columns(body, self%watched(k), '', ' [m]', ' [rad]', names)
    end do
    do k = 1, size(self%reacting)
      call name_columns(body, self%reacting(k), 'force ', ' [N]', ' [N m]', names)
    end do
  end subroutine columns

  !> Amplitude and phase of three components of a group, and of micro-rotations where it has some.
  subroutine name_columns(body, g, what, unit, turn, names)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: g
    character(len=*), intent(in) :: what, unit, turn
    type(string_type), allocatable, intent(inout) :: names(:)
    character(len=1), parameter :: letter(3) = ['x', 'y', 'z']
    character(len=:), allocatable :: name
    integer(i4) :: c
    associate (group => body%mesh%group(g))
      name = trim(group%name)//' '//what
      do c = 1, 3
        call append_string(names, name//letter(c)//unit)
        call append_string(names, name//letter(c)//' phase [rad]')
      end do
      if (.not. any(body%dofs%phi(group%node) > 0)) return
      do c = 1, 3
        call append_string(names, name//'r'//letter(c)//turn)
        call append_string(names, name//'r'//letter(c)//' phase [rad]')
      end do
    end associate
  end subroutine name_columns

  !> A row a frequency, once both parts are written: means of motions, sums of reactions.
  subroutine row(self, body, values)
    class(fem_analysis_harmonic_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    real(wp), allocatable, intent(out) :: values(:)
    integer(i4), allocatable :: phi(:)
    integer(i4) :: k
    allocate (values(0))
    if (modulo(self%parts, 2_i4) == 1) return
    values = [self%frequency(self%parts/2), self%residual]
    do k = 1, size(self%watched)
      associate (node => body%mesh%group(self%watched(k))%node)
        phi = pack(body%dofs%phi(node), body%dofs%phi(node) > 0)
        values = [values, amplitude_phase(self%u(:, node, :)/size(node))]
        if (size(phi) > 0) values = [values, amplitude_phase(self%u(:, phi, :)/size(phi))]
      end associate
    end do
    do k = 1, size(self%reacting)
      associate (node => body%mesh%group(self%reacting(k))%node)
        phi = pack(body%dofs%phi(node), body%dofs%phi(node) > 0)
        values = [values, amplitude_phase(self%reaction(:, node, :))]
        if (size(phi) > 0) values = [values, amplitude_phase(self%reaction(:, phi, :))]
      end associate
    end do
  end subroutine row

  !> Amplitude and phase [rad] of the three components of a sum over blocks, by turns.
  pure function amplitude_phase(u) result(values)
    real(wp), intent(in) :: u(:, :, :)  !! (3, n, 2) real and imaginary parts
    real(wp) :: values(6), mean(3, 2)
    mean = sum(u, 2)
    values(1::2) = hypot(mean(:, 1), mean(:, 2))
    values(2::2) = atan2(mean(:, 2), mean(:, 1))
  end function amplitude_phase

  subroutine report(self, body, log)
    class(fem_analysis_harmonic_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    if (modulo(self%parts, 2_i4) == 0) return
    call log%item('frequency '//str(1 + self%parts/2), &
                  short_number(self%frequency(1 + self%parts/2))//' Hz', &
                  'residual '//short_number(self%residual))
  end subroutine report
end module fem_analysis_harmonic
