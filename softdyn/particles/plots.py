"""Pictures of a run of many particles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE, PURPLE
from softdyn.errors import SceneError
from softdyn.particles.observables import (
    coordination,
    is_sheared,
    normal_stress_differences,
    relative_viscosity,
    strain,
)
from softdyn.results import written_whole

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]
Panel = Callable[["Axes", "ParticleResult"], None]

#: Contacts up to which each is drawn over time; more are drawn as a distribution at the end.
FEW = 20
#: Colours of forces: blue pulls, orange pushes.
FORCES = LinearSegmentedColormap.from_list("forces", [BLUE, "0.75", ORANGE])
FORCE = "force $F$, > 0 in compression"
#: Corners of a particle's outline: an edge is shorter than the facet of a surface deflected by a thousandth of R.
CORNERS = 120
#: An animation lasts as long as its frames at a rate within these bounds allow.
SECONDS, RATES = 8, (4, 25)


def plot_particles(result: ParticleResult) -> Figure:
    """Draw the contact network at the end, and what is measured on the run.

    Stress, relative viscosity and normal stress differences where there are any; coordination; the balance of energy;
    gaps and forces, of a few contacts over time, of many as they are distributed at the end.

    Parameters
    ----------
    result : ParticleResult

    Returns
    -------
    matplotlib.figure.Figure
    """
    few = max(len(result.contacts(frame)["h"]) for frame in range(len(result.t))) <= FEW
    draw = _draw_histories if few else _draw_distribution
    periodic = bool(np.isfinite(result.box).all())
    sheared = periodic and is_sheared(result) and "eta" in result.parameters
    left: list[Panel] = [_draw_stress]
    left += [_draw_viscosity] if sheared else []
    left += [_draw_normal_stresses] if periodic and result.x.shape[2] > 1 else []
    left += [_draw_coordination]
    right: list[Panel] = [
        lambda axes, result: draw(axes, result, "h", "gap $h$", BLUE),
        lambda axes, result: draw(axes, result, "F", "force $F$, compression", ORANGE),
        _draw_energy,
    ]
    figure = Figure(figsize=(13, 2.2 * max(len(left), len(right))), layout="constrained")
    grid = figure.add_gridspec(1, 3, width_ratios=[1.5, 1, 1])
    network = figure.add_subplot(grid[0, 0])
    if few or result.x.shape[2] < 3:
        _, colours = draw_network(network, result, -1, largest_force(result, [-1]))
        scale = network.inset_axes((0.1, 1.04, 0.8, 0.02))
        figure.colorbar(colours, cax=scale, label=FORCE, orientation="horizontal", ticklocation="top")
        scale.xaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    else:
        _draw_profile(network, result)
    for column, panels in enumerate((left, right), start=1):
        places = grid[0, column].subgridspec(len(panels), 1)
        for row, panel in enumerate(panels):
            axes = figure.add_subplot(places[row])
            panel(axes, result)
            if axes.get_xscale() == "linear":
                axes.ticklabel_format(axis="x", scilimits=(-3, 5))  # longer times run into each other
    figure.suptitle(f"{result.law}: {result.x.shape[1]} particles, {_when(result, -1)}", fontsize="medium")
    return figure


def animate(result: ParticleResult, path: Path) -> Path:
    """Draw the particles and the contact network of each frame, one after the other.

    Parameters
    ----------
    result : ParticleResult
        Of one or two dimensions.
    path : Path
        Ending in .gif, or in .mp4, which needs the program ffmpeg.

    Raises
    ------
    SceneError
        If particles are in three dimensions, ffmpeg is not there, or the file cannot be written.
    """
    if result.x.shape[2] == 3:
        raise SceneError(
            f"cannot draw {path}: in three dimensions particles hide each other; save the result as .gsd for OVITO or "
            ".pvd for ParaView, and make the animation there"
        )
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise SceneError(f"cannot draw {path}: the program ffmpeg is needed, and there is none; draw a .gif instead")
    rate = int(np.clip(len(result) / SECONDS, *RATES))
    frames = range(len(result))
    largest = largest_force(result, frames)
    window = _window(result, frames)
    wide, high = np.ptp(window, axis=0)
    figure = Figure(figsize=(7, float(np.clip(5.3 * high / wide, 1.5, 9)) + 0.9), layout="constrained")
    axes = figure.add_subplot()
    artists, colours = draw_network(axes, result, 0, largest, window)
    figure.colorbar(colours, ax=axes, label=FORCE, shrink=0.8)
    writer = (PillowWriter if path.suffix == ".gif" else FFMpegWriter)(fps=rate)
    with written_whole(path) as temporary, writer.saving(figure, str(temporary), dpi=100):
        for frame in frames:
            for artist in artists:
                artist.remove()
            artists, _ = draw_network(axes, result, frame, largest, window)
            axes.set_title(f"{result.law}, {_when(result, frame)}", fontsize="medium", loc="left", family="monospace")
            writer.grab_frame()
    return path


def _when(result: ParticleResult, frame: int) -> str:
    return f"t = {result.t[frame]:.4g}" + (f", strain = {strain(result)[frame]:.3f}" if is_sheared(result) else "")


def largest_force(result: ParticleResult, frames: Iterable[int]) -> float:
    """Force that all but one in a hundred contacts of each of the frames stay below: the scale of their colours."""
    sizes = [np.abs(result.contacts(frame)["F"]) for frame in frames]
    return max((float(np.quantile(size, 0.99)) for size in sizes if len(size)), default=0.0) or 1.0


def _window(result: ParticleResult, frames: Iterable[int]) -> Array:
    """Lower left and upper right corner of what is drawn: the periodic box where there is one."""
    x = np.concatenate([_in_plane(result.x[frame]) for frame in frames])
    radius = float(result.radii.max())
    low, high = x.min(axis=0) - radius, x.max(axis=0) + radius
    for axis, length in enumerate(result.box[:2]):
        if math.isfinite(length):
            low[axis], high[axis] = 0.0, max(float(result.cell[frame][axis, axis]) for frame in frames)
    return np.array([low, high])


def draw_network(
    axes: Axes, result: ParticleResult, frame: int, largest: float, window: Array | None = None
) -> tuple[list[Artist], ScalarMappable]:
    """Draw the particles and contacts of a frame, seen along z.

    In one and two dimensions a particle is flattened where it is pressed, by the deflection of its surface; what is
    left between two of them is the gap. Each contact is a line from the centre of a particle to the middle of the gap,
    wide and coloured by its force. Images of particles show where they reach into the window.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    result : ParticleResult
    frame : int
    largest : float
        Force at the ends of the colour scale.
    window : array, shape (2, 2), optional
        Lower left and upper right corner; by default, of this frame.

    Returns
    -------
    list of matplotlib.artist.Artist
        What was drawn.
    matplotlib.cm.ScalarMappable
        The scale of the colours.
    """
    window = _window(result, [frame]) if window is None else window
    x, radii, contacts = _in_plane(result.x[frame]), result.radii, result.contacts(frame)
    owner, toward, depth, middle = _ends(result, contacts)
    shapes = _outlines(radii, owner, toward, depth if result.x.shape[2] < 3 else np.zeros_like(depth))
    instance, place = _images(x, radii, result.cell[frame], window)
    F = np.concatenate([contacts["F"], contacts["F"][contacts["j"] < len(radii)]])
    # each end of a contact, once for each image of its particle
    drawn, end = _matches(instance, owner)
    lines = np.stack([place[drawn], place[drawn] + middle[end, None] * toward[end]], axis=1)
    colours = ScalarMappable(Normalize(-largest, largest), FORCES)
    particles = PolyCollection(
        list(shapes[instance] + place[:, None]), facecolor="0.93", edgecolor="0.6", linewidth=0.5
    )
    # in points: as much narrower than a particle whatever their number
    scale = min(axes.bbox.width, axes.bbox.height) / axes.figure.dpi * 72 / float(np.ptp(window, axis=0).max())
    widest = float(np.clip(0.3 * radii.mean() * scale, 0.8, 6.0))
    widths = widest * np.sqrt(np.clip(np.abs(F[end]) / largest, 0.02, 1.0))
    network = LineCollection(list(lines), colors=colours.to_rgba(F[end]), linewidths=list(widths))
    artists: list[Artist] = [axes.add_collection(particles), axes.add_collection(network)]
    for point, normal in zip(result.wall_point[frame], result.wall_normal, strict=True):
        if len(point) == 2:
            artists.append(axes.axline(point, point + np.array([-normal[1], normal[0]]), color="0.3", linewidth=1))
    axes.set(xlabel="$x$", ylabel="$y$", xlim=window[:, 0], ylim=window[:, 1])
    axes.set_aspect("equal")
    return artists, colours


def _ends(result: ParticleResult, contacts: dict[str, NDArray[Any]]) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Two ends of each contact, one where it is with a wall: particle, direction, deflection, distance to mid-gap.

    The deflection 2 delta of both surfaces is shared as 1/E; a rigid wall has none of it.
    """
    count = len(result.radii)
    i, j, n = contacts["i"], contacts["j"], _in_plane(contacts["n"])
    pair = j < count
    given = result.parameters.get("E", 1.0)
    names = result.species_names.tolist()
    E = np.array([given[name] for name in names] if isinstance(given, Mapping) else [given] * len(names))[
        result.species
    ]
    # a wall that is not rigid is as soft as the particle
    other = np.where(pair, E[np.where(pair, j, 0)], E[i])
    rigid = np.append(np.zeros(count, bool), result.wall_rigid)[j]
    share = np.where(rigid, 1.0, other / (E[i] + other))
    owner = np.concatenate([i, j[pair]])
    toward = np.concatenate([n, -n[pair]])
    depth = 2 * np.concatenate([share * contacts["delta"], ((1 - share) * contacts["delta"])[pair]])
    gap = np.concatenate([contacts["h"], contacts["h"][pair]])
    return owner, toward, depth, result.radii[owner] - depth + gap / 2


def _outlines(radii: Array, owner: NDArray[np.int64], toward: Array, depth: Array) -> Array:
    """Outlines of particles cut flat at their contacts, shape (N, CORNERS, 2)."""
    angle = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    r = np.tile(radii[:, None], CORNERS)
    pressed = depth > 0
    owner, cosine = owner[pressed], toward[pressed] @ around.T
    plane = (radii[owner] - depth[pressed])[:, None]
    np.minimum.at(r, owner, np.where(cosine > 0, plane / np.maximum(cosine, 1e-9), np.inf))
    return r[:, :, None] * around


def _images(x: Array, radii: Array, cell: Array, window: Array) -> tuple[NDArray[np.int64], Array]:
    """Images of the particles that reach into the window: their numbers and places."""
    vectors = [np.zeros(2), np.zeros(2)]
    for axis in range(min(2, len(cell))):
        vectors[axis][: min(2, len(cell))] = cell[:2, axis]
    x = x.copy()
    for axis in (1, 0):  # the second vector may be tilted along the first
        if vectors[axis][axis]:
            x -= np.floor(x[:, axis] / vectors[axis][axis])[:, None] * vectors[axis]
    numbers, places = [], []
    for up in (-1, 0, 1) if vectors[1].any() else (0,):
        shifted = x + up * vectors[1]
        if vectors[0].any():
            shifted[:, 0] = np.mod(shifted[:, 0], vectors[0][0])
        for along in (-1, 0, 1) if vectors[0].any() else (0,):
            place = shifted + along * vectors[0]
            inside = ((place + radii[:, None] > window[0]) & (place - radii[:, None] < window[1])).all(axis=1)
            numbers.append(np.flatnonzero(inside))
            places.append(place[inside])
    return np.concatenate(numbers), np.concatenate(places)


def _matches(instance: NDArray[np.int64], owner: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs of places where the two agree."""
    order = np.argsort(owner, kind="stable")
    first, last = (np.searchsorted(owner[order], instance, side) for side in ("left", "right"))
    drawn = np.repeat(np.arange(len(instance)), last - first)
    within = np.arange(len(drawn)) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
    return drawn, order[first[drawn] + within]


def _in_plane(vectors: Array) -> Array:
    """Give vectors two dimensions."""
    return np.pad(vectors[:, :2], ((0, 0), (0, max(0, 2 - vectors.shape[1]))))


def _draw_profile(axes: Axes, result: ParticleResult) -> None:
    """Velocity along x against y, at the end."""
    axes.plot(result.v[-1][:, 0], result.x[-1][:, 1], ".", color=GREEN, markersize=2)
    axes.set(xlabel="velocity along $x$", ylabel="$y$")
    axes.grid(alpha=0.3)


def _draw_stress(axes: Axes, result: ParticleResult) -> None:
    d = result.stress.shape[1]
    styles: list[tuple[int, int, str]] = [(0, 0, BLUE), (1, 1, ORANGE), (0, 1, PURPLE)] if d > 1 else [(0, 0, BLUE)]
    for a, b, colour in styles:
        axes.plot(result.t, result.stress[:, a, b], color=colour, label=rf"$\sigma_{{{'xyz'[a]}{'xyz'[b]}}}$")
    axes.set(xlabel="time $t$", ylabel="stress" if np.isfinite(result.box).all() else "virial")
    axes.legend()
    axes.grid(alpha=0.3)


def _draw_coordination(axes: Axes, result: ParticleResult) -> None:
    axes.plot(result.t, coordination(result), color=GREEN)
    axes.set(xlabel="time $t$", ylabel="pressed contacts per particle", ylim=(0, None))
    axes.grid(alpha=0.3)


def _draw_viscosity(axes: Axes, result: ParticleResult) -> None:
    axes.plot(result.t, relative_viscosity(result), color=PURPLE)
    axes.set(xlabel="time $t$", ylabel=r"relative viscosity")
    axes.grid(alpha=0.3)


def _draw_normal_stresses(axes: Axes, result: ParticleResult) -> None:
    first, second = normal_stress_differences(result)
    axes.plot(result.t, first, color=BLUE, label="$N_1$")
    if result.x.shape[2] == 3:
        axes.plot(result.t, second, color=ORANGE, label="$N_2$")
    axes.set(xlabel="time $t$", ylabel="normal stress differences")
    axes.legend()
    axes.grid(alpha=0.3)


#: Words for the energies that are taken, and their colours.
TAKEN = {
    "stored": ("stored", BLUE),
    "gaps": ("lost in the gaps", ORANGE),
    "drag": ("lost by drag", GREEN),
    "remote": ("remote forces", PURPLE),
    "U_h": ("$U_h$ term", "0.5"),
    "sliding": ("lost in sliding", "tab:red"),
    "rolling": ("lost in rolling", "tab:brown"),
    "k_t": ("$k_t$ term", "0.7"),
}


def _draw_energy(axes: Axes, result: ParticleResult) -> None:
    """Each term of the balance that is there; all that is given is the sum of all that is taken."""
    given = sum(result.arrays[f"energy_{name}"] for name in ("external", "flow", "box"))
    axes.plot(result.t, given, color="k", label="given")
    taken = {name: result.arrays[f"energy_{name}"] for name in TAKEN if f"energy_{name}" in result.arrays}
    for name, values in taken.items():
        label, colour = TAKEN[name]
        if values.any():
            axes.plot(result.t, values, color=colour, label=label)
    axes.plot(result.t, sum(taken.values()), color="w", linestyle=":", linewidth=1)
    axes.set(xlabel="time $t$", ylabel="energy")
    axes.legend(fontsize="x-small")
    axes.grid(alpha=0.3)


def _draw_histories(axes: Axes, result: ParticleResult, name: str, label: str, colour: str) -> None:
    """One line for each pair that is ever in contact, with gaps where it is not."""
    frames = [result.contacts(frame) for frame in range(len(result.t))]
    values = [
        {(i, j): value for i, j, value in zip(frame["i"], frame["j"], frame[name], strict=True)} for frame in frames
    ]
    for pair in dict.fromkeys(pair for of_frame in values for pair in of_frame):
        axes.plot(result.t, [of_frame.get(pair, math.nan) for of_frame in values], color=colour, alpha=0.7)
    if name == "h":
        axes.set_yscale("log")
    else:
        axes.axhline(0, color="0.6", linewidth=0.5)
    axes.set(xlabel="time $t$", ylabel=label)
    axes.grid(alpha=0.3)


def _draw_distribution(axes: Axes, result: ParticleResult, name: str, label: str, colour: str) -> None:
    values: NDArray[Any] = result.contacts(-1)[name]
    values = values[values > 0]
    if len(values):
        bins = np.geomspace(values.min(), values.max() * (1 + 1e-9), max(5, math.isqrt(len(values)) // 2) + 1)
        axes.hist(values, bins=list(bins), color=colour)
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel=label, ylabel="contacts")
