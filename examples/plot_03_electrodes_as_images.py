"""
Electrodes as images
====================

`STHMPTransformer` turns the readings of electrodes into images, and codes small patches
of these images as `KSVDTransformer` codes windows of a signal. A BioTac finger has 19
electrodes under its skin. Their positions matter: a slide raises the readings on one
side of the finger and lowers them on the other.
"""

# %%
# 1. From electrodes to pixels
# ----------------------------
# ``layout="biotac"`` stands for an array of shape (7, 3, 19): the weight of each of a
# finger's 19 electrodes in each pixel of 7 rows, tip of the finger first, and 3
# columns. Most pixels are one electrode. The middle pixels of rows 3 and 4 have no
# electrode, so they take the mean of those neighbours that have one. A fitted
# transformer stores the array as ``layout_``.
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from sklearn.pipeline import make_pipeline

from sklearn_haptic import STHMPTransformer, TemporalMaxPool
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.plotting import AtomsDisplay

corpus = make_haptic_corpus(
    30, 1, procedure="slow_slide", sensors=["electrodes"], random_state=0
)
rate = corpus.sampling_rates["electrodes"]
trials = corpus.trials["electrodes"]
trial = trials.iloc[list(corpus.object_names).index("glass")]
coder = STHMPTransformer(n_atoms=10, random_state=0).fit(trials)
weights = coder.layout_
print(f"layout_ has shape {weights.shape}, the weights of each pixel sum to 1")
for row in (3, 4):
    electrodes = np.flatnonzero(weights[row, 1]) + 1
    print(f"row {row}, middle: mean of electrodes {electrodes}")

# %%
# The weights times the readings of a finger give its images. Two fingers, of 19
# channels each, are placed side by side: 7 × 6 pixels.
images = np.concatenate([weights @ f.T for f in (trial[:, :19], trial[:, 19:])], axis=1)
print(f"{len(trial)} frames of {images.shape[0]} × {images.shape[1]} pixels")

_, axes = plt.subplots(1, 4, figsize=(6.4, 2.5), layout="constrained", sharey=True)
axes[0].set(title="electrode", xlim=(-0.5, 2.5), xticks=range(3), aspect="equal")
for (row, column), n_electrodes in np.ndenumerate((weights > 0).sum(axis=2)):
    number = weights[row, column].argmax() + 1
    name, size = (number, "small") if n_electrodes == 1 else ("mean", 5.5)
    axes[0].text(column, row, name, ha="center", va="center", fontsize=size)
limit = np.abs(images).max()
for ax, second in zip(axes[1:], [0.1, 1, 4]):
    frame = images[:, :, round(second * rate)]
    picture = ax.imshow(frame, cmap="viridis", vmin=-limit, vmax=limit)
    ax.axvline(2.5, color="white", linewidth=2)
    ax.set(title=f"after {second:g} s", xlabel="column", xticks=range(6))
axes[0].set(xlabel="column", ylabel="row, tip first", yticks=range(7))
bar = plt.colorbar(picture, ax=axes, label="counts above rest", shrink=0.8)
bar.ax.figure.suptitle("Electrodes of a finger; two fingers sliding over glass")

# %%
# 2. Atoms of patches
# -------------------
# Every 3 × 3 patch of every frame, minus its mean, is an observation of what the skin
# does at some location, independent of the location and of the level of the readings.
# K-SVD learns atoms from these observations; light and dark are weights of opposite
# signs. The shares say in how many frames and cells (section 3) an atom appears. They
# are high because most cells hold several patches.
display = AtomsDisplay.from_estimator(coder, trials)
display.figure_.suptitle("Atoms of patches of electrodes")

# %%
# 3. A pyramid of cells
# ---------------------
# A 3 × 3 patch has 5 × 4 locations in an image of 7 × 6 pixels. Codes are pooled over
# cells of these locations: by the maximum in each of 3 × 3 cells, of 2 × 2 cells and of
# the whole image. Small cells keep where something was felt, large cells only that it
# was felt. The names of features have the numbers in the figure: ``s4of9`` is the
# fourth of nine cells.
_, axes = plt.subplots(1, 3, figsize=(6.4, 2.8), layout="constrained", sharey=True)
for ax, n_cells in zip(axes, (3, 2, 1)):
    down, right = [np.ceil(np.arange(1, n + 1) * n_cells / n) - 1 for n in (5, 4)]
    cells = 1 + n_cells * down[:, np.newaxis] + right
    ax.imshow(cells, cmap="Blues", vmin=0, vmax=2 * n_cells**2)
    for (row, column), number in np.ndenumerate(cells):
        ax.text(column, row, f"{number:g}", ha="center", va="center")
    ax.set(title=f"cell of {n_cells**2}", xlabel="column of patch", xticks=range(4))
axes[0].set(ylabel="row of patch", yticks=range(5))

# %%
# 4. Features of a slide
# ----------------------
# Each frame gives 14 cells of 20 codes (positive and negative parts have one column
# each), and is scaled to norm 1. `TemporalMaxPool` takes maxima over time, as for any
# other sensor.
pipeline = make_pipeline(coder, TemporalMaxPool((4, 2, 1)))
features = pipeline.fit_transform(trials)
print(f"{features.shape[0]} trials, {features.shape[1]} features each, such as")
print(pipeline.get_feature_names_out()[[0, 1000, -1]])
codes = coder.transform([trial])[0]
_, ax = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
seconds = 0, len(codes) / rate, codes.shape[1] - 0.5, -0.5
ax.imshow(np.sqrt(codes.T), cmap="Blues", aspect="auto", extent=seconds)
ax.set(xlabel="time, s", ylabel="feature: 20 codes of each of 14 cells")
ax.set_title("Codes of the slide over glass, square roots")

# %%
# 5. Other layouts
# ----------------
# ``layout`` takes the weights of any sensor, for any number of fingers. With
# ``layout=None``, trials are images already. The images above give the same codes as
# the electrodes.
frames = np.moveaxis(images, 2, 0)
of_images = STHMPTransformer(
    n_atoms=10, layout=None, max_iter=0, dict_init=coder.components_
)
codes = of_images.fit_transform([frames])[0]
expected = coder.transform([trial])[0]
print("Largest difference of the codes:", f"{np.abs(codes - expected).max():.1g}")
if matplotlib.get_backend().lower() != "agg":
    plt.show()
