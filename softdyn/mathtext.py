"""Words of others in pictures."""

from softdyn.terminal import plain


def literal(text: str) -> str:
    """Text that a picture shows as it is, though it stands beside formulas: a dollar sign begins none."""
    return plain(text).replace("$", r"\$")
