!> The list of candidate pairs as named arrays, and back, with what its contacts remember.
module dem_store_pairs
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_text, only: str
  use dem_archive, only: dem_archive_type
  use dem_state, only: dem_data_type, dem_pairs_type, kind_ghost, lanes, history_size, &
    result_size, column_count, entries_ahead
  use dem_additional_list, only: put_additional, get_additional
  use dem_surface_store, only: get_surfaces
  use dem_pairs, only: update_bodies
  implicit none
  private
  integer(i8), parameter :: most_pairs = 1000000000_i8  !! their entries have 32-bit numbers
  integer(i8), parameter :: most_shape = 1000_i8        !! round + 2 shape, see put_pairs

  public :: put_pairs, put_images, get_skin, get_list

contains

  !> The list in its order, normals and history of every candidate, reference positions.
  subroutine put_pairs(p, archive)
    type(dem_pairs_type), intent(in) :: p
    class(dem_archive_type), intent(inout) :: archive
    integer(i4) :: m
    m = p%blocks
    call archive%put_integers('pairs.count', reshape([int(p%blocks, i8), &
                              int(p%grain_blocks, i8), int(p%count, i8), p%built_at], [4, 1]))
    call archive%put_integers('pairs.first', int(p%first, i8))
    call archive%put_integers('pairs.second', int(p%second, i8))
    call archive%put_integers('pairs.law', int(reshape( &
      [p%law_first, p%law_second, merge(1, 0, p%touched), merge(1, 0, p%round) + 2*p%shape], &
      [m, 4]), i8))
    call archive%put_integers('pairs.group_end', int(reshape(p%group_end, [1, p%groups]), i8))
    call archive%put_integers('pairs.start', int(reshape(p%start, [size(p%start), 1]), i8))
    call archive%put_integers('pairs.entry', int(reshape(p%entry(:2*p%count), [2*p%count, 1]), i8))
    call archive%put_reals('pairs.normal', reshape(p%normal, [lanes*3, m]))
    call archive%put_reals('pairs.history', reshape(p%history, [lanes*history_size, m]))
    call archive%put_reals('pairs.result', p%result)
    call archive%put_reals('pairs.least_gap', reshape(p%least_gap, [1, m]))
    call archive%put_reals('pairs.weight', p%weight)
    call archive%put_reals('pairs.m_star', p%m_star)
    call put_additional(p%additional, archive)
    call archive%put_reals('pairs.reference_x', p%reference_x)
    if (any(p%ease < 1.0_wp)) &
      call archive%put_reals('pairs.ease', reshape(p%ease, [1, size(p%ease)]))
    call archive%put_reals('pairs.reference_q', p%reference_q)
  end subroutine put_pairs

  !> The images of the list in a cell.
  subroutine put_images(p, archive)
    type(dem_pairs_type), intent(in) :: p
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_integers('images', int(reshape([p%grain(p%plain + 1:), &
                              reshape(p%shift, [3*p%images])], [p%images, 4]), i8))
    call archive%put_reals('images.force', p%image_force)
  end subroutine put_images

  subroutine get_skin(pairs, archive, errors)
    type(dem_pairs_type), intent(inout) :: pairs
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: skin(:, :)
    call archive%get_reals('pairs.skin', 3, 1, skin, errors)
    pairs%skin = skin(1, 1)
    pairs%least_skin = skin(2, 1)
    pairs%most_skin = skin(3, 1)
  end subroutine get_skin

  !> Which bodies each lane of a block joins, by which law, and where a body finds its pairs.
  subroutine get_blocks(p, materials, archive, errors)
    type(dem_pairs_type), intent(inout) :: p
    integer(i4), intent(in) :: materials
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: counts(:, :), law(:, :), first(:, :), second(:, :), start(:, :), &
      entry(:, :), group(:, :)
    integer(i8) :: bodies
    integer(i4) :: m

    call archive%get_integers('pairs.count', 4, 1, counts, errors, [0_i8, most_pairs])
    if (errors%any()) return
    m = int(counts(1, 1), i4)
    bodies = p%plain + p%images
    call archive%get_integers('pairs.first', lanes, m, first, errors, [1_i8, bodies])
    call archive%get_integers('pairs.second', lanes, m, second, errors, [1_i8, bodies])
    call archive%get_integers('pairs.law', m, 4, law, errors, [0_i8, most_shape])
    call archive%get_integers('pairs.group_end', 1, -1, group, errors, [0_i8, int(m, i8)])
    call archive%get_integers('pairs.start', int(bodies, i4) + 1, 1, start, errors, &
                              [1_i8, 2*counts(3, 1) + 1])
    call archive%get_integers('pairs.entry', 2*int(counts(3, 1), i4), 1, entry, errors, &
                              [0_i8, 2_i8*lanes*m - 1])
    if (errors%any()) return
    if (counts(2, 1) > m) call archive%refuse('pairs.count', 'has '//str(counts(2, 1))// &
                                              ' of '//str(m)//' blocks', errors)
    if (any(law(:, :2) < 1) .or. any(law(:, :2) > materials)) &
      call archive%refuse('pairs.law', 'names a material that the deck has not', errors)
    call check_rising('pairs.start', start(:, 1), 2*counts(3, 1) + 1, archive, errors)
    call check_rising('pairs.group_end', group(1, :), int(m, i8), archive, errors)
    if (errors%any()) return
    p%blocks = m
    p%grain_blocks = int(counts(2, 1), i4)
    p%count = int(counts(3, 1), i4)
    p%built_at = counts(4, 1)
    p%first = int(first, i4)
    p%second = int(second, i4)
    p%law_first = int(law(:, 1), i4)
    p%law_second = int(law(:, 2), i4)
    p%touched = law(:, 3) == 1
    p%round = law(:, 4) == 1
    p%shape = int(law(:, 4)/2, i4)
    p%groups = size(group, 2)
    p%group_end = int(group(1, :), i4)
    p%start = int(start(:, 1), i4)
    p%entry = int([entry(:, 1), spread(0_i8, 1, entries_ahead)], i4)
  end subroutine get_blocks

  !> Places that rise to the last one.
  subroutine check_rising(name, places, last, archive, errors)
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: places(:), last
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    integer :: n
    n = size(places)
    if (n == 0) return
    if (any(places(2:) < places(:n - 1)) .or. places(n) /= last) &
      call archive%refuse(name, 'does not rise to '//str(last), errors)
  end subroutine check_rising

  subroutine get_pairs(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: flat(:, :)

    call get_blocks(d%pairs, size(d%materials, kind=i4), archive, errors)
    if (errors%any()) return
    associate (p => d%pairs, m => d%pairs%blocks)
      call get_skin(p, archive, errors)
      call archive%get_reals('pairs.normal', lanes*3, m, flat, errors)
      p%normal = reshape(flat, [lanes, 3, m])
      call archive%get_reals('pairs.history', lanes*history_size, m, flat, errors)
      p%history = reshape(flat, [lanes, history_size, m])
      call archive%get_reals('pairs.result', result_size, lanes*m, flat, errors)
      p%result = flat
      call archive%get_reals('pairs.least_gap', 1, m, flat, errors)
      p%least_gap = flat(1, :)
      call count_blocks(p, d%grains%kind)
      call archive%get_reals('pairs.weight', lanes, -1, flat, errors)
      p%weight = flat
      call archive%get_reals('pairs.m_star', lanes, m, flat, errors)
      p%m_star = flat
      call archive%get_reals('pairs.reference_x', 3, p%plain, flat, errors)
      p%reference_x = flat
      if (archive%find('pairs.ease') > 0) then
        call archive%get_reals('pairs.ease', 1, p%plain, flat, errors)
        p%ease = flat(1, :)
      end if
      call archive%get_reals('pairs.reference_q', 4, p%plain, flat, errors)
      p%reference_q = flat
      p%columns = reshape(spread(0.0_wp, 1, column_count*m), [column_count, m])
    end associate
  end subroutine get_pairs

  !> How many of the first blocks hold no ghost, and no two of them. Lists of old checkpoints mix
  !! pairs with and without a ghost.
  pure subroutine count_blocks(p, kind)
    type(dem_pairs_type), intent(inout) :: p
    integer(i4), intent(in) :: kind(:)  !! of the grains
    integer(i4) :: b, n
    logical :: bare
    n = size(kind, kind=i4)
    p%bare_blocks = 0
    p%rim_blocks = 0
    do b = 1, p%grain_blocks
      associate (first => pack(p%first(:, b), p%first(:, b) <= n), &
                 second => p%grain(pack(p%second(:, b), p%first(:, b) <= n)))
        if (all(kind(first) == kind_ghost .and. kind(second) == kind_ghost)) exit
        p%rim_blocks = b
        bare = .not. any(kind(first) == kind_ghost .or. kind(second) == kind_ghost)
        if (bare .and. p%bare_blocks == b - 1) p%bare_blocks = b
      end associate
    end do
  end subroutine count_blocks

  !> The list as it was, and what is near surfaces.
  subroutine get_list(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    call get_pairs(d, archive, errors)
    if (errors%any()) return
    call get_additional(d%pairs%additional, d%pairs%blocks, archive, errors)
    if (errors%any()) return
    call update_bodies(d%pairs, d%grains, d%planes, d%cell)
    call get_surfaces(d, archive, errors)
  end subroutine get_list
end module dem_store_pairs
