"""
Your own sensor
===============

The transformers need to know two things about a sensor: where its channels lie, if they
make an image, and how long a window should be. This example says both about a gripper
with a skin of 4 × 4 taxels and an accelerometer of three axes, and shows how well the
model predicts what people say. Nothing depends on a BioTac.
"""

# %%
# 1. Recordings
# -------------
# A few lines simulate the sensor. The softer the object, the larger the area of skin
# that touches it; the rougher the object, the stronger the vibration. Trials differ in
# length, in force and in where the skin is touched. The taxels are read row by row, to
# and fro, as the wire runs.
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.compose import make_column_transformer
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    STHMPTransformer,
    TemporalMaxPool,
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
# Each of 30 objects is touched five times, and rated by 15 people from 1 to 5. They
# differ in what they call rough, and feel some things that no sensor records.
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
# 3. What must be changed
# -----------------------
# For the taxels, give the layout: a matrix of shape (height, width, n_channels) with
# the weight of each channel in each pixel. Here each pixel is one channel; a dead taxel
# could be given the weights of its neighbours. Patches of 3 × 3 are large for 4 × 4
# pixels, so we take 2 × 2, of which there are 3 × 3 locations.
layout = np.zeros((4, 4, 16))
np.put_along_axis(layout, wiring[:, :, np.newaxis], 1, axis=2)
skin = STHMPTransformer(
    n_atoms=6,
    n_nonzero_coefs=2,
    layout=layout,
    patch_size=(2, 2),
    spatial_cells=(3, 1),
    max_iter=20,
    random_state=0,
)

# %%
# The trials of one sensor may also be a list of arrays. The layout of another sensor is
# refused.
display = AtomsDisplay.from_estimator(skin.fit([taxels for taxels, _ in cells]))
try:
    STHMPTransformer(layout="biotac").fit(trials["taxels"])
except ValueError as error:
    print(error)

# %%
# For the accelerometer, give the length of a window: 20 samples are 40 ms. Any number
# of channels works; each is cut into windows of its own, and all windows share one
# dictionary.
vibration = KSVDTransformer(
    n_atoms=8, n_nonzero_coefs=2, window=20, max_iter=20, random_state=0
)

# %%
# Each sensor is pooled over time and goes through a transformer of its own.
features = make_column_transformer(
    (make_pipeline(skin, TemporalMaxPool((2, 1))), "taxels"),
    (make_pipeline(vibration, TemporalMaxPool((2, 1))), "accelerometer"),
)
for _, transformer, column in features.transformers:
    print(column, transformer.fit_transform(trials[column]).shape)
regressor = DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=1.0))
model = make_pipeline(features, StandardScaler(), regressor)

# %%
# 4. Objects never touched before
# -------------------------------
# In each fold all trials of some objects are left out, or the model would be asked
# about objects that it knows. `cross_val_predict_proba` keeps the trials of an object
# together, and the counts as they are; scikit-learn's `cross_val_predict` would train
# on ranks. The baselines predict one distribution for all, whatever the sensors say.
# Lower is better.
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
# The figure shows what the model says of the roughest object, from each of its five
# touches.
of_object = objects == roughness.argmax()
display = InverseCDFDisplay.from_predictions(
    y["rough"][of_object], predicted["rough", "model"][of_object]
)
display.figure_.suptitle("How rough is the roughest object, never touched before?")
if matplotlib.get_backend().lower() != "agg":
    plt.show()
