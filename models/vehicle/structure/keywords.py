"""Cards of an LS-DYNA keyword file: fixed columns or commas, with the line that each stands on."""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

COMMENT = "$"
WIDTH = 10
"""Columns of a field, unless the card has widths of its own."""
TITLED = "_TITLE"
"""Ending of a keyword whose first card is a title."""


@dataclass
class Block:
    """A keyword with the lines below it.

    Attributes
    ----------
    name : str
        Without the star and in upper case; a ``_TITLE`` is cut off.
    line : int
        Where the keyword stands, from 1.
    cards : list of (int, str)
        Line number and text of each card.
    titled : bool
        Whether the keyword had the ending ``_TITLE``.
    """

    name: str
    line: int
    cards: list[tuple[int, str]] = field(default_factory=list)
    titled: bool = False


def read_blocks(path: Path) -> list[Block]:
    """Return the keywords of a file in order, up to ``*END``.

    Raises
    ------
    ValueError
        In one line, if the file cannot be read, has no keyword, or is of the long format.
    """
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error})") from None
    blocks: list[Block] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith(COMMENT):
            continue
        if line.startswith("*"):
            name = line[1:].split()[0].upper() if line[1:].split() else ""
            if name == "END":
                break
            if name.endswith(("+", "%")) or re.search(r"LONG\s*=\s*[YS]", line.upper()):
                raise ValueError(f"{path}: line {number}: the long format is not read")
            titled = name.endswith(TITLED) and name != TITLED
            blocks.append(Block(name.removesuffix(TITLED), number, titled=titled))
        elif blocks:
            blocks[-1].cards.append((number, line))
        elif line.strip():
            raise ValueError(f"{path}: line {number}: a keyword file begins with a *")
    if not blocks:
        raise ValueError(f"{path}: holds no keyword")
    return blocks


def fields_of(path: Path, card: tuple[int, str], widths: Sequence[int] = (WIDTH,) * 8) -> list[str]:
    """Return the fields of a card, as texts without blanks.

    Parameters
    ----------
    path : Path
        For messages.
    card : (int, str)
        Line number and text.
    widths : sequence of int
        Columns of the fields, for a card without commas.

    Raises
    ------
    ValueError
        In one line, if the card names a parameter.
    """
    number, text = card
    if "&" in text:
        raise ValueError(f"{path}: line {number}: parameters ({text.strip()[:20]}) are not read")
    if "," in text:
        found = [part.strip() for part in text.split(",")]
        return found + [""] * (len(widths) - len(found))
    found, start = [], 0
    for width in widths:
        found.append(text[start : start + width].strip())
        start += width
    return found


def number_of(path: Path, line: int, text: str, what: str, default: float | None = None) -> float:
    """Return a field as a number.

    Parameters
    ----------
    path : Path
    line : int
        For the message.
    text : str
        Field.
    what : str
        Its name, for the message.
    default : float, optional
        Value of a blank field.

    Raises
    ------
    ValueError
        In one line, if the field is no number, or blank without a default.
    """
    if not text and default is not None:
        return default
    # A sign within a number stands for its exponent: 1.0-3.
    written = re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", text.lower().replace("d", "e"))
    try:
        return float(written)
    except ValueError:
        raise ValueError(f"{path}: line {line}: {what} must be a number, given {text!r}") from None


def rows_of(path: Path, block: Block, widths: Sequence[int]) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and fields of each card of a block that is not blank."""
    for card in block.cards:
        if card[1].strip():
            yield card[0], fields_of(path, card, widths)


def refuse_unknown(
    path: Path, blocks: Collection[Block], known: Collection[str], ignored: Collection[str]
) -> list[str]:
    """Return notes of the keywords that are left out.

    Parameters
    ----------
    path : Path
    blocks : collection of Block
    known : collection of str
        Keywords that are read.
    ignored : collection of str
        Beginnings of keywords that change nothing here, or that the user leaves out.

    Raises
    ------
    ValueError
        In one line, if there is any other.
    """
    left: dict[str, int] = {}
    for block in blocks:
        if block.name in known:
            continue
        if not any(block.name.startswith(start) for start in ignored):
            raise ValueError(
                f"{path}: line {block.line}: *{block.name} is not read; take it out, or name it "
                "in the car file's shells.ignore if the front does without it"
            )
        left[block.name] = left.get(block.name, 0) + 1
    return [f"*{name} left out ({count})" for name, count in left.items()]
