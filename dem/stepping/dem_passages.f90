!> Contacts that a step has missed. The list is made anew before forces are worked as soon as half
!! the margin is used up, so that no contact of a state is ever missed. What can be missed is one
!! between two states: bodies that go further than the whole margin in one step may pass through
!! each other, or through a surface. Such late rebuilds are looked into, grain by grain: those that
!! went along with all others, or through empty space, have missed nothing (theory-dem, Search).
module dem_passages
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_homogenise, only: inverse_of
  use talus_text, only: str
  use talus_vectors, only: cross
  use dem_cell, only: is_periodic
  use dem_gap, only: solve_gap
  use dem_shape_gap, only: solve_shapes
  use dem_shape_state, only: shape_ellipsoid
  use dem_kinds, only: moved_by_forces, gives_way
  use dem_state, only: dem_data_type
  use dem_surface_images, only: reached_images, image_count, image_at
  use dem_surface_state, only: dem_surfaces_type, is_round, is_bore, is_cylinder
  implicit none
  private
  public :: find_passage, name_passage

  real(wp), parameter :: deep = 0.01_wp  !! a missed overlap of less is a graze, in least semi-axes
  real(wp), parameter :: most_work = 2.0e8_wp  !! pairs that are looked at; of more, and of
                                             !! polyhedra, one is assumed
  integer(i4), parameter :: looks = 64   !! at a round body along a grain's way

contains

  !> Look for a contact that the last step, of h [s], has missed, into health%passed. Collective
  !! over all ranks.
  subroutine find_passage(d, h)
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: h
    integer(i4), allocatable :: fast(:)
    real(wp) :: ids(2)
    integer(i4) :: k

    d%health%passed = 0
    fast = fast_grains(d, h)
    if (size(fast) > 0 .and. (allocated(d%pairs%features) .or. real(size(fast), wp) &
        *(d%grains%n + d%surfaces%mesh%triangles) > most_work)) then
      d%health%passed(1) = d%grains%id(fast(1))
    else
      do k = 1, size(fast)
        if (d%health%passed(1) > 0) exit
        call pass_grains(d, fast(k), h)
        if (d%surfaces%n > 0 .and. d%health%passed(1) == 0) call pass_surfaces(d, fast(k), h)
      end do
    end if
    if (.not. d%halo%team%several()) return
    ids(1) = real(d%health%passed(1), wp)
    call d%halo%team%most(ids(:1))
    ids(2) = -huge(1.0_wp)
    if (nint(ids(1), i8) == d%health%passed(1)) ids(2) = real(d%health%passed(2), wp)
    call d%halo%team%most(ids(2:))
    d%health%passed = nint(ids, i8)
  end subroutine find_passage

  !> Grains that went further than half the margin in h [s], in space or from the mean of all free
  !! ones, whichever are fewer: a bed that moves as a whole meets what does not.
  pure function fast_grains(d, h) result(fast)
    type(dem_data_type), intent(in) :: d
    real(wp), intent(in) :: h
    integer(i4), allocatable :: fast(:)
    real(wp) :: mean(3), least
    integer(i4) :: i
    allocate (fast(0))
    if (.not. h > 0.0_wp) return
    least = (0.5_wp*d%pairs%skin/h)**2
    mean = 0.0_wp
    do i = 1, d%grains%n
      if (moved_by_forces(d%grains%kind(i))) mean = mean + d%pairs%body(4:6, i)
    end do
    mean = mean/max(count(moved_by_forces(d%grains%kind(:d%grains%n))), 1)
    fast = pack([(i, i=1, d%grains%n)], &
                [(sum(d%pairs%body(4:6, i)**2) > least, i=1, d%grains%n)])
    if (size(fast) <= d%grains%n/2 .or. d%surfaces%n > 0) return
    fast = pack([(i, i=1, d%grains%n)], &
                [(sum((d%pairs%body(4:6, i) - mean)**2) > least, i=1, d%grains%n)])
  end function fast_grains

  !> Grains that grain i has passed through.
  subroutine pass_grains(d, i, h)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: h
    real(wp) :: inverse(3, 3), r(3), way(3)
    integer(i4) :: j
    logical :: periodic
    periodic = is_periodic(d%cell)
    inverse = 0.0_wp
    if (periodic) inverse = inverse_of(d%cell%vectors)
    do j = 1, d%grains%n
      if (j == i .or. .not. (gives_way(d%grains%kind(i)) .or. gives_way(d%grains%kind(j)))) cycle
      r = d%pairs%body(1:3, j) - d%pairs%body(1:3, i)
      if (periodic) r = r - matmul(d%cell%vectors, &
                                   merge(anint(matmul(inverse, r)), 0.0_wp, d%cell%periodic))
      way = h*(d%pairs%body(4:6, j) - d%pairs%body(4:6, i))
      if (.not. have_met(d, i, j, r, way)) cycle
      d%health%passed = [d%grains%id(i), d%grains%id(j)]
      return
    end do
  end subroutine pass_grains

  !> Have grains i and j, now r apart, overlapped on the way by which this has changed, and not
  !! before or after it; or are they past each other?
  logical function have_met(d, i, j, r, way)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, j
    real(wp), intent(in) :: r(3), way(3)  !! [m]
    real(wp) :: before(3), between(3), part, graze
    have_met = .false.
    before = r - way
    part = -dot_product(before, way)/max(sum(way*way), tiny(1.0_wp))
    if (part <= 0.0_wp .or. part >= 1.0_wp) return  ! nearest at one of the ends
    between = before + part*way
    if (sum(between**2) > (d%grains%radius(i) + d%grains%radius(j))**2) return
    graze = deep*min(minval(d%grains%axes(:, i)), minval(d%grains%axes(:, j)))
    if (gap_of(d, i, j, between) > -graze) return
    have_met = dot_product(before, r) < 0.0_wp
    if (.not. have_met) have_met = gap_of(d, i, j, before) >= 0.0_wp .and. &
      gap_of(d, i, j, r) >= 0.0_wp
  end function have_met

  !> Gap of two grains r apart, as they are turned now [m].
  real(wp) function gap_of(d, i, j, r) result(gap)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, j
    real(wp), intent(in) :: r(3)  !! [m]
    real(wp) :: normal(3)
    logical :: shaped
    normal = 0.0_wp
    shaped = .false.
    if (d%grains%shapes%in_use) shaped = any(d%grains%shapes%kind([i, j]) /= shape_ellipsoid)
    if (shaped) then
      call solve_shapes(r, d%grains%shapes%record(:, i), d%grains%shapes%record(:, j), normal, gap)
    else
      call solve_gap(r, d%pairs%body(10:15, i), d%pairs%body(10:15, j), normal, gap)
    end if
  end function gap_of

  !> Surfaces that the centre of grain i has passed through: triangles, and round bodies from one
  !! side to the other.
  subroutine pass_surfaces(d, i, h)
    type(dem_data_type), intent(inout) :: d
    integer(i4), intent(in) :: i
    real(wp), intent(in) :: h
    integer(i4) :: b

    if (.not. moved_by_forces(d%grains%kind(i))) return
    do b = 1, d%surfaces%n
      if (.not. passes_images(d, i, b, h)) cycle
      d%health%passed = [d%grains%id(i), -int(b, i8)]
      return
    end do
  end subroutine pass_surfaces

  !> Has the centre of grain i passed through an image of body b in this step?
  logical function passes_images(d, i, b, h) result(passes)
    type(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: i, b
    real(wp), intent(in) :: h
    real(wp) :: x(3), v(3)
    integer(i4) :: first(3), last(3), k

    passes = .false.
    x = d%pairs%body(1:3, i)
    v = d%pairs%body(4:6, i)
    call reached_images(d%surfaces, b, d%cell, x, h*norm2(v - velocity_at(d%surfaces, b, x)), &
                        first, last)
    do k = 1, image_count(first, last)
      x = d%pairs%body(1:3, i) - image_at(d%cell, first, last, k)
      passes = crosses_body(d%surfaces, b, x, h*(v - velocity_at(d%surfaces, b, x)))
      if (passes) return
    end do
  end function passes_images

  !> Does the way that ends at x lead through body b?
  pure logical function crosses_body(s, b, x, way) result(crosses)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: x(3), way(3)  !! [m]
    integer(i4) :: t
    if (is_round(s, b)) then
      crosses = crosses_round(s, b, x, way)
      return
    end if
    crosses = .false.
    do t = s%first_triangle(b), s%first_triangle(b + 1) - 1
      crosses = crosses_triangle(s%mesh%x(:, s%mesh%corner(:, t)), x, way)
      if (crosses) return
    end do
  end function crosses_body

  !> Velocity of body b at a point; that of soft ones is left out, their vertices go slowly [m/s].
  pure function velocity_at(s, b, x) result(v)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: x(3)
    real(wp) :: v(3)
    v = s%velocity(:, b) + cross(s%spin(:, b), x - s%centre(:, b))
  end function velocity_at

  !> Does the way that ends at x cross a triangle?
  pure logical function crosses_triangle(corner, x, way)
    real(wp), intent(in) :: corner(3, 3), x(3), way(3)  !! [m]
    real(wp) :: e(3), f(3), p(3), q(3), r(3), det, u, v, t
    crosses_triangle = .false.
    e = corner(:, 2) - corner(:, 1)
    f = corner(:, 3) - corner(:, 1)
    p = cross(way, f)
    det = dot_product(e, p)
    if (.not. abs(det) > 0.0_wp) return
    r = x - way - corner(:, 1)
    q = cross(r, e)
    u = dot_product(r, p)/det
    v = dot_product(way, q)/det
    t = dot_product(f, q)/det
    crosses_triangle = u >= 0.0_wp .and. v >= 0.0_wp .and. u + v <= 1.0_wp .and. t > 0.0_wp &
      .and. t <= 1.0_wp
  end function crosses_triangle

  !> Was a grain inside a cone or cylinder on the way that ends at x, or out of a bore at its end?
  pure logical function crosses_round(s, b, x, way) result(crosses)
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: x(3), way(3)  !! [m]
    real(wp) :: r(3), along, across
    integer(i4) :: k
    crosses = .false.
    do k = 1, looks
      r = x - (1.0_wp - real(k, wp)/looks)*way - s%centre(:, b)
      along = dot_product(r, s%round%axis(:, b))
      across = norm2(r - along*s%round%axis(:, b))
      if (is_bore(s, b)) then
        if (k == looks) crosses = across > s%round%radius(b) .and. &
          abs(along) < s%round%extent(b)
      else if (is_cylinder(s, b)) then
        crosses = across < s%round%radius(b) .and. abs(along) < s%round%extent(b)
      else
        crosses = across < min(s%round%radius(b), along*s%round%sine(b)/s%round%cosine(b))
      end if
      if (crosses) return
    end do
  end function crosses_round

  !> Fault N209 where a contact was missed, which all ranks know of.
  subroutine name_passage(d, errors)
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: partner
    if (d%health%passed(1) == 0) return
    if (d%health%passed(2) > 0) then
      partner = 'grain '//str(d%health%passed(2))
    else if (d%health%passed(2) < 0) then
      partner = "surface '"//d%surfaces%name(-d%health%passed(2))%s//"'"
    else
      partner = 'others, of which too many move as fast to look at each'
    end if
    call errors%add('N209', 'grain '//str(d%health%passed(1))//' may have passed through '// &
                    partner//' within one step: it went further than the margin of the list, '// &
                    str(d%pairs%skin)//' m', place='step '//str(d%health%steps), &
                    hint="a smaller time step; &limits allow = 'late_rebuilds' goes on all "// &
                    'the same')
  end subroutine name_passage
end module dem_passages
