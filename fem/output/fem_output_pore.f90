!> Results of the liquid in the pores: pressures, Darcy's flow and total stress in the fields, and
!! the table of what entered and what is there.
module fem_output_pore
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_history, only: history_type
  use talus_xdmf, only: xdmf_type, xdmf_node, xdmf_cell
  use fem_body, only: fem_body_type
  use fem_elastic, only: classical
  use fem_pore_faces, only: fem_leak_type
  implicit none
  private
  public :: describe_pore, put_pore, pore_ledger, pore_titles, write_pore, balance_error

contains

  !> Attributes of nodes and cells.
  subroutine describe_pore(body, xdmf)
    type(fem_body_type), intent(in) :: body
    type(xdmf_type), intent(inout) :: xdmf
    call xdmf%attribute('pore_pressure', 'pore_pressure', xdmf_node, 1)
    call xdmf%attribute('excess_pressure', 'excess_pressure', xdmf_node, 1)
    call xdmf%attribute('darcy', 'darcy', xdmf_cell, 3)
    if (body%pore%unsaturated) call xdmf%attribute('saturation', 'saturation', xdmf_cell, 1)
    call xdmf%attribute('total_stress', 'total_stress', xdmf_cell, stresses(body))
  end subroutine describe_pore

  !> Components of a stress in files.
  pure integer(i4) function stresses(body)
    type(fem_body_type), intent(in) :: body
    stresses = merge(classical, 9_i4, body%elastic%components == classical)
  end function stresses

  !> Datasets of a step; `mean` has the effective stress of the cells.
  subroutine put_pore(body, mean, file, group, errors)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: mean(:, :)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: total(:, :), flow(:, :)
    integer(i4) :: e, k, diagonal(3)
    allocate (total(stresses(body), body%mesh%elements), flow(5, body%mesh%elements))
    total = mean(:size(total, 1), :)
    diagonal = merge([1, 2, 3], [1, 5, 9], size(total, 1) == classical)
    do e = 1, body%mesh%elements
      call body%pore%element_flow(body%mesh, body%dofs, body%elastic, body%accepted%u, e, &
        flow(:, e))
      k = body%pore%skeleton_of(e)
      if (k > 0) total(diagonal, e) = total(diagonal, e) - body%pore%skeleton(k)%biot*flow(4, e)
    end do
    call file%put(group//'/pore_pressure', nodal_pressure(body, body%accepted%u(1, :)), errors)
    call file%put(group//'/excess_pressure', nodal_pressure(body, body%accepted%u(1, :) &
      - body%pore%start(1, :)), errors)
    call file%put(group//'/darcy', flow(:3, :), errors)
    if (body%pore%unsaturated) call file%put(group//'/saturation', flow(5, :), errors)
    call file%put(group//'/total_stress', total, errors)
  end subroutine put_pore

  !> Values of all nodes from those of the pressures: between corners as the element has them, zero
  !! where there is no liquid.
  pure function nodal_pressure(body, value) result(p)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: value(:)  !! (blocks) [Pa]
    real(wp) :: p(body%mesh%nodes)
    integer(i4) :: e, a
    p = 0.0_wp
    do e = 1, body%mesh%elements
      if (body%pore%skeleton_of(e) == 0) cycle
      associate (rule => body%elastic%rule(body%elastic%rule_of(e)), &
                 node => body%mesh%node(body%mesh%start(e):body%mesh%start(e + 1) - 1), &
                 wet => body%dofs%wet(body%dofs%wet_start(e):body%dofs%wet_start(e + 1) - 1))
        do a = 1, rule%nodes
          p(node(a)) = dot_product(rule%middle(:, a), value(wet))
        end do
      end associate
    end do
  end function nodal_pressure

  !> Columns of the ledger.
  subroutine pore_ledger(columns)
    type(string_type), allocatable, intent(inout) :: columns(:)
    call append_string(columns, 'liquid [J]')
    call append_string(columns, 'darcy [J]')
    call append_string(columns, 'flow [J]')
  end subroutine pore_ledger

  !> Columns of `<deck>_pore.csv`.
  function pore_titles(body) result(columns)
    type(fem_body_type), intent(in) :: body
    type(string_type), allocatable :: columns(:)
    integer(i4) :: k
    call append_string(columns, 'time [s]')
    call append_string(columns, 'least pressure [Pa]')
    call append_string(columns, 'largest pressure [Pa]')
    call append_string(columns, 'content [m3]')
    call append_string(columns, 'balance [m3]')
    do k = 1, size(body%pore%held)
      call name_columns(trim(body%pore%held(k)%name))
    end do
    do k = 1, size(body%pore%inflow)
      call name_columns(trim(body%pore%inflow(k)%name))
    end do
    do k = 1, size(body%pore%leak)
      call name_columns(trim(body%pore%leak(k)%name)//kind_of(body%pore%leak(k)))
    end do

  contains

    subroutine name_columns(name)
      character(len=*), intent(in) :: name
      call append_string(columns, name//' entered [m3]')
      call append_string(columns, name//' inflow [m3/s]')
    end subroutine name_columns
  end function pore_titles

  !> What a leak is, in titles.
  pure function kind_of(leak) result(kind)
    type(fem_leak_type), intent(in) :: leak
    character(len=:), allocatable :: kind
    kind = ' leak'
    if (leak%one_way) kind = ' seepage'
    if (allocated(leak%most)) kind = ' infiltration'
  end function kind_of

  !> The row of the accepted state: content gained since the start, what entered less that, and of
  !! each boundary what entered and how fast in the last step.
  subroutine write_pore(body, table, errors)
    type(fem_body_type), intent(in) :: body
    type(history_type), intent(inout) :: table
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    associate (b => body%pore%accepted_books, p => body%accepted%u(1, body%dofs%solid + 1:))
      call table%write([body%accepted%time, minval(p), maxval(p), b%content, &
                        sum(b%entered) - b%content, &
                        [([b%entered(k), b%rate(k)], k=1, size(b%entered))]], errors)
    end associate
  end subroutine write_pore

  !> |what entered - what is there| over all that passed a face or was stored.
  pure real(wp) function balance_error(body)
    type(fem_body_type), intent(in) :: body
    real(wp) :: scale
    balance_error = 0.0_wp
    if (.not. body%pore%active) return
    associate (b => body%pore%accepted_books)
      scale = max(b%through, abs(b%content))
      if (scale > 0.0_wp) balance_error = abs(sum(b%entered) - b%content)/scale
    end associate
  end function balance_error
end module fem_output_pore
