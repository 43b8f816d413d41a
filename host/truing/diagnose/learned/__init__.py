"""What the catalogue does not hold: an additive correction beside the physics, learned and judged on runs left out."""
