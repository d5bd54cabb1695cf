!> Images of bodies that points may reach in a cell of 2 x 4 m, periodic along x and y, and sheared:
!! each image nearer than the margin lies in the range, which is empty far from all of them.
program test_dem_surface_images
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use dem_cell, only: set_cell, shift_of
  use dem_state, only: dem_cell_type
  use dem_surface_images, only: reached_images, image_count, image_at, body_width, turned_width, &
    is_endless, endless_along, crosses_edges
  use dem_surface_make, only: mesh_type, round_type, join_corners, check_mesh
  use dem_surface_state, only: dem_surfaces_type, surface_rigid
  use dem_surface_values, only: add_mesh, add_cylinder, add_cone
  use talus_errors, only: error_list_type
  implicit none
  type(test_type) :: test
  type(dem_cell_type) :: box, leaning
  type(dem_surfaces_type) :: s
  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: few_roundings = 1.0e-14_wp
  real(wp), parameter :: none(3) = 0.0_wp
  integer(i4) :: first(3), last(3)

  call set_cell(box, none, reshape([2.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 4.0_wp, 0.0_wp, 0.0_wp, &
                                    0.0_wp, 9.0_wp], [3, 3]), [.true., .true., .false.])
  call set_cell(leaning, none, reshape([2.0_wp, 0.0_wp, 0.0_wp, 1.5_wp, 4.0_wp, 0.0_wp, 0.0_wp, &
                                        0.0_wp, 9.0_wp], [3, 3]), [.true., .true., .false.])
  call make_bodies()
  call check_plain()
  call check_all_near(box, 'box')
  call check_all_near(leaning, 'leaning cell')
  call check_ends()
  call test%finish()

contains

  !> 1 a triangle, 2 a rod, 3 an endless bar along y, 4 a cone with its shaft, 5 an endless bar
  !! along x and z.
  subroutine make_bodies()
    type(mesh_type) :: mesh
    type(error_list_type) :: errors
    real(wp) :: corner(3, 3, 1)
    mesh%name = 'triangle'
    corner = 0.0_wp
    corner(1, 2, 1) = 0.8_wp
    corner(2, 3, 1) = 1.0_wp
    call join_corners(corner, mesh)
    call check_mesh(mesh, .false., errors)
    call add_mesh(s, mesh, 'triangle', surface_rigid, 1_i4, 0.9_wp, [0.4_wp, 0.5_wp, 0.0_wp])
    call add_cylinder(s, 'rod', 1_i4, round_type([5.0_wp, 1.0_wp, 0.5_wp], &
                                                 [1.0_wp, 1.0_wp, 0.0_wp], 0.1_wp, 0.5_wp), .false.)
    call add_cylinder(s, 'bar', 1_i4, round_type([0.5_wp, 1.0_wp, 0.5_wp], &
                                                 [0.0_wp, 1.0_wp, 0.0_wp], 0.1_wp), .false.)
    call add_cone(s, 'cone', [1_i4, 1_i4, 1_i4], round_type([0.5_wp, 1.0_wp, 0.5_wp], &
                  [0.0_wp, 0.0_wp, 1.0_wp], 0.1_wp, 0.7_wp), 30.0_wp*degree)
    call add_cylinder(s, 'skew', 1_i4, round_type([0.5_wp, 1.0_wp, 0.5_wp], &
                                                  [1.0_wp, 0.0_wp, 1.0_wp], 0.1_wp), .false.)
    call test%check('no fault', .not. errors%any())
  end subroutine make_bodies

  !> Without a cell there is the body alone; beside a face there are two.
  subroutine check_plain()
    type(dem_cell_type) :: absent
    call reached_images(s, 1_i4, absent, [50.0_wp, 0.0_wp, 0.0_wp], 0.1_wp, first, last)
    call test%check('no cell: the body alone', all(first == 0) .and. all(last == 0))
    call reached_images(s, 3_i4, box, [1.5_wp, 77.0_wp, 0.5_wp], 0.95_wp, first, last)
    call test%check('bar: both sides, once along itself', all(first == [0, 0, 0]) .and. &
                    all(last == [1, 0, 0]))
    call reached_images(s, 3_i4, box, [8.5_wp, 0.0_wp, 0.5_wp], 0.1_wp, first, last)
    call test%check('bar: four cells on', all(first == [4, 0, 0]) .and. all(last == [4, 0, 0]))
    call reached_images(s, 3_i4, box, [1.5_wp, 0.0_wp, 0.5_wp], 0.1_wp, first, last)
    call test%check('bar: far from all', last(1) < first(1))
  end subroutine check_plain

  !> Points on a net: whatever image has a point of the body within the margin is in the range.
  subroutine check_all_near(cell, name)
    type(dem_cell_type), intent(in) :: cell
    character(len=*), intent(in) :: name
    real(wp) :: x(3)
    integer(i4) :: b, i, near, missed

    missed = 0
    near = 0
    do b = 1, 4
      if (b == 3 .and. .not. endless_along(s, b, cell, 2_i4)) cycle
      do i = 0, 19*19 - 1
        x = [0.37_wp*(mod(i, 19) - 9), 0.51_wp*(i/19 - 9), 0.4_wp]
        call count_images(cell, b, x, near, missed)
      end do
    end do
    call test%check(name//': images were near', near > 200)
    call test%check(name//': none was missed', missed == 0)
  end subroutine check_all_near

  !> Images of body b that have a point near x, and those that are not in the range.
  subroutine count_images(cell, b, x, near, missed)
    type(dem_cell_type), intent(in) :: cell
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: x(3)
    integer(i4), intent(inout) :: near, missed
    real(wp), parameter :: margin = 0.3_wp
    real(wp) :: point(3)
    integer(i4) :: k, p, m(2)

    call reached_images(s, b, cell, x, margin, first, last)
    do k = 0, 17*17 - 1
      m = [mod(k, 17) - 8, k/17 - 8]
      if (b == 3 .and. m(2) /= 0) cycle  ! the bar is its own image there
      do p = 0, 8
        point = point_of(b, 0.25_wp*p - 1.0_wp) + shift_of(cell, [m, 0])
        if (b == 3) point(2) = x(2)
        if (norm2(point(:2) - x(:2)) > margin) cycle
        near = near + 1
        if (any(m < first(:2) .or. m > last(:2))) missed = missed + 1
      end do
    end do
  end subroutine count_images

  !> A point of body b, t from -1 to 1 along it.
  pure function point_of(b, t) result(x)
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: t
    real(wp) :: x(3)
    select case (b)
    case (1)
      x = [0.4_wp + 0.4_wp*t, 0.5_wp - 0.5_wp*t, 0.0_wp]
    case (2)
      x = s%centre(:, 2) + 0.5_wp*t*s%round%axis(:, 2)
    case (3)
      x = s%centre(:, 3)
    case default
      x = s%centre(:, 4) + 0.1_wp*[t, 0.0_wp, 0.0_wp]
    end select
  end function point_of

  !> Widths, and bodies without end.
  subroutine check_ends()
    call test%check_close('width of the triangle', body_width(s, 1_i4, box, 1_i4, .false.), &
                          0.4_wp, few_roundings)
    first = [-1, 0, 2]
    last = [0, 2, 2]
    call test%check('six images', image_count(first, last) == 6)
    call test%check_all_close('the last of them', image_at(box, first, last, 6_i4), &
                           [0.0_wp, 8.0_wp, 18.0_wp], few_roundings)
    call test%check_all_close('the third', image_at(box, first, last, 3_i4), &
                           [-2.0_wp, 4.0_wp, 18.0_wp], few_roundings)
    call test%check('none', image_count(first, [5, 5, 1]) == 0)
    call test%check_close('the same if it turns', body_width(s, 1_i4, box, 1_i4, .true.), &
                          sqrt(0.41_wp), few_roundings)
    call test%check_close('and about z', turned_width(s, 1_i4, box, 1_i4, &
                                                   [0.0_wp, 0.0_wp, 2.0_wp]), sqrt(0.41_wp), &
                          few_roundings)
    call test%check_close('and about x', turned_width(s, 1_i4, box, 1_i4, &
                                                   [3.0_wp, 0.0_wp, 0.0_wp]), 0.4_wp, few_roundings)
    call test%check_close('width of the rod', body_width(s, 2_i4, box, 2_i4, .false.), &
                          (0.1_wp + 0.5_wp*sqrt(0.5_wp))/2.0_wp, few_roundings)
    call test%check('the bar has no end', is_endless(s, 3_i4) .and. .not. is_endless(s, 2_i4))
    call test%check('along y', endless_along(s, 3_i4, box, 2_i4))
    call test%check('not along x', .not. endless_along(s, 3_i4, box, 1_i4))
    call test%check('nor along a leaning edge', .not. endless_along(s, 3_i4, leaning, 2_i4))
    call test%check('which it crosses', crosses_edges(s, 3_i4, leaning))
    call test%check('it crosses none of the box', .not. crosses_edges(s, 3_i4, box))
    call test%check('a skew bar does', crosses_edges(s, 5_i4, box))
    call test%check('a rod has ends', .not. crosses_edges(s, 2_i4, box))
  end subroutine check_ends
end program test_dem_surface_images
