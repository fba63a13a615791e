"""Random access to takes of `si-lf`: views decoded to show one view at one instant."""

from __future__ import annotations

import numpy as np

from ..checks import check_type, whole, whole_pair
from ..coders.lf.coder import MOST_VIEWS, LightField
from ..coders.lf.pyramid import batches, pyramid
from .order import MOST_FRAMES, AccessCost, Plan


def light_field_cost(plan: Plan, ei_pixels: tuple[int, int], instants: int) -> AccessCost:
    """Return the cost of one sub-image of a take coded by ``si-lf`` at its default stride.

    Of each earlier instant of its segment the levels up to that of the view are decoded, of its own instant the
    views up to its batch.

    Parameters
    ----------
    plan : Plan
        Segments of the take.
    ei_pixels : (int, int)
        Columns U and rows V of views.
    instants : int
        Pictures of the take.

    Returns
    -------
    AccessCost
        Mean and worst number of views decoded, over all views and instants.

    Raises
    ------
    TypeError, ValueError
        If an argument is of another type or out of range.

    Notes
    -----
    Counted from the order of coding: the pyramid of views (`codec.coders.lf.pyramid`) and the segments of the plan.
    """
    check_type("plan", plan, Plan, "a Plan")
    cols, rows = (whole("ei_pixels", side, 1, MOST_VIEWS) for side in whole_pair("ei_pixels", ei_pixels))
    whole("ei_pixels (views)", rows * cols, 1, MOST_VIEWS)
    whole("instants", instants, 1, MOST_FRAMES // (rows * cols))
    own, before = [], []  # of each view
    done = 0
    for level in pyramid(rows, cols, int(LightField.options["stride"].default), 1, 0):
        end = done + len(level)
        for batch in batches(level):
            done += len(batch)
            own += len(batch) * [done]
            before += len(batch) * [end]
    each = [np.array(own) + at * np.array(before) for part in plan.segments(instants) for at in range(len(part))]
    costs = np.concatenate(each)
    return AccessCost(mean=float(costs.mean()), worst=int(costs.max()))
