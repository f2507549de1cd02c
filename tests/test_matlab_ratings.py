"""`MatlabRatings`: arrays of files of SciPy and of MATLAB 7.3, beside plain loops."""

from itertools import permutations

import numpy as np
import pytest
from scipy.io import savemat
from test_phac2 import write_trial

from sklearn_haptic.datasets import MatlabRatings, load_phac2

h5py = pytest.importorskip("h5py")

IDS = [602, 7, 114]
TRIALS = ["cup_7_01", "sponge_114_02", "sponge_114_10", "mat_602_01"]
OBJECTS = [7, 114, 114, 602]
ADJECTIVES = ["hard", "soft", "rough", "cold"]
CELLS = np.array(ADJECTIVES, dtype=object)
TOLD = {"objects": IDS, "adjectives": ADJECTIVES}


def save_v73(path, variables):
    """Write numbers and structs as MATLAB 7.3 does: axes reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            _write(file, name, value)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


def _write(file, name, value):
    if isinstance(value, dict):
        for field, inner in value.items():
            _write(file, f"{name}/{field}", inner)
        return
    value = np.asarray(value)
    if value.dtype == object:  # cells are references
        value = np.full(value.shape, file.ref, dtype=h5py.ref_dtype)
    file[name] = np.atleast_2d(value).T


@pytest.fixture(params=[savemat, save_v73])
def save(request, tmp_path):
    def save(**variables):
        request.param(tmp_path / "ratings.mat", variables)
        return tmp_path / "ratings.mat"

    return save


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    path = tmp_path_factory.mktemp("corpus") / "corpus.h5"
    with h5py.File(path, "w") as file:
        for name in TRIALS:
            write_trial(file, name)
    return path


@pytest.fixture
def ratings():
    """Ratings of 3 objects on 4 adjectives by 12 people, of whom some gave none."""
    rng = np.random.default_rng(0)
    ratings = rng.choice(6, (3, 4, 12), p=[0.1, 0.3, 0.2, 0.2, 0.1, 0.1])
    ratings[1, :, 5] = 0
    return ratings


def load(corpus, path, **told):
    told = {"variable": "a"} | TOLD | told
    ratings = MatlabRatings(path, **told)
    return load_phac2(corpus, sensors=["pdc"], trials=TRIALS, ratings=ratings)


def assert_counted(loaded, ratings, adjectives=ADJECTIVES):
    """Compare the counts of each trial with those of a plain loop."""
    assert list(loaded.ratings) == list(adjectives)
    for j, adjective in enumerate(adjectives):
        assert loaded.ratings[adjective].dtype == np.int64
        for found, object_id in zip(loaded.ratings[adjective], OBJECTS):
            own = ratings[IDS.index(object_id), j]
            assert found.tolist() == [sum(own == level) for level in range(1, 6)]


@pytest.mark.parametrize("order", [*permutations(range(3))])
@pytest.mark.parametrize("missing", [0, np.nan])
def test_answers_with_axes_in_any_order(corpus, save, ratings, order, missing):
    array = np.where(ratings == 0, missing, ratings).transpose(order)
    axes = np.take(["objects", "adjectives", "raters"], order)
    loaded = load(corpus, save(a=array), axes=axes)
    assert_counted(loaded, ratings)
    people = loaded.rater_ratings
    assert people.index.names == ["object", "rater"] and list(people) == ADJECTIVES
    for i, object_id in enumerate(IDS):
        for rater in range(1, 13):
            own = ratings[i, :, rater - 1]
            if own.any():
                found = people.loc[(object_id, rater)]
                np.testing.assert_array_equal(found, np.where(own, own, np.nan))
            else:
                assert (object_id, rater) not in people.index


@pytest.mark.parametrize("order", [*permutations(range(3))])
@pytest.mark.parametrize("dtype", [np.uint8, float])
def test_counts_with_axes_in_any_order(corpus, save, ratings, order, dtype):
    counts = (ratings[..., None] == np.arange(1, 6)).sum(axis=2)
    axes = np.take(["objects", "adjectives", "levels"], order)
    path = save(a=counts.transpose(order).astype(dtype))
    loaded = load(corpus, path, axes=axes)
    assert_counted(loaded, ratings)
    assert loaded.rater_ratings is None


AXES = ("objects", "adjectives", "raters")


def test_objects_that_the_file_lists(corpus, save, ratings):
    """Also in a struct, beside variables that are not asked for."""
    path = save(study={"a": ratings, "ids": IDS}, a=np.ones((3, 4, 5)), odd=CELLS)
    told = {"variable": "study.a", "objects": "study.ids"}
    assert_counted(load(corpus, path, axes=AXES, **told), ratings)


def test_axes_of_length_one(corpus, save, ratings):
    """MATLAB drops the last ones."""
    path = save(a=ratings[:, :1, :1].clip(1)[:, :, 0], b=ratings[:, 0])
    one = load(corpus, path, axes=AXES, adjectives=["hard"])
    assert_counted(one, ratings[:, :1, :1].clip(1), ["hard"])
    axes = ("objects", "raters", "adjectives")
    loaded = load(corpus, path, variable="b", axes=axes, adjectives=["hard"])
    assert_counted(loaded, ratings[:, :1], ["hard"])


@pytest.mark.parametrize(
    "told, message",
    [
        ({"axes": ("objects", "adjectives", *["raters"] * 2)}, "must be 'objects', 'a"),
        ({"axes": ("adjectives", "objects", "raters")}, r"of shape \(4, 3, 12\); mend"),
        ({"objects": "ids"}, r"has no (variable )?'ids'; it has .*'a'"),
        ({"variable": "s.a.b"}, "has no variable 's.a.b'|is not a group"),
        ({"variable": "s"}, r"'s' of .*mat has shape|/s of .* is not a dataset"),
        ({"variable": "words"}, "has dtype object; it must|'words' of .* has shape"),
        ({"variable": "half"}, "'hard': ratings has the rating 1.5 in row 0, which is"),
        ({"variable": "none"}, "'rough'.* has no ratings of objects .602."),
    ],
)
def test_what_does_not_fit(corpus, save, ratings, told, message):
    none = ratings.copy()
    none[0, 2] = 0
    path = save(
        a=ratings,
        half=ratings.clip(1) / 2,
        none=none,
        words=CELLS,
        s={"a": ratings},
    )
    with pytest.raises(ValueError, match=message):
        load(corpus, path, **{"axes": AXES} | told)
