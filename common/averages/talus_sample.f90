!> Grains and contacts at one instant, as the formulas of homogenisation need them.
!!
!! A contact joins grain `first` to grain `second`; first = 0 is a boundary (a plane), whose end of
!! the branch is the contact point. The force is that on the first from the second. In a periodic
!! cell the second end may be an image of its grain, `over` away from it.
module talus_sample
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: sample_type, rotation_matrix

  !> What is measured.
  type :: sample_type
    integer(i4) :: n = 0                        !! grains
    real(wp), allocatable :: x(:, :)            !! (3, n) centre [m]
    real(wp), allocatable :: turn(:, :, :)      !! (3, 3, n) rotation, body to space [-]
    real(wp), allocatable :: axes(:, :)         !! (3, n) semi-axes [m]
    real(wp), allocatable :: v(:, :)            !! (3, n) velocity [m/s]
    real(wp), allocatable :: omega(:, :)        !! (3, n) spin, in space [rad/s]
    real(wp), allocatable :: mass(:)            !! (n) [kg]
    real(wp), allocatable :: inertia(:)         !! (n) mean of the principal moments [kg m^2]
    real(wp), allocatable :: volume(:)          !! (n) [m^3]
    logical, allocatable :: free(:)             !! (n) moved by forces
    real(wp) :: cell_volume = 0.0_wp            !! of the cell that holds all, 0: none [m^3]
    integer(i4) :: contacts = 0
    integer(i4), allocatable :: first(:)        !! (contacts) grain, 0: a boundary
    integer(i4), allocatable :: second(:)       !! (contacts) grain
    real(wp), allocatable :: over(:, :)         !! (3, contacts) from the second to its image [m]
    real(wp), allocatable :: start(:, :)        !! (3, contacts) centre of the first, or point [m]
    real(wp), allocatable :: point(:, :)        !! (3, contacts) contact point [m]
    real(wp), allocatable :: normal(:, :)       !! (3, contacts) from first to second [-]
    real(wp), allocatable :: force(:, :)        !! (3, contacts) on the first [N]
    real(wp), allocatable :: stiffness(:, :)    !! (2, contacts) normal, tangential [N/m]
    logical, allocatable :: sliding(:)          !! (contacts) at the friction limit
    integer(i8), allocatable :: ids(:, :)       !! (2, contacts) of first and second; boundaries < 0
    real(wp), allocatable :: overlap(:)         !! (contacts) [m]
  contains
    procedure :: make
    procedure :: far_end
  end type sample_type

contains

  !> Room for n grains and m contacts.
  pure subroutine make(self, n, m)
    class(sample_type), intent(inout) :: self
    integer(i4), intent(in) :: n, m

    if (allocated(self%x)) deallocate (self%x, self%turn, self%axes, self%v, self%omega, &
                                       self%mass, self%inertia, self%volume, self%free)
    if (allocated(self%first)) deallocate (self%first, self%second, self%start, self%point, &
                                           self%normal, self%force, self%stiffness, self%sliding, &
                                           self%over, self%ids, self%overlap)
    self%cell_volume = 0.0_wp
    self%n = n
    self%contacts = m
    allocate (self%x(3, n), self%axes(3, n), self%v(3, n), self%omega(3, n), source=0.0_wp)
    allocate (self%turn(3, 3, n), source=0.0_wp)
    allocate (self%mass(n), self%inertia(n), self%volume(n), source=0.0_wp)
    allocate (self%free(n), source=.true.)
    allocate (self%first(m), self%second(m), source=0_i4)
    allocate (self%start(3, m), self%point(3, m), self%normal(3, m), self%force(3, m), &
              self%over(3, m), source=0.0_wp)
    allocate (self%stiffness(2, m), source=0.0_wp)
    allocate (self%sliding(m), source=.false.)
    allocate (self%ids(2, m), source=0_i8)
    allocate (self%overlap(m), source=0.0_wp)
  end subroutine make

  !> Centre at the second end of a contact [m].
  pure function far_end(self, c) result(x)
    class(sample_type), intent(in) :: self
    integer(i4), intent(in) :: c
    real(wp) :: x(3)
    x = self%x(:, self%second(c)) + self%over(:, c)
  end function far_end

  !> Rotation matrix, body to space, of a unit quaternion (w, x, y, z).
  pure function rotation_matrix(q) result(r)
    real(wp), intent(in) :: q(4)
    real(wp) :: r(3, 3), w, x, y, z
    w = q(1)
    x = q(2)
    y = q(3)
    z = q(4)
    r(:, 1) = [1.0_wp - 2.0_wp*(y*y + z*z), 2.0_wp*(x*y + w*z), 2.0_wp*(x*z - w*y)]
    r(:, 2) = [2.0_wp*(x*y - w*z), 1.0_wp - 2.0_wp*(x*x + z*z), 2.0_wp*(y*z + w*x)]
    r(:, 3) = [2.0_wp*(x*z + w*y), 2.0_wp*(y*z - w*x), 1.0_wp - 2.0_wp*(x*x + y*y)]
  end function rotation_matrix
end module talus_sample
