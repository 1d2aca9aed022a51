"""A flow made ready to run: its mesh, nodes, kernels, conditions, and its equations at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from softdyn.elements import (
    Assembly,
    ElementKernel,
    assembled,
    assembly,
    facet_assembly,
    get_element_kernel,
    residual_of,
)
from softdyn.errors import SceneError
from softdyn.fluid.bed import bed_faults, porosity_at
from softdyn.fluid.boundary_keys import periodic_pairs
from softdyn.fluid.conditions import Conditions, Outlet, conditions_of, given_values
from softdyn.fluid.fields import AXES, FieldFunction, field_of, fields_of, values_at, vectors_at
from softdyn.fluid.fluid_scene import ORDERS, FluidScene, check_fluid
from softdyn.fluid.mesh import Mesh, owners, place
from softdyn.fluid.mesh_section import made_mesh
from softdyn.fluid.numbering import Nodes, nodes_of
from softdyn.fluid.unknowns import Unknowns, unknowns_of
from softdyn.laws import law_or_closure_of, require_known_closure, term_of
from softdyn.scene.kinds import is_number, shown
from softdyn.scene.numbers import range_fault
from softdyn.words import listed, suggestion

if TYPE_CHECKING:
    from softdyn.derive.averaged_flow import Term
    from softdyn.derive.closure import Closure

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class OpenFacets:
    """Facets at which a pressure is given.

    Attributes
    ----------
    outlet : Outlet
    assembly : Assembly
    entries : array of int
        Entries of the whole matrix that those of the facets' are added to.
    """

    outlet: Outlet
    assembly: Assembly
    entries: Ints


@dataclass
class FluidSystem:
    """A flow made ready to run.

    Attributes
    ----------
    scene : FluidScene
    mesh : Mesh
    velocity, pressure : Nodes
    conditions : Conditions
    held : array of int
        An unknown pressure of each enclosed part, which is 0.
    unknowns : Unknowns
    kernel, outlet_kernel : ElementKernel
    assembly : Assembly
    open : tuple of OpenFacets
    numbers : mapping from str to float
        Of the kernel.
    porosity : FieldFunction or None
    grains, force : tuple of FieldFunction or None
        Velocity of the grains; force per volume of fluid.
    weight : array, shape (d,)
        Of the fluid, per volume.
    own : mapping from str to tuple of FieldFunction
        Coefficients of terms.
    viscosity : closure or None
        Of the mixture.
    moving : dict or None
        Of grains that move by themselves, at the nodes of the velocity: c, us, growth, friction, tried, pull, lent; see
        :mod:`softdyn.derive.averaged_flow`.
    warnings : dict
        What is to be told, each once, and the time at which it came.
    """

    scene: FluidScene
    mesh: Mesh
    velocity: Nodes
    pressure: Nodes
    conditions: Conditions
    held: Ints
    unknowns: Unknowns
    kernel: ElementKernel
    outlet_kernel: ElementKernel | None
    assembly: Assembly
    open: tuple[OpenFacets, ...]
    numbers: Mapping[str, float]
    porosity: FieldFunction | None
    grains: tuple[FieldFunction, ...] | None
    force: tuple[FieldFunction, ...] | None
    weight: Array
    own: Mapping[str, tuple[FieldFunction, ...]]
    mixture: Closure | None
    moving: dict[str, Array] | None = None
    warnings: dict[str, float] = field(default_factory=dict)
    _known: tuple[float, dict[str, Array]] | None = None

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return self.mesh.dimension

    @property
    def velocities(self) -> int:
        """How many unknowns are velocities: these come first."""
        return self.dimension * self.velocity.count

    @property
    def of_time(self) -> bool:
        """Whether anything that is given may change in time."""
        fields = [
            self.porosity,
            *(self.grains or ()),
            *(self.force or ()),
            *(f for own in self.own.values() for f in own),
        ]
        return self.conditions.of_time or any(one is not None and one.of_time for one in fields)

    def coefficients(self, t: float) -> dict[str, Array]:
        """What is given at the nodes of the velocity at a time, each of shape (nodes,) or (nodes, d)."""
        if self._known is not None and (self._known[0] == t or not self.of_time):
            return {**self._known[1], **(self.moving or {})}
        at, found = self.velocity.at, dict[str, Array]()
        if self.porosity is not None:
            found["c"], warning = porosity_at(self.porosity, at, t)
            if warning:
                self.warnings.setdefault(warning, t)
            if self.grains is not None:
                found["us"] = (1 - found["c"])[:, None] * vectors_at(self.grains, at, t)
        force = np.tile(self.weight, (len(at), 1))
        found["force"] = force if self.force is None else force + vectors_at(self.force, at, t)
        for name, fields in self.own.items():
            found[name] = vectors_at(fields, at, t) if len(fields) > 1 else values_at(fields[0], at, t)
        self._known = (t, found)
        return {**found, **(self.moving or {})}

    def given(self, t: float) -> Array:
        """Values that boundaries give at a time."""
        known = self.coefficients(t)
        # what grains that move by themselves let in, their growth tells
        us, carried = (known.get("us"), None) if self.moving is None else (None, known.get("us"))
        values, warnings = given_values(self.conditions, t, known.get("c"), us, carried)
        for warning in warnings:
            self.warnings.setdefault(warning.partition(" at t = ")[0], t)
        fixed = len(self.conditions.fixed)
        return np.concatenate([values[:fixed], np.zeros(len(self.held)), values[fixed:]])

    def equations(self, t: float, rate: float = 0.0, past: Array | None = None, thicker: float = 1.0) -> FlowEquations:
        """Equations at a time, where the derivative of the velocities is rate u + past.

        Parameters
        ----------
        t, rate : float
        past : array, shape (unknowns,), optional
        thicker : float
            Viscosity over that of the scene.
        """
        return FlowEquations(self, t, rate, past, thicker)

    def where(self, row: int) -> str:
        """Words for an unknown: which it is, and its place."""
        if row >= self.velocities:
            return f"the balance of volume at {place(self.pressure.at[row - self.velocities])}"
        axis, node = divmod(row, self.velocity.count)
        return f"the balance of momentum along {AXES[axis]} at {place(self.velocity.at[node])}"


class FlowEquations:
    """Equations of a flow at a time; see :class:`softdyn.fluid.newton.Equations`."""

    def __init__(self, system: FluidSystem, t: float, rate: float, past: Array | None, thicker: float) -> None:
        self.system, self.t = system, t
        known = dict(system.coefficients(t))
        if past is not None:
            known["past"] = past[: system.velocities].reshape(system.dimension, -1).T
        self.numbers = {**system.numbers, "rate": rate, "eta": thicker * system.numbers["eta"]}
        self.known = known
        self.q, self.p = _arguments(system.kernel, known, self.numbers)
        self.open_q = [
            _arguments(system.outlet_kernel, {**known, "pressure": _outside(system, part.outlet, t)}, self.numbers)
            for part in system.open
            if system.outlet_kernel is not None
        ]

    def residual(self, x: Array) -> Array:
        """The residual of all unknowns."""
        total = residual_of(self.system.kernel, self.system.assembly, x, self.q, self.p)
        for part in self.of_outlets(x):
            total += part
        return total

    def of_outlets(self, x: Array) -> list[Array]:
        """Part of the residual that each outlet makes."""
        kernel = self.system.outlet_kernel
        if kernel is None:
            return []
        parts = zip(self.system.open, self.open_q, strict=True)
        return [residual_of(kernel, part.assembly, x, q, p) for part, (q, p) in parts]

    def linearised(self, x: Array) -> tuple[Array, csr_matrix]:
        """The residual, and its derivative by the unknowns."""
        residual, matrix = assembled(self.system.kernel, self.system.assembly, x, self.q, self.p)
        kernel = self.system.outlet_kernel
        for part, (q, p) in zip(self.system.open, self.open_q, strict=True):
            assert kernel is not None
            more, small = assembled(kernel, part.assembly, x, q, p)
            residual += more
            matrix.data[part.entries] += small.data
        return residual, matrix

    def without(self, *names: str) -> FlowEquations:
        """The same with coefficients or numbers that are 0, in what elements make of it."""
        other = FlowEquations.__new__(FlowEquations)
        other.system, other.t, other.open_q = self.system, self.t, self.open_q
        other.known = {name: np.zeros_like(array) if name in names else array for name, array in self.known.items()}
        other.numbers = {name: 0.0 if name in names else number for name, number in self.numbers.items()}
        other.q, other.p = _arguments(self.system.kernel, other.known, other.numbers)
        return other

    def of_elements(self, x: Array) -> Array:
        """Part of the residual that elements make."""
        return residual_of(self.system.kernel, self.system.assembly, x, self.q, self.p)


def _arguments(kernel: ElementKernel, known: Mapping[str, Array], numbers: Mapping[str, float]) -> tuple[Array, Array]:
    """The arrays q and p of a kernel."""
    q = [known[name].T.reshape(-1) for name, _, _ in kernel.varying]
    return np.concatenate(q) if q else np.empty(0), np.array([numbers[_bare(name)] for name in kernel.numbers])


def _bare(name: str) -> str:
    return name.removeprefix("own_")


def _outside(system: FluidSystem, outlet: Outlet, t: float) -> Array:
    """Pressure outside, at the nodes of the velocity: 0 away from the outlet."""
    found, nodes = np.zeros(system.velocity.count), np.unique(outlet.nodes)
    found[nodes] = values_at(outlet.pressure, system.velocity.at[nodes], t)
    return found


def without_level(system: FluidSystem, x: Array) -> Array:
    """The same unknowns; where the pressure has no level, its mean over the nodes is 0.

    Parameters
    ----------
    system : FluidSystem
    x : array, shape (unknowns,)
        Velocities, then pressures.
    """
    found = x.copy()
    for level in system.conditions.levels:
        found[level] -= found[level].mean()
    return found


def prepared(scene: FluidScene, moving: bool = False) -> FluidSystem:
    """Check a scene, make its mesh, and get its kernels.

    Parameters
    ----------
    scene : FluidScene
    moving : bool
        Whether there are grains that move by themselves, of which ``FluidSystem.moving`` is to be told.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    check_fluid(scene)
    mesh, d = made_mesh(scene.mesh), 0
    d = mesh.dimension
    order = ORDERS[scene.elements]
    pairs = periodic_pairs(scene.boundary)
    velocity, pressure = nodes_of(mesh, order, pairs), nodes_of(mesh, 1, pairs)
    conditions = conditions_of(scene.boundary, mesh, velocity, pressure, scene.constants)
    drag, mixture, terms = _closures(scene)
    faults = [] if scene.bed is None else bed_faults(scene.bed)
    if mixture is not None and scene.bed is None and not moving:
        faults.append("[fluid] mixture is of no use without a [bed]: there are no grains")
    gravity = scene.gravity
    if gravity is not None and (len(gravity) != d or not all(map(is_number, gravity))):
        faults.append(f"[gravity] acceleration needs {d} components, finite numbers, not {shown(gravity)}")
    if faults:
        raise SceneError(listed(faults))
    weight = np.zeros(d) if gravity is None else scene.density * np.array(gravity, dtype=float)
    constants, bed = scene.constants, scene.bed
    force = None if scene.force is None else fields_of(scene.force, d, constants, "[fluid] force")
    porosity = None if bed is None else field_of(bed.porosity, d, constants, "[bed] porosity")
    grains = None
    if bed is not None and bed.velocity is not None:
        grains = fields_of(bed.velocity, d, constants, "[bed] velocity")
    numbers, own = _values(scene, d, drag, mixture, terms)
    numbers |= {"rho": float(scene.density), "eta": float(scene.viscosity), "rate": 0.0}
    if bed is not None and bed.radius is not None:
        numbers["r"] = float(bed.radius)
    absent = {"us": grains is None and not moving, "force": force is None and not weight.any()}
    absent |= {"rho": not scene.density, "rate": scene.steady, "past": scene.steady}
    kernel, outlet_kernel = _kernels(scene, d, order, drag, mixture, terms, absent, bool(conditions.outlets), moving)
    nodes = {order: velocity.of, 1: pressure.of}
    whole = assembly(kernel, mesh.at, mesh.corners, nodes)
    pattern = csr_matrix((np.ones(len(whole.columns)), whole.columns, whole.starts), shape=(whole.size, whole.size))
    opened = [_open(outlet_kernel, whole, mesh, nodes, pattern, one) for one in conditions.outlets if outlet_kernel]
    held = np.array([level[0] for level in conditions.levels], dtype=np.int64)
    kinds = np.repeat([0, 1], [d * velocity.count, pressure.count])
    places = np.concatenate([velocity.at] * d + [pressure.at])
    fixed = np.concatenate([conditions.fixed, held])
    unknowns = unknowns_of(pattern, kinds, places, fixed, conditions.slipping, conditions.normals)
    if not unknowns.basis.shape[1]:
        raise SceneError("the mesh has no free unknown: all velocities are given, and all pressures")
    return FluidSystem(
        scene, mesh, velocity, pressure, conditions, held, unknowns, kernel, outlet_kernel, whole, tuple(opened),
        numbers, porosity, grains, force, weight, own, mixture, {} if moving else None,
    )  # fmt: skip


def _kernels(
    scene: FluidScene,
    d: int,
    order: int,
    drag: Closure | None,
    mixture: Closure | None,
    terms: tuple[Term, ...],
    absent: Mapping[str, bool],
    opens: bool,
    moving: bool,
) -> tuple[ElementKernel, ElementKernel | None]:
    """Kernels of the elements and, if there are outlets, of their facets."""
    from softdyn.derive.averaged_flow import averaged_flow, outlet

    form = averaged_flow(d, order, drag=drag, mixture=mixture, more=terms, moving=moving)
    known = {one.name for one in form.coefficients} | {symbol.name for symbol in form.parameters}
    unit = () if scene.bed is not None or moving else ("c",)
    gone = tuple(name for name, is_absent in absent.items() if is_absent and name in known)
    kernel = get_element_kernel(form, scene.target, absent=gone, unit=unit)
    if not opens:
        return kernel, None
    facets = outlet(d, order, mixture=mixture)
    known = {one.name for one in facets.coefficients} | {symbol.name for symbol in facets.parameters}
    gone = tuple(name for name, is_absent in absent.items() if is_absent and name in known)
    return kernel, get_element_kernel(facets, scene.target, absent=gone, unit=unit)


def _open(
    kernel: ElementKernel, whole: Assembly, mesh: Mesh, nodes: Mapping[int, Ints], pattern: csr_matrix, outlet: Outlet
) -> OpenFacets:
    elements = owners(mesh, outlet.points)
    corners = mesh.corners[elements]
    sides = np.argmin((corners[:, :, None] == outlet.points[:, None, :]).any(axis=2), axis=1)
    part = facet_assembly(kernel, whole, elements, sides, nodes)
    numbered = csr_matrix((np.arange(1.0, pattern.nnz + 1), pattern.indices, pattern.indptr), shape=pattern.shape)
    rows = np.repeat(np.arange(part.size), np.diff(part.starts))
    entries = np.asarray(numbered[rows, part.columns]).ravel().astype(np.int64) - 1
    assert (entries >= 0).all()
    return OpenFacets(outlet, part, entries)


def _closures(scene: FluidScene) -> tuple[Closure | None, Closure | None, tuple[Term, ...]]:
    """Drag, viscosity of the mixture, and terms of a scene."""
    asked = {"[bed] drag": None if scene.bed is None else scene.bed.drag, "[fluid] mixture": scene.mixture}
    found = [None if given is None else closure_of(given, key) for key, given in asked.items()]
    return found[0], found[1], tuple(_term(one) for one in scene.terms)


def closure_faults(closure: Closure, given: Mapping[str, Any]) -> list[str]:
    """What is wrong with the values of a closure's parameters, each by itself: no number, or outside of its range.

    Parameters
    ----------
    closure : Closure
    given : mapping from str to value
        All that are needed.
    """
    from softdyn.derive.closure import ranges_of

    ranges, faults = ranges_of(closure), list[str | None]()
    for symbol in closure.parameters:
        name, value = symbol.name, given[symbol.name]
        one = ranges.get(symbol)
        if not is_number(value):
            faults.append(f"[parameters] {name} must be a finite number, not {shown(value)}")
        elif symbol.is_positive and not value > 0:
            faults.append(f"[parameters] {name} of the closure {closure.name} must be positive, not {value:g}")
        elif one is not None:
            allowed = (float(one.start), float(one.end), bool(one.left_open), bool(one.right_open))
            faults.append(range_fault(name, float(value), allowed))
    return [fault for fault in faults if fault is not None]


def closure_of(given: Any, key: str, gives: str = "") -> Closure:
    """The closure that a key of a scene names.

    Parameters
    ----------
    given : str or Closure
    key : str
        For messages: "[closures] drag".
    gives : str
        What it must give, as "drag"; "" where that is looked at elsewhere.

    Raises
    ------
    SceneError
    """
    from softdyn.derive.closure import Closure

    closure: Closure | object = given
    if not isinstance(given, Closure):
        if not isinstance(given, str):
            raise SceneError(f"{key} must be a closure's name, a path or a Closure, not {shown(given)}")
        try:
            require_known_closure(given)
            closure = law_or_closure_of(given)
        except SceneError as error:
            raise SceneError(f"{key}: {error}") from None
    if not isinstance(closure, Closure):
        raise SceneError(f"{key}: {given!r} is a contact law, and a closure is asked for: see softdyn closures")
    if gives and closure.gives != gives:
        raise SceneError(f"{key}: the closure {closure.name} gives the {closure.gives}, and the {gives} is asked for")
    return closure


def _term(given: Any) -> Term:
    from softdyn.derive.averaged_flow import Term

    if isinstance(given, Term):
        return given
    if not isinstance(given, str):
        raise SceneError(f'[fluid] terms: {shown(given)} is none: "path/terms.py:name" is, and in Python a Term')
    return term_of(given)


def _values(
    scene: FluidScene, d: int, drag: Closure | None, mixture: Closure | None, terms: tuple[Term, ...]
) -> tuple[dict[str, float], dict[str, tuple[FieldFunction, ...]]]:
    """Values of the parameters of closures and terms, and the coefficients of terms.

    Raises
    ------
    SceneError
        If one is missing, or of no use.
    """
    declared = [one.parameters for one in (drag, mixture, *terms) if one is not None]
    numbers = [symbol.name for parameters in declared for symbol in parameters]
    scalars = [name for term in terms for name in term.coefficients]
    vectors = [name for term in terms for name in term.vectors]
    needed, given = [*numbers, *scalars, *vectors], scene.parameters
    faults = [f"[parameters] {name} is missing" for name in needed if name not in given]
    faults += [f"[parameters] {name} is of no use{suggestion(name, needed)}" for name in given if name not in needed]
    faults += [
        f"[parameters] {name} must be a finite number, not {shown(given[name])}"
        for name in numbers
        if name in given and not is_number(given[name])
    ]
    faults = faults or [fault for one in (drag, mixture) if one is not None for fault in closure_faults(one, given)]
    if faults:
        raise SceneError(listed(faults))
    own: dict[str, tuple[FieldFunction, ...]] = {
        name: (field_of(given[name], d, scene.constants, f"[parameters] {name}"),) for name in scalars
    }
    own |= {name: fields_of(given[name], d, scene.constants, f"[parameters] {name}") for name in vectors}
    return {name: float(given[name]) for name in numbers}, own
