"""Wrong calls of every public function: good calls of each, wrong values, and the judgement of their errors."""
