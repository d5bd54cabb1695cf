!> Inertia of the ghosts for a solid that has inertia: their motion is prescribed, so that of the
!! layer of grains whose centres are on the facets the half among the grains has none there. The
!! facets carry it, without a weight: that of the deposit is in balance as it is. eq. C.47
module cpl_ghost_mass
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_message, only: verb_set
  use talus_port_names, only: field_a, field_id, field_mass, field_set, field_u, field_v, &
    field_value, field_what, role_load, what_grains, what_mass_factor
  use cpl_interface, only: interface_type, node_set
  use cpl_order, only: sort_order
  use cpl_pore, only: row_of, to_facets
  use cpl_run, only: cpl_run_type
  use cpl_solver, only: cpl_solver_type, side_grains, side_solid
  implicit none
  private
  public :: carry_ghosts, values_of

contains

  !> A share of the ghosts' mass, with the liquid that moves with them, to the nodes of the facets.
  subroutine carry_ghosts(face, share, run, errors)
    type(interface_type), intent(inout) :: face
    real(wp), intent(in) :: share  !! [-]
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    real(wp) :: mass(face%map%ghosts), nodal(1, face%map%nodes), own(face%map%nodes)

    if (.not. share > 0.0_wp .or. .not. face%dynamic) return
    call masses_of(run%solvers(side_grains), face%map%ghost_id, mass, run, errors)
    if (errors%any()) return
    nodal = to_facets(face%map, row_of(share*mass))
    associate (solid => run%solvers(side_solid))
      call solid%start_select(face%step, node_set, role_load, face%map%node_id, &
                              field_u//','//field_v//','//field_a)
      call solid%ask(run%timers, errors)
      if (errors%any()) return
      call solid%reply%get(field_mass, own, errors)
      if (errors%any()) return
      call solid%start_request(verb_set, face%step, solid%time, solid%time)
      call solid%request%put_text(field_what, what_mass_factor)
      call solid%request%put_text(field_set, node_set)
      call solid%request%put(field_value, 1.0_wp + nodal(1, :)/own)
      call solid%ask(run%timers, errors)
      call face%lift(nodal(1, :), solid%gravity)
    end associate
  end subroutine carry_ghosts

  !> Masses of these grains [kg].
  subroutine masses_of(grains, id, mass, run, errors)
    type(cpl_solver_type), intent(inout) :: grains
    integer(i8), intent(in) :: id(:)
    real(wp), intent(out) :: mass(:)
    type(cpl_run_type), intent(inout) :: run
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: all_id(:)
    real(wp), allocatable :: all_mass(:)
    mass = 0.0_wp
    call grains%describe(what_grains, '', run%timers, errors)
    if (errors%any()) return
    call grains%reply%take_int(field_id, all_id, errors)
    call grains%reply%take(field_mass, all_mass, errors)
    if (errors%any()) return
    if (.not. errors%any()) mass = values_of(id, all_id, all_mass)
  end subroutine masses_of

  !> Values of these ids in a list of others, 0 of those that are not in it. Both are gone through
  !! in rising order at once.
  function values_of(id, all_id, all_value) result(value)
    integer(i8), intent(in) :: id(:), all_id(:)
    real(wp), intent(in) :: all_value(:)
    real(wp) :: value(size(id))
    integer(i4) :: own(size(id)), order(size(all_id)), k, j
    value = 0.0_wp
    call sort_order(real(id, wp), own)
    call sort_order(real(all_id, wp), order)
    j = 1
    do k = 1, size(id)
      do while (j < size(all_id))
        if (all_id(order(j)) >= id(own(k))) exit
        j = j + 1
      end do
      if (size(all_id) == 0) return
      if (all_id(order(j)) == id(own(k))) value(own(k)) = all_value(order(j))
    end do
  end function values_of
end module cpl_ghost_mass
