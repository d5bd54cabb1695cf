"""The style check counts what it says: arguments, lines, nesting, labels, subjects, exceptions."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tools"))

import style  # noqa: E402
import style_labels  # noqa: E402
import style_procedures  # noqa: E402

SOURCE = """module dem_x
  implicit none
  private
  integer :: counter = 0
  integer, parameter :: three = 3
  type :: pair_type
    integer :: a = 0
  end type pair_type
contains
  pure subroutine deep(a, b, c, &
                       d, e, f, g, h)
    do while (a)
      if (b) then
        select case (c)
        case (1)
          if (d) then
            e = 1
          end if
        end select
      end if
      if (f) g = h
    end do
  end subroutine deep

  function flat(a) result(b)
    b = a
  end function flat
end module dem_x
"""


def test_procedures_are_measured() -> None:
    """Arguments over continued lines, levels of nesting, variables of modules."""
    code = style.code_of(SOURCE.splitlines())
    deep, flat = style_procedures.procedures(code)
    assert (deep.name, deep.line, deep.lines, deep.arguments, deep.nesting) == (
        "deep",
        10,
        14,
        8,
        4,
    )
    assert (flat.name, flat.lines, flat.arguments, flat.nesting) == ("flat", 3, 1, 0)
    assert style_procedures.module_variables(code) == [(4, "counter")]
    rules = [rule for _, _, rule, _ in style_procedures.breaches(code)]
    assert rules == ["arguments", "levels", "module-variable"]


def test_exceptions_only_shrink(tmp_path: Path) -> None:
    """What the list names passes up to its value; an entry that is mended must go."""
    (tmp_path / "tools").mkdir()
    path = tmp_path / style.EXCEPTIONS
    path.write_text("dem_x deep arguments 8\ndem_x deep levels 9\ndem_x gone lines 70\n")
    exceptions = style.Exceptions(path)
    code = style.code_of(SOURCE.splitlines())
    found = exceptions.check(Path("dem/dem_x.f90"), code)
    assert [text for _, text in found] == ["counter: 1 module-variable, limit 0"]
    assert len(exceptions.idle()) == 2
    exceptions.shrink()
    lines = path.read_text().splitlines()[1:]
    assert lines == ["dem_x deep arguments 8", "dem_x deep levels 4"]


def test_labels_are_checked(tmp_path: Path) -> None:
    """Equations without label or with another's, labels and pages that do not exist."""
    for name in ("manual", "dem"):
        (tmp_path / name).mkdir()
    page = "$$a=b$$ {D.1}\n\n$$c$$\n\n$$d\n=e$$ {D.1}\n"
    (tmp_path / "manual/theory-dem.md").write_text(page)
    source = "! eq. D.1, theory-dem\n! eqs. D.1 and D.2\n! theory-nowhere\n! formulation/dem.md\n"
    (tmp_path / "dem/dem_x.f90").write_text(source)
    assert style_labels.check(tmp_path) == [
        "manual/theory-dem.md:3: equation without label",
        "manual/theory-dem.md:6: label D.1 is in theory-dem.md too",
        "dem/dem_x.f90:2: no equation D.2",
        "dem/dem_x.f90:3: no page theory-nowhere",
        "dem/dem_x.f90:4: cites what is not in the repository",
    ]


@pytest.mark.parametrize(
    ("subject", "good"),
    [
        ("dem: carry springs over list rebuilds", True),
        ("dem, fem: process faults in order", True),
        ("dem: carried springs", False),
        ("dem: the springs", False),
        ("carry springs", False),
    ],
)
def test_subjects_are_imperative(subject: str, good: bool) -> None:
    """`area: verb` with the verb as an order."""
    start = style.SUBJECT.match(subject)
    fine = start is not None and (
        not style.NO_VERB.search(start["verb"]) or start["verb"] in style.VERBS
    )
    assert fine == good
