"""What the presets of a study fix, unless `run_study` is told otherwise."""

from typing import Any

from ..metrics import neg_macro_mae_scorer
from ..models import NNPOM, PAPER_2020, DistributionalOrdinalRegressor

PRESETS: dict[str, dict[str, Any]] = {
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
    # observation" (section 2.2). Both presets therefore keep the means of windows.
    "paper": {
        "split": "paper",
        "update": "exact",
        "standardise": False,
        "regressor": DistributionalOrdinalRegressor(**PAPER_2020),
        "scoring": neg_macro_mae_scorer,
    },
}
