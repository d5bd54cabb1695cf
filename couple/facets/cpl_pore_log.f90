!> What a run reports of the liquid across its interface.
module cpl_pore_log
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_log, only: log_type, short_number
  use talus_summary, only: summary_type
  use cpl_pore, only: pore_link_type
  implicit none
  private
  public :: log_pore, pore_columns, pore_row, pore_health, summarise_pore

  character(len=22), parameter :: names(17) = [character(len=22) :: 'time [s]', &
    'mean_pressure [Pa]', 'force_x [N]', 'force_y [N]', 'force_z [N]', 'to_solid [m3]', &
    'withheld [m3]', 'lent [m3]', 'grains_content [m3]', 'grains_entered [m3]', &
    'solid_content [m3]', 'solid_entered [m3]', 'balance [-]', 'work_on_grains [J]', &
    'work_on_solid [J]', 'grains_darcy [J]', 'solid_darcy [J]']

contains

  subroutine log_pore(log, link)
    type(log_type), intent(inout) :: log
    type(pore_link_type), intent(in) :: link
    if (link%permeable) then
      call log%item('liquid', str(link%hull%ghosts)//' nodes of the grid on '// &
                    str(link%wet%nodes)//' corners of facets', 'storage of half bricks '// &
                    short_number(sum(link%storage))//' m3/Pa, '//merge('conductance', &
                    'admittance ', link%yields)//' times interval '// &
                    short_number(sum(link%ahead) + sum(link%conduct))//' m3/Pa')
    else
      call log%item('liquid', str(link%hull%ghosts)//' nodes of the grid on impervious facets')
    end if
  end subroutine log_pore

  subroutine pore_columns(columns)
    type(string_type), allocatable, intent(out) :: columns(:)
    integer(i4) :: k
    do k = 1, size(names)
      call append_string(columns, trim(names(k)))
    end do
  end subroutine pore_columns

  !> A row of <stem>_pore.csv at time [s], after an exchange was accepted.
  pure function pore_row(link, time) result(value)
    type(pore_link_type), intent(in) :: link
    real(wp), intent(in) :: time
    real(wp) :: value(size(names))
    associate (b => link%books)
      value(1) = time
      value(2) = 0.0_wp
      if (link%permeable) value(2) = sum(link%p)/size(link%p)
      value(3:5) = sum(link%force, 2)
      value(6) = b%to_solid
      value(7) = sum(link%kept)
      value(8) = b%lent
      value(9:12) = [b%content(1), b%entered(1), b%content(2), b%entered(2)]
      value(13) = relative_balance(link)
      value(14:15) = b%work
      value(16:17) = b%darcy
    end associate
  end function pore_row

  !> Liquid that came from nowhere over what went over, or over what is stored, the larger.
  pure real(wp) function relative_balance(link) result(share)
    type(pore_link_type), intent(in) :: link
    real(wp) :: scale
    associate (b => link%books)
      scale = max(b%passed, sum(abs(b%content)), sum(abs(b%entered)))
    end associate
    share = 0.0_wp
    if (scale > 0.0_wp) share = abs(link%balance())/scale
  end function relative_balance

  subroutine pore_health(log, link)
    type(log_type), intent(inout) :: log
    type(pore_link_type), intent(in) :: link
    associate (b => link%books)
      call log%health('liquid: '//short_number(b%to_solid)//' m3 from the grains to the solid, '// &
                      short_number(relative_balance(link))//' of it came from nowhere, '// &
                      'work of the interface '//short_number(b%work(1))//' J on that of the '// &
                      'grains, '//short_number(b%work(2))//' J on the solid')
    end associate
  end subroutine pore_health

  subroutine summarise_pore(summary, link)
    type(summary_type), intent(inout) :: summary
    type(pore_link_type), intent(in) :: link
    call summary%set('health.liquid_balance', relative_balance(link))
    call summary%set('interface.liquid_to_solid_m3', link%books%to_solid)
    call summary%set('interface.liquid_work_on_grains_J', link%books%work(1))
    call summary%set('interface.liquid_work_on_solid_J', link%books%work(2))
  end subroutine summarise_pore
end module cpl_pore_log
