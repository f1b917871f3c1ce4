"""Transfer curves and ICC profiles."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from edf_stitch.core.raster.colour import decode, encode, icc_channels, parse_icc, srgb_curve
from hypothesis import given, settings
from hypothesis import strategies as st

# Colorants of two profiles as their makers wrote them (XYZ relative to D50, one row a primary).
SRGB = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410))
DISPLAY_P3 = ((0.51512, 0.24120, -0.00105), (0.29198, 0.69225, 0.04189), (0.15710, 0.06657, 0.78407))


def fixed(*numbers: float) -> bytes:
    return b"".join(struct.pack(">i", round(number * 65536)) for number in numbers)


def para(kind: int, *numbers: float) -> bytes:
    return b"para\0\0\0\0" + struct.pack(">HH", kind, 0) + fixed(*numbers)


def curv(*values: int) -> bytes:
    return b"curv\0\0\0\0" + struct.pack(f">I{len(values)}H", len(values), *values)


SRGB_CURVE = para(3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)


def icc(space: bytes = b"RGB ", primaries=DISPLAY_P3, curves=(SRGB_CURVE,) * 3, pcs: bytes = b"XYZ ") -> bytes:
    if space == b"GRAY":
        tags = {b"kTRC": curves[0]}
    else:
        tags = {name: b"XYZ \0\0\0\0" + fixed(*xyz)
                for name, xyz in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)}
        tags |= dict(zip((b"rTRC", b"gTRC", b"bTRC"), curves, strict=True))
    table, body = struct.pack(">I", len(tags)), b""
    for name, value in tags.items():
        value += b"\0" * (-len(value) % 4)
        table += struct.pack(">4sII", name, 132 + 12 * len(tags) + len(body), len(value))
        body += value
    size = 128 + len(table) + len(body)
    header = struct.pack(">I4xI4s4s4s12x4s", size, 0x04000000, b"mntr", space, pcs, b"acsp").ljust(128, b"\0")
    return header + table + body


def all_levels(bits: int) -> np.ndarray:
    return np.arange(1 << bits, dtype=np.uint8 if bits == 8 else np.uint16).reshape(-1, 1, 1)


@pytest.mark.parametrize("bits", [8, 16])
def test_every_srgb_level_survives_the_round_trip(bits: int) -> None:
    levels = all_levels(bits)
    assert np.array_equal(encode(decode(levels), bits), levels)


def test_srgb_decodes_as_the_standard_says() -> None:
    coded = np.array([0, 10, 11, 128, 255], np.uint8).reshape(1, -1, 1)
    x = coded / 255.0
    expected = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    assert np.allclose(decode(coded), expected, rtol=2e-6, atol=0)
    assert decode(coded).dtype == np.float32
    # both depths mean the same light
    assert np.array_equal(decode(coded), decode(coded.astype(np.uint16) * 257))


def test_encoding_rounds_to_the_nearest_level_and_clips() -> None:
    light = np.array([-1.0, np.nan, 0.0, 1.0, 7.0, np.inf], np.float32).reshape(1, -1, 1)
    assert encode(light, 8).ravel().tolist() == [0, 0, 0, 255, 255, 255]
    assert encode(light, 16).ravel().tolist() == [0, 0, 0, 65535, 65535, 65535]
    random = np.random.default_rng(1).random((50, 60, 3), dtype=np.float32)
    exact = np.where(random <= 0.0031308, random * 12.92, 1.055 * np.float64(random) ** (1 / 2.4) - 0.055)
    assert np.abs(encode(random, 8) - exact * 255).max() < 0.505
    assert np.abs(encode(random, 16) - exact * 65535).max() < 0.55


def test_blocks_meet_without_a_seam() -> None:
    light = np.linspace(0, 1, 3_000_000, dtype=np.float32).reshape(1000, 1000, 3)
    assert (np.diff(encode(light, 16).ravel().astype(np.int32)) >= 0).all()


@pytest.mark.parametrize(("curve", "formula"), [
    (para(0, 2.2), lambda x: x**2.2),
    (para(1, 2.0, 1.25, -0.25), lambda x: np.where(x >= 0.2, np.maximum(1.25 * x - 0.25, 0) ** 2, 0)),
    (para(2, 2.0, 0.9, 0.0, 0.1), lambda x: (0.9 * x) ** 2 + 0.1),
    (SRGB_CURVE, lambda x: np.where(x >= 0.04045, ((x + 0.055) / 1.055) ** 2.4, x / 12.92)),
    (para(4, 2.0, 0.9, 0.1, 0.2, 0.1, 0.0, 0.01), lambda x: np.where(x >= 0.1, (0.9 * x + 0.1) ** 2, 0.2 * x + 0.01)),
    (curv(), lambda x: x),
    (curv(round(1.8 * 256)), lambda x: x ** (round(1.8 * 256) / 256)),
    (curv(0, 6554, 65535), lambda x: np.interp(x, (0, 0.5, 1), (0, 6554 / 65535, 1))),
])
def test_every_kind_of_profile_curve(curve: bytes, formula) -> None:
    profile = parse_icc(icc(curves=(curve,) * 3))
    assert profile is not None and len(profile.curves) == 1
    x = np.linspace(0, 1, 256)
    assert np.allclose(decode(all_levels(8), profile.curves).ravel(), np.clip(formula(x), 0, 1), atol=5e-5)
    if formula(1.0) == 1:
        assert profile.curves[0].table[-1] == 1, "white is white"


@pytest.mark.parametrize("curve", [
    para(0, 1.0), para(0, 1.8), para(0, 2.2), para(0, 2.6), SRGB_CURVE, curv(0, 9000, 65535)])
@pytest.mark.parametrize("bits", [8, 16])
def test_every_level_survives_through_a_profile(curve: bytes, bits: int) -> None:
    profile = parse_icc(icc(curves=(curve,) * 3))
    assert profile is not None
    levels = all_levels(bits)
    back = encode(decode(levels, profile.curves), bits, profile.curves)
    assert np.abs(back.astype(np.int32) - levels).max() <= (0 if bits == 8 else 1)


def test_channels_keep_their_own_curves() -> None:
    coded = np.full((2, 2, 3), 51, np.uint8)
    for gammas in ((1.0, 2.0, 3.0), (1.0, 2.0, 1.0)):
        profile = parse_icc(icc(curves=tuple(para(0, gamma) for gamma in gammas)))
        assert profile is not None
        assert np.allclose(decode(coded, profile.curves)[0, 0], np.power(0.2, gammas), atol=1e-5)
        assert np.array_equal(encode(decode(coded, profile.curves), 8, profile.curves), coded)


def test_matrix_leads_to_linear_srgb() -> None:
    same = parse_icc(icc(primaries=SRGB))
    assert same is not None and np.allclose(same.to_srgb, np.eye(3), atol=5e-4)
    wider = parse_icc(icc(primaries=DISPLAY_P3))
    assert wider is not None
    # Display P3 to sRGB, from the primaries and white points of both (they share D65)
    expected = [[1.2249, -0.2247, 0], [-0.0420, 1.0419, 0], [-0.0197, -0.0786, 1.0979]]
    assert np.allclose(wider.to_srgb, expected, atol=2e-3)
    assert np.allclose(wider.to_srgb.sum(axis=1), 1, atol=1e-3), "white stays white"


def test_gray_profiles_are_their_curve() -> None:
    profile = parse_icc(icc(b"GRAY", curves=(para(0, 2.0),)))
    assert profile is not None and profile.gray
    assert np.allclose(decode(np.full((1, 1, 1), 51, np.uint8), profile.curves), 0.04, atol=1e-5)


@pytest.mark.parametrize("profile", [
    b"", b"x" * 500, icc(b"CMYK"), icc(pcs=b"Lab "), icc(primaries=((0, 0, 0),) * 3),
    icc(curves=(b"mft2" + bytes(40),) * 3), icc(curves=(curv(30000, 30000),) * 3),
    icc(curves=(curv(65535, 30000, 0),) * 3), icc(curves=(para(9, 1),) * 3), icc()[:300],
])
def test_other_profiles_are_not_understood(profile: bytes) -> None:
    assert parse_icc(profile) is None


def test_channels_of_a_profile() -> None:
    assert [icc_channels(one) for one in (icc(), icc(b"GRAY"), icc(b"CMYK"), b"", bytes(200))] == [3, 1, 0, 0, 0]


@settings(max_examples=150)
@given(st.lists(st.tuples(st.integers(0, 470), st.integers(0, 255)), min_size=1, max_size=6), st.integers(0, 480))
def test_damaged_profiles_never_raise(changes: list[tuple[int, int]], length: int) -> None:
    damaged = bytearray(icc())
    for at, value in changes:
        damaged[at % len(damaged)] = value
    for bytes_left in (len(damaged), length):
        profile = parse_icc(bytes(damaged[:bytes_left]))
        assert profile is None or np.isfinite(profile.to_srgb).all()


def test_the_srgb_curve_is_shared() -> None:
    assert srgb_curve() is srgb_curve()
