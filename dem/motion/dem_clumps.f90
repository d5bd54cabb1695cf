!> Members of clumps: where they are and how they move, from the motion of their clumps.
!! eqs. D.89 and D.90
module dem_clumps
  use talus_kinds, only: wp, i4
  use talus_vectors, only: cross
  use dem_ellipsoid, only: rotation_of
  use dem_prescribed, only: put_body
  use dem_state, only: dem_clumps_type, dem_grains_type, body_size
  implicit none
  private
  public :: ready_clumps, place_members, move_members, add_load, set_lightness

contains

  !> Records of all clumps, and arms of their members, as clumps are now.
  subroutine ready_clumps(clumps, grains)
    type(dem_clumps_type), intent(inout) :: clumps
    type(dem_grains_type), intent(in) :: grains
    real(wp) :: rotation(3, 3)
    integer(i4) :: k, i

    if (clumps%n == 0) return
    if (allocated(clumps%pairs%body)) deallocate (clumps%pairs%body, clumps%pairs%reach, &
                                                  clumps%pairs%ease)
    allocate (clumps%pairs%body(body_size, clumps%n), clumps%pairs%reach(clumps%n), source=0.0_wp)
    allocate (clumps%pairs%ease(clumps%n), source=1.0_wp)
    if (.not. allocated(clumps%arm)) allocate (clumps%arm(3, grains%n), source=0.0_wp)
    do k = 1, clumps%n
      call put_body(clumps%grains, k, clumps%pairs%body(:, k))
      rotation = rotation_of(clumps%grains%quat(:, k))
      do i = clumps%first(k), clumps%last(k)
        clumps%arm(:, i) = matmul(rotation, clumps%place(:, i))
        clumps%pairs%reach(k) = max(clumps%pairs%reach(k), norm2(clumps%place(:, i)))
      end do
    end do
  end subroutine ready_clumps

  !> Members of clump k, and their records, go where the clump has gone.
  pure subroutine place_members(clumps, grains, body, k)
    type(dem_clumps_type), intent(inout) :: clumps
    type(dem_grains_type), intent(inout) :: grains
    real(wp), intent(inout) :: body(:, :)  !! records of the grains
    integer(i4), intent(in) :: k
    real(wp) :: rotation(3, 3)
    integer(i4) :: i

    rotation = rotation_of(clumps%grains%quat(:, k))
    do i = clumps%first(k), clumps%last(k)
      clumps%arm(:, i) = matmul(rotation, clumps%place(:, i))
      grains%x(:, i) = clumps%grains%x(:, k) + clumps%arm(:, i)
      grains%quat(:, i) = clumps%grains%quat(:, k)
      grains%theta(:, i) = clumps%grains%theta(:, k)
      body(1:3, i) = grains%x(:, i)
      body(4:6, i) = clumps%pairs%body(4:6, k) + cross(clumps%grains%omega(:, k), clumps%arm(:, i))
      body(7:9, i) = clumps%grains%omega(:, k)
    end do
    call move_members(clumps, grains, k)
  end subroutine place_members

  !> Velocities and spins of the members of clump k.
  pure subroutine move_members(clumps, grains, k)
    type(dem_clumps_type), intent(in) :: clumps
    type(dem_grains_type), intent(inout) :: grains
    integer(i4), intent(in) :: k
    integer(i4) :: i
    do i = clumps%first(k), clumps%last(k)
      grains%v(:, i) = clumps%grains%v(:, k) + cross(clumps%grains%omega(:, k), clumps%arm(:, i))
      grains%omega(:, i) = clumps%grains%omega(:, k)
    end do
  end subroutine move_members

  !> Force and moment on clump k from those on its members, in their order.
  pure subroutine add_load(clumps, grains, k)
    type(dem_clumps_type), intent(inout) :: clumps
    type(dem_grains_type), intent(in) :: grains
    integer(i4), intent(in) :: k
    real(wp) :: force(3), moment(3)
    integer(i4) :: i
    force = 0.0_wp
    moment = 0.0_wp
    do i = clumps%first(k), clumps%last(k)
      force = force + grains%force(:, i)
      moment = moment + (grains%moment(:, i) + cross(clumps%arm(:, i), grains%force(:, i)))
    end do
    clumps%grains%force(:, k) = force
    clumps%grains%moment(:, k) = moment
  end subroutine add_load

  !> Mass over the least effective mass 1/(1/m + l) of members under forces along normals of their
  !! surfaces, l the largest eigenvalue of [c]^T I^-1 [c], which has the eigenvalue 0 along c.
  pure subroutine set_lightness(clumps)
    type(dem_clumps_type), intent(inout) :: clumps
    real(wp) :: c(3), a(3), tensor(6), trace, minor
    integer(i4) :: k, i
    do k = 1, clumps%n
      a = 1.0_wp/clumps%grains%inertia(:, k)
      do i = clumps%first(k), clumps%last(k)
        c = clumps%place(:, i)
        tensor(1) = a(2)*c(3)**2 + a(3)*c(2)**2
        tensor(2) = a(3)*c(1)**2 + a(1)*c(3)**2
        tensor(3) = a(1)*c(2)**2 + a(2)*c(1)**2
        tensor(4:) = -[a(3)*c(1)*c(2), a(1)*c(2)*c(3), a(2)*c(3)*c(1)]
        trace = sum(tensor(:3))
        minor = tensor(1)*tensor(2) + tensor(2)*tensor(3) + tensor(3)*tensor(1) &
                - sum(tensor(4:)**2)
        clumps%lightness(i) = 1.0_wp + clumps%grains%mass(k) &
          *0.5_wp*(trace + sqrt(max(trace*trace - 4.0_wp*minor, 0.0_wp)))
      end do
    end do
  end subroutine set_lightness
end module dem_clumps
