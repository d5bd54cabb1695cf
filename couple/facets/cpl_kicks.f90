!> Kicks of the interface nodes of an explicit solid (scheme = 'symmetric'): what they work, and how
!! long an exchange may be (theory: facet coupling, Explicit solids).
module cpl_kicks
  use talus_kinds, only: wp, i4
  use talus_log, only: short_number
  implicit none
  private
  public :: kicks_type, kicks_allowed

  real(wp), parameter :: pi = acos(-1.0_wp)

  !> Masses and supports of the interface nodes, works of the kicks of an exchange.
  type :: kicks_type
    logical :: active = .false.               !! the scheme is symmetric
    real(wp), allocatable :: mass(:)          !! of the nodes (m) [kg]
    logical, allocatable :: held(:, :)        !! the solid's deck supports them (3, m)
    real(wp) :: work = 0.0_wp                 !! of the exchange under way [J]
    real(wp) :: step_limit = 0.0_wp           !! of the solid alone [s]
    integer(i4) :: substeps = 0               !! of the solid in the last exchange, 0: none yet
    real(wp) :: rate = 0.0_wp                 !! contact stiffness over mass, largest [1/s2]
    real(wp) :: shortest = huge(1.0_wp)       !! stable exchange, at most that of the deck [s]
    logical :: warned = .false.               !! the exchange is too long, and that was told
  contains
    procedure :: add_work
    procedure :: note_rate
    procedure :: limit
    procedure :: warning
  end type kicks_type

contains

  !> Work of kicks (3, m) [N s] on nodes that have the velocities v before them [m/s].
  pure subroutine add_work(self, push, v)
    class(kicks_type), intent(inout) :: self
    real(wp), intent(in) :: push(:, :), v(:, :)
    integer(i4) :: k, c
    do k = 1, size(self%mass)
      do c = 1, 3
        if (self%held(c, k)) cycle
        self%work = self%work + push(c, k)*(v(c, k) + 0.5_wp*push(c, k)/self%mass(k))
      end do
    end do
  end subroutine add_work

  !> Largest stiffness over mass of a node that is not held, from the stiffness of the contacts
  !! shared out to the nodes as forces are: a bound of the square of a frequency.
  pure subroutine note_rate(self, stiffness)
    class(kicks_type), intent(inout) :: self
    real(wp), intent(in) :: stiffness(:)  !! (m) [N/m]
    integer(i4) :: k
    self%rate = 0.0_wp
    do k = 1, size(self%mass)
      if (all(self%held(:, k))) cycle
      self%rate = max(self%rate, abs(stiffness(k))/self%mass(k))
    end do
  end subroutine note_rate

  !> Longest exchange up to `exchange` that is stable whatever the solid's frequencies are [s]. In
  !! how many steps a shorter one is gone through is the solid's own matter: as few as may be.
  pure real(wp) function limit(self, exchange)
    class(kicks_type), intent(in) :: self
    real(wp), intent(in) :: exchange  !! [s]
    real(wp), parameter :: shorter = 0.98_wp
    integer(i4) :: n
    limit = exchange
    n = max(self%substeps, fewest_steps(limit, self%step_limit))
    do while (self%rate*limit**2 > kicks_allowed(limit, n, self%step_limit))
      limit = shorter*limit
      n = fewest_steps(limit, self%step_limit)
    end do
  end function limit

  !> Steps of a solid in an exchange, none above the largest stable one (0: none).
  pure integer(i4) function fewest_steps(exchange, step_limit)
    real(wp), intent(in) :: exchange, step_limit  !! [s]
    real(wp), parameter :: round_off = 1.0e-9_wp
    fewest_steps = 1
    if (step_limit > 0.0_wp) fewest_steps = max(1_i4, ceiling(exchange/step_limit - round_off))
  end function fewest_steps

  !> Largest stable square of (contact frequency x exchange): 4 of a node alone. Steps of an
  !! explicit solid turn its fastest mode by theta in an exchange; beyond a half turn kicks may meet
  !! it in time, and only weak ones do no harm.
  !! eq. C.57
  pure real(wp) function kicks_allowed(exchange, n, step_limit)
    real(wp), intent(in) :: exchange    !! [s]
    integer(i4), intent(in) :: n        !! steps of the solid in it
    real(wp), intent(in) :: step_limit  !! its largest stable one [s]; 0: none
    real(wp), parameter :: harmless = 0.02_wp
    real(wp) :: z, theta
    kicks_allowed = 4.0_wp
    if (.not. step_limit > 0.0_wp) return
    z = min(1.0_wp, exchange/(n*step_limit))
    theta = 2.0_wp*n*asin(z)
    kicks_allowed = harmless
    if (theta < pi) &
      kicks_allowed = max(harmless, 4.0_wp*n*z*sqrt(1.0_wp - z**2)/tan(0.5_wp*theta))
  end function kicks_allowed

  !> W438, once: contacts are too stiff for the exchange, or kicks may meet waves in time.
  function warning(self, exchange) result(text)
    class(kicks_type), intent(inout) :: self
    real(wp), intent(in) :: exchange  !! [s]
    character(len=:), allocatable :: text
    real(wp) :: stable
    text = ''
    if (.not. self%active) return
    stable = self%limit(exchange)
    self%shortest = min(self%shortest, stable)
    if (stable >= exchange .or. self%warned) return
    self%warned = .true.
    text = 'W438'//': an exchange of '//short_number(exchange)// &
      ' s is above the one that is stable for sure, '//short_number(stable)// &
      ' s: the energy may grow. Shorten &clock exchange, or write scheme = ''iterated'''
  end function warning
end module cpl_kicks
