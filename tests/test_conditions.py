"""Conditions at boundaries: what is given at which node, where fluid slips, and that an enclosed flow balances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from softdyn.errors import SceneError
from softdyn.fluid.bed import Bed, bed_faults, porosity_at
from softdyn.fluid.boundary_keys import Boundary, periodic_pairs
from softdyn.fluid.built_meshes import box_mesh, cylinder_mesh
from softdyn.fluid.conditions import Conditions, conditions_of, given_values
from softdyn.fluid.fields import field_of, values_at
from softdyn.fluid.mesh import Mesh, facet_normals, mesh_of
from softdyn.fluid.mesh_section import MeshSection, made_mesh
from softdyn.fluid.numbering import Nodes, nodes_of

Array = Any
REST = {2: [0, 0], 3: [0, 0, 0]}


def of(mesh: Mesh, boundaries: list[Boundary], order: int = 2, **constants: float) -> tuple[Conditions, Nodes]:
    """Conditions, and the nodes of the velocity."""
    pairs = periodic_pairs(boundaries)
    velocity, pressure = nodes_of(mesh, order, pairs), nodes_of(mesh, 1, pairs)
    return conditions_of(boundaries, mesh, velocity, pressure, constants), velocity


def velocities(conditions: Conditions, t: float = 0.0, **more: Any) -> Array:
    """What is given at each node, nan where it is not, shape (nodes, d)."""
    count, d = conditions.at.shape
    u = np.full(count * d, np.nan)
    values, _ = given_values(conditions, t, **more)
    u[conditions.fixed] = values[: len(conditions.fixed)]
    return u.reshape(d, count).T


def flux(mesh: Mesh, velocity: Nodes, u: Array, order: int) -> float:
    """Flux through the boundary of what the nodes have, by quadrature of order 3 on each edge, two dimensions."""
    total = 0.0
    for name, facets in mesh.boundaries.items():
        normals = facet_normals(mesh.at, facets)
        for s, weight in ((0.5 - math.sqrt(15) / 10, 5 / 18), (0.5, 4 / 9), (0.5 + math.sqrt(15) / 10, 5 / 18)):
            shapes = [1 - s, s] if order == 1 else [(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)]
            at = sum(shape * u[velocity.facets[name][:, k]] for k, shape in enumerate(shapes))
            total += weight * float(np.sum(at * normals))
    return total


@pytest.mark.parametrize("order", [1, 2])
def test_a_channel_has_its_profile_at_the_inlet_and_rest_at_walls(order: int) -> None:
    mesh = cylinder_mesh(around=32)
    conditions, nodes = of(
        mesh,
        [
            Boundary("inlet", velocity=["4*U*y*(H - y)/H**2*sin(t)", 0]),
            Boundary(["walls", "cylinder"], velocity=[0, 0]),
            Boundary("outlet", pressure="2*t"),
        ],
        order,
        U=0.3,
        H=0.41,
    )
    u = velocities(conditions, math.pi / 2)
    inlet = np.unique(nodes.facets["inlet"])
    y = nodes.at[inlet, 1]
    assert u[inlet, 0] == pytest.approx(1.2 * y * (0.41 - y) / 0.41**2, abs=1e-15)
    for name in ("walls", "cylinder"):
        assert (u[np.unique(nodes.facets[name])] == 0).all()
    inner = np.setdiff1d(nodes.facets["outlet"], nodes.facets["walls"])
    assert np.isnan(u[inner]).all()
    assert conditions.levels == ()
    assert conditions.of_time
    (outlet,) = conditions.outlets
    assert outlet.name == "outlet"
    assert (nodes.at[outlet.nodes][..., 0] == 2.2).all()
    assert values_at(outlet.pressure, nodes.at[outlet.nodes[:, 0]], 3.0) == pytest.approx(6.0)


def test_at_corners_each_boundary_keeps_the_flow_through_it() -> None:
    """A lid does not leak, whatever moves beside it; what flows in evenly does so up to the wall."""
    mesh = box_mesh((1, 1), (4, 4))
    moving = [Boundary("top", velocity=[1, 0]), Boundary(["left", "right"], velocity=[0, 2])]
    for entries in (moving, moving[::-1]):
        conditions, nodes = of(mesh, [*entries, Boundary("bottom", velocity=[0, 0])])
        u = velocities(conditions)
        for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
            assert (u[(nodes.at == corner).all(axis=1)] == 0).all()
    inflow = [Boundary("left", velocity=["1", "3"]), Boundary(["bottom", "top"], velocity=[0, 0])]
    conditions, nodes = of(mesh, [*inflow, Boundary("right", pressure=0)])
    u = velocities(conditions)
    left = np.unique(nodes.facets["left"])
    at_wall = np.isin(nodes.at[left, 1], (0, 1))
    assert (u[left] == np.where(at_wall[:, None], [1, 0], [1, 3])).all()


def test_at_corners_in_space_walls_of_one_name_have_a_normal_each() -> None:
    mesh = box_mesh((1, 1, 1), (2, 3, 3))
    walls = Boundary(["bottom", "top", "front", "back"], velocity=[0, 0, 0])
    conditions, nodes = of(mesh, [Boundary("left", velocity=[1, 2, 3]), walls, Boundary("right", pressure=0)])
    left = np.unique(nodes.facets["left"])
    y, z = nodes.at[left, 1:].T
    expected = np.stack([0 * y + 1, 2.0 * ~np.isin(y, (0, 1)), 3.0 * ~np.isin(z, (0, 1))], axis=1)
    # along an edge the wall at rest holds, whatever is left
    expected[np.isin(y, (0, 1)) | np.isin(z, (0, 1)), 1:] = 0
    assert velocities(conditions)[left] == pytest.approx(expected)


def test_where_boundaries_meet_without_an_edge_a_wall_at_rest_holds_and_else_the_later() -> None:
    """A side of a box of three parts: what moves, a wall at rest, what moves otherwise; a corner of 30 degrees, too."""
    box = box_mesh((1, 1), (3, 2))
    at = box.at.copy()
    at[:, 1] += np.where(box.at[:, 0] < 0.5, 0.2, 0.0) * (1 - box.at[:, 1])  # the floor's first part leans
    floor = box.boundaries["bottom"][np.argsort(box.at[box.boundaries["bottom"]].mean(axis=1)[:, 0])]
    rest = {name: facets for name, facets in box.boundaries.items() if name != "bottom"}
    mesh = mesh_of(at, box.corners, rest | {"a": floor[:1], "b": floor[1:2], "c": floor[2:]})
    others = Boundary(list(rest), pressure=0)
    moving = [Boundary("a", velocity=[1, 1]), Boundary("c", velocity=[2, 2])]
    conditions, nodes = of(mesh, [*moving, Boundary("b", velocity=[0, 0]), others])
    u = velocities(conditions)
    assert (u[np.unique(nodes.facets["b"])] == 0).all()
    conditions, nodes = of(mesh, [*moving, Boundary("b", velocity=[3, 3]), others])
    assert velocities(conditions)[np.unique(nodes.facets["b"])] == pytest.approx(3.0)


def test_velocity_is_multiplied_by_the_porosity_and_flux_is_not() -> None:
    mesh = box_mesh((1, 1), (4, 4))
    entries = [
        Boundary("left", velocity=[1, 0]),
        Boundary(["bottom", "top"], slip=True),
        Boundary("right", pressure=0),
    ]
    conditions, nodes = of(mesh, entries)
    c = 0.3 + 0.5 * nodes.at[:, 1]
    left = np.unique(nodes.facets["left"])
    assert velocities(conditions, c=c)[left, 0] == pytest.approx(c[left])
    conditions, _ = of(mesh, [Boundary("left", flux=[1, 0]), *entries[1:]])
    assert (velocities(conditions, c=c)[left, 0] == 1).all()


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("lengths", [(2.0, 1.0), (2.0, 1.0, 1.5)])
def test_along_planes_of_symmetry_nothing_flows_through_and_edges_have_both_normals(
    lengths: tuple[float, ...], order: int
) -> None:
    """On a box that is turned, all of whose sides slip: 1, 2 or 3 directions are left out at sides, edges, corners."""
    d = len(lengths)
    turn, _ = np.linalg.qr(np.random.default_rng(d).normal(size=(d, d)))
    box = box_mesh(lengths, [3] * d)
    mesh = mesh_of(box.at @ turn, box.corners, box.boundaries)
    conditions, nodes = of(mesh, [Boundary(list(mesh.boundaries), slip=True)], order)
    straight = nodes.at @ turn.T
    sides = np.isclose(straight, 0) | np.isclose(straight, lengths)
    assert np.bincount(conditions.slipping[:, 0], minlength=nodes.count) == pytest.approx(sides.sum(axis=1))
    assert (conditions.slipping == conditions.slipping[:, :1] + nodes.count * np.arange(d)).all()
    # what is free along a side: motion along the other axes
    for node, normal in zip(conditions.slipping[:, 0], conditions.normals @ turn.T, strict=True):
        assert np.linalg.norm(normal[~sides[node]]) < 1e-12
        assert np.linalg.norm(normal) == pytest.approx(1)
    (level,) = conditions.levels
    assert (level == d * nodes.count + np.arange(nodes_of(mesh, 1).count)).all()


@pytest.mark.parametrize("order", [1, 2])
def test_nothing_flows_through_a_round_boundary_with_slip_whatever_flows_along_it(order: int) -> None:
    mesh = cylinder_mesh(around=32)
    conditions, nodes = of(
        mesh, [Boundary("cylinder", slip=True), Boundary(["inlet", "outlet", "walls"], velocity=[0, 0])], order
    )
    draw = np.random.default_rng(1).normal(size=nodes.at.shape)
    node, normal = conditions.slipping[:, 0], conditions.normals
    assert len(np.unique(node)) == len(node) == 32 * order
    draw[node] -= np.sum(draw[node] * normal, axis=1)[:, None] * normal
    others = np.setdiff1d(np.arange(nodes.count), node)
    draw[others] = 0
    assert flux(mesh, nodes, draw, order) == pytest.approx(0, abs=1e-15)
    radial = nodes.at[node] - [0.2, 0.2]
    assert np.abs(np.sum(radial * normal, axis=1)) == pytest.approx(np.linalg.norm(radial, axis=1), rel=1e-3)


def test_a_given_velocity_holds_before_slip_and_both_with_a_pressure_slip_holds() -> None:
    mesh = box_mesh((1, 1), (4, 4))
    conditions, nodes = of(
        mesh,
        [
            Boundary(["bottom", "top"], slip=True),
            Boundary("left", velocity=[1, 0]),
            Boundary("right", pressure=0),
        ],
    )
    slipping = nodes.at[conditions.slipping[:, 0]]
    assert slipping[:, 0].min() > 0
    assert slipping[:, 0].max() == 1
    assert velocities(conditions)[np.unique(nodes.facets["left"])] == pytest.approx(np.array([[1, 0]] * 9))


@pytest.mark.parametrize("order", [1, 2])
def test_a_periodic_channel_has_no_ends(order: int) -> None:
    mesh = box_mesh((2, 1), (6, 4))
    conditions, nodes = of(
        mesh, [Boundary(["left", "right"], periodic=True), Boundary(["bottom", "top"], velocity=[0, 0])], order
    )
    assert len(conditions.fixed) == 2 * 2 * 6 * order
    assert nodes.count == 6 * order * (4 * order + 1)
    assert len(conditions.levels[0]) == 6 * 5


@pytest.mark.parametrize("order", [1, 2])
def test_what_interpolation_lets_into_an_enclosed_flow_is_taken_off(order: int) -> None:
    """A parabola flows in and a quartic out, of one flux: on nodes they differ; walls stay at rest."""
    mesh = box_mesh((2, 1), (8, 8))
    entries = [
        Boundary("left", velocity=["6*y*(1 - y)", 0]),
        Boundary("right", velocity=["20*y**3*(1 - y) + 0*t", 0]),
        Boundary(["bottom", "top"], velocity=[0, 0]),
    ]
    conditions, nodes = of(mesh, entries, order)
    u = velocities(conditions)
    assert flux(mesh, nodes, np.nan_to_num(u), order) == pytest.approx(0, abs=1e-14)
    left = np.unique(nodes.facets["left"])
    y = nodes.at[left, 1]
    assert u[left, 0] == pytest.approx(6 * y * (1 - y), rel=0.01 if order == 1 else 1e-4, abs=1e-14)
    _, warnings = given_values(conditions, 0.0)
    assert "into an enclosed part of the fluid" in warnings[0]
    assert ("let 0.984375" if order == 1 else "let 1 into") in warnings[0]


def test_what_moving_grains_carry_through_a_boundary_is_balanced_with_the_fluid() -> None:
    """What the grains bring in the fluid must carry out: div(u + us) = 0."""
    mesh = box_mesh((1, 1), (4, 4))
    entries = [Boundary(["left", "right"], velocity=["-0.5", 0]), Boundary(["bottom", "top"], slip=True)]
    conditions, nodes = of(mesh, entries)
    us = np.tile([0.5, 0.0], (nodes.count, 1))
    values, warnings = given_values(conditions, 0.0, us=us)
    assert (values[: len(values) // 2][conditions.fixed[: len(values) // 2] < nodes.count] == -0.5).all()
    assert warnings == ()
    with pytest.raises(SceneError, match="would take in 1 and give off 0 at t = 0"):
        given_values(conditions, 0.0, us=us * (nodes.at[:, :1] < 0.5) * 2)


@pytest.mark.parametrize(
    ("left", "right"),
    [(["4*y*(1 - y)", 0], [0, 0]), ([1, 0], ["1 + 0.1*t", 0]), ([0, 0], ["-t", 0])],
)
def test_an_enclosed_flow_that_does_not_balance_is_refused_with_the_time(left: Any, right: Any) -> None:
    mesh = box_mesh((2, 1), (8, 8))
    conditions, _ = of(
        mesh,
        [
            Boundary("left", velocity=left),
            Boundary("right", velocity=right),
            Boundary(["bottom", "top"], slip=True),
        ],
    )
    with pytest.raises(SceneError, match=r"would take in .* and give off .* at t = 3, .* give one of them a pressure"):
        given_values(conditions, 3.0)


def test_each_part_of_the_fluid_has_its_own_level_and_balance() -> None:
    """Two boxes in one mesh, one with an outlet, the other enclosed."""
    one, two = box_mesh((1, 1), (3, 3)), box_mesh((1, 1), (3, 3), origin=(5, 0))
    shifted = {f"{name} 2": facets + len(one.at) for name, facets in two.boundaries.items()}
    corners = np.concatenate([one.corners, two.corners + len(one.at)])
    mesh = mesh_of(np.concatenate([one.at, two.at]), corners, {**one.boundaries, **shifted})
    rest = [Boundary([name for name in mesh.boundaries if name != "right"], velocity=[0, 0])]
    conditions, nodes = of(mesh, [*rest, Boundary("right", pressure=1)])
    (level,) = conditions.levels
    assert level - 2 * nodes.count == pytest.approx(np.arange(16, 32))


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ([Boundary("left", velocity=[0, 0])], "nothing is said of boundary 'right', 'bottom', 'top': add"),
        ([Boundary("lefft", velocity=[0, 0])], "the mesh has no boundary 'lefft'; did you mean 'left'"),
        ([Boundary("botom", velocity=[0, 0])], "did you mean 'bottom'"),
        ([Boundary("left", slip=True), Boundary("left", pressure=0)], "1: boundary 'left' has a condition already"),
        ([Boundary("left", slip=True, pressure=0)], "0: give one of .*: pressure and slip are given"),
        ([Boundary("left")], "0: give one of velocity, flux, pressure, slip, periodic: none is given"),
        ([Boundary("left", periodic=True)], r'0: periodic is on two parts, such as on = \["left", "right"\], not 1'),
    ],
)
def test_conditions_that_do_not_fit_the_mesh_are_refused(entries: list[Boundary], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        of(box_mesh((1, 1), (3, 3)), entries)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (Boundary("left", velocity=[0, 0, 0]), r"0: velocity needs 2 components, a number .* for each of x, y, not"),
        (Boundary("left", velocity=["y*z", 0]), r"0: velocity, x: expression 'y\*z', position 3: unknown name 'z'"),
        (Boundary("left", velocity=[None, 0]), "0: velocity, x must be a number, or an expression of x, y and t"),
        (Boundary("left", pressure="open('f')"), "0: pressure: expression .* position"),
        (Boundary("left", velocity="1"), "0: velocity needs 2 components"),
    ],
)
def test_what_is_no_velocity_or_pressure_is_refused(entry: Boundary, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        of(box_mesh((1, 1), (3, 3)), [entry, Boundary(["right", "bottom", "top"], pressure=0)])


def test_a_velocity_that_is_not_finite_is_named_with_place_and_time() -> None:
    mesh = box_mesh((1, 1), (2, 2))
    entries = [Boundary("left", velocity=["1/(y - 0.5)", 0]), Boundary(["right", "bottom", "top"], pressure=0)]
    conditions, _ = of(mesh, entries)
    with pytest.raises(SceneError, match=r"\[\[boundary\]\] 0: velocity, x is inf at \(0, 0.5\), t = 2"):
        given_values(conditions, 2.0)


def test_porosity_lies_between_0_and_1_and_is_clamped_where_no_packing_is_as_dense() -> None:
    at = np.array([[0.0, 0], [0.5, 0], [1, 0], [2, 0]])

    def found(text: str) -> tuple[Array, str]:
        return porosity_at(field_of(text, 2, {}, "[bed] porosity"), at, 1.0)

    values, warning = found("0.4 + 0.6*smoothstep(x, 0, 1)")
    assert values == pytest.approx([0.4, 0.7, 1, 1])
    assert warning == ""
    values, warning = found("0.01 + 0.4*x")
    assert values == pytest.approx([0.05, 0.21, 0.41, 0.81])
    assert warning == "[bed] porosity is below 0.05 at 1 of 4 nodes, least 0.01 at (0, 0): taken for 0.05"
    for text, said in (("1 + x", r"is 1.5 at \(0.5, 0\), t = 1"), ("-0.1", r"is -0.1 at \(0, 0\)"), ("0", "is 0 at")):
        with pytest.raises(SceneError, match=r"\[bed\] porosity must lie between 0 and 1, and " + said):
            found(text)


def test_a_drag_needs_a_radius_and_a_radius_a_drag() -> None:
    assert bed_faults(Bed(0.5, drag="ergun", radius=1e-3)) == []
    assert "radius is missing" in bed_faults(Bed(0.5, drag="ergun"))[0]
    assert "of no use" in bed_faults(Bed(0.5, radius=1.0))[0]


@pytest.mark.parametrize(
    ("section", "said"),
    [
        (MeshSection(), "takes one of file, box, channel: none is given"),
        (MeshSection(box=[1, 1], file="a.msh"), "file and box are given"),
        (MeshSection(box=[1, 1]), "cells is missing: box needs it"),
        (MeshSection(box=[1, 1], cells=[4, 4], radius=1.0), "radius does not go with box: leave it out"),
        (MeshSection(box=[1, 1], cells=[4, 4], finer_at=["left"]), "finer_at needs a ratio"),
        (MeshSection(box=[1, 1], cells=[4, 4], ratio=3), "ratio needs the sides"),
        (MeshSection(channel=[2, 1, 1], cylinder=[1, 0.5], radius=0.1, around=32), "channel takes 2 numbers"),
        (MeshSection(file="none.msh"), "cannot read the mesh none.msh"),
    ],
)
def test_keys_of_a_mesh_that_do_not_go_together_are_refused(section: MeshSection, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        made_mesh(section)


def test_a_mesh_follows_from_its_section() -> None:
    box = made_mesh(MeshSection(box=[2, 1], cells=[4, 4], origin=[1, 1], finer_at=["left"], ratio=2.0))
    assert (box.at.min(axis=0) == [1, 1]).all()
    assert len(box.corners) == 32
    channel = made_mesh(MeshSection(channel=[2.2, 0.41], cylinder=[0.2, 0.2], radius=0.05, around=64))
    assert (channel.at == cylinder_mesh().at).all()
