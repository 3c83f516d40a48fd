"""Pictures to a film that browsers play, H.264 in MP4; the same pictures give the same bytes."""

import tempfile
from collections.abc import Iterable
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import numpy as np
from av.bitstream import BitStreamFilterContext
from av.video.reformatter import Colorspace, Interpolation

QUALITY = {  # x264 decides otherwise with other threads, and with other instructions of the processor
    "preset": "medium",
    "crf": "26",
    "x264-params": "threads=1:lookahead-threads=1:cpu-independent=1",
}
CONTAINER = {
    "movflags": "+faststart",  # playing begins before all is loaded
    "fflags": "+bitexact",  # no date, no version
}
NO_VERSION = "filter_units=remove_types=6"  # x264 puts its version into a unit of type 6
EXACT = Interpolation.BICUBIC | Interpolation.ACCURATE_RND | Interpolation.BITEXACT
BT709 = 1  # what players take high definition for; limited range likewise


def encoded(pictures: Iterable[np.ndarray], rate: Fraction) -> bytes:
    """The film's file.

    Args:
        pictures: at least one; (height, width, 3) uint8, both even.
        rate: pictures a second.
    """
    pictures = iter(pictures)
    first = next(pictures)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"  # not in memory: to put its index first, FFmpeg opens the file again
        with av.open(str(path), "w", container_options=CONTAINER) as file:
            stream = file.add_stream("libx264", rate=rate, options=QUALITY)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "yuv420p"
            codec = stream.codec_context
            codec.thread_count = 1
            codec.color_range = codec.colorspace = codec.color_primaries = codec.color_trc = BT709
            without_version = BitStreamFilterContext(NO_VERSION, "h264")
            frames = (_frame(picture) for picture in chain([first], pictures))
            for frame in chain(frames, [None]):
                for packet in stream.encode(frame):
                    for kept in without_version.filter(packet):
                        kept.stream = stream
                        file.mux(kept)
        return path.read_bytes()


def _frame(picture: np.ndarray) -> av.VideoFrame:
    return av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(
        format="yuv420p", dst_colorspace=Colorspace.ITU709, interpolation=EXACT, threads=1
    )
