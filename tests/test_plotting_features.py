"""AtomsDisplay and FeatureMapDisplay: the numbers drawn are those of the estimators."""

from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from sklearn.decomposition import PCA
from sklearn.exceptions import NotFittedError
from sklearn.pipeline import make_pipeline

from sklearn_haptic import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from sklearn_haptic.plotting import AtomsDisplay, FeatureMapDisplay

RNG = np.random.default_rng(0)
SIGNALS = [RNG.normal(size=(n, 2)).cumsum(axis=0) for n in (90, 120, 107)]
SKIN = [RNG.normal(size=(n, 38)).cumsum(axis=0) for n in (25, 40)]


def waveforms(sign="split", pool=None):
    coder = KSVDTransformer(
        7, 2, window=20, overlap=0.5, sign=sign, max_iter=5, random_state=0
    )
    return (make_pipeline(coder, pool) if pool else coder).fit(SIGNALS)


def patches(pool=None):
    coder = STHMPTransformer(4, 2, spatial_cells=(2, 1), max_iter=3, random_state=0)
    return (make_pipeline(coder, pool) if pool else coder).fit(SKIN)


@pytest.mark.slow
def test_atoms_of_signals_are_waveforms_in_milliseconds():
    ksvd = waveforms()
    display = AtomsDisplay.from_estimator(ksvd, sampling_rate=200)
    assert len(display.lines_) == len(display.axes_) == 7
    for line, atom in zip(display.lines_, ksvd.components_):
        np.testing.assert_array_equal(line.get_ydata(), atom)
        np.testing.assert_allclose(line.get_xdata(), np.arange(20) * 5)
    display.figure_.canvas.draw()
    assert len({panel.get_ylim() for panel in display.axes_}) == 1
    assert display.axes_[0].get_ylim()[1] > ksvd.components_.max()
    titles = [panel.get_title() for panel in display.axes_]
    assert titles == ["atom 0", *map(str, range(1, 7))]
    # The lowest row of a 4 + 3 grid names the axis; the rows keep their distance.
    labels = [panel.get_xlabel() for panel in display.axes_]
    assert labels == [""] * 4 + ["time, ms"] * 3
    assert display.axes_[4].get_ylabel() == "atom\n(no unit)"
    assert len(display.figure_.axes) == 8


@pytest.mark.slow
@pytest.mark.parametrize("sign", ["split", "absolute", "none"])
def test_atoms_are_sorted_by_the_share_of_codes_that_use_them(sign):
    ksvd = waveforms(sign)
    display = AtomsDisplay.from_estimator(ksvd, SIGNALS)
    names = ksvd.get_feature_names_out()
    used, total = np.zeros(7), 0
    for codes in ksvd.transform(SIGNALS):
        for row in codes:
            for channel in ("ch0", "ch1"):
                total += 1
                for atom in range(7):
                    stem = f"{channel}_atom{atom}"
                    columns = np.isin(names, [stem, f"{stem}+", f"{stem}-"])
                    used[atom] += row[columns].any()
    share = used / total
    np.testing.assert_allclose(display.usage, np.sort(share)[::-1])
    np.testing.assert_allclose(share[display.names], display.usage)
    np.testing.assert_array_equal(display.atoms, ksvd.components_[display.names])
    first = display.names[0]
    title = f"atom {first}:\n{share[first]:.0%} of codes"
    assert display.axes_[0].get_title() == title
    assert display.axes_[0].get_xlabel() == ""
    assert display.axes_[-1].get_xlabel() == "sample"


def test_atoms_of_images_are_patches():
    sthmp = patches()
    display = AtomsDisplay.from_estimator(sthmp, SKIN)
    limit = np.abs(sthmp.components_).max()
    for image, name in zip(display.images_, display.names, strict=True):
        atom = sthmp.components_[name].reshape(3, 3)
        np.testing.assert_array_equal(image.get_array(), atom)
        assert image.get_clim() == (-limit, limit)
    assert (np.diff(display.usage) <= 0).all()
    assert "atom (no unit)" in {ax.get_ylabel() for ax in display.figure_.axes}


@pytest.mark.slow
def test_atoms_of_tables():
    X = RNG.normal(size=(40, 5))
    ksvd = KSVDTransformer(3, 1, max_iter=2, random_state=0).fit(X)
    ksvd.set_output(transform="pandas")
    display = AtomsDisplay.from_estimator(ksvd, X)
    assert display.usage.sum() == pytest.approx(1)  # one atom per code
    sthmp = STHMPTransformer(3, 1, max_iter=2, random_state=0).fit(X)
    assert len(AtomsDisplay.from_estimator(sthmp).lines_) == 3


@pytest.mark.slow
def test_atoms_of_extreme_dictionaries():
    for window in (1, 2):
        ksvd = KSVDTransformer(1, 1, window=window, max_iter=1, remove_mean=False)
        AtomsDisplay.from_estimator(ksvd.fit(SIGNALS)).figure_.canvas.draw()
    zero = KSVDTransformer(12, 1, window=3, max_iter=0, dict_init=np.zeros((12, 3)))
    display = AtomsDisplay.from_estimator(zero.fit(SIGNALS))
    assert len({panel.get_position().y0 for panel in display.axes_}) == 2


def test_codes_lie_at_the_middle_of_their_windows():
    ksvd = waveforms()
    display = FeatureMapDisplay.from_estimator(ksvd, SIGNALS[1], sampling_rate=10)
    codes = ksvd.transform([SIGNALS[1]])[0]
    assert codes.shape == (11, 28)
    np.testing.assert_array_equal(display.images_[0].get_array(), codes.T)
    middles = (display.edges[1:] + display.edges[:-1]) / 2
    np.testing.assert_allclose(middles, [1 + i for i in range(11)])
    assert len(display.axes_) == 1
    assert display.axes_[0].get_xlabel() == "time, s"
    blocks = [text.get_text() for text in display.axes_[0].get_yticklabels()]
    assert blocks == ["ch0", "ch1"]
    np.testing.assert_array_equal(display.axes_[0].get_yticks(), [6.5, 20.5])


@pytest.mark.slow
def test_maxima_lie_where_their_cells_are():
    pipeline = patches(TemporalMaxPool((3, 1)))
    trial = SKIN[0]
    display = FeatureMapDisplay.from_estimator(pipeline, trial, sampling_rate=100)
    frames = pipeline[0].transform([trial])[0]
    parts = [0, 8, 16, 25]
    assert len(frames) == 25
    np.testing.assert_allclose(display.level_edges[0], np.array(parts) / 100)
    np.testing.assert_allclose(display.level_edges[1], [0, 0.25])
    maxima = [frames[a:b].max(axis=0) for a, b in pairwise(parts)]
    np.testing.assert_array_equal(display.images_[1].get_array(), np.array(maxima).T)
    whole = frames.max(axis=0)[:, np.newaxis]
    np.testing.assert_array_equal(display.images_[2].get_array(), whole)
    titles = [panel.get_title(loc="left") for panel in display.axes_]
    assert titles == ["codes", "maxima in 3 cells", "maxima in 1 cell"]
    assert "spatial cell (s1of4: the first of 4)" in display.axes_[0].get_ylabel()
    pool = TemporalMaxPool((3,), statistics=("mean", "max"))
    display = FeatureMapDisplay.from_estimator(patches(pool), trial)
    title = display.axes_[1].get_title(loc="left")
    assert title == "maxima in 3 cells (also pooled: mean)"
    assert len({panel.get_xlim() for panel in display.axes_}) == 1
    cells = [text.get_text() for text in display.axes_[0].get_yticklabels()]
    assert cells == ["s1of4", "s2of4", "s3of4", "s4of4", "s1of1"]
    display.figure_.canvas.draw()


def test_floor_cells_take_the_remainder_last():
    pipeline = waveforms(pool=TemporalMaxPool((4,), split="floor"))
    display = FeatureMapDisplay.from_estimator(pipeline, SIGNALS[1])
    # Eleven windows of 20 samples every 10: cells begin at windows 0, 2, 4, 6.
    np.testing.assert_allclose(display.level_edges[0], [5, 25, 45, 65, 115])
    assert display.axes_[-1].get_xlabel() == "time, samples"


@pytest.mark.slow
def test_colours_follow_the_root_and_show_signs():
    unsigned = FeatureMapDisplay.from_estimator(waveforms(), SIGNALS[0])
    scale = unsigned.images_[0].norm
    assert (scale.vmin, scale.vmax) == (0, unsigned.codes.max())
    assert scale(scale.vmax / 4) == pytest.approx(0.5)
    signed = FeatureMapDisplay.from_estimator(waveforms("none"), SIGNALS[0])
    scale = signed.images_[0].norm
    assert scale.vmax == -scale.vmin == np.abs(signed.codes).max()
    assert scale(0) == pytest.approx(0.5)
    still = FeatureMapDisplay.from_estimator(waveforms(), np.ones((40, 2)))
    assert not still.codes.any()
    still.figure_.canvas.draw()


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda ax: AtomsDisplay.from_estimator(waveforms(), ax=ax),
        lambda ax: AtomsDisplay.from_estimator(patches(), ax=ax),
        lambda ax: FeatureMapDisplay.from_estimator(waveforms(), SIGNALS[0], ax=ax),
    ],
)
def test_given_axes_hold_the_panels(make):
    figure = matplotlib.figure.Figure(layout="constrained")
    left, right = figure.subplots(1, 2)
    display = make(right)
    assert display.ax_ is right and display.figure_ is figure
    figure.canvas.draw()
    assert min(p.get_position().x0 for p in display.axes_) > left.get_position().x1


def test_atoms_and_codes_are_found_in_pipelines():
    with pytest.raises(ValueError, match="a PCA, which has no atoms; give"):
        AtomsDisplay.from_estimator(make_pipeline(PCA(), waveforms()))
    unfitted = make_pipeline(waveforms(), TemporalMaxPool())
    with pytest.raises(NotFittedError, match="TemporalMaxPool instance is not fitted"):
        FeatureMapDisplay.from_estimator(unfitted, SIGNALS[0])
