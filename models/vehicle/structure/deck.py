"""A user's own front of shells: an LS-DYNA keyword deck with its thicknesses and materials.

Read are nodes, shells, parts, shell sections, three materials (elastic, piecewise linear
plasticity, rigid), curves and fixed nodes; anything else is refused unless the user says that the
front does without it. Field orders are those of the keyword manual (LS-DYNA R6.1, volumes I and
II).
"""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.shells.material import Materials
from models.vehicle.structure.hardening import fit_hardening
from models.vehicle.structure.keywords import (
    WIDTH,
    Block,
    fields_of,
    number_of,
    read_blocks,
    refuse_unknown,
    rows_of,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]

UNITS = {
    "m-s-kg": (1.0, 1.0, 1.0),
    "mm-ms-kg": (1e-3, 1e-3, 1.0),
    "mm-s-t": (1e-3, 1.0, 1e3),
}
"""Length, time and mass of a deck's units, in m, s and kg."""
SILENT = ("KEYWORD", "TITLE", "COMMENT", "CONTROL_", "DATABASE_", "HOURGLASS")
"""Beginnings of keywords that say nothing about the front."""
MATERIALS = {
    "MAT_ELASTIC": "elastic", "MAT_001": "elastic",
    "MAT_PIECEWISE_LINEAR_PLASTICITY": "plastic", "MAT_024": "plastic",
    "MAT_RIGID": "rigid", "MAT_020": "rigid",
}  # fmt: skip
KNOWN = (
    "NODE", "ELEMENT_SHELL", "PART", "SECTION_SHELL", "DEFINE_CURVE", "SET_NODE_LIST",
    "BOUNDARY_SPC_NODE", "BOUNDARY_SPC_SET", *MATERIALS,
)  # fmt: skip
NODE_WIDTHS = (8, 16, 16, 16, 8, 8)
SHELL_WIDTHS = (8,) * 6
CURVE_WIDTHS = (20, 20)
FORMULATIONS = (1, 2, 10, 16)
"""Element formulations of thin shells; all become the one of ``models.shells.element``."""
NEVER = 1e10
"""Failure strain from which on a material does not fail."""


@dataclass(frozen=True)
class Deck:
    """What a keyword deck holds, in m, s and kg.

    Attributes
    ----------
    position : (n, 3) array
        m.
    elements : (m, 4) array of int
        Rows of the nodes; a triangle repeats its last node.
    part : (m,) array of int
        Row of ``names``.
    names : tuple of str
        Titles of the parts.
    thickness : (parts,) array
        m.
    materials : Materials
        One row a part.
    held : (n,) array of bool
        Nodes that do not move: those fixed, and those of rigid parts.
    notes : list of str
        What was left out or changed.
    digest : str
        Of the file and of what is left out.
    """

    position: Array
    elements: Index
    part: Index
    names: tuple[str, ...]
    thickness: Array
    materials: Materials
    held: NDArray[np.bool_]
    notes: list[str]
    digest: str


def read_deck(path: Path, units: str, ignore: Collection[str] = ()) -> Deck:
    """Return the shells of a keyword file.

    Parameters
    ----------
    path : Path
    units : str
        One of ``UNITS``.
    ignore : collection of str
        Keywords (or their beginnings) that the front does without; ``FAIL`` for the failure of
        materials.

    Raises
    ------
    ValueError
        In one line that names the file and the line, if the units are unknown or the file has
        anything that is not read.
    """
    if units not in UNITS:
        raise ValueError(f"units must be one of {', '.join(UNITS)}, given {units!r}")
    blocks = read_blocks(path)
    notes = refuse_unknown(path, blocks, KNOWN, (*SILENT, *ignore))
    length, time, mass = UNITS[units]
    reader = _Reader(path, length, mass / length / time**2, mass / length**3, 1.0 / time,
                     "FAIL" in ignore, notes)  # fmt: skip
    by_name: dict[str, list[Block]] = {}
    for block in blocks:
        by_name.setdefault(block.name, []).append(block)
    number, position = reader.nodes(by_name.get("NODE", []))
    elements, pid = reader.shells(by_name.get("ELEMENT_SHELL", []), number)
    curves = reader.curves(by_name.get("DEFINE_CURVE", []))
    sections = reader.sections(by_name.get("SECTION_SHELL", []))
    kinds = [block for name in MATERIALS for block in by_name.get(name, [])]
    materials = reader.materials(kinds, curves)
    parts = reader.parts(by_name.get("PART", []))
    used, part = np.unique(pid, return_inverse=True)
    rows = [reader.part_row(int(p), parts, sections, materials) for p in used]
    fixed = reader.fixed(by_name, number)
    rigid = np.array([row[3] for row in rows])
    held = np.zeros(len(position), dtype=np.bool_)
    held[fixed] = True
    held[np.unique(elements[rigid[part]])] = True
    notes.append("fixed nodes are held in all directions")
    digest = hashlib.sha256(path.read_bytes() + repr((units, sorted(ignore))).encode())
    return Deck(
        position=position, elements=elements, part=part.reshape(-1),
        names=tuple(row[0] for row in rows), thickness=np.array([row[1] for row in rows]),
        materials=Materials(*(np.array(c) for c in zip(*(row[2] for row in rows), strict=True))),
        held=held, notes=notes, digest=digest.hexdigest()[:12],
    )  # fmt: skip


_Row = tuple[float, ...]


@dataclass(frozen=True)
class _Reader:
    """Reads the blocks of one file; factors turn its units into m, Pa, kg/m3 and 1/s."""

    path: Path
    length: float
    pressure: float
    density: float
    rate: float
    no_failure: bool
    notes: list[str]

    def _fail(self, line: int, message: str) -> ValueError:
        return ValueError(f"{self.path}: line {line}: {message}")

    def _number(self, line: int, text: str, what: str, default: float | None = None) -> float:
        return number_of(self.path, line, text, what, default)

    def _card(self, block: Block, k: int, needed: bool = True) -> tuple[int, list[str]]:
        """Return line and fields of a block's card below its title."""
        if k >= len(block.cards):
            if needed:
                raise self._fail(block.line, f"*{block.name} lacks card {k + 1}")
            return block.line, [""] * 8
        return block.cards[k][0], fields_of(self.path, block.cards[k])

    def nodes(self, blocks: list[Block]) -> tuple[Index, Array]:
        """Return numbers (n,) and places (n, 3), m."""
        number, place = [], []
        for block in blocks:
            for line, row in rows_of(self.path, block, NODE_WIDTHS):
                number.append(int(self._number(line, row[0], "node")))
                place.append([self._number(line, v, "a coordinate", 0.0) for v in row[1:4]])
                if row[4] not in ("", "0") or row[5] not in ("", "0"):
                    raise self._fail(line, "constraints in *NODE are not read; use *BOUNDARY_SPC")
        if not number:
            raise ValueError(f"{self.path}: has no *NODE")
        found = np.array(number, dtype=np.int64)
        values, count = np.unique(found, return_counts=True)
        if (count > 1).any():
            raise ValueError(f"{self.path}: node {values[count > 1][0]} is defined twice")
        return found, self.length * np.array(place)

    def shells(self, blocks: list[Block], number: Index) -> tuple[Index, Index]:
        """Return rows of nodes (m, 4) and part numbers (m,)."""
        order = np.argsort(number)
        corners, pid = [], []
        for block in blocks:
            for line, row in rows_of(self.path, block, SHELL_WIDTHS):
                wanted = [int(self._number(line, v, "a node", 0.0)) for v in row[2:6]]
                if wanted[3] in (0, wanted[2]):
                    wanted[3] = wanted[2]
                if len(set(wanted)) < 3:
                    raise self._fail(line, f"shell {row[0]} has fewer than three corners")
                place = np.minimum(np.searchsorted(number[order], wanted), len(order) - 1)
                rows = order[place]
                missing = [w for w, r in zip(wanted, rows, strict=True) if number[r] != w]
                if missing:
                    raise self._fail(line, f"node {missing[0]} is not in *NODE")
                corners.append(rows)
                pid.append(int(self._number(line, row[1], "part")))
        if not corners:
            raise ValueError(f"{self.path}: has no *ELEMENT_SHELL")
        return np.array(corners, dtype=np.int64), np.array(pid, dtype=np.int64)

    def curves(self, blocks: list[Block]) -> dict[int, Array]:
        """Return the curves (k, 2) by number, in the file's own units."""
        found = {}
        for block in blocks:
            first = int(block.titled)
            line, head = self._card(block, first)
            sfa, sfo, offa, offo = (
                self._number(line, head[k], "a scale", 1.0 if k < 4 else 0.0) for k in (2, 3, 4, 5)
            )
            table = []
            for card in block.cards[first + 1 :]:
                if not card[1].strip():
                    continue
                row = fields_of(self.path, card, CURVE_WIDTHS)
                x, y = (self._number(card[0], v, "a point") for v in row[:2])
                table.append(((sfa or 1.0) * (x + offa), (sfo or 1.0) * (y + offo)))
            number = int(self._number(line, head[0], "curve"))
            if len(table) < 2:
                raise self._fail(line, f"curve {number} has fewer than two points")
            found[number] = np.array(table)
        return found

    def sections(self, blocks: list[Block]) -> dict[int, float]:
        """Return the thickness of each section, m."""
        found = {}
        for block in blocks:
            k = int(block.titled)
            while k < len(block.cards):
                line, head = self._card(block, k)
                form = int(self._number(line, head[1], "element formulation", 2.0))
                if form not in FORMULATIONS:
                    raise self._fail(
                        line, f"element formulation {form} is not read; {FORMULATIONS} are"
                    )
                if head[6] not in ("", "0"):
                    raise self._fail(line, "layered (ICOMP) sections are not read")
                line, row = self._card(block, k + 1)
                t = [self._number(line, v, "thickness", 0.0) for v in row[:4]]
                if t[0] <= 0.0 or any(v not in (0.0, t[0]) for v in t[1:]):
                    raise self._fail(line, f"a section has one thickness above zero, given {t}")
                if row[4] not in ("", "0", "0.0"):
                    raise self._fail(line, "sections beside their nodes (NLOC) are not read")
                found[int(self._number(line, head[0], "section"))] = self.length * t[0]
                k += 2 + int(block.titled)
        return found

    def materials(
        self, blocks: list[Block], curves: Mapping[int, Array]
    ) -> dict[int, tuple[_Row, bool]]:
        """Return the row of each material, and whether it is rigid."""
        found = {}
        for block in blocks:
            first = int(block.titled)
            kind = MATERIALS[block.name]
            line, head = self._card(block, first)
            mid = int(self._number(line, head[0], "material"))
            density = self.density * self._number(line, head[1], "density")
            young = self.pressure * self._number(line, head[2], "Young's modulus")
            poisson = self._number(line, head[3], "Poisson's ratio", 0.0)
            if density <= 0.0 or young <= 0.0 or not 0.0 <= poisson < 0.5:
                raise self._fail(
                    line, f"material {mid}: no elastic constants of a metal or plastic"
                )
            row: _Row = (young, poisson, density, np.inf, 0.0, 0.0, 1.0, np.inf, 1.0)
            if kind == "plastic":
                row = (young, poisson, density, *self._plastic(block, first, mid, young, curves))
            found[mid] = (row, kind == "rigid")
        return found

    def _plastic(
        self, block: Block, first: int, mid: int, young: float, curves: Mapping[int, Array]
    ) -> _Row:
        """Return yield stress, slope, saturation, scale, rate and exponent of a MAT_024."""
        line, head = self._card(block, first)
        fail = self._number(line, head[6], "FAIL", 0.0)
        if 0.0 < fail < NEVER:
            if not self.no_failure:
                raise self._fail(
                    line, f"material {mid} fails (FAIL {fail:g}), which is not modelled; name FAIL "
                    "in the car file's shells.ignore to go on without it"
                )  # fmt: skip
            self.notes.append(f"material {mid}: failure at {fail:g} is left out")
        line, rates = self._card(block, first + 1, needed=False)
        c, p = (self._number(line, rates[k], name, 0.0) for k, name in ((0, "C"), (1, "P")))
        lcss = int(self._number(line, rates[2], "LCSS", 0.0))
        if int(self._number(line, rates[3], "LCSR", 0.0)):
            raise self._fail(line, "curves of the rate (LCSR) are not read; give C and P")
        table = None
        if lcss:
            if lcss not in curves:
                raise self._fail(line, f"LCSS {lcss} is no *DEFINE_CURVE; tables are not read")
            table = curves[lcss]
        else:
            _, strain = self._card(block, first + 2, needed=False)
            line, stress = self._card(block, first + 3, needed=False)
            points = [
                (self._number(line, e, "EPS", 0.0), self._number(line, s, "ES", 0.0))
                for e, s in zip(strain[:8], stress[:8], strict=True)
            ]
            points = [pair for pair in points if pair[1] > 0.0]
            table = np.array(points) if points else None
        viscous = (self.rate * c, p) if c > 0.0 and p > 0.0 else (np.inf, 1.0)
        if table is None:
            line, head = self._card(block, first)
            limit = self.pressure * self._number(line, head[4], "SIGY")
            tangent = self.pressure * self._number(line, head[5], "ETAN", 0.0)
            if limit <= 0.0 or not 0.0 <= tangent < young:
                raise self._fail(line, f"material {mid}: SIGY must be above 0, ETAN below E")
            return (limit, young * tangent / (young - tangent), 0.0, 1.0, *viscous)
        scaled = table * np.array([1.0, self.pressure])
        try:
            law, error = fit_hardening(scaled)
        except ValueError as why:
            raise self._fail(line, f"material {mid}: {why}") from None
        self.notes.append(f"material {mid}: hardening curve met within {100.0 * error:.1f} %")
        return (*law, *viscous)

    def parts(self, blocks: list[Block]) -> dict[int, tuple[str, int, int, int]]:
        """Return title, section, material and line of each part."""
        found = {}
        for block in blocks:
            for k in range(0, len(block.cards) - 1, 2):
                line, row = self._card(block, k + 1)
                pid, secid, mid = (
                    int(self._number(line, row[j], what))
                    for j, what in ((0, "part"), (1, "section"), (2, "material"))
                )
                found[pid] = (block.cards[k][1].strip() or f"part {pid}", secid, mid, line)
        return found

    def part_row(
        self,
        pid: int,
        parts: Mapping[int, tuple[str, int, int, int]],
        sections: Mapping[int, float],
        materials: Mapping[int, tuple[_Row, bool]],
    ) -> tuple[str, float, _Row, bool]:
        """Return title, thickness, material and whether it is rigid, of a part."""
        if pid not in parts:
            raise ValueError(f"{self.path}: a shell names part {pid}, which is not in *PART")
        title, secid, mid, line = parts[pid]
        if secid not in sections:
            raise self._fail(line, f"section {secid} of {title!r} is not in *SECTION_SHELL")
        if mid not in materials:
            raise self._fail(line, f"material {mid} of {title!r} is not among the materials")
        row, rigid = materials[mid]
        return title, sections[secid], row, rigid

    def fixed(self, by_name: Mapping[str, list[Block]], number: Index) -> Index:
        """Return the rows of the nodes that are fixed."""
        row = {int(n): k for k, n in enumerate(number)}
        sets: dict[int, list[int]] = {}
        for block in by_name.get("SET_NODE_LIST", []):
            first = int(block.titled)
            line, head = self._card(block, first)
            rows = [fields_of(self.path, card) for card in block.cards[first + 1 :]]
            own = [int(self._number(line, v, "a node", 0.0)) for r in rows for v in r]
            sets[int(self._number(line, head[0], "set"))] = [n for n in own if n]
        found: list[int] = []
        for name in ("BOUNDARY_SPC_NODE", "BOUNDARY_SPC_SET"):
            for block in by_name.get(name, []):
                for line, card in rows_of(self.path, block, (WIDTH,) * 8):
                    which = int(self._number(line, card[0], "node or set"))
                    if "1" not in card[2:5]:
                        continue
                    nodes = [which] if name.endswith("NODE") else sets.get(which)
                    if nodes is None:
                        raise self._fail(line, f"set {which} is not in *SET_NODE_LIST")
                    lost = [n for n in nodes if n not in row]
                    if lost:
                        raise self._fail(line, f"node {lost[0]} is not in *NODE")
                    found += [row[n] for n in nodes]
        return np.array(found, dtype=np.int64)
