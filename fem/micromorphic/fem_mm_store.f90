!> State of a micromorphic point in a body, as plain numbers: a column of its states and one
!! of its stresses. The first places are those that all laws share (fem_law); plastic strains are
!! Green's, (Fp'Fp - 1)/2, with engineering shears.
module fem_mm_store
  use talus_kinds, only: wp, i4
  use fem_law, only: at_flag, at_iterations, at_stored, at_dissipated, at_numerical, at_plastic, &
    common_size
  use fem_mm_cones, only: surfaces
  use fem_mm_flow, only: mm_state_type
  use fem_mm_motion, only: mm_motion_type, mm_force_type, mm_spatial_type, packed_motion, &
    packed_force, pushed
  use fem_mm_plastic, only: mm_point_type
  use fem_mm_tensor, only: identity
  implicit none
  private
  public :: point_states, point_stresses, named_states, state_title, at_energy
  public :: state_of, store_point, stress_row

  integer(i4), parameter :: at_z = common_size + 1           !! hardening variables
  integer(i4), parameter :: at_yield = at_z + surfaces        !! yield functions [Pa], [N/m]
  integer(i4), parameter :: at_active = at_yield + surfaces   !! 1 for surfaces that yield
  integer(i4), parameter :: at_parts = at_active + surfaces   !! substeps
  integer(i4), parameter :: at_shifted = at_parts + 1         !! work of stored energy [J/m^3]
  integer(i4), parameter :: at_cap = at_shifted + 1           !! p_c of two ellipses [Pa]
  integer(i4), parameter :: at_breakage = at_cap + 2          !! B
  integer(i4), parameter :: at_energy = at_breakage + 1       !! stored, the start's too [J/m^3]
  integer(i4), parameter :: at_fp = at_energy + 1, at_xp = at_fp + 9, at_gp = at_xp + 9
  integer(i4), parameter :: at_force = at_gp + 27             !! P, Q, R as the element has them
  integer(i4), parameter :: point_states = at_force + 44
  integer(i4), parameter :: named_states = at_breakage        !! those of interest to a reader
  integer(i4), parameter :: point_stresses = 45               !! Cauchy, micro, couple stress

  character(len=18), parameter :: titles(common_size + 1:named_states) = [character(len=18) :: &
    'z_macro', 'z_micro', 'z_gradient_1', 'z_gradient_2', 'z_gradient_3', &
    'yield_macro', 'yield_micro', 'yield_gradient_1', 'yield_gradient_2', 'yield_gradient_3', &
    'macro_yields', 'micro_yields', 'gradient_1_yields', 'gradient_2_yields', &
    'gradient_3_yields', 'substeps', 'shifted', 'cap_macro', 'cap_micro', 'breakage']

contains

  !> Name of a state beyond the common ones.
  pure function state_title(k) result(name)
    integer(i4), intent(in) :: k
    character(len=:), allocatable :: name
    name = trim(titles(k))
  end function state_title

  !> What the law reads of the point.
  pure function state_of(column) result(state)
    real(wp), intent(in) :: column(:)
    type(mm_state_type) :: state
    state%fp = reshape(column(at_fp:at_fp + 8), [3, 3])
    state%xp = reshape(column(at_xp:at_xp + 8), [3, 3])
    state%gp = reshape(column(at_gp:at_gp + 26), [3, 3, 3])
    state%z = column(at_z:at_z + surfaces - 1)
    state%dissipated = column(at_dissipated)
    state%shifted = column(at_shifted)
    state%yielded = column(at_flag) > 0.0_wp
  end function state_of

  !> A point at the end of a step between two motions, `force` as the element has it. Trapezoidal
  !! work is stored, dissipated, or due to the integration and to the shift of stored energy.
  pure subroutine store_point(motion, point, force, before, column)
    type(mm_motion_type), intent(in) :: motion(2)
    type(mm_point_type), intent(in) :: point
    type(mm_force_type), intent(in) :: force
    real(wp), intent(in) :: before(:)
    real(wp), intent(out) :: column(:)
    real(wp) :: packed(45), e(3, 3), work
    packed = packed_force(force)
    work = 0.5_wp*sum((packed + before(at_force:at_force + 44)) &
                      *(packed_motion(motion(2)) - packed_motion(motion(1))))
    column(at_flag) = real(count(point%active), wp)
    column(at_iterations) = real(point%iterations, wp)
    column(at_energy) = point%stored
    column(at_stored) = before(at_stored) + point%stored - before(at_energy)
    column(at_dissipated) = point%state%dissipated
    column(at_numerical) = before(at_numerical) + work - (point%stored - before(at_energy)) &
      - (point%state%dissipated - before(at_dissipated))
    e = 0.5_wp*(matmul(transpose(point%state%fp), point%state%fp) - identity)
    column(at_plastic:at_plastic + 5) = [e(1, 1), e(2, 2), e(3, 3), 2.0_wp*e(1, 2), &
      2.0_wp*e(2, 3), 2.0_wp*e(3, 1)]
    column(at_z:at_z + surfaces - 1) = point%state%z
    column(at_yield:at_yield + surfaces - 1) = point%yield
    column(at_active:at_active + surfaces - 1) = merge(1.0_wp, 0.0_wp, point%active)
    column(at_parts) = real(point%substeps, wp)
    column(at_shifted) = point%state%shifted
    column(at_cap:at_cap + 1) = point%cap
    column(at_breakage) = point%breakage
    column(at_fp:at_fp + 8) = reshape(point%state%fp, [9])
    column(at_xp:at_xp + 8) = reshape(point%state%xp, [9])
    column(at_gp:at_gp + 26) = reshape(point%state%gp, [27])
    column(at_force:at_force + 44) = packed
  end subroutine store_point

  !> Cauchy and micro-stress [Pa], couple stress [N/m], the last index running fastest.
  pure function stress_row(motion, point) result(row)
    type(mm_motion_type), intent(in) :: motion
    type(mm_point_type), intent(in) :: point
    real(wp) :: row(point_stresses)
    type(mm_spatial_type) :: spatial
    spatial = pushed(motion, point%stress)
    row(:9) = reshape(transpose(spatial%sigma), [9])
    row(10:18) = reshape(transpose(spatial%s), [9])
    row(19:) = reshape(reshape(spatial%m, [3, 3, 3], order=[3, 2, 1]), [27])
  end function stress_row
end module fem_mm_store
