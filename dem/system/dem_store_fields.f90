!> Wear and heat on their way to and from a checkpoint.
module dem_store_fields
  use talus_errors, only: error_list_type
  use talus_kinds, only: wp
  use dem_archive, only: dem_archive_type
  use dem_heat_state, only: dem_heat_type
  use dem_state, only: dem_data_type
  use dem_wear_state, only: dem_wear_type
  implicit none
  private
  public :: put_wear_and_heat, get_wear_and_heat

contains

  !> What the run counts of both.
  subroutine put_wear_and_heat(d, archive)
    type(dem_data_type), intent(in) :: d
    class(dem_archive_type), intent(inout) :: archive
    if (d%wear%active) call put_wear(d%wear, archive)
    if (d%heat%active) call put_heat(d%heat, archive)
  end subroutine put_wear_and_heat

  !> The same back.
  subroutine get_wear_and_heat(d, archive, errors)
    type(dem_data_type), intent(inout) :: d
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    if (d%wear%active) call get_wear(d%wear, archive, errors)
    if (d%heat%active) call get_heat(d%heat, archive, errors)
  end subroutine get_wear_and_heat

  !> What has slid so far.
  subroutine put_wear(wear, archive)
    type(dem_wear_type), intent(in) :: wear
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('wear.plane', reshape(wear%plane, [1, size(wear%plane)]))
    call archive%put_reals('wear.body', reshape(wear%body, [1, size(wear%body)]))
    call archive%put_reals('wear.triangle', reshape(wear%triangle, [1, size(wear%triangle)]))
  end subroutine put_wear

  !> The same back; a checkpoint of a deck without wear has none.
  subroutine get_wear(wear, archive, errors)
    type(dem_wear_type), intent(inout) :: wear
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:, :)
    if (archive%find('wear.plane') == 0) return
    call archive%get_reals('wear.plane', 1, size(wear%plane), row, errors)
    if (.not. errors%any()) wear%plane = row(1, :)
    call archive%get_reals('wear.body', 1, size(wear%body), row, errors)
    if (.not. errors%any()) wear%body = row(1, :)
    call archive%get_reals('wear.triangle', 1, size(wear%triangle), row, errors)
    if (.not. errors%any()) wear%triangle = row(1, :)
  end subroutine get_wear

  !> Temperatures, heat given by boundaries, content at the start.
  subroutine put_heat(heat, archive)
    type(dem_heat_type), intent(in) :: heat
    class(dem_archive_type), intent(inout) :: archive
    call archive%put_reals('heat.temperature', reshape(heat%temperature, &
                                                       [1, size(heat%temperature)]))
    call archive%put_reals('heat.given', reshape(heat%given, [1, size(heat%given)]))
    call archive%put_reals('heat.start', reshape([heat%start, heat%ratio], [2, 1]))
  end subroutine put_heat

  !> The same back, of a deck with as many boundaries; a checkpoint without heat has none. Held
  !! grains have the temperatures of the deck.
  subroutine get_heat(heat, archive, errors)
    type(dem_heat_type), intent(inout) :: heat
    type(dem_archive_type), intent(in) :: archive
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: row(:, :)
    if (archive%find('heat.temperature') == 0) return
    call archive%get_reals('heat.temperature', 1, size(heat%temperature), row, errors)
    if (errors%any()) return
    heat%temperature = merge(row(1, :), heat%temperature, heat%held == 0)
    call archive%get_reals('heat.given', 1, size(heat%given), row, errors)
    if (errors%any()) return
    heat%given = row(1, :)
    call archive%get_reals('heat.start', 2, 1, row, errors)
    if (errors%any()) return
    heat%start = row(1, 1)
    heat%ratio = row(2, 1)
  end subroutine get_heat
end module dem_store_fields
