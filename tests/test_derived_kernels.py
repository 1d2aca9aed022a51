"""What runs is what was derived: a kernel follows each derived quantity, or its form is seen to be another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
from sympy import Matrix

from softdyn.derive import contact_equations, controls, dynamics, pair_equations
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.dynamics import GenericDynamics, generic_dynamics
from softdyn.derive.pair_equations import Needs
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.laws import law_of

NUMBERS = ("X", "by_gap", "stiffness", "friction", "dh_dt", "ddelta_dt", "dX_dt")
ENTRIES = [("h, delta", i, j) for i in (0, 1) for j in (0, 1)]
ALONG = ("ln h, delta from the force balance", 0, 0)
#: What each kernel is made of: of a Jacobian the entries.
KERNELS: dict[str, tuple[Callable[[], object], list[str | tuple[str, int, int]]]] = {
    "force": (
        lambda: kernel_ir(law_of("rognon_gay"), Needs("table", outputs=None)),
        [*NUMBERS, "lambda1", "lambda2", ALONG, ("h, delta", 0, 1)],
    ),
    "velocity": (
        lambda: kernel_ir(law_of("rognon_gay"), Needs("table", control="velocity", outputs=None)),
        [*NUMBERS, ("h, delta", 0, 0), ("h, delta", 0, 1)],
    ),
    "spring": (
        lambda: kernel_ir(law_of("rognon_gay"), Needs("table", control="spring", outputs=None)),
        [*NUMBERS, ("h, delta", 0, 0), ("h, delta", 0, 1)],
    ),
    "contacts": (
        lambda: contact_ir(law_of("rognon_gay"), ContactNeeds()),
        ["X", "by_gap", "stiffness", "dh_dt", ("h, delta", 0, 0), ("h, delta", 0, 1)],
    ),
}
CACHED = (
    controls.rates, controls.by_force, controls.by_centres, controls.by_gap, controls.without_film,
    contact_equations.stage_equation, pair_equations.pair_equations, pair_equations.with_slopes,
)  # fmt: skip


def falsified(generic: GenericDynamics, what: str | tuple[str, int, int]) -> GenericDynamics:
    """The dynamics with one quantity, or one entry of a Jacobian, twice as large."""
    if isinstance(what, str):
        return replace(generic, **{what: 2 * getattr(generic, what)})
    name, i, j = what
    wrong = Matrix(generic.jacobians[name])
    wrong[i, j] *= 2
    return replace(generic, jacobians={**generic.jacobians, name: wrong})


def forget() -> None:
    for function in CACHED:
        function.cache_clear()


@pytest.fixture
def remembered_anew() -> Iterator[None]:
    forget()
    yield
    forget()


@pytest.mark.slow
@pytest.mark.usefixtures("remembered_anew")
@pytest.mark.parametrize("kind", KERNELS)
def test_a_wrong_derivation_gives_another_kernel_or_is_refused(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, made_of = KERNELS[kind]
    right = {general: generic_dynamics(general) for general in (False, True)}
    expected = make()
    for what in made_of:
        forget()
        wrong = {general: falsified(generic, what) for general, generic in right.items()}
        for module in (dynamics, controls, pair_equations):
            monkeypatch.setattr(module, "generic_dynamics", lambda general=False, wrong=wrong: wrong[general])
        try:
            found = make()
        except AssertionError:
            continue
        assert found != expected, f"nothing of {kind} follows {what}"


@pytest.mark.usefixtures("remembered_anew")
@pytest.mark.parametrize("law", ["rigid", "dry"])
def test_a_wrong_rate_of_rigid_or_dry_particles_is_refused(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    form, made_of = {
        "rigid": (controls.by_gap, ("X", "friction", "dh_dt", ("h, delta", 0, 0), ("ln h, delta", 0, 0))),
        "dry": (controls.without_film, ("X", "ddelta_dt")),
    }[law]
    right = generic_dynamics(general=True)
    form()
    for what in made_of:
        forget()
        wrong = falsified(right, what)
        monkeypatch.setattr(controls, "generic_dynamics", lambda general=False, wrong=wrong: wrong)
        with pytest.raises(AssertionError, match="is not what is derived"):
            form()
