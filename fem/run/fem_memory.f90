!> Memory that a deck takes, for --check: what the check itself has had, or what it has now and a
!! run adds. Factors are counted after MUMPS' symbolic analysis, levels of multigrid and the
!! fields of steps by measured rules (manual, Ranks); nothing is factored for it.
module fem_memory
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_log, only: short_number
  use talus_memory_text, only: foretold_type, text_of_ranks
  use talus_system, only: memory_most, memory_resident
  use fem_model, only: fem_model_type
  use fem_setup_solver, only: choose_solver
  implicit none
  private
  public :: foretell_memory

  real(wp), parameter :: mebibyte = 1048576.0_wp
  !> Of each block of three unknowns [byte]: in a step, for output, for messages of a coupled run.
  real(wp), parameter :: in_step = 100.0_wp, for_output = 700.0_wp, at_port = 400.0_wp

contains

  !> Of a run of the model that was prepared; ranks that do not lead are told nothing.
  subroutine foretell_memory(model, foretold)
    type(fem_model_type), intent(inout) :: model
    type(foretold_type), intent(out) :: foretold
    real(wp), allocatable :: all(:, :)
    real(wp) :: own

    own = memory_of_rank(model)/mebibyte
    foretold%entities = model%body%mesh%total_nodes()
    foretold%most = [own]
    foretold%text = 'memory: '//short_number(own)//' MiB at most'
    if (.not. model%ranks%several()) return
    call model%ranks%collect([own], all)
    foretold%most = all(1, :)
    if (model%ranks%leads()) foretold%text = text_of_ranks(foretold%most)
  end subroutine foretell_memory

  !> Of this rank [byte].
  real(wp) function memory_of_rank(model)
    type(fem_model_type), intent(inout) :: model
    type(error_list_type) :: ignored  ! the run will report them
    real(wp), parameter :: block = 72.0_wp
    real(wp) :: lasting, passing, fields  ! beside what there is now
    lasting = 0.0_wp
    passing = 0.0_wp
    associate (body => model%body, system => model%body%system)
      if (.not. body%scheme%explicit .and. system%factored_dt < 0.0_wp) then
        call choose_solver(model%deck, body, model%analysis, model%served, model%auto_solver)
        if (.not. (system%fresh_numbering .or. system%solver%mumps%analysed)) &
          call body%number_free(ignored)
        lasting = system%solver%foretold(system%pattern)
        if (.not. body%matter%active) passing = block*size(system%pattern%column)  ! a copy of K
      end if
      if (model%served) lasting = lasting + at_port*body%dofs%blocks
      fields = in_step + merge(for_output, 0.0_wp, model%deck%count('output') > 0)
      fields = fields*body%dofs%blocks
    end associate
    memory_of_rank = max(real(memory_most(), wp), memory_resident() + lasting &
      + max(passing, fields))
  end function memory_of_rank
end module fem_memory
