"""Binary glTF 2.0 (.glb): one file with vertices, faces and a texture that is shown as it is, without light."""

from __future__ import annotations

import json
import struct
from typing import Any

from ...pictures.metadata import SOFTWARE
from .surface import Surface

_FLOAT, _UINT = 5126, 5125  # component types
_VERTICES, _INDICES = 34962, 34963  # what a part of the buffer is for
_CLAMPED, _LINEAR = 33071, 9729  # of a texture


def glb_bytes(surface: Surface, texture: bytes, opaque: bool, about: dict[str, Any]) -> bytes:
    """A surface as a file.

    Parameters
    ----------
    surface : Surface
        In glTF's axes (y up, −z ahead); v of its uvs runs down.
    texture : bytes
        A PNG file.
    opaque : bool
        Whether all of the texture is; else what is transparent is left out.
    about : dict
        JSON-ready; stands in the file's `asset.extras`.

    Returns
    -------
    bytes
        The same surface gives the same bytes.
    """
    points = surface.vertices.astype("<f4")
    triangles = surface.faces[:, [0, 1, 2, 0, 2, 3]].astype("<u4")
    parts: list[bytes] = [points.tobytes(), surface.uvs.astype("<f4").tobytes(), triangles.tobytes(), texture]
    views, start = [], 0
    for part, target in zip(parts, (_VERTICES, _VERTICES, _INDICES, None), strict=True):
        view = {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
        views.append(view | ({"target": target} if target else {}))
        start += _padded(len(part))
    material = {
        "name": "Panorama", "doubleSided": True, "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 1.0},
        **({} if opaque else {"alphaMode": "MASK", "alphaCutoff": 0.5}),
    }  # fmt: skip
    told = {
        "asset": {"version": "2.0", "generator": SOFTWARE, "extras": about},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "Panorama"}],
        "meshes": [{"name": "Panorama", "primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
        ]}],
        "accessors": [
            _accessor(0, _FLOAT, len(points), "VEC3") | {
                "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()
            },
            _accessor(1, _FLOAT, len(points), "VEC2"), _accessor(2, _UINT, triangles.size, "SCALAR"),
        ],
        "materials": [material], "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": _CLAMPED, "wrapT": _CLAMPED, "magFilter": _LINEAR, "minFilter": _LINEAR}],
        "images": [{"bufferView": 3, "mimeType": "image/png", "name": "Panorama"}],
        "bufferViews": views, "buffers": [{"byteLength": start}],
    }  # fmt: skip
    header = json.dumps(told, separators=(",", ":")).encode()
    header += b" " * (_padded(len(header)) - len(header))
    chunks = [struct.pack("<I4s", len(header), b"JSON"), header, struct.pack("<I4s", start, b"BIN\0")]
    chunks += [part + bytes(_padded(len(part)) - len(part)) for part in parts]
    return struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks)


def _accessor(view: int, kind: int, count: int, shape: str) -> dict[str, Any]:
    """What one part of the buffer holds."""
    return {"bufferView": view, "componentType": kind, "count": count, "type": shape}


def _padded(length: int) -> int:
    """A length in bytes up to the next multiple of four, where a part has to begin."""
    return -(-length // 4) * 4
