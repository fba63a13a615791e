"""Tables of peers and of speed ratios."""

from benchmarks.pages import readme


def test_ranges_have_one_unit_and_start_at_the_least_gain():
    assert readme.percents([-26.4, -50.2, -39.0]) == "−26 to −50 %"
    assert readme.percents([3.4]) == "+3 %"
    assert readme.percents([-26.4, None]) == readme.percents([]) == readme.NONE
    assert readme.factors([123.2, 75.9]) == "76 to 123 ×"
    assert readme.factors([1.4049, 1.3564]) == "1.4 ×"


def test_a_peer_is_shown_where_all_scenes_have_both_curves():
    rows = {(name, scheme): {} for name in readme.SCENES for scheme in ("si-avif", "si-lf")}
    assert list(readme.paired(rows, "si-avif")) == list(readme.SCENES)
    del rows["cuboid", "si-avif"]
    assert readme.paired(rows, "si-avif") == {}


def test_losses_are_claims_too():
    """Every peer has a line for each size of views that was measured, whatever it says."""
    found = [(peer, scale) for peer, scale, _ in readme.meetings()]
    assert found[:4] == [("AV1", 8), ("AV1", 1), ("HEVC", 8), ("HEVC", 4)]
    lines = readme.peers_table()
    assert sum(": rate" in line for line in lines) == len(found)
    assert sum("decoding" in line for line in lines) == 2
