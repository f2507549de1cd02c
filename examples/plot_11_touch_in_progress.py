"""
A touch in progress
===================

Longer touches predict better, but cost time. Here a model predicts while the finger is
still on the object, and a rule lifts the finger when a longer touch gains less than it
costs.
"""

# %%
# 1. A model of prefixes
# ----------------------
# A model of whole touches has not learned what the beginning of a touch is like, so
# what it predicts from the first second is worse than it need be.
# :class:`~sklearn_haptic.AnytimeRegressor` therefore also learns from the beginnings of
# the training touches, at each of several durations. With windows of 20 samples, codes
# of pressure and heat flow are used after a quarter of a second. The objects are given
# as groups, so the calibration and the rule are learned from objects held out.
import matplotlib.pyplot as plt
import numpy as np

from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score
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
    features__pdc__codes__ksvdtransformer__window=20,
    features__tac__codes__ksvdtransformer__window=20,
)
model = AnytimeRegressor(
    pipeline,
    durations=[0.1, 0.25, 0.5, 1, 2, 4],
    sampling_rates=corpus.sampling_rates,
    cv=3,
    stopping=ExpectedGain(price=0.03),
)
model.fit(touches[~held_out], hard[~held_out], groups=corpus.objects[~held_out])

# %%
# 2. A callback per message
# -------------------------
# Samples arrive in messages of 10 ms. The touch takes any number of samples, and
# predicts from the longest complete duration. On a robot, a callback of the driver
# replaces the loop; the guide *Touches in progress* has one for ROS 2.
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
# The distribution becomes sharper with time. Before the first duration, it is that of
# all training touches. The last panel shows people's ratings.
figure, axes = plt.subplots(1, 6, figsize=(10, 2.4), sharey=True, layout="constrained")
for ax, (seconds, proba) in zip(axes, steps.items()):
    ax.bar(corpus.levels, proba, color="0.4")
    ax.set(title=f"{seconds:.2f} s", xlabel="hard")
axes[-1].bar(corpus.levels, hard[trial] / hard[trial].sum(), color="#E69F00")
axes[-1].set(title="people", xlabel="hard")
axes[0].set_ylabel("share of people")

# %%
# 3. What a second costs
# ----------------------
# The rule stops a touch if it expects the loss (the ranked probability score) to fall
# by less than the price of the further seconds. Choose the price on the training
# touches, whose predictions out of fold the model keeps, by the seconds that you can
# afford: a higher price gives shorter touches and a higher loss.
seconds, counts = model.durations_, hard[~held_out]
prices = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3]
oof, spent, loss = model.oof_proba_, [], []
for price in prices:
    rule = ExpectedGain(price).fit(oof, counts, durations=seconds)
    stop = rule.stop_at(oof)
    spent.append(seconds[stop].mean())
    chosen = oof[np.arange(len(stop)), stop]
    loss.append(ranked_probability_score(counts, chosen))
figure, axes = plt.subplots(1, 2, figsize=(8, 2.8), layout="constrained")
for ax, values, name in zip(axes, (spent, loss), ("mean seconds", "RPS")):
    ax.plot(prices, values, "o-", color="black")
    ax.axvline(model.stopping.price, color="#E69F00", linestyle="--")
    ax.set(xscale="log", xlabel="price of a second, RPS", ylabel=name)

# %%
# 4. Is a rule worth it?
# ----------------------
# On touches of other objects, several prices give a curve of the rule, to compare with
# that of fixed durations. The bars show where touches stop at the price of the model.
proba = model.predict_proba_over_time(touches[held_out], seconds)
stops = [
    ExpectedGain(price).fit(oof, counts, durations=seconds).stop_at(proba)
    for price in (0.1, 0.01, 0.003, 0.03)
]
TouchTimeDisplay.from_predictions(
    hard[held_out],
    proba,
    seconds,
    stopped={"expected gain": np.array(stops)},
    groups=corpus.objects[held_out],
)

# %%
# On ratings, the rule is about as good as a fixed duration of the same mean: objects
# hardly differ in how soon they are known, and longer touches do not reduce the
# disagreement of people. If one of several classes is right, the rule can gain more.
_, stopped_at = model.predict_when_done(touches[held_out])
for duration, n in zip(*np.unique(stopped_at, return_counts=True)):
    print(f"{n} touches are done after {duration:g} s")
