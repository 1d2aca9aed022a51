"""What specialisation is worth: the same run with each rule switched off."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from softdyn.kernels import Functions, Kernel
from softdyn.laws import law_of
from softdyn.targets import target_module

#: This rule leaves out what nobody asked for: without it a kernel computes all outputs.
OUTPUTS = "outputs asked for"


def kernels_by_rule(law: Any, kernel: Kernel, needs: dict[str, Any]) -> Iterator[tuple[str, Kernel, int]]:
    """Variants of a scene's kernel in C: its name, the kernel, and the operations of its law.

    As it is, without each of the rules that apply, without all of them, and with the parameters, all 1, as numbers.

    Parameters
    ----------
    law : str, Path or ContactLaw
    kernel : Kernel
        Of the scene; the variants differ from it in their functions, and in what these take and give.
    needs : dict
        What the scene needs, fields of :class:`softdyn.derive.pair_equations.Needs`.
    """
    from softdyn.derive.emit import write
    from softdyn.derive.kernel_form import total_operations
    from softdyn.derive.pair_equations import Needs
    from softdyn.derive.pair_kernel import kernel_ir
    from softdyn.derive.rules import RULES, Rule

    declared, full = law_of(law), Needs(**needs)
    back_end = target_module("c")
    made_by = back_end.identity()
    applied = [saving.rule for saving in kernel_ir(declared, full).savings]
    variants: list[tuple[str, tuple[Rule, ...], Needs]] = [("as it is", RULES, full)]
    for name in applied:
        kept = tuple(rule for rule in RULES if rule.name != name)
        variants.append((f"without: {name}", kept, replace(full, outputs=None) if name == OUTPUTS else full))
    variants.append(("without any", (), replace(full, outputs=None)))
    ones = {name: "1" for name in kernel.parameters if name != "R"}
    variants.append((f"with {' = '.join(ones)} = 1 as numbers", RULES, replace(full, fixed=ones)))
    for name, rules, of_variant in variants:
        ir = kernel_ir(declared, of_variant, rules)
        with tempfile.TemporaryDirectory(prefix="softdyn-") as scratch:
            text, _, signatures = write(ir, "c")
            for file, content in back_end.build(ir.name, text, made_by).items():
                Path(scratch, file).write_bytes(content)
            functions = Functions(**back_end.load(Path(scratch), ir.name, signatures))
        takes = {"parameters": ir.arrays["p"], "outputs": ir.settings["outputs"], "inputs": ir.settings["inputs"]}
        made = replace(kernel, functions=functions, **takes)
        yield name, made, total_operations(ir)
