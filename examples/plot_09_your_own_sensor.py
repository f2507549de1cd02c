"""
Your own sensor
===============

Describe each sensor to get a model for it. Here a gripper has a skin of 4 × 4 taxels
and an accelerometer with three axes. This example describes both, repairs faulty
recordings, and shows how well the model predicts people's ratings. Nothing depends on a
BioTac.
"""

# %%
# 1. Recordings
# -------------
# A few lines simulate the sensor. The softer the object, the larger the area of skin
# that touches it; the rougher the object, the stronger the vibration. Trials differ in
# length, in force and in where the skin is touched. The taxels are read row by row, in
# alternating directions, as the wire runs.
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline

from sklearn_haptic import (
    DummyDistribution,
    RepairTrials,
    Signal,
    TaxelGrid,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import earth_movers_distance, ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba
from sklearn_haptic.plotting import AtomsDisplay, InverseCDFDisplay, SignalsDisplay

rng = np.random.default_rng(0)
wiring = np.arange(16).reshape(4, 4)
wiring[1::2] = wiring[1::2, ::-1]  # the channel at each row and column of the skin


def touch(softness, roughness):
    """Return readings of the taxels at 50 Hz and accelerations at 500 Hz."""
    n_times = rng.integers(50, 100)
    force = rng.uniform(0.8, 1.2) * -np.expm1(-np.arange(n_times) / 10)
    row, column = rng.normal(1.5, 0.3, size=2)
    distance = np.hypot(*np.ogrid[-row : 4 - row, -column : 4 - column])
    radius = 0.5 + softness * np.sqrt(force)[:, None, None]
    skin = 100 * force[:, None, None] * np.exp(-((distance / radius) ** 2) / 2)
    taxels = np.empty((n_times, 16))
    taxels[:, wiring] = skin + rng.normal(size=skin.shape)
    strength = 0.2 + roughness * force.repeat(10)[:, None] * [1.0, 0.6, 0.3]
    return taxels, strength * rng.normal(size=(10 * n_times, 3))


# %%
# 2. Ratings
# ----------
# Each of 30 objects is touched five times, and 15 people rate it from 1 to 5. People
# differ in what they call rough, and feel some properties that no sensor records.
n_objects, n_trials, n_people = 30, 5, 15
softness, roughness = rng.uniform(size=(2, n_objects))
objects = np.repeat(np.arange(n_objects), n_trials)
cells = [touch(softness[i], roughness[i]) for i in objects]
trials = pd.DataFrame(cells, columns=["taxels", "accelerometer"])
y = {}
for adjective, felt in {"soft": softness, "rough": roughness}.items():
    opinion = felt + rng.normal(scale=0.1, size=n_objects)
    opinion = opinion[:, None] + rng.normal(scale=0.2, size=(n_objects, n_people))
    rating = np.digitize(opinion, [0.2, 0.4, 0.6, 0.8])
    counts = (rating[:, :, None] == np.arange(5)).sum(axis=1)
    y[adjective] = counts[objects]  # one row per trial: the ratings of its object

hard, soft = softness[objects].argmin(), softness[objects].argmax()
display = SignalsDisplay.from_trials(
    {"the hardest object": trials.iloc[hard], "the softest object": trials.iloc[soft]},
    sampling_rate={"taxels": 50, "accelerometer": 500},
    unit={"taxels": "counts", "accelerometer": "m/s²"},
)

# %%
# 3. Descriptions of the sensors
# ------------------------------
# The taxels need a layout: ``np.eye(16)[wiring]`` has the weight of each channel in
# each pixel; here each pixel is one channel. If all rows were read in the same
# direction, ``(4, 4)`` would be enough. The accelerometer needs the rate. Its windows
# have ten samples, unless you give their length in seconds.
sensors = {
    "taxels": TaxelGrid(np.eye(16)[wiring]),
    "accelerometer": Signal(rate=500),
}
model = make_haptic_pipeline(sensors, random_state=0)
print(model[0].fit_transform(trials).shape)

# %%
# Each sensor has codes and statistics. The atoms of the codes are drawn from the
# touches; those of the skin are patches of 2 × 2 taxels. You can access and set every
# part of the model, as in any Pipeline.
codes = model[0].named_transformers_["taxels"]["codes"]
display = AtomsDisplay.from_estimator(codes[0])

# %%
# 4. Faulty recordings
# --------------------
# Real recordings have faults. Here a taxel is dead, frames are lost and one trial has
# no acceleration. `RepairTrials` repairs these faults, and lists each repair.
for i in range(5):
    trials["taxels"][i][:, 6] = 0
trials["taxels"][20][15:18] = np.nan
trials.at[30, "accelerometer"] = None
model = make_pipeline(RepairTrials(), model).fit(trials, y["rough"])
print(model[0].faults_[["trial", "sensor", "channel", "fault", "answer"]].to_string())

# %%
# 5. Objects never touched before
# -------------------------------
# In each fold, all trials of some objects are left out; otherwise the model would be
# tested on objects that it knows. `cross_val_predict_proba` keeps the trials of an
# object together and the counts as they are; scikit-learn's `cross_val_predict` would
# train on ranks. The baselines ignore the sensors and predict one distribution for all
# trials. Lower scores are better.
models = {
    "model": model,
    "marginal": DummyDistribution("marginal"),
    "barycentre": DummyDistribution("barycentre"),
}
predicted = {}
print("\nadjective  predicted by   RPS    EMD")
for adjective, counts in y.items():
    for name, each in models.items():
        proba = cross_val_predict_proba(each, trials, counts, groups=objects, cv=4)
        predicted[adjective, name] = proba
        rps = ranked_probability_score(counts, proba)
        emd = earth_movers_distance(counts, proba)
        print(f"{adjective:<10} {name:<12} {rps:5.3f}  {emd:5.3f}")

# %%
# The figure shows the predictions for the roughest object, from each of its five
# touches.
of_object = objects == roughness.argmax()
display = InverseCDFDisplay.from_predictions(
    y["rough"][of_object], predicted["rough", "model"][of_object]
)
display.figure_.suptitle("How rough is the roughest object, never touched before?")
if matplotlib.get_backend().lower() != "agg":
    plt.show()
