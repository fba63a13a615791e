"""Display: views, quilts, lenticular panels, films and the viewer page."""
