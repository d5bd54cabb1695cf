!> Facets of all kinds: shape functions, projection, operators on curved surfaces, with ghosts that
!! follow micro-rotations of all nodes or of the corners alone.
program test_cpl_shapes
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: larger, max_abs, test_type
  use cpl_choices, only: rotation_fixed, rotation_micro
  use cpl_facet_map, only: facet_map_type
  use cpl_shapes, only: shapes, shapes_at, corner_count, inside, nearest_inside, centre_of
  use cpl_solid_mesh, only: solid_mesh_type
  use cpl_springs, only: springs_type
  use cpl_transfer, only: transfer_type, cross
  implicit none

  integer(i4), parameter :: kinds(5) = [3, 4, 6, 8, 9], ghosts = 24
  type(test_type) :: test
  integer(i4) :: k

  do k = 1, size(kinds)
    call functions(kinds(k))
    call curved(kinds(k))
  end do
  call no_rotations()
  call bad_meshes()
  call test%finish()

contains

  character(len=32) function name_of(n, what)
    integer(i4), intent(in) :: n
    character(len=*), intent(in) :: what
    write (name_of, '(i0, 2a)') n, ' nodes: ', what
  end function name_of

  !> Natural coordinates of the nodes (2, n).
  function nodes_of(n) result(at)
    integer(i4), intent(in) :: n
    real(wp) :: at(2, n)
    real(wp), parameter :: square(2, 9) = reshape([-1, -1, 1, -1, 1, 1, -1, 1, 0, -1, 1, 0, 0, 1, &
                                                   -1, 0, 0, 0]*1.0_wp, [2, 9])
    real(wp), parameter :: triangle(2, 6) = reshape([0, 0, 2, 0, 0, 2, 1, 0, 1, 1, 0, 1]*0.5_wp, &
                                                    [2, 6])
    if (corner_count(n) == 3) then
      at = triangle(:, :n)
    else
      at = square(:, :n)
    end if
  end function nodes_of

  !> A place on the facet, another for each g.
  function place(n, g) result(natural)
    integer(i4), intent(in) :: n, g
    real(wp) :: natural(2)
    natural = [sin(1.7_wp*g), cos(2.3_wp*g)]*0.97_wp
    if (corner_count(n) == 3) natural = nearest_inside(n, 0.5_wp + 0.5_wp*natural)
  end function place

  !> One at its node, none at the others, sum one, linear functions kept, slopes and bends right.
  subroutine functions(n)
    integer(i4), intent(in) :: n
    real(wp), parameter :: h = 1.0e-5_wp
    real(wp) :: at(2, n), value(n), slope(2, n), bend(3, n), ahead(n), back(n), slope_ahead(2, n), &
      slope_back(2, n), unused(3, n), worst(4), step(2), natural(2)
    integer(i4) :: a, g, c
    at = nodes_of(n)
    worst = 0.0_wp
    do a = 1, n
      value = shapes_at(n, at(:, a))
      value(a) = value(a) - 1.0_wp
      worst(1) = larger(worst(1), max_abs(value))
    end do
    do g = 1, 10
      natural = place(n, g)
      call shapes(n, natural, value, slope, bend)
      worst(2) = larger(worst(2), abs(sum(value) - 1.0_wp), max_abs(matmul(at, value) - natural))
      do c = 1, 2
        step = 0.0_wp
        step(c) = h
        call shapes(n, natural + step, ahead, slope_ahead, unused)
        call shapes(n, natural - step, back, slope_back, unused)
        worst(3) = larger(worst(3), max_abs((ahead - back)/(2.0_wp*h) - slope(c, :)))
        worst(4) = larger(worst(4), max_abs((slope_ahead - slope_back)/(2.0_wp*h) &
                                            - bend(c:c + 1, :)))
      end do
    end do
    call test%check_close(name_of(n, 'nodes'), worst(1), 0.0_wp, 1.0e-15_wp)
    call test%check_close(name_of(n, 'linear'), worst(2), 0.0_wp, 1.0e-15_wp)
    call test%check_close(name_of(n, 'slopes'), worst(3), 0.0_wp, 1.0e-9_wp)
    call test%check_close(name_of(n, 'bends'), worst(4), 0.0_wp, 1.0e-9_wp)
    call test%check(name_of(n, 'inside'), inside(n, centre_of(n), 0.0_wp) .and. &
                    .not. inside(n, [1.0_wp, 1.1_wp], 1.0e-3_wp))
  end subroutine functions

  !> A single facet, bent where its nodes let it: ghosts on it are found again, the operators keep
  !! rigid motion, total force and moment, and power.
  subroutine curved(n)
    integer(i4), intent(in) :: n
    type(solid_mesh_type) :: mesh
    type(facet_map_type) :: map
    type(error_list_type) :: errors
    real(wp) :: ghost(3, ghosts), natural(2, ghosts), at(2, n), worst
    integer(i4) :: a, g
    at = nodes_of(n)
    allocate (mesh%x(3, n), mesh%facets(9, 1), mesh%hex8(8, 0), mesh%polar(n))
    mesh%facets = 0
    mesh%facets(:n, 1) = [(a, a=1, n)]
    mesh%polar = 1
    do a = 1, n
      mesh%x(:, a) = 0.01_wp*[at(1, a) + 0.1_wp*at(2, a), at(2, a) + 0.05_wp*sin(3.0_wp*a), &
                              0.3_wp*at(1, a)**2 + 0.2_wp*at(1, a)*at(2, a) - 0.2_wp*at(2, a)**2]
    end do
    call mesh%check(errors)
    do g = 1, ghosts
      natural(:, g) = place(n, g)
      ghost(:, g) = matmul(mesh%x, shapes_at(n, natural(:, g)))
    end do
    call map%build([(100_i8 + g, g=1, ghosts)], ghost, mesh%facets, mesh%x, -1.0_wp, errors)
    call test%check(name_of(n, 'no faults'), .not. errors%any())
    call test%check_all_close(name_of(n, 'projected'), map%natural, natural, &
                          1.0e-10_wp)
    call map%identity_error(ghost, mesh%x, worst, errors)
    call test%check_close(name_of(n, 'identities'), worst, 0.0_wp, 1.0e-13_wp)
    call powers(name_of(n, 'fixed'), mesh, map, ghost, 0.0_wp, rotation_fixed)
    call powers(name_of(n, 'micro'), mesh, map, ghost, 0.0_wp, rotation_micro)
    call powers(name_of(n, 'kernel'), mesh, map, ghost, 6.0e-3_wp, rotation_micro)
    if (n <= 4) return
    mesh%polar(corner_count(n) + 1:) = 0
    call powers(name_of(n, 'corners'), mesh, map, ghost, 0.0_wp, rotation_micro)
  end subroutine curved

  subroutine powers(name, mesh, map, ghost, width, rotation)
    character(len=*), intent(in) :: name
    type(solid_mesh_type), intent(in) :: mesh
    type(facet_map_type), intent(inout) :: map
    real(wp), intent(in) :: ghost(:, :), width
    integer(i4), intent(in) :: rotation
    type(transfer_type) :: transfer
    type(springs_type) :: springs
    type(error_list_type) :: errors
    real(wp), allocatable :: p(:, :), d(:, :), f(:, :), u(:, :)
    real(wp) :: worst, moment(3), radius(ghosts)
    integer(i4) :: g

    call transfer%build(map, mesh, width, rotation, errors)
    call test%check(name//' no faults', .not. errors%any())
    call transfer%identity_error(mesh%x(:, map%node_id), ghost, worst, errors)
    call test%check_close(name//' rigid motion', worst, 0.0_wp, 1.0e-13_wp)
    allocate (p(transfer%rows, ghosts), d(transfer%rows, ghosts))
    allocate (f(3, transfer%blocks), u(3, transfer%blocks))
    do g = 1, ghosts
      p(:3, g) = [sin(0.3_wp*g), cos(0.9_wp*g), 1.0_wp]
      if (rotation == rotation_micro) p(4:, g) = 1.0e-2_wp*[cos(0.3_wp*g), 1.0_wp, sin(0.9_wp*g)]
    end do
    call transfer%to_nodes(p, f)
    call test%check_all_close(name//' force', sum(f(:, :map%nodes), 2), sum(p(:3, :), &
                          2), 1.0e-13_wp)
    moment = -transfer%moment_of(p) - sum(f(:, map%nodes + 1:), 2)
    do g = 1, ghosts
      moment = moment + cross(ghost(:, g), p(:3, g))
      if (rotation == rotation_micro) moment = moment + p(4:, g)
    end do
    do g = 1, map%nodes
      moment = moment - cross(mesh%x(:, map%node_id(g)), f(:, g))
    end do
    call test%check_all_close(name//' moment', moment, 0.0_wp, 1.0e-14_wp)
    do g = 1, transfer%blocks
      u(:, g) = 1.0e-3_wp*[sin(2.0_wp*g), cos(3.0_wp*g), sin(5.0_wp*g)]
    end do
    call transfer%to_ghosts(u, d)
    call test%check_close(name//' power', sum(d*p), sum(u*f), 1.0e-15_wp)
    radius = 1.0e-3_wp
    call springs%make(1.0e6_wp, map, transfer, radius)
    call springs%force(u, f)
    call test%check(name//' springs', sum(u*f) > 0.0_wp .and. &
                    springs%turning == merge(ghosts, 0, rotation == rotation_micro))
    if (rotation == rotation_micro .and. width <= 0.0_wp) call test%check_close( &
      name//' energy of springs', sum(u*f), 1.0e6_wp*(sum((d(:3, :) - arms(transfer, d))**2) &
                                                      + 1.0e-6_wp*sum(d(4:, :)**2)), 1.0e-9_wp)
  end subroutine powers

  !> What the ghosts move by turning about their points on the facet.
  function arms(transfer, d) result(part)
    type(transfer_type), intent(in) :: transfer
    real(wp), intent(in) :: d(:, :)
    real(wp) :: part(3, ghosts)
    integer(i4) :: g
    do g = 1, ghosts
      part(:, g) = cross(d(4:6, g), transfer%arm(:, g))
    end do
  end function arms

  subroutine triangle(mesh)
    type(solid_mesh_type), intent(out) :: mesh
    mesh%x = reshape([0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp], &
                     [3, 3])
    mesh%facets = reshape([1, 2, 3], [3, 1])
    allocate (mesh%hex8(8, 0))
    mesh%polar = [1, 0, 1]
  end subroutine triangle

  !> A corner without micro-rotation.
  subroutine no_rotations()
    type(solid_mesh_type) :: mesh
    type(facet_map_type) :: map
    type(transfer_type) :: transfer
    type(error_list_type) :: errors
    real(wp) :: ghost(3, 1)
    call triangle(mesh)
    ghost(:, 1) = sum(mesh%x, 2)/3.0_wp
    call map%build([7_i8], ghost, mesh%facets, mesh%x, -1.0_wp, errors)
    call transfer%build(map, mesh, 0.0_wp, rotation_micro, errors)
    call test%check('no micro-rotation: one fault', errors%count == 1)
    call test%check_text('no micro-rotation: code', errors%item(1)%code, 'I406')
  end subroutine no_rotations

  !> Meshes that a damaged partner may send.
  subroutine bad_meshes()
    type(solid_mesh_type) :: mesh
    call triangle(mesh)
    mesh%facets(2, 1) = 4
    call refused('no such node', mesh)
    mesh%facets(2, 1) = -1
    call refused('negative node', mesh)
    mesh%facets(2, 1) = 0
    call refused('two nodes', mesh)
    mesh%facets(2, 1) = 2
    mesh%hex8 = reshape([1, 2, 3, 1, 2, 3, 1, 9], [8, 1])
    call refused('element of other nodes', mesh)
    mesh%hex8 = reshape([1, 2, 3], [3, 1])
    call refused('element of three nodes', mesh)
    call triangle(mesh)
    mesh%polar = [1]
    call refused('too few marks', mesh)
    call triangle(mesh)
    mesh%x(1, 2) = ieee_value(1.0_wp, ieee_quiet_nan)
    call refused('no number', mesh)
  end subroutine bad_meshes

  subroutine refused(name, mesh)
    character(len=*), intent(in) :: name
    type(solid_mesh_type), intent(in) :: mesh
    type(error_list_type) :: errors
    call mesh%check(errors)
    call test%check(name//': one fault', errors%count == 1)
    if (errors%any()) call test%check_text(name//': code', errors%item(1)%code, 'P413')
  end subroutine refused
end program test_cpl_shapes
