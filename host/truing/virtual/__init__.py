"""Virtual boards inside this process: made from what the user chose, alone or on a CAN bus."""
