!> Values of one key against its definition: number, type, range, choice, file.
module talus_deck_values
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, str, lower
  use talus_suggest, only: nearest_name, did_you_mean
  use talus_files, only: plain_file
  use talus_deck_table, only: deck_group_type, deck_key_type, range_text, size_text
  use talus_deck_value, only: parse_real, parse_integer, parse_logical, value_good, &
    value_not_finite, value_too_large, value_is_real
  use talus_deck_source, only: deck_source_type
  use talus_deck_faults, only: deck_faults_type
  use talus_deck_tokens, only: token_type, token_text, token_string, token_word
  implicit none
  private
  public :: check_values, resolve_path, word_number

contains

  !> All values of a key. Faults: D014 to D019.
  subroutine check_values(source, group, key, values, name, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_group_type), intent(in) :: group
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: values(:), name
    type(deck_faults_type), intent(inout) :: faults
    integer(i4) :: k

    if (size(values) < key%least .or. size(values) > key%most) &
      call wrong_count(source, group, key, values, name, faults)
    do k = 1, min(size(values), key%most)
      select case (key%kind)
      case ('real', 'integer')
        call check_number(source, key, values(k), faults)
      case ('logical')
        call check_logical(source, key, values(k), faults)
      case default
        call check_string(source, key, values(k), faults)
      end select
    end do
  end subroutine check_values

  subroutine wrong_count(source, group, key, values, name, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_group_type), intent(in) :: group
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: values(:), name
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: message, hint
    type(string_type), allocatable :: names(:)
    type(token_type) :: place
    integer(i4) :: k

    message = key%name//' needs '//size_text(key)//', '
    hint = key%doc
    place = name
    if (size(values) == 0) then
      message = message//'none is given'
    else if (size(values) < key%least) then
      message = message//str(size(values))//trim(merge(' is ', ' are', size(values) == 1))//' given'
      do k = 1, size(values)
        if (values(k)%line == place%line) place%last = values(k)%last
      end do
    else
      message = message//str(size(values))//' are given'
      place = values(key%most + 1)
      if (place%kind == token_word) then
        call group%key_names(names)
        if (len(nearest_name(token_text(source, place), names)) > 0) &
          hint = 'is a ''='' missing after '''//token_text(source, place)//'''?'
      end if
    end if
    call faults%add(source, 'D015', message, place%line, place%first, place%last, hint)
  end subroutine wrong_count

  !> A real or an integer.
  subroutine check_number(source, key, token, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: text
    real(wp) :: value
    integer(i4) :: whole, status

    text = token_text(source, token)
    if (token%kind == token_string) then
      if (word_number(key, text) == 0) call quoted_number(source, key, token, faults)
      return
    end if
    if (key%kind == 'integer') then
      call parse_integer(text, whole, status)
      value = real(whole, wp)
    else
      call parse_real(text, value, status)
    end if
    select case (status)
    case (value_good)
      call check_range(source, key, token, value, faults)
    case (value_not_finite)
      call add_at(source, 'D019', key%name//' = '//text//' is no finite number', token, &
                  limits(key), faults)
    case (value_too_large)
      call add_at(source, 'D016', key%name//' = '//text//' is too large: '//trim(merge( &
        'integers end at 2147483647         ', 'no quantity of physics reaches 1e51', &
        key%kind == 'integer')), token, limits(key), faults)
    case (value_is_real)
      call add_at(source, 'D014', key%name//' needs an integer, '//text//' is a real number', &
                  token, limits(key), faults)
    case default
      call no_number(source, key, token, faults)
    end select
  end subroutine check_number

  !> A string where a number is wanted.
  subroutine quoted_number(source, key, token, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: text, hint
    real(wp) :: value
    integer(i4) :: status

    text = token_text(source, token)
    call parse_real(text, value, status)
    if (status == value_good) then
      hint = 'write the number without quotes: '//text
    else if (allocated(key%word)) then
      hint = did_you_mean(text, key%word, 'words that it accepts:')
    else
      hint = limits(key)
    end if
    call add_at(source, 'D014', key%name//' needs '//wanted(key)//', '//shown(source, token) &
                //' is a string', token, hint, faults)
  end subroutine quoted_number

  !> A word that is no number where a number is wanted.
  subroutine no_number(source, key, token, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: text, hint

    text = token_text(source, token)
    hint = 'numbers are written 1, 1.0 or 1.0e3'
    if (index(text, '*') > 0) hint = 'write every value out: 0.0, 0.0, 0.0'
    if (word_number(key, lower(text)) > 0) hint = 'put a word in quotes: '''//lower(text)//''''
    call add_at(source, 'D014', key%name//' needs '//wanted(key)//', '//text//' is none', token, &
                hint, faults)
  end subroutine no_number

  subroutine check_range(source, key, token, value, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    real(wp), intent(in) :: value
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: unit
    logical :: low, high, small, large

    low = value < key%low .or. (key%low_open .and. .not. value > key%low)
    high = value > key%high .or. (key%high_open .and. .not. value < key%high)
    if (low .or. high) call add_at(source, 'D016', key%name//' = '//token_text(source, token) &
                                   //' is out of range: it must be '//range_text(key), token, &
                                   key%doc, faults)
    small = abs(value) > 0.0_wp .and. abs(value) < key%smallest
    large = abs(value) > key%largest
    if (low .or. high .or. .not. (small .or. large)) return
    unit = 'numbers without a unit'
    if (len(key%unit) > 0) unit = 'quantities in '//key%unit
    if (small) unit = unit//' begin at '//str(key%smallest)
    if (large) unit = unit//' end at '//str(key%largest)
    call add_at(source, 'D016', key%name//' = '//token_text(source, token) &
                //' is out of range: '//unit, token, key%doc, faults)
  end subroutine check_range

  subroutine check_logical(source, key, token, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    logical :: value
    integer(i4) :: status

    call parse_logical(source%text(token%first:token%last), value, status)
    if (status /= value_good) call add_at(source, 'D014', key%name//' is a logical, ' &
                                          //shown(source, token)//' is none', token, &
                                          'write .true. or .false., without quotes', faults)
  end subroutine check_logical

  !> A string or the name of a file.
  subroutine check_string(source, key, token, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: text
    integer(i4) :: k

    text = token_text(source, token)
    if (token%kind /= token_string) then
      call add_at(source, 'D014', key%name//' needs a string, '//text//' is without quotes', &
                  token, 'write '''//text//''', with plain quotes', faults)
    else if (allocated(key%choice)) then
      do k = 1, size(key%choice)
        if (key%choice(k)%s == text) return
      end do
      if (allocated(key%old_choice)) then
        do k = 1, size(key%old_choice)
          if (key%old_choice(k)%s /= text) cycle
          call add_at(source, 'D023', key%name//' = '''//text//''' is now called ''' &
                      //key%new_choice(k)%s//'''', token, 'write '//key%name//' = ''' &
                      //key%new_choice(k)%s//'''', faults)
          return
        end do
      end if
      call add_at(source, 'D017', key%name//' = '''//text//''' is not one of '//range_text(key), &
                  token, did_you_mean(text, key%choice, 'it accepts:'), faults)
    else if (key%kind == 'file') then
      call check_file(source, key, token, text, faults)
    end if
  end subroutine check_string

  !> The file must exist and be no folder.
  subroutine check_file(source, key, token, name, faults)
    type(deck_source_type), intent(in) :: source
    type(deck_key_type), intent(in) :: key
    type(token_type), intent(in) :: token
    character(len=*), intent(in) :: name
    type(deck_faults_type), intent(inout) :: faults
    character(len=:), allocatable :: path
    logical :: there, folder

    path = resolve_path(source%path, name)
    inquire (file=path, exist=there)
    inquire (file=path//'/.', exist=folder)
    if (len_trim(name) == 0 .or. .not. there) then
      call add_at(source, 'D018', key%name//': there is no file '''//name//'''', token, &
                  'searched for '//path//'; names are relative to the deck', faults)
    else if (folder) then
      call add_at(source, 'D018', key%name//': '''//name//''' is a folder, not a file', token, &
                  key%doc, faults)
    else if (.not. plain_file(path)) then
      call add_at(source, 'D018', key%name//': '''//name//''' is a pipe or a device, not a file', &
                  token, key%doc, faults)
    end if
  end subroutine check_file

  !> Number of the word of a real key, 0 if it is none.
  pure integer(i4) function word_number(key, text)
    type(deck_key_type), intent(in) :: key
    character(len=*), intent(in) :: text
    word_number = 0
    if (.not. allocated(key%word)) return
    do word_number = size(key%word), 1, -1
      if (key%word(word_number)%s == text) return
    end do
  end function word_number

  !> A name relative to the folder of the deck; absolute names stay.
  pure function resolve_path(deck_path, name) result(path)
    character(len=*), intent(in) :: deck_path, name
    character(len=:), allocatable :: path
    path = name
    if (len(name) == 0) return
    if (name(1:1) /= '/') path = deck_path(:index(deck_path, '/', back=.true.))//name
  end function resolve_path

  pure function wanted(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text
    text = 'a number'
    if (key%kind == 'integer') text = 'an integer'
    if (allocated(key%word)) text = text//' '//range_text(key)
  end function wanted

  pure function limits(key) result(text)
    type(deck_key_type), intent(in) :: key
    character(len=:), allocatable :: text
    text = key%doc
    if (len(range_text(key)) > 0) text = 'it must be '//range_text(key)//'; '//text
  end function limits

  pure function shown(source, token) result(text)
    type(deck_source_type), intent(in) :: source
    type(token_type), intent(in) :: token
    character(len=:), allocatable :: text
    text = source%text(token%first:token%last)
  end function shown

  subroutine add_at(source, code, message, token, hint, faults)
    type(deck_source_type), intent(in) :: source
    character(len=*), intent(in) :: code, message, hint
    type(token_type), intent(in) :: token
    type(deck_faults_type), intent(inout) :: faults
    call faults%add(source, code, message, token%line, token%first, token%last, hint)
  end subroutine add_at
end module talus_deck_values
