!> Which rank has which elements, by METIS (5.1, 32-bit indices): parts of about the same work
!! that share few faces, and the blocks that the parts share.
module fem_partition
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr, c_null_ptr
  use talus_kinds, only: i4, i8
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_halo, only: fem_halo_type
  use fem_types, only: fem_mesh_type
  implicit none
  private
  public :: part_elements, make_halo, rank_of, blocks_of_part

  integer(c_int), parameter :: metis_ok = 1
  integer(c_int), parameter :: face_nodes = 3  !! that two elements share at least
  integer(i8), parameter :: light = 64_i8      !! points times nodes^2 that count as one

  interface
    integer(c_int) function metis_part(ne, nn, eptr, eind, vwgt, vsize, ncommon, nparts, &
      tpwgts, options, objval, epart, npart) bind(c, name='METIS_PartMeshDual')
      import :: c_int, c_ptr
      integer(c_int), intent(in) :: ne, nn, ncommon, nparts
      integer(c_int), intent(inout) :: eptr(*), eind(*), vwgt(*)
      type(c_ptr), value :: vsize, tpwgts, options
      integer(c_int), intent(out) :: objval, epart(*), npart(*)
    end function metis_part
  end interface

contains

  !> Rank of each element, from 0; each rank has one at least where there are enough.
  subroutine part_elements(mesh, elastic, ranks, part)
    type(fem_mesh_type), intent(in) :: mesh
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: ranks
    integer(i4), allocatable, intent(out) :: part(:)  !! (elements)
    integer(c_int), allocatable :: eptr(:), eind(:), work(:), epart(:), npart(:)
    integer(c_int) :: cut, status
    integer(i4) :: e

    allocate (eptr, source=int(mesh%start - 1, c_int))
    allocate (eind, source=int(mesh%node - 1, c_int))
    allocate (work(mesh%elements), epart(mesh%elements), npart(mesh%nodes))
    do e = 1, mesh%elements
      work(e) = int(max(1_i8, (elastic%point(e + 1) - elastic%point(e))* &
                        int(mesh%start(e + 1) - mesh%start(e), i8)**2/light), c_int)
    end do
    status = metis_part(int(mesh%elements, c_int), int(mesh%nodes, c_int), eptr, eind, work, &
      c_null_ptr, face_nodes, int(ranks, c_int), c_null_ptr, c_null_ptr, cut, epart, npart)
    part = int(epart, i4)
    if (status == metis_ok .and. all([(any(part == e), e=0, ranks - 1)])) return
    part = [(int((e - 1)*int(ranks, i8)/mesh%elements, i4), e=1, mesh%elements)]
  end subroutine part_elements

  !> The blocks of each rank's elements. The first rank that holds a block owns it.
  subroutine make_halo(dofs, part, halo)
    type(fem_dofs_type), intent(in) :: dofs  !! of all elements
    integer(i4), intent(in) :: part(:)       !! (elements)
    type(fem_halo_type), intent(inout) :: halo
    integer(i4), allocatable :: owner(:)
    logical, allocatable :: here(:), there(:), common(:)
    integer(i4) :: r

    allocate (owner(dofs%blocks), source=-1)
    allocate (here(dofs%blocks), there(dofs%blocks))
    allocate (common(dofs%blocks), source=.false.)
    allocate (halo%first(0:halo%ranks), halo%first_own(0:halo%ranks))
    allocate (halo%shared(0), halo%own(0))
    call blocks_of_part(dofs, part, halo%rank, here)
    halo%first(0) = 1
    halo%first_own(0) = 1
    do r = 0, halo%ranks - 1
      call blocks_of_part(dofs, part, r, there)
      call append(there .and. owner < 0, halo%own)
      where (there .and. owner < 0) owner = r
      halo%first_own(r + 1) = size(halo%own) + 1
      there = there .and. here
      if (r /= halo%rank) then
        common = common .or. there
        call append(there, halo%shared)
      end if
      halo%first(r + 1) = size(halo%shared) + 1
    end do
    allocate (halo%common(0))
    call append(common, halo%common)
    halo%mine = owner == halo%rank
  end subroutine make_halo

  !> Which blocks have the elements of rank r?
  pure subroutine blocks_of_part(dofs, part, r, there)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:), r
    logical, intent(out) :: there(:)
    integer(i4) :: e
    there = .false.
    do e = 1, size(part)
      if (part(e) == r) there(dofs%block(dofs%start(e):dofs%start(e + 1) - 1)) = .true.
    end do
  end subroutine blocks_of_part

  !> Rank of the first element that has all of some blocks.
  pure integer(i4) function rank_of(dofs, part, first, list, blocks)
    type(fem_dofs_type), intent(in) :: dofs
    integer(i4), intent(in) :: part(:), first(:), list(:), blocks(:)
    integer(i4) :: k, a
    logical :: all_there
    rank_of = 0
    do k = first(blocks(1)), first(blocks(1) + 1) - 1
      associate (e => list(k))
        all_there = .true.
        do a = 2, size(blocks)
          all_there = all_there .and. &
                      any(dofs%block(dofs%start(e):dofs%start(e + 1) - 1) == blocks(a))
        end do
        rank_of = part(e)
        if (all_there) return
      end associate
    end do
  end function rank_of

  !> Append the numbers of the true ones.
  pure subroutine append(which, list)
    logical, intent(in) :: which(:)
    integer(i4), allocatable, intent(inout) :: list(:)
    integer(i4), allocatable :: longer(:)
    integer(i4) :: i, n
    n = size(list)
    allocate (longer(n + count(which)))
    longer(:n) = list
    do i = 1, size(which)
      if (.not. which(i)) cycle
      n = n + 1
      longer(n) = i
    end do
    call move_alloc(longer, list)
  end subroutine append
end module fem_partition
