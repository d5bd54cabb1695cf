!> The one-point driver: a material without mesh and equilibrium. `talus-fem --point deck.nml`
!! writes <stem>_point.csv: a row for each &path state, or along &control rows (fem_point_path).
module fem_point
  use talus_kinds, only: wp, i4
  use talus_text, only: str, string_type, append_string
  use talus_errors, only: error_list_type
  use talus_options, only: options_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_files, only: make_folder, folder_of, run_stem
  use talus_curve, only: curve_type, read_curves
  use talus_history, only: history_type
  use fem_deck_keys, only: fem_deck_table
  use fem_mm_path, only: follow_micromorphic
  use fem_micropolar, only: micropolar_strain, micropolar_stress, axial
  use fem_law_polar, only: fem_law_polar_type
  use fem_point_path, only: follow_path
  use fem_point_polar, only: follow_polar
  use fem_setup_sections, only: read_material, fem_material_type, check_ids
  implicit none
  private
  public :: run_point

contains

  !> Read the deck, evaluate, write.
  subroutine run_point(options, errors)
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    type(key_table_type) :: table
    type(deck_type) :: deck
    type(fem_material_type), allocatable :: material(:)
    type(history_type) :: file
    character(len=:), allocatable :: stem
    integer(i4) :: k, m

    call point_table(table)
    call deck%read(options%deck, table, errors)
    if (errors%any()) return
    if (deck%count('micro_point') + deck%count('micromorphic') > 0) then
      call run_micromorphic(deck, options, errors)
      return
    end if
    call check_ids(deck, 'material', errors)
    allocate (material(deck%count('material')))
    do k = 1, size(material)
      call read_material(deck, k, material(k), errors)
    end do
    if (deck%count('path') + deck%count('point') == 0) call errors%add('D332', &
      'the deck has neither &path nor &point', options%deck, 'a point needs states or a path')
    do k = 1, deck%count('path')
      call find_material(deck, 'path', k, material, m, errors)
      if (m <= size(material)) call refuse_state(deck, k, material(m), errors)
    end do
    if (errors%any()) return
    stem = run_stem(options%deck, options%output_dir)
    if (.not. options%check) call make_folder(folder_of(stem), errors)
    if (deck%count('point') > 0 .and. .not. errors%any()) &
      call run_control(deck, material, stem//'_point.csv', options%check, errors)
    if (errors%any() .or. options%check .or. deck%count('path') == 0) return
    call open_table(file, stem//'_point.csv', errors)
    do k = 1, deck%count('path')
      call find_material(deck, 'path', k, material, m, errors)
      call write_state(deck, k, material(m), file, errors)
    end do
    call file%close(errors)
  end subroutine run_point

  !> A micromorphic point has groups of its own.
  subroutine run_micromorphic(deck, options, errors)
    type(deck_type), intent(in) :: deck
    type(options_type), intent(in) :: options
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: stem
    if (deck%count('path') + deck%count('point') > 0 .or. deck%count('micro_point') == 0 .or. &
        deck%count('micromorphic') == 0) then
      call errors%add('D352', 'a micromorphic point needs &micromorphic and &micro_point, and '// &
        'no &path and no &point', options%deck, 'tables have one name: use two decks')
      return
    end if
    stem = run_stem(options%deck, options%output_dir)
    if (.not. options%check) call make_folder(folder_of(stem), errors)
    if (errors%any()) return
    call follow_micromorphic(deck, stem//'_point.csv', options%check, errors)
  end subroutine run_micromorphic

  !> The table of decks, of which a point needs neither mesh nor sections nor an analysis.
  subroutine point_table(table)
    type(key_table_type), intent(inout) :: table
    character(len=*), parameter :: spare(4) = [character(len=8) :: 'mesh', 'section', &
      'analysis', 'material']
    integer(i4) :: k
    call fem_deck_table(table)
    do k = 1, table%group_count
      if (any(spare == table%group(k)%name)) table%group(k)%required = .false.
    end do
  end subroutine point_table

  !> A law with a state needs a path.
  subroutine refuse_state(deck, k, material, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_material_type), intent(in) :: material
    type(error_list_type), intent(inout) :: errors
    if (material%stateful) call deck%fault(errors, 'D332', 'the material '//trim(material%id)// &
      ' has a state: single states of strain mean nothing to it', 'path', k, '', &
      'give &point and &control rows')
  end subroutine refuse_state

  !> The path of &point and &control rows.
  subroutine run_control(deck, material, path, check, errors)
    type(deck_type), intent(in) :: deck
    type(fem_material_type), intent(in) :: material(:)
    character(len=*), intent(in) :: path
    logical, intent(in) :: check
    type(error_list_type), intent(inout) :: errors
    type(curve_type), allocatable :: curve(:)
    integer(i4) :: m

    if (deck%count('path') > 0 .or. deck%count('point') > 1) then
      call deck%fault(errors, 'D332', 'the deck has more than one &point, or &path beside it', &
                      'point', 1, '', 'they make tables of one name: use two decks')
      return
    end if
    call find_material(deck, 'point', 1, material, m, errors)
    call read_curves(deck, 'D304', curve, errors)
    if (errors%any()) return
    if (material(m)%polar .and. .not. material(m)%stateful) then
      call deck%fault(errors, 'D332', 'a micropolar solid has &path states', 'point', 1, &
                      'material', 'it has no state')
      return
    end if
    select type (law => material(m)%law)
    class is (fem_law_polar_type)
      call follow_polar(deck, law, curve, path, check, errors)
    class default
      call follow_path(deck, law, curve, path, check, errors)
    end select
  end subroutine run_control

  !> Material that instance k of a group names, or the only one.
  subroutine find_material(deck, group, k, material, m, errors)
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: group
    integer(i4), intent(in) :: k
    type(fem_material_type), intent(in) :: material(:)
    integer(i4), intent(out) :: m
    type(error_list_type), intent(inout) :: errors
    character(len=:), allocatable :: id
    call deck%get(group, k, 'material', id)
    do m = 1, size(material)
      if (material(m)%id == id .or. (len(id) == 0 .and. size(material) == 1)) return
    end do
    call deck%fault(errors, 'D302', "there is no material '"//id//"'", group, k, 'material', &
                    'with several materials each &'//group//' names one')
  end subroutine find_material

  subroutine open_table(file, path, errors)
    type(history_type), intent(inout) :: file
    character(len=*), intent(in) :: path
    type(error_list_type), intent(inout) :: errors
    type(string_type), allocatable :: columns(:)
    character(len=2), parameter :: kl(9) = ['11', '12', '13', '21', '22', '23', '31', '32', '33']
    integer(i4) :: k

    call append_string(columns, 'state [-]')
    do k = 1, 9
      call append_string(columns, 'gamma '//kl(k)//' [-]')
    end do
    do k = 1, 9
      call append_string(columns, 'sigma '//kl(k)//' [Pa]')
    end do
    do k = 1, 9
      call append_string(columns, 'm '//kl(k)//' [N/m]')
    end do
    do k = 1, 3
      call append_string(columns, 'axial '//str(k)//' [Pa]')
    end do
    call append_string(columns, 'energy [J/m3]')
    call file%open(path, columns, .false., errors)
  end subroutine open_table

  subroutine write_state(deck, k, material, file, errors)
    type(deck_type), intent(in) :: deck
    integer(i4), intent(in) :: k
    type(fem_material_type), intent(in) :: material
    type(history_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    real(wp), allocatable :: gradient(:), rotation(:), curvature(:)
    real(wp) :: h(3, 3), c(3, 3), gamma(9), sigma(9), couple(9)

    call deck%get('path', k, 'gradient', gradient)
    call deck%get('path', k, 'rotation', rotation)
    call deck%get('path', k, 'rotation_gradient', curvature)
    h = transpose(reshape(gradient, [3, 3]))
    c = transpose(reshape(curvature, [3, 3]))
    if (.not. material%polar) rotation = 0.5_wp*[h(3, 2) - h(2, 3), h(1, 3) - h(3, 1), &
                                                 h(2, 1) - h(1, 2)]
    gamma = micropolar_strain(h, rotation)
    if (allocated(material%law%operator)) then
      sigma = matmul(material%law%operator(:, :, 1), gamma)
      couple = matmul(material%law%operator(:, :, 2), reshape(c, [9]))
    else
      call micropolar_stress(material%moduli, gamma, c, sigma, couple)
    end if
    call file%write([real(k, wp), gamma, sigma, couple, axial(sigma), &
                     0.5_wp*(sum(sigma*gamma) + sum(couple*reshape(c, [9])))], errors)
  end subroutine write_state
end module fem_point
