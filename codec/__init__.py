"""Coding: II-pictures to bitstreams and back, by pseudo video sequences and by JPEG 2000."""

from .access import decode_component, decode_frame
from .analysis import analyse_orders
from .aom import Avif
from .base import options, parse_scheme, register, schemes
from .coded import Encoded, decode, encode, timed_decode
from .ffv1 import Ffv1
from .jpeg2000 import Jpeg2000
from .mpeg2 import Mpeg2
from .sperr import Sperr
from .still import Htj2k, Jpeg, JpegXl
from .streams import extract
from .svtav1 import Av1
from .volume import Separate, Volume
from .vp9 import Vp9
from .x264 import H264
from .x265 import Hevc

for _kind in ("ei", "si", "ri"):
    for _video in (H264, Hevc, Av1, Vp9, Ffv1):
        register(_video(_kind))
for _coder in (Mpeg2("ei"), Mpeg2("si"), Jpeg2000(), Jpeg(), JpegXl(), Htj2k()):
    register(_coder)
for _kind in ("ei", "si", "ri"):
    register(Volume(_kind))
register(Separate("si"))
register(Sperr("si"))
register(Avif("si"))

__all__ = [
    "Encoded",
    "analyse_orders",
    "decode",
    "decode_component",
    "decode_frame",
    "encode",
    "extract",
    "options",
    "parse_scheme",
    "schemes",
    "timed_decode",
]
