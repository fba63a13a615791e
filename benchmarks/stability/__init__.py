"""Where methods fail, hunted: one function a case, each giving rows of measured numbers."""
