!> Families of fragments: their sizes, their volumes, that they lie inside the grain and apart, by
!! the supports that the contact kernel uses; surfaces of forms against closed ones.
program test_dem_fragments
  use talus_kinds, only: wp, i4, i8
  use talus_random, only: unit_number, turn_of
  use talus_test, only: test_type
  use dem_fragments, only: fragment_type, make_fragments, family_radii, family_fourteen, &
    family_halves, family_none, area_of, created_area, split_axis, slenderness_of_halves
  use dem_shape, only: shape_size, shape_of, shape_height
  use dem_shape_gap, only: solve_shapes
  use dem_shape_mass, only: shape_mass_type, mass_of_shape
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), unturned(4) = [1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp]
  real(wp), parameter :: upper(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp], &
                         lower(3) = [1.5e-3_wp, 2.0e-3_wp, 1.0e-3_wp]
  ! exponent, r1, r2, t, volume kept: values of another program, six digits
  real(wp), parameter :: table(5, 4) = reshape([ &
    2.0_wp, 0.414214_wp, 0.230093_wp, 0.444506_wp, 0.523861_wp, &
    3.0_wp, 0.386488_wp, 0.260414_wp, 0.512800_wp, 0.487667_wp, &
    4.0_wp, 0.372885_wp, 0.278815_wp, 0.547982_wp, 0.484478_wp, &
    8.0_wp, 0.352857_wp, 0.306433_wp, 0.604572_wp, 0.493798_wp], [5, 4])
  real(wp), parameter :: slender = 50.0_wp
  integer(i4) :: k

  do k = 1, size(table, 2)
    call check_sizes(table(:, k))
    call check_family(upper, lower, table(1, k), family_fourteen, table(5, k))
    call check_family(upper, upper, table(1, k), family_fourteen, table(5, k))
    call check_family(upper, lower, table(1, k), family_halves, 0.75_wp**(2.0_wp/table(1, k)))
  end do
  call check_turned()
  call check_reference()
  call check_generations()
  call check_areas()
  call test%finish()

contains

  subroutine check_sizes(row)
    real(wp), intent(in) :: row(5)
    real(wp) :: sizes(2), place
    call family_radii(row(1), sizes, place)
    call test%check_all_close('sizes', [sizes, place], row(2:4), 1.0e-6_wp)
    call test%check_close('volume kept', 6.0_wp*sizes(1)**3 + 8.0_wp*sizes(2)**3, row(5), 1.0e-6_wp)
  end subroutine check_sizes

  !> Inside the grain, apart, and of this part of its volume.
  subroutine check_family(up, low, exponent, family, kept)
    real(wp), intent(in) :: up(3), low(3), exponent, kept
    integer(i4), intent(in) :: family
    type(fragment_type), allocatable :: fragment(:)
    real(wp) :: tolerance
    tolerance = merge(1.0e-3_wp, 1.0e-6_wp, exponent > 2.0_wp)  ! sizes are smaller; six digits
    call make_fragments(family, up, low, exponent, unturned, 1_i4, fragment)
    call test%check('apart', least_gap(fragment, exponent) >= 0.0_wp)
    call test%check('inside', farthest_out(fragment, up, low, exponent) <= 0.0_wp)
    call test%check_close('volume', volume_of(fragment, exponent)/body_volume(up, low, exponent), &
                          kept, tolerance)
  end subroutine check_family

  real(wp) function body_volume(up, low, exponent)
    real(wp), intent(in) :: up(3), low(3), exponent
    type(shape_mass_type) :: mass
    mass = mass_of_shape(up, low, exponent)
    body_volume = mass%volume
  end function body_volume

  real(wp) function volume_of(fragment, exponent) result(volume)
    type(fragment_type), intent(in) :: fragment(:)
    real(wp), intent(in) :: exponent
    integer(i4) :: i
    volume = 0.0_wp
    do i = 1, size(fragment)
      volume = volume + body_volume(fragment(i)%upper, fragment(i)%lower, exponent)
    end do
  end function volume_of

  !> Least gap of two fragments by the contact kernel [m].
  real(wp) function least_gap(fragment, exponent) result(least)
    type(fragment_type), intent(in) :: fragment(:)
    real(wp), intent(in) :: exponent
    real(wp) :: a(shape_size), b(shape_size), n(3), gap
    real(wp), parameter :: none(3) = [0.0_wp, 0.0_wp, 0.0_wp]
    integer(i4) :: i, j
    least = huge(least)
    do i = 1, size(fragment)
      a = shape_of(fragment(i)%upper, fragment(i)%lower, none, exponent)
      do j = i + 1, size(fragment)
        b = shape_of(fragment(j)%upper, fragment(j)%lower, none, exponent)
        n = 0.0_wp
        call solve_shapes(fragment(j)%origin - fragment(i)%origin, a, b, n, gap)
        least = min(least, gap)
      end do
    end do
  end function least_gap

  !> How far a support plane of a fragment lies out of that of the grain at most [m].
  real(wp) function farthest_out(fragment, up, low, exponent) result(out)
    type(fragment_type), intent(in) :: fragment(:)
    real(wp), intent(in) :: up(3), low(3), exponent
    real(wp) :: whole(shape_size), a(shape_size), n(3), z, angle
    real(wp), parameter :: none(3) = [0.0_wp, 0.0_wp, 0.0_wp]
    integer(i4), parameter :: many = 400
    integer(i4) :: i, j
    out = -huge(out)
    whole = shape_of(up, low, none, exponent)
    do j = 1, many
      z = 1.0_wp - (2.0_wp*j - 1.0_wp)/many
      angle = 2.399963_wp*j
      n = [sqrt(1.0_wp - z*z)*cos(angle), sqrt(1.0_wp - z*z)*sin(angle), z]
      do i = 1, size(fragment)
        a = shape_of(fragment(i)%upper, fragment(i)%lower, none, exponent)
        out = max(out, dot_product(fragment(i)%origin, n) + shape_height(a, n) &
                  - shape_height(whole, n))
      end do
    end do
  end function farthest_out

  !> The turned family of an ellipsoid is inside and apart, too.
  subroutine check_turned()
    type(fragment_type), allocatable :: fragment(:)
    real(wp), parameter :: axes(3) = [2.5e-3_wp, 2.0e-3_wp, 1.5e-3_wp]
    real(wp) :: turn(4)
    integer(i8) :: k
    turn = [0.9_wp, 0.1_wp, -0.3_wp, 0.2_wp]
    turn = turn/norm2(turn)
    call make_fragments(family_fourteen, upper, upper, 2.0_wp, turn, 1_i4, fragment)
    call test%check('turned: apart', least_gap(fragment, 2.0_wp) >= 0.0_wp)
    call test%check('turned: inside', farthest_out(fragment, upper, upper, 2.0_wp) <= 0.0_wp)
    call make_fragments(family_none, upper, upper, 2.0_wp, turn, 1_i4, fragment)
    call test%check('none', size(fragment) == 0)
    ! grain 1 of the seed 1, as another program turns it
    turn = turn_of([(unit_number(1_i8, 1_i8 + 1000003_i8*k), k=1, 3)])
    call make_fragments(family_fourteen, axes, axes, 2.0_wp, turn, 1_i4, fragment)
    call test%check_all_close('turned by the id: third', fragment(3)%origin, &
      [0.000491497395758176_wp, -0.0009176828735490643_wp, 0.0004597913178832725_wp], 1.0e-15_wp)
    call test%check_all_close('turned by the id: eighth', fragment(8)%origin, &
      [0.0012645517546544772_wp, -0.0010425745941731305_wp, -0.00038290117440600526_wp], &
      1.0e-15_wp)
  end subroutine check_turned

  !> Places and semi-axes of a poly-ellipsoid's fragments, as another program has them.
  subroutine check_reference()
    type(fragment_type), allocatable :: fragment(:)
    call make_fragments(family_fourteen, upper, lower, 2.0_wp, unturned, 1_i4, fragment)
    call test%check_all_close('second, origin', fragment(2)%origin, &
                          [-0.0008786796564403573_wp, 0.0_wp, 0.0_wp], 1.0e-15_wp)
    call test%check_all_close('second, lower', fragment(2)%lower, &
      [0.0006213203435596426_wp, 0.0008284271247461902_wp, 0.0004142135623730951_wp], 1.0e-11_wp)
    call test%check_all_close('eighth, origin', fragment(8)%origin, &
      [0.0011112647630844477_wp, 0.0008890118104675581_wp, -0.00044450590523377904_wp], 1.0e-15_wp)
    call test%check_all_close('eighth, upper', fragment(8)%upper, &
      [0.0005752329696767455_wp, 0.00046018637574139645_wp, 0.00023009318787069823_wp], 1.0e-11_wp)
    call make_fragments(family_halves, upper, lower, 2.0_wp, unturned, 3_i4, fragment)
    call test%check_all_close('half, origin', fragment(1)%origin, [0.0_wp, 0.0_wp, 0.000375_wp], &
                          1.0e-15_wp)
    call test%check_all_close('half, upper', fragment(1)%upper, &
      [0.0021650635094610966_wp, 0.0017320508075688772_wp, 0.001125_wp], 1.0e-11_wp)
    call test%check_all_close('half, lower', fragment(1)%lower, &
      [0.001299038105676658_wp, 0.0017320508075688772_wp, 0.000375_wp], 1.0e-11_wp)
    call test%check('cut across the longest', split_axis(upper, upper, [0.0_wp, 0.0_wp, 1.0_wp], &
                                                     2.0_wp, slender) == 1)
    call test%check('a load along it', split_axis(upper, upper, [1.0_wp, 0.0_wp, 0.0_wp], &
                                                  2.0_wp, slender) == 2)
  end subroutine check_reference

  !> Halves of halves under loads of any direction, for ten generations: none is too slender to be
  !! halved again. Without that condition one in some is.
  subroutine check_generations()
    real(wp), parameter :: free = huge(1.0_wp)
    call test%check('a long grain under a load along it', split_axis([20.0_wp, 1.0_wp, 0.5_wp], &
      [20.0_wp, 1.0_wp, 0.5_wp], [1.0_wp, 0.0_wp, 0.0_wp], 2.0_wp, slender) == 1)
    call test%check('across its axis it would be too slender', slenderness_of_halves( &
      [20.0_wp, 1.0_wp, 0.5_wp], [20.0_wp, 1.0_wp, 0.5_wp], 2.0_wp, 3_i4) > slender)
    call test%check('sphere', most_of_generations(upper(1)*[1.0_wp, 1.0_wp, 1.0_wp], slender) &
                    <= slender)
    call test%check('long', most_of_generations([8.0_wp, 0.4_wp, 0.5_wp], slender) <= slender)
    call test%check('long, without the condition', &
                    most_of_generations([8.0_wp, 0.4_wp, 0.5_wp], free) > slender)
  end subroutine check_generations

  !> Slenderness of the most slender piece of many chains of ten halvings [-].
  real(wp) function most_of_generations(axes, limit) result(most)
    real(wp), intent(in) :: axes(3), limit
    integer(i8), parameter :: chains = 400, generations = 10
    type(fragment_type), allocatable :: fragment(:)
    type(fragment_type) :: piece
    real(wp) :: load(3), p
    integer(i8) :: k, g
    integer(i4) :: axis, which
    most = 0.0_wp
    do k = 1, chains
      piece%upper = axes
      piece%lower = axes
      p = 2.0_wp + 8.0_wp*unit_number(k, 5_i8)
      do g = 1, generations
        load = [(unit_number(generations*k + g, int(axis, i8)), axis=1, 3)] - 0.5_wp
        load = load*(piece%upper + piece%lower)  ! mostly along the longest axis
        axis = split_axis(piece%upper, piece%lower, load/norm2(load), p, limit)
        call make_fragments(family_halves, piece%upper, piece%lower, p, unturned, axis, fragment)
        which = merge(1, 2, unit_number(generations*k + g, 4_i8) > 0.5_wp)
        piece = fragment(which)
        most = max(most, max(maxval(piece%upper), maxval(piece%lower)) &
                   /min(minval(piece%upper), minval(piece%lower)))
        call test%check('skew that shapes may have', all(abs(piece%upper - piece%lower) &
                        <= 0.8_wp*(piece%upper + piece%lower)))
      end do
    end do
  end function most_of_generations

  !> A sphere, an oblate spheroid by its formula, and a family's surface piece by piece.
  subroutine check_areas()
    type(fragment_type), allocatable :: fragment(:)
    real(wp) :: e, sum_of
    integer(i4) :: i
    call test%check_close('sphere', area_of(upper(1) + [0.0_wp, 0.0_wp, 0.0_wp], &
                                            upper(1) + [0.0_wp, 0.0_wp, 0.0_wp], 2.0_wp), &
                          4.0_wp*pi*upper(1)**2, 1.0e-18_wp)
    e = sqrt(1.0_wp - (1.5_wp/2.5_wp)**2)
    call test%check_close('oblate', area_of([2.5_wp, 2.5_wp, 1.5_wp], [2.5_wp, 2.5_wp, 1.5_wp], &
                                            2.0_wp), &
                          2.0_wp*pi*2.5_wp**2*(1.0_wp + (1.0_wp - e*e)/e*atanh(e)), 1.0e-10_wp)
    call make_fragments(family_fourteen, upper, lower, 2.0_wp, unturned, 1_i4, fragment)
    sum_of = -area_of(upper, lower, 2.0_wp)
    do i = 1, size(fragment)
      sum_of = sum_of + area_of(fragment(i)%upper, fragment(i)%lower, 2.0_wp)
    end do
    call test%check_close('created', created_area(family_fourteen, upper, lower, 2.0_wp, 1_i4), &
                          sum_of, 1.0e-12_wp*abs(sum_of))
    call test%check_close('created by a sphere, of its own', &
                          created_area(family_fourteen, upper(1) + [0.0_wp, 0.0_wp, 0.0_wp], &
                                       upper(1) + [0.0_wp, 0.0_wp, 0.0_wp], 2.0_wp, 1_i4) &
                          /(4.0_wp*pi*upper(1)**2), 0.4529797_wp, 1.0e-6_wp)
    call test%check_close('vanishes', created_area(family_none, upper, upper, 2.0_wp, 1_i4), &
                          -area_of(upper, upper, 2.0_wp), 1.0e-18_wp)
  end subroutine check_areas
end program test_dem_fragments
