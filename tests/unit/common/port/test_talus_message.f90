!> Port messages: every kind and shape of field there and back, every kind of damage found.
program test_talus_message
  use talus_kinds, only: wp, i4, i8
  use talus_text, only: str
  use talus_errors, only: error_list_type
  use talus_message, only: message_type, verb_advance, verb_hello
  use talus_test, only: test_type
  implicit none

  type(test_type) :: test

  call there_and_back()
  call layout()
  call steady_state()
  call receiver_checks()
  call unknown_fields()
  call reported_faults()
  call damage()
  call test%finish()

contains

  !> What a transport does: words of one message into the buffer of another.
  subroutine carry(from, to, errors, words)
    type(message_type), intent(in) :: from
    type(message_type), intent(inout) :: to
    type(error_list_type), intent(inout) :: errors
    integer(i8), intent(in), optional :: words
    integer(i8) :: n
    n = from%used
    if (present(words)) n = words
    call to%reserve(n)
    to%word(:n) = from%word(:n)
    call to%parse(n, errors)
  end subroutine carry

  subroutine there_and_back()
    type(message_type) :: a, b
    type(error_list_type) :: errors
    real(wp) :: x(3, 4), y(3, 4), s, v(5), w(5)
    real(wp), allocatable :: tv(:), tm(:, :)
    integer(i8) :: l(2, 3), m(2, 3), one
    integer(i8), allocatable :: tl(:, :)
    integer(i4) :: id(6), back(6), single, k
    integer(i4), allocatable :: tid(:)
    character(len=:), allocatable :: text

    call random_number(x)
    v = [(1.0_wp/k, k=1, 5)]
    l = reshape([1_i8, -2_i8, 2_i8**40, 4_i8, -5_i8**20, huge(0_i8)], [2, 3])
    id = [1, 5, 2147483647, -7, 0, 12]
    call fill(a, x, v, l, id)
    call carry(a, b, errors)
    call test%check('parses', .not. errors%any())
    call test%check('header', b%verb == verb_advance .and. b%step == 12 .and. b%sequence == 77 &
                    .and. b%status == 0 .and. b%t0 >= 0.25_wp .and. b%t1 <= 0.5_wp)
    call b%get('container.x', y, errors)
    call test%check('matrix', all(transfer(x, l) == transfer(y, l)))
    call b%take('transposed', tm, errors)
    call test%check('matrix of other shape', all(shape(tm) == [4, 3]) .and. all(tm >= transpose(x)))
    call b%get('v', w, errors)
    call test%check('vector', all(transfer(v, l) == transfer(w, l)))
    call b%take('every second', tv, errors)
    call test%check('section', all(transfer(tv, l) == transfer(v(1:5:2), l)))
    s = 1.0_wp
    call b%get('s', s, errors)
    call test%check('signed zero', sign(1.0_wp, s) < 0.0_wp .and. .not. s < 0.0_wp)
    call b%get_int('pairs', m, errors)
    call b%take_int('pairs', tl, errors)
    call test%check('long integers', all(m == l) .and. all(tl == l))
    call b%get_int('id', back, errors)
    call b%take_int('id', tid, errors)
    call test%check('short integers', all(back == id) .and. all(tid == id))
    call b%get_int('ranks', single, errors)
    call b%get_int('ranks', one, errors)
    call test%check('single integers', single == 3 .and. one == 3)
    call b%get_text('run_id', text, errors)
    call test%check_text('text of any bytes', text, 'Prüfung'//char(0)//'7')
    call b%get_text('nothing', text, errors)
    call test%check_text('empty text', text, '')
    call b%take('empty', tm, errors)
    call test%check('empty field', all(shape(tm) == [3, 0]))
    call b%all_read(errors)
    call test%check('no fault', .not. errors%any())
  end subroutine there_and_back

  subroutine fill(a, x, v, l, id)
    type(message_type), intent(inout) :: a
    real(wp), intent(in) :: x(:, :), v(:)
    integer(i8), intent(in) :: l(:, :)
    integer(i4), intent(in) :: id(:)

    call a%start(verb_advance, 12_i8, 0.25_wp, 0.5_wp)
    call a%put('container.x', x)
    call a%put('transposed', transpose(x))
    call a%put('v', v)
    call a%put('every second', v(1:5:2))
    call a%put('s', -0.0_wp)
    call a%put_int('pairs', l)
    call a%put_int('id', id)
    call a%put_int('ranks', 3)
    call a%put_text('run_id', 'Prüfung'//char(0)//'7')
    call a%put_text('nothing', '')
    call a%put('empty', x(:, 1:0))
    call a%seal(77_i8)
  end subroutine fill

  !> The words as manual/port.md lays them down; the checksum bit by bit.
  subroutine layout()
    type(message_type) :: a
    integer(i8) :: sent
    real(wp) :: x(3, 37)

    call a%start(verb_hello, 5_i8, 1.0_wp, 2.0_wp)
    call a%put_text('ab', 'TALUSMSG')
    call random_number(x)
    call a%put('x', x)
    call a%seal(9_i8)
    call test%check('magic', a%word(1) == transfer('TALUSMSG', 0_i8))
    call test%check('header words', all(a%word(2:5) == [2_i8, 9_i8, 1_i8, 5_i8]) .and. &
                    all(a%word(6:7) == transfer([1.0_wp, 2.0_wp], [0_i8])) .and. &
                    all(a%word(8:9) == [0_i8, 2_i8]) .and. a%word(10) == 16 + 10 + 1 + 10 + 111)
    call test%check('field words', a%word(17) == transfer('ab      ', 0_i8) .and. &
                    all(a%word(23:26) == [3_i8, 1_i8, 8_i8, 1_i8]) .and. a%word(27) == a%word(1) &
                    .and. all(a%word(34:37) == [1_i8, 3_i8, 37_i8, 111_i8]))
    sent = a%word(11)
    a%word(11) = 0
    call test%check('checksum', sent == crc_by_bits(a%word(:a%used)))
  end subroutine layout

  !> CRC-64/XZ of words, lowest byte first, one bit after the other.
  pure integer(i8) function crc_by_bits(word)
    integer(i8), intent(in) :: word(:)
    integer(i8), parameter :: polynomial = int(z'C96C5795D7870F42', i8)
    integer :: k, bit
    logical :: odd
    crc_by_bits = not(0_i8)
    do k = 1, size(word)
      do bit = 0, 63
        odd = btest(crc_by_bits, 0) .neqv. btest(word(k), bit)
        crc_by_bits = ishft(crc_by_bits, -1)
        if (odd) crc_by_bits = ieor(crc_by_bits, polynomial)
      end do
    end do
    crc_by_bits = not(crc_by_bits)
  end function crc_by_bits

  !> Messages of equal size leave the buffers where they are.
  subroutine steady_state()
    type(message_type) :: a, b
    type(error_list_type) :: errors
    real(wp) :: x(3, 1000)
    integer(i8) :: room(2)
    integer(i4) :: k

    x = 1.0_wp
    do k = 1, 100
      call a%start(verb_advance)
      call a%put('x', x)
      call a%put('v', x)
      call a%seal(int(k, i8))
      call carry(a, b, errors)
      call b%get('x', x, errors)
      call b%get('v', x, errors)
      if (k == 1) room = [size(a%word, kind=i8), size(b%word, kind=i8)]
    end do
    call test%check('no allocation', all(room == [size(a%word, kind=i8), size(b%word, kind=i8)]) &
                    .and. .not. errors%any())
  end subroutine steady_state

  subroutine receiver_checks()
    type(message_type) :: a
    type(error_list_type) :: errors
    real(wp) :: x(3, 2), y(2, 3), v(6)
    integer(i4) :: id(2)
    character(len=:), allocatable :: text

    x = 2.0_wp
    y = 1.0_wp
    v = 1.0_wp
    call a%start(verb_advance, 3_i8)
    call a%put('x', x)
    call a%put_int('big', [1_i8, 2_i8**31])
    call a%seal(4_i8)
    call a%get('z', y, errors)
    call a%get('x', y, errors)
    call a%get('x', v, errors)
    call a%get_int('x', id, errors)
    call a%get_text('x', text, errors)
    call a%get_int('big', id, errors)
    call test%check('count of faults', errors%count == 6)
    call test%check_text('missing', errors%item(1)%code, 'P009')
    call test%check_text('shape', errors%item(2)%code, 'P010')
    call test%check_text('shape seen', errors%item(2)%message, &
                         'the field ''x'' is 3 x 2, 2 x 3 is expected')
    call test%check_text('rank', errors%item(3)%code, 'P010')
    call test%check_text('kind', errors%item(4)%code, 'P011')
    call test%check_text('kind of text', errors%item(5)%code, 'P011')
    call test%check_text('32 bits', errors%item(6)%code, 'P013')
    call test%check_text('place', errors%item(1)%place, 'message 4 (ADVANCE, step 3)')
    call test%check('nothing written', all(y < 1.5_wp) .and. all(v < 1.5_wp))
  end subroutine receiver_checks

  subroutine unknown_fields()
    type(message_type) :: a
    type(error_list_type) :: errors, more
    real(wp) :: s

    call a%start(verb_advance)
    call a%put('known', 1.0_wp)
    call a%put('mistyped', 2.0_wp)
    call a%seal(1_i8)
    call a%get('known', s, errors)
    call a%all_read(errors)
    call test%check('one unknown', errors%count == 1)
    call test%check_text('unknown', errors%item(1)%code, 'P012')
    call test%check('named', index(errors%item(1)%message, '''mistyped''') > 0)
    call a%expect([character(len=12) :: 'known', 'mistyped'], more)
    call test%check('all expected', .not. more%any())
    call a%expect([character(len=12) :: 'known'], more)
    call test%check('one not expected', more%count == 1)
    call test%check('has', a%has('known') .and. .not. a%has('unknown'))
    call test%check('shape', all(a%shape('known') == 1) .and. all(a%shape('unknown') == -1))
  end subroutine unknown_fields

  subroutine reported_faults()
    type(message_type) :: a, b, request
    type(error_list_type) :: here, there

    call request%start(verb_advance, 8_i8, 1.0_wp, 2.0_wp)
    call a%answer(request)
    call a%put('half written', 1.0_wp)
    call here%add('N201', 'grain 17 left the box', 'grain 17', 'smaller dt')
    call here%add('N202', 'so did grain 18')
    call a%fail_with(here)
    call a%seal(1_i8)
    call carry(a, b, there)
    call b%faults(there)
    call b%all_read(there)
    call test%check('one fault arrives', there%count == 1 .and. b%status == 2)
    call test%check_text('code', there%item(1)%code, 'N201')
    call test%check_text('message', there%item(1)%message, &
                         'grain 17 left the box (and 1 more, see its log)')
    call test%check_text('place', there%item(1)%place, 'grain 17')
    call test%check_text('hint', there%item(1)%hint, 'smaller dt')
    call test%check('verb and step kept', b%verb == verb_advance .and. b%step == 8)
  end subroutine reported_faults

  !> Each word of a message is damaged in turn; none passes, none crashes.
  subroutine damage()
    type(message_type) :: good, bad, b
    type(error_list_type) :: errors
    integer(i8) :: k
    integer(i4) :: passed, bit

    call good%start(verb_advance)
    call good%put('x', [1.0_wp, 2.0_wp])
    call good%put_text('t', 'abc')
    call good%seal(1_i8)
    passed = 0
    do k = 1, good%used
      do bit = 0, 63, 7
        bad = good
        bad%word(k) = ieor(bad%word(k), ishft(1_i8, bit))
        call errors%clear()
        call carry(bad, b, errors)
        if (.not. errors%any()) passed = passed + 1
      end do
    end do
    call test%check('no damaged word passes: '//str(passed), passed == 0)
    call pairs(good)
    passed = 0
    do k = 0, good%used - 1
      call errors%clear()
      call carry(good, b, errors, words=k)
      if (.not. errors%any()) passed = passed + 1
    end do
    call test%check('no truncated message passes', passed == 0)
    bad = good
    bad%word(2) = 99
    call errors%clear()
    call carry(bad, b, errors)
    call test%check_text('other protocol', errors%item(1)%code, 'P005')
  end subroutine damage

  !> Two flips of the same bit in two words: sums would let those of the highest bit cancel.
  subroutine pairs(good)
    type(message_type), intent(in) :: good
    type(message_type) :: bad, b
    type(error_list_type) :: errors
    integer(i8) :: k, j
    integer(i4) :: passed, bit

    passed = 0
    do bit = 3, 63, 12
      do k = 1, good%used
        do j = k + 1, good%used
          bad = good
          bad%word(k) = ieor(bad%word(k), ishft(1_i8, bit))
          bad%word(j) = ieor(bad%word(j), ishft(1_i8, bit))
          call errors%clear()
          call carry(bad, b, errors)
          if (.not. errors%any()) passed = passed + 1
        end do
      end do
    end do
    call test%check('no pair of flips passes: '//str(passed), passed == 0)
  end subroutine pairs
end program test_talus_message
