!> Distribute the elements of a body to the ranks, once the deck is read: each has its own with
!! their points and states, and all nodes.
module fem_distribute
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use fem_body, only: fem_body_type
  use fem_dofs, only: fem_dofs_type
  use fem_elastic, only: fem_elastic_type
  use fem_partition, only: part_elements, make_halo, rank_of
  use talus_ranks, only: ranks_type
  use fem_sparse, only: elements_of_blocks
  use fem_stages, only: fem_stages_type
  use fem_types, only: fem_mesh_type, group_volume
  implicit none
  private
  public :: share_out, list_laws

contains

  !> Restrict this rank to its elements; fault I309 where ranks would have none.
  subroutine share_out(body, ranks, errors)
    type(fem_body_type), intent(inout) :: body
    type(ranks_type), intent(in) :: ranks
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: part(:), mine(:)
    integer(i4) :: e

    if (.not. ranks%several()) return
    if (body%mesh%elements < ranks%ranks) then
      call errors%add('I309', str(ranks%ranks)//' ranks are more than the '// &
        str(body%mesh%elements)//' elements of the mesh', '', 'start fewer')
      return
    end if
    if (ranks%leads()) then
      call part_elements(body%mesh, body%elastic, ranks%ranks, part)
      body%whole%mesh = body%mesh
      body%system%solver%whole = body%dofs
    else
      allocate (part(body%mesh%elements))
    end if
    call ranks%broadcast_numbers(part)
    mine = pack([(e, e=1, body%mesh%elements)], part == ranks%rank)
    body%dofs%halo%ranks_type = ranks
    call make_halo(body%dofs, part, body%dofs%halo)
    call own_surfaces(body, part)
    body%whole%ranks = ranks
    body%matter%ranks = ranks
    body%whole%point = body%elastic%point
    if (allocated(body%matter%law_of)) then
      call list_laws(body%matter%law_of, body%whole%laws)
      body%matter%law_of = body%matter%law_of(mine)
    end if
    if (body%matter%micro%active) body%matter%micro%law_of = body%matter%micro%law_of(mine)
    if (allocated(body%matter%stress)) then
      call keep_columns(body%elastic%point, mine, body%matter%stress)
      call keep_columns(body%elastic%point, mine, body%matter%state)
    end if
    call keep_elastic(body%elastic, mine)
    if (body%stages%active) call keep_stages(body%whole%point, mine, body%elastic, body%stages)
    call keep_mesh(body%mesh, mine)
    call keep_dofs(body%dofs, mine)
    call move_alloc(part, body%whole%part)
  end subroutine share_out

  !> The laws that some element has.
  pure subroutine list_laws(law_of, laws)
    integer(i4), intent(in) :: law_of(:)
    integer(i4), allocatable, intent(out) :: laws(:)
    integer(i4) :: m
    laws = pack([(m, m=1, maxval(law_of))], [(any(law_of == m), m=1, maxval(law_of))])
  end subroutine list_laws

  !> Springs and pressures on facets belong to the rank that has their element.
  subroutine own_surfaces(body, part)
    type(fem_body_type), intent(inout) :: body
    integer(i4), intent(in) :: part(:)
    integer(i4), allocatable :: first(:), list(:)
    integer(i4) :: s, f, n
    if (body%supports%ground%n == 0 .and. .not. allocated(body%loads%follower)) return
    call elements_of_blocks(body%dofs, first, list)
    allocate (body%supports%ground%here(body%supports%ground%n))
    do s = 1, body%supports%ground%n
      n = rank_of(body%dofs, part, first, list, &
                  pack(body%supports%ground%node(:, s), abs(body%supports%ground%weight(:, &
                    s)) > 0.0_wp))
      body%supports%ground%here(s) = n == body%dofs%halo%rank
    end do
    if (.not. allocated(body%loads%follower)) return
    do s = 1, size(body%loads%follower)
      associate (facet => body%mesh%group(body%loads%follower(s)%group)%facet)
        allocate (body%loads%follower(s)%here(size(facet, 2)))
        do f = 1, size(facet, 2)
          n = rank_of(body%dofs, part, first, list, pack(facet(:, f), facet(:, f) > 0))
          body%loads%follower(s)%here(f) = n == body%dofs%halo%rank
        end do
      end associate
    end do
  end subroutine own_surfaces

  !> Columns of the points of some elements.
  pure subroutine keep_columns(point, mine, values)
    integer(i4), intent(in) :: point(:), mine(:)
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: kept(:, :)
    integer(i4) :: k, n, m
    allocate (kept(size(values, 1), sum(point(mine + 1) - point(mine))))
    n = 0
    do k = 1, size(mine)
      m = point(mine(k) + 1) - point(mine(k))
      kept(:, n + 1:n + m) = values(:, point(mine(k)):point(mine(k) + 1) - 1)
      n = n + m
    end do
    call move_alloc(kept, values)
  end subroutine keep_columns

  !> Data of some elements alone; `id` remembers which they were.
  pure subroutine keep_elastic(elastic, mine)
    type(fem_elastic_type), intent(inout) :: elastic
    integer(i4), intent(in) :: mine(:)
    real(wp), allocatable :: factor(:, :)
    factor = reshape(elastic%factor, [1, size(elastic%factor)])
    call keep_columns(elastic%point, mine, factor)
    elastic%factor = factor(1, :)
    if (allocated(elastic%initial)) call keep_columns(elastic%point, mine, elastic%initial)
    elastic%id = mine
    elastic%rule_of = elastic%rule_of(mine)
    elastic%moduli = elastic%moduli(:, mine)
    elastic%layered_of = elastic%layered_of(mine)
    elastic%density = elastic%density(mine)
    elastic%inertia = elastic%inertia(mine)
    elastic%hourglass = elastic%hourglass(mine)
    if (allocated(elastic%absent)) elastic%absent = elastic%absent(mine)
    call keep_rows(elastic%point, mine)
    elastic%points = elastic%point(size(elastic%point)) - 1
  end subroutine keep_elastic

  !> What some elements remove and place, by their present numbers.
  pure subroutine keep_stages(point, mine, elastic, stages)
    integer(i4), intent(in) :: point(:), mine(:)  !! of all elements
    type(fem_elastic_type), intent(in) :: elastic
    type(fem_stages_type), intent(inout) :: stages
    integer(i4) :: k, i
    stages%density = stages%density(mine)
    call keep_columns(point, mine, stages%stress)
    call keep_columns(point, mine, stages%state)
    do k = 1, size(stages%stage)
      associate (element => stages%stage(k)%element)
        element = [(elastic%place_of(element(i)), i=1, size(element))]
      end associate
      stages%stage(k)%element = pack(stages%stage(k)%element, stages%stage(k)%element > 0)
    end do
  end subroutine keep_stages

  !> Starts of the rows of some elements, one after the other.
  pure subroutine keep_rows(start, mine)
    integer(i4), allocatable, intent(inout) :: start(:)
    integer(i4), intent(in) :: mine(:)
    integer(i4), allocatable :: kept(:)
    integer(i4) :: k
    allocate (kept(size(mine) + 1))
    kept(1) = 1
    do k = 1, size(mine)
      kept(k + 1) = kept(k) + start(mine(k) + 1) - start(mine(k))
    end do
    call move_alloc(kept, start)
  end subroutine keep_rows

  !> Entries in the rows of some elements.
  pure subroutine keep_list(start, mine, list)
    integer(i4), intent(in) :: start(:), mine(:)
    integer(i4), allocatable, intent(inout) :: list(:)
    integer(i4), allocatable :: kept(:)
    integer(i4) :: k, n, m
    allocate (kept(sum(start(mine + 1) - start(mine))))
    n = 0
    do k = 1, size(mine)
      m = start(mine(k) + 1) - start(mine(k))
      kept(n + 1:n + m) = list(start(mine(k)):start(mine(k) + 1) - 1)
      n = n + m
    end do
    call move_alloc(kept, list)
  end subroutine keep_list

  !> Elements of the mesh; those of groups have their present numbers, 0 where others have them.
  pure subroutine keep_mesh(mesh, mine)
    type(fem_mesh_type), intent(inout) :: mesh
    integer(i4), intent(in) :: mine(:)
    integer(i4) :: new(0:mesh%elements), k
    new = 0
    do k = 1, size(mine)
      new(mine(k)) = k
    end do
    do k = 1, size(mesh%group)
      associate (group => mesh%group(k))
        if (.not. allocated(group%element)) cycle
        group%element = new(group%element)
        if (group%kind == group_volume) group%element = pack(group%element, group%element > 0)
      end associate
    end do
    call keep_list(mesh%start, mine, mesh%node)
    call keep_rows(mesh%start, mine)
    mesh%kind = mesh%kind(mine)
    if (allocated(mesh%hex8)) mesh%hex8 = mesh%hex8(:, mine)
    mesh%elements = size(mine)
  end subroutine keep_mesh

  pure subroutine keep_dofs(dofs, mine)
    type(fem_dofs_type), intent(inout) :: dofs
    integer(i4), intent(in) :: mine(:)
    call keep_list(dofs%start, mine, dofs%block)
    call keep_rows(dofs%start, mine)
  end subroutine keep_dofs
end module fem_distribute
