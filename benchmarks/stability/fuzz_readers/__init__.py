"""Structure-aware fuzzing of every reader: mutation of trees, containers and text, and the cases made of them."""
