"""Places of a pixel's samples that miss least of an edge, for up to 16 samples.

The sets minimise the mean square of the error over straight edges, which for edges of all angles is the energy
distance of the samples to the square (support points: Mak and Joseph 2018); two fifths of the weight are on edges
along rows and columns. ``benchmarks.accuracy.sample_places`` finds them and measures their errors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST = 16

# Thousandths of the pixel, x and y, the sample nearest to the centre first. Of 4 and 8 samples each quarter of the
# pixel has as many, of 16 each sixteenth has one.
_FIXED = {
    1: "500 500",
    2: "279 279, 721 721",
    3: "444 175, 825 556, 218 782",
    4: "155 366, 845 634, 634 155, 366 845",
    5: "500 500, 714 874, 874 286, 126 714, 286 126",
    6: "590 441, 242 214, 421 889, 111 602, 885 742, 764 115",
    7: "508 516, 185 370, 797 206, 620 904, 904 636, 365 87, 119 791",
    8: "671 550, 329 450, 426 905, 574 94, 825 820, 175 180, 912 299, 88 701",
    9: "613 494, 306 401, 394 833, 495 84, 142 735, 919 602, 836 178, 729 913, 76 253",
    10: "566 424, 456 651, 150 556, 366 152, 859 733, 918 358, 648 930, 223 865, 741 80, 79 238",
    11: "418 491, 672 325, 327 710, 759 595, 126 413, 508 68, 585 926, 207 140, 886 211, 930 786, 78 856",
    12: ("397 551, 619 381, 200 438, 558 803, 794 622, 427 134, 890 300, 116 718, 293 941, 719 62, 73 188, 923 871"),
    13: (
        "501 413, 342 657, 734 498, 651 729, 282 293, 893 338, 443 62, 63 582, 564 947, 798 111, 185 884, "
        "104 183, 940 807"
    ),
    14: (
        "535 544, 464 310, 259 470, 614 752, 764 408, 397 888, 670 110, 55 610, 938 663, 175 835, 107 "
        "237, 316 56, 903 184, 815 939"
    ),
    15: (
        "579 470, 502 647, 280 574, 248 305, 765 688, 691 237, 446 157, 355 844, 899 376, 45 449, 640 "
        "950, 162 92, 954 775, 102 883, 836 53"
    ),
    16: (
        "594 593, 345 467, 644 339, 452 728, 804 542, 282 229, 529 145, 163 655, 722 860, 88 397, 909 "
        "294, 409 950, 832 87, 952 790, 199 45, 63 889"
    ),
}
# The first 4 and 8 of these 16 are nearly as good; each four in turn have one in each quarter of the pixel.
_DOUBLING = (
    "282 229, 909 294, 163 655, 722 860, 88 397, 529 145, 409 950, 804 542, 199 45, 832 87, 452 728, "
    "594 593, 345 467, 644 339, 63 889, 952 790"
)


def fixed_places(samples: int) -> NDArray[np.float64]:
    """Return the places (samples, 2) of so many samples of a pixel, in [0, 1)²; none if they are more than `MOST`."""
    return _table(_FIXED.get(samples, ""))


def doubling_places(most: int) -> NDArray[np.float64]:
    """Return places of which the first 4, 8 … ``most`` are samples of a pixel, in [0, 1)²; none if too many."""
    return _table(_DOUBLING if most <= MOST else "")


def _table(thousandths: str) -> NDArray[np.float64]:
    return np.array(thousandths.replace(",", "").split(), np.float64).reshape(-1, 2) / 1000
