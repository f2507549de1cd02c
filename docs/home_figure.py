"""The figure of the home page: three touches, and what they say about three objects.

    python docs/home_figure.py

Touches and people are generated. The three objects took no part in training. Ten
seconds on one core.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from sklearn_haptic import make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus

if sys.argv[1:]:
    sys.exit(__doc__)
BLUE, ORANGE = "#0072B2", "#D55E00"
SENSORS = ["pac", "pdc", "tdc", "electrodes"]
MATERIALS = ["foam", "fabric", "metal"]  # the first object of each is shown

corpus = make_haptic_corpus(60, 5, "slow_slide", sensors=SENSORS, random_state=0)
counts, materials = corpus.ratings["hard"], np.asarray(corpus.object_names)
shown = [np.flatnonzero(materials == name)[0] for name in MATERIALS]
training = ~np.isin(corpus.objects, corpus.objects[shown])
model = make_haptic_pipeline(SENSORS, random_state=0)
groups = corpus.objects[training]
model.fit(corpus.trials[training], counts[training], model__groups=groups)
predicted = model.predict_proba(corpus.trials.iloc[shown])

figure, axes = plt.subplots(
    3, 2, figsize=(6.4, 4.6), sharex="col", sharey="col", width_ratios=[3, 2]
)
for (left, right), trial, proba in zip(axes, shown, predicted):
    vibration = corpus.trials["pac"].iloc[trial][:, 0]
    seconds = np.arange(len(vibration)) / corpus.sampling_rates["pac"]
    left.plot(seconds, vibration, color="0.35", linewidth=0.4)
    left.set_ylabel(materials[trial], rotation=0, ha="right", va="center", size=13)
    left.set(yticks=[], xticks=[])
    left.spines[:].set_visible(False)
    people = counts[trial] / counts[trial].sum()
    right.bar(corpus.levels, proba, color=BLUE, width=0.8)
    right.plot(
        corpus.levels, people, "o", color=ORANGE, mec="white", ms=9, clip_on=False
    )
    right.set(
        yticks=[], xticks=corpus.levels, xticklabels=["not at\nall", *"234", "very"]
    )
    right.spines[["top", "left", "right"]].set_visible(False)
axes[0, 1].text(2.0, 0.42, "■ predicted", color=BLUE, size=12, weight="bold")
axes[0, 1].text(2.0, 0.61, "● said by 12 people", color=ORANGE, size=12, weight="bold")
axes[0, 0].set_title("A robot touches an object\nthat it never met …", size=13)
axes[0, 1].set_title("… and predicts how hard\npeople will find it", size=13)
figure.tight_layout()
figure.savefig(Path(__file__).parent / "images" / "three_touches.png", dpi=130)
