!> kind = 'static' with &stage: groups of elements are removed and placed during the run.
module fem_analysis_stages
  use talus_kinds, only: wp
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_hdf5, only: h5_file_type
  use fem_analysis_static, only: fem_analysis_static_type
  use fem_body, only: fem_body_type
  use fem_staging, only: staged_step, put_stages, get_stages
  implicit none
  private
  public :: fem_analysis_stages_type

  type, extends(fem_analysis_static_type) :: fem_analysis_stages_type
  contains
    procedure :: check_port
    procedure :: step
    procedure :: put
    procedure :: get
  end type fem_analysis_stages_type

contains

  subroutine check_port(self, deck, errors)
    class(fem_analysis_stages_type), intent(in) :: self
    type(deck_type), intent(in) :: deck
    type(error_list_type), intent(inout) :: errors
    call deck%fault(errors, 'D339', 'a coupled run has no stages', 'stage', 1, '', &
                    'run this deck alone')
  end subroutine check_port

  subroutine step(self, body, t1, errors)
    class(fem_analysis_stages_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    real(wp), intent(in) :: t1  !! [s]
    type(error_list_type), intent(inout) :: errors
    call staged_step(body, t1, errors)
  end subroutine step

  subroutine put(self, body, file, errors)
    class(fem_analysis_stages_type), intent(in) :: self
    type(fem_body_type), intent(in) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call put_stages(body, file, errors)
  end subroutine put

  subroutine get(self, body, file, errors)
    class(fem_analysis_stages_type), intent(inout) :: self
    type(fem_body_type), intent(inout) :: body
    type(h5_file_type), intent(inout) :: file
    type(error_list_type), intent(inout) :: errors
    call get_stages(body, file, errors)
  end subroutine get
end module fem_analysis_stages
