!> Newmark's relations between displacements, velocities and accelerations of a body, and the works
!! of a step that trapezoids leave over.
!! eq. F.23
module fem_newmark
  use talus_kinds, only: wp
  use fem_body, only: fem_body_type
  use fem_pore_motion, only: lacking_inertia
  use fem_sparse, only: multiply_mass
  implicit none
  private
  public :: newmark_motion, dynamic_work

contains

  !> Velocities and accelerations of the trial state from its displacements. What is prescribed has
  !! a velocity constant over the step and the backward difference of it as acceleration, as in
  !! linear steps.
  subroutine newmark_motion(self, dt)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt  !! [s]
    associate (s => self%state, old => self%accepted)
      where (self%supports%held .or. self%port%prescribed)
        s%v = (s%u - old%u)/dt
        s%a = (s%v - old%v)/dt
      elsewhere
        s%a = ((s%u - old%u)/dt - old%v)/(self%scheme%beta*dt) - (0.5_wp/self%scheme%beta &
          - 1.0_wp)*old%a
        s%v = old%v + dt*((1.0_wp - self%scheme%gamma)*old%a + self%scheme%gamma*s%a)
      end where
      s%v(:, self%dofs%solid + 1:) = 0.0_wp  ! pressures have no inertia
      s%a(:, self%dofs%solid + 1:) = 0.0_wp
    end associate
  end subroutine newmark_motion

  !> What trapezoidal works miss. By their balance in every state it is D = du'b - dv'M v_mean
  !! with b the mean of what accelerates (M a, or the balances of HHT): the dissipation of the
  !! scheme. Moved supports do not obey Newmark's relations; with e = du - dt v_mean and
  !! f = dt a_mean - dv there (zero where free) f'M v_mean + e'M a_mean is work of theirs.
  subroutine dynamic_work(self, dt, inertia, old_balance)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: dt                                 !! [s]
    real(wp), intent(in) :: inertia(:, :), old_balance(:, :)   !! M a1, b0 of HHT [N]
    real(wp), dimension(3, self%dofs%blocks) :: mean, product, defect, moved
    real(wp) :: left, supports
    associate (s => self%state, old => self%accepted, fixed => self%supports%held &
      .or. self%port%prescribed)
      moved = s%u - old%u
      if (.not. self%pore%unsaturated .and. self%scheme%lag <= 0.0_wp &
          .and. abs(self%scheme%gamma - 0.5_wp) + abs(self%scheme%beta - 0.25_wp) <= 0.0_wp &
          .and. .not. any(fixed .and. abs(moved) + abs(s%v) + abs(old%v) + abs(s%a) + abs(old%a) &
                          > 0.0_wp)) return
      mean = 0.5_wp*(s%a + old%a)
      call multiply_mass(self%system%pattern, self%system%mass, mean, product)
      defect = merge(moved - 0.5_wp*dt*(s%v + old%v), 0.0_wp, fixed)
      supports = sum(defect*product)
      left = sum(moved*product)
      if (self%scheme%lag > 0.0_wp) left = 0.5_wp*sum(moved*(old_balance + s%tie &
        + (inertia - s%tie - self%scheme%lag*old_balance)/(1.0_wp - self%scheme%lag)))
      defect = merge(dt*mean - (s%v - old%v), 0.0_wp, fixed)
      mean = 0.5_wp*(s%v + old%v)
      call multiply_mass(self%system%pattern, self%system%mass, mean, product)
      supports = supports + sum(defect*product)
      left = left - sum((s%v - old%v)*product)
      if (self%pore%unsaturated) left = left + lost_with_liquid(self, moved)
      self%energy%support = self%energy%support - supports
      self%energy%numerical = self%energy%numerical + left - supports
    end associate
  end subroutine dynamic_work

  !> The same sum for the masses that unsaturated pores lack: it has what liquid takes along or
  !! brings, too, as masses change in the step [J].
  function lost_with_liquid(self, moved) result(work)
    type(fem_body_type), intent(in) :: self
    real(wp), intent(in) :: moved(:, :)  !! (3, blocks)
    real(wp) :: work
    associate (s => self%state, old => self%accepted)
      work = 0.5_wp*(sum(old%v*lacking_inertia(self, old%u, old%v)) &
                     - sum(s%v*lacking_inertia(self, s%u, s%v)))
      if (self%scheme%lag > 0.0_wp) return  ! the balances of HHT have the accelerations
      work = work + 0.5_wp*sum(moved*(lacking_inertia(self, old%u, old%a) &
        + lacking_inertia(self, s%u, s%a)))
    end associate
  end function lost_with_liquid
end module fem_newmark
