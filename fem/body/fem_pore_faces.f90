!> Faces that liquid passes: held pressures, inflow, and leaks, which depend on the pressure.
module fem_pore_faces
  use talus_kinds, only: wp, i4
  use fem_pore_element, only: fem_flow_step_type
  use fem_sparse, only: fem_pattern_type
  use fem_types, only: name_length
  implicit none
  private
  public :: fem_held_pressure_type, fem_inflow_type, fem_leak_type, add_leaks, let_in, most_in
  public :: most_flips

  integer(i4), parameter :: most_flips = 5  !! of a node in a step, then it is a leak

  !> Pressures that the deck prescribes at some nodes.
  type :: fem_held_pressure_type
    character(len=name_length) :: name = ''
    integer(i4) :: curve = 0                !! 0: constant
    integer(i4), allocatable :: block(:)
    real(wp), allocatable :: value(:)       !! [Pa]
  end type fem_held_pressure_type

  !> Liquid that enters through facets.
  type :: fem_inflow_type
    character(len=name_length) :: name = ''
    integer(i4) :: curve = 0
    real(wp) :: factor = 1.0_wp             !! of the curve in the step
    real(wp), allocatable :: rate(:)        !! (blocks) [m^3/s]
  end type fem_inflow_type

  !> Faces that let liquid out by c (p - outside), shared out to their nodes. Nodes of faces that
  !! switch keep the pressure outside or let in what may enter: seepage nothing, infiltration what
  !! rains (fem_face_set); c is that of nodes that do not come to rest.
  type :: fem_leak_type
    character(len=name_length) :: name = ''
    integer(i4) :: curve = 0                !! of the pressure outside
    logical :: one_way = .false.
    real(wp) :: outside = 0.0_wp            !! [Pa]
    real(wp) :: now = 0.0_wp                !! pressure outside in the step [Pa]
    real(wp) :: rate = 0.0_wp               !! inflow in the step [m^3/s]
    integer(i4), allocatable :: block(:)
    real(wp), allocatable :: conductance(:) !! c times the share of the area [m^3/(Pa s)]
    logical, allocatable :: open(:)         !! what passes in the trial depends on the pressure
    logical, allocatable :: held(:)         !! keep the pressure outside; given where faces switch
    integer(i4), allocatable :: flips(:)    !! of nodes that switch, in the step
    integer(i4) :: rain = 0                 !! curve of the most that enters, 0: constant
    real(wp) :: raining = 1.0_wp            !! factor of that in the step
    real(wp), allocatable :: most(:)        !! that enters of infiltration [m^3/s]
  end type fem_leak_type

contains

  !> Add the inflow of the leaks (eq. F.89) for pressures at the start and the end of a step, and
  !! the sizes of what a balance sums.
  pure subroutine let_in(leak, step, start, after, rate, gross)
    type(fem_leak_type), intent(inout) :: leak(:)
    type(fem_flow_step_type), intent(in) :: step
    real(wp), intent(in) :: start(:), after(:)           !! (blocks) [Pa]
    real(wp), intent(inout) :: rate(:), gross(:)  !! (blocks) [m^3/s], [m^3]
    real(wp) :: inward
    integer(i4) :: k, a
    do k = 1, size(leak)
      associate (l => leak(k), theta => step%theta)
        l%rate = 0.0_wp
        do a = 1, size(l%block)
          inward = l%conductance(a)*(l%now - theta*after(l%block(a)) &
                                     - (1.0_wp - theta)*start(l%block(a)))
          call restrain(l, a, inward)
          rate(l%block(a)) = rate(l%block(a)) + inward
          gross(l%block(a)) = gross(l%block(a)) + abs(step%dt*inward)
          l%rate = l%rate + inward
        end do
      end associate
    end do
  end subroutine let_in

  !> What enters by node a of a face that switches [m^3/s], and whether it depends on the pressure:
  !! what held nodes let pass is a reaction, and only those that do not come to rest are leaks.
  pure subroutine restrain(leak, a, inward)
    type(fem_leak_type), intent(inout) :: leak
    integer(i4), intent(in) :: a
    real(wp), intent(inout) :: inward
    if (.not. allocated(leak%held)) return
    leak%open(a) = leak%flips(a) >= most_flips .and. inward < most_in(leak, a)
    if (leak%open(a)) return
    inward = most_in(leak, a)
    if (leak%held(a)) inward = 0.0_wp
  end subroutine restrain

  !> The most that enters by node a of a face that switches [m^3/s].
  pure real(wp) function most_in(leak, a)
    type(fem_leak_type), intent(in) :: leak
    integer(i4), intent(in) :: a
    most_in = 0.0_wp
    if (allocated(leak%most)) most_in = leak%raining*leak%most(a)
  end function most_in

  !> Add the slopes of the leaks to a matrix.
  pure subroutine add_leaks(leak, step, pattern, k)
    type(fem_leak_type), intent(in) :: leak(:)
    type(fem_flow_step_type), intent(in) :: step
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(inout) :: k(:, :, :)
    integer(i4) :: i, a, p
    do i = 1, size(leak)
      associate (l => leak(i))
        do a = 1, size(l%block)
          p = pattern%start(l%block(a))  ! the diagonal is first in its row
          if (l%open(a)) k(1, 1, p) = k(1, 1, p) - step%dt*step%theta*l%conductance(a)
        end do
      end associate
    end do
  end subroutine add_leaks
end module fem_pore_faces
