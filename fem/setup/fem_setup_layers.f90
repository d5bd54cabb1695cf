!> The layered solid of the deck.
module fem_setup_layers
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use fem_layered, only: fem_layered_type, fem_layers_type, layered_law
  use fem_micropolar, only: lame_moduli
  implicit none
  private
  public :: read_layers

contains

  !> Moduli of material m, and the layers' own as those of a solid without joints; fault D321.
  subroutine read_layers(deck, m, law, moduli, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: m
    type(fem_layered_type), intent(out) :: law
    real(wp), intent(out) :: moduli(6)
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
    moduli = lame_moduli(layers%young, layers%poisson)
    if (.not. norm2(axis) > 0.0_wp) then
      call deck%fault(errors, 'D321', 'the normal of the layers has no length', 'material', m, &
                      'layer_normal', 'give its direction, such as 0, 0, 1')
      return
    end if
    layers%axis = axis
    layers%published = moduli_of == 'published'
    law = layered_law(layers)
  end subroutine read_layers
end module fem_setup_layers
