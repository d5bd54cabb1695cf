!> Speed of the micromorphic law, as `make bench` shows it: states and tangents of points, and whole
!! elements by threads. What is judged is that all points found their states; times are printed.
program test_fem_mm_speed
  use, intrinsic :: omp_lib, only: omp_get_max_threads
  use talus_kinds, only: wp, i4
  use talus_test, only: test_type
  use fem_mm_cones, only: make_cone, surfaces
  use fem_mm_element, only: mm_element_type, mm_response_type, prepare_element, respond
  use fem_mm_elastic, only: set_moduli
  use fem_mm_flow, only: mm_law_type, mm_state_type
  use fem_mm_motion, only: mm_motion_type, packed_motion, unpacked_motion
  use fem_mm_plastic, only: mm_point_type, update_point
  use fem_rules, only: fem_formulation_type, make_rule, rule_index
  implicit none

  real(wp), parameter :: degree = acos(-1.0_wp)/180.0_wp
  real(wp), parameter :: moduli(7) = [29.0_wp, 7.0_wp, 60.0_wp, 10.0_wp, 10.0_wp, 8.0_wp, 5.0_wp]
  real(wp), parameter :: taus(11) = [0.3_wp, 0.1_wp, 0.2_wp, 0.4_wp, -0.1_wp, 0.5_wp, 8.0_wp, &
                                     0.2_wp, 0.6_wp, 0.3_wp, 0.1_wp]
  integer(i4), parameter :: ways = 50             !! motions that take turns
  type(test_type) :: test
  type(mm_motion_type) :: there(ways)
  type(mm_motion_type) :: none
  integer(i4) :: k

  do k = 1, ways
    there(k) = unpacked_motion(packed_motion(none) + way(k))
  end do
  call points('micromorphic_elastic_tau7', law_of(.false., 0), 10000)
  call points('micromorphic_elastic', law_of(.true., 0), 10000)
  call points('micromorphic_plastic_macro', law_of(.true., 1), 1500)
  call points('micromorphic_plastic_micro', law_of(.true., 2), 1500)
  call points('micromorphic_plastic_all', law_of(.true., 5), 500)
  call elements('micromorphic_elements', law_of(.true., 0))
  call test%finish()

contains

  !> Strains of 3 per cent, slightly compressed.
  pure function way(k) result(v)
    integer(i4), intent(in) :: k
    real(wp) :: v(45)
    integer(i4) :: n
    v = [(0.03_wp*sin(1.0_wp + 1.7_wp*n + 0.01_wp*k), n=1, 45)]
    v([1, 5, 9]) = v([1, 5, 9]) - sum(v([1, 5, 9]))/3.0_wp - 0.001_wp
    v([10, 14, 18]) = v([10, 14, 18]) - sum(v([10, 14, 18]))/3.0_wp
    v(19:) = 3.0_wp*v(19:)
  end function way

  !> With the first of the five cones.
  pure function law_of(all_taus, cones) result(law)
    logical, intent(in) :: all_taus
    integer(i4), intent(in) :: cones
    type(mm_law_type) :: law
    real(wp), parameter :: shape(2) = [-1.0_wp, -1.0_wp]
    real(wp) :: gradient(11)
    gradient = taus
    if (.not. all_taus) gradient = [0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 8.0_wp, &
                                    0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
    law%elastic = set_moduli([moduli, gradient], .false.)
    law%length = 0.6_wp
    law%modulus = 60.0_wp
    if (cones >= 1) law%cone(1) = make_cone([30.0_wp, 10.0_wp]*degree, shape, 0.08_wp, 20.0_wp, &
                                            0.0_wp)
    if (cones >= 2) law%cone(2) = make_cone([25.0_wp, 8.0_wp]*degree, shape, 0.073_wp, 20.0_wp, &
                                            0.0_wp)
    if (cones >= surfaces) law%cone(3:) = make_cone([20.0_wp, 5.0_wp]*degree, shape, 0.1_wp, &
                                                    0.3_wp, 0.0_wp)
    law%plastic = cones > 0
  end function law_of

  !> Updates with tangents, one after another.
  subroutine points(name, law, count_of)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    integer(i4), intent(in) :: count_of
    type(mm_state_type) :: start
    type(mm_point_type) :: point
    real(wp) :: tangent(45, 45), total, from
    integer(i4) :: n
    logical :: fine
    fine = .true.
    total = 0.0_wp
    from = seconds()
    do n = 1, count_of
      call update_point(law, [none, there(mod(n, ways) + 1)], start, point, tangent)
      fine = fine .and. point%done .and. (any(point%active) .eqv. law%plastic)
      total = total + tangent(1, 1)
    end do
    call say(name, count_of, seconds() - from)
    call test%check(name//': every point has its state', fine .and. total > 0.0_wp)
  end subroutine points

  !> Forces and stiffness of hex20/hex8 elements by threads; points of all elements count.
  subroutine elements(name, law)
    character(len=*), intent(in) :: name
    type(mm_law_type), intent(in) :: law
    integer(i4), parameter :: many = 64
    type(fem_formulation_type) :: rule
    type(mm_element_type) :: element
    type(mm_response_type) :: response
    real(wp), allocatable :: u(:, :), phi(:, :)
    real(wp) :: x(3, 8)
    real(wp) :: from
    integer(i4) :: e, failed
    logical :: good
    call make_rule(rule_index('hex20/hex8'), rule)
    x = real(reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], &
                     [3, 8]), wp)
    call prepare_element(rule%at, matmul(x, rule%middle), element, good)
    u = 0.01_wp*sin(matmul(x, rule%middle))
    allocate (phi(9, element%micro_nodes), source=0.01_wp)
    failed = 0
    from = seconds()
    !$omp parallel do default(none) shared(law, element, u, phi) private(e, response) &
    !$omp schedule(static) reduction(+:failed)
    do e = 1, many
      call respond(law, element, u, phi, .true., response)
      failed = failed + response%failed
    end do
    !$omp end parallel do
    call say(name, many*element%points, seconds() - from)
    call test%check(name//': every element answers', good .and. failed == 0)
  end subroutine elements

  !> CPU time of this program, all its threads together: the machine may have other work.
  real(wp) function seconds()
    call cpu_time(seconds)
  end function seconds

  !> A line that tools/bench_solid.py reads.
  subroutine say(name, count_of, time)
    character(len=*), intent(in) :: name
    integer(i4), intent(in) :: count_of
    real(wp), intent(in) :: time  !! [s]
    print '(a,1x,i0,1x,a,1x,es12.5,1x,a,1x,i0,1x,a)', name, count_of, 'points', time, 's', &
      omp_get_max_threads(), 'threads'
  end subroutine say
end program test_fem_mm_speed
