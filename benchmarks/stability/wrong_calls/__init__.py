"""Wrong calls of every public function: good calls, wrong values, and classification of the errors."""
