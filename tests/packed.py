"""Reads what `jointplay.show.player.tracks.Packer` has packed, as `static/tracks.js` does."""

from typing import Any

import numpy as np


def unpack_mesh(block: bytes, entry: dict[str, Any]) -> np.ndarray:
    """Triangles that `Packer.mesh` appended, from the decompressed block: shape (m, 3)."""
    data = np.frombuffer(block, np.uint8, entry["bytes"], entry["at"])
    behind = np.ascontiguousarray(data.reshape(4, -1).T).view("<u4").reshape(-1)
    corners, fresh = [], 0
    for back in behind.tolist():
        corners.append(fresh - back)
        fresh += back == 0
    return np.array(corners).reshape(-1, 3)


def unpack(block: bytes, entry: dict[str, Any]) -> np.ndarray:
    """Table that `Packer.table` appended, from the decompressed block: shape (rows, columns)."""
    rows, columns = entry["rows"], entry["columns"]
    data = np.frombuffer(block, np.uint8, entry["bytes"], entry["at"])
    zigzag = np.ascontiguousarray(data.reshape(4, -1).T).view("<u4").reshape(columns, rows)
    zigzag = zigzag.astype(np.int64)
    change = (zigzag >> 1) ^ -(zigzag & 1)
    return np.cumsum(change, axis=1).T * entry["quantum"]
