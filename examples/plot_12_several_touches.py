"""
Several touches, and a broken sensor
====================================

How much does a second touch of an object gain, and what happens if a sensor breaks?
Here a robot holds objects and squeezes them. A pool predicts from any available
touches, and a guard notices signals that are unlike those of all training touches.
"""

# %%
# 1. A pool of two kinds of touch
# -------------------------------
# Each row of the corpus is an object held once and squeezed once. A
# :class:`~sklearn_haptic.TouchPool` has one model of holds and one of squeezes, and
# learns their weights on objects held out.
import matplotlib.pyplot as plt
import numpy as np

from sklearn_haptic import (
    DummyDistribution,
    NoveltyGuard,
    TouchPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score

corpus = make_haptic_corpus(
    48, 3, ["hold", "squeeze"], sensors=["pdc", "tdc"], random_state=0
)
test = np.isin(corpus.objects, np.unique(corpus.objects)[::3])
trials, hard, objects = corpus.trials, corpus.ratings["hard"], corpus.objects

columns = {kind: [f"{kind}_pdc", f"{kind}_tdc"] for kind in ("hold", "squeeze")}
pool = TouchPool(
    [
        (kind, make_haptic_pipeline(names, random_state=0), names)
        for kind, names in columns.items()
    ],
    cv=3,
)
pool.fit(trials[~test], hard[~test], groups=objects[~test])

# %%
# 2. Predictions from any touches
# -------------------------------
# If a touch was not made, its columns are None. With ``groups``, all rows of an object
# are also pooled.
touched = trials[test]
held = touched.assign(squeeze_pdc=None, squeeze_tdc=None)
squeezed = touched.assign(hold_pdc=None, hold_tdc=None)
guess = DummyDistribution().fit(np.zeros((sum(~test), 1)), hard[~test])
predicted = {
    "guess, no touch": guess.predict_proba(np.zeros((len(touched), 1))),
    "one hold": pool.predict_proba(held),
    "three holds": pool.predict_proba(held, groups=objects[test]),
    "one squeeze": pool.predict_proba(squeezed),
    "one hold, one squeeze": pool.predict_proba(touched),
    "three of each": pool.predict_proba(touched, groups=objects[test]),
}
names, place = np.unique(objects[test], return_inverse=True)
errors = {}
for label, proba in predicted.items():
    rps = ranked_probability_score(hard[test], proba, average=False)
    errors[label] = np.bincount(place, rps) / np.bincount(place)
    print(f"{label}: RPS {errors[label].mean():.3f}")

# %%
# Objects differ a lot, so each prediction is compared with that of one hold on the same
# objects. Bars are standard errors over sixteen objects. A touch of another kind, the
# squeeze, gains more than two further holds. Of an object that was also squeezed, the
# hold tells nothing more, and the pool gives it no weight.
fig, ax = plt.subplots(figsize=(6.4, 2.4), layout="constrained")
labels = [*predicted][2:]
for y, label in enumerate(labels):
    gain = errors["one hold"] - errors[label]
    error = gain.std(ddof=1) / np.sqrt(len(gain))
    ax.errorbar(gain.mean(), y, xerr=error, fmt="o", color="C0", capsize=3)
ax.set_yticks(range(len(labels)), labels)
ax.invert_yaxis()
ax.axvline(0, color="0.6", linewidth=0.8)
ax.set_xlabel("RPS lower than that of one hold by … (more is better)")

# %%
# 3. A sensor that died
# ---------------------
# A :class:`~sklearn_haptic.NoveltyGuard` around a model compares each touch with the
# training touches, by its features and by the statistics of its signals. Its p-value
# is small if no training touch was like this one. Here the pressure sensor is dead in
# every second hold: its signal is always zero.
pressure = columns["hold"]
guard = NoveltyGuard(make_haptic_pipeline(pressure, random_state=0), cv=3)
guard.fit(trials.loc[~test, pressure], hard[~test], groups=objects[~test])
felt = trials.loc[test, pressure].copy()
dead = np.arange(len(felt)) % 2 == 0
felt["hold_pdc"] = [
    np.zeros_like(signal) if broken else signal
    for signal, broken in zip(felt["hold_pdc"], dead)
]
p_values = guard.p_values(felt)
for name, which in {"dead": dead, "sound": ~dead}.items():
    share = np.mean(p_values[which] <= 0.05)
    print(f"{name}: {share:.0%} of the touches have p of 0.05 or less")
