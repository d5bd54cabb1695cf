!> The set of nodes at which seepage faces and infiltration keep the pressure outside: at every node
!! p <= outside, inflow <= most that enters, and one of both is equal. Nodes change sides between
!! the corrections of a step. One that does so too often becomes a leak until the step ends.
!! eq. F.90
module fem_face_set
  use talus_kinds, only: wp, i4
  use fem_pore_faces, only: fem_leak_type, most_flips, most_in
  use fem_sparse, only: fem_pattern_type
  implicit none
  private
  public :: begin_sets, turn_nodes, mark_held, put_outside, reactions_of, leaking, cut_out

contains

  !> The sets at the start of a step: the pressures of held nodes are those outside, and those of
  !! others below. So the state alone has the set, and a restart begins with the same.
  pure subroutine begin_sets(leak, p)
    type(fem_leak_type), intent(inout) :: leak(:)
    real(wp), intent(in) :: p(:)  !! (blocks) [Pa]
    integer(i4) :: k
    do k = 1, size(leak)
      if (.not. allocated(leak(k)%held)) cycle
      leak(k)%flips = 0
      leak(k)%held = p(leak(k)%block) >= leak(k)%now
    end do
  end subroutine begin_sets

  !> Let nodes change sides: those that suck more than may enter let go, those with a pressure above
  !! the one outside are held. `turned` is how many did.
  pure subroutine turn_nodes(leak, p, entering, slack, turned)
    type(fem_leak_type), intent(inout) :: leak(:)
    real(wp), intent(in) :: p(:)         !! (blocks) [Pa]
    real(wp), intent(in) :: entering(:)  !! (blocks) by held nodes [m^3/s]
    real(wp), intent(in) :: slack(2)     !! of pressures [Pa] and rates [m^3/s], round-off
    integer(i4), intent(out) :: turned
    logical :: turn
    integer(i4) :: k, a, b
    turned = 0
    do k = 1, size(leak)
      if (.not. allocated(leak(k)%held)) cycle
      associate (l => leak(k))
        do a = 1, size(l%block)
          if (l%flips(a) >= most_flips) cycle
          b = l%block(a)
          turn = p(b) > l%now + slack(1)
          if (l%held(a)) turn = entering(b) > most_in(l, a) + slack(2)
          if (.not. turn) cycle
          turned = turned + 1
          l%flips(a) = l%flips(a) + 1
          l%held(a) = .not. l%held(a) .and. l%flips(a) < most_flips
        end do
      end associate
    end do
  end subroutine turn_nodes

  !> Mark the held pressures.
  pure subroutine mark_held(leak, fixed)
    type(fem_leak_type), intent(in) :: leak(:)
    logical, intent(inout) :: fixed(:, :)  !! (3, blocks)
    integer(i4) :: k
    do k = 1, size(leak)
      if (.not. allocated(leak(k)%held)) cycle
      fixed(1, pack(leak(k)%block, leak(k)%held)) = .true.
    end do
  end subroutine mark_held

  !> Put the pressures outside into held nodes; of two faces at a node the first one's.
  pure subroutine put_outside(leak, u)
    type(fem_leak_type), intent(in) :: leak(:)
    real(wp), intent(inout) :: u(:, :)  !! (3, blocks)
    integer(i4) :: k
    do k = size(leak, kind=i4), 1, -1
      if (.not. allocated(leak(k)%held)) cycle
      u(1, pack(leak(k)%block, leak(k)%held)) = leak(k)%now
    end do
  end subroutine put_outside

  !> What held nodes of a face let in [m^3]; a node of two faces counts in the first.
  pure subroutine reactions_of(leak, left, volume)
    type(fem_leak_type), intent(in) :: leak
    real(wp), intent(inout) :: left(:)  !! (blocks) not counted yet [m^3]
    real(wp), intent(out) :: volume
    volume = 0.0_wp
    if (.not. allocated(leak%held)) return
    volume = sum(left(pack(leak%block, leak%held)))
    left(pack(leak%block, leak%held)) = 0.0_wp
  end subroutine reactions_of

  !> How many nodes did not come to rest.
  pure integer(i4) function leaking(leak)
    type(fem_leak_type), intent(in) :: leak(:)
    integer(i4) :: k
    leaking = 0
    do k = 1, size(leak)
      if (allocated(leak(k)%held)) leaking = leaking &
        + count(leak(k)%flips >= most_flips, kind=i4)
    end do
  end function leaking

  !> Take marked pressures out of a matrix: rows and columns but for the diagonal. Their values are
  !! known, and the numbering of the equations stays.
  pure subroutine cut_out(pattern, fixed, k, lower)
    type(fem_pattern_type), intent(in) :: pattern
    logical, intent(in) :: fixed(:)  !! (blocks)
    real(wp), intent(inout) :: k(:, :, :), lower(:, :, :)
    integer(i4) :: i, j, p
    do i = 1, pattern%nodes
      do p = pattern%start(i), pattern%start(i + 1) - 1
        j = pattern%column(p)
        if (j == i) then
          if (fixed(i) .and. .not. abs(k(1, 1, p)) > 0.0_wp) k(1, 1, p) = -1.0_wp
          cycle
        end if
        if (fixed(i)) k(1, :, p) = 0.0_wp
        if (fixed(j)) k(:, 1, p) = 0.0_wp
        if (size(lower, 3) == 0) cycle
        if (fixed(i)) lower(:, 1, p) = 0.0_wp
        if (fixed(j)) lower(1, :, p) = 0.0_wp
      end do
    end do
  end subroutine cut_out
end module fem_face_set
