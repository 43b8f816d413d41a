"""The world around the robot: maps, simulated sensors, occupancy."""
