"""What the catalogue does not hold: a correction beside the physics, judged on runs left out."""
