!> Layered solid as a micropolar continuum, `layered` (Adhikary & Dyskin 1997): equal elastic
!! layers, joints that open and slip elastically between them, and micro-rotations that follow the
!! layers.
!!
!! Along the normal 3 of the layers, of modulus E, ratio nu and thickness b, G = E/(2 (1 + nu)),
!! with joints of stiffness k_n and k_s per area, G' = G b k_s/(G + b k_s):
!!   sigma_31 = G' (gamma_31 + gamma_13),  sigma_13 = G' gamma_31 + (G + G') gamma_13,
!!   m_21 = B (phi_1,2 - nu phi_2,1),      m_12 = B (phi_2,1 - nu phi_1,2),
!!   B = E b^2/(12 (1 - nu^2)) (G - G')/(G + G'),
!!   m_11 = -m_22 = B (1 - nu)/2 (phi_1,1 - phi_2,2),
!! the stretches those of layers and joints in series. The last line, the twist of the layers as
!! plates, makes the law the same for all directions in their plane; the source omits it.
!! Indices as in `fem_micropolar`: the first is the face's normal, and nine-vectors hold kl = 11 12
!! 13 21 22 23 31 32 33.
module fem_law_layered
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use fem_law, only: at_flag, at_iterations, flag_elastic
  use fem_law_polar, only: fem_law_polar_type, count_polar_work
  use fem_micropolar, only: lame_moduli
  use fem_polar, only: polar_size, eringen_families
  implicit none
  private
  public :: fem_law_layered_type

  !> Constants of the layers and joints.
  type :: fem_layers_type
    real(wp) :: young = 0.0_wp, poisson = 0.0_wp   !! of the layers [Pa], [-]
    real(wp) :: thickness = 0.0_wp                 !! of a layer, b [m]
    real(wp) :: normal = 0.0_wp, shear = 0.0_wp    !! of the joints, k_n and k_s [Pa/m]
    real(wp) :: spin = 0.0_wp                      !! against spin about the normal [Pa]
    real(wp) :: axis(3) = [0.0_wp, 0.0_wp, 1.0_wp]  !! normal of the layers
    logical :: published = .false.  !! moduli of Adhikary & Dyskin for plane strain
  end type fem_layers_type

  type, extends(fem_law_polar_type) :: fem_law_layered_type
  contains
    procedure :: define
    procedure :: read_constants
    procedure :: polar_update
  end type fem_law_layered_type

contains

  subroutine define(self)
    class(fem_law_layered_type), intent(inout) :: self
    self%name = 'layered'
    self%stateful = .false.
    self%polar = .true.
  end subroutine define

  !> The operator in space, and the layers' own moduli as those of a solid without joints; fault
  !! D321.
  subroutine read_constants(self, deck, m, errors)
    class(fem_law_layered_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(error_list_type), intent(inout) :: errors
    type(fem_layers_type) :: layers
    real(wp), allocatable :: axis(:)
    character(len=:), allocatable :: moduli_of

    call deck%get('material', m, 'young', layers%young)
    call deck%get('material', m, 'poisson', layers%poisson)
    call deck%get('material', m, 'layer_thickness', layers%thickness)
    call deck%get('material', m, 'joint_normal', layers%normal)
    call deck%get('material', m, 'joint_shear', layers%shear)
    call deck%get('material', m, 'spin_modulus', layers%spin)
    call deck%get('material', m, 'layer_normal', axis)
    call deck%get('material', m, 'layer_moduli', moduli_of)
    self%moduli = lame_moduli(layers%young, layers%poisson)
    if (.not. norm2(axis) > 0.0_wp) then
      call deck%fault(errors, 'D321', 'the normal of the layers has no length', 'material', m, &
                      'layer_normal', 'give its direction, such as 0, 0, 1')
      return
    end if
    layers%axis = axis
    layers%published = moduli_of == 'published'
    self%modulus_of = eringen_families(self%moduli)
    self%operator = operator_of(layers)
  end subroutine read_constants

  pure subroutine polar_update(self, strain, stress, state, tangent, good)
    class(fem_law_layered_type), intent(in) :: self
    real(wp), intent(in) :: strain(polar_size)
    real(wp), intent(inout) :: stress(polar_size)
    real(wp), intent(inout) :: state(:)
    real(wp), intent(out) :: tangent(polar_size, polar_size)
    logical, intent(out) :: good
    real(wp) :: new(polar_size)
    tangent = 0.0_wp
    tangent(:9, :9) = self%operator(:, :, 1)
    tangent(10:, 10:) = self%operator(:, :, 2)
    new = stress + matmul(tangent, strain)
    state(at_flag) = flag_elastic
    state(at_iterations) = 0.0_wp
    call count_polar_work(strain, 0.0_wp*strain, stress, new, state)
    stress = new
    good = .true.
  end subroutine polar_update

  !> The moduli in space.
  pure function operator_of(layers) result(moduli)
    type(fem_layers_type), intent(in) :: layers
    real(wp) :: moduli(9, 9, 2)
    real(wp) :: turn(3, 3)
    moduli = 0.0_wp
    call stretch_moduli(layers, moduli(:, :, 1))
    call shear_moduli(layers, moduli)
    turn = frame_of(layers%axis)
    moduli(:, :, 1) = turned(moduli(:, :, 1), turn)
    moduli(:, :, 2) = turned(moduli(:, :, 2), turn)
  end function operator_of

  !> Stretches along the layers and across them: layers and joints in series.
  pure subroutine stretch_moduli(layers, a)
    type(fem_layers_type), intent(in) :: layers
    real(wp), intent(inout) :: a(9, 9)
    real(wp) :: across, along, between, side, ratio, joint
    associate (e => layers%young, nu => layers%poisson)
      joint = layers%thickness*layers%normal
      ratio = nu/(1.0_wp - nu)
      across = 1.0_wp/((1.0_wp + nu)*(1.0_wp - 2.0_wp*nu)/(e*(1.0_wp - nu)) + 1.0_wp/joint)
      side = ratio*across
      along = e/(1.0_wp - nu**2) + ratio*side
      between = e*nu/(1.0_wp - nu**2) + ratio*side
      if (layers%published) between = ratio*along
    end associate
    a([1, 5], 9) = side
    a(9, [1, 5]) = side
    a(9, 9) = across
    a(1, 1) = along
    a(5, 5) = along
    a(1, 5) = between
    a(5, 1) = between
  end subroutine stretch_moduli

  !> Shears and the bending of the layers.
  pure subroutine shear_moduli(layers, moduli)
    type(fem_layers_type), intent(in) :: layers
    real(wp), intent(inout) :: moduli(9, 9, 2)
    real(wp) :: g, jointed, bending
    associate (e => layers%young, nu => layers%poisson, b => layers%thickness, &
               c => moduli(:, :, 2))
      g = e/(2.0_wp*(1.0_wp + nu))
      jointed = g*b*layers%shear/(g + b*layers%shear)
      bending = e*b**2/(12.0_wp*(1.0_wp - nu**2))*(g - jointed)/(g + jointed)
      c(4, [4, 2]) = bending*[1.0_wp, -nu]
      c(2, [2, 4]) = bending*[1.0_wp, -nu]
      if (.not. layers%published) then
        c(1, [1, 5]) = 0.5_wp*(1.0_wp - nu)*bending*[1.0_wp, -1.0_wp]
        c(5, [5, 1]) = 0.5_wp*(1.0_wp - nu)*bending*[1.0_wp, -1.0_wp]
      end if
    end associate
    associate (a => moduli(:, :, 1))
      a([2, 4], [2, 4]) = g
      a([2, 4], 2) = a([2, 4], 2) + layers%spin*[1.0_wp, -1.0_wp]
      a([2, 4], 4) = a([2, 4], 4) - layers%spin*[1.0_wp, -1.0_wp]
      a([7, 3], [7, 3]) = jointed
      a(3, 3) = g + jointed
      a([8, 6], [8, 6]) = jointed
      a(6, 6) = g + jointed
    end associate
  end subroutine shear_moduli

  !> Columns are the axes of the layers, the third along the normal.
  pure function frame_of(axis) result(turn)
    real(wp), intent(in) :: axis(3)
    real(wp) :: turn(3, 3)
    integer(i4) :: least
    turn(:, 3) = axis/norm2(axis)
    if (abs(turn(3, 3)) > 1.0_wp - epsilon(1.0_wp)) then
      turn(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
    else
      least = minloc(abs(turn(:, 3)), dim=1)
      turn(:, 1) = -turn(least, 3)*turn(:, 3)
      turn(least, 1) = turn(least, 1) + 1.0_wp
      turn(:, 1) = turn(:, 1)/norm2(turn(:, 1))
    end if
    turn(:, 2) = [turn(2, 3)*turn(3, 1) - turn(3, 3)*turn(2, 1), &
                  turn(3, 3)*turn(1, 1) - turn(1, 3)*turn(3, 1), &
                  turn(1, 3)*turn(2, 1) - turn(2, 3)*turn(1, 1)]
  end function frame_of

  !> Moduli of the frame's axes in space.
  pure function turned(moduli, turn) result(space)
    real(wp), intent(in) :: moduli(9, 9), turn(3, 3)
    real(wp) :: space(9, 9), q(9, 9)
    integer(i4) :: k, i
    do i = 1, 3
      do k = 1, 3
        q(3*k - 2:3*k, 3*i - 2:3*i) = turn(k, i)*turn
      end do
    end do
    space = matmul(q, matmul(moduli, transpose(q)))
  end function turned
end module fem_law_layered
