!> Clumps of the packing: what they do not go with, their mass, and their members. Faults D395 to
!! D398, I283.
module dem_setup_clumps
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use dem_clump_file, only: packed_clumps_type
  use dem_clumps, only: ready_clumps, place_members, set_lightness
  use dem_ellipsoid, only: rotation_of, quaternion_product
  use dem_make, only: allocate_grains
  use dem_packing, only: dem_packing_type
  use dem_state, only: dem_data_type, dem_grains_type, kind_free, kind_member, body_size
  use dem_polyhedron, only: polyhedron_type, mass_of_polyhedron
  use dem_setup_polyhedra, only: read_polyhedra, make_features
  use dem_union, only: union_mass_type, mass_of_union, principal_frame
  implicit none
  private
  public :: mark_members, make_clumps, refuse_clumps

  character(len=*), parameter :: others(16) = [character(len=15) :: 'bond', 'breakage', 'source', &
    'sink', 'window', 'tile', 'surcharge', 'pore_grid', 'membrane', 'body', 'heat', 'wear', &
    'probe', 'grading', 'measure', 'grid']

contains

  !> Rows of the packing that are members of clumps get their kind; all others that claim to be are
  !! refused (I283).
  subroutine mark_members(packing, path, errors)
    type(dem_packing_type), intent(inout) :: packing
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    integer(i8) :: id
    real(wp) :: radius
    integer(i4) :: k, m, row, low
    real(wp), parameter :: part = 1.0e-6_wp
    integer(i4), allocatable :: at(:)

    if (any(packing%kind == kind_member)) then
      call errors%add('I283', "'"//path//"' has a grain of kind "//str(kind_member), path, &
                      'members of clumps are free grains, kind 0')
      return
    end if
    if (packing%clumps%n == 0) return
    allocate (at(maxval(packing%id)), source=0_i4)
    at(packing%id) = [(k, k=1, packing%n)]
    do k = 1, packing%clumps%n
      low = sum(packing%clumps%spheres(:packing%clumps%template(k) - 1))
      do m = 1, packing%clumps%spheres(packing%clumps%template(k))
        id = packing%clumps%first(k) + m - 1
        row = 0
        if (id >= 1 .and. id <= size(at)) row = at(id)
        radius = packing%clumps%scale(k)*packing%clumps%radius(low + m)
        if (row > 0) then
          if (packing%kind(row) /= kind_free .or. packing%exponent(row) > 2.0_wp .or. any( &
            abs(packing%axes(:, row) - radius) > part*radius)) row = 0
        end if
        if (row == 0) then
          call errors%add('I283', 'clump '//str(k)//": its member, grain "//str(id)// &
                          ', is not there or no free sphere of its radius', path, &
                          'members have ids that follow each other, from /clumps/first on')
          return
        end if
        packing%kind(row) = kind_member
      end do
    end do
  end subroutine mark_members

  !> What clumps do not go with (D395, D396, D397).
  subroutine refuse_clumps(deck, d, served, ranks, adaptive, errors)
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    logical, intent(in) :: served, adaptive
    integer(i4), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: bodies
    integer :: k

    if (d%clumps%n == 0) return
    bodies = 'clumps'
    if (allocated(d%pairs%features)) bodies = 'polyhedra'
    do k = 1, size(others)
      if (deck%count(trim(others(k))) > 0) call deck%fault(errors, 'D395', &
        bodies//' do not go with &'//trim(others(k)), trim(others(k)), 1, '', &
        'leave the group out, or take a packing without '//bodies)
    end do
    if (adaptive) call deck%fault(errors, 'D395', bodies//' do not go with adaptive '// &
                                  'damping', 'relaxation', 1, 'damping', 'give a damping')
    if (served) call deck%fault(errors, 'D396', bodies//' are not carried under a partner', &
                                'particles', 1, 'file', 'run talus-dem alone')
    if (ranks > 1) call deck%fault(errors, 'D397', bodies//' are moved on one rank', 'particles', &
                                   1, 'file', 'run with threads')
  end subroutine refuse_clumps

  !> Clumps from those of the packing; grains have been made, members as spheres of their own.
  subroutine make_clumps(packed, d, path, errors)
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(inout) :: d
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(union_mass_type), allocatable :: mass(:)
    real(wp) :: body(body_size, d%grains%n)
    integer(i4) :: k

    if (packed%n == 0) return
    call weigh_templates(packed, mass, path, errors)
    if (errors%any()) return
    call allocate_clumps(packed, d)
    do k = 1, packed%n
      call find_members(packed, d, k, errors)
      if (errors%any()) return
      call make_clump(packed, mass(packed%template(k)), d, k)
    end do
    call ready_clumps(d%clumps, d%grains)
    call set_lightness(d%clumps)
    call make_features(packed, d)
    do k = 1, packed%n
      call compare_members(d, packed%first(k), k, path, errors)
      call place_members(d%clumps, d%grains, body, k)
    end do
  end subroutine make_clumps

  !> Mass properties of all templates, as given, of the rounded polyhedron or of the union of their
  !! spheres.
  subroutine weigh_templates(packed, mass, path, errors)
    type(packed_clumps_type), intent(in) :: packed
    type(union_mass_type), allocatable, intent(out) :: mass(:)
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(polyhedron_type), allocatable :: shape(:)
    integer(i4) :: t, low, high

    call read_polyhedra(packed, shape, path, errors)
    if (errors%any()) return
    allocate (mass(size(packed%spheres)))
    high = 0
    do t = 1, size(packed%spheres)
      low = high + 1
      high = high + packed%spheres(t)
      if (allocated(packed%volume)) then
        mass(t)%volume = packed%volume(t)
        mass(t)%centre = packed%middle(:, t)
        mass(t)%inertia = packed%inertia(:, t)
      else if (allocated(shape(t)%x)) then
        mass(t) = mass_of_polyhedron(shape(t))
      else
        mass(t) = mass_of_union(packed%centre(:, low:high), packed%radius(low:high))
      end if
    end do
  end subroutine weigh_templates

  subroutine allocate_clumps(packed, d)
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(inout) :: d
    associate (c => d%clumps, n => packed%n)
      c%n = n
      allocate (c%grains, c%pairs)
      c%grains%n = n
      call allocate_grains(c%grains, .false.)
      allocate (c%first(n), c%last(n), source=0_i4)
      allocate (c%place(3, d%grains%n), c%arm(3, d%grains%n), source=0.0_wp)
      allocate (c%lightness(d%grains%n), source=1.0_wp)
      allocate (c%frame(4, n), c%origin(3, n), source=0.0_wp)
      c%template = packed%template
      c%scale = packed%scale
      allocate (d%grains%clump(d%grains%n), source=0_i4)
    end associate
  end subroutine allocate_clumps

  !> Indices of the members of clump k; they have one material (D398).
  subroutine find_members(packed, d, k, errors)
    type(packed_clumps_type), intent(in) :: packed
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: k
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: low, high

    low = 1
    high = d%grains%n
    do while (low < high)
      if (d%grains%id((low + high)/2) < packed%first(k)) then
        low = (low + high)/2 + 1
      else
        high = (low + high)/2
      end if
    end do
    d%clumps%first(k) = low
    d%clumps%last(k) = low + packed%spheres(packed%template(k)) - 1
    associate (members => d%grains%material(low:d%clumps%last(k)))
      if (any(members /= members(1))) call errors%add('D398', 'the members of the clump that '// &
        'begins with grain '//str(packed%first(k))//' have different materials', &
        hint='&grains must name whole clumps')
    end associate
    d%grains%clump(low:d%clumps%last(k)) = k
  end subroutine find_members

  !> Mass, frame and motion of clump k, and the places of its members.
  subroutine make_clump(packed, mass, d, k)
    type(packed_clumps_type), intent(in) :: packed
    type(union_mass_type), intent(in) :: mass
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: k
    real(wp) :: moment(3), turn(4), rotation(3, 3), s, density
    integer(i4) :: low, m, i

    s = packed%scale(k)
    density = d%materials(d%grains%material(d%clumps%first(k)))%density
    call principal_frame(mass%inertia, moment, turn)
    associate (g => d%clumps%grains)
      g%id(k) = packed%first(k)
      g%material(k) = d%grains%material(d%clumps%first(k))
      g%mass(k) = density*mass%volume*s**3
      g%inertia(:, k) = density*moment*s**5
      g%quat(:, k) = quaternion_product(packed%quat(:, k), turn)
      g%quat(:, k) = g%quat(:, k)/sqrt(sum(g%quat(:, k)**2))
      g%x(:, k) = packed%x(:, k) + matmul(rotation_of(packed%quat(:, k)), s*mass%centre)
      g%v(:, k) = packed%v(:, k)
      g%omega(:, k) = packed%omega(:, k)
      rotation = transpose(rotation_of(turn))
      d%clumps%frame(:, k) = [turn(1), -turn(2:4)]
      d%clumps%origin(:, k) = -matmul(rotation, s*mass%centre)
      if (packed%spheres(packed%template(k)) == 1 .and. .not. allocated(packed%volume)) then
        g%mass(k) = d%grains%mass(d%clumps%first(k))
        g%inertia(:, k) = d%grains%inertia(:, d%clumps%first(k))
      end if
      low = sum(packed%spheres(:packed%template(k) - 1))
      do m = 1, packed%spheres(packed%template(k))
        i = d%clumps%first(k) + m - 1
        d%clumps%place(:, i) = matmul(rotation, s*(packed%centre(:, low + m) - mass%centre))
        call weigh_member(d%grains, g, i, k, s*packed%radius(low + m))
      end do
      g%axes(:, k) = maxval(d%grains%radius(d%clumps%first(k):d%clumps%last(k)))
      g%radius(k) = g%axes(1, k)
    end associate
  end subroutine make_clump

  !> A member has the mass of its clump, for its contacts, and the size of its sphere.
  subroutine weigh_member(grains, clumps, i, k, radius)
    type(dem_grains_type), intent(inout) :: grains
    type(dem_grains_type), intent(in) :: clumps
    integer(i4), intent(in) :: i, k
    real(wp), intent(in) :: radius
    grains%mass(i) = clumps%mass(k)
    grains%inertia(:, i) = minval(clumps%inertia(:, k))
    grains%axes(:, i) = radius
    grains%radius(i) = radius
  end subroutine weigh_member

  !> Are the members where the file has them, to a part of their size (I283)?
  subroutine compare_members(d, first, k, path, errors)
    type(dem_data_type), intent(in) :: d
    integer(i8), intent(in) :: first
    integer(i4), intent(in) :: k
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    real(wp), parameter :: part = 1.0e-6_wp
    integer(i4) :: i
    do i = d%clumps%first(k), d%clumps%last(k)
      if (norm2(d%clumps%grains%x(:, k) + d%clumps%arm(:, i) - d%grains%x(:, i)) &
          <= part*(d%grains%radius(i) + norm2(d%clumps%arm(:, i)))) cycle
      call errors%add('I283', 'grain '//str(d%grains%id(i))//' is not where the clump that '// &
                      'begins with grain '//str(first)//' has it', path, &
                      '/grains/x and /clumps must agree: make the packing again')
      return
    end do
  end subroutine compare_members
end module dem_setup_clumps
