"""How much memory this process has had at most."""

import math
import sys


def peak_memory() -> float:
    """Return the largest resident size so far, in bytes; nan where the system does not tell, as on Windows."""
    try:
        import resource
    except ImportError:
        return math.nan
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024))
