!> The only interface to MUMPS (5.5): factors that are kept, of symmetric positive definite
!! matrices or of general ones, in memory or on disk.
!!
!! The order comes from METIS through PERM_IN (Debian's MUMPS has none inside). MPI is started
!! with the first factorisation, if any. With several ranks each
!! gives the entries of its own elements, the leader the order; right-hand sides and solutions are
!! the same on all. Ranks that factor together add up what comes first, so that their last bits are
!! not those of another run; the leader alone repeats itself.
module fem_mumps
  use talus_kinds, only: wp, i4, i8
  use talus_errors, only: error_list_type
  use talus_system, only: memory_free
  use talus_text, only: str
  use talus_ranks, only: ranks_type, start_mpi
  implicit none
  private
  public :: mumps_type, storage_auto, storage_memory, storage_disk

  include 'dmumps_struc.h'

  integer(i4), parameter :: spd = 1, unsymmetric = 0, symmetric = 2
  integer(i4), parameter :: given_order = 1, distributed = 3
  integer(i4), parameter :: storage_auto = 0, storage_memory = 1, storage_disk = 2
  real(wp), parameter :: usable = 0.9_wp   !! share of the free memory that factors may use
  real(wp), parameter :: mega = 1.0e6_wp
  integer(i4), parameter :: least_split = 9        !! KEEP: least order of fronts shared by ranks
  integer(i4), parameter :: never = 1000000000
  real(wp), parameter :: large_root = 4000.0_wp     !! order from which on ScaLAPACK is slow
  real(wp), parameter :: root_share = 0.8_wp        !! of the guess that counts as the root
  integer(i4), parameter :: extra_space = 30, most_space = 200  !! ICNTL(14) [%]

  !> One matrix with its factors.
  type :: mumps_type
    logical :: general = .false.         !! not symmetric: all entries are given, not one triangle
    logical :: indefinite = .false.      !! negative pivots are no fault
    logical :: pivoting = .false.        !! symmetric, with pivots of 1 x 1 and 2 x 2
    integer(i4) :: storage = storage_auto
    character(len=:), allocatable :: scratch  !! folder of factors on disk
    logical :: on_disk = .false.         !! the factors are
    logical :: analysed = .false., factored = .false.
    integer(i4) :: n = 0                 !! order of the matrix
    integer(i8) :: entries = 0           !! in the factors
    real(wp) :: flops = 0.0_wp           !! of the factorisation
    integer(i4) :: memory = 0            !! [MB]
    type(ranks_type) :: ranks        !! that share the matrix
    logical :: by_leader = .false.   !! who factors and solves alone
    type(ranks_type), private :: crew    !! that factor and solve
    type(dmumps_struc), allocatable, private :: id
  contains
    procedure :: analyse
    procedure :: factor
    procedure :: solve
    procedure :: foretold
    procedure :: free
  end type mumps_type

contains

  !> Symbolic analysis for rows irn(:), columns jcn(:) of one triangle (or of all of a general
  !! matrix) and a given order; with ranks the entries are those of this one, the order is the
  !! leader's.
  subroutine analyse(self, n, irn, jcn, order, errors)
    class(mumps_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    integer(i4), intent(in) :: irn(:), jcn(:)
    integer(i4), intent(in) :: order(:)  !! (n) position of each row in the elimination
    type(error_list_type), intent(inout) :: errors
    type(ranks_type) :: nobody
    real(wp), allocatable :: own(:, :), pairs(:, :)

    self%by_leader = self%by_leader .and. self%ranks%several()
    self%crew = self%ranks
    if (.not. self%by_leader) then
      call analyse_here(self, n, irn, jcn, order, errors)
      return
    end if
    self%crew = nobody
    self%n = n
    allocate (own(2, size(irn)))
    own(1, :) = irn
    own(2, :) = jcn
    call self%ranks%collect_columns(own, pairs)
    if (self%ranks%leads()) call analyse_here(self, n, nint(pairs(1, :), i4), &
                                              nint(pairs(2, :), i4), order, errors)
    call self%ranks%agree(errors)
    self%analysed = .not. errors%any()
  end subroutine analyse

  !> The same by those that factor.
  subroutine analyse_here(self, n, irn, jcn, order, errors)
    class(mumps_type), intent(inout) :: self
    integer(i4), intent(in) :: n
    integer(i4), intent(in) :: irn(:), jcn(:)
    integer(i4), intent(in) :: order(:)
    type(error_list_type), intent(inout) :: errors

    call self%free()
    call start_mpi()
    allocate (self%id)
    self%n = n
    self%id%comm = self%crew%comm
    self%id%sym = merge(unsymmetric, merge(symmetric, spd, self%pivoting), self%general)
    self%id%par = 1
    self%id%job = -1
    call dmumps(self%id)
    self%id%icntl(1:3) = -1
    self%id%icntl(4) = 0
    self%id%icntl(6) = 0  ! no permutation by values: the analysis serves many
    self%id%icntl(7) = given_order
    self%id%icntl(14) = extra_space
    self%id%icntl(28) = 1
    self%id%n = n
    call give_pattern(self, irn, jcn)
    if (self%crew%ranks == 2) call share_root(self)
    if (self%crew%leads()) then
      allocate (self%id%perm_in(n), self%id%rhs(n))
      self%id%perm_in = order
    end if
    self%id%job = 1
    call dmumps(self%id)
    if (self%id%infog(1) < 0) then
      call translate(self, 'the symbolic analysis', errors)
    else if (self%id%infog(7) /= given_order) then
      call errors%add('S302', 'MUMPS did not accept the order of METIS (INFOG(7) = ' &
                      //str(self%id%infog(7))//')', hint='install another build of MUMPS 5')
    end if
    self%analysed = self%id%infog(1) >= 0
  end subroutine analyse_here

  !> Rows and columns of the entries that this rank has.
  subroutine give_pattern(self, irn, jcn)
    class(mumps_type), intent(inout) :: self
    integer(i4), intent(in) :: irn(:), jcn(:)
    if (self%crew%several()) then
      self%id%icntl(18) = distributed
      self%id%nnz_loc = size(irn, kind=i8)
      allocate (self%id%irn_loc(size(irn)), self%id%jcn_loc(size(irn)), self%id%a_loc(size(irn)))
      self%id%irn_loc = irn
      self%id%jcn_loc = jcn
      return
    end if
    self%id%nnz = size(irn, kind=i8)
    allocate (self%id%irn(size(irn)), self%id%jcn(size(irn)), self%id%a(size(irn)))
    self%id%irn = irn
    self%id%jcn = jcn
  end subroutine give_pattern

  !> Two ranks factor a half of the tree, and they share its root alone, by ScaLAPACK as long
  !! as it is small: 0.55 of the time of one rank for 30^3 hexahedra, where MUMPS' own choice (many
  !! shared fronts) needs 0.63, and 0.6 instead of 0.68 for 40^3. The root is guessed from the
  !! section through the middle of a cube.
  subroutine share_root(self)
    class(mumps_type), intent(inout) :: self
    real(wp) :: root
    root = 3.0_wp*(real(self%n, wp)/3.0_wp)**(2.0_wp/3.0_wp)
    if (root < large_root) then
      self%id%keep(least_split) = never
    else
      self%id%icntl(13) = 1
      self%id%keep(least_split) = nint(root_share*root, i4)
    end if
  end subroutine share_root

  !> Numerical factorisation of the values a(:) in the order of irn and jcn.
  subroutine factor(self, a, errors)
    class(mumps_type), intent(inout) :: self
    real(wp), intent(in) :: a(:)
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: own(:, :), all(:, :)
    integer(i4) :: done(1)

    if (.not. self%analysed) error stop 'bug: factorisation before analysis'
    self%factored = .false.
    if (.not. self%by_leader) then
      call factor_here(self, a, errors)
      return
    end if
    allocate (own(1, size(a)))
    own(1, :) = a
    call self%ranks%collect_columns(own, all)
    if (self%ranks%leads()) call factor_here(self, all(1, :), errors)
    call self%ranks%agree(errors)
    done = merge(1_i4, 0_i4, self%factored)
    call self%ranks%broadcast_numbers(done)
    self%factored = done(1) > 0
  end subroutine factor

  !> The same by those that factor.
  subroutine factor_here(self, a, errors)
    class(mumps_type), intent(inout) :: self
    real(wp), intent(in) :: a(:)
    type(error_list_type), intent(inout) :: errors

    if (self%crew%several()) then
      self%id%a_loc = a
    else
      self%id%a = a
    end if
    call choose_storage(self)
    do
      self%id%job = 2
      call dmumps(self%id)
      select case (self%id%infog(1))
      case (-9)  ! its estimate of the workspace was too small
        if (self%id%icntl(14) >= most_space) exit
        self%id%icntl(14) = 2*self%id%icntl(14)
      case (-13)
        if (self%on_disk .or. self%storage /= storage_auto) exit
        call use_disk(self)
      case default
        exit
      end select
    end do
    if (self%id%infog(1) < 0) then
      call translate(self, 'the factorisation', errors)
      return
    end if
    self%factored = .true.
    if (self%id%infog(12) > 0 .and. .not. (self%general .or. self%indefinite)) then
      call errors%add('N302', 'the stiffness has '//str(self%id%infog(12))// &
        ' negative pivots: it is not positive definite', hint='check supports, moduli and the mesh')
      return
    end if
    self%flops = self%id%rinfog(3)
    self%memory = self%id%infog(19)
    self%entries = self%id%infog(9)
    if (self%entries < 0) self%entries = -self%entries*1000000_i8
  end subroutine factor_here

  !> Memory that the factors and the work on them will take on this rank [byte], once analysed:
  !! MUMPS' estimate (INFO(15), on disk INFO(17)) without the extra space, of which nothing is
  !! touched as a rule; 0 on ranks that do not factor.
  real(wp) function foretold(self)
    class(mumps_type), intent(inout) :: self
    foretold = 0.0_wp
    if (.not. (self%analysed .and. allocated(self%id))) return
    call choose_storage(self)
    foretold = mega*real(self%id%info(merge(17, 15, self%on_disk)), wp) &
      /(1.0_wp + real(extra_space, wp)/100.0_wp)
  end function foretold

  !> On disk if the deck requires it, or if it leaves the choice and memory is short.
  subroutine choose_storage(self)
    class(mumps_type), intent(inout) :: self
    real(wp) :: free
    logical :: short
    self%on_disk = .false.
    self%id%icntl(22) = 0
    free = real(memory_free(), wp)/mega
    if (self%storage == storage_disk) call use_disk(self)
    short = free > 0.0_wp .and. real(self%id%infog(16), wp)*self%crew%on_host > usable*free
    call self%crew%any_of(short)
    if (self%storage == storage_auto .and. short) call use_disk(self)
  end subroutine choose_storage

  subroutine use_disk(self)
    class(mumps_type), intent(inout) :: self
    self%on_disk = .true.
    self%id%icntl(22) = 1
    self%id%ooc_tmpdir = '/tmp'
    if (allocated(self%scratch)) self%id%ooc_tmpdir = self%scratch
    self%id%ooc_prefix = 'talus-factors-'
  end subroutine use_disk

  !> Solve in place for one right-hand side b(n), the same on all ranks.
  subroutine solve(self, b, errors)
    class(mumps_type), intent(inout) :: self
    real(wp), intent(inout) :: b(:)
    type(error_list_type), intent(inout) :: errors

    if (.not. self%factored) error stop 'bug: solution before factorisation'
    if (.not. self%by_leader) then
      call solve_here(self, b, errors)
      return
    end if
    if (self%ranks%leads()) call solve_here(self, b, errors)
    call self%ranks%agree(errors)
    if (.not. errors%any()) call self%ranks%broadcast_values(b)
  end subroutine solve

  !> The same by those that factor.
  subroutine solve_here(self, b, errors)
    class(mumps_type), intent(inout) :: self
    real(wp), intent(inout) :: b(:)
    type(error_list_type), intent(inout) :: errors

    if (self%crew%leads()) self%id%rhs = b
    self%id%nrhs = 1
    self%id%lrhs = self%n
    self%id%job = 3
    call dmumps(self%id)
    if (self%id%infog(1) < 0) then
      call translate(self, 'the solution', errors)
      return
    end if
    if (self%crew%leads()) b = self%id%rhs
    call self%crew%broadcast_values(b)
  end subroutine solve_here

  !> Release the factors.
  subroutine free(self)
    class(mumps_type), intent(inout) :: self
    self%analysed = .false.
    self%factored = .false.
    if (.not. allocated(self%id)) return
    if (associated(self%id%irn)) deallocate (self%id%irn, self%id%jcn, self%id%a)
    if (associated(self%id%irn_loc)) &
      deallocate (self%id%irn_loc, self%id%jcn_loc, self%id%a_loc)
    if (associated(self%id%perm_in)) deallocate (self%id%perm_in, self%id%rhs)
    self%id%job = -2
    call dmumps(self%id)
    deallocate (self%id)
  end subroutine free

  !> MUMPS' error codes in words, with remedies.
  subroutine translate(self, where, errors)
    class(mumps_type), intent(in) :: self
    character(len=*), intent(in) :: where
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: hint, mumps
    integer(i4) :: detail

    detail = self%id%infog(2)
    mumps = ' (MUMPS '//str(self%id%infog(1))//', '//str(detail)//')'
    select case (self%id%infog(1))
    case (-7, -8, -9, -13, -19)
      hint = "factors = 'disk' needs "//str(self%id%infog(26))//" MB, solver = 'multigrid' in "// &
             'statics even less; or use a smaller mesh'
      if (self%on_disk) hint = "solver = 'multigrid' in statics needs less; or take a smaller mesh"
      call errors%add('S303', 'not enough memory for '//where//mumps//': about '// &
        str(self%id%infog(merge(26, 16, self%on_disk)))//' MB are needed, '// &
        str(int(memory_free()/int(mega, i8), i4))//' MB are free', hint=hint)
    case (-90)
      call errors%add('S305', 'the factors cannot be put on disk'//mumps, &
        trim(self%id%ooc_tmpdir), 'is it a folder with space for '//str(self%id%infog(16))// &
        ' MB? `scratch` in &analysis names another')
    case (-6, -10, -40)
      call errors%add('N301', 'the stiffness is singular in '//where//mumps, &
                      hint='is every part of the body supported?')
    case default
      call errors%add('S304', where//' failed'//mumps, &
                      hint='MUMPS users'' guide, section on error codes')
    end select
  end subroutine translate
end module fem_mumps
