"""Files of studies and reports of pairs of pictures, as text and charts."""
