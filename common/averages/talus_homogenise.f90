!> From grains and contacts to continuum measures of a region (theory: "Averages").
!!
!! Signs: tension positive, the first index is the normal of the area; l = x2 - x1 is the branch of
!! a contact and f the force on grain 1 from grain 2. Branches are cut at the faces of the region.
module talus_homogenise
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use talus_region, only: region_type
  use talus_sample, only: sample_type
  implicit none
  private
  public :: branch_inside, love_weber, couple_stress, direction_fabric, branch_fabric
  public :: axis_fabric, velocity_gradient, kinetic_stress, half_sizes, dyad, cross, deviator_of
  public :: inverse_of

contains

  pure function dyad(a, b) result(t)
    real(wp), intent(in) :: a(3), b(3)
    real(wp) :: t(3, 3)
    integer(i4) :: j
    do j = 1, 3
      t(:, j) = a*b(j)
    end do
  end function dyad

  !> Half-sizes of the boxes around ellipsoids (3, n) [m].
  pure function half_sizes(sample) result(half)
    type(sample_type), intent(in) :: sample
    real(wp), allocatable :: half(:, :)
    integer(i4) :: i, k
    allocate (half(3, sample%n))
    do i = 1, sample%n
      do k = 1, 3
        half(k, i) = sqrt(sum((sample%turn(k, :, i)*sample%axes(:, i))**2))
      end do
    end do
  end function half_sizes

  !> Branch of contact c inside the region: from the first centre to the point, and on to the
  !! second centre, each cut at the faces [m].
  pure function branch_inside(sample, region, c) result(branch)
    type(sample_type), intent(in) :: sample
    type(region_type), intent(in) :: region
    integer(i4), intent(in) :: c
    real(wp) :: branch(3), a(3), b(3), p(3)

    a = sample%start(:, c)
    p = sample%point(:, c)
    b = sample%far_end(c)
    branch = region%part_of_segment(a, p)*(p - a) + region%part_of_segment(p, b)*(b - p)
  end function branch_inside

  !> Stress of the contacts: sigma_ij = 1/V sum of l_i f_j [Pa].
  pure function love_weber(sample, branch, volume) result(sigma)
    type(sample_type), intent(in) :: sample
    real(wp), intent(in) :: branch(:, :)  !! (3, contacts) inside the region [m]
    real(wp), intent(in) :: volume        !! [m^3]
    real(wp) :: sigma(3, 3)
    integer(i4) :: c
    sigma = 0.0_wp
    do c = 1, sample%contacts
      sigma = sigma + dyad(branch(:, c), sample%force(:, c))
    end do
    sigma = sigma/volume
  end function love_weber

  !> Couple stress of the contacts: mu_ij = 1/V sum of l_i (s x f)_j [N/m], the arm s from the
  !! middle of the branch to the contact point, or (given) from a fixed origin.
  pure function couple_stress(sample, branch, volume, origin) result(mu)
    type(sample_type), intent(in) :: sample
    real(wp), intent(in) :: branch(:, :)  !! (3, contacts) inside the region [m]
    real(wp), intent(in) :: volume        !! [m^3]
    real(wp), intent(in), optional :: origin(3)  !! [m]
    real(wp) :: mu(3, 3), arm(3)
    integer(i4) :: c
    mu = 0.0_wp
    do c = 1, sample%contacts
      if (present(origin)) then
        arm = sample%point(:, c) - origin
      else
        arm = sample%point(:, c) - 0.5_wp*(sample%start(:, c) + sample%far_end(c))
      end if
      mu = mu + dyad(branch(:, c), cross(arm, sample%force(:, c)))
    end do
    mu = mu/volume
  end function couple_stress

  !> Fabric <n n> of the contacts that are picked; zero without any [-].
  pure function direction_fabric(sample, picked) result(fabric)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: picked(:)
    real(wp) :: fabric(3, 3)
    integer(i4) :: c
    fabric = 0.0_wp
    do c = 1, sample%contacts
      if (picked(c)) fabric = fabric + dyad(sample%normal(:, c), sample%normal(:, c))
    end do
    fabric = fabric/max(1, count(picked))
  end function direction_fabric

  !> Fabric <l l>/|l|^2 of the branches, and their mean length [m].
  pure subroutine branch_fabric(sample, picked, fabric, length)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: picked(:)
    real(wp), intent(out) :: fabric(3, 3), length
    real(wp) :: l(3)
    integer(i4) :: c
    fabric = 0.0_wp
    length = 0.0_wp
    do c = 1, sample%contacts
      if (.not. picked(c)) cycle
      l = sample%far_end(c) - sample%start(:, c)
      if (.not. sum(l**2) > 0.0_wp) cycle
      fabric = fabric + dyad(l, l)/sum(l**2)
      length = length + norm2(l)
    end do
    fabric = fabric/max(1, count(picked))
    length = length/max(1, count(picked))
  end subroutine branch_fabric

  !> Fabric <m m> of the shortest (or longest) axes of the grains; axes of equal length share [-].
  pure function axis_fabric(sample, picked, longest) result(fabric)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: picked(:), longest
    real(wp), parameter :: equal = 1.0e-9_wp
    real(wp) :: fabric(3, 3), this(3, 3), wanted
    integer(i4) :: i, k, many
    fabric = 0.0_wp
    do i = 1, sample%n
      if (.not. picked(i)) cycle
      wanted = merge(maxval(sample%axes(:, i)), minval(sample%axes(:, i)), longest)
      this = 0.0_wp
      many = 0
      do k = 1, 3
        if (abs(sample%axes(k, i) - wanted) > equal*wanted) cycle
        this = this + dyad(sample%turn(:, k, i), sample%turn(:, k, i))
        many = many + 1
      end do
      fabric = fabric + this/many
    end do
    fabric = fabric/max(1, count(picked))
  end function axis_fabric

  !> Best fit of v_i = v0_i + g_ij (x_j - x0_j) over the grains, weighted by mass [1/s]; zero where
  !! their centres lie in a plane.
  pure function velocity_gradient(sample, picked) result(g)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: picked(:)
    real(wp), parameter :: flat = 1.0e-12_wp
    real(wp) :: g(3, 3), spread(3, 3), work(3, 3), x0(3), v0(3), mass, det
    integer(i4) :: i

    g = 0.0_wp
    mass = sum(sample%mass, mask=picked)
    if (count(picked) < 4 .or. .not. mass > 0.0_wp) return
    do i = 1, 3
      x0(i) = sum(sample%mass*sample%x(i, :), mask=picked)/mass
      v0(i) = sum(sample%mass*sample%v(i, :), mask=picked)/mass
    end do
    spread = 0.0_wp
    work = 0.0_wp
    do i = 1, sample%n
      if (.not. picked(i)) cycle
      spread = spread + sample%mass(i)*dyad(sample%x(:, i) - x0, sample%x(:, i) - x0)
      work = work + sample%mass(i)*dyad(sample%v(:, i) - v0, sample%x(:, i) - x0)
    end do
    det = dot_product(spread(:, 1), cross(spread(:, 2), spread(:, 3)))
    if (det <= flat*((spread(1, 1) + spread(2, 2) + spread(3, 3))/3.0_wp)**3) return
    g = matmul(work, inverse_of(spread))
  end function velocity_gradient

  !> Inverse of a regular matrix.
  pure function inverse_of(a) result(b)
    real(wp), intent(in) :: a(3, 3)
    real(wp) :: b(3, 3)
    b(1, :) = cross(a(:, 2), a(:, 3))
    b(2, :) = cross(a(:, 3), a(:, 1))
    b(3, :) = cross(a(:, 1), a(:, 2))
    b = b/dot_product(a(:, 1), b(1, :))
  end function inverse_of

  !> Stress of the motion about the linear field: -1/V sum of m v' v' [Pa].
  pure function kinetic_stress(sample, picked, gradient, volume) result(sigma)
    type(sample_type), intent(in) :: sample
    logical, intent(in) :: picked(:)
    real(wp), intent(in) :: gradient(3, 3)  !! of velocity [1/s]
    real(wp), intent(in) :: volume          !! [m^3]
    real(wp) :: sigma(3, 3), x0(3), v0(3), mass, rest(3)
    integer(i4) :: i
    sigma = 0.0_wp
    mass = sum(sample%mass, mask=picked)
    if (.not. mass > 0.0_wp) return
    do i = 1, 3
      x0(i) = sum(sample%mass*sample%x(i, :), mask=picked)/mass
      v0(i) = sum(sample%mass*sample%v(i, :), mask=picked)/mass
    end do
    do i = 1, sample%n
      if (.not. picked(i)) cycle
      rest = sample%v(:, i) - v0 - matmul(gradient, sample%x(:, i) - x0)
      sigma = sigma - sample%mass(i)*dyad(rest, rest)
    end do
    sigma = sigma/volume
  end function kinetic_stress

  !> sqrt(3/2 s:s) of the symmetric deviator s [unit of the tensor].
  pure real(wp) function deviator_of(t) result(q)
    real(wp), intent(in) :: t(3, 3)
    real(wp) :: s(3, 3), mean
    integer(i4) :: k
    s = 0.5_wp*(t + transpose(t))
    mean = (s(1, 1) + s(2, 2) + s(3, 3))/3.0_wp
    do k = 1, 3
      s(k, k) = s(k, k) - mean
    end do
    q = sqrt(1.5_wp*sum(s**2))
  end function deviator_of
end module talus_homogenise
