!> CRC-64/XZ of bytes (ECMA-182 polynomial, reflected; talus_crc64.c): finds every burst of up to
!! 64 bits, and every two and three flipped bits of up to 1 GB. No protection against intent.
module talus_crc64
  use, intrinsic :: iso_c_binding, only: c_int64_t
  implicit none
  private
  public :: crc64, crc64_by_tables

  interface
    !> CRC-64 of `bytes` bytes of a contiguous array behind bytes whose CRC is `before` (0: none);
    !! the 64 bits of an unsigned number.
    pure function crc64(data, bytes, before) result(crc) bind(c, name='talus_crc64_bytes')
      import :: c_int64_t
      type(*), intent(in) :: data(*)
      integer(c_int64_t), value :: bytes
      integer(c_int64_t), value :: before
      integer(c_int64_t) :: crc
    end function crc64
    !> The same number by tables alone, as on processors without carry-less multiplication.
    pure function crc64_by_tables(data, bytes, before) result(crc) &
      bind(c, name='talus_crc64_by_tables')
      import :: c_int64_t
      type(*), intent(in) :: data(*)
      integer(c_int64_t), value :: bytes
      integer(c_int64_t), value :: before
      integer(c_int64_t) :: crc
    end function crc64_by_tables
  end interface
end module talus_crc64
