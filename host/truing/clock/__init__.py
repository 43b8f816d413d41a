"""The board's clock related to this computer's."""
