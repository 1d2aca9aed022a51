"""Target numba: a Python module that numba compiles and caches."""

from softdyn.derive.emit import kernel_body, render_template
from softdyn.derive.kernel import KernelIR

SUFFIX = ".py"


def render(ir: KernelIR) -> str:
    """Python text of a kernel."""
    return render_template("numba/kernel.py.j2", ir, body=kernel_body(ir))
