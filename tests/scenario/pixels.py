"""Drawn pictures as numbers."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageColor

from trace_dag.pages.canvas import pixels_of
from trace_dag.pages.pictures import WIDTH_PX


def drawn(svg: str, width_px: int = WIDTH_PX) -> Image.Image:
    """An SVG as pixels."""
    return pixels_of(svg, width_px).convert("RGB")


def rgb(colour: str) -> np.ndarray:
    """A colour as CSS has it, three numbers from 0 to 1."""
    return np.array(ImageColor.getrgb(colour)[:3]) / 255


def of_colour(picture: Image.Image, colour: str) -> np.ndarray:
    """Column and row of every pixel of about that colour, shape (n, 2)."""
    off = np.abs(np.asarray(picture.convert("RGB"), float) / 255 - rgb(colour)).max(axis=2)
    return np.argwhere(off < 0.12)[:, ::-1]
