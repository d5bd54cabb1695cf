!> One source of grains, as the deck describes it: which grains, where, when, how many. What sources
!! do is in dem_sources. Faults D294 to D296, D478 (dem_size_law).
module dem_source
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_random, only: uniform
  use talus_region, only: region_type, region_box, region_cylinder
  use talus_region_deck, only: read_region
  use talus_text, only: str
  use dem_make, only: make_grains, sorted_order
  use dem_packing, only: dem_packing_type, read_packing
  use dem_shape_make, only: make_shapes
  use dem_size_law, only: size_law_type, read_size_law, by_law
  use dem_state, only: dem_grains_type, dem_material_type
  implicit none
  private
  public :: source_type, read_source

  real(wp), parameter :: pi = acos(-1.0_wp)
  integer(i8), parameter :: which = 1, how_large = 2  !! what a random number is for

  !> Grains to draw from, and their way into the run.
  type :: source_type
    character(len=:), allocatable :: id
    integer(i4) :: material = 0
    logical :: whole = .false.               !! the packing enters as it is, not grain by grain
    type(dem_packing_type) :: packing        !! grains to draw from; none: by semi_axes
    real(wp) :: semi_axes(3) = 0.0_wp        !! [m]
    real(wp) :: scatter = 0.0_wp             !! of the size, uniform [-]
    type(size_law_type) :: law               !! of sizes, in place of scatter
    logical :: turned = .true.               !! orientations are random
    type(region_type) :: region              !! bounding spheres lie in it
    real(wp) :: shift(3) = 0.0_wp            !! of a whole packing [m]
    real(wp) :: velocity(3) = 0.0_wp         !! [m/s]
    real(wp) :: spin(3) = 0.0_wp             !! [rad/s]
    real(wp) :: mass_rate = 0.0_wp           !! [kg/s]; 0: by number
    real(wp) :: number_rate = 0.0_wp         !! [1/s]
    real(wp) :: most_mass = huge(1.0_wp)     !! [kg]
    real(wp) :: most_grains = huge(1.0_wp)
    real(wp) :: begin = 0.0_wp               !! [s]
    real(wp) :: end = huge(1.0_wp)           !! [s]
    real(wp) :: every = 0.0_wp               !! [s]
    integer(i4) :: tries = 0                 !! places tried for a grain
    integer(i8) :: seed = 1
    real(wp), allocatable :: mass(:)         !! of each grain to draw from [kg]
    real(wp), allocatable :: radius(:)       !! of its bounding sphere [m]
  contains
    procedure :: row_of
    procedure :: size_of
    procedure :: opening
    procedure :: least_axis
    procedure :: largest_radius
    procedure :: shaped
  end type source_type

contains

  !> The k-th &source, whose material is known.
  subroutine read_source(deck, k, materials, source, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_material_type), intent(in) :: materials(:)
    type(source_type), intent(inout) :: source
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    integer(i4) :: seed, most, before

    before = errors%count
    call deck%get('source', k, 'id', source%id)
    call deck%get('source', k, 'placement', text)
    source%whole = text == 'packing'
    call deck%get('source', k, 'turn', text)
    source%turned = text == 'random'
    call get_three(deck, k, 'velocity', source%velocity)
    call get_three(deck, k, 'spin', source%spin)
    call deck%get('source', k, 'start', source%begin)
    if (deck%given('source', k, 'stop')) call deck%get('source', k, 'stop', source%end)
    call deck%get('source', k, 'every_time', source%every)
    call deck%get('source', k, 'tries', source%tries)
    call deck%get('source', k, 'seed', seed)
    source%seed = seed
    if (deck%given('source', k, 'mass')) call deck%get('source', k, 'mass', source%most_mass)
    if (deck%given('source', k, 'grains')) then
      call deck%get('source', k, 'grains', most)
      source%most_grains = most
    end if
    call read_grains(deck, k, source, errors)
    if (errors%count > before .or. source%material == 0) return
    call weigh_grains(source, materials, errors)
    if (errors%count > before) return
    if (source%whole) then
      call get_three(deck, k, 'shift', source%shift)
    else
      call read_place(deck, k, source, errors)
    end if
  end subroutine read_source

  !> From a packing or by their semi-axes (D294).
  subroutine read_grains(deck, k, source, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(source_type), intent(inout) :: source
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: axes(:)

    if (deck%given('source', k, 'file')) then
      call read_packing(source%packing, deck%path('source', k, 'file'), errors)
      return
    end if
    call deck%get('source', k, 'semi_axes', axes)
    call deck%get('source', k, 'scatter', source%scatter)
    if (all(size(axes) /= [1, 3])) then
      call deck%fault(errors, 'D294', "source '"//source%id//"' has "//str(size(axes))// &
                      ' semi-axes', 'source', k, 'semi_axes', &
                      'a sphere has one radius, an ellipsoid three semi-axes')
      return
    end if
    source%semi_axes = axes(1)
    if (size(axes) == 3) source%semi_axes = axes
    call read_size_law(deck, k, source%law, errors)
  end subroutine read_grains

  !> Masses and bounding spheres of the grains to draw from; faults of what a packing holds are
  !! those of dem_make.
  subroutine weigh_grains(source, materials, errors)
    type(source_type), intent(inout) :: source
    type(dem_material_type), intent(in) :: materials(:)
    type(error_list_type), intent(inout) :: errors
    type(dem_grains_type) :: grains
    integer(i4), allocatable :: order(:), same(:)
    integer(i8), allocatable :: id(:)
    integer(i4) :: i

    associate (p => source%packing)
      if (p%n == 0) then
        source%radius = [maxval(source%semi_axes)]
        source%mass = [materials(source%material)%density*4.0_wp/3.0_wp*pi &
                       *product(source%semi_axes)]
        return
      end if
      allocate (same(p%n), source=source%material)
      call make_grains(grains, materials, p%id, 0*same, same, p%x, p%quat, p%axes, p%v, p%omega, &
                       errors)
      if (errors%any()) return
      call make_shapes(grains, materials, p%id, p%skew, p%exponent, errors)
      if (errors%any()) return
      id = p%id
      order = sorted_order(id)
    end associate
    allocate (source%mass(grains%n), source%radius(grains%n))
    do i = 1, grains%n
      source%mass(order(i)) = grains%mass(i)
      source%radius(order(i)) = grains%radius(i)
    end do
  end subroutine weigh_grains

  !> Rate and region of grains that enter one by one (D295, D296).
  subroutine read_place(deck, k, source, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(source_type), intent(inout) :: source
    type(error_list_type), intent(inout) :: errors
    real(wp) :: room
    integer(i4) :: before

    call deck%get('source', k, 'mass_rate', source%mass_rate)
    call deck%get('source', k, 'number_rate', source%number_rate)
    if ((source%mass_rate > 0.0_wp) .eqv. (source%number_rate > 0.0_wp)) &
      call deck%fault(errors, 'D295', "source '"//source%id//"' needs one rate", 'source', k, '', &
                      'give either mass_rate in kg/s or number_rate in 1/s')
    before = errors%count
    call read_region(deck, 'source', k, 'D261', source%region, errors)
    if (errors%count > before) return
    associate (r => source%region)
      if (r%kind == region_box) then
        room = minval(r%upper - r%lower)
      else if (r%kind == region_cylinder) then
        room = min(2.0_wp*r%radius, r%length)
      else
        room = 2.0_wp*r%radius
      end if
    end associate
    if (room > 2.0_wp*source%largest_radius()) return
    call deck%fault(errors, 'D296', "source '"//source%id//"' has no room for its largest "// &
                    'grain: '//str(room)//' m for '//str(2.0_wp*source%largest_radius())//' m', &
                    'source', k, 'region', 'a region that is wider than the grains in every '// &
                    'direction: bounding spheres lie in it as a whole')
  end subroutine read_place

  subroutine get_three(deck, k, key, value)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: key
    integer(i4), intent(in) :: k
    real(wp), intent(out) :: value(3)
    real(wp), allocatable :: list(:)
    call deck%get('source', k, key, list)
    value = list
  end subroutine get_three

  !> Row of the packing that the n-th grain copies; 0: it is made by semi-axes.
  pure integer(i4) function row_of(self, n) result(row)
    class(source_type), intent(in) :: self
    integer(i8), intent(in) :: n
    row = 0
    if (self%packing%n > 0) row = 1 + min(self%packing%n - 1, &
                                          int(self%packing%n*uniform([self%seed, which, n]), i4))
  end function row_of

  !> Size of the n-th grain over that of the deck or the packing [-].
  pure real(wp) function size_of(self, n) result(scale)
    class(source_type), intent(in) :: self
    integer(i8), intent(in) :: n
    scale = uniform([self%seed, how_large, n])
    if (allocated(self%law%edge)) then
      scale = by_law(self%law, scale)/self%opening()
    else
      scale = 1.0_wp + self%scatter*(2.0_wp*scale - 1.0_wp)
    end if
  end function size_of

  !> Sieve that a grain of its semi-axes just passes: twice the middle one [m].
  pure real(wp) function opening(self)
    class(source_type), intent(in) :: self
    opening = 2.0_wp*(sum(self%semi_axes) - minval(self%semi_axes) - maxval(self%semi_axes))
  end function opening

  !> Least semi-axis of any of its grains [m].
  pure real(wp) function least_axis(self)
    class(source_type), intent(in) :: self
    least_axis = (1.0_wp - self%scatter)*minval(self%semi_axes)
    if (allocated(self%law%edge)) &
      least_axis = self%law%edge(1)/self%opening()*minval(self%semi_axes)
    if (self%packing%n > 0) least_axis = minval(self%packing%axes)
  end function least_axis

  !> Bounding sphere of the largest of them [m].
  pure real(wp) function largest_radius(self) result(radius)
    class(source_type), intent(in) :: self
    radius = (1.0_wp + self%scatter)*maxval(self%radius)
    if (allocated(self%law%edge)) &
      radius = self%law%edge(size(self%law%edge))/self%opening()*maxval(self%radius)
  end function largest_radius

  !> Is any of its grains no ellipsoid?
  pure logical function shaped(self)
    class(source_type), intent(in) :: self
    shaped = .false.
    if (self%packing%n > 0) shaped = any(self%packing%exponent > 2.0_wp) .or. &
      any(abs(self%packing%skew) > 0.0_wp)
  end function shaped
end module dem_source
