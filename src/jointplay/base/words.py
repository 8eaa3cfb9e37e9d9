"""Numbers of things in words."""


def counted(number: float | str, noun: str, plural: str = "") -> str:
    """A number and what it counts: ``1 block``, ``3 blocks``; the plural of most nouns has an s."""
    return f"{number} {noun if str(number) == '1' else plural or f'{noun}s'}"
