!> Bonds at the start of a run: between all grains within reach, or the pairs that the deck names.
module dem_bonds_make
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_additional_registry, only: find_model
  use dem_bond, only: bond_type, bond_of, set_bond
  use dem_bond_counts, only: bond_at
  use dem_state, only: dem_data_type, lanes
  use dem_shape_gap, only: find_shape_gap
  use dem_gap, only: solve_gap
  use dem_candidates, only: slot_of
  implicit none
  private
  public :: make_bonds, check_bonds, check_bond_reach

contains

  !> Bonds are made among the pairs of the list: none may reach beyond its margin (I239).
  subroutine check_bond_reach(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: wider = 2.0_wp  !! a margin that leaves bonds room to stretch
    type(bond_type) :: bond
    if (.not. d%pairs%additional%bond%given) return
    bond = constants(d)
    if (bond%reach <= d%pairs%skin) return
    call errors%add('I239', '&bond reach = '//str(bond%reach)//' m is more than the margin of '// &
                    'the list of pairs, '//str(d%pairs%skin)//' m: pairs beyond it would get '// &
                    'no bond', hint='give &search skin = '//str(wider*bond%reach)// &
                    ', or a smaller reach')
  end subroutine check_bond_reach

  !> Glue the grains; a named pair across a gap is a fault (I236), and so are no bonds at all.
  subroutine make_bonds(d, errors)
    type(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    type(bond_type) :: bond
    integer(i4) :: k, lane, pair

    if (.not. d%pairs%additional%bond%given) return
    bond = constants(d)
    if (allocated(d%pairs%additional%bond%pairs)) then
      do pair = 1, size(d%pairs%additional%bond%pairs, 2)
        call glue_pair(d, d%pairs%additional%bond%pairs(:, pair), errors)
      end do
    else
      do k = 1, d%pairs%grain_blocks
        do lane = 1, lanes
          if (d%pairs%first(lane, k) > d%grains%n) cycle
          if (gap_of(d, lane, k) <= bond%reach) call glue(d, lane, k)
        end do
      end do
    end if
    if (d%pairs%additional%made > 0 .or. errors%any()) return
    call errors%add('I236', 'no two grains are within '//str(bond%reach)// &
                    ' m of each other: there is nothing to bond', &
                    hint='a larger &bond reach, or a packing whose grains touch')
  end subroutine make_bonds

  !> Constants of the bonds of the run.
  pure function constants(d)
    type(dem_data_type), intent(in) :: d
    type(bond_type) :: constants
    constants = bond_of(d%pairs%additional%own(:, find_model('bond')))
  end function constants

  !> One pair of the deck.
  subroutine glue_pair(d, ids, errors)
    type(dem_data_type), intent(inout) :: d
    integer(i8), intent(in) :: ids(2)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: first, second, slot, lane, k
    type(bond_type) :: bond
    real(wp) :: gap

    bond = constants(d)
    first = findloc(d%grains%id, minval(ids), 1)
    second = findloc(d%grains%id, maxval(ids), 1)
    if (first == 0 .or. second == 0 .or. first == second) then
      call errors%add('I236', 'a bond needs two grains of the packing, not '//str(ids(1))// &
                      ' and '//str(ids(2)), hint='correct &bond pairs')
      return
    end if
    gap = norm2(d%grains%x(:, second) - d%grains%x(:, first)) - d%grains%radius(first) &
          - d%grains%radius(second)
    slot = slot_of(d%pairs, first, second)
    if (slot > 0) then
      lane = 1 + mod(slot - 1, lanes)
      k = 1 + (slot - 1)/lanes
      gap = gap_of(d, lane, k)
    end if
    if (slot > 0 .and. gap <= bond%reach) then
      call glue(d, lane, k)
    else
      call errors%add('I236', 'grains '//str(minval(ids))//' and '//str(maxval(ids))//' are '// &
                      str(gap)//' m apart, a bond reaches '//str(bond%reach)// &
                      ' m', hint='bring them together, or give a larger &bond reach')
    end if
  end subroutine glue_pair

  !> Gap of a pair of grains [m].
  real(wp) function gap_of(d, lane, k) result(gap)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: lane, k
    real(wp) :: normal(3)
    normal = 0.0_wp
    if (d%grains%shapes%in_use) then
      associate (i => d%pairs%first(lane, k), j => d%pairs%second(lane, k))
        call find_shape_gap(d%pairs%body(1:3, j) - d%pairs%body(1:3, i), &
                           d%grains%shapes%record(:, i), &
                           d%grains%shapes%record(:, d%pairs%grain(j)), d%pairs%skin, normal, gap)
      end associate
      return
    end if
    associate (a => d%pairs%body(:, d%pairs%first(lane, k)), &
               b => d%pairs%body(:, d%pairs%second(lane, k)))
      call solve_gap(b(1:3) - a(1:3), a(10:15), b(10:15), normal, gap)
    end associate
  end function gap_of

  !> A bond in a lane, without load.
  subroutine glue(d, lane, k)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: lane, k
    type(bond_type) :: bond
    real(wp) :: radius
    integer(i4) :: a, b, at
    a = d%pairs%first(lane, k)
    b = d%pairs%second(lane, k)
    at = bond_at(d%pairs%additional)
    bond = constants(d)
    radius = bond%radius &
             *min(minval(d%grains%axes(:, a)), minval(d%grains%axes(:, d%pairs%grain(b))))
    call set_bond(d%pairs%additional%kept(lane, at:, k), radius, &
                  norm2(d%pairs%body(1:3, b) - d%pairs%body(1:3, a)))
    d%pairs%touched(k) = .true.
    d%pairs%additional%made = d%pairs%additional%made + 1
  end subroutine glue

  !> A bond that has stretched beyond the margin of the list can no longer be worked (N205).
  !! Collective over all ranks.
  subroutine check_bonds(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp) :: missing(1)
    if (bond_at(d%pairs%additional) == 0) return
    missing = real(d%pairs%additional%lost, wp)
    if (d%halo%team%several()) then
      missing = missing_bonds(d)
      call d%halo%team%add_up(missing)
    end if
    if (nint(missing(1)) == 0) return
    call errors%add('N205', str(nint(missing(1), i4))//' bonds have stretched beyond the '// &
                    'margin of the list, '//str(d%pairs%skin)//' m, without breaking', &
                    place='step '//str(d%health%steps), &
                    hint='a wider &search skin, stiffer bonds or a lower tensile_strength')
  end subroutine check_bonds

  !> This rank's part of the bonds that were made, have not broken and are in no list.
  pure real(wp) function missing_bonds(d) result(missing)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: k, held, at
    associate (additional => d%pairs%additional)
      at = bond_at(additional)
      missing = real(additional%made, wp) - sum(additional%broken)
      do k = 1, d%pairs%grain_blocks
        held = count(additional%kept(:, at, k) > 0.0_wp)
        if (allocated(d%pairs%share)) then
          missing = missing - d%pairs%share(k)*held
        else
          missing = missing - held
        end if
      end do
    end associate
  end function missing_bonds
end module dem_bonds_make
