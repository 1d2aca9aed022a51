"""Which method integrates a scene: the one that it names, or the one that costs least of those that can.

Grains without a law are rigid: contact dynamics. A dry contact of grains with inertia is fast, as stiff as the grains,
and has nothing that could be followed in longer steps than its own: explicit steps, which cost least each. Noise has
steps of a fixed length, lest they follow what it has done: Brownian motion. All others are implicit: films are stiffer
the thinner they get, and without inertia no step can be explicit.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from softdyn.errors import SceneError
from softdyn.particles.loose_particles import is_loose
from softdyn.particles.mechanisms import rooms_of
from softdyn.particles.method_names import MODULES
from softdyn.particles.names import is_number
from softdyn.traits import traits_of
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.particles.system import ValidatedScene

#: Rooms of mechanisms that explicit steps know; contacts are their own.
KNOWN_TO_EXPLICIT = (
    "soft_films", "dry_contacts", "pushes", "gravity", "inertia", "coulomb", "holds", "walls", "shear",
)  # fmt: skip


def method_of(facts: ValidatedScene) -> str:
    """Name of the method of a scene.

    Raises
    ------
    SceneError
        If the method that it asks for cannot integrate it.
    """
    scene = facts.scene
    name, faults = scene.method or _cheapest(facts), []
    rigid, inert = scene.law is None, scene.inertia is not None
    if scene.noise is not None or name == "brownian":
        faults += _brownian_faults(facts, name)
    elif name == "contact_dynamics":
        if not rigid:
            faults.append("[method] name: contact dynamics is for rigid grains, which have no law: leave law out")
        if not inert:
            faults.append("[inertia] density is missing: rigid grains move as their mass makes them")
    elif rigid and not is_loose(scene):
        faults.append('law is missing: law = "NAME"; without one grains are rigid, [method] name = "contact_dynamics"')
    elif name == "explicit":
        if not inert:
            faults.append("[method] name: explicit steps are those of grains with inertia: give [inertia] density")
        if not _is_dry(scene.law):
            faults.append(
                "[method] name: explicit steps are for dry contacts, and the law has a film with a gap of its own: "
                "give a dry law, as hertz_dry, or the implicit method"
            )
        faults += _unknown_to_explicit(facts)
    if scene.step is not None and name != "contact_dynamics":
        own = "[noise] step" if name == "brownian" else "[accuracy] rtol"
        faults.append(f"[method] step is that of contact dynamics; the steps of the method {name} are those of {own}")
    if name not in ("implicit", "brownian"):
        between = {"[[potential]]": scene.potential, "[[bond]]": scene.bond}
        faults += [f"{place} is not known to the method {name}: leave it out" for place in between if between[place]]
    if faults:
        raise SceneError(listed(faults))
    return name


def module_of(name: str) -> Any:
    """Module of a method."""
    return import_module(MODULES[name])


def _cheapest(facts: ValidatedScene) -> str:
    scene = facts.scene
    if scene.noise is not None:
        return "brownian"
    if scene.law is None:
        return "contact_dynamics" if scene.inertia is not None else "implicit"
    fast = scene.inertia is not None and _is_dry(scene.law) and not _unknown_to_explicit(facts)
    fast = fast and not scene.potential and not scene.bond
    return "explicit" if fast else "implicit"


def _brownian_faults(facts: ValidatedScene, name: str) -> list[str]:
    scene = facts.scene
    if scene.noise is None:
        return ["[method] name: Brownian motion needs a temperature: give [noise]"]
    if name != "brownian":
        return [f"[noise] is known to the method brownian alone: leave [method] name = {name!r} out"]
    faults = []
    if scene.law is not None:
        faults.append(
            "[noise] is that of the drag of each particle; the noise of a film, whose friction depends on its gap, is "
            "not known: leave law out, and keep particles apart by a [[potential]]"
        )
    given = {
        "[inertia]": scene.inertia is not None,
        "[friction]": scene.friction is not None,
        "[contacts] tangential": bool(scene.tangential),
        "[stress]": bool(scene.stress) or scene.stress_viscosity is not None,
    }
    faults += [f"{place} has no meaning for Brownian motion without inertia" for place, there in given.items() if there]
    if not is_number(scene.shear_rate):
        faults.append("[flow] shear_rate: with noise the rate is a number, which steps of a fixed length resolve")
    return faults


def _unknown_to_explicit(facts: ValidatedScene) -> list[str]:
    scene = facts.scene
    found = [f"[{name}]" if name != "drag" else "[flow] drag" for name in _strangers(facts)]
    found += ["[contacts] gap"] if scene.gap is not None else []
    found += ["[contacts] tangential"] if scene.tangential else []
    found += ["the remote force F_adh of the law"] if _is_dry(scene.law) and traits_of(scene.law).remote else []
    if scene.friction is not None and _is_dry(scene.law) and traits_of(scene.law).rubs:
        found.append("friction of a load and a stiffness that the law declares, rubbing=,")
    return [f"{what} is not known to the explicit method: leave it out, or take another" for what in found]


def _strangers(facts: ValidatedScene) -> list[str]:
    """Rooms of mechanisms that the scene asks for, and explicit steps do not know."""
    rooms = [room.__name__.rpartition(".")[2] for room in rooms_of(facts.scene)]
    return [name for name in rooms if name not in (*KNOWN_TO_EXPLICIT, "potentials", "bonds")]


def _is_dry(law: Any) -> bool:
    return law is not None and traits_of(law).kind == "dry"
