"""Rate–distortion: points of schemes and Bjøntegaard differences of curves."""
