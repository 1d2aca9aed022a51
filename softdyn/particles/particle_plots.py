"""Pictures of a run of many particles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, ScalarFormatter
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE, PURPLE
from softdyn.errors import SceneError
from softdyn.mathtext import literal
from softdyn.particles.export import boxed, lines, outline, padded
from softdyn.particles.free_plots import bonds_at, draw_bond_lengths, draw_pair_distribution, draw_spread
from softdyn.particles.observables import (
    coordination,
    force_distribution,
    gap_distribution,
    has_viscosity,
    is_periodic,
    is_sheared,
    normal_stress_differences,
    pressure,
    relative_viscosity,
    strain,
)
from softdyn.results.axis_units import tell_units
from softdyn.results.chosen_panels import NARROW, Panel, chosen_panels, root_of
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]
Draw = Callable[["Axes", "ParticleResult"], None]

#: Two more of Okabe & Ito's colours.
AMBER, SKY = "#E69F00", "#56B4E9"
#: Contacts up to which each is drawn over time; more are drawn as a distribution at the end.
FEW = 20
#: Colours of contacts, as long as they are not more than these.
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, AMBER, SKY, "0.3", "0.6")
#: Contacts of a periodic box in three dimensions that are drawn: more hide each other.
MOST = 2000
#: Colours of forces: blue pulls, orange pushes.
FORCES = LinearSegmentedColormap.from_list("forces", [BLUE, "0.75", ORANGE])
FORCE = "force $F$: pulled < 0 < pressed"
#: Corners of a particle's outline: an edge is shorter than the facet of a surface deflected by a thousandth of R.
CORNERS = 120
#: An animation lasts as long as its frames at a rate within these bounds allow.
SECONDS, RATES = 8, (4, 25)
#: Units of what axes show.
UNITS = {
    "time $t$": "s", "$x$": "m", "$y$": "m", "$z$": "m", "$h$": "m", "$r$": "m", "distance $r$": "m", "$F$": "N",
    FORCE: "N", r"$\sigma$": "Pa", "differences, pressure": "Pa", "energy since the start": "J",
    "velocity along $x$": "m/s", r"$\langle\Delta r^2\rangle$": "m$^2$",
}  # fmt: skip
#: Dots per inch of an animation, and colours of one that is a .gif: it takes far more room than a film.
SHARPNESS, IN_GIF = {".gif": 72, ".mp4": 100}, 48
DIMENSIONS = {1: "one dimension", 2: "two dimensions", 3: "three dimensions"}
TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}
#: Legends are beside their axes, where they cover no curve.
BESIDE: dict[str, Any] = {
    "loc": "upper left", "bbox_to_anchor": (1.0, 1.03), "frameon": False, "fontsize": "small", "handlelength": 1.4,
    "borderaxespad": 0.2, "handletextpad": 0.5, "title_fontsize": "small", "alignment": "left",
}  # fmt: skip
#: How a box in three dimensions is seen; rows: right, up, toward the eye. x goes to the right and y up, turned by 25
#: degrees about y, then by 18 about the horizontal.
OBLIQUE = np.array(
    [
        [math.cos(0.44), 0.0, -math.sin(0.44)],
        [-math.sin(0.31) * math.sin(0.44), math.cos(0.31), -math.sin(0.31) * math.cos(0.44)],
        [math.cos(0.31) * math.sin(0.44), math.sin(0.31), math.cos(0.31) * math.cos(0.44)],
    ]
)


def plot_particles(
    result: ParticleResult,
    *,
    width: str | float | None = None,
    panels: Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw the contact network at the end, and what is measured on the run.

    Stress; relative viscosity, normal stress differences and pressure where there are any; coordination; the balance of
    energy; gaps and forces, of a few contacts over time, of many as they are distributed at the end; of many particles
    that are sheared, their velocities across the flow. Curves are over the strain where it grows all the time, else
    over the time.

    Parameters
    ----------
    result : ParticleResult
    width : "column", "page" or number, optional
        Of a figure of some panels; a number is in inches.
    panels : sequence of str, optional
        Which panels, below one another: "network", "energy", "stress" and what else :func:`panels_of` gives; without
        it, all that there are, in a figure of its own size.
    ax : matplotlib Axes, optional
        Where to draw a single panel, in a figure of one's own.

    Returns
    -------
    matplotlib.figure.Figure
        It belongs to no window.

    Raises
    ------
    SceneError
        If a panel is unknown, or if the result lacks what it shows.
    """
    if panels is not None or width is not None or ax is not None:
        known = panels_of(result)
        figure = chosen_panels(known, ["network"] if panels is None else panels, width or "page", ax)
        tell_units([ax] if ax is not None else figure.axes, result, UNITS)
        return figure
    middle, right = _columns(result)
    network_height = 14 * 1.4 / 3.4 * _network_tall(result) - 0.2
    height = max(network_height + 2.6, 2.3 * max(len(middle), len(right)) + 0.7)
    figure = Figure(figsize=(14, height), layout="constrained")
    grid = figure.add_gridspec(1, 3, width_ratios=[1.4, 1, 1])
    first = grid[0, 0].subgridspec(2, 1, height_ratios=[network_height, height - network_height])
    _draw_network_panel(figure.add_subplot(first[0]), result)
    _draw_energy(figure.add_subplot(first[1]), result)
    for column, drawn in enumerate((middle, right), start=1):
        places = grid[0, column].subgridspec(len(drawn), 1)
        for row, panel in enumerate(drawn.values()):
            panel(figure.add_subplot(places[row]), result)
    for axes in figure.axes:
        _shorten(axes)
    tell_units(figure.axes, result, UNITS)
    count, d = result.x.shape[1:]
    given = f"\nin the units of the scene: {_parameters(result)}" if result.parameters else ""
    figure.suptitle(
        f"{literal(result.law)}: {count} particles in {DIMENSIONS[d]}, at the end: {_when(result, -1)}{given}",
        fontsize="medium",
    )
    return figure


def panels_of(result: ParticleResult) -> dict[str, Panel]:
    """Panels that there are of a result, by name."""
    middle, right = _columns(result)
    found = {"network": Panel(partial(_draw_network_panel, result=result), _network_tall(result))}
    for name, draw in {"energy": _draw_energy, **middle, **right}.items():
        found[name] = Panel(partial(_draw_short, draw=draw, result=result))
    return found


def _draw_short(axes: Axes, draw: Draw, result: ParticleResult) -> None:
    draw(axes, result)
    _shorten(axes)


def _shorten(axes: Axes) -> None:
    """Long times as powers of ten, lest they run into each other."""
    if axes.get_xscale() == "linear" and isinstance(axes.xaxis.get_major_formatter(), ScalarFormatter):
        axes.ticklabel_format(axis="x", scilimits=(-3, 5))


def _columns(result: ParticleResult) -> tuple[dict[str, Draw], dict[str, Draw]]:
    """What is measured of the whole, and of single contacts and particles."""
    few = max(len(result.contacts(frame)["h"]) for frame in range(len(result))) <= FEW
    middle: dict[str, Draw] = {"stress": _draw_stress}
    middle |= {"viscosity": _draw_viscosity} if has_viscosity(result) else {}
    periodic = is_periodic(result)
    middle |= {"normal_stresses": _draw_normal_stresses} if periodic and result.x.shape[2] > 1 else {}
    touching = len(result.contact_h) > 0
    middle |= {"coordination": _draw_coordination} if touching else {}
    right: dict[str, Draw] = {}
    if not touching:
        right |= {"pair_distribution": draw_pair_distribution} if periodic else {}
        right |= {"spread": draw_spread}
    else:  # dry contacts have no gap
        gaps = {"gaps": _draw_gaps if few else _draw_gap_distribution} if (result.contact_h > 0).any() else {}
        right |= {**gaps, "forces": _draw_forces if few else _draw_force_distribution}
    right |= {"bond_lengths": draw_bond_lengths} if "bond_r" in result.arrays and result.bond_r.size else {}
    right |= {"velocities": _draw_profile} if is_sheared(result) and not few else {}
    return middle, right


def _network_tall(result: ParticleResult) -> float:
    """Height of the panel with the contact network, over its width."""
    window = _window(result, [-1]) if not _in_space(result) else np.array([[0.0, 0.0], [1.0, 1.0]])
    wide, high = np.ptp(window, axis=0)
    return (float(np.clip(5.2 * high / wide, 1.6, 5.2)) + 1.6) / (14 * 1.4 / 3.4)


def _draw_network_panel(axes: Axes, result: ParticleResult) -> None:
    """The contact network at the end, with the scale of its colours."""
    largest = largest_force(result, [-1])
    _, colours = draw_network(axes, result, -1, largest)
    axes.set_title(_network_title(result), **TITLE)
    axes.set_anchor("N")
    beyond = np.abs(result.contacts(-1)["F"]).max(initial=0.0) > largest * (1 + 1e-9)
    bar = root_of(axes).colorbar(
        colours,
        ax=axes,
        label=FORCE,
        orientation="horizontal",
        shrink=0.9,
        aspect=40,
        pad=0.03,
        extend="both" if beyond else "neither",
    )
    bar.locator = MaxNLocator(5, symmetric=True)
    bar.update_ticks()


def _parameters(result: ParticleResult) -> str:
    texts = (
        f"{name} = "
        + (", ".join(f"{v:.4g} ({k})" for k, v in value.items()) if isinstance(value, Mapping) else f"{value:.4g}")
        for name, value in result.parameters.items()
    )
    return literal(", ".join(texts))


def _network_title(result: ParticleResult) -> str:
    if not _in_space(result):
        third = f", seen along {'xyz'[_hidden(result)]}" if result.x.shape[2] == 3 else ""
        links = "contacts" if len(result.contact_h) else "bonds" if "bond_r" in result.arrays else ""
        return f"particles, and forces at their {links}{third}" if links else f"particles{third}"
    shown = len(result.contacts(-1)["h"])
    return f"forces at the {f'{MOST} strongest of {shown}' if shown > MOST else shown} contacts, seen obliquely"


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
    writer = (_Gif if path.suffix == ".gif" else FFMpegWriter)(fps=rate)
    with written_whole(path) as temporary, writer.saving(figure, str(temporary), dpi=SHARPNESS[path.suffix]):
        for frame in frames:
            for artist in artists:
                artist.remove()
            artists, _ = draw_network(axes, result, frame, largest, window)
            axes.set_title(
                f"{literal(result.law)}, {_when(result, frame)}", fontsize="medium", loc="left", family="monospace"
            )
            writer.grab_frame()
    return path


class _Gif(PillowWriter):
    """Frames in few colours, the same in all: matplotlib's own take twice the room, and flicker."""

    _frames: list[Any]

    def finish(self) -> None:
        """Write the frames."""
        colours = self._frames[len(self._frames) // 2].quantize(IN_GIF)
        first, *others = (frame.quantize(palette=colours, dither=0) for frame in self._frames)
        first.save(self.outfile, save_all=True, append_images=others, duration=int(1000 / self.fps), loop=0)


def _when(result: ParticleResult, frame: int) -> str:
    return f"t = {result.t[frame]:.4g}" + (f", strain = {strain(result)[frame]:.3f}" if is_sheared(result) else "")


def largest_force(result: ParticleResult, frames: Iterable[int]) -> float:
    """Force that all but one in a hundred contacts of each of the frames stay below: the scale of their colours."""
    sizes = [np.abs(result.contacts(frame)["F"]) for frame in frames]
    sizes += [np.abs(bonds_at(result, frame)[3]) for frame in frames]
    return max((float(np.quantile(size, 0.99, method="higher")) for size in sizes if len(size)), default=0.0) or 1.0


def _in_space(result: ParticleResult) -> bool:
    """Whether there is a periodic box in three dimensions: its pictures have depth."""
    return bool(result.x.shape[2] == 3 and np.isfinite(result.box).any())


def _hidden(result: ParticleResult) -> int:
    """Axis along which a picture is seen: z, or in three dimensions that along which particles are nearest."""
    extent = np.ptp(padded(result.x.reshape(-1, result.x.shape[2])), axis=0)
    return int(2 - np.argmin(extent[::-1])) if result.x.shape[2] == 3 else 2


def _seen(result: ParticleResult) -> tuple[int, int]:
    """Axes of a picture."""
    first, second = (axis for axis in range(3) if axis != _hidden(result))
    return first, second


def _window(result: ParticleResult, frames: Iterable[int]) -> Array:
    """Lower left and upper right corner of what is drawn: the periodic box where there is one."""
    x = np.concatenate([_in_plane(result, result.x[frame]) for frame in frames])
    reach = 1.05 * float(result.radii.max())
    low, high = x.min(axis=0) - reach, x.max(axis=0) + reach
    for axis, length in enumerate(result.box[:2]):
        if math.isfinite(length):
            low[axis], high[axis] = 0.0, max(float(result.cell[frame][axis, axis]) for frame in frames)
    return np.array([low, high])


def draw_network(
    axes: Axes, result: ParticleResult, frame: int, largest: float, window: Array | None = None
) -> tuple[list[Artist], ScalarMappable]:
    """Draw the particles and contacts of a frame.

    In one and two dimensions a particle is flattened where it is pressed, by the deflection of its surface; what is
    left between two of them is the gap. Each contact is a line from the centre of a particle to the middle of the gap,
    wide and coloured by its force. Images of particles show where they reach into the window.

    In three dimensions the view is along the axis along which particles are nearest to each other, and they are
    flattened where they are seen from the side. Of a periodic box the edges, small balls at the centres and the
    strongest contacts are drawn, seen obliquely, paler the farther they are.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    result : ParticleResult
    frame : int
    largest : float
        Force at the ends of the colour scale.
    window : array, shape (2, 2), optional
        Lower left and upper right corner; by default, of this frame. Not for a periodic box in three dimensions.

    Returns
    -------
    list of matplotlib.artist.Artist
        What was drawn.
    matplotlib.cm.ScalarMappable
        The scale of the colours.
    """
    colours = ScalarMappable(Normalize(-largest, largest), FORCES)
    if _in_space(result):
        return _draw_in_space(axes, result, frame, largest, colours), colours
    window = _window(result, [frame]) if window is None else window
    x, radii, contacts = _in_plane(result, result.x[frame]), result.radii, result.contacts(frame)
    owner, toward, depth, middle = _ends(result, contacts)
    shapes = _outlines(radii, owner, toward, depth)
    instance, place = _images(x, radii, result.cell[frame], window)
    if result.x.shape[2] == 3:  # the nearer hide the farther
        hidden = result.x[frame][:, _hidden(result)] * (-1 if _hidden(result) == 1 else 1)
        order = np.argsort(hidden[instance], kind="stable")
        instance, place = instance[order], place[order]
    F = np.concatenate([contacts["F"], contacts["F"][contacts["j"] < len(radii)]])
    # each end of a contact, once for each image of its particle
    drawn, end = _matches(instance, owner)
    halves = np.stack([place[drawn], place[drawn] + middle[end, None] * toward[end]], axis=1)
    particles = PolyCollection(
        list(shapes[instance] + place[:, None]), facecolor="0.93", edgecolor="0.6", linewidth=0.5
    )
    widths = _widths(axes, F[end], largest, 0.3 * float(radii.mean()) / float(np.ptp(window, axis=0).max()))
    network = LineCollection(list(halves), colors=colours.to_rgba(F[end]), linewidths=list(widths))
    artists: list[Artist] = [axes.add_collection(particles), axes.add_collection(network)]
    i, j, along, tension = bonds_at(result, frame)
    if len(i):
        half = _in_plane(result, along) / 2
        drawn, end = _matches(instance, np.concatenate([i, j]))
        ends = np.stack([place[drawn], place[drawn] + np.concatenate([half, -half])[end]], axis=1)
        pull = np.concatenate([tension, tension])[end]
        bonds = LineCollection(list(ends), colors=colours.to_rgba(-pull), linewidths=2.0, capstyle="round")
        artists.append(axes.add_collection(bonds))
    normals = _in_plane(result, result.wall_normal)
    for point, normal in zip(_in_plane(result, result.wall_point[frame]), normals, strict=True):
        if math.isclose(float(np.linalg.norm(normal)), 1.0, rel_tol=1e-6):  # seen from the side
            artists.append(axes.axline(point, point + np.array([-normal[1], normal[0]]), color="0.3", linewidth=1))
    first, second = (f"${'xyz'[axis]}$" for axis in _seen(result))
    axes.set(xlabel=first, ylabel=second, xlim=window[:, 0], ylim=window[:, 1])
    if result.x.shape[2] == 1:
        axes.set(ylabel="", yticks=[])
    axes.set_aspect("equal")
    return artists, colours


def _widths(axes: Axes, F: Array, largest: float, widest: float) -> Array:
    """Widths of lines in points, as the roots of forces; ``widest`` relative to the picture's smaller edge."""
    size = min(axes.bbox.width, axes.bbox.height) / axes.figure.dpi * 72
    widths: Array = float(np.clip(widest * size, 0.8, 6.0)) * np.sqrt(np.clip(np.abs(F) / largest, 0.02, 1.0))
    return widths


def _draw_in_space(
    axes: Axes, result: ParticleResult, frame: int, largest: float, colours: ScalarMappable
) -> list[Artist]:
    """Draw the contact network of a periodic box in three dimensions."""
    placed, contacts = boxed(result, frame), result.contacts(frame)
    points, ends = lines(result, placed, contacts)
    strongest = np.argsort(np.abs(contacts["F"]), kind="stable")[-MOST:]
    F, ends = contacts["F"][strongest], ends[strongest]
    corners, edges = outline(placed)
    corners = corners @ OBLIQUE.T
    seen = points @ OBLIQUE.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float(np.max(high[:2] - low[:2]))

    def paler(colour: Any, depth: Array) -> Array:
        """Colours, the farther the nearer to white."""
        near = np.clip((depth - low[2]) / (high[2] - low[2]), 0.0, 1.0)[:, None]
        return np.asarray(1 - (0.3 + 0.7 * near) * (1 - np.asarray(colour)[..., :3]))

    artists: list[Artist] = []
    if is_periodic(result):
        artists.append(
            axes.add_collection(LineCollection(list(corners[edges][:, :, :2]), colors="0.5", linewidths=0.7))
        )
    balls = np.argsort(seen[: len(result.radii), 2])
    small = 0.6 * result.radii[balls]
    centres = EllipseCollection(
        small, small, np.zeros_like(small), units="xy", offsets=seen[balls, :2], offset_transform=axes.transData,
        facecolors=list(paler((0.7, 0.7, 0.7), seen[balls, 2])), edgecolors="none",
    )  # fmt: skip
    artists.append(axes.add_collection(centres))
    middle = seen[ends].mean(axis=1)
    order = np.argsort(middle[:, 2])
    widths = _widths(axes, F[order], largest, 0.2 * float(result.radii.mean()) / size)
    network = LineCollection(
        list(seen[ends][order][:, :, :2]), colors=list(paler(colours.to_rgba(F[order]), middle[order, 2])),
        linewidths=list(widths),
    )  # fmt: skip
    artists.append(axes.add_collection(network))
    margin = 0.04 * size
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    axes.set_aspect("equal")
    axes.set_axis_off()
    for axis, name in enumerate("xyz"):
        beside = np.array([0.0, -0.03 * size] if axis == 0 else [-0.03 * size, 0.0])
        at = ((placed.corner + placed.cell[:, axis] / 2) @ OBLIQUE.T)[:2] + beside
        artists.append(axes.text(at[0], at[1], f"${name}$"))
    return artists


def _ends(result: ParticleResult, contacts: dict[str, NDArray[Any]]) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Two ends of each contact, one where it is with a wall: particle, direction, deflection, distance to mid-gap.

    The deflection 2 delta of both surfaces is shared as 1/E; a rigid wall has none of it.
    """
    count = len(result.radii)
    i, j, n = contacts["i"], contacts["j"], _in_plane(result, contacts["n"])
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
    middle = result.radii[owner] - depth + gap / 2
    askew = np.linalg.norm(toward, axis=1) < 1 - 1e-6  # a facet that is not seen from the side
    return owner, toward, np.where(askew, 0.0, depth), middle


def _outlines(radii: Array, owner: NDArray[np.int64], toward: Array, depth: Array) -> Array:
    """Outlines of particles cut flat at their contacts, shape (N, CORNERS, 2)."""
    angle = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    r = np.tile(radii[:, None], CORNERS)
    pressed = depth > 0
    owner, cosine = owner[pressed], toward[pressed] @ around.T
    plane = (radii[owner] - depth[pressed])[:, None]
    np.minimum.at(r, owner, np.where(cosine > 0, plane / np.maximum(cosine, 1e-9), np.inf))
    return np.asarray(r[:, :, None] * around)


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


def _in_plane(result: ParticleResult, vectors: Array) -> Array:
    """Components of vectors along the axes of a picture."""
    return padded(vectors)[:, _seen(result)]


def _course(result: ParticleResult) -> tuple[Array, str]:
    """Values that frames are drawn against, and their label: the strain where it grows all the time, else the time."""
    if is_sheared(result) and len(result) > 1:
        along = strain(result)
        if np.all(np.diff(along) > 0) or np.all(np.diff(along) < 0):
            return along, "strain"
    return result.t, "time $t$"


def _draw_course(
    axes: Axes, result: ParticleResult, curves: list[tuple[Array, dict[str, Any]]], title: str, from_zero: bool = False
) -> None:
    """Draw what is measured at each frame.

    A start that is by far beyond what follows, as where particles were not at rest, would flatten it: it is left out of
    the scale, and the title says so. Not if the scale is to start from zero.
    """
    along, label = _course(result)
    for values, style in curves:
        axes.plot(along, values, **{"marker": "o" if len(result) == 1 else "", **style})
    every = np.array([values for values, _ in curves])
    rest = every[:, 1:][np.isfinite(every[:, 1:])]
    if from_zero:
        # room above for curves that are nearly level, too
        axes.set_ylim(0, 1.07 * float(np.nanmax(every, initial=0.0)) or None)
    elif len(result) > 3 and len(rest):
        low, high = float(rest.min()), float(rest.max())
        spread = high - low
        off = (every[:, 0] < low - 3 * spread) | (every[:, 0] > high + 3 * spread)
        if spread and off.any():
            axes.set_ylim(low - 0.07 * spread, high + 0.07 * spread)
            title += " (start is off the scale)"
    axes.set(xlabel=label)
    axes.set_title(title, **TITLE)
    axes.grid(alpha=0.3)


def _draw_profile(axes: Axes, result: ParticleResult) -> None:
    """Velocity along x across the flow at the end, each particle at its image in the box, beside the flow's."""
    x, v, rate = result.x[-1][:, 1], result.v[-1][:, 0], float(result.gradient[-1, 0, 1])
    if np.isfinite(result.box[1]):
        turns = np.floor(x / result.cell[-1][1, 1]) * result.cell[-1][1, 1]
        x, v = x - turns, v - rate * turns
    axes.plot(v, x, ".", color=GREEN, markersize=3, label="particles", rasterized=True)
    ends = np.array([x.min(), x.max()])
    axes.plot(rate * ends, ends, color="k", linewidth=1, label=r"flow, $\dot\gamma y$")
    axes.set(xlabel="velocity along $x$", ylabel="$y$")
    axes.set_title("velocities across the flow", **TITLE)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3)


def _draw_stress(axes: Axes, result: ParticleResult) -> None:
    d = result.stress.shape[1]
    styles = [(0, 0, BLUE), (1, 1, ORANGE), (2, 2, GREEN), (0, 1, PURPLE)]
    curves: list[tuple[Array, dict[str, Any]]] = [
        (
            result.stress[:, a, b],
            {
                "color": colour,
                "label": rf"$\sigma_{{{'xyz'[a]}{'xyz'[b]}}}$",
                # equal ones show below each other
                "linestyle": "-" if a == b == 0 else (0, (4 + 2 * a, 1 + b)),
            },
        )
        for a, b, colour in styles
        if max(a, b) < d
    ]
    title = "stress" if is_periodic(result) else "virial (force times length)"
    _draw_course(axes, result, curves, f"{title}, > 0 in tension")
    axes.set(ylabel=r"$\sigma$")
    axes.legend(**BESIDE)


def _draw_coordination(axes: Axes, result: ParticleResult) -> None:
    curves: list[tuple[Array, dict[str, Any]]] = [(coordination(result), {"color": GREEN, "label": "all"})]
    held = coordination(result, without_rattlers=True)
    if np.isfinite(held).all():
        curves.append((held, {"color": BLUE, "linestyle": "--", "label": "without\nrattlers"}))
    _draw_course(axes, result, curves, "pressed contacts per particle", from_zero=True)
    axes.set(ylabel="$Z$")
    if len(curves) > 1:
        axes.legend(**BESIDE)


def _draw_viscosity(axes: Axes, result: ParticleResult) -> None:
    curves: list[tuple[Array, dict[str, Any]]] = [(relative_viscosity(result), {"color": PURPLE})]
    _draw_course(axes, result, curves, "relative viscosity")
    axes.set(ylabel=r"$1 + \sigma_{xy}/(\eta\,\dot\gamma)$")


def _draw_normal_stresses(axes: Axes, result: ParticleResult) -> None:
    first, second = normal_stress_differences(result)
    curves: list[tuple[Array, dict[str, Any]]] = [(first, {"color": BLUE, "label": "$N_1$"})]
    if result.x.shape[2] == 3:
        curves.append((second, {"color": ORANGE, "label": "$N_2$"}))
    curves.append((pressure(result), {"color": "0.4", "linestyle": "--", "label": r"$\Pi$"}))
    _draw_course(axes, result, curves, "normal stresses")
    axes.set(ylabel="differences, pressure")
    axes.legend(**BESIDE)


#: Words for the energies that are taken, and how they are drawn.
TAKEN: dict[str, tuple[str, dict[str, Any]]] = {
    "stored": ("stored", {"color": BLUE}),
    "gaps": ("lost in the gaps", {"color": ORANGE}),
    "drag": ("lost by drag", {"color": GREEN}),
    "remote": ("remote forces", {"color": PURPLE}),
    "U_h": ("$U_h$ term", {"color": "0.5"}),
    "sliding": ("lost in sliding", {"color": AMBER}),
    "rolling": ("lost in rolling", {"color": SKY}),
    "k_t": ("$k_t$ term", {"color": "0.5", "linestyle": "-."}),
}


def _draw_energy(axes: Axes, result: ParticleResult) -> None:
    """Each term of the balance that is there; all that is given is the sum of all that is taken."""
    along, label = _course(result)
    told = result.stats.get("given", ("external", "flow", "box"))
    put_in = [name for name in told if f"energy_{name}" in result.arrays]
    given = sum(result.arrays[f"energy_{name}"] for name in put_in)
    kinds = [name.removeprefix("energy_") for name in result.arrays if name.startswith("energy_")]
    taken = {name: result.arrays[f"energy_{name}"] for name in (*TAKEN, *kinds) if name in kinds and name not in put_in}
    axes.plot(along, given, color="0.8", linewidth=4, label="given")
    axes.plot(along, sum(taken.values()), color="k", linestyle="--", linewidth=1, label="taken, in all")
    used = {TAKEN[name][1]["color"] for name, values in taken.items() if name in TAKEN and values.any()}
    others = itertools.cycle(colour for colour in COLOURS if colour not in used)
    for name, values in taken.items():
        if values.any():
            words, style = TAKEN[name] if name in TAKEN else (name, {"color": next(others)})
            axes.plot(along, values, label=words, **style)
    axes.set(xlabel=label, ylabel="energy since the start")
    axes.set_title("balance of energy", **TITLE)
    columns = 4 if root_of(axes).get_figwidth() > NARROW else 2
    axes.legend(
        fontsize="small", loc="upper center", bbox_to_anchor=(0.5, 0), borderaxespad=4, ncols=columns, frameon=False
    )
    axes.grid(alpha=0.3)


def _draw_gaps(axes: Axes, result: ParticleResult) -> None:
    _draw_histories(axes, result, "h")
    axes.set(yscale="log", ylabel="$h$")
    axes.set_title("gaps", **TITLE)


def _draw_forces(axes: Axes, result: ParticleResult) -> None:
    _draw_histories(axes, result, "F")
    axes.axhline(0, color="0.6", linewidth=0.5)
    axes.set(ylabel="$F$")
    axes.set_title("forces, > 0 in compression", **TITLE)


def _draw_histories(axes: Axes, result: ParticleResult, name: str) -> None:
    """One line for each pair that is ever in contact, with gaps where it is not."""
    along, label = _course(result)
    count = len(result.radii)
    frames = [result.contacts(frame) for frame in range(len(result))]
    values = [
        {(i, j): value for i, j, value in zip(frame["i"], frame["j"], frame[name], strict=True)} for frame in frames
    ]
    pairs = list(dict.fromkeys(pair for of_frame in values for pair in of_frame))
    curves = np.array([[of_frame.get(pair, math.nan) for of_frame in values] for pair in pairs])
    coarse = 0.0 if name == "h" else 1e-3 * float(np.nanmax(np.abs(curves), initial=0.0))
    alike: list[list[int]] = []  # those that cannot be told apart are one line
    for number, curve in enumerate(curves):
        for others in alike:
            if np.allclose(curve, curves[others[0]], rtol=1e-3, atol=coarse, equal_nan=True):
                others.append(number)
                break
        else:
            alike.append([number])
    named = len(alike) <= len(COLOURS)
    for own, colour in zip(alike, itertools.cycle(COLOURS if named else [BLUE]), strict=False):
        ends = ", ".join(f"{i}–{j}" if j < count else f"{i}–wall\u00a0{j - count}" for i, j in (pairs[k] for k in own))
        marker = "o" if len(result) == 1 else ""
        axes.plot(along, curves[own[0]], color=colour, marker=marker, label=fill(ends, 10))
    axes.set(xlabel=label)
    axes.grid(alpha=0.3)
    if named and pairs:
        axes.legend(**BESIDE, title="pairs")


def _draw_gap_distribution(axes: Axes, result: ParticleResult) -> None:
    edges, density = gap_distribution(result)
    if len(density):
        axes.stairs(density, edges, fill=True, color=BLUE)
        if edges[-1] > 3 * edges[0]:
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            if edges[-1] < 200 * edges[0]:
                axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        else:
            axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.set(xlabel="$h$", ylabel=r"density of $\ln h$")
    axes.set_title("distribution of gaps", **TITLE)


def _draw_force_distribution(axes: Axes, result: ParticleResult) -> None:
    edges, density = force_distribution(result)
    for sign, colour, label in ((-1, BLUE, "pulled"), (1, ORANGE, "pressed")):
        mine = sign * (edges[1:] + edges[:-1]) > 0
        if density[mine].any():
            among = np.append(mine, False) | np.insert(mine, 0, False)
            axes.stairs(density[mine], edges[among], color=colour, fill=True, label=label)
    if len(density):
        axes.legend(fontsize="small")
        if density.max() > 10 * density[density > 0].min():
            axes.set_yscale("log")
    axes.set(xlabel=r"$F/\langle|F|\rangle$", ylabel="density")
    axes.set_title("distribution of forces", **TITLE)
