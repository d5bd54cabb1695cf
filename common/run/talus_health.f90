!> Health of a run: figures that show whether its results can be trusted, each with a limit beyond
!! which it is amber (a warning) and one beyond which it is red (fault N001, exit code 2, once all
!! results are written). `&limits allow` makes red ones amber. The same in all programs; the limits
!! stand with their reasons in the manual (running, Health).
module talus_health
  use talus_kinds, only: wp, i4
  use talus_deck, only: deck_type
  use talus_errors, only: error_list_type
  use talus_log, only: log_type, short_number
  use talus_summary, only: summary_type
  use talus_text, only: str, string_type, is_finite
  implicit none
  private
  public :: health_type, green, amber, red

  integer(i4), parameter :: green = 0, amber = 1, red = 2
  character(len=5), parameter :: names(green:red) = ['green', 'amber', 'red  ']

  !> One figure.
  type :: figure_type
    character(len=:), allocatable :: key   !! name in &limits allow and in summary.json
    character(len=:), allocatable :: text  !! what it is, with its value and why it matters
    character(len=:), allocatable :: hint
    real(wp) :: limit = 0.0_wp             !! that it passed
    integer(i4) :: state = green
    logical :: allowed = .false.           !! it would be red
  end type figure_type

  type :: health_type
    private
    type(figure_type), allocatable :: figure(:)
  contains
    procedure :: judge
    procedure :: state
    procedure :: warn
    procedure :: complain
    procedure :: summarise
  end type health_type

contains

  !> Compare a figure with its limits; what is no number is red. A limit that is huge is none.
  subroutine judge(self, deck, key, text, value, limits, hint)
    class(health_type), intent(inout) :: self
    type(deck_type), intent(in) :: deck
    character(len=*), intent(in) :: key        !! a choice of &limits allow
    character(len=*), intent(in) :: text       !! as in 'energy error'
    real(wp), intent(in) :: value
    real(wp), intent(in) :: limits(amber:red)  !! ascending
    character(len=*), intent(in) :: hint       !! what helps
    type(string_type), allocatable :: allow(:)
    type(figure_type) :: one
    integer(i4) :: k

    if (.not. allocated(self%figure)) allocate (self%figure(0))
    one%key = key
    one%text = text//' '//short_number(value)
    one%hint = hint
    if (.not. value <= limits(amber)) one%state = amber
    if (.not. (value <= limits(red) .and. is_finite(value))) one%state = red
    if (one%state > green) one%limit = limits(one%state)
    if (one%state == red .and. deck%count('limits') > 0) then
      call deck%get('limits', 1, 'allow', allow)
      do k = 1, size(allow)
        one%allowed = one%allowed .or. allow(k)%s == key
      end do
      if (one%allowed) one%state = amber
    end if
    call append(self%figure, one)
  end subroutine judge

  !> One more figure (an array constructor of this type is more than gfortran 12 can do).
  subroutine append(list, one)
    type(figure_type), allocatable, intent(inout) :: list(:)
    type(figure_type), intent(in) :: one
    type(figure_type), allocatable :: longer(:)
    integer(i4) :: k
    allocate (longer(size(list) + 1))
    do k = 1, size(list)
      longer(k) = list(k)
    end do
    longer(size(longer)) = one
    call move_alloc(longer, list)
  end subroutine append

  !> The worst of all figures.
  pure integer(i4) function state(self)
    class(health_type), intent(in) :: self
    integer(i4) :: k
    state = green
    if (.not. allocated(self%figure)) return
    do k = 1, size(self%figure)
      state = max(state, self%figure(k)%state)
    end do
  end function state

  !> A warning in the log for every figure that is not green.
  subroutine warn(self, log)
    class(health_type), intent(in) :: self
    type(log_type), intent(inout) :: log
    integer(i4) :: k
    if (.not. allocated(self%figure)) return
    do k = 1, size(self%figure)
      if (self%figure(k)%state > green) call log%warn(note(self%figure(k)))
    end do
  end subroutine warn

  !> Fault N001 for every figure that is red.
  subroutine complain(self, place, errors)
    class(health_type), intent(in) :: self
    character(len=*), intent(in) :: place  !! the deck
    type(error_list_type), intent(inout) :: errors
    integer(i4) :: k
    if (.not. allocated(self%figure)) return
    do k = 1, size(self%figure)
      if (self%figure(k)%state < red) cycle
      call errors%add('N001', note(self%figure(k)), place=place, &
                      hint=self%figure(k)%hint//"; &limits allow = '"//self%figure(k)%key// &
                      "' makes it a warning")
    end do
  end subroutine complain

  !> health.verdict and, as health.notes, what is not green.
  subroutine summarise(self, summary)
    class(health_type), intent(in) :: self
    type(summary_type), intent(inout) :: summary
    character(len=:), allocatable :: notes
    integer(i4) :: k
    notes = ''
    do k = 1, merge(size(self%figure, kind=i4), 0_i4, allocated(self%figure))
      if (self%figure(k)%state == green) cycle
      if (len(notes) > 0) notes = notes//'; '
      notes = notes//note(self%figure(k))
    end do
    call summary%set('health.verdict', trim(names(self%state())))
    call summary%set('health.notes', notes)
  end subroutine summarise

  !> As in 'health amber: energy error 0.02, limit 0.01'.
  function note(one) result(text)
    type(figure_type), intent(in) :: one
    character(len=:), allocatable :: text
    text = 'health '//trim(names(one%state))//': '//one%text//', limit '//short_number(one%limit)
    if (one%allowed) text = text//' (allowed by the deck)'
  end function note
end module talus_health
