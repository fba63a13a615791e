"""Scene and mesh files: TOML, glTF, OBJ, PLY, STL."""
