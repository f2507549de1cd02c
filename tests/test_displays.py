"""What all displays have in common: the axes that they use, and no matplotlib."""

import sys
from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from test_plotting_speed_accuracy import CV_RESULTS

from sklearn_haptic import KSVDTransformer, plotting

RNG = np.random.default_rng(0)
COUNTS, PROBA = RNG.integers(1, 9, (10, 5)), RNG.dirichlet(np.ones(5), 10)
TRIALS = [RNG.normal(size=(n, 2)) for n in (40, 50)]
MODELS = pd.MultiIndex.from_product(
    [["none", "pac"], range(2), range(4)], names=["held_out", "start", "object"]
).to_frame(index=False)
GIVEN = {
    "AdjectiveCorrelationDisplay.from_ratings": (RNG.normal(size=(20, 3)),),
    "AtomsDisplay.from_estimator": (),
    "DistributionDisplay.from_predictions": (COUNTS[0], PROBA),
    "InterraterAgreementDisplay.from_counts": (COUNTS,),
    "InverseCDFDisplay.from_predictions": (COUNTS[0], PROBA),
    "PITHistogramDisplay.from_predictions": (COUNTS, PROBA),
    "RatingsDisplay.from_counts": (COUNTS,),
    "ReliabilityDisplay.from_predictions": (COUNTS, PROBA),
    "SensorContributionsDisplay.from_scores": (
        MODELS.assign(macro_mae=RNG.uniform(size=16)),
    ),
    "SignalsDisplay.from_trials": ({"pac": TRIALS[0]},),
    "SpeedAccuracyDisplay.from_search": (CV_RESULTS,),
    "TouchTimeDisplay.from_predictions": (COUNTS, PROBA[:, None], [1.0]),
}


@pytest.fixture(params=GIVEN)
def draw(request):
    name, method = request.param.split(".")
    function = getattr(getattr(plotting, name), method)
    if method == "from_estimator":
        coder = KSVDTransformer(3, 2, window=9, max_iter=1, random_state=0).fit(TRIALS)
        function = partial(function, coder)
    return partial(function, *GIVEN[request.param])


def test_every_display_is_drawn():
    assert {name.partition(".")[0] for name in GIVEN} == set(plotting.__all__)


def test_given_axes_are_used_and_no_figure_is_made(draw):
    figure = Figure(layout="constrained")
    ax = figure.subplots()
    drawn = draw(ax=ax)
    assert drawn.ax_ is ax and drawn.figure_ is figure
    assert plt.get_fignums() == []
    assert drawn.plot() is drawn
    assert drawn.figure_ is not figure


def test_without_matplotlib_the_extra_is_named(draw, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        draw()
