!> Numbers of the additional contact models of a pair of materials, and the works that they book.
module dem_additional_numbers
  use talus_kinds, only: wp, i4
  implicit none
  private
  public :: most_models, most_own, additional_law_type
  public :: additional_work_count, work_rolling, work_breakage, work_torn, work_sheared
  public :: work_formed, work_ruptured, work_drawn, work_returned

  integer(i4), parameter :: most_models = 8  !! room in the registry
  integer(i4), parameter :: most_own = 8     !! constants of a model's own

  integer(i4), parameter :: additional_work_count = 8  !! works and counts of a block
  integer(i4), parameter :: work_rolling = 1   !! dissipated by rolling and twisting [J]
  integer(i4), parameter :: work_breakage = 2  !! lost when bonds, necks and bridges come or go [J]
  integer(i4), parameter :: work_torn = 3      !! bonds broken by tension and bending [-]
  integer(i4), parameter :: work_sheared = 4   !! by shear and twisting [-]
  integer(i4), parameter :: work_formed = 5    !! capillary bridges formed [-]
  integer(i4), parameter :: work_ruptured = 6  !! and broken [-]
  integer(i4), parameter :: work_drawn = 7     !! liquid that went into bridges [m^3]
  integer(i4), parameter :: work_returned = 8  !! and out of those that broke [m^3]

  !> Models of a pair of materials, each at its place in dem_additional_registry.
  type :: additional_law_type
    logical :: used = .false.                        !! some model acts
    logical :: acts(most_models) = .false.
    real(wp) :: own(most_own, most_models) = 0.0_wp  !! constants of its own, see its file
  end type additional_law_type
end module dem_additional_numbers
