!> Test of dem_thornton_ning at one contact: curves, plastic work, energy, what is kept.
program test_dem_thornton_ning
  use talus_kinds, only: wp, i4
  use talus_test, only: max_abs, test_type
  use dem_block, only: dem_block_type
  use dem_law, only: make_law
  use dem_sizes, only: lanes
  use dem_state, only: dem_law_type, dem_material_type, history_size, history_root, column_count
  use dem_law_state, only: column_plastic
  use dem_thornton_ning, only: yield_overlap, plastic_work
  implicit none
  type(test_type) :: test
  real(wp), parameter :: pi = acos(-1.0_wp), radius = 1.0e-3_wp, pressure = 2.0e9_wp
  type(dem_law_type) :: law
  type(dem_block_type) :: b
  real(wp) :: history(lanes, history_size), memory(lanes, 5), first, line, lost

  call make_contact()
  first = (0.5_wp*pi*pressure/law%e_star)**2*radius
  line = pi*radius*pressure
  call check_loading()
  call check_unloading()
  call check_ledger()
  call test%finish()

contains

  !> Two spheres of R_e = 1 mm on the x axis, at rest.
  subroutine make_contact()
    type(dem_material_type) :: steel
    steel%young = 200.0e9_wp
    steel%poisson = 0.3_wp
    law = make_law('thornton_ning', steel, steel, 0.3_wp, 0.0_wp, 0.0_wp)
    law%own(1) = pressure
    law%frozen = .true.
    call forget()
  end subroutine make_contact

  subroutine forget()
    history = 0.0_wp
    history(:, history_root) = sqrt(radius)
    memory = 0.0_wp
    lost = 0.0_wp
  end subroutine forget

  !> Normal force at an overlap, reached in one step from the last [N].
  real(wp) function force_at(overlap) result(force)
    real(wp), intent(in) :: overlap
    real(wp) :: columns(column_count), ones(lanes)
    ones = 1.0_wp
    b%a%x = 0.0_wp
    b%a%vx = 0.0_wp
    b%a%vy = 0.0_wp
    b%a%vz = 0.0_wp
    b%a%wx = 0.0_wp
    b%a%wy = 0.0_wp
    b%a%wz = 0.0_wp
    b%b = b%a
    b%rx = 4.0_wp*radius - overlap
    b%ry = 0.0_wp
    b%rz = 0.0_wp
    b%nx = 1.0_wp
    b%ny = 0.0_wp
    b%nz = 0.0_wp
    b%ax = 2.0_wp*radius
    b%ay = 0.0_wp
    b%az = 0.0_wp
    b%ha = 2.0_wp*radius
    b%hb = 2.0_wp*radius
    b%gap = -overlap
    b%curvature = 1.0_wp/radius
    call law%base%forces(b, law%law_numbers_type, .true., 1.0e-9_wp, ones, ones, history, memory, &
                         columns)
    lost = lost + columns(column_plastic)/lanes
    force = b%load%fx(1)
  end function force_at

  real(wp) function stored()
    real(wp) :: energy(2), ones(lanes)
    ones = 1.0_wp/lanes
    energy = 0.0_wp
    call law%base%energy(law%law_numbers_type, ones, memory, energy)
    stored = energy(1)
  end function stored

  !> Hertz to the yield overlap, then the straight line of slope pi R p_y.
  subroutine check_loading()
    real(wp) :: hertz
    hertz = 4.0_wp/3.0_wp*law%e_star*sqrt(radius)
    call test%check_close('yield overlap', yield_overlap(law%law_numbers_type, radius)/first, &
                          1.0_wp, 1.0e-14_wp)
    call test%check_close('Hertz before yield', force_at(0.5_wp*first) &
                          /(hertz*(0.5_wp*first)**1.5_wp), 1.0_wp, 1.0e-13_wp)
    call test%check_close('nothing lost before yield', lost, 0.0_wp, 0.0_wp)
    call test%check_close('Hertz at yield', force_at(first)/(hertz*first**1.5_wp), 1.0_wp, &
                          1.0e-13_wp)
    call test%check_close('line of yield', (force_at(9.0_wp*first) - hertz*first**1.5_wp) &
                          /(8.0_wp*line*first), 1.0_wp, 1.0e-13_wp)
    call test%check_close('contact radius at the largest overlap', &
                          memory(1, 2)/sqrt(radius*9.0_wp*first), 1.0_wp, 1.0e-13_wp)
  end subroutine check_loading

  !> A Hertz curve of radius R_e F_e/F* through the largest overlap, there and back.
  subroutine check_unloading()
    real(wp) :: top, plastic, share, last, force
    top = 9.0_wp*first
    share = (13.0_wp/9.0_wp)/3.0_wp  ! (3/2 u - 1/2)/u^(3/2) at u = 9
    plastic = top*(1.0_wp - share)
    last = lost
    force = force_at(plastic + 0.25_wp*(top - plastic))
    call test%check_close('unloading curve', force/(line*(top - first/3.0_wp)), 0.125_wp, &
                          1.0e-12_wp)
    call test%check_close('no force below the permanent overlap', force_at(0.9_wp*plastic), &
                          0.0_wp, 0.0_wp)
    call test%check_close('reloading is unloading', force_at(plastic + 0.25_wp*(top - plastic)) &
                          /force, 1.0_wp, 1.0e-13_wp)
    call test%check_close('nothing lost on the way', lost - last, 0.0_wp, 0.0_wp)
    force = force_at(-first)
    call test%check('a contact that parts forgets', max_abs(memory) <= 0.0_wp)
  end subroutine check_unloading

  !> Work of the force = stored + lost, at any step; restitution^2 of the closed form is the share
  !! that is stored.
  subroutine check_ledger()
    integer(i4), parameter :: n = 20000
    real(wp) :: work, force, last, d, ratio, e
    integer(i4) :: k
    call forget()
    work = 0.0_wp
    last = 0.0_wp
    d = 9.0_wp*first/n
    do k = 1, n
      force = force_at(k*d)
      work = work + 0.5_wp*d*(force + last)
      last = force
    end do
    call test%check_close('work = stored + plastic', (stored() + lost)/work, 1.0_wp, 1.0e-8_wp)
    call test%check_close('plastic work in one step', &
                          plastic_work(law%law_numbers_type, radius, 9.0_wp*first)/lost, 1.0_wp, &
                          1.0e-11_wp)
    ratio = sqrt(4.0_wp/15.0_wp*line*first**2/work)  ! v_y/v
    e = sqrt(1.2_wp*sqrt(3.0_wp))*sqrt(1.0_wp - ratio**2/6.0_wp) &
        *(ratio/(ratio + 2.0_wp*sqrt(1.2_wp - 0.2_wp*ratio**2)))**0.25_wp
    call test%check_close('restitution of Thornton and Ning', sqrt(stored()/work), e, 1.0e-8_wp)
  end subroutine check_ledger
end program test_dem_thornton_ning
