"""The progress of a study, as lines of text."""

import sys

from ._store import read_record


class Progress:
    """Prints one line per finished unit, with the time left.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    units : list of tuple
        All units, finished or not.
    n_workers : int
        Number of units that are computed at a time.
    """

    def __init__(self, folder, units, n_workers):
        records = {unit: read_record(folder, unit) for unit in units}
        self.seconds = {
            unit: record["seconds"] if record else None
            for unit, record in records.items()
        }
        self.n_workers = n_workers

    def __call__(self, unit, seconds):
        """Note that a unit is finished."""
        self.seconds[unit] = seconds
        n_done = sum(each is not None for each in self.seconds.values())
        print(
            f"[{n_done}/{len(self.seconds)}] {' '.join(map(str, unit))}: "
            f"{seconds:.1f} s, {self.time_left()}",
            file=sys.stderr,
            flush=True,
        )

    def time_left(self):
        """Estimate the time left from the mean time of each kind of unit."""
        total = 0.0
        for kind in dict.fromkeys(unit[0] for unit in self.seconds):
            of_kind = [s for unit, s in self.seconds.items() if unit[0] == kind]
            taken = [s for s in of_kind if s is not None]
            n_left = len(of_kind) - len(taken)
            if n_left and not taken:
                return f"time left not known before the first of {n_left} {kind}"
            if n_left:
                total += n_left * sum(taken) / len(taken)
        return f"about {total / self.n_workers / 60:.1f} min left"
