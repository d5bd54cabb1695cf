!> Stress and density of the grains in elements that are born again: a column of a cubic lattice
!! whose force along it grows with depth, up to its ends, where the mean of an element is that in
!! its middle; elements that are not open do not count.
program test_cpl_reborn
  use talus_kinds, only: wp, i4, i8
  use talus_test, only: test_type
  use cpl_cells, only: cells_type
  use cpl_overlap_partition, only: contacts_type
  use cpl_reborn, only: average_grains
  use cpl_sets, only: pack_type
  implicit none

  integer(i4), parameter :: elements = 4_i4, high = 12_i4  !! elements, grains along the column
  real(wp), parameter :: h = 3.0_wp, force = 0.3_wp, mass = 2.0_wp
  real(wp), parameter :: down(3) = [0.0_wp, 0.0_wp, -9.81_wp]
  type(test_type) :: test
  type(cells_type) :: cells
  type(pack_type) :: pack_of
  type(contacts_type) :: contacts

  call make_mesh()
  call make_pack()
  call check_column('even', 0.0_wp, 0.0_wp*down)
  call check_column('deep', 0.1_wp, down)
  call check_closed()
  call test%finish()

contains

  !> Elements of the edge h in a column along z.
  subroutine make_mesh()
    integer(i4), parameter :: corner(2, 4) = reshape([0, 0, 1, 0, 1, 1, 0, 1], [2, 4])
    integer(i4) :: e, a, k
    cells%nodes = 4*(elements + 1)
    cells%elements = elements
    allocate (cells%x(3, cells%nodes), cells%kind(elements), cells%start(elements + 1))
    allocate (cells%polar(cells%nodes), source=.false.)
    cells%kind = 1
    do k = 0, elements
      do a = 1, 4
        cells%x(:, 4*k + a) = h*[corner(1, a), corner(2, a), k]
      end do
    end do
    cells%start = [(8*e - 7, e=1, elements + 1)]
    cells%node = [((4*e - 4 + a, a=1, 8), e=1, elements)]
    call cells%prepare()
  end subroutine make_mesh

  !> Grains of diameter 1 that touch above one another, the lowest and the highest a wall.
  subroutine make_pack()
    integer(i4) :: i, k, n, g
    n = 9*high
    pack_of%id = [(int(7*i, i8), i=1, n)]
    pack_of%radius = spread(0.5_wp, 1, n)
    pack_of%mass = spread(mass, 1, n)
    allocate (pack_of%x(3, n), contacts%ids(2, n + 9), contacts%point(3, n + 9), &
              contacts%force(3, n + 9))
    contacts%force = 0.0_wp
    do k = 1, high + 1
      do i = 0, 8
        g = 9*(k - 1) + i + 1
        contacts%point(:, g) = [mod(i, 3) + 0.5_wp, i/3 + 0.5_wp, k - 1.0_wp]
        contacts%ids(:, g) = 7*[g - 9, g]
        if (k == 1) contacts%ids(1, g) = 0
        if (k > high) contacts%ids(:, g) = [0, 7*(g - 9)]
        if (k <= high) pack_of%x(:, g) = contacts%point(:, g) + [0.0_wp, 0.0_wp, 0.5_wp]
      end do
    end do
  end subroutine make_pack

  !> Force at a height: on the first grain, away from the second; the wall above is the first.
  subroutine press(slope)
    real(wp), intent(in) :: slope
    integer(i4) :: g
    do g = 1, size(contacts%force, 2)
      contacts%force(3, g) = -force*(1.0_wp + slope*(high - contacts%point(3, g)))
      if (g > 9*high) contacts%force(3, g) = -contacts%force(3, g)
    end do
  end subroutine press

  subroutine check_column(name, slope, gravity)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: slope, gravity(3)
    real(wp) :: average(7, elements)
    integer(i4) :: e
    call press(slope)
    call average_grains(cells, spread(.true., 1, elements), spread(.true., 1, elements), gravity, &
                        pack_of, contacts, average)
    do e = 1, elements
      call test%check_close(name//': stress of an element', average(3, e), &
        -force*(1.0_wp + slope*(high - h*(e - 0.5_wp))), 1.0e-12_wp)
    end do
    call test%check_all_close(name//': no other', average([1, 2, 4, 5, 6], :), 0.0_wp, 1.0e-12_wp)
    call test%check_all_close(name//': density', average(7, :), mass, 1.0e-12_wp)
  end subroutine check_column

  !> An element that is not open, whose contacts may be missing, has no part in its neighbour.
  subroutine check_closed()
    real(wp) :: average(7, elements), own(7, elements)
    logical :: open(elements), chosen(elements)
    integer(i4) :: g
    call press(0.0_wp)
    open = [.true., .true., .true., .false.]
    chosen = [.false., .false., .true., .false.]
    call average_grains(cells, open, chosen, 0.0_wp*down, pack_of, contacts, own)
    do g = 1, size(contacts%force, 2)
      if (contacts%point(3, g) > 3.2_wp*h) contacts%force(:, g) = 0.0_wp
    end do
    call average_grains(cells, open, chosen, 0.0_wp*down, pack_of, contacts, average)
    call test%check_close('whole', own(3, 3), -force, 1.0e-12_wp)
    call test%check_close('without what is missing', average(3, 3), -force, 1.0e-12_wp)
  end subroutine check_closed
end program test_cpl_reborn
