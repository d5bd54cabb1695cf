!> Grains near the seam of two packs grow from a smaller size to their own among the others, which
!! are held, in a system of their own, and a little farther until they bear the packs' pressure; no
!! time passes (theory-dem, Conversion). eq. D.99
!!
!! The friction is that of the packs' making: grains without friction carry nothing at the density
!! of a pack that has some.
module dem_seam_growth
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use dem_equilibrium, only: mean_unbalanced
  use dem_make, only: make_grains
  use dem_mosaic, only: lying_type
  use dem_shape_make, only: make_shapes
  use dem_state, only: kind_fixed, kind_free
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  private
  public :: growth_type

  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i4), parameter :: block = 20  !! steps between two checks of the damping
  integer(i4), parameter :: steps_of_stage = 200, steps_of_last = 1000  !! at most
  real(wp), parameter :: tolerance = 1.0e-3_wp  !! of what is left, see mean_unbalanced [-]
  !> Sizes of the grains on their way: at the first one none of a mosaic overlaps another.
  real(wp), parameter :: sizes(12) = [0.4_wp, 0.5_wp, 0.6_wp, 0.7_wp, 0.8_wp, 0.85_wp, 0.9_wp, &
                                      0.93_wp, 0.95_wp, 0.97_wp, 0.985_wp, 1.0_wp]
  real(wp), parameter :: farther = 5.0e-4_wp  !! of their size, a stage beyond it
  integer(i4), parameter :: most_farther = 8  !! stages

  type :: growth_type
    real(wp) :: friction = 0.0_wp    !! of making [-]
    real(wp) :: pressure = 0.0_wp    !! of the packs [Pa]
    real(wp) :: solid = 1.0_wp       !! fraction of them [-]
    integer(i4) :: material = 1      !! of all grains
    integer(i4) :: steps = 0         !! taken
    real(wp) :: unbalanced = 0.0_wp  !! at the end [-]
    real(wp) :: moved = 0.0_wp       !! farthest way of a grain [m]
  contains
    procedure :: grow
  end type growth_type

contains

  !> New places and orientations of those that move.
  subroutine grow(self, lying, moving, like, errors)
    class(growth_type), intent(inout) :: self
    type(lying_type), intent(inout) :: lying
    logical, intent(in) :: moving(:)            !! (grains)
    type(dem_system_type), intent(in) :: like   !! its materials, laws and step
    type(error_list_type), intent(inout) :: errors
    class(dem_system_type), allocatable :: system
    real(wp) :: start(3, lying%n), part
    integer(i4) :: k, i, most

    start = lying%x
    do k = 1, size(sizes) + most_farther
      part = sizes(min(k, size(sizes))) + farther*max(0, k - size(sizes))
      if (allocated(system)) deallocate (system)
      allocate (system)
      call fill(self, system, lying, moving, like, part, errors)
      if (errors%any()) return
      most = merge(steps_of_last, steps_of_stage, k >= size(sizes))
      call come_to_rest(self, system, most, errors)
      if (errors%any()) return
      do i = 1, system%grains%n
        associate (own => int(system%grains%id(i), i4))
          if (.not. moving(own)) cycle
          lying%x(:, own) = system%grains%x(:, i)
          lying%quat(:, own) = system%grains%quat(:, i)
        end associate
      end do
      if (k < size(sizes)) cycle
      if (pressure_of(self, system, lying, moving) > self%pressure) exit
    end do
    lying%axes = lying%axes*spread(merge(part, 1.0_wp, moving), 1, 3)
    self%moved = sqrt(maxval(sum((lying%x - start)**2, 1)))
  end subroutine grow

  !> All grains by their rows, those that move with a part of their size.
  subroutine fill(self, system, lying, moving, like, part, errors)
    class(growth_type), intent(in) :: self
    type(dem_system_type), intent(inout) :: system
    type(lying_type), intent(in) :: lying
    logical, intent(in) :: moving(:)
    type(dem_system_type), intent(in) :: like
    real(wp), intent(in) :: part
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: row(lying%n)
    integer(i4) :: k
    real(wp) :: none(3, lying%n), axes(3, lying%n)

    system%materials = like%materials
    system%laws = like%laws
    system%laws%friction = self%friction
    system%par = like%par
    system%par%gravity = 0.0_wp
    system%par%damping = 0.0_wp
    system%par%full_damping = .false.
    system%par%ghost_pairs = .false.
    system%par%overlapped = .false.
    system%par%overlap_limit = 1.0_wp
    system%par%energy_limit = huge(1.0_wp)
    row = [(int(k, i8), k=1, lying%n)]
    none = 0.0_wp
    axes = lying%axes*spread(merge(part, 1.0_wp, moving), 1, 3)
    call make_grains(system%grains, system%materials, row, merge(kind_free, kind_fixed, moving), &
                     spread(self%material, 1, lying%n), lying%x, lying%quat, axes, none, none, &
                     errors)
    if (errors%any()) return
    call make_shapes(system%grains, system%materials, row, none, spread(2.0_wp, 1, lying%n), errors)
    if (errors%any()) return
    call system%init(errors)
    if (errors%any()) return
    system%par%dt = min(like%par%dt, 0.5_wp*system%step_limit())
  end subroutine fill

  !> Pressure of the contacts of the grains that move, over the volume that is theirs [Pa].
  real(wp) function pressure_of(self, system, lying, moving) result(p)
    class(growth_type), intent(in) :: self
    type(dem_system_type), intent(in) :: system
    type(lying_type), intent(in) :: lying
    logical, intent(in) :: moving(:)
    type(dem_contacts_type) :: list
    real(wp) :: volume
    integer(i4) :: c
    call system%contacts(list)
    p = 0.0_wp
    do c = 1, list%n
      p = p + dot_product(list%force(:, c), list%branch(:, c))/6.0_wp*count(moving(list%ids(:, c)))
    end do
    volume = 4.0_wp/3.0_wp*pi*sum(product(lying%axes, 1), moving)
    p = p*self%solid/volume
  end function pressure_of

  !> Adaptive damping, eq. D.4.
  subroutine come_to_rest(self, system, most, errors)
    class(growth_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i4), intent(in) :: most  !! steps
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: steps
    steps = 0
    do
      call system%step(block, errors)
      if (errors%any()) return
      steps = steps + block
      call system%slow_down()
      self%unbalanced = mean_unbalanced(system)
      if (self%unbalanced <= tolerance .or. steps >= most) exit
    end do
    self%steps = self%steps + steps
  end subroutine come_to_rest
end module dem_seam_growth
