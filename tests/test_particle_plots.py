"""Pictures and animations of many particles: what is drawn is what was computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.animation import FFMpegWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from numpy.typing import NDArray
from PIL import Image

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.particles import particle_plots as plots
from softdyn.particles.geometry import Wall
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_plots import draw_network
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def two(d: int = 2, **changes: Any) -> ParticleScene:
    """Two unequal particles, one of them three times as hard, pushed together, and from above onto a wall."""
    pad = [0.0] * (d - 1)
    settings: dict[str, Any] = {
        "law": "rognon_gay",
        "parameters": {"E": {"hard": 3.0, "soft": 1.0}, "eta": 1.0},
        "positions": [[0.0, *pad], [2.55, *pad]],
        "radii": [1.0, 1.5],
        "species": ["soft", "hard"],
        "gap": 0.05,
        "push": [Push([0], [3e-2, *pad]), Push([1], [-3e-2, *pad])],
        "range": 0.4,
        "drag": 1.0,
        "until_t": 300.0,
        "times": 3,
        "rtol": 1e-3,
    }
    return ParticleScene(**{**settings, **changes})


def packing(strain: float) -> ParticleResult:
    """A periodic packing, sheared."""
    place = np.array([[i + 0.5 * (j % 2), j * np.sqrt(3) / 2] for j in range(6) for i in range(6)]) * 1.9
    box = np.array([6.0, 3 * np.sqrt(3)]) * 1.9
    scene = ParticleScene(
        law="rognon_gay",
        parameters={"E": 1.0, "eta": 1.0},
        positions=np.mod(place + 0.3 + 0.05 * np.random.default_rng(1).uniform(-1, 1, place.shape), box),
        radii=1.0,
        box=list(box),
        gap=0.05,
        range=0.4,
        shear_rate=1e-3,
        drag=1.0,
        until_t=1e3 * strain,
        times=3,
        rtol=1e-2,
    )
    return simulate_particles(scene)


def drawn(result: ParticleResult, frame: int) -> tuple[list[Array], Array]:
    """Outlines of particles, shape (corners, 2) each, and lines of contacts, shape (lines, 2, 2)."""
    axes = Figure().add_subplot()
    artists, _ = draw_network(axes, result, frame, 1.0)
    outlines = [np.asarray(path.vertices)[:-1] for path in artists[0].get_paths()]  # type: ignore[attr-defined]
    return outlines, np.array(artists[1].get_segments())  # type: ignore[attr-defined]


def test_what_is_left_between_two_particles_is_the_gap() -> None:
    """Both are cut flat, the soft one deeper, as 1/E; lines meet in the middle of the gap."""
    result = simulate_particles(two())
    (left, right), lines = drawn(result, -1)
    contacts = result.contacts(-1)
    h, delta = contacts["h"][0], contacts["delta"][0]
    assert right[:, 0].min() - left[:, 0].max() == pytest.approx(h, rel=1e-9)
    x = result.x[-1, :, 0]
    assert left[:, 0].max() - x[0] == pytest.approx(1.0 - 2 * delta * 3 / 4)
    assert x[1] - right[:, 0].min() == pytest.approx(1.5 - 2 * delta / 4)
    np.testing.assert_allclose(lines[0, 1], lines[1, 1], atol=1e-12)
    np.testing.assert_allclose(lines[:, 0], result.x[-1], atol=1e-12)
    # beyond the facet each is round
    assert left[:, 0].min() == pytest.approx(x[0] - 1.0)


@pytest.mark.parametrize("rigid", [True, False])
def test_a_rigid_wall_gives_in_by_nothing(rigid: bool) -> None:
    wall = Wall(np.array([0.0, -1.05]), np.array([0.0, -1.0]), rigid=rigid)
    result = simulate_particles(two(wall=[wall], push=[Push([0], [0.0, -3e-2])], positions=[[0, 0], [8.0, 2.0]]))
    outlines, _ = drawn(result, -1)
    contacts = result.contacts(-1)
    lowest = outlines[0][:, 1].min()
    given_in = 0.0 if rigid else contacts["delta"][0]
    assert lowest - contacts["h"][0] + given_in == pytest.approx(-1.05)


@given(strain=st.floats(0.0, 1.0))
def test_a_sheared_box_is_filled_by_images(strain: float) -> None:
    """Whatever the tilt, the window shows as much of particles as the box holds, and all contacts are whole."""
    result = BEFORE
    cell = np.array([[result.box[0], strain * result.box[1]], [0.0, result.box[1]]])
    arrays = {**result.arrays, "cell": np.array([cell])}
    # positions that fill the tilted cell as they filled the first: an affine map keeps each within its own cell
    x = result.x[0] + strain * np.column_stack([result.x[0][:, 1], np.zeros(36)])
    arrays["x"], arrays["contact_start"] = x[None], np.array([0, 0])
    outlines, _ = drawn(ParticleResult("", "", {}, arrays, {}, {}), 0)
    centres = np.array([outline.mean(axis=0) for outline in outlines])
    low, high = np.zeros(2), result.box
    inside = ((centres >= low) & (centres < high)).all(axis=1)
    assert inside.sum() == 36
    # every image that reaches into the window is there: count them over a wide patch of the lattice
    shifts = [i * cell[:, 0] + j * cell[:, 1] for i in range(-4, 4) for j in range(-3, 4)]
    every = np.concatenate([x + shift for shift in shifts])
    reaching = ((every > low - 1) & (every < high + 1)).all(axis=1)
    assert len(outlines) == reaching.sum()


BEFORE = packing(0.001)


def test_both_halves_of_a_contact_meet_across_the_faces_of_the_box() -> None:
    result = packing(0.7)
    contacts = result.contacts(-1)
    _, lines = drawn(result, -1)
    cell = result.cell[-1]
    middles = np.linalg.solve(cell, lines[:, 1].T).T
    middles -= np.floor(middles + 1e-9)
    expected = result.x[-1][contacts["i"]] + contacts["n"] * (1 - contacts["delta"] + contacts["h"] / 2)[:, None]
    expected = np.linalg.solve(cell, expected.T).T
    expected -= np.floor(expected + 1e-9)
    apart = np.linalg.norm(middles[:, None] - expected[None], axis=2)
    apart = np.minimum(apart, np.abs(apart - 1))  # a face of the box, seen from both sides
    assert np.all(apart.min(axis=1) < 1e-6)
    # each contact is drawn from both of its ends at least
    nearest = np.bincount(apart.argmin(axis=1), minlength=len(expected))
    assert np.all(nearest >= 2)


def spheres(strain: float = 0.7, count: int = 4) -> ParticleResult:
    """A periodic cubic packing, sheared in three dimensions."""
    place = 1.98 * np.array([np.array(at) + 0.5 for at in np.ndindex(count, count, count)])
    scene = ParticleScene(
        law="rognon_gay",
        parameters={"E": 1.0, "eta": 1.0},
        positions=place + 0.05 * np.random.default_rng(1).uniform(-1, 1, place.shape),
        radii=1.0,
        box=[1.98 * count] * 3,
        gap=0.05,
        range=0.4,
        shear_rate=1e-3,
        drag=1.0,
        until_t=1e3 * strain,
        times=4,
        rtol=1e-2,
    )
    return simulate_particles(scene)


def test_a_box_in_space_shows_its_strongest_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines are as long as contacts seen obliquely, the stronger the wider, pushed ones orange and pulled ones blue."""
    result = spheres()
    contacts = result.contacts(-1)
    r = 2 + contacts["h"] - 2 * contacts["delta"]
    largest = np.abs(contacts["F"]).max()
    for most in (10_000, 50):
        monkeypatch.setattr(plots, "MOST", most)
        axes = Figure().add_subplot()
        artists, _ = draw_network(axes, result, -1, largest)
        box, _, network = (artist for artist in artists[:3])
        assert len(box.get_segments()) == 12  # type: ignore[attr-defined]
        lines = np.array(network.get_segments())  # type: ignore[attr-defined]
        shown = np.argsort(np.abs(contacts["F"]))[-most:]
        assert len(lines) == len(shown) == min(most, len(r))
        # orthographic: what is seen of a line is the part of it across the direction of sight
        sight = np.cross(*plots.OBLIQUE[:2])
        np.testing.assert_allclose(sight, plots.OBLIQUE[2], atol=1e-15)
        across = r * np.sqrt(1 - (contacts["n"] @ sight) ** 2)
        lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        np.testing.assert_allclose(np.sort(lengths), np.sort(across[shown]), rtol=1e-6)
    # of the last picture: by their widths lines are in the order of their forces, and pushed ones are redder than blue
    widths, colours = np.array(network.get_linewidths()), np.array(network.get_colors())  # type: ignore[attr-defined]
    F = contacts["F"][shown][np.argsort(np.abs(contacts["F"][shown]))]
    by_width = colours[np.argsort(widths)]
    strong = np.abs(F) > 0.1 * largest
    assert np.array_equal(by_width[strong, 0] > by_width[strong, 2], F[strong] > 0)


def test_particles_in_space_are_seen_along_the_axis_where_they_are_nearest() -> None:
    """A pair along x and one along z: seen along y, flattened; walls from the side."""
    scene = two(
        3,
        positions=[[0.0, 0.0, 0.0], [2.55, 0.0, 0.5]],
        wall=[Wall(np.array([0.0, 0.0, -1.05]), np.array([0.0, 0.0, -1.0]))],
    )
    result = simulate_particles(scene)
    axes = Figure().add_subplot()
    artists, _ = draw_network(axes, result, -1, 1.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$x$", "$z$")
    assert len(artists) == 3
    lines = np.array(artists[1].get_segments())  # type: ignore[attr-defined]
    contacts = result.contacts(-1)
    pair = int(np.flatnonzero(contacts["j"] == 1)[0])
    ends = lines[[0 if pair == 0 else 1]]
    np.testing.assert_allclose(ends[0, 0], result.x[-1, 0, [0, 2]], atol=1e-9)
    # both outlines end where the gap starts
    n = contacts["n"][pair, [0, 2]]
    outlines = [np.asarray(path.vertices)[:-1] for path in artists[0].get_paths()]  # type: ignore[attr-defined]
    reach = sorted((outline @ n for outline in outlines), key=lambda along: float(np.mean(along)))
    assert reach[1].min() - reach[0].max() == pytest.approx(contacts["h"][pair], rel=1e-3)


def test_a_wall_in_one_dimension_is_drawn() -> None:
    result = simulate_particles(two(1, wall=[Wall(np.array([-1.1]), np.array([-1.0]))]))
    axes = Figure().add_subplot()
    artists, _ = draw_network(axes, result, -1, 1.0)
    assert len(artists) == 3
    assert artists[2].get_xy1() == pytest.approx([-1.1, 0.0])  # type: ignore[attr-defined]


def panel(figure: Figure, title: str) -> Any:
    """Axes whose title starts with these words."""
    return next(axes for axes in figure.axes if axes.get_title(loc="left").startswith(title))


@pytest.mark.parametrize("start", [-300.0, 5.0])
def test_a_start_that_would_flatten_what_follows_is_off_the_scale(start: float) -> None:
    """And the title says so; any other is on it."""
    result = spheres(0.01)
    stress = np.zeros((4, 3, 3)) + np.array([start, 4.0, 5.0, 7.0])[:, None, None]
    axes = panel(ParticleResult("", "", {"eta": 1.0}, {**result.arrays, "stress": stress}, {}, {}).plot(), "stress")
    low, high = axes.get_ylim()
    off = start == -300
    assert axes.get_title(loc="left").endswith("(start is off the scale)") == off
    assert (low > start) == off
    assert low < 4 < 7 < high


def test_curves_are_over_the_strain_where_it_grows_and_else_over_time() -> None:
    result = spheres(0.01)
    (line, *_) = panel(result.plot(), "stress").get_lines()
    np.testing.assert_allclose(line.get_xdata(), 1e-3 * result.t)
    back = result.cell.copy()
    back[3] = back[1]
    there_and_back = ParticleResult("", "", {"eta": 1.0}, {**result.arrays, "cell": back}, {}, {})
    (line, *_) = panel(there_and_back.plot(), "stress").get_lines()
    np.testing.assert_array_equal(line.get_xdata(), result.t)


@pytest.mark.parametrize("which", ["line", "few", "emulsion", "spheres"])
def test_no_words_run_into_another_picture(which: str) -> None:
    """Neither labels, nor titles, nor legends: what belongs to one set of axes overlaps with that of no other."""
    results = {"line": lambda: simulate_particles(two(1)), "few": lambda: simulate_particles(two()), "spheres": spheres}
    result = results[which]() if which in results else packing(0.7)
    if which == "spheres":  # with the longest titles
        result.arrays["stress"][0] = 1e4  # type: ignore[index]
    figure = result.plot()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [box for axes in figure.axes if (box := axes.get_tightbbox(canvas.get_renderer())) is not None]
    assert len(boxes) == len(figure.axes)
    for k, one in enumerate(boxes):
        for other in boxes[:k]:
            overlap = Bbox.intersection(one, other)
            assert overlap is None or min(overlap.width, overlap.height) < 2
        assert one.x0 > -2
        assert one.x1 < figure.bbox.x1 + 2


def test_an_animation_has_each_frame(tmp_path: Path) -> None:
    result = simulate_particles(two())
    with Image.open(result.animate(tmp_path / "a.gif")) as animation:
        assert getattr(animation, "n_frames", 1) == len(result) == 3
        frames = []
        for number in range(3):
            animation.seek(number)
            frames.append(np.asarray(animation.convert("RGB"), dtype=float))
    assert all(np.abs(frames[k] - frames[k + 1]).max() > 50 for k in range(2))


def test_the_command_line_animates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = simulate_particles(two()).save(tmp_path / "a.npz")
    assert main(["plot", str(path), "-o", str(tmp_path / "a.gif")]) == 0
    assert (tmp_path / "a.gif").stat().st_size > 10_000
    pad = simulate_particles(two(3)).save(tmp_path / "b.npz")
    assert main(["plot", str(pad), "-o", str(tmp_path / "b.gif")]) == 2
    assert "OVITO" in capsys.readouterr().err


def test_a_missing_program_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result = simulate_particles(two())
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SceneError, match="the program ffmpeg is needed"):
        result.animate(tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs the program ffmpeg")
def test_an_mp4_is_written(tmp_path: Path) -> None:
    path = simulate_particles(two()).animate(tmp_path / "a.mp4")
    assert path.read_bytes()[4:8] == b"ftyp"


def test_the_energies_of_frames_add_up() -> None:
    """Those of the last frame are those of the run; all that is given is taken, at each frame."""
    result = simulate_particles(two(times=6, rtol=1e-5))
    for name in ("external", "flow", "box", "gaps", "drag", "remote", "U_h", "stored"):
        assert result.arrays[f"energy_{name}"][-1] == pytest.approx(result.energy[name])
        assert result.arrays[f"energy_{name}"][0] == 0.0
    given_in = sum(result.arrays[f"energy_{name}"] for name in ("external", "flow", "box"))
    taken = sum(result.arrays[f"energy_{name}"] for name in ("stored", "gaps", "drag", "remote", "U_h"))
    np.testing.assert_allclose(given_in, taken, atol=1e-4 * given_in[-1])
    assert np.all(np.diff(result.energy_gaps) > 0)


def test_panels_are_drawn_by_name_at_the_width_of_a_column() -> None:
    result = packing(1e-3)
    figure = result.plot(panels=["stress", "energy"], width="column")
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["stress, > 0 in tension", "balance of energy"]
    assert figure.get_figwidth() == 3.4
    assert all(axes.get_title(loc="left") for axes in result.plot(panels=["network"], width=5).axes[:1])


def test_a_panel_is_drawn_into_axes_of_ones_own() -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    result = packing(1e-3)
    assert result.plot(panels=["stress"], ax=right) is figure
    assert right.get_title(loc="left") == "stress, > 0 in tension"
    assert not left.lines


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        ({"panels": ["strss"]}, "panel 'strss': the result has none; did you mean 'stress'"),
        ({"panels": "stress"}, "panels is a list of some of network, energy, stress"),
        ({"width": "colum"}, "width must be one of column, page, or a number"),
        ({"panels": ["stress", "energy"], "ax": Figure().subplots()}, "ax takes a single panel"),
    ],
)
def test_panels_that_there_are_not_are_refused(layout: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        packing(1e-3).plot(**layout)
