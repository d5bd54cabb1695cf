!> Data prescribed by the deck or a partner: motion of grains, constant forces on them, weights of
!! contacts. Prescribed grains are named by index (find gives it).
module dem_driven_system
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_repeated_errors, only: repeated_errors_type
  use talus_text, only: str
  use dem_state, only: dem_data_type
  use dem_make, only: sorted_order
  use dem_pairs, only: build_pairs
  use dem_ellipsoid, only: quaternion_from_rotation, rotation_between
  use dem_records, only: index_of
  use dem_adaptive_damping, only: reset_sums
  use dem_surface_search, only: list_near
  use dem_ranked_system, only: dem_ranked_system_type
  implicit none
  private
  public :: dem_driven_system_type

  !> A system with grains whose motion is prescribed, held forces and contact weights.
  type, extends(dem_ranked_system_type) :: dem_driven_system_type
  contains
    procedure :: set_motion       !! (index, x1, quat1, steps): linear/slerp to the target
    procedure :: set_velocity     !! (index, v, omega): constant from now on
    procedure :: set_state        !! (index, x, quat, v, omega): placed at once
    procedure :: set_extra        !! (index, force, moment): held on free grains
    procedure :: clear_extra      !! ()
    procedure :: set_weights      !! (ids(2,:), value(:)): contact weights by pair id
    procedure :: forget_weights   !! (grains): their contacts count fully from the next list on
    procedure :: reset_impulses   !! (): impulses and work of grains and planes to zero
    procedure :: find             !! (ids, index, errors): grain indices of ids
  end type dem_driven_system_type

contains

  !> Prescribed grains go to x1, quat1 in `steps` steps of par%dt: constant velocity and spin.
  subroutine set_motion(self, index, x1, quat1, steps)
    class(dem_driven_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x1(:, :)     !! (3, :) [m]
    real(wp), intent(in) :: quat1(:, :)  !! (4, :) [-]
    integer(i4), intent(in) :: steps     !! sub-steps to get there
    real(wp) :: time, rotation(3)
    integer(i4) :: k, i

    time = steps*self%par%dt
    do k = 1, size(index)
      i = index(k)
      rotation = rotation_between(self%grains%quat(:, i), quat1(:, k))
      self%grains%v(:, i) = (x1(:, k) - self%grains%x(:, i))/time
      self%grains%omega(:, i) = rotation/time
      self%grains%turn(:, i) = quaternion_from_rotation(rotation/steps)
      self%grains%target_x(:, i) = x1(:, k)
      self%grains%target_quat(:, i) = quat1(:, k)
      self%grains%has_target(i) = .true.
    end do
    if (allocated(self%rank_team)) self%rank_team%redirected = .true.
  end subroutine set_motion

  !> Prescribed grains move with constant velocity and spin from now on.
  subroutine set_velocity(self, index, v, omega)
    class(dem_driven_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: v(:, :), omega(:, :)  !! (3, :) [m/s], [rad/s]
    integer(i4) :: k, i
    do k = 1, size(index)
      i = index(k)
      self%grains%v(:, i) = v(:, k)
      self%grains%omega(:, i) = omega(:, k)
      self%grains%turn(:, i) = quaternion_from_rotation(self%par%dt*omega(:, k))
      self%grains%has_target(i) = .false.
    end do
    if (allocated(self%rank_team)) self%rank_team%redirected = .true.
  end subroutine set_velocity

  !> Place prescribed grains at x, quat with velocity v and spin omega.
  subroutine set_state(self, index, x, quat, v, omega)
    class(dem_driven_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: x(:, :), quat(:, :), v(:, :), omega(:, :)
    integer(i4) :: k
    do k = 1, size(index)
      self%grains%x(:, index(k)) = x(:, k)
      self%grains%quat(:, index(k)) = quat(:, k)
    end do
    call self%set_velocity(index, v, omega)
  end subroutine set_state

  !> Forces and moments held on free grains until changed, besides the surcharge.
  subroutine set_extra(self, index, force, moment)
    class(dem_driven_system_type), intent(inout) :: self
    integer(i4), intent(in) :: index(:)
    real(wp), intent(in) :: force(:, :), moment(:, :)  !! (3, :) [N], [N m]
    logical, allocatable :: marked(:)
    integer(i4) :: k
    do k = 1, size(index)
      self%grains%extra_force(:, index(k)) = force(:, k)
      self%grains%extra_moment(:, index(k)) = moment(:, k)
      if (allocated(self%surcharge)) self%grains%extra_force(3, index(k)) = &
        force(3, k) - self%surcharge(index(k))
    end do
    if (.not. allocated(self%rank_team)) return
    allocate (marked(self%grains%n), source=.false.)
    marked(index) = .true.
    call self%rank_team%mark_loads(marked)
  end subroutine set_extra

  subroutine clear_extra(self)
    class(dem_driven_system_type), intent(inout) :: self
    self%grains%extra_force = 0.0_wp
    self%grains%extra_moment = 0.0_wp
    if (allocated(self%surcharge)) self%grains%extra_force(3, :) = -self%surcharge
    if (allocated(self%rank_team)) call self%rank_team%mark_loads(spread(.true., 1, self%grains%n))
  end subroutine clear_extra

  !> Contact weights by pair id, all others 1; takes effect at the next evaluation.
  subroutine set_weights(self, ids, value)
    class(dem_driven_system_type), intent(inout) :: self
    integer(i8), intent(in) :: ids(:, :)   !! (2, :) in any order
    real(wp), intent(in) :: value(:)       !! [-]
    integer(i8), allocatable :: low(:), high(:)
    integer(i4), allocatable :: order(:)
    logical :: same

    allocate (low(size(value)), high(size(value)))
    low = min(ids(1, :), ids(2, :))
    high = max(ids(1, :), ids(2, :))
    order = sorted_order(high)
    order = order(sorted_order(low(order)))
    same = self%ready .and. size(value) > 0 .and. self%weights%n == size(value)
    if (same) same = all(self%weights%id(1, :) == low(order)) .and. &
      all(self%weights%id(2, :) == high(order)) .and. &
      .not. any(abs(self%weights%value - value(order)) > 0.0_wp)
    if (same) return  ! after a restart: they came with the list, which stays as it is
    self%weights%n = size(value)
    self%weights%id = reshape([low(order), high(order)], [2, size(order)], order=[2, 1])
    self%weights%value = value(order)
    if (self%ready) then
      call build_pairs(self%pairs, self%grains, self%planes, self%weights, self%par%ghost_pairs, &
                       self%cell)
      if (self%surfaces%n > 0) call list_near(self%dem_data_type)
    end if
  end subroutine set_weights

  !> Contacts of these grains count fully from the next list on.
  subroutine forget_weights(self, grains)
    class(dem_driven_system_type), intent(inout) :: self
    logical, intent(in) :: grains(:)
    logical :: kept(self%weights%n)
    integer(i4) :: k, j, i
    if (self%weights%n == 0) return
    kept = .true.
    do k = 1, size(kept)
      do j = 1, 2
        i = index_of(self%dem_data_type, real(self%weights%id(j, k), wp))
        if (i > 0) kept(k) = kept(k) .and. .not. grains(i)
      end do
    end do
    self%weights%id = self%weights%id(:, pack([(k, k=1, size(kept))], kept))
    self%weights%value = pack(self%weights%value, kept)
    self%weights%n = count(kept)
  end subroutine forget_weights

  !> Impulses and works of grains and planes to zero (start of an exchange).
  subroutine reset_impulses(self)
    class(dem_driven_system_type), intent(inout) :: self
    call reset_sums(self%dem_data_type)
    if (allocated(self%rank_team)) self%rank_team%reset = .true.
  end subroutine reset_impulses

  !> Indices of ids; unknown ones are faults (I216) and give 0.
  subroutine find(self, ids, index, errors)
    class(dem_driven_system_type), intent(in) :: self
    integer(i8), intent(in) :: ids(:)
    integer(i4), allocatable, intent(out) :: index(:)
    type(error_list_type), intent(inout) :: errors
    type(repeated_errors_type) :: few
    integer(i4) :: k

    allocate (index(size(ids)))
    do k = 1, size(ids)
      index(k) = 0
      if (ids(k) > 0) index(k) = index_of(self%dem_data_type, real(ids(k), wp))
      if (index(k) == 0) call few%add('I216', 'there is no grain with id '//str(ids(k)), &
                                      'ids are those of the packing file', errors)
    end do
    call few%finish('ids', errors)
  end subroutine find
end module dem_driven_system
