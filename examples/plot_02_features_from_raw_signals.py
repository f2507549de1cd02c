"""
Features from raw signals
=========================

A touch is thousands of samples of several sensors, but a model needs one row of
numbers. This example follows one touch from signals to windows, atoms, codes and their
maxima, and says what each step keeps and what it drops.
"""

# %%
# 1. Signals
# ----------
# A trial is a row of a DataFrame and a sensor is a column; each cell is an array of
# samples of two fingers. With the same seed, the corpus holds the same objects for
# every exploratory procedure, so the figure can compare the procedures. It shows
# vibration (pac), pressure (pdc), heat flow (tac), temperature (tdc) and the electrodes
# under the skin.
import time

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline

from sklearn_haptic import KSVDTransformer, TemporalMaxPool
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.plotting import AtomsDisplay, SignalsDisplay

procedures = ["squeeze", "hold", "slow_slide", "fast_slide"]
corpora = {
    name: make_haptic_corpus(n_objects=20, n_trials=1, procedure=name, random_state=0)
    for name in procedures
}
number = list(corpora["hold"].object_names).index("plastic")
display = SignalsDisplay.from_trials(
    {name: corpus.trials.iloc[number] for name, corpus in corpora.items()}
)
display.figure_.suptitle("One plastic object, touched in four ways")

# %%
# 2. Windows
# ----------
# From here on we follow the vibration of fast slides. Each finger's signal is cut into
# windows of 22 samples (10 ms). Neighbouring windows overlap by half. The order of the
# windows is kept; samples after the last whole window are dropped.
rate = corpora["fast_slide"].sampling_rates["pac"]
trials = corpora["fast_slide"].trials["pac"]
trial = trials.iloc[number]
coder = KSVDTransformer(n_atoms=40, window=22, random_state=0)
started = time.perf_counter()
codes = coder.fit_transform(trials)[number]
print(f"{len(trial)} samples of 2 fingers, {len(trial) / rate:.2f} s")
print(f"{len(codes)} windows, {codes.shape[1]} codes each")
print(f"dictionary and codes: {time.perf_counter() - started:.1f} s")

# %%
# 3. Atoms
# --------
# K-SVD learns 40 atoms such that each window, minus its mean, is nearly a weighted sum
# of at most four atoms. Atoms have no unit, because each has norm 1; the code says how
# much of each atom a window contains. We sort the atoms by the share of all windows
# that use them.
display = AtomsDisplay.from_estimator(coder, trials, sampling_rate=rate)
display.figure_.suptitle("Atoms of vibration, and the share of windows that use each")

# %%
# 4. What the reconstruction error says
# -------------------------------------
# Multiplying a code by the atoms reconstructs the window. Positive and negative parts
# are in separate columns, finger after finger.
positive, negative = codes.reshape(len(codes), 2, 2, 40).transpose(2, 0, 1, 3)
rebuilt = (positive - negative) @ coder.components_
windows = np.lib.stride_tricks.sliding_window_view(trial, 22, axis=0)[::11]
centred = windows - windows.mean(axis=2, keepdims=True)
errors = np.square(rebuilt - centred).mean(axis=2)
order = np.argsort(errors, axis=None)
_, axes = plt.subplots(1, 2, figsize=(6.4, 2.8), layout="constrained")
for ax, rank, title in zip(axes, (errors.size // 2, -1), ("median", "worst")):
    at = np.unravel_index(order[rank], errors.shape)
    milliseconds = 1000 * np.arange(22) / rate
    ax.plot(milliseconds, centred[at], "o", color="0.5", label="recorded")
    ax.plot(milliseconds, rebuilt[at], color="#0072B2", label="sum of 4 atoms")
    ax.set(xlabel="time, ms", ylabel="pac less its mean, counts")
    ax.set_title(f"the {title} window of this trial")
axes[0].legend()

# %%
# The transformer reports the root mean square error over the training windows, in the
# unit of the signal. Each further atom that a code may use lowers the error, by less
# each time. A small error shows that the codes represent the windows well. It does not
# show that the codes predict how objects feel: only the scores of a model on unseen
# objects can show that.
spread = np.sqrt(
    np.mean(
        [
            np.lib.stride_tricks.sliding_window_view(each, 22, axis=0)[::11]
            .var(axis=2)
            .mean()
            for each in trials
        ]
    )
)
print(f"Windows about their means: {spread:.1f} counts\nerror of codes of")
for n_nonzero_coefs in (1, 2, 4, 8):
    coder.set_params(n_nonzero_coefs=n_nonzero_coefs).fit(trials)
    error = coder.reconstruction_error_
    print(f"  {n_nonzero_coefs} atoms: {error:4.1f} counts, {error / spread:4.0%}")

# %%
# 5. Means
# --------
# By default, each window's mean is removed, because it is not useful in vibration. Two
# windows that differ only in their mean then have the same code. In pressure and
# temperature, the mean is information, and ``remove_mean=False`` keeps it.
pressure = corpora["fast_slide"].trials["pdc"]
for remove_mean in (True, False):
    of_pressure = KSVDTransformer(
        10, window=50, remove_mean=remove_mean, random_state=0
    ).fit(pressure)
    low, high = of_pressure.transform([pressure.iloc[0], pressure.iloc[0] + 100])
    same = np.allclose(low, high, atol=1e-3)
    print(f"remove_mean={remove_mean}: 100 counts more give the same codes: {same}")

# %%
# 6. One row per trial
# --------------------
# Trials differ in length. `TemporalMaxPool` takes the maximum of each code in four
# quarters, two halves and the whole recording, so every trial has the same number of
# features. These features say whether an atom appeared, how strongly and in which
# quarter. They do not say how often or when exactly.
coder.set_params(n_nonzero_coefs=4)
pipeline = make_pipeline(coder, TemporalMaxPool((4, 2, 1)))
features = pipeline.fit_transform(trials)
print(f"{features.shape[0]} trials, {features.shape[1]} features each, such as")
print(pipeline.get_feature_names_out()[[0, 200, -1]])

# %%
# The figure shows this for one finger and ten atoms, so that single codes are visible:
# the codes over time, and the maxima in the four quarters.
few = make_pipeline(
    KSVDTransformer(n_atoms=10, window=22, n_nonzero_coefs=2, random_state=0),
    TemporalMaxPool((4, 2, 1)),
).fit([each[:, :1] for each in trials])
codes = few[0].transform([trial[:, :1]])[0].T
quarters = few.transform([trial[:, :1]])[0, : 4 * len(codes)].reshape(4, -1).T
figure, axes = plt.subplots(2, figsize=(6.4, 4.4), layout="constrained", sharex=True)
seconds = 0, len(trial) / rate, len(codes) - 0.5, -0.5
for ax, values, title in zip(axes, (codes, quarters), ("codes", "maxima of quarters")):
    image = ax.imshow(np.sqrt(values), cmap="Blues", aspect="auto", extent=seconds)
    figure.colorbar(image, ax=ax, label="square root of code")
    ax.set(title=title, ylabel="atom, + then −")
axes[1].set_xlabel("time, s")
if matplotlib.get_backend().lower() != "agg":
    plt.show()
