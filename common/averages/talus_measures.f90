!> All measures of a region as one row of numbers with their titles.
!!
!! Grains belong to the region by their centre, contacts by their point; stress and moduli take the
!! part of each branch inside, the solid volume the part of each grain inside. Only free grains
!! count in coordination, axes and velocity gradient.
module talus_measures
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: branch_inside, love_weber, couple_stress, direction_fabric, &
    branch_fabric, axis_fabric, velocity_gradient, kinetic_stress, half_sizes, deviator_of
  use talus_micro_moduli, only: micro_type, micro_moduli, gradient_moduli
  use talus_moduli, only: affine_moduli, isotropic_part, isotropic_type
  use talus_region, only: region_type, region_all, region_cell, ball_points
  use talus_sample, only: sample_type
  use talus_text, only: str, string_type, append_string
  implicit none
  private
  public :: request_type, measure_columns, measure_row, moduli_columns, moduli_row, contacts_of
  public :: micro_columns, micro_row
  public :: add_titles, add_tensor, region_now, nine_parts, six_parts, row9, row6, pressure_of, &
    solid_content

  character(len=2), parameter :: nine_parts(9) = ['xx', 'xy', 'xz', 'yx', 'yy', 'yz', 'zx', &
                                                    'zy', 'zz']
  character(len=2), parameter :: six_parts(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'zx']
  real(wp), parameter :: pi = acos(-1.0_wp)

  !> What is wanted of a region.
  type :: request_type
    type(region_type) :: region
    integer(i4) :: resolution = 24          !! points to the diameter of a grain that is cut
    logical :: has_origin = .false.         !! arms of the couple stress from origin
    real(wp) :: origin(3) = 0.0_wp          !! [m]
  end type request_type

contains

  !> Titles of a row, the time first.
  subroutine measure_columns(names)
    type(string_type), allocatable, intent(out) :: names(:)

    allocate (names(0))
    call add_titles(names, 'time [s],volume [m3],grains [-],contacts [-],solid_fraction [-],')
    call add_titles(names, 'density [kg/m3],micro_inertia [m2],coordination [-],')
    call add_titles(names, 'mechanical_coordination [-],rattlers [-],sliding [-],')
    call add_tensor(names, 'stress', 'Pa', nine_parts)
    call add_titles(names, 'pressure [Pa],deviator [Pa],skew [Pa],kinetic_pressure [Pa],')
    call add_tensor(names, 'couple_stress', 'N/m', nine_parts)
    call add_tensor(names, 'fabric_contact', '-', six_parts)
    call add_tensor(names, 'fabric_branch', '-', six_parts)
    call add_titles(names, 'branch_length [m],')
    call add_tensor(names, 'fabric_short_axis', '-', six_parts)
    call add_tensor(names, 'fabric_long_axis', '-', six_parts)
    call add_tensor(names, 'velocity_gradient', '1/s', nine_parts)
    call add_titles(names, 'shear_rate [1/s],inertial_number [-],')
    call add_titles(names, 'affine_bulk [Pa],affine_shear [Pa],affine_lambda [Pa],affine_mu [Pa],')
    call add_titles(names, 'affine_kappa [Pa],affine_alpha [N],affine_beta [N],affine_gamma [N],')
    call add_titles(names, 'coupling_number [-],bending_length [m],')
  end subroutine measure_columns

  !> Titles of the affine moduli in full.
  subroutine moduli_columns(names)
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: t, i, j

    allocate (names(0))
    call add_titles(names, 'time [s],')
    do t = 1, 3
      do i = 1, 9
        do j = 1, 9
          call add_titles(names, 'CBD'(t:t)//'_'//nine_parts(i)//'_'//nine_parts(j)//' '// &
                          trim(merge('[Pa] ', merge('[N]  ', '[N/m]', t == 2), t == 1))//',')
        end do
      end do
    end do
  end subroutine moduli_columns

  !> Titles of the affine micromorphic moduli.
  subroutine micro_columns(names)
    type(string_type), allocatable, intent(out) :: names(:)
    integer(i4) :: k
    allocate (names(0))
    call add_titles(names, 'time [s],lambda [Pa],mu [Pa],eta [Pa],tau [Pa],kappa [Pa],nu [Pa],'// &
                    'sigma [Pa],')
    do k = 1, 11
      call add_titles(names, 'tau_'//str(k)//' [N],')
    end do
    call add_titles(names, 'density [kg/m3],micro_inertia [m2],')
  end subroutine micro_columns

  !> Add titles, each ended by a comma.
  subroutine add_titles(names, list)
    type(string_type), allocatable, intent(inout) :: names(:)
    character(len=*), intent(in) :: list
    integer :: first, comma
    first = 1
    do
      comma = index(list(first:), ',')
      if (comma == 0) return
      call append_string(names, list(first:first + comma - 2))
      first = first + comma
    end do
  end subroutine add_titles

  subroutine add_tensor(names, name, unit, parts)
    type(string_type), allocatable, intent(inout) :: names(:)
    character(len=*), intent(in) :: name, unit, parts(:)
    integer :: k
    do k = 1, size(parts)
      call append_string(names, name//'_'//parts(k)//' ['//unit//']')
    end do
  end subroutine add_tensor

  !> Row xx xy xz yx ... of a tensor.
  pure function row9(t) result(r)
    real(wp), intent(in) :: t(3, 3)
    real(wp) :: r(9)
    r = reshape(transpose(t), [9])
  end function row9

  !> Row xx yy zz xy yz zx of a symmetric tensor.
  pure function row6(t) result(r)
    real(wp), intent(in) :: t(3, 3)
    real(wp) :: r(6)
    r = [t(1, 1), t(2, 2), t(3, 3), t(1, 2), t(2, 3), t(3, 1)]
  end function row6

  !> Contacts of every grain (n).
  pure function contacts_of(sample) result(z)
    type(sample_type), intent(in) :: sample
    integer(i4), allocatable :: z(:)
    integer(i4) :: c
    allocate (z(sample%n), source=0_i4)
    do c = 1, sample%contacts
      if (sample%first(c) > 0) z(sample%first(c)) = z(sample%first(c)) + 1
      z(sample%second(c)) = z(sample%second(c)) + 1
    end do
  end function contacts_of

  !> The region as it is now: all is the box around the free grains, or the whole cell.
  pure function region_now(sample, request) result(region)
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    type(region_type) :: region
    real(wp), allocatable :: half(:, :)
    integer(i4), allocatable :: rows(:)
    integer(i4) :: c
    region = request%region
    if (region%kind /= region_all) return
    if (sample%cell_volume > 0.0_wp) then
      region%kind = region_cell
      region%cell_volume = sample%cell_volume
      return
    end if
    half = half_sizes(sample)
    rows = pack([(c, c=1, sample%n)], sample%free)
    call region%fit(sample%x(:, rows), half(:, rows))
  end function region_now

  !> The region as it is now, and the branches inside it.
  pure subroutine prepare(sample, request, region, half, branch)
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    type(region_type), intent(out) :: region
    real(wp), allocatable, intent(out) :: half(:, :), branch(:, :)
    integer(i4) :: c
    region = region_now(sample, request)
    half = half_sizes(sample)
    allocate (branch(3, sample%contacts))
    do c = 1, sample%contacts
      branch(:, c) = branch_inside(sample, region, c)
    end do
  end subroutine prepare

  !> The row of a region at a time [s].
  subroutine measure_row(time, sample, request, row)
    real(wp), intent(in) :: time
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    real(wp), allocatable, intent(out) :: row(:)
    type(region_type) :: region
    real(wp), allocatable :: half(:, :), branch(:, :)
    logical, allocatable :: grains(:), contacts(:)
    real(wp) :: volume, sigma(3, 3), mu(3, 3), fabric(3, 3), length, g(3, 3), kinetic(3, 3)
    real(wp) :: solid(3)
    integer(i4) :: i

    call prepare(sample, request, region, half, branch)
    volume = max(region%volume(), tiny(1.0_wp))
    grains = [(sample%free(i) .and. region%contains(sample%x(:, i)), i=1, sample%n)]
    contacts = [(region%contains(sample%point(:, i)), i=1, sample%contacts)]
    solid = solid_content(sample, region, half, request%resolution)
    row = [time, volume, real(count(grains), wp), real(count(contacts), wp), solid(1)/volume, &
           solid(2)/volume, solid(3)/max(solid(2), tiny(1.0_wp)), &
           coordination_row(sample, grains), &
           real(count(contacts .and. sample%sliding), wp)/max(1, count(contacts))]
    sigma = love_weber(sample, branch, volume)
    g = velocity_gradient(sample, grains)
    kinetic = kinetic_stress(sample, grains, g, volume)
    if (request%has_origin) then
      mu = couple_stress(sample, branch, volume, request%origin)
    else
      mu = couple_stress(sample, branch, volume)
    end if
    row = [row, row9(sigma), pressure_of(sigma), deviator_of(sigma), &
           sqrt(sum((0.5_wp*(sigma - transpose(sigma)))**2)/2.0_wp), pressure_of(kinetic), &
           row9(mu), row6(direction_fabric(sample, contacts))]
    call branch_fabric(sample, contacts, fabric, length)
    row = [row, row6(fabric), length, row6(axis_fabric(sample, grains, .false.)), &
           row6(axis_fabric(sample, grains, .true.)), row9(g), &
           rate_row(sample, grains, g, pressure_of(sigma))]
    row = [row, isotropic_row(sample, branch, volume)]
  end subroutine measure_row

  !> Volume [m^3], mass [kg] and moment of inertia (mean) [kg m^2] of the grains inside, fixed ones
  !! too; what two grains share counts twice.
  pure function solid_content(sample, region, half, resolution) result(sums)
    type(sample_type), intent(in) :: sample
    type(region_type), intent(in) :: region
    real(wp), intent(in) :: half(:, :)
    integer(i4), intent(in) :: resolution
    real(wp), allocatable :: points(:, :)
    real(wp) :: sums(3), part
    integer(i4) :: i
    allocate (points, source=ball_points(resolution))
    sums = 0.0_wp
    do i = 1, sample%n
      part = region%part_of_grain(sample%x(:, i), half(:, i), sample%turn(:, :, i), &
                                  sample%axes(:, i), points)
      sums = sums + part*[sample%volume(i), sample%mass(i), sample%inertia(i)]
    end do
  end function solid_content

  !> Mean contacts of a grain; mean contacts with each other of those that are held; part of the
  !! grains that are not.
  pure function coordination_row(sample, grains) result(row)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: grains(:)
    real(wp) :: row(3)
    integer(i4), allocatable :: z(:), among(:)
    logical, allocatable :: held(:)
    integer(i4) :: n
    allocate (z, source=contacts_of(sample))
    call find_held(sample, held, among)
    n = count(grains)
    row(1) = real(sum(z, mask=grains), wp)/max(1, n)
    row(2) = real(sum(among, mask=grains .and. held), wp)/max(1, count(grains .and. held))
    row(3) = real(count(grains .and. .not. held), wp)/max(1, n)
  end function coordination_row

  !> Grains that are held, and their contacts with boundaries and with each other: free grains with
  !! fewer than two contacts are removed with their contacts, repeatedly until none is left.
  pure subroutine find_held(sample, held, among)
    type(sample_type), intent(in) :: sample
    logical, allocatable, intent(out) :: held(:)     !! (n)
    integer(i4), allocatable, intent(out) :: among(:)  !! (n)
    logical, allocatable :: lost(:)
    integer(i4) :: c, i, j
    allocate (held(sample%n), source=.true.)
    do
      among = spread(0_i4, 1, sample%n)
      do c = 1, sample%contacts
        i = sample%first(c)
        j = sample%second(c)
        if (i > 0) then
          if (.not. (held(i) .and. held(j))) cycle
          among(i) = among(i) + 1
        end if
        if (held(j)) among(j) = among(j) + 1
      end do
      lost = held .and. sample%free .and. among < 2
      if (.not. any(lost)) return
      held = held .and. .not. lost
    end do
  end subroutine find_held

  !> Shear rate sqrt(2 D:D) of the deviatoric rate [1/s] and inertial number rate d sqrt(rho/p),
  !! d the mean diameter of spheres of equal volume; 0 without pressure.
  pure function rate_row(sample, grains, g, pressure) result(row)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: grains(:)
    real(wp), intent(in) :: g(3, 3), pressure
    real(wp) :: row(2), diameter, density
    row(1) = deviator_of(g)*2.0_wp/sqrt(3.0_wp)
    row(2) = 0.0_wp
    if (.not. pressure > 0.0_wp .or. count(grains) == 0) return
    diameter = sum((6.0_wp*sample%volume/pi)**(1.0_wp/3.0_wp), mask=grains)/count(grains)
    density = sum(sample%mass, mask=grains)/sum(sample%volume, mask=grains)
    row(2) = row(1)*diameter*sqrt(density/pressure)
  end function rate_row

  pure function isotropic_row(sample, branch, volume) result(row)
    type(sample_type), intent(in) :: sample
    real(wp), intent(in) :: branch(:, :), volume
    type(isotropic_type) :: iso
    real(wp) :: row(10), c9(9, 9), b9(9, 9), d9(9, 9)
    call affine_moduli(sample, branch, volume, c9, b9, d9)
    iso = isotropic_part(c9, b9)
    row = [iso%bulk, iso%shear, iso%lambda, iso%mu, iso%kappa, iso%alpha, iso%beta, iso%gamma, &
           iso%coupling_number, iso%bending_length]
  end function isotropic_row

  !> The affine moduli in full: C, B, D, each 9 x 9, second pair running fastest.
  subroutine moduli_row(time, sample, request, row)
    real(wp), intent(in) :: time
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    real(wp), allocatable, intent(out) :: row(:)
    type(region_type) :: region
    real(wp), allocatable :: half(:, :), branch(:, :)
    real(wp) :: c9(9, 9), b9(9, 9), d9(9, 9)
    call prepare(sample, request, region, half, branch)
    call affine_moduli(sample, branch, max(region%volume(), tiny(1.0_wp)), c9, b9, d9)
    row = [time, reshape(transpose(c9), [81]), reshape(transpose(b9), [81]), &
           reshape(transpose(d9), [81])]
  end subroutine moduli_row

  !> The affine micromorphic moduli, density and micro-inertia i_KL = i d_KL; `grains` are lambda
  !! and mu of their material [Pa].
  subroutine micro_row(time, sample, request, grains, row)
    real(wp), intent(in) :: time, grains(2)
    type(sample_type), intent(in) :: sample
    type(request_type), intent(in) :: request
    real(wp), allocatable, intent(out) :: row(:)
    type(region_type) :: region
    type(micro_type) :: m
    real(wp), allocatable :: half(:, :), branch(:, :)
    real(wp) :: c9(9, 9), b9(9, 9), d9(9, 9), volume, solid(3)
    call prepare(sample, request, region, half, branch)
    volume = max(region%volume(), tiny(1.0_wp))
    call affine_moduli(sample, branch, volume, c9, b9, d9)
    solid = solid_content(sample, region, half, request%resolution)
    m = micro_moduli(isotropic_part(c9, b9), solid(1)/volume, grains(1), grains(2), &
                     gradient_moduli(sample, branch, volume))
    row = [time, m%lambda, m%mu, m%eta, m%tau, m%kappa, m%nu, m%sigma, m%taus, solid(2)/volume, &
           0.5_wp*solid(3)/max(solid(2), tiny(1.0_wp))]
  end subroutine micro_row

  pure real(wp) function pressure_of(t)
    real(wp), intent(in) :: t(3, 3)
    pressure_of = -(t(1, 1) + t(2, 2) + t(3, 3))/3.0_wp
  end function pressure_of
end module talus_measures
