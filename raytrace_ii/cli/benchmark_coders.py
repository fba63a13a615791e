"""Coders of the benchmark: schemes of the package, or external commands, for pictures and for takes."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from metrics.benchmark.profile import Profile
    from metrics.benchmark.subject import Subject


def coder_of(
    profile: Profile, scheme: str | None, anchor: str | None, external: tuple[str, str], name: str | None, views: str
) -> tuple[str, dict[str, Any]]:
    """Return the coder's name, and its functions for `metrics.benchmark.result.run`.

    Raises
    ------
    ValueError
        If there is none or more than one, the scheme is unknown, or it codes no takes and the profile has some.
    """
    if sum((scheme is not None, anchor is not None, any(external))) != 1:
        raise ValueError("coder is missing: either --scheme, --anchor or --external is needed")
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
    from metrics.benchmark.external import External

    if not name:
        raise ValueError("name is missing: --name gives the name of the external commands in results")
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
    """Decode what `encode_subject` returned, all frames of it; the answer has ``picture`` and CPU ``seconds``."""
    import codec
    from ii_core import video_of
    from metrics.benchmark.subject import Decoded

    if not isinstance(coded, codec.EncodedTake):
        return codec.timed_decode(coded)
    started = time.process_time()
    video = codec.open_take(coded)
    frames = list(video)
    return Decoded(video_of(frames, fps=video.fps), time.process_time() - started)
