"""What a study is: its settings, and the seeds that follow from them."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from sklearn.utils import Bunch

from ..features import KSVDTransformer, STHMPTransformer
from ..models import DistributionalOrdinalRegressor
from ..utils._sklearn import Scorer
from ._split import split_objects


def derive_seed(random_state, *name):
    """Return the seed of one random choice: a function of the study's and of its name.

    Parameters
    ----------
    random_state : int
        Seed of the study.
    *name : str, int or float
        What the seed is for.

    Returns
    -------
    seed : int
        From 0 to 2**31 - 1.

    Examples
    --------
    >>> from sklearn_haptic.study._study import derive_seed
    >>> derive_seed(0, "features", "hold", "pac")
    1392585247
    """
    digest = sha256(json.dumps([random_state, *name]).encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1


@dataclass(frozen=True)
class Study:
    """The settings of a study, as `run_study` takes them."""

    corpus: Callable[..., Bunch]
    folder: Path
    procedures: list[str]
    """All that the corpus knows."""
    sensors: list[str]
    coders: dict[str, KSVDTransformer | STHMPTransformer]
    """Those given in place of the defaults."""
    update: str
    dictionaries: str
    standardise: bool
    split: str
    n_splits: int
    n_repeats: int
    n_hidden: list[int]
    alpha: list[float]
    n_starts: int
    regressor: DistributionalOrdinalRegressor
    scoring: str | Scorer | None
    random_state: int

    @property
    def settings(self):
        """Everything that changes the results of a unit."""
        chosen = {name: value for name, value in vars(self).items() if name != "folder"}
        return {"version": version("sklearn_haptic"), **chosen}

    @property
    def n_folds(self):
        """Number of folds per procedure and adjective."""
        return 1 if self.split == "paper" else self.n_splits * self.n_repeats

    def seed(self, *name):
        """Seed of the random choice of this name."""
        return derive_seed(self.random_state, *name)

    def split_objects(self, objects, adjective):
        """Folds of trials: the paper's for one adjective, or the same for all."""
        name = adjective if self.split == "paper" else "all"
        return split_objects(
            objects,
            self.split,
            n_splits=self.n_splits,
            n_repeats=self.n_repeats,
            seed=self.seed("split", name),
        )

    def features_unit(self, procedure, sensor, adjective, fold):
        """Name of the unit of the features that a fold takes from a sensor."""
        unit = "features", procedure, sensor
        if self.dictionaries == "all objects":
            return unit
        return *unit, adjective if self.split == "paper" else "all", fold
