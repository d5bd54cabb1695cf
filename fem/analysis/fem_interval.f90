!> What a partner does to an explicit body at the start of an interval: loads that are held from
!! there on, and impulses.
module fem_interval
  use talus_kinds, only: wp, i4
  use talus_text, only: str, is_finite
  use talus_errors, only: error_list_type
  use fem_body, only: fem_body_type
  use fem_types, only: fem_energy_type
  implicit none
  private
  public :: begin_interval, give_impulse, check_impulse

contains

  !> Put the loads of now on the accepted state, which is where the interval begins: forces and
  !! accelerations jump, velocities do not, so that a load F held over a time T gives the impulse
  !! F T. Then the impulses (3, blocks) [N s], if there are any.
  !! eq. F.78
  subroutine begin_interval(self, push)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in), allocatable :: push(:, :)
    real(wp) :: jump(3, self%dofs%blocks)
    integer(i4) :: i

    associate (old => self%accepted)
      call self%external_at(old%time, jump)
      call self%follow(old%time, old%u, jump)
      jump = jump - old%external
      old%external = old%external + jump
      do i = 1, self%dofs%blocks
        where (is_fixed(self, i))
          old%reaction(:, i) = old%reaction(:, i) - jump(:, i)
        elsewhere
          old%a(:, i) = old%a(:, i) + jump(:, i)/self%system%node_mass(i)
        end where
      end do
    end associate
    if (allocated(push)) call give_impulse(self, push, self%accepted%v, self%accepted_energy)
  end subroutine begin_interval

  !> Change the velocities of what is free by impulses; their work is that of loads.
  !! eq. F.79
  subroutine give_impulse(self, push, v, energy)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: push(:, :)              !! (3, blocks) [N s]
    real(wp), intent(inout) :: v(:, :)              !! (3, blocks) [m/s]
    type(fem_energy_type), intent(inout) :: energy
    real(wp) :: change(3), work
    integer(i4) :: i

    work = 0.0_wp
    do i = 1, self%dofs%blocks
      if (.not. any(abs(push(:, i)) > 0.0_wp)) cycle
      change = merge(0.0_wp, push(:, i)/self%system%node_mass(i), is_fixed(self, i))
      work = work + dot_product(push(:, i), merge(0.0_wp, v(:, i), is_fixed(self, i)) &
                                + 0.5_wp*change)
      v(:, i) = v(:, i) + change
    end do
    energy%load = energy%load + work
    energy%kinetic = energy%kinetic + work
  end subroutine give_impulse

  !> Components of a block that supports or a partner move.
  pure function is_fixed(self, block) result(fixed)
    type(fem_body_type), intent(in) :: self
    integer(i4), intent(in) :: block
    logical :: fixed(3)
    fixed = self%supports%held(:, block) .or. self%port%prescribed(:, block)
  end function is_fixed

  !> P302: impulses that are no numbers, on a body that does not step explicitly, or on a rigid
  !! group that moves freely.
  subroutine check_impulse(self, push, place, errors)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: push(:, :)  !! (3, blocks) [N s]
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k

    if (errors%any()) return
    if (.not. self%scheme%explicit) then
      call errors%add('P302', 'only an explicit body takes impulses', place, &
                      'load it by forces, or write kind = ''explicit''')
    else if (.not. all(is_finite(push))) then
      call errors%add('P302', 'an impulse is no number', place)
    end if
    if (.not. allocated(self%supports%rigid)) return
    do k = 1, size(self%supports%rigid)
      associate (rigid => self%supports%rigid(k))
        if (.not. any(rigid%free)) cycle
        if (any(abs(push(:, rigid%node)) > 0.0_wp)) &
          call errors%add('P302', 'rigid group '//str(k)//' moves freely and takes no impulse', &
                          place, 'load it by forces')
      end associate
    end do
  end subroutine check_impulse
end module fem_interval
