!> Grains that are about to enter a run: room for them, and the records that the system takes.
module dem_entry
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use dem_make, only: make_grains
  use dem_packing, only: dem_packing_type
  use dem_shape_make, only: make_shapes
  use dem_state, only: dem_grains_type
  use dem_system, only: dem_system_type
  implicit none
  private
  public :: size_batch, trim_batch, make_entering, make_batch, check_ids

  integer(i8), parameter :: most_id = int(huge(1_i4), i8)

contains

  !> Room for n grains, free and at rest; there are none yet.
  pure subroutine size_batch(batch, n)
    type(dem_packing_type), intent(out) :: batch
    integer(i4), intent(in) :: n
    allocate (batch%id(n), source=0_i8)
    allocate (batch%kind(n), source=0_i4)
    allocate (batch%x(3, n), batch%quat(4, n), batch%axes(3, n), batch%v(3, n), &
              batch%omega(3, n), batch%skew(3, n), batch%exponent(n), source=0.0_wp)
  end subroutine size_batch

  !> The same grains in room for n.
  pure subroutine trim_batch(batch, n)
    type(dem_packing_type), intent(inout) :: batch
    integer(i4), intent(in) :: n
    type(dem_packing_type) :: other
    integer(i4) :: m
    m = min(n, batch%n)
    call size_batch(other, n)
    other%n = m
    other%id(:m) = batch%id(:m)
    other%kind(:m) = batch%kind(:m)
    other%x(:, :m) = batch%x(:, :m)
    other%quat(:, :m) = batch%quat(:, :m)
    other%axes(:, :m) = batch%axes(:, :m)
    other%v(:, :m) = batch%v(:, :m)
    other%omega(:, :m) = batch%omega(:, :m)
    other%skew(:, :m) = batch%skew(:, :m)
    other%exponent(:m) = batch%exponent(:m)
    batch = other
  end subroutine trim_batch

  !> Grains as the system has them, in the order of their ids.
  subroutine make_entering(batch, material, system, entering, errors)
    type(dem_packing_type), intent(in) :: batch
    integer(i4), intent(in) :: material  !! of all of them
    type(dem_system_type), intent(in) :: system
    type(dem_grains_type), intent(inout) :: entering
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: materials(batch%n)
    materials = material
    call make_batch(batch, materials, system, entering, errors)
  end subroutine make_entering

  !> The same of several materials.
  subroutine make_batch(batch, materials, system, entering, errors)
    type(dem_packing_type), intent(in) :: batch
    integer(i4), intent(in) :: materials(:)
    type(dem_system_type), intent(in) :: system
    type(dem_grains_type), intent(inout) :: entering
    type(error_list_type), intent(inout) :: errors
    call make_grains(entering, system%materials, batch%id, batch%kind, materials, batch%x, &
                     batch%quat, batch%axes, batch%v, batch%omega, errors)
    if (errors%any()) return
    call make_shapes(entering, system%materials, batch%id, batch%skew, batch%exponent, errors, &
                     system%grains%shapes%in_use)
  end subroutine make_batch

  !> Ids are 32-bit numbers (N210).
  subroutine check_ids(who, batch, path, errors)
    character(len=*), intent(in) :: who   !! for the message
    type(dem_packing_type), intent(in) :: batch
    character(len=*), intent(in) :: path  !! of the deck
    type(error_list_type), intent(inout) :: errors
    if (maxval(batch%id) <= most_id) return
    call errors%add('N210', who//' has no ids left for its grains: they go to '//str(most_id), &
                    path, "begin again from the packing at the end, with new ids ('talus pack "// &
                    "edit --renumber')")
  end subroutine check_ids
end module dem_entry
