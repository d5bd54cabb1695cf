!> Grains and contacts as rows and back: a list made from rows equals the original.
program test_dem_received_contacts
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_received_contacts, only: receive_contacts, give_results
  use dem_law, only: make_law
  use dem_make, only: make_grains, make_planes
  use dem_migrate, only: make_local, pack_grains
  use dem_pairs, only: build_pairs
  use dem_records, only: contact_reals, pack_contact, carried, index_of
  use dem_state, only: lanes
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  type(test_type) :: test
  type(dem_system_type) :: pile

  call make_pile(pile)
  call check_rows()
  call test%finish()

contains

  !> A cube of ellipsoids on a floor, slightly compressed, with descending ids.
  subroutine make_pile(s)
    type(dem_system_type), intent(inout) :: s
    integer(i4), parameter :: m = 4, n = m**3
    type(error_list_type) :: errors
    integer(i8) :: id(n)
    integer(i4) :: kind(n), material(n), k
    real(wp) :: x(3, n), q(4, n), a(3, n), still(3, n)

    do k = 1, n
      id(k) = 2*(n - k) + 5
      x(:, k) = 2.01e-3_wp*[mod(k - 1, m), mod((k - 1)/m, m), (k - 1)/m**2] + 1.0e-3_wp
    end do
    kind = 0
    kind(:3) = 1
    material = 1
    q = 0.0_wp
    q(1, :) = 1.0_wp
    a = 1.01e-3_wp
    a(3, ::2) = 1.02e-3_wp
    still = 0.0_wp
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%density = 2650.0_wp
    s%materials(1)%young = 1.0e7_wp
    s%materials(1)%poisson = 0.25_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.1_wp, &
                            0.1_wp)
    call make_grains(s%grains, s%materials, id, kind, material, x, q, a, still, still, errors)
    call make_planes(s%planes, reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]), &
                     reshape([0.1_wp, 0.0_wp, 1.0_wp], [3, 1]), &
                     reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]), [1_i4])
    s%par%gravity = [1.0_wp, 0.5_wp, -9.81_wp]
    s%par%dt = 1.0e-5_wp
    call s%init(errors)
    call s%step(20, errors)
    call test%check('the pile stands', .not. errors%any())
  end subroutine make_pile

  subroutine check_rows()
    type(dem_system_type) :: copy
    type(dem_contacts_type) :: old, new
    real(wp), allocatable :: grains(:, :), rows(:, :), contact(:, :)
    integer(i4) :: k, lane, n
    logical, allocatable :: all_grains(:)

    call pile%contacts(old)
    allocate (all_grains(pile%grains%n), source=.true.)
    call pack_grains(pile%dem_data_type, all_grains, grains)
    allocate (rows(contact_reals(pile%dem_data_type), pile%pairs%count))
    n = 0
    do k = 1, pile%pairs%blocks
      do lane = 1, lanes
        if (.not. carried(pile%dem_data_type, lane, k)) cycle
        n = n + 1
        call pack_contact(pile%dem_data_type, lane, k, rows(:, n))
      end do
    end do
    contact = rows(:, n:1:-1)
    copy = pile
    call make_local(copy%dem_data_type, grains(:, size(grains, 2):1:-1))
    call test%check('grains by id', all(copy%grains%id == pile%grains%id))
    call test%check('grains keep their bits', same(copy%grains%x, pile%grains%x) &
                    .and. same(copy%grains%quat, pile%grains%quat) &
                    .and. same(copy%grains%omega, pile%grains%omega) &
                    .and. same(copy%grains%force, pile%grains%force) &
                    .and. same(copy%pairs%body(:, :copy%grains%n), &
                               pile%pairs%body(:, :copy%grains%n)))
    call test%check('an id that is not here', index_of(copy%dem_data_type, 6.0_wp) == 0)
    call receive_contacts(copy%dem_data_type, contact)
    call build_pairs(copy%pairs, copy%grains, copy%planes, copy%weights, .false., copy%cell)
    call give_results(copy%dem_data_type, contact)
    call copy%contacts(new)
    call test%check('many contacts', old%n > 60)
    call test%check('as many afterwards', new%n == old%n)
    if (new%n /= old%n) return
    call test%check('of the same grains', all(new%ids == old%ids))
    call test%check('contacts keep their bits', same(new%normal, old%normal) &
                    .and. same(new%force, old%force) .and. same(new%point, old%point) &
                    .and. same(new%stiffness, old%stiffness))
  end subroutine check_rows

  pure logical function same(a, b)
    real(wp), intent(in) :: a(:, :), b(:, :)
    same = all(abs(a - b) <= 0.0_wp)
  end function same
end program test_dem_received_contacts
