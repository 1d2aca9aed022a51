"""Words and formulas in pictures, as matplotlib's mathtext takes them."""

import re

from softdyn.terminal import plain

#: Fractions within so many others are still of full size.
NESTED = 1
TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|.", re.DOTALL)


def literal(text: str) -> str:
    """Text that a picture shows as it is, though it stands beside formulas: a dollar sign begins none."""
    return plain(text).replace("$", r"\$")


def displayed(latex: str) -> str:
    """Fractions in full size, but for those deep within others, in exponents and subscripts."""
    text, outer = "", []
    depth, groups, deeper = 0, 0, 0
    for token in TOKEN.findall(latex):
        if token == "{":
            outer.append((depth, max(groups - 1, 0), deeper))
            depth, groups, deeper = depth + deeper * (groups > 0), 0, 0
        elif token == "}":
            depth, groups, deeper = outer.pop()
        elif token == r"\frac":
            token, groups, deeper = r"\dfrac" if depth <= NESTED else token, 2, 1
        elif token in ("^", "_"):
            groups, deeper = 1, NESTED + 1
        elif token != " ":
            groups = 0
        text += token
    return text
