"""
A touch in progress
===================

A robot pays for accuracy in seconds of touch. Here a model predicts while the finger is
still on the object, and a rule lifts the finger when touching on gains less than it
costs.
"""

# %%
# 1. A model of prefixes
# ----------------------
# A model of whole touches is worse than guessing on the first seconds of one.
# :class:`~sklearn_haptic.AnytimeRegressor` therefore learns from the first seconds of
# the training touches too, at each of several durations. Windows of 20 samples let
# pressure and heat flow speak after a quarter of a second. The objects are given as
# groups, so that the calibration and the rule are learned from objects held out.
import matplotlib.pyplot as plt
import numpy as np

from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.plotting import TouchTimeDisplay
from sklearn_haptic.streaming import ExpectedGain

sensors = ["pac", "pdc", "tac"]
corpus = make_haptic_corpus(
    48, 2, procedure="slow_slide", sensors=sensors, random_state=0
)
held_out = np.isin(corpus.objects, np.unique(corpus.objects)[::3])
touches, hard = corpus.trials, corpus.ratings["hard"]

pipeline = make_haptic_pipeline(sensors, random_state=0)
pipeline.set_params(
    features__pdc__ksvdtransformer__window=20,
    features__tac__ksvdtransformer__window=20,
)
model = AnytimeRegressor(
    pipeline,
    durations=[0.1, 0.25, 0.5, 1, 2, 4],
    sampling_rates=corpus.sampling_rates,
    cv=3,
    stopping=ExpectedGain(price=0.01),
)
model.fit(touches[~held_out], hard[~held_out], groups=corpus.objects[~held_out])

# %%
# 2. A callback per message
# -------------------------
# Samples arrive in messages of 10 ms. The touch takes them, whatever their number, and
# predicts from the longest duration that is complete. On a robot the loop is a callback
# of the driver; the guide *Touches in progress* has one for ROS 2.
trial = np.flatnonzero(held_out)[4]
recorded, touch = touches.iloc[trial], model.start()
steps = {}
for i in range(500):
    new = {
        sensor: recorded[sensor][i * rate // 100 : (i + 1) * rate // 100]
        for sensor, rate in corpus.sampling_rates.items()
    }
    proba = touch.update(new).predict_proba()
    if i + 1 in (5, 10, 50, 100, 400):
        steps[touch.seconds] = proba

# %%
# The distribution grows sharper. Before the first duration it is that of all training
# touches. The bars in the last panel are what people said.
figure, axes = plt.subplots(1, 6, figsize=(10, 2.4), sharey=True, layout="constrained")
for ax, (seconds, proba) in zip(axes, steps.items()):
    ax.bar(corpus.levels, proba, color="0.4")
    ax.set(title=f"{seconds:.2f} s", xlabel="hard")
axes[-1].bar(corpus.levels, hard[trial] / hard[trial].sum(), color="#E69F00")
axes[-1].set(title="people", xlabel="hard")
axes[0].set_ylabel("share of people")

# %%
# 3. When to stop
# ---------------
# The rule expects to gain nothing from touching on if the loss that it has learned to
# expect, the ranked probability score, falls by less than the price of the seconds. A
# higher price buys shorter touches. One price after another gives the rule's curve,
# to be compared with that of fixed durations; the bar shows where touches stop at the
# price of the model.
seconds = model.durations_
proba = model.predict_proba_over_time(touches[held_out], seconds)
counts = hard[~held_out]
stops = [
    ExpectedGain(price).fit(model.oof_proba_, counts, durations=seconds).stop_at(proba)
    for price in (0.1, 0.03, 0.003, 0.01)
]
TouchTimeDisplay.from_predictions(
    hard[held_out],
    proba,
    seconds,
    stopped={"expected gain": np.array(stops)},
    groups=corpus.objects[held_out],
)

# %%
# On ratings the rule is about as good as a fixed duration of the same mean: how fast an
# object is known hardly differs between objects, and that people disagree is not
# mended by touching on. Where one of several classes is right the rule gains more.
_, stopped_at = model.predict_when_done(touches[held_out])
for seconds, n in zip(*np.unique(stopped_at, return_counts=True)):
    print(f"{n} touches are done after {seconds:g} s")
