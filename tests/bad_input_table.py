"""Print the table of `bad_input_cases`: who is called, what is given, what is said.

``python tests/bad_input_table.py > bad_input_table.md`` writes it as a page.
"""

import tempfile
import warnings
from pathlib import Path

HEAD = "| Called | Given | Exception | Message |\n|---|---|---|---|\n"


def outcome(case, folder):
    """Make the call of a case; return what it raises."""
    function, args, kwargs = case.make(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            function(*args, **kwargs)
        except Exception as error:
            return error
    raise AssertionError(f"{case.called} accepts {case.given}.")


def row(case):
    """Return the line of a case, in which `…` stands for a path and a long message."""
    with tempfile.TemporaryDirectory() as folder:
        error = outcome(case, Path(folder))
        message = " ".join(str(error).replace(folder, "…").split())
    message = message if len(message) <= 250 else f"{message[:249]}…"
    cells = (case.called, case.given, type(error).__name__, message)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


if __name__ == "__main__":
    from bad_input_cases import CASES

    print(HEAD, *map(row, CASES), sep="", end="")
