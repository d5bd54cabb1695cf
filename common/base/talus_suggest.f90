!> "Did you mean": the nearest of a list of names to one that is mistyped.
module talus_suggest
  use talus_kinds, only: i4
  use talus_text, only: string_type, lower
  implicit none
  private
  public :: edit_distance, nearest_name, did_you_mean

contains

  !> Number of insertions, deletions, replacements and swaps of neighbours that turn a into b
  !! (Damerau-Levenshtein distance, optimal string alignment).
  pure integer(i4) function edit_distance(a, b)
    character(len=*), intent(in) :: a, b
    integer(i4) :: cost(0:len(a), 0:len(b)), i, j, change

    cost(:, 0) = [(i, i=0, len(a))]
    cost(0, :) = [(j, j=0, len(b))]
    do j = 1, len(b)
      do i = 1, len(a)
        change = merge(0, 1, a(i:i) == b(j:j))
        cost(i, j) = min(cost(i - 1, j) + 1, cost(i, j - 1) + 1, cost(i - 1, j - 1) + change)
        if (i > 1 .and. j > 1) then
          if (a(i:i) == b(j - 1:j - 1) .and. a(i - 1:i - 1) == b(j:j)) &
            cost(i, j) = min(cost(i, j), cost(i - 2, j - 2) + 1)
        end if
      end do
    end do
    edit_distance = cost(len(a), len(b))
  end function edit_distance

  !> The nearest name, or '' when none is near: at most a third of the letters may differ, or one
  !! name must hold the other.
  pure function nearest_name(name, names) result(best)
    character(len=*), intent(in) :: name
    type(string_type), intent(in) :: names(:)
    character(len=:), allocatable :: best, low
    integer(i4) :: k, distance, least, length

    best = ''
    low = lower(name)
    if (len(low) == 0 .or. len(low) > 64) return
    least = max(1, (len(low) + 1)/3) + 1
    do k = 1, size(names)
      distance = edit_distance(low, lower(names(k)%s))
      if (distance < least .and. distance < max(len(low), len(names(k)%s))) then
        least = distance
        best = names(k)%s
      end if
    end do
    if (len(best) > 0) return
    least = huge(least)
    do k = 1, size(names)
      length = min(len(low), len(names(k)%s))
      if (length < 3) cycle
      if (index(low, lower(names(k)%s)) == 0 .and. index(lower(names(k)%s), low) == 0) cycle
      distance = abs(len(low) - len(names(k)%s))
      if (distance >= least) cycle
      least = distance
      best = names(k)%s
    end do
  end function nearest_name

  !> Hint text: "did you mean 'young'?", or all that is known when nothing is near.
  pure function did_you_mean(name, names, otherwise) result(hint)
    character(len=*), intent(in) :: name
    type(string_type), intent(in) :: names(:)
    character(len=*), intent(in) :: otherwise  !! head of the list of names, '' for no list
    character(len=:), allocatable :: hint
    integer(i4) :: k

    hint = nearest_name(name, names)
    if (len(hint) > 0) then
      hint = 'did you mean '''//hint//'''?'
    else if (len(otherwise) > 0) then
      hint = otherwise
      do k = 1, size(names)
        hint = hint//trim(merge(' ', ',', k == 1))//' '//names(k)%s
      end do
    end if
  end function did_you_mean
end module talus_suggest
