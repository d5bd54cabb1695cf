!> All of a system but some free grains is held, and let go again; no time passes.
!!
!! Held grains are ghosts for the time being: they are in the list with what they touch of the
!! grains that move. What their contacts with each other, with walls and surfaces remember is kept
!! aside and brought back, as are velocities, impulses and works. The ledger books the kinetic
!! energy that is taken away as taken along, and what comes back as brought along (eq. D.23).
module dem_hold
  use talus_kinds, only: wp, i4
  use dem_gather, only: pack_contacts
  use dem_ellipsoid, only: quaternion_from_rotation
  use dem_ledger, only: refresh_stored
  use dem_make, only: is_prescribed
  use dem_population, only: memory_type, change_kinds, change_memory, gain
  use dem_prescribed, only: put_body
  use dem_state, only: dem_data_type, dem_ledger_type, kind_free, kind_ghost
  use dem_surface_records, only: pack_touches
  use dem_surface_values, only: set_velocities
  implicit none
  private
  public :: held_type, hold_others, let_others_go

  !> What is brought back.
  type :: held_type
    logical, allocatable :: moving(:)               !! (grains) that are not held
    logical :: ghost_pairs = .false.
    integer(i4), allocatable :: kind(:)             !! (grains)
    real(wp), allocatable :: v(:, :), omega(:, :)   !! (3, grains) [m/s], [rad/s]
    real(wp), allocatable :: impulse(:, :), moment_impulse(:, :), work(:)
    real(wp), allocatable :: plane_v(:, :), plane_impulse(:, :), plane_work(:)
    real(wp), allocatable :: surface_v(:, :), surface_spin(:, :)
    type(memory_type) :: memory
  end type held_type

contains

  !> These free grains may move, nothing else; all are at rest.
  subroutine hold_others(d, moving, held)
    type(dem_data_type), intent(inout) :: d
    logical, intent(in) :: moving(:)  !! (grains)
    type(held_type), intent(out) :: held
    integer(i4) :: kind(d%grains%n), i
    type(dem_ledger_type) :: before

    call refresh_stored(d, d%ledger_dt, before)
    held%moving = moving .and. d%grains%kind == kind_free
    held%ghost_pairs = d%par%ghost_pairs
    held%kind = d%grains%kind
    held%v = d%grains%v
    held%omega = d%grains%omega
    call keep_sums(d, held)
    call pack_contacts(d, [-huge(1.0_wp), huge(1.0_wp)], held%memory%contacts)
    if (d%surfaces%n > 0) call pack_touches(d, held%memory%touches)
    d%par%ghost_pairs = .true.
    kind = merge(kind_ghost, d%grains%kind, d%grains%kind == kind_free .and. .not. held%moving)
    call change_kinds(d, kind)
    do i = 1, d%grains%n
      call set_motion(d, i, [0.0_wp, 0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp, 0.0_wp])
    end do
    d%planes%velocity = 0.0_wp
    if (d%surfaces%n > 0) call set_velocities(d%surfaces, 0.0_wp*held%surface_v, &
                                              0.0_wp*held%surface_spin)
    call change_memory(d)
    d%ledger%left = d%ledger%left - gain(d, before)
  end subroutine hold_others

  !> All is as it was, but for the places of the grains that have moved and their contacts.
  subroutine let_others_go(d, held)
    type(dem_data_type), intent(inout) :: d
    type(held_type), intent(inout) :: held
    type(dem_ledger_type) :: before
    integer(i4) :: i

    call refresh_stored(d, d%ledger_dt, before)
    d%par%ghost_pairs = held%ghost_pairs
    call change_kinds(d, held%kind)
    d%planes%velocity = held%plane_v
    if (d%surfaces%n > 0) call set_velocities(d%surfaces, held%surface_v, held%surface_spin)
    call change_memory(d, held%memory, held%moving)
    do i = 1, d%grains%n
      call set_motion(d, i, held%v(:, i), held%omega(:, i))
    end do
    call bring_back_sums(d, held)
    d%ledger%entered = d%ledger%entered + gain(d, before)
  end subroutine let_others_go

  !> Velocity and spin of a grain from now on.
  subroutine set_motion(d, i, v, omega)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: v(3), omega(3)  !! [m/s], [rad/s]
    d%grains%v(:, i) = v
    d%grains%omega(:, i) = omega
    if (is_prescribed(d%grains%kind(i))) then
      d%grains%turn(:, i) = quaternion_from_rotation(d%par%dt*omega)
      d%grains%has_target(i) = .false.
    end if
    call put_body(d%grains, i, d%pairs%body(:, i))
  end subroutine set_motion

  !> Impulses and works of what is prescribed.
  subroutine keep_sums(d, held)
    type(dem_data_type), intent(in) :: d
    type(held_type), intent(inout) :: held
    held%impulse = d%grains%impulse
    held%moment_impulse = d%grains%moment_impulse
    held%work = d%grains%work
    held%plane_v = d%planes%velocity
    held%plane_impulse = d%planes%impulse
    held%plane_work = d%planes%work
    if (d%surfaces%n == 0) return
    held%surface_v = d%surfaces%velocity
    held%surface_spin = d%surfaces%spin
  end subroutine keep_sums

  subroutine bring_back_sums(d, held)
    type(dem_data_type), intent(inout) :: d
    type(held_type), intent(in) :: held
    d%planes%impulse = held%plane_impulse
    d%planes%work = held%plane_work
    d%grains%impulse = 0.0_wp
    d%grains%moment_impulse = 0.0_wp
    d%grains%work = 0.0_wp
    if (size(held%work) /= size(d%grains%work)) return  ! nothing was prescribed before
    d%grains%impulse = held%impulse
    d%grains%moment_impulse = held%moment_impulse
    d%grains%work = held%work
  end subroutine bring_back_sums
end module dem_hold
