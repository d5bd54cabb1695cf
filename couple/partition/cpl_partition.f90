!> Overlap of grains and elements as the energy partition sees it (theory: "Energy partition").
!!
!! U = sum over contacts of w psi + sum over quadrature points of beta V W. Ghost grains follow the
!! nodes of their element; this module has what ghosts and elements put on the nodes. It is
!! independent of ports and decks.
!!
!! Blocks are the rows of three: displacements of the nodes, then (polar) their micro-rotations.
!! Loads are inner ones, dU/du and dU/dphi. Nine-vectors hold kl = 11 12 13 21 22 23 31 32 33 with
!! the normal of the area first. Nodes that are left out of an element's list are 0. Nodes on the
!! surface of the mesh are not at rest under uniform strain: their rows do not count.
module cpl_partition
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: cross
  implicit none
  private
  public :: partition_type, grain_free, grain_ghost, grain_other, region_free, region_ghost, &
    region_rest, turn_none, turn_curl, turn_micro, state_count, state_strain, uniform_states, &
    residual_rows, add_grain, add_point, ghost_ghost, mean_sizes, worst_rows

  integer(i4), parameter :: grain_free = 1, grain_ghost = 2, grain_other = 3
  integer(i4), parameter :: region_free = 1   !! free grains are in these elements
  integer(i4), parameter :: region_ghost = 2  !! ghosts are in these elements
  integer(i4), parameter :: region_rest = 3   !! elements without grains
  integer(i4), parameter :: turn_none = 0     !! ghosts do not turn, their moments are lost
  integer(i4), parameter :: turn_curl = 1     !! with half the curl of the displacement
  integer(i4), parameter :: turn_micro = 2    !! with the micro-rotation
  integer(i4), parameter :: state_count = 6   !! xx yy zz xy yz zx

  !> Grains, contacts, elements and quadrature points of an overlap.
  type :: partition_type
    integer(i4) :: nodes = 0                       !! of displacement
    logical :: polar = .false.                     !! elements have micro-rotations
    integer(i4) :: turning = turn_micro            !! how ghosts turn
    logical, allocatable :: outer(:)               !! (nodes) on the mesh's surface, if there is one
    integer(i4), allocatable :: kind(:)            !! (grains) grain_*
    integer(i4), allocatable :: cell(:)            !! (grains) element of a ghost, else 0
    real(wp), allocatable :: depth(:)              !! (grains) distance from the free region [m]
    real(wp), allocatable :: shape_u(:, :)         !! (nodes, grains) N_a at ghosts [-]
    real(wp), allocatable :: shape_phi(:, :)       !! (nodes of phi, grains) [-]
    real(wp), allocatable :: shape_slope(:, :, :)  !! (3, nodes, grains) dN_a/dx at ghosts [1/m]
    integer(i4), allocatable :: pair(:, :)         !! (2, contacts) rows of grains
    real(wp), allocatable :: arm(:, :, :)          !! (3, 2, contacts) centres to the point [m]
    real(wp), allocatable :: normal(:, :)          !! (3, contacts) from the first to the second
    real(wp), allocatable :: stiffness(:, :)       !! (2, contacts) normal, tangential [N/m]
    integer(i4), allocatable :: node_u(:, :)       !! (nodes, elements)
    integer(i4), allocatable :: node_phi(:, :)     !! (nodes of phi, elements)
    integer(i4), allocatable :: region(:)          !! (elements) region_*
    real(wp), allocatable :: moduli(:, :, :)       !! (9, 9, elements) of stress over strain [Pa]
    integer(i4), allocatable :: element(:)         !! (points)
    real(wp), allocatable :: volume(:)             !! (points) weight times Jacobian [m^3]
    real(wp), allocatable :: point_depth(:)        !! (points) distance from the free region [m]
    real(wp), allocatable :: slope_u(:, :, :)      !! (3, nodes, points) dN_a/dx [1/m]
    real(wp), allocatable :: slope_mean(:, :, :)   !! (3, nodes, points) that of the volume change
    real(wp), allocatable :: value_phi(:, :)       !! (nodes of phi, points) N_a [-]
    real(wp), allocatable :: slope_phi(:, :, :)    !! (3, nodes of phi, points) [1/m]
  contains
    procedure :: blocks
    procedure :: branch
  end type partition_type

contains

  !> Rows of three: nodes, twice as many in a polar body.
  pure integer(i4) function blocks(self)
    class(partition_type), intent(in) :: self
    blocks = merge(2, 1, self%polar)*self%nodes
  end function blocks

  !> l = x2 - x1 of contact c [m].
  pure function branch(self, c) result(l)
    class(partition_type), intent(in) :: self
    integer(i4), intent(in) :: c
    real(wp) :: l(3)
    l = self%arm(:, 1, c) - self%arm(:, 2, c)
  end function branch

  !> Do both ends of contact c follow nodes?
  pure logical function ghost_ghost(self, c)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: c
    ghost_ghost = all(self%kind(self%pair(:, c)) == grain_ghost)
  end function ghost_ghost

  !> Strain of uniform state s: 1 along an axis, or a shear of 1 that does not turn [-].
  pure function state_strain(s) result(strain)
    integer(i4), intent(in) :: s
    real(wp) :: strain(3, 3)
    integer(i4), parameter :: one(6) = [1, 2, 3, 1, 2, 3], two(6) = [1, 2, 3, 2, 3, 1]
    strain = 0.0_wp
    strain(one(s), two(s)) = strain(one(s), two(s)) + 0.5_wp
    strain(two(s), one(s)) = strain(two(s), one(s)) + 0.5_wp
  end function state_strain

  !> Forces of the contacts (on the first grain) and stress of the elements in the six uniform
  !! states, grains moving as the strain says and not turning.
  pure subroutine uniform_states(self, force, stress)
    type(partition_type), intent(in) :: self
    real(wp), allocatable, intent(out) :: force(:, :, :)   !! (3, 6, contacts) [N]
    real(wp), allocatable, intent(out) :: stress(:, :, :)  !! (9, 6, elements) [Pa]
    real(wp) :: strain(3, 3), jump(3), along
    integer(i4) :: s, c, e

    allocate (force(3, state_count, size(self%pair, 2)))
    allocate (stress(9, state_count, size(self%region)))
    do s = 1, state_count
      strain = state_strain(s)
      do c = 1, size(self%pair, 2)
        jump = matmul(strain, self%branch(c))
        along = dot_product(jump, self%normal(:, c))
        force(:, s, c) = self%stiffness(2, c)*jump &
                         + (self%stiffness(1, c) - self%stiffness(2, c))*along*self%normal(:, c)
      end do
      do e = 1, size(self%region)
        stress(:, s, e) = matmul(self%moduli(:, :, e), reshape(strain, [9]))
      end do
    end do
  end subroutine uniform_states

  !> Mean size of the contacts' forces in each state, and mean length of their arms.
  pure subroutine mean_sizes(self, force, mean_force, mean_arm)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: force(:, :, :)  !! (3, states, contacts) [N]
    real(wp), intent(out) :: mean_force(:)  !! (states) [N]
    real(wp), intent(out) :: mean_arm       !! [m]
    integer(i4) :: c, n
    n = size(force, 3)
    mean_force = 0.0_wp
    mean_arm = 0.0_wp
    do c = 1, n
      mean_force = mean_force + norm2(force(:, :, c), 1)
      mean_arm = mean_arm + 0.5_wp*(norm2(self%arm(:, 1, c)) + norm2(self%arm(:, 2, c)))
    end do
    mean_force = mean_force/max(1, n)
    mean_arm = mean_arm/max(1, n)
  end subroutine mean_sizes

  !> Inner loads of all blocks: ghosts' ends of the contacts times w, points times beta V.
  pure subroutine residual_rows(self, w, beta, force, stress, row)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: w(:)              !! (contacts) [-]
    real(wp), intent(in) :: beta(:)           !! (points) [-]
    real(wp), intent(in) :: force(:, :, :)    !! (3, states, contacts) on the first grain [N]
    real(wp), intent(in) :: stress(:, :, :)   !! (9, states, elements) [Pa]
    real(wp), allocatable, intent(out) :: row(:, :, :)  !! (3, states, blocks) [N], [N m]
    integer(i4) :: c, q

    allocate (row(3, size(force, 2), self%blocks()), source=0.0_wp)
    do c = 1, size(w)
      call add_contact(self, c, w(c), force(:, :, c), row)
    end do
    do q = 1, size(beta)
      call add_point(self, q, beta(q)*self%volume(q), stress(:, :, self%element(q)), row)
    end do
  end subroutine residual_rows

  !> What contact c puts on the blocks through its ends that are ghosts.
  pure subroutine add_contact(self, c, w, force, row)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: c
    real(wp), intent(in) :: w            !! [-]
    real(wp), intent(in) :: force(:, :)  !! (3, states) on the first [N]
    real(wp), intent(inout) :: row(:, :, :)
    integer(i4) :: end
    do end = 1, 2
      if (self%kind(self%pair(end, c)) == grain_ghost) &
        call add_grain(self, c, end, w, force, row)
    end do
  end subroutine add_contact

  !> What one end of contact c, a ghost, puts on the blocks.
  pure subroutine add_grain(self, c, end, w, force, row)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: c, end    !! 1 or 2
    real(wp), intent(in) :: w            !! [-]
    real(wp), intent(in) :: force(:, :)  !! (3, states) on the first [N]
    real(wp), intent(inout) :: row(:, :, :)
    real(wp) :: load(3), moment(3)
    integer(i4) :: s, a, g, e

    g = self%pair(end, c)
    e = self%cell(g)
    do s = 1, size(force, 2)
      load = merge(-w, w, end == 1)*force(:, s)
      moment = cross(self%arm(:, end, c), load)
      do a = 1, size(self%node_u, 1)
        associate (node => self%node_u(a, e))
          if (node == 0) cycle
          row(:, s, node) = row(:, s, node) + self%shape_u(a, g)*load
          if (self%turning == turn_curl) row(:, s, node) = row(:, s, node) &
            + 0.5_wp*cross(moment, self%shape_slope(:, a, g))
        end associate
      end do
      if (self%turning /= turn_micro) cycle
      do a = 1, size(self%node_phi, 1)
        associate (node => self%node_phi(a, e))
          if (node > 0) row(:, s, self%nodes + node) = row(:, s, self%nodes + node) &
            + self%shape_phi(a, g)*moment
        end associate
      end do
    end do
  end subroutine add_grain

  !> What the stresses (and couple stresses) of point q put on the blocks, times a factor [m^3].
  pure subroutine add_point(self, q, factor, stress, row, couple)
    type(partition_type), intent(in) :: self
    integer(i4), intent(in) :: q
    real(wp), intent(in) :: factor
    real(wp), intent(in) :: stress(:, :)  !! (9, states) [Pa]
    real(wp), intent(inout) :: row(:, :, :)
    real(wp), intent(in), optional :: couple(:, :)  !! (9, states) [N/m]
    real(wp) :: t(3, 3), axial(3), p
    integer(i4) :: s, a, e

    e = self%element(q)
    do s = 1, size(stress, 2)
      t = factor*reshape(stress(:, s), [3, 3])  ! t(l, k) = sigma_kl
      p = (t(1, 1) + t(2, 2) + t(3, 3))/3.0_wp
      do a = 1, size(self%node_u, 1)
        associate (node => self%node_u(a, e), g => self%slope_u(:, a, q))
          if (node > 0) row(:, s, node) = row(:, s, node) + matmul(t, g) &
            + p*(self%slope_mean(:, a, q) - g)
        end associate
      end do
      if (.not. self%polar) cycle
      axial = [t(2, 3) - t(3, 2), t(3, 1) - t(1, 3), t(1, 2) - t(2, 1)]
      if (present(couple)) t = factor*reshape(couple(:, s), [3, 3])
      do a = 1, size(self%node_phi, 1)
        associate (node => self%node_phi(a, e))
          if (node == 0) cycle
          row(:, s, self%nodes + node) = row(:, s, self%nodes + node) + self%value_phi(a, q)*axial
          if (present(couple)) row(:, s, self%nodes + node) = row(:, s, self%nodes + node) &
            + matmul(t, self%slope_phi(:, a, q))
        end associate
      end do
    end do
  end subroutine add_point

  !> Largest row over the mean force of its state (times the mean arm): of displacements, of
  !! micro-rotations [-].
  pure function worst_rows(self, row, mean_force, mean_arm) result(worst)
    type(partition_type), intent(in) :: self
    real(wp), intent(in) :: row(:, :, :)   !! (3, states, blocks)
    real(wp), intent(in) :: mean_force(:)  !! (states) [N]
    real(wp), intent(in) :: mean_arm       !! [m]
    real(wp) :: worst(2)
    integer(i4) :: s
    worst = 0.0_wp
    do s = 1, size(row, 2)
      if (.not. mean_force(s) > 0.0_wp) cycle
      worst(1) = max(worst(1), maxval(norm2(row(:, s, :self%nodes), 1))/mean_force(s))
      if (self%polar) worst(2) = max(worst(2), maxval(norm2(row(:, s, self%nodes + 1:), 1)) &
                                     /(mean_force(s)*mean_arm))
    end do
  end function worst_rows
end module cpl_partition
