"""Wrong arguments of the public functions of codec: errors that name the argument, before any work."""

import numpy as np
import pytest

from codec import (
    Encoded,
    access_cost,
    analyse_orders,
    decode,
    decode_component,
    decode_frame,
    encode,
    extract,
    options,
    parse_scheme,
    timed_decode,
)
from codec.inspect.header_bits import coarsest, floor, parts
from ii_core import IIPicture

PICTURE = IIPicture(np.zeros((4, 6, 3), np.uint8), (3, 2), (2, 2))
CODED = encode(PICTURE, "si-h264", qp=40)
# Good arguments of every function, by name.
CALLS = {
    "encode": (encode, {"picture": PICTURE, "scheme": "si-h264", "bpp": 1.0}),
    "encode by quantiser": (encode, {"picture": PICTURE, "scheme": "si-h264", "qp": 40}),
    "encode by quality": (encode, {"picture": PICTURE, "scheme": "jpeg", "quality": 40}),
    "decode": (decode, {"coded": CODED, "max_pixels": 100}),
    "timed_decode": (timed_decode, {"coded": CODED, "max_pixels": 100}),
    "decode_frame": (decode_frame, {"coded": CODED, "index": 0}),
    "access_cost": (access_cost, {"coded": CODED, "place": (0, 0)}),
    "decode_component": (decode_component, {"coded": CODED, "place": (0, 0)}),
    "extract": (extract, {"coded": CODED}),
    "options": (options, {"scheme": "jpeg"}),
    "parse_scheme": (parse_scheme, {"scheme": "jpeg"}),
    "analyse_orders": (analyse_orders, {"picture": PICTURE, "kinds": ("si",), "orders": ("row",)}),
    "parts": (parts, {"coded": CODED}),
    "floor": (floor, {"scheme": "si-h264", "lenses": (2, 2), "ei_pixels": (2, 2)}),
    "coarsest": (coarsest, {"picture": PICTURE, "scheme": "si-h264"}),
    "load": (Encoded.load, {"path": ""}),
    "save": (CODED.save, {"path": ""}),
}
EMPTY = ((), {}, set())
WRONG = [
    *(None, True, 3, -1, 1.5, float("nan"), 10**400, b"x", object(), np.zeros(3)),
    *((1,), (1, None), ("a", "b"), [[1, 2]], *EMPTY),
]
# Of these, values that are right after all.
RIGHT = {
    ("encode", "bpp"): (3, 1.5),
    ("encode by quantiser", "qp"): (3,),
    ("encode by quality", "quality"): (3, 1.5),
    ("decode_frame", "index"): (3,),
    ("analyse_orders", "kinds"): EMPTY,
    ("analyse_orders", "orders"): EMPTY,
}
SAID = {"kinds": "kinds|component image", "orders": "orders?"}


@pytest.mark.parametrize(("call", "name"), [(call, name) for call, (_, given) in CALLS.items() for name in given])
def test_wrong_arguments_are_named(call, name, tmp_path):
    function, given = CALLS[call]
    if call == "extract":
        given = given | {"path": tmp_path / "x.mkv"}
    for value in WRONG:
        if not any(value is right for right in RIGHT.get((call, name), ())):
            with pytest.raises((TypeError, ValueError), match=rf"\b({SAID.get(name, name)})\b"):
                function(**given | {name: value})
