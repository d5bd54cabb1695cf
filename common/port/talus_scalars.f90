!> Scalars that every step reply carries, in one fixed order: field 'scalars', real(scalar_count).
!!
!! Energies in J, accumulated from the start of the run (theory-dem, Energy);
!! momentum in kg m/s and N m s; step limit in s; the largest overlap is relative to the radius.
module talus_scalars
  use talus_kinds, only: i4
  implicit none
  private
  public :: scalar_kinetic, scalar_elastic, scalar_friction, scalar_contact_damping
  public :: scalar_background_damping, scalar_curvature, scalar_tangential_relaxation
  public :: scalar_plastic, scalar_boundary, scalar_gravity, scalar_momentum
  public :: scalar_angular_momentum, scalar_step_limit, scalar_max_overlap, scalar_flags
  public :: scalar_count, scalar_names, scalar_units
  public :: flag_late_rebuild, flag_large_overlap, flag_energy

  integer(i4), parameter :: scalar_kinetic = 1
  integer(i4), parameter :: scalar_elastic = 2
  integer(i4), parameter :: scalar_friction = 3
  integer(i4), parameter :: scalar_contact_damping = 4
  integer(i4), parameter :: scalar_background_damping = 5
  integer(i4), parameter :: scalar_curvature = 6              !! work of the changing stiffness
  integer(i4), parameter :: scalar_tangential_relaxation = 7
  integer(i4), parameter :: scalar_plastic = 8
  integer(i4), parameter :: scalar_boundary = 9               !! work done by all prescriptions
  integer(i4), parameter :: scalar_gravity = 10
  integer(i4), parameter :: scalar_momentum = 11              !! first of three: 11, 12, 13
  integer(i4), parameter :: scalar_angular_momentum = 14      !! first of three: 14, 15, 16
  integer(i4), parameter :: scalar_step_limit = 17
  integer(i4), parameter :: scalar_max_overlap = 18
  integer(i4), parameter :: scalar_flags = 19                 !! sum of flag_* since the last reply
  integer(i4), parameter :: scalar_count = 19

  integer(i4), parameter :: flag_late_rebuild = 1   !! a list was rebuilt later than its skin allows
  integer(i4), parameter :: flag_large_overlap = 2  !! an overlap is past the deck's limit
  integer(i4), parameter :: flag_energy = 4         !! the energy error is past the deck's limit

  character(len=22), parameter :: scalar_names(scalar_count) = [character(len=22) :: &
    'kinetic', 'elastic', 'friction', 'contact_damping', 'background_damping', 'curvature', &
    'tangential_relaxation', 'plastic', 'boundary', 'gravity', 'momentum_x', 'momentum_y', &
    'momentum_z', 'angular_momentum_x', 'angular_momentum_y', 'angular_momentum_z', &
    'step_limit', 'max_overlap', 'flags']

  character(len=6), parameter :: scalar_units(scalar_count) = [character(len=6) :: &
    'J', 'J', 'J', 'J', 'J', 'J', 'J', 'J', 'J', 'J', 'kg m/s', 'kg m/s', 'kg m/s', &
    'N m s', 'N m s', 'N m s', 's', '1', '1']
end module talus_scalars
