!> What the contacts of a region bear: three grains and a wall, by hand.
program test_talus_contact_measures
  use talus_kinds, only: wp, i4
  use talus_contact_measures, only: contact_columns, contact_row, contacts_inside
  use talus_measures, only: request_type
  use talus_region, only: region_box, region_sphere
  use talus_sample, only: sample_type, rotation_matrix
  use talus_test, only: max_abs, test_type
  use talus_text, only: string_type
  implicit none
  type(test_type) :: test
  type(string_type), allocatable :: names(:)

  call contact_columns(names)
  call check_row()
  call check_empty()
  call check_cut()
  call test%finish()

contains

  !> Unit spheres at 0, 2, 4 along x and a wall below the first; the contact at x = 3 slides.
  subroutine make_three(sample)
    type(sample_type), intent(inout) :: sample
    integer(i4) :: i
    call sample%make(3, 3)
    do i = 1, 3
      sample%x(1, i) = 2.0_wp*(i - 1)
      sample%turn(:, :, i) = rotation_matrix([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end do
    sample%axes = 1.0_wp
    sample%volume = 4.0_wp
    sample%first = [1, 2, 0]
    sample%second = [2, 3, 1]
    sample%start(:, 1:2) = sample%x(:, 1:2)
    sample%start(:, 3) = [0.0_wp, 0.0_wp, -1.0_wp]
    sample%point = reshape([1.0_wp, 0.0_wp, 0.0_wp, 3.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
                            -1.0_wp], [3, 3])
    sample%normal(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp]
    sample%normal(:, 2) = [1.0_wp, 0.0_wp, 0.0_wp]
    sample%normal(:, 3) = [0.0_wp, 0.0_wp, 1.0_wp]
    sample%force(:, 1) = [-6.0_wp, 0.0_wp, 2.0_wp]
    sample%force(:, 2) = [-4.0_wp, 3.0_wp, 0.0_wp]
    sample%force(:, 3) = [1.0_wp, 0.0_wp, -8.0_wp]
    sample%overlap = [0.1_wp, 0.2_wp, 0.3_wp]
    sample%sliding = [.false., .true., .false.]
  end subroutine make_three

  !> Value of a column.
  real(wp) function value(row, name)
    real(wp), intent(in) :: row(:)
    character(len=*), intent(in) :: name
    integer :: k
    value = -huge(1.0_wp)
    do k = 1, size(names)
      if (index(names(k)%s, name//' [') == 1) value = row(k)
    end do
  end function value

  !> A box of volume 5 x 2 x 4 that has contacts 1 and 3.
  subroutine check_row()
    type(sample_type) :: sample
    type(request_type) :: request
    real(wp), allocatable :: row(:)
    real(wp), parameter :: v = 40.0_wp
    call make_three(sample)
    request%region%kind = region_box
    request%region%lower = [-2.5_wp, -1.0_wp, -2.0_wp]
    request%region%upper = [2.5_wp, 1.0_wp, 2.0_wp]
    call contact_row(0.5_wp, sample, request, row)
    call test%check('as many values as titles', size(row) == size(names))
    call test%check('contacts belong to a region by their point', &
                    all(contacts_inside(sample, request) .eqv. [.true., .false., .true.]))
    call test%check_close('contacts', value(row, 'contacts'), 2.0_wp, 0.0_wp)
    call test%check_close('those with a wall', value(row, 'boundary_contacts'), 1.0_wp, 0.0_wp)
    call test%check_close('contacts of the grains whose centres are inside', &
                          value(row, 'coordination'), 2.0_wp, 0.0_wp)
    call test%check_close('the one that slides is outside', value(row, 'sliding'), 0.0_wp, 0.0_wp)
    call test%check_close('normal force', value(row, 'normal_force_mean'), 7.0_wp, 1.0e-14_wp)
    call test%check_close('the largest', value(row, 'normal_force_largest'), 8.0_wp, 1.0e-14_wp)
    call test%check_close('tangential', value(row, 'tangential_force_mean'), 1.5_wp, 1.0e-14_wp)
    call test%check_close('largest overlap', value(row, 'overlap_largest'), 0.3_wp, 1.0e-14_wp)
    call test%check_close('a branch that leaves the region counts whole', &
                          value(row, 'stress_xx'), -12.0_wp/v, 1.0e-14_wp)
    call test%check_close('shear stress', value(row, 'stress_xz'), 4.0_wp/v, 1.0e-14_wp)
    call test%check_close('from wall to centre', value(row, 'stress_zz'), -8.0_wp/v, 1.0e-14_wp)
    call test%check_close('fabric', value(row, 'fabric_contact_xx'), 0.5_wp, 1.0e-14_wp)
    call test%check_close('fabric weighed with forces', &
                          value(row, 'fabric_force_zz'), 8.0_wp/14.0_wp, 1.0e-14_wp)
    request%region%upper(1) = 3.5_wp
    call contact_row(0.5_wp, sample, request, row)
    call test%check_close('one of three slides', value(row, 'sliding'), 1.0_wp/3.0_wp, 1.0e-14_wp)
    call test%check_close('its force', value(row, 'tangential_force_largest'), 3.0_wp, 1.0e-14_wp)
  end subroutine check_row

  !> A region without contacts has zeros, and no division by them.
  subroutine check_empty()
    type(sample_type) :: sample
    type(request_type) :: request
    real(wp), allocatable :: row(:)
    call make_three(sample)
    request%region%kind = region_sphere
    request%region%base = [0.0_wp, 9.0_wp, 0.0_wp]
    request%region%radius = 1.0_wp
    call contact_row(0.0_wp, sample, request, row)
    call test%check_close('nothing in an empty region', max_abs(row(3:)), 0.0_wp, 0.0_wp)
  end subroutine check_empty

  !> Solid fraction is exact where no face cuts a grain.
  subroutine check_cut()
    type(sample_type) :: sample
    type(request_type) :: request
    real(wp), allocatable :: row(:)
    call make_three(sample)
    request%region%kind = region_box
    request%region%lower = [-1.0_wp, -1.0_wp, -1.0_wp]
    request%region%upper = [3.0_wp, 1.0_wp, 1.0_wp]
    call contact_row(0.0_wp, sample, request, row)
    call test%check_close('two grains whole, one out', value(row, 'grains_cut'), 0.0_wp, 0.0_wp)
    call test%check_close('both grains', value(row, 'solid_fraction'), 8.0_wp/16.0_wp, 1.0e-14_wp)
    request%region%upper = [4.0_wp, 0.5_wp, 1.0_wp]
    call contact_row(0.0_wp, sample, request, row)
    call test%check_close('all three are cut', value(row, 'grains_cut'), 3.0_wp, 0.0_wp)
  end subroutine check_cut
end program test_talus_contact_measures
