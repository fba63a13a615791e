"""Coding of II-pictures: pseudo video sequences, volumes, light fields and whole pictures."""

from .api import Encoded, decode, encode, timed_decode
from .coders.ffv1 import Ffv1
from .coders.forman import Forman
from .coders.jpeg2000 import Jpeg2000
from .coders.lf.coder import LightField
from .coders.libaom import Avif
from .coders.mpeg2 import Mpeg2
from .coders.stills import Htj2k, Jpeg, JpegXl
from .coders.svtav1 import Av1
from .coders.volume import Separate, Volume
from .coders.vp9 import Vp9
from .coders.x264 import H264
from .coders.x265 import Hevc
from .contract import Coder, Goal, Option, general_scheme, options, parse_scheme, register, schemes
from .inspect.extract import extract
from .inspect.order_analysis import analyse_orders
from .inspect.progressive import DecodedView, Stage, decode_levels, decode_view
from .inspect.random_access import access_cost, decode_component, decode_frame
from .search import Axis, CodingResult, Run, meet_size
from .takes.api import EncodedTake, encode_take, open_take
from .takes.coding import codes_takes
from .takes.container import DamagedTake, is_take
from .takes.field_cost import light_field_cost
from .takes.header import TakeFloor, take_floor
from .takes.order import AccessCost, Plan, component_cost, view_cost

for _kind in ("ei", "si", "ri"):
    for _video in (H264, Hevc, Av1, Vp9, Ffv1):
        register(_video(_kind))
for _coder in (Mpeg2("ei"), Mpeg2("si"), Jpeg2000(), Jpeg(), JpegXl(), Htj2k()):
    register(_coder)
for _kind in ("ei", "si", "ri"):
    register(Volume(_kind))
register(Separate("si"))
register(Avif("si"))
register(LightField())
register(Forman())

__all__ = [
    "AccessCost",
    "Axis",
    "Coder",
    "CodingResult",
    "DamagedTake",
    "DecodedView",
    "Encoded",
    "EncodedTake",
    "Goal",
    "Option",
    "Plan",
    "Run",
    "Stage",
    "TakeFloor",
    "access_cost",
    "analyse_orders",
    "codes_takes",
    "component_cost",
    "decode",
    "decode_component",
    "decode_frame",
    "decode_levels",
    "decode_view",
    "encode",
    "encode_take",
    "extract",
    "general_scheme",
    "is_take",
    "light_field_cost",
    "meet_size",
    "open_take",
    "options",
    "parse_scheme",
    "register",
    "schemes",
    "take_floor",
    "timed_decode",
    "view_cost",
]
