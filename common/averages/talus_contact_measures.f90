!> What the contacts of a region bear, as one row of numbers with their titles.
!!
!! A contact belongs to the region by its point and counts with its whole branch, so that stress and
!! forces are sums over one set of contacts (talus_measures cuts branches at the faces).
module talus_contact_measures
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: dyad, half_sizes, love_weber, direction_fabric
  use talus_measures, only: request_type, add_titles, add_tensor, contacts_of, region_now, &
    nine_parts, six_parts, row9, row6, pressure_of, solid_content
  use talus_region, only: region_type
  use talus_sample, only: sample_type
  use talus_text, only: string_type
  implicit none
  private
  public :: contact_columns, contact_row, contacts_inside

contains

  !> Titles of a row, the time first.
  subroutine contact_columns(names)
    type(string_type), allocatable, intent(out) :: names(:)
    allocate (names(0))
    call add_titles(names, 'time [s],volume [m3],contacts [-],boundary_contacts [-],')
    call add_titles(names, 'coordination [-],sliding [-],')
    call add_titles(names, 'normal_force_mean [N],normal_force_largest [N],')
    call add_titles(names, 'tangential_force_mean [N],tangential_force_largest [N],')
    call add_titles(names, 'overlap_mean [m],overlap_largest [m],')
    call add_tensor(names, 'stress', 'Pa', nine_parts)
    call add_titles(names, 'pressure [Pa],')
    call add_tensor(names, 'fabric_contact', '-', six_parts)
    call add_tensor(names, 'fabric_force', '-', six_parts)
    call add_titles(names, 'solid_fraction [-],grains_cut [-],')
  end subroutine contact_columns

  !> Which contacts have their point in the region as it is now (contacts).
  pure function contacts_inside(sample, request) result(inside)
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    logical, allocatable :: inside(:)
    type(region_type) :: region
    integer(i4) :: c
    region = region_now(sample, request)
    allocate (inside(sample%contacts))
    do c = 1, sample%contacts
      inside(c) = region%contains(sample%point(:, c))
    end do
  end function contacts_inside

  !> The row of a region at a time [s]. eq. D.83, D.84
  subroutine contact_row(time, sample, request, row)
    real(wp), intent(in) :: time
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    real(wp), allocatable, intent(out) :: row(:)
    type(region_type) :: region
    logical, allocatable :: inside(:), grains(:)
    real(wp), allocatable :: branch(:, :)
    integer(i4), allocatable :: z(:)
    real(wp) :: sigma(3, 3), volume
    integer(i4) :: c, n

    region = region_now(sample, request)
    volume = max(region%volume(), tiny(1.0_wp))
    inside = contacts_inside(sample, request)
    n = count(inside)
    allocate (branch(3, sample%contacts), source=0.0_wp)
    do c = 1, sample%contacts
      if (inside(c)) branch(:, c) = sample%far_end(c) - sample%start(:, c)
    end do
    sigma = love_weber(sample, branch, volume)
    grains = [(sample%free(c) .and. region%contains(sample%x(:, c)), c=1, sample%n)]
    z = contacts_of(sample)
    row = [time, volume, real(n, wp), real(count(inside .and. sample%first <= 0), wp), &
           real(sum(z, mask=grains), wp)/max(1, count(grains)), &
           real(count(inside .and. sample%sliding), wp)/max(1, n), force_row(sample, inside), &
           row9(sigma), pressure_of(sigma), row6(direction_fabric(sample, inside)), &
           row6(force_fabric(sample, inside)), solid_row(sample, region, request%resolution)/ &
           [volume, 1.0_wp]]
  end subroutine contact_row

  !> Mean and largest normal force, tangential force [N] and overlap [m].
  pure function force_row(sample, inside) result(row)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: inside(:)
    real(wp) :: row(6), this(3), total(3), most(3)
    integer(i4) :: c
    total = 0.0_wp
    most = 0.0_wp
    do c = 1, sample%contacts
      if (.not. inside(c)) cycle
      this(1) = -dot_product(sample%force(:, c), sample%normal(:, c))
      this(2) = norm2(sample%force(:, c) + this(1)*sample%normal(:, c))
      this(3) = sample%overlap(c)
      total = total + this
      most = max(most, this)
    end do
    total = total/max(1, count(inside))
    row = [total(1), most(1), total(2), most(2), total(3), most(3)]
  end function force_row

  !> Normals weighed with the normal forces, sum f_n n n / sum f_n; zero without force [-].
  pure function force_fabric(sample, inside) result(fabric)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: inside(:)
    real(wp) :: fabric(3, 3), force, total
    integer(i4) :: c
    fabric = 0.0_wp
    total = 0.0_wp
    do c = 1, sample%contacts
      if (.not. inside(c)) cycle
      force = -dot_product(sample%force(:, c), sample%normal(:, c))
      fabric = fabric + force*dyad(sample%normal(:, c), sample%normal(:, c))
      total = total + force
    end do
    if (abs(total) > 0.0_wp) fabric = fabric/total
  end function force_fabric

  !> Volume of the grains inside [m^3] and number of those that faces cut: it is exact without any.
  pure function solid_row(sample, region, resolution) result(row)
    type(sample_type), intent(in) :: sample
    type(region_type), intent(in) :: region
    integer(i4), intent(in) :: resolution
    real(wp) :: row(2), solid(3), half(3, sample%n)
    logical :: cut(sample%n)
    integer(i4) :: i
    half = half_sizes(sample)
    solid = solid_content(sample, region, half, resolution)
    do i = 1, sample%n
      cut(i) = .not. region%decides(sample%x(:, i), half(:, i), maxval(sample%axes(:, i)))
    end do
    row = [solid(1), real(count(cut), wp)]
  end function solid_row
end module talus_contact_measures
