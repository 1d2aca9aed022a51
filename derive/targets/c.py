"""Target C: any C99 compiler, math.h alone."""

from softdyn.derive.emit import kernel_body, render_template
from softdyn.derive.kernel import KernelIR
from softdyn.derive.translate import to_c

SUFFIX = ".c"


def render(ir: KernelIR) -> str:
    """C text of a kernel."""
    return render_template("c/kernel.c.j2", ir, body=to_c(kernel_body(ir)).rstrip())
