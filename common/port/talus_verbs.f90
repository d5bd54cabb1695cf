!> Verbs of the exchange port: one number each, the same on every side (manual/port.md).
!!
!! made by tools/port.py from common/port/port.toml: change that file, then `make port`.
module talus_verbs
  use talus_kinds, only: i4
  implicit none
  private
  public :: verb_hello, verb_describe, verb_select, verb_set, verb_ready, verb_advance
  public :: verb_solve, verb_force, verb_kick_drift, verb_accept, verb_reject, verb_checkpoint
  public :: verb_write, verb_stop, verb_abort, verb_wake, verb_sleep, verb_relax, verb_first
  public :: verb_last, verb_name

  integer(i4), parameter :: verb_hello = 1  !! who are you; must be the first
  integer(i4), parameter :: verb_describe = 2  !! grains, contacts, mesh, facets, groups
  integer(i4), parameter :: verb_select = 3  !! name a set of entities and its role
  integer(i4), parameter :: verb_set = 4  !! weights, springs, dead loads, moduli
  !> state and forces at t with everything set, like the reply of a step of no duration
  integer(i4), parameter :: verb_ready = 5
  !> own sub-steps to t₁; prescribed motion is linear from t₀ (rotations by slerp), loads are held
  integer(i4), parameter :: verb_advance = 6
  !> one static or implicit step from the accepted state to t₁
  integer(i4), parameter :: verb_solve = 7
  !> forces with prescribed entities where the request puts them; no time passes
  integer(i4), parameter :: verb_force = 8
  !> v += kick (F + X)/m of free entities, then x += drift v; rotations alike
  integer(i4), parameter :: verb_kick_drift = 9
  integer(i4), parameter :: verb_accept = 10  !! keep the step; due output is written
  integer(i4), parameter :: verb_reject = 11  !! back to the last accepted state
  integer(i4), parameter :: verb_checkpoint = 12  !! write a checkpoint of the accepted state
  integer(i4), parameter :: verb_write = 13  !! write fields now
  integer(i4), parameter :: verb_stop = 14  !! normal end
  integer(i4), parameter :: verb_abort = 15  !! leave at once
  !> grains enter; no time passes, all sets but surfaces are forgotten
  integer(i4), parameter :: verb_wake = 16
  !> grains leave; no time passes, all sets but surfaces are forgotten
  integer(i4), parameter :: verb_sleep = 17
  !> some free grains come to rest with adaptive damping under their contacts and weight, without
  !! forces of the partner, all else is held; no time passes, all sets but surfaces are forgotten
  integer(i4), parameter :: verb_relax = 18

  integer(i4), parameter :: verb_first = verb_hello, verb_last = verb_relax
  character(len=10), parameter :: names(verb_first:verb_last) = [character(len=10) :: &
    'HELLO', 'DESCRIBE', 'SELECT', 'SET', 'READY', 'ADVANCE', 'SOLVE', 'FORCE', 'KICK_DRIFT', &
    'ACCEPT', 'REJECT', 'CHECKPOINT', 'WRITE', 'STOP', 'ABORT', 'WAKE', 'SLEEP', 'RELAX']

contains

  !> Name of a verb as users read it; 'verb N' for a number that is none.
  pure function verb_name(verb) result(name)
    integer(i4), intent(in) :: verb
    character(len=:), allocatable :: name
    character(len=16) :: number

    if (verb >= verb_first .and. verb <= verb_last) then
      name = trim(names(verb))
    else
      write (number, '(i0)') verb
      name = 'verb '//trim(number)
    end if
  end function verb_name
end module talus_verbs
