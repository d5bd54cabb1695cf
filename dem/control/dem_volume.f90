!> Constant volume: walls of a box move so that its volume stays while its other walls move
!! (undrained triaxial compression, plane strain at constant volume).
!!
!! At every update the chosen pairs get the velocities that bring the volume back to its value when
!! the group began to act, at the next update, with the other walls as they move now; both walls of
!! a pair share the change.
!! eq. D.6
module dem_volume
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_suggest, only: did_you_mean
  use dem_state, only: dem_data_type
  implicit none
  private
  public :: constant_volume_type, box_pairs

  real(wp), parameter :: parallel = 1.0e-9_wp

  type :: constant_volume_type
    logical :: active = .false.
    real(wp) :: since = 0.0_wp          !! [s]
    integer(i4) :: pair(2, 3) = 0       !! walls of the box, opposite ones together
    logical :: moves(3) = .false.       !! pairs that keep the volume
  contains
    procedure :: read => read_volume
    procedure :: set => set_velocities
    procedure, private :: check_servos
  end type constant_volume_type

contains

  !> Three pairs of opposite planes at right angles; 0 where there are no such or more.
  pure function box_pairs(d) result(pair)
    type(dem_data_type), intent(in) :: d
    integer(i4) :: pair(2, 3), i, j, n
    pair = 0
    n = 0
    do i = 1, d%planes%n
      do j = i + 1, d%planes%n
        if (dot_product(d%planes%normal(:, i), d%planes%normal(:, j)) > parallel - 1.0_wp) cycle
        n = n + 1
        if (n <= 3) pair(:, n) = [i, j]
      end do
    end do
    if (n /= 3) then
      pair = 0
      return
    end if
    do i = 1, 3
      j = 1 + mod(i, 3)
      if (abs(dot_product(d%planes%normal(:, pair(1, i)), d%planes%normal(:, pair(1, j)))) &
          > parallel) n = 0
    end do
    if (n == 0) pair = 0
  end function box_pairs

  !> Group constant_volume (D281).
  subroutine read_volume(self, deck, d, names, errors)
    class(constant_volume_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(string_type), intent(in) :: names(:)  !! of the walls
    type(error_list_type), intent(inout) :: errors
    logical :: chosen(size(names))
    integer(i4) :: k, before

    self%active = deck%count('constant_volume') > 0
    if (.not. self%active) return
    before = errors%count
    call deck%get('constant_volume', 1, 'since', self%since)
    self%pair = box_pairs(d)
    if (any(self%pair == 0)) then
      call deck%fault(errors, 'D281', 'the walls are no box: it needs three pairs of opposite '// &
                      'walls at right angles to each other', 'constant_volume', 1, '', &
                      'give six walls, no more that are opposite to each other')
      return
    end if
    call find_walls(deck, names, chosen, errors)
    if (errors%count > before) return
    do k = 1, 3
      self%moves(k) = all(chosen(self%pair(:, k)))
      if (any(chosen(self%pair(:, k))) .neqv. self%moves(k)) &
        call deck%fault(errors, 'D281', "of the opposite walls '"//names(self%pair(1, k))%s// &
                        "' and '"//names(self%pair(2, k))%s//"' one is named", &
                        'constant_volume', 1, 'walls', 'name both or none of a pair')
      if (self%moves(k) .and. any(abs(d%planes%velocity(:, self%pair(:, k))) > 0.0_wp)) &
        call deck%fault(errors, 'D281', "wall '"//names(self%pair(1, k))%s//"' or '"// &
                        names(self%pair(2, k))%s//"' has a velocity of its own", &
                        'constant_volume', 1, 'walls', 'leave it out: the volume sets it')
    end do
    call self%check_servos(deck, names, chosen, errors)
    if (all(self%moves)) &
      call deck%fault(errors, 'D281', 'all walls keep the volume: nothing would move', &
                      'constant_volume', 1, 'walls', 'leave out the pair that is driven')
  end subroutine read_volume

  !> Which walls the deck names.
  subroutine find_walls(deck, names, chosen, errors)
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)
    logical, intent(out) :: chosen(:)
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: wanted(:)
    integer(i4) :: k, j

    chosen = .false.
    call deck%get('constant_volume', 1, 'walls', wanted)
    do k = 1, size(wanted)
      do j = 1, size(names)
        if (names(j)%s == wanted(k)%s) exit
      end do
      if (j > size(names)) then
        call deck%fault(errors, 'D281', "there is no wall '"//wanted(k)%s//"'", &
                        'constant_volume', 1, 'walls', &
                        did_you_mean(wanted(k)%s, names, 'walls of this deck:'))
        return
      end if
      chosen(j) = .true.
    end do
  end subroutine find_walls

  !> None of them may be under a servo after `since`.
  subroutine check_servos(self, deck, names, chosen, errors)
    class(constant_volume_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(string_type), intent(in) :: names(:)
    logical, intent(in) :: chosen(:)
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k, j
    real(wp) :: until

    do k = 1, deck%count('servo')
      call deck%get('servo', k, 'wall', name)
      until = huge(1.0_wp)
      if (deck%given('servo', k, 'until')) call deck%get('servo', k, 'until', until)
      do j = 1, size(names)
        if (names(j)%s /= name .or. .not. chosen(j) .or. until <= self%since) cycle
        call deck%fault(errors, 'D281', "wall '"//name//"' is under a servo when it keeps the "// &
                        'volume', 'servo', k, 'wall', 'end the servo: until = since')
      end do
    end do
  end subroutine check_servos

  !> Velocities of the chosen pairs until the next update.
  subroutine set_velocities(self, d, time, ahead)
    class(constant_volume_type), intent(in) :: self
    type(dem_data_type), intent(inout) :: d
    real(wp), intent(in) :: time, ahead  !! now, and to the next update [s]
    real(wp) :: length(3), later(3), growth
    integer(i4) :: k, j, wall

    if (.not. self%active .or. time < self%since) return
    associate (p => d%planes)
      do k = 1, 3
        associate (a => self%pair(1, k), b => self%pair(2, k))
          length(k) = dot_product(p%point(:, b) - p%point(:, a), p%normal(:, a))
          later(k) = length(k)
          if (.not. self%moves(k)) later(k) = length(k) + ahead &
            *dot_product(p%velocity(:, b) - p%velocity(:, a), p%normal(:, a))
        end associate
      end do
      if (.not. d%kept_volume > 0.0_wp) d%kept_volume = product(length)
      growth = (d%kept_volume/product(later))**(1.0_wp/count(self%moves)) - 1.0_wp
      do k = 1, 3
        if (.not. self%moves(k)) cycle
        do j = 1, 2
          wall = self%pair(j, k)
          p%velocity(:, wall) = -0.5_wp*growth*length(k)/ahead*p%normal(:, wall)
        end do
      end do
    end associate
  end subroutine set_velocities
end module dem_volume
