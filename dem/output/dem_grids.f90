!> Coarse-grained fields on a grid: group &grid, HDF5 file of cells with XDMF.
module dem_grids
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_coarse, only: grid_type, fields_type, coarse_grain, kernel_gaussian, kernel_lucy
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_sample, only: sample_type
  use talus_series, only: series_type
  use talus_xdmf, only: xdmf_type, xdmf_cell
  implicit none
  private
  public :: dem_grid_type, read_grid, put_mesh

  character(len=*), parameter :: format_name = 'talus-grid'
  real(wp), parameter :: most_cells = 1.0e8_wp

  type :: dem_grid_type
    character(len=:), allocatable :: id
    type(grid_type) :: grid
    real(wp) :: every = 0.0_wp        !! [s]; 0: first and last state only
    real(wp) :: last_time = -1.0_wp   !! of the last step written [s]
    type(series_type) :: series
    type(xdmf_type) :: xdmf
  contains
    procedure :: open => open_grid
    procedure :: write => write_grid
  end type dem_grid_type

contains

  !> Group grid number k; cells must have a size, and none may be wider than the kernel (D263).
  subroutine read_grid(deck, k, item, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_grid_type), intent(inout) :: item
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: kernel
    real(wp), allocatable :: reals(:)
    integer(i4), allocatable :: cells(:)
    real(wp) :: edge

    call deck%get('grid', k, 'id', item%id)
    call deck%get('grid', k, 'every_time', item%every)
    call deck%get('grid', k, 'lower', reals)
    item%grid%lower = reals
    call deck%get('grid', k, 'upper', reals)
    item%grid%upper = reals
    call deck%get('grid', k, 'cells', cells)
    item%grid%cells = cells
    call deck%get('grid', k, 'width', item%grid%width)
    call deck%get('grid', k, 'kernel', kernel)
    item%grid%kernel = merge(kernel_lucy, kernel_gaussian, kernel == 'lucy')
    if (.not. all(item%grid%upper > item%grid%lower)) then
      call deck%fault(errors, 'D263', 'the grid has no volume', 'grid', k, 'upper', &
                      'upper must be above lower in x, y and z')
      return
    end if
    edge = maxval((item%grid%upper - item%grid%lower)/item%grid%cells)
    if (edge > item%grid%width*(1.0_wp + 1.0e-9_wp)) &
      call deck%fault(errors, 'D263', 'a cell is '//str(edge)//' m wide, the kernel only '// &
                      str(item%grid%width)//' m: fields would depend on where cells lie', &
                      'grid', k, 'cells', 'more cells, or a larger width')
    if (product(real(cells, wp)) > most_cells) &
      call deck%fault(errors, 'D263', 'the grid has '//str(product(real(cells, wp)))//' cells', &
                      'grid', k, 'cells', 'at most 1e8')
  end subroutine read_grid

  !> Begin the file, or go on in it after a restart at time >= 0.
  subroutine open_grid(self, stem, time, errors)
    class(dem_grid_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! s
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    character(len=:), allocatable :: path
    integer(i8) :: nodes, cells
    logical :: found

    path = stem//'_grid_'//self%id
    found = .false.
    self%last_time = -1.0_wp
    if (time >= 0.0_wp) then
      call self%series%resume(path//'.h5', format_name, time, found, errors)
      if (found .and. self%series%count > 0) &
        self%last_time = self%series%step(self%series%count)%time
    end if
    if (.not. found .and. .not. errors%any()) then
      call self%series%start(path//'.h5', format_name, file, errors)
      call put_mesh(file, self%grid, errors)
      call file%commit(errors)
    end if
    nodes = product(int(self%grid%cells + 1, i8))
    cells = product(int(self%grid%cells, i8))
    call self%xdmf%describe_hex8(path//'.xdmf', '/mesh/x', '/mesh/hex8', nodes, cells)
    call self%xdmf%attribute('solid_fraction', 'solid_fraction', xdmf_cell, 1)
    call self%xdmf%attribute('density', 'density', xdmf_cell, 1)
    call self%xdmf%attribute('momentum', 'momentum', xdmf_cell, 3)
    call self%xdmf%attribute('velocity', 'velocity', xdmf_cell, 3)
    call self%xdmf%attribute('stress', 'stress', xdmf_cell, 9)
    call self%xdmf%attribute('kinetic_stress', 'kinetic_stress', xdmf_cell, 9)
    call self%xdmf%attribute('fabric', 'fabric', xdmf_cell, 9)
  end subroutine open_grid

  !> Corners and cells, x fastest.
  subroutine put_mesh(file, grid, errors)
    type(h5_file_type), intent(inout) :: file
    type(grid_type), intent(in) :: grid
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: x(:, :)
    integer(i4), allocatable :: hex8(:, :)
    integer(i4) :: i, j, k, n, across(2)

    across = [grid%cells(1) + 1, (grid%cells(1) + 1)*(grid%cells(2) + 1)]
    allocate (x(3, product(grid%cells + 1)), hex8(8, product(grid%cells)))
    n = 0
    do k = 0, grid%cells(3)
      do j = 0, grid%cells(2)
        do i = 0, grid%cells(1)
          x(:, 1 + i + across(1)*j + across(2)*k) = &
            grid%lower + [i, j, k]*((grid%upper - grid%lower)/grid%cells)
          if (any([i, j, k] == grid%cells)) cycle
          n = n + 1
          hex8(:, n) = corners_of([i, j, k], across)
        end do
      end do
    end do
    call file%group('/mesh', errors)
    call file%put('/mesh/x', x, errors)
    call file%put('/mesh/hex8', hex8, errors)
  end subroutine put_mesh

  !> Numbers of the corners of a cell, from 0, in the order of hex8.
  pure function corners_of(cell, across) result(number)
    integer(i4), intent(in) :: cell(3)    !! its place along x, y, z, from 0
    integer(i4), intent(in) :: across(2)  !! corners from one row to the next, from layer to layer
    integer(i4) :: number(8)
    integer(i4), parameter :: corner(3, 8) = reshape( &
      [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
    number = cell(1) + corner(1, :) + across(1)*(cell(2) + corner(2, :)) &
             + across(2)*(cell(3) + corner(3, :))
  end function corners_of

  !> One more step.
  subroutine write_grid(self, time, sample, errors)
    class(dem_grid_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! s
    type(sample_type), intent(in) :: sample
    type(error_list_type), intent(inout) :: errors
    type(fields_type) :: fields
    type(h5_file_type) :: file
    character(len=:), allocatable :: group

    call coarse_grain(sample, self%grid, fields)
    call self%series%begin_step(time, file, group, errors)
    call file%put(group//'/solid_fraction', fields%solid, errors)
    call file%put(group//'/density', fields%density, errors)
    call file%put(group//'/momentum', fields%momentum, errors)
    call file%put(group//'/velocity', fields%velocity, errors)
    call file%put(group//'/stress', fields%stress, errors)
    call file%put(group//'/kinetic_stress', fields%kinetic, errors)
    call file%put(group//'/fabric', fields%fabric, errors)
    call self%series%end_step(int(fields%n, i8), file, errors)
    call self%xdmf%write(self%series, errors)
    self%last_time = time
  end subroutine write_grid
end module dem_grids
