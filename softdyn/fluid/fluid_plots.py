"""Pictures of a flow: speed and streamlines, pressure, porosity, forces on boundaries over time; animations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from softdyn.colours import BLUE, GREEN, ORANGE, PURPLE
from softdyn.errors import SceneError
from softdyn.fluid.fluid_fields import spread_to
from softdyn.fluid.locate import located, locator, sampled
from softdyn.fluid.mesh import Mesh
from softdyn.fluid.numbering import nodes_of
from softdyn.results.axis_units import tell_units
from softdyn.results.chosen_panels import Panel, chosen_panels, root_of
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from softdyn.results.result import Result

Array = NDArray[np.float64]

#: Triangles between the nodes of a triangle of order 2.
QUARTERS = ((0, 3, 4), (3, 1, 5), (4, 5, 2), (3, 5, 4))
#: Points of a slice, and of the grid that streamlines follow, along the longer side of the picture.
ACROSS = {"slice": 400, "streamlines": 160}
#: An animation lasts as long as its frames at a rate within these bounds allow.
SECONDS, RATES = 8, (4, 25)
COLOURS = (BLUE, ORANGE, GREEN, PURPLE, "0.3", "0.6")
TITLE: dict[str, Any] = {"loc": "left", "fontsize": "medium"}
#: Speeds below this, over the largest, are rounding: there are no streamlines to draw.
STILL = 1e-12
#: Fraction of the points that may be beyond an end of the colours.
FEW = 0.005
#: Through a wall flows at most this much, over what flows through any other part of the boundary.
TIGHT = 1e-6


@dataclass(frozen=True)
class Picture:
    """What is drawn of a flow, in a plane: all of it, or a slice.

    Attributes
    ----------
    axes : tuple of int
        Of the picture.
    low, high : arrays, shape (2,)
    triangles : Triangulation or None
        Of a plane flow, between the nodes of the velocity.
    spread : function
        Values at the points that are drawn, of those at nodes of the velocity, or of the pressure: at the nodes of the
        triangles, or on the grid of a slice, shape (up, across), nan where there is no fluid.
    grid : tuple of two arrays
        Places along the axes, at which streamlines are followed.
    on_grid : function
        Values there.
    where : str
        Of a slice, which.
    """

    axes: tuple[int, int]
    low: Array
    high: Array
    triangles: Triangulation | None
    spread: Callable[[Array], Array]
    grid: tuple[Array, Array]
    on_grid: Callable[[Array], Array]
    where: str = ""


def plot_fluid(
    result: Result,
    *,
    width: str | float | None = None,
    panels: Sequence[str] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw the flow at the end: speed and streamlines, pressure, porosity; and over time velocities of grains, forces.

    In three dimensions it is a slice through the middle, along the two longer sides. Forces are those of the fluid on
    the parts of the boundary that nothing flows through.

    Parameters
    ----------
    result : Result
    width : "column", "page" or number, optional
        Of a figure of some panels; a number is in inches.
    panels : sequence of str, optional
        Which panels, below one another: "speed", "pressure", "porosity", "velocities", "stress", "bond_lengths",
        "force_x" and so on, as far as there are any; without it, all, in a figure of its own size.
    ax : matplotlib Axes, optional
        Where to draw a single panel, in a figure of one's own.

    Raises
    ------
    SceneError
        If a panel is unknown, or if the result lacks what it shows.
    """
    picture = picture_of(result)
    fields = _fields(result)
    lines = _lines(result, picture)
    wide, high = picture.high - picture.low
    if panels is not None or width is not None or ax is not None:
        shape = float(np.clip(0.8 * high / wide, 0.25, 2.0)) + 0.1
        known = {name: Panel(partial(_draw_field, picture=picture, result=result, name=name), shape) for name in fields}
        known |= {name: Panel(draw) for name, draw in lines.items()}
        figure = chosen_panels(known, ["speed"] if panels is None else panels, width or "page", ax)
        tell_units([ax] if ax is not None else figure.axes, result, _units(result))
        return figure
    across_page = float(np.clip(4.4 * wide / high, 6.0, 11.0))
    tall = float(np.clip(0.86 * across_page * high / wide, 1.3, 7.0)) + 0.75
    # beside each other where they are as high as they are wide
    across = len(fields) if across_page < 8 else 1
    each = min(0.95 * across_page, tall * wide / high + 2) if across > 1 else across_page + 1.4
    rows = [tall] * (len(fields) // across) + [2.3] * len(lines)
    figure = Figure(figsize=(each * across, sum(rows) + 0.6), layout="constrained")
    grid = figure.add_gridspec(len(rows), across, height_ratios=rows)
    places = [figure.add_subplot(grid[k // across, k % across]) for k in range(len(fields))]
    for axes, name in zip(places, fields, strict=True):
        _draw_field(axes, picture, result, name)
        if across > 1:
            axes.locator_params(axis="x", nbins=3)
    for k, draw in enumerate(lines.values(), start=len(fields) // across):
        draw(figure.add_subplot(grid[k, :]))
    tell_units(figure.axes, result, _units(result))
    figure.suptitle(_told(result, picture), fontsize="medium")
    return figure


def _units(result: Result) -> dict[str, str]:
    """Units of what axes and titles show; in two dimensions forces are those on a length across the flow."""
    force = "N" if result.at.shape[1] == 3 else "N/m"
    found = {"time $t$": "s", "$x$": "m", "$y$": "m", "$z$": "m", "$v$": "m/s", "pressure": "Pa"}
    found |= {rf"$\sigma_{{{a}{b}}}$": "Pa" for a in "xyz" for b in "xyz"}
    return {**found, _speed_title(result): "m/s", **{f"$F_{axis}$": force for axis in "xyz"}}


def _fields(result: Result) -> dict[str, tuple[str, Array, str]]:
    """Fields that are drawn, by name: title, values, colours."""
    found = {
        "speed": (_speed_title(result), _speeds(result, -1), "viridis"),
        "pressure": ("pressure", result.p[-1], "RdBu_r"),
    }
    return found | ({"porosity": ("porosity", result.c[-1], "cividis")} if "c" in result.arrays else {})


def _draw_field(axes: Axes, picture: Picture, result: Result, name: str) -> None:
    """A field at the end, with the scale of its colours; streamlines and grains on the speed."""
    title, values, colours = _fields(result)[name]
    low, high = _range(picture, values, from_zero=name == "speed")
    drawn = draw_field(axes, picture, values, colours, (low, high))
    axes.set_title(title, **TITLE)
    shown = picture.spread(values)
    below, above = np.nanmin(shown) < low, np.nanmax(shown) > high
    extend = "both" if below and above else "min" if below else "max" if above else "neither"
    root_of(axes).colorbar(drawn, ax=axes, pad=0.015, fraction=0.05, extend=extend)
    if name == "speed":
        draw_streamlines(axes, picture, result.u[-1])
        if "radii" in result.arrays:
            draw_grains(axes, picture, result)


def _lines(result: Result, picture: Picture) -> dict[str, Callable[[Axes], None]]:
    """What is drawn over time, by name."""
    walls = tight_boundaries(result) if len(result.step_t) > 1 else []
    grains = "radii" in result.arrays and bool(len(result.radii)) and len(result) > 1
    found: dict[str, Callable[[Axes], None]] = {}
    if grains:
        found["velocities"] = partial(_draw_velocities, result=result)
        if _is_sheared(result):
            found["stress"] = partial(_draw_stresses, result=result)
    if grains and "bond_r" in result.arrays and result.bond_r.size:
        from softdyn.particles.free_plots import draw_bond_lengths

        found["bond_lengths"] = partial(draw_bond_lengths, result=result)
    for axis in picture.axes if walls else ():
        found[f"force_{'xyz'[axis]}"] = partial(_draw_forces, result=result, names=walls, axis=axis)
    return found


def animate_fluid(result: Result, path: Path) -> Path:
    """Draw the speed of each frame, one after the other; in three dimensions on a slice through the middle.

    Parameters
    ----------
    result : Result
    path : Path
        Ending in .gif, or in .mp4, which needs the program ffmpeg.

    Raises
    ------
    SceneError
        If ffmpeg is not there, or the file cannot be written.
    """
    if path.suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise SceneError(f"cannot draw {path}: the program ffmpeg is needed, and there is none; draw a .gif instead")
    rate = int(np.clip(len(result) / SECONDS, *RATES))
    picture = picture_of(result)
    wide, high = picture.high - picture.low
    width = float(np.clip(4.4 * wide / high, 5.0, 10.0))
    figure = Figure(
        figsize=(width + 1.2, float(np.clip(0.86 * width * high / wide, 1.3, 9)) + 0.9), layout="constrained"
    )
    axes = figure.add_subplot()
    largest = max(float(_speeds(result, frame).max()) for frame in range(len(result)))
    drawn = draw_field(axes, picture, _speeds(result, 0), "viridis", (0.0, largest))
    figure.colorbar(drawn, ax=axes, pad=0.015, fraction=0.05, label=_speed_title(result))
    grains = draw_grains(axes, picture, result, 0) if "radii" in result.arrays else None
    writer = (PillowWriter if path.suffix == ".gif" else FFMpegWriter)(fps=rate)
    with written_whole(path) as temporary, writer.saving(figure, str(temporary), dpi=100):
        for frame in range(len(result)):
            drawn.set_array(picture.spread(_speeds(result, frame)))
            if grains is not None:
                grains.set_offsets(_grain_places(picture, result, frame))
            axes.set_title(f"t = {result.t[frame]:<10.4g} {picture.where}", family="monospace", **TITLE)
            writer.grab_frame()
    return path


def picture_of(result: Result) -> Picture:
    """Prepare what all pictures of a result share."""
    at, corners = result.at, result.corners
    d = at.shape[1]
    extent = np.ptp(at, axis=0)
    hidden = 2 if d == 2 else int(2 - np.argmin(extent[::-1]))
    axes = tuple(axis for axis in range(3) if axis != hidden)[:2]
    low, high = at.min(axis=0)[list(axes)], at.max(axis=0)[list(axes)]
    middle = 0.0 if d == 2 else float(at[:, hidden].min() + extent[hidden] / 2)
    search = locator(at, corners)

    def grid_of(count: int) -> tuple[tuple[Array, Array], Callable[[Array], Array]]:
        step = float(np.max(high - low)) / count
        lines = tuple(np.linspace(a, b, max(8, round((b - a) / step)) + 1) for a, b in zip(low, high, strict=True))
        first, second = np.meshgrid(*lines)
        points = np.full((first.size, d), middle)
        points[:, axes[0]], points[:, axes[1]] = first.reshape(-1), second.reshape(-1)
        found = located(search, points)

        def on_grid(values: Array) -> Array:
            nodes = result.u_nodes if len(values) == len(result.u[0]) else result.p_nodes
            taken = sampled(values, nodes, *found)
            return taken.reshape(*first.shape, *values.shape[1:])

        return (lines[0], lines[1]), on_grid

    grid, on_grid = grid_of(ACROSS["streamlines"])
    if d == 3:
        _, spread = grid_of(ACROSS["slice"])
        where = f"slice at {'xyz'[hidden]} = {middle:.4g}"
        return Picture((axes[0], axes[1]), low, high, None, spread, grid, on_grid, where)
    triangles, spread = _plane(result)
    return Picture((0, 1), low, high, triangles, spread, grid, on_grid)


def _plane(result: Result) -> tuple[Triangulation, Callable[[Array], Array]]:
    """Triangles between the nodes of a plane flow, each node at its own place, and values there."""
    order = 2 if result.u_nodes.shape[1] > 3 else 1
    nodes = nodes_of(Mesh(result.at, result.corners, {}), order)
    of = nodes.of[:, np.array(QUARTERS if order == 2 else ((0, 1, 2),))].reshape(-1, 3)

    def spread(values: Array) -> Array:
        return spread_to(values, result, nodes)

    return Triangulation(*nodes.at.T, of), spread


def draw_field(axes: Axes, picture: Picture, values: Array, colours: str, limits: tuple[float, float]) -> Any:
    """Draw values at nodes in colours; returns what a colour bar takes.

    Parameters
    ----------
    axes : Axes
    picture : Picture
    values : array, shape (nodes,)
    colours : str
        Name of a colour map.
    limits : (float, float)
        Values at its ends.
    """
    norm = Normalize(*limits)
    shown = picture.spread(values)
    if picture.triangles is not None:
        drawn: Any = axes.tripcolor(
            picture.triangles, shown, shading="gouraud", cmap=colours, norm=norm, rasterized=True
        )
    else:
        extent = (picture.low[0], picture.high[0], picture.low[1], picture.high[1])
        drawn = axes.imshow(
            shown, origin="lower", extent=extent, cmap=colours, norm=norm, interpolation="bilinear", aspect="equal"
        )
    first, second = ("xyz"[axis] for axis in picture.axes)
    margin = 0.01 * float(np.max(picture.high - picture.low))
    axes.set(
        xlabel=f"${first}$",
        ylabel=f"${second}$",
        xlim=(picture.low[0] - margin, picture.high[0] + margin),
        ylim=(picture.low[1] - margin, picture.high[1] + margin),
    )
    axes.set_aspect("equal")
    return drawn


def draw_streamlines(axes: Axes, picture: Picture, u: Array) -> list[Artist]:
    """Draw lines along the flow, of its components in the picture; none of a fluid at rest.

    Parameters
    ----------
    axes : Axes
    picture : Picture
    u : array, shape (nodes, d)
        Velocities.
    """
    flow = picture.on_grid(u)[..., list(picture.axes)]
    first, second = np.moveaxis(np.nan_to_num(flow), -1, 0)
    if not np.hypot(first, second).max() > STILL * np.abs(u).max() > 0:
        return []
    hole = np.isnan(flow[..., 0])
    wide, high = picture.high - picture.low
    density = (float(np.clip(1.3 * wide / high, 0.8, 3.0)), float(np.clip(1.3 * high / wide, 0.8, 3.0)))
    lines = axes.streamplot(
        *picture.grid,
        np.ma.array(first, mask=hole),
        np.ma.array(second, mask=hole),
        color="w",
        linewidth=0.6,
        density=density,
        arrowsize=0.7,
    )
    assert isinstance(lines.lines, LineCollection)
    lines.lines.set_alpha(0.8)
    return [lines.lines]


def draw_grains(axes: Axes, picture: Picture, result: Result, frame: int = -1) -> EllipseCollection:
    """Draw the outlines of grains, in three dimensions of all of them, whatever the slice.

    Parameters
    ----------
    axes : Axes
    picture : Picture
    result : Result
    frame : int
    """
    sizes, none = 2 * result.radii, np.zeros(len(result.radii))
    grains = EllipseCollection(
        sizes, sizes, none, units="xy", offsets=_grain_places(picture, result, frame), offset_transform=axes.transData,
        facecolors="none", edgecolors=ORANGE, linewidths=0.8,
    )  # fmt: skip
    axes.add_collection(grains, autolim=False)
    if frame == -1 and "bond_i" in result.arrays:
        axes.add_collection(_bond_lines(picture, result), autolim=False)
    return grains


def _bond_lines(picture: Picture, result: Result) -> LineCollection:
    """Lines between grains whose bond holds at the end, but for those through what is periodic."""
    places = _grain_places(picture, result, -1)
    ends = places[np.column_stack([result.bond_i, result.bond_j])]
    near = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) <= np.nan_to_num(result.bond_r[-1]) * (1 + 1e-9)
    return LineCollection([*ends[near & np.isinf(result.bond_broken)]], colors=ORANGE, linewidths=1.6)


def _grain_places(picture: Picture, result: Result, frame: int) -> Array:
    """Places of the grains in the picture, on the near side of what is periodic."""
    low, side = result.at.min(axis=0), np.ptp(result.at, axis=0)
    return np.asarray((low + (result.x[frame] - low) % side)[:, list(picture.axes)])


def tight_boundaries(result: Result) -> list[str]:
    """Names of the parts of the boundary that nothing flows through, at any time; none without a history."""
    names = result.boundary_names.tolist() if len(result.step_t) else []
    names = [name for name in names if f"flux_{name}" in result.arrays]  # not the periodic
    flows = {name: float(np.abs(result.arrays[f"flux_{name}"]).max()) for name in names}
    largest = max(flows.values(), default=0.0)
    return [name for name, flow in flows.items() if flow <= TIGHT * largest or largest == 0]


def _draw_forces(axes: Axes, result: Result, names: list[str], axis: int) -> None:
    for name, colour in zip(names, [*COLOURS] * len(names), strict=False):
        axes.plot(result.step_t, result.arrays[f"force_{name}"][:, axis], color=colour, label=name)
    axes.set(xlabel="time $t$", ylabel=f"$F_{'xyz'[axis]}$")
    axes.set_title(f"force of the fluid along {'xyz'[axis]}", **TITLE)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=4, borderpad=0.1)


def _draw_velocities(axes: Axes, result: Result) -> None:
    """Mean velocity of the grains over time."""
    for axis, (values, colour) in enumerate(zip(result.v.mean(axis=1).T, COLOURS, strict=False)):
        axes.plot(result.t, values, color=colour, label=f"along {'xyz'[axis]}")
    axes.set(xlabel="time $t$", ylabel="$v$")
    axes.set_title("mean velocity of the grains", **TITLE)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=3, borderpad=0.1)


def _is_sheared(result: Result) -> bool:
    if "fluid_stress" not in result.arrays:
        return False
    from softdyn.suspension.stresses import is_sheared

    return is_sheared(result.arrays)


def _draw_stresses(axes: Axes, result: Result) -> None:
    """Shear stress of fluid and grains in each step, along the axes of which it is largest."""
    from softdyn.suspension.stresses import WORDS, largest_shear

    a, b = largest_shear(result.arrays)
    for (name, words), colour in zip(WORDS.items(), COLOURS, strict=False):
        axes.plot(result.step_t, result.arrays[name][:, a, b], color=colour, label=words)
    axes.set(xlabel="time $t$", ylabel=rf"$\sigma_{{{'xyz'[a]}{'xyz'[b]}}}$")
    axes.set_title("mean shear stress", **TITLE)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=2, borderpad=0.1)


def _speeds(result: Result, frame: int) -> Array:
    return np.asarray(np.linalg.norm(result.u[frame], axis=1))


def _speed_title(result: Result) -> str:
    return "porosity times speed $|u|$" if "c" in result.arrays else "speed $|u|$"


def _range(picture: Picture, values: Array, from_zero: bool) -> tuple[float, float]:
    """Ends of the colours: of what is drawn, farther apart than rounding; without a few points that are far off.

    Pressures have such at corners, where a wall ends or begins to move: there they grow without bound.
    """
    shown = picture.spread(values)
    low, high = 0.0 if from_zero else float(np.nanmin(shown)), float(np.nanmax(shown))
    inner = [float(edge) for edge in np.nanquantile(shown, (FEW, 1 - FEW))]
    spread = inner[1] - inner[0]
    if not from_zero and spread > 0:
        low = low if low > inner[0] - 0.5 * spread else inner[0]
        high = high if high < inner[1] + 0.5 * spread else inner[1]
    least = 1e-9 * max(abs(low), abs(high)) or 1.0
    if high - low >= least:
        return low, high
    return (0.0 if from_zero else low - least), high + least


def _told(result: Result, picture: Picture) -> str:
    """Title of a picture: which flow, when, and forces on walls of one that is steady."""
    count, d = len(result.corners), result.at.shape[1]
    kind = "triangles" if d == 2 else "tetrahedra"
    when = "steady" if len(result) == len(result.step_t) == 1 else f"t = {result.t[-1]:.4g}"
    lines = [", ".join(part for part in (f"{count} {kind}", when, picture.where) if part)]
    if when == "steady":
        told = {name: result.arrays[f"force_{name}"][-1] for name in tight_boundaries(result)[:3]}
        least = STILL * max((float(np.abs(force).max()) for force in told.values()), default=0.0)
        forces = [
            f"{name} ({', '.join(f'{x:.5g}' if abs(x) > least else '0' for x in force)})"
            for name, force in told.items()
        ]
        lines += [f"force on {'; '.join(forces)}"] if forces else []
    return "\n".join(lines)
