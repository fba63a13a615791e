"""Coding: II-pictures to bitstreams and back, by pseudo video sequences and by JPEG 2000."""

from .analysis import analyse_orders
from .base import options, parse_scheme, register, schemes
from .coded import Encoded, decode, encode, timed_decode
from .jpeg2000 import Jpeg2000
from .video import H264
from .volume import Separate, Volume

for _coder in (H264("ei"), H264("si"), H264("ri"), Jpeg2000()):
    register(_coder)
for _kind in ("ei", "si", "ri"):
    register(Volume(_kind))
register(Separate("si"))

__all__ = ["Encoded", "analyse_orders", "decode", "encode", "options", "parse_scheme", "schemes", "timed_decode"]
