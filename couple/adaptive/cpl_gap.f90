!> How far the continuum is from the grains where these wake: changes of stress since the start of
!! the tile after a history and of the element that went through it, and masses (theory-overlap,
!! Conversion). Fault N462.
module cpl_gap
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_message, only: verb_describe
  use talus_port_names, only: field_element, field_plastic, field_stress, field_weight, &
    field_what, what_quadrature
  use talus_text, only: str
  use talus_timers, only: timers_type
  use cpl_bed, only: change_type
  use cpl_cells, only: cells_type
  use cpl_overlap, only: overlap_type
  use cpl_sets, only: part_ghost
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: find_gap, mass_gap, density_of, stress_type, read_stress, mean_stress, six, &
    mobilised, yielded

  !> Components xx yy zz xy yz zx among nine.
  integer(i4), parameter :: six(6) = [1, 5, 9, 2, 6, 7]

  !> Stresses of the solid's points.
  type :: stress_type
    real(wp), allocatable :: stress(:, :)    !! (6, points), or with a second field (9, points) [Pa]
    real(wp), allocatable :: weight(:)       !! (points) [m^3]
    integer(i4), allocatable :: element(:)   !! (points)
    real(wp), allocatable :: plastic(:)      !! (points) equivalent plastic strain, if it is told
  end type stress_type

contains

  !> Largest difference of a component of the stress, over the pressure of the tile at rest (N462).
  subroutine find_gap(solid, change, most, timers, gap, errors)
    type(cpl_solver_type), intent(inout) :: solid
    type(change_type), intent(in) :: change  !! of a conversion, with replays
    real(wp), intent(in) :: most             !! allowed [-]
    type(timers_type), intent(inout) :: timers
    real(wp), intent(out) :: gap             !! [-]
    type(error_list_type), intent(inout) :: errors
    type(stress_type) :: points
    real(wp) :: own(6), other
    integer(i4) :: k, worst

    gap = 0.0_wp
    if (change%replays == 0) return
    call read_stress(solid, points, timers, errors)
    if (errors%any()) return
    worst = 1
    do k = 1, change%replays
      own = mean_stress(points, change%element(k))
      other = maxval(abs(change%stress(six, k) - own))/change%pressure
      if (other > gap) worst = k
      gap = max(gap, other)
    end do
    if (gap <= most) return
    call errors%add('N462', 'the law of the continuum is far from the grains: in element '// &
      str(change%element(worst))//' a component of the stress differs by '//short_number(gap)// &
      ' of the tile''s pressure from that of the tile after the same strain', 'conversion at '// &
      short_number(solid%time)//' s', 'a modulus or a law that fits the tile at this strain '// &
      '(element tests), or a larger &adapt most_gap')
  end subroutine find_gap

  !> Mass of the ghosts over that of the continuum in their elements, less one [-]. eq. C.26
  pure real(wp) function mass_gap(o, cells)
    type(overlap_type), intent(in) :: o
    type(cells_type), intent(in) :: cells  !! not displaced
    real(wp) :: volume(cells%elements), solid
    integer(i4) :: e
    volume = [(cells%volume(e), e=1, cells%elements)]
    solid = density_of(cells)*sum(volume, o%sets%part == part_ghost)
    mass_gap = 0.0_wp
    if (solid > 0.0_wp) mass_gap = sum(o%pack%mass(o%sets%ghost))/solid - 1.0_wp
  end function mass_gap

  !> Mean density of the continuum [kg/m^3].
  pure real(wp) function density_of(cells)
    type(cells_type), intent(in) :: cells  !! not displaced
    integer(i4) :: e
    density_of = sum(cells%mass)/sum([(cells%volume(e), e=1, cells%elements)])
  end function density_of

  !> Stresses of the solid's points now.
  subroutine read_stress(solid, points, timers, errors)
    type(cpl_solver_type), intent(inout) :: solid
    type(stress_type), intent(out) :: points
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    call solid%start_request(verb_describe, 0_i8, solid%time, solid%time)
    call solid%request%put_text(field_what, what_quadrature)
    call solid%ask(timers, errors)
    if (errors%any()) return
    call solid%reply%take(field_stress, points%stress, errors)
    call solid%reply%take(field_weight, points%weight, errors)
    call solid%reply%take_int(field_element, points%element, errors)
    if (solid%reply%has(field_plastic)) call solid%reply%take(field_plastic, points%plastic, errors)
  end subroutine read_stress

  !> Mean equivalent plastic strain of each element, none where it is not told. eq. C.69
  pure function yielded(points, elements) result(mean)
    type(stress_type), intent(in) :: points
    integer(i4), intent(in) :: elements
    real(wp) :: mean(elements), volume(elements)
    integer(i4) :: k
    mean = 0.0_wp
    if (.not. allocated(points%plastic)) return
    volume = 0.0_wp
    do k = 1, size(points%element)
      associate (e => points%element(k))
        volume(e) = volume(e) + points%weight(k)
        mean(e) = mean(e) + points%weight(k)*points%plastic(k)
      end associate
    end do
    where (volume > 0.0_wp) mean = mean/volume
  end function yielded

  !> Deviator over pressure, q/p, of the mean stress of each element: none where the pressure is
  !! less than a hundredth of the largest one, as at a surface. eq. C.73
  pure function mobilised(points, elements) result(ratio)
    type(stress_type), intent(in) :: points
    integer(i4), intent(in) :: elements
    real(wp), parameter :: little = 0.01_wp
    real(wp) :: ratio(elements), mean(6, elements), volume(elements), pressure(elements), least
    integer(i4) :: k, e
    mean = 0.0_wp
    volume = 0.0_wp
    do k = 1, size(points%element)
      e = points%element(k)
      volume(e) = volume(e) + points%weight(k)
      if (size(points%stress, 1) == size(mean, 1)) then
        mean(:, e) = mean(:, e) + points%weight(k)*points%stress(:, k)
      else
        mean(:, e) = mean(:, e) + points%weight(k)*points%stress(six, k)
      end if
    end do
    ratio = 0.0_wp
    pressure = 0.0_wp
    where (volume > 0.0_wp) pressure = -sum(mean(:3, :), 1)/(3.0_wp*volume)
    least = little*maxval(pressure)
    do e = 1, elements
      if (.not. pressure(e) > least) cycle
      mean(:, e) = mean(:, e)/volume(e)
      mean(:3, e) = mean(:3, e) + pressure(e)
      ratio(e) = sqrt(1.5_wp*(sum(mean(:3, e)**2) + 2.0_wp*sum(mean(4:, e)**2)))/pressure(e)
    end do
  end function mobilised

  !> Of one element, as xx yy zz xy yz zx [Pa].
  pure function mean_stress(points, element) result(mean)
    type(stress_type), intent(in) :: points
    integer(i4), intent(in) :: element
    logical :: of_it(size(points%element))
    real(wp) :: mean(6)
    integer(i4) :: j, at
    of_it = points%element == element
    do j = 1, 6
      at = j
      if (size(points%stress, 1) == 9) at = six(j)
      mean(j) = sum(points%weight*points%stress(at, :), of_it)/sum(points%weight, of_it)
    end do
  end function mean_stress
end module cpl_gap
