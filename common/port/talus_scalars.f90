!> Scalars that every step reply carries, in one fixed order: field 'scalars',
!! real(scalar_count). Work and spent energies in J count from the start of the run.
!!
!! made by tools/port.py from common/port/port.toml: change that file, then `make port`.
module talus_scalars
  use talus_kinds, only: i4
  implicit none
  private
  public :: scalar_kinetic, scalar_elastic, scalar_friction, scalar_contact_damping
  public :: scalar_background_damping, scalar_curvature, scalar_tangential_relaxation
  public :: scalar_plastic, scalar_boundary, scalar_gravity, scalar_momentum
  public :: scalar_angular_momentum, scalar_step_limit, scalar_max_overlap, scalar_flags
  public :: scalar_count, flag_late_rebuild, flag_large_overlap

  integer(i4), parameter :: scalar_kinetic = 1  !! kinetic energy, now [J]
  integer(i4), parameter :: scalar_elastic = 2  !! energy stored in contacts or elements, now [J]
  !> spent in sliding, rolling, breaking bonds and grains [J]
  integer(i4), parameter :: scalar_friction = 3
  integer(i4), parameter :: scalar_contact_damping = 4  !! spent in dashpots of contacts [J]
  !> spent in damping of the whole body, and numerically [J]
  integer(i4), parameter :: scalar_background_damping = 5
  integer(i4), parameter :: scalar_curvature = 6  !! work of the changing stiffness of contacts [J]
  !> spent where tangential springs are shortened [J]
  integer(i4), parameter :: scalar_tangential_relaxation = 7
  integer(i4), parameter :: scalar_plastic = 8  !! plastic work [J]
  integer(i4), parameter :: scalar_boundary = 9  !! work done by all prescriptions and loads [J]
  integer(i4), parameter :: scalar_gravity = 10  !! work done by gravity [J]
  integer(i4), parameter :: scalar_momentum = 11  !! first of 3: x, y, z, now [kg m/s]
  !> first of 3: x, y, z about the origin, now [N m s]
  integer(i4), parameter :: scalar_angular_momentum = 14
  integer(i4), parameter :: scalar_step_limit = 17  !! largest stable step, now; 0: none [s]
  !> largest overlap over the radius of its grain [1]
  integer(i4), parameter :: scalar_max_overlap = 18
  integer(i4), parameter :: scalar_flags = 19  !! sum of the health flags since the last reply [1]
  integer(i4), parameter :: scalar_count = 19

  integer(i4), parameter :: flag_late_rebuild = 1  !! a list was rebuilt later than its skin allows
  integer(i4), parameter :: flag_large_overlap = 2  !! an overlap is above the deck's limit
end module talus_scalars
