!> All additional contact models. A new model is a file of this folder, its `use` and an `add`
!! here; forces and energies are added in this order.
module dem_additional_registry
  use talus_kinds, only: wp, i4
  use dem_additional_model, only: additional_model_type
  use dem_additional_numbers, only: additional_law_type, most_models
  use dem_additional_state, only: dem_additional_type
  use dem_bond, only: bond
  use dem_capillary, only: capillary
  use dem_cohesion, only: cohesion
  use dem_rolling, only: rolling
  implicit none
  private
  public :: list_models, find_model, use_model, use_in_run

contains

  !> The models and their number.
  pure subroutine list_models(list, n)
    type(additional_model_type), intent(out) :: list(most_models)
    integer(i4), intent(out) :: n
    n = 0
    call add(rolling(), list, n)
    call add(cohesion(), list, n)
    call add(bond(), list, n)
    call add(capillary(), list, n)
  end subroutine list_models

  pure subroutine add(model, list, n)
    type(additional_model_type), intent(in) :: model
    type(additional_model_type), intent(inout) :: list(:)
    integer(i4), intent(inout) :: n
    n = n + 1
    list(n) = model
  end subroutine add

  !> Place of the model of a name, 0: there is none.
  pure integer(i4) function find_model(name) result(place)
    character(len=*), intent(in) :: name
    type(additional_model_type) :: list(most_models)
    integer(i4) :: n
    call list_models(list, n)
    do place = n, 1, -1
      if (list(place)%name == name) return
    end do
  end function find_model

  !> A model acts between two materials, with these constants of its own.
  pure subroutine use_model(law, name, own)
    type(additional_law_type), intent(inout) :: law
    character(len=*), intent(in) :: name  !! in the registry
    real(wp), intent(in) :: own(:)
    integer(i4) :: m
    m = find_model(name)
    law%own(:size(own), m) = own
    law%acts(m) = .true.
    law%used = .true.
  end subroutine use_model

  !> A model acts between all grains of a run, with these constants of its own.
  pure subroutine use_in_run(additional, name, own)
    type(dem_additional_type), intent(inout) :: additional
    character(len=*), intent(in) :: name  !! in the registry
    real(wp), intent(in) :: own(:)
    integer(i4) :: m
    m = find_model(name)
    additional%own(:size(own), m) = own
    additional%of_run(m) = .true.
  end subroutine use_in_run
end module dem_additional_registry
