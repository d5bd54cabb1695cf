!> The registry of laws: the data of each, and an elastic increment of all that can do
!! without constants from a deck; that every law of the deck is there.
program test_fem_law_registry
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use talus_deck_table, only: key_table_type
  use fem_deck_keys, only: fem_deck_table
  use fem_law, only: fem_law_type, fem_law_box_type, common_size, common_names
  use fem_law_polar, only: fem_law_polar_type
  use fem_law_registry, only: all_laws, make_law
  use fem_polar, only: polar_size
  implicit none
  type(test_type) :: test
  type(fem_law_box_type), allocatable :: list(:)
  integer(i4) :: k

  call all_laws(list)
  call check_deck()
  do k = 1, int(size(list), i4)
    call check_traits(list(k)%law)
  end do
  call check_operator()
  call test%finish()

contains

  !> The laws of the deck are those of the registry.
  subroutine check_deck()
    type(key_table_type) :: table
    class(fem_law_type), allocatable :: law
    integer(i4) :: g, j
    call fem_deck_table(table)
    g = table%find('material')
    associate (key => table%group(g)%key(table%group(g)%find('law')))
      call test%check('as many laws as the deck has', size(key%choice) == size(list))
      do j = 1, int(size(key%choice), i4)
        call make_law(key%choice(j)%s, law)
        call test%check_text('law of the deck', trim(law%name), key%choice(j)%s)
      end do
    end associate
  end subroutine check_deck

  !> Names with units, each once; states as many as names; traits that go together.
  subroutine check_traits(law)
    class(fem_law_type), intent(in) :: law
    character(len=:), allocatable :: name, label
    integer(i4) :: i, j
    label = trim(law%name)
    call test%check(label//': has a name', len(label) > 0)
    call test%check(label//': Eringen''s constants are of micropolar laws', law%polar .or. &
                    .not. law%eringen)
    call test%check(label//': finite strain is not micropolar', .not. (law%polar .and. law%finite))
    select type (law)
    class is (fem_law_polar_type)
      call test%check(label//': is micropolar', law%polar)
    class default
      call test%check(label//': is not micropolar', .not. law%polar)
    end select
    if (.not. allocated(law%state_names)) then
      call test%check(label//': common states alone', law%states == common_size)
      return
    end if
    call test%check(label//': states', law%states == common_size + size(law%state_names))
    do i = common_size + 1, law%states
      name = law%state_name(i)
      call test%check(name//': has a unit', index(name, ' [') > 1 .and. name(len(name):) == ']')
      call test%check(name//': is not a common state', all(common_names /= name(:index(name, ' '))))
      do j = common_size + 1, i - 1
        call test%check(name//': is there once', law%state_name(j) /= name)
      end do
    end do
  end subroutine check_traits

  !> A law with an operator answers by it.
  subroutine check_operator()
    class(fem_law_type), allocatable :: law
    real(wp) :: strain(polar_size), stress(polar_size), tangent(polar_size, polar_size)
    real(wp) :: state(common_size)
    logical :: good
    integer(i4) :: i, j
    call make_law('layered', law)
    allocate (law%operator(9, 9, 2))
    do j = 1, 9
      do i = 1, 9
        law%operator(i, j, :) = [real(i + 2*j, wp), real(3*i + j, wp)]
      end do
    end do
    strain = [(0.01_wp*i, i=1, polar_size)]
    stress = 1.0_wp
    state = 0.0_wp
    select type (law)
    class is (fem_law_polar_type)
      call law%polar_update(strain, stress, state, tangent, good)
    end select
    call test%check('operator: good', good)
    do i = 1, 9
      ! sum_j j (i + 2 j) = 45 i + 570 and sum_j (9 + j) (3 i + j) = 378 i + 690, j to 9
      call test%check_close('operator: stress', stress(i), 1.0_wp + 0.01_wp*(45*i + 570), &
                            1.0e-12_wp)
      call test%check_close('operator: couple stress', stress(9 + i), &
                            1.0_wp + 0.01_wp*(378*i + 690), 1.0e-12_wp)
    end do
  end subroutine check_operator
end program test_fem_law_registry
