"""Where the contexts of each syntax element begin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SPLIT = 0  # block size 3 × smaller neighbours 3
SYNTHESIS = SPLIT + 9  # block size 4 × such neighbours 3
INTRA = SYNTHESIS + 12  # such neighbours 3
INTRA_MODE = INTRA + 3  # most probable, second, smooth
MERGE = INTRA_MODE + 3  # block size 4 × (synthesis by left: none, same, other 3; left; above)
DELTA = MERGE + 20  # 14 digits and 1 sign
SAME_MASK = DELTA + 15  # where the index is from: coded, synthesis, left, above 4 × left and above alike 2
MASK = SAME_MASK + 8  # references 4 × reference 4 × any set before 2
RESIDUAL = MASK + 32  # block size 4 × (synthesis, else) 2 × such neighbours 3
CODED = RESIDUAL + 24  # plane 3 × block size 4 × intra or not 2 × first plane coded 2
LAST = CODED + 48  # plane 3 × block size 4 × 12 digits
SIGNIFICANT = LAST + 144  # plane 3 × block size 4 × place 4 × neighbourhood 6
ABOVE_ONE = SIGNIFICANT + 288  # plane 3 × neighbourhood 6 × at the mean 2
ABOVE_TWO = ABOVE_ONE + 36
REST = ABOVE_TWO + 36  # plane 3 × 16 digits
BLEND = REST + 48
COUNT = BLEND + 1

# Probabilities to begin with: log(p / (1 - p)) from -6.2 up in steps of 0.2, by its digit; * where none is known. The
# mean over eight coded pictures: three scenes and a flower of a real light field camera, at two quantisers each.
DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
STARTS = (
    "TVWldal**KRT9NWCOZN**EPWMNGZcPeeYfQfgZeRihN****TDJOF*********WONSVQXSU********Z**P****Z*fV*O**X*ZUaV"
    "*VXYlVZeHVjRaqbQ*ajg***I**o*s*t*t*s*n*****lUiceaWl*W*i****LKRWSRUf*Q*l****zurU0*******twyroT2*****qt"
    "tttrrS8***************noiP1*******oroniL4*****nrrrpkjKE***************llfN4*******nronlM5*****jpplnm"
    "pJB***************WWYYYcRVWXZbUYZZbc******RWYXYcOVWYZdQVWYYdQXXZZbOWUWUgITTVXaLQWYXbOVYYZb**********"
    "**************VWWWYdOUVWZcPVXZac******TVVXYcQVUWYdNRTWXaLRUVYaOSUVagRSVWXdMSVWXcJPTUXb**************"
    "**********VXWXYeOTUVWZOUUVZa******QWWWYfMSUVWaKQTVXaKRTUYXMTTXWgONRXXdNQUWYaKQUVWY******************"
    "******RSOKRMROURVWKNGKKMNPOQSXHMDJGLKQPRTXRQQQPPRPSRTVLQLONPOQOSTWLRLPMQNQNTSYROLKLPMMQ*******RPMLNN"
    "OQ********SPMNIUK*********E"
)
PROBABILITIES = (
    133,
    162,
    198,
    241,
    295,
    360,
    439,
    535,
    652,
    795,
    968,
    1179,
    1434,
    1743,
    2117,
    2567,
    3108,
    3757,
    4531,
    5451,
    6537,
    7812,
    9296,
    11009,
    12964,
    15170,
    17625,
    20318,
    23222,
    26300,
    29502,
    32768,
    36034,
    39236,
    42314,
    45218,
    47911,
    50366,
    52572,
    54527,
    56240,
    57724,
    58999,
    60085,
    61005,
    61779,
    62428,
    62969,
    63419,
    63793,
    64102,
    64357,
    64568,
    64741,
    64884,
    65001,
    65097,
    65176,
    65241,
    65295,
    65338,
    65374,
)  # of each digit, in 2^-16
TRUSTED = 4  # bits that such a beginning counts as


def starting_contexts() -> NDArray[np.int32]:
    """Contexts (COUNT, 3) at the beginning of a stream: two probabilities in 2^-16, and bits seen."""
    # Whole probabilities of every digit: decoders need not agree on an exponential function.
    found = np.array(
        [(*(2 * [PROBABILITIES[DIGITS.index(d)]]), TRUSTED) if d != "*" else (1 << 15, 1 << 15, 0) for d in STARTS]
    )
    return found.astype(np.int32)
