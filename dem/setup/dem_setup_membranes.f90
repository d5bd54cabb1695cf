!> Groups membrane: material of membranes and supports of their edges. Faults D293.
module dem_setup_membranes
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_text, only: string_type
  use talus_deck, only: deck_type
  use talus_suggest, only: did_you_mean
  use dem_membrane, only: no_membranes, shape_membrane
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: read_membranes

contains

  !> All groups membrane; their membranes are the last surfaces, in the deck's order.
  subroutine read_membranes(deck, walls, served, d, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: walls(:)  !! names
    logical, intent(in) :: served              !! a partner drives the run
    class(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    if (deck%count('membrane') == 0) return
    if (served .or. deck%count('relaxation') > 0) &
      call deck%fault(errors, 'D293', 'membranes move in &dynamics, without a partner', &
                      'membrane', 1, '', 'take &dynamics in place of &relaxation')
    if (on_top(d)) &
      call deck%fault(errors, 'D293', 'additional contact models (cohesion, rolling, turning '// &
                      'points, elliptic areas) do not act at the surfaces of a run with '// &
                      'membranes', 'membrane', 1, 'material', &
                      'give its surfaces materials of their own, with &contact without them')
    if (errors%any()) return
    call no_membranes(d%surfaces)
    do k = 1, deck%count('membrane')
      call read_membrane(deck, k, walls, d, errors)
    end do
  end subroutine read_membranes

  !> Does a law of a surface and a grain have more than the base law?
  pure logical function on_top(d)
    class(dem_data_type), intent(in) :: d
    integer(i4) :: k, i
    on_top = .false.
    do k = 1, d%surfaces%parts
      do i = 1, d%grains%n
        associate (law => d%laws(d%surfaces%material(k), d%grains%material(i)))
          on_top = on_top .or. law%additional%used .or. law%elliptic .or. law%base%reals > 0
        end associate
      end do
    end do
  end function on_top

  subroutine read_membrane(deck, k, walls, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: walls(:)
    class(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: inside(:)
    real(wp) :: young, thickness, density
    integer(i4) :: b

    b = d%surfaces%n - deck%count('membrane') + k
    call deck%get('membrane', k, 'young', young)
    call deck%get('membrane', k, 'thickness', thickness)
    call deck%get('membrane', k, 'density', density)
    call deck%get('membrane', k, 'inside', inside)
    associate (m => d%surfaces%membranes)
      call deck%get('membrane', k, 'poisson', m%poisson(b))
      call deck%get('membrane', k, 'pressure', m%pressure(b))
      call deck%get('membrane', k, 'damping', m%damping(b))
      call deck%get('membrane', k, 'stretch_limit', m%limit(b))
      m%modulus(b) = young*thickness/(1.0_wp - m%poisson(b)**2)
    end associate
    call shape_membrane(d%surfaces, b, density*thickness, inside)
    call hold_edges(deck, k, b, walls, d, errors)
  end subroutine read_membrane

  !> Corners on free edges are fixed, or follow the nearest of the walls named (D293).
  subroutine hold_edges(deck, k, b, walls, d, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k, b
    type(string_type), intent(in) :: walls(:)
    class(dem_data_type), intent(inout) :: d
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: wall(:)
    integer(i4) :: t, e, first, second

    call find_clamps(deck, k, walls, wall, errors)
    if (errors%any()) return
    associate (s => d%surfaces)
      do t = s%first_triangle(b), s%first_triangle(b + 1) - 1
        do e = 1, 3
          if (s%mesh%mate(e, t) > 0) cycle
          first = s%mesh%corner(e, t)
          second = s%mesh%corner(1 + mod(e, 3), t)
          s%membranes%wall(first) = nearest_wall(d, wall, s%mesh%x(:, first))
          s%membranes%wall(second) = nearest_wall(d, wall, s%mesh%x(:, second))
        end do
      end do
    end associate
  end subroutine hold_edges

  !> Numbers of the walls that hold membrane k of the deck (D293).
  subroutine find_clamps(deck, k, walls, wall, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(string_type), intent(in) :: walls(:)
    integer(i4), allocatable, intent(out) :: wall(:)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: names(:)
    integer(i4) :: j, w

    call deck%get('membrane', k, 'clamp', names)
    allocate (wall(size(names)), source=0_i4)
    do j = 1, size(names)
      do w = 1, size(walls)
        if (walls(w)%s == names(j)%s) wall(j) = w
      end do
      if (wall(j) == 0) &
        call deck%fault(errors, 'D293', "there is no wall '"//names(j)%s//"'", 'membrane', k, &
                        'clamp', did_you_mean(names(j)%s, walls, 'walls of this deck:'))
    end do
  end subroutine find_clamps

  !> Of these walls the one nearest to a point, 0 if there are none.
  pure integer(i4) function nearest_wall(d, wall, x)
    class(dem_data_type), intent(in) :: d
    integer(i4), intent(in) :: wall(:)
    real(wp), intent(in) :: x(3)
    real(wp) :: distance(size(wall))
    integer(i4) :: j
    nearest_wall = 0
    if (size(wall) == 0) return
    do j = 1, size(wall)
      distance(j) = abs(dot_product(x - d%planes%point(:, wall(j)), d%planes%normal(:, wall(j))))
    end do
    nearest_wall = wall(minloc(distance, 1))
  end function nearest_wall
end module dem_setup_membranes
