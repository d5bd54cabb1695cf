!> Elements that lock: near incompressibility those whose volumetric strain is not fitted in the
!! element have too many constraints, and the stress at their points is off by tens of per cent long
!! before their displacements show it.
module fem_locking
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use fem_elastic, only: fem_elastic_type
  use fem_kinds, only: hex8
  implicit none
  private
  public :: locking_warning

  !> Poisson's ratio from which nodal stresses of elements without B-bar are worse than those at 0.3
  !! by several times (case thick_sphere: eight times at 0.49).
  real(wp), parameter :: least_ratio = 0.48_wp

contains

  !> The warning W301 that a body needs, '' if it needs none. Micropolar elements have no remedy and
  !! are not warned of.
  pure function locking_warning(elastic) result(text)
    type(fem_elastic_type), intent(in) :: elastic
    character(len=:), allocatable :: text
    real(wp) :: ratio, largest
    integer(i4) :: e, first, locking
    text = ''
    first = 0
    locking = 0
    largest = 0.0_wp
    do e = 1, size(elastic%rule_of)
      associate (rule => elastic%rule(elastic%rule_of(e)))
        if (rule%bbar .or. rule%polar) cycle
      end associate
      ratio = ratio_of(elastic%moduli(:, e))
      if (ratio < least_ratio) cycle
      if (locking == 0) first = e
      locking = locking + 1
      largest = max(largest, ratio)
    end do
    if (locking == 0) return
    associate (rule => elastic%rule(elastic%rule_of(first)))
      text = 'W301'//': '//str(locking)//' elements lock near incompressibility, '// &
        "Poisson's ratio "//str(largest)//': the first is element '//str(first)//', '// &
        trim(rule%name)//'; stresses are off by tens of per cent. Take '// &
        trim(merge('hex8_bbar ', 'hex27_bbar', rule%kind == hex8))//', which does not lock'
    end associate
  end function locking_warning

  !> Poisson's ratio; 0 without stiffness.
  pure real(wp) function ratio_of(moduli)
    real(wp), intent(in) :: moduli(6)  !! lambda and mu first [Pa]
    ratio_of = 0.0_wp
    if (moduli(1) + moduli(2) > 0.0_wp) ratio_of = 0.5_wp*moduli(1)/(moduli(1) + moduli(2))
  end function ratio_of
end module fem_locking
