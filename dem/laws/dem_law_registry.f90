!> All base contact laws. A new law is a file of this folder, its `use` and an `add` here.
module dem_law_registry
  use talus_kinds, only: i4
  use dem_law_state, only: base_law_type, dem_law_type
  use dem_additional_state, only: kept_places_type, kept_range, part_of_law, most_laws
  use dem_hertz_mindlin, only: hertz_mindlin
  use dem_hertz_no_history, only: hertz_no_history
  use dem_linear, only: linear
  use dem_mindlin_deresiewicz, only: mindlin_deresiewicz
  use dem_thornton_ning, only: thornton_ning
  implicit none
  private
  public :: law_count, base_law, find_law, bind_law, place_of_memory, memory_places

contains

  !> The laws and their number.
  pure subroutine list_laws(list, n)
    type(base_law_type), intent(out) :: list(most_laws)
    integer(i4), intent(out) :: n
    n = 0
    call add(hertz_mindlin(), list, n)
    call add(hertz_no_history(), list, n)
    call add(linear(), list, n)
    call add(mindlin_deresiewicz(), list, n)
    call add(thornton_ning(), list, n)
  end subroutine list_laws

  pure subroutine add(base, list, n)
    type(base_law_type), intent(in) :: base
    type(base_law_type), intent(inout) :: list(:)
    integer(i4), intent(inout) :: n
    n = n + 1
    list(n) = base
  end subroutine add

  pure integer(i4) function law_count() result(n)
    type(base_law_type) :: list(most_laws)
    call list_laws(list, n)
  end function law_count

  pure function base_law(kind) result(base)
    integer(i4), intent(in) :: kind  !! place in the list
    type(base_law_type) :: base, list(most_laws)
    integer(i4) :: n
    call list_laws(list, n)
    base = list(kind)
  end function base_law

  !> Place of the law of a name, 0: there is none.
  pure integer(i4) function find_law(name) result(kind)
    character(len=*), intent(in) :: name
    type(base_law_type) :: list(most_laws)
    integer(i4) :: n
    call list_laws(list, n)
    do kind = n, 1, -1
      if (list(kind)%name == name) return
    end do
  end function find_law

  !> What belongs to a law's kind, after its numbers came from another process.
  pure subroutine bind_law(law)
    type(dem_law_type), intent(inout) :: law
    type(base_law_type) :: none
    law%base = none
    if (law%kind > 0) law%base = base_law(law%kind)
    law%spring = law%base%spring
  end subroutine bind_law

  !> Room for what the laws of a run keep, behind what is reserved.
  pure subroutine memory_places(laws, places)
    type(dem_law_type), intent(in) :: laws(:, :)
    class(kept_places_type), intent(inout) :: places
    type(base_law_type) :: list(most_laws)
    integer(i4) :: k, n
    call list_laws(list, n)
    do k = 1, n
      associate (part => places%part(part_of_law(k)))
        part%name = list(k)%memory
        part%reals = list(k)%reals
        part%at = 0
        if (part%reals == 0 .or. .not. any(laws%kind == k)) cycle
        part%at = places%reals + 1
        places%reals = places%reals + part%reals
      end associate
    end do
  end subroutine memory_places

  !> First and last of the reals that contacts of a law keep; none: [1, 0].
  pure function place_of_memory(law, places) result(range)
    type(dem_law_type), intent(in) :: law
    class(kept_places_type), intent(in) :: places
    integer(i4) :: range(2)
    range = [1, 0]
    if (law%base%reals > 0) range = kept_range(places%part(part_of_law(law%kind)))
  end function place_of_memory
end module dem_law_registry
