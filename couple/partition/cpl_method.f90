!> Which weights to take, by name (theory: "Energy partition").
!!
!! ramp: ramps of omega; fit: ramps and the joint fit, for lattices; auto: fit where the pack is a
!! lattice, else ramp. The others are for comparison: twice counts all; share skips contacts between
!! ghosts and takes 1 - share; scalar the same with points fitted; given takes what is there.
module cpl_method
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
  public :: method_type, choose_weights, method_of, method_auto, method_ramp, method_fit, &
    method_twice, method_share, method_scalar, method_given

  integer(i4), parameter :: method_auto = 1, method_ramp = 2, method_fit = 3, method_twice = 4, &
    method_share = 5, method_scalar = 6, method_given = 7
  character(len=*), parameter :: names(7) = [character(len=6) :: 'auto', 'ramp', 'fit', 'twice', &
                                             'share', 'scalar', 'given']

  type :: method_type
    integer(i4) :: kind = method_auto
    character(len=:), allocatable :: name  !! 'auto' becomes what it has chosen
    real(wp) :: depth = 0.0_wp             !! T of the ghosts' layer [m]
    real(wp) :: d_max = 0.0_wp             !! largest diameter [m]
    real(wp) :: rho = 1.0_wp               !! relaxed over affine stiffness of the pack [-]
    real(wp) :: disorder = 0.0_wp          !! median unbalance of grains under uniform strain [-]
    real(wp), allocatable :: share(:)      !! (points) of stiffness counted in contacts [-]
  end type method_type

contains

  !> Find a method by its name; D440 where there is none.
  subroutine method_of(name, method, place, errors)
    character(len=*), intent(in) :: name, place
    type(method_type), intent(inout) :: method
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: known(:)
    integer(i4) :: k
    method%name = name
    method%kind = int(findloc(names == name, .true., 1), i4)
    if (method%kind > 0) return
    do k = 1, size(names)
      call append_string(known, trim(names(k)))
    end do
    call errors%add('D440', "there are no weights '"//name//"'", place, &
                    did_you_mean(name, known, 'methods:'))
  end subroutine method_of

  !> Weights of contacts and points; of method_given they are there already.
  subroutine choose_weights(self, method, w, beta, fit, errors)
    type(partition_type), intent(in) :: self
    type(method_type), intent(inout) :: method
    real(wp), allocatable, intent(inout) :: w(:), beta(:)
    type(fit_type), intent(out) :: fit
    type(error_list_type), intent(inout) :: errors
    logical :: disordered

    call pack_is_disordered(self, disordered, method%disorder)
    if (method%kind == method_auto) then
      method%kind = merge(method_ramp, method_fit, disordered)
      method%name = trim(names(method%kind))
    end if
    select case (method%kind)
    case (method_ramp, method_fit)
      if (.not. method%depth > method%d_max) then
        call errors%add('D441', 'the layer of ghosts is '//str(method%depth)//' m deep, the '// &
                        'largest grain '//str(method%d_max)//' m', 'energy partition', &
                        'three largest diameters or more are advised')
        return
      end if
      call ramp_weights(self, method%depth, method%d_max, method%rho, w, beta)
    case (method_twice)
      call twice_weights(self, w, beta)
    case (method_share, method_scalar)
      if (.not. allocated(method%share)) then
        call errors%add('D442', "the weights '"//method%name//"' need shares of the points", &
                        'energy partition', 'give positions of points and contacts')
        return
      end if
      call share_weights(self, method%share, w, beta)
    end select
    if (method%kind == method_fit .or. method%kind == method_scalar) &
      call fit_joint(self, method%kind == method_fit, w, beta, fit, errors)
    if (method%kind == method_fit .and. .not. fit%after <= closed) &
      call errors%add('N443', 'the fit of the weights leaves '//str(fit%after)//' of a mean '// &
                      'contact force', 'energy partition', 'weights within 0 and 1 cannot '// &
                      "balance these ghosts and elements: take partition = 'ramp', or a "// &
                      'layer of ghosts of three diameters or more')
  end subroutine choose_weights
end module cpl_method
