"""
Vibrations that people rated
============================

Of many studies only mean ratings are published. They are enough to learn from: here
vibrations of a tenth of a second to sixteen seconds, which people rated from -3 to 3,
become predictions of how a crowd will answer.
"""

# %%
# 1. Recordings and published means
# ---------------------------------
# If the vibrations of VibViz are in the file ``vibviz.npz``, :doc:`as real data are
# </real_data>`, they are taken. Otherwise similar ones are generated: pulses of a
# carrier, more or less strong, in slow or fast rhythm.
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.linear_model import RidgeCV
from sklearn.metrics import r2_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    DummyDistribution,
    RegressedDistribution,
    Signal,
    SignalStatistics,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import noise_ceiling, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba
from sklearn_haptic.plotting import DistributionDisplay
from sklearn_haptic.ratings import counts_from_moments, rating_mean

rng = np.random.default_rng(0)


def generate(n=80, rate=2000):
    """Return vibrations, and what people feel on average."""
    energy, tempo = rng.uniform(-1, 1, size=(2, n))
    signals = []
    for strength, pace in zip(10.0**energy, 2.0 ** (1 + 2 * tempo)):
        time = np.arange(0, rng.uniform(0.5, 4), 1 / rate)
        pulses = (time * pace % 1 < 0.4) * strength * rng.uniform(0.7, 1.4)
        signal = pulses * np.sin(2 * np.pi * rng.uniform(80, 250) * time)
        signals.append(signal + 0.01 * rng.normal(size=len(time)))
    felt = 2.2 * np.stack([energy, tempo], axis=1)
    return signals, felt + rng.normal(scale=0.5, size=(n, 2))


if Path("vibviz.npz").exists():
    with np.load("vibviz.npz") as file:
        signals = np.split(file["signal"], np.cumsum(file["length"])[:-1])
        means = pd.DataFrame(file["mean"], columns=file["attribute"])
        means = means[["energy", "tempo"]]
else:
    signals, felt = generate()
    means = pd.DataFrame(np.clip(felt, -3, 3), columns=["energy", "tempo"])
trials = [signal[:, None] for signal in signals]
print(means.describe().round(2).loc[["count", "mean", "std", "min", "max"]])

# %%
# 2. From means to distributions
# ------------------------------
# How far people disagree is not published, so their standard deviation is borrowed: 1.2
# on seven levels is usual for materials. Of an object in the middle of the scale this
# is the deviation, and towards the ends it becomes smaller.
levels = range(-3, 4)
y = {
    name: counts_from_moments(mean, 1.2, levels=levels, n=12)
    for name, mean in means.items()
}
print(counts_from_moments([-2.8, -1, 0], 1.2, levels=levels).round(2))

# %%
# 3. Vibrations never felt before
# -------------------------------
# A model needs no more than the sampling rate. Its features are also given to ridge
# regression, as are plain statistics; the baselines ignore the vibrations. All
# predictions are out of fold. R² is that of the mean, which was published; the ranked
# probability score (lower is better) also depends on the borrowed deviation.
model = make_haptic_pipeline(Signal(rate=2000), random_state=0)
ridge = RegressedDistribution(RidgeCV(np.logspace(-1, 5, 13)))
models = {
    "default": model,
    "its features, ridge": make_pipeline(model[0], ridge),
    "statistics, ridge": make_pipeline(SignalStatistics(), StandardScaler(), ridge),
    "marginal": DummyDistribution("marginal"),
    "barycentre": DummyDistribution("barycentre"),
}
objects = np.arange(len(trials))
predicted = {}
print("\nrated    predicted by           R²    RPS")
for name, counts in y.items():
    for label, each in models.items():
        proba = cross_val_predict_proba(each, trials, counts, groups=objects, cv=5)
        predicted[name, label] = proba
        r2 = r2_score(means[name], rating_mean(proba, levels=levels))
        rps = ranked_probability_score(counts, proba)
        print(f"{name:<8} {label:<20} {r2:5.2f}  {rps:5.3f}")
    best = [
        noise_ceiling(counts, s).truth for s in (r2_score, ranked_probability_score)
    ]
    print(f"{name:<8} {'(ceiling)':<20} {best[0]:5.2f}  {best[1]:5.3f}")

# %%
# Nobody can predict which twelve people are asked, hence the ceiling: the score of the
# mean, and of the distribution, of everybody.

# %%
# 4. What is predicted
# --------------------
# On the left is the published mean of each vibration against the predicted one. On the
# right is the whole predicted distribution for a vibration that feels weak to people.
name = "energy"
proba = predicted[name, "default"]
weak = int(np.argsort(means[name].to_numpy())[len(means) // 10])
fig, axes = plt.subplots(1, 2, figsize=(10, 3.5), layout="constrained")
axes[0].plot(rating_mean(proba, levels=levels), means[name], "o", alpha=0.6)
axes[0].axline((0, 0), slope=1, color="grey", linewidth=1)
axes[0].set(xlabel=f"predicted mean of {name}", ylabel="published mean")
DistributionDisplay.from_predictions(
    y[name].iloc[[weak]], proba[[weak]], levels=levels, ax=axes[1]
)
plt.show()
