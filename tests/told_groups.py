"""A classifier that asks for the objects and remembers what it was told."""

from sklearn.dummy import DummyClassifier


class Told(DummyClassifier):
    __metadata_request__fit = {"groups": True}  # noqa: RUF012

    def fit(self, X, y, sample_weight=None, *, groups=None):
        self.groups_ = groups
        return super().fit(X, y, sample_weight)
