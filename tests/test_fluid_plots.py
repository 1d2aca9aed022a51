"""Pictures and files of flows, from arrays as a result has them: what is drawn is what the arrays say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, TriMesh
from PIL import Image

from softdyn.errors import SceneError
from softdyn.fluid.built_meshes import box_mesh, cylinder_mesh
from softdyn.fluid.fluid_export import write_vtk
from softdyn.fluid.fluid_plots import animate_fluid, picture_of, plot_fluid, tight_boundaries
from softdyn.fluid.mesh import Mesh, volumes
from softdyn.fluid.numbering import nodes_of
from softdyn.results.result import Result

Array = Any


class Arrays(Result):
    """A result of nothing but its arrays."""

    origin = None

    def __init__(self, arrays: dict[str, Array]) -> None:
        self.arrays = arrays


def flow(
    mesh: Mesh, order: int, times: list[float], periodic: tuple[tuple[str, str], ...] = (), bed: bool = False
) -> Arrays:
    """A flow that is known everywhere: u = (1 + t + y^2, x), p = x - y at its nodes; periodic along what is given."""
    velocity, pressure = nodes_of(mesh, order, periodic), nodes_of(mesh, 1, periodic)
    x, y = velocity.at.T[:2]
    u = np.zeros((len(times), *velocity.at.shape))
    u[:, :, 0] = 1 + np.array(times)[:, None] + y**2
    u[:, :, 1] = 0 if periodic else x
    p = pressure.at[:, 0] * (0 if periodic else 1) - pressure.at[:, 1]
    arrays: dict[str, Array] = {"t": np.array(times), "u": u, "p": np.tile(p, (len(times), 1))}
    arrays |= {"at": mesh.at, "corners": mesh.corners, "u_nodes": velocity.of, "p_nodes": pressure.of}
    arrays |= {"c": np.tile(0.4 + 0.1 * y, (len(times), 1))} if bed else {}
    arrays["step_t"] = np.linspace(0, times[-1], 5 * len(times)) if len(times) > 1 else np.zeros(1)
    arrays["boundary_names"] = np.array(list(mesh.boundaries))
    for number, (name, facets) in enumerate(mesh.boundaries.items()):
        arrays[f"boundary_{name}"] = facets
        arrays[f"force_{name}"] = np.full((len(arrays["step_t"]), mesh.dimension), float(number))
        arrays[f"flux_{name}"] = np.full(len(arrays["step_t"]), 1.0 if name in ("inlet", "outlet") else 1e-12)
    return Arrays(arrays)


@pytest.mark.parametrize("order", [1, 2])
def test_a_plane_flow_is_drawn_with_its_speed_streamlines_and_pressure(order: int) -> None:
    result = flow(cylinder_mesh(around=32), order, [0.0])
    figure = plot_fluid(result)
    speed, pressure = (axes for axes in figure.axes if axes.get_title(loc="left") in ("speed $|u|$", "pressure"))
    for axes, values in ((speed, np.linalg.norm(result.u[0], axis=1)), (pressure, result.p[0])):
        (drawn,) = [one for one in axes.collections if isinstance(one, TriMesh)]
        shown = drawn.get_array()
        assert shown is not None
        assert shown.max() == pytest.approx(values.max())
        assert drawn.norm.vmax == pytest.approx(values.max())
    lines = [one for one in speed.collections if isinstance(one, LineCollection)]
    assert sum(len(one.get_segments()) for one in lines) > 30
    assert "steady" in figure.get_suptitle()
    assert "force on walls (2, 2); cylinder (3, 3)" in figure.get_suptitle()


def test_the_area_of_what_is_drawn_is_that_of_the_fluid() -> None:
    mesh = cylinder_mesh(around=32)
    triangles = picture_of(flow(mesh, 2, [0.0])).triangles
    assert triangles is not None
    a, b, c = (np.stack([triangles.x, triangles.y], axis=1)[triangles.triangles[:, k]] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(volumes(mesh).sum())


def test_forces_are_drawn_over_time_on_what_nothing_flows_through() -> None:
    result = flow(cylinder_mesh(around=32), 1, [0.0, 1.0, 2.0], bed=True)
    assert tight_boundaries(result) == ["walls", "cylinder"]
    figure = plot_fluid(result)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert {"porosity times speed $|u|$", "porosity", "force of the fluid along x"} <= set(titles)
    forces = figure.axes[titles.index("force of the fluid along y")]
    assert [line.get_label() for line in forces.lines] == ["walls", "cylinder"]
    assert (forces.lines[1].get_ydata() == 3).all()
    assert "t = 2" in figure.get_suptitle()


def test_frames_of_a_run_that_has_not_ended_have_a_picture_without_forces() -> None:
    result = flow(cylinder_mesh(around=16), 1, [0.0, 1.0])
    for name in [name for name in result.arrays if name.startswith(("step_", "force_", "flux_"))]:
        result.arrays[name] = result.arrays[name][:0]
    figure = plot_fluid(result)
    assert [axes.get_title(loc="left") for axes in figure.axes][:2] == ["speed $|u|$", "pressure"]
    assert figure.get_suptitle() == f"{len(result.corners)} triangles, t = 1"


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_a_flow_in_space_is_drawn_as_a_slice_through_its_middle(order: int) -> None:
    mesh = box_mesh((2, 1, 0.5), (4, 4, 2))
    figure = plot_fluid(flow(mesh, order, [0.0]))
    pressure = next(axes for axes in figure.axes if axes.get_title(loc="left") == "pressure")
    (image,) = pressure.images
    shown = np.asarray(image.get_array())
    assert shown[0, 0] == pytest.approx(0, abs=1e-12)
    assert shown[-1, -1] == pytest.approx(1)
    assert "slice at z = 0.25" in figure.get_suptitle()


def test_a_fluid_at_rest_has_a_picture() -> None:
    result = flow(box_mesh((1, 1), (2, 2)), 1, [0.0])
    result.arrays["u"] *= 0
    result.arrays["p"] *= 0
    figure = plot_fluid(result)
    speed = figure.axes[0].collections[0]
    assert isinstance(speed, TriMesh)
    assert speed.norm.vmin == 0


def test_an_animation_has_a_picture_for_each_frame(tmp_path: Path) -> None:
    result = flow(cylinder_mesh(around=16), 2, [0.0, 0.5, 1.0])
    animate_fluid(result, tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as image:
        assert image.n_frames == 3


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("lengths", [(2.0, 1.0), (2.0, 1.0, 1.0)])
@pytest.mark.parametrize("periodic", [False, True])
def test_files_for_paraview_hold_the_fields_at_the_places_of_the_nodes(
    tmp_path: Path, order: int, lengths: tuple[float, ...], periodic: bool
) -> None:
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("pyevtk")
    mesh = box_mesh(lengths, [4, 3, 2][: len(lengths)])
    result = flow(mesh, order, [0.0, 1.0], periodic=(("left", "right"),) if periodic else (), bed=True)
    write_vtk(result, tmp_path / "run.pvd")
    listed = (tmp_path / "run.pvd").read_text()
    assert listed.count("DataSet ") == 2
    read = meshio.read(tmp_path / "run" / "flow_1.vtu")
    x, y = read.points.T[:2]
    assert len(x) == np.prod([order * n + 1 for n in (4, 3, 2)[: len(lengths)]])
    assert read.point_data["flux"][:, 0] == pytest.approx(2 + y**2)
    assert read.point_data["flux"][:, 1] == pytest.approx(0 * x if periodic else x)
    assert read.point_data["porosity"].reshape(-1) == pytest.approx(0.4 + 0.1 * y)
    assert read.point_data["velocity"][:, 0] == pytest.approx((2 + y**2) / (0.4 + 0.1 * y))
    assert read.point_data["pressure"].reshape(-1) == pytest.approx((0 if periodic else x) - y)
    (block,) = read.cells
    kinds = {(2, 1): "triangle", (2, 2): "triangle6", (3, 1): "tetra", (3, 2): "tetra10"}
    assert block.type == kinds[len(lengths), order]
    # nodes in VTK's order: the middles of edges as it numbers them
    ends = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))[: 3 if len(lengths) == 2 else 6]
    for place, (i, j) in enumerate(ends if order == 2 else (), len(lengths) + 1):
        middle = (read.points[block.data[:, i]] + read.points[block.data[:, j]]) / 2
        assert read.points[block.data[:, place]] == pytest.approx(middle)


def test_panels_of_a_flow_are_drawn_by_name() -> None:
    result = flow(cylinder_mesh(around=32), 1, [0.0])
    figure = plot_fluid(result, panels=["pressure"], width="column")
    assert figure.axes[0].get_title(loc="left") == "pressure"
    assert figure.get_figwidth() == 3.4
    with pytest.raises(SceneError, match="panel 'porosity': the result has none"):
        plot_fluid(result, panels=["porosity"])


def test_labels_of_a_tall_flow_are_within_the_picture(tmp_path: Path) -> None:
    """Where a picture has proportions of its own, its first layout is not its last."""
    figure = plot_fluid(flow(box_mesh((8, 12), (4, 6)), 1, [0.0]), panels=["speed", "pressure"], width="column")
    figure.savefig(tmp_path / "tall.png", dpi=150)
    labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes if axes.get_ylabel()]
    assert len(labels) == 2
    assert min(label.x0 for label in labels) >= 0
