from itertools import permutations

import numpy as np
import pytest
from scipy.io import savemat

from sklearn_haptic.datasets import MatlabRatings
from sklearn_haptic.datasets._matlab_ratings import read_matlab
from sklearn_haptic.datasets._rated import ADJECTIVES, LEVELS, ratings_of_trials
from sklearn_haptic.ratings import rating_counts

IDS = np.arange(101, 161)  # 60 objects
TRIALS = np.repeat(IDS, 2)


@pytest.fixture
def ratings():
    """Ratings of 60 objects, 10 adjectives and 12 raters, some missing."""
    rng = np.random.default_rng(0)
    return rng.choice(6, (60, 10, 12), p=[0.02, 0.3, 0.3, 0.2, 0.1, 0.08])


@pytest.fixture
def counts(ratings):
    """How often each level occurs, by another route than the reader's."""
    return np.array(
        [[np.bincount(cell, minlength=6)[1:] for cell in row] for row in ratings]
    )


def cells(texts):
    return np.array(texts, dtype=object)


def save_v7(path, variables):
    savemat(path, variables)


def save_v73(path, variables):
    """Write numbers and cell arrays of strings as MATLAB 7.3 does: axes reversed."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            value = np.asarray(value)
            if value.dtype == object:
                references = []
                for i, text in enumerate(value.ravel()):
                    codes = np.array([[ord(letter)] for letter in text], dtype="u2")
                    cell = file.create_dataset(f"#refs#/{name}{i}", data=codes)
                    cell.attrs["MATLAB_class"] = np.bytes_("char")
                    references.append([cell.ref])
                dataset = file.create_dataset(
                    name, data=np.array(references, dtype=h5py.ref_dtype)
                )
                dataset.attrs["MATLAB_class"] = np.bytes_("cell")
            else:
                file[name] = np.atleast_2d(value).T
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


@pytest.fixture(params=[save_v7, save_v73])
def save(request, tmp_path):
    def save(**variables):
        request.param(tmp_path / "ratings.mat", variables)
        return tmp_path / "ratings.mat"

    return save


def read_ratings(path, known, of_trials, /, **told):
    """Read the ratings of a corpus of known objects, for trials of some of them."""
    trials = [f"x_{object_id}_{run}" for run, object_id in enumerate(of_trials)]
    object_of = {f"y_{object_id}_1": object_id for object_id in np.asarray(known)}
    object_of |= dict(zip(trials, np.asarray(of_trials).tolist()))
    rated = read_matlab(MatlabRatings(path, **told), np.asarray(known))
    return ratings_of_trials(rated, object_of, trials)


def read(path, of_trials=TRIALS, known=IDS, **told):
    """Read them in the usual order, except where the file tells another."""
    told = {"objects": known, "adjectives": ADJECTIVES} | told
    return read_ratings(path, known, of_trials, **told)[0]


def assert_ratings(found, counts, names=ADJECTIVES):
    assert list(found) == list(names)
    for i, name in enumerate(names):
        assert found[name].dtype.kind == "i"
        np.testing.assert_array_equal(found[name], counts[:, i])


@pytest.mark.slow
@pytest.mark.parametrize("axes", list(permutations(range(3))))
@pytest.mark.parametrize("dtype", ["u1", "f8"])
def test_axes_of_ratings_may_come_in_any_order(save, ratings, counts, axes, dtype):
    path = save(a=ratings.transpose(axes).astype(dtype))
    assert_ratings(read(path), counts.repeat(2, axis=0))


@pytest.mark.parametrize("axes", list(permutations(range(3))))
def test_axes_of_counts_may_come_in_any_order(save, counts, axes):
    assert_ratings(read(save(a=counts.transpose(axes))), counts.repeat(2, axis=0))


def test_missing_ratings_may_be_nan(save, ratings, counts):
    path = save(a=np.where(ratings == 0, np.nan, ratings))
    assert_ratings(read(path), counts.repeat(2, axis=0))


def test_other_variables_do_no_harm(save, ratings, counts):
    path = save(
        medians=np.median(ratings, axis=2),
        means=ratings.mean(axis=2)[..., None] + np.full(12, 0.01),
        raters=np.arange(1, 13),
        below=ratings - 3,
        subjects=cells(["a", "b"]),
        n=60,
        ratings=ratings,
    )
    assert_ratings(read(path), counts.repeat(2, axis=0))


def test_struct(tmp_path, ratings, counts):
    path = tmp_path / "ratings.mat"
    savemat(path, {"study": {"scores": ratings, "info": {"ids": IDS[::-1]}}})
    found, _ = read_ratings(path, IDS, TRIALS, adjectives=ADJECTIVES)
    assert_ratings(found, counts[::-1].repeat(2, axis=0))


def test_struct_of_version_7_3(tmp_path, ratings, counts):
    save_v73(tmp_path / "ratings.mat", {"study/scores": ratings})
    assert_ratings(read(tmp_path / "ratings.mat"), counts.repeat(2, axis=0))


def test_orders_that_the_file_tells(save, ratings, counts):
    order = np.random.default_rng(1).permutation(10)
    names = [ADJECTIVES[i] for i in order]
    rows = np.random.default_rng(2).permutation(60)
    path = save(
        data=ratings[rows][:, order],
        labels=cells([name.capitalize() for name in names]),
        object_ids=IDS[rows].astype(float),
    )
    found, _ = read_ratings(path, IDS, TRIALS)
    assert_ratings(found, counts.repeat(2, axis=0)[:, order], names)


def test_adjectives_as_a_character_matrix(tmp_path, ratings):
    names = [name.ljust(8) for name in ADJECTIVES[::-1]]
    savemat(tmp_path / "r.mat", {"data": ratings, "names": names})
    found = read(tmp_path / "r.mat", adjectives=None)
    assert list(found) == list(ADJECTIVES[::-1])


def test_adjectives_of_other_names_are_taken_as_they_are(save, ratings):
    names = [*ADJECTIVES[:-1], "bouncy"]
    assert list(read(save(data=ratings, names=cells(names)), adjectives=None)) == names


def test_known_adjectives_win_over_other_lists_of_ten(save, ratings):
    path = save(data=ratings, a=cells(list("abcdefghij")), b=cells(ADJECTIVES[::-1]))
    assert list(read(path, adjectives=None)) == list(ADJECTIVES[::-1])


def test_no_order_is_assumed(save, ratings):
    """Not even where the corpus has as many objects as the file."""
    path = save(a=ratings)
    mend = r"MatlabRatings\(.*mat', objects=\[\.\.\.\], adjectives=\[\.\.\.\]\)"
    with pytest.raises(ValueError, match=rf"of its objects and adjectives; .*{mend}"):
        read_ratings(path, IDS, TRIALS)
    with pytest.raises(ValueError, match=r"mat does not tell .* its adjectives; give"):
        read_ratings(path, IDS, TRIALS, objects=IDS)
    with pytest.raises(ValueError, match=r"mat does not tell .* its objects; give"):
        read_ratings(path, IDS, TRIALS, adjectives=ADJECTIVES)
    path = save(a=ratings, names=cells(ADJECTIVES))
    with pytest.raises(ValueError, match=r"mat does not tell .* its objects; give"):
        read_ratings(path, IDS, TRIALS)


def test_orders_that_are_given(save, ratings, counts):
    """They go before what the file tells; ids may be text."""
    rows = np.random.default_rng(2).permutation(60)
    path = save(a=ratings[rows, ::-1], ids=IDS, names=cells(ADJECTIVES))
    for objects in (IDS[rows], [f"0{each}" for each in IDS[rows]]):
        order = {"objects": objects, "adjectives": ADJECTIVES[::-1]}
        found, people = read_ratings(path, IDS, TRIALS, **order)
        assert_ratings(found, counts.repeat(2, axis=0)[:, ::-1], ADJECTIVES[::-1])
        answer = people.loc[(IDS[7], 3), "rough"]
        np.testing.assert_equal(answer, ratings[7, 2, 2] or np.nan)


def test_adjectives_of_any_number(save, ratings, counts):
    names = ["hard", "bouncy"]
    found = read(save(a=ratings[:, :2]), adjectives=names)
    assert_ratings(found, counts.repeat(2, axis=0), names)


@pytest.mark.parametrize(
    "told, message",
    [
        ({"objects": [*IDS[:-1], "101"]}, r"objects=\[101, .*\]\) must be distinct"),
        ({"objects": []}, "must be distinct and at least one"),
        ({"objects": IDS[:-1]}, "59 objects × 10 adjectives"),
        ({"objects": ["sponge"]}, "has the object 'sponge'; give the ids that"),
        ({"objects": [*IDS[:-1], 7]}, r"objects that the corpus does not have, \[7\]"),
        ({"adjectives": ADJECTIVES[:9]}, "60 objects × 9 adjectives"),
        ({"adjectives": "hard"}, "60 objects × 1 adjectives"),
        ({"adjectives": ["hard"] * 10}, "must be distinct"),
        ({"adjectives": range(10)}, "must list names as text"),
        ({"variable": "b"}, r"has no variable 'b'; it has a: \(60, 10, 12\)"),
    ],
)
def test_orders_that_do_not_fit(save, ratings, told, message):
    with pytest.raises(ValueError, match=message):
        read(save(a=ratings), **told)


def test_the_variable_may_be_named(save, tmp_path, ratings, counts):
    path = save(one=ratings, two=ratings[::-1])
    assert_ratings(read(path, variable="one"), counts.repeat(2, axis=0))
    assert_ratings(read(path, variable="two"), counts[::-1].repeat(2, axis=0))
    savemat(path, {"study": {"first": ratings, "second": ratings[::-1]}})
    assert_ratings(read(path, variable="study.first"), counts.repeat(2, axis=0))


def test_file_of_more_objects_than_the_trials(save, ratings, counts):
    path = save(a=ratings, ids=IDS)
    found = read(path, of_trials=IDS[[7, 3, 7]])
    assert_ratings(found, counts[[7, 3, 7]])


def test_file_of_more_objects_than_the_corpus(save, ratings):
    path = save(a=ratings, ids=IDS, names=cells(ADJECTIVES))
    with pytest.raises(ValueError, match=r"corpus does not have, \[101, 102, 103, 105"):
        read_ratings(path, IDS[[3, 7, 9]], IDS[[7, 3, 7]])


def test_five_raters_and_five_levels(save):
    rng = np.random.default_rng(0)
    five = rng.integers(1, 6, (60, 10, 5))
    found = read(save(a=five))
    np.testing.assert_array_equal(found["hard"][::2, 0], (five[:, 0] == 1).sum(axis=1))
    even = rng.multinomial(5, [0.2] * 5, (60, 10))
    np.testing.assert_array_equal(read(save(a=even))["hard"][::2], even[:, 0])
    with pytest.raises(ValueError, match=r"several ways: a .* as ratings .* as counts"):
        read(save(a=rng.integers(0, 6, (60, 10, 5))))
    each_level_thrice = np.full((60, 10, 5), 3)
    with pytest.raises(ValueError, match=r"several ways: a .* as ratings .* as counts"):
        read(save(a=each_level_thrice))


@pytest.mark.parametrize("missing", [0, np.nan])
@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1)])
def test_ratings_of_each_person(save, ratings, missing, axes):
    ratings = np.where(ratings == 0, missing, ratings)
    ratings[3, :, 5] = missing  # person 6 did not rate object 104 at all
    path = save(a=ratings.transpose(axes), ids=IDS, names=cells(ADJECTIVES))
    counts, people = read_ratings(path, IDS, IDS[[3, 3, 0]])
    assert people.index.names == ["object", "rater"]
    assert list(people) == list(ADJECTIVES)
    assert people.loc[101].index.tolist() == [*range(1, 13)]
    assert people.loc[104].index.tolist() == [1, 2, 3, 4, 5, *range(7, 13)]
    assert len(people) == 23
    for row, rater, adjective in [(0, 12, 4), (3, 1, 9), (3, 7, 0)]:
        found = people.loc[(IDS[row], rater), ADJECTIVES[adjective]]
        expected = ratings[row, adjective, rater - 1]
        assert found == expected or (np.isnan(found) and not expected > 0)
    for adjective in ADJECTIVES:
        table = rating_counts(
            people[adjective], people.index.get_level_values("object"), levels=LEVELS
        )
        np.testing.assert_array_equal(table.counts, counts[adjective][[2, 0]])


def test_counts_say_nothing_of_each_person(save, counts):
    path = save(a=counts, ids=IDS, names=cells(ADJECTIVES))
    assert read_ratings(path, IDS, TRIALS)[1] is None


# What is refused


@pytest.mark.parametrize(
    "array",
    [
        np.ones((60, 10)),
        np.ones((59, 10, 12)),
        np.full((60, 10, 12), 6),
        np.full((60, 10, 12), 2.5),
        np.full((60, 10, 12), -1),
        np.full((60, 10, 5), np.inf),
        np.full((60, 10, 12), np.nan),
    ],
)
def test_no_ratings_lists_the_variables(save, array):
    path = save(first=array, second=cells(["x", "y", "z"]))
    with pytest.raises(
        ValueError,
        match=r"ratings\.mat has no .*first: \(.*\) .*; second: \(1, 3\) cell",
    ) as caught:
        read(path)
    assert str(array.shape) in str(caught.value)


def test_empty_file(save):
    with pytest.raises(ValueError, match="no variables"):
        read(save())


def test_ambiguous_arrays_are_listed(save, ratings, counts):
    with pytest.raises(ValueError, match=r"one \(60.* as ratings.*two .* as counts"):
        read(save(one=ratings, two=counts))


def test_ambiguous_axes_are_listed(save, ratings):
    with pytest.raises(ValueError, match=r"axes \(0, 1, 2\).*axes \(2, 1, 0\)"):
        read(save(a=ratings[:12]), of_trials=IDS[:1], known=IDS[:12])


def test_ambiguous_ids_and_adjectives(save, ratings):
    with pytest.raises(ValueError, match=r"object ids: \['a', 'b'\]"):
        read(save(data=ratings, a=IDS, b=IDS[::-1]), objects=None)
    with pytest.raises(ValueError, match=r"adjectives: \['a', 'b'\]"):
        lists = {"a": cells(list("abcdefghij")), "b": cells(list("klmnopqrst"))}
        read(save(data=ratings, **lists), adjectives=None)


def test_object_without_ratings(save, ratings):
    path = save(a=ratings[1:], ids=IDS[1:])
    with pytest.raises(ValueError, match=r"ratings\.mat has no ratings of object 101"):
        read(path, objects=None)
    assert len(read(path, of_trials=IDS[1:], objects=None)["hard"]) == 59
    ratings[4, 2] = 0
    with pytest.raises(ValueError, match="no 'rough' rating of object 105"):
        read(save(a=ratings))


def test_unreadable_variables_are_passed_over(tmp_path, ratings):
    from scipy.sparse import eye_array

    savemat(
        tmp_path / "r.mat",
        {
            "sparse": eye_array(60).tocsc(),
            "mixed": cells(["text", ratings]),
            "complex": ratings * 1j,
        },
    )
    with pytest.raises(ValueError, match=r"\(60, 60\) sparse.*mixed.*complex"):
        read(tmp_path / "r.mat")


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no file .*nothing\.mat"):
        read(tmp_path / "nothing.mat")


@pytest.mark.parametrize("content", [b"", b"text", b"\x00" * 200, b"MATLAB 7.3 MAT"])
def test_not_a_matlab_file(tmp_path, content):
    path = tmp_path / "r.mat"
    path.write_bytes(content)
    with pytest.raises(OSError, match=r"r\.mat is not"):
        read(path)


@pytest.mark.parametrize("kept", [10, 127, 128, 150, 0.5, -1])
def test_cut_short(save, ratings, kept):
    path = save(a=ratings)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content)) if 0 < kept < 1 else kept])
    with pytest.raises((OSError, ValueError), match=r"ratings\.mat"):
        read(path)


def test_references_in_version_7_3_to_no_text(tmp_path, ratings):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "r.mat"
    save_v73(path, {"a": ratings, "names": cells(ADJECTIVES[::-1])})
    with h5py.File(path, "r+") as file:
        group = file.create_group("#refs#/group")
        for name, target in [
            ("cells_of_structs", group),
            ("cells_of_numbers", file["a"]),
        ]:
            file[name] = np.array([[target.ref]], dtype=h5py.ref_dtype)
            file[name].attrs["MATLAB_class"] = np.bytes_("cell")
        file["complex"] = np.zeros((60, 10, 12), "f8,f8")
    assert list(read(path, adjectives=None)) == list(ADJECTIVES[::-1])


def test_links_in_version_7_3_are_not_followed(tmp_path, ratings):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "r.mat"
    save_v73(tmp_path / "other.mat", {"a": ratings})
    save_v73(path, {})
    with h5py.File(path, "r+") as file:
        file["a"] = h5py.ExternalLink(str(tmp_path / "other.mat"), "/a")
    with pytest.raises(ValueError, match=r"'a' in .*r\.mat is a soft or external link"):
        read(path)


# What else version 7.3 may hold


def write_empty(file, name, matlab_class):
    """Write '', {} or [] as MATLAB does: the shape in place of values."""
    file[name] = np.zeros(2, "u8")
    file[name].attrs["MATLAB_class"] = np.bytes_(matlab_class)
    file[name].attrs["MATLAB_empty"] = np.uint8(1)


def write_text(file, name, codes):
    file[name] = codes
    file[name].attrs["MATLAB_class"] = np.bytes_("char")


def write_cells(file, name, cells):
    references = np.array([[cell.ref] for cell in cells], dtype=file_reference())
    file[name] = references
    file[name].attrs["MATLAB_class"] = np.bytes_("cell")


def file_reference():
    return pytest.importorskip("h5py").ref_dtype


@pytest.fixture
def file_v73(tmp_path, ratings):
    """A file of ratings, ids and names of adjectives, open for more."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "ratings.mat"
    save_v73(path, {"a": ratings, "ids": IDS, "names": cells(ADJECTIVES)})
    with h5py.File(path, "r+") as file:
        yield file


def read_closed(file):
    path = file.filename
    file.close()
    return read_ratings(path, IDS, TRIALS)[0]


def test_empty_variables_of_version_7_3(file_v73, counts):
    for matlab_class in ("char", "cell", "double", "struct", "logical"):
        write_empty(file_v73, f"empty_{matlab_class}", matlab_class)
        write_empty(file_v73, f"in_struct/{matlab_class}", matlab_class)
    assert_ratings(read_closed(file_v73), counts.repeat(2, axis=0))


def test_empty_text_in_cells_of_version_7_3(file_v73):
    write_empty(file_v73, "#refs#/blank", "char")
    words = [file_v73[f"#refs#/names{i}"] for i in range(9)]
    del file_v73["names"]
    write_cells(file_v73, "names", [*words, file_v73["#refs#/blank"]])
    assert list(read_closed(file_v73)) == [*ADJECTIVES[:9], ""]


def test_text_of_any_shape_and_code_does_no_harm(file_v73, counts):
    write_text(file_v73, "three_axes", np.full((4, 3, 2), 97, "u2"))
    write_text(file_v73, "ten_of_three_axes", np.full((4, 3, 10), 97, "u2"))
    write_text(file_v73, "one_axis", np.full(4, 97, "u2"))
    write_text(file_v73, "large", np.full((4, 1), 2**40, "u8"))
    write_text(file_v73, "half", np.full((4, 1), 0xD800, "u2"))
    write_text(file_v73, "no_text", np.ones((4, 1)))
    file_v73["modern"] = np.arange(6, dtype="u4")
    file_v73["modern"].attrs["MATLAB_class"] = "string"
    file_v73["other"] = np.arange(6)
    file_v73["other"].attrs["MATLAB_class"] = np.int64(3)
    assert_ratings(read_closed(file_v73), counts.repeat(2, axis=0))


def test_text_outside_the_basic_plane(file_v73):
    del file_v73["names"]
    names = [*ADJECTIVES[:9], "\N{BUTTER}"]
    codes = np.array([list(f"{name:8s}"[:8].encode("utf-16-le")) for name in names[:9]])
    rows = np.full((10, 8), 32, "u2")
    rows[:9] = codes[:, ::2]
    rows[9, :2] = np.frombuffer(names[9].encode("utf-16-le"), "<u2")
    write_text(file_v73, "names", rows.T)
    assert list(read_closed(file_v73)) == names


@pytest.mark.parametrize("code", [2**40, 0x10FFFF, 0xD800])
def test_names_that_are_no_text_are_refused(file_v73, code):
    write_text(file_v73, "words", np.full((4, 10), code, "u8"))
    with pytest.raises(ValueError, match=r"/words of .*ratings\.mat is not UTF-16"):
        read_closed(file_v73)


@pytest.mark.parametrize("name", ["MATLAB_class", "MATLAB_empty"])
@pytest.mark.parametrize("value", [[1, 2], np.array([b"char"]), np.zeros((2, 2))])
def test_attribute_that_is_an_array(file_v73, name, value):
    file_v73["odd"] = np.ones(3)
    file_v73["odd"].attrs[name] = value
    with pytest.raises(
        ValueError, match=rf"attribute {name} of /odd of .*mat has shape .*one value"
    ):
        read_closed(file_v73)


def test_class_as_text_of_any_length(file_v73, counts):
    for name in ("a", "ids"):
        file_v73[name].attrs["MATLAB_class"] = "double"
    file_v73["names"].attrs["MATLAB_class"] = "cell"
    assert_ratings(read_closed(file_v73), counts.repeat(2, axis=0))


def test_sparse_array_of_version_7_3(file_v73, counts):
    group = file_v73.create_group("sparse")
    group.attrs["MATLAB_sparse"] = np.uint64(60)
    group["ir"] = IDS[::-1]  # no ids
    assert_ratings(read_closed(file_v73), counts.repeat(2, axis=0))


def test_ids_too_large_to_be_told_apart(save, ratings):
    ids = IDS.astype(float)
    ids[-1] = 1e300
    with pytest.raises(ValueError, match="order of its objects"):
        read_ratings(save(a=ratings, ids=ids), IDS, TRIALS)
