!> Which elements are warned of near incompressibility, and what is advised.
program test_fem_locking
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_elastic, only: fem_elastic_type
  use fem_locking, only: locking_warning
  implicit none
  type(test_type) :: test

  call test%check('tet10 at 0.3', warning_of('tet10', 0.3_wp) == '')
  call test%check('tet10 just below the limit', warning_of('tet10', 0.4799_wp) == '')
  call test%check('tet10 at 0.4999', has(warning_of('tet10', 0.4999_wp), '2 elements lock') .and. &
                  has(warning_of('tet10', 0.4999_wp), 'first is element 2, tet10') .and. &
                  has(warning_of('tet10', 0.4999_wp), 'Take hex27_bbar'))
  call test%check('hex8_full', has(warning_of('hex8_full', 0.49_wp), 'Take hex8_bbar'))
  call test%check('hex20', has(warning_of('hex20', 0.49_wp), 'Take hex27_bbar'))
  call test%check('hex8_bbar does not lock', warning_of('hex8_bbar', 0.4999_wp) == '')
  call test%check('hex27_bbar does not lock', warning_of('hex27_bbar', 0.4999_wp) == '')
  call test%check('no remedy for pairs', warning_of('tet10/tet4', 0.4999_wp) == '')
  call test%finish()

contains

  !> Three elements, the first compressible.
  function warning_of(name, ratio) result(text)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: ratio
    character(len=:), allocatable :: text
    type(fem_elastic_type) :: elastic
    integer(i4) :: e, r
    call elastic%start(3)
    call elastic%use_rule(name, r)
    elastic%rule_of = r
    do e = 1, 3
      elastic%moduli(:2, e) = lame(merge(0.2_wp, ratio, e == 1))
    end do
    text = locking_warning(elastic)
  end function warning_of

  !> lambda and mu of E = 1.
  pure function lame(ratio) result(moduli)
    real(wp), intent(in) :: ratio
    real(wp) :: moduli(2)
    moduli = [ratio/((1.0_wp + ratio)*(1.0_wp - 2.0_wp*ratio)), 0.5_wp/(1.0_wp + ratio)]
  end function lame

  pure logical function has(text, part)
    character(len=*), intent(in) :: text, part
    has = index(text, part) > 0
  end function has
end program test_fem_locking
