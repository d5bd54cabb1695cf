!> Verbs of the port that change the population: WAKE, SLEEP, RELAX, and SET kind.
!!
!! No time passes in them, and grains have other numbers afterwards: whoever calls forgets all that
!! is by grain. Faults P265 to P268.
module dem_port_population
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use talus_message, only: message_type
  use talus_port_names, only: field_axes, field_exponent, field_force, field_guest, &
    field_history, field_id, field_ids, field_kind, field_knots, field_material, field_moved, &
    field_omega, field_pressure, field_quat, field_skew, field_step_limit, field_steps, &
    field_stress, field_stretch, field_substeps, field_tolerance, field_turn, field_unbalanced, &
    field_v, field_x
  use talus_suggest, only: did_you_mean
  use dem_bed, only: waking_type
  use dem_entry, only: size_batch, make_entering, check_ids
  use dem_model, only: dem_model_type
  use talus_serve, only: limit_told
  use dem_packing, only: dem_packing_type
  use dem_port_seam, only: fit_in
  use dem_records, only: index_of
  use dem_rest, only: rest_type
  use dem_start_springs, only: start_springs_type
  use dem_state, only: dem_grains_type, kind_free, kind_ghost
  implicit none
  private
  public :: wake, sleep, relax, set_kinds

contains

  !> Grains enter, with the friction of their contacts.
  subroutine wake(model, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    type(dem_packing_type) :: batch
    type(dem_grains_type) :: entering
    type(start_springs_type) :: springs
    type(waking_type) :: waking
    integer(i4) :: material

    call check_open(model, request, errors)
    call take_material(model, request, material, errors)
    if (.not. errors%any()) call take_waking(model, request, reply, material, waking, errors)
    if (.not. errors%any()) call take_batch(model, request, waking, batch, errors)
    if (request%has(field_guest) .and. .not. errors%any()) then
      call check_new(model, request, batch, errors)
      if (.not. errors%any()) &
        call fit_in(model, request, reply, material, batch, waking, errors)
    end if
    if (.not. errors%any()) call take_springs(request, springs, errors)
    call request%all_read(errors)
    if (errors%any()) return
    call check_new(model, request, batch, errors)
    if (.not. request%has(field_axes) .and. .not. errors%any()) &
      call model%bed%springs_of(model%system%dem_data_type, batch%id, springs, waking)
    if (.not. errors%any()) call check_ids('the partner', batch, request%place(), errors)
    if (.not. errors%any()) call make_entering(batch, material, model%system, entering, errors)
    if (errors%any()) return
    call model%system%be_open()
    call model%system%enter(entering, springs)
    call settle(model, reply)
  end subroutine wake

  !> Grains leave.
  subroutine sleep(model, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    logical, allocatable :: leaving(:)

    call check_open(model, request, errors)
    call take_marks(model, request, leaving, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (any(leaving .and. model%system%grains%kind /= kind_free .and. &
            model%system%grains%kind /= kind_ghost)) then
      call errors%add('P268', 'grains that the deck fixes or drives cannot leave', &
                      request%place(), 'name grains that are free or prescribed')
      return
    end if
    call model%system%be_open()
    call model%system%forget_weights(leaving)
    call model%system%leave(leaving)
    call settle(model, reply)
  end subroutine sleep

  !> Some free grains come to rest, all else is held.
  subroutine relax(model, request, reply, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    type(error_list_type), intent(inout) :: errors
    type(rest_type) :: rest
    logical, allocatable :: moving(:)

    call check_open(model, request, errors)
    call take_marks(model, request, moving, errors)
    call request%get_int(field_steps, rest%most_steps, errors)
    call request%get(field_tolerance, rest%tolerance, errors)
    call request%all_read(errors)
    if (errors%any()) return
    if (any(moving .and. model%system%grains%kind /= kind_free) .or. rest%most_steps < 1 .or. &
        .not. rest%tolerance > 0.0_wp) then
      call errors%add('P267', 'RELAX of grains that are not free, without steps or without a '// &
                      'tolerance', request%place(), 'name free grains, at least one step and a '// &
                      'tolerance above 0')
      return
    end if
    call model%timers%start('conversions')
    call rest%reach(model%system, moving, errors)
    call model%timers%stop('conversions')
    if (errors%any()) return
    call reply%put_int(field_substeps, rest%steps)
    call reply%put(field_unbalanced, rest%unbalanced)
    call reply%put(field_moved, rest%moved)
    call settle(model, reply)
  end subroutine relax

  !> SET kind: free or prescribed from now on; what becomes prescribed is at rest.
  subroutine set_kinds(model, request, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: index(:), kind(:), now(:)
    integer(i8), allocatable :: ids(:)
    type(start_springs_type) :: springs
    real(wp), allocatable :: given(:, :), v(:, :)
    logical :: none(model%system%grains%n)

    call check_open(model, request, errors)
    call request%take_int(field_id, ids, errors)
    call request%take_int(field_kind, kind, errors)
    allocate (given(3, size(ids)), source=0.0_wp)
    if (request%has(field_v) .and. .not. errors%any()) call request%get(field_v, given, errors)
    call request%all_read(errors)
    if (errors%any()) return
    call check_kinds(request, kind, size(ids), errors)
    call model%system%find(ids, index, errors)
    if (errors%any()) return
    allocate (v(3, model%system%grains%n), source=0.0_wp)
    v(:, index) = given
    now = model%system%grains%kind
    now(index) = kind
    if (any(now(index) /= model%system%grains%kind(index) .and. &
            model%system%grains%kind(index) /= kind_free .and. &
            model%system%grains%kind(index) /= kind_ghost)) then
      call errors%add('P268', 'grains that the deck fixes or drives cannot become free', &
                      request%place(), 'name grains that are free or prescribed')
      return
    end if
    none = .false.
    call model%system%forget_weights(now == kind_free .and. &
                                     model%system%grains%kind == kind_ghost)
    if (model%bed%active) then
      call springs_of_freed(model, now, springs)
      call model%system%leave(none, now, springs, v)
    else
      call model%system%leave(none, now, v=v)
    end if
    call renew_driven(model)
  end subroutine set_kinds

  !> Friction of the tile for contacts of grains that become free with others that were not free,
  !! which were in no list until now.
  subroutine springs_of_freed(model, kind, springs)
    type(dem_model_type), intent(in) :: model
    integer(i4), intent(in) :: kind(:)  !! (grains) from now on
    type(start_springs_type), intent(out) :: springs
    integer(i4), allocatable :: kept(:)
    integer(i4) :: k
    associate (g => model%system%grains)
      call model%bed%springs_of(model%system%dem_data_type, &
                                pack(g%id, kind == kind_free .and. g%kind == kind_ghost), springs)
      kept = pack([(k, k=1, springs%given)], [(was_ghost(springs%ids(2, k)), k=1, springs%given)])
      springs%ids = springs%ids(:, kept)
      springs%force = springs%force(:, kept)
      springs%given = size(kept)
    end associate

  contains

    logical function was_ghost(id)
      integer(i8), intent(in) :: id
      was_ghost = model%system%grains%kind(index_of(model%system%dem_data_type, real(id, wp))) &
                  == kind_ghost
    end function was_ghost
  end subroutine springs_of_freed

  !> P265: what counts on the grains of the start.
  subroutine check_open(model, request, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(in) :: request
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: what
    what = ''
    if (model%system%cell%active) what = 'a cell'
    if (model%surcharge%active) what = 'a surcharge'
    if (model%system%pairs%additional%bond%given) what = 'bonds'
    if (model%system%par%dt <= 0.0_wp) what = 'no step of their own'
    if (len(what) == 0) return
    call errors%add('P265', 'grains with '//what//' do not change their number', &
                    request%place(), 'leave it out of the deck of the grains, or the partner '// &
                    'keeps to the grains of the start')
  end subroutine check_open

  !> In which state of the tile the grains wake: histories are followed first (P266).
  subroutine take_waking(model, request, reply, material, waking, errors)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: request, reply
    integer(i4), intent(in) :: material
    type(waking_type), intent(inout) :: waking
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    integer(i4), allocatable :: knots(:)
    real(wp), allocatable :: stretch(:, :), stress(:, :)
    integer(i4) :: k, steps

    call request%take_int(field_id, ids, errors)
    if (errors%any()) return
    allocate (waking%history(size(ids)), source=0_i4)
    allocate (waking%turn(4, size(ids)), source=0.0_wp)
    waking%turn(1, :) = 1.0_wp
    if (.not. model%bed%active) return
    if (request%has(field_turn)) call request%get(field_turn, waking%turn, errors)
    if (.not. request%has(field_history) .or. errors%any()) return
    call request%take_int(field_history, waking%history, errors)
    call request%take_int(field_knots, knots, errors)
    call request%take(field_stretch, stretch, errors)
    if (errors%any()) return
    if (.not. are_histories(waking%history, size(ids), knots, stretch)) then
      call errors%add('P266', 'histories of WAKE do not fit: '//str(size(knots))//' with '// &
        str(sum(knots))//' knots, '//str(size(stretch, 2))//' stretches, numbers up to '// &
        str(maxval(waking%history)), request%place(), 'one number for each grain, 0 or of a '// &
        'history; one tensor of nine finite numbers near 1 for each knot')
      return
    end if
    call model%timers%start('replays')
    call model%bed%follow_histories(model%system, material, knots, &
                                    reshape(stretch, [3, 3, size(stretch, 2)]), steps, errors)
    call model%timers%stop('replays')
    if (errors%any()) return
    stress = reshape([(model%bed%replays%kept(k)%stress, k=1, size(knots))], [9, size(knots)])
    call reply%put(field_stress, stress)
    associate (tile => model%bed%replays%stress)
      call reply%put(field_pressure, -(tile(1, 1) + tile(2, 2) + tile(3, 3))/3.0_wp)
    end associate
    call reply%put_int(field_substeps, steps)
  end subroutine take_waking

  !> Do numbers of histories, of knots and stretches fit each other?
  pure logical function are_histories(history, n, knots, stretch) result(fit)
    integer(i4), intent(in) :: history(:), knots(:)
    integer, intent(in) :: n  !! grains
    real(wp), intent(in) :: stretch(:, :)
    fit = size(history) == n .and. size(stretch, 1) == 9 .and. all(knots > 0)
    if (fit) fit = sum(knots) == size(stretch, 2) .and. all(history >= 0) .and. &
      all(history <= size(knots)) .and. all(is_finite(stretch))
    if (fit) fit = all(abs(stretch) < 2.0_wp)
  end function are_histories

  !> What enters; what is left out has its default.
  subroutine take_batch(model, request, waking, batch, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: request
    type(waking_type), intent(in) :: waking
    type(dem_packing_type), intent(inout) :: batch
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    integer(i4), allocatable :: kind(:)

    call request%take_int(field_id, ids, errors)
    if (errors%any()) return
    call size_batch(batch, size(ids, kind=i4))
    batch%n = size(ids)
    batch%id = ids
    batch%kind = kind_free
    batch%quat(1, :) = 1.0_wp
    batch%exponent = 2.0_wp
    if (request%has(field_kind)) then
      call request%take_int(field_kind, kind, errors)
      if (errors%any()) return
      call check_kinds(request, kind, size(ids), errors)
      if (errors%any()) return
      batch%kind = kind
    end if
    if (request%has(field_x) .or. .not. model%bed%active) &
      call request%get(field_x, batch%x, errors)
    if (errors%any()) return
    if (model%bed%active .and. .not. request%has(field_axes)) then
      call model%bed%fill(batch, request%has(field_x), request%has(field_quat), waking)
    else
      call request%get(field_axes, batch%axes, errors)
    end if
    if (request%has(field_quat)) call request%get(field_quat, batch%quat, errors)
    if (request%has(field_skew)) call request%get(field_skew, batch%skew, errors)
    if (request%has(field_exponent)) call request%get(field_exponent, batch%exponent, errors)
    if (request%has(field_v)) call request%get(field_v, batch%v, errors)
    if (request%has(field_omega)) call request%get(field_omega, batch%omega, errors)
  end subroutine take_batch

  !> Kinds of the port are free and prescribed (P268).
  subroutine check_kinds(request, kind, n, errors)
    type(message_type), intent(in) :: request
    integer(i4), intent(in) :: kind(:)
    integer, intent(in) :: n  !! how many there must be
    type(error_list_type), intent(inout) :: errors
    if (size(kind) == n) then
      if (all(kind == kind_free .or. kind == kind_ghost)) return
    end if
    call errors%add('P268', str(size(kind))//' kinds of '//str(n)// &
                    ' grains, or others than 0 (free) and 3 (prescribed)', request%place(), &
                    'send one of the two numbers for each id')
  end subroutine check_kinds

  !> Tangential forces that contacts begin with.
  subroutine take_springs(request, springs, errors)
    type(message_type), intent(inout) :: request
    type(start_springs_type), intent(inout) :: springs
    type(error_list_type), intent(inout) :: errors
    if (.not. request%has(field_ids)) return
    call request%take_int(field_ids, springs%ids, errors)
    if (errors%any()) return
    springs%given = size(springs%ids, 2)
    allocate (springs%force(3, springs%given))
    call request%get(field_force, springs%force, errors)
  end subroutine take_springs

  !> Material of what enters (P266): that of the packing if none is named.
  subroutine take_material(model, request, material, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: request
    integer(i4), intent(out) :: material
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: name
    integer(i4) :: k
    material = model%choices%of_entering(1)
    if (.not. request%has(field_material)) return
    call request%get_text(field_material, name, errors)
    if (errors%any()) return
    do k = 1, size(model%system%materials)
      material = k
      if (model%choices%material(k)%s == name) return
    end do
    call errors%add('P266', "the grains have no material '"//name//"'", request%place(), &
                    did_you_mean(name, model%choices%material, 'materials of their deck:'))
  end subroutine take_material

  !> Ids that no grain has, rising, and of a bed within it (P266).
  subroutine check_new(model, request, batch, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(in) :: request
    type(dem_packing_type), intent(in) :: batch
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, k
    k = 0
    do i = 1, batch%n
      if (index_of(model%system%dem_data_type, real(batch%id(i), wp)) > 0) k = i
      if (batch%id(i) < 1) k = i
      if (model%bed%active .and. batch%id(i) > model%bed%grains()) k = i
      if (i > 1) then
        if (batch%id(i) <= batch%id(i - 1)) k = i
      end if
    end do
    if (k == 0) return
    call errors%add('P266', 'grain '//str(batch%id(k))//' is there already, is not of the '// &
                    'bed, or ids do not rise from 1', request%place(), 'send new grains in the '// &
                    'order of their ids')
  end subroutine check_new

  !> Marks of the grains whose ids the request names.
  subroutine take_marks(model, request, marked, errors)
    type(dem_model_type), intent(in) :: model
    type(message_type), intent(inout) :: request
    logical, allocatable, intent(out) :: marked(:)
    type(error_list_type), intent(inout) :: errors
    integer(i8), allocatable :: ids(:)
    integer(i4), allocatable :: index(:)
    allocate (marked(model%system%grains%n), source=.false.)
    call request%take_int(field_id, ids, errors)
    if (errors%any()) return
    call model%system%find(ids, index, errors)
    if (.not. errors%any()) marked(index) = .true.
  end subroutine take_marks

  !> What goes by number is found again; the reply.
  subroutine settle(model, reply)
    type(dem_model_type), intent(inout) :: model
    type(message_type), intent(inout) :: reply
    call renew_driven(model)
    call reply%put(field_step_limit, limit_told(model%system%step_limit()))
  end subroutine settle

  !> Driven grains have other numbers.
  subroutine renew_driven(model)
    type(dem_model_type), intent(inout) :: model
    call model%histories%find_driven(model%system)
  end subroutine renew_driven
end module dem_port_population
