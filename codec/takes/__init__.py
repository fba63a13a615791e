"""II-video: orders over view and time, coding, random access."""
