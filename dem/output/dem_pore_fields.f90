!> Fields of the liquid among the grains: pressures at the nodes of its grid, pores and flow of its
!! bricks, step by step in HDF5, described in XDMF. The mesh is that of the start.
module dem_pore_fields
  use talus_kinds, only: wp, i4, i8
  use talus_coarse, only: grid_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_series, only: series_type
  use talus_xdmf, only: xdmf_type, xdmf_cell, xdmf_node
  use dem_grids, only: put_mesh
  use dem_pore_cavity, only: hydrostatic
  use dem_pore_fit, only: make_fit, fit_fields
  use dem_pore_grid, only: brick_count, node_count, brick_edges
  use dem_pore_medium, only: darcy_velocity
  use dem_pore_state, only: pore_fit_type
  use dem_pore_tools, only: add_tool_fields, place_tools, share_tools, tool_velocity
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: dem_pore_fields_type

  character(len=*), parameter :: format_name = 'talus-pore'

  type :: dem_pore_fields_type
    logical :: opened = .false.
    real(wp) :: last_time = -1.0_wp  !! of the last step written [s]
    character(len=:), allocatable :: note  !! what was repaired in the file, '' for nothing
    type(series_type) :: series
    type(xdmf_type) :: xdmf
  contains
    procedure :: open => open_fields
    procedure :: write => write_fields
  end type dem_pore_fields_type

contains

  !> Begin <stem>_pore.h5, or go on in it after a restart at time >= 0.
  subroutine open_fields(self, d, stem, time, errors)
    class(dem_pore_fields_type), intent(inout) :: self
    type(dem_data_type), intent(in) :: d
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! [s]
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    type(grid_type) :: grid
    logical :: found
    integer(i4) :: before

    self%note = ''
    if (.not. d%pore%active) return
    before = errors%count
    found = .false.
    if (time >= 0.0_wp) then
      call self%series%resume(stem//'_pore.h5', format_name, time, found, errors)
      self%note = self%series%note
      if (found .and. self%series%count > 0) &
        self%last_time = self%series%step(self%series%count)%time
    end if
    if (.not. found .and. errors%count == before) then
      call self%series%start(stem//'_pore.h5', format_name, file, errors)
      grid%lower = d%pore%grid%lower
      grid%upper = d%pore%grid%upper
      grid%cells = d%pore%grid%bricks
      call put_mesh(file, grid, errors)
      call file%commit(errors)
    end if
    call self%xdmf%describe_hex8(stem//'_pore.xdmf', '/mesh/x', '/mesh/hex8', &
                                 int(node_count(d%pore%grid), i8), &
                                 int(brick_count(d%pore%grid), i8))
    call self%xdmf%attribute('excess_pressure', 'excess_pressure', xdmf_node, 1)
    call self%xdmf%attribute('pressure', 'pressure', xdmf_node, 1)
    call self%xdmf%attribute('porosity', 'porosity', xdmf_cell, 1)
    call self%xdmf%attribute('room', 'room', xdmf_cell, 1)
    call self%xdmf%attribute('mobility', 'mobility', xdmf_cell, 1)
    call self%xdmf%attribute('darcy', 'darcy', xdmf_cell, 3)
    call self%xdmf%attribute('velocity', 'velocity', xdmf_cell, 3)
    call self%xdmf%attribute('divergence', 'divergence', xdmf_cell, 1)
    call self%xdmf%attribute('grains', 'grains', xdmf_cell, 1, 'int4')
    self%opened = errors%count == before
  end subroutine open_fields

  !> One more step; a time that was just written is not written twice.
  subroutine write_fields(self, time, d, errors)
    class(dem_pore_fields_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! [s]
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    character(len=:), allocatable :: group
    type(pore_fit_type) :: fit
    real(wp), allocatable :: v(:, :), w(:, :), divergence(:), field(:, :, :)
    real(wp) :: h(3)
    integer(i4) :: c, j

    if (.not. self%opened .or. .not. time > self%last_time) return
    associate (pore => d%pore)
      fit%tools = pore%fit%tools
      call place_tools(d%surfaces, fit%tools)
      call share_tools(pore%grid, fit%tools)
      call make_fit(pore%grid, d%grains%x, pore%volume, fit)
      h = brick_edges(pore%grid)
      allocate (v(3, brick_count(pore%grid)), w(3, brick_count(pore%grid)))
      allocate (divergence(brick_count(pore%grid)), field(4, 3, brick_count(pore%grid)))
      call fit_fields(fit, d%grains%v, field)
      call add_tool_fields(pore%grid, fit, tool_velocity(d%surfaces, fit%tools), field)
      do c = 1, size(divergence)
        v(:, c) = field(1, :, c)
        divergence(c) = sum([(field(1 + j, j, c)/h(j), j=1, 3)])
        w(:, c) = darcy_velocity(pore, c)
      end do
      call self%series%begin_step(time, file, group, errors)
      call file%put(group//'/excess_pressure', pore%p, errors)
      call file%put(group//'/pressure', &
                    pore%p + hydrostatic(pore%grid, pore%liquid%density* &
                                         d%par%gravity_scale*d%par%gravity), errors)
      call file%put(group//'/porosity', pore%porosity, errors)
      call file%put(group//'/room', pore%room, errors)
      call file%put(group//'/mobility', pore%mobility, errors)
      call file%put(group//'/darcy', w, errors)
      call file%put(group//'/velocity', v, errors)
      call file%put(group//'/divergence', divergence, errors)
      call file%put(group//'/grains', fit%start(2:) - fit%start(:size(divergence)), errors)
    end associate
    call self%series%end_step(int(size(divergence), i8), file, errors)
    call self%xdmf%write(self%series, errors)
    self%last_time = time
  end subroutine write_fields
end module dem_pore_fields
