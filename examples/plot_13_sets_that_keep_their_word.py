"""
Sets that keep their word
=========================

A predicted distribution says what a crowd would answer, but not how far it may be off.
A set of levels says it for one person: of a new object, it holds the answer of somebody
drawn anew with the probability that you choose. A band says it for a whole crowd.
"""

# %%
# 1. Learn from all objects, and be judged by all
# -----------------------------------------------
# :class:`~sklearn_haptic.ConformalRatings` takes any model. It fits it without each
# fold of objects and sees how far people's ratings of these are from what it predicts.
import matplotlib.pyplot as plt
import numpy as np

from sklearn_haptic import ConformalRatings, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.plotting import DistributionDisplay

corpus = make_haptic_corpus(90, 2, sensors=["pdc", "tdc"], random_state=0)
names = np.unique(corpus.objects)
old = np.isin(corpus.objects, np.random.default_rng(0).permutation(names)[:50])
trials, objects = corpus.trials, corpus.objects
hard = np.asarray(corpus.ratings["hard"])

model = ConformalRatings(make_haptic_pipeline(["pdc", "tdc"], random_state=0))
model.fit(trials[old], hard[old], groups=objects[old])

# %%
# 2. Does it keep its word?
# -------------------------
# For new objects, count how many of the people who rated them are within the sets. The
# smaller alpha is, the larger are the sets. Below 1 / 51, with 50 objects, nothing
# could be left out.
share = hard[~old] / hard[~old].sum(axis=1, keepdims=True)
for alpha in (0.3, 0.2, 0.1):
    chosen = model.predict_set(trials[~old], alpha)
    lower, upper = model.predict_band(trials[~old], alpha)
    below = np.cumsum(share, axis=1)
    within = ((lower <= below + 1e-9) & (below <= upper + 1e-9)).all(axis=1)
    people, size = (chosen * share).sum(axis=1).mean(), chosen.sum(axis=1).mean()
    print(f"promised {1 - alpha:.0%}: {people:.0%} of people, in {size:.1f} levels")
    print(f"               {within.mean():.0%} of crowds")

# %%
# This is one draw of fifty objects. Another draw is off by some percent in either
# direction; the promise is that of the average over draws.

# %%
# 3. The set and the band of one object
# -------------------------------------
# Of a new object about which people disagree, the levels in the 80 % sets of two
# touches are shaded on the left, darker if they are in both. On the right are the band
# for the CDF of twelve people, and the CDF of those who rated it.
contested = objects[~old][np.argmax((share > 0).sum(axis=1))]
one = objects == contested
fig, axes = plt.subplots(1, 2, figsize=(10, 3.5), layout="constrained")
DistributionDisplay.from_estimator(model, trials[one], hard[one], alpha=0.2, ax=axes[0])
lower, upper = model.predict_band(trials[one], alpha=0.2)
axes[1].fill_between(model.classes_, lower[0], upper[0], step="post", alpha=0.25)
axes[1].step(model.classes_, below[objects[~old] == contested][0], "k", where="post")
axes[1].set(
    xlabel="rating", ylabel="share of people at or below", xticks=model.classes_
)
plt.show()

# %%
# 4. What is not promised
# -----------------------
# The average is over objects, so that contested ones may be covered less often than
# agreed ones. Here the touches are divided by how spread the predictions are.
chosen = model.predict_set(trials[~old], 0.2)
inside = (chosen * share).sum(axis=1)
proba = model.predict_proba(trials[~old])
variance = proba @ np.arange(5) ** 2 - (proba @ np.arange(5)) ** 2
order = np.argsort(variance)
for name, rows in zip(("narrow", "middle", "wide"), np.array_split(order, 3)):
    print(f"{name} predictions: {inside[rows].mean():.0%} of people")
