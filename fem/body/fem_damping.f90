!> Viscous forces C v of a body: Rayleigh's a M + b K, and dashpots at nodes (Lysmer's absorbing
!! faces: theory, dynamics).
module fem_damping
  use talus_kinds, only: wp, i4
  use fem_halo, only: fem_halo_type
  use fem_sparse, only: fem_pattern_type, multiply, multiply_mass
  implicit none
  private
  public :: fem_damping_type

  type :: fem_damping_type
    real(wp) :: mass = 0.0_wp        !! Rayleigh's a [1/s]
    real(wp) :: stiffness = 0.0_wp   !! Rayleigh's b [s]
    integer(i4) :: n = 0             !! blocks with a dashpot
    integer(i4), allocatable :: block(:)
    real(wp), allocatable :: dashpot(:, :, :)  !! (3, 3, n) [N s/m]
  contains
    procedure :: active
    procedure :: force
    procedure :: add_dashpots
    procedure :: add_face
    procedure :: complete
  end type fem_damping_type

contains

  pure logical function active(self)
    class(fem_damping_type), intent(in) :: self
    active = self%mass > 0.0_wp .or. self%stiffness > 0.0_wp .or. self%n > 0
  end function active

  !> C v [N, N m].
  subroutine force(self, pattern, k, mass, v, f)
    class(fem_damping_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in), contiguous :: k(:, :, :), mass(:), v(:, :)
    real(wp), intent(out) :: f(:, :)
    real(wp) :: part(3, size(v, 2))
    integer(i4) :: i
    f = 0.0_wp
    if (self%mass > 0.0_wp) then
      call multiply_mass(pattern, mass, v, part)
      f = self%mass*part
    end if
    if (self%stiffness > 0.0_wp) then
      call multiply(pattern, k, v, part)
      f = f + self%stiffness*part
    end if
    do i = 1, self%n
      f(:, self%block(i)) = f(:, self%block(i)) + matmul(self%dashpot(:, :, i), v(:, self%block(i)))
    end do
  end subroutine force

  !> Add factor times the dashpots to the diagonal blocks of a matrix.
  pure subroutine add_dashpots(self, pattern, factor, k)
    class(fem_damping_type), intent(in) :: self
    type(fem_pattern_type), intent(in) :: pattern
    real(wp), intent(in) :: factor
    real(wp), intent(inout) :: k(:, :, :)
    integer(i4) :: i, p
    do i = 1, self%n
      if (.not. pattern%halo%owns(self%block(i))) cycle
      p = pattern%start(self%block(i))
      k(:, :, p) = k(:, :, p) + factor*self%dashpot(:, :, i)
    end do
  end subroutine add_dashpots

  !> The dashpots of all ranks' faces at the blocks of this one, where these are dealt out.
  subroutine complete(self, halo)
    class(fem_damping_type), intent(inout) :: self
    type(fem_halo_type), intent(in) :: halo
    real(wp), allocatable :: all(:, :)
    integer(i4) :: i
    if (.not. halo%dealt) return
    allocate (all(9, size(halo%mine)), source=0.0_wp)
    do i = 1, self%n
      all(:, self%block(i)) = reshape(self%dashpot(:, :, i), [9])
    end do
    call halo%sum_up(all)
    self%block = pack([(i, i=1, size(all, 2))], maxval(abs(all), 1) > 0.0_wp)
    self%n = int(size(self%block), i4)
    self%dashpot = reshape(all(:, self%block), [3_i4, 3_i4, self%n])
  end subroutine complete

  !> Dashpots c (3, 3) [N s/m] of the nodes of a face, added to those that they have already.
  subroutine add_face(self, block, c)
    class(fem_damping_type), intent(inout) :: self
    integer(i4), intent(in) :: block(:)
    real(wp), intent(in) :: c(:, :, :)
    integer(i4), allocatable :: blocks(:)
    real(wp), allocatable :: dashpots(:, :, :)
    integer(i4) :: a, k

    do a = 1, size(block)
      k = 0
      if (self%n > 0) k = int(findloc(self%block(:self%n), block(a), 1), i4)
      if (k == 0) then
        if (.not. allocated(self%block)) allocate (self%block(0), self%dashpot(3, 3, 0))
        if (self%n == size(self%block)) then
          allocate (blocks(2*self%n + 64), dashpots(3, 3, 2*self%n + 64))
          dashpots = 0.0_wp
          blocks(:self%n) = self%block
          dashpots(:, :, :self%n) = self%dashpot
          call move_alloc(blocks, self%block)
          call move_alloc(dashpots, self%dashpot)
        end if
        self%n = self%n + 1
        k = self%n
        self%block(k) = block(a)
      end if
      self%dashpot(:, :, k) = self%dashpot(:, :, k) + c(:, :, a)
    end do
  end subroutine add_face
end module fem_damping
