!> Moduli of a pack by small strains: group &probe (theory-dem, "Probed moduli").
!!
!! From the last state of a run, which must be at rest, the cell is strained by each of the six
!! components, to one or to both sides, the grains find their new equilibrium, and the change of the
!! stress of all contacts over the strain is a column of the stiffness. All is done on copies: the
!! state of the run stays as it was.
!!
!! Faults: D269 the deck, N222 the pack is not at rest, N223 a probe does not come to rest.
!! eq. D.10
module dem_probe
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_history, only: history_type
  use talus_homogenise, only: branch_inside
  use talus_log, only: log_type, short_number
  use talus_moduli, only: affine_moduli
  use talus_region, only: region_type, region_cell
  use talus_sample, only: sample_type
  use talus_stiffness, only: six_by_six, fit_isotropic, fit_type, six_of, pairs_of_six
  use talus_summary, only: summary_type
  use dem_cell, only: cell_volume
  use dem_equilibrium, only: mean_unbalanced
  use dem_cell_stress, only: cell_stress
  use dem_sample, only: fill_sample
  use dem_state, only: dem_data_type, copy_data, keep_data
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  private
  public :: dem_probe_type

  integer(i4), parameter :: check_interval = 10, check_updates = 10
  character(len=2), parameter :: six(6) = ['xx', 'yy', 'zz', 'yz', 'zx', 'xy']

  type :: dem_probe_type
    logical :: wanted = .false.
    real(wp) :: strain = 0.0_wp          !! [-]
    real(wp) :: unbalanced = 0.0_wp      !! of the pack that is still at rest [-]
    real(wp) :: energy_ratio = 0.0_wp    !! of the pack that is still at rest [-]
    real(wp) :: accuracy = 0.0_wp        !! unbalanced force over the mean change of forces [-]
    integer(i4) :: load_steps = 0        !! over which the strain is put on
    integer(i4) :: most_steps = 0        !! to come to rest
    logical :: both = .true.             !! strain to both sides
    logical :: done = .false.
    real(wp) :: limit = 0.0_wp           !! unbalanced force at which a probe is at rest [-]
    real(wp) :: sigma(3, 3) = 0.0_wp     !! before the probes [Pa]
    real(wp) :: volume = 0.0_wp          !! of the cell [m^3]
    real(wp) :: probed(6, 6) = 0.0_wp    !! [Pa]
    real(wp) :: affine(6, 6) = 0.0_wp    !! [Pa]
    real(wp) :: one_sided = 0.0_wp       !! largest difference of both sides over the larger one [-]
    integer(i4) :: steps = 0             !! of all probes
  contains
    procedure :: read => read_probe
    procedure :: run => run_probes
    procedure :: write => write_probe
    procedure, private :: check_rest
    procedure, private :: relax
    procedure, private :: strain_by
    procedure, private :: put_affine
  end type dem_probe_type

contains

  !> Group probe; there must be a cell to strain (D269).
  subroutine read_probe(self, deck, d, errors)
    class(dem_probe_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    type(dem_data_type), intent(in) :: d
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: sides

    self%wanted = deck%count('probe') > 0
    if (.not. self%wanted) return
    call deck%get('probe', 1, 'strain', self%strain)
    call deck%get('probe', 1, 'unbalanced', self%unbalanced)
    call deck%get('probe', 1, 'energy_ratio', self%energy_ratio)
    call deck%get('probe', 1, 'accuracy', self%accuracy)
    call deck%get('probe', 1, 'load_steps', self%load_steps)
    call deck%get('probe', 1, 'most_steps', self%most_steps)
    call deck%get('probe', 1, 'sides', sides)
    self%both = sides == 'both'
    if (sides == 'shorter') self%strain = -self%strain
    if (.not. d%cell%active) then
      call deck%fault(errors, 'D269', 'there is no cell to probe', 'probe', 1, '', &
                      "add &cell /; for a pack between fixed grains &cell periodic = 'none', ... /")
    else if (any(d%cell%periodic) .and. .not. all(d%cell%periodic)) then
      call deck%fault(errors, 'D269', 'a cell between walls cannot be strained in all '// &
                      'components', 'probe', 1, '', "periodic = 'a', 'b', 'c' or 'none'")
    else if (d%planes%n > 0) then
      call deck%fault(errors, 'D269', 'walls do not follow the strain of a probe', 'probe', 1, '', &
                      'cut the pack from the box, with its outer grains fixed')
    end if
  end subroutine read_probe

  !> All probes of the present state, which is left as it was.
  subroutine run_probes(self, system, place, errors)
    class(dem_probe_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    class(dem_data_type), allocatable :: kept, still
    real(wp) :: sigma(3, 3, 2), stiffness(10)
    integer(i4) :: k, side

    call self%check_rest(system, place, errors)
    if (errors%any()) return
    call keep_data(system%dem_data_type, kept)
    system%cell%rate = 0.0_wp
    system%par%damping = 0.0_wp
    system%par%full_damping = .false.
    call self%relax(system, 'before the probes', place, errors)
    call keep_data(system%dem_data_type, still)
    call cell_stress(still, self%sigma, stiffness)
    self%volume = cell_volume(still%cell)
    call self%put_affine(system, errors)
    do k = 1, 6
      do side = 1, merge(2, 1, self%both)
        if (errors%any()) exit
        call copy_data(still, system%dem_data_type)
        call system%begin_anew()
        call self%strain_by(system, k, merge(self%strain, -self%strain, side == 1), errors)
        call self%relax(system, "probe '"//six(k)//"'", place, errors)
        call cell_stress(system%dem_data_type, sigma(:, :, side), stiffness)
      end do
      if (errors%any()) exit
      if (.not. self%both) sigma(:, :, 2) = 2.0_wp*self%sigma - sigma(:, :, 1)
      self%probed(:, k) = six_of(sigma(:, :, 1) - sigma(:, :, 2))/(2.0_wp*self%strain)
      self%one_sided = max(self%one_sided, &
                           maxval(abs(sigma(:, :, 1) + sigma(:, :, 2) - 2.0_wp*self%sigma)) &
                           /max(maxval(abs(sigma(:, :, 1) - sigma(:, :, 2))), tiny(1.0_wp)))
    end do
    call copy_data(kept, system%dem_data_type)
    call system%begin_anew()
    self%done = .not. errors%any()
  end subroutine run_probes

  !> Only a pack at rest has moduli (N222).
  subroutine check_rest(self, system, place, errors)
    class(dem_probe_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    character(len=*), intent(in) :: place
    type(error_list_type), intent(inout) :: errors
    real(wp) :: unbalanced, elastic, sigma(3, 3), stiffness(10), pressure

    call cell_stress(system%dem_data_type, sigma, stiffness)
    call system%refresh_ledger()
    elastic = system%ledger%elastic_normal + system%ledger%elastic_tangential
    if (.not. elastic > 0.0_wp) then
      call errors%add('N222', 'the pack cannot be probed: its grains do not touch', place, &
                      'compress it first, with &cell_stress and &equilibrium')
      return
    end if
    unbalanced = mean_unbalanced(system)
    if (unbalanced > self%unbalanced .or. system%ledger%kinetic > self%energy_ratio*elastic) then
      call errors%add('N222', 'the pack cannot be probed, it is not in equilibrium: unbalanced '// &
                      'force '//short_number(unbalanced)//' of the mean contact force (limit '// &
                      short_number(self%unbalanced)//'), kinetic energy '// &
                      short_number(system%ledger%kinetic/elastic)//' of the elastic (limit '// &
                      short_number(self%energy_ratio)//')', place, &
                      'bring it to rest with &equilibrium, or relax the limits of &probe')
      return
    end if
    pressure = max(-(sigma(1, 1) + sigma(2, 2) + sigma(3, 3))/3.0_wp, tiny(1.0_wp))
    self%limit = self%accuracy*abs(self%strain)*stiffness(10)/pressure
  end subroutine check_rest

  !> Stop every grain that slows down until the forces left are small against their change by a
  !! probe (N223).
  subroutine relax(self, system, what, place, errors)
    class(dem_probe_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    character(len=*), intent(in) :: what, place
    type(error_list_type), intent(inout) :: errors
    real(wp) :: unbalanced
    integer(i4) :: k, n

    call system%gather()
    if (allocated(system%seen_kinetic)) system%seen_kinetic = 0.0_wp
    call system%begin_anew()
    do n = check_interval*check_updates, self%most_steps, check_interval*check_updates
      do k = 1, check_updates
        call system%step(check_interval, errors)
        if (errors%any()) return
        call system%slow_down()
      end do
      self%steps = self%steps + check_interval*check_updates
      call system%gather()
      unbalanced = mean_unbalanced(system)
      if (unbalanced <= self%limit) return
    end do
    call errors%add('N223', what//': the grains do not come to rest within '// &
                    str(self%most_steps)//' steps: unbalanced force '//short_number(unbalanced)// &
                    ' of the mean contact force instead of '//short_number(self%limit), place, &
                    'raise most_steps, strain or accuracy of &probe, or begin with a pack that '// &
                    'is closer to rest')
  end subroutine relax

  !> Put a strain on, over some steps.
  subroutine strain_by(self, system, k, strain, errors)
    class(dem_probe_type), intent(inout) :: self
    type(dem_system_type), intent(inout) :: system
    integer(i4), intent(in) :: k         !! component
    real(wp), intent(in) :: strain       !! of a shear: the change of the angle
    type(error_list_type), intent(inout) :: errors
    real(wp) :: rate

    rate = strain/(self%load_steps*system%par%dt)
    system%cell%rate = 0.0_wp
    associate (pair => pairs_of_six(:, k), l => system%cell%rate)
      l(pair(1), pair(2)) = l(pair(1), pair(2)) + 0.5_wp*rate
      l(pair(2), pair(1)) = l(pair(2), pair(1)) + 0.5_wp*rate
    end associate
    call system%step(self%load_steps, errors)
    system%cell%rate = 0.0_wp
    self%steps = self%steps + self%load_steps
  end subroutine strain_by

  !> Moduli that the contacts would have if all grains followed the strain.
  subroutine put_affine(self, system, errors)
    class(dem_probe_type), intent(inout) :: self
    type(dem_system_type), intent(in) :: system
    type(error_list_type), intent(inout) :: errors
    type(dem_contacts_type) :: list
    type(sample_type) :: sample
    type(region_type) :: region
    real(wp), allocatable :: branch(:, :)
    real(wp) :: c9(9, 9), b9(9, 9), d9(9, 9)
    integer(i4) :: c

    if (errors%any()) return
    call system%contacts(list)
    call fill_sample(system, list, sample, errors)
    if (errors%any()) return
    region%kind = region_cell
    allocate (branch(3, sample%contacts))
    do c = 1, sample%contacts
      branch(:, c) = branch_inside(sample, region, c)
    end do
    call affine_moduli(sample, branch, cell_volume(system%cell), c9, b9, d9)
    self%affine = six_by_six(c9)
  end subroutine put_affine

  !> Log, <stem>_probe.json and <stem>_probe.csv.
  subroutine write_probe(self, stem, program, deck, time, log, errors)
    class(dem_probe_type), intent(in) :: self
    character(len=*), intent(in) :: stem, program
    type(deck_type), intent(in) :: deck
    real(wp), intent(in) :: time  !! [s]
    type(log_type), intent(inout) :: log
    type(error_list_type), intent(inout) :: errors
    type(summary_type) :: file
    type(fit_type) :: fit

    if (.not. self%done) return
    fit = fit_isotropic(self%probed)
    call log%section('Probed moduli')
    call log_fit(log, 'probed', fit)
    call log_fit(log, 'affine sum', fit_isotropic(self%affine))
    call log%item('probes', str(self%steps)//' steps', 'strain '//short_number(self%strain)// &
                  ', sides differ by '//short_number(self%one_sided))
    call file%set_program(program, deck%source%path, deck%hash())
    call file%set('format', 'talus-probe')
    call file%set('format_version', 1_i4)
    call file%set('time_s', time)
    call file%set('strain', self%strain)
    call file%set('both_sides', self%both)
    call file%set('steps', self%steps)
    call file%set('sides_differ', self%one_sided)
    call file%set('volume_m3', self%volume)
    call file%set('stress_Pa', six_of(self%sigma))
    call file%set('pressure_Pa', -sum([self%sigma(1, 1), self%sigma(2, 2), self%sigma(3, 3)]) &
                  /3.0_wp)
    call put_fit(file, 'probed', self%probed)
    call put_fit(file, 'affine', self%affine)
    call file%write(stem//'_probe.json', errors)
    call write_rows(self, stem//'_probe.csv', errors)
  end subroutine write_probe

  subroutine log_fit(log, name, fit)
    type(log_type), intent(inout) :: log
    character(len=*), intent(in) :: name
    type(fit_type), intent(in) :: fit
    call log%item(name, 'K '//short_number(fit%bulk)//' Pa, G '//short_number(fit%shear)//' Pa', &
                  'E '//short_number(fit%young)//' Pa, nu '//short_number(fit%poisson)// &
                  ', misfit '//short_number(fit%misfit)//', asymmetry '// &
                  short_number(fit%asymmetry))
  end subroutine log_fit

  !> A stiffness, row by row, and its isotropic part.
  subroutine put_fit(file, name, c6)
    type(summary_type), intent(inout) :: file
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: c6(6, 6)
    type(fit_type) :: fit
    integer(i4) :: k
    fit = fit_isotropic(c6)
    call file%set(name//'.bulk_Pa', fit%bulk)
    call file%set(name//'.shear_Pa', fit%shear)
    call file%set(name//'.lambda_Pa', fit%lambda)
    call file%set(name//'.young_Pa', fit%young)
    call file%set(name//'.poisson', fit%poisson)
    call file%set(name//'.misfit', fit%misfit)
    call file%set(name//'.asymmetry', fit%asymmetry)
    do k = 1, 6
      call file%set(name//'.stiffness_Pa.'//six(k), c6(k, :))
    end do
  end subroutine put_fit

  !> One row a component of the stress.
  subroutine write_rows(self, path, errors)
    class(dem_probe_type), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(history_type) :: table
    type(string_type) :: names(13)
    integer(i4) :: k

    names(1)%s = 'row [-]'
    do k = 1, 6
      names(1 + k)%s = 'probed_'//six(k)//' [Pa]'
      names(7 + k)%s = 'affine_'//six(k)//' [Pa]'
    end do
    call table%open(path, names, .false., errors)
    do k = 1, 6
      call table%write([real(k, wp), self%probed(k, :), self%affine(k, :)], errors)
    end do
    call table%close(errors)
  end subroutine write_rows
end module dem_probe
