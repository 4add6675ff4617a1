"""Maps in a few lines of text: the data of the tests of :mod:`trace_dag.osm`."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

ORIGIN = (37.0, -77.0)
LATITUDE_PER_M = 1 / 111_195.0
LONGITUDE_PER_M = LATITUDE_PER_M / 0.79863551  # cos 37 degrees


def place(x_m: float, y_m: float) -> tuple[float, float]:
    """Latitude and longitude some metres east and north of the origin."""
    return ORIGIN[0] + y_m * LATITUDE_PER_M, ORIGIN[1] + x_m * LONGITUDE_PER_M


def node(number: int, x_m: float, y_m: float, **tags: str) -> str:
    """A node at metres east and north of the origin."""
    latitude, longitude = place(x_m, y_m)
    return f'<node id="{number}" version="1" lat="{latitude:.7f}" lon="{longitude:.7f}">{_tags(tags)}</node>'


def way(number: int, nodes: list[int], **tags: str) -> str:
    """A way, residential unless told otherwise; ``__`` in a key stands for a colon."""
    return thing(number, nodes, **{"highway": "residential", **tags})


def thing(number: int, nodes: list[int], **tags: str) -> str:
    """A way that is not a road."""
    refs = "".join(f'<nd ref="{ref}"/>' for ref in nodes)
    return f'<way id="{number}" version="1">{refs}{_tags(tags)}</way>'


def restriction(
    number: int, from_way: int, via: int, to_way: int, kind: str = "no_left_turn", *, via_type: str = "node"
) -> str:
    """A turn restriction via a node, or a way."""
    return (
        f'<relation id="{number}" version="1"><member type="way" ref="{from_way}" role="from"/>'
        f'<member type="{via_type}" ref="{via}" role="via"/><member type="way" ref="{to_way}" role="to"/>'
        f"{_tags({'type': 'restriction', 'restriction': kind})}</relation>"
    )


def document(*elements: str, bounds_m: tuple[float, float, float, float] | None = None) -> bytes:
    """An OSM file; ``bounds_m`` is west, south, east, north of what it says to cover."""
    bounds = ""
    if bounds_m is not None:
        (south, west), (north, east) = place(*bounds_m[:2]), place(*bounds_m[2:])
        bounds = f'<bounds minlat="{south:.7f}" minlon="{west:.7f}" maxlat="{north:.7f}" maxlon="{east:.7f}"/>'
    return f'<?xml version="1.0" encoding="UTF-8"?><osm version="0.6">{bounds}{"".join(elements)}</osm>'.encode()


def save(path: Path, *elements: str, bounds_m: tuple[float, float, float, float] | None = None) -> Path:
    """Write :func:`document` to a file."""
    path.write_bytes(document(*elements, bounds_m=bounds_m))
    return path


def _tags(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key.replace("__", ":")}" v={quoteattr(value)}/>' for key, value in tags.items())
