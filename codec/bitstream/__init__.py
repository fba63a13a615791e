"""Bitstream parsing and framing; nothing here encodes or decodes."""
