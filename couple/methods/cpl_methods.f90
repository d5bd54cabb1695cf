!> The coupling methods by name: one line each.
module cpl_methods
  use cpl_bridging_domain, only: bridging_domain_type
  use cpl_adaptive_scale, only: adaptive_scale_type
  use cpl_bridging_scale, only: bridging_scale_type
  use cpl_facet_method, only: facet_method_type
  use cpl_method, only: cpl_method_type
  use cpl_overlap_method, only: overlap_method_type
  use cpl_penalty, only: penalty_type
  use cpl_static_overlap, only: static_overlap_type
  implicit none
  private
  public :: choose_method

contains

  !> The method of a name that cpl_choices has made from a checked deck.
  subroutine choose_method(name, method)
    character(len=*), intent(in) :: name
    class(cpl_method_type), allocatable, intent(out) :: method
    select case (name)
    case ('facets'); allocate (facet_method_type :: method)
    case ('adaptive_scale'); allocate (adaptive_scale_type :: method)
    case ('bridging_scale'); allocate (bridging_scale_type :: method)
    case ('static_overlap'); allocate (static_overlap_type :: method)
    case ('bridging_domain'); allocate (bridging_domain_type :: method)
    case ('penalty'); allocate (penalty_type :: method)
    case default; error stop 'bug: a coupling method without its line'
    end select
    select type (method)
    class is (overlap_method_type)
      allocate (method%o)
    end select
  end subroutine choose_method
end module cpl_methods
