"""What a study is: its settings, and the seeds that follow from them."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sklearn.utils import Bunch

from ..features import KSVDTransformer, STHMPTransformer
from ..metrics import neg_macro_mae_scorer
from ..models import NNPOM, PAPER_2020, DistributionalOrdinalRegressor
from ..utils._sklearn import Scorer
from ._split import split_objects

# What `run_study` does unless it is told otherwise.
PROTOCOLS: dict[str, dict[str, Any]] = {
    "default": {
        "split": "group_kfold",
        "update": "approximate",
        "standardise": True,
        "regressor": DistributionalOrdinalRegressor(
            NNPOM(early_stopping=True, max_iter=200, n_iter_no_change=30)
        ),
        "scoring": None,
    },
    # The paper names no standardisation of features. Nor does it name a removal of
    # means: its windows are cut from the signals, and "each is used as a single
    # observation" (section 2.2). Both protocols therefore keep the means of windows.
    "paper": {
        "split": "paper",
        "update": "exact",
        "standardise": False,
        "regressor": DistributionalOrdinalRegressor(**PAPER_2020),
        "scoring": neg_macro_mae_scorer,
    },
}


def derive_seed(random_state, *name):
    """Return the seed of one random choice: a function of the study's and of its name.

    A name is of words and numbers; seeds are from 0 to 2**31 - 1.

    Examples
    --------
    >>> from sklearn_haptic.study._study import derive_seed
    >>> derive_seed(0, "features", "hold", "pac")
    1392585247
    """
    digest = sha256(json.dumps([random_state, *name]).encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1


def count_folds(settings):
    """Return the number of folds per procedure and adjective."""
    if settings["split"] == "paper":
        return 1
    return settings["n_splits"] * settings["n_repeats"]


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
