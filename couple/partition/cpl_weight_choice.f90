!> Which weights to take, by name (theory: "Energy partition").
!!
!! ramp: ramps of omega; fit: ramps and the joint fit, for lattices; auto: fit where the pack is a
!! lattice, else ramp. The others are for comparison: twice counts all; share skips contacts between
!! ghosts and takes 1 - share; scalar the same with points fitted; given takes what is there.
module cpl_weight_choice
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_suggest, only: did_you_mean
  use talus_text, only: string_type, append_string
  use talus_errors, only: error_list_type
  use cpl_partition, only: partition_type
  use cpl_weight_fit, only: fit_type, fit_joint, closed
  use cpl_weights, only: ramp_weights, twice_weights, share_weights, pack_is_disordered
  implicit none
  private
  public :: weight_choice_type, choose_weights, weight_choice_of, weights_auto, weights_ramp, &
    weights_fit, weights_twice, weights_share, weights_scalar, weights_given

  integer(i4), parameter :: weights_auto = 1, weights_ramp = 2, weights_fit = 3, &
    weights_twice = 4, weights_share = 5, weights_scalar = 6, weights_given = 7
  character(len=*), parameter :: names(7) = [character(len=6) :: 'auto', 'ramp', 'fit', 'twice', &
                                             'share', 'scalar', 'given']

  type :: weight_choice_type
    integer(i4) :: kind = weights_auto
    character(len=:), allocatable :: name  !! 'auto' becomes what it has chosen
    real(wp) :: depth = 0.0_wp             !! T of the ghosts' layer [m]
    real(wp) :: d_max = 0.0_wp             !! largest diameter [m]
    real(wp) :: rho = 1.0_wp               !! relaxed over affine stiffness of the pack [-]
    real(wp) :: disorder = 0.0_wp          !! median unbalance of grains under uniform strain [-]
    real(wp), allocatable :: share(:)      !! (points) of stiffness counted in contacts [-]
  end type weight_choice_type

contains

  !> Find a method by its name; D440 where there is none.
  subroutine weight_choice_of(name, choice, place, errors)
    character(len=*), intent(in) :: name, place
    type(weight_choice_type), intent(inout) :: choice
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: known(:)
    integer(i4) :: k
    choice%name = name
    choice%kind = int(findloc(names == name, .true., 1), i4)
    if (choice%kind > 0) return
    do k = 1, size(names)
      call append_string(known, trim(names(k)))
    end do
    call errors%add('D440', "there are no weights '"//name//"'", place, &
                    did_you_mean(name, known, 'methods:'))
  end subroutine weight_choice_of

  !> Weights of contacts and points; of weights_given they are there already.
  subroutine choose_weights(self, choice, w, beta, fit, errors)
    type(partition_type), intent(in) :: self
    type(weight_choice_type), intent(inout) :: choice
    real(wp), allocatable, intent(inout) :: w(:), beta(:)
    type(fit_type), intent(out) :: fit
    type(error_list_type), intent(inout) :: errors
    logical :: disordered

    call pack_is_disordered(self, disordered, choice%disorder)
    if (choice%kind == weights_auto) then
      choice%kind = merge(weights_ramp, weights_fit, disordered)
      choice%name = trim(names(choice%kind))
    end if
    select case (choice%kind)
    case (weights_ramp, weights_fit)
      if (.not. choice%depth > choice%d_max) then
        call errors%add('D441', 'the layer of ghosts is '//str(choice%depth)//' m deep, the '// &
                        'largest grain '//str(choice%d_max)//' m', 'energy partition', &
                        'three largest diameters or more are advised')
        return
      end if
      call ramp_weights(self, choice%depth, choice%d_max, choice%rho, w, beta)
    case (weights_twice)
      call twice_weights(self, w, beta)
    case (weights_share, weights_scalar)
      if (.not. allocated(choice%share)) then
        call errors%add('D442', "the weights '"//choice%name//"' need shares of the points", &
                        'energy partition', 'give positions of points and contacts')
        return
      end if
      call share_weights(self, choice%share, w, beta)
    end select
    if (choice%kind == weights_fit .or. choice%kind == weights_scalar) &
      call fit_joint(self, choice%kind == weights_fit, w, beta, fit, errors)
    if (choice%kind == weights_fit .and. .not. fit%after <= closed) &
      call errors%add('N443', 'the fit of the weights leaves '//str(fit%after)//' of a mean '// &
                      'contact force', 'energy partition', 'weights within 0 and 1 cannot '// &
                      "balance these ghosts and elements: take partition = 'ramp', or a "// &
                      'layer of ghosts of three diameters or more')
  end subroutine choose_weights
end module cpl_weight_choice
