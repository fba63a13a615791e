"""A coder of light fields: views on a grid, predicted from each other by disparity."""
