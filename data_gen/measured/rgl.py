"""Materials of EPFL's Realistic Graphics Lab (Dupuy and Jakob 2018), read by Mitsuba's `measured` plugin."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from data_gen.measured.files import mitsuba, size_of
from data_gen.measured.table import Table
from data_gen.measured.tabulation import Fidelity, tabulate
from envbench.directions import Array
from envbench.errors import BadInput

HORIZON = float(np.cos(np.deg2rad(85)))
"""Beyond 85 degrees f is as at 85: the files' f cos theta does not vanish at 90, so that f would grow without bound."""
_MAGIC = b"tensor_file\0"
_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8"}
_FIELDS = ("phi_i", "theta_i", "sigma", "ndf", "vndf", "luminance", "rgb", "jacobian")


def table(path: Path) -> tuple[Table, Fidelity]:
    """Tabulate f(L, V) with V as the plugin's ``wi``, as a path traced from the eye calls it.

    Raises
    ------
    BadInput
        The file is no isotropic RGB measurement, is cut short, or holds NaN or nothing but zeros.
    """
    check(path)
    with mitsuba("llvm_ad_rgb") as mi:
        import drjit as dr

        plugin, context = mi.load_dict({"type": "measured", "filename": str(path)}), mi.BSDFContext()

        def function(light: Array, view: Array) -> Array:
            si = dr.zeros(mi.SurfaceInteraction3f, len(light))
            si.wi = mi.Vector3f(view.T.astype(np.float32))
            value = plugin.eval(context, si, mi.Vector3f(light.T.astype(np.float32)))
            return value.numpy().T / np.maximum(light[:, 2:], 1e-9)

        return tabulate(path.stem, function, horizon=HORIZON)


def check(path: Path) -> None:
    """Check the container before Mitsuba, which trusts it, reads it; see `table`."""
    tensors = _tensors(path)
    missing = [name for name in _FIELDS if name not in tensors]
    if missing:
        hint = "take the file whose name ends in _rgb" if "spectra" in tensors else "get it again"
        raise BadInput(f"{path}: has no '{missing[0]}', so it is no RGB measurement; {hint}.")
    if tensors["phi_i"].size > 2:
        raise BadInput(f"{path}: is anisotropic ({tensors['phi_i'].size} azimuths); only isotropic ones can be read.")
    views, resolution = tensors["theta_i"].size, tensors["luminance"].shape[-1]
    wanted = {"luminance": (1, views, resolution, resolution), "rgb": (1, views, 3, resolution, resolution)}
    wanted["vndf"] = (1, views, *tensors["vndf"].shape[2:4])
    for name, shape in wanted.items():
        if tensors[name].shape != shape:
            raise BadInput(
                f"{path}: '{name}' must have shape {shape}. Got {tensors[name].shape} instead; get it again."
            )
    for name in _FIELDS:
        values = tensors[name]
        if values.dtype == np.float32 and not np.isfinite(values).all():
            raise BadInput(f"{path}: '{name}' holds NaN or Inf; get it again.")
    if not tensors["luminance"].any() or not tensors["rgb"].any():
        raise BadInput(f"{path}: reflects nothing (all zero); get it again.")


def _tensors(path: Path) -> dict[str, NDArray[np.generic]]:
    """Read Mitsuba's tensor file: fields of name, dimensions, type and offset, checked against the file's size."""
    size_of(path)
    data = path.read_bytes()
    if data[:12] != _MAGIC or data[12:14] != b"\x01\x00":
        raise BadInput(f"{path}: no RGL measurement (it must begin with 'tensor_file' and version 1.0).")
    tensors: dict[str, NDArray[np.generic]] = {}
    try:
        (count,) = struct.unpack_from("<I", data, 14)
        at = 18
        for _ in range(count):
            (length,) = struct.unpack_from("<H", data, at)
            name = data[at + 2 : at + 2 + length].decode("ascii")
            dimensions, kind, offset = struct.unpack_from("<HBQ", data, at + 2 + length)
            shape = struct.unpack_from(f"<{dimensions}Q", data, at + 13 + length)
            at += 13 + length + 8 * dimensions
            # as many as the shape says, or frombuffer raises: nothing is allocated
            items = int(np.prod([int(n) for n in shape], dtype=object))
            tensors[name] = np.frombuffer(data, _TYPES[kind], items, offset).reshape(shape)
    except (struct.error, ValueError, KeyError, OverflowError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: is cut short or damaged ({error}); get it again.") from error
    return tensors
