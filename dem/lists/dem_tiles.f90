!> A sample of a periodic cell laid side by side, so that regions and grids see the images of grains
!! and contacts around them.
module dem_tiles
  use talus_kinds, only: wp, i4
  use talus_homogenise, only: inverse_of
  use talus_sample, only: sample_type
  use dem_cell, only: fractions, shift_of
  use dem_state, only: dem_cell_type
  implicit none
  private
  public :: tile

  !> Images found so far: grain and shift of each, in the order of the grains.
  type :: images_type
    integer(i4) :: count = 0
    integer(i4), allocatable :: grain(:), shift(:, :), start(:)
  end type images_type

  !> Where images are wanted.
  type :: box_type
    real(wp) :: lower(3), upper(3)  !! its faces [m]
    real(wp) :: low(3), high(3)     !! fractions of the cell's edges that it reaches [-]
  end type box_type

contains

  !> All images whose centres lie between lower and upper [m], and the contacts between them.
  subroutine tile(sample, cell, lower, upper, tiled)
    type(sample_type), intent(in) :: sample
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: lower(3), upper(3)
    type(sample_type), intent(inout) :: tiled
    type(images_type) :: images
    integer(i4), allocatable :: contact(:, :)
    integer(i4) :: k

    call find_images(sample, cell, box_of(cell, lower, upper), images)
    call find_contacts(sample, cell, images, contact)
    call tiled%make(images%count, size(contact, 2))
    do k = 1, images%count
      associate (i => images%grain(k))
        tiled%x(:, k) = sample%x(:, i) + shift_of(cell, images%shift(:, k))
        tiled%v(:, k) = sample%v(:, i) + matmul(cell%rate, shift_of(cell, images%shift(:, k)))
        tiled%turn(:, :, k) = sample%turn(:, :, i)
        tiled%axes(:, k) = sample%axes(:, i)
        tiled%omega(:, k) = sample%omega(:, i)
        tiled%mass(k) = sample%mass(i)
        tiled%inertia(k) = sample%inertia(i)
        tiled%volume(k) = sample%volume(i)
        tiled%free(k) = sample%free(i)
      end associate
    end do
    do k = 1, size(contact, 2)
      call put_contact(sample, tiled, k, contact(:, k))
    end do
  end subroutine tile

  !> One contact: its number in the sample, first and second image.
  subroutine put_contact(sample, tiled, k, contact)
    type(sample_type), intent(in) :: sample
    type(sample_type), intent(inout) :: tiled
    integer(i4), intent(in) :: k, contact(3)
    real(wp) :: moved(3)
    associate (c => contact(1))
      tiled%first(k) = contact(2)
      tiled%second(k) = contact(3)
      moved = tiled%x(:, contact(3)) - sample%far_end(c)
      tiled%start(:, k) = sample%start(:, c) + moved
      tiled%point(:, k) = sample%point(:, c) + moved
      tiled%normal(:, k) = sample%normal(:, c)
      tiled%force(:, k) = sample%force(:, c)
      tiled%stiffness(:, k) = sample%stiffness(:, c)
      tiled%sliding(k) = sample%sliding(c)
      tiled%ids(:, k) = sample%ids(:, c)
      tiled%overlap(k) = sample%overlap(c)
    end associate
  end subroutine put_contact

  !> A box, and the fractions of the cell's edges between which its corners lie.
  pure function box_of(cell, lower, upper) result(box)
    type(dem_cell_type), intent(in) :: cell
    real(wp), intent(in) :: lower(3), upper(3)  !! [m]
    type(box_type) :: box
    real(wp) :: s(3, 8)
    integer(i4) :: corner
    do corner = 0, 7
      s(:, corner + 1) = fractions(cell, merge(upper, lower, [btest(corner, 0), btest(corner, 1), &
                                                              btest(corner, 2)]))
    end do
    box = box_type(lower, upper, minval(s, 2), maxval(s, 2))
  end function box_of

  !> Images of all grains, counted before there is room for them.
  subroutine find_images(sample, cell, box, images)
    type(sample_type), intent(in) :: sample
    type(dem_cell_type), intent(in) :: cell
    type(box_type), intent(in) :: box
    type(images_type), intent(out) :: images
    integer(i4) :: i, round

    allocate (images%start(sample%n + 1))
    do round = 1, 2
      images%count = 0
      do i = 1, sample%n
        images%start(i) = images%count + 1
        call add_images(sample, cell, box, i, images)
      end do
      images%start(sample%n + 1) = images%count + 1
      if (round == 1) allocate (images%grain(images%count), images%shift(3, images%count))
    end do
  end subroutine find_images

  !> Images of grain i in the box: counted, and kept once there is room.
  subroutine add_images(sample, cell, box, i, images)
    type(sample_type), intent(in) :: sample
    type(dem_cell_type), intent(in) :: cell
    type(box_type), intent(in) :: box
    integer(i4), intent(in) :: i
    type(images_type), intent(inout) :: images
    real(wp) :: own(3), x(3)
    integer(i4) :: a, b, c, first(3), last(3)

    own = fractions(cell, sample%x(:, i))
    first = merge(ceiling(box%low - own), 0, cell%periodic)
    last = merge(floor(box%high - own), 0, cell%periodic)
    do c = first(3), last(3)
      do b = first(2), last(2)
        do a = first(1), last(1)
          x = sample%x(:, i) + shift_of(cell, [a, b, c])
          if (any(cell%periodic) .and. (any(x < box%lower) .or. any(x > box%upper))) cycle
          images%count = images%count + 1
          if (.not. allocated(images%grain)) cycle
          images%grain(images%count) = i
          images%shift(:, images%count) = [a, b, c]
        end do
      end do
    end do
  end subroutine add_images

  !> Contacts of which both ends are there (3, count): number, first image (0: a wall), second.
  subroutine find_contacts(sample, cell, images, contact)
    type(sample_type), intent(in) :: sample
    type(dem_cell_type), intent(in) :: cell
    type(images_type), intent(in) :: images
    integer(i4), allocatable, intent(out) :: contact(:, :)
    real(wp) :: inverse(3, 3)
    integer(i4) :: c, k, first, count, over(3), round
    logical :: wall

    inverse = inverse_of(cell%vectors)
    do round = 1, 2
      count = 0
      do c = 1, sample%contacts
        over = nint(matmul(inverse, sample%over(:, c)))
        wall = sample%first(c) <= 0
        do k = images%start(sample%second(c)), images%start(sample%second(c) + 1) - 1
          first = 0
          if (.not. wall) first = image_of(images, sample%first(c), images%shift(:, k) - over)
          if (first == 0 .and. .not. wall) cycle
          count = count + 1
          if (round == 2) contact(:, count) = [c, first, k]
        end do
      end do
      if (round == 1) allocate (contact(3, count))
    end do
  end subroutine find_contacts

  !> Number of an image, 0 if it is not among those found.
  pure integer(i4) function image_of(images, grain, shift) result(k)
    type(images_type), intent(in) :: images
    integer(i4), intent(in) :: grain, shift(3)
    do k = images%start(grain), images%start(grain + 1) - 1
      if (all(images%shift(:, k) == shift)) return
    end do
    k = 0
  end function image_of
end module dem_tiles
