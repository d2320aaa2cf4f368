"""A mesh of shells that comes to rest after an impact."""

from models.compilation import kernel
from models.shells.element import update_element
from models.shells.explicit import advance, clear_loads
from models.shells.parts import apply_parts


@kernel
def settle(
    nodes, shells, materials, start, ties, gaps, supports, step, count, damping, frame, local
):  # fmt: skip
    """Let a mesh come to rest by damping in proportion to mass.

    Parameters
    ----------
    nodes, shells, materials
        The mesh; changed.
    start : (n, 3) array
        Places of the nodes at rest, m.
    ties, gaps, supports
        See ``models.shells.parts``.
    step : float
        s.
    count : int
        Number of steps.
    damping : float
        Force against the velocity over mass, 1/s.
    frame : (3, 3) array
        Workspace.
    local : (9,) array
        Workspace.
    """
    keep = 1.0 - damping * step
    for _ in range(count):
        clear_loads(nodes)
        for e in range(shells.node.shape[0]):
            update_element(nodes, shells, materials, e, step, frame, local)
        apply_parts(nodes, start, ties, gaps, supports)
        for n in range(nodes.mass.shape[0]):
            for a in range(3):
                nodes.velocity[n, a] *= keep
                nodes.spin[n, a] *= keep
        advance(nodes, step, step)
