!> Faces whose flow depends on the pressure: a leak both ways, restless nodes of seepage outward
!! alone, those of infiltration inward at most at its rate; slopes are those of differences. At rest
!! they let in what may enter, or by their reaction.
program test_fem_pore_faces
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_pore_element, only: fem_flow_step_type
  use fem_pore_faces, only: fem_leak_type, add_leaks, let_in, most_flips
  use fem_sparse, only: fem_pattern_type
  implicit none
  type(test_type) :: test
  type(fem_flow_step_type) :: step

  step = fem_flow_step_type(2.0_wp, 0.75_wp)
  call check_face('leak', face_of(.false., 0.0_wp), [-3.0_wp, 1.0_wp, 5.0_wp], &
                  [1.5_wp, 0.5_wp, -0.5_wp])
  call check_face('seepage', face_of(.true., 0.0_wp), [-3.0_wp, 1.0_wp, 5.0_wp], &
                  [0.0_wp, 0.0_wp, -0.5_wp])
  call check_face('infiltration', face_of(.false., 0.7_wp), [-3.0_wp, 1.0_wp, 5.0_wp], &
                  [0.7_wp, 0.5_wp, -0.5_wp])
  call check_rest()
  call test%finish()

contains

  !> A face of one node that conducts 1/4 to a pressure of 3, at most `rain` inward.
  function face_of(one_way, rain) result(face)
    logical, intent(in) :: one_way
    real(wp), intent(in) :: rain
    type(fem_leak_type), allocatable :: face
    allocate (face)
    face%one_way = one_way
    face%now = 3.0_wp
    face%block = [1_i4]
    face%conductance = [0.25_wp]
    allocate (face%open(1), source=.not. one_way)
    face%raining = 0.5_wp
    if (rain > 0.0_wp) face%most = [2.0_wp*rain]
    if (.not. (one_way .or. rain > 0.0_wp)) return
    face%held = [.false.]
    face%flips = [most_flips]
  end function face_of

  !> Inflows for pressures at the start and the end, and their slopes.
  subroutine check_face(name, face, p, inflow)
    character(len=*), intent(in) :: name
    type(fem_leak_type), intent(in) :: face
    real(wp), intent(in) :: p(:), inflow(:)
    type(fem_leak_type) :: leak(1)
    type(fem_pattern_type) :: pattern
    real(wp) :: rate(1, 2), gross(1), k(3, 3, 1)
    real(wp), parameter :: small = 1.0e-3_wp
    integer(i4) :: i
    pattern%start = [1, 2]
    do i = 1, size(p)
      leak(1) = face
      rate = 0.0_wp
      gross = 0.0_wp
      k = 0.0_wp
      call let_in(leak, step, [p(i)], [p(i) + small], rate(:, 2), gross)
      call let_in(leak, step, [p(i)], [p(i)], rate(:, 1), gross)
      call add_leaks(leak, step, pattern, k)
      call test%check_close(name//': inflow', rate(1, 1), inflow(i), 1.0e-14_wp)
      call test%check_close(name//': slope', k(1, 1, 1), step%dt*(rate(1, 2) - rate(1, 1))/small, &
                            1.0e-12_wp)
      call test%check_close(name//': rate of the face', leak(1)%rate, rate(1, 1), 1.0e-14_wp)
    end do
  end subroutine check_face

  !> Nodes at rest: the rain, or nothing beside the reaction, whatever the pressure.
  subroutine check_rest()
    type(fem_leak_type) :: leak(1)
    real(wp) :: rate(1), gross(1), wanted
    integer(i4) :: i
    do i = 1, 4
      leak(1) = face_of(i > 2, merge(0.7_wp, 0.0_wp, i <= 2))
      leak(1)%flips = most_flips - 1
      leak(1)%held = modulo(i, 2) == 0
      wanted = merge(0.7_wp, 0.0_wp, i == 1)
      rate = 0.0_wp
      gross = 0.0_wp
      call let_in(leak, step, [5.0_wp], [-5.0_wp], rate, gross)
      call test%check_close('at rest', rate(1), wanted, 1.0e-15_wp)
      call test%check('no slope', .not. leak(1)%open(1))
    end do
  end subroutine check_rest
end program test_fem_pore_faces
