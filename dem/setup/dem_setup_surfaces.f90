!> Surfaces, penetrometers and cylinders of the deck. Faults D270 to D273, D289; those of
!! files see dem_stl, dem_surface_file and dem_surface_make.
module dem_setup_surfaces
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string, ends_with, lower
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_log, only: short_number
  use dem_packing, only: dem_packing_type
  use dem_setup_laws, only: material_index
  use dem_obj, only: read_obj
  use dem_stl, only: read_stl
  use dem_surface_file, only: read_facets
  use dem_surface_make, only: mesh_type, round_type, join_corners, check_mesh
  use dem_surface_solid, only: solid_of_triangles
  use dem_surface_state, only: dem_surfaces_type, surface_rigid, surface_membrane, soft_smooth, &
    is_bore
  use dem_surface_values, only: add_mesh, add_cone, add_cylinder, set_velocity
  implicit none
  private
  public :: read_surfaces, check_units

  character(len=12), parameter :: groups(4) = [character(len=12) :: 'surface', 'penetrometer', &
    'cylinder', 'membrane']
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: along_axis = 1.0e-9_wp  !! part of a spin across an axis that is none
  real(wp), parameter :: too_large = 100.0_wp  !! of the bed: a mesh in millimetres
  real(wp), parameter :: too_small = 0.1_wp    !! of the mean grain

contains

  !> All groups surface, then all groups penetrometer, then cylinder, then
  !! membrane.
  subroutine read_surfaces(deck, names, s, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)  !! of the materials
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    call check_names(deck, errors)
    do k = 1, deck%count('surface')
      call read_surface(deck, k, names, s, errors)
    end do
    do k = 1, deck%count('penetrometer')
      call read_penetrometer(deck, k, names, s, errors)
    end do
    do k = 1, deck%count('cylinder')
      call read_cylinder(deck, k, names, s, errors)
    end do
    do k = 1, deck%count('membrane')
      call read_membrane(deck, k, names, s, errors)
    end do
  end subroutine read_surfaces

  !> Every surface has a name of its own (D270).
  subroutine check_names(deck, errors)
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: seen(:)
    character(len=:), allocatable :: name
    integer(i4) :: g, k, j

    allocate (seen(0))
    do g = 1, size(groups)
      do k = 1, deck%count(trim(groups(g)))
        call deck%get(trim(groups(g)), k, 'id', name)
        do j = 1, size(seen)
          if (seen(j)%s == name) &
            call deck%fault(errors, 'D270', "two surfaces are named '"//name//"'", &
                            trim(groups(g)), k, 'id', 'give each surface, penetrometer and '// &
                            'cylinder its own id')
        end do
        call append_string(seen, name)
      end do
    end do
  end subroutine check_names

  !> One group surface.
  subroutine read_surface(deck, k, names, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: names(:)
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    type(mesh_type) :: mesh
    real(wp), allocatable :: corner(:, :, :), values(:)
    character(len=:), allocatable :: name
    real(wp) :: smooth, scale, centre(3), volume, second(3, 3)
    logical :: closed
    integer(i4) :: before, number

    before = errors%count
    call deck%get('surface', k, 'id', name)
    call material_index(deck, names, 'surface', k, 'material', number, errors)
    call read_corners(deck, k, corner, mesh%name, errors)
    if (errors%count > before) return
    call deck%get('surface', k, 'scale', scale)
    call deck%get('surface', k, 'smooth_deg', smooth)
    call deck%get('surface', k, 'closed', closed)
    call deck%get('surface', k, 'shift', values)
    corner = scale*corner + spread(spread(values, 2, 3), 3, size(corner, 3))
    call join_corners(corner, mesh)
    call check_mesh(mesh, closed, errors)
    if (errors%count > before) return
    centre = 0.5_wp*(minval(mesh%x, 2) + maxval(mesh%x, 2))
    if (deck%given('surface', k, 'centre')) then
      call deck%get('surface', k, 'centre', values)
      centre = values
    else if (has_density(deck, name) .and. mesh%rim == 0) then
      call solid_of_triangles(mesh%x, mesh%corner, volume, centre, second)
    end if
    call add_mesh(s, mesh, name, surface_rigid, number, cos(smooth*degree), centre)
    call read_motion(deck, 'surface', k, s)
  end subroutine read_surface

  !> Does a body give the surface a density? Its centre is then that of its mass.
  logical function has_density(deck, name)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: surface
    integer(i4) :: k
    has_density = .false.
    do k = 1, deck%count('body')
      call deck%get('body', k, 'surface', surface)
      has_density = has_density .or. (surface == name .and. deck%given('body', k, 'density'))
    end do
  end function has_density

  !> Corners of the triangles from a file, or a rectangle (D271).
  subroutine read_corners(deck, k, corner, name, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    real(wp), allocatable, intent(out) :: corner(:, :, :)
    character(len=:), allocatable, intent(out) :: name  !! for messages
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: facets
    real(wp), allocatable :: p(:)

    call deck%get('surface', k, 'facets', facets)
    if (deck%given('surface', k, 'rectangle')) then
      name = 'rectangle'
      call deck%get('surface', k, 'rectangle', p)
      allocate (corner(3, 3, 2))
      corner(:, :, 1) = reshape(p, [3, 3])
      corner(:, :, 2) = corner(:, [1, 3, 3], 1)
      corner(:, 3, 2) = corner(:, 1, 1) + corner(:, 3, 1) - corner(:, 2, 1)
      return
    end if
    name = deck%path('surface', k, 'file')
    if (ends_with(lower(name), '.h5') .neqv. len(facets) > 0) then
      call deck%fault(errors, 'D271', 'facets belong to meshes (.h5), STL and OBJ files have '// &
                      'none', 'surface', k, 'file', "for a mesh add facets = 'name of a "// &
                      "facet group'")
    else if (len(facets) > 0) then
      call read_facets(name, facets, corner, errors)
    else if (ends_with(lower(name), '.obj')) then
      call read_obj(name, corner, errors)
    else
      call read_stl(name, corner, errors)
    end if
  end subroutine read_corners

  !> Velocity and spin of the body that was added last.
  subroutine read_motion(deck, group, k, s)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(inout) :: s
    real(wp), allocatable :: velocity(:), spin(:)
    call deck%get(group, k, 'velocity', velocity)
    call deck%get(group, k, 'spin', spin)
    call set_velocity(s, s%n, velocity, spin)
  end subroutine read_motion

  !> One group penetrometer (D273).
  subroutine read_penetrometer(deck, k, names, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: names(:)
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    real(wp), allocatable :: tip(:), axis(:)
    real(wp) :: apex, diameter, length
    integer(i4) :: before, number(2)

    before = errors%count
    call deck%get('penetrometer', k, 'id', name)
    call material_index(deck, names, 'penetrometer', k, 'material', number(1), errors)
    number(2) = number(1)
    if (deck%given('penetrometer', k, 'shaft_material')) then
      call material_index(deck, names, 'penetrometer', k, 'shaft_material', number(2), errors)
    end if
    call deck%get('penetrometer', k, 'tip', tip)
    call deck%get('penetrometer', k, 'axis', axis)
    call deck%get('penetrometer', k, 'apex_deg', apex)
    call deck%get('penetrometer', k, 'diameter', diameter)
    call deck%get('penetrometer', k, 'shaft', length)
    if (.not. sum(axis**2) > 0.0_wp) &
      call deck%fault(errors, 'D273', 'the axis of a penetrometer has no length', 'penetrometer', &
                      k, 'axis', 'give the direction from the tip up the shaft')
    if (errors%count > before) return
    call add_cone(s, name, [number(1), number(1), number(2)], &
                  round_type(tip, axis, 0.5_wp*diameter, length), 0.5_wp*apex*degree)
    call read_motion(deck, 'penetrometer', k, s)
  end subroutine read_penetrometer

  !> One group cylinder (D289).
  subroutine read_cylinder(deck, k, names, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: names(:)
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name, side
    real(wp), allocatable :: centre(:), axis(:), spin(:)
    real(wp) :: radius, half
    integer(i4) :: before, number

    before = errors%count
    call deck%get('cylinder', k, 'id', name)
    call deck%get('cylinder', k, 'side', side)
    call material_index(deck, names, 'cylinder', k, 'material', number, errors)
    call deck%get('cylinder', k, 'centre', centre)
    call deck%get('cylinder', k, 'axis', axis)
    call deck%get('cylinder', k, 'spin', spin)
    call deck%get('cylinder', k, 'radius', radius)
    half = huge(half)
    if (deck%given('cylinder', k, 'length')) then
      call deck%get('cylinder', k, 'length', half)
      half = 0.5_wp*half
    end if
    if (.not. sum(axis**2) > 0.0_wp) then
      call deck%fault(errors, 'D289', 'the axis of a cylinder has no length', 'cylinder', k, &
                      'axis', 'give the direction of the axis')
    else if (half >= huge(half) .and. sum((spin - dot_product(spin, axis)/sum(axis**2)*axis)**2) &
             > (along_axis*norm2(spin))**2) then
      call deck%fault(errors, 'D289', 'a cylinder without ends spins about its axis alone', &
                      'cylinder', k, 'spin', 'give it a length, or a spin along the axis')
    end if
    if (errors%count > before) return
    call add_cylinder(s, name, number, round_type(centre, axis, radius, half), side == 'inside')
    call read_motion(deck, 'cylinder', k, s)
  end subroutine read_cylinder

  !> The membrane of one group membrane.
  subroutine read_membrane(deck, k, names, s, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: names(:)
    type(dem_surfaces_type), intent(inout) :: s
    type(error_list_type), intent(inout) :: errors
    type(mesh_type) :: mesh
    real(wp), allocatable :: corner(:, :, :)
    character(len=:), allocatable :: name
    real(wp) :: scale
    integer(i4) :: before, number

    before = errors%count
    call deck%get('membrane', k, 'id', name)
    call material_index(deck, names, 'membrane', k, 'material', number, errors)
    mesh%name = deck%path('membrane', k, 'file')
    call read_stl(mesh%name, corner, errors)
    if (errors%count > before) return
    call deck%get('membrane', k, 'scale', scale)
    corner = scale*corner
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    if (errors%count > before) return
    call add_mesh(s, mesh, name, surface_membrane, number, soft_smooth, [0.0_wp, 0.0_wp, 0.0_wp])
  end subroutine read_membrane

  !> A surface far larger than the bed or far smaller than a grain has another unit, unless the deck
  !! gives scale (D272); no grain fits into a bore narrower than itself (D289).
  subroutine check_units(deck, s, packing, errors)
    type(deck_type), intent(in) :: deck
    type(dem_surfaces_type), intent(in) :: s
    type(dem_packing_type), intent(in) :: packing
    type(error_list_type), intent(inout) :: errors
    real(wp) :: bed, grain, extent
    integer(i4) :: k

    if (s%n < deck%count('surface')) return
    do k = 1, s%n
      if (.not. is_bore(s, k)) cycle
      if (s%round%radius(k) > maxval(packing%axes)) cycle
      call deck%fault(errors, 'D289', "cylinder '"//s%name(k)%s//"' has a radius of "// &
                      short_number(s%round%radius(k))//' m, the largest grain a semi-axis of '// &
                      short_number(maxval(packing%axes))//' m', 'cylinder', &
                      k - s%n + deck%count('cylinder'), 'radius', 'take a wider cylinder, or '// &
                      "side = 'outside' if the grains are around it")
    end do
    grain = 2.0_wp*sum(maxval(packing%axes, 1))/packing%n
    bed = maxval(maxval(packing%x, 2) - minval(packing%x, 2)) + grain
    do k = 1, deck%count('surface')
      if (deck%given('surface', k, 'scale') .or. .not. deck%given('surface', k, 'file')) cycle
      associate (x => s%mesh%x(:, s%first_vertex(k):s%first_vertex(k + 1) - 1))
        extent = maxval(maxval(x, 2) - minval(x, 2))
      end associate
      if (extent <= too_large*bed .and. extent >= too_small*grain) cycle
      call deck%fault(errors, 'D272', 'the surface is '//short_number(extent)//' m large, the '// &
                      'bed '//short_number(bed)//' m, a grain '//short_number(grain)// &
                      ' m: is its file in another unit?', 'surface', k, 'file', &
                      'give scale = 1.0e-3 for a file in mm, or scale = 1.0 if it is meant')
    end do
  end subroutine check_units
end module dem_setup_surfaces
