"""AtomsDisplay: the numbers drawn are those of the estimators."""

import matplotlib
import numpy as np
import pytest
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline

from sklearn_haptic import KSVDTransformer, STHMPTransformer
from sklearn_haptic.plotting import AtomsDisplay

RNG = np.random.default_rng(0)
SIGNALS = [RNG.normal(size=(n, 2)).cumsum(axis=0) for n in (90, 120, 107)]
SKIN = [RNG.normal(size=(n, 38)).cumsum(axis=0) for n in (25, 40)]


def waveforms(sign="split"):
    coder = KSVDTransformer(
        7, 2, window=20, overlap=0.5, sign=sign, max_iter=5, random_state=0
    )
    return coder.fit(SIGNALS)


def patches():
    coder = STHMPTransformer(4, 2, spatial_cells=(2, 1), max_iter=3, random_state=0)
    return coder.fit(SKIN)


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


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda ax: AtomsDisplay.from_estimator(waveforms(), ax=ax),
        lambda ax: AtomsDisplay.from_estimator(patches(), ax=ax),
    ],
)
def test_given_axes_hold_the_panels(make):
    figure = matplotlib.figure.Figure(layout="constrained")
    left, right = figure.subplots(1, 2)
    display = make(right)
    assert display.ax_ is right and display.figure_ is figure
    figure.canvas.draw()
    assert min(p.get_position().x0 for p in display.axes_) > left.get_position().x1


def test_atoms_are_found_in_pipelines():
    with pytest.raises(ValueError, match="a PCA, which has no atoms; give"):
        AtomsDisplay.from_estimator(make_pipeline(PCA(), waveforms()))
    display = AtomsDisplay.from_estimator(make_pipeline(waveforms(), PCA()))
    assert len(display.axes_) == 7
