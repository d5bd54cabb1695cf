!> The liquid in the pores of a solid at the port: nodes with a pressure that a partner has, what it
!! lets in, what they report. eq. F.70
module fem_port_pore
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: dot_content, dot_darcy, dot_entered, dot_flow_work, dot_fluid_in, &
    dot_p, field_compressibility, field_id, field_mobility, field_value
  use fem_body, only: fem_body_type
  use fem_types, only: fem_set_type
  implicit none
  private
  public :: check_wet, describe_wet, put_wet, store_at, take_wet

contains

  !> SELECT: all nodes have a pressure (D452).
  subroutine check_wet(body, name, ids, errors)
    type(fem_body_type), intent(in) :: body
    character(len=*), intent(in) :: name
    integer(i8), intent(in) :: ids(:)
    type(error_list_type), intent(inout) :: errors
    logical :: dry
    integer(i4) :: k
    if (body%pore%unsaturated) call errors%add('D476', 'unsaturated pores share no liquid', &
      'set '//name, "take full pores, retention = 'none', or set permeable = .false.")
    if (errors%any()) return
    do k = 1, size(ids)
      dry = .not. body%pore%active
      if (.not. dry) dry = ids(k) < 1 .or. ids(k) > body%mesh%nodes
      if (.not. dry) dry = body%dofs%p(ids(k)) == 0
      if (.not. dry) cycle
      call errors%add('D452', 'node '//str(ids(k))//' has no pressure of a liquid', 'set '//name, &
                      'give the material of its elements a &pore, or set permeable = .false.')
      return
    end do
  end subroutine check_wet

  !> DESCRIBE pore: nodes with a pressure, the largest mobility and compressibility of the elements
  !! around each; the drained skeleton counts in the latter.
  subroutine describe_wet(body, reply, errors)
    type(fem_body_type), intent(in) :: body
    type(message_type), intent(inout) :: reply
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: most(:, :)
    integer(i4), allocatable :: node(:)
    integer(i4) :: a
    if (.not. body%pore%active) then
      call errors%add('D452', 'the solid has no liquid in its pores', 'exchange port, DESCRIBE', &
                      'add &pore to its deck, or set permeable = .false.')
      return
    end if
    if (body%pore%unsaturated) then
      call errors%add('D476', 'unsaturated pores share no liquid', 'exchange port, DESCRIBE', &
                      "take full pores, retention = 'none', or set permeable = .false.")
      return
    end if
    most = largest_around(body)
    node = pack([(a, a=1, body%mesh%nodes)], body%dofs%p > 0)
    call reply%put_int(field_id, node)
    call reply%put(field_mobility, most(1, node))
    call reply%put(field_compressibility, most(2, node))
  end subroutine describe_wet

  !> Mobility [m^2/(Pa s)] and compressibility [1/Pa] at nodes, the largest of their elements.
  pure function largest_around(body) result(most)
    type(fem_body_type), intent(in) :: body
    real(wp) :: most(2, body%mesh%nodes), here(2)
    integer(i4) :: e, a, k, node
    most = 0.0_wp
    do e = 1, body%mesh%elements
      k = body%pore%skeleton_of(e)
      if (k == 0) cycle
      associate (s => body%pore%skeleton(k))
        here = [maxval(s%mobility), s%storage + s%biot**2/max(body%pore%confined(e), tiny(1.0_wp))]
      end associate
      do a = body%dofs%wet_start(e), body%dofs%wet_start(e + 1) - 1
        node = body%dofs%node(body%dofs%wet(a))
        most(:, node) = max(most(:, node), here)
      end do
    end do
  end function largest_around

  !> SET pore_storage of a set.
  subroutine store_at(body, set, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: value(size(set%node))
    call request%get(field_value, value, errors)
    if (errors%any()) return
    if (.not. body%pore%partner > 0 .or. .not. all(is_finite(value)) .or. any(value < 0.0_wp)) then
      call errors%add('P302', 'storage of the set '//trim(set%name)//' is negative or no number', &
                      request%place())
      return
    end if
    body%pore%beside(body%dofs%p(set%node)) = value
    call body%system%forget_factors()
    call body%system%forget_numbers()
  end subroutine store_at

  !> What a partner lets in at a set in the interval of a request; nothing if it does not say.
  subroutine take_wet(body, set, request, errors)
    type(fem_body_type), intent(inout) :: body
    type(fem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    real(wp) :: volume(size(set%node)), span
    volume = 0.0_wp
    if (request%has(trim(set%name)//dot_fluid_in)) &
      call request%get(trim(set%name)//dot_fluid_in, volume, errors)
    span = request%t1 - body%accepted%time
    if (.not. all(is_finite(volume)) .or. .not. span > 0.0_wp) &
      call errors%add('P302', 'set '//trim(set%name)//': a volume that enters is no number, or '// &
                      'the interval has no length', request%place())
    if (.not. errors%any()) &
      call body%pore%let_partner_in(body%dofs%p(set%node), volume, span)
  end subroutine take_wet

  !> Pressures, contents and works of a set.
  subroutine put_wet(body, set, reply)
    type(fem_body_type), intent(in) :: body
    type(fem_set_type), intent(in) :: set
    type(message_type), intent(inout) :: reply
    character(len=:), allocatable :: name
    integer(i4) :: own
    name = trim(set%name)
    associate (b => body%pore%books)
      own = int(size(body%pore%held), i4) + body%pore%partner
      call reply%put(name//dot_p, body%state%u(1, body%dofs%p(set%node)))
      call reply%put(name//dot_content, b%content)
      call reply%put(name//dot_entered, sum(b%entered) - b%entered(own))
      call reply%put(name//dot_flow_work, body%energy%flow)
      call reply%put(name//dot_darcy, body%energy%darcy)
    end associate
  end subroutine put_wet
end module fem_port_pore
