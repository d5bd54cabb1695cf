!> Stress, couple stress and affine moduli of the grains in each element (theory: overlap coupling,
!! Start).
!!
!! Branches are cut at the faces of the elements (centre to contact point to centre). In the layer
!! of ghosts all counts with a ramp that ends a largest diameter before it does: beyond, neighbours
!! of the ghosts may be cut off, and their contacts are missing. Elements of ghosts, of which little
!! is under the ramp, take the mean over all that share their nodes; elements without grains take a
!! fit over the others: a constant, with gravity a linear change with depth. Moduli are those of
!! the elements of free grains.
!! eq. C.12
module cpl_homogenise
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: cross
  use talus_moduli, only: affine_moduli, isotropic_part, isotropic_type
  use talus_sample, only: sample_type
  use cpl_cells, only: cells_type, spot_type
  use cpl_elements, only: most_nodes, corner_count, corner_kind, shapes
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type, rows_of_contacts
  use cpl_sets, only: part_ghost, part_free
  use cpl_weights, only: omega
  implicit none
  private
  public :: pack_average_type, average_pack, extend_average, stress_at, smooth_over_nodes

  integer(i4), parameter :: deepest = 8            !! halvings of a piece that crosses a face
  real(wp), parameter :: flat = 1.0e-6_wp          !! spread of depths that shows no slope

  !> Nine-vectors hold kl = 11 12 13 21 ..., the normal of the area first.
  type :: pack_average_type
    real(wp), allocatable :: stress(:, :)   !! (9, elements) [Pa]
    real(wp), allocatable :: couple(:, :)   !! (9, elements) [N/m]
    real(wp), allocatable :: volume(:)      !! (elements) that was averaged over [m^3]
    real(wp), allocatable :: share(:)       !! (elements) the same over the element's [-]
    logical, allocatable :: own(:)          !! (elements) has a stress of its own
    type(isotropic_type) :: affine          !! moduli, upper bounds
    real(wp) :: mean_force = 0.0_wp         !! of the contacts [N]
    real(wp) :: mean(9) = 0.0_wp, slope(9) = 0.0_wp  !! fit: [Pa], [Pa/m] along down
    real(wp) :: middle(3) = 0.0_wp, down(3) = 0.0_wp !! of the fit [m], [-]
  end type pack_average_type

contains

  !> Sums over the contacts, which must be there with their whole forces.
  subroutine average_pack(o, contacts, points, average)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(pack_average_type), intent(inout) :: average
    type(sample_type) :: sample
    real(wp), allocatable :: branch(:, :)
    integer(i4), allocatable :: pair(:, :), element(:)
    real(wp) :: c9(9, 9), b9(9, 9), d9(9, 9)
    integer(i4) :: c

    allocate (average%stress(9, o%cells%elements), average%couple(9, o%cells%elements), &
              source=0.0_wp)
    call volumes(o, points, average)
    call rows_of_contacts(o, contacts, pair)
    call fill_sample(o, contacts, pair, sample)
    call elements_of(o, element)
    allocate (branch(3, sample%contacts), source=0.0_wp)
    do c = 1, sample%contacts
      call add_contact(o, sample, c, element, average, branch(:, c))
    end do
    average%mean_force = sum(norm2(sample%force, 1))/max(1, sample%contacts)
    do c = 1, o%cells%elements
      if (.not. average%volume(c) > 0.0_wp) cycle
      average%stress(:, c) = average%stress(:, c)/average%volume(c)
      average%couple(:, c) = average%couple(:, c)/average%volume(c)
    end do
    call affine_moduli(sample, branch, sum(average%volume, o%sets%part == part_free), c9, b9, d9)
    average%affine = isotropic_part(c9, b9)
    call smooth(o, average)
  end subroutine average_pack

  !> Volumes of the elements times the ramp.
  subroutine volumes(o, points, average)
    type(overlap_type), intent(in) :: o
    type(points_type), intent(in) :: points
    type(pack_average_type), intent(inout) :: average
    real(wp) :: whole(o%cells%elements)
    integer(i4) :: q, e
    allocate (average%volume(o%cells%elements), average%share(o%cells%elements), source=0.0_wp)
    whole = 0.0_wp
    do q = 1, size(points%element)
      whole(points%element(q)) = whole(points%element(q)) + points%weight(q)
    end do
    do e = 1, o%cells%elements
      average%share(e) = mean_ramp(o, e)
    end do
    average%volume = average%share*whole
  end subroutine volumes

  !> Mean of the ramp over an element, on a grid of points.
  real(wp) function mean_ramp(o, e)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(in) :: e
    integer(i4), parameter :: grid = 6
    real(wp) :: n(most_nodes), dn(3, most_nodes), xi(3)
    integer(i4) :: i, j, k, c, kind, many

    mean_ramp = merge(1.0_wp, 0.0_wp, o%sets%part(e) == part_free)
    if (o%sets%part(e) /= part_ghost) return
    kind = corner_kind(o%cells%kind(e))
    c = corner_count(kind)
    many = 0
    associate (x => o%cells%x(:, o%cells%node(o%cells%start(e):o%cells%start(e) + c - 1)))
      do k = 0, grid - 1
        do j = 0, grid - 1
          do i = 0, grid - 1
            if (c == 8) then
              xi = (2.0_wp*[i, j, k] + 1.0_wp)/grid - 1.0_wp
            else
              if (i + j + k >= grid) cycle
              xi = ([i, j, k] + 0.25_wp)/grid
            end if
            call shapes(kind, xi, n, dn)
            mean_ramp = mean_ramp + ramp_at(o, e, matmul(x, n(:c)))
            many = many + 1
          end do
        end do
      end do
    end associate
    mean_ramp = mean_ramp/many
  end function mean_ramp

  !> The ramp at a point of an element; 1 under free grains, 0 where contacts may be missing.
  real(wp) function ramp_at(o, e, x)
    type(overlap_type), intent(in) :: o
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: x(3)  !! [m]
    ramp_at = 0.0_wp
    if (e == 0) return
    if (o%sets%part(e) == part_free) ramp_at = 1.0_wp
    if (o%sets%part(e) == part_ghost) &
      ramp_at = omega(o%sets%hull%distance(x) + o%sets%d_max, o%sets%depth, o%sets%d_max)
  end function ramp_at

  !> Contacts as the formulas want them; those with a boundary begin at their point.
  subroutine fill_sample(o, contacts, pair, sample)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    integer(i4), intent(in) :: pair(:, :)
    type(sample_type), intent(inout) :: sample
    integer(i4), allocatable :: kept(:)
    integer(i4) :: c, k
    kept = pack([(c, c=1, size(pair, 2))], pair(2, :) > 0)
    call sample%make(int(size(o%pack%id), i4), int(size(kept), i4))
    sample%x = o%pack%x
    do k = 1, size(kept)
      c = kept(k)
      sample%first(k) = pair(1, c)
      sample%second(k) = pair(2, c)
      sample%point(:, k) = contacts%point(:, c)
      sample%start(:, k) = contacts%point(:, c)
      if (pair(1, c) > 0) sample%start(:, k) = o%pack%x(:, pair(1, c))
      sample%normal(:, k) = contacts%normal(:, c)
      sample%force(:, k) = contacts%force(:, c)
      sample%stiffness(:, k) = contacts%stiffness(:, c)
    end do
  end subroutine fill_sample

  !> Elements of the coupled grains; 0 for all others.
  subroutine elements_of(o, element)
    type(overlap_type), intent(in) :: o
    integer(i4), allocatable, intent(out) :: element(:)
    allocate (element(size(o%pack%id)), source=0_i4)
    element(o%sets%free) = o%sets%free_spot%element
    element(o%sets%ghost) = o%sets%ghost_spot%element
  end subroutine elements_of

  !> Both arms of contact c, to the elements they run through; branch is what lies in elements of
  !! free grains [m].
  subroutine add_contact(o, sample, c, element, average, branch)
    type(overlap_type), intent(in) :: o
    type(sample_type), intent(in) :: sample
    integer(i4), intent(in) :: c, element(:)
    type(pack_average_type), intent(inout) :: average
    real(wp), intent(inout) :: branch(3)
    real(wp) :: a(3), p(3), b(3), couple(3)
    integer(i4) :: ea, ep, eb

    a = sample%start(:, c)
    p = sample%point(:, c)
    b = sample%far_end(c)
    eb = element(sample%second(c))
    ep = element_at(o, p)
    ea = ep
    if (sample%first(c) > 0) ea = element(sample%first(c))
    if (ea == 0 .and. eb == 0 .and. ep == 0) return
    couple = cross(p - 0.5_wp*(a + b), sample%force(:, c))
    call add_piece(o, a, p, ea, ep, deepest, sample%force(:, c), couple, average, branch)
    call add_piece(o, p, b, ep, eb, deepest, sample%force(:, c), couple, average, branch)
  end subroutine add_contact

  integer(i4) function element_at(o, x)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: x(3)  !! [m]
    type(spot_type) :: spot
    call o%cells%find(x, o%sets%part, spot)
    element_at = spot%element
  end function element_at

  !> The piece from a to b; one whose ends lie in two elements is halved.
  recursive subroutine add_piece(o, a, b, ea, eb, left, force, couple, average, branch)
    type(overlap_type), intent(in) :: o
    real(wp), intent(in) :: a(3), b(3)            !! [m]
    integer(i4), intent(in) :: ea, eb, left       !! elements at the ends, halvings left
    real(wp), intent(in) :: force(3), couple(3)   !! [N], [N m]
    type(pack_average_type), intent(inout) :: average
    real(wp), intent(inout) :: branch(3)
    real(wp) :: middle(3), piece(3)
    integer(i4) :: em, k

    middle = 0.5_wp*(a + b)
    em = ea
    if (ea /= eb) em = element_at(o, middle)
    if (ea /= eb .and. left > 0) then
      call add_piece(o, a, middle, ea, em, left - 1, force, couple, average, branch)
      call add_piece(o, middle, b, em, eb, left - 1, force, couple, average, branch)
      return
    end if
    piece = ramp_at(o, em, middle)*(b - a)
    if (.not. any(abs(piece) > 0.0_wp)) return
    if (o%sets%part(em) == part_free) branch = branch + piece
    do k = 1, 3
      associate (row => average%stress(3*k - 2:3*k, em), turn => average%couple(3*k - 2:3*k, em))
        row = row + piece(k)*force
        turn = turn + piece(k)*couple
      end associate
    end do
  end subroutine add_piece

  !> Means over the nodes' elements, then over the elements' nodes, for the elements of ghosts.
  subroutine smooth(o, average)
    type(overlap_type), intent(in) :: o
    type(pack_average_type), intent(inout) :: average
    logical :: ghosts(o%cells%elements), found(o%cells%elements)
    ghosts = o%sets%part == part_ghost
    call smooth_over_nodes(o%cells, average%volume, ghosts, average%stress, found)
    call smooth_over_nodes(o%cells, average%volume, ghosts, average%couple, found)
    average%own = merge(found, average%volume > 0.0_wp, ghosts)
  end subroutine smooth

  !> Values of some elements become means over all that share their nodes, by volumes: over the
  !! elements of a node, then over the nodes. `found`: there are such.
  subroutine smooth_over_nodes(cells, volume, chosen, value, found)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: volume(:)         !! (elements) [m^3]
    logical, intent(in) :: chosen(:)          !! (elements)
    real(wp), intent(inout) :: value(:, :)    !! (n, elements)
    logical, intent(out) :: found(:)          !! (elements)
    real(wp) :: around(cells%nodes), sums(size(value, 1), cells%nodes), whole
    integer(i4) :: e, a

    around = 0.0_wp
    sums = 0.0_wp
    do e = 1, cells%elements
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        do a = 1, size(node)
          around(node(a)) = around(node(a)) + volume(e)
          sums(:, node(a)) = sums(:, node(a)) + volume(e)*value(:, e)
        end do
      end associate
    end do
    found = .false.
    do e = 1, cells%elements
      if (.not. chosen(e)) cycle
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        whole = sum(around(node))
        found(e) = whole > 0.0_wp
        if (found(e)) value(:, e) = sum(sums(:, node), 2)/whole
      end associate
    end do
  end subroutine smooth_over_nodes

  !> Fit over the elements that are known: a constant, or with gravity a line along it. Couple
  !! stress is not carried beyond the grains.
  subroutine extend_average(cells, gravity, average)
    type(cells_type), intent(in) :: cells
    real(wp), intent(in) :: gravity(3)  !! [m/s^2]
    type(pack_average_type), intent(inout) :: average
    real(wp) :: w(cells%elements), z(cells%elements), middle(3, cells%elements), spread_of
    integer(i4) :: e, k

    do e = 1, cells%elements
      associate (node => cells%node(cells%start(e):cells%start(e + 1) - 1))
        middle(:, e) = sum(cells%x(:, node), 2)/size(node)
      end associate
    end do
    w = merge(average%volume, 0.0_wp, average%own)
    if (.not. any(w > 0.0_wp)) return
    average%middle = matmul(middle, w)/sum(w)
    average%mean = matmul(average%stress, w)/sum(w)
    if (.not. norm2(gravity) > 0.0_wp) return
    average%down = gravity/norm2(gravity)
    do e = 1, cells%elements
      z(e) = dot_product(average%down, middle(:, e) - average%middle)
    end do
    spread_of = sum(w*z**2)/sum(w)
    if (spread_of <= flat*(maxval(z) - minval(z))**2) return
    do k = 1, 9
      average%slope(k) = sum(w*z*(average%stress(k, :) - average%mean(k)))/sum(w)/spread_of
    end do
  end subroutine extend_average

  !> Stress and couple stress for a point of element e: the element's own, or the fit.
  pure subroutine stress_at(average, e, x, stress, couple)
    type(pack_average_type), intent(in) :: average
    integer(i4), intent(in) :: e
    real(wp), intent(in) :: x(3)                    !! [m]
    real(wp), intent(out) :: stress(9), couple(9)   !! [Pa], [N/m]
    if (average%own(e)) then
      stress = average%stress(:, e)
      couple = average%couple(:, e)
    else
      stress = average%mean + dot_product(average%down, x - average%middle)*average%slope
      couple = 0.0_wp
    end if
  end subroutine stress_at
end module cpl_homogenise
