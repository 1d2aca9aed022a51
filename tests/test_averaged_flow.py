"""Averaged flow: closures inside, where their arguments are extreme, forces of users, and refusals."""

from __future__ import annotations

import cmath
import math
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from sympy import Matrix, Symbol
from test_elements import assert_slopes_are_those_of_complex_steps, evaluated, mesh, names_of, values_of

from softdyn.derive.averaged_flow import Flow, Term, averaged_flow, outlet
from softdyn.derive.closure import Closure, Re, c, phi, r, rho
from softdyn.derive.dimensions import DIMENSIONLESS, FORCE, LENGTH, TIME
from softdyn.derive.element_equations import ElementNeeds
from softdyn.derive.element_kernel import element_ir
from softdyn.derive.kernel_form import KernelIR
from softdyn.derive.symbols import eta
from softdyn.elements import assembled, assembly, get_element_kernel, residual_of
from softdyn.errors import LawError, SceneError
from softdyn.laws import law_or_closure_of as find_closure
from softdyn.laws import stock_closures, term_of

DRAGS = [name for name in stock_closures() if find_closure(name).gives == "drag"]
VISCOSITIES = [name for name in stock_closures() if find_closure(name).gives == "viscosity"]
slow = pytest.mark.slow
#: Derivations of three dimensions, and of stabilised elements, take longer.
CASES = [
    pytest.param(name, d, order, marks=[] if (d, order) == (2, 2) else [slow])
    for name in DRAGS
    for d, order in ((2, 2), (2, 1), (3, 2), (3, 1))
]


@cache
def ir_of(drag: str | None, d: int, order: int, mixture: str | None = None, absent: tuple[str, ...] = ()) -> KernelIR:
    closures = {"drag": drag and find_closure(drag), "mixture": mixture and find_closure(mixture)}
    return element_ir(averaged_flow(d, order, **closures), ElementNeeds(absent=absent))


def at(ir: KernelIR, seed: int = 0, **given: float) -> dict[str, Any]:
    """Values of what the code reads; vectors are given by one number."""
    values = values_of(ir, seed)
    for name, value in given.items():
        values |= {f"own_{name}{k}": value for k in ("", 0, 1, 2) if f"own_{name}{k}" in values}
    return values


def drag_of(name: str, values: dict[str, Any], d: int) -> list[float]:
    """Drag on the grains per volume, from the closure's own expression, with 50 digits."""
    closure = find_closure(name)
    with mpmath.workdps(50):
        share, radius = mpmath.mpf(values["own_c"]), mpmath.mpf(values["own_r"])
        grains, density, viscosity = 1 - share, mpmath.mpf(values.get("own_rho", 0)), mpmath.mpf(values["own_eta"])
        slip = [mpmath.mpf(values[f"own_u{k}"]) / share - mpmath.mpf(values[f"own_us{k}"]) / grains for k in range(d)]
        size = mpmath.sqrt(sum(x**2 for x in slip))
        number = 2 * radius * density * size / viscosity
        known = {c: share, phi: grains, Re: number, r: radius, rho: density, eta: viscosity}
        friction = closure.expression.evalf(40, subs=known)
        volume = 4 * mpmath.pi * radius**3 / 3
        return [float(grains / volume * mpmath.mpf(friction) * x) for x in slip]


@pytest.mark.parametrize(("name", "d", "order"), CASES)
def test_a_drag_inside_is_the_closure_and_its_slopes_are_exact(name: str, d: int, order: int) -> None:
    """What is left of the flux if the grains are taken away is the drag: phi/V K slip."""
    ir = ir_of(name, d, order)
    for seed in range(3):
        values = at(ir, seed, us=0.05)
        assert_slopes_are_those_of_complex_steps(ir, values)
        without = evaluated(ir_of(None, d, order), values)
        if order == 2:
            found = [evaluated(ir, values)[f"flux{i}_0"] - without[f"flux{i}_0"] for i in range(d)]
            np.testing.assert_allclose(np.real(found), drag_of(name, values, d), rtol=1e-11)


@pytest.mark.parametrize(("name", "d", "order"), CASES)
def test_a_drag_is_finite_where_its_arguments_are_extreme(name: str, d: int, order: int) -> None:
    """No slip at all, without and with grains; a Reynolds number of 1e-12, and of 1e8; a bed that ends."""
    ir = ir_of(name, d, order)
    rest, free, nearly, bed = {"u": 0.0, "us": 0.0}, {"c": 1.0, "us": 0.0}, {"c": 1 - 1e-15}, {"c": 0.45}
    for given in (
        {**rest, **bed},
        {**rest, **free},
        free,
        {**nearly, "us": 0.0},
        {**bed, "rho": 1e-12},
        {**bed, "rho": 1e8},
    ):
        values = at(ir, 1, **given)
        found = evaluated(ir, values)
        assert all(cmath.isfinite(found[one]) for one in ir.functions["point"].gives), given
        assert_slopes_are_those_of_complex_steps(ir, values)
    # without grains there is no drag
    plain, values = evaluated(ir_of(None, d, order), at(ir, 1, **free)), at(ir, 1, **free)
    assert evaluated(ir, values)["flux0_0"] == pytest.approx(plain["flux0_0"], rel=1e-14)


@pytest.mark.parametrize("name", [pytest.param(x, marks=[] if x == "gidaspow" else [slow]) for x in DRAGS])
def test_without_a_density_drag_is_the_limit_of_a_small_reynolds_number(name: str) -> None:
    """Stokes flow: the kernel has neither rho nor Re, and gives what a density of 1e-30 gives."""
    creeping, whole = ir_of(name, 2, 2, absent=("rho",)), ir_of(name, 2, 2)
    assert "own_rho" not in names_of(creeping)
    assert "own_Re" not in names_of(creeping)
    values = at(whole, 2, us=0.05, rho=1e-30)
    assert_slopes_are_those_of_complex_steps(creeping, values)
    small, found = evaluated(whole, values), evaluated(creeping, values)
    for i in range(2):
        # a closure may tend to its limit as slowly as the root of Re
        assert found[f"flux{i}_0"] == pytest.approx(small[f"flux{i}_0"], rel=1e-13)


@pytest.mark.parametrize("name", DRAGS)
def test_drag_does_not_depend_on_units(name: str) -> None:
    """With lengths, masses and times in other units, the drag per volume is the same, in these units, slow or not."""
    ir = ir_of(name, 2, 2)
    length, mass, time = 1e3, 1e-6, 1e2
    units = {"u": length / time, "us": length / time, "r": length, "rho": mass / length**3, "eta": mass / length / time}
    for slow_down in (1.0, 1e-9):
        one = at(ir, 3, us=0.0, force=0.0, p=0.0, past=0.0, rate=0.0)
        one |= {f"own_u{k}": one[f"own_u{k}"] * slow_down for k in range(2)}
        other = dict(one)
        for key, unit in units.items():
            other |= {f"own_{key}{k}": one[f"own_{key}{k}"] * unit for k in ("", 0, 1) if f"own_{key}{k}" in one}
        for key in one:
            other |= {key: one[key] / (time if "_u" in key else length)} if "_d" in key else {}
        found = [np.real(evaluated(ir, values)["flux0_0"]) for values in (one, other)]
        assert found[1] == pytest.approx(found[0] * mass / length**2 / time**2, rel=1e-12)


@pytest.mark.parametrize("name", VISCOSITIES)
@pytest.mark.parametrize("order", [2, pytest.param(1, marks=slow)])
def test_viscosities_of_the_mixture_are_inside(name: str, order: int) -> None:
    """The shear stress is 2 eta* D(u + us), with the closure's own expression."""
    closure, ir = find_closure(name), ir_of(None, 2, order, name)
    values = at(ir, 4)
    assert_slopes_are_those_of_complex_steps(ir, values)
    own = {
        symbol: values[f"own_{symbol.name}"] for symbol in (*closure.parameters, eta) if f"own_{symbol.name}" in values
    }
    viscosity = float(closure.expression.evalf(30, subs={phi: 1 - values["own_c"], c: values["own_c"], **own}))
    shear = sum(values[f"own_{one}{i}_d{j}"] for one in ("u", "us") for i, j in ((0, 1), (1, 0)))
    u = [values["own_u0"], values["own_u1"]]
    if order == 2:
        expected = viscosity * shear - values["own_rho"] * u[0] * u[1] / values["own_c"]
        assert evaluated(ir, values)["flux0_2"] == pytest.approx(expected, rel=1e-12)


# ---------------------------------------------------------------- forces of users

permeability, expansion = Symbol("permeability", positive=True), Symbol("expansion", positive=True)
brinkman = Term(
    name="brinkman",
    force=lambda flow: -flow.eta / permeability * flow.u,
    parameters={permeability: LENGTH**2},
)
boussinesq = Term(
    name="boussinesq",
    force=lambda flow: -flow.rho * expansion * flow.own["temperature"] * flow.own["gravity"],
    parameters={expansion: DIMENSIONLESS},
    coefficients={"temperature": DIMENSIONLESS},
    vectors={"gravity": LENGTH / TIME**2},
)
inertial = Symbol("inertial", positive=True)
forchheimer = Term("forchheimer", lambda flow: -flow.rho * inertial * flow.speed * flow.u, {inertial: LENGTH**-1})


@pytest.mark.parametrize("order", [2, pytest.param(1, marks=slow)])
def test_forces_of_users_are_terms_like_others(order: int) -> None:
    """Each is in the residual with its exact slopes, at rest, too, and absent where what it takes is absent."""
    form = averaged_flow(2, order, more=(brinkman, boussinesq, forchheimer))
    assert [one.name for one in form.coefficients] == ["c", "us", "force", "past", "temperature", "gravity"]
    assert {symbol.name for symbol in form.parameters} == {
        "rho",
        "eta",
        "rate",
        "permeability",
        "expansion",
        "inertial",
    }
    ir = element_ir(form, ElementNeeds())
    for given in ({}, {"u": 0.0}):
        values = at(ir, 5, **given)
        assert_slopes_are_those_of_complex_steps(ir, values)
        plain = evaluated(ir_of(None, 2, order), values)
        if order == 2:
            u = np.array([values["own_u0"], values["own_u1"]])
            pulled = values["own_temperature"] * np.array([values["own_gravity0"], values["own_gravity1"]])
            expected = values["own_eta"] / values["own_permeability"] * u + values["own_rho"] * (
                values["own_expansion"] * pulled + values["own_inertial"] * np.linalg.norm(u) * u
            )
            found = [evaluated(ir, values)[f"flux{i}_0"] - plain[f"flux{i}_0"] for i in range(2)]
            np.testing.assert_allclose(np.real(found), expected, rtol=1e-12)
    spared = element_ir(form, ElementNeeds(absent=("temperature", "inertial")))
    assert not [
        name for name in ("own_gravity", "own_temperature", "own_inertial", "own_speed") if name in names_of(spared)
    ]


@pytest.mark.slow
def test_a_brinkman_force_alone_is_darcys_law() -> None:
    """Uniform flow through a porous solid: eta u/permeability = -grad p, to rounding."""
    kernel = get_element_kernel(
        averaged_flow(2, 1, more=(brinkman,)), "c", unit=("c",), absent=("us", "force", "past", "rate", "rho")
    )
    made, corners = mesh(2)
    a = assembly(kernel, made.p.T, corners, {1: corners})
    numbers = {"eta": 1e-3, "permeability": 1e-9}
    pressure = -1e-3 / 1e-9 * np.array([0.3, -0.2]) @ made.p
    unknown = np.concatenate([np.full(a.counts[1], 0.3), np.full(a.counts[1], -0.2), pressure])
    p = np.array([numbers[name] for name in kernel.numbers])
    residual, _ = assembled(kernel, a, unknown, np.empty(0), p)
    inner = np.tile(np.isin(np.arange(a.counts[1]), made.interior_nodes()), 3)
    moving = unknown * np.repeat([1, 1, 0], a.counts[1])
    other = residual_of(kernel, a, moving, np.empty(0), p)
    assert np.abs(residual[inner]).max() < 1e-12 * np.abs(other[inner]).max()


def term(**changed: Any) -> Term:
    plain = {"name": "plain", "force": brinkman.force, "parameters": {permeability: LENGTH**2}}
    return Term(**{**plain, **changed})


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"parameters": {}}, "in 2 dimensions: component 0 has permeability, which is declared nowhere"),
        ({"parameters": {permeability: LENGTH}}, "component 0 is a .*, and must be a force per volume"),
        ({"force": lambda flow: flow.rho}, "force is rho, and must be a vector: a matrix of 2 rows and one column"),
        ({"force": lambda flow: flow.own["temperature"] * flow.u}, "force raises KeyError: 'temperature'"),
        ({"force": 3}, "force = 3 is no function of the flow"),
        ({"force": lambda flow: flow.u + flow.us * flow.p}, "component 0: .* combines"),
        ({"force": lambda _: Matrix([0, 0])}, "in 3 dimensions: force is .*, and must be a vector: a matrix of 3 rows"),
        ({"name": "No Name"}, "name = 'No Name' must be a lower-case identifier"),
        ({"coefficients": {"us": LENGTH}}, "'us' is a name of the flow's own"),
        ({"coefficients": {"a_b": LENGTH}}, "the name 'a_b' is not of letters and digits"),
        ({"vectors": {"permeability": LENGTH}}, "two things are named permeability"),
        ({"coefficients": {"warm": "kelvin"}}, "the dimension of warm is 'kelvin', which is none"),
    ],
)
def test_a_faulty_force_is_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(LawError, match=f"(?s)term .* fault.*{message}"):
        term(**changed)


def test_wrong_closures_and_clashes_are_refused() -> None:
    with pytest.raises(LawError, match="closure stokes gives the drag, and is taken for the viscosity"):
        averaged_flow(2, 2, mixture=find_closure("stokes"))
    thickening = Closure("thickening", "viscosity", eta * (1 + phi * Re))
    with pytest.raises(LawError, match="closure thickening: a viscosity of the mixture that depends on Re"):
        averaged_flow(2, 2, mixture=thickening)
    other = Term("other", lambda flow: -permeability * flow.u, {permeability: FORCE * TIME / LENGTH**4})
    with pytest.raises(LawError, match="permeability of other is another one than that of the flow, or of another"):
        averaged_flow(2, 2, more=(brinkman, other))
    with pytest.raises(LawError, match="two terms are named boussinesq") as error:
        averaged_flow(2, 2, more=(boussinesq, boussinesq))
    assert "two terms have gravity" in str(error.value)


def test_all_terms_of_a_flow_have_the_dimension_of_power() -> None:
    """Declared with their units, so that every term is checked; a wrong one is told."""
    assert outlet(3, 2, mixture=find_closure("einstein")).units["pressure"] == FORCE / LENGTH**2
    flow = averaged_flow(3, 1, drag=find_closure("ergun"), mixture=find_closure("maron_pierce"))
    assert set(flow.units) >= {symbol.name for symbol in flow.parameters}
    with pytest.raises(LawError, match="component 0 is a"):
        Term("heavy", lambda flow: flow.rho * flow.u)


def test_a_force_is_read_from_a_file_of_ten_lines(tmp_path: Path) -> None:
    """As a law is; what is wrong with the file is told."""
    file = tmp_path / "porous.py"
    file.write_text(
        """from sympy import Symbol

from softdyn.derive.averaged_flow import Term
from softdyn.derive.dimensions import LENGTH

permeability = Symbol("permeability", positive=True)
term = Term(
    name="porous",
    force=lambda flow: -flow.eta / permeability * flow.u,
    parameters={permeability: LENGTH**2},
)
""",
        encoding="utf-8",
    )
    found = term_of(f"{file}")
    assert (found.name, [symbol.name for symbol in found.parameters]) == ("porous", ["permeability"])
    with pytest.raises(SceneError, match=r"porous.py defines no term 'term2'; did you mean 'term'"):
        term_of(f"{file}:term2")
    with pytest.raises(SceneError, match=r"term 'brinkman': a force on the fluid is declared in a file"):
        term_of("brinkman")
    file.write_text(file.read_text(encoding="utf-8").replace("LENGTH**2", "LENGTH"), encoding="utf-8")
    with pytest.raises(LawError, match="term 'porous' has 1 fault:"):
        term_of(f"{file}")


def test_what_a_force_may_depend_on_is_told() -> None:
    """In two and in three dimensions."""
    seen: list[Flow] = []

    def record(flow: Flow) -> Any:
        seen.append(flow)
        return flow.rho * flow.own["gravity"] + 0 * flow.gradient * flow.u * flow.rho

    Term("seen", record, vectors={"gravity": LENGTH / TIME**2})
    assert [flow.dimension for flow in seen] == [2, 3]
    assert [flow.u.shape for flow in seen] == [(2, 1), (3, 1)]
    assert math.prod(seen[1].gradient.shape) == 9
