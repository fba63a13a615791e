"""Analysis of coded pictures: header portion, random access, extraction, orders of frames."""
