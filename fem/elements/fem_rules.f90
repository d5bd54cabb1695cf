!> Element formulations: which shape functions displacement and micro-rotation have, and at which
!! points they are integrated. Shape functions are evaluated once, here.
module fem_rules
  use talus_kinds, only: wp, i4
  use fem_quadrature, only: quadrature_rule
  use fem_shape, only: shape_functions, corner_kind, node_count, reference_nodes, hex8, hex20, &
    hex27, tet4, tet10, wedge6
  implicit none
  private
  public :: fem_formulation_type, fem_points_type, make_rule, rule_index, kind_of_rule, usual_rule
  public :: polar_rule, rules_for

  integer(i4), parameter :: name_size = 18
  character(len=name_size), parameter :: rule_names(16) = [character(len=name_size) :: &
    'hex8_bbar', 'hex8_full', 'hex8_incompatible', 'hex8_one_point', 'hex20', 'hex27', &
    'hex27_bbar', 'tet4', &
    'tet10', 'wedge6', 'hex8/hex8', &
    'hex20/hex8', 'hex27/hex8', 'hex20/hex20', 'tet4/tet4', 'tet10/tet4']
  integer(i4), parameter :: kind_u(16) = [hex8, hex8, hex8, hex8, hex20, hex27, &
    hex27, tet4, tet10, wedge6, hex8, hex20, hex27, hex20, &
    tet4, tet10]
  integer(i4), parameter :: kind_phi(16) = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, hex8, hex8, &
    hex8, hex20, tet4, tet4]
  !> Degree of the polynomials that the stiffness, and the mass, integrate exactly on undistorted
  !! elements; for hexahedra 3 means two points and 5 three points a direction.
  integer(i4), parameter :: degree(16) = [3, 3, 3, 1, 5, 5, 5, 1, 2, 2, 3, 5, 5, 5, 2, 2]
  integer(i4), parameter :: mass_degree(16) = [3, 3, 3, 3, 5, 5, 5, 2, 4, 2, 3, 5, 5, 5, 2, 4]

  !> Shape functions of both fields at quadrature points.
  type :: fem_points_type
    integer(i4) :: n = 0
    real(wp), allocatable :: weight(:)         !! (n) [-]
    real(wp), allocatable :: u(:, :)           !! (nodes, n)
    real(wp), allocatable :: u_slope(:, :, :)  !! (3, nodes, n) by natural coordinates
    real(wp), allocatable :: phi(:, :)         !! (rotations, n)
    real(wp), allocatable :: phi_slope(:, :, :)
    real(wp), allocatable :: corner(:, :)      !! (corners, n) of the corner element
    real(wp), allocatable :: corner_slope(:, :, :)  !! (3, corners, n) by natural coordinates
    real(wp), allocatable :: fine_slope(:, :, :)  !! (3, nodes, points) for mean gradients
  end type fem_points_type

  type :: fem_formulation_type
    character(len=name_size) :: name = ''
    integer(i4) :: kind = 0, nodes = 0, rotations = 0, corners = 0
    logical :: one_point = .false.  !! mean gradients, hourglass modes by an elastic stiffness
    integer(i4) :: modes = 0    !! incompatible modes 1 - xi_i^2, condensed in the element
    logical :: polar = .false.
    logical :: brick = .false.  !! hex8 by its own routines
    logical :: bbar = .false.   !! volumetric strain by its fit in the element: the mean, or if ...
    logical :: linear_volume = .false.  !! ... linear in space
    logical :: hrz = .false.    !! lumped mass by scaling the diagonal, else by row sums
    type(fem_points_type) :: at       !! for stiffness and stress
    type(fem_points_type) :: mass_at  !! for mass and body forces
    real(wp), allocatable :: spread(:, :)  !! (corners, n) least squares from points to corners
    real(wp), allocatable :: middle(:, :)  !! (corners, nodes) corner functions at the nodes
    real(wp), allocatable :: mode_slope(:, :)    !! (modes, n) d(1 - xi_i^2)/dxi_i
    real(wp), allocatable :: centre_slope(:, :)  !! (3, nodes) of the u functions at the centre
  end type fem_formulation_type

contains

  !> Place of a formulation in `rule_names`, 0 if there is none of that name.
  pure integer(i4) function rule_index(name)
    character(len=*), intent(in) :: name
    rule_index = int(findloc(rule_names, name, 1), i4)
  end function rule_index

  !> Kind of the cells that a formulation is for.
  pure integer(i4) function kind_of_rule(name)
    character(len=*), intent(in) :: name
    kind_of_rule = kind_u(rule_index(name))
  end function kind_of_rule

  !> Does the formulation have micro-rotations?
  pure logical function polar_rule(name)
    character(len=*), intent(in) :: name
    polar_rule = kind_phi(rule_index(name)) > 0
  end function polar_rule

  !> The formulation for cells of a kind where the deck names none; '' if there is none.
  pure function usual_rule(kind, polar) result(name)
    integer(i4), intent(in) :: kind
    logical, intent(in) :: polar
    character(len=name_size) :: name
    integer(i4) :: k
    name = ''
    do k = size(rule_names), 1, -1  ! of equal kinds the first is the usual one
      if (kind_u(k) == kind .and. (kind_phi(k) > 0 .eqv. polar)) name = rule_names(k)
    end do
  end function usual_rule

  !> All formulations for cells of a kind, for hints.
  pure function rules_for(kind, polar) result(text)
    integer(i4), intent(in) :: kind
    logical, intent(in) :: polar
    character(len=:), allocatable :: text
    integer(i4) :: k
    text = ''
    do k = 1, size(rule_names)
      if (kind_u(k) /= kind .or. (kind_phi(k) > 0 .neqv. polar)) cycle
      if (len(text) > 0) text = text//', '
      text = text//trim(rule_names(k))
    end do
    if (len(text) == 0) text = 'none'
  end function rules_for

  !> The formulation number k of `rule_names`.
  subroutine make_rule(k, rule)
    integer(i4), intent(in) :: k
    type(fem_formulation_type), intent(out) :: rule
    integer(i4) :: q
    real(wp), allocatable :: slope(:, :)
    real(wp) :: at(3, node_count(kind_u(k)))

    rule%name = rule_names(k)
    rule%kind = kind_u(k)
    rule%nodes = node_count(rule%kind)
    rule%corners = node_count(corner_kind(rule%kind))
    rule%polar = kind_phi(k) > 0
    if (rule%polar) rule%rotations = node_count(kind_phi(k))
    rule%one_point = rule%name == 'hex8_one_point'
    rule%brick = rule%kind == hex8 .and. .not. (rule%polar .or. rule%one_point)
    rule%linear_volume = rule%name == 'hex27_bbar'
    rule%bbar = rule%name == 'hex8_bbar' .or. rule%linear_volume
    rule%hrz = rule%kind == hex20 .or. rule%kind == tet10
    call evaluate(rule%kind, kind_phi(k), degree(k), rule%at)
    call evaluate(rule%kind, kind_phi(k), mass_degree(k), rule%mass_at)
    if (rule%one_point) rule%at%fine_slope = rule%mass_at%u_slope  ! 2 x 2 x 2: exact means
    call fit(rule%at, rule%corners, rule%spread)
    at = reference_nodes(rule%kind)
    allocate (rule%middle(rule%corners, rule%nodes), slope(3, rule%corners))
    do q = 1, rule%nodes
      call shape_functions(corner_kind(rule%kind), at(:, q), rule%middle(:, q), slope)
    end do
    if (rule%name == 'hex8_incompatible') call add_modes(degree(k), rule)
  end subroutine make_rule

  !> Three incompatible modes of a hex8 (Taylor, Beresford and Wilson 1976).
  subroutine add_modes(order, rule)
    integer(i4), intent(in) :: order
    type(fem_formulation_type), intent(inout) :: rule
    real(wp), allocatable :: points(:, :), weights(:)
    real(wp) :: n(rule%nodes)
    rule%modes = 3
    call quadrature_rule(rule%kind, order, points, weights)
    rule%mode_slope = -2.0_wp*points
    allocate (rule%centre_slope(3, rule%nodes))
    call shape_functions(rule%kind, [0.0_wp, 0.0_wp, 0.0_wp], n, rule%centre_slope)
  end subroutine add_modes

  subroutine evaluate(kind, rotations_kind, order, at)
    integer(i4), intent(in) :: kind, rotations_kind, order
    type(fem_points_type), intent(out) :: at
    real(wp), allocatable :: points(:, :)
    integer(i4) :: q, m, r

    call quadrature_rule(kind, order, points, at%weight)
    at%n = size(at%weight)
    m = node_count(kind)
    r = 0
    if (rotations_kind > 0) r = node_count(rotations_kind)
    allocate (at%u(m, at%n), at%u_slope(3, m, at%n), at%phi(r, at%n), at%phi_slope(3, r, at%n))
    m = node_count(corner_kind(kind))
    allocate (at%corner(m, at%n), at%corner_slope(3, m, at%n))
    do q = 1, at%n
      call shape_functions(kind, points(:, q), at%u(:, q), at%u_slope(:, :, q))
      call shape_functions(corner_kind(kind), points(:, q), at%corner(:, q), &
                           at%corner_slope(:, :, q))
      if (r > 0) call shape_functions(rotations_kind, points(:, q), at%phi(:, q), &
                                      at%phi_slope(:, :, q))
    end do
  end subroutine evaluate

  !> Matrix that maps values at the points to the corners: the least squares fit by the corner
  !! functions, or the mean where there are fewer points than corners.
  subroutine fit(at, corners, spread)
    type(fem_points_type), intent(in) :: at
    integer(i4), intent(in) :: corners
    real(wp), allocatable, intent(out) :: spread(:, :)
    real(wp) :: gram(corners, corners)
    integer(i4) :: a, b

    allocate (spread(corners, at%n), source=1.0_wp/at%n)
    if (at%n < corners) return
    gram = matmul(at%corner, transpose(at%corner))
    spread = at%corner
    do a = 1, corners  ! Gauss-Jordan; the Gram matrix of independent functions needs no pivoting
      spread(a, :) = spread(a, :)/gram(a, a)
      gram(a, :) = gram(a, :)/gram(a, a)
      do b = 1, corners
        if (b == a) cycle
        spread(b, :) = spread(b, :) - gram(b, a)*spread(a, :)
        gram(b, :) = gram(b, :) - gram(b, a)*gram(a, :)
      end do
    end do
  end subroutine fit
end module fem_rules
