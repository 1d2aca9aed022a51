"""Certificates of limits: they hold, and no falsified one does."""

from __future__ import annotations

import ast
import copy
import json
import math
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Piecewise, Symbol, exp, log, pi

from softdyn import certificate_checker
from softdyn.certificate_checker import Refused, check_certificate
from softdyn.cli import main
from softdyn.derive import LENGTH, ContactLaw, E, F, Limit, R, delta, eta, h
from softdyn.derive.certificate import certificate, certificates
from softdyn.derive.dominant_balance import definitions
from softdyn.derive.witness import side_of
from softdyn.laws import law_of

#: Claims of the stock laws that have a certificate, at least; what the others lack is told by ``softdyn check``.
COVERED = {"rognon_gay": 12, "lubrication_rigid": 6, "hertz_dry": 4, "cone": 20, "droplet": 30, "equal_spheres": 41}
COVERED |= {"dlvo": 13, "soap_film": 11, "steric": 12}


ell = Symbol("ell", positive=True)


@cache
def made(name: str) -> list[dict[str, Any]]:
    return json.loads(json.dumps(certificates(law_of(name))[0]))  # type: ignore[no-any-return]


def law(zeta: Any, claim: Any, order: Any = (delta, h, R)) -> ContactLaw:
    return ContactLaw(name="law", a=R, F_ela=E * R * delta, zeta=zeta, limits=(Limit("limit", order, {"zeta": claim}),))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in ("rognon_gay", "cone") else pytest.mark.slow) for name in COVERED]
)
def test_certificates_of_stock_laws_hold(name: str) -> None:
    assert len(made(name)) >= COVERED[name]
    for one in made(name):
        check_certificate(one)
        for hidden in ("#h", "@h", "~h", "a b", ""):  # no name of a quantity is taken for that of a constant
            with pytest.raises(Refused):
                check_certificate(
                    json.loads(
                        json.dumps(one).replace('"h"', json.dumps(hidden)).replace('"delta"', json.dumps(hidden))
                    )
                )


def value_of(text: Any, at: dict[str, float]) -> float:
    """Value of an expression in prefix notation."""
    if isinstance(text, str):
        return at[text] if text in at else float(Fraction(text))
    parts = [value_of(part, at) for part in text[1:]]
    operations: dict[str, Any] = {"+": math.fsum, "*": math.prod, "^": lambda x: x[0] ** x[1]}
    operations |= {"exp": lambda x: math.exp(x[0]), "log": lambda x: math.log(x[0])}
    return float(operations[text[0]](parts))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["droplet", "steric"])
def test_what_a_certificate_defines_is_the_laws_own(name: str) -> None:
    """In numbers: also where sums are written out in h and delta, and where one branch alone is left."""
    for one in made(name):
        limit = next(x for x in law_of(name).limits if one["claim_of"].startswith(f"{name}: {x.name}: "))
        side = side_of(limit)
        sizes = {"R": 1.0, "E": 1.3, "eta": 0.7, "nu": 0.3, "sigma": 0.9, "Pi0": 1.7, "h": 0.11, "delta": 0.07}
        # on the side of each branch that the order says
        sizes["L"] = 0.02 if any("L" in str(small) for small, _ in one["branches"]) else 0.4
        defined = dict(sizes, pi=math.pi)
        for quantity, text in one["definitions"]:
            defined[quantity] = value_of(text, defined)
        exact = {symbol: sizes[symbol.name] for symbol in (R, E, eta, h, *law_of(name).parameters)}
        exact[delta] = side * sizes["delta"]
        for symbol, form in definitions(law_of(name)).items():
            exact[symbol] = float(form.subs(exact))
            if symbol.name in defined:
                assert defined[symbol.name] == pytest.approx(exact[symbol], rel=1e-12), (one["claim_of"], symbol)


def test_a_branch_and_a_force_are_told_by_the_order() -> None:
    """A law with a branch: the one that applies; and a claim that needs the force to be large."""
    brush = Piecewise((E * R * (ell - h), h < ell), (0, True))
    both = ContactLaw(
        name="law",
        a=R,
        F_ela=E * R * delta,
        zeta=6 * pi * eta * R**2 / h,
        F_adh=brush,
        parameters={ell: LENGTH},
        limits=(
            Limit("inside", ((h, ell), (delta, R)), {"F_adh": E * R * ell}),
            Limit("pressed", ((h, ell), (E * R * ell, F), (delta, R)), {"dh_dt": -F * h / (6 * pi * eta * R**2)}),
            Limit("unknown", ((h, R), (ell, R), (delta, R)), {"F_adh": E * R * ell}),
        ),
    )
    inside = certificate(both, both.limits[0], "F_adh")
    pressed = certificate(both, both.limits[1], "dh_dt")
    for one in (inside, pressed):
        check_certificate(one)
        with pytest.raises(Refused):
            check_certificate({**one, "branches": [pair[::-1] for pair in one["branches"]]})
    assert inside["forces"] == []
    assert pressed["forces"][0][0] == "F"
    with pytest.raises(Refused):  # the claim rests on it
        check_certificate({**pressed, "forces": []})
    with pytest.raises(Refused, match="not fixed"):
        check_certificate({**pressed, "fixed": [*pressed["fixed"], "ell"]})
    with pytest.raises(Refused, match="branch"):
        certificate(both, both.limits[2], "F_adh")


def test_the_checker_is_short_and_knows_nothing_of_the_prover() -> None:
    text = Path(certificate_checker.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) < 300
    imported = {node.module or "" for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}
    imported |= {name.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for name in node.names}
    assert imported <= {"__future__", "json", "fractions", "itertools", "typing"}
    assert not any(word in text for word in ("eval(", "sympify", "sympy"))


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to every number and name within plain data."""
    if isinstance(value, dict):
        return [place for key, part in value.items() for place in places(part, (*path, key))]
    if isinstance(value, list):
        return [place for i, part in enumerate(value) for place in places(part, (*path, i))]
    return [path]


def changed(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    found = copy.deepcopy(data)
    inner = found
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return found


@pytest.mark.parametrize("part", ["claim", "quantity", "multipliers"])
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_falsified_certificate_is_refused(part: str, data: st.DataObject) -> None:
    """Each number of the claim, of what is claimed of, and each multiplier that is used says something."""
    one = data.draw(st.sampled_from([c for c in made("cone") + made("rognon_gay") if places(c[part])]))
    numbers = [p for p in places(one[part]) if at(one, (part, *p)).lstrip("-")[:1].isdigit()]
    if not numbers and part != "multipliers":
        wrong = changed(one, (part,), ["*", "2", one[part]])
    elif part == "multipliers":
        wrong = changed(one, (part,), {key: [[["7/3"] * len(g), b] for g, b in v] for key, v in one[part].items()})
        if all(not value for value in one[part].values()) or (one["cases"] == "leaf" and not one[part]):
            return
    else:
        path = (part, *data.draw(st.sampled_from(numbers)))
        wrong = changed(one, path, data.draw(st.sampled_from(["7", "11/13", "-3"])))
        if at(one, path) == at(wrong, path):
            return
    with pytest.raises(Refused):
        check_certificate(wrong)


def at(data: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


@pytest.mark.parametrize("name", ["rognon_gay", "cone"])
def test_no_part_can_be_left_out_or_be_something_else(name: str) -> None:
    for one in made(name)[:6]:
        for key in ("format", "fixed", "assumed", "order", "definitions", "quantity", "claim", "atoms", "cases"):
            for wrong in (None, "x", 3, {"x": "1"}, [["x"]]):
                if key in ("fixed", "assumed") and not (wrong is None or wrong == 3):
                    continue  # what is fixed may not be needed
                with pytest.raises(Refused):
                    check_certificate({**one, key: wrong})
            with pytest.raises(Refused):
                check_certificate({k: v for k, v in one.items() if k != key})
        # what is compared is not fixed; without the order, or the multipliers, no term is small
        with pytest.raises(Refused):
            check_certificate({**one, "fixed": [*one["fixed"], "h", "delta"]})
        if one["multipliers"]:
            for key, nothing in (("order", []), ("multipliers", {})):
                with pytest.raises(Refused):
                    check_certificate({**one, key: nothing})


@pytest.mark.parametrize("factor", [2, pi, 1 + h / R, R / h, exp(-h / R), log(R / h)])
def test_no_wrong_claim_has_a_certificate(factor: Any) -> None:
    """But for a factor that tends to 1."""
    true = 6 * pi * eta * R**2 / h
    wrong = law(6 * pi * eta * R * (1 + R / h), true * factor)
    if factor in (1 + h / R, exp(-h / R)):
        check_certificate(certificate(wrong, wrong.limits[0], "zeta"))
    else:
        with pytest.raises(Refused):
            certificate(wrong, wrong.limits[0], "zeta")


def test_cases_leave_no_part_of_an_order_out() -> None:
    """Delta << R and h << R say nothing of delta against h: a claim that holds on one side has no certificate."""
    order = ((delta, R), (h, R))
    zeta = eta * R**2 / h
    both = ContactLaw(name="both", a=h + delta**2 / R + R, F_ela=E * R * delta, zeta=zeta)
    from dataclasses import replace

    from sympy import Abs

    split = replace(both, a=R * (h + Abs(delta)) / (h + 2 * Abs(delta)), limits=(Limit("l", order, {"a": R}),))
    with pytest.raises(Refused):
        certificate(split, split.limits[0], "a")
    whole = replace(both, a=R + h * (h + Abs(delta)) / (h + 2 * Abs(delta)), limits=(Limit("l", order, {"a": R}),))
    one = certificate(whole, whole.limits[0], "a")
    check_certificate(one)
    assert one["cases"] != "leaf"
    for branch in ("above", "below", "level"):
        with pytest.raises(Refused):
            check_certificate({**one, "cases": {k: v for k, v in one["cases"].items() if k != branch}})


def test_logarithms_and_exponentials_are_variables_with_their_relation() -> None:
    """log(R/h) grows, and slower than any power; the false proof of a vanishing exponential has no certificate."""
    grows = law(eta * R * (log(1 + R / h) + R / h), eta * R**2 / h)
    check_certificate(certificate(grows, grows.limits[0], "zeta"))
    alone = law(eta * R * (1 + log(1 + R / h)), eta * R * log(R / h))
    with pytest.raises(Refused):  # log(1 + R/h) is another variable than log(R/h)
        certificate(alone, alone.limits[0], "zeta")
    one = certificate(grows, grows.limits[0], "zeta")
    assert [kind for _, (kind, _), _ in one["atoms"]] == ["log"]
    for power in ("0", "-1"):
        with pytest.raises(Refused):
            check_certificate({**one, "atoms": [[*one["atoms"][0][:2], power]]})
    with pytest.raises(Refused):
        check_certificate({**one, "atoms": []})


@pytest.mark.slow
def test_the_command_writes_certificates_and_checks_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "certificates.json"
    assert main(["check", "rognon_gay", "--certificates", str(path)]) == 0
    assert "12 of 12 claims" in capsys.readouterr().err
    assert main(["verify", str(path)]) == 0
    assert "12 of 12 certificates hold" in capsys.readouterr().out
    data = json.loads(path.read_text(encoding="utf-8"))
    data["certificates"][3]["claim"] = ["*", "2", data["certificates"][3]["claim"]]
    path.write_text(json.dumps(data), encoding="utf-8")
    assert main(["verify", str(path)]) == 1
    assert "refused" in capsys.readouterr().out
    for text, told in (
        ("[" * 100_000, "is no JSON file"),
        ('{"a": 1}', "has no list of certificates"),
        (None, "cannot read"),
    ):
        path.unlink() if text is None else path.write_text(text, encoding="utf-8")
        assert main(["verify", str(path)]) == 2
        assert told in capsys.readouterr().err
