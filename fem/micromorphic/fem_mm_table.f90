!> Table of a micromorphic point: every measure of motion, stress and state, a row an instant.
module fem_mm_table
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_history, only: history_type
  use fem_mm_cones, only: surfaces
  use fem_mm_elastic, only: mm_strain_type
  use fem_mm_flow, only: mm_law_type
  use fem_mm_motion, only: mm_motion_type, mm_spatial_type, strains, pushed
  use fem_mm_plastic, only: mm_point_type
  implicit none
  private
  public :: open_point_table, write_point_row

contains

  subroutine open_point_table(file, path, errors)
    type(history_type), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    integer(i4) :: k

    call append_string(columns, 'time [s]')
    call add(columns, 'F', '-', 2)
    call add(columns, 'chi', '-', 2)
    call add(columns, 'grad_chi', '1/m', 3)
    call add(columns, 'C', '-', 2)
    call add(columns, 'Psi', '-', 2)
    call add(columns, 'Gamma', '1/m', 3)
    call add(columns, 'S', 'Pa', 2)
    call add(columns, 'Sigma', 'Pa', 2)
    call add(columns, 'M', 'N/m', 3)
    call add(columns, 'cauchy', 'Pa', 2)
    call add(columns, 'micro', 'Pa', 2)
    call add(columns, 'couple', 'N/m', 3)
    call add(columns, 'P', 'Pa', 2)
    call add(columns, 'Q', 'Pa', 2)
    call add(columns, 'R', 'N/m', 3)
    call add(columns, 'Fp', '-', 2)
    call add(columns, 'chi_p', '-', 2)
    call add(columns, 'grad_chi_p', '1/m', 3)
    do k = 1, surfaces
      call append_string(columns, 'Z '//str(k)//' [-]')
    end do
    do k = 1, surfaces
      call append_string(columns, 'yield '//str(k)//' [Pa]')
    end do
    do k = 1, surfaces
      call append_string(columns, 'active '//str(k)//' [-]')
    end do
    call append_string(columns, 'stored [J/m3]')
    call append_string(columns, 'dissipated [J/m3]')
    call append_string(columns, 'shifted [J/m3]')
    call append_string(columns, 'work [J/m3]')
    call append_string(columns, 'substeps [-]')
    call append_string(columns, 'iterations [-]')
    call append_string(columns, 'cap 1 [Pa]')
    call append_string(columns, 'cap 2 [Pa]')
    call append_string(columns, 'breakage [-]')
    call append_string(columns, 'breakage energy [J/m3]')
    call file%open(path, columns, .false., errors)
  end subroutine open_point_table

  !> Columns of a tensor of an order, the last index running fastest.
  subroutine add(columns, name, unit, order)
    type(string_type), allocatable, intent(inout) :: columns(:)
    character(len=*), intent(in) :: name, unit
    integer(i4), intent(in) :: order
    integer(i4) :: k
    do k = 0, 3**order - 1
      if (order == 2) then
        call append_string(columns, name//' '//str(1 + k/3)//str(1 + mod(k, 3))//' ['//unit//']')
      else
        call append_string(columns, name//' '//str(1 + k/9)//str(1 + mod(k/3, 3)) &
          //str(1 + mod(k, 3))//' ['//unit//']')
      end if
    end do
  end subroutine add

  !> Work [J/m^3] done and iterations of the path are the caller's.
  subroutine write_point_row(file, time, motion, point, work, iterations, errors)
    type(history_type), intent(inout) :: file
    real(wp), intent(in) :: time
    type(mm_motion_type), intent(in) :: motion
    type(mm_point_type), intent(in) :: point
    real(wp), intent(in) :: work
    integer(i4), intent(in) :: iterations
    type(error_list_type), intent(inout) :: errors
    type(mm_strain_type) :: strain
    type(mm_spatial_type) :: spatial
    real(wp) :: row(1 + 6*45 + 3*surfaces + 10)
    integer(i4) :: n

    strain = strains(motion)
    spatial = pushed(motion, point%stress)
    row(1) = time
    row(2:46) = [two(motion%f), two(motion%chi), three(motion%g)]
    row(47:91) = [two(strain%c), two(strain%psi), three(strain%gamma)]
    row(92:136) = [two(point%stress%s), two(point%stress%sigma), three(point%stress%m)]
    row(137:181) = [two(spatial%sigma), two(spatial%s), three(spatial%m)]
    row(182:226) = [two(point%force%p), two(point%force%q), three(point%force%r)]
    row(227:271) = [two(point%state%fp), two(point%state%xp), three(point%state%gp)]
    n = 271
    row(n + 1:n + surfaces) = point%state%z
    row(n + surfaces + 1:n + 2*surfaces) = point%yield
    row(n + 2*surfaces + 1:n + 3*surfaces) = merge(1.0_wp, 0.0_wp, point%active)
    n = n + 3*surfaces
    row(n + 1:) = [point%stored, point%state%dissipated, point%state%shifted, work, &
                   real(point%substeps, wp), real(iterations, wp), point%cap, point%breakage, &
                   point%energy_b]
    call file%write(row, errors)
  end subroutine write_point_row

  pure function two(a) result(v)
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: v(9)
    v = reshape(transpose(a), [9])
  end function two

  pure function three(a) result(v)
    real(wp), intent(in) :: a(3, 3, 3)
    real(wp) :: v(27)
    v = reshape(reshape(a, [3, 3, 3], order=[3, 2, 1]), [27])
  end function three
end module fem_mm_table
