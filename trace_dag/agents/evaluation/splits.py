"""Splits of the crashes into training, validation and test.

Crashes within :data:`SITE_M` of each other, directly or through others, form one site. A site belongs to one part as a
whole, so that no road is both trained and tested on. The part is drawn from the site's first key alone, so the same
crashes are always split alike. An added crash moves another one only if it joins two sites.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from enum import StrEnum
from typing import Final

import numpy as np

SITE_M: Final = 1000.0
_EARTH_M: Final = 6_371_009.0  # mean radius, IUGG
_SHARES: Final = (0.6, 0.8)  # up to the first train, up to the second validation


class Split(StrEnum):
    """The parts of a benchmark."""

    TRAIN = "train"
    VALIDATION = "validation"
    TEST = "test"


def splits_of(places: Mapping[str, tuple[float, float]]) -> dict[str, Split]:
    """Return the part of each crash by key, from reported latitudes and longitudes (degrees).

    >>> splits_of({"2012-1": (35.0, -110.0), "2013-9": (35.001, -110.0)})  # 111 m apart: one site
    {'2012-1': <Split.TRAIN: 'train'>, '2013-9': <Split.TRAIN: 'train'>}
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    keys = sorted(places)
    if not keys:
        return {}
    latitude, longitude = np.radians([places[key] for key in keys]).T
    on_sphere_m = _EARTH_M * np.column_stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    pairs = cKDTree(on_sphere_m).query_pairs(SITE_M, output_type="ndarray")
    near = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(keys), len(keys)))
    _, sites = connected_components(near, directed=False)
    first: dict[int, str] = {}
    for key, site in zip(keys, sites, strict=True):
        first.setdefault(int(site), key)
    return {key: _drawn(first[int(site)]) for key, site in zip(keys, sites, strict=True)}


def _drawn(key: str) -> Split:
    share = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big") / 2**64
    train, validation = _SHARES
    return Split.TRAIN if share < train else Split.VALIDATION if share < validation else Split.TEST
