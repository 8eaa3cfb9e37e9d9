"""What Pinocchio's users expect of a mechanism besides its model: shapes and a visualizer."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pinocchio as pin

from jointplay.host.late import late

if TYPE_CHECKING:
    from jointplay.mechanism.visuals import Visuals


class Shown:
    """Part of a `Mechanism`: made when first asked for."""

    @cached_property
    def visual_model(self) -> pin.GeometryModel:
        """Shapes as the URDF has them, for `model`; stand-ins where it has none."""
        look: Visuals = late("mechanism.visuals:visuals")(self)
        return look.geometry

    @cached_property
    def collision_model(self) -> pin.GeometryModel:
        """Collision shapes as the URDF has them, for `model`, with no pairs of them chosen."""
        look: Visuals = late("mechanism.visuals:collisions")(self)
        return look.geometry

    def visualizer(self, meshes: Sequence[str | Path] = (), open: bool = False) -> Any:
        """Pinocchio's MeshcatVisualizer, ready: it plays `Result.q`, in a notebook too.

            viz = mechanism.visualizer()  # its viz.viewer.jupyter_cell() is for a notebook
            viz.play(result.q[::10], 1e-3)

        Args:
            meshes: folders where meshes may be, too.
            open: whether to open a window of the browser.

        Raises:
            JointplayError: a given folder does not exist, or loops cannot be closed.
        """
        return late("mechanism.visuals:visualizer")(self, meshes, open)
