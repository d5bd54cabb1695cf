!> Formulation and material data of every element, and the values at its quadrature points.
module fem_elastic
  use talus_kinds, only: wp, i4
  use fem_hourglass, only: usual_share
  use fem_layered, only: fem_layered_type
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  use fem_types, only: place_in
  implicit none
  private
  public :: fem_elastic_type, classical, polar, micromorphic

  integer(i4), parameter :: classical = 6  !! stress components at a point of a classical body
  integer(i4), parameter :: polar = 18     !! stress and couple stress, nine each
  integer(i4), parameter :: micromorphic = 45  !! Cauchy and micro-stress, nine each, couple stress

  type :: fem_elastic_type
    type(fem_formulation_type), allocatable :: rule(:)
    integer(i4), allocatable :: rule_of(:)  !! (elements)
    real(wp), allocatable :: moduli(:, :)   !! (6, elements) lambda mu kappa [Pa], alpha.. [N]
    type(fem_layered_type), allocatable :: layered(:)
    integer(i4), allocatable :: layered_of(:)  !! (elements) law of `layered`; 0: that of `moduli`
    real(wp), allocatable :: density(:)     !! (elements) [kg/m^3]
    real(wp), allocatable :: inertia(:)     !! (elements) micro-inertia j [m^2]
    real(wp), allocatable :: hourglass(:)   !! (elements) share of the hourglass control [-]
    integer(i4), allocatable :: point(:)    !! (elements + 1) first point of each element
    integer(i4) :: points = 0
    integer(i4) :: components = classical   !! of the stress at a point
    real(wp), allocatable :: factor(:)      !! (points) weight, for overlaps [-]
    real(wp), allocatable :: initial(:, :)  !! (components, points) initial stress
    logical :: has_initial = .false.
    logical, allocatable :: absent(:)       !! (elements) that a stage has removed or not yet placed
    integer(i4), allocatable :: id(:)       !! (elements) in the mesh, where ranks have some each
  contains
    procedure :: start
    procedure :: use_rule
    procedure :: number_points
    procedure :: rotations
    procedure :: number_of
    procedure :: place_of
    procedure :: is_absent
    procedure :: clear_absent
  end type fem_elastic_type

contains

  !> Allocate n elements, none with a rule yet.
  subroutine start(self, n)
    class(fem_elastic_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    allocate (self%rule(0), self%rule_of(n), self%moduli(6, n), self%density(n), self%inertia(n))
    allocate (self%layered(0))
    allocate (self%layered_of(n), source=0)
    self%rule_of = 0
    self%moduli = 0.0_wp
    self%density = 0.0_wp
    self%inertia = 0.0_wp
    allocate (self%hourglass(n), source=usual_share)
  end subroutine start

  !> Index of the rule of a name (of `rule_names`), which is made if it is new.
  subroutine use_rule(self, name, r)
    class(fem_elastic_type), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(i4), intent(out) :: r
    type(fem_formulation_type), allocatable :: longer(:)
    do r = 1, size(self%rule)
      if (self%rule(r)%name == name) return
    end do
    allocate (longer(r))
    longer(:r - 1) = self%rule
    call make_rule(rule_index(name), longer(r))
    call move_alloc(longer, self%rule)
  end subroutine use_rule

  !> Count the quadrature points once every element has its rule; all weigh one.
  subroutine number_points(self)
    class(fem_elastic_type), intent(inout) :: self
    integer(i4) :: e
    allocate (self%point(size(self%rule_of) + 1))
    self%point(1) = 1
    do e = 1, size(self%rule_of)
      self%point(e + 1) = self%point(e) + self%rule(self%rule_of(e))%at%n
      if (self%rule(self%rule_of(e))%polar) self%components = polar
    end do
    self%points = self%point(size(self%point)) - 1
    allocate (self%factor(self%points), source=1.0_wp)
  end subroutine number_points

  !> Nodes with micro-rotation of every element.
  pure function rotations(self) result(n)
    class(fem_elastic_type), intent(in) :: self
    integer(i4) :: n(size(self%rule_of))
    integer(i4) :: e
    do e = 1, size(n)
      n(e) = self%rule(self%rule_of(e))%rotations
    end do
  end function rotations

  !> Number of element e in the mesh of the file.
  pure integer(i4) function number_of(self, e)
    class(fem_elastic_type), intent(in) :: self
    integer(i4), intent(in) :: e
    number_of = e
    if (allocated(self%id) .and. e > 0) number_of = self%id(e)
  end function number_of

  !> Number here of the element with a number in the mesh of the file, 0 if another rank has it.
  pure integer(i4) function place_of(self, number)
    class(fem_elastic_type), intent(in) :: self
    integer(i4), intent(in) :: number
    place_of = number
    if (allocated(self%id)) place_of = place_in(self%id, number)
  end function place_of

  !> Has a stage removed element e, or not yet placed it?
  pure logical function is_absent(self, e)
    class(fem_elastic_type), intent(in) :: self
    integer(i4), intent(in) :: e
    is_absent = .false.
    if (allocated(self%absent)) is_absent = self%absent(e)
  end function is_absent

  !> No stress in elements that are absent.
  pure subroutine clear_absent(self, stress)
    class(fem_elastic_type), intent(in) :: self
    real(wp), intent(inout) :: stress(:, :)  !! (components, points)
    integer(i4) :: e
    do e = 1, size(self%rule_of)
      if (self%is_absent(e)) stress(:, self%point(e):self%point(e + 1) - 1) = 0.0_wp
    end do
  end subroutine clear_absent
end module fem_elastic
