!> Copies of a tile that are strained along histories of stretch, in a periodic cell of their own,
!! and come to rest there: states in which grains of the bed wake (theory-dem, Conversion).
!!
!! A history is a list of right stretch tensors U from 1; between them the cell goes straight, slow
!! enough for the inertial number of the deck. A history that begins like an earlier one goes on
!! from there, before its rest: the same bits as from the start. Where a row stands beside the
!! affine place of its tile is w, its mean over the tile none. Faults N241. eq. D.32
module dem_replay
  use talus_kinds, only: wp, i4, i8
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use talus_homogenise, only: inverse_of
  use talus_log, only: short_number
  use talus_text, only: str
  use dem_cell, only: set_cell, fractions, least_width
  use dem_cell_stress, only: cell_stress
  use dem_equilibrium, only: mean_unbalanced
  use dem_make, only: make_grains
  use dem_packed_contacts, only: row_of
  use dem_packing, only: dem_packing_type
  use dem_shape_make, only: make_shapes
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_data_type, copy_data, keep_data, kind_free
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_tile_contacts, only: tile_contacts_type, sort_contacts
  implicit none
  private
  public :: replay_type, replays_type

  integer(i4), parameter :: block = 20  !! steps between two checks
  !> Background damping times d sqrt(rho/p): it bears as much of a contact's force as the inertial
  !! number says, and loose grains stay put.
  real(wp), parameter :: calm = 2.0_wp
  real(wp), parameter :: unit(3, 3) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, &
                                               0.0_wp, 0.0_wp, 1.0_wp], [3, 3])

  !> The tile at the end of one history.
  type :: replay_type
    real(wp), allocatable :: knot(:, :, :)         !! (3, 3, knots) U [-]
    class(dem_data_type), allocatable :: strained  !! at the last of them, before its rest
    real(wp), allocatable :: offset(:, :)          !! (3, rows) w [m]
    real(wp), allocatable :: quat(:, :)            !! (4, rows)
    type(tile_contacts_type) :: contacts
    real(wp) :: stress(3, 3) = 0.0_wp              !! more than the tile's [Pa]
    integer(i4) :: steps = 0                       !! taken for it, with its rest
    real(wp) :: unbalanced = 0.0_wp                !! at the end [-]
  end type replay_type

  type :: replays_type
    real(wp) :: inertial = 0.0_wp      !! number at which the tile is strained [-]
    real(wp) :: tolerance = 0.0_wp     !! mean force left over mean contact force at rest [-]
    integer(i4) :: most_steps = 0      !! to rest
    real(wp) :: stress(3, 3) = 0.0_wp  !! of the tile [Pa]
    type(replay_type), allocatable :: kept(:)
  contains
    procedure :: read => read_replays
    procedure :: find
    procedure :: follow
    procedure, private :: longest_start
  end type replays_type

contains

  !> How histories are followed, from the group &tile.
  subroutine read_replays(self, deck)
    class(replays_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    call deck%get('tile', 1, 'replay_inertial', self%inertial)
    call deck%get('tile', 1, 'replay_unbalanced', self%tolerance)
    call deck%get('tile', 1, 'replay_steps', self%most_steps)
    allocate (self%kept(0))
  end subroutine read_replays

  !> Number of the state at the end of a history, 0 if it was not followed.
  pure integer(i4) function find(self, knot) result(k)
    class(replays_type), intent(in) :: self
    real(wp), intent(in) :: knot(:, :, :)
    do k = size(self%kept), 1, -1
      if (size(self%kept(k)%knot, 3) /= size(knot, 3)) cycle
      if (.not. any(abs(self%kept(k)%knot - knot) > 0.0_wp)) return
    end do
  end function find

  !> Follow one history more; its state is the last one.
  subroutine follow(self, tile, like, material, knot, errors)
    class(replays_type), intent(inout) :: self
    type(dem_packing_type), intent(in) :: tile   !! rows in the order of their ids
    type(dem_system_type), intent(in) :: like    !! its materials, laws and step
    integer(i4), intent(in) :: material          !! of the tile's grains
    real(wp), intent(in) :: knot(:, :, :)        !! (3, 3, knots)
    type(error_list_type), intent(inout) :: errors
    class(dem_system_type), allocatable :: system
    type(replay_type) :: replay
    real(wp) :: rate, fall
    integer(i4) :: k, from

    allocate (system)
    call fill_cell(system, tile, like, material, errors)
    if (errors%any()) return
    self%stress = stress_in(system)
    fall = time_of_fall(system)
    rate = self%inertial/fall
    system%par%damping = calm/fall
    from = 0
    k = self%longest_start(knot)
    if (k > 0) then
      from = size(self%kept(k)%knot, 3)
      call copy_data(self%kept(k)%strained, system%dem_data_type)
      call system%begin_anew()
    end if
    do k = from + 1, size(knot, 3)
      call strain_to(system, matmul(knot(:, :, k), tile%cell), rate, replay%steps, errors)
      if (errors%any()) exit
    end do
    replay%knot = knot
    if (.not. errors%any()) then
      call keep_data(system%dem_data_type, replay%strained)
      call come_to_rest(self, system, replay, errors)
    end if
    if (errors%any() .or. replay%unbalanced > self%tolerance) then
      call errors%add('N241', 'the tile does not come to rest at the end of a history of '// &
        str(size(knot, 3))//' knots, at strains of '//strain_text(knot)//': '// &
        short_number(replay%unbalanced)//' of the contact force is left after '// &
        str(replay%steps)//' steps', 'WAKE', 'a smaller replay_inertial, more '// &
        'replay_steps; a tile that is not periodic in all directions cannot follow, nor one '// &
        'that has yielded')
      return
    end if
    replay%stress = stress_in(system) - self%stress
    call read_state(system, tile, replay)
    self%kept = [self%kept, replay]
  end subroutine follow

  !> Normal strains at the end, for a message.
  pure function strain_text(knot) result(text)
    real(wp), intent(in) :: knot(:, :, :)
    character(len=:), allocatable :: text
    associate (u => knot(:, :, size(knot, 3)))
      text = short_number(u(1, 1) - 1.0_wp)//', '//short_number(u(2, 2) - 1.0_wp)//', '// &
        short_number(u(3, 3) - 1.0_wp)
    end associate
  end function strain_text

  !> Number of the kept history that is the longest start of another one, 0: none.
  pure integer(i4) function longest_start(self, knot) result(k)
    class(replays_type), intent(in) :: self
    real(wp), intent(in) :: knot(:, :, :)
    integer(i4) :: j, n, most
    most = 0
    k = 0
    do j = 1, size(self%kept)
      n = size(self%kept(j)%knot, 3)
      if (n > size(knot, 3) .or. n <= most) cycle
      if (any(abs(self%kept(j)%knot - knot(:, :, :n)) > 0.0_wp)) cycle
      most = n
      k = j
    end do
  end function longest_start

  !> The tile in its cell, with the laws of the run.
  subroutine fill_cell(system, tile, like, material, errors)
    type(dem_system_type), intent(inout) :: system
    type(dem_packing_type), intent(in) :: tile
    type(dem_system_type), intent(in) :: like
    integer(i4), intent(in) :: material
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: materials(tile%n)

    system%materials = like%materials
    system%laws = like%laws
    system%par = like%par
    system%par%gravity = 0.0_wp
    system%par%damping = 0.0_wp
    system%par%full_damping = .false.
    system%par%ghost_pairs = .false.
    system%par%overlapped = .false.
    materials = material
    call make_grains(system%grains, system%materials, tile%id, spread(kind_free, 1, tile%n), &
                     materials, tile%x, tile%quat, tile%axes, 0.0_wp*tile%v, 0.0_wp*tile%omega, &
                     errors)
    if (errors%any()) return
    call make_shapes(system%grains, system%materials, tile%id, tile%skew, tile%exponent, errors)
    if (errors%any()) return
    call set_cell(system%cell, tile%cell_origin, tile%cell, [.true., .true., .true.])
    if (least_width(system%cell) < 4.0_wp*maxval(system%grains%radius)) then
      call errors%add('N241', 'the tile is '//short_number(least_width(system%cell))// &
                      ' m wide, less than two ranges of its grains: it cannot be '// &
                      'strained alone', 'WAKE', 'a larger tile with more grains')
      return
    end if
    system%springs = tile%springs
    call system%init(errors)
    if (errors%any()) return
    system%par%dt = min(like%par%dt, 0.5_wp*system%step_limit())
  end subroutine fill_cell

  !> d sqrt(rho/p): the inertial number over the rate of strain [s].
  real(wp) function time_of_fall(system) result(time)
    type(dem_system_type), intent(in) :: system
    real(wp) :: sigma(3, 3), d, rho, p
    sigma = stress_in(system)
    p = -(sigma(1, 1) + sigma(2, 2) + sigma(3, 3))/3.0_wp
    associate (g => system%grains)
      d = 2.0_wp*sum(product(g%axes(:, :g%n), 1)**(1.0_wp/3.0_wp))/g%n
      rho = system%materials(g%material(1))%density
    end associate
    time = d*sqrt(rho/max(p, tiny(p)))
  end function time_of_fall

  !> Of the contacts in the cell [Pa].
  pure function stress_in(system) result(sigma)
    type(dem_system_type), intent(in) :: system
    real(wp) :: sigma(3, 3), stiffness(10)
    call cell_stress(system%dem_data_type, sigma, stiffness)
  end function stress_in

  !> Steps in which the edges go straight to others.
  subroutine strain_to(system, edges, rate, steps, errors)
    type(dem_system_type), intent(inout) :: system
    real(wp), intent(in) :: edges(3, 3)   !! columns [m]
    real(wp), intent(in) :: rate          !! [1/s]
    integer(i4), intent(inout) :: steps
    type(error_list_type), intent(inout) :: errors
    real(wp) :: from(3, 3), change(3, 3), inverse(3, 3), spell
    integer(i4) :: n, k

    from = system%cell%vectors
    spell = block*system%par%dt
    inverse = inverse_of(from)
    change = matmul(edges, inverse) - unit
    n = max(1, ceiling(norm2(change)/(rate*spell)))
    do k = 1, n
      inverse = inverse_of(system%cell%vectors)
      change = matmul(from + real(k, wp)/n*(edges - from), inverse) - unit
      system%cell%rate = (change - 0.5_wp*matmul(change, change))/spell
      call system%step(block, errors)
      if (errors%any()) return
    end do
    system%cell%rate = 0.0_wp
    steps = steps + n*block
  end subroutine strain_to

  !> Adaptive damping in the cell as it is.
  subroutine come_to_rest(self, system, replay, errors)
    class(replays_type), intent(in) :: self
    type(dem_system_type), intent(inout) :: system
    type(replay_type), intent(inout) :: replay
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: steps
    steps = 0
    if (allocated(system%seen_kinetic)) deallocate (system%seen_kinetic)
    do
      replay%unbalanced = mean_unbalanced(system)
      if (replay%unbalanced <= self%tolerance .or. steps >= self%most_steps) exit
      call system%step(block, errors)
      if (errors%any()) return
      steps = steps + block
      call system%slow_down()
    end do
    replay%steps = replay%steps + steps
  end subroutine come_to_rest

  !> Places beside the affine ones, orientations, contacts and stress.
  subroutine read_state(system, tile, replay)
    type(dem_system_type), intent(in) :: system
    type(dem_packing_type), intent(in) :: tile
    type(replay_type), intent(inout) :: replay
    type(dem_contacts_type) :: list
    type(start_springs_type) :: springs
    real(wp) :: back(3, 3), s(3)
    integer(i4) :: whole(3, tile%n), i, r

    allocate (replay%offset(3, tile%n), replay%quat(4, tile%n))
    back = inverse_of(tile%cell)
    do i = 1, tile%n
      r = row_of(tile%id, int(system%grains%id(i), i8))
      s = fractions(system%cell, system%grains%x(:, i)) &
          - matmul(back, tile%x(:, r) - tile%cell_origin)
      whole(:, r) = nint(s)
      replay%offset(:, r) = matmul(system%cell%vectors, s - nint(s))
      replay%quat(:, r) = system%grains%quat(:, i)
    end do
    replay%offset = replay%offset - spread(sum(replay%offset, 2)/tile%n, 2, tile%n)
    call system%contacts(list)
    call springs_of(list, system, tile, whole, springs)
    call sort_contacts(replay%contacts, tile%id, springs)
  end subroutine read_state

  !> Tangential forces with the shifts between rows that have not passed through a face.
  subroutine springs_of(list, system, tile, whole, springs)
    type(dem_contacts_type), intent(in) :: list
    type(dem_system_type), intent(in) :: system
    type(dem_packing_type), intent(in) :: tile
    integer(i4), intent(in) :: whole(:, :)  !! (3, rows) edges that each row has passed
    type(start_springs_type), intent(inout) :: springs
    real(wp) :: back(3, 3), apart(3)
    integer(i4) :: place(tile%n), k, a, b

    do k = 1, tile%n
      place(row_of(tile%id, int(system%grains%id(k), i8))) = k
    end do
    springs%given = list%n
    allocate (springs%ids(2, list%n), springs%force(3, list%n), springs%shift(3, list%n))
    back = inverse_of(system%cell%vectors)
    do k = 1, list%n
      a = row_of(tile%id, list%ids(1, k))
      b = row_of(tile%id, list%ids(2, k))
      apart = system%grains%x(:, place(b)) - system%grains%x(:, place(a))
      springs%ids(:, k) = list%ids(:, k)
      springs%shift(:, k) = nint(matmul(back, list%branch(:, k) - apart)) &
                            + whole(:, b) - whole(:, a)
      springs%force(:, k) = list%spring(:, k) &
                            - dot_product(list%spring(:, k), list%normal(:, k))*list%normal(:, k)
    end do
  end subroutine springs_of
end module dem_replay
