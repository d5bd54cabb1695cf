"""The scanner of writers finds assignments, allocations and associated names, and nothing else."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tools"))

import writers  # noqa: E402

STATE = """module dem_state
  implicit none
  private
  public :: state_type, outer_type
  type :: state_type
    real(wp), allocatable :: x(:, :), y(:)
    integer(i4) :: count = 0
  end type state_type
  type, extends(state_type) :: more_type
    type(state_type) :: inner
  end type more_type
  type :: outer_type
    type(state_type) :: state(2)
  end type outer_type
contains
  subroutine begin(self)
    class(state_type), intent(inout) :: self
    allocate (self%x(3, self%count), source=0.0_wp)
  end subroutine begin
end module dem_state
"""
OTHER = """module dem_other
  use dem_state, only: whole_type => outer_type, state_type
  implicit none
contains
  subroutine fill(o, y)
    type(whole_type), intent(inout) :: o
    real(wp), intent(inout), allocatable :: y(:)
    real(wp) :: x
    if (o%state(1)%count == 1) o%state(2)%count = 2
    associate (s => o%state(1), c => o%state(1)%x(:, 1), n => size(y) + 1)
      where (c > 0.0_wp) c = 1.0_wp
      call move_alloc(y, s%y)
      call s%begin()
      if (s%count > n) call show(x=s%y)
    end associate
    x = o%state(1)%x(1, 1)
  end subroutine fill
end module dem_other
"""
CHILD = """module dem_child
  use dem_state, only: more_type
  implicit none
contains
  subroutine clear(m)
    class(more_type), intent(inout) :: m
    deallocate (m%x, m%inner%y)
  end subroutine clear
end module dem_child
"""


def scanned(root: Path) -> dict[tuple[str, str, str], set[str]]:
    """Scan the three modules in a folder."""
    (root / "dem").mkdir()
    for name, text in (("state", STATE), ("other", OTHER), ("child", CHILD)):
        (root / "dem" / f"dem_{name}.f90").write_text(text)
    return writers.read_writers(root)


def test_writers_are_found(tmp_path: Path) -> None:
    """Assignments after conditions, allocations, associated names, inherited components."""
    found = scanned(tmp_path)
    assert found == {
        ("dem_state", "state_type", "x"): {"dem_state", "dem_other", "dem_child"},
        ("dem_state", "state_type", "y"): {"dem_other", "dem_child"},
        ("dem_state", "state_type", "count"): {"dem_other"},
    }


def test_limit_holds_for_watched_modules(tmp_path: Path, monkeypatch) -> None:
    """Three writers are one too many, where the type is watched."""
    scanned(tmp_path)
    assert writers.check(tmp_path) == []
    monkeypatch.setattr(writers, "WATCHED", ("dem_state",))
    (only,) = writers.check(tmp_path)
    assert only.startswith("dem_state: state_type%x is written by 3 modules: dem_child, dem_other")
