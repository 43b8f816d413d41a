"""Figures of the product, each measured here and set beside its peer."""
