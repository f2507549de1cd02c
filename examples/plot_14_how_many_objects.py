"""
How many objects do I need?
===========================

More objects make a model better, up to a point, and every object has to be rated by
people. A learning curve shows from the objects that you have whether more would help:
the model learns from some of them, and predicts others.
"""

# %%
# 1. Your corpus
# --------------
# The curve takes touches, the counts of their ratings, and the object of each touch.
# Put your own in their place.
import matplotlib.pyplot as plt
import numpy as np
from sklearn.model_selection import GroupKFold

from sklearn_haptic import DummyDistribution, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.model_selection import cross_val_predict_proba

sensors = ["pdc", "tdc"]
corpus = make_haptic_corpus(60, 2, "hold", sensors=sensors, random_state=0)
trials, objects = corpus.trials, corpus.objects
counts = np.asarray(corpus.ratings["hard"])
model = make_haptic_pipeline(sensors, random_state=0)

# %%
# 2. Learn from some of the objects
# ---------------------------------
# Each fold learns from some of its training objects and predicts the others. The larger
# draws contain the smaller ones, so that chance moves the curve little. What counts is
# how much lower the ranked probability score (RPS) is than that of guessing.
names, which = np.unique(objects, return_inverse=True)
order = np.random.default_rng(0).permutation(len(names))
folds = [*GroupKFold(5).split(trials, groups=objects)]
fewest = min(len(np.unique(which[train])) for train, _ in folds)
numbers = [n for n in (fewest // 8, fewest // 4, fewest // 2, fewest) if n > 2]


def some(train, n):
    """Return the training touches of the first n objects in a fixed random order."""
    kept = [i for i in order if i in which[train]][:n]
    return train[np.isin(which[train], kept)]


def gains(counts):
    """Return how much better than guessing each object is predicted, by number."""
    found = []
    for n in numbers:
        fewer = [(some(train, n), test) for train, test in folds]
        guess, ours = (
            ranked_probability_score(
                counts,
                cross_val_predict_proba(each, trials, counts, groups=objects, cv=fewer),
                average=False,
            )
            for each in (DummyDistribution(), model)
        )
        found.append(np.bincount(which, guess - ours) / np.bincount(which))
    return np.array(found)


# %%
# 3. Is there anything to learn?
# ------------------------------
# Dealt anew among the objects, the ratings have nothing to do with the touches. A good
# model then guesses; how far its curve is from zero shows what luck can do.
first = np.unique(which, return_index=True)[1]
dealt = np.random.default_rng(1).permutation(first)[which]
curves = {"ratings": gains(counts), "ratings dealt anew": gains(counts[dealt])}
for (name, gain), marker in zip(curves.items(), "os"):
    error = gain.std(axis=1, ddof=1) / np.sqrt(len(names))
    plt.errorbar(numbers, gain.mean(axis=1), 2 * error, marker=marker, label=name)
plt.axhline(0, color="black", linewidth=0.8)
plt.xlabel("objects that the model learns from")
plt.ylabel("RPS of guessing minus RPS of the model")
plt.legend(loc="center right")
plt.show()

# %%
# 4. Would more objects help?
# ---------------------------
# The last doubling says most about the next one. If it gained less than two standard
# errors, put the effort into better touches, other sensors or more raters instead.
last = curves["ratings"][-1] - curves["ratings"][-2]
error = last.std(ddof=1) / np.sqrt(len(names))
print(f"From {numbers[-2]} to {numbers[-1]} objects: {last.mean():.3f} ± {error:.3f}")
