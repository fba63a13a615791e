"""Where the contexts of each syntax element begin."""

from __future__ import annotations

SPLIT = 0  # block size 3 × smaller neighbours 3
SYNTHESIS = SPLIT + 9  # block size 4 × such neighbours 3
INTRA = SYNTHESIS + 12  # such neighbours 3
INTRA_MODE = INTRA + 3  # most probable, second, smooth
MERGE = INTRA_MODE + 3  # synthesis, left, above
DELTA = MERGE + 3  # 14 digits and 1 sign
SAME_MASK = DELTA + 15  # 2
MASK = SAME_MASK + 2  # references 4 × reference 4 × any set before 2
RESIDUAL = MASK + 32  # block size 4 × (synthesis, else) 2 × such neighbours 3
CODED = RESIDUAL + 24  # plane 3 × block size 4 × intra or not 2 × first plane coded 2
LAST = CODED + 48  # luminance or not 2 × block size 4 × 12 digits
SIGNIFICANT = LAST + 96  # luminance or not 2 × block size 4 × place 4 × neighbourhood 6
ABOVE_ONE = SIGNIFICANT + 192  # luminance or not 2 × neighbourhood 6 × at the mean 2
ABOVE_TWO = ABOVE_ONE + 24
REST = ABOVE_TWO + 24  # luminance or not 2 × 16 digits
BLEND = REST + 32
COUNT = BLEND + 1
