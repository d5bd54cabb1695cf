!> Number kinds of the whole suite: 64-bit reals, 32-bit indices, 64-bit counts.
module talus_kinds
  use, intrinsic :: iso_fortran_env, only: real64, int32, int64
  implicit none
  private
  public :: wp, i4, i8

  integer, parameter :: wp = real64  !! working precision of every real
  integer, parameter :: i4 = int32   !! indices inside a rank
  integer, parameter :: i8 = int64   !! global counts and file sizes
end module talus_kinds
