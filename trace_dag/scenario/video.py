"""Frames as an MP4 that plays everywhere: H.264, through PyAV, which brings its own FFmpeg. The extra ``mp4``."""

from __future__ import annotations

import io
from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from trace_dag.errors import UserError

if TYPE_CHECKING:
    from PIL.Image import Image

_QUALITY = "23"  # constant rate factor of x264, 0 to 51: its default, lines stay sharp


def encode_mp4(frames: Iterable[Image], frames_per_s: int) -> bytes:
    """The frames, all of one size, as a video; a last row or column of odd sizes is cut off, as 4:2:0 colour needs.

    Frames are taken one after the other and not kept. Raises :class:`UserError` where PyAV is missing.

    >>> from PIL import Image
    >>> encode_mp4([Image.new("RGB", (64, 64))], 25)[4:8]  # the box that an MP4 begins with (ISO 14496-12)
    b'ftyp'
    """
    try:
        import av
    except ImportError as error:
        raise UserError(
            "MP4 needs PyAV: pip install 'trace-dag[mp4]', or take the replay as html, webp or gif"
        ) from error

    following = iter(frames)
    first = next(following)
    stream = io.BytesIO()
    with av.open(stream, "w", format="mp4") as container:
        video = container.add_stream("libx264", rate=Fraction(frames_per_s), options={"crf": _QUALITY})
        video.width, video.height = first.width // 2 * 2, first.height // 2 * 2
        video.pix_fmt = "yuv420p"
        for picture in chain((first,), following):
            pixels = np.asarray(picture)[: video.height, : video.width]
            container.mux(video.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(video.encode())
    return stream.getvalue()
