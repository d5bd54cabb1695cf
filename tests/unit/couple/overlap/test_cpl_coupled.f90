!> The operator whose highest frequency limits the step in an overlap: symmetric, blind to rigid
!! motion, and its frequency against a dense solution, with grains that turn, elements classical and
!! micropolar, masses carried by nodes and transferred.
program test_cpl_coupled
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_homogenise, only: cross
  use talus_test, only: larger, max_abs, test_type
  use cpl_choices, only: rotation_curl, rotation_micro
  use cpl_coupled, only: coupled_type, motion_type
  use cpl_elements, only: hex8
  use cpl_operators, only: map_choice_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_limit, only: highest_frequency, mode_type
  use cpl_overlap_mass, only: share_mass
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_sets, only: part_rest, part_ghost, part_free
  implicit none

  integer(i4), parameter :: slices = 6, per_edge = 2, layers = 10  !! elements, grains
  real(wp), parameter :: d = 0.01_wp, h = per_edge*d  !! [m]
  type(test_type) :: test

  call whole('classical, carried', .false., 'consistent')
  call whole('classical, handed over', .false., 'projected')
  call whole('micropolar, carried', .true., 'consistent')
  call test%finish()

contains

  subroutine whole(name, polar, mass)
    character(len=*), intent(in) :: name, mass
    logical, intent(in) :: polar
    type(overlap_type) :: o
    type(contacts_type) :: contacts
    type(points_type) :: points
    type(coupled_type) :: coupled
    type(error_list_type) :: errors

    call make_mesh(o, polar)
    call make_grains(o)
    call o%sets%sort(o%cells, o%pack, errors)
    call o%op%build(o%cells, o%sets, o%pack, map_choice_type(merge(rotation_micro, &
      rotation_curl, polar)), errors)
    o%rules%turns = polar
    call o%allocate_state()
    call share_mass(o, mass, errors)
    call test%check(name//': made', .not. errors%any())
    if (errors%any()) return
    call make_contacts(o, contacts)
    call make_points(o, polar, points)
    allocate (o%share%beta(size(points%element)), source=0.7_wp)
    where (o%sets%part(points%element) == part_free) o%share%beta = 0.0_wp
    call coupled%build(o, contacts, points, o%pack%slimmest)
    call symmetric(name, o, coupled)
    call rigid(name, o, coupled)
    call frequency(name, o, coupled)
    call kicks(name, o, contacts, points)
  end subroutine whole

  !> What acts in kicks is the layer of ghosts but for contacts with free grains and elements with
  !! prescribed nodes: kicks and steps add up alike with and without contacts between ghosts.
  subroutine kicks(name, o, contacts, points)
    character(len=*), intent(in) :: name
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(in) :: contacts
    type(points_type), intent(in) :: points
    type(contacts_type) :: fewer
    type(coupled_type) :: every, kick, without, elements
    type(motion_type) :: y, all_steps, all_kicks, some_steps, some_kicks
    logical :: ghost(size(o%pack%id))
    integer(i4), allocatable :: kept(:)
    real(wp) :: most
    integer(i4) :: c

    ghost = .false.
    ghost(o%sets%ghost) = .true.
    kept = pack([(c, c=1, int(size(contacts%ids, 2), i4))], &
                .not. (ghost(contacts%ids(1, :)) .and. ghost(contacts%ids(2, :))))
    fewer%ids = contacts%ids(:, kept)
    fewer%normal = contacts%normal(:, kept)
    fewer%point = contacts%point(:, kept)
    fewer%stiffness = contacts%stiffness(:, kept)
    call every%build(o, contacts, points, o%pack%slimmest)
    call kick%build(o, contacts, points, o%pack%slimmest, .true.)
    call without%build(o, fewer, points, o%pack%slimmest)
    call elements%build(o, fewer, points, o%pack%slimmest, .true.)
    call symmetric(name//', kicks', o, kick)
    call rigid(name//', kicks', o, kick)
    call frequency(name//', kicks', o, kick)
    call scatter(o, every, 0.8_wp, y)
    call every%stiffness_times(o, y, all_steps)
    call kick%stiffness_times(o, y, all_kicks)
    call without%stiffness_times(o, y, some_steps)
    call elements%stiffness_times(o, y, some_kicks)
    most = max_abs(all_steps%u)
    call test%check(name//': kicks are not nothing', max_abs(some_kicks%u) > 0.0_wp .and. &
                    max_abs(all_kicks%u - some_kicks%u) > 1.0e-6_wp*most)
    call test%check_close(name//': kicks and steps, nodes', max_abs(all_steps%u &
      + some_kicks%u - all_kicks%u - some_steps%u)/most, 0.0_wp, 1.0e-12_wp)
    call test%check_close(name//': kicks and steps, grains', max_abs(all_steps%q &
      + some_kicks%q - all_kicks%q - some_steps%q)/max_abs(all_steps%q), 0.0_wp, 1.0e-12_wp)
  end subroutine kicks

  !> A bar of elements along x: two of free grains, two of ghosts, two of continuum.
  subroutine make_mesh(o, polar)
    type(overlap_type), intent(inout) :: o
    logical, intent(in) :: polar
    integer(i4) :: s, a
    associate (c => o%cells)
      c%nodes = 4*(slices + 1)
      c%elements = slices
      allocate (c%x(3, c%nodes), c%node(8*slices))
      do s = 0, slices
        do a = 1, 4
          c%x(:, 4*s + a) = h*[real(s, wp), merge(1.0_wp, 0.0_wp, a == 2 .or. a == 3), &
                               merge(1.0_wp, 0.0_wp, a > 2)]
        end do
      end do
      do s = 1, slices
        c%node(8*s - 7:8*s) = 4*(s - 1) + [1, 5, 6, 2, 4, 8, 7, 3]
      end do
      c%kind = [(hex8, s=1, slices)]
      c%start = [(8*s + 1, s=0, slices)]
      allocate (c%polar(c%nodes), source=polar)
      allocate (c%mass(c%nodes), source=0.002_wp)
      allocate (c%inertia(c%nodes), source=merge(4.0e-8_wp, 0.0_wp, polar))
      call c%prepare()
    end associate
    o%sets%part = [part_free, part_free, part_ghost, part_ghost, part_rest, part_rest]
  end subroutine make_mesh

  !> A square lattice: a layer before the mesh, then up to the end of the ghosts.
  subroutine make_grains(o)
    type(overlap_type), intent(inout) :: o
    integer(i4), parameter :: n = 4*layers
    integer(i4) :: i, j
    associate (p => o%pack)
      allocate (p%x(3, n))
      do i = 1, layers
        do j = 0, 3
          p%x(:, 4*i - 3 + j) = d*[i - 2.5_wp, j/2 + 0.5_wp, mod(j, 2) + 0.5_wp]
        end do
      end do
      p%id = [(int(i, i8), i=1, n)]
      allocate (p%radius(n), source=0.5_wp*d)
      p%mass = [(1.0e-3_wp*(1.0_wp + 0.2_wp*sin(1.0_wp*i)), i=1, n)]
      p%inertia = 0.1_wp*p%mass*d**2
      p%slimmest = p%inertia
      p%volume = p%mass/2500.0_wp
      allocate (p%kind(n), source=0_i4)
      allocate (p%round(n), source=.true.)
      allocate (p%quat(4, n), source=0.0_wp)
      p%quat(1, :) = 1.0_wp
    end associate
  end subroutine make_grains

  subroutine make_contacts(o, contacts)
    type(overlap_type), intent(in) :: o
    type(contacts_type), intent(inout) :: contacts
    integer(i4) :: i, j, n, pass
    real(wp) :: branch(3)
    do pass = 1, 2
      n = 0
      do i = 1, size(o%pack%id)
        do j = i + 1, size(o%pack%id)
          branch = o%pack%x(:, j) - o%pack%x(:, i)
          if (norm2(branch) > 1.01_wp*d) cycle
          n = n + 1
          if (pass == 1) cycle
          contacts%ids(:, n) = [o%pack%id(i), o%pack%id(j)]
          contacts%normal(:, n) = branch/norm2(branch)
          contacts%point(:, n) = o%pack%x(:, i) + 0.5_wp*branch
          contacts%stiffness(:, n) = [1.0e5_wp, 6.0e4_wp]
        end do
      end do
      if (pass == 1) allocate (contacts%ids(2, n), contacts%normal(3, n), contacts%point(3, n), &
                               contacts%stiffness(2, n))
    end do
  end subroutine make_contacts

  !> Eight points an element.
  subroutine make_points(o, polar, points)
    type(overlap_type), intent(in) :: o
    logical, intent(in) :: polar
    type(points_type), intent(inout) :: points
    real(wp), parameter :: g = 0.5_wp/sqrt(3.0_wp)
    integer(i4) :: e, q, n
    n = 8*slices
    allocate (points%x(3, n), points%element(n), points%moduli(6, slices))
    do e = 1, slices
      do q = 0, 7
        points%element(8*e - 7 + q) = e
        points%x(:, 8*e - 7 + q) = h*(0.5_wp + [e - 1.0_wp, 0.0_wp, 0.0_wp] &
          + g*[2*mod(q, 2) - 1, 2*mod(q/2, 2) - 1, 2*mod(q/4, 2) - 1])
      end do
      points%moduli(:, e) = [2.0e6_wp, 4.0e6_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
      if (polar) points%moduli(3:, e) = [3.0e6_wp, 10.0_wp, 20.0_wp, 80.0_wp]
    end do
    allocate (points%weight(n), source=h**3/8.0_wp)
    allocate (points%mean(slices), source=1_i4)
    if (size(o%cells%x, 2) == 0 .or. polar) points%mean = 0
  end subroutine make_points

  !> A motion of all that is free, of no special form.
  subroutine scatter(o, coupled, phase, y)
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    real(wp), intent(in) :: phase
    type(motion_type), intent(out) :: y
    integer(i4) :: k
    call coupled%start(o, y)
    y%q = y%q*phase + cos(phase)*cshift(y%q, 3, 2)
    y%q(:, o%sets%ghost) = 0.0_wp
    y%u(1, :) = [(sin(phase + k), k=1, size(y%u, 2))]
    y%phi(2, :) = [(cos(phase*k)/d, k=1, size(y%phi, 2))]
  end subroutine scatter

  pure real(wp) function product_of(o, y, r)
    type(overlap_type), intent(in) :: o
    type(motion_type), intent(in) :: y, r
    product_of = sum(y%q*r%q) + sum(y%theta*r%theta) &
      + sum(y%u(:, o%op%prescribed + 1:)*r%u(:, o%op%prescribed + 1:)) &
      + sum(y%phi(:, o%op%prescribed_phi + 1:)*r%phi(:, o%op%prescribed_phi + 1:))
  end function product_of

  subroutine symmetric(name, o, coupled)
    character(len=*), intent(in) :: name
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    type(motion_type) :: one, two, r1, r2
    real(wp) :: here, there
    call scatter(o, coupled, 0.4_wp, one)
    call scatter(o, coupled, 1.9_wp, two)
    call coupled%stiffness_times(o, one, r1)
    call coupled%stiffness_times(o, two, r2)
    here = product_of(o, one, r2)
    there = product_of(o, two, r1)
    call test%check_close(name//': symmetric', here/there, 1.0_wp, 1.0e-10_wp)
    call test%check(name//': positive', product_of(o, one, r1) > 0.0_wp)
    call coupled%accelerate(o, r1)
    call coupled%accelerate(o, r2)
    call scatter(o, coupled, 0.4_wp, one)
    call coupled%stiffness_times(o, one, two)
    here = product_of(o, r2, two)
    call scatter(o, coupled, 1.9_wp, one)
    call coupled%stiffness_times(o, one, two)
    call test%check_close(name//': accelerations', here/product_of(o, r1, two), 1.0_wp, 1.0e-10_wp)
  end subroutine symmetric

  !> Shifts and turns of all put no force on anything.
  subroutine rigid(name, o, coupled)
    character(len=*), intent(in) :: name
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    type(motion_type) :: y, r
    real(wp) :: axis(3), scale
    integer(i4) :: k, c
    do c = 1, 6
      axis = 0.0_wp
      axis(1 + mod(c - 1, 3)) = 1.0_wp
      call coupled%start(o, y)
      scale = 1.0e5_wp*merge(1.0_wp, 10.0_wp*d, c <= 3)
      do k = 1, size(y%q, 2)
        y%q(:, k) = axis
        if (c > 3) y%q(:, k) = cross(axis, o%pack%x(:, k))
        y%theta(:, k) = merge(axis, 0.0_wp, c > 3)
      end do
      do k = 1, size(y%u, 2)
        y%u(:, k) = axis
        if (c > 3) y%u(:, k) = cross(axis, o%map%x_node(:, k))
      end do
      y%phi = spread(merge(axis, 0.0_wp, c > 3), 2, size(y%phi, 2))
      call coupled%stiffness_times(o, y, r)
      call test%check(name//': rigid motion is free', larger(max_abs(r%q), max_abs(r%u)) &
                      < 1.0e-11_wp*scale)
      call test%check(name//': and without moments', max_abs(r%theta) < 1.0e-11_wp*scale)
    end do
  end subroutine rigid

  !> The quotient is that of an eigenvector: what it finds must remain when iterated alone.
  subroutine frequency(name, o, coupled)
    character(len=*), intent(in) :: name
    type(overlap_type), intent(in) :: o
    type(coupled_type), intent(in) :: coupled
    type(mode_type) :: mode
    type(motion_type) :: y, r, a
    real(wp) :: square, largest
    integer(i4) :: k
    mode = highest_frequency(o, coupled)
    call coupled%start(o, y)
    do k = 1, 3000
      call coupled%stiffness_times(o, y, r)
      a = r
      call coupled%accelerate(o, a)
      square = product_of(o, a, r)/product_of(o, y, r)
      largest = larger(max_abs(a%q), max_abs(a%u))
      y%q = a%q/largest
      y%theta = a%theta/largest
      y%u = a%u/largest
      y%phi = a%phi/largest
    end do
    call test%check(name//': not above the highest', mode%omega <= sqrt(square)*(1.0_wp + 1e-9_wp))
    call test%check_close(name//': within a percent', mode%omega/sqrt(square), 1.0_wp, 0.01_wp)
    call test%check(name//': names one', mode%grain > 0 .or. mode%node > 0)
  end subroutine frequency
end program test_cpl_coupled
