!> Stress, moduli and couple stress of a simple cubic lattice in a column of elements, against their
!! closed forms, and the fit beyond the grains.
program test_cpl_homogenise
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use talus_errors, only: error_list_type
  use talus_files, only: remove_file
  use cpl_homogenise, only: pack_average_type, average_pack, extend_average, stress_at
  use cpl_moduli, only: read_probe
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: contacts_type, points_type
  use cpl_sets, only: part_rest, part_ghost, part_free
  implicit none

  integer(i4), parameter :: across = 3_i4, below = 2_i4, above = 6_i4  !! grains
  integer(i4), parameter :: elements = 4_i4
  real(wp), parameter :: h = 3.0_wp, kn = 2.0_wp, ks = 0.7_wp, force = 0.3_wp
  type(test_type) :: test

  call test_lattice(0.0_wp)
  call test_lattice(0.1_wp)
  call test_probe()
  call test%finish()

contains

  !> Compression along z, more with depth (slope, per length): stress and moduli of the element of
  !! free grains, of that of the ghosts, and of those beyond.
  subroutine test_lattice(slope)
    real(wp), intent(in) :: slope
    type(overlap_type) :: o
    type(contacts_type) :: contacts
    type(points_type) :: points
    type(pack_average_type) :: average
    type(error_list_type) :: errors
    real(wp) :: stress(9), couple(9), wanted
    real(wp), parameter :: down(3) = [0.0_wp, 0.0_wp, -1.0_wp]

    call make_mesh(o, points)
    call make_pack(o, slope, contacts)
    call o%sets%sort(o%cells, o%pack, errors)
    call test%check('the sets are good', .not. errors%any())
    if (errors%any()) return
    call average_pack(o, contacts, points, average)
    call extend_average(o%cells, merge(down, 0.0_wp, slope > 0.0_wp), average)
    wanted = -force*(1.0_wp + slope*(0.5_wp*h))
    call test%check_close('stress under free grains', average%stress(9, 1), wanted, 1.0e-9_wp)
    call test%check_all_close('no shear', average%stress(:8, 1), 0.0_wp, 1.0e-14_wp)
    call test%check_all_close('equal spheres have no couple stress', average%couple, &
                          0.0_wp, 1.0e-14_wp)
    call test%check_close('all of the first element', average%share(1), 1.0_wp, 1.0e-12_wp)
    call test%check_close('share of the ghosts', average%share(2), 1.0_wp/3.0_wp, 1.0e-12_wp)
    if (slope > 0.0_wp) then
      call stress_at(average, 4_i4, [1.5_wp, 1.5_wp, 10.0_wp], stress, couple)
      call test%check('stress grows beyond', stress(9) < average%stress(9, 1))
    else
      call test%check_close('stress under ghosts', average%stress(9, 2), wanted, 1.0e-9_wp)
      call stress_at(average, 4_i4, [1.5_wp, 1.5_wp, 10.0_wp], stress, couple)
      call test%check_close('stress beyond', stress(9), wanted, 1.0e-9_wp)
    end if
    call test%check_close('shear modulus', average%affine%shear, wanted_shear(), 1.0e-12_wp)
  end subroutine test_lattice

  !> The projection is the same for all directions: 7/3 contacts in a unit of volume.
  pure real(wp) function wanted_shear()
    wanted_shear = (2.0_wp*kn + 3.0_wp*ks)*7.0_wp/90.0_wp
  end function wanted_shear

  !> A column of four cubes: free grains, ghosts, nothing, nothing.
  subroutine make_mesh(o, points)
    type(overlap_type), intent(inout) :: o
    type(points_type), intent(inout) :: points
    integer(i4), parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, &
                                                      0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
    integer(i4) :: e, a, k
    associate (c => o%cells)
      c%nodes = 4*(elements + 1)
      c%elements = elements
      allocate (c%x(3, c%nodes), c%kind(elements), c%start(elements + 1), c%node(8*elements))
      allocate (c%polar(c%nodes), source=.false.)
      c%kind = 1
      do k = 0, elements
        do a = 1, 4
          c%x(:, 4*k + a) = h*[corner(1, a), corner(2, a), k]
        end do
      end do
      do e = 1, elements
        c%start(e) = 8*e - 7
        c%node(8*e - 7:8*e) = [(4*e - 4 + a, a=1, 8)]
      end do
      c%start(elements + 1) = 8*elements + 1
      call c%prepare()
    end associate
    o%sets%part = [part_free, part_ghost, part_rest, part_rest]
    points%element = [(e, e=1, elements)]
    points%weight = [(h**3, e=1, elements)]
  end subroutine make_mesh

  !> Grains of diameter 1 and their contacts, without those to the sides of the column.
  subroutine make_pack(o, slope, contacts)
    type(overlap_type), intent(inout) :: o
    real(wp), intent(in) :: slope
    type(contacts_type), intent(inout) :: contacts
    integer(i4) :: n, m, i, j, k
    n = across**2*(below + above)
    associate (p => o%pack)
      p%id = [(int(i, i8), i=1, n)]
      allocate (p%x(3, n))
      p%radius = [(0.5_wp, i=1, n)]
      p%mass = p%radius
      p%inertia = p%radius
      p%volume = p%radius
      p%kind = [(0_i4, i=1, n)]
      p%round = [(.true., i=1, n)]
    end associate
    allocate (contacts%ids(2, 3*n), contacts%point(3, 3*n), contacts%normal(3, 3*n), &
              contacts%stiffness(2, 3*n), contacts%force(3, 3*n))
    m = 0
    do k = 1, below + above
      do j = 1, across
        do i = 1, across
          o%pack%x(:, number(i, j, k)) = [i, j, k - below] - 0.5_wp
          call add_contacts([i, j, k], slope, o%pack%x(:, number(i, j, k)), contacts, m)
        end do
      end do
    end do
    contacts%ids = contacts%ids(:, :m)
    contacts%point = contacts%point(:, :m)
    contacts%normal = contacts%normal(:, :m)
    contacts%stiffness = contacts%stiffness(:, :m)
    contacts%force = contacts%force(:, :m)
  end subroutine make_pack

  !> The contacts of a grain at x with those behind it along the axes.
  subroutine add_contacts(at, slope, x, contacts, m)
    integer(i4), intent(in) :: at(3)  !! of the grain in the lattice
    real(wp), intent(in) :: slope, x(3)
    type(contacts_type), intent(inout) :: contacts
    integer(i4), intent(inout) :: m   !! contacts so far
    integer(i4) :: axis, step(3), other(3)

    do axis = 1, 3
      step = 0
      step(axis) = 1
      other = at + step
      if (any(other > [across, across, below + above])) cycle
      m = m + 1
      contacts%ids(:, m) = [number(at(1), at(2), at(3)), number(other(1), other(2), other(3))]
      contacts%point(:, m) = x + 0.5_wp*step
      contacts%normal(:, m) = step
      contacts%stiffness(:, m) = [kn, ks]
      contacts%force(:, m) = 0.0_wp
      if (axis == 3) contacts%force(3, m) = -force*(1.0_wp + slope*contacts%point(3, m))
    end do
  end subroutine add_contacts

  pure integer(i4) function number(i, j, k)
    integer(i4), intent(in) :: i, j, k
    number = i + across*(j - 1 + across*(k - 1))
  end function number

  !> Files of probed moduli, good and bad.
  subroutine test_probe()
    type(error_list_type) :: errors
    real(wp) :: lambda, shear
    call put('{"format": "talus-probe", "probed": {"bulk_Pa": 3.0, "shear_Pa": 1.5e8, '// &
             '"lambda_Pa": 2.25e8, "stiffness_Pa": {"xx": [1]}}, "affine": {"shear_Pa": 9}}')
    call read_probe('probe.json', lambda, shear, errors)
    call test%check('a good file', .not. errors%any())
    call test%check_close('lambda', lambda, 2.25e8_wp, 1.0e-3_wp)
    call test%check_close('shear', shear, 1.5e8_wp, 1.0e-3_wp)
    call put('{"format": "talus-probe", "affine": {"shear_Pa": 9, "lambda_Pa": 9}}')
    call read_probe('probe.json', lambda, shear, errors)
    call test%check_text('without probes', errors%item(1)%code, 'I444')
    call errors%clear()
    call put('{"format": "talus-probe", "probed": {"shear_Pa": null, "lambda_Pa": 9}}')
    call read_probe('probe.json', lambda, shear, errors)
    call test%check_text('no number', errors%item(1)%code, 'I444')
    call remove_file('probe.json')
  end subroutine test_probe

  subroutine put(text)
    character(len=*), intent(in) :: text
    integer :: unit
    open (newunit=unit, file='probe.json', status='replace')
    write (unit, '(a)') text
    close (unit)
  end subroutine put
end program test_cpl_homogenise
