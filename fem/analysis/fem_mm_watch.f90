!> A warning, once in a run, where hardening loses the ellipticity of a micromorphic solid. Checked
!! is the first point that yields in each element at the end of a step, of laws that can lose it:
!! those that are closed, soften or flow otherwise than along the normals of their surfaces.
module fem_mm_watch
  use talus_kinds, only: wp, i4
  use talus_log, only: log_type, short_number
  use talus_text, only: str
  use fem_body, only: fem_body_type
  use fem_law, only: at_flag
  use fem_mm_cones, only: kind_cone
  use fem_mm_element, only: motion_at
  use fem_mm_ellipticity, only: least_determinant, determinant_along
  use fem_mm_flow, only: mm_law_type
  use fem_mm_motion, only: mm_motion_type, mm_force_type, elastic_tangent
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_mm_store, only: state_of
  implicit none
  private
  public :: watch_ellipticity, can_lose

contains

  !> Check the converged trial state of a body, and warn of the first element; not
  !! again where `elliptic` is false already.
  subroutine watch_ellipticity(body, log, failed, elliptic)
    type(fem_body_type), intent(in) :: body
    type(log_type), intent(inout) :: log
    logical, intent(in) :: failed  !! the step has no end
    logical, intent(inout) :: elliptic
    real(wp), allocatable :: seen(:, :)  !! least determinant, its direction and point (5, elements)
    integer(i4) :: e, point, first(1)

    associate (micro => body%matter%micro)
      if (.not. (micro%active .and. elliptic) .or. body%scheme%explicit .or. failed) return
      if (.not. any(can_lose(micro%law))) return
    end associate
    allocate (seen(5, body%mesh%elements), source=1.0_wp)
    !$omp parallel do default(none) shared(body, seen) private(e, point) schedule(dynamic)
    do e = 1, body%mesh%elements
      call look_at(body, e, point, seen(1, e), seen(2:4, e))
      seen(5, e) = real(point, wp)
    end do
    !$omp end parallel do
    call body%whole%collect_cells(seen)  ! the first of all ranks, on the leader
    e = 0
    if (body%whole%ranks%leads()) e = int(findloc(seen(1, :) <= 0.0_wp, .true., 1), i4)
    first = e
    if (body%whole%ranks%several()) call body%whole%ranks%broadcast_numbers(first)
    if (first(1) == 0) return
    elliptic = .false.
    if (e == 0) return
    call log%warn('time '//short_number(body%state%time)//' s: hardening loses ellipticity at '// &
      'point '//str(nint(seen(5, e), i4))//' of element '//str(e)//', in the direction '// &
      short_number(seen(2, e))//', '//short_number(seen(3, e))//', '// &
      short_number(seen(4, e))//'; from here on the width of bands may be that of elements')
  end subroutine watch_ellipticity

  !> Softening, or a potential that is not the surface; closed surfaces can always soften.
  elemental logical function can_lose(law)
    type(mm_law_type), intent(in) :: law
    can_lose = any(law%cone%on .and. (law%cone%kind /= kind_cone .or. law%cone%hardening < 0.0_wp &
      .or. abs(law%cone%b_flow - law%cone%b) > 0.0_wp))
  end function can_lose

  !> The least determinant over the elastic one at the first point of an element that yields, 1 if
  !! none does.
  subroutine look_at(body, e, point, least, normal)
    type(fem_body_type), intent(in) :: body
    integer(i4), intent(in) :: e
    integer(i4), intent(out) :: point
    real(wp), intent(inout) :: least
    real(wp), intent(out) :: normal(3)
    type(mm_motion_type) :: motion(2), rest
    type(mm_point_type) :: answer
    type(mm_force_type) :: force
    real(wp) :: tangent(45, 45), whole
    logical :: gradient
    integer(i4) :: first

    normal = 0.0_wp
    first = body%elastic%point(e)
    point = findloc(body%matter%state(at_flag, first:body%elastic%point(e + 1) - 1) > 0.0_wp, &
                    .true., 1)
    if (point == 0) return
    associate (law => body%matter%micro%law(body%matter%micro%law_of(e)))
      if (.not. can_lose(law)) return
      motion = [motion_of(body, body%accepted%u, e, point), motion_of(body, body%state%u, e, point)]
      call update_point(law, motion, state_of(body%matter%accepted_state(:, first + point - 1)), &
                        answer, tangent)
      if (.not. answer%done) return
      gradient = any(abs(law%elastic%taus) > 0.0_wp)
      call least_determinant(tangent, gradient, least, normal)
      call elastic_tangent(law%elastic, rest, force, tangent)
    end associate
    whole = determinant_along(tangent, [0.0_wp, 0.0_wp, 1.0_wp], gradient)
    least = merge(least/whole, 1.0_wp, whole > 0.0_wp)
  end subroutine look_at

  !> Motion of a point of element e for blocks u.
  pure function motion_of(body, u, e, point) result(motion)
    type(fem_body_type), intent(in) :: body
    real(wp), intent(in) :: u(:, :)
    integer(i4), intent(in) :: e, point
    type(mm_motion_type) :: motion
    integer(i4) :: a, b
    a = body%dofs%start(e)
    b = body%dofs%start(e + 1) - 1
    associate (element => body%matter%micro%element(e), block => u(:, body%dofs%block(a:b)))
      motion = motion_at(element, point, block(:, :element%nodes), &
        reshape(block(:, element%nodes + 1:), [9, element%micro_nodes]))
    end associate
  end function motion_of
end module fem_mm_watch
