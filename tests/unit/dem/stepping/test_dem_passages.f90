!> Contacts that one long step misses: what is one, and what only looks like it.
program test_dem_passages
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_test, only: test_type
  use dem_law, only: make_law
  use dem_make, only: make_grains
  use dem_passages, only: find_passage, name_passage
  use dem_state, only: kind_free, kind_fixed
  use dem_system, only: dem_system_type
  implicit none

  real(wp), parameter :: r = 1.0e-3_wp, h = 1.0e-5_wp
  type(test_type) :: test

  call check('through the middle of a grain', [3.0_wp, 0.0_wp, 0.0_wp], 6.0_wp, kind_free, .true.)
  call check('off its middle', [3.0_wp, 1.5_wp, 0.0_wp], 6.0_wp, kind_free, .true.)
  call check('grazing it', [3.0_wp, 1.999_wp, 0.0_wp], 6.0_wp, kind_free, .false.)
  call check('beside it', [3.0_wp, 2.1_wp, 0.0_wp], 6.0_wp, kind_free, .false.)
  call check('through a fixed one', [3.0_wp, 0.5_wp, 0.0_wp], 6.0_wp, kind_fixed, .true.)
  call check('into contact, which is seen', [3.0_wp, 0.0_wp, 0.0_wp], 1.5_wp, kind_free, .false.)
  call check('past the centre, which is seen the wrong way', [3.0_wp, 0.0_wp, 0.0_wp], 3.5_wp, &
             kind_free, .true.)
  call check('short of it', [8.0_wp, 0.0_wp, 0.0_wp], 5.0_wp, kind_free, .false.)
  call check('away from it', [-3.0_wp, 0.0_wp, 0.0_wp], 6.0_wp, kind_free, .false.)
  call check_company()
  call test%finish()

contains

  !> The first grain comes from the origin along x, `way` radii in a step; the second stands still.
  subroutine check(name, place, way, kind, missed)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: place(3), way  !! in radii
    integer(i4), intent(in) :: kind
    logical, intent(in) :: missed
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), v(3, 2)
    x(:, 1) = [0.0_wp, 0.0_wp, 0.0_wp]
    x(:, 2) = r*place
    v = 0.0_wp
    call make(s, x, v, [kind_free, kind], errors)
    associate (speed => way*r/h)
      s%pairs%body(1, 1) = s%pairs%body(1, 1) + h*speed
      s%pairs%body(4, 1) = speed
    end associate
    call find_passage(s%dem_data_type, h)
    call test%check('grain '//name, (s%health%passed(1) > 0) .eqv. missed)
    call name_passage(s%dem_data_type, errors)
    call test%check('fault '//name, errors%any() .eqv. missed)
    if (.not. errors%any()) return
    call test%check_text('code '//name, errors%item(1)%code, 'N209')
    call test%check('both are named '//name, all(s%health%passed == [1_i8, 2_i8]))
  end subroutine check

  !> Grains that go far together pass nothing, and what stands among them is passed.
  subroutine check_company()
    type(dem_system_type) :: s
    type(error_list_type) :: errors
    real(wp) :: x(3, 28), v(3, 28)
    integer(i4) :: i, kind(28)
    do i = 1, 27
      x(:, i) = 2.05_wp*r*[mod(i - 1, 3), mod((i - 1)/3, 3), (i - 1)/9]
    end do
    x(:, 28) = [50.0_wp*r, 0.0_wp, 0.0_wp]
    v = 0.0_wp
    kind = kind_free
    kind(28) = kind_fixed
    call make(s, x, v, kind, errors)
    s%pairs%body(1, :27) = s%pairs%body(1, :27) + 10.0_wp*r
    s%pairs%body(4, :27) = 10.0_wp*r/h
    call find_passage(s%dem_data_type, h)
    call test%check('a cloud goes along', s%health%passed(1) == 0_i8)
    s%pairs%body(1, 28) = s%pairs%body(1, 1) - 5.0_wp*r
    s%pairs%body(2:3, 28) = s%pairs%body(2:3, 1)
    call find_passage(s%dem_data_type, h)
    call test%check('it has run over a fixed grain', any(s%health%passed == 28_i8))
  end subroutine check_company

  subroutine make(s, x, v, kind, errors)
    type(dem_system_type), intent(inout) :: s
    real(wp), intent(in) :: x(:, :), v(:, :)
    integer(i4), intent(in) :: kind(:)
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: i, n
    real(wp) :: q(4, size(kind))
    n = size(kind, kind=i4)
    q = 0.0_wp
    q(1, :) = 1.0_wp
    allocate (s%materials(1), s%laws(1, 1))
    s%materials(1)%young = 29.0e6_wp
    s%materials(1)%poisson = 0.25_wp
    s%materials(1)%density = 2650.0_wp
    s%laws(1, 1) = make_law('hertz_mindlin', s%materials(1), s%materials(1), 0.5_wp, 0.0_wp, &
                            0.0_wp)
    call make_grains(s%grains, s%materials, [(int(i, i8), i=1, n)], kind, [(1_i4, i=1, n)], x, q, &
                     spread([(r, i=1, 3)], 2, n), v, v, errors)
    s%par%dt = h
    call s%init(errors)
    call test%check('the grains are made', .not. errors%any())
  end subroutine make
end program test_dem_passages
