"""What the classifiers of this package share: ordered classes, scored as such."""

from numpy.typing import ArrayLike
from sklearn.base import ClassifierMixin

from .._sklearn import Trials
from ..metrics import neg_rps_scorer


class OrdinalClassifierMixin(ClassifierMixin):
    """Mixin, in place of `ClassifierMixin`: one score for labels and for counts."""

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.classifier_tags.poor_score = True  # on classes that have no order
        return tags

    def score(
        self, X: Trials, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> float:
        """Return the negative mean ranked probability score; higher is better.

        Labels and counts are scored by the same rule, not by the accuracy of
        scikit-learn's classifiers, which ignores both the order of the levels and
        the predicted probabilities; ``scoring="accuracy"`` gives that for labels.

        Parameters
        ----------
        X : array-like of shape (n_trials, n_features)
            Features of each trial, or whatever else `predict_proba` takes.
        y : array-like of shape (n_trials, n_levels) or (n_trials,)
            Counts of each rating, or one rating a trial. Of several adjectives that
            were learnt together, counts of shape (n_trials, n_adjectives, n_levels),
            whose scores are averaged.
        sample_weight : array-like of shape (n_trials,), default=None
            Weight of each trial.

        Returns
        -------
        score : float
        """
        return neg_rps_scorer(self, X, y, sample_weight)
