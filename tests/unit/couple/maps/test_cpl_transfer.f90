!> The operator between nodes and ghosts: rigid motion, total force and moment about the origin,
!! and power, for points and kernels, with and without rotation, on distorted hexahedra.
program test_cpl_transfer
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use cpl_choices, only: rotation_curl, rotation_fixed
  use cpl_facet_map, only: facet_map_type
  use cpl_shapes, only: shapes_at
  use cpl_solid_mesh, only: solid_mesh_type
  use cpl_springs, only: springs_type
  use cpl_transfer, only: transfer_type, cross
  implicit none

  integer(i4), parameter :: across = 5, n = 30  !! nodes along an edge of the surface, ghosts
  type(test_type) :: test
  real(wp) :: x(3, 2*across**2)
  integer(i4) :: facets(4, (across - 1)**2), hex8(8, (across - 1)**2)
  logical :: flat
  integer(i4) :: flat_or_not

  do flat_or_not = 1, 2
    flat = flat_or_not == 1
    call make_sheet()
    call transfers('point', 0.0_wp, .false., 0.0_wp)
    call transfers('point, curl', 0.0_wp, .true., 0.0_wp)
    call transfers('point with offset, curl', 0.0_wp, .true., 2.0e-3_wp)
    call transfers('kernel', 6.0e-3_wp, .false., 0.0_wp)
    call transfers('kernel, curl', 6.0e-3_wp, .true., 0.0_wp)
    call transfers('wide kernel, curl', 2.5e-2_wp, .true., 1.0e-3_wp)
  end do
  call no_element()
  call test%finish()

contains

  !> One layer of hexahedra below facets of about 10 mm, skewed, warped unless flat.
  subroutine make_sheet()
    integer(i4) :: i, j, k, e
    k = 0
    do j = 0, across - 1
      do i = 0, across - 1
        k = k + 1
        x(:, k) = 0.01_wp*[i + 0.2_wp*j + 0.1_wp*sin(3.0_wp*k), j - 0.05_wp*i, &
                           merge(0.0_wp, 0.1_wp*cos(2.0_wp*k), flat)]
        x(:, k + across**2) = x(:, k) + 0.01_wp*[0.1_wp, 0.2_wp*cos(1.0_wp*k), -1.0_wp]
      end do
    end do
    e = 0
    do j = 1, across - 1
      do i = 1, across - 1
        e = e + 1
        k = i + (j - 1)*across
        facets(:, e) = [k, k + 1, k + 1 + across, k + across]
        hex8(:, e) = [facets(:, e) + across**2, facets(:, e)]
      end do
    end do
  end subroutine make_sheet

  function mesh_of(elements) result(mesh)
    integer(i4), intent(in) :: elements(:, :)
    type(solid_mesh_type) :: mesh
    allocate (mesh%x, source=x)
    allocate (mesh%facets, source=facets)
    allocate (mesh%hex8, source=elements)
    allocate (mesh%polar(size(x, 2)), source=0_i4)
  end function mesh_of

  subroutine transfers(name, width, turns, offset)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: width, offset
    logical, intent(in) :: turns
    type(facet_map_type) :: map
    type(transfer_type) :: transfer
    type(error_list_type) :: errors
    real(wp) :: ghost(3, n), natural(2), worst, force(3), moment(3)
    real(wp), allocatable :: p(:, :), d(:, :), f(:, :), u(:, :)
    integer(i4) :: g, on

    do g = 1, n
      on = 1 + mod(7*g, size(facets, 2))
      natural = [sin(1.7_wp*g), cos(2.3_wp*g)]*0.97_wp
      ghost(:, g) = matmul(x(:, facets(:, on)), shapes_at(4, natural))
      ghost(3, g) = ghost(3, g) + offset*sin(1.0_wp*g)
    end do
    call map%build([(100_i8 + g, g=1, n)], ghost, facets, x, 1.0e-2_wp, errors)
    call transfer%build(map, mesh_of(hex8), width, merge(rotation_curl, rotation_fixed, turns), &
                        errors)
    call test%check(name//': no faults', .not. errors%any())
    call transfer%identity_error(x(:, map%node_id), ghost, worst, errors)
    call test%check_close(name//': rigid motion', worst, 0.0_wp, 1.0e-13_wp)
    allocate (p(transfer%rows, n), d(transfer%rows, n), f(3, map%nodes), u(3, map%nodes))
    do g = 1, n
      p(:3, g) = [sin(0.3_wp*g), cos(0.9_wp*g), 1.0_wp]
      if (turns) p(4:, g) = 1.0e-2_wp*[cos(0.3_wp*g), 1.0_wp, sin(0.9_wp*g)]
    end do
    call transfer%to_nodes(p, f)
    force = sum(f, 2) - sum(p(:3, :), 2)
    call test%check_all_close(name//': force', force, 0.0_wp, 1.0e-13_wp)
    moment = -transfer%moment_of(p)
    do g = 1, n
      moment = moment + cross(ghost(:, g), p(:3, g))
      if (turns) moment = moment + p(4:, g)
    end do
    do g = 1, map%nodes
      moment = moment - cross(x(:, map%node_id(g)), f(:, g))
      u(:, g) = 1.0e-3_wp*[sin(2.0_wp*g), cos(3.0_wp*g), sin(5.0_wp*g)]
    end do
    call test%check_all_close(name//': moment', moment, 0.0_wp, 1.0e-14_wp)
    if (flat .and. offset <= 0.0_wp) call test%check_all_close(name//': no moment is lost', &
      transfer%moment_of(p), 0.0_wp, 1.0e-14_wp)
    call transfer%to_ghosts(u, d)
    call test%check_close(name//': power', sum(d*p), sum(u*f), 1.0e-15_wp)
    call test%check(name//': hash', transfer%hash(map) /= map%hash())
    if (turns) call rotational_springs(name, map, transfer)
  end subroutine transfers

  !> Springs on the nodes bound those on the ghosts' rotation: no motion makes them softer.
  subroutine rotational_springs(name, map, transfer)
    character(len=*), intent(in) :: name
    type(facet_map_type), intent(in) :: map
    type(transfer_type), intent(in) :: transfer
    type(springs_type) :: springs
    real(wp) :: u(3, map%nodes), f(3, map%nodes), d(6, n), radius(n), least
    integer(i4) :: g, k
    radius = 1.0e-3_wp
    call springs%make(1.0e6_wp, map, transfer, radius)
    least = huge(1.0_wp)
    do k = 1, 40
      do g = 1, map%nodes
        u(:, g) = [sin(2.0_wp*g*k), cos(3.0_wp*g*k), sin(5.0_wp*g*k)]
      end do
      call springs%force(u, f)
      call transfer%to_ghosts(u, d)
      least = min(least, sum(u*f)/sum(1.0_wp*d(4:, :)**2))
    end do
    call test%check(name//': springs hold rotation', least >= 1.0_wp)
  end subroutine rotational_springs

  subroutine no_element()
    type(facet_map_type) :: map
    type(transfer_type) :: transfer
    type(error_list_type) :: errors
    real(wp) :: ghost(3, 1)
    ghost(:, 1) = 0.25_wp*sum(x(:, facets(:, 2)), 2)
    call map%build([7_i8], ghost, facets, x, -1.0_wp, errors)
    call transfer%build(map, mesh_of(hex8(:, :1)), 0.0_wp, rotation_curl, errors)
    call test%check('no element behind', errors%count == 1)
    call test%check_text('no element behind: code', errors%item(1)%code, 'I405')
  end subroutine no_element
end program test_cpl_transfer
