!> Stress and state of every quadrature point of a body whose laws have a state: trial and accepted
!! values, commit and revert, stored energy and dissipation.
module fem_points
  use talus_kinds, only: wp, i4
  use talus_text, only: str
  use talus_ranks, only: ranks_type
  use fem_elastic, only: fem_elastic_type
  use fem_finite, only: fem_deformation_type
  use fem_geometry, only: fem_geometry_type
  use fem_law, only: fem_law_box_type, at_flag, at_iterations, at_stored, at_dissipated, &
    at_numerical, common_size
  use fem_law_finite, only: at_ratio
  use fem_mm_body, only: fem_micro_type
  implicit none
  private
  public :: fem_points_type, fem_work_type

  !> The present element, and the workspace of elements of one rule.
  type :: fem_work_type
    integer(i4) :: element = 0
    type(fem_geometry_type) :: geometry  !! where the body keeps none
    type(fem_deformation_type) :: motion
  end type fem_work_type

  type :: fem_points_type
    logical :: active = .false.               !! some law of the body has a state
    logical :: symmetric = .true.             !! all tangents are
    logical :: finite = .false.               !! some law is one of finite strain
    integer(i4) :: bad = 0                    !! first point without a state in the last update,
                                              !! < 0: one that another rank has
    integer(i4) :: bad_rank = 0               !! rank that has it
    type(ranks_type) :: ranks             !! that have the other elements
    type(fem_law_box_type), allocatable :: law(:)
    integer(i4), allocatable :: law_of(:)     !! (elements)
    integer(i4) :: states = common_size       !! most of any law
    real(wp), allocatable :: weight(:)        !! (points) volume times factor [m^3]
    type(fem_geometry_type), allocatable :: geometry(:)  !! (elements) unless it is too large
    real(wp), allocatable :: stress(:, :), accepted_stress(:, :)  !! (components, points) [Pa]
    real(wp), allocatable :: state(:, :), accepted_state(:, :)    !! (states, points)
    real(wp), allocatable :: tangent(:, :, :)  !! (components, components, points) [Pa]
    real(wp), allocatable :: nodal(:, :)      !! (3, blocks of all elements) forces [N]
    real(wp), allocatable :: u(:, :)          !! (3, blocks) of the trial, with finite strains [m]
    type(fem_micro_type) :: micro             !! if the body is micromorphic
  contains
    procedure :: accept
    procedure :: reject
    procedure :: renew_moduli
    procedure :: works
    procedure :: growth
    procedure :: yielding
    procedure :: element_of
    procedure :: trouble
  end type fem_points_type

contains

  subroutine accept(self)
    class(fem_points_type), intent(inout) :: self
    if (.not. self%active) return
    self%accepted_stress = self%stress
    self%accepted_state = self%state
  end subroutine accept

  subroutine reject(self)
    class(fem_points_type), intent(inout) :: self
    if (.not. self%active) return
    self%stress = self%accepted_stress
    self%state = self%accepted_state
  end subroutine reject

  !> Moduli of the elements are those of their first points, of the trial state.
  subroutine renew_moduli(self, elastic)
    class(fem_points_type), intent(in) :: self
    type(fem_elastic_type), intent(inout) :: elastic
    integer(i4) :: e
    do e = 1, int(size(self%law_of), i4)
      elastic%moduli(:, e) = &
        self%law(self%law_of(e))%law%moduli_at(self%stress(:, elastic%point(e)))
    end do
  end subroutine renew_moduli

  !> Stored energy, dissipation and that of the integration, of the trial state [J].
  pure function works(self)
    class(fem_points_type), intent(in) :: self
    real(wp) :: works(3)
    works = [sum(self%weight*self%state(at_stored, :)), &
             sum(self%weight*self%state(at_dissipated, :)), &
             sum(self%weight*self%state(at_numerical, :))]
  end function works

  !> Dissipated by the integration since the accepted state [J].
  pure real(wp) function growth(self)
    class(fem_points_type), intent(in) :: self
    growth = sum(self%weight*(self%state(at_numerical, :) - self%accepted_state(at_numerical, :)))
  end function growth

  !> Points that yielded in the trial increment, and the most local iterations.
  pure function yielding(self) result(counts)
    class(fem_points_type), intent(in) :: self
    integer(i4) :: counts(2)
    counts = [int(count(self%state(at_flag, :) > 0.0_wp), i4), &
              nint(maxval(self%state(at_iterations, :)))]
  end function yielding

  !> The fault of the first point without a state, and whether its element is turned inside
  !! out; collective over the ranks.
  subroutine trouble(self, elastic, text, inverted)
    class(fem_points_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    character(len=:), allocatable, intent(out) :: text
    logical, intent(out) :: inverted
    inverted = .false.
    text = ''
    if (self%bad > 0) call trouble_here(self, elastic, text, inverted)
    call self%ranks%broadcast_text(self%bad_rank, text)
    call self%ranks%any_of(inverted)
  end subroutine trouble

  subroutine trouble_here(self, elastic, text, inverted)
    class(fem_points_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    character(len=:), allocatable, intent(out) :: text
    logical, intent(out) :: inverted
    integer(i4) :: at(2)
    character(len=:), allocatable :: element
    at = self%element_of(elastic, self%bad)
    element = 'element '//str(elastic%number_of(at(1)))
    if (self%micro%active) then
      inverted = index(self%micro%trouble, 'determinant') > 0
      text = 'the law of point '//str(at(2))//' of '//element//' finds no state: '// &
        self%micro%trouble
      return
    end if
    inverted = self%law(self%law_of(at(1)))%law%finite
    if (inverted) then
      text = element//' is turned inside out at point '//str(at(2))// &
        ', its volume is '//str(self%state(at_ratio, self%bad))//' of what it was'
    else
      text = 'the law of point '//str(at(2))//' of '//element//' finds no state'
    end if
  end subroutine trouble_here

  !> Element and number in it of a point.
  pure function element_of(self, elastic, p) result(where_it_is)
    class(fem_points_type), intent(in) :: self
    type(fem_elastic_type), intent(in) :: elastic
    integer(i4), intent(in) :: p
    integer(i4) :: where_it_is(2)
    where_it_is(1) = int(count(elastic%point <= p), i4)
    where_it_is(2) = p - elastic%point(where_it_is(1)) + 1
  end function element_of
end module fem_points
