"""Coders of the benchmark: schemes of the package, or external commands, for pictures and for takes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metrics.benchmark.profile import Profile
    from metrics.benchmark.subject import Subject


def coder_of(
    profile: Profile, scheme: str | None, anchor: str | None, external: tuple[str, str], decoded: Path | None,
    name: str | None, views: str,
) -> tuple[str, dict[str, Any]]:  # fmt: skip
    """Return the coder's name, and its functions for `metrics.benchmark.result.run`.

    Raises
    ------
    ValueError
        If there is none or more than one, the scheme is unknown, or it codes no takes and the profile has some.
    """
    if sum((scheme is not None, anchor is not None, decoded is not None, any(external))) != 1:
        raise ValueError("coder is missing: either --scheme, --anchor, --external or --decoded is needed")
    if anchor is not None:
        return _anchor(profile, anchor, name)
    if scheme is not None:
        import codec

        if name is not None:
            raise ValueError(f"name is {name!r}: only --external takes a name, a scheme has its own")
        codes_takes = codec.codes_takes(scheme)  # raises ValueError for an unknown scheme, before rendering
        if takes := [reference.name for reference in profile.pictures if reference.frames and not codes_takes]:
            raise ValueError(f"scheme {scheme} codes no takes: {takes[0]} of profile {profile.name} is one")
        return scheme, {"encode": encode_subject, "decode": decode_subject}
    if not name:
        raise ValueError("name is missing: --name gives the name of the coder in results")
    if decoded is not None:
        from metrics.benchmark.delivered import Delivered

        views_of = Delivered(decoded, views, profile.rate_tolerance)
        return name, {"encode": views_of.encode, "decode": views_of.decode, "named": views_of.named}
    from metrics.benchmark.external import External

    encoder, decoder = external
    tool = External(
        encoder=encoder, decoder=decoder, kind=views, seconds=profile.seconds, rate_tolerance=profile.rate_tolerance
    )
    return name, {"encode": tool.encode, "decode": tool.decode, "commands": [encoder, decoder]}


def _anchor(profile: Profile, anchor: str, name: str | None) -> tuple[str, dict[str, Any]]:
    """Return `coder_of` of an anchor; its command with a quantiser of q stands in the result."""
    from metrics.benchmark.anchor_coder import AnchorCoder, versions
    from metrics.benchmark.anchors import ANCHORS

    if name is not None:
        raise ValueError(f"name is {name!r}: only --external takes a name, an anchor has its own")
    tool = AnchorCoder(anchor, profile.rate_tolerance)
    if takes := [reference.name for reference in profile.pictures if reference.frames]:
        raise ValueError(f"anchor {anchor} codes no takes: {takes[0]} of profile {profile.name} is one")
    told = " ".join(f"{library} {version}" for library, version in versions().items())
    return anchor, {"encode": tool.encode, "decode": tool.decode, "commands": [ANCHORS[anchor].encoder, told]}


def encode_subject(subject: Subject, scheme: str, *, bpp: float) -> Any:
    """Code a picture, or a video as a take."""
    import codec
    from ii_core import IIVideo

    if isinstance(subject, IIVideo):
        return codec.encode_take(subject, scheme, bpp=bpp)
    return codec.encode(subject, scheme, bpp=bpp)


def decode_subject(coded: Any) -> Any:
    """Decode what `encode_subject` returned, all frames of it; of sub-images the middle view alone, too."""
    import codec
    from ii_core import video_of
    from metrics.benchmark.subject import Decoded

    if not isinstance(coded, codec.EncodedTake):
        answer = codec.timed_decode(coded)
        return Decoded(answer.picture, answer.seconds, more=_middle_view(coded))
    started = time.process_time()
    video = codec.open_take(coded)
    frames = list(video)
    return Decoded(video_of(frames, fps=video.fps), time.process_time() - started)


def _middle_view(coded: Any) -> dict[str, float]:
    """Return bytes and CPU seconds that it takes to reach the middle view; empty if the scheme reaches none alone."""
    import codec

    if not coded.scheme.startswith("si-"):
        return {}
    columns, rows = coded.structure["ei_pixels"]
    cost = codec.access_cost(coded, (columns // 2, rows // 2))
    return {} if cost is None else {"view_nbytes": cost[0], "view_seconds": cost[1]}
