!> Field output: grains (and contacts, on request) step by step in HDF5, described in XDMF.
module dem_fields
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_hdf5, only: h5_file_type
  use talus_series, only: series_type
  use talus_xdmf, only: xdmf_type, xdmf_node, xdmf_cell
  use dem_surface_output, only: surface_mesh_sizes, put_surface_mesh
  use dem_system, only: dem_system_type, dem_contacts_type
  use dem_breakage, only: generation_of
  use dem_clump_file, only: clump_frames
  use dem_measure, only: coordination_of
  use dem_packing, only: put_shapes
  use dem_slabs, only: dem_slab_type, slab_grains
  use dem_feature_state, only: feature_vertex
  use dem_state, only: dem_grains_type, kind_free, kind_member
  use dem_wear_output, only: put_wear
  implicit none
  private
  public :: dem_fields_type

  character(len=*), parameter :: format_name = 'talus-grains'
  integer(i8), parameter :: whole_arrays(2) = [0_i8, -1_i8]  !! no slab

  type :: dem_fields_type
    logical :: contacts = .false.     !! write contacts too
    logical :: generations = .false.  !! grains break
    logical :: heat = .false.         !! grains have temperatures
    logical :: opened = .false.
    real(wp) :: last_time = -1.0_wp   !! of the last step written [s]
    type(series_type) :: series
    type(xdmf_type) :: xdmf
    type(xdmf_type) :: surfaces       !! described beside the grains
    logical :: described = .false.
    character(len=:), allocatable :: stem
  contains
    procedure :: open => open_fields
    procedure :: write => write_fields
  end type dem_fields_type

contains

  !> Create the file, or continue it after a restart at time >= 0; note describes repairs.
  subroutine open_fields(self, stem, time, note, errors)
    class(dem_fields_type), intent(inout) :: self
    character(len=*), intent(in) :: stem
    real(wp), intent(in) :: time  !! of the checkpoint [s]; < 0: a fresh run
    character(len=:), allocatable, intent(out) :: note
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    logical :: found
    integer(i4) :: before

    before = errors%count
    found = .false.
    note = ''
    if (time >= 0.0_wp) then
      call self%series%resume(stem//'.h5', format_name, time, found, errors)
      note = self%series%note
      if (found .and. self%series%count > 0) &
        self%last_time = self%series%step(self%series%count)%time
    end if
    if (errors%count == before .and. .not. found) then
      call self%series%start(stem//'.h5', format_name, file, errors)
      call file%commit(errors)
    end if
    call describe(self%xdmf, stem)
    if (self%generations) &
      call self%xdmf%attribute('generation', 'grains/generation', xdmf_node, 1, 'int4')
    if (self%heat) call self%xdmf%attribute('temperature', 'grains/temperature', xdmf_node, 1)
    self%stem = stem
    self%opened = errors%count == before
  end subroutine open_fields

  subroutine describe(xdmf, stem)
    type(xdmf_type), intent(inout) :: xdmf
    character(len=*), intent(in) :: stem
    call xdmf%describe_points(stem//'.xdmf', 'grains/x')
    call xdmf%attribute('id', 'grains/id', xdmf_node, 1, 'int8')
    call xdmf%attribute('kind', 'grains/kind', xdmf_node, 1, 'int4')
    call xdmf%attribute('coordination', 'grains/coordination', xdmf_node, 1, 'int4')
    call xdmf%attribute('quat', 'grains/quat', xdmf_node, 4)
    call xdmf%attribute('axes', 'grains/axes', xdmf_node, 3)
    call xdmf%attribute('v', 'grains/v', xdmf_node, 3)
    call xdmf%attribute('omega', 'grains/omega', xdmf_node, 3)
    call xdmf%attribute('force', 'grains/force', xdmf_node, 3)
    call xdmf%attribute('moment', 'grains/moment', xdmf_node, 3)
  end subroutine describe

  !> One more step; a time that was just written is not written twice.
  subroutine write_fields(self, time, system, errors)
    class(dem_fields_type), intent(inout) :: self
    real(wp), intent(in) :: time  !! s
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    type(h5_file_type) :: file
    character(len=:), allocatable :: group

    if (.not. self%opened .or. .not. time > self%last_time) return
    call self%series%begin_step(time, file, group, errors)
    call file%group(group//'/grains', errors)
    if (system%owner_changed() .and. system%grains%n > 0) then
      call put_slabs(file, group//'/grains', system, errors)
    else
      call put_grains(file, group//'/grains', system%grains, &
                      int(coordination_of(system%dem_data_type), i4), errors)
    end if
    if (self%generations) call file%put(group//'/grains/generation', generation_of( &
      system%dem_data_type, system%grains%id), errors)
    if (system%heat%active) call file%put(group//'/grains/temperature', system%heat%temperature, &
                                          errors)
    if (system%cell%active) then
      call file%group(group//'/cell', errors)
      call file%put(group//'/cell/vectors', system%cell%vectors, errors)
      call file%put(group//'/cell/origin', system%cell%origin, errors)
      call file%put(group//'/cell/rate', transpose(system%cell%rate), errors)
      call file%put(group//'/cell/periodic', merge(1_i4, 0_i4, system%cell%periodic), errors)
    end if
    if (system%surfaces%n > 0) call put_surface_mesh(file, group//'/surfaces', system%surfaces, &
      errors)
    if (system%surfaces%n > 0 .and. system%wear%active) &
      call put_wear(file, group//'/surfaces', system%dem_data_type, errors)
    if (self%contacts) call put_contacts(file, group//'/contacts', system, errors)
    if (system%clumps%n > 0) call put_moving_clumps(file, group//'/clumps', system, errors)
    call self%series%end_step(int(system%grains%n, i8), file, errors)
    call self%xdmf%write(self%series, errors)
    if (system%surfaces%n > 0) call describe_surfaces(self, system, errors)
    self%last_time = time
  end subroutine write_fields

  !> <stem>_surfaces.xdmf: the same triangles in every step.
  subroutine describe_surfaces(self, system, errors)
    class(dem_fields_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: points, triangles
    if (.not. self%described) then
      self%described = .true.
      call surface_mesh_sizes(system%surfaces, points, triangles)
      call self%surfaces%describe_mesh(self%stem//'_surfaces.xdmf', 'surfaces/x', 'Triangle', &
                                       'surfaces/triangles', [int(triangles, i8), 3_i8], &
                                       int(points, i8), int(triangles, i8))
      call self%surfaces%attribute('surface', 'surfaces/surface', xdmf_cell, 1, 'int4')
      if (system%wear%active) then
        call self%surfaces%attribute('wear', 'surfaces/wear', xdmf_cell, 1)
        call self%surfaces%attribute('wear_depth', 'surfaces/wear_depth', xdmf_cell, 1)
      end if
    end if
    call self%surfaces%write(self%series, errors)
  end subroutine describe_surfaces

  !> Grains, all or a slab of them.
  subroutine put_grains(file, group, g, coordination, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_grains_type), intent(in) :: g
    integer(i4), intent(in) :: coordination(:)
    type(error_list_type), intent(inout) :: errors
    call file%put(group//'/id', g%id, errors)
    call file%put(group//'/kind', merge(kind_free, g%kind, g%kind == kind_member), errors)
    call file%put(group//'/coordination', coordination, errors)
    call file%put(group//'/x', g%x, errors)
    call put_shapes(file, group, g, errors)
    call file%put(group//'/v', g%v, errors)
    call file%put(group//'/omega', g%omega, errors)
    call file%put(group//'/force', g%force, errors)
    call file%put(group//'/moment', g%moment, errors)
  end subroutine put_grains

  !> Clumps: centre of mass, orientation of the template, motion and loads; of polyhedra how many
  !! rows of grains are theirs, and how many of these, the first ones, vertices.
  subroutine put_moving_clumps(file, group, system, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    associate (g => system%clumps%grains)
      call file%group(group, errors)
      call file%put(group//'/first', g%id, errors)
      call file%put(group//'/mass', g%mass, errors)
      call file%put(group//'/inertia', g%inertia, errors)
      call file%put(group//'/x', g%x, errors)
      call file%put(group//'/quat', clump_frames(system%clumps), errors)
      call file%put(group//'/principal', g%quat, errors)
      call file%put(group//'/v', g%v, errors)
      call file%put(group//'/omega', g%omega, errors)
      call file%put(group//'/force', g%force, errors)
      call file%put(group//'/moment', g%moment, errors)
    end associate
    if (.not. allocated(system%pairs%features)) return
    associate (c => system%clumps)
      call file%put(group//'/members', c%last - c%first + 1_i4, errors)
      call file%put(group//'/vertices', [(count(system%pairs%features%kind(c%first(k):c%last(k)) &
                                          == feature_vertex, kind=i4), k=1, c%n)], errors)
    end associate
  end subroutine put_moving_clumps

  !> Grains of all ranks, slab by slab.
  subroutine put_slabs(file, group, system, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    type(dem_slab_type) :: slab
    integer(i4) :: low, high
    do low = 1, system%grains%n, slab_grains
      high = min(low + slab_grains - 1, system%grains%n)
      call system%rank_team%some_grains(system%grains%id(low:high), slab)
      file%slab = [low - 1, system%grains%n]
      call put_grains(file, group, slab%some%grains, slab%coordination, errors)
    end do
    file%slab = whole_arrays
  end subroutine put_slabs

  subroutine put_contacts(file, group, system, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_system_type), intent(inout) :: system
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type) :: list
    integer(i4) :: low, planes
    integer(i8) :: done

    call file%group(group, errors)
    if (.not. system%owner_changed()) then
      call system%contacts(list)
      call put_list(file, group, list, errors)
      return
    end if
    call system%refresh_ledger()
    done = 0
    do low = 1, system%grains%n, slab_grains
      associate (id => system%grains%id)
        call put_some(id(low), id(min(low + slab_grains - 1, system%grains%n)))
      end associate
    end do
    planes = system%planes%n
    if (planes > 0) call put_some(-int(planes, i8), -1_i8)
    if (system%surfaces%n > 0) &
      call put_some(-int(planes + system%surfaces%n, i8), -int(planes + 1, i8))
    file%slab = whole_arrays

  contains

    subroutine put_some(first, last)
      integer(i8), intent(in) :: first, last
      call system%rank_team%some_contacts(first, last, list)
      file%slab = [done, system%contact_number()]
      call put_list(file, group, list, errors)
      done = done + list%n
    end subroutine put_some
  end subroutine put_contacts

  subroutine put_list(file, group, list, errors)
    type(h5_file_type), intent(inout) :: file
    character(len=*), intent(in) :: group
    type(dem_contacts_type), intent(in) :: list
    type(error_list_type), intent(inout) :: errors
    call file%put(group//'/ids', list%ids(:, :list%n), errors)
    call file%put(group//'/point', list%point(:, :list%n), errors)
    call file%put(group//'/normal', list%normal(:, :list%n), errors)
    call file%put(group//'/force', list%force(:, :list%n), errors)
    call file%put(group//'/stiffness', list%stiffness(:, :list%n), errors)
    call file%put(group//'/overlap', list%overlap(:list%n), errors)
  end subroutine put_list
end module dem_fields
