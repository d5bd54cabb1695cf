!> CRC-64 against published values, by both ways of computing it, whole and in parts; flips.
program test_talus_crc64
  use talus_kinds, only: i4, i8
  use talus_text, only: str
  use talus_crc64, only: crc64, crc64_by_tables
  use talus_test, only: test_type
  implicit none
  type(test_type) :: test

  call published()
  call both_ways()
  call in_parts()
  call flips()
  call test%finish()

contains

  !> Check value of the catalogue of CRCs (G. Cook) for CRC-64/XZ; the others bit by bit from the
  !! polynomial.
  subroutine published()
    call one('123456789', '995DC9BBDF1939FA')
    call one('', '0000000000000000')
    call one('a', '330284772E652B05')
    call one('The quick brown fox jumps over the lazy dog', '5B5EB8C2E54AA1C4')
  end subroutine published

  subroutine one(text, expected)
    character(len=*), intent(in) :: text, expected
    character(len=1) :: bytes(len(text))
    integer :: k
    do k = 1, len(text)
      bytes(k) = text(k:k)
    end do
    call test%check_text('crc64 of '//text, hex(crc64(bytes, len(text, i8), 0_i8)), expected)
    call test%check_text('by tables of '//text, hex(crc64_by_tables(bytes, len(text, i8), 0_i8)), &
                         expected)
  end subroutine one

  pure function hex(crc)
    integer(i8), intent(in) :: crc
    character(len=16) :: hex
    write (hex, '(z16.16)') crc
  end function hex

  !> Numbers that look random, the same in every run.
  pure subroutine fill(word)
    integer(i8), intent(out) :: word(:)
    integer(i8) :: state
    integer :: k
    state = 88172645463325252_i8
    do k = 1, size(word)
      state = ieor(state, ishft(state, 13))
      state = ieor(state, ishft(state, -7))
      state = ieor(state, ishft(state, 17))
      word(k) = state
    end do
  end subroutine fill

  !> Lengths around all limits of the loops, 0 to 1100 bytes, and one of 80 kB.
  subroutine both_ways()
    integer(i8) :: word(10000), bytes
    integer(i4) :: different
    call fill(word)
    different = 0
    do bytes = 0, 1100
      if (crc64(word, bytes, 3*bytes) /= crc64_by_tables(word, bytes, 3*bytes)) &
        different = different + 1
    end do
    call test%check('both ways agree, '//str(different)//' differ', different == 0)
    call test%check('both ways agree on 80 kB', &
                    crc64(word, 80000_i8, 0_i8) == crc64_by_tables(word, 80000_i8, 0_i8))
  end subroutine both_ways

  !> A text in two parts, cut anywhere, has the CRC of the whole.
  subroutine in_parts()
    integer(i8) :: word(200), whole, first
    integer(i4) :: different, cut
    call fill(word)
    whole = crc64(word, 1600_i8, 0_i8)
    different = 0
    do cut = 0, 200
      first = crc64(word(:cut), 8_i8*cut, 0_i8)
      if (crc64(word(cut + 1:), 1600_i8 - 8_i8*cut, first) /= whole) different = different + 1
    end do
    call test%check('parts add up, '//str(different)//' do not', different == 0)
  end subroutine in_parts

  !> Every pair of flips of the same bit in two words of a message is seen, and every single one.
  subroutine flips()
    integer(i8) :: word(64), whole
    integer(i4) :: unseen, j, k, bit
    call fill(word)
    whole = crc64(word, 512_i8, 0_i8)
    unseen = 0
    do bit = 0, 63
      do j = 1, 64
        word(j) = ieor(word(j), ishft(1_i8, bit))
        if (crc64(word, 512_i8, 0_i8) == whole) unseen = unseen + 1
        do k = j + 1, 64
          word(k) = ieor(word(k), ishft(1_i8, bit))
          if (crc64(word, 512_i8, 0_i8) == whole) unseen = unseen + 1
          word(k) = ieor(word(k), ishft(1_i8, bit))
        end do
        word(j) = ieor(word(j), ishft(1_i8, bit))
      end do
    end do
    call test%check('flips seen, '//str(unseen)//' unseen', unseen == 0)
  end subroutine flips
end program test_talus_crc64
