"""Light-field coder: views on a grid, predicted from each other by disparity."""
