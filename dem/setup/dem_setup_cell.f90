!> The cell of a deck and what must fit into it. Faults D247, D265 to D267.
module dem_setup_cell
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_region, only: region_box, region_cylinder, region_sphere
  use dem_cell, only: set_cell, determinant, least_width, is_periodic, fractions
  use dem_measures, only: dem_measures_type
  use dem_packing, only: dem_packing_type
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: read_cell, check_regions

  real(wp), parameter :: flat = 1.0e-9_wp   !! volume over product of the edges that is none
  real(wp), parameter :: slack = 1.0e-6_wp  !! of an edge, by which a centre may lie outside

contains

  !> Group cell; edges that the deck leaves out are those of the packing.
  subroutine read_cell(deck, packing, walls, served, system, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(in) :: packing
    type(string_type), intent(in) :: walls(:)  !! names
    logical, intent(in) :: served
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp) :: vectors(3, 3), origin(3)
    logical :: periodic(3)
    integer(i4) :: before

    if (deck%count('cell') == 0) return
    before = errors%count
    if (served) call deck%fault(errors, 'D247', 'a cell does not work under a partner', 'cell', 1, &
                                '', 'leave &cell out under talus-couple')
    call read_periodic(deck, periodic, errors)
    call read_edges(deck, packing, vectors, origin, errors)
    if (errors%count > before) return
    call set_cell(system%cell, origin, vectors, periodic)
    if (.not. is_periodic(system%cell)) return
    call check_width(deck, system, errors)
    call check_grains(deck, system, errors)
    call check_walls(deck, system, walls, errors)
    if (all(periodic) .and. any(abs(system%par%gravity) > 0.0_wp)) &
      call deck%fault(errors, 'D265', 'gravity in a cell that is periodic in all directions: '// &
                      'all grains would fall for ever', 'run', 1, 'gravity', &
                      'set gravity to zero, or let walls bound one direction')
  end subroutine read_cell

  !> Names of the periodic edges; all where none is given (D265).
  subroutine read_periodic(deck, periodic, errors)
    type(deck_type), intent(in) :: deck
    logical, intent(out) :: periodic(3)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    logical :: none
    integer(i4) :: k

    periodic = .not. deck%given('cell', 1, 'periodic')
    if (all(periodic)) return
    call deck%get('cell', 1, 'periodic', names)
    none = .false.
    do k = 1, size(names)
      if (names(k)%s == 'none') then
        none = .true.
      else
        periodic(index('abc', names(k)%s)) = .true.
      end if
    end do
    if (none .and. any(periodic)) &
      call deck%fault(errors, 'D265', "'none' is given beside a periodic edge", 'cell', 1, &
                      'periodic', "name edges, or 'none' alone")
  end subroutine read_periodic

  !> Edges as columns and the corner [m] (D265).
  subroutine read_edges(deck, packing, vectors, origin, errors)
    type(deck_type), intent(in) :: deck
    type(dem_packing_type), intent(in) :: packing
    real(wp), intent(out) :: vectors(3, 3), origin(3)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)
    character(len=:), allocatable :: what
    real(wp) :: volume
    integer(i4) :: k

    vectors = packing%cell
    origin = packing%cell_origin
    if (deck%given('cell', 1, 'size')) then
      call deck%get('cell', 1, 'size', values)
      vectors = 0.0_wp
      do k = 1, 3
        vectors(k, k) = values(k)
      end do
    else if (deck%given('cell', 1, 'vectors')) then
      call deck%get('cell', 1, 'vectors', values)
      vectors = reshape(values, [3, 3])
    else if (.not. packing%has_cell) then
      call deck%fault(errors, 'D265', 'the cell has no edges', 'cell', 1, '', &
                      'give size or vectors, or a packing that was made in a cell')
      return
    end if
    if (deck%given('cell', 1, 'origin') .or. .not. packing%has_cell) then
      call deck%get('cell', 1, 'origin', values)
      origin = values
    end if
    volume = determinant(vectors)/max(product(norm2(vectors, 1)), tiny(1.0_wp))
    if (volume > flat) return
    what = trim(merge('are left-handed', 'lie in a plane ', volume < -flat))
    call deck%fault(errors, 'D265', 'the edges of the cell '//what, 'cell', 1, &
                    trim(merge('vectors', '       ', deck%given('cell', 1, 'vectors'))), &
                    'the third edge must lie on the side to which the first two turn')
  end subroutine read_edges

  !> A pair must meet over one face only: two ranges fit between opposite faces (D266).
  subroutine check_width(deck, system, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp) :: range, width
    range = 2.0_wp*maxval(system%grains%radius) + system%first_skin()
    width = least_width(system%cell)
    if (width >= 2.0_wp*range) return
    call deck%fault(errors, 'D266', 'the periodic cell is '//str(width)//' m wide, less than '// &
                    'two interaction ranges of '//str(range)//' m', 'cell', 1, '', &
                    'a larger cell with more grains')
  end subroutine check_width

  !> Centres lie in the cell, where it is periodic, of clumps their centres of mass (D267).
  subroutine check_grains(deck, system, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    real(wp) :: s(3)
    integer(i4) :: i, first, outside

    outside = 0
    first = 0
    do i = 1, system%grains%n
      s = fractions(system%cell, centre_of(system, i))
      if (.not. any(system%cell%periodic .and. (s < -slack .or. s > 1.0_wp + slack))) cycle
      outside = outside + 1
      if (first == 0) first = i
    end do
    if (outside == 0) return
    s = fractions(system%cell, centre_of(system, first))
    call deck%fault(errors, 'D267', 'grain '//str(system%grains%id(first))//' lies outside the '// &
                    'cell, at '//str(s)//' of its edges ('//str(outside)//' such grains)', 'cell', &
                    1, '', 'origin and edges must hold all centres of the packing')
  end subroutine check_grains

  !> Centre of a grain, of a member that of its clump [m].
  pure function centre_of(system, i) result(x)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: i
    real(wp) :: x(3)
    x = system%grains%x(:, i)
    if (system%clumps%n > 0) x = x - system%clumps%arm(:, i)
  end function centre_of

  !> No wall cuts a periodic direction (D267).
  subroutine check_walls(deck, system, walls, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(string_type), intent(in) :: walls(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k, j
    do k = 1, system%planes%n
      do j = 1, 3
        if (.not. system%cell%periodic(j)) cycle
        if (abs(dot_product(system%planes%normal(:, k), system%cell%vectors(:, j))) <= &
            flat*norm2(system%cell%vectors(:, j))) cycle
        call deck%fault(errors, 'D267', "wall '"//walls(k)%s//"' cuts edge "//str(j)//' of the '// &
                        'cell, which is periodic', 'wall', k, 'normal', &
                        'walls run along all periodic edges, or take the edge out of periodic')
        exit
      end do
    end do
  end subroutine check_walls

  !> Regions and grids lie in the cell at the start (D267).
  subroutine check_regions(deck, system, measures, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    type(dem_measures_type), intent(in) :: measures
    type(error_list_type), intent(inout) :: errors
    real(wp) :: across(3)
    integer(i4) :: k

    if (.not. is_periodic(system%cell)) return
    do k = 1, measures%n
      associate (r => measures%item(k)%request%region)
        if (r%kind == region_box) call check_box(deck, system, 'measure', k, r%lower, r%upper, &
                                                 errors)
        across = sqrt(max(0.0_wp, 1.0_wp - r%axis**2))
        if (r%kind == region_cylinder) &
          call check_box(deck, system, 'measure', k, &
                         min(r%base, r%base + r%length*r%axis) - r%radius*across, &
                         max(r%base, r%base + r%length*r%axis) + r%radius*across, &
                         errors)
        if (r%kind == region_sphere) call check_box(deck, system, 'measure', k, &
                                                    r%base - r%radius, r%base + r%radius, errors)
      end associate
    end do
    do k = 1, measures%grids
      associate (g => measures%grid(k)%grid)
        call check_box(deck, system, 'grid', k, g%lower, g%upper, errors)
      end associate
    end do
  end subroutine check_regions

  subroutine check_box(deck, system, group, k, lower, upper, errors)
    type(deck_type), intent(in) :: deck
    type(dem_system_type), intent(in) :: system
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    real(wp), intent(in) :: lower(3), upper(3)
    type(error_list_type), intent(inout) :: errors
    real(wp) :: s(3)
    integer(i4) :: corner
    do corner = 0, 7
      s = fractions(system%cell, merge(upper, lower, [btest(corner, 0), btest(corner, 1), &
                                                      btest(corner, 2)]))
      if (.not. any(system%cell%periodic .and. (s < -slack .or. s > 1.0_wp + slack))) cycle
      call deck%fault(errors, 'D267', 'the region reaches out of the periodic cell', group, k, &
                      'upper', 'keep lower and upper inside the cell')
      return
    end do
  end subroutine check_box
end module dem_setup_cell
