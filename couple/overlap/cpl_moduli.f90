!> Moduli of the solid from the pack: those that talus-dem has probed, or the affine sum over its
!! contacts, which is an upper bound (theory: overlap coupling, Start).
module cpl_moduli
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_files, only: read_file
  use talus_message, only: verb_set
  use talus_moduli, only: isotropic_type
  use talus_port_names, only: field_element, field_micropolar, field_poisson, field_what, &
    field_young, what_moduli
  use talus_timers, only: timers_type
  use cpl_choices, only: cpl_choices_type
  use cpl_overlap, only: overlap_type
  use cpl_overlap_partition, only: points_type
  use cpl_solver, only: cpl_solver_type
  implicit none
  private
  public :: choose_moduli, send_moduli, read_probe

  real(wp), parameter :: least_length = 1.0e-3_wp  !! l_b of contacts, of a diameter, that counts

contains

  !> Moduli of all elements as the deck asks for them, over those that the solid has.
  subroutine choose_moduli(o, choices, affine, points, errors)
    type(overlap_type), intent(inout) :: o
    type(cpl_choices_type), intent(in) :: choices
    type(isotropic_type), intent(in) :: affine
    type(points_type), intent(inout) :: points
    type(error_list_type), intent(inout) :: errors
    real(wp) :: lambda, shear
    integer(i4) :: e

    o%start%affine = affine
    if (choices%overlap%moduli == 'deck') return
    lambda = affine%lambda
    shear = affine%shear
    if (choices%overlap%moduli == 'probed') &
      call read_probe(choices%overlap%probe, lambda, shear, errors)
    if (errors%any()) return
    if (.not. (shear > 0.0_wp .and. 3.0_wp*lambda + 2.0_wp*shear > 0.0_wp)) then
      call errors%add('I445', 'the pack gives no moduli: lambda '//str(lambda)//' Pa, G '// &
                      str(shear)//' Pa', choices%overlap%probe, 'its grains do not touch, or '// &
                      "not enough: compress it first, or write moduli = 'deck'")
      return
    end if
    o%start%lambda = lambda
    o%start%shear = shear
    o%start%moduli = points%moduli
    do e = 1, size(o%start%moduli, 2)
      associate (m => o%start%moduli(:, e))
        m(1) = lambda
        if (m(3) > 0.0_wp) then
          m(3) = merge(affine%kappa, m(3), affine%kappa > 0.0_wp)
          if (affine%bending_length > least_length*o%sets%d_max) &
            m(4:6) = [affine%alpha, affine%beta, affine%gamma]
        end if
        m(2) = shear - 0.5_wp*m(3)
      end associate
    end do
    points%moduli = o%start%moduli
  end subroutine choose_moduli

  !> SET moduli: six of micropolar elements, two of the others.
  subroutine send_moduli(o, solid, timers, errors)
    type(overlap_type), intent(in) :: o
    type(cpl_solver_type), intent(inout) :: solid
    type(timers_type), intent(inout) :: timers
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: list(:)
    integer(i4) :: e
    logical :: polar(size(o%start%moduli, 2))

    polar = o%start%moduli(3, :) > 0.0_wp
    list = pack([(e, e=1, size(polar))], polar)
    if (size(list) > 0) then
      call begin(list)
      call solid%request%put(field_micropolar, o%start%moduli(:, list))
      call solid%ask(timers, errors)
    end if
    list = pack([(e, e=1, size(polar))], .not. polar)
    if (size(list) == 0 .or. errors%any()) return
    call begin(list)
    associate (lambda => o%start%moduli(1, list), shear => o%start%moduli(2, list))
      call solid%request%put(field_young, shear*(3.0_wp*lambda + 2.0_wp*shear)/(lambda + shear))
      call solid%request%put(field_poisson, 0.5_wp*lambda/(lambda + shear))
    end associate
    call solid%ask(timers, errors)

  contains

    subroutine begin(elements)
      integer(i4), intent(in) :: elements(:)
      call solid%start_request(verb_set, o%step, solid%time, solid%time)
      call solid%request%put_text(field_what, what_moduli)
      call solid%request%put_int(field_element, elements)
    end subroutine begin
  end subroutine send_moduli

  !> The isotropic part of what talus-dem has probed (format talus-probe). I444 other files.
  subroutine read_probe(path, lambda, shear, errors)
    character(len=*), intent(in) :: path
    real(wp), intent(out) :: lambda, shear  !! [Pa]
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: text
    logical :: found(2)
    integer :: from, to

    lambda = 0.0_wp
    shear = 0.0_wp
    call read_file(path, text, errors)
    if (errors%any()) return
    found = .false.
    from = index(text, '"probed"')
    if (index(text, '"talus-probe"') > 0 .and. from > 0) then
      to = from + index(text(from:)//'}', '}') - 2
      call number_of(text(from:to), 'lambda_Pa', lambda, found(1))
      call number_of(text(from:to), 'shear_Pa', shear, found(2))
    end if
    if (all(found)) return
    call errors%add('I444', 'this is no file of probed moduli', path, &
                    'name the <deck>_probe.json of a talus-dem run with &probe')
  end subroutine read_probe

  !> The number behind "name":
  pure subroutine number_of(text, name, value, found)
    character(len=*), intent(in) :: text, name
    real(wp), intent(out) :: value
    logical, intent(out) :: found
    integer :: from, to, status
    value = 0.0_wp
    found = .false.
    from = index(text, '"'//name//'"')
    if (from == 0) return
    from = from + len(name) + 2
    from = from + index(text(from:), ':')
    to = from + scan(text(from:)//',', ','//achar(10)//'}') - 2
    read (text(from:to), *, iostat=status) value
    found = status == 0
    if (found) found = is_finite(value)
  end subroutine number_of
end module cpl_moduli
