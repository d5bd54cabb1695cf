!> Motions of surfaces one after another: groups motion of the deck. Fault D380.
!!
!! Each moves a surface along, or turns it about its centre or a point in space, for some time.
!! Every few steps the surface takes the constant velocity and spin that bring it where its motions
!! do in these steps, in the order of the deck.
module dem_surface_paths
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_curve, only: curve_type, curve_index
  use talus_deck, only: deck_type
  use dem_surface_images, only: is_endless
  use dem_surface_state, only: dem_surfaces_type
  use dem_ellipsoid, only: quaternion_from_rotation, quaternion_product, rotation_of
  implicit none
  private
  public :: motion_type, read_motions, moved, mean_motion

  type :: motion_type
    integer(i4) :: body = 0                  !! number of the surface
    integer(i4) :: curve = 0                 !! factor of its velocity and spin, 0: none
    real(wp) :: from = 0.0_wp, until = 0.0_wp    !! [s]
    real(wp) :: velocity(3) = 0.0_wp, spin(3) = 0.0_wp  !! [m/s], [rad/s]
    logical :: pivot = .false.               !! it turns about a point in space, not its centre
    real(wp) :: about(3) = 0.0_wp            !! that point [m]
  contains
    procedure, private :: advance
  end type motion_type

  real(wp), parameter :: aligned = 1.0e-12_wp  !! 1 - cosine of an angle that is none

contains

  !> All groups motion.
  subroutine read_motions(deck, s, curve, motion, errors)
    type(deck_type), intent(in) :: deck
    type(dem_surfaces_type), intent(in) :: s
    type(curve_type), intent(in) :: curve(:)
    type(motion_type), allocatable, intent(out) :: motion(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    allocate (motion(deck%count('motion')))
    do k = 1, size(motion)
      call read_motion(deck, k, s, motion(k), errors)
      call curve_index(deck, 'D250', curve, 'motion', k, motion(k)%curve, errors)
    end do
  end subroutine read_motions

  !> One group motion.
  subroutine read_motion(deck, k, s, motion, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(in) :: s
    type(motion_type), intent(inout) :: motion
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:)

    call find_body(deck, k, s, motion%body, errors)
    call deck%get('motion', k, 'from', motion%from)
    motion%until = huge(motion%until)
    if (deck%given('motion', k, 'until')) call deck%get('motion', k, 'until', motion%until)
    if (motion%until <= motion%from) &
      call deck%fault(errors, 'D380', 'a motion ends before it begins', 'motion', k, 'until', &
                      'give a later time, or leave it out for a motion to the end of the run')
    call deck%get('motion', k, 'velocity', values)
    motion%velocity = values
    call deck%get('motion', k, 'spin', values)
    motion%spin = values
    if (all(abs([motion%velocity, motion%spin]) <= 0.0_wp)) &
      call deck%fault(errors, 'D380', 'a motion neither moves nor turns its surface', 'motion', &
                      k, '', 'give a velocity, a spin or both')
    call check_endless(deck, k, s, motion, errors)
    motion%pivot = deck%given('motion', k, 'about')
    if (.not. motion%pivot) return
    call deck%get('motion', k, 'about', values)
    motion%about = values
    if (all(abs(motion%spin) <= 0.0_wp)) &
      call deck%fault(errors, 'D380', 'a motion about a point has no spin', 'motion', k, 'about', &
                      'give the spin, or take the point out')
  end subroutine read_motion

  !> The body that a group motion names.
  subroutine find_body(deck, k, s, body, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(in) :: s
    integer(i4), intent(out) :: body
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: surface, known
    integer(i4) :: b

    call deck%get('motion', k, 'surface', surface)
    body = 0
    known = ''
    do b = 1, s%n - deck%count('membrane')  ! membranes are the last ones
      if (s%name(b)%s == surface) body = b
      known = known//" '"//s%name(b)%s//"'"
    end do
    if (body > 0) return
    if (len(known) == 0) known = ' none'
    call deck%fault(errors, 'D380', "there is no surface '"//surface//"'", 'motion', k, &
                    'surface', 'surfaces, penetrometers and cylinders of this deck:'//known)
  end subroutine find_body

  !> A cylinder without ends turns about its axis alone.
  subroutine check_endless(deck, k, s, motion, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(dem_surfaces_type), intent(in) :: s
    type(motion_type), intent(in) :: motion
    type(error_list_type), intent(inout) :: errors
    real(wp) :: along
    if (motion%body == 0) return
    if (.not. is_endless(s, motion%body)) return
    along = abs(dot_product(motion%spin, s%round%axis(:, motion%body)))
    if (along >= (1.0_wp - aligned)*norm2(motion%spin)) return
    call deck%fault(errors, 'D380', 'a cylinder without ends turns about its axis alone', &
                    'motion', k, 'spin', 'give the cylinder a length, or a spin along its axis')
  end subroutine check_endless

  !> Centre [m] and turn of body b a while after t0, by its motions.
  pure subroutine moved(motion, curve, b, t0, t1, centre, turn)
    type(motion_type), intent(in) :: motion(:)
    type(curve_type), intent(in) :: curve(:)
    integer(i4), intent(in) :: b
    real(wp), intent(in) :: t0, t1  !! [s]
    real(wp), intent(inout) :: centre(3)
    real(wp), intent(inout) :: turn(4)  !! since t0, a quaternion
    integer(i4) :: k
    do k = 1, size(motion)
      if (motion(k)%body == b) call motion(k)%advance(curve, [t0, t1], centre, turn)
    end do
  end subroutine moved

  !> One motion between two times: along first, then the turn.
  pure subroutine advance(self, curve, time, centre, turn)
    class(motion_type), intent(in) :: self
    type(curve_type), intent(in) :: curve(:)
    real(wp), intent(in) :: time(2)
    real(wp), intent(inout) :: centre(3), turn(4)
    real(wp) :: first, last, lasting, q(4)

    first = max(time(1), self%from)
    last = min(time(2), self%until)
    if (last <= first) return
    lasting = last - first
    if (self%curve > 0) lasting = lasting*curve(self%curve)%mean(first, last)
    centre = centre + lasting*self%velocity
    if (all(abs(self%spin) <= 0.0_wp)) return
    q = quaternion_from_rotation(lasting*self%spin)
    if (self%pivot) centre = self%about + matmul(rotation_of(q), centre - self%about)
    turn = quaternion_product(q, turn)
  end subroutine advance

  !> Constant velocity [m/s] and spin [rad/s] that move a centre and turn a body so in a time.
  pure subroutine mean_motion(way, turn, time, velocity, spin)
    real(wp), intent(in) :: way(3), turn(4), time  !! [m], quaternion, [s]
    real(wp), intent(out) :: velocity(3), spin(3)
    real(wp) :: sine
    velocity = way/time
    spin = 2.0_wp*turn(2:)/time
    sine = norm2(turn(2:))
    if (sine > 0.0_wp) spin = spin*(atan2(sine, turn(1))/sine)
  end subroutine mean_motion
end module dem_surface_paths
