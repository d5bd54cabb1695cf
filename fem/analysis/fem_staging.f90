!> Steps of a body whose elements are removed and placed in stages. What a stage leaves out of
!! balance (forces of removed elements, weight of placed ones) is a load that vanishes over
!! the stage's duration.
module fem_staging
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_h5_shaped, only: get_shaped
  use talus_hdf5, only: h5_file_type
  use fem_body, only: fem_body_type
  use fem_law, only: at_stored, at_numerical
  use fem_newton, only: newton_step
  use fem_stages, only: next_stage
  implicit none
  private
  public :: staged_step, hide_absent, put_stages, get_stages

  real(wp), parameter :: near = 1.0e-9_wp  !! of a step, by which a stage may come early

contains

  !> From the accepted state to time t1, in parts that start at the stages; parts before the last
  !! one are accepted.
  subroutine staged_step(self, t1, errors)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    real(wp) :: slack, goal
    slack = near*(t1 - self%accepted%time)
    do
      do while (next_stage(self%stages, t1) <= self%accepted%time + slack)
        call change(self, self%stages%done + 1)
      end do
      goal = next_stage(self%stages, t1)
      if (goal >= t1 - slack) goal = t1
      call newton_step(self, goal, errors)
      if (errors%any() .or. goal >= t1) return
      call self%accept()
    end do
  end subroutine staged_step

  !> Remove or place the elements of stage k; the release has what is out of balance then.
  subroutine change(self, k)
    type(fem_body_type), intent(inout) :: self
    integer(i4), intent(in) :: k
    real(wp), dimension(3, self%dofs%blocks) :: internal, external
    real(wp) :: gone(1)
    integer(i4) :: i, e, q

    gone = 0.0_wp
    associate (stage => self%stages%stage(k), m => self%matter)
      do i = 1, size(stage%element)
        e = stage%element(i)
        do q = self%elastic%point(e), self%elastic%point(e + 1) - 1
          if (.not. stage%place) gone = gone &
            + m%weight(q)*sum(m%accepted_state(at_stored:at_numerical, q))
          m%stress(:, q) = self%stages%stress(:, q)
          m%state(:, q) = self%stages%state(:, q)
        end do
      end do
      self%elastic%absent(stage%element) = .not. stage%place
    end associate
    call self%dofs%halo%add_in_order(gone)
    self%stages%done = k
    call hide_absent(self)
    call self%assemble()
    self%accepted_energy%load = self%accepted_energy%load - gone(1)
    self%loads%load(self%stages%load)%force = 0.0_wp
    call self%trial_force(self%accepted%u, internal)
    call self%matter%reject()
    call self%external_at(self%accepted%time, external)
    call self%follow(self%accepted%time, self%accepted%u, external)
    internal = merge(0.0_wp, internal - external, self%supports%held .or. self%port%prescribed)
    self%loads%load(self%stages%load)%force = internal
    self%accepted%external = external + internal
    where (self%port%prescribed) self%accepted%reaction = 0.0_wp
    call set_release(self, self%stages%stage(k)%time, self%stages%stage(k)%duration)
  end subroutine change

  !> The release decreases from 1 at its start to 0 at its end.
  subroutine set_release(self, time, duration)
    type(fem_body_type), intent(inout) :: self
    real(wp), intent(in) :: time, duration  !! [s]
    self%loads%curve(self%stages%curve)%time = [time, time + duration]
    self%loads%curve(self%stages%curve)%value = [1.0_wp, 0.0_wp]
  end subroutine set_release

  !> What is absent has no weight and no mass; where no element is left, nodes stay where they are.
  subroutine hide_absent(self)
    type(fem_body_type), intent(inout) :: self
    integer(i4) :: alone(self%dofs%blocks)
    integer(i4) :: e
    alone = 1
    do e = 1, self%mesh%elements
      associate (first => self%elastic%point(e), last => self%elastic%point(e + 1) - 1)
        self%elastic%factor(first:last) = merge(0.0_wp, 1.0_wp, self%elastic%absent(e))
      end associate
      self%elastic%density(e) = merge(0.0_wp, self%stages%density(e), self%elastic%absent(e))
      if (.not. self%elastic%absent(e)) &
        alone(self%dofs%block(self%dofs%start(e):self%dofs%start(e + 1) - 1)) = 0
    end do
    call self%dofs%halo%least_numbers(alone)
    call self%port%fix_at(spread(alone > 0, 1, 3), self%accepted%u)
    call self%system%forget_numbers()
  end subroutine hide_absent

  !> Where the stages are, to a checkpoint.
  subroutine put_stages(self, file, errors)
    type(fem_body_type), intent(in) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call file%put('/state/stages', [real(self%stages%done, wp), &
                                    self%loads%curve(self%stages%curve)%time], errors)
    call file%put('/state/release', self%loads%load(self%stages%load)%force, errors)
  end subroutine put_stages

  !> And back; the body is assembled again.
  subroutine get_stages(self, file, errors)
    type(fem_body_type), intent(inout) :: self
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: values(:), release(:, :)
    integer(i4) :: k
    call get_shaped(file, '/state/stages', 3, values, errors)
    call get_shaped(file, '/state/release', shape(self%loads%load(self%stages%load)%force), &
                    release, errors)
    if (errors%any()) return
    if (.not. (values(1) >= 0.0_wp .and. values(1) <= size(self%stages%stage))) then
      call errors%add('I306', 'the checkpoint counts '//str(values(1))//' of '// &
                      str(size(self%stages%stage))//' stages', file%path//':/state/stages', &
                      'use an older checkpoint, or start from the beginning')
      return
    end if
    self%stages%done = nint(values(1), i4)
    do k = 1, self%stages%done
      associate (stage => self%stages%stage(k))
        self%elastic%absent(stage%element) = .not. stage%place
      end associate
    end do
    call hide_absent(self)
    call self%assemble()
    self%loads%load(self%stages%load)%force = release
    call set_release(self, values(2), values(3) - values(2))
  end subroutine get_stages
end module fem_staging
