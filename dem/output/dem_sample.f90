!> The grains and contacts of a system as a sample to be measured.
module dem_sample
  use talus_kinds, only: wp, i4
  use talus_errors, only: error_list_type
  use talus_sample, only: sample_type, rotation_matrix
  use talus_homogenise, only: inverse_of
  use dem_cell, only: cell_volume, is_periodic, reduced_basis
  use dem_pair_law, only: at_friction_limit
  use dem_state, only: kind_free
  use dem_system, only: dem_system_type, dem_contacts_type
  implicit none
  private
  public :: fill_sample

  real(wp), parameter :: pi = acos(-1.0_wp)

contains

  !> Sample of the grains of a system and a list of contacts between them; ids that the system does
  !! not have are faults (I216).
  subroutine fill_sample(system, list, sample, errors)
    type(dem_system_type), intent(in) :: system
    type(dem_contacts_type), intent(in) :: list
    type(sample_type), intent(inout) :: sample
    type(error_list_type), intent(inout) :: errors
    integer(i4), allocatable :: first(:), second(:)
    integer(i4) :: i, c, before

    before = errors%count
    call system%find(list%ids(2, :list%n), second, errors)
    call system%find(pack(list%ids(1, :list%n), list%ids(1, :list%n) > 0), first, errors)
    if (errors%count > before) return
    call sample%make(system%grains%n, list%n)
    if (system%cell%active) sample%cell_volume = cell_volume(system%cell)
    associate (g => system%grains)
      sample%x = g%x
      sample%axes = g%axes
      sample%v = g%v
      sample%omega = g%omega
      sample%mass = g%mass
      sample%inertia = sum(g%inertia, 1)/3.0_wp
      sample%volume = 4.0_wp/3.0_wp*pi*product(g%axes, 1)
      sample%free = g%kind == kind_free
      do i = 1, g%n
        sample%turn(:, :, i) = rotation_matrix(g%quat(:, i))
        if (system%cell%active) sample%v(:, i) = g%v(:, i) + matmul(system%cell%rate, g%x(:, i) &
                                                                    - system%cell%origin)
      end do
    end associate
    sample%second = second
    sample%first = unpack(first, list%ids(1, :list%n) > 0, 0_i4)
    do c = 1, list%n
      call put_contact(system, list, c, sample)
    end do
    if (is_periodic(system%cell)) call put_images(system, sample)
  end subroutine fill_sample

  !> Second ends that are images: of all images the one nearest to the contact.
  subroutine put_images(system, sample)
    type(dem_system_type), intent(in) :: system
    type(sample_type), intent(inout) :: sample
    real(wp) :: h(3, 3), inverse(3, 3), s(3)
    integer(i4) :: whole(3, 3), c, k
    call reduced_basis(system%cell, h, whole)
    inverse = inverse_of(h)
    do c = 1, sample%contacts
      s = matmul(inverse, sample%point(:, c) - sample%x(:, sample%second(c)))
      do k = 1, 3
        if (system%cell%periodic(k)) sample%over(:, c) = sample%over(:, c) + anint(s(k))*h(:, k)
      end do
    end do
  end subroutine put_images

  subroutine put_contact(system, list, c, sample)
    type(dem_system_type), intent(in) :: system
    type(dem_contacts_type), intent(in) :: list
    integer(i4), intent(in) :: c
    type(sample_type), intent(inout) :: sample
    integer(i4) :: material

    sample%point(:, c) = list%point(:, c)
    sample%normal(:, c) = list%normal(:, c)
    sample%force(:, c) = -list%force(:, c)
    sample%stiffness(:, c) = list%stiffness(:, c)
    sample%ids(:, c) = list%ids(:, c)
    sample%overlap(c) = list%overlap(c)
    if (sample%first(c) > 0) then
      sample%start(:, c) = sample%x(:, sample%first(c))
      material = system%grains%material(sample%first(c))
    else
      sample%start(:, c) = list%point(:, c)
      material = boundary_material(system, int(-list%ids(1, c), i4))
    end if
    if (material == 0) return
    sample%sliding(c) = at_friction_limit( &
      system%laws(material, system%grains%material(sample%second(c))), list%force(:, c), &
      list%normal(:, c), list%stiffness(1, c), list%overlap(c))
  end subroutine put_contact

  !> Material of a plane or, behind these, of a surface; 0 of one whose parts have several.
  pure integer(i4) function boundary_material(system, boundary) result(material)
    type(dem_system_type), intent(in) :: system
    integer(i4), intent(in) :: boundary
    integer(i4) :: first, last
    if (boundary <= system%planes%n) then
      material = system%planes%material(boundary)
      return
    end if
    associate (s => system%surfaces)
      first = s%first_part(boundary - system%planes%n)
      last = s%first_part(boundary - system%planes%n + 1) - 1
      material = 0
      if (all(s%material(first:last) == s%material(first))) material = s%material(first)
    end associate
  end function boundary_material
end module dem_sample
